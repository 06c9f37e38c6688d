"""Next-event estimation, path by path: a connection to a point of a light, through all that is between.

Multiple importance sampling (Veach 1997, power heuristic) weighs it against the light that is met by scattered rays.
"""

from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.bsdf import Bsdf, eval_bsdf
from fgf_warp.device.geometry import BOUNDARY, MISS, OFFSET, SURFACE, coordinate_reach
from fgf_warp.device.lights import Light, LightSample, chance, choose_light, sample_light
from fgf_warp.device.medium import Medium, container_at, medium_at
from fgf_warp.device.numerics import INFINITE, max_component
from fgf_warp.device.phase import build_phase
from fgf_warp.device.rng import CONNECTION
from fgf_warp.device.surfaces import diffuse_pdf
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.boundaries import MAX_CROSSINGS, Boundaries
from fgf_warp.integrator.intersection import LightFunctions, ShapeIntersection, power_heuristic, shines_on
from fgf_warp.integrator.laws import LineLaws
from fgf_warp.integrator.media.value import MediumFunctions
from fgf_warp.integrator.path import ALL_LINKS, PathRecord
from fgf_warp.integrator.sampler import Sampler
from fgf_warp.integrator.scene_data import scene_struct
from fgf_warp.integrator.shading import SurfaceReading


@wp.struct
class Shadow:
    """What is between a vertex and a light."""

    transmittance: wp.vec3
    truncated: int


class Aim(NamedTuple):
    """Functions of the device; branch-free.

    Args:
        scatter_pdf: (path, lone, wi) -> float, pdf_solid_angle of scattering into `wi` at this event, and the share
            that scatters there.
        light_numbers: (path, seed) -> vec4, random numbers: which light, and where on it.
        aim: (path, lone, sample, pdf_choice) -> Path, with the connection as if nothing were between.
    """

    scatter_pdf: Any
    light_numbers: Any
    aim: Any


def build_aim(
    features: RenderFeatures, record: PathRecord, sampler: Sampler, medium: MediumFunctions, channel_weight: Any
) -> Aim:
    """The functions of a kernel of these features."""
    Path = record.struct
    draw, scattering = sampler.draw, medium.scattering
    eval_phase, _ = build_phase(features.phases)

    @wp.func(inline=True)
    def scatter_pdf(path: Path, lone: Medium, wi: wp.vec3) -> float:
        pdf = float(0.0)
        if wp.static(features.media):
            _albedo, phase = scattering(lone, path)
            pdf = eval_phase(phase, path.direction, wi)
        if wp.static(features.surfaces):
            pdf = wp.where(path.scatters == SURFACE, diffuse_pdf(path.hit.normal, wi), pdf)
        return pdf

    @wp.func(inline=True)
    def light_numbers(path: Path, seed: wp.uint64) -> wp.vec4:
        return draw(seed, path.pixel, path.sample_index, path.bounce, CONNECTION)

    @wp.func(inline=True)
    def aim(before: Path, lone: Medium, towards: LightSample, pdf_choice: float) -> Path:
        path = before
        path.to_light = towards.direction
        # Just short of the light, which would block itself.
        short_of = towards.distance - OFFSET * coordinate_reach(path.origin, wp.min(towards.distance, 1.0e30))
        path.light_distance = wp.where(towards.distance < INFINITE, short_of, INFINITE)
        pdf_light = towards.pdf_solid_angle * pdf_choice
        pdf_scatter = scatter_pdf(before, lone, towards.direction)
        is_possible = before.scatters != MISS and pdf_light > 0.0 and pdf_scatter > 0.0
        pdf_light = wp.where(is_possible, pdf_light, 1.0)
        mis_weight = wp.where(towards.only_connected == 1, 1.0, power_heuristic(pdf_light, pdf_scatter))
        weight = wp.where(is_possible, pdf_scatter / pdf_light * mis_weight, 0.0)
        arriving = wp.cw_mul(towards.radiance, channel_weight(before))
        path.light_share = wp.cw_mul(before.throughput, arriving) * weight
        return path

    return Aim(scatter_pdf, light_numbers, aim)


def build_shadow(
    features: RenderFeatures,
    record: PathRecord,
    laws: LineLaws,
    medium: MediumFunctions,
    boundaries: Boundaries,
    shapes: ShapeIntersection,
    surfaces: SurfaceReading,
) -> Any:
    """The function (scene, path, light, direction, distance, seed) -> Shadow."""
    Path, SceneData = record.struct, scene_struct(features)
    cross, carries_on, intersect = boundaries.cross, boundaries.carries_on, shapes.anything
    look_of, straight_share, transmittance = surfaces.look_of, surfaces.straight_share, medium.transmittance
    medium_at_depth, rates_of, is_from_medium, draw_rates = (
        laws.medium_at_depth,
        laws.rates_of,
        laws.is_from_medium,
        laws.draw_rates,
    )
    draws_rates = features.frozen and features.looks_up_media

    @wp.func
    def find_shadow(
        scene: SceneData, path: Path, light: Light, direction: wp.vec3, distance: float, seed: wp.uint64
    ) -> Shadow:
        result = Shadow()
        result.transmittance = wp.vec3(1.0)
        start = path.start
        segment = float(0.0)
        from_medium = is_from_medium(path)
        medium = int(-1)
        casting = ALL_LINKS
        if wp.static(features.links):
            start.casters = light.casters
            casting = light.casting_containers
        if wp.static(features.media):
            medium = medium_at(scene.containers, start.inside & casting)
        rates = rates_of(path)
        # Whose rates are to be drawn; those of the medium that the path is in, it has.
        body = int(-1)
        if wp.static(draws_rates):
            if path.body < 0 or scene.containers[path.body].medium != medium:
                body = container_at(scene.containers, start.inside & casting)
        for _ in range(MAX_CROSSINGS):
            hit = intersect(scene, path.origin, direction, distance, start)
            beyond = int(-1)
            goes_on = bool(True)
            gate = int(-1)
            lets_through = hit.kind == BOUNDARY
            if hit.kind == BOUNDARY:
                gate = hit.item
            if wp.static(features.passes):
                if hit.kind == SURFACE:
                    straight = straight_share(scene, hit, direction, start)
                    result.transmittance = wp.cw_mul(result.transmittance, straight)
                    lets_through = max_component(straight) > 0.0
                    gate = look_of(scene, hit.item).container
                    if gate < 0:
                        start.passed = hit.t
            if wp.static(features.media):
                beyond = medium
                if lets_through and gate >= 0:
                    inside = start.inside & casting
                    start = cross(scene, start, gate, path.origin, hit.t)
                    beyond = medium_at(scene.containers, start.inside & casting)
                    goes_on = carries_on(scene.containers, medium, inside, start.inside & casting, start.entered)
                if medium >= 0 and (not lets_through or not goes_on):
                    crossed = medium_at_depth(scene.media[scene.first_medium + medium], path.depth + 1)
                    if wp.static(draws_rates):
                        if body >= 0:
                            rates = draw_rates(scene, path, crossed, body, seed)
                    passed = transmittance(crossed, hit.t - segment, from_medium, rates)
                    result.transmittance = wp.cw_mul(result.transmittance, passed)
            if hit.kind == MISS:
                return result
            if not lets_through:
                result.transmittance = wp.vec3(0.0)
                return result
            if not goes_on:
                segment = hit.t
                from_medium = False
                medium = beyond
                if wp.static(draws_rates):
                    body = container_at(scene.containers, start.inside & casting)
        result.transmittance = wp.vec3(0.0)
        result.truncated = 1
        return result

    return find_shadow


def build_surface_connection(
    features: RenderFeatures,
    record: PathRecord,
    boundaries: Boundaries,
    surfaces: SurfaceReading,
    channel_weight: Any,
) -> tuple[Any, Any]:
    """Of a path at a shaded surface, what a connection brings by way of it, and the side that light comes from.

    Returns:
        The functions (scene, path, bsdf, sample, pdf_choice) -> Path, and (scene, path, direction) -> Path.
    """
    Path, SceneData = record.struct, scene_struct(features)
    look_of, change_side = surfaces.look_of, boundaries.change_side

    @wp.func
    def light_surface(scene: SceneData, before: Path, bsdf: Bsdf, towards: LightSample, pdf_choice: float) -> Path:
        path = before
        path.light_share = wp.vec3(0.0)
        scattered = eval_bsdf(scene.shading[0].albedos, bsdf, towards.direction)
        pdf_light = towards.pdf_solid_angle * pdf_choice
        if pdf_light > 0.0:
            mis_weight = wp.where(towards.only_connected == 1, 1.0, power_heuristic(pdf_light, scattered[3]))
            value = wp.vec3(scattered[0], scattered[1], scattered[2]) * (mis_weight / pdf_light)
            arriving = wp.cw_mul(towards.radiance, channel_weight(before))
            path.light_share = wp.cw_mul(before.incoming, wp.cw_mul(value, arriving))
        return path

    @wp.func
    def face_light(scene: SceneData, before: Path, direction: wp.vec3) -> Path:
        path = before
        container = look_of(scene, before.hit.item).container
        is_beyond = wp.dot(before.hit.normal, direction) < 0.0
        if container >= 0 and is_beyond != (before.transmits == 1):
            path = change_side(scene, before, container)
            back = wp.where(is_beyond, -2.0, 2.0) * OFFSET * coordinate_reach(before.origin, before.hit.t)
            path.origin = before.origin + before.hit.normal * back
        return path

    return light_surface, face_light


def build_links_here(features: RenderFeatures, record: PathRecord, shapes: ShapeIntersection) -> Any:
    """The function (scene, path) -> uint32: link bits of what the path has just been scattered by."""
    Path, SceneData = record.struct, scene_struct(features)
    surface_at = shapes.surface_at

    @wp.func
    def links_here(scene: SceneData, path: Path) -> wp.uint32:
        if wp.static(features.surfaces):
            if path.scatters == SURFACE:
                return scene.surfaces[surface_at(scene, path.hit.item)].light_links
        links = wp.uint32(ALL_LINKS)
        if wp.static(features.media):
            links = scene.containers[container_at(scene.containers, path.start.inside)].light_links
        return links

    return links_here


def build_next_event(
    features: RenderFeatures,
    record: PathRecord,
    aim: Aim,
    lights: LightFunctions,
    steps: tuple[Any, Any, Any, Any],
) -> Any:
    """The function (scene, lone, path, bsdf, seed) -> Path, with the light that a connection brings.

    Args:
        features: of the kernel.
        record: its path.
        aim: from `build_aim`.
        lights: of the scene.
        steps: what `build_links_here`, `build_shadow` and `build_surface_connection` give.
    """
    Path, SceneData = record.struct, scene_struct(features)
    scatter_pdf, light_numbers, aim_at = aim
    links_here, find_shadow, light_surface, face_light = steps
    sample_any_light = lights.sample

    @wp.func
    def next_event(scene: SceneData, lone: Medium, before: Path, bsdf: Bsdf, seed: wp.uint64) -> Path:
        path = before
        is_shaded = bool(False)
        if wp.static(features.shading):
            is_shaded = before.scatters == SURFACE
        if not is_shaded:
            path.pdf_direction = scatter_pdf(path, lone, path.wi)
        xi = light_numbers(path, seed)
        light = scene.lights[choose_light(scene.lights, xi[0])]
        towards = LightSample()
        if wp.static(features.intricate_lights):
            towards = sample_any_light(light, scene.light_tables[0], path.origin, xi[1], xi[2])
        else:
            towards = sample_light(light, light.kind, path.origin, xi[1], xi[2])
        if wp.static(features.links):
            path.links = links_here(scene, path)
            if not shines_on(light, path.links):
                return path
        path = aim_at(path, lone, towards, chance(light))
        if wp.static(features.shading):
            if is_shaded:
                path = light_surface(scene, path, bsdf, towards, chance(light))
        if max_component(path.light_share) > 0.0:
            lit = path
            if wp.static(features.refracts):
                if is_shaded:
                    lit = face_light(scene, path, path.to_light)
            shadow = find_shadow(scene, lit, light, path.to_light, path.light_distance, seed)
            path.truncated = wp.max(path.truncated, shadow.truncated)
            share = path.light_share
            if wp.static(features.refracts):
                share = share / lit.eta_scale
            path.radiance += wp.cw_mul(share, shadow.transmittance)
        return path

    return next_event
