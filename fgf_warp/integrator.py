"""The life of a path, from the camera to its end, built for exactly the features that a scene has.

Path tracing with multiple scattering, next-event estimation, and multiple importance sampling (Veach 1997, power
heuristic) between lights and phase function or BSDF. Free flights are sampled in proportion to their density, so
they carry no weight; in a medium whose channels differ, one channel is drawn per path and the balance heuristic
over channels weighs it. Transport kernels: section 4 of Bitterli et al. 2018, in the reciprocal or the renewal way; in
the mixed transport a share of the paths is frozen: for them a medium is classical at a rate of their own.

A path lives in stages: depart, fly, look, meet, arrive, connect, go on. They are written once, each from a `Path` to a
`Path`, and two drivers run them: on CUDA a thread takes one path through all of them; on the CPU a pool of lanes
takes `LANES` paths through one stage after the other, so that the compiler makes vector code of the stages that have
neither branches nor look-ups (see `device/lanes.py`).
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from fgf_warp.device import fbm
from fgf_warp.device import lanes as lanes_module
from fgf_warp.device.bsdf import Bsdf, eval_bsdf, prepare_bsdf, rescale, sample_bsdf
from fgf_warp.device.bvh import Bvh, build_intersect_meshes, build_place_instance
from fgf_warp.device.camera import Camera, camera_at, camera_direction, camera_ray, far_distance, film_point
from fgf_warp.device.drift import Drift, image_motion
from fgf_warp.device.film import Film, Sample, Tally, add_sample
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
    Motion,
    Solid,
    Start,
    build_intersect_solids,
    chord,
    coordinate_reach,
    cross_boundary,
    entered_at,
    is_inside,
    meet_open_surface,
    meet_solid_boundary,
    meet_solid_surface,
    offset_from_surface,
    solid_at,
    solid_span,
    surface_distance,
)
from fgf_warp.device.lanes import FIRST_CONTAINER, LANES, NOT_SEEN, Path
from fgf_warp.device.law import (
    ESCAPED,
    EXACT_FBM,
    EXPONENTIAL,
    FRACTIONAL,
    NOT_FROZEN,
    POWER,
    Law,
    flight_density,
    flight_of_ln,
    fly_frozen,
    fly_power,
    frozen_density,
    frozen_transmittance,
    ln_decorrelation,
    ln_flight,
    sample_mm,
    sample_sm,
    segment_transmittance,
)
from fgf_warp.device.lights import (
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
    build_lights,
    chance,
    choose_light,
    cone_pdf,
    emitted_radiance,
    is_in_distant_light,
    light_distance,
    light_pdf,
    meet_light,
    sample_light,
)
from fgf_warp.device.medium import (
    Container,
    Medium,
    build_carries_on,
    container_at,
    ior_at,
    medium_after,
    medium_at,
    refracting_at,
)
from fgf_warp.device.numerics import INFINITE, choose, log_positive, max_component
from fgf_warp.device.options import kernel_options
from fgf_warp.device.phase import Phase, build_phase
from fgf_warp.device.rng import (
    CAMERA,
    CONNECTION,
    EVENT,
    WHOLE_PATH,
    draw_in_pixel,
    draw_independent,
    draw_lattice,
    draw_more_independent,
    draw_more_lattice,
    pixel_shift,
    reverse_bits,
)
from fgf_warp.device.shading import Look, Shade, Shading, read_surface
from fgf_warp.device.surfaces import Surface, diffuse_pdf, sample_diffuse
from fgf_warp.device.tables import draw_from
from fgf_warp.features import RenderFeatures
from fgf_warp.settings import PRIM_AOVS, SPLIT_AOVS, Aov

lane_floats, tally_floats = lanes_module.lane_floats, lanes_module.tally_floats

MAX_CROSSINGS = wp.constant(1024)
"""Boundaries between two scattering events; a path that crosses more is cut and counted as truncated."""
MANY_WAITING = wp.constant(4)
"""Lanes without a pixel that are worth a look at all of them."""
SHORTEST_DEPTH = wp.constant(1.0e-30)
"""Mean optical depth below which a flight has no length: between medium vertices many have none where b is small."""
CAMERA_RAY = wp.constant(-1.0)
"""Stands for the pdf of a direction that no light sampling competes with."""
ALL_LINKS = wp.constant(wp.uint32(0xFFFFFFFF))
"""Of what all lights shine on."""


@wp.struct
class SceneData:
    """The uploaded scene."""

    camera: Camera
    environment: wp.vec3
    solids: wp.array(dtype=Solid)
    lone_solid: int
    """The one that the only medium fills; used where one does."""
    motions: wp.array(dtype=Motion)
    """Of solids and instances that move."""
    meshes: wp.array(dtype=Bvh)
    surfaces: wp.array(dtype=Surface)
    surface_of: wp.array(dtype=int)
    """Of what a hit of a surface tells, the index of the surface: instances share theirs."""
    shading: wp.array(dtype=Shading)
    light_tables: wp.array(dtype=LightTables)
    """One of each: functions take the scene by value, and it should not be large."""
    media: wp.array(dtype=Medium)
    """Of all images, image after image."""
    media_count: int
    """Of one image."""
    first_medium: int
    """Of the image that is rendered."""
    tables: wp.array(dtype=wp.vec3)
    """Of the laws."""
    containers: wp.array(dtype=Container)
    surface_drifts: wp.array(dtype=Drift)
    container_drifts: wp.array(dtype=Drift)
    """Of each of the surfaces and the containers, where a plane tells of motion."""
    lights: wp.array(dtype=Light)
    camera_inside: wp.uint32
    """Containers around what camera rays begin at, where they are the same for all."""
    contact_rounding: float
    """Distance that rounding may part boundaries by which coincide, for rays of all slants but the flattest."""
    camera_ior: float
    """Index of refraction there; where they are not the same, in the middle of where rays begin."""
    media_center: wp.vec3
    media_radius: float
    """A ball that holds all containers, used where they are not the same."""
    boundaries: wp.array(dtype=Bvh)
    """Containers that are meshes, without anything on them; used likewise."""
    seeds: wp.array(dtype=wp.uint64)
    """Of each image."""


@wp.struct
class Limits:
    """Where a path ends that nothing else ends."""

    max_depth: int
    roulette_depth: int


@wp.struct
class Counts:
    """How many samples the pixels have and get; one entry per pixel of each image, image after image."""

    done: wp.array(dtype=int)
    """Before all launches of a step."""
    wanted: wp.array(dtype=int)
    """After them."""
    order: wp.array(dtype=int)
    """Of each image, the pixels: side by side those that get about equally many samples, so that they end together."""


@wp.struct
class Round:
    """Of the samples that each pixel gets in a step, those of one launch."""

    skipped: int
    """Of earlier launches."""
    samples: int
    """At most."""


@wp.func(inline=True)
def samples_of_round(counts: Counts, part: Round, place: int):
    """The first sample of a pixel in this launch, and the one after its last."""
    end = counts.wanted[place]
    first = wp.min(counts.done[place] + part.skipped, end)
    return first, wp.min(first + part.samples, end)


@wp.func
def skip_pixels(counts: Counts, part: Round, first_place: int, turn: int, end_turn: int) -> int:
    """Whose turn it is from this one on, of those that get samples in this launch."""
    for candidate in range(turn, end_turn):
        first_sample, end_sample = samples_of_round(counts, part, first_place + counts.order[first_place + candidate])
        if first_sample < end_sample:
            return candidate
    return end_turn


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
        scratch_floats: length of the array that a launch of `render_pool` works in.
    """

    features: RenderFeatures
    render_threads: Any
    render_pool: Any
    scratch_floats: int


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


LAW_KINDS = {
    "exponential": int(EXPONENTIAL),
    "power": int(POWER),
    "fractional": int(FRACTIONAL),
    "exact_fbm": int(EXACT_FBM),
}
SOLID_KINDS = {"sphere": int(SPHERE), "cube": int(CUBE), "cylinder": int(CYLINDER)}
LIGHT_KINDS = {
    "distant": int(DISTANT),
    "rect": int(RECT),
    "disk": int(DISK),
    "sphere": int(SPHERE_LIGHT),
    "dome": int(DOME),
    "cylinder": int(CYLINDER_LIGHT),
    "mesh": int(MESH_LIGHT),
}
"""What the device calls them."""


@cache
def build_program(features: RenderFeatures) -> Program:
    """The kernels that render scenes of these features; compiled when they are first loaded on a device."""
    moves = features.lens and features.motion
    sees_first_segment = bool(features.aovs & {Aov.DEPTH, Aov.TRANSMITTANCE, Aov.OPTICAL_DEPTH})
    sees_segment_length = bool(features.aovs & {Aov.TRANSMITTANCE, Aov.OPTICAL_DEPTH})
    tells_prims = bool(features.aovs & PRIM_AOVS)
    tracks = Aov.MOTION in features.aovs
    splits = bool(features.aovs & SPLIT_AOVS)
    has_surfaces, has_lights, has_solids = features.surfaces, bool(features.shaped_lights), bool(features.solids)
    solid_kinds = {SOLID_KINDS[kind] for kind in features.solids}
    shaped_kinds = {LIGHT_KINDS[kind] for kind in features.shaped_lights}
    light_kinds = shaped_kinds | ({int(DISTANT)} if features.distant_lights else set())
    all_light_kinds = frozenset(light_kinds | ({int(DOME)} if features.dome_image else set()))
    has_light_images = features.dome_image or features.light_images
    intersect_lights, sample_any_light, any_light_pdf, any_radiance = build_lights(
        all_light_kinds, has_light_images, features.shaping
    )
    kinds_code = sum(1 << kind for kind in solid_kinds) + sum(1 << 8 + kind for kind in light_kinds)
    has_beyond = features.distant_lights or features.dome_image
    meets_emitters = has_surfaces or features.connections
    bsdf_count = int(LANES) if features.shading else 0
    shades, passes, refracts = features.shading, features.passes, features.refracts
    # One medium of one law is the same for all lanes; anything else is looked up lane by lane.
    lone_law, lone_solid, has_crossings = features.lone_law, bool(features.lone_solid), features.crossings
    looks_up_flights = lone_law == "exact_fbm"
    freezes_at_birth = features.frozen and lone_law != ""
    lone_kind = SOLID_KINDS.get(features.lone_solid, 0)
    is_lattice = features.sampler == "lattice"
    draw = draw_lattice if is_lattice else draw_independent
    draw_more = draw_more_lattice if is_lattice else draw_more_independent
    pool_floats, sum_count = lane_floats(features), tally_floats(features)
    eval_phase, sample_phase = build_phase(features.phases)
    intersect_solids, intersect_meshes = build_intersect_solids(features), build_intersect_meshes(features)
    place_instance, carries_on = build_place_instance(features), build_carries_on(features)
    load, store = lanes_module.build_lanes(features)
    load_tally, store_tally = lanes_module.build_tallies(features)

    # ---- the law of a path: its medium's, or where it is frozen there, the exponential at its rate.

    @wp.func
    def draw_rates(scene: SceneData, path: Path, medium: Medium, body: int, seed: wp.uint64) -> wp.vec3:
        """At which it is frozen in a body of a medium: the same rates whenever it comes there."""
        xi = draw(seed, path.pixel, path.turn, scene.containers[body].rates, WHOLE_PATH)
        rates = wp.vec3(NOT_FROZEN)
        if xi[0] < medium.frozen_share:
            rates = wp.vec3(draw_from(scene.tables, medium.law.rates, xi[1]))
            if wp.static(features.chromatic):
                rates[1] = draw_from(scene.tables, medium.law_green.rates, xi[1])
                rates[2] = draw_from(scene.tables, medium.law_blue.rates, xi[1])
        return rates

    @wp.func(inline=True)
    def pass_segment(law: Law, u: float, from_medium: bool, rate: float) -> float:
        """Share of light that passes a segment which ends uncorrelated."""
        passed = float(0.0)
        if wp.static(features.exact_variance):
            if law.kind == EXACT_FBM:
                passed = fbm.segment_transmittance(law, u, from_medium)
            else:
                passed = segment_transmittance(law, u, from_medium)
        else:
            passed = segment_transmittance(law, u, from_medium)
        if wp.static(features.frozen):
            passed = wp.where(rate >= 0.0, frozen_transmittance(rate, u), passed)
        return passed

    @wp.func
    def end_in_segment(law: Law, u: float, from_medium: bool, rate: float) -> float:
        """Density in u of the next scattering event."""
        if wp.static(features.frozen):
            if rate >= 0.0:
                return frozen_density(rate, u)
        if wp.static(features.exact_variance):
            if law.kind == EXACT_FBM:
                return fbm.flight_density(law, u, from_medium)
        return flight_density(law, u, from_medium)

    # ---- the medium of a path: its own, or after some scattering events the similar one.

    @wp.func(inline=True)
    def seen_medium(medium: Medium, scatterings: int) -> Medium:
        if wp.static(features.similarity):
            return medium_after(medium, scatterings)
        return medium

    # ---- depart and fly: how far would the path fly, were the medium unbounded?

    @wp.func(inline=True)
    def depart(before: Path, seed: wp.uint64) -> Path:
        path = before
        path.bounce = before.bounce + 1
        path.xi = draw(seed, before.pixel, before.turn, path.bounce, EVENT)
        path.flight = wp.where(before.keeps == 1, before.flight, INFINITE)
        if wp.static(passes):
            path.passes = 0
        if wp.static(refracts):
            path.transmits = 0
        return path

    @wp.func(inline=True)
    def begin_exact_flight(before: Path, medium: Medium) -> Path:
        """Of a variance of finite segments: `flight` is ln u, here with the asymptotic variance."""
        path = before
        remembers = before.from_medium == 1 and medium.law.reciprocal == 1
        path.flight = fbm.ln_asymptotic_flight(medium.law, -log_positive(before.xi[0]), remembers)
        return path

    @wp.func(inline=True)
    def look_up_exact_flight(before: Path, medium: Medium, tables: wp.array(dtype=wp.vec3)) -> Path:
        path = before
        remembers = before.from_medium == 1 and medium.law.reciprocal == 1
        path.flight = fbm.look_up_flight(medium.law, tables, before.flight, remembers)
        return path

    @wp.func(inline=True)
    def fly_in_lone_medium(before: Path, lone: Medium, seed: wp.uint64) -> Path:
        path = before
        medium = seen_medium(lone, before.depth)
        remembers = before.from_medium == 1 and medium.law.reciprocal == 1
        exponent = -log_positive(before.xi[0])
        u = exponent / medium.law.rate
        if wp.static(lone_law == "power"):
            u = fly_power(medium.law, exponent, remembers)
        if wp.static(looks_up_flights):
            u = flight_of_ln(before.flight)
        if wp.static(lone_law == "fractional"):
            ln_u = ln_flight(medium.law, exponent)
            more = draw_more(seed, before.pixel, before.turn, before.bounce, EVENT)
            ln_u = wp.where(remembers, wp.min(ln_u, ln_decorrelation(medium.law, more[0], more[1])), ln_u)
            u = flight_of_ln(ln_u)
        if wp.static(features.frozen):
            u = wp.where(before.rates[0] >= 0.0, fly_frozen(before.rates[0], exponent), u)
        path.flight = wp.min(u / medium.extinction[0], 0.5 * INFINITE)
        if wp.static(not lone_solid):
            is_in_medium = before.start.inside != wp.uint32(0)
            path.medium = wp.where(is_in_medium, medium.index, -1)
            path.flight = wp.where(is_in_medium, before.segment + path.flight, INFINITE)
        return path

    @wp.func
    def fly_by_law(scene: SceneData, path: Path, law: Law, seed: wp.uint64) -> float:
        """u of the next flight."""
        if wp.static(features.frozen):
            rate = path.rates[path.channel]
            if rate >= 0.0:
                return fly_frozen(rate, -log_positive(path.xi[0]))
        if wp.static(features.exact_variance):
            if law.kind == EXACT_FBM:
                return fbm.sample_flight(law, scene.tables, path.xi[0], path.from_medium == 1)
        if path.from_medium == 1 and law.reciprocal == 1:
            more = draw_more(seed, path.pixel, path.turn, path.bounce, EVENT)
            return sample_mm(law, path.xi[0], more[0], more[1])
        return sample_sm(law, path.xi[0])

    @wp.func
    def fly_anywhere(scene: SceneData, before: Path, seed: wp.uint64) -> Path:
        """The same among many media, or with channels that differ."""
        path = before
        path.medium = medium_at(scene.containers, before.start.inside)
        if path.medium >= 0 and path.keeps == 0:
            medium = seen_medium(scene.media[scene.first_medium + path.medium], path.depth)
            if wp.static(features.frozen):
                if path.body < 0:
                    path.body = container_at(scene.containers, before.start.inside)
                    path.rates = draw_rates(scene, path, medium, path.body, seed)
            u = fly_by_law(scene, path, law_of_channel(medium, path.channel), seed)
            path.length = wp.min(u / medium.extinction[path.channel], 0.5 * INFINITE)
            path.flight = path.segment + path.length
        return path

    # ---- look: what lies ahead, as far as it flies?

    @wp.func(inline=True)
    def look_at_lone_solid(before: Path, solid: Solid, kind: int) -> Path:
        """Where the ray is in the only medium, and where its flight ends, if it ends there."""
        path = before
        span = solid_span(solid, kind, before.origin, before.direction)
        within = chord(span, before.start.inside != wp.uint32(0))
        path.t_in = within[0]
        path.t_out = within[1]
        end = path.t_in + before.flight
        path.flight = wp.where(end <= path.t_out, end, INFINITE)
        return path

    @wp.func(inline=True)
    def camera_of(camera: Camera, path: Path) -> Camera:
        """The camera when the path was born."""
        if wp.static(moves):
            return camera_at(camera, path.start.time)
        return camera

    @wp.func(inline=True)
    def open_eyes(before: Path, camera: Camera) -> Path:
        path = before
        path.hit.t = before.flight
        if wp.static(features.meshes):
            margin = 2.0 * MARGIN * coordinate_reach(before.origin, before.flight)
            path.hit.t = wp.min(before.flight + margin, INFINITE)
        if wp.static(sees_first_segment):
            path.hit.t = wp.where(before.depth == 0, INFINITE, path.hit.t)
        if wp.static(features.lens):
            far = far_distance(camera_of(camera, before), before.direction)
            path.hit.t = wp.where(before.depth == 0, wp.min(path.hit.t, far), path.hit.t)
        path.hit.kind = MISS
        path.met = wp.vec3(0.0, 0.0, 0.0)
        return path

    @wp.func(inline=True)
    def look_at_boundary(before: Path, solid: Solid, kind: int) -> Path:
        path = before
        span = solid_span(solid, kind, before.origin, before.direction)
        path.hit = meet_solid_boundary(solid, span, before.start, before.hit)
        return path

    @wp.func(inline=True)
    def look_at_surface(before: Path, solid: Solid, kind: int, surface: Surface) -> Path:
        path = before
        span = solid_span(solid, kind, before.origin, before.direction)
        path.hit = meet_solid_surface(solid, span, before.origin, before.direction, before.start, before.hit)
        is_nearer = path.hit.t < before.hit.t
        path.albedo = choose(is_nearer, surface.diffuse, before.albedo)
        path.met = choose(is_nearer, surface.emission, before.met)
        return path

    @wp.func
    def surface_at(surface_of: wp.array(dtype=int), item: int) -> int:
        """Index of the surface that was hit."""
        if wp.static(features.instances):
            return surface_of[item]
        return item

    @wp.func
    def look_at_item(scene: SceneData, item: int) -> Look:
        """The look of the surface that was hit."""
        return scene.shading[0].looks[surface_at(scene.surface_of, item)]

    @wp.func
    def look_at_solids(scene: SceneData, before: Path) -> Path:
        """At all of them but the lone one, lane by lane."""
        path = before
        for s in range(scene.solids.shape[0]):
            solid = scene.solids[s]
            if wp.static(features.motion):
                solid = solid_at(solid, scene.motions, before.start.time)
            if solid.surface >= 0:
                if wp.static(passes):
                    span = solid_span(solid, solid.kind, before.origin, before.direction)
                    path.hit = meet_open_surface(solid, span, before.origin, before.direction, before.start, path.hit)
                else:
                    surface = scene.surfaces[surface_at(scene.surface_of, solid.surface)]
                    path = look_at_surface(path, solid, solid.kind, surface)
            elif wp.static(has_crossings):
                path = look_at_boundary(path, solid, solid.kind)
        return path

    @wp.func
    def hit_of_meshes(trees: wp.array(dtype=Bvh), path: Path) -> Hit:
        return intersect_meshes(trees, path.origin, path.direction, path.start, path.hit)

    @wp.func(inline=True)
    def see_mesh(before: Path, hit: Hit, surfaces: wp.array(dtype=Surface), surface_of: wp.array(dtype=int)) -> Path:
        """The path with what it has just hit of the meshes, if it is nearer than all else."""
        path = before
        path.hit = hit
        if wp.static(has_surfaces and not shades):
            if hit.t < before.hit.t and hit.kind == SURFACE:
                surface = surfaces[surface_at(surface_of, hit.item)]
                path.albedo = surface.diffuse
                path.met = surface.emission
        return path

    @wp.func(inline=True)
    def hit_weight(path: Path, pdf_light: float) -> float:
        """mis_weight of a light that the path met by itself."""
        return wp.where(path.pdf_direction == CAMERA_RAY, 1.0, power_heuristic(path.pdf_direction, pdf_light))

    @wp.func(inline=True)
    def look_at_light(before: Path, light: Light, kind: int, item: int) -> Path:
        path = before
        path.hit = meet_light(light, kind, item, before.origin, before.direction, before.hit)
        is_nearer = path.hit.t < before.hit.t
        position = before.origin + before.direction * wp.where(is_nearer, path.hit.t, 0.0)
        pdf = light_pdf(light, kind, before.origin, position, before.direction) * chance(light)
        met = emitted_radiance(light, kind, before.direction) * hit_weight(before, pdf)
        path.met = choose(is_nearer, met, before.met)
        return path

    @wp.func(inline=True)
    def look_beyond(before: Path, light: Light) -> Path:
        """At a distant light, where nothing is before it."""
        path = before
        is_seen = before.hit.kind == MISS and is_in_distant_light(light, before.direction)
        weight = hit_weight(before, cone_pdf(light.cone) * chance(light))
        path.met = before.met + light.radiance * wp.where(is_seen, weight, 0.0)
        return path

    @wp.func(inline=True)
    def shines_on(light: Light, links: wp.uint32) -> bool:
        """True where a light is linked to a shape with these bits, or to all."""
        return light.link == wp.uint32(0) or (light.link & links) != wp.uint32(0)

    @wp.func
    def found_light(scene: SceneData, path: Path, light: Light, position: wp.vec3) -> wp.vec3:
        """What the path finds of a light by itself, times its mis_weight."""
        if wp.static(features.links):
            is_found = light.casters == wp.uint32(0) or path.pdf_direction == CAMERA_RAY
            if not (shines_on(light, path.links) and is_found):
                return wp.vec3(0.0)
        pdf = any_light_pdf(light, scene.light_tables[0], path.hit, path.origin, position, path.direction)
        radiance = any_radiance(light, scene.light_tables[0], path.hit, position, path.direction)
        return radiance * hit_weight(path, pdf * chance(light))

    @wp.func
    def look_at_lights(scene: SceneData, before: Path) -> Path:
        """The same at all lights, where one path at a time looks at them, after it has looked at the shapes."""
        path = before
        path.hit = intersect_lights(scene.lights, before.origin, before.direction, before.hit)
        if path.hit.kind == LIGHT and path.hit.t < path.flight:
            position = before.origin + before.direction * path.hit.t
            path.met = found_light(scene, path, scene.lights[path.hit.item], position)
        if wp.static(has_beyond):
            if path.hit.kind == MISS and path.flight >= 0.5 * INFINITE:
                for k in range(scene.lights.shape[0]):
                    light = scene.lights[k]
                    if light.kind == DOME or is_in_distant_light(light, path.direction):
                        path.met += found_light(scene, path, light, path.origin)
        return path

    @wp.func(inline=True)
    def lone_attenuation(medium: Medium, t: float, from_medium: bool, rate: float) -> float:
        """Of a medium whose channels do not differ."""
        return pass_segment(medium.law, mean_optical_depth(medium.extinction[0], t), from_medium, rate)

    # ---- shade: what does the surface do to light that it meets?

    @wp.func
    def read_shade(scene: SceneData, hit: Hit, direction: wp.vec3, start: Start) -> Shade:
        """The surface at a hit, ready to be evaluated."""
        look = look_at_item(scene, hit.item)
        normals_to_world = wp.identity(n=3, dtype=float)
        axes = wp.identity(n=3, dtype=float)
        if wp.static(features.instances):
            if look.instance >= 0:
                placement = place_instance(scene.meshes, look.instance + hit.item - look.item, start.time)
                normals_to_world = wp.transpose(placement.to_object)
                axes = wp.inverse(placement.to_object)
        is_within = look.container >= 0 and is_inside(start.inside, look.container)
        surface = read_surface(scene.shading[0], look, hit, direction, is_within, normals_to_world, axes)
        if wp.static(refracts):
            if look.container >= 0:
                beyond = cross_boundary(start.inside, look.container)
                surface.bsdf = put_glass(scene, surface.bsdf, start.inside, beyond)
        surface.bsdf = prepare_bsdf(scene.shading[0].albedos, surface.bsdf, -direction)
        return surface

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
    def is_hidden(scene: SceneData, container: int, inside: wp.uint32) -> bool:
        """True of a boundary that light enters, where another medium fills the space on both sides of it."""
        hidden = bool(False)
        if wp.static(refracts):
            if container >= 0:
                beyond = cross_boundary(inside, container)
                hidden = medium_at(scene.containers, inside) == medium_at(scene.containers, beyond)
        return hidden

    @wp.func
    def go_through(scene: SceneData, before: Start, container: int, origin: wp.vec3, t: float) -> Start:
        """Beyond the boundary of a container that a ray crosses at t."""
        start = before
        if wp.static(features.contacts):
            start.entered = entered_at(before, container, origin, t, scene.contact_rounding)
        start.inside = cross_boundary(before.inside, container)
        start.t_min = t
        start.crossed = container
        return start

    @wp.func
    def pass_surface(scene: SceneData, before: Path, container: int, weight: wp.vec3, keeps: bool) -> Path:
        """It goes straight on; on a boundary, on the other side of it."""
        path = before
        path.passes = 1
        path.albedo = weight
        path.keeps = wp.where(keeps, 1, 0)
        if container >= 0:
            path.start = go_through(scene, before.start, container, before.origin, before.hit.t)
            path = with_index(scene, path)
            path.body = wp.where(keeps, before.body, -1)
        else:
            path.start.passed = before.hit.t
        return path

    @wp.func
    def change_side(scene: SceneData, before: Path, container: int) -> Path:
        """It is on the other side of a boundary."""
        path = before
        path.start.inside = cross_boundary(before.start.inside, container)
        return with_index(scene, path)

    @wp.func
    def with_index(scene: SceneData, before: Path) -> Path:
        """With the index of refraction of where it is."""
        path = before
        index = ior_at(scene.containers, path.start.inside) / scene.camera_ior
        path.squeeze = index * index
        return path

    @wp.func(inline=True)
    def reaches_surface(path: Path) -> bool:
        """True where a surface is what it meets, and it was not scattered before."""
        return path.hit.kind == SURFACE and path.flight > path.hit.t

    @wp.func
    def shade(scene: SceneData, before: Path, seed: wp.uint64):
        """What becomes of a path that reaches a surface, and the surface, lane by lane."""
        path = before
        container = look_at_item(scene, before.hit.item).container
        path.start.crossed = container
        path.keeps = 0
        if is_hidden(scene, container, before.start.inside):
            beyond = go_through(scene, before.start, container, before.origin, before.hit.t)
            keeps = carries_on(scene.containers, before.medium, before.start.inside, beyond.inside, beyond.entered)
            return pass_surface(scene, path, container, wp.vec3(1.0), keeps), Bsdf()
        surface = read_shade(scene, before.hit, before.direction, before.start)
        bsdf = surface.bsdf
        path.met = surface.emission
        path.reflectance = surface.reflectance
        path.hit.normal = bsdf.facet
        # Numbers of their own: what is drawn for the event says already that it comes here.
        more = draw_more(seed, before.pixel, before.turn, before.bounce, CONNECTION)
        if wp.static(passes):
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
        if wp.static(refracts):
            path.transmits = s.transmits
            if s.transmits == 1:
                path = change_side(scene, path, container)
                path.body = -1
        return path, bsdf

    # ---- meet: what of the scene does it find there, and does the light end here?

    @wp.func
    def attenuation(medium: Medium, t: float, from_medium: bool, rates: wp.vec3) -> wp.vec3:
        red = lone_attenuation(medium, t, from_medium, rates[0])
        if wp.static(features.chromatic):
            return wp.vec3(
                red,
                pass_segment(medium.law_green, mean_optical_depth(medium.extinction[1], t), from_medium, rates[1]),
                pass_segment(medium.law_blue, mean_optical_depth(medium.extinction[2], t), from_medium, rates[2]),
            )
        return wp.vec3(red)

    @wp.func
    def channel_densities(medium: Medium, t: float, from_medium: bool, rates: wp.vec3) -> wp.vec3:
        """Per channel, the density with which a flight ends at t; of one without length, the probability of that."""
        shortest = SHORTEST_DEPTH / max_component(medium.extinction)
        densities = wp.vec3()
        for channel in range(3):
            extinction = medium.extinction[channel]
            law = law_of_channel(medium, channel)
            if t > shortest:
                u = mean_optical_depth(extinction, t)
                densities[channel] = extinction * end_in_segment(law, u, from_medium, rates[channel])
            else:
                passed = pass_segment(law, extinction * shortest, from_medium, rates[channel])
                densities[channel] = wp.max(1.0 - passed, 1.0e-7)
        return densities

    @wp.func
    def intersect(scene: SceneData, origin: wp.vec3, direction: wp.vec3, t_max: float, start: Start) -> Hit:
        hit = Hit()
        hit.t = t_max
        hit.kind = MISS
        if wp.static(has_solids):
            hit = intersect_solids(scene.solids, scene.motions, origin, direction, start, hit)
        if wp.static(features.meshes):
            hit = intersect_meshes(scene.meshes, origin, direction, start, hit)
        if wp.static(has_lights):
            if start.casters == wp.uint32(0):
                hit = intersect_lights(scene.lights, origin, direction, hit)
        return hit

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
            start = go_through(scene, start, gate, path.origin, hit.t)
            if not carries_on(scene.containers, path.medium, inside, start.inside, start.entered):
                break
            hit = intersect(scene, path.origin, path.direction, INFINITE, start)
        return hit.t

    @wp.func
    def gate_of(scene: SceneData, hit: Hit) -> int:
        """The container whose boundary was met, or -1."""
        gate = int(-1)
        if hit.kind == BOUNDARY:
            gate = hit.item
        if wp.static(refracts):
            if hit.kind == SURFACE:
                gate = look_at_item(scene, hit.item).container
        return gate

    @wp.func(inline=True)
    def channel_weight(path: Path) -> wp.vec3:
        """Balance heuristic over the channel that the flights were sampled from."""
        weight = wp.vec3(1.0, 1.0, 1.0)
        if wp.static(features.chromatic):
            total = path.channel_pdfs[0] + path.channel_pdfs[1] + path.channel_pdfs[2]
            weight = path.channel_pdfs * (3.0 / total)
        return weight

    @wp.func
    def meet(scene: SceneData, before: Path) -> Path:
        """Look-ups of media at the event, lane by lane; only scenes whose boundaries are crossed have this stage."""
        path = before
        scatters = before.medium >= 0 and before.flight <= before.hit.t
        path.keeps = 0
        if wp.static(passes):
            path.keeps = wp.where(before.passes == 1, before.keeps, 0)
        if wp.static(lone_law == ""):
            if before.hit.kind == BOUNDARY and not scatters:
                inside = before.start.inside
                beyond = go_through(scene, before.start, before.hit.item, before.origin, before.hit.t)
                path.start.entered = beyond.entered
                if carries_on(scene.containers, path.medium, inside, beyond.inside, beyond.entered):
                    path.keeps = 1
                else:
                    path.body = -1
            if path.medium >= 0 and path.keeps == 0:
                medium = seen_medium(scene.media[scene.first_medium + path.medium], path.depth)
                if scatters:
                    path.albedo = medium.albedo
                    path.phase = medium.phase
                    if wp.static(tells_prims):
                        path.container = container_at(scene.containers, before.start.inside)
                if wp.static(features.chromatic):
                    densities = wp.vec3(1.0)
                    if scatters:
                        densities = channel_densities(medium, before.length, before.from_medium == 1, before.rates)
                    else:
                        t = before.hit.t - before.segment
                        densities = attenuation(medium, t, before.from_medium == 1, before.rates)
                    relative = densities / wp.max(densities[path.channel], 1.0e-37)
                    path.channel_pdfs = wp.cw_mul(path.channel_pdfs, relative)
        if wp.static(sees_segment_length):
            if path.depth == 0 and path.medium >= 0 and path.has_met_medium == 0:
                if scatters or path.keeps == 0:
                    medium = scene.media[scene.first_medium + path.medium]
                    end = segment_end(scene, before)
                    if wp.static(features.lens):
                        end = wp.min(end, far_distance(camera_of(scene.camera, before), before.direction))
                    length = end - before.segment
                    path.first_transmittance = attenuation(medium, length, False, wp.vec3(NOT_FROZEN))
                    path.first_optical_depth = medium.extinction * length
                    path.has_met_medium = 1
        return path

    @wp.func(inline=True)
    def length_in_medium(path: Path) -> float:
        """Of the medium segment that ends at this event; 0 where none does."""
        end = wp.min(path.flight, path.hit.t)
        length = float(0.0)
        if wp.static(lone_solid):
            length = wp.max(wp.min(end, path.t_out), path.t_in) - path.t_in
        else:
            ends = path.medium >= 0 and path.keeps == 0 and end < 0.5 * INFINITE
            length = wp.where(ends, end - path.segment, 0.0)
        return length

    # ---- arrive: cross a boundary, leave the scene, end at a light, or scatter.

    @wp.func(inline=True)
    def cross(before: Path, is_alive: bool, crosses: bool, scatters_in_medium: bool, meets_surface: bool) -> Path:
        """A boundary lets it through, and ends its memory unless the medium is the same beyond."""
        path = before
        is_new = is_alive
        if wp.static(passes):
            is_new = is_alive and before.passes == 0
        crossed = cross_boundary(before.start.inside, wp.where(crosses, before.hit.item, 0))
        path.start.inside = wp.where(crosses, crossed, before.start.inside)
        path.start.t_min = wp.where(crosses, before.hit.t, wp.where(is_new, 0.0, before.start.t_min))
        if wp.static(features.contacts):
            begins = is_new and not crosses
            path.start.entered = wp.where(begins, wp.uint32(0), before.start.entered)
        last_crossed = wp.where(is_new, -1, before.start.crossed)
        if wp.static(refracts):
            last_crossed = wp.where(meets_surface, before.start.crossed, last_crossed)
        path.start.crossed = wp.where(crosses, before.hit.item, last_crossed)
        renewed = wp.where(before.keeps == 1, before.segment, before.hit.t)
        if wp.static(passes):
            path.segment = wp.where(crosses or before.passes == 1, renewed, wp.where(is_new, 0.0, before.segment))
        else:
            path.segment = wp.where(crosses, renewed, wp.where(is_alive, 0.0, before.segment))
        step = 2.0 * OFFSET * coordinate_reach(before.origin, 2.0 * before.hit.t)
        path.start.slack = wp.where(meets_surface, step, wp.where(scatters_in_medium, 0.0, before.start.slack))
        path.crossings = before.crossings + wp.where(crosses, 1, 0)
        if wp.static(passes):
            path.crossings = path.crossings + before.passes
        return path

    @wp.func(inline=True)
    def arrive(before: Path, lone: Medium, environment: wp.vec3, camera: Camera, limits: Limits) -> Path:
        path = before
        is_alive = before.alive == 1
        scatters_in_medium = is_alive and before.flight <= before.hit.t and before.flight < 0.5 * INFINITE
        arrives = is_alive and not scatters_in_medium
        crosses = arrives and before.hit.kind == BOUNDARY
        escapes = arrives and before.hit.kind == MISS
        meets_light = arrives and before.hit.kind == LIGHT
        meets_surface = arrives and before.hit.kind == SURFACE
        goes_on = crosses
        ends_light = escapes or meets_light or meets_surface
        is_lost = bool(False)
        if wp.static(passes):
            # What passes is not scattered, but meets emission.
            goes_straight = meets_surface and before.passes == 1
            goes_on = crosses or goes_straight
            meets_surface = meets_surface and before.passes == 0
            anew = scatters_in_medium or meets_surface
            path.start.passed = wp.where(anew, 0.0, before.start.passed)

        if wp.static(Aov.DEPTH in features.aovs):
            nearest = before.hit.t
            if wp.static(features.lens):
                nearest = wp.where(before.hit.kind == MISS, INFINITE, before.hit.t)
            if wp.static(lone_solid):
                t_in = before.t_in
                if wp.static(features.lens):
                    t_in = wp.where(t_in <= before.hit.t, t_in, INFINITE)
                nearest = wp.min(nearest, t_in)
            is_first = before.depth == 0 and nearest < INFINITE and before.first_depth == INFINITE
            if wp.static(passes):
                is_first = is_first and before.passes == 0
            view = camera_of(camera, before)
            ahead = nearest * wp.dot(before.direction, view.forward)
            if wp.static(features.lens):
                ahead += view.near
            path.first_depth = wp.where(is_first, ahead, before.first_depth)
        if wp.static(has_crossings):
            path = cross(path, is_alive, crosses, scatters_in_medium, meets_surface)
            is_lost = path.crossings > MAX_CROSSINGS
        if wp.static(lone_solid):
            stays = meets_surface and before.hit.t >= before.t_in and before.hit.t < before.t_out
            stays = stays or scatters_in_medium
            path.start.inside = wp.where(is_alive, wp.where(stays, wp.uint32(1), wp.uint32(0)), before.start.inside)
            if wp.static(sees_segment_length):
                length = wp.min(before.t_out, before.hit.t) - before.t_in
                is_first = is_alive and before.depth == 0 and length >= 0.0
                passed = lone_attenuation(lone, wp.max(length, 0.0), False, NOT_FROZEN)
                passed = wp.where(is_first, passed, before.first_transmittance[0])
                path.first_transmittance = wp.vec3(passed, passed, passed)
                depth = lone.extinction[0] * length
                depth = wp.where(is_first, depth, before.first_optical_depth[0])
                path.first_optical_depth = wp.vec3(depth, depth, depth)

        weight = channel_weight(before)
        if wp.static(features.media and Aov.COLLISIONS in features.aovs):
            collisions = wp.where(scatters_in_medium, 1.0, 0.0)
            path.collisions = before.collisions + wp.cw_mul(before.throughput, weight) * collisions
        if wp.static(features.media and Aov.PATH_LENGTH in features.aovs):
            length = wp.where(is_alive, length_in_medium(before), 0.0)
            path.path_length = before.path_length + wp.cw_mul(before.throughput, weight) * length

        # Light ends there: what it met, or what is beyond the scene.
        share = before.throughput
        if wp.static(refracts):
            share = before.throughput * (1.0 / before.squeeze)
        if wp.static(meets_emitters):
            ends_there = wp.where(ends_light, 1.0, 0.0)
            path.radiance = path.radiance + wp.cw_mul(share, wp.cw_mul(before.met, weight)) * ends_there
        if wp.static(features.environment):
            beyond = wp.cw_mul(share, wp.cw_mul(environment, weight))
            path.radiance = path.radiance + beyond * wp.where(escapes, 1.0, 0.0)
        if wp.static(splits):
            path.direct = choose(before.depth <= 1, path.radiance, before.direct)

        # It scatters: in the medium, or from a surface.
        would_scatter = scatters_in_medium or meets_surface
        t = wp.where(would_scatter, wp.min(before.hit.t, before.flight), 0.0)
        albedo = wp.vec3(0.0, 0.0, 0.0)
        wi = before.direction
        if wp.static(features.media):
            phase = Phase()
            if wp.static(lone_law == ""):
                phase = before.phase
                albedo = before.albedo
            else:
                medium = seen_medium(lone, before.depth)
                phase = medium.phase
                albedo = medium.albedo
            wi = sample_phase(phase, before.direction, before.xi[2], before.xi[3])
            if wp.static(features.meshes):
                # Not so close to a face ahead that rounding could put the event behind it.
                clear = wp.max(
                    before.hit.t - MARGIN * coordinate_reach(before.origin, before.flight), 0.5 * before.hit.t
                )
                t = wp.where(scatters_in_medium, wp.min(before.flight, clear), t)
        path.origin = before.origin + before.direction * t
        if wp.static(has_surfaces):
            normal = before.hit.normal
            if wp.static(not shades):
                faces = wp.dot(before.hit.normal, before.direction) < 0.0
                normal = choose(faces, before.hit.normal, -before.hit.normal)
            path.hit.normal = normal
            side = normal
            if wp.static(refracts):
                side = choose(before.transmits == 1, -normal, normal)
            if wp.static(Aov.NORMAL in features.aovs and not shades):
                path.first_normal = choose(before.depth == 0 and meets_surface, normal, before.first_normal)
            off_surface = offset_from_surface(path.origin, side, before.hit.t)
            path.origin = choose(meets_surface, off_surface, path.origin)
            if wp.static(shades):
                wi = choose(meets_surface, before.wi, wi)
            else:
                wi = choose(meets_surface, sample_diffuse(normal, before.xi[2], before.xi[3]), wi)
            albedo = choose(meets_surface, before.albedo, albedo)
            if wp.static(passes):
                albedo = choose(goes_straight, before.albedo, albedo)
        if wp.static(Aov.ALBEDO in features.aovs):
            is_first = before.depth == 0 and would_scatter
            color = albedo
            if wp.static(shades):
                color = choose(meets_surface, before.reflectance, albedo)
            path.first_albedo = choose(is_first, color, before.first_albedo)
        if wp.static(tells_prims):
            is_first = before.depth == 0 and would_scatter
            container = int(0)
            if wp.static(lone_law == ""):
                container = before.container
            item = wp.where(meets_surface, before.hit.item, FIRST_CONTAINER - container)
            path.seen = wp.where(is_first, wp.min(before.hit.t, before.flight), before.seen)
            path.seen_item = wp.where(is_first, item, before.seen_item)
            path.seen_at = choose(is_first, path.origin, before.seen_at)
        dimmed = wp.cw_mul(before.throughput, albedo)
        is_absorbed = would_scatter and max_component(dimmed) == 0.0
        is_cut = would_scatter and not is_absorbed and before.depth >= limits.max_depth
        scatters = would_scatter and not is_absorbed and not is_cut
        path.throughput = choose(scatters, dimmed, before.throughput)
        path.wi = choose(scatters, wi, before.direction)
        connects = scatters
        if wp.static(passes):
            path.throughput = choose(scatters or goes_straight, dimmed, before.throughput)
        if wp.static(shades):
            # A surface from which no direction is found may still be lit.
            connects = scatters or (meets_surface and is_absorbed and before.depth < limits.max_depth)
            path.incoming = before.throughput
        path.scatters = wp.where(connects, wp.where(meets_surface, SURFACE, BOUNDARY), MISS)
        remembers = scatters_in_medium or (goes_on and before.keeps == 1 and before.from_medium == 1)
        path.from_medium = wp.where(remembers, 1, 0)
        path.alpha = wp.where(would_scatter or meets_light, 1.0, before.alpha)
        path.truncated = wp.where(is_cut or is_lost, 1, before.truncated)
        ends = escapes or meets_light or is_cut or is_absorbed or is_lost
        path.alive = wp.where(ends, 0, before.alive)
        return path

    # ---- connect: next-event estimation.

    @wp.func
    def links_here(scene: SceneData, path: Path) -> wp.uint32:
        """Of what the path has just been scattered by."""
        if wp.static(has_surfaces):
            if path.scatters == SURFACE:
                return scene.surfaces[surface_at(scene.surface_of, path.hit.item)].light_links
        links = wp.uint32(ALL_LINKS)
        if wp.static(features.media):
            links = scene.containers[container_at(scene.containers, path.start.inside)].light_links
        return links

    @wp.func
    def passage(
        scene: SceneData, path: Path, light: Light, direction: wp.vec3, distance: float, seed: wp.uint64
    ) -> Connection:
        """What passes from a vertex to a light through the media between them."""
        result = Connection()
        result.transmittance = wp.vec3(1.0)
        start = path.start
        segment = float(0.0)
        from_medium = path.from_medium == 1
        medium = int(-1)
        casting = ALL_LINKS
        if wp.static(features.links):
            start.casters = light.casters
            casting = light.casting_containers
        if wp.static(features.media):
            medium = medium_at(scene.containers, start.inside & casting)
        rates = path.rates
        # Whose rates are to be drawn; those of the medium that the path is in, it has.
        body = int(-1)
        if wp.static(features.frozen and not freezes_at_birth):
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
            if wp.static(passes):
                if hit.kind == SURFACE:
                    straight = straight_share(scene, hit, direction, start)
                    result.transmittance = wp.cw_mul(result.transmittance, straight)
                    lets_through = max_component(straight) > 0.0
                    gate = look_at_item(scene, hit.item).container
                    if gate < 0:
                        start.passed = hit.t
            if wp.static(features.media):
                beyond = medium
                if lets_through and gate >= 0:
                    inside = start.inside & casting
                    start = go_through(scene, start, gate, path.origin, hit.t)
                    beyond = medium_at(scene.containers, start.inside & casting)
                    goes_on = carries_on(scene.containers, medium, inside, start.inside & casting, start.entered)
                if medium >= 0 and (not lets_through or not goes_on):
                    crossed = seen_medium(scene.media[scene.first_medium + medium], path.depth + 1)
                    if wp.static(features.frozen and not freezes_at_birth):
                        if body >= 0:
                            rates = draw_rates(scene, path, crossed, body, seed)
                    passed = attenuation(crossed, hit.t - segment, from_medium, rates)
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
                if wp.static(features.frozen and not freezes_at_birth):
                    body = container_at(scene.containers, start.inside & casting)
        result.transmittance = wp.vec3(0.0)
        result.truncated = 1
        return result

    @wp.func
    def straight_share(scene: SceneData, hit: Hit, direction: wp.vec3, start: Start) -> wp.vec3:
        """Of light that meets a surface, what passes straight on."""
        look = look_at_item(scene, hit.item)
        if scene.shading[0].materials[look.material].may_pass == 0:
            return wp.vec3(0.0)
        if is_hidden(scene, look.container, start.inside):
            return wp.vec3(1.0)
        surface = read_shade(scene, hit, direction, start)
        return surface.bsdf.passes

    @wp.func(inline=True)
    def scatter_pdf(path: Path, lone: Medium, wi: wp.vec3) -> float:
        """pdf_solid_angle of scattering into `wi` at this event, and the share that scatters there."""
        pdf = float(0.0)
        if wp.static(features.media):
            phase = seen_medium(lone, path.depth).phase
            if wp.static(lone_law == ""):
                phase = path.phase
            pdf = eval_phase(phase, path.direction, wi)
        if wp.static(has_surfaces):
            pdf = wp.where(path.scatters == SURFACE, diffuse_pdf(path.hit.normal, wi), pdf)
        return pdf

    @wp.func(inline=True)
    def light_place(path: Path, seed: wp.uint64) -> wp.vec4:
        """Which light, and where on it."""
        return draw(seed, path.pixel, path.turn, path.bounce, CONNECTION)

    @wp.func(inline=True)
    def aim_connection(before: Path, lone: Medium, towards: LightSample, pdf_choice: float) -> Path:
        """The connection to a point of a light, as if nothing were between."""
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

    @wp.func
    def light_surface(scene: SceneData, before: Path, bsdf: Bsdf, towards: LightSample, pdf_choice: float) -> Path:
        """What the connection brings by way of a surface, in the place of what it would bring in a medium."""
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
        """The path at a surface that light may enter, on the side from which the light comes."""
        path = before
        container = look_at_item(scene, before.hit.item).container
        is_beyond = wp.dot(before.hit.normal, direction) < 0.0
        if container >= 0 and is_beyond != (before.transmits == 1):
            path = change_side(scene, before, container)
            back = wp.where(is_beyond, -2.0, 2.0) * OFFSET * coordinate_reach(before.origin, before.hit.t)
            path.origin = before.origin + before.hit.normal * back
        return path

    @wp.func
    def connect(scene: SceneData, lone: Medium, before: Path, bsdf: Bsdf, seed: wp.uint64) -> Path:
        """All of it, lane by lane."""
        path = before
        is_shaded = bool(False)
        if wp.static(shades):
            is_shaded = before.scatters == SURFACE
        if not is_shaded:
            path.pdf_direction = scatter_pdf(path, lone, path.wi)
        xi = light_place(path, seed)
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
        path = aim_connection(path, lone, towards, chance(light))
        if wp.static(shades):
            if is_shaded:
                path = light_surface(scene, path, bsdf, towards, chance(light))
        if max_component(path.light_share) > 0.0:
            lit = path
            if wp.static(refracts):
                if is_shaded:
                    lit = face_light(scene, path, path.to_light)
            link = passage(scene, lit, light, path.to_light, path.light_distance, seed)
            path.truncated = wp.max(path.truncated, link.truncated)
            share = path.light_share
            if wp.static(refracts):
                share = share / lit.squeeze
            path.radiance += wp.cw_mul(share, link.transmittance)
        return path

    @wp.func(inline=True)
    def begin_connection(before: Path, lone: Medium) -> Path:
        path = before
        scatters = before.scatters != MISS
        path.pdf_direction = wp.where(scatters, scatter_pdf(before, lone, before.wi), before.pdf_direction)
        path.light_share = wp.vec3(0.0, 0.0, 0.0)
        return path

    @wp.func(inline=True)
    def aim_at_light(before: Path, lone: Medium, seed: wp.uint64, light: Light, kind: int) -> Path:
        """The connection, where this is the light."""
        path = before
        xi = light_place(before, seed)
        aimed = aim_connection(before, lone, sample_light(light, kind, before.origin, xi[1], xi[2]), chance(light))
        is_chosen = xi[0] >= light.first_chance and xi[0] < light.last_chance
        path.to_light = choose(is_chosen, aimed.to_light, before.to_light)
        path.light_distance = wp.where(is_chosen, aimed.light_distance, before.light_distance)
        path.light_share = choose(is_chosen, aimed.light_share, before.light_share)
        return path

    @wp.func(inline=True)
    def block(before: Path, t: float) -> Path:
        """The connection, ended by what is at distance t."""
        path = before
        path.light_share = before.light_share * wp.where(t < before.light_distance, 0.0, 1.0)
        return path

    @wp.func(inline=True)
    def block_by_surface(before: Path, solid: Solid, kind: int) -> Path:
        return block(before, surface_distance(solid_span(solid, kind, before.origin, before.to_light), 0.0))

    @wp.func(inline=True)
    def block_by_light(before: Path, light: Light, kind: int) -> Path:
        return block(before, light_distance(light, kind, before.origin, before.to_light))

    @wp.func
    def mesh_between(trees: wp.array(dtype=Bvh), path: Path) -> float:
        """Distance of the mesh that is in the connection's way."""
        nearest = Hit()
        nearest.t = path.light_distance
        return intersect_meshes(trees, path.origin, path.to_light, path.start, nearest).t

    @wp.func(inline=True)
    def dim_by_lone_solid(before: Path, lone: Medium, solid: Solid, kind: int) -> Path:
        """The connection, dimmed by the only medium."""
        path = before
        span = chord(solid_span(solid, kind, before.origin, before.to_light), before.start.inside != wp.uint32(0))
        length = wp.min(span[1], before.light_distance) - span[0]
        medium = seen_medium(lone, before.depth + 1)
        passed = lone_attenuation(medium, wp.max(length, 0.0), before.from_medium == 1, before.rates[0])
        path.light_share = before.light_share * wp.where(length > 0.0, passed, 1.0)
        return path

    @wp.func(inline=True)
    def end_connection(before: Path) -> Path:
        path = before
        path.radiance = before.radiance + before.light_share
        return path

    # ---- go on: roulette, and the new direction.

    @wp.func(inline=True)
    def go_on(before: Path, limits: Limits) -> Path:
        path = before
        scattered = before.scatters != MISS
        if wp.static(splits):
            path.direct = choose(before.depth == 0, before.radiance, before.direct)
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

    @wp.func
    def go_to_pixel(before: Path, width: int, seed: wp.uint64, pixel: int) -> Path:
        path = before
        path.pixel = pixel
        path.row = pixel // width
        path.column = pixel % width
        shift = pixel_shift(seed, pixel)
        path.shift_x = wp.int32(shift[0])
        path.shift_y = wp.int32(shift[1])
        return path

    @wp.func(inline=True)
    def emit(camera: Camera, inside: wp.uint32, seed: wp.uint64, before: Path) -> Path:
        """The path of this pixel and sample, at the camera."""
        path = Path()
        path.pixel = before.pixel
        path.row = before.row
        path.column = before.column
        path.sample = before.sample
        path.end_sample = before.end_sample
        path.alive = 1
        path.turn = wp.int32(reverse_bits(wp.uint32(path.end_sample + path.sample)))
        path.shift_x = before.shift_x
        path.shift_y = before.shift_y
        in_pixel = wp.vec2(0.0, 0.0)
        if wp.static(is_lattice):
            in_pixel = draw_in_pixel(path.shift_x, path.shift_y, path.turn)
        else:
            xi = draw(seed, path.pixel, path.turn, 0, CAMERA)
            in_pixel = wp.vec2(xi[0], xi[1])
        if wp.static(features.chromatic or features.lens or features.motion):
            xi = draw(seed, path.pixel, path.turn, 0, WHOLE_PATH)
            path.channel = wp.min(int(xi[0] * 3.0), 2)
            path.start.time = xi[1]
            lens_x = xi[2]
            lens_y = xi[3]
        if wp.static(features.lens):
            view = camera_of(camera, path)
            film = film_point(view, path.row, path.column, in_pixel[0], in_pixel[1])
            ray = camera_ray(view, film, lens_x, lens_y)
            path.origin = ray.origin
            path.direction = ray.direction
        else:
            path.origin = camera.position
            path.direction = camera_direction(camera, path.row, path.column, in_pixel[0], in_pixel[1])
        path.throughput = wp.vec3(1.0, 1.0, 1.0)
        path.start.inside = inside
        path.start.crossed = -1
        path.pdf_direction = CAMERA_RAY
        path.first_depth = INFINITE
        path.seen = INFINITE
        path.seen_item = NOT_SEEN
        path.first_transmittance = wp.vec3(1.0, 1.0, 1.0)
        path.medium = -1
        path.links = ALL_LINKS
        path.rates = wp.vec3(NOT_FROZEN)
        path.body = -1
        path.squeeze = 1.0
        if wp.static(features.chromatic):
            path.channel_pdfs = wp.vec3(1.0, 1.0, 1.0)
        return path

    @wp.func
    def find_start(scene: SceneData, before: Path) -> Path:
        """The containers around the path's start: those entered and not left on its own line from outside of all."""
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
            if wp.static(has_solids):
                for s in range(scene.solids.shape[0]):
                    solid = scene.solids[s]
                    if wp.static(features.motion):
                        solid = solid_at(solid, scene.motions, start.time)
                    if solid.container >= 0:
                        span = solid_span(solid, solid.kind, origin, before.direction)
                        hit = meet_solid_boundary(solid, span, start, hit)
            if wp.static(features.meshes):
                hit = intersect_meshes(scene.boundaries, origin, before.direction, start, hit)
            if hit.kind != BOUNDARY:
                break
            start = go_through(scene, start, hit.item, origin, hit.t)
        path.start.inside = start.inside
        path.start.slack = 2.0 * OFFSET * coordinate_reach(before.origin, back)
        return path

    @wp.func
    def track(scene: SceneData, before: Path) -> Path:
        """How what a complete path saw first moves in the image."""
        path = before
        if before.seen_item != NOT_SEEN:
            drift = Drift()
            if before.seen_item <= FIRST_CONTAINER:
                drift = scene.container_drifts[FIRST_CONTAINER - before.seen_item]
            else:
                drift = scene.surface_drifts[before.seen_item]
            path.first_motion = image_motion(scene.camera, drift, before.seen_at, before.start.time)
        return path

    @wp.func(inline=True)
    def finish(before: Tally, path: Path, is_complete: bool) -> Tally:
        """The tally of the path's pixel with the path in it, where the path is complete."""
        sample = Sample()
        sample.radiance = path.radiance
        sample.alpha = path.alpha
        sample.depth = path.first_depth
        sample.transmittance = path.first_transmittance
        sample.albedo = path.first_albedo
        sample.collisions = path.collisions
        sample.path_length = path.path_length
        sample.normal = path.first_normal
        sample.motion = path.first_motion
        sample.optical_depth = path.first_optical_depth
        sample.direct = path.direct
        sample.scatterings = float(path.depth)
        sample.seen = path.seen
        sample.seen_item = path.seen_item
        sample.truncated = path.truncated
        return add_sample(before, sample, is_complete)

    @wp.func
    def read_film(film: Film, place: int) -> Tally:
        tally = Tally()
        tally.radiance = film.radiance[place]
        tally.radiance_sq = film.radiance_sq[place]
        tally.alpha = film.alpha[place]
        tally.invalid = film.invalid[place]
        tally.truncated = film.truncated[place]
        if wp.static(Aov.DEPTH in features.aovs):
            tally.depth = film.depth[place]
        if wp.static(Aov.TRANSMITTANCE in features.aovs):
            tally.transmittance = film.transmittance[place]
        if wp.static(Aov.ALBEDO in features.aovs):
            tally.albedo = film.albedo[place]
        if wp.static(Aov.COLLISIONS in features.aovs):
            tally.collisions = film.collisions[place]
        if wp.static(Aov.PATH_LENGTH in features.aovs):
            tally.path_length = film.path_length[place]
        if wp.static(Aov.NORMAL in features.aovs):
            tally.normal = film.normal[place]
        if wp.static(Aov.MOTION in features.aovs):
            tally.motion = film.motion[place]
        if wp.static(Aov.OPTICAL_DEPTH in features.aovs):
            tally.optical_depth = film.optical_depth[place]
        if wp.static(splits):
            tally.direct = film.direct[place]
        if wp.static(Aov.SCATTERINGS in features.aovs):
            tally.scatterings = film.scatterings[place]
        if wp.static(tells_prims):
            tally.seen = film.seen[place]
            tally.seen_item = film.seen_item[place]
        return tally

    @wp.func
    def write_film(film: Film, place: int, tally: Tally):
        film.radiance[place] = tally.radiance
        film.radiance_sq[place] = tally.radiance_sq
        film.alpha[place] = tally.alpha
        film.invalid[place] = tally.invalid
        film.truncated[place] = tally.truncated
        if wp.static(Aov.DEPTH in features.aovs):
            film.depth[place] = tally.depth
        if wp.static(Aov.TRANSMITTANCE in features.aovs):
            film.transmittance[place] = tally.transmittance
        if wp.static(Aov.ALBEDO in features.aovs):
            film.albedo[place] = tally.albedo
        if wp.static(Aov.COLLISIONS in features.aovs):
            film.collisions[place] = tally.collisions
        if wp.static(Aov.PATH_LENGTH in features.aovs):
            film.path_length[place] = tally.path_length
        if wp.static(Aov.NORMAL in features.aovs):
            film.normal[place] = tally.normal
        if wp.static(Aov.MOTION in features.aovs):
            film.motion[place] = tally.motion
        if wp.static(Aov.OPTICAL_DEPTH in features.aovs):
            film.optical_depth[place] = tally.optical_depth
        if wp.static(splits):
            film.direct[place] = tally.direct
        if wp.static(Aov.SCATTERINGS in features.aovs):
            film.scatterings[place] = tally.scatterings
        if wp.static(tells_prims):
            film.seen[place] = tally.seen
            film.seen_item[place] = tally.seen_item

    # ---- the drivers.

    @wp.func
    def scene_of_image(scene: SceneData, image: int) -> SceneData:
        """The scene with this image's media."""
        view = scene
        view.first_medium = image * scene.media_count
        return view

    @wp.func
    def lone_medium(scene: SceneData) -> Medium:
        """The only medium, the same for every lane."""
        medium = Medium()
        if wp.static(lone_law != ""):
            medium = scene.media[scene.first_medium + scene.containers[0].medium]
            medium.law.kind = wp.static(LAW_KINDS[lone_law])
        return medium

    connects_in_lanes = features.connects_in_lanes
    opens_eyes_at_once = not features.media or (lone_law != "" and not lone_solid)
    needs_meeting = has_crossings and (lone_law == "" or sees_segment_length)

    @wp.func
    def look(scene: SceneData, before: Path) -> Path:
        """One path's look at the whole scene."""
        path = before
        if wp.static(lone_solid):
            solid = scene.solids[scene.lone_solid]
            path = look_at_lone_solid(path, solid, solid.kind)
        path = open_eyes(path, scene.camera)
        if wp.static(has_solids):
            path = look_at_solids(scene, path)
        if wp.static(features.meshes):
            path = see_mesh(path, hit_of_meshes(scene.meshes, path), scene.surfaces, scene.surface_of)
        if wp.static(features.intricate_lights):
            path = look_at_lights(scene, path)
        else:
            if wp.static(has_lights):
                for k in range(scene.lights.shape[0]):
                    light = scene.lights[k]
                    if light.kind != DISTANT:
                        path = look_at_light(path, light, light.kind, k)
            if wp.static(features.distant_lights):
                for k in range(scene.lights.shape[0]):
                    path = look_beyond(path, scene.lights[k])
        return path

    @wp.kernel(module="unique", module_options=kernel_options(features.meshes))
    def render_threads(
        batch: SceneData,
        limits: Limits,
        film: Film,
        images: wp.array(dtype=int),
        pixel_count: int,
        counts: Counts,
        part: Round,
    ):
        slot, turn = wp.tid()
        image = images[slot]
        pixel = counts.order[image * pixel_count + turn]
        scene = scene_of_image(batch, image)
        seed = scene.seeds[image]
        lone = lone_medium(scene)
        place = image * pixel_count + pixel
        tally = read_film(film, place)
        waiting = go_to_pixel(Path(), scene.camera.width, seed, pixel)
        first_sample, end_sample = samples_of_round(counts, part, place)
        for sample in range(first_sample, end_sample):
            waiting.sample = sample
            path = emit(scene.camera, scene.camera_inside, seed, waiting)
            if wp.static(features.varied_starts):
                path = find_start(scene, path)
            if wp.static(freezes_at_birth):
                path.rates = draw_rates(scene, path, lone, 0, seed)
            while path.alive == 1:
                path = depart(path, seed)
                if wp.static(features.media):
                    if wp.static(lone_law == ""):
                        path = fly_anywhere(scene, path, seed)
                    else:
                        if wp.static(looks_up_flights):
                            path = look_up_exact_flight(begin_exact_flight(path, lone), lone, scene.tables)
                        path = fly_in_lone_medium(path, lone, seed)
                path = look(scene, path)
                bsdf = Bsdf()
                if wp.static(shades):
                    if reaches_surface(path):
                        path, bsdf = shade(scene, path, seed)
                if wp.static(needs_meeting):
                    path = meet(scene, path)
                path = arrive(path, lone, scene.environment, scene.camera, limits)
                if wp.static(features.connections):
                    if path.scatters != MISS:
                        path = connect(scene, lone, path, bsdf, seed)
                path = go_on(path, limits)
            if wp.static(tracks):
                path = track(scene, path)
            tally = finish(tally, path, True)
        write_film(film, place, tally)

    # ---- the pool: what a round does with all lanes, stage by stage. Each is a function of its own, for the compiler's
    # time grows with the square of what it finds in one.

    @wp.func(inline=True)
    def sums_of(pool: wp.uint64) -> wp.array(dtype=wp.float64):
        """Of each lane's pixel. Arrays of known layout are what lets the compiler see that lanes are apart."""
        return wp.array(ptr=pool, shape=(wp.static(sum_count),), dtype=wp.float64)

    @wp.func(inline=True)
    def lanes_of(pool: wp.uint64) -> wp.array(dtype=float):
        return wp.array(ptr=pool + wp.uint64(wp.static(8 * sum_count)), shape=(wp.static(pool_floats),), dtype=float)

    @wp.func(inline=True)
    def bsdfs_of(pool: wp.uint64) -> wp.array(dtype=Bsdf):
        """Of each lane, the surface that it met."""
        start = pool + wp.uint64(wp.static(8 * sum_count + 4 * pool_floats))
        return wp.array(ptr=start, shape=(wp.static(bsdf_count),), dtype=Bsdf)

    @wp.func
    def empty_lanes(pool: wp.uint64):
        lanes = lanes_of(pool)
        for i in range(LANES):
            idle = Path()
            idle.pixel = -1
            store(lanes, i, idle)

    @wp.func
    def track_lanes(pool: wp.uint64, scene: SceneData):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.alive == 0 and path.sample < 0:
                store(lanes, i, track(scene, path))

    @wp.func
    def finish_lanes(pool: wp.uint64) -> int:
        """Adds complete paths to their pixels; returns how many lanes wait for another pixel."""
        sums = sums_of(pool)
        lanes = lanes_of(pool)
        waiting = int(0)
        for i in range(LANES):
            path = load(lanes, i)
            is_complete = path.alive == 0 and path.sample < 0
            store_tally(sums, i, finish(load_tally(sums, i), path, is_complete))
        for i in range(LANES):
            path = load(lanes, i)
            is_complete = path.alive == 0 and path.sample < 0
            path.sample = path.sample + wp.where(is_complete, 1, 0)
            waiting += wp.where(path.sample == 0, 1, 0)
            store(lanes, i, path)
        return waiting

    @wp.func
    def hand_out_pixels(
        pool: wp.uint64,
        film: Film,
        counts: Counts,
        part: Round,
        first_place: int,
        width: int,
        seed: wp.uint64,
        next_turn: int,
        end_turn: int,
    ):
        """Waiting lanes' pixels go to the film, and they to others; returns whose turn it is, and how many retire."""
        sums = sums_of(pool)
        lanes = lanes_of(pool)
        turn = next_turn
        retired = int(0)
        for i in range(LANES):
            path = load(lanes, i)
            if path.sample == 0:
                if path.pixel >= 0:
                    write_film(film, first_place + path.pixel, load_tally(sums, i))
                turn = skip_pixels(counts, part, first_place, turn, end_turn)
                if turn < end_turn:
                    pixel = counts.order[first_place + turn]
                    path = go_to_pixel(path, width, seed, pixel)
                    first_sample, end_sample = samples_of_round(counts, part, first_place + pixel)
                    path.sample = first_sample - end_sample
                    path.end_sample = end_sample
                    store_tally(sums, i, read_film(film, first_place + pixel))
                    turn += 1
                else:
                    path.pixel = -1
                    path.sample = 1
                    retired += 1
                store(lanes, i, path)
        return turn, retired

    @wp.func
    def emit_lanes(pool: wp.uint64, scene: SceneData, lone: Medium, seed: wp.uint64):
        lanes = lanes_of(pool)
        camera = scene.camera
        for i in range(LANES):
            path = load(lanes, i)
            fresh = emit(camera, scene.camera_inside, seed, path)
            if path.alive == 0 and path.sample < 0:
                store(lanes, i, fresh)
        if wp.static(features.varied_starts):
            for i in range(LANES):
                path = load(lanes, i)
                if path.alive == 1 and path.bounce == 0:
                    store(lanes, i, find_start(scene, path))
        if wp.static(freezes_at_birth):
            for i in range(LANES):
                path = load(lanes, i)
                if path.alive == 1 and path.bounce == 0:
                    path.rates = draw_rates(scene, path, lone, 0, seed)
                    store(lanes, i, path)

    @wp.func
    def fly_lanes(pool: wp.uint64, camera: Camera, lone: Medium, seed: wp.uint64):
        """Departs, and in a lone medium flies."""
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            path = depart(path, seed)
            if wp.static(looks_up_flights):
                path = begin_exact_flight(path, lone)
            elif wp.static(lone_law != ""):
                path = fly_in_lone_medium(path, lone, seed)
            if wp.static(opens_eyes_at_once and not looks_up_flights):
                path = open_eyes(path, camera)
            store(lanes, i, path)

    @wp.func
    def look_up_lanes(pool: wp.uint64, camera: Camera, lone: Medium, tables: wp.array(dtype=wp.vec3), seed: wp.uint64):
        """Ends the flights that are looked up."""
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            store(lanes, i, look_up_exact_flight(path, lone, tables))
        for i in range(LANES):
            path = load(lanes, i)
            path = fly_in_lone_medium(path, lone, seed)
            if wp.static(opens_eyes_at_once):
                path = open_eyes(path, camera)
            store(lanes, i, path)

    @wp.func
    def fly_lanes_anywhere(pool: wp.uint64, scene: SceneData, seed: wp.uint64):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.alive == 1:
                path = open_eyes(fly_anywhere(scene, path, seed), scene.camera)
            store(lanes, i, path)

    @wp.func
    def look_at_lone_solid_in_lanes(pool: wp.uint64, camera: Camera, solid: Solid):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            store(lanes, i, open_eyes(look_at_lone_solid(path, solid, wp.static(lone_kind)), camera))

    @wp.func
    def look_at_solids_by_lane(pool: wp.uint64, scene: SceneData):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.alive == 1:
                store(lanes, i, look_at_solids(scene, path))

    @wp.func
    def look_at_solids_in_lanes(pool: wp.uint64, solids: wp.array(dtype=Solid), surfaces: wp.array(dtype=Surface)):
        lanes = lanes_of(pool)
        for s in range(solids.shape[0]):
            solid = solids[s]
            for kind in range(wp.static(len(SOLID_KINDS))):
                if wp.static(kind in solid_kinds):
                    if wp.static(has_crossings):
                        if solid.surface < 0 and solid.kind == kind:
                            for i in range(LANES):
                                path = load(lanes, i)
                                store(lanes, i, look_at_boundary(path, solid, kind))
                    if wp.static(has_surfaces):
                        if solid.surface >= 0 and solid.kind == kind:
                            surface = surfaces[solid.surface]
                            for i in range(LANES):
                                path = load(lanes, i)
                                store(lanes, i, look_at_surface(path, solid, kind, surface))

    @wp.func
    def look_at_meshes_by_lane(
        pool: wp.uint64, trees: wp.array(dtype=Bvh), surfaces: wp.array(dtype=Surface), surface_of: wp.array(dtype=int)
    ):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.alive == 1:
                hit = hit_of_meshes(trees, path)
                # Loaded anew after the call: for all that the compiler knows it could change any lane, and all that was
                # loaded before would be stored again.
                store(lanes, i, see_mesh(load(lanes, i), hit, surfaces, surface_of))

    @wp.func
    def look_at_lights_by_lane(pool: wp.uint64, scene: SceneData):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.alive == 1:
                store(lanes, i, look_at_lights(scene, path))

    @wp.func
    def look_at_lights_in_lanes(pool: wp.uint64, lights: wp.array(dtype=Light)):
        lanes = lanes_of(pool)
        for k in range(lights.shape[0]):
            light = lights[k]
            for kind in range(wp.static(len(LIGHT_KINDS))):
                if wp.static(kind in shaped_kinds):
                    if light.kind == kind:
                        for i in range(LANES):
                            path = load(lanes, i)
                            store(lanes, i, look_at_light(path, light, kind, k))
        if wp.static(features.distant_lights):
            for k in range(lights.shape[0]):
                light = lights[k]
                for i in range(LANES):
                    path = load(lanes, i)
                    store(lanes, i, look_beyond(path, light))

    @wp.func
    def shade_by_lane(pool: wp.uint64, scene: SceneData, seed: wp.uint64):
        lanes = lanes_of(pool)
        bsdfs = bsdfs_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.alive == 1 and reaches_surface(path):
                path, bsdf = shade(scene, path, seed)
                bsdfs[i] = bsdf
                store(lanes, i, path)

    @wp.func
    def meet_by_lane(pool: wp.uint64, scene: SceneData):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.alive == 1:
                store(lanes, i, meet(scene, path))

    @wp.func
    def arrive_in_lanes(pool: wp.uint64, lone: Medium, environment: wp.vec3, camera: Camera, limits: Limits):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            path = arrive(path, lone, environment, camera, limits)
            if wp.static(connects_in_lanes):
                path = begin_connection(path, lone)
            if wp.static(not features.connections):
                path = go_on(path, limits)
            store(lanes, i, path)

    @wp.func
    def connect_by_lane(pool: wp.uint64, scene: SceneData, lone: Medium, seed: wp.uint64):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.scatters != MISS:
                bsdf = Bsdf()
                if wp.static(shades):
                    bsdf = bsdfs_of(pool)[i]
                store(lanes, i, connect(scene, lone, path, bsdf, seed))

    @wp.func
    def aim_in_lanes(pool: wp.uint64, lights: wp.array(dtype=Light), lone: Medium, seed: wp.uint64):
        lanes = lanes_of(pool)
        for k in range(lights.shape[0]):
            light = lights[k]
            for kind in range(wp.static(len(LIGHT_KINDS))):
                if wp.static(kind in light_kinds):
                    if light.kind == kind:
                        for i in range(LANES):
                            path = load(lanes, i)
                            store(lanes, i, aim_at_light(path, lone, seed, light, kind))

    @wp.func
    def block_by_solids_in_lanes(pool: wp.uint64, solids: wp.array(dtype=Solid)):
        lanes = lanes_of(pool)
        for s in range(solids.shape[0]):
            solid = solids[s]
            for kind in range(wp.static(len(SOLID_KINDS))):
                if wp.static(kind in solid_kinds):
                    if solid.surface >= 0 and solid.kind == kind:
                        for i in range(LANES):
                            path = load(lanes, i)
                            store(lanes, i, block_by_surface(path, solid, kind))

    @wp.func
    def block_by_lights_in_lanes(pool: wp.uint64, lights: wp.array(dtype=Light)):
        lanes = lanes_of(pool)
        for k in range(lights.shape[0]):
            light = lights[k]
            for kind in range(wp.static(len(LIGHT_KINDS))):
                if wp.static(kind in shaped_kinds):
                    if light.kind == kind:
                        for i in range(LANES):
                            path = load(lanes, i)
                            store(lanes, i, block_by_light(path, light, kind))

    @wp.func
    def block_by_meshes_by_lane(pool: wp.uint64, trees: wp.array(dtype=Bvh)):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if max_component(path.light_share) > 0.0:
                distance = mesh_between(trees, path)
                store(lanes, i, block(load(lanes, i), distance))

    @wp.func
    def dim_in_lanes(pool: wp.uint64, lone: Medium, solid: Solid):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            store(lanes, i, dim_by_lone_solid(path, lone, solid, wp.static(lone_kind)))

    @wp.func
    def go_on_in_lanes(pool: wp.uint64, limits: Limits):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if wp.static(connects_in_lanes):
                path = end_connection(path)
            store(lanes, i, go_on(path, limits))

    @wp.kernel(module="unique", module_options=kernel_options(features.meshes))
    def render_pool(
        batch: SceneData,
        limits: Limits,
        film: Film,
        scratch: wp.array(dtype=float),
        image: int,
        pixels_per_image: int,
        first_turn: int,
        turn_count: int,
        counts: Counts,
        part: Round,
    ):
        # Tells these kernels apart: Warp's hash of a function does not see what depends on the variable of a loop.
        _kinds = wp.static(kinds_code)
        pool = scratch.ptr
        scene = scene_of_image(batch, image)
        seed = scene.seeds[image]
        lone = lone_medium(scene)
        lone_shape = Solid()
        if wp.static(lone_solid):
            lone_shape = scene.solids[scene.lone_solid]
        first_place = image * pixels_per_image
        end_turn = first_turn + turn_count
        next_turn = int(first_turn)
        empty_lanes(pool)
        working = int(LANES)
        while working > 0:
            # A lane takes the samples of its pixel one after the other, and then another pixel.
            if wp.static(tracks):
                track_lanes(pool, scene)
            waiting = finish_lanes(pool)
            if waiting >= MANY_WAITING or (waiting > 0 and next_turn >= end_turn):
                turn, retired = hand_out_pixels(
                    pool, film, counts, part, first_place, scene.camera.width, seed, next_turn, end_turn
                )
                next_turn = turn
                working -= retired
            emit_lanes(pool, scene, lone, seed)

            fly_lanes(pool, scene.camera, lone, seed)
            if wp.static(looks_up_flights):
                look_up_lanes(pool, scene.camera, lone, scene.tables, seed)
            if wp.static(features.media and lone_law == ""):
                fly_lanes_anywhere(pool, scene, seed)

            if wp.static(lone_solid):
                look_at_lone_solid_in_lanes(pool, scene.camera, lone_shape)
            if wp.static(has_solids and (features.motion or passes)):
                look_at_solids_by_lane(pool, scene)
            elif wp.static(has_solids and (has_crossings or has_surfaces)):
                look_at_solids_in_lanes(pool, scene.solids, scene.surfaces)
            if wp.static(features.meshes):
                look_at_meshes_by_lane(pool, scene.meshes, scene.surfaces, scene.surface_of)
            if wp.static(features.intricate_lights):
                look_at_lights_by_lane(pool, scene)
            elif wp.static(features.connections):
                look_at_lights_in_lanes(pool, scene.lights)
            if wp.static(shades):
                shade_by_lane(pool, scene, seed)
            if wp.static(needs_meeting):
                meet_by_lane(pool, scene)

            arrive_in_lanes(pool, lone, scene.environment, scene.camera, limits)
            if wp.static(features.connections and not connects_in_lanes):
                connect_by_lane(pool, scene, lone, seed)
            if wp.static(connects_in_lanes):
                aim_in_lanes(pool, scene.lights, lone, seed)
                if wp.static(has_surfaces and has_solids):
                    block_by_solids_in_lanes(pool, scene.solids)
                if wp.static(has_lights):
                    block_by_lights_in_lanes(pool, scene.lights)
                if wp.static(features.meshes):
                    block_by_meshes_by_lane(pool, scene.meshes)
                if wp.static(lone_solid):
                    dim_in_lanes(pool, lone, lone_shape)
            if wp.static(features.connections):
                go_on_in_lanes(pool, limits)

    bsdf_floats = bsdf_count * Bsdf.numpy_dtype()["itemsize"] // 4
    return Program(features, render_threads, render_pool, 2 * sum_count + pool_floats + bsdf_floats)
