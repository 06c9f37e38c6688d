"""What the film has of each pixel, and what a path carries for it: a new plane is a row here.

It also needs its name in `settings.Aov`, and the stage of a path that finds its value.
"""

from collections.abc import Set
from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.numerics import INFINITE
from fgf_warp.integrator.rows import Needs, Row
from fgf_warp.settings import PRIM_AOVS, SPLIT_AOVS, Aov

NOT_SEEN = wp.constant(-1)
"""`seen_item` of a path that has met nothing."""
FIRST_CONTAINER = wp.constant(-2)
"""`seen_item` of the first container; the next ones count down."""


class Plane(NamedTuple):
    """What the film has of each pixel.

    Args:
        name: of the film's array and the tally's field.
        dtype: of the film's array.
        meaning: one line.
        source: the path's field, or what is computed of it.
        rule: how a sample is added, one of `RULES`.
        aovs: it is needed for any of them; where there are none, always.
        initial: of a pixel without samples.
    """

    name: str
    dtype: Any
    meaning: str
    source: str
    rule: str
    aovs: Set[Aov] = frozenset()
    initial: float = 0.0

    def is_needed(self, aovs: Set[Aov]) -> bool:
        """True where it is summed for these planes of the result."""
        return not self.aovs or bool(self.aovs & aovs)

    @property
    def pixel_bytes(self) -> int:
        """Memory that it takes in the film, per pixel."""
        return wp.types.type_size_in_bytes(self.dtype)


RULES = {
    "sum of vectors": "add_where(is_valid, before.{name}, {value})",
    "sum of squares": "before.{name} + square(add_where(is_valid, wp.vec3d(), {value}))",
    "sum": "before.{name} + wp.float64(wp.where(is_valid, {value}, 0.0))",
    "count": "before.{name} + wp.where(is_complete, {value}, 0)",
    "count of invalid": "before.{name} + wp.where(is_complete and not is_valid, 1, 0)",
    "nearest": "wp.min(before.{name}, wp.where(is_valid, {value}, INFINITE))",
    "of the nearest": "wp.where(is_valid and path.seen < before.seen, {value}, before.{name})",
}
"""A tally's field after a sample; what is not finite is left out. Each names what it adds `value`."""

PLANES = (
    Plane("radiance", wp.vec3d, "sum", "path.radiance", "sum of vectors"),
    Plane("radiance_sq", wp.vec3d, "sum of its square", "path.radiance", "sum of squares"),
    Plane("alpha", wp.float64, "sum", "path.alpha", "sum"),
    Plane("invalid", wp.int32, "samples that were not finite, and were left out", "", "count of invalid"),
    Plane("truncated", wp.int32, "paths cut at the bound on their length", "path.truncated", "count"),
    Plane("depth", wp.float32, "the nearest, not a sum", "path.first_depth", "nearest", {Aov.DEPTH}, float("inf")),
    Plane("transmittance", wp.vec3d, "sum", "path.first_transmittance", "sum of vectors", {Aov.TRANSMITTANCE}),
    Plane("optical_depth", wp.vec3d, "sum", "path.first_optical_depth", "sum of vectors", {Aov.OPTICAL_DEPTH}),
    Plane("albedo", wp.vec3d, "sum", "path.first_albedo", "sum of vectors", {Aov.ALBEDO}),
    Plane("normal", wp.vec3d, "sum", "path.first_normal", "sum of vectors", {Aov.NORMAL}),
    Plane("collisions", wp.vec3d, "sum", "path.collisions", "sum of vectors", {Aov.COLLISIONS}),
    Plane("path_length", wp.vec3d, "sum", "path.path_length", "sum of vectors", {Aov.PATH_LENGTH}),
    Plane("scatterings", wp.float64, "sum", "float(path.depth)", "sum", {Aov.SCATTERINGS}),
    Plane("direct", wp.vec3d, "sum", "path.direct", "sum of vectors", SPLIT_AOVS),
    Plane("motion", wp.vec3d, "sum; the third number is 0", "path.first_motion", "sum of vectors", {Aov.MOTION}),
    Plane("seen", wp.float32, "distance of the nearest thing that is seen", "path.seen", "of the nearest",
          PRIM_AOVS, float("inf")),
    Plane("seen_item", wp.int32, "which it is, a path's `seen_item`", "path.seen_item", "of the nearest",
          PRIM_AOVS, NOT_SEEN),
)  # fmt: skip


def shows(*aovs: Aov) -> Needs:
    """Needed for any of these planes."""
    return lambda features: not features.aovs.isdisjoint(aovs)


PLANE_ROWS = (
    Row("first_depth", float, "along the view axis, of what is met first", shows(Aov.DEPTH), initial=INFINITE),
    Row("first_transmittance", wp.vec3, "of the first segment in a medium", shows(Aov.TRANSMITTANCE), initial=1.0),
    Row("first_optical_depth", wp.vec3, "of that segment", shows(Aov.OPTICAL_DEPTH)),
    Row("has_crossed_medium", int, "1 after that segment",
        lambda f: f.crossings and shows(Aov.TRANSMITTANCE, Aov.OPTICAL_DEPTH)(f)),
    Row("first_albedo", wp.vec3, "where it scatters first", shows(Aov.ALBEDO)),
    Row("reflectance", wp.vec3, "colour of the surface that is met", lambda f: f.shading and shows(Aov.ALBEDO)(f)),
    Row("first_normal", wp.vec3, "shading normal of the surface that it meets first", shows(Aov.NORMAL)),
    Row("collisions", wp.vec3, "in media so far, each weighted by the throughput before it",
        lambda f: f.media and shows(Aov.COLLISIONS)(f)),
    Row("path_length", wp.vec3, "in media so far, weighted alike [stage unit]",
        lambda f: f.media and shows(Aov.PATH_LENGTH)(f)),
    Row("direct", wp.vec3, "the part of `radiance` that came before a second scattering event", shows(*SPLIT_AOVS)),
    Row("seen", float, "distance of the surface or of the scattering in a medium that it meets first",
        shows(*PRIM_AOVS), initial=INFINITE),
    Row("seen_item", int, "that surface, or FIRST_CONTAINER less the container", shows(*PRIM_AOVS), initial=NOT_SEEN),
    Row("container", int, "whose medium it scatters in", lambda f: f.looks_up_media and shows(*PRIM_AOVS)(f)),
    Row("seen_at", wp.vec3, "where that is", shows(Aov.MOTION)),
    Row("first_motion", wp.vec3, "how that moves in the image [pixel]", shows(Aov.MOTION)),
)  # fmt: skip
"""Of a path, for the planes."""
