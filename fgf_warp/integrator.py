"""The life of a path, from the camera to its end, built for exactly the features that a scene has.

Path tracing with multiple scattering, next-event estimation, and multiple importance sampling (Veach 1997, power
heuristic) between lights and phase function or BSDF. Free flights are sampled in proportion to their density, so
they carry no weight; in a medium whose channels differ, one channel is drawn per path and the balance heuristic
over channels weighs it. Transport kernels: section 4 of Bitterli et al. 2018, in the reciprocal or the renewal way.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from fgf_warp.device import film as film_module
from fgf_warp.device.bvh import Bvh, intersect_meshes
from fgf_warp.device.camera import Camera, camera_direction
from fgf_warp.device.geometry import (
    BOUNDARY,
    LIGHT,
    MARGIN,
    MISS,
    SURFACE,
    Hit,
    Solid,
    coordinate_reach,
    cross_boundary,
    intersect_solids,
    offset_from_surface,
)
from fgf_warp.device.law import (
    ESCAPED,
    Law,
    density_mm,
    density_sm,
    sample_mm,
    sample_sm,
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
from fgf_warp.device.numerics import INFINITE, is_finite, max_component
from fgf_warp.device.phase import eval_hg, sample_hg
from fgf_warp.device.rng import CAMERA, CONNECTION, CORRELATED_FLIGHT, EVENT, uniforms
from fgf_warp.device.surfaces import Surface, diffuse_pdf, sample_diffuse
from fgf_warp.features import RenderFeatures
from fgf_warp.settings import Aov

Film = film_module.Film

MAX_CROSSINGS = wp.constant(1024)
"""Boundaries between two scattering events; a path that crosses more is cut and counted as truncated."""
CAMERA_RAY = wp.constant(-1.0)
"""Stands for the pdf of a direction that no light sampling competes with."""


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
    camera_inside: wp.uint64
    """Containers around the camera."""


@wp.struct
class Limits:
    """Where a path ends that nothing else ends."""

    max_depth: int
    roulette_depth: int


@wp.struct
class Path:
    """A path between two events."""

    origin: wp.vec3
    direction: wp.vec3
    throughput: wp.vec3
    inside: wp.uint64
    """Containers around the origin."""
    from_medium: bool
    """The segment began at a medium vertex: its flight remembers the last one."""
    vertex: wp.vec3
    """Where the path last scattered."""
    pdf_direction: float
    """pdf_solid_angle with which it did."""
    bounce: int
    """Events so far, crossings included: the address of random numbers."""
    depth: int
    """Scattering events so far."""
    crossings: int
    """Boundaries crossed since the last scattering event."""
    channel: int
    """Whose law the flights are sampled from, in a chromatic scene."""
    channel_pdfs: wp.vec3
    """Density of the path's flights under each channel, over that under `channel`."""


@wp.struct
class Sample:
    """What one path brings to its pixel."""

    radiance: wp.vec3
    alpha: float
    depth: float
    transmittance: wp.vec3
    albedo: wp.vec3
    truncated: int


@wp.struct
class Connection:
    """The share of light that arrives along a connection."""

    transmittance: wp.vec3
    truncated: int


@dataclass(frozen=True)
class Program:
    """A kernel and what it was built for."""

    features: RenderFeatures
    kernel: Any


@wp.func
def power_heuristic(pdf: float, other: float) -> float:
    """mis_weight of a sample drawn with density `pdf` where `other` competes."""
    return 1.0 / (1.0 + (other / pdf) * (other / pdf))


@wp.func
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
    """The kernel that renders scenes of these features; compiled when it is first loaded on a device."""
    sees_first_segment = bool(features.aovs & {Aov.DEPTH, Aov.TRANSMITTANCE})

    @wp.func
    def intersect(scene: SceneData, origin: wp.vec3, direction: wp.vec3, t_max: float, inside: wp.uint64) -> Hit:
        hit = Hit()
        hit.t = t_max
        hit.kind = MISS
        if wp.static(features.solids):
            hit = intersect_solids(scene.solids, origin, direction, inside, hit)
        if wp.static(features.meshes):
            hit = intersect_meshes(scene.meshes, origin, direction, inside, hit)
        if wp.static(features.shaped_lights):
            hit = intersect_lights(scene.lights, origin, direction, hit)
        return hit

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
    def sample_flight(
        scene: SceneData, medium: Medium, path: Path, seed: wp.uint64, pixel: int, sample: int, xi: float
    ) -> float:
        """Distance to the next scattering event, were the medium unbounded."""
        law = medium.law
        extinction = medium.extinction[0]
        if wp.static(features.chromatic):
            law = law_of_channel(medium, path.channel)
            extinction = medium.extinction[path.channel]
        u = float(0.0)
        if wp.static(features.correlated):
            if path.from_medium and law.reciprocal == 1:
                more = uniforms(seed, pixel, sample, path.bounce, CORRELATED_FLIGHT)
                u = sample_mm(law, scene.flight_tables, xi, more[0], more[1])
            else:
                u = sample_sm(law, scene.flight_tables, xi)
        else:
            u = -wp.log(xi) / law.rate
        return wp.min(u / extinction, 0.5 * INFINITE)

    @wp.func
    def channel_weight(path: Path) -> wp.vec3:
        """Balance heuristic over the channel that the flights were sampled from."""
        if wp.static(features.chromatic):
            total = path.channel_pdfs[0] + path.channel_pdfs[1] + path.channel_pdfs[2]
            return path.channel_pdfs * (3.0 / total)
        return wp.vec3(1.0)

    @wp.func
    def weigh_flight(medium: Medium, path: Path, t: float) -> wp.vec3:
        """`channel_pdfs` after a flight that ended in a scattering event at t."""
        pdfs = wp.vec3()
        for channel in range(3):
            law = law_of_channel(medium, channel)
            extinction = medium.extinction[channel]
            u = mean_optical_depth(extinction, t)
            pdfs[channel] = extinction * flight_density(law, u, path.from_medium)
        return wp.cw_mul(path.channel_pdfs, pdfs / wp.max(pdfs[path.channel], 1.0e-37))

    @wp.func
    def weigh_passage(medium: Medium, path: Path, t: float) -> wp.vec3:
        """`channel_pdfs` after a flight that reached the end of its segment at t."""
        pdfs = attenuation(medium, t, path.from_medium)
        return wp.cw_mul(path.channel_pdfs, pdfs / wp.max(pdfs[path.channel], 1.0e-37))

    @wp.func
    def connect(
        scene: SceneData,
        origin: wp.vec3,
        direction: wp.vec3,
        distance: float,
        start_inside: wp.uint64,
        start_in_medium: bool,
    ) -> Connection:
        """What passes from a vertex to a light through the media between them."""
        result = Connection()
        result.transmittance = wp.vec3(1.0)
        inside = start_inside
        from_medium = start_in_medium
        position = origin
        remaining = distance
        for _ in range(MAX_CROSSINGS):
            hit = intersect(scene, position, direction, remaining, inside)
            if wp.static(features.media):
                medium = medium_at(scene.containers, inside)
                if medium >= 0:
                    passed = attenuation(scene.media[medium], hit.t, from_medium)
                    result.transmittance = wp.cw_mul(result.transmittance, passed)
            if hit.kind == MISS:
                return result
            if hit.kind != BOUNDARY:
                result.transmittance = wp.vec3(0.0)
                return result
            inside = cross_boundary(inside, hit.item)
            from_medium = False
            position = position + direction * hit.t
            remaining = remaining - hit.t
        result.transmittance = wp.vec3(0.0)
        result.truncated = 1
        return result

    @wp.func
    def hit_weight(path: Path, pdf_light: float) -> float:
        """mis_weight of a light that the path met by itself."""
        if path.pdf_direction == CAMERA_RAY:
            return 1.0
        return power_heuristic(path.pdf_direction, pdf_light)

    @wp.func
    def escape(scene: SceneData, path: Path) -> wp.vec3:
        """Radiance from beyond the scene."""
        radiance = wp.vec3(0.0)
        if wp.static(features.environment):
            radiance += scene.environment
        if wp.static(features.distant_lights):
            for i in range(scene.lights.shape[0]):
                light = scene.lights[i]
                if is_in_distant_light(light, path.direction):
                    pdf_light = cone_pdf(light.cone) / float(scene.lights.shape[0])
                    radiance += light.radiance * hit_weight(path, pdf_light)
        return radiance

    @wp.func
    def trace(scene: SceneData, limits: Limits, seed: wp.uint64, pixel: int, sample: int) -> Sample:
        result = Sample()
        result.depth = INFINITE
        result.transmittance = wp.vec3(1.0)

        # A path begins at the camera.
        xi = uniforms(seed, pixel, sample, 0, CAMERA)
        path = Path()
        path.origin = scene.camera.position
        path.direction = camera_direction(scene.camera, pixel, xi[0], xi[1])
        path.throughput = wp.vec3(1.0)
        path.inside = scene.camera_inside
        path.pdf_direction = CAMERA_RAY
        path.channel_pdfs = wp.vec3(1.0)
        if wp.static(features.chromatic):
            path.channel = wp.min(int(xi[2] * 3.0), 2)
        has_met_medium = bool(False)

        while True:
            path.bounce += 1
            xi = uniforms(seed, pixel, sample, path.bounce, EVENT)

            # In a medium, how far does it fly?
            is_in_medium = bool(False)
            medium = Medium()
            flight = INFINITE
            reach = INFINITE
            if wp.static(features.media):
                medium_index = medium_at(scene.containers, path.inside)
                is_in_medium = medium_index >= 0
                if is_in_medium:
                    medium = scene.media[medium_index]
                    flight = sample_flight(scene, medium, path, seed, pixel, sample, xi[0])
                    reach = flight
                    if wp.static(features.meshes):
                        margin = coordinate_reach(path.origin, flight) * MARGIN
                        reach = flight + 2.0 * margin
                    if wp.static(sees_first_segment):
                        reach = wp.where(path.depth == 0, INFINITE, reach)

            # What lies ahead, as far as it flies?
            hit = intersect(scene, path.origin, path.direction, reach, path.inside)
            scatters_in_medium = is_in_medium and flight <= hit.t
            if wp.static(features.media and features.meshes):
                if scatters_in_medium:
                    # Not so close to a face that rounding could put it behind.
                    flight = wp.min(flight, wp.max(hit.t - margin, 0.5 * hit.t))
            if wp.static(Aov.DEPTH in features.aovs):
                if path.depth == 0 and hit.kind != MISS and result.depth == INFINITE:
                    result.depth = hit.t * wp.dot(path.direction, scene.camera.forward)
            if wp.static(Aov.TRANSMITTANCE in features.aovs):
                if path.depth == 0 and is_in_medium and not has_met_medium:
                    result.transmittance = attenuation(medium, hit.t, False)
                    has_met_medium = True

            # A boundary lets it through and ends its memory.
            if wp.static(features.chromatic):
                if is_in_medium and not scatters_in_medium:
                    path.channel_pdfs = weigh_passage(medium, path, hit.t)
            if hit.kind == BOUNDARY and not scatters_in_medium:
                path.inside = cross_boundary(path.inside, hit.item)
                path.origin = path.origin + path.direction * hit.t
                path.from_medium = False
                path.crossings += 1
                if path.crossings > MAX_CROSSINGS:
                    result.truncated = 1
                    break
                continue

            # Beyond the scene there is only light.
            if hit.kind == MISS and not scatters_in_medium:
                beyond = wp.cw_mul(escape(scene, path), channel_weight(path))
                result.radiance += wp.cw_mul(path.throughput, beyond)
                break
            result.alpha = 1.0

            # A light that it meets adds its radiance, and is black otherwise.
            if wp.static(features.shaped_lights):
                if hit.kind == LIGHT and not scatters_in_medium:
                    light = scene.lights[hit.item]
                    if wp.dot(hit.normal, path.direction) < 0.0:
                        position = path.origin + path.direction * hit.t
                        pdf_light = light_pdf(light, path.vertex, position, path.direction)
                        met = light.radiance * hit_weight(path, pdf_light / float(scene.lights.shape[0]))
                        result.radiance += wp.cw_mul(path.throughput, wp.cw_mul(met, channel_weight(path)))
                    break

            # It scatters: in the medium, or from a surface.
            if path.depth >= limits.max_depth:
                result.truncated = 1
                break
            wi = path.direction
            pdf_direction = float(1.0)
            albedo = wp.vec3(0.0)
            normal = wp.vec3(0.0)
            if wp.static(features.chromatic):
                if scatters_in_medium:
                    path.channel_pdfs = weigh_flight(medium, path, flight)
            if scatters_in_medium:
                path.origin = path.origin + path.direction * flight
                path.from_medium = True
                albedo = medium.albedo
                wi = sample_hg(medium.asymmetry, path.direction, xi[2], xi[3])
                if wp.static(features.connections):
                    pdf_direction = eval_hg(medium.asymmetry, path.direction, wi)
            if wp.static(features.surfaces):
                if hit.kind == SURFACE and not scatters_in_medium:
                    surface = scene.surfaces[hit.item]
                    emitted = wp.cw_mul(surface.emission, channel_weight(path))
                    result.radiance += wp.cw_mul(path.throughput, emitted)
                    normal = wp.where(wp.dot(hit.normal, path.direction) < 0.0, hit.normal, -hit.normal)
                    path.origin = offset_from_surface(path.origin + path.direction * hit.t, normal, hit.t)
                    path.from_medium = False
                    albedo = surface.diffuse
                    wi = sample_diffuse(normal, xi[2], xi[3])
                    pdf_direction = diffuse_pdf(normal, wi)
            if wp.static(Aov.ALBEDO in features.aovs):
                if path.depth == 0:
                    result.albedo = albedo
            path.throughput = wp.cw_mul(path.throughput, albedo)
            if max_component(path.throughput) == 0.0:
                break

            # It connects to a light.
            if wp.static(features.connections):
                xi_light = uniforms(seed, pixel, sample, path.bounce, CONNECTION)
                light_count = float(scene.lights.shape[0])
                light_index = wp.min(int(xi_light[0] * light_count), scene.lights.shape[0] - 1)
                towards = sample_light(scene.lights[light_index], path.origin, xi_light[1], xi_light[2])
                if towards.pdf_solid_angle > 0.0:
                    pdf_scatter = float(0.0)
                    if scatters_in_medium:
                        pdf_scatter = eval_hg(medium.asymmetry, path.direction, towards.direction)
                    else:
                        pdf_scatter = diffuse_pdf(normal, towards.direction)
                    if pdf_scatter > 0.0:
                        # Just short of the light, which would block itself.
                        reach = wp.where(towards.distance < INFINITE, towards.distance * 0.9999, INFINITE)
                        link = connect(scene, path.origin, towards.direction, reach, path.inside, path.from_medium)
                        result.truncated = wp.max(result.truncated, link.truncated)
                        pdf_light = towards.pdf_solid_angle / light_count
                        weight = pdf_scatter / pdf_light
                        if towards.is_delta == 0:
                            weight *= power_heuristic(pdf_light, pdf_scatter)
                        arriving = wp.cw_mul(wp.cw_mul(towards.radiance, link.transmittance), channel_weight(path))
                        result.radiance += wp.cw_mul(path.throughput, arriving) * weight

            # Roulette, and on in the new direction.
            path.depth += 1
            if path.depth > limits.roulette_depth:
                survival = wp.min(max_component(wp.cw_mul(path.throughput, channel_weight(path))), 1.0)
                if xi[1] >= survival:
                    break
                path.throughput = path.throughput / survival
            path.vertex = path.origin
            path.direction = wi
            path.pdf_direction = pdf_direction
            path.crossings = 0

        return result

    @wp.kernel(module="unique", enable_backward=False)
    def render_samples(
        scene: SceneData,
        limits: Limits,
        film: Film,
        seed: wp.uint64,
        first_pixel: int,
        first_sample: int,
        sample_count: int,
    ):
        pixel = first_pixel + wp.tid()
        radiance = film.radiance[pixel]
        radiance_sq = film.radiance_sq[pixel]
        for sample in range(first_sample, first_sample + sample_count):
            result = trace(scene, limits, seed, pixel, sample)
            film.truncated[pixel] = film.truncated[pixel] + result.truncated
            if is_finite(result.radiance):
                value = wp.vec3d(result.radiance)
                radiance += value
                radiance_sq += wp.cw_mul(value, value)
                film.alpha[pixel] = film.alpha[pixel] + wp.float64(result.alpha)
                if wp.static(Aov.DEPTH in features.aovs):
                    film.depth[pixel] = wp.min(film.depth[pixel], result.depth)
                if wp.static(Aov.TRANSMITTANCE in features.aovs):
                    film.transmittance[pixel] = film.transmittance[pixel] + wp.vec3d(result.transmittance)
                if wp.static(Aov.ALBEDO in features.aovs):
                    film.albedo[pixel] = film.albedo[pixel] + wp.vec3d(result.albedo)
            else:
                film.invalid[pixel] = film.invalid[pixel] + 1
        film.radiance[pixel] = radiance
        film.radiance_sq[pixel] = radiance_sq

    return Program(features, render_samples)
