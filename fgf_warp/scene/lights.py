"""Light sources: distant lights, the dome, and lights with an area."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from fgf_warp.errors import SceneError
from fgf_warp.scene.checks import (
    UNIT_ROUNDING,
    check_color,
    check_finite_array,
    check_fraction,
    check_not_negative,
    check_positive,
    check_range,
    check_unit_vector,
    check_vector,
)
from fgf_warp.scene.textures import Image
from fgf_warp.scene.values import BLACK, Rgb, Vec3

MAX_LINKS = 32
"""The most sets of shapes that lights may be linked to: each has one bit in `Solid.light_links` and its like."""
RECT_CORNERS = np.array(list(product((-1.0, 1.0), repeat=2)))
"""(4, 2) float64, of a rect in units of half_u and half_v."""
IMAGE_CORNERS = {*product((0.0, 1.0), repeat=2)}
"""Of an image in s and t."""


@dataclass(frozen=True)
class Shaping:
    """How a light's radiance depends on the direction that it leaves in, as UsdLux.ShapingAPI says.

    Args:
        axis: unit vector in world space that it is centred around.
        cone_angle: half the cone's opening, radians in [0, pi]; nothing is emitted beyond.
        cone_softness: share of the cone's angle over which it fades, in [0, 1].
        focus: power of the cosine with the axis, >= 0.
        focus_tint: colour that the light takes on away from the axis, per channel >= 0.
    """

    axis: Vec3
    cone_angle: float = math.pi
    cone_softness: float = 0.0
    focus: float = 0.0
    focus_tint: Rgb = BLACK

    def __post_init__(self) -> None:
        check_unit_vector("shaping", "axis", self.axis)
        check_range("shaping", "cone_angle", self.cone_angle, "in [0, pi]", lambda x: 0 <= x <= math.pi)
        check_fraction("shaping", "cone_softness", self.cone_softness)
        check_not_negative("shaping", "focus", self.focus)
        check_color("shaping", "focus_tint", self.focus_tint)


@dataclass(frozen=True, eq=False, kw_only=True)
class LightSource:
    """What all lights have, beside a name and a radiance.

    Args:
        link: bit in [0, 32): it shines only on shapes whose `light_links` have it; None: on all, and on all media.
        shadow_link: bit in [0, 32): only shapes whose `shadow_links` have it cast shadows in its light; None: all do.
        shaping: None where it emits evenly.

    Raises:
        SceneError: naming the light, the parameter, its value and the accepted range.
    """

    link: int | None = None
    shadow_link: int | None = None
    shaping: Shaping | None = None

    def _check_source(self, name: str, radiance: Rgb) -> None:
        check_color(name, "radiance", radiance)
        for key in ("link", "shadow_link"):
            bit = getattr(self, key)
            if bit is not None and not 0 <= bit < MAX_LINKS:
                raise SceneError(f"{name}: {key} = {bit}; accepted: in [0, {MAX_LINKS - 1}], or None")


@dataclass(frozen=True)
class DistantLight(LightSource):
    """Light from one direction, or from a cone around it.

    Args:
        name: the prim path.
        direction: unit vector in world space along which the light travels.
        half_angle: of the cone, radians in [0, pi/2]; 0 is a delta light.
        radiance: >= 0 per channel, from within the cone; for half_angle = 0 the irradiance on a surface that faces the
            light.
    """

    name: str
    direction: Vec3
    half_angle: float
    radiance: Rgb

    def __post_init__(self) -> None:
        self._check_source(self.name, self.radiance)
        check_range(self.name, "half_angle", self.half_angle, "in [0, pi/2]", lambda x: 0 <= x <= math.pi / 2)
        check_unit_vector(self.name, "direction", self.direction)


@dataclass(frozen=True)
class DomeLight(LightSource):
    """An environment: of constant radiance, or times an image around the scene.

    Args:
        name: the prim path.
        radiance: >= 0 per channel.
        image: multiplies the radiance, >= 0; it is laid out by longitude and latitude around the light's y axis, as
            the format ``latlong`` of UsdLux.DomeLight says. None: constant.
        light_to_world: three rows of three numbers, an orthogonal matrix that turns the image.
    """

    name: str
    radiance: Rgb
    image: Image | None = None
    light_to_world: tuple[Vec3, Vec3, Vec3] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    def __post_init__(self) -> None:
        self._check_source(self.name, self.radiance)
        _check_light_image(self.name, self.image)
        turn = np.array(self.light_to_world)
        if turn.shape != (3, 3) or not np.allclose(turn @ turn.T, np.eye(3), atol=UNIT_ROUNDING):
            raise SceneError(f"{self.name}: light_to_world = {turn.tolist()}; accepted: an orthogonal 3x3 matrix")

    @property
    def is_plain(self) -> bool:
        """True where it is the same in every direction and for all that it shines on."""
        return self.image is None and self.link is None and self.shadow_link is None and self.shaping is None


@dataclass(frozen=True)
class AreaLight(LightSource):
    """A flat light that emits to the side of ``cross(half_u, half_v)`` and is black behind.

    Args:
        name: the prim path.
        shape: ``rect``, the parallelogram center +- half_u +- half_v, or ``disk``, the ellipse within it.
        center: in world space [stage unit].
        half_u: from the center to the middle of one side [stage unit].
        half_v: from the center to the middle of the next side [stage unit].
        radiance: >= 0 per channel.
        image: multiplies the radiance of a rect, >= 0; None: even.
        image_axes: two rows of three, which applied to (a, b, 1) give the image's s and t at center + a half_u +
            b half_v, with a and b in [-1, 1]. The image fills the rect, so its corners lie on the rect's; t = 0 is its
            lower edge.
    """

    name: str
    shape: Literal["rect", "disk"]
    center: Vec3
    half_u: Vec3
    half_v: Vec3
    radiance: Rgb
    image: Image | None = None
    image_axes: tuple[Vec3, Vec3] = ((0.5, 0.0, 0.5), (0.0, 0.5, 0.5))

    def __post_init__(self) -> None:
        self._check_source(self.name, self.radiance)
        for key in ("center", "half_u", "half_v"):
            check_vector(self.name, key, getattr(self, key))
        check_positive(self.name, "area", self.area)
        _check_light_image(self.name, self.image)
        if self.image is not None and self.shape != "rect":
            raise SceneError(f"{self.name}: image on a {self.shape}; accepted: on a rect")
        self._check_image_axes()

    def _check_image_axes(self) -> None:
        axes = np.array(self.image_axes)
        at_corners = RECT_CORNERS @ axes[:, :2].T + axes[:, 2]
        if {*map(tuple, at_corners.round(5))} != IMAGE_CORNERS:
            raise SceneError(
                f"{self.name}: image_axes = {self.image_axes}; accepted: those that lay its corners on the rect's"
            )

    @property
    def area(self) -> float:
        """Of the side that emits [stage unit^2]."""
        cross = float(np.linalg.norm(np.cross(self.half_u, self.half_v)))
        return cross * (4.0 if self.shape == "rect" else math.pi)


@dataclass(frozen=True)
class SphereLight(LightSource):
    """A sphere that emits outwards.

    Args:
        name: the prim path.
        center: in world space [stage unit].
        radius: > 0 [stage unit].
        radiance: >= 0 per channel.
    """

    name: str
    center: Vec3
    radius: float
    radiance: Rgb

    def __post_init__(self) -> None:
        self._check_source(self.name, self.radiance)
        check_vector(self.name, "center", self.center)
        check_positive(self.name, "radius", self.radius)

    @property
    def area(self) -> float:
        """Of the sphere [stage unit^2]."""
        return 4 * math.pi * self.radius**2


@dataclass(frozen=True)
class CylinderLight(LightSource):
    """A round tube without caps that emits outwards.

    Args:
        name: the prim path.
        center: in world space [stage unit].
        half_axis: from the center to the middle of one end [stage unit].
        radius: > 0 [stage unit].
        radiance: >= 0 per channel.
    """

    name: str
    center: Vec3
    half_axis: Vec3
    radius: float
    radiance: Rgb

    def __post_init__(self) -> None:
        self._check_source(self.name, self.radiance)
        check_vector(self.name, "center", self.center)
        check_vector(self.name, "half_axis", self.half_axis)
        check_positive(self.name, "length", math.hypot(*self.half_axis))
        check_positive(self.name, "radius", self.radius)

    @property
    def area(self) -> float:
        """Of the tube [stage unit^2]."""
        return 4 * math.pi * self.radius * math.hypot(*self.half_axis)


@dataclass(frozen=True, eq=False)
class MeshLight(LightSource):
    """Triangles that emit to their front and are black behind; they block light as a shape does, but are none.

    Args:
        name: the prim path.
        corners: (m, 3, 3) float64, in world space, counter-clockwise seen from the side that emits.
        radiance: >= 0 per channel.
    """

    name: str
    corners: np.ndarray
    radiance: Rgb

    def __post_init__(self) -> None:
        self._check_source(self.name, self.radiance)
        check_finite_array(self.name, "corners", self.corners, ("m", 3, 3))
        check_positive(self.name, "area", self.area)

    @property
    def areas(self) -> np.ndarray:
        """Of each triangle, (m,) float64 [stage unit^2]."""
        a, b, c = (self.corners[:, corner] for corner in range(3))
        return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2

    @property
    def area(self) -> float:
        """Of all triangles [stage unit^2]."""
        return float(self.areas.sum())


Light = DistantLight | DomeLight | AreaLight | SphereLight | CylinderLight | MeshLight


def _check_light_image(name: str, image: Image | None) -> None:
    if image is not None and image.pixels.dtype == np.float32:
        colors = image.pixels[..., :3]
        if not (np.isfinite(colors).all() and colors.min() >= 0):
            raise SceneError(f"{name}: {image.name} has pixels below 0 or not finite; accepted: finite and >= 0")
