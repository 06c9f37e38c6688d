"""The transmittance law, its transport kernels and samplers in float32; twin of `theory/kernels.py`.

u is the mean optical depth sigma_m t >= 0. Error bounds are asserted by `tests/contracts/test_law_device.py`
against 50-digit values over kappa and u from 1e-8 to 1e8.
"""

import warp as wp

from fgf_warp.device.numerics import exp_bounded, exp_or_zero, expm1_ratio, log_positive
from fgf_warp.device.tables import Flights, Table

EXPONENTIAL = wp.constant(0)
"""b = 0 or kappa = 0: exp(-rate u)."""
POWER = wp.constant(1)
"""b = 1: (1 + kappa u)^(-1/kappa)."""
FRACTIONAL = wp.constant(2)
"""Any other b."""
EXACT_FBM = wp.constant(3)
"""b = 1, with the variance of finite segments: see `device/fbm.py`."""

NOT_FROZEN = wp.constant(-1.0)
"""Stands for the rate of a path that no rate was drawn for."""
ESCAPED = wp.constant(1.0e30)
"""Saturated flight, beyond every scene."""
LN_LARGEST = wp.constant(84.0)
"""exp of it is still finite in float32, and beyond ESCAPED."""
LARGE_LN_Y = wp.constant(16.0)
"""Above it 1 + y = y in float32, and y need not be formed."""
TINY_U = wp.constant(1.0e-37)

FIT_DEGREE = wp.constant(13)
FIT_PAIRS = wp.constant(6)
Fit = wp.types.vector(length=14, dtype=wp.float32)


@wp.struct
class Law:
    """The line law of one medium."""

    kind: int
    b: float
    kappa: float
    ln_kappa: float
    rate: float
    """-Tr'(0) of the exponential kind."""
    reciprocal: int
    """1: flights between medium vertices are Tmm and connections Tms, unless frozen; 0 (renewal): Tsm and Tss."""
    fit_offset: float
    """ln(kappa (1-b) / 2)."""
    fit_bend: float
    fit_scale: float
    fit: Fit
    """Of `theory.kernels.fit_flight`; these are used by the fractional kind."""
    rates: Table
    """Of frozen paths: rows (cumulative weight, rate)."""
    two_hurst: float
    """2H."""
    outer_depth: float
    """sigma_m L."""
    flights: Flights
    flights_from_medium: Flights
    """These are used by the exact fBm."""


@wp.func(inline=True)
def log1p_ratio(y: float) -> float:
    """l(y) = log1p(y) / y, y >= 0; relative error below 5e-7."""
    small = wp.min(y, 1.0)
    large = wp.max(y, 1.0)
    z = small / (2.0 + small)
    z2 = z * z
    odd = z2 / 13.0 + z2 * z2 / 15.0
    odd = z2 * (1.0 / 3.0 + z2 * (1.0 / 5.0 + z2 * (1.0 / 7.0 + z2 * (1.0 / 9.0 + z2 * (1.0 / 11.0 + odd)))))
    return wp.where(y >= 1.0, log_positive(1.0 + large) / large, (1.0 - z) * (1.0 + odd))


@wp.func
def log1p_ratio_slope(y: float) -> float:
    """m(y) = -l'(y), y >= 0; relative error below 2e-6."""
    if y >= 1.0:
        return (wp.log(1.0 + y) / y - 1.0 / (1.0 + y)) / y
    z = y / (2.0 + y)
    z2 = z * z
    odd = z2 / 13.0 + z2 * z2 / 15.0
    odd = 1.0 / 3.0 + z2 * (1.0 / 5.0 + z2 * (1.0 / 7.0 + z2 * (1.0 / 9.0 + z2 * (1.0 / 11.0 + odd))))
    return 0.5 * (1.0 - z) * (1.0 - z) * (1.0 / (1.0 + z) + z * odd)


@wp.func(inline=True)
def ln_y(law: Law, u: float) -> float:
    """ln(kappa u^b)."""
    return law.ln_kappa + law.b * log_positive(wp.max(u, TINY_U))


@wp.func(inline=True)
def exponent_of(y: float, u: float) -> float:
    """f(u) of y = kappa u^b."""
    return u * log1p_ratio(y)


@wp.func(inline=True)
def exponent_d1_of(law: Law, y: float) -> float:
    """f'(u) of y = kappa u^b."""
    return (1.0 - law.b) * log1p_ratio(y) + law.b / (1.0 + y)


@wp.func(inline=True)
def line_exponent(law: Law, u: float) -> float:
    """f(u) = -ln Tr(u); relative error below 1e-5."""
    return wp.where(law.kind == EXPONENTIAL, law.rate * u, exponent_of(exp_bounded(ln_y(law, u)), u))


@wp.func(inline=True)
def line_exponent_d1(law: Law, u: float) -> float:
    """f'(u); relative error below 1e-5."""
    return wp.where(law.kind == EXPONENTIAL, law.rate, exponent_d1_of(law, exp_bounded(ln_y(law, u))))


@wp.func
def line_exponent_d2(law: Law, u: float) -> float:
    """f''(u) for u > 0; relative error below 2e-5."""
    if law.kind == EXPONENTIAL:
        return 0.0
    w = ln_y(law, u)
    a = 1.0 - law.b
    if w >= LARGE_LN_Y:
        return -law.b / u * (a * (w - 1.0) + law.b) * wp.exp(-w)
    y = wp.exp(w)
    return -law.b / u * y * (a * log1p_ratio_slope(y) + law.b / ((1.0 + y) * (1.0 + y)))


@wp.func(inline=True)
def initial_rate(law: Law) -> float:
    """-Tr'(0) for b >= 0."""
    return wp.where(law.kind == EXPONENTIAL, law.rate, 1.0)


@wp.func(inline=True)
def transmittance_ss(law: Law, u: float) -> float:
    """Tss = Tr(u); relative error below 1e-6 + 1e-5 f(u)."""
    return exp_or_zero(-line_exponent(law, u))


@wp.func(inline=True)
def density_sm(law: Law, u: float) -> float:
    """Tsm = -Tr'(u); relative error below 1e-5 (1 + f(u))."""
    return line_exponent_d1(law, u) * transmittance_ss(law, u)


@wp.func(inline=True)
def transmittance_ms(law: Law, u: float) -> float:
    """Tms = Tr'(u) / Tr'(0), b >= 0; relative error below 1e-5 (1 + f(u))."""
    return density_sm(law, u) / initial_rate(law)


@wp.func
def density_mm(law: Law, u: float) -> float:
    """Tmm = Tr''(u) / -Tr'(0), b >= 0; relative error below 2e-5 + 1e-5 f(u)."""
    d1 = line_exponent_d1(law, u)
    d2 = line_exponent_d2(law, wp.max(u, TINY_U))
    return (d1 * d1 - d2) * transmittance_ss(law, u) / initial_rate(law)


@wp.func(inline=True)
def segment_transmittance(law: Law, u: float, from_medium: bool) -> float:
    """Share of light that passes a segment which ends uncorrelated: Tms from a medium vertex, else Tss."""
    passed = transmittance_ss(law, u)
    shortens = from_medium and law.reciprocal == 1
    return wp.where(shortens, passed * line_exponent_d1(law, u) / initial_rate(law), passed)


@wp.func(inline=True)
def flight_density(law: Law, u: float, from_medium: bool) -> float:
    """Density in u of the next scattering event: Tmm from a medium vertex, else Tsm."""
    if from_medium and law.reciprocal == 1:
        return density_mm(law, u)
    return density_sm(law, u)


@wp.func(inline=True)
def frozen_transmittance(rate: float, u: float) -> float:
    """Of a path that is classical at this rate >= 0; relative error below 1e-6 (1 + rate u)."""
    return exp_or_zero(-rate * u)


@wp.func(inline=True)
def frozen_density(rate: float, u: float) -> float:
    """Density in u of the next scattering event of such a path."""
    return rate * frozen_transmittance(rate, u)


@wp.func(inline=True)
def sample_frozen(rate: float, exponent: float) -> float:
    """Its flight u from E, at most ESCAPED."""
    return wp.min(exponent / wp.max(rate, TINY_U), ESCAPED)


@wp.func(inline=True)
def ln_flight(law: Law, exponent: float) -> float:
    """ln u of Tsm from E > 0; absolute error below 1.2e-4."""
    ln_exponent = log_positive(wp.max(exponent, TINY_U))
    guess = log_positive(1.0 + exp_bounded(law.fit_offset + law.b * ln_exponent))
    t = wp.min(law.fit_scale * guess / (guess + law.fit_bend) - 1.0, 1.0)
    # The even and the odd powers apart: two short chains instead of a long one.
    t2 = t * t
    even = law.fit[FIT_DEGREE - 1]
    odd = law.fit[FIT_DEGREE]
    for k in range(FIT_PAIRS):
        even = even * t2 + law.fit[FIT_DEGREE - 3 - 2 * k]
        odd = odd * t2 + law.fit[FIT_DEGREE - 2 - 2 * k]
    return ln_exponent + (even + t * odd) * guess


@wp.func(inline=True)
def ln_decorrelation(law: Law, xi2: float, xi3: float) -> float:
    """ln u of a variate whose survival is f': the smaller of it and one of Tsm is distributed as Tmm."""
    r = wp.where(xi3 < law.b, 1.0, wp.max((xi3 - law.b) / wp.max(1.0 - law.b, 1.0e-6), 1.0e-10))
    return (log_positive((1.0 - xi2) / (xi2 * r)) - law.ln_kappa) / law.b


@wp.func(inline=True)
def flight_of_ln(ln_u: float) -> float:
    """u, at most ESCAPED, and 0 below the least that is a normal float32."""
    return wp.min(exp_or_zero(wp.min(ln_u, LN_LARGEST)), ESCAPED)


@wp.func(inline=True)
def sample_power(law: Law, exponent: float, remembers: bool) -> float:
    """u of the power law from E: as Tmm where the flight remembers its medium vertex, else as Tsm."""
    shortened = wp.where(remembers, exponent / (1.0 + law.kappa), exponent)
    return wp.min(shortened * expm1_ratio(law.kappa * shortened), ESCAPED)


@wp.func(inline=True)
def sample_sm(law: Law, xi: float) -> float:
    """u distributed as Tsm; relative error below 1.2e-4 and mostly 1e-5."""
    exponent = -log_positive(xi)
    if law.kind == EXPONENTIAL:
        return wp.min(exponent / law.rate, ESCAPED)
    if law.kind == POWER:
        return sample_power(law, exponent, False)
    return flight_of_ln(ln_flight(law, exponent))


@wp.func(inline=True)
def sample_mm(law: Law, xi: float, xi2: float, xi3: float) -> float:
    """u distributed as Tmm, 0 <= b <= 1; xi2 and xi3 matter to the fractional kind alone."""
    if law.kind == POWER:
        return sample_power(law, -log_positive(xi), True)
    if law.kind == EXPONENTIAL:
        return sample_sm(law, xi)
    return flight_of_ln(wp.min(ln_flight(law, -log_positive(xi)), ln_decorrelation(law, xi2, xi3)))
