"""Boundaries of media: what crossing one changes, and when a medium goes on beyond it."""

from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.geometry import Start, cross_boundary, entered_at
from fgf_warp.device.medium import build_carries_on, ior_at, medium_at
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.path import PathRecord
from fgf_warp.integrator.scene_data import scene_struct

MAX_CROSSINGS = wp.constant(1024)
"""Boundaries between two scattering events; a path that crosses more is cut and counted as truncated."""


class Boundaries(NamedTuple):
    """Functions of the device.

    Args:
        cross: (scene, start, container, origin, t) -> Start, beyond a boundary that the ray crosses at t.
        carries_on: see `device.medium.build_carries_on`.
        is_hidden: (scene, container, inside) -> bool, True of a boundary that light enters, where another medium fills
            the space on both sides of it.
        change_side: (scene, path, container) -> Path, on the other side of a boundary.
        with_eta_scale: (scene, path) -> Path, with the index of refraction of where it is.
    """

    cross: Any
    carries_on: Any
    is_hidden: Any
    change_side: Any
    with_eta_scale: Any


def build_boundaries(features: RenderFeatures, record: PathRecord) -> Boundaries:
    """The functions of a kernel of these features."""
    Path, SceneData = record.struct, scene_struct(features)

    @wp.func
    def cross(scene: SceneData, before: Start, container: int, origin: wp.vec3, t: float) -> Start:
        start = before
        if wp.static(features.contacts):
            start.entered = entered_at(before, container, origin, t, scene.contact_rounding)
        start.inside = cross_boundary(before.inside, container)
        start.t_min = t
        start.crossed = container
        return start

    @wp.func
    def is_hidden(scene: SceneData, container: int, inside: wp.uint32) -> bool:
        hidden = bool(False)
        if wp.static(features.refracts):
            if container >= 0:
                beyond = cross_boundary(inside, container)
                hidden = medium_at(scene.containers, inside) == medium_at(scene.containers, beyond)
        return hidden

    @wp.func
    def with_eta_scale(scene: SceneData, before: Path) -> Path:
        path = before
        if wp.static(features.refracts):
            index = ior_at(scene.containers, path.start.inside) / scene.camera_ior
            path.eta_scale = index * index
        return path

    @wp.func
    def change_side(scene: SceneData, before: Path, container: int) -> Path:
        path = before
        path.start.inside = cross_boundary(before.start.inside, container)
        return with_eta_scale(scene, path)

    return Boundaries(cross, build_carries_on(features), is_hidden, change_side, with_eta_scale)
