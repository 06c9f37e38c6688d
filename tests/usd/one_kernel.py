"""Few kernels for many scenes: what a scene does not need may be in its kernel, and changes no image.

What kernels expect to be there, lights above all, is not forced on scenes that have none.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields, replace

from fgf_warp.features import RenderFeatures

OF_LIGHTS = (
    "shaped_lights",
    "distant_lights",
    "environment",
    "dome_image",
    "light_images",
    "shaping",
    "links",
)


def union(of: Iterable[RenderFeatures]) -> RenderFeatures:
    """The least that renders all of them, if all have the same lights."""
    every = list(of)
    merged = {}
    for field in fields(RenderFeatures):
        values = [getattr(features, field.name) for features in every]
        if isinstance(values[0], frozenset):
            merged[field.name] = frozenset().union(*values)
        elif isinstance(values[0], bool):
            merged[field.name] = any(values)
        else:  # Of the lone medium, and the sampler: what they agree on.
            merged[field.name] = values[0] if len(set(values)) == 1 else ""
    return RenderFeatures(**merged)


def with_lights_of(features: RenderFeatures, lit: RenderFeatures) -> RenderFeatures:
    """The features with the lights of others."""
    return replace(features, **{name: getattr(lit, name) for name in OF_LIGHTS})
