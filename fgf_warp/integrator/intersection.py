"""What lies ahead on the ray: the lone solid, shapes tried one by one, meshes, and lights."""

from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.bvh import Bvh
from fgf_warp.device.geometry import (
    LIGHT,
    MISS,
    SURFACE,
    Hit,
    Solid,
    Start,
    build_intersect_solids,
    chord,
    intersect_open_surface,
    intersect_solid_boundary,
    intersect_solid_surface,
    solid_at,
    solid_span,
)
from fgf_warp.device.lights import (
    DISTANT,
    DOME,
    Light,
    build_lights,
    chance,
    cone_pdf,
    emitted_radiance,
    intersect_light,
    is_in_distant_light,
    light_pdf,
)
from fgf_warp.device.numerics import INFINITE, choose
from fgf_warp.device.surfaces import Surface
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.kinds import LIGHT_KINDS
from fgf_warp.integrator.path import CAMERA_RAY, PathRecord
from fgf_warp.integrator.scene_data import scene_struct


class ShapeIntersection(NamedTuple):
    """Functions of the device; those of one solid are branch-free.

    Args:
        lone_solid: (path, solid, kind) -> Path, with the ray's chord through it and where its flight ends, if there.
        boundary: (path, solid, kind) -> Path.
        surface: (path, solid, kind, surface) -> Path.
        solids: (scene, path) -> Path, all of them but the lone one.
        meshes: (trees, path) -> Hit.
        take_mesh_hit: (path, hit, scene) -> Path, whose hit is what it meets of the meshes.
        surface_at: (scene, item) -> int, index of the surface that was hit.
        anything: (scene, origin, direction, t_max, start) -> Hit, the nearest of all on a ray.
    """

    lone_solid: Any
    boundary: Any
    surface: Any
    solids: Any
    meshes: Any
    take_mesh_hit: Any
    surface_at: Any
    anything: Any


class LightIntersection(NamedTuple):
    """Functions of the device; those of one light are branch-free.

    Args:
        light: (path, light, kind, item) -> Path, with what it finds of a light that it meets.
        beyond: (path, light) -> Path, with what it finds of a distant light.
        lights: (scene, path) -> Path, both at all lights, after all shapes: lights with images, shaping or links.
    """

    light: Any
    beyond: Any
    lights: Any


class LightFunctions(NamedTuple):
    """What `device.lights.build_lights` gives for the lights of a scene."""

    intersect: Any
    sample: Any
    pdf: Any
    radiance: Any


def light_kinds(features: RenderFeatures) -> set[int]:
    """Kinds of the lights that paths meet or connect to, beside the dome."""
    kinds = {LIGHT_KINDS[kind] for kind in features.shaped_lights}
    return kinds | ({int(DISTANT)} if features.distant_lights else set())


def build_light_functions(features: RenderFeatures) -> LightFunctions:
    """The functions of all lights of a scene of these features."""
    kinds = frozenset(light_kinds(features) | ({int(DOME)} if features.dome_image else set()))
    has_images = features.dome_image or features.light_images
    return LightFunctions(*build_lights(kinds, has_images, features.shaping))


@wp.func(inline=True)
def power_heuristic(pdf: float, other: float) -> float:
    """mis_weight of a sample drawn with density `pdf` where `other` competes (Veach 1997)."""
    return 1.0 / (1.0 + (other / pdf) * (other / pdf))


@wp.func(inline=True)
def shines_on(light: Light, links: wp.uint32) -> bool:
    """True where a light is linked to a shape with these bits, or to all."""
    return light.link == wp.uint32(0) or (light.link & links) != wp.uint32(0)


def build_solid_intersection(features: RenderFeatures, record: PathRecord, surface_at: Any) -> tuple[Any, ...]:
    """The fields `lone_solid`, `boundary`, `surface` and `solids` of `ShapeIntersection`."""
    Path, SceneData = record.struct, scene_struct(features)

    @wp.func(inline=True)
    def intersect_lone_solid(before: Path, solid: Solid, kind: int) -> Path:
        path = before
        span = solid_span(solid, kind, before.origin, before.direction)
        within = chord(span, before.start.inside != wp.uint32(0))
        path.t_in = within[0]
        path.t_out = within[1]
        end = path.t_in + before.flight
        path.flight = wp.where(end <= path.t_out, end, INFINITE)
        return path

    @wp.func(inline=True)
    def intersect_boundary(before: Path, solid: Solid, kind: int) -> Path:
        path = before
        span = solid_span(solid, kind, before.origin, before.direction)
        path.hit = intersect_solid_boundary(solid, span, before.start, before.hit)
        return path

    @wp.func(inline=True)
    def intersect_surface(before: Path, solid: Solid, kind: int, surface: Surface) -> Path:
        path = before
        span = solid_span(solid, kind, before.origin, before.direction)
        path.hit = intersect_solid_surface(solid, span, before.origin, before.direction, before.start, before.hit)
        is_nearer = path.hit.t < before.hit.t
        path.albedo = choose(is_nearer, surface.diffuse, before.albedo)
        path.emitted = choose(is_nearer, surface.emission, before.emitted)
        return path

    @wp.func
    def intersect_solids(scene: SceneData, before: Path) -> Path:
        path = before
        for s in range(scene.solids.shape[0]):
            solid = scene.solids[s]
            if wp.static(features.motion):
                solid = solid_at(solid, scene.motions, before.start.time)
            if solid.surface >= 0:
                if wp.static(features.passes):
                    span = solid_span(solid, solid.kind, before.origin, before.direction)
                    path.hit = intersect_open_surface(
                        solid, span, before.origin, before.direction, before.start, path.hit
                    )
                elif wp.static(features.surfaces):
                    surface = scene.surfaces[surface_at(scene, solid.surface)]
                    path = intersect_surface(path, solid, solid.kind, surface)
            elif wp.static(features.crossings):
                path = intersect_boundary(path, solid, solid.kind)
        return path

    return intersect_lone_solid, intersect_boundary, intersect_surface, intersect_solids


def build_shape_intersection(
    features: RenderFeatures, record: PathRecord, lights: LightFunctions, intersect_meshes: Any
) -> ShapeIntersection:
    """The functions of a kernel of these features."""
    Path, SceneData = record.struct, scene_struct(features)
    intersect_lights, intersect_all_solids = lights.intersect, build_intersect_solids(features)

    @wp.func
    def surface_at(scene: SceneData, item: int) -> int:
        if wp.static(features.instances):
            return scene.surface_of[item]
        return item

    @wp.func
    def hit_of_meshes(trees: wp.array(dtype=Bvh), path: Path) -> Hit:
        return intersect_meshes(trees, path.origin, path.direction, path.start, path.hit)

    @wp.func(inline=True)
    def take_mesh_hit(before: Path, hit: Hit, scene: SceneData) -> Path:
        path = before
        path.hit = hit
        if wp.static(features.surfaces and not features.shading):
            if hit.t < before.hit.t and hit.kind == SURFACE:
                surface = scene.surfaces[surface_at(scene, hit.item)]
                path.albedo = surface.diffuse
                path.emitted = surface.emission
        return path

    @wp.func
    def intersect(scene: SceneData, origin: wp.vec3, direction: wp.vec3, t_max: float, start: Start) -> Hit:
        hit = Hit()
        hit.t = t_max
        hit.kind = MISS
        if wp.static(bool(features.solids)):
            hit = intersect_all_solids(scene.solids, scene.motions, origin, direction, start, hit)
        if wp.static(features.meshes):
            hit = intersect_meshes(scene.meshes, origin, direction, start, hit)
        if wp.static(bool(features.shaped_lights)):
            if start.casters == wp.uint32(0):
                hit = intersect_lights(scene.lights, origin, direction, hit)
        return hit

    return ShapeIntersection(
        *build_solid_intersection(features, record, surface_at), hit_of_meshes, take_mesh_hit, surface_at, intersect
    )


def build_light_intersection(features: RenderFeatures, record: PathRecord, lights: LightFunctions) -> LightIntersection:
    """The functions of a kernel of these features."""
    Path, SceneData = record.struct, scene_struct(features)
    has_beyond = features.distant_lights or features.dome_image
    intersect_lights, pdf_of, radiance_of = lights.intersect, lights.pdf, lights.radiance

    @wp.func(inline=True)
    def hit_weight(path: Path, pdf_light: float) -> float:
        """mis_weight of a light that the path met by itself."""
        return wp.where(path.pdf_direction == CAMERA_RAY, 1.0, power_heuristic(path.pdf_direction, pdf_light))

    @wp.func(inline=True)
    def find_light(before: Path, light: Light, kind: int, item: int) -> Path:
        path = before
        path.hit = intersect_light(light, kind, item, before.origin, before.direction, before.hit)
        is_nearer = path.hit.t < before.hit.t
        position = before.origin + before.direction * wp.where(is_nearer, path.hit.t, 0.0)
        pdf = light_pdf(light, kind, before.origin, position, before.direction) * chance(light)
        emitted = emitted_radiance(light, kind, before.direction) * hit_weight(before, pdf)
        path.emitted = choose(is_nearer, emitted, before.emitted)
        return path

    @wp.func(inline=True)
    def look_beyond(before: Path, light: Light) -> Path:
        path = before
        is_seen = before.hit.kind == MISS and is_in_distant_light(light, before.direction)
        weight = hit_weight(before, cone_pdf(light.cone) * chance(light))
        path.emitted = before.emitted + light.radiance * wp.where(is_seen, weight, 0.0)
        return path

    @wp.func
    def found_light(scene: SceneData, path: Path, light: Light, position: wp.vec3) -> wp.vec3:
        """What the path finds of a light by itself, times its mis_weight."""
        if wp.static(features.links):
            is_found = light.casters == wp.uint32(0) or path.pdf_direction == CAMERA_RAY
            if not (shines_on(light, path.links) and is_found):
                return wp.vec3(0.0)
        pdf = pdf_of(light, scene.light_tables[0], path.hit, path.origin, position, path.direction)
        radiance = radiance_of(light, scene.light_tables[0], path.hit, position, path.direction)
        return radiance * hit_weight(path, pdf * chance(light))

    @wp.func
    def intersect_intricate_lights(scene: SceneData, before: Path) -> Path:
        path = before
        path.hit = intersect_lights(scene.lights, before.origin, before.direction, before.hit)
        if path.hit.kind == LIGHT and path.hit.t < path.flight:
            position = before.origin + before.direction * path.hit.t
            path.emitted = found_light(scene, path, scene.lights[path.hit.item], position)
        if wp.static(has_beyond):
            if path.hit.kind == MISS and path.flight >= 0.5 * INFINITE:
                for k in range(scene.lights.shape[0]):
                    light = scene.lights[k]
                    if light.kind == DOME or is_in_distant_light(light, path.direction):
                        path.emitted += found_light(scene, path, light, path.origin)
        return path

    return LightIntersection(find_light, look_beyond, intersect_intricate_lights)
