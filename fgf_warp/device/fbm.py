"""Fractional Brownian motion with the exact variance of a finite segment, in float32; twin of `theory/fbm.py`.

Of the law, kappa is that of the asymptotic variance, and b is 1. Error bounds are asserted by
`tests/contracts/test_fbm.py` for t/L from 1e-6 to 10.
"""

import warp as wp

from fgf_warp.device.law import LN_LARGEST, TINY_U, Law, flight_of_ln, log1p_ratio, log1p_ratio_slope
from fgf_warp.device.numerics import exp_bounded, exp_or_zero, expm1_ratio, log_positive


@wp.func(inline=True)
def variance_terms(two_hurst: float, tau: float) -> wp.vec3:
    """R, beta = 1 + d ln R / d ln tau, and d beta / d ln tau at tau = t/L; absolute errors below 2e-6, 1e-5, 4e-5."""
    n = two_hurst + 2.0
    ln_longer = tau * log1p_ratio(tau)
    a = expm1_ratio(n * ln_longer) * log1p_ratio(tau)
    longer = exp_bounded((n - 1.0) * ln_longer)
    a1 = longer - a
    a2 = (n - 1.0) * tau * longer / (1.0 + tau) - a1
    power = exp_bounded(two_hurst * log_positive(wp.max(tau, TINY_U))) / n
    c1 = power * (two_hurst + (n - 1.0) * tau)
    c2 = power * (two_hurst * two_hurst + (n - 1.0) * (n - 1.0) * tau)
    ratio = a - power * (1.0 + tau)
    growth = (a1 - c1) / ratio
    return wp.vec3(ratio, 1.0 + growth, (a2 - c2) / ratio - growth * growth)


@wp.func(inline=True)
def line_exponent(law: Law, u: float) -> float:
    """f(u) = -ln Tr(u); relative error below 1e-5."""
    return u * log1p_ratio(law.kappa * u * variance_terms(law.two_hurst, u / law.outer_depth)[0])


@wp.func(inline=True)
def line_exponent_d1(law: Law, u: float) -> float:
    """f'(u); relative error below 1e-4 as far as Tr falls."""
    terms = variance_terms(law.two_hurst, u / law.outer_depth)
    y = law.kappa * u * terms[0]
    return (1.0 - terms[1]) * log1p_ratio(y) + terms[1] / (1.0 + y)


@wp.func(inline=True)
def line_exponent_d2(law: Law, u: float) -> float:
    """f''(u) for u > 0; relative error below 1e-3 as far as Tr falls."""
    terms = variance_terms(law.two_hurst, u / law.outer_depth)
    y = law.kappa * u * terms[0]
    slope = log1p_ratio_slope(y)
    constant = terms[1] * ((1.0 - terms[1]) * slope + terms[1] / ((1.0 + y) * (1.0 + y)))
    return -y / u * (constant + slope * terms[2])


@wp.func(inline=True)
def segment_transmittance(law: Law, u: float, from_medium: bool) -> float:
    """Share of light that passes a segment which ends uncorrelated: Tms from a medium vertex, else Tss."""
    passed = exp_or_zero(-line_exponent(law, u))
    if from_medium and law.reciprocal == 1:
        return passed * line_exponent_d1(law, u)
    return passed


@wp.func(inline=True)
def flight_density(law: Law, u: float, from_medium: bool) -> float:
    """Density in u of the next scattering event: Tmm from a medium vertex, else Tsm."""
    passed = exp_or_zero(-line_exponent(law, u))
    d1 = line_exponent_d1(law, u)
    if from_medium and law.reciprocal == 1:
        return (d1 * d1 - line_exponent_d2(law, wp.max(u, TINY_U))) * passed
    return d1 * passed


@wp.func(inline=True)
def sample_flight(law: Law, tables: wp.array(dtype=wp.vec3), xi: float, from_medium: bool) -> float:
    """u distributed as Tmm from a medium vertex, else as Tsm; relative error below 1e-3, and mostly 1e-5."""
    remembers = from_medium and law.reciprocal == 1
    ln_u = ln_asymptotic_flight(law, -log_positive(xi), remembers)
    return flight_of_ln(look_up_flight(law, tables, ln_u, remembers))


@wp.func(inline=True)
def ln_asymptotic_flight(law: Law, exponent: float, remembers: bool) -> float:
    """ln u of E with the asymptotic variance, and LN_LARGEST where E is beyond the exact flights."""
    largest = wp.where(remembers, law.flights_from_medium.largest_exponent, law.flights.largest_exponent)
    shortened = wp.where(remembers, exponent / (1.0 + law.kappa), exponent)
    ln_u = log_positive(wp.max(shortened, TINY_U)) + log_positive(expm1_ratio(law.kappa * shortened))
    return wp.where(exponent > largest, LN_LARGEST, ln_u)


@wp.func(inline=True)
def look_up_flight(law: Law, tables: wp.array(dtype=wp.vec3), ln_asymptotic: float, remembers: bool) -> float:
    """ln u of the exact flight."""
    if ln_asymptotic == LN_LARGEST:
        return LN_LARGEST
    flights = law.flights
    if remembers:
        flights = law.flights_from_medium
    place = wp.max((ln_asymptotic - flights.start) / flights.step, 0.0)
    row = wp.min(int(place), flights.table.count - 2)
    low = tables[flights.table.first + row]
    high = tables[flights.table.first + row + 1]
    # Hermite's cubic, about the straight line between the rows (ln u, slope).
    t = place - float(row)
    rise = high[0] - low[0]
    bend = (1.0 - t) * (flights.step * low[1] - rise) - t * (flights.step * high[1] - rise)
    before = wp.min(ln_asymptotic - flights.start, 0.0)
    return low[0] + t * rise + t * (1.0 - t) * bend + before
