"""Lights in the shape of a tube, and lights made of triangles."""

import warp as wp

from fgf_warp.device.lights.data import Light, LightSample, LightTables, draw_place, sample_towards
from fgf_warp.device.numerics import INFINITE


@wp.func
def cylinder_distance(light: Light, origin: wp.vec3, direction: wp.vec3) -> float:
    """Distance > 0 at which a ray meets the tube, from without or within; INFINITE where it does not."""
    o = origin - light.center
    along = wp.dot(direction, light.normal)
    across = direction - light.normal * along
    slope_sq = wp.length_sq(across)
    if slope_sq < 1.0e-24:
        return INFINITE
    # From the point nearest to the axis, which keeps its digits far away.
    o_across = o - light.normal * wp.dot(o, light.normal)
    t_near = -wp.dot(o_across, across) / slope_sq
    room = light.radius * light.radius - wp.length_sq(o_across + across * t_near)
    if room < 0.0:
        return INFINITE
    half = wp.sqrt(room / slope_sq)
    half_length = wp.length(light.half_u)
    for side in range(2):
        t = t_near + wp.where(side == 0, -half, half)
        # A point on the tube is not met by a ray that begins there, but for rounding.
        if t > 0.0 and wp.abs(wp.dot(o + direction * t, light.normal)) <= half_length:
            return t
    return INFINITE


@wp.func
def cylinder_normal(light: Light, position: wp.vec3) -> wp.vec3:
    """Outward unit normal of the tube at a point of it."""
    p = position - light.center
    return wp.normalize(p - light.normal * wp.dot(p, light.normal))


@wp.struct
class Line:
    """A line of a tube along its axis, as it is seen from a point; angles are off the plane across it there."""

    low: float
    """Height of its lower end above the point; the upper one is `length` higher."""
    length: float
    distance: float
    """From the point to the line, > 0."""
    sine_low: float
    sine_growth: float
    """From the lower to the upper end, in the form that keeps its digits where both are far away on one side."""


@wp.func
def see_line(low: float, length: float, distance: float) -> Line:
    """The line whose ends are so far above the point, from a distance > 0."""
    line = Line()
    line.low = low
    line.length = length
    line.distance = distance
    high = low + length
    distance_sq = distance * distance
    low_sq = distance_sq + low * low
    high_sq = distance_sq + high * high
    line.sine_low = low / wp.sqrt(low_sq)
    sine_high = high / wp.sqrt(high_sq)
    line.sine_growth = sine_high - line.sine_low
    if low * high > 0.0:
        squares = distance_sq / low_sq * (length * (low + high) / high_sq)
        line.sine_growth = squares / (line.sine_low + sine_high)
    return line


@wp.func
def height_on_line(line: Line, xi: float) -> float:
    """Height above the lower end of a point of the line, even in the sine of its angle, from a uniform."""
    growth = line.sine_growth * xi
    sine = line.sine_low + growth
    low_sq = line.distance * line.distance + line.low * line.low
    cosine_sq = line.distance * line.distance / low_sq - growth * (line.sine_low + sine)
    height = line.distance * sine / wp.sqrt(wp.max(cosine_sq, 1.0e-20)) - line.low
    return wp.clamp(height, 0.0, line.length)


@wp.func
def cylinder_pdf(light: Light, vertex: wp.vec3, normal: wp.vec3, direction: wp.vec3) -> float:
    """pdf_solid_angle of `sample_cylinder` [1/sr] on the line of the tube that has this normal; 0 from behind."""
    o = vertex - light.center
    height = wp.dot(o, light.normal)
    o_across = o - light.normal * height
    distance = wp.length(o_across)
    if distance <= light.radius or wp.dot(normal, direction) >= 0.0:
        return 0.0
    half_length = wp.length(light.half_u)
    line = see_line(-half_length - height, 2.0 * half_length, wp.length(o_across - normal * light.radius))
    return 1.0 / (2.0 * wp.asin(light.radius / distance) * line.sine_growth)


@wp.func
def sample_cylinder(light: Light, position: wp.vec3, xi1: float, xi2: float) -> LightSample:
    """Towards a tube, from two uniforms: a line even in the angle across it, then a point of it even in solid angle."""
    o = position - light.center
    height = wp.dot(o, light.normal)
    o_across = o - light.normal * height
    distance = wp.length(o_across)
    sample = LightSample()
    if distance <= light.radius:
        return sample
    half_view = wp.asin(light.radius / distance)
    azimuth = (2.0 * xi1 - 1.0) * half_view
    sine = wp.sin(azimuth)
    cosine = wp.cos(azimuth)
    inward = o_across / (-distance)
    room = light.radius * light.radius - distance * distance * sine * sine
    to_line = (distance - light.radius) * (distance + light.radius) / (distance * cosine + wp.sqrt(wp.max(room, 0.0)))
    across = o_across + (inward * cosine + wp.cross(light.normal, inward) * sine) * to_line
    half_length = wp.length(light.half_u)
    line = see_line(-half_length - height, 2.0 * half_length, to_line)
    along = light.normal * (height_on_line(line, xi2) - half_length)
    sample = sample_towards(position, light.center + across + along)
    sample.pdf_solid_angle = 1.0 / (2.0 * half_view * line.sine_growth)
    return sample


@wp.func
def facing_pdf(light: Light, normal: wp.vec3, direction: wp.vec3, distance: float) -> float:
    """pdf_solid_angle [1/sr] of a uniform point of a light with this normal there; 0 from behind."""
    cosine = -wp.dot(normal, direction)
    if cosine <= 1.0e-6:
        return 0.0
    return distance * distance / (cosine * light.area)


@wp.func
def sample_mesh(light: Light, tables: LightTables, position: wp.vec3, xi1: float, xi2: float) -> LightSample:
    """Towards a uniform point of a triangle drawn in proportion to its area, from two uniforms."""
    triangle = draw_place(tables.places, light.first_place, light.columns, xi1)
    at = light.first_corner + 3 * triangle.item
    a = tables.corners[at]
    ab = tables.corners[at + 1] - a
    ac = tables.corners[at + 2] - a
    side = wp.sqrt(triangle.within)
    sample = sample_towards(position, a + ab * (side * (1.0 - xi2)) + ac * (side * xi2))
    normal = wp.normalize(wp.cross(ab, ac))
    sample.pdf_solid_angle = facing_pdf(light, normal, sample.direction, sample.distance)
    return sample
