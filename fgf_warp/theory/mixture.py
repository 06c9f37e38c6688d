"""A transmittance as a mixture of exponentials: what the mixed transport freezes.

For 0 <= b <= 1, Tr is completely monotone, so that Tr(u) is the mean of exp(-rate u) over a distribution G of rates
(Bernstein): the medium is as if it were drawn anew for every path and then classical. For b = 1, G is the Gamma
distribution of shape 1/kappa and scale kappa; in general it has no closed form. Here it is discrete: non-negative least
squares of Tr on exponentials, which is found node by node.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from fgf_warp.theory import fbm, kernels

MIXTURE_ERROR = 1e-4
"""Of Tr, absolute: what is farther off is no mixture of exponentials."""
TOLERANCE = 2e-8
NEAREST = 1e-8
"""u of the nearest segment that is fitted; below it Tr is 1 to the same precision."""
FARTHEST = 1e12
LARGEST_LN_RATE = np.log(1e9)
DEPTHS = 400
FIRST_PER_DECADE = 6
TRIED_PER_DECADE = 60
TRIED_NEAR_ONE = np.linspace(-1.5, 1.5, 3001)
"""ln rate: where the rates of a weakly correlated medium crowd."""
ROUNDS = 60


@dataclass(frozen=True, eq=False)
class RateMixture:
    """Rates and how often they occur.

    Args:
        rates: (n,) float64, falling, in units of the mean extinction; 0 is a path on which there is no medium.
        weights: (n,) float64, > 0, with sum 1.
        error: largest absolute error of Tr.
    """

    rates: np.ndarray
    weights: np.ndarray
    error: float


@cache
def mix_rates(b: float, kappa: float) -> RateMixture:
    """G of the law of (b, kappa), 0 < b <= 1, kappa > 0; its Tr is accurate to 3e-8 absolute, for b < 0.02 to 1e-4.

    Rates are at most 1e9. For small b the mean rate, which is 1, lies in yet larger ones that no path would draw: it is
    0.63 at b = 0.05, kappa = 3, and the collisions of frozen paths are as many fewer.

    Raises:
        ArithmeticError: where the least squares do not converge.
    """
    with np.errstate(over="ignore"):
        farthest = min(float(kernels.flight_from_exponent(b, kappa, 25.0)), FARTHEST)
    return fit_rates(lambda u: kernels.transmittance_ss(b, kappa, u), farthest)


@cache
def mix_exact_rates(line: fbm.ExactFbm, farthest: float) -> RateMixture:
    """The same for an exact variance, up to u = `farthest`; there its `error` may be large.

    Where v(t) grows faster than its asymptote, beta > 1, Tr need not be completely monotone.

    Raises:
        ArithmeticError: where the least squares do not converge.
    """
    return fit_rates(lambda u: np.exp(-fbm.line_exponent(line, u)), farthest)


def fit_rates(transmittance: Callable[[np.ndarray], np.ndarray], farthest: float) -> RateMixture:
    """The mixture of exponentials nearest to a transmittance; look at its `error`.

    From a coarse grid of rates on, each round adds those rates of a fine one along which the residual falls fastest,
    and solves again: an active-set method over a continuum.

    Args:
        transmittance: of (n,) mean optical depths u > 0.
        farthest: the largest u of interest, > 0.

    Raises:
        ArithmeticError: where the least squares do not converge.
    """
    from scipy.optimize import nnls  # noqa: PLC0415 - slow to import, and scenes rarely need it

    u = np.append(0.0, np.geomspace(NEAREST * min(farthest, 1.0), farthest, DEPTHS))
    expected = np.append(1.0, transmittance(u[1:]))
    lowest = min(-np.log(farthest), 0.0) - 2
    decades = (LARGEST_LN_RATE - lowest) / np.log(10)
    tried = np.union1d(np.linspace(lowest, LARGEST_LN_RATE, int(decades * TRIED_PER_DECADE)), TRIED_NEAR_ONE)
    along = np.exp(-np.outer(np.exp(tried), u))
    # The rate 0 stands for all that are too low to matter.
    candidates = np.append(0.0, np.exp(np.arange(lowest, LARGEST_LN_RATE, np.log(10) / FIRST_PER_DECADE)))
    for _ in range(ROUNDS):
        try:
            weights, _ = nnls(np.exp(-np.outer(u, candidates)), expected, maxiter=100 * len(candidates))
        except RuntimeError as error:
            raise ArithmeticError("the transmittance's mixture of exponentials was not found") from error
        rates, weights = candidates[weights > 0], weights[weights > 0]
        residual = expected - np.exp(-np.outer(u, rates)) @ weights
        gain = along @ residual
        is_peak = (gain[1:-1] > gain[:-2]) & (gain[1:-1] >= gain[2:]) & (gain[1:-1] > 0)
        if np.abs(residual).max() < TOLERANCE or not is_peak.any():
            break
        candidates = np.union1d(np.append(0.0, rates), np.exp(tried[1:-1][is_peak]))
    return RateMixture(rates[::-1], weights[::-1] / weights.sum(), float(np.abs(residual).max()))
