"""What a kernel knows of the scene: one table, from which the struct is made that a scene is uploaded into."""

from functools import cache
from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.bvh import Bvh
from fgf_warp.device.camera import Camera
from fgf_warp.device.drift import Drift
from fgf_warp.device.geometry import Motion, Solid
from fgf_warp.device.lights import Light, LightTables
from fgf_warp.device.medium import Container, Medium
from fgf_warp.device.shading import Shading
from fgf_warp.device.surfaces import Surface
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.rows import Needs, always, make_struct
from fgf_warp.settings import Aov


class Part(NamedTuple):
    """A part of the uploaded scene.

    Args:
        name: of the struct's field.
        dtype: a Warp type, for an array that of its elements in a list.
        meaning: one line.
        needs: whether a kernel of these features has it.
    """

    name: str
    dtype: Any
    meaning: str
    needs: Needs = always


SCENE = (
    Part("camera", Camera, "at the opening of the shutter, and at its closing"),
    Part("environment", wp.vec3, "radiance of all that is beyond the scene", lambda f: f.environment),
    Part("solids", [Solid], "those that are tried one after the other", lambda f: bool(f.solids)),
    Part("lone_solid", int, "the one that the only medium fills", lambda f: bool(f.lone_solid)),
    Part("motions", [Motion], "of solids and instances that move", lambda f: bool(f.solids)),
    Part("meshes", [Bvh], "the tree over all triangles or instances", lambda f: f.meshes),
    Part("surfaces", [Surface], "of each shape with a surface", lambda f: f.surfaces),
    Part("surface_of", [int], "of what a hit tells, the index of the surface: instances share theirs",
         lambda f: f.surfaces),
    Part("shading", [Shading], "one: functions take the scene by value, and it should not be large",
         lambda f: f.shading),
    Part("light_tables", [LightTables], "one, likewise", lambda f: f.intricate_lights),
    Part("media", [Medium], "of all images, image after image", lambda f: f.media),
    Part("media_count", int, "of one image", lambda f: f.media),
    Part("first_medium", int, "of the image that is rendered", lambda f: f.media),
    Part("tables", [wp.vec3], "of the laws", lambda f: f.media),
    Part("containers", [Container], "shapes filled with media, in the order of their bits", lambda f: f.media),
    Part("surface_drifts", [Drift], "of each surface", lambda f: Aov.MOTION in f.aovs),
    Part("container_drifts", [Drift], "of each container", lambda f: Aov.MOTION in f.aovs),
    Part("lights", [Light], "those that paths connect to", lambda f: f.connections),
    Part("camera_inside", wp.uint32, "containers around what camera rays begin at, where all begin in the same",
         lambda f: f.media),
    Part("contact_rounding", float, "distance that rounding may part boundaries by which coincide [stage unit]",
         lambda f: f.contacts),
    Part("camera_ior", float, "index of refraction where camera rays begin, or in the middle of where they do",
         lambda f: f.refracts),
    Part("media_center", wp.vec3, "of a ball that holds all containers", lambda f: f.varied_starts),
    Part("media_radius", float, "of that ball [stage unit]", lambda f: f.varied_starts),
    Part("boundaries", [Bvh], "containers that are meshes, without anything on them",
         lambda f: f.varied_starts and f.meshes),
    Part("seeds", [wp.uint64], "of each image"),
)  # fmt: skip


@cache
def scene_struct(features: RenderFeatures) -> Any:
    """The struct `SceneData` of a kernel of these features."""
    fields = {
        part.name: wp.array(dtype=part.dtype[0]) if isinstance(part.dtype, list) else part.dtype
        for part in SCENE
        if part.needs(features)
    }
    return make_struct("SceneData", fields)
