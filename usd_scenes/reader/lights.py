"""UsdLux: lights whose radiance is intensity x 2^exposure x color, in the formulas of the UsdLux documentation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Literal

import numpy as np
from pxr import Usd, UsdLux, UsdShade

from fgf_warp.errors import SceneError, UnsupportedFeatureError
from fgf_warp.scene import AreaLight, DistantLight, DomeLight, Light, Rgb, SphereLight, Vec3
from usd_scenes.reader.attributes import is_authored, read_color, read_number
from usd_scenes.reader.context import StageContext

DEFAULT_DOME = DomeLight(name="default dome", radiance=(1.0, 1.0, 1.0))
"""Lights a stage that has no light of its own."""

HARMLESS: dict[str, object] = {
    "inputs:diffuse": 1.0,
    "inputs:specular": 1.0,
    "inputs:shadow:enable": True,
    "inputs:texture:file": None,
    "inputs:shaping:focus": 0.0,
    "inputs:shaping:cone:angle": 90.0,
    "inputs:shaping:ies:file": None,
    "treatAsPoint": False,
    "collection:lightLink:includeRoot": True,
    "collection:shadowLink:includeRoot": True,
}
"""Attributes of lights that are not rendered, and the values at which that needs no warning."""
RELATIONSHIPS_NOT_READ = (
    "light:filters",
    "portals",
    "collection:lightLink:includes",
    "collection:lightLink:excludes",
    "collection:shadowLink:includes",
    "collection:shadowLink:excludes",
)
EXPOSURE_MAX = 127
"""2^127 is the largest power of two in float32."""
SCALE_TOLERANCE = 1e-4
"""Relative difference of the axes' scales up to which a transform counts as uniform."""


def read_distant_light(prim: Usd.Prim, context: StageContext) -> DistantLight:
    """A DistantLight, which shines along its local -z.

    Raises:
        SceneError: for a value out of its range.
        UnsupportedFeatureError: for an angle above 180 degrees.
    """
    angle = _non_negative(prim, "inputs:angle", context.time)
    if angle > 180:
        raise UnsupportedFeatureError(f"{prim.GetPath()}.inputs:angle = {angle:g}; accepted: [0, 180] degrees")
    half_angle = math.radians(angle) / 2
    size_factor = math.pi * math.sin(half_angle) ** 2 if _normalize(prim, context.time) and half_angle > 0 else 1.0
    axis = -context.local_to_world(prim)[:3, 2]
    if not axis.any():
        raise SceneError(
            f"{prim.GetPath()}: the transform leaves the light no direction; accepted: a scale that is not 0"
        )
    return DistantLight(
        name=str(prim.GetPath()),
        direction=_vec3(axis / np.linalg.norm(axis)),
        half_angle=half_angle,
        radiance=_scaled(_emission(prim, context.time), 1 / size_factor),
    )


def read_dome_light(prim: Usd.Prim, context: StageContext) -> DomeLight:
    """A DomeLight of constant radiance; `normalize` does not apply to it.

    Raises:
        SceneError: for a value out of its range.
    """
    return DomeLight(name=str(prim.GetPath()), radiance=_emission(prim, context.time))


def read_rect_light(prim: Usd.Prim, context: StageContext) -> AreaLight:
    """A RectLight, which emits along its local -z.

    Raises:
        SceneError: for a value out of its range.
    """
    half_width = _positive(prim, "inputs:width", context.time) / 2
    half_height = _positive(prim, "inputs:height", context.time) / 2
    return _area_light("rect", prim, half_width, half_height, context)


def read_disk_light(prim: Usd.Prim, context: StageContext) -> AreaLight:
    """A DiskLight, which emits along its local -z.

    Raises:
        SceneError: for a value out of its range.
    """
    radius = _positive(prim, "inputs:radius", context.time)
    return _area_light("disk", prim, radius, radius, context)


def read_sphere_light(prim: Usd.Prim, context: StageContext) -> SphereLight:
    """A SphereLight; under a scale that is not uniform, a sphere of the same volume, with a warning.

    Raises:
        SceneError: for a value out of its range.
    """
    to_world = context.local_to_world(prim)
    scales = np.linalg.svd(to_world[:3, :3], compute_uv=False)
    if scales.max() - scales.min() > SCALE_TOLERANCE * scales.max():
        context.notes.add("scale is not uniform: a sphere of the same volume is rendered", prim.GetPath())
    radius = _positive(prim, "inputs:radius", context.time) * float(np.prod(scales)) ** (1 / 3)
    light = SphereLight(
        name=str(prim.GetPath()),
        center=_vec3(to_world[:3, 3]),
        radius=radius,
        radiance=_emission(prim, context.time),
    )
    if not _normalize(prim, context.time):
        return light
    return replace(light, radiance=_scaled(light.radiance, 1 / (4 * math.pi * radius**2)))


LIGHT_READERS: dict[str, Callable[[Usd.Prim, StageContext], Light]] = {
    "DistantLight": read_distant_light,
    "DomeLight": read_dome_light,
    "DomeLight_1": read_dome_light,
    "RectLight": read_rect_light,
    "DiskLight": read_disk_light,
    "SphereLight": read_sphere_light,
}


def read_light(prim: Usd.Prim, context: StageContext) -> Light | None:
    """Any light; None, with a warning, for a kind that is not supported.

    Raises:
        SceneError: for a value out of its range.
        UnsupportedFeatureError: for a DistantLight wider than a hemisphere.
    """
    reader = LIGHT_READERS.get(prim.GetTypeName())
    if reader is None:
        context.notes.add(f"light of type {prim.GetTypeName()} is not supported and gives no light", prim.GetPath())
        return None
    for name in _ignored(prim, context.time):
        context.notes.add(f"{name} of lights is not supported and is ignored", prim.GetPath())
    return reader(prim, context)


def is_light(prim: Usd.Prim) -> bool:
    """True for every kind of light, supported or not."""
    return prim.HasAPI(UsdLux.LightAPI)


def _area_light(
    shape: Literal["rect", "disk"], prim: Usd.Prim, half_x: float, half_y: float, context: StageContext
) -> AreaLight:
    to_world = context.local_to_world(prim)
    x, y = to_world[:3, 0] * half_x, to_world[:3, 1] * half_y
    # Locally y cross x is -z, the side that emits; a mirroring transform turns cross products over.
    half_u, half_v = (y, x) if np.linalg.det(to_world[:3, :3]) >= 0 else (x, y)
    light = AreaLight(
        name=str(prim.GetPath()),
        shape=shape,
        center=_vec3(to_world[:3, 3]),
        half_u=_vec3(half_u),
        half_v=_vec3(half_v),
        radiance=_emission(prim, context.time),
    )
    if not _normalize(prim, context.time):
        return light
    return replace(light, radiance=_scaled(light.radiance, 1 / light.area))


def _emission(prim: Usd.Prim, time: Usd.TimeCode) -> Rgb:
    """Radiance per channel before `normalize`."""
    intensity = _non_negative(prim, "inputs:intensity", time)
    exposure = read_number(
        prim.GetAttribute("inputs:exposure"), time, accepted=f"[-{EXPOSURE_MAX}, {EXPOSURE_MAX}]", holds=_is_exposure
    )
    color = read_color(prim.GetAttribute("inputs:color"), time)
    if prim.GetAttribute("inputs:enableColorTemperature").Get(time):
        kelvin = read_number(
            prim.GetAttribute("inputs:colorTemperature"), time, accepted="[1000, 10000] K", holds=_is_blackbody
        )
        white = UsdLux.BlackbodyTemperatureAsRgb(kelvin)
        color = (color[0] * white[0], color[1] * white[1], color[2] * white[2])
    return _scaled(color, intensity * 2.0**exposure)


def _ignored(prim: Usd.Prim, time: Usd.TimeCode) -> Iterator[str]:
    for name, harmless in HARMLESS.items():
        attribute = prim.GetAttribute(name)
        if is_authored(attribute) and attribute.Get(time) != harmless:
            yield name
    for name in RELATIONSHIPS_NOT_READ:
        if prim.GetRelationship(name).HasAuthoredTargets():
            yield name
    for light_input in UsdShade.ConnectableAPI(prim).GetInputs():
        if light_input.HasConnectedSource():
            yield f"connection of {light_input.GetFullName()}"


def _normalize(prim: Usd.Prim, time: Usd.TimeCode) -> bool:
    return bool(prim.GetAttribute("inputs:normalize").Get(time))


def _is_blackbody(kelvin: float) -> bool:
    return 1000 <= kelvin <= 10000


def _is_exposure(exposure: float) -> bool:
    return abs(exposure) <= EXPOSURE_MAX


def _non_negative(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> float:
    return read_number(prim.GetAttribute(name), time, accepted=">= 0", holds=lambda x: x >= 0)


def _positive(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> float:
    return read_number(prim.GetAttribute(name), time, accepted="> 0", holds=lambda x: x > 0)


def _scaled(color: Rgb, factor: float) -> Rgb:
    return (color[0] * factor, color[1] * factor, color[2] * factor)


def _vec3(values: np.ndarray) -> Vec3:
    return (float(values[0]), float(values[1]), float(values[2]))
