"""What tells which measured pair a scene is like."""

from __future__ import annotations

from typing import Any

from fgf_warp.result import RenderResult
from fgf_warp.scene import Scene
from fgf_warp.settings import Aov

FEATURE_AOVS = frozenset({Aov.OPTICAL_DEPTH, Aov.SCATTERINGS})
"""The planes that features are read from."""


def read_features(scene: Scene, result: RenderResult) -> dict[str, Any]:
    """The features of a scene.

    Args:
        scene: any.
        result: a short render of it, with `FEATURE_AOVS`.

    Returns:
        ``optical_depth``, mean of sigma_m times the length of the camera ray's first medium segment, over the pixels
        that have one; ``scatterings``, mean number of events of the paths that have any; and of the first medium
        ``regime``, ``H``, ``g``, ``albedo`` (mean of the channels), ``kappa`` and ``transport``, where there is one.
    """
    depth = result.aovs[Aov.OPTICAL_DEPTH].mean(axis=2)
    scattering = float(result.alpha.sum())
    features: dict[str, Any] = {
        "optical_depth": float(depth[depth > 0].mean()) if (depth > 0).any() else 0.0,
        "scatterings": float(result.aovs[Aov.SCATTERINGS].sum()) / scattering if scattering else 0.0,
    }
    if scene.media:
        medium = scene.media[0]
        features |= {
            "regime": medium.line_law.regime,
            "H": medium.hurst,
            "g": medium.asymmetry,
            "albedo": sum(medium.albedo) / 3,
            "kappa": medium.line_law.kappa,
            "transport": medium.resolved_transport,
        }
    return features
