"""The loops that take all lanes of a pool through a stage: in lanes as vector code, or lane by lane."""

from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.bsdf import Bsdf
from fgf_warp.device.bvh import Bvh
from fgf_warp.device.camera import Camera
from fgf_warp.device.geometry import MISS, Solid
from fgf_warp.device.lights import Light
from fgf_warp.device.medium import Medium
from fgf_warp.device.numerics import max_component
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.intersection import light_kinds
from fgf_warp.integrator.kinds import LIGHT_KINDS, SOLID_KINDS
from fgf_warp.integrator.rows import LANES
from fgf_warp.integrator.scene_data import scene_struct
from fgf_warp.integrator.stages import Stages
from fgf_warp.integrator.work import Limits


class ShapeLanes(NamedTuple):
    """Functions of the device on the address of a pool: what of the shapes is ahead.

    Args:
        lone_solid: (pool, camera, solid).
        solids_by_lane: (pool, scene), of solids that move or may let light pass.
        solids: (pool, scene), of others.
        meshes: (pool, scene).
    """

    lone_solid: Any
    solids_by_lane: Any
    solids: Any
    meshes: Any


class LightLanes(NamedTuple):
    """Functions of the device on the address of a pool: what of the lights is ahead.

    Args:
        by_lane: (pool, scene), of lights with images, shaping or links.
        in_lanes: (pool, lights), of others.
    """

    by_lane: Any
    in_lanes: Any


class InteractionLanes(NamedTuple):
    """Functions of the device on the address of a pool: what happens where flights end.

    Args:
        shade: (pool, scene, seed).
        look_up_media: (pool, scene).
        interact: (pool, lone, environment, camera, limits).
        russian_roulette: (pool, limits).
    """

    shade: Any
    look_up_media: Any
    interact: Any
    russian_roulette: Any


class ConnectionLanes(NamedTuple):
    """Functions of the device on the address of a pool: next-event estimation.

    Args:
        next_event: (pool, scene, lone, seed), all of it, lane by lane.
        aim: (pool, lights, lone, seed), and the further ones: `LaneConnection` in lanes.
        block_by_solids: (pool, solids).
        block_by_lights: (pool, lights).
        block_by_meshes: (pool, trees).
        dim: (pool, lone, solid).
    """

    next_event: Any
    aim: Any
    block_by_solids: Any
    block_by_lights: Any
    block_by_meshes: Any
    dim: Any


def build_shape_lanes(features: RenderFeatures, stages: Stages) -> ShapeLanes:
    """The functions of a kernel of these features."""
    SceneData, shapes = scene_struct(features), stages.shapes
    load, store, lanes_of = stages.path.load, stages.path.store, stages.layout.lanes_of
    begin_ray, lone_kind = stages.flight.begin_ray, SOLID_KINDS.get(features.lone_solid, 0)
    solid_kinds = {SOLID_KINDS[kind] for kind in features.solids}

    @wp.func
    def lone_solid(pool: wp.uint64, camera: Camera, solid: Solid):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            store(lanes, i, begin_ray(shapes.lone_solid(path, solid, wp.static(lone_kind)), camera))

    @wp.func
    def solids_by_lane(pool: wp.uint64, scene: SceneData):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.alive == 1:
                store(lanes, i, shapes.solids(scene, path))

    @wp.func
    def solids_in_lanes(pool: wp.uint64, scene: SceneData):
        lanes = lanes_of(pool)
        for s in range(scene.solids.shape[0]):
            solid = scene.solids[s]
            for kind in range(wp.static(len(SOLID_KINDS))):
                if wp.static(kind in solid_kinds):
                    if wp.static(features.crossings):
                        if solid.surface < 0 and solid.kind == kind:
                            for i in range(LANES):
                                path = load(lanes, i)
                                store(lanes, i, shapes.boundary(path, solid, kind))
                    if wp.static(features.surfaces):
                        if solid.surface >= 0 and solid.kind == kind:
                            surface = scene.surfaces[solid.surface]
                            for i in range(LANES):
                                path = load(lanes, i)
                                store(lanes, i, shapes.surface(path, solid, kind, surface))

    @wp.func
    def meshes_by_lane(pool: wp.uint64, scene: SceneData):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.alive == 1:
                hit = shapes.meshes(scene.meshes, path)
                # Loaded anew after the call: for all that the compiler knows it could change any lane, and all that was
                # loaded before would be stored again.
                store(lanes, i, shapes.take_mesh_hit(load(lanes, i), hit, scene))

    return ShapeLanes(lone_solid, solids_by_lane, solids_in_lanes, meshes_by_lane)


def build_light_lanes(features: RenderFeatures, stages: Stages) -> LightLanes:
    """The functions of a kernel of these features."""
    SceneData, lights = scene_struct(features), stages.lights
    load, store, lanes_of = stages.path.load, stages.path.store, stages.layout.lanes_of
    shaped_kinds = {LIGHT_KINDS[kind] for kind in features.shaped_lights}

    @wp.func
    def by_lane(pool: wp.uint64, scene: SceneData):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.alive == 1:
                store(lanes, i, lights.lights(scene, path))

    @wp.func
    def in_lanes(pool: wp.uint64, of_scene: wp.array(dtype=Light)):
        lanes = lanes_of(pool)
        for k in range(of_scene.shape[0]):
            light = of_scene[k]
            for kind in range(wp.static(len(LIGHT_KINDS))):
                if wp.static(kind in shaped_kinds):
                    if light.kind == kind:
                        for i in range(LANES):
                            path = load(lanes, i)
                            store(lanes, i, lights.light(path, light, kind, k))
        if wp.static(features.distant_lights):
            for k in range(of_scene.shape[0]):
                light = of_scene[k]
                for i in range(LANES):
                    path = load(lanes, i)
                    store(lanes, i, lights.beyond(path, light))

    return LightLanes(by_lane, in_lanes)


def build_interaction_lanes(features: RenderFeatures, stages: Stages) -> InteractionLanes:
    """The functions of a kernel of these features."""
    SceneData, shading, connection = scene_struct(features), stages.shading, stages.lane_connection
    load, store = stages.path.load, stages.path.store
    lanes_of, bsdfs_of = stages.layout.lanes_of, stages.layout.bsdfs_of
    look_up_media, interact, russian_roulette = stages.look_up_media, stages.interact, stages.russian_roulette
    in_lanes = features.connects_in_lanes

    @wp.func
    def shade_by_lane(pool: wp.uint64, scene: SceneData, seed: wp.uint64):
        lanes = lanes_of(pool)
        bsdfs = bsdfs_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.alive == 1 and shading.reaches_surface(path):
                path, bsdf = shading.shade(scene, path, seed)
                bsdfs[i] = bsdf
                store(lanes, i, path)

    @wp.func
    def look_up_media_by_lane(pool: wp.uint64, scene: SceneData):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.alive == 1:
                store(lanes, i, look_up_media(scene, path))

    @wp.func
    def interact_in_lanes(pool: wp.uint64, lone: Medium, environment: wp.vec3, camera: Camera, limits: Limits):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            path = interact(path, lone, environment, camera, limits)
            if wp.static(in_lanes):
                path = connection.begin(path, lone)
            if wp.static(not features.connections):
                path = russian_roulette(path, limits)
            store(lanes, i, path)

    @wp.func
    def russian_roulette_in_lanes(pool: wp.uint64, limits: Limits):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if wp.static(in_lanes):
                path = connection.end(path)
            store(lanes, i, russian_roulette(path, limits))

    return InteractionLanes(shade_by_lane, look_up_media_by_lane, interact_in_lanes, russian_roulette_in_lanes)


def build_connection_lanes(features: RenderFeatures, stages: Stages) -> ConnectionLanes:
    """The functions of a kernel of these features."""
    SceneData, connection, next_event = scene_struct(features), stages.lane_connection, stages.next_event
    load, store = stages.path.load, stages.path.store
    lanes_of, bsdfs_of = stages.layout.lanes_of, stages.layout.bsdfs_of
    lone_kind, all_kinds = SOLID_KINDS.get(features.lone_solid, 0), light_kinds(features)
    solid_kinds = {SOLID_KINDS[kind] for kind in features.solids}
    shaped_kinds = {LIGHT_KINDS[kind] for kind in features.shaped_lights}

    @wp.func
    def next_event_by_lane(pool: wp.uint64, scene: SceneData, lone: Medium, seed: wp.uint64):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if path.scatters != MISS:
                bsdf = Bsdf()
                if wp.static(features.shading):
                    bsdf = bsdfs_of(pool)[i]
                store(lanes, i, next_event(scene, lone, path, bsdf, seed))

    @wp.func
    def aim_in_lanes(pool: wp.uint64, lights: wp.array(dtype=Light), lone: Medium, seed: wp.uint64):
        lanes = lanes_of(pool)
        for k in range(lights.shape[0]):
            light = lights[k]
            for kind in range(wp.static(len(LIGHT_KINDS))):
                if wp.static(kind in all_kinds):
                    if light.kind == kind:
                        for i in range(LANES):
                            path = load(lanes, i)
                            store(lanes, i, connection.aim_at_light(path, lone, seed, light, kind))

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
                            store(lanes, i, connection.block_by_surface(path, solid, kind))

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
                            store(lanes, i, connection.block_by_light(path, light, kind))

    @wp.func
    def block_by_meshes_by_lane(pool: wp.uint64, trees: wp.array(dtype=Bvh)):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            if max_component(path.light_share) > 0.0:
                distance = connection.distance_of_mesh(trees, path)
                store(lanes, i, connection.block(load(lanes, i), distance))

    @wp.func
    def dim_in_lanes(pool: wp.uint64, lone: Medium, solid: Solid):
        lanes = lanes_of(pool)
        for i in range(LANES):
            path = load(lanes, i)
            store(lanes, i, connection.dim(path, lone, solid, wp.static(lone_kind)))

    return ConnectionLanes(
        next_event_by_lane,
        aim_in_lanes,
        block_by_solids_in_lanes,
        block_by_lights_in_lanes,
        block_by_meshes_by_lane,
        dim_in_lanes,
    )
