"""The stages of a path's life, built for the features of a kernel; the two drivers take paths through them."""

from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.bvh import build_intersect_meshes
from fgf_warp.device.drift import Drift, image_motion
from fgf_warp.device.medium import Medium
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.birth import Birth, build_birth, build_camera_of
from fgf_warp.integrator.boundaries import build_boundaries
from fgf_warp.integrator.connection import (
    build_aim,
    build_links_here,
    build_next_event,
    build_shadow,
    build_surface_connection,
)
from fgf_warp.integrator.connection_lanes import LaneConnection, build_lane_connection
from fgf_warp.integrator.flight import FlightStart, build_flight_start
from fgf_warp.integrator.interaction import build_interaction
from fgf_warp.integrator.intersection import (
    LightIntersection,
    ShapeIntersection,
    build_light_functions,
    build_light_intersection,
    build_shape_intersection,
)
from fgf_warp.integrator.kinds import LAW_KINDS
from fgf_warp.integrator.laws import LineLaws, build_laws
from fgf_warp.integrator.media import build_medium
from fgf_warp.integrator.media.value import MediumFunctions, MediumParts
from fgf_warp.integrator.media_lookup import build_first_segment, build_media_lookup
from fgf_warp.integrator.path import PathRecord, build_path
from fgf_warp.integrator.planes import FIRST_CONTAINER, NOT_SEEN
from fgf_warp.integrator.pool_layout import PoolLayout, build_pool_layout
from fgf_warp.integrator.roulette import build_channel_weight, build_russian_roulette
from fgf_warp.integrator.sampler import build_sampler
from fgf_warp.integrator.scene_data import scene_struct
from fgf_warp.integrator.shading import Shading, build_shading, build_surface_reading
from fgf_warp.integrator.tally import TallyRecord, build_tally


class Stages(NamedTuple):
    """What happens to a path, in the order in which it does; each is explained where it is built."""

    path: PathRecord
    tally: TallyRecord
    layout: PoolLayout
    birth: Birth
    laws: LineLaws
    flight: FlightStart
    medium: MediumFunctions
    shapes: ShapeIntersection
    lights: LightIntersection
    shading: Shading
    look_up_media: Any
    interact: Any
    next_event: Any
    lane_connection: LaneConnection
    russian_roulette: Any
    track: Any
    scene_of_image: Any
    lone_medium: Any


def build_stages(features: RenderFeatures) -> Stages:
    """The stages of a kernel of these features."""
    path, tally = build_path(features), build_tally(features)
    layout, sampler = build_pool_layout(features, path, tally), build_sampler(features)
    laws, boundaries = build_laws(features, path, sampler), build_boundaries(features, path)
    camera_of, channel_weight = build_camera_of(features, path), build_channel_weight(features, path)
    intersect_meshes, all_lights = build_intersect_meshes(features), build_light_functions(features)
    flight = build_flight_start(features, path, sampler, camera_of)
    medium = build_medium(MediumParts(features, path, sampler, laws, flight, layout))
    shapes = build_shape_intersection(features, path, all_lights, intersect_meshes)
    surfaces = build_surface_reading(features, path, boundaries, shapes)
    first_segment = build_first_segment(features, path, medium, boundaries, shapes, surfaces, camera_of)
    aim = build_aim(features, path, sampler, medium, channel_weight)
    connection = (
        build_links_here(features, path, shapes),
        build_shadow(features, path, laws, medium, boundaries, shapes, surfaces),
        *build_surface_connection(features, path, boundaries, surfaces, channel_weight),
    )
    return Stages(
        path=path,
        tally=tally,
        layout=layout,
        birth=build_birth(features, path, sampler, boundaries, intersect_meshes),
        laws=laws,
        flight=flight,
        medium=medium,
        shapes=shapes,
        lights=build_light_intersection(features, path, all_lights),
        shading=build_shading(features, path, sampler, boundaries, surfaces),
        look_up_media=build_media_lookup(features, path, laws, medium, boundaries, first_segment),
        interact=build_interaction(features, path, laws, medium, camera_of, channel_weight),
        next_event=build_next_event(features, path, aim, all_lights, connection),
        lane_connection=build_lane_connection(features, path, laws, aim, intersect_meshes),
        russian_roulette=build_russian_roulette(features, path, channel_weight),
        track=build_track(features, path),
        scene_of_image=build_scene_of_image(features),
        lone_medium=build_lone_medium(features),
    )


def build_track(features: RenderFeatures, record: PathRecord) -> Any:
    """The function (scene, path) -> Path: how what a complete path saw first moves in the image."""
    Path, SceneData = record.struct, scene_struct(features)

    @wp.func
    def track(scene: SceneData, before: Path) -> Path:
        path = before
        if before.seen_item != NOT_SEEN:
            drift = Drift()
            if before.seen_item <= FIRST_CONTAINER:
                drift = scene.container_drifts[FIRST_CONTAINER - before.seen_item]
            else:
                drift = scene.surface_drifts[before.seen_item]
            path.first_motion = image_motion(scene.camera, drift, before.seen_at, before.start.time)
        return path

    return track


def build_scene_of_image(features: RenderFeatures) -> Any:
    """The function (scene, image) -> SceneData with this image's media."""
    SceneData = scene_struct(features)

    @wp.func
    def scene_of_image(scene: SceneData, image: int) -> SceneData:
        view = scene
        if wp.static(features.media):
            view.first_medium = image * scene.media_count
        return view

    return scene_of_image


def build_lone_medium(features: RenderFeatures) -> Any:
    """The function (scene) -> Medium, the only one, which is the same for every lane; blank where there are many."""
    SceneData = scene_struct(features)

    @wp.func
    def lone_medium(scene: SceneData) -> Medium:
        medium = Medium()
        if wp.static(bool(features.lone_law)):
            medium = scene.media[scene.first_medium + scene.containers[0].medium]
            medium.law.kind = wp.static(LAW_KINDS[features.lone_law])
        return medium

    return lone_medium
