"""Fractional Brownian motion with the exact variance of a finite segment, in float64.

Guo et al. 2019, supplement, (11): averaged over segments that begin in [0, L], the line variance is
``v(t) = v R(t/L)``, with v the asymptotic one, (13), and R the `variance_ratio`. So ``y(u) = kappa u R(u/(sigma_m L))``
takes the place of ``kappa u``; where the theory has b, the local exponent ``beta = d ln y / d ln u`` does.

The field's variance grows along the line without bound, and from some length on Tr would rise again: this law holds
for shorter segments alone, see `falls_until`. `device/fbm.py` holds the float32 twins under the same names.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fgf_warp.theory.kernels import (
    KernelValues,
    compose_kernels,
    log1p_ratio,
    log1p_ratio_slope,
    log_expm1_ratio,
)

LONGEST = 10.0
"""t/L up to which the law is held to hold: an average over segments that begin in [0, L] says little of longer ones."""
SEARCHED = np.geomspace(1e-3, LONGEST, 1601)
"""t/L at which `falls_until` looks for the end; R is 1 below."""
STILL_FALLS = 0.3
"""f' over that of the asymptotic variance, 1/(1+y), below which Tr counts as no longer falling."""
SHORTEST_FLIGHT = 1e-9
"""Over what a flight is without correlation, kappa = 0 or a medium vertex; float32 numbers give E >= 6e-8."""
LARGEST_EXPONENT = 23.0
"""Of E = -ln xi of float32 numbers."""
NODES_PER_UNIT = 32
"""Of the table of flights. A flight takes as long from a table of a quarter or of four times as many: the time is 0.97
and 0.99 of that with these, medians of nine renders. u is then wrong by 1e-2 or 4e-6 at most in place of 3e-4 (H = 0.7,
near the end of the law), and the table is made in 15 or 75 ms in place of 30. So it is no setting."""
BISECTIONS = 60
LARGEST_SHIFT = 40.0
"""Of ln u, between the exact and the asymptotic variance."""


@dataclass(frozen=True)
class ExactFbm:
    """The line law of a fractional Brownian motion with its exact variance.

    Args:
        hurst: H in (0, 1).
        kappa: > 0, of the asymptotic variance.
        outer_depth: sigma_m L, > 0.
    """

    hurst: float
    kappa: float
    outer_depth: float


@dataclass(frozen=True, eq=False)
class FlightTable:
    """ln u of a flight at even steps of z, the ln u that it has with the asymptotic variance; cubic between them.

    Args:
        start: z of the first node; before it, u is in proportion to exp(z).
        step: in z.
        ln_flight: (n,) float64.
        slope: (n,) float64, d ln u / dz.
        largest_exponent: of E = -ln xi; beyond it the flight escapes.
    """

    start: float
    step: float
    ln_flight: np.ndarray
    slope: np.ndarray
    largest_exponent: float


def variance_ratio(hurst: float, tau: ArrayLike) -> np.ndarray:
    """R(tau): the exact line variance over the asymptotic one, at tau = t/L > 0; 1 - O(tau^min(1, 2H)) for small tau.

    Supplement, (11) over (13): ((1+tau)^n - tau^n - 1) / (n tau) - tau^(2H) / n with n = 2H + 2, which is written so
    that nothing cancels for small tau.
    """
    return _variance_terms(hurst, np.asarray(tau, dtype=np.float64))[0]


def local_exponent(hurst: float, tau: ArrayLike) -> np.ndarray:
    """beta = 1 + d ln v / d ln t at tau = t/L > 0, which takes the place of b = 1."""
    return _variance_terms(hurst, np.asarray(tau, dtype=np.float64))[1]


def line_exponent(line: ExactFbm, u: ArrayLike) -> np.ndarray:
    """f(u) = u l(y(u)) at mean optical depths u > 0."""
    return _derivatives(line, u)[0]


def line_exponent_d1(line: ExactFbm, u: ArrayLike) -> np.ndarray:
    """f'(u) = (1-beta) l(y) + beta / (1+y)."""
    return _derivatives(line, u)[1]


def line_exponent_d2(line: ExactFbm, u: ArrayLike) -> np.ndarray:
    """f''(u): that of a constant b = beta, less m(y) y / u times the slope of beta in ln u."""
    return _derivatives(line, u)[2]


def eval_kernels(line: ExactFbm, u: ArrayLike) -> KernelValues:
    """The four transport kernels at u > 0; -Tr'(0) is 1."""
    return compose_kernels(*_derivatives(line, u), 1.0)


def falls_until(line: ExactFbm) -> float:
    """The u up to which the law holds: ten outer scales at most, and as far as Tr falls.

    It counts as falling where its slope is over three tenths of what the asymptotic variance makes it.
    Tr is convex that far too, so that Tmm is a density: -Tr' vanishes before its slope changes sign.
    """
    u = SEARCHED * line.outer_depth
    y = line.kappa * u * variance_ratio(line.hurst, SEARCHED)
    stops = line_exponent_d1(line, u) * (1 + y) <= STILL_FALLS
    return float(u[np.argmax(stops)] if stops.any() else u[-1])


def tabulate_flights(line: ExactFbm, farthest: float, *, from_medium: bool) -> FlightTable:
    """Flights up to u = `farthest`, at which Tr must still fall: as Tmm from a medium vertex, else as Tsm."""

    def exponent(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """E and its slope in u: of Tr, or of Tms = Tr f'."""
        f, d1, d2 = _derivatives(line, u)
        return (f - np.log(d1), d1 - d2 / d1) if from_medium else (f, d1)

    # With the asymptotic variance, E is this times log1p(kappa u) / kappa.
    shortening = 1 + line.kappa if from_medium else 1.0
    largest = min(float(exponent(np.array(farthest))[0]), LARGEST_EXPONENT)
    # At least a node and its successor, however near the farthest is.
    start = np.log(min(SHORTEST_FLIGHT, largest / 2) / shortening)
    stop = np.log(largest / shortening) + log_expm1_ratio(np.array(line.kappa * largest / shortening))[0]
    nodes, step = np.linspace(start, stop, int((stop - start) * NODES_PER_UNIT) + 2, retstep=True)
    plain = line.kappa * np.exp(nodes)
    wanted = shortening * np.log1p(plain) / line.kappa
    low, high = nodes - LARGEST_SHIFT, np.minimum(nodes + LARGEST_SHIFT, np.log(farthest))
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        is_short = exponent(np.exp(middle))[0] < wanted
        low, high = np.where(is_short, middle, low), np.where(is_short, high, middle)
    u = np.exp((low + high) / 2)
    slope = shortening * np.exp(nodes) / ((1 + plain) * u * exponent(u)[1])
    return FlightTable(float(start), float(step), np.log(u), slope, largest)


def _derivatives(line: ExactFbm, u: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    u = np.asarray(u, dtype=np.float64)
    ratio, beta, beta_slope = _variance_terms(line.hurst, u / line.outer_depth)
    y = line.kappa * u * ratio
    value, slope = log1p_ratio(y), log1p_ratio_slope(y)
    d1 = (1 - beta) * value + beta / (1 + y)
    d2 = -y / u * (beta * ((1 - beta) * slope + beta / (1 + y) ** 2) + slope * beta_slope)
    return u * value, d1, d2


def _variance_terms(hurst: float, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """R, beta = 1 + d ln R / d ln tau, and d beta / d ln tau.

    R is the difference of a = ((1+tau)^n - 1) / (n tau) and c = tau^(2H) (1 + tau) / n.
    """
    n = 2 * hurst + 2
    ln_longer = np.log1p(tau)
    a = np.expm1(n * ln_longer) / (n * tau)
    longer = np.exp((n - 1) * ln_longer)
    a1 = longer - a
    a2 = (n - 1) * tau * longer / (1 + tau) - a1
    power = tau ** (2 * hurst) / n
    c, c1 = power * (1 + tau), power * (2 * hurst + (n - 1) * tau)
    c2 = power * ((2 * hurst) ** 2 + (n - 1) ** 2 * tau)
    ratio = a - c
    growth = (a1 - c1) / ratio
    return ratio, 1 + growth, (a2 - c2) / ratio - growth**2
