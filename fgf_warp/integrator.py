"""The life of a path, from the camera to its end, built for exactly the features that a scene has.

Path tracing with multiple scattering, next-event estimation, and multiple importance sampling (Veach 1997, power
heuristic) between lights and phase function or BSDF. Free flights are sampled in proportion to their density, so
they carry no weight; in a medium whose channels differ, one channel is drawn per path and the balance heuristic
over channels weighs it. Transport kernels: section 4 of Bitterli et al. 2018, in the reciprocal or the renewal way.

A path lives in stages: depart, fly, look, meet, arrive, connect, go on. They are written once, each from a `Path` to a
`Path`, and two drivers run them: on CUDA a thread takes one path through all of them; on the CPU a pool of lanes
takes `LANES` paths through one stage after the other, so that the compiler makes vector code of the stages that have
neither branches nor look-ups (see `device/lanes.py`).
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from fgf_warp.device import film as film_module
from fgf_warp.device import lanes as lanes_module
from fgf_warp.device.bvh import Bvh, intersect_meshes
from fgf_warp.device.camera import Camera, camera_direction, row_of
from fgf_warp.device.geometry import (
    BOUNDARY,
    CUBE,
    CYLINDER,
    LIGHT,
    MARGIN,
    MISS,
    OFFSET,
    SPHERE,
    SURFACE,
    Hit,
    Solid,
    Start,
    coordinate_reach,
    cross_boundary,
    intersect_solids,
    meet_solid_boundary,
    meet_solid_surface,
    offset_from_surface,
    solid_span,
)
from fgf_warp.device.lanes import LANES, Path
from fgf_warp.device.law import (
    ESCAPED,
    Law,
    density_mm,
    density_sm,
    fly_fractional,
    fly_power,
    read_table,
    sample_mm,
    sample_sm,
    shorten_fractional,
    table_place,
    transmittance_ms,
    transmittance_ss,
)
from fgf_warp.device.lights import (
    Light,
    cone_pdf,
    intersect_lights,
    is_in_distant_light,
    light_pdf,
    sample_light,
)
from fgf_warp.device.medium import Container, Medium, medium_at
from fgf_warp.device.numerics import INFINITE, choose, is_finite, log_positive, max_component
from fgf_warp.device.phase import eval_hg, sample_hg
from fgf_warp.device.rng import CAMERA, CONNECTION, CORRELATED_FLIGHT, EVENT, uniforms
from fgf_warp.device.surfaces import Surface, diffuse_pdf, sample_diffuse
from fgf_warp.features import RenderFeatures
from fgf_warp.settings import Aov

Film = film_module.Film
lane_floats = lanes_module.lane_floats

MAX_CROSSINGS = wp.constant(1024)
"""Boundaries between two scattering events; a path that crosses more is cut and counted as truncated."""
CAMERA_RAY = wp.constant(-1.0)
"""Stands for the pdf of a direction that no light sampling competes with."""
SAMPLE_FLOATS = wp.constant(12)
"""What a path leaves in the pool's buffer: radiance, alpha, depth, transmittance, albedo, truncated."""


@wp.struct
class SceneData:
    """The uploaded scene."""

    camera: Camera
    environment: wp.vec3
    solids: wp.array(dtype=Solid)
    meshes: Bvh
    surfaces: wp.array(dtype=Surface)
    media: wp.array(dtype=Medium)
    containers: wp.array(dtype=Container)
    lights: wp.array(dtype=Light)
    flight_tables: wp.array(dtype=wp.vec2)
    camera_inside: wp.uint32
    """Containers around the camera."""


@wp.struct
class Limits:
    """Where a path ends that nothing else ends."""

    max_depth: int
    roulette_depth: int


@wp.struct
class Connection:
    """The share of light that arrives along a connection."""

    transmittance: wp.vec3
    truncated: int


@dataclass(frozen=True)
class Program:
    """The kernels of one set of features.

    Args:
        features: what they were built for.
        render_threads: one thread per pixel, for CUDA.
        render_pool: one pool of lanes per launch, for the CPU.
    """

    features: RenderFeatures
    render_threads: Any
    render_pool: Any


@wp.func(inline=True)
def power_heuristic(pdf: float, other: float) -> float:
    """mis_weight of a sample drawn with density `pdf` where `other` competes."""
    return 1.0 / (1.0 + (other / pdf) * (other / pdf))


@wp.func(inline=True)
def mean_optical_depth(extinction: float, t: float) -> float:
    """u = sigma_m t, saturated."""
    return wp.min(extinction * t, ESCAPED)


@wp.func
def law_of_channel(medium: Medium, channel: int) -> Law:
    """The line law of one channel."""
    if channel == 0:
        return medium.law
    if channel == 1:
        return medium.law_green
    return medium.law_blue


@wp.func
def segment_transmittance(law: Law, u: float, from_medium: bool) -> float:
    """Share of light that passes a segment which ends uncorrelated: Tms from a medium vertex, else Tss."""
    if from_medium and law.reciprocal == 1:
        return transmittance_ms(law, u)
    return transmittance_ss(law, u)


@wp.func
def flight_density(law: Law, u: float, from_medium: bool) -> float:
    """Density in u of the next scattering event: Tmm from a medium vertex, else Tsm."""
    if from_medium and law.reciprocal == 1:
        return density_mm(law, u)
    return density_sm(law, u)


@cache
def build_program(features: RenderFeatures) -> Program:
    """The kernels that render scenes of these features; compiled when they are first loaded on a device."""
    sees_first_segment = bool(features.aovs & {Aov.DEPTH, Aov.TRANSMITTANCE})
    has_surfaces, has_lights = features.surfaces, features.shaped_lights
    # One medium of one law is the same for all lanes; anything else is looked up lane by lane.
    lone_law = features.lone_law
    pool_floats = lane_floats(features)
    load, store, is_alive, place_lane = lanes_module.build_lanes(features)

    # ---- depart and fly: how far would the path fly, were the medium unbounded?

    @wp.func(inline=True)
    def depart(before: Path, seed: wp.uint64) -> Path:
        path = before
        path.bounce = before.bounce + 1
        path.xi = uniforms(seed, before.pixel, before.sample, path.bounce, EVENT)
        path.flight = wp.where(before.keeps == 1, before.flight, INFINITE)
        return path

    @wp.func(inline=True)
    def begin_flight(before: Path, law: Law) -> Path:
        """In a lone medium: the exponent E, and where in the flight table it falls."""
        path = before
        path.flight = -log_positive(before.xi[0])
        if wp.static(lone_law == "fractional"):
            path.ln_ratio = table_place(law, path.flight)
        return path

    @wp.func(inline=True)
    def end_flight(before: Path, medium: Medium, seed: wp.uint64) -> Path:
        """In a lone medium: the distance."""
        path = before
        remembers = before.from_medium == 1 and medium.law.reciprocal == 1
        u = before.flight / medium.law.rate
        if wp.static(lone_law == "power"):
            u = fly_power(medium.law, before.flight, remembers)
        if wp.static(lone_law == "fractional"):
            u = fly_fractional(before.flight, before.ln_ratio)
            more = uniforms(seed, before.pixel, before.sample, before.bounce, CORRELATED_FLIGHT)
            u = wp.where(remembers, shorten_fractional(medium.law, u, more[0], more[1]), u)
        is_in_medium = before.start.inside != wp.uint32(0)
        path.medium = wp.where(is_in_medium, medium.index, -1)
        ends = before.segment + wp.min(u / medium.extinction[0], 0.5 * INFINITE)
        path.flight = wp.where(is_in_medium, ends, INFINITE)
        return path

    @wp.func
    def fly_anywhere(scene: SceneData, before: Path, seed: wp.uint64) -> Path:
        """The same among many media, or with channels that differ."""
        path = before
        path.medium = medium_at(scene.containers, before.start.inside)
        if path.medium >= 0 and path.keeps == 0:
            medium = scene.media[path.medium]
            law = law_of_channel(medium, path.channel)
            u = float(0.0)
            if path.from_medium == 1 and law.reciprocal == 1:
                more = uniforms(seed, path.pixel, path.sample, path.bounce, CORRELATED_FLIGHT)
                u = sample_mm(law, scene.flight_tables, path.xi[0], more[0], more[1])
            else:
                u = sample_sm(law, scene.flight_tables, path.xi[0])
            path.flight = path.segment + wp.min(u / medium.extinction[path.channel], 0.5 * INFINITE)
        return path

    # ---- look: what lies ahead, as far as it flies?

    @wp.func(inline=True)
    def open_eyes(before: Path) -> Path:
        path = before
        margin = float(0.0)
        if wp.static(features.meshes):
            margin = 2.0 * MARGIN * coordinate_reach(before.origin, before.flight)
        path.hit.t = wp.where(before.medium >= 0, before.flight + margin, INFINITE)
        if wp.static(sees_first_segment):
            path.hit.t = wp.where(before.depth == 0, INFINITE, path.hit.t)
        path.hit.kind = MISS
        return path

    @wp.func(inline=True)
    def look_at_boundary(before: Path, solid: Solid, kind: int) -> Path:
        path = before
        span = solid_span(solid, kind, before.origin, before.direction)
        path.hit = meet_solid_boundary(solid, span, before.start, before.hit)
        return path

    @wp.func(inline=True)
    def look_at_surface(before: Path, solid: Solid, kind: int) -> Path:
        path = before
        span = solid_span(solid, kind, before.origin, before.direction)
        path.hit = meet_solid_surface(solid, span, before.origin, before.direction, before.hit)
        return path

    @wp.func
    def look_at_the_rest(scene: SceneData, before: Path) -> Path:
        path = before
        if wp.static(features.meshes):
            path.hit = intersect_meshes(scene.meshes, before.origin, before.direction, before.start, path.hit)
        if wp.static(has_lights):
            path.hit = intersect_lights(scene.lights, before.origin, before.direction, path.hit)
        return path

    # ---- meet: what of the scene does it find there, and does the light end here?

    @wp.func
    def attenuation(medium: Medium, t: float, from_medium: bool) -> wp.vec3:
        red = segment_transmittance(medium.law, mean_optical_depth(medium.extinction[0], t), from_medium)
        if wp.static(features.chromatic):
            return wp.vec3(
                red,
                segment_transmittance(medium.law_green, mean_optical_depth(medium.extinction[1], t), from_medium),
                segment_transmittance(medium.law_blue, mean_optical_depth(medium.extinction[2], t), from_medium),
            )
        return wp.vec3(red)

    @wp.func
    def channel_densities(medium: Medium, t: float, from_medium: bool) -> wp.vec3:
        """Per channel, the density with which a flight ends at t."""
        densities = wp.vec3()
        for channel in range(3):
            extinction = medium.extinction[channel]
            u = mean_optical_depth(extinction, t)
            densities[channel] = extinction * flight_density(law_of_channel(medium, channel), u, from_medium)
        return densities

    @wp.func
    def intersect(scene: SceneData, origin: wp.vec3, direction: wp.vec3, t_max: float, start: Start) -> Hit:
        hit = Hit()
        hit.t = t_max
        hit.kind = MISS
        if wp.static(features.solids):
            hit = intersect_solids(scene.solids, origin, direction, start, hit)
        if wp.static(features.meshes):
            hit = intersect_meshes(scene.meshes, origin, direction, start, hit)
        if wp.static(has_lights):
            hit = intersect_lights(scene.lights, origin, direction, hit)
        return hit

    @wp.func
    def segment_end(scene: SceneData, path: Path) -> float:
        """Distance at which the path would leave the medium that it is in, if it did not scatter."""
        start = path.start
        hit = path.hit
        for _ in range(MAX_CROSSINGS):
            if hit.kind != BOUNDARY:
                break
            start.inside = cross_boundary(start.inside, hit.item)
            start.t_min = hit.t
            start.crossed = hit.item
            if medium_at(scene.containers, start.inside) != path.medium:
                break
            hit = intersect(scene, path.origin, path.direction, INFINITE, start)
        return hit.t

    @wp.func(inline=True)
    def channel_weight(path: Path) -> wp.vec3:
        """Balance heuristic over the channel that the flights were sampled from."""
        weight = wp.vec3(1.0, 1.0, 1.0)
        if wp.static(features.chromatic):
            total = path.channel_pdfs[0] + path.channel_pdfs[1] + path.channel_pdfs[2]
            weight = path.channel_pdfs * (3.0 / total)
        return weight

    @wp.func(inline=True)
    def hit_weight(path: Path, pdf_light: float) -> float:
        """mis_weight of a light that the path met by itself."""
        if path.pdf_direction == CAMERA_RAY:
            return 1.0
        return power_heuristic(path.pdf_direction, pdf_light)

    @wp.func
    def meet(scene: SceneData, before: Path) -> Path:
        """Look-ups at the event, lane by lane; only scenes that need them have this stage."""
        path = before
        scatters = before.medium >= 0 and before.flight <= before.hit.t
        light_count = float(scene.lights.shape[0])
        path.keeps = 0
        if wp.static(features.media and lone_law == ""):
            if before.hit.kind == BOUNDARY and not scatters:
                beyond = medium_at(scene.containers, cross_boundary(before.start.inside, before.hit.item))
                if beyond == path.medium:
                    path.keeps = 1
            if path.medium >= 0 and path.keeps == 0:
                medium = scene.media[path.medium]
                path.albedo = medium.albedo
                path.asymmetry = medium.asymmetry
                if wp.static(features.chromatic):
                    densities = wp.vec3(1.0)
                    if scatters:
                        t = before.flight - before.segment
                        densities = channel_densities(medium, t, before.from_medium == 1)
                    else:
                        densities = attenuation(medium, before.hit.t - before.segment, before.from_medium == 1)
                    relative = densities / wp.max(densities[path.channel], 1.0e-37)
                    path.channel_pdfs = wp.cw_mul(path.channel_pdfs, relative)
        if wp.static(Aov.TRANSMITTANCE in features.aovs):
            if path.depth == 0 and path.medium >= 0 and path.has_met_medium == 0:
                if scatters or path.keeps == 0:
                    end = segment_end(scene, before)
                    path.first_transmittance = attenuation(scene.media[path.medium], end - before.segment, False)
                    path.has_met_medium = 1
        if wp.static(has_surfaces):
            if before.hit.kind == SURFACE and not scatters:
                surface = scene.surfaces[before.hit.item]
                path.albedo = surface.diffuse
                emitted = wp.cw_mul(surface.emission, channel_weight(path))
                path.radiance += wp.cw_mul(path.throughput, emitted)
        if wp.static(has_lights):
            if before.hit.kind == LIGHT and not scatters:
                # A light adds its radiance where it is met from its front, and is black otherwise.
                light = scene.lights[before.hit.item]
                if wp.dot(before.hit.normal, path.direction) < 0.0:
                    position = path.origin + path.direction * before.hit.t
                    pdf_light = light_pdf(light, path.origin, position, path.direction) / light_count
                    met = light.radiance * hit_weight(path, pdf_light)
                    path.radiance += wp.cw_mul(path.throughput, wp.cw_mul(met, channel_weight(path)))
        if wp.static(features.distant_lights):
            if before.hit.kind == MISS and not scatters:
                for i in range(scene.lights.shape[0]):
                    light = scene.lights[i]
                    if is_in_distant_light(light, path.direction):
                        beyond = light.radiance * hit_weight(path, cone_pdf(light.cone) / light_count)
                        path.radiance += wp.cw_mul(path.throughput, wp.cw_mul(beyond, channel_weight(path)))
        return path

    # ---- arrive: cross a boundary, leave the scene, end at a light, or scatter.

    @wp.func(inline=True)
    def arrive(before: Path, lone: Medium, environment: wp.vec3, forward: wp.vec3, limits: Limits) -> Path:
        path = before
        is_alive = before.alive == 1
        scatters_in_medium = is_alive and before.medium >= 0 and before.flight <= before.hit.t
        arrives = is_alive and not scatters_in_medium
        crosses = arrives and before.hit.kind == BOUNDARY
        escapes = arrives and before.hit.kind == MISS
        meets_light = arrives and before.hit.kind == LIGHT
        meets_surface = arrives and before.hit.kind == SURFACE

        if wp.static(Aov.DEPTH in features.aovs):
            is_first = before.depth == 0 and before.hit.kind != MISS and before.first_depth == INFINITE
            ahead = before.hit.t * wp.dot(before.direction, forward)
            path.first_depth = wp.where(is_first, ahead, before.first_depth)

        # A boundary lets it through, and ends its memory unless the medium is the same beyond.
        is_lost = bool(False)
        if wp.static(features.media):
            crossed = cross_boundary(before.start.inside, wp.where(crosses, before.hit.item, 0))
            path.start.inside = wp.where(crosses, crossed, before.start.inside)
            path.start.t_min = wp.where(crosses, before.hit.t, wp.where(is_alive, 0.0, before.start.t_min))
            path.start.crossed = wp.where(crosses, before.hit.item, wp.where(is_alive, -1, before.start.crossed))
            renewed = wp.where(before.keeps == 1, before.segment, before.hit.t)
            path.segment = wp.where(crosses, renewed, wp.where(is_alive, 0.0, before.segment))
            step = 2.0 * OFFSET * coordinate_reach(before.origin, 2.0 * before.hit.t)
            path.start.slack = wp.where(meets_surface, step, wp.where(scatters_in_medium, 0.0, before.start.slack))
            path.crossings = before.crossings + wp.where(crosses, 1, 0)
            is_lost = path.crossings > MAX_CROSSINGS

        # Beyond the scene there is only light.
        if wp.static(features.environment):
            beyond = wp.cw_mul(before.throughput, wp.cw_mul(environment, channel_weight(before)))
            path.radiance = before.radiance + beyond * wp.where(escapes, 1.0, 0.0)

        # It scatters: in the medium, or from a surface.
        would_scatter = scatters_in_medium or meets_surface
        t = wp.where(would_scatter, wp.min(before.hit.t, before.flight), 0.0)
        albedo = wp.vec3(0.0, 0.0, 0.0)
        wi = before.direction
        if wp.static(features.media):
            asymmetry = float(0.0)
            if wp.static(lone_law == ""):
                asymmetry = before.asymmetry
                albedo = before.albedo
            else:
                asymmetry = lone.asymmetry
                albedo = lone.albedo
            wi = sample_hg(asymmetry, before.direction, before.xi[2], before.xi[3])
            if wp.static(features.meshes):
                # Not so close to a face ahead that rounding could put the event behind it.
                clear = wp.max(
                    before.hit.t - MARGIN * coordinate_reach(before.origin, before.flight), 0.5 * before.hit.t
                )
                t = wp.where(scatters_in_medium, wp.min(before.flight, clear), t)
        path.origin = before.origin + before.direction * t
        if wp.static(has_surfaces):
            faces = wp.dot(before.hit.normal, before.direction) < 0.0
            normal = choose(faces, before.hit.normal, -before.hit.normal)
            path.hit.normal = normal
            off_surface = offset_from_surface(path.origin, normal, before.hit.t)
            path.origin = choose(meets_surface, off_surface, path.origin)
            wi = choose(meets_surface, sample_diffuse(normal, before.xi[2], before.xi[3]), wi)
            albedo = choose(meets_surface, before.albedo, albedo)
        if wp.static(Aov.ALBEDO in features.aovs):
            is_first = before.depth == 0 and would_scatter
            path.first_albedo = choose(is_first, albedo, before.first_albedo)
        dimmed = wp.cw_mul(before.throughput, albedo)
        is_absorbed = would_scatter and max_component(dimmed) == 0.0
        is_cut = would_scatter and not is_absorbed and before.depth >= limits.max_depth
        scatters = would_scatter and not is_absorbed and not is_cut
        path.throughput = choose(scatters, dimmed, before.throughput)
        path.wi = choose(scatters, wi, before.direction)
        path.scatters = wp.where(scatters, wp.where(meets_surface, SURFACE, BOUNDARY), MISS)
        remembers = scatters_in_medium or (crosses and before.keeps == 1 and before.from_medium == 1)
        path.from_medium = wp.where(remembers, 1, 0)
        path.alpha = wp.where(would_scatter or meets_light, 1.0, before.alpha)
        path.truncated = wp.where(is_cut or is_lost, 1, before.truncated)
        ends = escapes or meets_light or is_cut or is_absorbed or is_lost
        path.alive = wp.where(ends, 0, before.alive)
        return path

    # ---- connect: next-event estimation.

    @wp.func
    def passage(scene: SceneData, path: Path, direction: wp.vec3, distance: float) -> Connection:
        """What passes from a vertex to a light through the media between them."""
        result = Connection()
        result.transmittance = wp.vec3(1.0)
        start = path.start
        segment = float(0.0)
        from_medium = path.from_medium == 1
        medium = int(-1)
        if wp.static(features.media):
            medium = medium_at(scene.containers, start.inside)
        for _ in range(MAX_CROSSINGS):
            hit = intersect(scene, path.origin, direction, distance, start)
            beyond = int(-1)
            if wp.static(features.media):
                if hit.kind == BOUNDARY:
                    start.inside = cross_boundary(start.inside, hit.item)
                    start.t_min = hit.t
                    start.crossed = hit.item
                    beyond = medium_at(scene.containers, start.inside)
                if medium >= 0 and (hit.kind != BOUNDARY or beyond != medium):
                    passed = attenuation(scene.media[medium], hit.t - segment, from_medium)
                    result.transmittance = wp.cw_mul(result.transmittance, passed)
            if hit.kind == MISS:
                return result
            if hit.kind != BOUNDARY:
                result.transmittance = wp.vec3(0.0)
                return result
            if beyond != medium:
                segment = hit.t
                from_medium = False
                medium = beyond
        result.transmittance = wp.vec3(0.0)
        result.truncated = 1
        return result

    @wp.func
    def connect(scene: SceneData, lone: Medium, before: Path, seed: wp.uint64) -> Path:
        path = before
        asymmetry = float(0.0)
        if wp.static(features.media):
            if wp.static(lone_law == ""):
                asymmetry = path.asymmetry
            else:
                asymmetry = lone.asymmetry
        is_surface = path.scatters == SURFACE
        if is_surface:
            path.pdf_direction = diffuse_pdf(path.hit.normal, path.wi)
        else:
            path.pdf_direction = eval_hg(asymmetry, path.direction, path.wi)
        xi = uniforms(seed, path.pixel, path.sample, path.bounce, CONNECTION)
        light_count = float(scene.lights.shape[0])
        light_index = wp.min(int(xi[0] * light_count), scene.lights.shape[0] - 1)
        towards = sample_light(scene.lights[light_index], path.origin, xi[1], xi[2])
        if towards.pdf_solid_angle > 0.0:
            pdf_scatter = float(0.0)
            if is_surface:
                pdf_scatter = diffuse_pdf(path.hit.normal, towards.direction)
            else:
                pdf_scatter = eval_hg(asymmetry, path.direction, towards.direction)
            if pdf_scatter > 0.0:
                # Just short of the light, which would block itself.
                short_of = towards.distance - OFFSET * coordinate_reach(path.origin, towards.distance)
                distance = wp.where(towards.distance < INFINITE, short_of, INFINITE)
                link = passage(scene, path, towards.direction, distance)
                path.truncated = wp.max(path.truncated, link.truncated)
                pdf_light = towards.pdf_solid_angle / light_count
                weight = pdf_scatter / pdf_light
                if towards.is_delta == 0:
                    weight *= power_heuristic(pdf_light, pdf_scatter)
                arriving = wp.cw_mul(wp.cw_mul(towards.radiance, link.transmittance), channel_weight(path))
                path.radiance += wp.cw_mul(path.throughput, arriving) * weight
        return path

    # ---- go on: roulette, and the new direction.

    @wp.func(inline=True)
    def go_on(before: Path, limits: Limits) -> Path:
        path = before
        scattered = before.scatters != MISS
        path.depth = before.depth + wp.where(scattered, 1, 0)
        path.crossings = wp.where(scattered, 0, before.crossings)
        plays = scattered and path.depth > limits.roulette_depth
        best = max_component(wp.cw_mul(before.throughput, channel_weight(before)))
        survival = wp.where(plays, wp.min(best, 1.0), 1.0)
        path.alive = wp.where(plays and before.xi[1] >= survival, 0, before.alive)
        path.throughput = before.throughput / wp.max(survival, 1.0e-37)
        path.direction = before.wi
        return path

    # ---- birth and death.

    @wp.func(inline=True)
    def aim(camera: Camera, seed: wp.uint64, pixel: int, sample: int, row: int, column: int) -> Path:
        """What tells one new path from another."""
        path = Path()
        path.pixel = pixel
        path.sample = sample
        path.alive = 1
        xi = uniforms(seed, pixel, sample, 0, CAMERA)
        path.direction = camera_direction(camera, row, column, xi[0], xi[1])
        if wp.static(features.chromatic):
            path.channel = wp.min(int(xi[2] * 3.0), 2)
        return path

    @wp.func(inline=True)
    def emit(scene: SceneData, aimed: Path) -> Path:
        """A path at the camera."""
        path = Path()
        path.pixel = aimed.pixel
        path.sample = aimed.sample
        path.direction = aimed.direction
        path.channel = aimed.channel
        path.alive = 1
        path.origin = scene.camera.position
        path.throughput = wp.vec3(1.0, 1.0, 1.0)
        path.start.inside = scene.camera_inside
        path.start.crossed = -1
        path.pdf_direction = CAMERA_RAY
        path.channel_pdfs = wp.vec3(1.0, 1.0, 1.0)
        path.first_depth = INFINITE
        path.first_transmittance = wp.vec3(1.0, 1.0, 1.0)
        path.medium = -1
        return path

    @wp.func
    def deposit(
        film: Film,
        pixel: int,
        radiance: wp.vec3,
        alpha: float,
        depth: float,
        transmittance: wp.vec3,
        albedo: wp.vec3,
        truncated: int,
    ):
        film.truncated[pixel] = film.truncated[pixel] + truncated
        if is_finite(radiance):
            value = wp.vec3d(radiance)
            film.radiance[pixel] = film.radiance[pixel] + value
            film.radiance_sq[pixel] = film.radiance_sq[pixel] + wp.cw_mul(value, value)
            film.alpha[pixel] = film.alpha[pixel] + wp.float64(alpha)
            if wp.static(Aov.DEPTH in features.aovs):
                film.depth[pixel] = wp.min(film.depth[pixel], depth)
            if wp.static(Aov.TRANSMITTANCE in features.aovs):
                film.transmittance[pixel] = film.transmittance[pixel] + wp.vec3d(transmittance)
            if wp.static(Aov.ALBEDO in features.aovs):
                film.albedo[pixel] = film.albedo[pixel] + wp.vec3d(albedo)
        else:
            film.invalid[pixel] = film.invalid[pixel] + 1

    # ---- the drivers.

    @wp.func
    def lone_medium(scene: SceneData) -> Medium:
        """The only medium, the same for every lane."""
        medium = Medium()
        if wp.static(lone_law != ""):
            medium = scene.media[scene.containers[0].medium]
        return medium

    needs_meeting = has_surfaces or has_lights or features.distant_lights or lone_law == ""
    needs_meeting = needs_meeting and (features.media or has_surfaces or has_lights or features.distant_lights)
    needs_meeting = needs_meeting or Aov.TRANSMITTANCE in features.aovs

    @wp.kernel(module="unique", enable_backward=False, module_options={"fuse_fp": False})
    def render_threads(
        scene: SceneData,
        limits: Limits,
        film: Film,
        seed: wp.uint64,
        first_pixel: int,
        first_sample: int,
        sample_count: int,
    ):
        pixel = first_pixel + wp.tid()
        lone = lone_medium(scene)
        for sample in range(first_sample, first_sample + sample_count):
            width = scene.camera.width
            path = emit(scene, aim(scene.camera, seed, pixel, sample, pixel // width, pixel % width))
            while path.alive == 1:
                path = depart(path, seed)
                if wp.static(features.media):
                    if wp.static(lone_law == ""):
                        path = fly_anywhere(scene, path, seed)
                    else:
                        path = begin_flight(path, lone.law)
                        if wp.static(lone_law == "fractional"):
                            path.ln_ratio = read_table(lone.law, scene.flight_tables, path.ln_ratio)
                        path = end_flight(path, lone, seed)
                path = open_eyes(path)
                if wp.static(features.solids):
                    path.hit = intersect_solids(scene.solids, path.origin, path.direction, path.start, path.hit)
                if wp.static(features.meshes or has_lights):
                    path = look_at_the_rest(scene, path)
                if wp.static(needs_meeting):
                    path = meet(scene, path)
                path = arrive(path, lone, scene.environment, scene.camera.forward, limits)
                if wp.static(features.connections):
                    if path.scatters != MISS:
                        path = connect(scene, lone, path, seed)
                path = go_on(path, limits)
            deposit(
                film,
                pixel,
                path.radiance,
                path.alpha,
                path.first_depth,
                path.first_transmittance,
                path.first_albedo,
                path.truncated,
            )

    @wp.kernel(module="unique", enable_backward=False, module_options={"fuse_fp": False})
    def render_pool(
        scene: SceneData,
        limits: Limits,
        film: Film,
        seed: wp.uint64,
        scratch: wp.array(dtype=float),
        first_pixel: int,
        pixel_count: int,
        first_sample: int,
        sample_count: int,
    ):
        # Arrays of known layout, which is what lets the compiler see that lanes are apart.
        lanes = wp.array(ptr=scratch.ptr, shape=(wp.static(pool_floats),), dtype=float)
        aimed = wp.array(
            ptr=scratch.ptr + wp.uint64(wp.static(4 * pool_floats)), shape=(wp.static(pool_floats),), dtype=float
        )
        lone = lone_medium(scene)
        camera = scene.camera
        environment = scene.environment
        first_row = first_pixel // camera.width
        first_column = first_pixel % camera.width
        next_pixel = int(0)
        next_sample = int(0)
        waiting = pixel_count * sample_count
        ready = int(0)
        taken = int(0)
        for i in range(LANES):
            idle = Path()
            idle.pixel = -1
            store(lanes, i, idle)
        busy = int(1)
        while busy > 0:
            # Refill: finished paths leave what they bring, new ones take their lanes.
            busy = int(0)
            for i in range(LANES):
                if is_alive(lanes, i):
                    busy += 1
                else:
                    path = load(lanes, i)
                    if path.pixel >= 0:
                        local = (path.pixel - first_pixel) * sample_count + path.sample - first_sample
                        at = wp.static(2 * pool_floats) + local * SAMPLE_FLOATS
                        for k in range(3):
                            scratch[at + k] = path.radiance[k]
                            if wp.static(Aov.TRANSMITTANCE in features.aovs):
                                scratch[at + 5 + k] = path.first_transmittance[k]
                            if wp.static(Aov.ALBEDO in features.aovs):
                                scratch[at + 8 + k] = path.first_albedo[k]
                        scratch[at + 3] = path.alpha
                        if wp.static(Aov.DEPTH in features.aovs):
                            scratch[at + 4] = path.first_depth
                        scratch[at + 11] = float(path.truncated)
                    if ready == 0 and waiting > 0:
                        # Aim as many new paths as there are lanes; those past the last are not taken.
                        for k in range(LANES):
                            place_lane(aimed, k, next_pixel, next_sample)
                            next_sample += 1
                            if next_sample == sample_count:
                                next_sample = 0
                                next_pixel += 1
                        for k in range(LANES):
                            place = load(aimed, k)
                            row = row_of(place.pixel + first_column, camera.width)
                            column = place.pixel + first_column - row * camera.width
                            pixel = first_pixel + place.pixel
                            sample = first_sample + place.sample
                            store(aimed, k, aim(camera, seed, pixel, sample, first_row + row, column))
                        ready = wp.min(int(LANES), waiting)
                        taken = 0
                    if ready > 0:
                        store(lanes, i, emit(scene, load(aimed, taken)))
                        taken += 1
                        ready -= 1
                        waiting -= 1
                        busy += 1
                    elif path.pixel >= 0:
                        path.pixel = -1
                        store(lanes, i, path)

            for i in range(LANES):
                path = load(lanes, i)
                path = depart(path, seed)
                if wp.static(lone_law != ""):
                    path = begin_flight(path, lone.law)
                    if wp.static(lone_law != "fractional"):
                        path = open_eyes(end_flight(path, lone, seed))
                elif wp.static(not features.media):
                    path = open_eyes(path)
                store(lanes, i, path)
            if wp.static(lone_law == "fractional"):
                for i in range(LANES):
                    path = load(lanes, i)
                    path.ln_ratio = read_table(lone.law, scene.flight_tables, path.ln_ratio)
                    store(lanes, i, path)
                for i in range(LANES):
                    path = load(lanes, i)
                    path = open_eyes(end_flight(path, lone, seed))
                    store(lanes, i, path)
            if wp.static(features.media and lone_law == ""):
                for i in range(LANES):
                    path = load(lanes, i)
                    if path.alive == 1:
                        path = open_eyes(fly_anywhere(scene, path, seed))
                    store(lanes, i, path)

            if wp.static(features.solids):
                for s in range(scene.solids.shape[0]):
                    solid = scene.solids[s]
                    if solid.surface < 0 and solid.kind == SPHERE:
                        for i in range(LANES):
                            path = load(lanes, i)
                            store(lanes, i, look_at_boundary(path, solid, SPHERE))
                    if solid.surface < 0 and solid.kind == CUBE:
                        for i in range(LANES):
                            path = load(lanes, i)
                            store(lanes, i, look_at_boundary(path, solid, CUBE))
                    if solid.surface < 0 and solid.kind == CYLINDER:
                        for i in range(LANES):
                            path = load(lanes, i)
                            store(lanes, i, look_at_boundary(path, solid, CYLINDER))
                    if wp.static(has_surfaces):
                        if solid.surface >= 0 and solid.kind == SPHERE:
                            for i in range(LANES):
                                path = load(lanes, i)
                                store(lanes, i, look_at_surface(path, solid, SPHERE))
                        if solid.surface >= 0 and solid.kind == CUBE:
                            for i in range(LANES):
                                path = load(lanes, i)
                                store(lanes, i, look_at_surface(path, solid, CUBE))
                        if solid.surface >= 0 and solid.kind == CYLINDER:
                            for i in range(LANES):
                                path = load(lanes, i)
                                store(lanes, i, look_at_surface(path, solid, CYLINDER))
            if wp.static(features.meshes or has_lights):
                for i in range(LANES):
                    path = load(lanes, i)
                    if path.alive == 1:
                        store(lanes, i, look_at_the_rest(scene, path))
            if wp.static(needs_meeting):
                for i in range(LANES):
                    path = load(lanes, i)
                    if path.alive == 1:
                        store(lanes, i, meet(scene, path))

            for i in range(LANES):
                path = load(lanes, i)
                path = arrive(path, lone, environment, camera.forward, limits)
                if wp.static(not features.connections):
                    path = go_on(path, limits)
                store(lanes, i, path)
            if wp.static(features.connections):
                for i in range(LANES):
                    path = load(lanes, i)
                    if path.scatters != MISS:
                        store(lanes, i, connect(scene, lone, path, seed))
                for i in range(LANES):
                    path = load(lanes, i)
                    store(lanes, i, go_on(path, limits))

        for p in range(pixel_count):
            for s in range(sample_count):
                at = wp.static(2 * pool_floats) + (p * sample_count + s) * SAMPLE_FLOATS
                deposit(
                    film,
                    first_pixel + p,
                    wp.vec3(scratch[at], scratch[at + 1], scratch[at + 2]),
                    scratch[at + 3],
                    scratch[at + 4],
                    wp.vec3(scratch[at + 5], scratch[at + 6], scratch[at + 7]),
                    wp.vec3(scratch[at + 8], scratch[at + 9], scratch[at + 10]),
                    int(scratch[at + 11]),
                )

    return Program(features, render_threads, render_pool)
