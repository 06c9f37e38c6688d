"""Where a flight ends: the path crosses a boundary, leaves the scene, ends at a light, or scatters. All branch-free."""

from typing import Any

import warp as wp

from fgf_warp.device.camera import Camera
from fgf_warp.device.geometry import (
    BOUNDARY,
    LIGHT,
    MARGIN,
    MISS,
    OFFSET,
    SURFACE,
    coordinate_reach,
    cross_boundary,
    offset_from_surface,
)
from fgf_warp.device.law import NOT_FROZEN
from fgf_warp.device.medium import Medium
from fgf_warp.device.numerics import INFINITE, choose, max_component
from fgf_warp.device.phase import build_phase
from fgf_warp.device.surfaces import sample_diffuse
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.boundaries import MAX_CROSSINGS
from fgf_warp.integrator.laws import LineLaws
from fgf_warp.integrator.media.value import MediumFunctions
from fgf_warp.integrator.media_lookup import FIRST_SEGMENT_AOVS
from fgf_warp.integrator.path import PathRecord
from fgf_warp.integrator.planes import FIRST_CONTAINER
from fgf_warp.integrator.work import Limits
from fgf_warp.settings import PRIM_AOVS, SPLIT_AOVS, Aov


@wp.struct
class Event:
    """What happens at the end of a flight; each is true or not."""

    is_alive: bool
    scatters_in_medium: bool
    crosses: bool
    """A boundary with nothing on it."""
    escapes: bool
    meets_light: bool
    meets_surface: bool
    """And is scattered there."""
    goes_straight: bool
    """Through a surface."""


def build_interaction(
    features: RenderFeatures,
    record: PathRecord,
    laws: LineLaws,
    medium: MediumFunctions,
    camera_of: Any,
    channel_weight: Any,
) -> Any:
    """The function (path, lone, environment, camera, limits) -> Path of all that happens at the end of a flight."""
    Path = record.struct
    classify = build_classify(features, record)
    cross, enter_lone_solid = build_cross(features, record), build_enter_lone_solid(features, record, laws)
    record_depth = build_record_depth(features, record, camera_of)
    gather = build_gather(features, record, medium, channel_weight)
    scatter = build_scatter(features, record, medium)

    @wp.func(inline=True)
    def interact(before: Path, lone: Medium, environment: wp.vec3, camera: Camera, limits: Limits) -> Path:
        path = before
        event = classify(before)
        is_lost = bool(False)
        if wp.static(features.passes):
            anew = event.scatters_in_medium or event.meets_surface
            path.start.passed = wp.where(anew, 0.0, before.start.passed)
        if wp.static(Aov.DEPTH in features.aovs):
            path = record_depth(before, path, event, camera)
        if wp.static(features.crossings):
            path = cross(path, event)
            is_lost = path.crossings > MAX_CROSSINGS
        if wp.static(bool(features.lone_solid)):
            path = enter_lone_solid(before, path, event, lone)
        path = gather(before, path, event, environment)
        return scatter(before, path, event, lone, limits, is_lost)

    return interact


def build_classify(features: RenderFeatures, record: PathRecord) -> Any:
    """The function (path) -> Event."""
    Path = record.struct

    @wp.func(inline=True)
    def classify(path: Path) -> Event:
        event = Event()
        is_alive = path.alive == 1
        scatters_in_medium = is_alive and path.flight <= path.hit.t and path.flight < 0.5 * INFINITE
        arrives = is_alive and not scatters_in_medium
        crosses = arrives and path.hit.kind == BOUNDARY
        escapes = arrives and path.hit.kind == MISS
        meets_light = arrives and path.hit.kind == LIGHT
        meets_surface = arrives and path.hit.kind == SURFACE
        if wp.static(features.passes):
            event.goes_straight = meets_surface and path.passes_straight == 1
            meets_surface = meets_surface and path.passes_straight == 0
        event.is_alive = is_alive
        event.scatters_in_medium = scatters_in_medium
        event.crosses = crosses
        event.escapes = escapes
        event.meets_light = meets_light
        event.meets_surface = meets_surface
        return event

    return classify


def build_record_depth(features: RenderFeatures, record: PathRecord, camera_of: Any) -> Any:
    """The function (before, path, event, camera) -> Path, with the depth of what is met first."""
    Path = record.struct
    lone_solid = bool(features.lone_solid)

    @wp.func(inline=True)
    def record_depth(before: Path, now: Path, event: Event, camera: Camera) -> Path:
        path = now
        nearest = before.hit.t
        if wp.static(features.lens):
            nearest = wp.where(before.hit.kind == MISS, INFINITE, before.hit.t)
        if wp.static(lone_solid):
            t_in = before.t_in
            if wp.static(features.lens):
                t_in = wp.where(t_in <= before.hit.t, t_in, INFINITE)
            nearest = wp.min(nearest, t_in)
        is_first = before.depth == 0 and nearest < INFINITE and before.first_depth == INFINITE
        if wp.static(features.passes):
            is_first = is_first and before.passes_straight == 0
        view = camera_of(camera, before)
        ahead = nearest * wp.dot(before.direction, view.forward)
        if wp.static(features.lens):
            ahead += view.near
        path.first_depth = wp.where(is_first, ahead, before.first_depth)
        return path

    return record_depth


def build_cross(features: RenderFeatures, record: PathRecord) -> Any:
    """The function (path, event) -> Path: a boundary lets it through, and ends the memory of another medium."""
    Path = record.struct
    has_many = features.looks_up_media

    @wp.func(inline=True)
    def cross(before: Path, event: Event) -> Path:
        path = before
        is_new = event.is_alive
        if wp.static(features.passes):
            is_new = event.is_alive and before.passes_straight == 0
        crosses = event.crosses
        crossed = cross_boundary(before.start.inside, wp.where(crosses, before.hit.item, 0))
        path.start.inside = wp.where(crosses, crossed, before.start.inside)
        path.start.t_min = wp.where(crosses, before.hit.t, wp.where(is_new, 0.0, before.start.t_min))
        if wp.static(features.contacts):
            begins = is_new and not crosses
            path.start.entered = wp.where(begins, wp.uint32(0), before.start.entered)
        last_crossed = wp.where(is_new, -1, before.start.crossed)
        if wp.static(features.refracts):
            last_crossed = wp.where(event.meets_surface, before.start.crossed, last_crossed)
        path.start.crossed = wp.where(crosses, before.hit.item, last_crossed)
        if wp.static(has_many):
            renewed = wp.where(before.flight_continues == 1, before.segment, before.hit.t)
            if wp.static(features.passes):
                goes_on = crosses or before.passes_straight == 1
                path.segment = wp.where(goes_on, renewed, wp.where(is_new, 0.0, before.segment))
            else:
                path.segment = wp.where(crosses, renewed, wp.where(event.is_alive, 0.0, before.segment))
        step = 2.0 * OFFSET * coordinate_reach(before.origin, 2.0 * before.hit.t)
        slack = wp.where(event.scatters_in_medium, 0.0, before.start.slack)
        path.start.slack = wp.where(event.meets_surface, step, slack)
        path.crossings = before.crossings + wp.where(crosses, 1, 0)
        if wp.static(features.passes):
            path.crossings = path.crossings + before.passes_straight
        return path

    return cross


def build_enter_lone_solid(features: RenderFeatures, record: PathRecord, laws: LineLaws) -> Any:
    """The function (before, path, event, lone) -> Path, which is in the lone solid or not where the flight ends."""
    Path = record.struct
    channel_transmittance = laws.channel_transmittance

    @wp.func(inline=True)
    def enter_lone_solid(before: Path, now: Path, event: Event, lone: Medium) -> Path:
        path = now
        stays = event.meets_surface and before.hit.t >= before.t_in and before.hit.t < before.t_out
        stays = stays or event.scatters_in_medium
        inside = wp.where(stays, wp.uint32(1), wp.uint32(0))
        path.start.inside = wp.where(event.is_alive, inside, before.start.inside)
        if wp.static(bool(features.aovs & FIRST_SEGMENT_AOVS)):
            length = wp.min(before.t_out, before.hit.t) - before.t_in
            is_first = event.is_alive and before.depth == 0 and length >= 0.0
            if wp.static(Aov.TRANSMITTANCE in features.aovs):
                passed = channel_transmittance(lone, wp.max(length, 0.0), False, NOT_FROZEN)
                passed = wp.where(is_first, passed, before.first_transmittance[0])
                path.first_transmittance = wp.vec3(passed, passed, passed)
            if wp.static(Aov.OPTICAL_DEPTH in features.aovs):
                depth = lone.extinction[0] * length
                depth = wp.where(is_first, depth, before.first_optical_depth[0])
                path.first_optical_depth = wp.vec3(depth, depth, depth)
        return path

    return enter_lone_solid


def build_gather(features: RenderFeatures, record: PathRecord, medium: MediumFunctions, channel_weight: Any) -> Any:
    """The function (before, path, event, environment) -> Path, with the light that it has come to."""
    Path = record.struct
    length_of_segment = medium.length_of_segment
    splits = bool(features.aovs & SPLIT_AOVS)

    @wp.func(inline=True)
    def gather(before: Path, now: Path, event: Event, environment: wp.vec3) -> Path:
        path = now
        weight = channel_weight(before)
        if wp.static(features.media and Aov.COLLISIONS in features.aovs):
            collisions = wp.where(event.scatters_in_medium, 1.0, 0.0)
            path.collisions = before.collisions + wp.cw_mul(before.throughput, weight) * collisions
        if wp.static(features.media and Aov.PATH_LENGTH in features.aovs):
            length = wp.where(event.is_alive, length_of_segment(before), 0.0)
            path.path_length = before.path_length + wp.cw_mul(before.throughput, weight) * length
        share = before.throughput
        if wp.static(features.refracts):
            share = before.throughput * (1.0 / before.eta_scale)
        if wp.static(features.surfaces or features.connections):
            ends_light = event.escapes or event.meets_light or event.meets_surface
            if wp.static(features.passes):
                # What passes is not scattered, but meets emission.
                ends_light = ends_light or event.goes_straight
            ends_there = wp.where(ends_light, 1.0, 0.0)
            path.radiance = path.radiance + wp.cw_mul(share, wp.cw_mul(before.emitted, weight)) * ends_there
        if wp.static(features.environment):
            beyond = wp.cw_mul(share, wp.cw_mul(environment, weight))
            path.radiance = path.radiance + beyond * wp.where(event.escapes, 1.0, 0.0)
        if wp.static(splits):
            path.direct = choose(before.depth <= 1, path.radiance, before.direct)
        return path

    return gather


def build_direction(features: RenderFeatures, record: PathRecord, medium: MediumFunctions) -> Any:
    """The function (before, path, event, lone) -> (Path, wi, albedo): where it scatters, into which direction."""
    Path = record.struct
    scattering = medium.scattering
    _, sample_phase = build_phase(features.phases)

    @wp.func(inline=True)
    def choose_direction(before: Path, now: Path, event: Event, lone: Medium):
        path = now
        would_scatter = event.scatters_in_medium or event.meets_surface
        t = wp.where(would_scatter, wp.min(before.hit.t, before.flight), 0.0)
        albedo = wp.vec3(0.0, 0.0, 0.0)
        wi = before.direction
        if wp.static(features.media):
            albedo, phase = scattering(lone, before)
            wi = sample_phase(phase, before.direction, before.xi[2], before.xi[3])
            if wp.static(features.meshes):
                # Not so close to a face ahead that rounding could put the event behind it.
                clear = wp.max(
                    before.hit.t - MARGIN * coordinate_reach(before.origin, before.flight), 0.5 * before.hit.t
                )
                t = wp.where(event.scatters_in_medium, wp.min(before.flight, clear), t)
        path.origin = before.origin + before.direction * t
        if wp.static(features.surfaces):
            normal = before.hit.normal
            if wp.static(not features.shading):
                faces = wp.dot(before.hit.normal, before.direction) < 0.0
                normal = choose(faces, before.hit.normal, -before.hit.normal)
            path.hit.normal = normal
            side = normal
            if wp.static(features.refracts):
                side = choose(before.transmits == 1, -normal, normal)
            if wp.static(Aov.NORMAL in features.aovs and not features.shading):
                is_first = before.depth == 0 and event.meets_surface
                path.first_normal = choose(is_first, normal, before.first_normal)
            off_surface = offset_from_surface(path.origin, side, before.hit.t)
            path.origin = choose(event.meets_surface, off_surface, path.origin)
            if wp.static(features.shading):
                wi = choose(event.meets_surface, before.wi, wi)
            else:
                wi = choose(event.meets_surface, sample_diffuse(normal, before.xi[2], before.xi[3]), wi)
            albedo = choose(event.meets_surface, before.albedo, albedo)
            if wp.static(features.passes):
                albedo = choose(event.goes_straight, before.albedo, albedo)
        return path, wi, albedo

    return choose_direction


def build_scatter(features: RenderFeatures, record: PathRecord, medium: MediumFunctions) -> Any:
    """The function (before, path, event, lone, limits, is_lost) -> Path, scattered, or ended, or on its way."""
    Path = record.struct
    choose_direction = build_direction(features, record, medium)
    has_many = features.looks_up_media
    tells_prims, moves = bool(features.aovs & PRIM_AOVS), Aov.MOTION in features.aovs

    @wp.func(inline=True)
    def scatter(before: Path, now: Path, event: Event, lone: Medium, limits: Limits, is_lost: bool) -> Path:
        path, wi, albedo = choose_direction(before, now, event, lone)
        meets_surface = event.meets_surface
        would_scatter = event.scatters_in_medium or meets_surface
        if wp.static(Aov.ALBEDO in features.aovs):
            is_first = before.depth == 0 and would_scatter
            color = albedo
            if wp.static(features.shading):
                color = choose(meets_surface, before.reflectance, albedo)
            path.first_albedo = choose(is_first, color, before.first_albedo)
        if wp.static(tells_prims):
            is_first = before.depth == 0 and would_scatter
            container = int(0)
            if wp.static(has_many):
                container = before.container
            item = wp.where(meets_surface, before.hit.item, FIRST_CONTAINER - container)
            path.seen = wp.where(is_first, wp.min(before.hit.t, before.flight), before.seen)
            path.seen_item = wp.where(is_first, item, before.seen_item)
            if wp.static(moves):
                path.seen_at = choose(is_first, path.origin, before.seen_at)
        dimmed = wp.cw_mul(before.throughput, albedo)
        is_absorbed = would_scatter and max_component(dimmed) == 0.0
        is_cut = would_scatter and not is_absorbed and before.depth >= limits.max_depth
        scatters = would_scatter and not is_absorbed and not is_cut
        path.throughput = choose(scatters, dimmed, before.throughput)
        path.wi = choose(scatters, wi, before.direction)
        connects = scatters
        if wp.static(features.passes):
            path.throughput = choose(scatters or event.goes_straight, dimmed, before.throughput)
        if wp.static(features.shading):
            # A surface from which no direction is found may still be lit.
            connects = scatters or (meets_surface and is_absorbed and before.depth < limits.max_depth)
            if wp.static(features.connections):
                path.incoming = before.throughput
        path.scatters = wp.where(connects, wp.where(meets_surface, SURFACE, BOUNDARY), MISS)
        if wp.static(features.media):
            remembers = event.scatters_in_medium
            if wp.static(has_many):
                goes_on = event.crosses or event.goes_straight
                remembers = remembers or (goes_on and before.flight_continues == 1 and before.from_medium == 1)
            path.from_medium = wp.where(remembers, 1, 0)
        path.alpha = wp.where(would_scatter or event.meets_light, 1.0, before.alpha)
        path.truncated = wp.where(is_cut or is_lost, 1, before.truncated)
        ends = event.escapes or event.meets_light or is_cut or is_absorbed or is_lost
        path.alive = wp.where(ends, 0, before.alive)
        return path

    return scatter
