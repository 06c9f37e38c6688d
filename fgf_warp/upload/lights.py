"""Lights from a scene to the device: structs, and the tables by which they are sampled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from fgf_warp.device import lights
from fgf_warp.integrator.kinds import LIGHT_KINDS
from fgf_warp.scene import (
    AreaLight,
    CylinderLight,
    DistantLight,
    DomeLight,
    Image,
    Light,
    LightSource,
    MeshLight,
    Scene,
    Shape,
    SphereLight,
)
from fgf_warp.upload.textures import ImageRows, decoded_srgb

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear Rec.709."""
EVEN = Image("even", np.full((1, 1, 4), 255, dtype=np.uint8))
"""Image of a dome that has none and must be connected to."""


class LightRows:
    """What lights look up: images, cumulative shares, and corners of triangles."""

    def __init__(self) -> None:
        self.images = ImageRows()
        self._places: list[np.ndarray] = [np.zeros(0)]
        self._corners: list[np.ndarray] = [np.zeros((0, 3))]
        self._place_count = self._corner_count = 0

    def add_places(self, shares: np.ndarray) -> int:
        """Adds cumulative shares, (n,) in [0, 1]; returns the index of the first."""
        self._places.append(shares)
        self._place_count += len(shares)
        return self._place_count - len(shares)

    def add_corners(self, corners: np.ndarray) -> int:
        """Adds corners, (n, 3) [stage unit]; returns the index of the first."""
        self._corners.append(corners)
        self._corner_count += len(corners)
        return self._corner_count - len(corners)

    def upload(self, device: str) -> Any:
        """The device's `LightTables`."""
        result = lights.LightTables()
        result.places = wp.array(np.concatenate(self._places).astype(np.float32), dtype=float, device=device)
        result.corners = wp.array(np.concatenate(self._corners).astype(np.float32), dtype=wp.vec3, device=device)
        result.images = self.images.upload(device)
        return result


def build_device_lights(scene: Scene, containers: Sequence[Shape], device: str) -> tuple[wp.array, Any]:
    """The device's view of all lights that paths connect to.

    Args:
        scene: whose lights they are.
        containers: the shapes filled with media, in the order of their bits.
        device: where to put them.

    Returns:
        The `Light`s, (n,), in the order of `connected_lights`; and the `LightTables` that they look up.
    """
    rows = LightRows()
    sources = connected_lights(scene)
    chances = np.concatenate([[0.0], np.cumsum(choose_chances(sources, scene))]).astype(np.float32)
    made = []
    for source, first, last in zip(sources, chances[:-1], chances[1:], strict=True):
        light = build_device_light(source, rows)
        light.first_chance, light.last_chance = first, last
        if source.shadow_link is not None:
            bit = 1 << source.shadow_link
            light.casting_containers = sum(1 << k for k, shape in enumerate(containers) if shape.shadow_links & bit)
        made.append(light)
    return wp.array(made, dtype=lights.Light, device=device), rows.upload(device)


def connected_lights(scene: Scene) -> list[Light]:
    """All but what is in the even environment; the place of a light is its index on the device."""
    return [light for light in scene.lights if not (isinstance(light, DomeLight) and light.is_plain)]


def even_environment(scene: Scene) -> np.ndarray:
    """(3,) radiance of all domes that are the same in all directions, which no path connects to."""
    domes = [light.radiance for light in scene.lights if isinstance(light, DomeLight) and light.is_plain]
    return np.sum(domes, axis=0) if domes else np.zeros(3)


def choose_chances(sources: Sequence[Light], scene: Scene) -> np.ndarray:
    """The probability with which each light is connected to: half of it even, half in proportion to its power.

    The even half bounds what an estimate of power can cost where a weak light is near.

    Returns:
        (n,) float64, whose sum is 1.
    """
    powers = np.array([estimate_power(light, scene) for light in sources])
    even = np.full(len(sources), 1 / max(len(sources), 1))
    return 0.5 * (even + powers / powers.sum()) if powers.sum() > 0 else even


def estimate_power(light: Light, scene: Scene) -> float:
    """Luminous power that a light sends out, or into the sphere around the scene, in any unit and without shaping."""
    luminance = float(np.dot(light.radiance, LUMINANCE))
    cross_section = math.pi * scene.radius**2
    if isinstance(light, DistantLight):
        return luminance * cross_section * (math.pi * math.sin(light.half_angle) ** 2 if light.half_angle else 1.0)
    if isinstance(light, DomeLight):
        return luminance * cross_section * 4 * math.pi * (1.0 if light.image is None else dome_mean(light.image))
    if isinstance(light, AreaLight) and light.image is not None:
        luminance *= float(filtered_luminance(light.image, is_round=False).mean())
    return luminance * math.pi * light.area


def dome_mean(image: Image) -> float:
    """Mean luminance of an image in latitude and longitude, over solid angles."""
    weights = row_solid_angles(image.pixels.shape[0])
    return float(weights @ filtered_luminance(image, is_round=True).mean(axis=1) / weights.sum())


def build_device_light(light: Light, rows: LightRows) -> Any:
    """The device's view of a light that paths connect to, and always choose.

    Args:
        light: to describe.
        rows: to add to what it looks up.

    Returns:
        `device.lights.Light`.
    """
    result = lights.Light()
    result.last_chance = 1.0
    result.radiance = wp.vec3(*light.radiance)
    result.image = -1
    _add_source(result, light)
    if isinstance(light, DistantLight):
        result.kind = lights.DISTANT
        result.center = -wp.vec3(*light.direction)
        result.cone = 2 * math.sin(light.half_angle / 2) ** 2
    elif isinstance(light, DomeLight):
        result.kind = lights.DOME
        result.to_light = wp.mat33(*np.array(light.light_to_world).T.ravel())
        image = light.image or EVEN
        weights = row_solid_angles(image.pixels.shape[0])[:, None]
        _add_image(result, image, filtered_luminance(image, is_round=True) * weights, weights, rows)
    elif isinstance(light, MeshLight):
        result.kind = lights.MESH_LIGHT
        result.area, result.columns = light.area, len(light.corners)
        result.first_place = rows.add_places(cumulate(light.areas))
        result.first_corner = rows.add_corners(light.corners.reshape(-1, 3))
    else:
        result.center = wp.vec3(*light.center)
        result.area = light.area
        if isinstance(light, AreaLight):
            _add_flat(result, light, rows)
        else:
            _add_round(result, light)
    return result


def _add_source(result: Any, light: LightSource) -> None:
    """Adds what all kinds of lights may have: links and shaping."""
    result.link = 0 if light.link is None else 1 << light.link
    result.casters = 0 if light.shadow_link is None else 1 << light.shadow_link
    result.casting_containers = 0xFFFFFFFF
    shaping = light.shaping
    if shaping is not None:
        result.is_shaped = 1
        result.axis = wp.vec3(*shaping.axis)
        result.cone_angle = shaping.cone_angle
        result.fade_angle = shaping.cone_angle * (1 - shaping.cone_softness)
        result.focus, result.focus_tint = shaping.focus, wp.vec3(*shaping.focus_tint)


def _add_round(result: Any, light: SphereLight | CylinderLight) -> None:
    """Adds the shape of a sphere or a tube."""
    result.radius = light.radius
    result.kind = lights.SPHERE_LIGHT
    if isinstance(light, CylinderLight):
        result.kind = lights.CYLINDER_LIGHT
        result.half_u = wp.vec3(*light.half_axis)
        result.normal = wp.normalize(result.half_u)


def _add_flat(result: Any, light: AreaLight, rows: LightRows) -> None:
    """Adds the shape of a rect or disk, and its image."""
    halves = np.array([light.half_u, light.half_v])
    normal = np.cross(*halves)
    if light.image is not None:
        # Along the image's s and t, which are the rect's own axes in some order and either way.
        halves = 2 * np.array(light.image_axes)[:, :2] @ halves
        luminance = filtered_luminance(light.image, is_round=False)
        _add_image(result, light.image, luminance, np.ones((1, 1)), rows)
    duals = np.linalg.pinv(halves).T
    result.kind = LIGHT_KINDS[light.shape]
    result.half_u, result.half_v = wp.vec3(*halves[0]), wp.vec3(*halves[1])
    result.dual_u, result.dual_v = wp.vec3(*duals[0]), wp.vec3(*duals[1])
    result.normal = wp.vec3(*(normal / np.linalg.norm(normal)))


def _add_image(result: Any, image: Image, weights: np.ndarray, even: np.ndarray, rows: LightRows) -> None:
    """Adds an image, whose texels are sampled by `weights`, (height, width), or where all are 0 by `even`."""
    weights = weights if weights.any() else np.broadcast_to(even, weights.shape)
    result.image = rows.images.add(image)
    result.rows, result.columns = weights.shape
    result.first_place = rows.add_places(cumulate(weights.sum(axis=1)))
    rows.add_places(cumulate(weights).ravel())


def cumulate(weights: np.ndarray) -> np.ndarray:
    """Cumulative shares of weights >= 0 along their last axis.

    Returns:
        (..., n + 1) float64 for weights (..., n): from 0 to 1, or all 0 where there is no weight.
    """
    sums = np.cumsum(weights, axis=-1, dtype=np.float64)
    total = sums[..., -1:]
    shares = sums / np.where(total > 0, total, 1.0)
    return np.concatenate([np.zeros_like(total), shares], axis=-1)


def row_solid_angles(count: int) -> np.ndarray:
    """(count,) solid angle of each row of an image in latitude and longitude, over 4 pi."""
    edges = np.pi * np.arange(count) / count
    return np.sin(edges + np.pi / (2 * count)) * np.sin(np.pi / (2 * count))


def filtered_luminance(image: Image, *, is_round: bool) -> np.ndarray:
    """Mean luminance over each texel of the bilinear interpolant between the texels' centers.

    So nothing of a texel is left out where its neighbours glow into it.

    Args:
        image: whose luminance it is.
        is_round: True where columns begin anew at the side, as of a dome; else the last one goes on.

    Returns:
        (height, width) float64, linear.
    """
    luminance = linear_colors(image) @ LUMINANCE
    for axis, is_round_here in ((1, is_round), (0, False)):
        padding = [(0, 0), (0, 0)]
        padding[axis] = (1, 1)
        padded = np.pad(luminance, padding, mode="wrap" if is_round_here else "edge")
        before, after = (np.take(padded, np.arange(k, k + luminance.shape[axis]), axis=axis) for k in (0, 2))
        luminance = 0.75 * luminance + 0.125 * (before + after)
    return luminance


def linear_colors(image: Image) -> np.ndarray:
    """(height, width, 3) float64, linear; of integers in [0, 1]."""
    colors = image.pixels[..., :3]
    if image.is_srgb:
        return decoded_srgb()[colors]
    return colors.astype(np.float64) / (255 if colors.dtype == np.uint8 else 1)
