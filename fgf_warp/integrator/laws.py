"""The law of a path: its medium's, or where the path is frozen there, the exponential at its rate.

Transport kernels: section 4 of Bitterli et al. 2018, in the reciprocal or the renewal way. In the mixed transport a
share of the paths is frozen: for them a medium is classical at a rate of their own.
"""

from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device import fbm
from fgf_warp.device.law import (
    ESCAPED,
    EXACT_FBM,
    NOT_FROZEN,
    Law,
    flight_density,
    frozen_density,
    frozen_transmittance,
    segment_transmittance,
)
from fgf_warp.device.medium import Medium, medium_after
from fgf_warp.device.numerics import max_component
from fgf_warp.device.rng import WHOLE_PATH
from fgf_warp.device.tables import draw_from
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.path import PathRecord
from fgf_warp.integrator.sampler import Sampler
from fgf_warp.integrator.scene_data import scene_struct

SHORTEST_DEPTH = wp.constant(1.0e-30)
"""Mean optical depth below which a flight has no length: between medium vertices many have none where b is small."""

DENSE = wp.constant(1.0e18)
"""Extinction [1/stage unit] beyond which densities are scaled, or their quotients would overflow float32."""
DENSE_SCALE = wp.constant(5.421010862427522e-20)
"""2^-64, which is exact."""


class LineLaws(NamedTuple):
    """Functions of the device.

    Args:
        medium_at_depth: (medium, depth) -> Medium, the same, or the similar one after so many scattering events.
        rates_of: (path) -> vec3, at which it is frozen, or NOT_FROZEN.
        is_from_medium: (path) -> bool, whether its segment began at a medium vertex.
        draw_rates: (scene, path, medium, body, seed) -> vec3, at which the path is frozen in a body of a medium: the
            same rates whenever it comes there.
        channel_transmittance: (medium, t, from_medium, rate) -> float, of a medium whose channels do not differ.
        transmittance: see `MediumFunctions`.
        flight_densities: likewise.
    """

    medium_at_depth: Any
    rates_of: Any
    is_from_medium: Any
    draw_rates: Any
    channel_transmittance: Any
    transmittance: Any
    flight_densities: Any


@wp.func(inline=True)
def mean_optical_depth(extinction: float, t: float) -> float:
    """u = sigma_m t, saturated."""
    return wp.min(extinction * t, ESCAPED)


@wp.func
def law_of_channel(medium: Medium, channel: int) -> Law:
    """The line law of one channel."""
    if channel == 0:
        return medium.law
    if channel == 1:
        return medium.law_green
    return medium.law_blue


def build_channel_laws(features: RenderFeatures) -> tuple[Any, Any]:
    """The functions of one channel (law, u, from_medium, rate) -> float.

    Returns:
        The share of light that passes a segment which ends uncorrelated, and the density in u of the next event.
    """

    @wp.func(inline=True)
    def pass_segment(law: Law, u: float, from_medium: bool, rate: float) -> float:
        passed = float(0.0)
        if wp.static(features.exact_variance):
            if law.kind == EXACT_FBM:
                passed = fbm.segment_transmittance(law, u, from_medium)
            else:
                passed = segment_transmittance(law, u, from_medium)
        else:
            passed = segment_transmittance(law, u, from_medium)
        if wp.static(features.frozen):
            passed = wp.where(rate >= 0.0, frozen_transmittance(rate, u), passed)
        return passed

    @wp.func
    def end_in_segment(law: Law, u: float, from_medium: bool, rate: float) -> float:
        if wp.static(features.frozen):
            if rate >= 0.0:
                return frozen_density(rate, u)
        if wp.static(features.exact_variance):
            if law.kind == EXACT_FBM:
                return fbm.flight_density(law, u, from_medium)
        return flight_density(law, u, from_medium)

    return pass_segment, end_in_segment


def build_laws(features: RenderFeatures, record: PathRecord, sampler: Sampler) -> LineLaws:
    """The functions of a kernel of these features."""
    Path, SceneData = record.struct, scene_struct(features)
    draw = sampler.draw
    pass_segment, end_in_segment = build_channel_laws(features)

    @wp.func(inline=True)
    def medium_at_depth(medium: Medium, depth: int) -> Medium:
        if wp.static(features.similarity):
            return medium_after(medium, depth)
        return medium

    @wp.func(inline=True)
    def rates_of(path: Path) -> wp.vec3:
        rates = wp.vec3(NOT_FROZEN)
        if wp.static(features.frozen):
            rates = path.rates
        return rates

    @wp.func(inline=True)
    def is_from_medium(path: Path) -> bool:
        remembers = bool(False)
        if wp.static(features.media):
            remembers = path.from_medium == 1
        return remembers

    @wp.func
    def draw_rates(scene: SceneData, path: Path, medium: Medium, body: int, seed: wp.uint64) -> wp.vec3:
        xi = draw(seed, path.pixel, path.sample_index, scene.containers[body].rates, WHOLE_PATH)
        rates = wp.vec3(NOT_FROZEN)
        if xi[0] < medium.frozen_share:
            rates = wp.vec3(draw_from(scene.tables, medium.law.rates, xi[1]))
            if wp.static(features.chromatic):
                rates[1] = draw_from(scene.tables, medium.law_green.rates, xi[1])
                rates[2] = draw_from(scene.tables, medium.law_blue.rates, xi[1])
        return rates

    @wp.func(inline=True)
    def channel_transmittance(medium: Medium, t: float, from_medium: bool, rate: float) -> float:
        return pass_segment(medium.law, mean_optical_depth(medium.extinction[0], t), from_medium, rate)

    @wp.func
    def transmittance(medium: Medium, t: float, from_medium: bool, rates: wp.vec3) -> wp.vec3:
        red = channel_transmittance(medium, t, from_medium, rates[0])
        if wp.static(features.chromatic):
            return wp.vec3(
                red,
                pass_segment(medium.law_green, mean_optical_depth(medium.extinction[1], t), from_medium, rates[1]),
                pass_segment(medium.law_blue, mean_optical_depth(medium.extinction[2], t), from_medium, rates[2]),
            )
        return wp.vec3(red)

    @wp.func
    def flight_densities(medium: Medium, t: float, from_medium: bool, rates: wp.vec3) -> wp.vec3:
        largest = max_component(medium.extinction)
        shortest = SHORTEST_DEPTH / largest
        scale = wp.where(largest > DENSE, DENSE_SCALE, 1.0)
        densities = wp.vec3()
        for channel in range(3):
            extinction = medium.extinction[channel]
            law = law_of_channel(medium, channel)
            if t > shortest:
                u = mean_optical_depth(extinction, t)
                densities[channel] = extinction * scale * end_in_segment(law, u, from_medium, rates[channel])
            else:
                passed = pass_segment(law, extinction * shortest, from_medium, rates[channel])
                densities[channel] = wp.max(1.0 - passed, 1.0e-7)
        return densities

    return LineLaws(
        medium_at_depth, rates_of, is_from_medium, draw_rates, channel_transmittance, transmittance, flight_densities
    )
