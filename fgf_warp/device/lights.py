"""Lights that a path can connect to: sampling by solid angle, and being met by a ray."""

import warp as wp

from fgf_warp.device.geometry import LIGHT, Hit
from fgf_warp.device.numerics import INFINITE, PI, one_minus_cos_between, sincos_turns, turn

DISTANT = wp.constant(0)
RECT = wp.constant(1)
DISK = wp.constant(2)
SPHERE_LIGHT = wp.constant(3)


@wp.struct
class Light:
    """One light; which fields are used depends on the kind."""

    kind: int
    radiance: wp.vec3
    """Of a distant light without extent: its irradiance."""
    center: wp.vec3
    """Of a distant light: the unit vector towards it."""
    half_u: wp.vec3
    half_v: wp.vec3
    dual_u: wp.vec3
    dual_v: wp.vec3
    """Dual to the half vectors in the light's plane: the coordinate along half_u is dot(dual_u, p - center)."""
    normal: wp.vec3
    """The emitting side of a rect or disk."""
    area: float
    radius: float
    cone: float
    """1 - cos of a distant light's half angle; 0 is a delta light."""


@wp.struct
class LightSample:
    """A direction towards a light."""

    direction: wp.vec3
    distance: float
    radiance: wp.vec3
    pdf_solid_angle: float
    """0 where the light cannot be reached; 1 for a delta light."""
    is_delta: int


@wp.func
def sphere_cone(light: Light, position: wp.vec3) -> float:
    """1 - cos of the half angle under which a sphere light is seen; 0 from within."""
    sine_sq = light.radius * light.radius / wp.length_sq(light.center - position)
    return wp.where(sine_sq < 1.0, sine_sq / (1.0 + wp.sqrt(wp.max(1.0 - sine_sq, 0.0))), 0.0)


@wp.func
def sphere_distance(light: Light, position: wp.vec3, direction: wp.vec3) -> float:
    """Distance to the sphere from outside; INFINITE where the ray misses."""
    to_center = light.center - position
    t_near = wp.dot(to_center, direction)
    half_sq = light.radius * light.radius - wp.length_sq(to_center - direction * t_near)
    outside = wp.length_sq(to_center) > light.radius * light.radius
    if half_sq < 0.0 or t_near < 0.0 or not outside:
        return INFINITE
    return t_near - wp.sqrt(half_sq)


@wp.func
def cone_pdf(one_minus_cos: float) -> float:
    """pdf_solid_angle of a uniform direction in a cone."""
    return 1.0 / (2.0 * PI * one_minus_cos)


@wp.func
def point_on_flat_light(light: Light, xi1: float, xi2: float) -> wp.vec3:
    """A uniform point of a rect or disk."""
    if light.kind == RECT:
        return light.center + light.half_u * (2.0 * xi1 - 1.0) + light.half_v * (2.0 * xi2 - 1.0)
    radius = wp.sqrt(xi1)
    sine, cosine = sincos_turns(xi2)
    return light.center + light.half_u * (radius * cosine) + light.half_v * (radius * sine)


@wp.func
def flat_light_pdf(light: Light, direction: wp.vec3, distance: float) -> float:
    """pdf_solid_angle of a uniform point of a rect or disk; 0 from behind."""
    cosine = -wp.dot(light.normal, direction)
    return wp.where(cosine > 1.0e-6, distance * distance / (wp.max(cosine, 1.0e-6) * light.area), 0.0)


@wp.func
def sample_light(light: Light, position: wp.vec3, xi1: float, xi2: float) -> LightSample:
    """A direction from `position` towards the light."""
    s = LightSample()
    s.radiance = light.radiance
    if light.kind == DISTANT:
        s.distance = INFINITE
        s.is_delta = wp.where(light.cone == 0.0, 1, 0)
        if light.cone == 0.0:
            s.direction = light.center
            s.pdf_solid_angle = 1.0
        else:
            s.direction = turn(light.center, xi1 * light.cone, xi2)
            s.pdf_solid_angle = cone_pdf(light.cone)
        return s
    if light.kind == SPHERE_LIGHT:
        cone = sphere_cone(light, position)
        if cone > 0.0:
            s.direction = turn(wp.normalize(light.center - position), xi1 * cone, xi2)
            s.distance = wp.min(sphere_distance(light, position, s.direction), wp.length(light.center - position))
            s.pdf_solid_angle = cone_pdf(cone)
        return s
    to_light = point_on_flat_light(light, xi1, xi2) - position
    s.distance = wp.length(to_light)
    s.direction = to_light / wp.max(s.distance, 1.0e-30)
    s.pdf_solid_angle = flat_light_pdf(light, s.direction, s.distance)
    return s


@wp.func
def light_pdf(light: Light, vertex: wp.vec3, position: wp.vec3, direction: wp.vec3) -> float:
    """pdf_solid_angle with which `sample_light` at `vertex` gives the light's point `position`."""
    if light.kind == SPHERE_LIGHT:
        cone = sphere_cone(light, vertex)
        return wp.where(cone > 0.0, cone_pdf(wp.max(cone, 1.0e-12)), 0.0)
    return flat_light_pdf(light, direction, wp.length(position - vertex))


@wp.func
def is_in_distant_light(light: Light, direction: wp.vec3) -> bool:
    """True where a ray that leaves the scene ends in the disc of this distant light."""
    return light.kind == DISTANT and one_minus_cos_between(light.center, direction) < light.cone


@wp.func
def intersect_lights(lights: wp.array(dtype=Light), origin: wp.vec3, direction: wp.vec3, nearest: Hit) -> Hit:
    """`nearest`, or the light with a shape before it; lights are opaque."""
    hit = nearest
    for i in range(lights.shape[0]):
        light = lights[i]
        t = INFINITE
        normal = light.normal
        if light.kind == SPHERE_LIGHT:
            t = sphere_distance(light, origin, direction)
            normal = -direction
        elif light.kind != DISTANT:
            slope = wp.dot(light.normal, direction)
            if wp.abs(slope) > 1.0e-12:
                t_plane = wp.dot(light.normal, light.center - origin) / slope
                p = origin + direction * t_plane - light.center
                a = wp.dot(light.dual_u, p)
                b = wp.dot(light.dual_v, p)
                within = wp.where(light.kind == RECT, wp.max(wp.abs(a), wp.abs(b)), wp.sqrt(a * a + b * b))
                if t_plane > 0.0 and within <= 1.0:
                    t = t_plane
        if t < hit.t:
            hit.t = t
            hit.kind = LIGHT
            hit.item = i
            hit.normal = normal
    return hit
