"""What a surface does to a path that meets it: it lets it pass straight, or scatters it by its BSDF."""

from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.bsdf import Bsdf, prepare_bsdf, rescale, sample_bsdf
from fgf_warp.device.bvh import build_place_instance
from fgf_warp.device.geometry import SURFACE, Hit, Start, cross_boundary, is_inside
from fgf_warp.device.medium import refracting_at
from fgf_warp.device.rng import CONNECTION
from fgf_warp.device.shading import Look, Shade, read_surface
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.boundaries import Boundaries
from fgf_warp.integrator.intersection import ShapeIntersection
from fgf_warp.integrator.path import CAMERA_RAY, PathRecord
from fgf_warp.integrator.sampler import Sampler
from fgf_warp.integrator.scene_data import scene_struct
from fgf_warp.settings import Aov


class SurfaceReading(NamedTuple):
    """Functions of the device.

    Args:
        look_of: (scene, item) -> Look, of the surface that was hit.
        read: (scene, hit, direction, start) -> Shade, the surface there, ready to be evaluated.
        straight_share: (scene, hit, direction, start) -> vec3, of light that meets it, what passes straight on.
    """

    look_of: Any
    read: Any
    straight_share: Any


class Shading(NamedTuple):
    """Functions of the device.

    Args:
        reaches_surface: (path) -> bool, where a surface is what it meets, and it was not scattered before.
        shade: (scene, path, seed) -> (Path, Bsdf), what becomes of a path that reaches a surface.
    """

    reaches_surface: Any
    shade: Any


def build_surface_reading(
    features: RenderFeatures, record: PathRecord, boundaries: Boundaries, shapes: ShapeIntersection
) -> SurfaceReading:
    """The functions of a kernel of these features."""
    SceneData = scene_struct(features)
    place_instance, surface_at, is_hidden = build_place_instance(features), shapes.surface_at, boundaries.is_hidden

    @wp.func
    def look_of(scene: SceneData, item: int) -> Look:
        return scene.shading[0].looks[surface_at(scene, item)]

    @wp.func
    def put_glass(scene: SceneData, before: Bsdf, inside: wp.uint32, beyond: wp.uint32) -> Bsdf:
        """The surface with what is refracted between two places, where their indices differ."""
        bsdf = before
        here = refracting_at(scene.containers, inside)
        there = refracting_at(scene.containers, beyond)
        ior_here = float(1.0)
        ior_there = float(1.0)
        first = int(0)
        second = int(0)
        if here >= 0:
            ior_here = scene.containers[here].ior
            first = scene.containers[here].ior_number
        if there >= 0:
            ior_there = scene.containers[there].ior
            second = scene.containers[there].ior_number
        if ior_here != ior_there:
            bsdf.eta = ior_there / ior_here
            bsdf.front = scene.shading[0].glass[first * scene.shading[0].glass_count + second]
            bsdf.back = scene.shading[0].glass[second * scene.shading[0].glass_count + first]
        return bsdf

    @wp.func
    def read(scene: SceneData, hit: Hit, direction: wp.vec3, start: Start) -> Shade:
        look = look_of(scene, hit.item)
        normals_to_world = wp.identity(n=3, dtype=float)
        axes = wp.identity(n=3, dtype=float)
        if wp.static(features.instances):
            if look.instance >= 0:
                placement = place_instance(scene.meshes, look.instance + hit.item - look.item, start.time)
                normals_to_world = wp.transpose(placement.to_object)
                axes = wp.inverse(placement.to_object)
        is_within = look.container >= 0 and is_inside(start.inside, look.container)
        surface = read_surface(scene.shading[0], look, hit, direction, is_within, normals_to_world, axes)
        if wp.static(features.refracts):
            if look.container >= 0:
                beyond = cross_boundary(start.inside, look.container)
                surface.bsdf = put_glass(scene, surface.bsdf, start.inside, beyond)
        surface.bsdf = prepare_bsdf(scene.shading[0].albedos, surface.bsdf, -direction)
        return surface

    @wp.func
    def straight_share(scene: SceneData, hit: Hit, direction: wp.vec3, start: Start) -> wp.vec3:
        look = look_of(scene, hit.item)
        if scene.shading[0].materials[look.material].may_pass == 0:
            return wp.vec3(0.0)
        if is_hidden(scene, look.container, start.inside):
            return wp.vec3(1.0)
        surface = read(scene, hit, direction, start)
        return surface.bsdf.passes

    return SurfaceReading(look_of, read, straight_share)


def build_pass_surface(features: RenderFeatures, record: PathRecord, boundaries: Boundaries) -> Any:
    """The function (scene, path, container, weight, continues) -> Path, which goes straight on.

    On a boundary it is then on the other side of it; `continues` tells whether its flight goes on.
    """
    Path, SceneData = record.struct, scene_struct(features)
    cross, with_eta_scale = boundaries.cross, boundaries.with_eta_scale

    @wp.func
    def pass_surface(scene: SceneData, before: Path, container: int, weight: wp.vec3, continues: bool) -> Path:
        path = before
        path.passes_straight = 1
        path.albedo = weight
        if wp.static(features.media):
            path.flight_continues = wp.where(continues, 1, 0)
        if container >= 0:
            path.start = cross(scene, before.start, container, before.origin, before.hit.t)
            path = with_eta_scale(scene, path)
            if wp.static(features.frozen):
                path.body = wp.where(continues, before.body, -1)
        else:
            path.start.passed = before.hit.t
        return path

    return pass_surface


def build_shading(
    features: RenderFeatures,
    record: PathRecord,
    sampler: Sampler,
    boundaries: Boundaries,
    surfaces: SurfaceReading,
) -> Shading:
    """The functions of a kernel of these features."""
    Path, SceneData = record.struct, scene_struct(features)
    draw_more, look_of, read = sampler.draw_more, surfaces.look_of, surfaces.read
    cross, carries_on, is_hidden, change_side, _ = boundaries
    pass_surface = build_pass_surface(features, record, boundaries)

    @wp.func(inline=True)
    def reaches_surface(path: Path) -> bool:
        return path.hit.kind == SURFACE and path.flight > path.hit.t

    @wp.func
    def shade(scene: SceneData, before: Path, seed: wp.uint64):
        path = before
        container = look_of(scene, before.hit.item).container
        path.start.crossed = container
        if wp.static(features.looks_up_media):
            path.flight_continues = 0
        if wp.static(features.refracts):
            if is_hidden(scene, container, before.start.inside):
                beyond = cross(scene, before.start, container, before.origin, before.hit.t)
                goes_on = carries_on(
                    scene.containers, before.medium, before.start.inside, beyond.inside, beyond.entered
                )
                return pass_surface(scene, path, container, wp.vec3(1.0), goes_on), Bsdf()
        surface = read(scene, before.hit, before.direction, before.start)
        bsdf = surface.bsdf
        path.emitted = surface.emission
        if wp.static(Aov.ALBEDO in features.aovs):
            path.reflectance = surface.reflectance
        path.hit.normal = bsdf.facet
        # Numbers of their own: what is drawn for the event says already that it comes here.
        more = draw_more(seed, before.pixel, before.sample_index, before.bounce, CONNECTION)
        if wp.static(features.passes):
            if more[0] < bsdf.p_pass:
                return pass_surface(scene, path, container, bsdf.passes / bsdf.p_pass, container < 0), bsdf
        if wp.static(Aov.NORMAL in features.aovs):
            if before.depth == 0:
                path.first_normal = bsdf.normal
        chooses = rescale(more[0], bsdf.p_pass, 1.0 - bsdf.p_pass)
        s = sample_bsdf(scene.shading[0].albedos, bsdf, wp.vec4(before.xi[2], before.xi[3], chooses, more[1]))
        path.wi = s.wi
        path.albedo = s.weight
        path.pdf_direction = wp.where(s.is_delta == 1, CAMERA_RAY, s.pdf)
        if wp.static(features.refracts):
            path.transmits = s.transmits
            if s.transmits == 1:
                path = change_side(scene, path, container)
                if wp.static(features.frozen):
                    path.body = -1
        return path, bsdf

    return Shading(reaches_surface, shade)
