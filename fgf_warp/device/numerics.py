"""Elementary functions that Warp lacks or that must not lose digits."""

import warp as wp

PI = wp.constant(3.14159265358979)
INV_4PI = wp.constant(0.0795774715459477)
INFINITE = wp.constant(3.0e38)
"""Stands for an unbounded distance; finite so that no arithmetic on it makes a NaN."""


@wp.func
def expm1_ratio(x: float) -> float:
    """expm1(x) / x for x >= 0; relative error below 5e-7, infinite above x = 88."""
    if x < 0.4:
        return 1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * (1.0 + x / 6.0 * (1.0 + x / 7.0)))))
    return (wp.exp(x) - 1.0) / x


@wp.func
def orthonormal_tangent(n: wp.vec3) -> wp.vec3:
    """A unit vector perpendicular to the unit vector n (Duff et al. 2017, without its singularity)."""
    sign = wp.where(n[2] >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + n[2])
    return wp.vec3(1.0 + sign * n[0] * n[0] * a, sign * n[0] * n[1] * a, -sign * n[0])


@wp.func
def turn(axis: wp.vec3, one_minus_cos: float, azimuth: float) -> wp.vec3:
    """The unit vector at an angle theta from the unit vector `axis`, from 1 - cos(theta) in [0, 2].

    1 - cos(theta) rather than cos(theta), so that angles below 1e-4 keep their digits.
    """
    tangent = orthonormal_tangent(axis)
    bitangent = wp.cross(axis, tangent)
    sin_theta = wp.sqrt(wp.max(one_minus_cos * (2.0 - one_minus_cos), 0.0))
    across = tangent * wp.cos(azimuth) + bitangent * wp.sin(azimuth)
    return wp.normalize(axis * (1.0 - one_minus_cos) + across * sin_theta)


@wp.func
def one_minus_cos_between(a: wp.vec3, b: wp.vec3) -> float:
    """1 - dot(a, b) of unit vectors, from their difference, so that small angles keep their digits."""
    return 0.5 * wp.length_sq(a - b)


@wp.func
def max_component(v: wp.vec3) -> float:
    """The largest component."""
    return wp.max(v[0], wp.max(v[1], v[2]))


@wp.func
def is_finite(v: wp.vec3) -> bool:
    """True where no component is a NaN or infinite."""
    return wp.isfinite(v[0]) and wp.isfinite(v[1]) and wp.isfinite(v[2])
