"""No medium at all: flights have no end of their own."""

import warp as wp

from fgf_warp.device.medium import Medium
from fgf_warp.device.phase import Phase
from fgf_warp.integrator.media.value import MediumFunctions, MediumParts
from fgf_warp.integrator.rows import LANES
from fgf_warp.integrator.scene_data import scene_struct


def build_medium(parts: MediumParts) -> MediumFunctions:
    """The value of a kernel."""
    features, record, _, laws, flight, layout = parts
    Path, SceneData = record.struct, scene_struct(features)
    load, store, lanes_of = record.load, record.store, layout.lanes_of
    begin_event, begin_ray = flight

    @wp.func(inline=True)
    def sample_free_flight(scene: SceneData, lone: Medium, before: Path, seed: wp.uint64) -> Path:
        return before

    @wp.func
    def flights_in_lanes(pool: wp.uint64, scene: SceneData, lone: Medium, seed: wp.uint64):
        lanes = lanes_of(pool)
        camera = scene.camera
        for i in range(LANES):
            path = load(lanes, i)
            store(lanes, i, begin_ray(begin_event(path, seed), camera))

    @wp.func(inline=True)
    def scattering(lone: Medium, path: Path):
        return wp.vec3(0.0, 0.0, 0.0), Phase()

    @wp.func(inline=True)
    def length_of_segment(path: Path) -> float:
        return float(0.0)

    return MediumFunctions(
        sample_free_flight,
        flights_in_lanes,
        scattering,
        length_of_segment,
        laws.transmittance,
        laws.flight_densities,
    )
