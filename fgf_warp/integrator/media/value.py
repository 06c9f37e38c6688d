"""The value that a kind of medium builds.

A new kind of medium, such as a grid of densities, is a file beside this one with its own `build_medium`, a line in
`KINDS` and its name in `features.py`.
"""

from typing import Any, NamedTuple

from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.flight import FlightStart
from fgf_warp.integrator.laws import LineLaws
from fgf_warp.integrator.path import PathRecord
from fgf_warp.integrator.pool_layout import PoolLayout
from fgf_warp.integrator.sampler import Sampler


class MediumParts(NamedTuple):
    """What a medium is built from; each is explained in the file that it comes from."""

    features: RenderFeatures
    path: PathRecord
    sampler: Sampler
    laws: LineLaws
    flight: FlightStart
    layout: PoolLayout


class MediumFunctions(NamedTuple):
    """Functions of the device.

    Args:
        sample_free_flight: (scene, lone, path, seed) -> Path, with `flight`, the distance to the next scattering event
            were the medium unbounded [stage unit], sampled in proportion to its density, and the `medium` it is in.
        flights_in_lanes: (pool, scene, lone, seed): begins the event of all lanes of a pool and samples their flights.
        scattering: (lone, path) -> (albedo, Phase), of the medium at the event.
        length_of_segment: (path) -> float, of the segment in a medium that ends at this event; 0 where none does.
        transmittance: (medium, t, from_medium, rates) -> vec3, of a segment of length t that ends uncorrelated.
        flight_densities: (medium, t, from_medium, rates) -> vec3, per channel the density with which a flight ends at
            t; of one without length, the probability of that. Up to a factor that the channels share, since only their
            quotients matter.
    """

    sample_free_flight: Any
    flights_in_lanes: Any
    scattering: Any
    length_of_segment: Any
    transmittance: Any
    flight_densities: Any
