"""Distant lights, rects, disks and spheres that shine evenly: many of them are sampled and met at once, in lanes."""

import warp as wp

from fgf_warp.device.geometry import LIGHT, Hit
from fgf_warp.device.lights.data import DISTANT, RECT, SPHERE_LIGHT, Light, LightSample
from fgf_warp.device.numerics import INFINITE, PI, choose, one_minus_cos_between, rotate_from, sincos_turns, unit


@wp.func(inline=True)
def sphere_cone(light: Light, position: wp.vec3) -> float:
    """1 - cos of the half angle under which a sphere light is seen, in [0, 1]; 0 from within."""
    sine_sq = light.radius * light.radius / wp.max(wp.length_sq(light.center - position), 1.0e-37)
    return wp.where(sine_sq < 1.0, sine_sq / (1.0 + wp.sqrt(wp.max(1.0 - sine_sq, 0.0))), 0.0)


@wp.func(inline=True)
def sphere_distance(light: Light, position: wp.vec3, direction: wp.vec3) -> float:
    """Distance to the sphere from outside; INFINITE where the ray misses."""
    to_center = light.center - position
    t_near = wp.dot(to_center, direction)
    half_sq = light.radius * light.radius - wp.length_sq(to_center - direction * t_near)
    outside = wp.length_sq(to_center) > light.radius * light.radius
    meets = half_sq >= 0.0 and t_near >= 0.0 and outside
    return wp.where(meets, t_near - wp.sqrt(wp.max(half_sq, 0.0)), INFINITE)


@wp.func(inline=True)
def cone_pdf(one_minus_cos: float) -> float:
    """pdf_solid_angle [1/sr] of a uniform direction in a cone of this 1 - cos; 0 of a cone without extent."""
    return wp.where(one_minus_cos > 0.0, 1.0 / (2.0 * PI * wp.max(one_minus_cos, 1.0e-12)), 0.0)


@wp.func(inline=True)
def point_on_flat_light(light: Light, kind: int, xi1: float, xi2: float) -> wp.vec3:
    """A uniform point of a rect or disk, from two uniforms."""
    if kind == RECT:
        return light.center + light.half_u * (2.0 * xi1 - 1.0) + light.half_v * (2.0 * xi2 - 1.0)
    radius = wp.sqrt(xi1)
    sine, cosine = sincos_turns(xi2)
    return light.center + light.half_u * (radius * cosine) + light.half_v * (radius * sine)


@wp.func(inline=True)
def flat_light_pdf(light: Light, direction: wp.vec3, distance: float) -> float:
    """pdf_solid_angle [1/sr] of a uniform point of a rect or disk in this direction; 0 from behind.

    Relative error below 1e-4.
    """
    cosine = -wp.dot(light.normal, direction)
    return wp.where(cosine > 1.0e-6, distance * distance / (wp.max(cosine, 1.0e-6) * light.area), 0.0)


@wp.func(inline=True)
def sample_light(light: Light, kind: int, position: wp.vec3, xi1: float, xi2: float) -> LightSample:
    """A direction from `position` towards a light of this kind, from two uniforms.

    Even in solid angle in the cone of a distant light or a sphere, even in area on a rect or disk.
    """
    s = LightSample()
    s.radiance = light.radiance
    if kind == DISTANT:
        is_delta = light.cone == 0.0
        s.distance = INFINITE
        s.only_connected = wp.where(is_delta, 1, 0)
        s.direction = choose(is_delta, light.center, rotate_from(light.center, xi1 * light.cone, xi2))
        s.pdf_solid_angle = wp.where(is_delta, 1.0, cone_pdf(light.cone))
        return s
    if kind == SPHERE_LIGHT:
        cone = sphere_cone(light, position)
        to_center = light.center - position
        s.direction = rotate_from(unit(to_center), xi1 * cone, xi2)
        s.distance = wp.min(sphere_distance(light, position, s.direction), wp.length(to_center))
        s.pdf_solid_angle = cone_pdf(cone)
        return s
    to_light = point_on_flat_light(light, kind, xi1, xi2) - position
    s.distance = wp.length(to_light)
    s.direction = to_light / wp.max(s.distance, 1.0e-30)
    s.pdf_solid_angle = flat_light_pdf(light, s.direction, s.distance)
    return s


@wp.func(inline=True)
def light_pdf(light: Light, kind: int, vertex: wp.vec3, position: wp.vec3, direction: wp.vec3) -> float:
    """pdf_solid_angle [1/sr] with which `sample_light` at `vertex` gives the light's point `position`.

    direction: unit vector from `vertex` to `position`.
    """
    if kind == SPHERE_LIGHT:
        return cone_pdf(sphere_cone(light, vertex))
    return flat_light_pdf(light, direction, wp.length(position - vertex))


@wp.func(inline=True)
def is_in_distant_light(light: Light, direction: wp.vec3) -> bool:
    """True where a ray that leaves the scene ends in the disc of this distant light."""
    return light.kind == DISTANT and one_minus_cos_between(light.center, direction) < light.cone


@wp.func(inline=True)
def light_distance(light: Light, kind: int, origin: wp.vec3, direction: wp.vec3) -> float:
    """Distance > 0 at which a ray meets a light with a shape; INFINITE where it does not."""
    if kind == SPHERE_LIGHT:
        return sphere_distance(light, origin, direction)
    slope = wp.dot(light.normal, direction)
    crosses = wp.abs(slope) > 1.0e-12
    t = wp.dot(light.normal, light.center - origin) / wp.where(crosses, slope, 1.0)
    p = origin + direction * t - light.center
    a = wp.dot(light.dual_u, p)
    b = wp.dot(light.dual_v, p)
    within = a * a + b * b
    if kind == RECT:
        within = wp.max(wp.abs(a), wp.abs(b))
    return wp.where(crosses and t > 0.0 and within <= 1.0, t, INFINITE)


@wp.func(inline=True)
def intersect_light(light: Light, kind: int, item: int, origin: wp.vec3, direction: wp.vec3, nearest: Hit) -> Hit:
    """`nearest`, or the light before it; lights are opaque.

    item: index of the light, which the hit tells.
    """
    hit = nearest
    t = light_distance(light, kind, origin, direction)
    is_nearer = t < nearest.t
    hit.t = wp.where(is_nearer, t, nearest.t)
    hit.kind = wp.where(is_nearer, LIGHT, nearest.kind)
    hit.item = wp.where(is_nearer, item, nearest.item)
    return hit


@wp.func(inline=True)
def emitted_radiance(light: Light, kind: int, direction: wp.vec3) -> wp.vec3:
    """What a light with a shape sends against `direction`: a rect or disk is black from behind."""
    if kind == SPHERE_LIGHT:
        return light.radiance
    return choose(wp.dot(light.normal, direction) < 0.0, light.radiance, wp.vec3(0.0, 0.0, 0.0))
