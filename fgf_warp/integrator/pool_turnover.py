"""How lanes of a pool come by their paths: complete ones are added to their pixels, and new ones begin."""

from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.medium import Medium
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.rows import LANES
from fgf_warp.integrator.scene_data import scene_struct
from fgf_warp.integrator.stages import Stages
from fgf_warp.integrator.work import Counts, Round, samples_of_round, skip_pixels


class Turnover(NamedTuple):
    """Functions of the device on the address of a pool.

    Args:
        empty: (pool), all lanes wait for a pixel.
        track: (pool, scene), see `build_track`.
        finish: (pool) -> int, adds complete paths to their pixels; returns how many lanes wait for another pixel.
        hand_out_pixels: (pool, film, counts, round, first_place, width, seed, next_rank, end_rank): waiting lanes'
            pixels go to the film, and they to others; returns the next place in the order of pixels, and how many
            lanes retire.
        emit: (pool, scene, lone, seed), new paths in the lanes whose path is complete.
    """

    empty: Any
    track: Any
    finish: Any
    hand_out_pixels: Any
    emit: Any


def build_turnover(features: RenderFeatures, stages: Stages) -> Turnover:
    """The functions of a kernel of these features."""
    Path, SceneData = stages.path.struct, scene_struct(features)
    load, store, lanes_of, track = stages.path.load, stages.path.store, stages.layout.lanes_of, stages.track

    @wp.func
    def empty(pool: wp.uint64):
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

    finish, hand_out_pixels = build_pixel_turnover(stages)
    return Turnover(empty, track_lanes, finish, hand_out_pixels, build_emission(features, stages))


def build_pixel_turnover(stages: Stages) -> tuple[Any, Any]:
    """`Turnover.finish` and `Turnover.hand_out_pixels`."""
    Film, tally, go_to_pixel = stages.tally.film, stages.tally, stages.birth.go_to_pixel
    load, store = stages.path.load, stages.path.store
    sums_of, lanes_of = stages.layout.sums_of, stages.layout.lanes_of

    @wp.func
    def finish(pool: wp.uint64) -> int:
        sums = sums_of(pool)
        lanes = lanes_of(pool)
        waiting = int(0)
        for i in range(LANES):
            path = load(lanes, i)
            is_complete = path.alive == 0 and path.sample < 0
            tally.store(sums, i, tally.add(tally.load(sums, i), path, is_complete))
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
        next_rank: int,
        end_rank: int,
    ):
        sums = sums_of(pool)
        lanes = lanes_of(pool)
        rank = next_rank
        retired = int(0)
        for i in range(LANES):
            path = load(lanes, i)
            if path.sample == 0:
                if path.pixel >= 0:
                    tally.write(film, first_place + path.pixel, tally.load(sums, i))
                rank = skip_pixels(counts, part, first_place, rank, end_rank)
                if rank < end_rank:
                    pixel = counts.order[first_place + rank]
                    path = go_to_pixel(path, width, seed, pixel)
                    first_sample, end_sample = samples_of_round(counts, part, first_place + pixel)
                    path.sample = first_sample - end_sample
                    path.end_sample = end_sample
                    tally.store(sums, i, tally.read(film, first_place + pixel))
                    rank += 1
                else:
                    path.pixel = -1
                    path.sample = 1
                    retired += 1
                store(lanes, i, path)
        return rank, retired

    return finish, hand_out_pixels


def build_emission(features: RenderFeatures, stages: Stages) -> Any:
    """`Turnover.emit`."""
    SceneData = scene_struct(features)
    load, store, lanes_of = stages.path.load, stages.path.store, stages.layout.lanes_of
    emit, find_start, draw_rates = stages.birth.emit, stages.birth.find_start, stages.laws.draw_rates
    freezes_at_birth = features.frozen and bool(features.lone_law)

    @wp.func
    def emit_lanes(pool: wp.uint64, scene: SceneData, lone: Medium, seed: wp.uint64):
        lanes = lanes_of(pool)
        camera = scene.camera
        inside = wp.uint32(0)
        if wp.static(features.media):
            inside = scene.camera_inside
        for i in range(LANES):
            path = load(lanes, i)
            fresh = emit(camera, inside, seed, path)
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

    return emit_lanes
