"""The driver of the CPU: a pool of lanes goes through one stage after the other.

The compiler makes vector code of the stages that have neither branches nor look-ups. Each stage of the pool is a
function of its own, for the compiler's time grows with the square of what it finds in one.
"""

from typing import Any

import warp as wp

from fgf_warp.device.geometry import Solid
from fgf_warp.device.options import kernel_options
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.intersection import light_kinds
from fgf_warp.integrator.kinds import SOLID_KINDS
from fgf_warp.integrator.media_lookup import needs_look_up
from fgf_warp.integrator.pool_stages import (
    build_connection_lanes,
    build_interaction_lanes,
    build_light_lanes,
    build_shape_lanes,
)
from fgf_warp.integrator.pool_turnover import build_turnover
from fgf_warp.integrator.rows import LANES
from fgf_warp.integrator.scene_data import scene_struct
from fgf_warp.integrator.stages import Stages
from fgf_warp.integrator.work import Counts, Limits, Round
from fgf_warp.settings import Aov

MANY_WAITING = wp.constant(4)
"""Lanes without a pixel that are worth a look at all of them."""


def build_render_pool(features: RenderFeatures, stages: Stages) -> Any:
    """The kernel of one pool: some pixels of an image, in the order of `counts`."""
    SceneData, Film = scene_struct(features), stages.tally.film
    turnover, shapes, lights = (
        build_turnover(features, stages),
        build_shape_lanes(features, stages),
        build_light_lanes(features, stages),
    )
    interaction, connection = build_interaction_lanes(features, stages), build_connection_lanes(features, stages)
    scene_of_image, lone_medium = stages.scene_of_image, stages.lone_medium
    flights_in_lanes = stages.medium.flights_in_lanes
    kinds = sum(1 << SOLID_KINDS[kind] for kind in features.solids)
    kinds += sum(1 << 8 + kind for kind in light_kinds(features))
    has_solids, lone_solid = bool(features.solids), bool(features.lone_solid)
    looks_up, tracks = needs_look_up(features), Aov.MOTION in features.aovs
    in_lanes = features.connects_in_lanes

    @wp.kernel(module="unique", module_options=kernel_options(features.meshes))
    def render_pool(
        batch: SceneData,
        limits: Limits,
        film: Film,
        scratch: wp.array(dtype=float),
        image: int,
        pixels_per_image: int,
        first_rank: int,
        rank_count: int,
        counts: Counts,
        part: Round,
    ):
        # Tells these kernels apart: Warp's hash of a function does not see what depends on the variable of a loop.
        _kinds = wp.static(kinds)
        pool = scratch.ptr
        scene = scene_of_image(batch, image)
        seed = scene.seeds[image]
        lone = lone_medium(scene)
        lone_shape = Solid()
        if wp.static(lone_solid):
            lone_shape = scene.solids[scene.lone_solid]
        environment = wp.vec3(0.0)
        if wp.static(features.environment):
            environment = scene.environment
        first_place = image * pixels_per_image
        end_rank = first_rank + rank_count
        next_rank = int(first_rank)
        turnover.empty(pool)
        working = int(LANES)
        while working > 0:
            # A lane takes the samples of its pixel one after the other, and then another pixel.
            if wp.static(tracks):
                turnover.track(pool, scene)
            waiting = turnover.finish(pool)
            if waiting >= MANY_WAITING or (waiting > 0 and next_rank >= end_rank):
                rank, retired = turnover.hand_out_pixels(
                    pool, film, counts, part, first_place, scene.camera.width, seed, next_rank, end_rank
                )
                next_rank = rank
                working -= retired
            turnover.emit(pool, scene, lone, seed)

            flights_in_lanes(pool, scene, lone, seed)
            if wp.static(lone_solid):
                shapes.lone_solid(pool, scene.camera, lone_shape)
            if wp.static(has_solids and (features.motion or features.passes)):
                shapes.solids_by_lane(pool, scene)
            elif wp.static(has_solids and (features.crossings or features.surfaces)):
                shapes.solids(pool, scene)
            if wp.static(features.meshes):
                shapes.meshes(pool, scene)
            if wp.static(features.intricate_lights):
                lights.by_lane(pool, scene)
            elif wp.static(features.connections):
                lights.in_lanes(pool, scene.lights)

            if wp.static(features.shading):
                interaction.shade(pool, scene, seed)
            if wp.static(looks_up):
                interaction.look_up_media(pool, scene)
            interaction.interact(pool, lone, environment, scene.camera, limits)
            if wp.static(features.connections and not in_lanes):
                connection.next_event(pool, scene, lone, seed)
            if wp.static(in_lanes):
                connection.aim(pool, scene.lights, lone, seed)
                if wp.static(features.surfaces and has_solids):
                    connection.block_by_solids(pool, scene.solids)
                if wp.static(bool(features.shaped_lights)):
                    connection.block_by_lights(pool, scene.lights)
                if wp.static(features.meshes):
                    connection.block_by_meshes(pool, scene.meshes)
                if wp.static(lone_solid):
                    connection.dim(pool, lone, lone_shape)
            if wp.static(features.connections):
                interaction.russian_roulette(pool, limits)

    return render_pool
