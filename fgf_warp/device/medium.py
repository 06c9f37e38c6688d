"""Media and the containers they fill."""

from typing import Any

import warp as wp

from fgf_warp.device.geometry import is_inside
from fgf_warp.device.law import Law
from fgf_warp.device.numerics import choose
from fgf_warp.device.phase import Phase


@wp.struct
class Medium:
    """A homogeneous medium; its channels differ in albedo, and in extinction where the scene is chromatic."""

    index: int
    """Its place among the scene's media."""
    extinction: wp.vec3
    """sigma_m per channel [1/stage unit], > 0."""
    albedo: wp.vec3
    phase: Phase
    frozen_share: float
    """Of paths, for which the medium is classical at a rate of their own: the mixed transport."""
    law: Law
    law_green: Law
    law_blue: Law
    """Of the further channels; used where the scene is chromatic."""
    similarity_order: int
    """Scattering events after which a path sees the similar medium, which scatters evenly. The rest is of that."""
    similar_extinction: wp.vec3
    similar_albedo: wp.vec3
    similar_kappa: wp.vec3
    similar_ln_kappa: wp.vec3
    similar_rate: wp.vec3


@wp.struct
class Container:
    """A closed shape filled with a medium; its place in the array is its bit in a path's `inside`."""

    medium: int
    priority: int
    light_links: wp.uint32
    """Bits of the linked lights that shine in it."""
    ior: float
    """Index of refraction, where light enters through its surface; 0: its boundary refracts nothing."""
    ior_number: int
    """Of `ior` among the scene's; 0 is empty space."""
    rates: int
    """Address, among the random numbers of a whole path, of the rates at which it is frozen there."""


@wp.func(inline=True)
def similar_law(law: Law, is_similar: bool, kappa: float, ln_kappa: float, rate: float) -> Law:
    """A channel's law at the extinction of the similar medium, where `is_similar`."""
    result = law
    result.fit_offset = law.fit_offset + wp.where(is_similar, ln_kappa - law.ln_kappa, 0.0)
    result.kappa = wp.where(is_similar, kappa, law.kappa)
    result.ln_kappa = wp.where(is_similar, ln_kappa, law.ln_kappa)
    result.rate = wp.where(is_similar, rate, law.rate)
    return result


@wp.func(inline=True)
def medium_after(medium: Medium, scatterings: int) -> Medium:
    """The medium as a path sees it after so many scattering events; branch-free."""
    result = medium
    is_similar = scatterings >= medium.similarity_order
    result.extinction = choose(is_similar, medium.similar_extinction, medium.extinction)
    result.albedo = choose(is_similar, medium.similar_albedo, medium.albedo)
    result.phase.asymmetry = wp.where(is_similar, 0.0, medium.phase.asymmetry)
    result.phase.back_asymmetry = wp.where(is_similar, 0.0, medium.phase.back_asymmetry)
    result.phase.draine_alpha = wp.where(is_similar, 0.0, medium.phase.draine_alpha)
    kappa = medium.similar_kappa
    ln_kappa = medium.similar_ln_kappa
    rate = medium.similar_rate
    result.law = similar_law(medium.law, is_similar, kappa[0], ln_kappa[0], rate[0])
    result.law_green = similar_law(medium.law_green, is_similar, kappa[1], ln_kappa[1], rate[1])
    result.law_blue = similar_law(medium.law_blue, is_similar, kappa[2], ln_kappa[2], rate[2])
    return result


@wp.func
def container_at(containers: wp.array(dtype=Container), inside: wp.uint32) -> int:
    """The container that fills the space: of those around it the one of highest priority; -1 for none."""
    found = int(-1)
    for i in range(containers.shape[0]):
        if is_inside(inside, i):
            if found < 0 or containers[i].priority > containers[found].priority:
                found = i
    return found


@wp.func
def medium_at(containers: wp.array(dtype=Container), inside: wp.uint32) -> int:
    """The medium that fills the space; -1 for none."""
    medium = int(-1)
    container = container_at(containers, inside)
    if container >= 0:
        medium = containers[container].medium
    return medium


def build_carries_on(features: Any) -> Any:
    """The function that tells in a scene of these features whether a medium goes on where a boundary is crossed.

    It has the arguments (containers, medium, inside, beyond, entered): the medium before it, the path's containers
    before and after, and `Start.entered` after. A medium goes on in what is around the path on both sides. So a body
    that ends where another of the same medium begins does not go on in that: they touch, and are two media; one that
    overlaps it by more than rounding does.
    """

    @wp.func
    def carries_on(
        containers: wp.array(dtype=Container), medium: int, inside: wp.uint32, beyond: wp.uint32, entered: wp.uint32
    ) -> bool:
        is_same = medium_at(containers, beyond) == medium
        if wp.static(features.contacts):
            if is_same and (inside & beyond) != inside:
                lasting = beyond & (beyond ^ entered)
                is_same = bool(False)
                for i in range(containers.shape[0]):
                    is_same = is_same or (is_inside(lasting, i) and containers[i].medium == medium)
        return is_same

    return carries_on


@wp.func
def refracting_at(containers: wp.array(dtype=Container), inside: wp.uint32) -> int:
    """The container whose index of refraction fills the space: of those that have one, as for media; -1 for none."""
    found = int(-1)
    for i in range(containers.shape[0]):
        if is_inside(inside, i) and containers[i].ior > 0.0:
            if found < 0 or containers[i].priority > containers[found].priority:
                found = i
    return found


@wp.func
def ior_at(containers: wp.array(dtype=Container), inside: wp.uint32) -> float:
    """Index of refraction of the space; 1 where it is empty."""
    found = refracting_at(containers, inside)
    if found < 0:
        return 1.0
    return containers[found].ior
