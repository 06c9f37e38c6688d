"""The Henyey-Greenstein phase function; twin of `theory/phase.py`.

Both directions point the way the light travels, so forward scattering is `wi` close to `w`. The formulas are
written in 1 - cos(theta) and |g|, which keeps every term positive: no cancellation at g -> 0 nor at g -> +-1.
"""

import warp as wp

from fgf_warp.device.numerics import INV_4PI, choose, one_minus_cos_between, turn


@wp.func(inline=True)
def eval_hg(asymmetry: float, w: wp.vec3, wi: wp.vec3) -> float:
    """Value, and pdf_solid_angle, of Henyey-Greenstein [1/sr]; relative error below 1e-5 for |g| <= 0.9999."""
    g = wp.abs(asymmetry)
    v = one_minus_cos_between(w, choose(asymmetry >= 0.0, wi, -wi))
    s = (1.0 - g) * (1.0 - g) + 2.0 * g * v
    return INV_4PI * (1.0 - g) * (1.0 + g) / (s * wp.sqrt(s))


@wp.func(inline=True)
def sample_hg_one_minus_cos(g: float, xi: float) -> float:
    """1 - cos(theta) in [0, 2] for 0 <= g < 1; relative error below 1e-6."""
    t = (1.0 - g) + 2.0 * g * (1.0 - xi)
    return wp.min(2.0 * xi * (1.0 - g) / t * ((1.0 - g) / t) * (1.0 + g * (1.0 - xi)), 2.0)


@wp.func(inline=True)
def sample_hg(asymmetry: float, w: wp.vec3, xi1: float, xi2: float) -> wp.vec3:
    """A direction distributed as Henyey-Greenstein around w; its weight is 1."""
    axis = choose(asymmetry >= 0.0, w, -w)
    return turn(axis, sample_hg_one_minus_cos(wp.abs(asymmetry), xi1), xi2)
