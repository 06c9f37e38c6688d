"""Look-ups of media at an event, path by path, in scenes whose boundaries are crossed one by one."""

from typing import Any

import warp as wp

from fgf_warp.device.camera import far_distance
from fgf_warp.device.geometry import BOUNDARY, SURFACE, Hit
from fgf_warp.device.law import NOT_FROZEN
from fgf_warp.device.medium import container_at
from fgf_warp.device.numerics import INFINITE
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.boundaries import MAX_CROSSINGS, Boundaries
from fgf_warp.integrator.intersection import ShapeIntersection
from fgf_warp.integrator.laws import LineLaws
from fgf_warp.integrator.media.value import MediumFunctions
from fgf_warp.integrator.path import PathRecord
from fgf_warp.integrator.scene_data import scene_struct
from fgf_warp.integrator.shading import SurfaceReading
from fgf_warp.settings import PRIM_AOVS, Aov

FIRST_SEGMENT_AOVS = frozenset({Aov.TRANSMITTANCE, Aov.OPTICAL_DEPTH})
"""Planes of the first segment in a medium."""


def needs_look_up(features: RenderFeatures) -> bool:
    """True where the kernel has this stage."""
    return features.crossings and (features.looks_up_media or bool(features.aovs & FIRST_SEGMENT_AOVS))


def build_media_lookup(
    features: RenderFeatures,
    record: PathRecord,
    laws: LineLaws,
    medium: MediumFunctions,
    boundaries: Boundaries,
    first_segment: Any,
) -> Any:
    """The function (scene, path) -> Path: whether the medium goes on, and what it is where the path scatters."""
    Path, SceneData = record.struct, scene_struct(features)
    cross, carries_on = boundaries.cross, boundaries.carries_on
    medium_at_depth, rates_of, is_from_medium = laws.medium_at_depth, laws.rates_of, laws.is_from_medium
    transmittance, flight_densities = medium.transmittance, medium.flight_densities
    has_many = features.looks_up_media
    tells_prims = bool(features.aovs & PRIM_AOVS)

    @wp.func
    def look_up_media(scene: SceneData, before: Path) -> Path:
        path = before
        scatters = before.medium >= 0 and before.flight <= before.hit.t
        if wp.static(has_many):
            path.flight_continues = 0
            if wp.static(features.passes):
                path.flight_continues = wp.where(before.passes_straight == 1, before.flight_continues, 0)
            if before.hit.kind == BOUNDARY and not scatters:
                inside = before.start.inside
                beyond = cross(scene, before.start, before.hit.item, before.origin, before.hit.t)
                path.start.entered = beyond.entered
                if carries_on(scene.containers, path.medium, inside, beyond.inside, beyond.entered):
                    path.flight_continues = 1
                elif wp.static(features.frozen):
                    path.body = -1
            if path.medium >= 0 and path.flight_continues == 0:
                medium_here = medium_at_depth(scene.media[scene.first_medium + path.medium], path.depth)
                if scatters:
                    path.albedo = medium_here.albedo
                    path.phase = medium_here.phase
                    if wp.static(tells_prims):
                        path.container = container_at(scene.containers, before.start.inside)
                if wp.static(features.chromatic):
                    densities = wp.vec3(1.0)
                    if scatters:
                        densities = flight_densities(
                            medium_here, before.length, is_from_medium(before), rates_of(before)
                        )
                    else:
                        t = before.hit.t - before.segment
                        densities = transmittance(medium_here, t, is_from_medium(before), rates_of(before))
                    relative = densities / wp.max(densities[path.channel], 1.0e-37)
                    path.channel_pdfs = wp.cw_mul(path.channel_pdfs, relative)
        if wp.static(bool(features.aovs & FIRST_SEGMENT_AOVS)):
            path = first_segment(scene, before, path, scatters)
        return path

    return look_up_media


def build_first_segment(
    features: RenderFeatures,
    record: PathRecord,
    medium: MediumFunctions,
    boundaries: Boundaries,
    shapes: ShapeIntersection,
    surfaces: SurfaceReading,
    camera_of: Any,
) -> Any:
    """The function (scene, before, path, scatters) -> Path that records the first segment in a medium, whole."""
    Path, SceneData = record.struct, scene_struct(features)
    cross, carries_on = boundaries.cross, boundaries.carries_on
    transmittance, intersect, look_of = medium.transmittance, shapes.anything, surfaces.look_of
    has_many = features.looks_up_media

    @wp.func
    def gate_of(scene: SceneData, hit: Hit) -> int:
        """The container whose boundary was met, or -1."""
        gate = int(-1)
        if hit.kind == BOUNDARY:
            gate = hit.item
        if wp.static(features.refracts):
            if hit.kind == SURFACE:
                gate = look_of(scene, hit.item).container
        return gate

    @wp.func
    def segment_end(scene: SceneData, path: Path) -> float:
        """Distance at which the path would leave the medium that it is in, if it did not scatter."""
        start = path.start
        hit = path.hit
        for _ in range(MAX_CROSSINGS):
            gate = gate_of(scene, hit)
            if gate < 0:
                break
            inside = start.inside
            start = cross(scene, start, gate, path.origin, hit.t)
            if not carries_on(scene.containers, path.medium, inside, start.inside, start.entered):
                break
            hit = intersect(scene, path.origin, path.direction, INFINITE, start)
        return hit.t

    @wp.func
    def first_segment(scene: SceneData, before: Path, now: Path, scatters: bool) -> Path:
        path = now
        if path.depth == 0 and path.medium >= 0 and path.has_crossed_medium == 0:
            is_over = bool(True)
            begin = before.start.t_min
            if wp.static(has_many):
                is_over = scatters or path.flight_continues == 0
                begin = before.segment
            if is_over:
                medium_here = scene.media[scene.first_medium + path.medium]
                end = segment_end(scene, before)
                if wp.static(features.lens):
                    end = wp.min(end, far_distance(camera_of(scene.camera, before), before.direction))
                length = end - begin
                if wp.static(Aov.TRANSMITTANCE in features.aovs):
                    path.first_transmittance = transmittance(medium_here, length, False, wp.vec3(NOT_FROZEN))
                if wp.static(Aov.OPTICAL_DEPTH in features.aovs):
                    path.first_optical_depth = medium_here.extinction * length
                path.has_crossed_medium = 1
        return path

    return first_segment
