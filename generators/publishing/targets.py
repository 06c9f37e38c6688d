"""Targets of a sample beyond its parameters: what its law of transmittance says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fgf_warp.scene import Medium
from generators.law import evaluate_law

TRANSMITTANCE, MEAN_FREE_PATH = "transmittance", "mean_free_path"
TARGETS: dict[str, tuple[str, str]] = {
    TRANSMITTANCE: ("mean transmittance of segments of the lengths transmittance_t, from an uncorrelated end", ""),
    "transmittance_t": ("lengths of the segments of transmittance", "unit"),
    MEAN_FREE_PATH: ("mean length of a flight from an uncorrelated end; null where infinite or unknown", "unit"),
}
"""What `compute_targets` gives, with meaning and unit."""


def compute_targets(medium: Medium, targets: Mapping[str, Any]) -> dict[str, Any]:
    """The targets of one sample.

    Args:
        medium: the swept one, by the law that is in force in it, which a grey extinction color goes into.
        targets: that are asked for, as in `PlanMeta`: ``transmittance`` with its lengths [unit] as ``t``, and
            ``mean_free_path``.

    Returns:
        Numbers, lists of numbers, or None, by the names of `TARGETS`.

    Raises:
        ConfigError: for a length that is not finite and >= 0, or beyond where the law ends.
    """
    curve = targets.get(TRANSMITTANCE)
    law = evaluate_law(
        hurst=medium.hurst,
        white_noise_scale=None,
        mean_extinction=medium.line_law.mean_extinction,
        outer_scale=medium.outer_scale,
        kappa=medium.line_law.kappa,
        line_variance=medium.line_variance,
        lengths=curve["t"] if curve else (),
    )
    found = {TRANSMITTANCE: law["transmittance"], "transmittance_t": law["t"]} if curve else {}
    return {**found, MEAN_FREE_PATH: law["mean_free_path"]} if MEAN_FREE_PATH in targets else found
