"""Lights that a path can connect to: sampling by solid angle, and being met by a ray.

Of the plain kinds many are sampled at once, in lanes. What has an image, a shaping, or a shape of its own is looked up
one by one, by the functions of `build_lights`.
"""

from fgf_warp.device.lights.data import (
    CYLINDER_LIGHT,
    DISK,
    DISTANT,
    DOME,
    MESH_LIGHT,
    RECT,
    SPHERE_LIGHT,
    Light,
    LightSample,
    LightTables,
    chance,
    choose_light,
)
from fgf_warp.device.lights.intricate import build_lights
from fgf_warp.device.lights.plain import (
    cone_pdf,
    emitted_radiance,
    intersect_light,
    is_in_distant_light,
    light_distance,
    light_pdf,
    sample_light,
)

__all__ = [
    "CYLINDER_LIGHT",
    "DISK",
    "DISTANT",
    "DOME",
    "MESH_LIGHT",
    "RECT",
    "SPHERE_LIGHT",
    "Light",
    "LightSample",
    "LightTables",
    "build_lights",
    "chance",
    "choose_light",
    "cone_pdf",
    "emitted_radiance",
    "intersect_light",
    "is_in_distant_light",
    "light_distance",
    "light_pdf",
    "sample_light",
]
