"""Media and the containers they fill."""

import warp as wp

from fgf_warp.device.geometry import is_inside
from fgf_warp.device.law import Law
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
