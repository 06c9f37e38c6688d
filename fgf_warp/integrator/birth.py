"""Birth of a path: its pixel, its camera ray, and the media around the ray's origin."""

from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.camera import Camera, camera_at, camera_direction, camera_ray, film_point
from fgf_warp.device.geometry import (
    BOUNDARY,
    MISS,
    OFFSET,
    Hit,
    Start,
    coordinate_reach,
    intersect_solid_boundary,
    solid_at,
    solid_span,
)
from fgf_warp.device.rng import CAMERA, WHOLE_PATH, draw_in_pixel, pixel_shift, reverse_bits
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.boundaries import MAX_CROSSINGS, Boundaries
from fgf_warp.integrator.path import PathRecord
from fgf_warp.integrator.sampler import Sampler
from fgf_warp.integrator.scene_data import scene_struct


class Birth(NamedTuple):
    """Functions of the device.

    Args:
        go_to_pixel: (path, width, seed, pixel) -> Path, which waits at a pixel.
        emit: (camera, inside, seed, path) -> Path, the path of its pixel and sample, at the camera; branch-free.
        find_start: (scene, path) -> Path, with the containers around its start, where these vary.
    """

    go_to_pixel: Any
    emit: Any
    find_start: Any


def build_camera_of(features: RenderFeatures, record: PathRecord) -> Any:
    """The function (camera, path) -> Camera, at the time of the path."""
    Path = record.struct
    moves = features.lens and features.motion

    @wp.func(inline=True)
    def camera_of(camera: Camera, path: Path) -> Camera:
        if wp.static(moves):
            return camera_at(camera, path.start.time)
        return camera

    return camera_of


def build_birth(
    features: RenderFeatures, record: PathRecord, sampler: Sampler, boundaries: Boundaries, intersect_meshes: Any
) -> Birth:
    """The functions of a kernel of these features."""
    Path = record.struct
    newborn, draw = record.newborn, sampler.draw
    is_lattice = features.sampler == "lattice"
    camera_of = build_camera_of(features, record)

    @wp.func
    def go_to_pixel(before: Path, width: int, seed: wp.uint64, pixel: int) -> Path:
        path = before
        path.pixel = pixel
        path.row = pixel // width
        path.column = pixel % width
        if wp.static(is_lattice):
            shift = pixel_shift(seed, pixel)
            path.shift_x = wp.int32(shift[0])
            path.shift_y = wp.int32(shift[1])
        return path

    @wp.func(inline=True)
    def emit(camera: Camera, inside: wp.uint32, seed: wp.uint64, before: Path) -> Path:
        path = newborn()
        path.pixel = before.pixel
        path.row = before.row
        path.column = before.column
        path.sample = before.sample
        path.end_sample = before.end_sample
        path.sample_index = wp.int32(reverse_bits(wp.uint32(path.end_sample + path.sample)))
        in_pixel = wp.vec2(0.0, 0.0)
        if wp.static(is_lattice):
            path.shift_x = before.shift_x
            path.shift_y = before.shift_y
            in_pixel = draw_in_pixel(path.shift_x, path.shift_y, path.sample_index)
        else:
            xi = draw(seed, path.pixel, path.sample_index, 0, CAMERA)
            in_pixel = wp.vec2(xi[0], xi[1])
        if wp.static(features.chromatic or features.lens or features.motion):
            xi = draw(seed, path.pixel, path.sample_index, 0, WHOLE_PATH)
            path.start.time = xi[1]
            lens_x = xi[2]
            lens_y = xi[3]
            if wp.static(features.chromatic):
                path.channel = wp.min(int(xi[0] * 3.0), 2)
        if wp.static(features.lens):
            view = camera_of(camera, path)
            film = film_point(view, path.row, path.column, in_pixel[0], in_pixel[1])
            ray = camera_ray(view, film, lens_x, lens_y)
            path.origin = ray.origin
            path.direction = ray.direction
        else:
            path.origin = camera.position
            path.direction = camera_direction(camera, path.row, path.column, in_pixel[0], in_pixel[1])
        path.start.inside = inside
        return path

    return Birth(go_to_pixel, emit, build_find_start(features, record, boundaries, intersect_meshes))


def build_find_start(
    features: RenderFeatures, record: PathRecord, boundaries: Boundaries, intersect_meshes: Any
) -> Any:
    """The function (scene, path) -> Path that finds the containers around the path's start.

    These are the ones that are entered and not left on the path's own line from outside of all to its start.
    """
    Path, SceneData = record.struct, scene_struct(features)
    cross = boundaries.cross

    @wp.func
    def find_start(scene: SceneData, before: Path) -> Path:
        path = before
        back = wp.length(before.origin - scene.media_center) + scene.media_radius
        origin = before.origin - before.direction * back
        start = Start()
        start.crossed = -1
        start.time = before.start.time
        for _ in range(MAX_CROSSINGS):
            hit = Hit()
            hit.t = back
            hit.kind = MISS
            if wp.static(bool(features.solids)):
                for s in range(scene.solids.shape[0]):
                    solid = scene.solids[s]
                    if wp.static(features.motion):
                        solid = solid_at(solid, scene.motions, start.time)
                    if solid.container >= 0:
                        span = solid_span(solid, solid.kind, origin, before.direction)
                        hit = intersect_solid_boundary(solid, span, start, hit)
            if wp.static(features.meshes):
                hit = intersect_meshes(scene.boundaries, origin, before.direction, start, hit)
            if hit.kind != BOUNDARY:
                break
            start = cross(scene, start, hit.item, origin, hit.t)
        path.start.inside = start.inside
        path.start.slack = 2.0 * OFFSET * coordinate_reach(before.origin, back)
        return path

    return find_start
