"""The Henyey-Greenstein phase function in float64 (Henyey and Greenstein 1941)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def eval_hg(asymmetry: ArrayLike, one_minus_cos: ArrayLike) -> np.ndarray:
    """Value [1/sr] for g in (-1, 1), at 1 - cos(theta) in [0, 2] with theta = 0 straight on."""
    g = np.abs(asymmetry)
    v = np.where(np.asarray(asymmetry) >= 0, one_minus_cos, 2 - np.asarray(one_minus_cos))
    return (1 - g) * (1 + g) / (4 * np.pi * ((1 - g) ** 2 + 2 * g * v) ** 1.5)


def sample_hg_one_minus_cos(g: ArrayLike, xi: ArrayLike) -> np.ndarray:
    """1 - cos(theta) for 0 <= g < 1 and xi uniform in (0, 1), without cancellation at either end of g.

    The textbook inversion cos = (1 + g^2 - ((1-g^2) / (1+g-2g xi))^2) / 2g, with 1 - cos factored.
    """
    g, xi = np.asarray(g, dtype=np.float64), np.asarray(xi, dtype=np.float64)
    return 2 * (1 - g) ** 2 * xi * (1 + g * (1 - xi)) / ((1 - g) + 2 * g * (1 - xi)) ** 2
