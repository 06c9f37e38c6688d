"""Elementary functions that Warp lacks, that must not lose digits, or that loops over lanes can vectorise.

What a lane pool calls (`integrator/pool_stages.py`) is without calls into the C library and without branches that carry
vectors, since both keep a loop scalar: hence `log_positive`, `exp_bounded`, `sincos_turns`, `unit` and `choose`.
"""

import warp as wp

PI = wp.constant(3.14159265358979)
INV_4PI = wp.constant(0.0795774715459477)
INFINITE = wp.constant(3.0e38)
"""Stands for an unbounded distance; finite so that no arithmetic on it makes a NaN."""

LARGEST = wp.constant(3.4028234e38)
"""Of float32."""


@wp.func(inline=True)
def choose(condition: bool, a: wp.vec3, b: wp.vec3) -> wp.vec3:
    """`wp.where` of each component."""
    return wp.vec3(wp.where(condition, a[0], b[0]), wp.where(condition, a[1], b[1]), wp.where(condition, a[2], b[2]))


@wp.func(inline=True)
def unit(v: wp.vec3) -> wp.vec3:
    """v / |v|, and 0 for 0."""
    return v * (1.0 / wp.sqrt(wp.max(wp.dot(v, v), 1.0e-37)))


@wp.func(inline=True)
def log_positive(x: float) -> float:
    """ln(x) for normal x > 0; error below 1.5e-7 relative, or 6e-8 absolute near 1 where that is less.

    The mantissa is brought to [sqrt(1/2), sqrt(2)); then 2 artanh(z), z = (m-1)/(m+1), which is exact for x near 1.
    """
    bits = wp.cast(x, wp.int32)
    m = wp.cast((bits & 0x007FFFFF) | 0x3F800000, wp.float32)
    is_upper = m > 1.41421356
    m = wp.where(is_upper, 0.5 * m, m)
    exponent = float((bits >> 23) - 127 + wp.where(is_upper, 1, 0))
    z = (m - 1.0) / (m + 1.0)
    z2 = z * z
    series = 1.0 / 3.0 + z2 * (1.0 / 5.0 + z2 * (1.0 / 7.0 + z2 * (1.0 / 9.0 + z2 / 11.0)))
    return exponent * 0.693145751953125 + (exponent * 1.42860682030941723e-6 + 2.0 * (z + z * z2 * series))


@wp.func(inline=True)
def exp_bounded(x: float) -> float:
    """exp(x), of x limited to [-87, 88]; relative error below 2e-7."""
    limited = wp.clamp(x, -87.0, 88.0)
    n = wp.floor(limited * 1.44269504088896341 + 0.5)
    r = (limited - n * 0.693359375) + n * 2.12194440e-4
    series = 1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0 + r / 5040.0))
    mantissa = 1.0 + (r + r * r * (0.5 + r * (1.0 / 6.0 + r * series)))
    return mantissa * wp.cast((int(n) + 127) << 23, wp.float32)


@wp.func(inline=True)
def exp_or_zero(x: float) -> float:
    """exp(x) for x <= 88, and 0 below -87."""
    return wp.where(x < -87.0, 0.0, exp_bounded(x))


@wp.func(inline=True)
def sincos_turns(turns: float):
    """Sine and cosine of 2 pi `turns`, `turns` in [0, 1]; absolute error below 2e-7."""
    quarter = wp.floor(4.0 * turns + 0.5)
    r = (turns - 0.25 * quarter) * 6.28318530717958648
    r2 = r * r
    s = r * (1.0 + r2 * (-1.0 / 6.0 + r2 * (1.0 / 120.0 + r2 * (-1.0 / 5040.0 + r2 / 362880.0))))
    c = 1.0 + r2 * (-0.5 + r2 * (1.0 / 24.0 + r2 * (-1.0 / 720.0 + r2 / 40320.0)))
    k = int(quarter)
    swapped_s = wp.where((k & 1) == 1, c, s)
    swapped_c = wp.where((k & 1) == 1, s, c)
    sine = wp.where((k & 2) == 2, -swapped_s, swapped_s)
    cosine = wp.where(((k + 1) & 2) == 2, -swapped_c, swapped_c)
    return sine, cosine


@wp.func(inline=True)
def expm1_ratio(x: float) -> float:
    """expm1(x) / x for x >= 0; relative error below 5e-7, and limited to its value at x = 88."""
    series = 1.0 + x / 6.0 * (1.0 + x / 7.0)
    series = 1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * series))
    small = 1.0 + x / 2.0 * series
    return wp.where(x < 0.4, small, (exp_bounded(x) - 1.0) / wp.max(x, 0.4))


@wp.func(inline=True)
def orthonormal_tangent(n: wp.vec3) -> wp.vec3:
    """A unit vector perpendicular to the unit vector n (Duff et al. 2017, without its singularity)."""
    sign = wp.where(n[2] >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + n[2])
    return wp.vec3(1.0 + sign * n[0] * n[0] * a, sign * n[0] * n[1] * a, -sign * n[0])


@wp.func(inline=True)
def rotate_from(axis: wp.vec3, one_minus_cos: float, azimuth: float) -> wp.vec3:
    """The unit vector at an angle theta from the unit vector `axis`, from 1 - cos(theta) in [0, 2].

    1 - cos(theta) rather than cos(theta), so that angles below 1e-4 keep their digits; the azimuth in turns.
    """
    tangent = orthonormal_tangent(axis)
    bitangent = wp.cross(axis, tangent)
    sin_theta = wp.sqrt(wp.max(one_minus_cos * (2.0 - one_minus_cos), 0.0))
    sine, cosine = sincos_turns(azimuth)
    return unit(axis * (1.0 - one_minus_cos) + (tangent * cosine + bitangent * sine) * sin_theta)


@wp.func(inline=True)
def one_minus_cos_between(a: wp.vec3, b: wp.vec3) -> float:
    """1 - dot(a, b) of unit vectors, from their difference, so that small angles keep their digits."""
    return 0.5 * wp.length_sq(a - b)


@wp.func(inline=True)
def max_component(v: wp.vec3) -> float:
    """The largest component."""
    return wp.max(v[0], wp.max(v[1], v[2]))


@wp.func(inline=True)
def is_finite(v: wp.vec3) -> bool:
    """True where no component is a NaN or infinite."""
    # Of a NaN no comparison holds.
    return wp.abs(v[0]) <= LARGEST and wp.abs(v[1]) <= LARGEST and wp.abs(v[2]) <= LARGEST
