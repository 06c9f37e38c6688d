"""The transmittance law, its transport kernels and samplers in float32; twin of `theory/kernels.py`.

u is the mean optical depth sigma_m t >= 0. Error bounds are asserted by `tests/contracts/test_law_device.py`
against 50-digit values over kappa and u from 1e-8 to 1e8.
"""

import warp as wp

from fgf_warp.device.numerics import exp_bounded, exp_or_zero, expm1_ratio, log_positive

EXPONENTIAL = wp.constant(0)
"""b = 0 or kappa = 0: exp(-rate u)."""
POWER = wp.constant(1)
"""b = 1: (1 + kappa u)^(-1/kappa)."""
FRACTIONAL = wp.constant(2)
"""Any other b."""

ESCAPED = wp.constant(1.0e30)
"""Saturated flight, beyond every scene."""
LN_LARGEST = wp.constant(84.0)
"""exp of it times any -ln xi is still finite in float32, and beyond ESCAPED for all but the shortest."""
LARGE_LN_Y = wp.constant(16.0)
"""Above it 1 + y = y in float32, and y need not be formed."""
TINY_U = wp.constant(1.0e-37)

TABLE_MIN = wp.constant(-16.0)
TABLE_STEPS_PER_UNIT = wp.constant(16.0)
TABLE_LAST = wp.constant(896)
"""Layout of `theory.kernels.build_flight_table`; `tests/contracts` holds both together."""


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
    """1: flights between medium vertices are Tmm and connections Tms; 0 (renewal): Tsm and Tss."""
    table: int
    """First row of the medium's flight table; used by the fractional kind."""


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
    return (d1 * d1 - line_exponent_d2(law, u)) * transmittance_ss(law, u) / initial_rate(law)


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
def table_place(law: Law, exponent: float) -> float:
    """Where in the flight table of the law the exponent E falls: row and fraction, within the table."""
    q = law.ln_kappa + law.b * log_positive(wp.max(exponent, TINY_U))
    return wp.clamp((q - TABLE_MIN) * TABLE_STEPS_PER_UNIT, 0.0, float(TABLE_LAST) - 0.001)


@wp.func(inline=True)
def read_table(law: Law, tables: wp.array(dtype=wp.vec2), place: float) -> float:
    """ln(u/E) at a place of the flight table: the chord, and a bend from how far the end slopes are from it."""
    row = int(place)
    t = place - float(row)
    left = tables[law.table + row]
    right = tables[law.table + row + 1]
    chord = right[0] - left[0]
    bend = (left[1] - chord) * (1.0 - t) - (right[1] - chord) * t
    return left[0] + t * chord + t * (1.0 - t) * bend


@wp.func(inline=True)
def fly_fractional(exponent: float, ln_ratio: float) -> float:
    """u from E and ln(u/E), at most ESCAPED."""
    return wp.min(exponent * exp_bounded(wp.min(ln_ratio, LN_LARGEST)), ESCAPED)


@wp.func(inline=True)
def fly_power(law: Law, exponent: float, remembers: bool) -> float:
    """u of the power law from E: as Tmm where the flight remembers its medium vertex, else as Tsm."""
    shortened = wp.where(remembers, exponent / (1.0 + law.kappa), exponent)
    return wp.min(shortened * expm1_ratio(law.kappa * shortened), ESCAPED)


@wp.func(inline=True)
def shorten_fractional(law: Law, first: float, xi2: float, xi3: float) -> float:
    """u of Tmm from u of Tsm: the smaller of it and a second variate, whose survival is f'."""
    r = wp.where(xi3 < law.b, 1.0, wp.max((xi3 - law.b) / wp.max(1.0 - law.b, 1.0e-6), 1.0e-10))
    ln_second = (log_positive((1.0 - xi2) / (xi2 * r)) - law.ln_kappa) / law.b
    return wp.min(first, wp.where(ln_second < -87.0, 0.0, exp_bounded(wp.min(ln_second, LN_LARGEST))))


@wp.func(inline=True)
def flight_from_exponent(law: Law, tables: wp.array(dtype=wp.vec2), exponent: float) -> float:
    """The u with f(u) = E > 0, at most ESCAPED; relative error below 1e-4 and mostly 1e-6."""
    if law.kind == EXPONENTIAL:
        return wp.min(exponent / law.rate, ESCAPED)
    if law.kind == POWER:
        return fly_power(law, exponent, False)
    return fly_fractional(exponent, read_table(law, tables, table_place(law, exponent)))


@wp.func(inline=True)
def sample_sm(law: Law, tables: wp.array(dtype=wp.vec2), xi: float) -> float:
    """u distributed as Tsm."""
    return flight_from_exponent(law, tables, -log_positive(xi))


@wp.func(inline=True)
def sample_mm(law: Law, tables: wp.array(dtype=wp.vec2), xi: float, xi2: float, xi3: float) -> float:
    """u distributed as Tmm, 0 <= b <= 1; xi2 and xi3 matter to the fractional kind alone."""
    if law.kind == POWER:
        return fly_power(law, -log_positive(xi), True)
    first = sample_sm(law, tables, xi)
    if law.kind == EXPONENTIAL:
        return first
    return shorten_fractional(law, first, xi2, xi3)
