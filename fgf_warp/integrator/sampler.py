"""Where a kernel's random numbers come from."""

from typing import Any, NamedTuple

from fgf_warp.device.rng import draw_independent, draw_lattice, draw_more_independent, draw_more_lattice
from fgf_warp.features import RenderFeatures


class Sampler(NamedTuple):
    """Four random numbers in (0, 1) by their address (seed, pixel, sample_index, bounce, purpose).

    Args:
        draw: the function of the first four.
        draw_more: of four more at the same address.
    """

    draw: Any
    draw_more: Any


def build_sampler(features: RenderFeatures) -> Sampler:
    """The sampler of a kernel of these features."""
    if features.sampler == "lattice":
        return Sampler(draw_lattice, draw_more_lattice)
    return Sampler(draw_independent, draw_more_independent)
