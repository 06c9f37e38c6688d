"""Any number of homogeneous media, or one whose channels differ: laws are looked up path by path."""

from typing import Any

import warp as wp

from fgf_warp.device import fbm
from fgf_warp.device.law import EXACT_FBM, Law, sample_frozen, sample_mm, sample_sm
from fgf_warp.device.medium import Medium, container_at, medium_at
from fgf_warp.device.numerics import INFINITE, log_positive
from fgf_warp.device.rng import EVENT
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.laws import LineLaws, law_of_channel
from fgf_warp.integrator.media.value import MediumFunctions, MediumParts
from fgf_warp.integrator.path import PathRecord
from fgf_warp.integrator.rows import LANES
from fgf_warp.integrator.sampler import Sampler
from fgf_warp.integrator.scene_data import scene_struct


def build_medium(parts: MediumParts) -> MediumFunctions:
    """The value of a kernel."""
    features, record, sampler, laws, flight, layout = parts
    Path, SceneData = record.struct, scene_struct(features)
    load, store, lanes_of = record.load, record.store, layout.lanes_of
    begin_event, begin_ray = flight
    sample_free_flight = build_sample_free_flight(features, record, sampler, laws)

    @wp.func
    def flights_in_lanes(pool: wp.uint64, scene: SceneData, lone: Medium, seed: wp.uint64):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            store(lanes, i, begin_event(path, seed))
        for i in range(LANES):
            path = load(lanes, i)
            if path.alive == 1:
                path = begin_ray(sample_free_flight(scene, lone, path, seed), scene.camera)
            store(lanes, i, path)

    @wp.func(inline=True)
    def scattering(lone: Medium, path: Path):
        return path.albedo, path.phase

    @wp.func(inline=True)
    def length_of_segment(path: Path) -> float:
        end = wp.min(path.flight, path.hit.t)
        ends = path.medium >= 0 and path.flight_continues == 0 and end < 0.5 * INFINITE
        return wp.where(ends, end - path.segment, 0.0)

    return MediumFunctions(
        sample_free_flight,
        flights_in_lanes,
        scattering,
        length_of_segment,
        laws.transmittance,
        laws.flight_densities,
    )


def build_sample_free_flight(features: RenderFeatures, record: PathRecord, sampler: Sampler, laws: LineLaws) -> Any:
    """`MediumFunctions.sample_free_flight`."""
    Path, SceneData = record.struct, scene_struct(features)
    draw_more, medium_at_depth, draw_rates = sampler.draw_more, laws.medium_at_depth, laws.draw_rates

    @wp.func
    def sample_optical_depth(scene: SceneData, path: Path, law: Law, channel: int, seed: wp.uint64) -> float:
        """u of the next flight."""
        if wp.static(features.frozen):
            rate = path.rates[channel]
            if rate >= 0.0:
                return sample_frozen(rate, -log_positive(path.xi[0]))
        if wp.static(features.exact_variance):
            if law.kind == EXACT_FBM:
                return fbm.sample_flight(law, scene.tables, path.xi[0], path.from_medium == 1)
        if path.from_medium == 1 and law.reciprocal == 1:
            more = draw_more(seed, path.pixel, path.sample_index, path.bounce, EVENT)
            return sample_mm(law, path.xi[0], more[0], more[1])
        return sample_sm(law, path.xi[0])

    @wp.func
    def sample_free_flight(scene: SceneData, lone: Medium, before: Path, seed: wp.uint64) -> Path:
        path = before
        path.medium = medium_at(scene.containers, before.start.inside)
        if path.medium >= 0 and path.flight_continues == 0:
            medium = medium_at_depth(scene.media[scene.first_medium + path.medium], path.depth)
            if wp.static(features.frozen):
                if path.body < 0:
                    path.body = container_at(scene.containers, before.start.inside)
                    path.rates = draw_rates(scene, path, medium, path.body, seed)
            channel = int(0)
            if wp.static(features.chromatic):
                channel = path.channel
            u = sample_optical_depth(scene, path, law_of_channel(medium, channel), channel, seed)
            length = wp.min(u / medium.extinction[channel], 0.5 * INFINITE)
            if wp.static(features.chromatic):
                path.length = length
            path.flight = path.segment + length
        return path

    return sample_free_flight
