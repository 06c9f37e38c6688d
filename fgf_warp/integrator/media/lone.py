"""One homogeneous medium in one body: its law is the same for all lanes, and flights are sampled by vector code."""

from typing import Any

import warp as wp

from fgf_warp.device import fbm
from fgf_warp.device.law import flight_of_ln, ln_decorrelation, ln_flight, sample_frozen, sample_power
from fgf_warp.device.medium import Medium
from fgf_warp.device.numerics import INFINITE, log_positive
from fgf_warp.device.rng import EVENT
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.flight import FlightStart
from fgf_warp.integrator.laws import LineLaws
from fgf_warp.integrator.media.value import MediumFunctions, MediumParts
from fgf_warp.integrator.path import PathRecord
from fgf_warp.integrator.pool_layout import PoolLayout
from fgf_warp.integrator.rows import LANES
from fgf_warp.integrator.sampler import Sampler
from fgf_warp.integrator.scene_data import scene_struct


def build_medium(parts: MediumParts) -> MediumFunctions:
    """The value of a kernel."""
    features, record, sampler, laws, flight, layout = parts
    Path, SceneData = record.struct, scene_struct(features)
    begin_exact_flight, look_up_exact_flight = build_exact_flight(record)
    sample_flight = build_sample_flight(features, record, sampler, laws)
    medium_at_depth, looks_up = laws.medium_at_depth, features.lone_law == "exact_fbm"

    @wp.func
    def sample_free_flight(scene: SceneData, lone: Medium, before: Path, seed: wp.uint64) -> Path:
        path = before
        if wp.static(looks_up):
            path = look_up_exact_flight(begin_exact_flight(path, lone), lone, scene.tables)
        return sample_flight(path, lone, seed)

    @wp.func(inline=True)
    def scattering(lone: Medium, path: Path):
        medium = medium_at_depth(lone, path.depth)
        return medium.albedo, medium.phase

    @wp.func(inline=True)
    def length_of_segment(path: Path) -> float:
        end = wp.min(path.flight, path.hit.t)
        length = float(0.0)
        if wp.static(bool(features.lone_solid)):
            length = wp.max(wp.min(end, path.t_out), path.t_in) - path.t_in
        else:
            ends = path.medium >= 0 and end < 0.5 * INFINITE
            length = wp.where(ends, end - path.start.t_min, 0.0)
        return length

    flights_in_lanes = build_flights_in_lanes(
        features, record, flight, layout, (sample_flight, begin_exact_flight, look_up_exact_flight)
    )
    return MediumFunctions(
        sample_free_flight,
        flights_in_lanes,
        scattering,
        length_of_segment,
        laws.transmittance,
        laws.flight_densities,
    )


def build_exact_flight(record: PathRecord) -> tuple[Any, Any]:
    """Flights of the exact fBm: `flight` is ln u, first with the asymptotic variance, then with that of the table.

    Returns:
        The functions (path, medium) -> Path and (path, medium, tables) -> Path; the first is branch-free.
    """
    Path = record.struct

    @wp.func(inline=True)
    def begin_exact_flight(before: Path, medium: Medium) -> Path:
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

    return begin_exact_flight, look_up_exact_flight


def build_sample_flight(features: RenderFeatures, record: PathRecord, sampler: Sampler, laws: LineLaws) -> Any:
    """The function (path, medium, seed) -> Path that samples the flight; branch-free."""
    Path = record.struct
    draw_more, medium_at_depth = sampler.draw_more, laws.medium_at_depth
    law_kind, lone_solid = features.lone_law, bool(features.lone_solid)

    @wp.func(inline=True)
    def sample_flight(before: Path, lone: Medium, seed: wp.uint64) -> Path:
        path = before
        medium = medium_at_depth(lone, before.depth)
        remembers = before.from_medium == 1 and medium.law.reciprocal == 1
        exponent = -log_positive(before.xi[0])
        u = exponent / medium.law.rate
        if wp.static(law_kind == "power"):
            u = sample_power(medium.law, exponent, remembers)
        if wp.static(law_kind == "exact_fbm"):
            u = flight_of_ln(before.flight)
        if wp.static(law_kind == "fractional"):
            ln_u = ln_flight(medium.law, exponent)
            more = draw_more(seed, before.pixel, before.sample_index, before.bounce, EVENT)
            ln_u = wp.where(remembers, wp.min(ln_u, ln_decorrelation(medium.law, more[0], more[1])), ln_u)
            u = flight_of_ln(ln_u)
        if wp.static(features.frozen):
            u = wp.where(before.rates[0] >= 0.0, sample_frozen(before.rates[0], exponent), u)
        path.flight = wp.min(u / medium.extinction[0], 0.5 * INFINITE)
        if wp.static(not lone_solid):
            # Only one boundary is around it, so its segment begins where it was last crossed.
            is_in_medium = before.start.inside != wp.uint32(0)
            path.medium = wp.where(is_in_medium, medium.index, -1)
            path.flight = wp.where(is_in_medium, before.start.t_min + path.flight, INFINITE)
        return path

    return sample_flight


def build_flights_in_lanes(
    features: RenderFeatures,
    record: PathRecord,
    flight: FlightStart,
    layout: PoolLayout,
    steps: tuple[Any, Any, Any],
) -> Any:
    """`MediumFunctions.flights_in_lanes`."""
    SceneData = scene_struct(features)
    load, store, lanes_of = record.load, record.store, layout.lanes_of
    begin_event, begin_ray = flight
    sample_flight, begin_exact_flight, look_up_exact_flight = steps
    looks_up = features.lone_law == "exact_fbm"
    # Into a lone solid the ray is followed first: the flight begins where the ray enters it.
    begins_ray = not features.lone_solid

    @wp.func
    def flights_in_lanes(pool: wp.uint64, scene: SceneData, lone: Medium, seed: wp.uint64):
        lanes = lanes_of(pool)
        camera = scene.camera
        for i in range(LANES):
            path = load(lanes, i)
            path = begin_event(path, seed)
            if wp.static(looks_up):
                path = begin_exact_flight(path, lone)
            else:
                path = sample_flight(path, lone, seed)
            if wp.static(begins_ray and not looks_up):
                path = begin_ray(path, camera)
            store(lanes, i, path)
        if wp.static(looks_up):
            for i in range(LANES):
                path = load(lanes, i)
                store(lanes, i, look_up_exact_flight(path, lone, scene.tables))
            for i in range(LANES):
                path = load(lanes, i)
                path = sample_flight(path, lone, seed)
                if wp.static(begins_ray):
                    path = begin_ray(path, camera)
                store(lanes, i, path)

    return flights_in_lanes
