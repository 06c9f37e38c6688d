"""The transmittance law, its four transport kernels and their samplers, in float64.

All take (b, kappa) of `LineLaw` and the mean optical depth u = sigma_m t, as scalars or broadcastable arrays.
`device/law.py` holds the float32 twins under the same names. Kernels: Bitterli et al. 2018, d'Eon 2018;
the line law: Guo et al. 2019, supplement, equation (4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

SERIES_TERMS = 20
"""Of the series in z = y / (2 + y) <= 1/3: (1/9)^20 is below double precision."""
FIT_DEGREE = 13
"""With 5 a render of sphere takes 0.99 of the time, and with 27 1.02 of it, while ln u is wrong by up to 3e-3 and 9e-5
in place of 1e-4. So it is no setting."""
FIT_NODES = 200
FIT_LARGEST_Q = 40.0
"""Of q = ln kappa + b ln E, with kappa up to 1e8 and E from 6e-8 to 23."""
FIT_LARGEST_S = 90.5
"""Where ln(u/E) = 86: farther flights have escaped in float32."""


@dataclass(frozen=True, eq=False)
class FlightFit:
    """ln(u/E) of flights of Tsm as a function of q = ln kappa + b ln E, for one b.

    With L = ln(1 + (1-b)/2 exp(q)) it is L times a polynomial in t = scale L / (L + bend) - 1, from -1 to 1.

    Args:
        bend: of the variable.
        scale: of the variable.
        coefficients: (14,) float64, from the constant on.
    """

    bend: float
    scale: float
    coefficients: np.ndarray


def log1p_ratio(y: ArrayLike) -> np.ndarray:
    """l(y) = log1p(y) / y for y >= 0, l(0) = 1."""
    y = np.asarray(y, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(y > 0, np.log1p(y) / y, 1.0)


def log1p_ratio_slope(y: ArrayLike) -> np.ndarray:
    """m(y) = -l'(y) = (l(y) - 1/(1+y)) / y for y >= 0, m(0) = 1/2; by a series below y = 1."""
    y = np.asarray(y, dtype=np.float64)
    z = np.where(y < 1, y / (2 + y), 0.0)
    odd = sum(z ** (2 * k) / (2 * k + 3) for k in range(SERIES_TERMS))
    series = (1 - z) ** 2 / 2 * (1 / (1 + z) + z * odd)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(y < 1, series, (log1p_ratio(y) - 1 / (1 + y)) / y)


def line_exponent(b: ArrayLike, kappa: ArrayLike, u: ArrayLike) -> np.ndarray:
    """f(u) = -ln Tr(u) = u l(kappa u^b)."""
    return np.asarray(u) * log1p_ratio(_y(b, kappa, u))


def line_exponent_d1(b: ArrayLike, kappa: ArrayLike, u: ArrayLike) -> np.ndarray:
    """f'(u) = (1-b) l(y) + b / (1+y)."""
    y = _y(b, kappa, u)
    return (1 - np.asarray(b)) * log1p_ratio(y) + np.asarray(b) / (1 + y)


def line_exponent_d2(b: ArrayLike, kappa: ArrayLike, u: ArrayLike) -> np.ndarray:
    """f''(u) = -(b/u) y [(1-b) m(y) + b/(1+y)^2]."""
    b, y = np.asarray(b), _y(b, kappa, u)
    return -b / np.asarray(u) * y * ((1 - b) * log1p_ratio_slope(y) + b / (1 + y) ** 2)


def initial_rate(b: ArrayLike, kappa: ArrayLike) -> np.ndarray:
    """-Tr'(0): 1 for b > 0, l(kappa) for b = 0, 0 for b < 0 (1 where kappa = 0)."""
    b, kappa = np.asarray(b), np.asarray(kappa)
    return np.where((b > 0) | (kappa == 0), 1.0, np.where(b == 0, log1p_ratio(kappa), 0.0))


@dataclass(frozen=True, eq=False)
class KernelValues:
    """The four transport kernels at some optical depths.

    Args:
        transmittance_ss: Tss.
        density_sm: Tsm.
        transmittance_ms: Tms.
        density_mm: Tmm.
    """

    transmittance_ss: np.ndarray
    density_sm: np.ndarray
    transmittance_ms: np.ndarray
    density_mm: np.ndarray


def compose_kernels(f: np.ndarray, d1: np.ndarray, d2: np.ndarray, rate: ArrayLike) -> KernelValues:
    """The kernels of f = -ln Tr, its two derivatives and -Tr'(0)."""
    passed = np.exp(-f)
    return KernelValues(passed, d1 * passed, d1 * passed / rate, (d1**2 - d2) * passed / rate)


def transmittance_ss(b: ArrayLike, kappa: ArrayLike, u: ArrayLike) -> np.ndarray:
    """Tss = Tr(u), between two uncorrelated ends."""
    return np.exp(-line_exponent(b, kappa, u))


def density_sm(b: ArrayLike, kappa: ArrayLike, u: ArrayLike) -> np.ndarray:
    """Tsm = -Tr'(u), the free-flight density in u from an uncorrelated end."""
    return line_exponent_d1(b, kappa, u) * transmittance_ss(b, kappa, u)


def transmittance_ms(b: ArrayLike, kappa: ArrayLike, u: ArrayLike) -> np.ndarray:
    """Tms = Tr'(u) / Tr'(0), from a medium vertex to an uncorrelated end; b >= 0."""
    return density_sm(b, kappa, u) / initial_rate(b, kappa)


def density_mm(b: ArrayLike, kappa: ArrayLike, u: ArrayLike) -> np.ndarray:
    """Tmm = Tr''(u) / -Tr'(0), the free-flight density between medium vertices; b >= 0."""
    return eval_kernels(b, kappa, u).density_mm


def eval_kernels(b: ArrayLike, kappa: ArrayLike, u: ArrayLike) -> KernelValues:
    """The four transport kernels at u > 0; those of medium vertices are NaN or infinite for b < 0."""
    f, d1, d2 = (derivative(b, kappa, u) for derivative in (line_exponent, line_exponent_d1, line_exponent_d2))
    with np.errstate(divide="ignore", invalid="ignore"):
        return compose_kernels(f, d1, d2, initial_rate(b, kappa))


def flight_from_exponent(b: ArrayLike, kappa: ArrayLike, exponent: ArrayLike) -> np.ndarray:
    """The u with f(u) = E, for E > 0: u = E expm1(s) / s with ln s + (1-b) ln(expm1(s)/s) = ln kappa + b ln E."""
    exponent = np.asarray(exponent, dtype=np.float64)
    kappa = np.asarray(kappa, dtype=np.float64)
    with np.errstate(divide="ignore", over="ignore"):
        q = np.log(kappa) + np.asarray(b) * np.log(exponent)
        return np.where(kappa > 0, exponent * np.exp(flight_log_ratio(b, q)[0]), exponent)


def sample_sm(b: ArrayLike, kappa: ArrayLike, xi: ArrayLike) -> np.ndarray:
    """u distributed as Tsm, from xi uniform in (0, 1): Tr(u) = xi."""
    return flight_from_exponent(b, kappa, -np.log(xi))


def sample_mm(b: ArrayLike, kappa: ArrayLike, xi: ArrayLike, xi2: ArrayLike, xi3: ArrayLike) -> np.ndarray:
    """u distributed as Tmm for 0 <= b <= 1, from three uniforms in (0, 1).

    Tms = Tr f' is a product of survival functions, so u is the smaller of two independent variates: one from
    Tsm, one whose survival f' is a mixture of 1/(1 + r y) over r (r = 1 with probability b, else uniform).
    """
    b = np.asarray(b, dtype=np.float64)
    xi3 = np.asarray(xi3, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        r = np.where(xi3 < b, 1.0, (xi3 - b) / (1 - b))
        second = np.exp((np.log((1 - np.asarray(xi2)) / (np.asarray(xi2) * r)) - np.log(kappa)) / b)
    correlated = (b > 0) & (np.asarray(kappa) > 0)
    first = sample_sm(b, kappa, xi)
    return np.where(correlated, np.minimum(first, second), first)


def flight_log_ratio(b: ArrayLike, q: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """ln(u/E) as a function of q = ln kappa + b ln E, and its slope in q; accurate to 1e-14 absolute.

    Newton's method in x = ln s on x + (1-b) h(x) = q, h = ln(expm1(s)/s), convex and increasing, from the right.

    Raises:
        ArithmeticError: if it has not converged.
    """
    a, q = np.broadcast_arrays(1.0 - np.asarray(b, dtype=np.float64), np.asarray(q, dtype=np.float64))
    with np.errstate(divide="ignore"):
        x = np.minimum(q, np.where(a > 0, np.log((np.maximum(q, 0.0) + 4.0) / np.maximum(a, 1e-300)), q))
    for _ in range(100):
        h, growth = log_expm1_ratio(np.exp(x))
        step = (x + a * h - q) / (1 + a * growth)
        x = x - step
        if np.all(np.abs(step) <= 4e-16 * np.maximum(1.0, np.abs(x))):
            break
    else:
        if np.any(np.abs(step) > 1e-14 * np.maximum(1.0, np.abs(x))):
            raise ArithmeticError("the inversion of the line law did not converge")
    h, growth = log_expm1_ratio(np.exp(x))
    return h, growth / (1 + a * growth)


def fit_flight(b: float) -> FlightFit:
    """The fit for one b < 1, b != 0: accurate to 1e-4 absolute, and for b <= 0.95 to 4e-5.

    L is the first guess of section 6 of the theory for the s of `flight_log_ratio`; the ratio of both is smooth, and
    in L / (L + bend) it is nearly a polynomial. Least squares at Chebyshev nodes.
    """
    a = 1 - b
    bend = min(7.0, 12 * a)
    largest_h = log_expm1_ratio(np.array(FIT_LARGEST_S))[0]
    largest_l = np.logaddexp(0, np.log(a / 2) + min(np.log(FIT_LARGEST_S) + a * largest_h, FIT_LARGEST_Q))
    scale = float(2 * (largest_l + bend) / largest_l)
    t = chebyshev.chebpts1(FIT_NODES)
    x = (t + 1) / scale
    guess = bend * x / (1 - x)
    ratio = flight_log_ratio(b, np.log(np.expm1(guess)) - np.log(a / 2))[0] / guess
    fitted = chebyshev.chebfit(t, ratio, FIT_DEGREE, w=np.maximum(guess, 0.01))
    return FlightFit(bend, scale, chebyshev.cheb2poly(fitted))


def mean_free_path(b: float, kappa: float) -> float:
    """Mean of u under -Tr', the integral of Tr; infinite for b = 1, kappa >= 1.

    The trapezoidal rule in ln u, which for this integrand converges faster than any power of the step.
    """
    if kappa == 0:
        return 1.0
    if b == 0:
        return float(1.0 / log1p_ratio(kappa))
    if b == 1:
        return 1.0 / (1.0 - kappa) if kappa < 1 else np.inf
    step = 1.0 / 64.0
    with np.errstate(over="ignore"):
        upper = np.log(flight_from_exponent(b, kappa, 750.0))
        x = np.arange(-45.0, upper + step, step)
        return float(np.exp(x - line_exponent(b, kappa, np.exp(x))).sum() * step)


def _y(b: ArrayLike, kappa: ArrayLike, u: ArrayLike) -> np.ndarray:
    with np.errstate(divide="ignore", over="ignore"):
        return np.asarray(kappa, dtype=np.float64) * np.asarray(u, dtype=np.float64) ** np.asarray(b)


def log_expm1_ratio(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """h = ln(expm1(s)/s), and dh/d(ln s) = s / (1 - exp(-s)) - 1; by series below s = 0.02."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        large_h = s + np.log(-np.expm1(-s) / s)
        large_growth = s / -np.expm1(-s) - 1
    small_h = s / 2 + s**2 / 24 - s**4 / 2880 + s**6 / 181440
    small_growth = s / 2 + s**2 / 12 - s**4 / 720 + s**6 / 30240
    return np.where(s < 0.02, small_h, large_h), np.where(s < 0.02, small_growth, large_growth)
