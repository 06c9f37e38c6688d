"""Phase functions in float64 [1/sr], at v = 1 - cos(theta) in [0, 2] with theta = 0 straight on.

Henyey and Greenstein 1941, blends of two of them, and the phase function of Draine 2003, "Scattering by interstellar
dust grains. I", which weighs Henyey-Greenstein by 1 + alpha cos^2: it is that of Cornette and Shanks 1992 at alpha = 1,
and Rayleigh's at g = 0 besides.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

DRAINE_ALPHA_MAX = 1e3
"""Within it the sampler's steps are enough. Dust needs 1, fits to fog take 250 (Jendersie and d'Eon 2023)."""
DRAINE_STEPS = 16
"""Newton's steps after the first; from 12 on nothing changes in float64."""


def eval_hg(asymmetry: ArrayLike, one_minus_cos: ArrayLike) -> np.ndarray:
    """Value [1/sr] of Henyey-Greenstein for g in (-1, 1)."""
    g = np.abs(asymmetry)
    v = np.where(np.asarray(asymmetry) >= 0, one_minus_cos, 2 - np.asarray(one_minus_cos))
    return (1 - g) * (1 + g) / (4 * np.pi * ((1 - g) ** 2 + 2 * g * v) ** 1.5)


def eval_two_lobe(
    asymmetry: ArrayLike, back_asymmetry: ArrayLike, back_weight: ArrayLike, one_minus_cos: ArrayLike
) -> np.ndarray:
    """Value [1/sr] of two Henyey-Greenstein lobes, of which the second weighs `back_weight` in [0, 1]."""
    weight = np.asarray(back_weight)
    return (1 - weight) * eval_hg(asymmetry, one_minus_cos) + weight * eval_hg(back_asymmetry, one_minus_cos)


def eval_draine(asymmetry: ArrayLike, alpha: ArrayLike, one_minus_cos: ArrayLike) -> np.ndarray:
    """Value [1/sr] of Draine's phase function for g in (-1, 1) and alpha >= 0."""
    return eval_hg(asymmetry, one_minus_cos) * draine_factor(asymmetry, alpha, 1 - np.asarray(one_minus_cos))


def draine_factor(asymmetry: ArrayLike, alpha: ArrayLike, cos_theta: ArrayLike) -> np.ndarray:
    """Draine's phase function over Henyey-Greenstein of the same g."""
    g, alpha, cos_theta = np.asarray(asymmetry), np.asarray(alpha), np.asarray(cos_theta)
    return (1 + alpha * cos_theta**2) / (1 + alpha * (1 + 2 * g**2) / 3)


def sample_hg_one_minus_cos(g: ArrayLike, xi: ArrayLike) -> np.ndarray:
    """1 - cos(theta) for 0 <= g < 1 and xi uniform in (0, 1), without cancellation at either end of g.

    The textbook inversion cos = (1 + g^2 - ((1-g^2) / (1+g-2g xi))^2) / 2g, with 1 - cos factored.
    """
    g, xi = np.asarray(g, dtype=np.float64), np.asarray(xi, dtype=np.float64)
    return 2 * (1 - g) ** 2 * xi * (1 + g * (1 - xi)) / ((1 - g) + 2 * g * (1 - xi)) ** 2


def choose_lobe(
    asymmetry: ArrayLike, back_asymmetry: ArrayLike, back_weight: ArrayLike, xi: ArrayLike
) -> tuple[np.ndarray, np.ndarray]:
    """g of the lobe that xi in (0, 1) falls in, and its place there in [0, 1], which is uniform again.

    The rarer lobe takes the low end, where floating-point numbers lie closest.
    """
    xi, weight = np.asarray(xi, dtype=np.float64), np.asarray(back_weight, dtype=np.float64)
    rarer = np.minimum(weight, 1 - weight)
    is_rarer = xi < rarer
    is_back = is_rarer == (weight < 0.5)
    place = np.where(is_rarer, xi, xi - rarer) / np.where(is_rarer, rarer, 1 - rarer)
    return np.where(is_back, back_asymmetry, asymmetry), place


def sample_draine_one_minus_cos(g: ArrayLike, alpha: ArrayLike, xi: ArrayLike) -> np.ndarray:
    """1 - cos(theta) of Draine's phase function for 0 <= g < 1, alpha in [0, 1000] and xi uniform in (0, 1).

    Let y be the share that Henyey-Greenstein scatters closer to straight on. Over y, Draine's density is
    1 + alpha cos^2 up to a factor, and its integral is a rational function. Up to 90 degrees the density falls, so
    Newton's steps from y = 0 rise to the root and never pass it. What goes beyond 90 degrees is found likewise
    from the other end, where g is -g and xi is 1 - xi. No step divides by g or alpha.
    """
    g, alpha, xi = (np.asarray(x, dtype=np.float64) for x in (g, alpha, xi))
    whole = 1 + alpha * (1 + 2 * g**2) / 3
    at_right_angle = np.sqrt(1 + g**2)
    y = (1 + g) / (at_right_angle * (at_right_angle + 1 - g))
    is_forward = xi * whole < y + alpha * cos_squared_below(g, y, (1 - g) * (1 + g) / at_right_angle)
    end_g = np.where(is_forward, g, -g)
    target = whole * np.where(is_forward, xi, 1 - xi)
    y = target / (1 + alpha)  # The first step, from y = 0.
    for _ in range(DRAINE_STEPS):
        t = hg_denominator(end_g, y)
        cos_theta = 1 - hg_one_minus_cos(end_g, y, t)
        y = y - (y + alpha * cos_squared_below(end_g, y, t) - target) / (1 + alpha * cos_theta**2)
    v = hg_one_minus_cos(end_g, y, hg_denominator(end_g, y))
    return np.where(is_forward, v, 2 - v)


def hg_denominator(g: ArrayLike, y: ArrayLike) -> np.ndarray:
    """t = 1 + g - 2 g y for g in (-1, 1): from 1 + g straight on to 1 - g straight back."""
    size = np.abs(g)
    return (1 - size) + 2 * size * np.where(np.asarray(g) > 0, 1 - np.asarray(y), y)


def hg_one_minus_cos(g: ArrayLike, y: ArrayLike, t: ArrayLike) -> np.ndarray:
    """1 - cos(theta) of the angle within which Henyey-Greenstein scatters the share y; t is `hg_denominator`."""
    g, y, t = np.asarray(g), np.asarray(y), np.asarray(t)
    return ((1 - g) / t) ** 2 * y * (1 + g + t)


def cos_squared_below(g: ArrayLike, y: ArrayLike, t: ArrayLike) -> np.ndarray:
    """Integral of cos^2 over the share y; (1 + 2 g^2) / 3 at y = 1."""
    g, y, t = np.asarray(g), np.asarray(y), np.asarray(t)
    r = (1 - g) * y / t
    return y - 2 * r**2 * t + r**3 * (1 - g) * (1 + g + 3 * t) / 3
