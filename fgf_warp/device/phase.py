"""Phase functions; twin of `theory/phase.py`.

Both directions point the way the light travels, so forward scattering is `wi` close to `w`. The formulas are
written in 1 - cos(theta) and |g|, which keeps their terms positive: no cancellation at g -> 0 nor at g -> +-1.
All are sampled by inversion, so a sampled direction has weight 1.
"""

from typing import Any

import warp as wp

from fgf_warp.device.numerics import INV_4PI, choose, one_minus_cos_between, rotate_from

DRAINE_STEPS = wp.constant(9)
"""Newton's steps after the first; fewer would show for alpha = 1000, and 4 are enough for alpha <= 1."""


@wp.struct
class Phase:
    """Parameters of a phase function; those that it does not have are 0."""

    asymmetry: float
    back_asymmetry: float
    back_weight: float
    draine_alpha: float


def build_phase(kinds: frozenset[str]) -> tuple[Any, Any]:
    """The functions `eval_phase` and `sample_phase` of a scene whose media have these kinds of phase functions.

    Where media differ, every kind is computed as the one that holds them all: isotropic is Henyey-Greenstein of g = 0,
    which is two lobes of which the second weighs 0, and Draine's of alpha = 0.
    """
    is_isotropic = kinds == {"isotropic"}

    @wp.func(inline=True)
    def eval_phase(phase: Phase, w: wp.vec3, wi: wp.vec3) -> float:
        """Value, and pdf_solid_angle [1/sr]."""
        value = float(INV_4PI)
        if wp.static("two_lobe" in kinds):
            value = eval_two_lobe(phase.asymmetry, phase.back_asymmetry, phase.back_weight, w, wi)
        elif wp.static(not is_isotropic):
            value = eval_hg(phase.asymmetry, w, wi)
        if wp.static("draine" in kinds):
            value = value * draine_factor(phase.asymmetry, phase.draine_alpha, wp.dot(w, wi))
        return value

    @wp.func(inline=True)
    def sample_phase(phase: Phase, w: wp.vec3, xi1: float, xi2: float) -> wp.vec3:
        """A direction distributed as the phase function around w; its weight is 1."""
        asymmetry = phase.asymmetry
        place = xi1
        if wp.static("two_lobe" in kinds):
            asymmetry, place = choose_lobe(phase.asymmetry, phase.back_asymmetry, phase.back_weight, xi1)
        one_minus_cos = 2.0 * place
        axis = w
        if wp.static(not is_isotropic):
            axis = choose(asymmetry >= 0.0, w, -w)
            if wp.static("draine" in kinds):
                one_minus_cos = sample_draine_one_minus_cos(wp.abs(asymmetry), phase.draine_alpha, place)
            else:
                one_minus_cos = sample_hg_one_minus_cos(wp.abs(asymmetry), place)
        return rotate_from(axis, one_minus_cos, xi2)

    return eval_phase, sample_phase


@wp.func(inline=True)
def eval_hg(asymmetry: float, w: wp.vec3, wi: wp.vec3) -> float:
    """Value of Henyey-Greenstein [1/sr]; relative error below 1e-5 for |g| <= 0.9999."""
    g = wp.abs(asymmetry)
    v = one_minus_cos_between(w, choose(asymmetry >= 0.0, wi, -wi))
    s = (1.0 - g) * (1.0 - g) + 2.0 * g * v
    return INV_4PI * (1.0 - g) * (1.0 + g) / (s * wp.sqrt(s))


@wp.func(inline=True)
def eval_two_lobe(asymmetry: float, back_asymmetry: float, back_weight: float, w: wp.vec3, wi: wp.vec3) -> float:
    """Value of two Henyey-Greenstein lobes [1/sr], of which the second weighs `back_weight`; error as of `eval_hg`."""
    return (1.0 - back_weight) * eval_hg(asymmetry, w, wi) + back_weight * eval_hg(back_asymmetry, w, wi)


@wp.func(inline=True)
def draine_factor(asymmetry: float, alpha: float, cos_theta: float) -> float:
    """Draine's phase function over Henyey-Greenstein of the same g."""
    return (1.0 + alpha * cos_theta * cos_theta) / (1.0 + alpha * (1.0 + 2.0 * asymmetry * asymmetry) / 3.0)


@wp.func(inline=True)
def sample_hg_one_minus_cos(g: float, xi: float) -> float:
    """1 - cos(theta) in [0, 2] for 0 <= g < 1; relative error below 1e-6."""
    t = (1.0 - g) + 2.0 * g * (1.0 - xi)
    return wp.min(2.0 * xi * (1.0 - g) / t * ((1.0 - g) / t) * (1.0 + g * (1.0 - xi)), 2.0)


@wp.func(inline=True)
def choose_lobe(asymmetry: float, back_asymmetry: float, back_weight: float, xi: float):
    """g of the lobe that xi falls in, and its place there in [0, 1]; the rarer lobe takes the low end."""
    rarer = wp.min(back_weight, 1.0 - back_weight)
    is_rarer = xi < rarer
    is_back = is_rarer == (back_weight < 0.5)
    place = wp.where(is_rarer, xi, xi - rarer) / wp.where(is_rarer, rarer, 1.0 - rarer)
    return wp.where(is_back, back_asymmetry, asymmetry), wp.min(place, 1.0)


@wp.func(inline=True)
def sample_draine_one_minus_cos(g: float, alpha: float, xi: float) -> float:
    """1 - cos(theta) in [0, 2] for 0 <= g < 1 and alpha in [0, 1000].

    For g <= 0.9999 the cdf there is off xi by less than 5e-7, and up to 90 degrees by less than 1e-6 xi.
    """
    whole = 1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0
    at_right_angle = wp.sqrt(1.0 + g * g)
    right = (1.0 + g) / (at_right_angle * (at_right_angle + (1.0 - g)))
    ahead = right + alpha * cos_squared_below(g, right, (1.0 - g) * (1.0 + g) / at_right_angle)
    is_forward = xi * whole < ahead
    end_g = wp.where(is_forward, g, -g)
    target = whole * wp.where(is_forward, xi, 1.0 - xi)
    y = target / (1.0 + alpha)
    for _ in range(DRAINE_STEPS):
        t = hg_denominator(end_g, y)
        cos_theta = 1.0 - hg_one_minus_cos(end_g, y, t)
        y = y - (y + alpha * cos_squared_below(end_g, y, t) - target) / (1.0 + alpha * cos_theta * cos_theta)
    v = wp.min(hg_one_minus_cos(end_g, y, hg_denominator(end_g, y)), 2.0)
    return wp.where(is_forward, v, 2.0 - v)


@wp.func(inline=True)
def hg_denominator(g: float, y: float) -> float:
    """t = 1 + g - 2 g y for g in (-1, 1): from 1 + g straight on to 1 - g straight back."""
    size = wp.abs(g)
    return (1.0 - size) + 2.0 * size * wp.where(g > 0.0, wp.max(1.0 - y, 0.0), y)


@wp.func(inline=True)
def hg_one_minus_cos(g: float, y: float, t: float) -> float:
    """1 - cos(theta) of the angle within which Henyey-Greenstein scatters the share y; t is `hg_denominator`."""
    return (1.0 - g) / t * ((1.0 - g) / t) * y * (1.0 + g + t)


@wp.func(inline=True)
def cos_squared_below(g: float, y: float, t: float) -> float:
    """Integral of cos^2 over the share y; (1 + 2 g^2) / 3 at y = 1."""
    r = (1.0 - g) * y / t
    return y - 2.0 * r * r * t + r * r * r * (1.0 - g) * (1.0 + g + 3.0 * t) / 3.0
