"""How an event begins: its random numbers, and the reach of its ray."""

from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.camera import Camera, far_distance
from fgf_warp.device.geometry import MARGIN, MISS, coordinate_reach
from fgf_warp.device.numerics import INFINITE
from fgf_warp.device.rng import EVENT
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.path import PathRecord
from fgf_warp.integrator.sampler import Sampler
from fgf_warp.settings import Aov


class FlightStart(NamedTuple):
    """Functions of the device; branch-free.

    Args:
        begin_event: (path, seed) -> Path, with the random numbers of its next event.
        begin_ray: (path, camera) -> Path, whose nearest hit is as far as it flies.
    """

    begin_event: Any
    begin_ray: Any


def build_flight_start(features: RenderFeatures, record: PathRecord, sampler: Sampler, camera_of: Any) -> FlightStart:
    """The functions of a kernel of these features."""
    Path = record.struct
    draw = sampler.draw
    sees_first_segment = bool(features.aovs & {Aov.DEPTH, Aov.TRANSMITTANCE, Aov.OPTICAL_DEPTH})

    @wp.func(inline=True)
    def begin_event(before: Path, seed: wp.uint64) -> Path:
        path = before
        path.bounce = before.bounce + 1
        path.xi = draw(seed, before.pixel, before.sample_index, path.bounce, EVENT)
        path.flight = INFINITE
        if wp.static(features.looks_up_media):
            path.flight = wp.where(before.flight_continues == 1, before.flight, INFINITE)
        if wp.static(features.passes):
            path.passes_straight = 0
        if wp.static(features.refracts):
            path.transmits = 0
        return path

    @wp.func(inline=True)
    def begin_ray(before: Path, camera: Camera) -> Path:
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
        if wp.static(features.surfaces or features.connections):
            path.emitted = wp.vec3(0.0, 0.0, 0.0)
        return path

    return FlightStart(begin_event, begin_ray)
