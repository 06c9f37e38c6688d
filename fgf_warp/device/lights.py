"""Lights that a path can connect to: sampling by solid angle, and being met by a ray.

Of the plain kinds many are sampled at once, in lanes. What has an image, a shaping, or a shape of its own is looked up
one by one, by the functions of `build_lights`.
"""

from typing import Any

import warp as wp

from fgf_warp.device.geometry import LIGHT, Hit
from fgf_warp.device.numerics import INFINITE, PI, choose, one_minus_cos_between, sincos_turns, turn, unit
from fgf_warp.device.textures import CLAMP, REPEAT, Images, read_image

DISTANT = wp.constant(0)
RECT = wp.constant(1)
DISK = wp.constant(2)
SPHERE_LIGHT = wp.constant(3)
DOME = wp.constant(4)
CYLINDER_LIGHT = wp.constant(5)
MESH_LIGHT = wp.constant(6)


@wp.struct
class Light:
    """One light; which fields are used depends on the kind."""

    kind: int
    first_chance: float
    last_chance: float
    """It is connected to where a uniform number falls between these."""
    radiance: wp.vec3
    """Of a distant light without extent: its irradiance."""
    center: wp.vec3
    """Of a distant light: the unit vector towards it."""
    half_u: wp.vec3
    """Along an image's s; of a cylinder: from its center to the middle of one end."""
    half_v: wp.vec3
    """Along an image's t, upwards."""
    dual_u: wp.vec3
    dual_v: wp.vec3
    """Dual to the half vectors in the light's plane: the coordinate along half_u is dot(dual_u, p - center)."""
    normal: wp.vec3
    """The emitting side of a rect or disk; of a cylinder its unit axis."""
    area: float
    radius: float
    cone: float
    """1 - cos of a distant light's half angle; 0 is a delta light."""
    to_light: wp.mat33
    """Of a dome: from the world to its own axes, of which y is the pole."""
    image: int
    """That multiplies the radiance, or -1."""
    columns: int
    rows: int
    """Of an image; of a mesh, its triangles in one row."""
    first_place: int
    """Of its rows in `LightTables.places`."""
    first_corner: int
    """Of a mesh: in `LightTables.corners`."""
    is_shaped: int
    axis: wp.vec3
    """Of the shaping."""
    fade_angle: float
    cone_angle: float
    """Angles with the axis at which the light begins to fade, and beyond which there is none."""
    focus: float
    focus_tint: wp.vec3
    link: wp.uint32
    """The bit of the shapes that it shines on; 0: all."""
    casters: wp.uint32
    """The bit of the shapes that cast shadows in its light; 0: all."""
    casting_containers: wp.uint32
    """Bits of the containers that do."""


@wp.struct
class LightTables:
    """What lights look up."""

    places: wp.array(dtype=float)
    """Per image: the cumulative shares of its rows, from 0 to 1, then for each row those of its columns; per mesh those
    of its triangles."""
    corners: wp.array(dtype=wp.vec3)
    """Per mesh: three of each triangle, counter-clockwise seen from the side that emits."""
    images: Images


@wp.struct
class LightSample:
    """A direction towards a light."""

    direction: wp.vec3
    distance: float
    radiance: wp.vec3
    pdf_solid_angle: float
    """0 where the light cannot be reached; 1 for a delta light."""
    only_connected: int
    """1 where no scattered ray finds the light, as of a delta light."""


@wp.func(inline=True)
def sphere_cone(light: Light, position: wp.vec3) -> float:
    """1 - cos of the half angle under which a sphere light is seen; 0 from within."""
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
    """pdf_solid_angle of a uniform direction in a cone; 0 of a cone without extent."""
    return wp.where(one_minus_cos > 0.0, 1.0 / (2.0 * PI * wp.max(one_minus_cos, 1.0e-12)), 0.0)


@wp.func(inline=True)
def point_on_flat_light(light: Light, kind: int, xi1: float, xi2: float) -> wp.vec3:
    """A uniform point of a rect or disk."""
    if kind == RECT:
        return light.center + light.half_u * (2.0 * xi1 - 1.0) + light.half_v * (2.0 * xi2 - 1.0)
    radius = wp.sqrt(xi1)
    sine, cosine = sincos_turns(xi2)
    return light.center + light.half_u * (radius * cosine) + light.half_v * (radius * sine)


@wp.func(inline=True)
def flat_light_pdf(light: Light, direction: wp.vec3, distance: float) -> float:
    """pdf_solid_angle of a uniform point of a rect or disk; 0 from behind."""
    cosine = -wp.dot(light.normal, direction)
    return wp.where(cosine > 1.0e-6, distance * distance / (wp.max(cosine, 1.0e-6) * light.area), 0.0)


@wp.func(inline=True)
def sample_light(light: Light, kind: int, position: wp.vec3, xi1: float, xi2: float) -> LightSample:
    """A direction from `position` towards a light of this kind."""
    s = LightSample()
    s.radiance = light.radiance
    if kind == DISTANT:
        is_delta = light.cone == 0.0
        s.distance = INFINITE
        s.only_connected = wp.where(is_delta, 1, 0)
        s.direction = choose(is_delta, light.center, turn(light.center, xi1 * light.cone, xi2))
        s.pdf_solid_angle = wp.where(is_delta, 1.0, cone_pdf(light.cone))
        return s
    if kind == SPHERE_LIGHT:
        cone = sphere_cone(light, position)
        to_center = light.center - position
        s.direction = turn(unit(to_center), xi1 * cone, xi2)
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
    """pdf_solid_angle with which `sample_light` at `vertex` gives the light's point `position`."""
    if kind == SPHERE_LIGHT:
        return cone_pdf(sphere_cone(light, vertex))
    return flat_light_pdf(light, direction, wp.length(position - vertex))


@wp.func(inline=True)
def is_in_distant_light(light: Light, direction: wp.vec3) -> bool:
    """True where a ray that leaves the scene ends in the disc of this distant light."""
    return light.kind == DISTANT and one_minus_cos_between(light.center, direction) < light.cone


@wp.func(inline=True)
def light_distance(light: Light, kind: int, origin: wp.vec3, direction: wp.vec3) -> float:
    """Distance at which a ray meets a light with a shape; INFINITE where it does not."""
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
def meet_light(light: Light, kind: int, item: int, origin: wp.vec3, direction: wp.vec3, nearest: Hit) -> Hit:
    """`nearest`, or the light before it; lights are opaque."""
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


@wp.func(inline=True)
def chance(light: Light) -> float:
    """Probability with which it is the light that a path connects to."""
    return light.last_chance - light.first_chance


@wp.func
def choose_light(lights: wp.array(dtype=Light), xi: float) -> int:
    """The light whose chances xi falls in."""
    low = int(0)
    high = int(lights.shape[0] - 1)
    while low < high:
        middle = (low + high) // 2
        if lights[middle].last_chance <= xi:
            low = middle + 1
        else:
            high = middle
    return low


@wp.struct
class Place:
    """One of several places, drawn in proportion to its share."""

    item: int
    within: float
    """How far the uniform number is between the place's ends, in [0, 1]."""
    share: float


@wp.func
def draw_place(places: wp.array(dtype=float), first: int, count: int, xi: float) -> Place:
    """One of `count` places, whose cumulative shares are count + 1 numbers from 0 to 1; not one without a share."""
    low = int(0)
    high = int(count - 1)
    while low < high:
        middle = (low + high) // 2
        if places[first + middle + 1] <= xi:
            low = middle + 1
        else:
            high = middle
    place = Place()
    place.item = low
    place.share = places[first + low + 1] - places[first + low]
    place.within = wp.clamp((xi - places[first + low]) / wp.max(place.share, 1.0e-37), 0.0, 1.0)
    return place


@wp.func
def row_of_columns(light: Light, row: int) -> int:
    """Where the cumulative shares of a row's columns begin."""
    return light.first_place + light.rows + 1 + row * (light.columns + 1)


@wp.func
def texel_share(light: Light, tables: LightTables, column: int, row: int) -> float:
    """Probability with which this texel of the light's image is drawn."""
    of_row = tables.places[light.first_place + row + 1] - tables.places[light.first_place + row]
    at = row_of_columns(light, row) + column
    return of_row * (tables.places[at + 1] - tables.places[at])


@wp.func
def filter_image(light: Light, tables: LightTables, s: float, t: float) -> wp.vec3:
    """Bilinear lookup of the light's image, t from the top; a dome's begins anew in s, all else ends."""
    image = tables.images.images[light.image]
    wrap = wp.where(light.kind == DOME, REPEAT, CLAMP)
    rgba = read_image(tables.images, image, s, 1.0 - t, wrap, CLAMP)
    return wp.vec3(rgba[0], rgba[1], rgba[2])


@wp.func
def dome_coordinates(direction: wp.vec3) -> wp.vec2:
    """s and t of a direction in the dome's own axes, as OpenEXR lays out latitude and longitude.

    t runs from the pole +y to -y; s from longitude +pi to -pi, where z is longitude 0 and x is pi/2.
    """
    longitude = wp.atan2(direction[0], direction[2])
    colatitude = wp.atan2(wp.sqrt(direction[0] * direction[0] + direction[2] * direction[2]), direction[1])
    return wp.vec2(wp.clamp(0.5 - longitude / (2.0 * PI), 0.0, 1.0), wp.clamp(colatitude / PI, 0.0, 1.0))


@wp.func
def row_cap(rows: int, row: int) -> wp.vec2:
    """Of a row of a dome's image: 1 - cos of the angle with the nearer pole at its near side, and how much it grows.

    So both keep their digits at both poles.
    """
    from_pole = wp.min(row, rows - 1 - row)
    step = PI / float(rows)
    start = wp.sin(0.5 * step * float(from_pole))
    growth = 2.0 * wp.sin(step * (float(from_pole) + 0.5)) * wp.sin(0.5 * step)
    return wp.vec2(2.0 * start * start, growth)


@wp.func
def sample_dome(light: Light, tables: LightTables, xi1: float, xi2: float) -> LightSample:
    """A direction of a texel drawn in proportion to its share, even in its solid angle."""
    row = draw_place(tables.places, light.first_place, light.rows, xi2)
    column = draw_place(tables.places, row_of_columns(light, row.item), light.columns, xi1)
    cap = row_cap(light.rows, row.item)
    is_upper = row.item <= light.rows - 1 - row.item
    one_minus_cos = cap[0] + cap[1] * wp.where(is_upper, row.within, 1.0 - row.within)
    s = (float(column.item) + column.within) / float(light.columns)
    longitude = 2.0 * PI * (0.5 - s)
    sine = wp.sqrt(wp.max(one_minus_cos * (2.0 - one_minus_cos), 0.0))
    cosine = wp.where(is_upper, 1.0 - one_minus_cos, one_minus_cos - 1.0)
    own = wp.vec3(sine * wp.sin(longitude), cosine, sine * wp.cos(longitude))
    sample = LightSample()
    sample.direction = wp.normalize(wp.transpose(light.to_light) * own)
    sample.distance = INFINITE
    sample.pdf_solid_angle = row.share * column.share * float(light.columns) / (2.0 * PI * cap[1])
    return sample


@wp.func
def dome_pdf(light: Light, tables: LightTables, direction: wp.vec3) -> float:
    """pdf_solid_angle of `sample_dome`."""
    st = dome_coordinates(light.to_light * direction)
    column = wp.min(int(st[0] * float(light.columns)), light.columns - 1)
    row = wp.min(int(st[1] * float(light.rows)), light.rows - 1)
    cap = row_cap(light.rows, row)
    return texel_share(light, tables, column, row) * float(light.columns) / (2.0 * PI * cap[1])


@wp.func
def rect_coordinates(light: Light, position: wp.vec3) -> wp.vec2:
    """s and t, from the top, of a point of a rect with an image."""
    p = position - light.center
    s = 0.5 + 0.5 * wp.dot(light.dual_u, p)
    t = 0.5 - 0.5 * wp.dot(light.dual_v, p)
    return wp.vec2(wp.clamp(s, 0.0, 1.0), wp.clamp(t, 0.0, 1.0))


@wp.func
def sample_rect_image(light: Light, tables: LightTables, position: wp.vec3, xi1: float, xi2: float) -> LightSample:
    """Towards a point of a texel drawn in proportion to its share, even in its area."""
    row = draw_place(tables.places, light.first_place, light.rows, xi2)
    column = draw_place(tables.places, row_of_columns(light, row.item), light.columns, xi1)
    a = 2.0 * (float(column.item) + column.within) / float(light.columns) - 1.0
    b = 1.0 - 2.0 * (float(row.item) + row.within) / float(light.rows)
    sample = sample_towards(position, light.center + light.half_u * a + light.half_v * b)
    density = row.share * column.share * float(light.columns) * float(light.rows)
    sample.pdf_solid_angle = density * flat_light_pdf(light, sample.direction, sample.distance)
    return sample


@wp.func
def rect_image_pdf(light: Light, tables: LightTables, vertex: wp.vec3, position: wp.vec3, direction: wp.vec3) -> float:
    """pdf_solid_angle of `sample_rect_image`."""
    st = rect_coordinates(light, position)
    column = wp.min(int(st[0] * float(light.columns)), light.columns - 1)
    row = wp.min(int(st[1] * float(light.rows)), light.rows - 1)
    density = texel_share(light, tables, column, row) * float(light.columns) * float(light.rows)
    return density * flat_light_pdf(light, direction, wp.length(position - vertex))


@wp.func
def sample_towards(position: wp.vec3, point: wp.vec3) -> LightSample:
    """Towards a point, not yet with a density."""
    sample = LightSample()
    to_point = point - position
    sample.distance = wp.length(to_point)
    sample.direction = to_point / wp.max(sample.distance, 1.0e-30)
    return sample


@wp.func
def cylinder_distance(light: Light, origin: wp.vec3, direction: wp.vec3) -> float:
    """Distance at which a ray meets the tube, from without or within; INFINITE where it does not."""
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
    """Of the point."""
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
    """Height above the lower end of a point of the line, even in the sine of its angle."""
    growth = line.sine_growth * xi
    sine = line.sine_low + growth
    low_sq = line.distance * line.distance + line.low * line.low
    cosine_sq = line.distance * line.distance / low_sq - growth * (line.sine_low + sine)
    height = line.distance * sine / wp.sqrt(wp.max(cosine_sq, 1.0e-20)) - line.low
    return wp.clamp(height, 0.0, line.length)


@wp.func
def cylinder_pdf(light: Light, vertex: wp.vec3, normal: wp.vec3, direction: wp.vec3) -> float:
    """pdf_solid_angle of `sample_cylinder` on the line of the tube that has this normal; 0 from behind."""
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
    """Even in the angle across the tube, and along it in solid angle: a line, and a point of it."""
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
    """pdf_solid_angle of a uniform point of a light with this normal there; 0 from behind."""
    cosine = -wp.dot(normal, direction)
    if cosine <= 1.0e-6:
        return 0.0
    return distance * distance / (cosine * light.area)


@wp.func
def sample_mesh(light: Light, tables: LightTables, position: wp.vec3, xi1: float, xi2: float) -> LightSample:
    """Towards a uniform point of a triangle drawn in proportion to its area."""
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


@wp.func
def shaping(light: Light, direction: wp.vec3) -> wp.vec3:
    """Share of its radiance that a shaped light sends against `direction`: the formulas of UsdLux.ShapingAPI."""
    emitted = -direction
    cosine = wp.dot(light.axis, emitted)
    angle = wp.atan2(wp.length(wp.cross(light.axis, emitted)), cosine)
    if angle > light.cone_angle:
        return wp.vec3(0.0)
    faded = float(0.0)
    if angle > light.fade_angle:
        x = (angle - light.fade_angle) / (light.cone_angle - light.fade_angle)
        faded = x * x * (3.0 - 2.0 * x)
    focused = wp.pow(wp.abs(cosine), light.focus)
    return (light.focus_tint * (1.0 - focused) + wp.vec3(focused)) * (1.0 - faded)


def build_lights(kinds: frozenset[int], has_images: bool, has_shaping: bool) -> tuple[Any, Any, Any, Any]:
    """Functions on one light of a scene that has these kinds, some with images or shaping.

    Returns:
        `intersect_lights`, `sample_any_light`, `any_light_pdf` and `any_radiance`.
    """

    @wp.func
    def intersect_lights(lights: wp.array(dtype=Light), origin: wp.vec3, direction: wp.vec3, nearest: Hit) -> Hit:
        """`nearest`, or the light with a shape before it; triangles are met among the meshes."""
        hit = nearest
        for i in range(lights.shape[0]):
            kind = lights[i].kind
            if kind == RECT or kind == DISK or kind == SPHERE_LIGHT:
                hit = meet_light(lights[i], kind, i, origin, direction, hit)
            if wp.static(int(CYLINDER_LIGHT) in kinds):
                if kind == CYLINDER_LIGHT:
                    t = cylinder_distance(lights[i], origin, direction)
                    if t < hit.t:
                        hit.t = t
                        hit.kind = LIGHT
                        hit.item = i
        return hit

    @wp.func
    def any_radiance(light: Light, tables: LightTables, hit: Hit, position: wp.vec3, direction: wp.vec3) -> wp.vec3:
        """What a light sends against `direction`, from a point of it unless it is beyond the scene.

        hit: with the normal, of a mesh.
        """
        radiance = light.radiance
        if light.kind == RECT or light.kind == DISK:
            radiance = emitted_radiance(light, light.kind, direction)
        if wp.static(int(CYLINDER_LIGHT) in kinds):
            if light.kind == CYLINDER_LIGHT and wp.dot(cylinder_normal(light, position), direction) >= 0.0:
                radiance = wp.vec3(0.0)
        if wp.static(int(MESH_LIGHT) in kinds):
            if light.kind == MESH_LIGHT and wp.dot(hit.normal, direction) >= 0.0:
                radiance = wp.vec3(0.0)
        if wp.static(has_images):
            if light.image >= 0:
                st = wp.vec2()
                if light.kind == RECT:
                    st = rect_coordinates(light, position)
                else:
                    st = dome_coordinates(light.to_light * direction)
                radiance = wp.cw_mul(radiance, filter_image(light, tables, st[0], st[1]))
        if wp.static(has_shaping):
            if light.is_shaped == 1:
                radiance = wp.cw_mul(radiance, shaping(light, direction))
        return radiance

    @wp.func
    def any_light_pdf(
        light: Light, tables: LightTables, hit: Hit, vertex: wp.vec3, position: wp.vec3, direction: wp.vec3
    ) -> float:
        """pdf_solid_angle with which `sample_any_light` at `vertex` gives this direction."""
        if light.kind == DISTANT:
            return cone_pdf(light.cone)
        if wp.static(int(DOME) in kinds):
            if light.kind == DOME:
                return dome_pdf(light, tables, direction)
        if wp.static(int(CYLINDER_LIGHT) in kinds):
            if light.kind == CYLINDER_LIGHT:
                return cylinder_pdf(light, vertex, cylinder_normal(light, position), direction)
        if wp.static(int(MESH_LIGHT) in kinds):
            if light.kind == MESH_LIGHT:
                return facing_pdf(light, hit.normal, direction, wp.length(position - vertex))
        if wp.static(has_images):
            if light.image >= 0:
                return rect_image_pdf(light, tables, vertex, position, direction)
        return light_pdf(light, light.kind, vertex, position, direction)

    @wp.func
    def sample_any_light(light: Light, tables: LightTables, position: wp.vec3, xi1: float, xi2: float) -> LightSample:
        """A direction from `position` towards this light, with what it sends from there."""
        sample = LightSample()
        is_done = bool(False)
        if wp.static(int(DOME) in kinds):
            if light.kind == DOME:
                sample = sample_dome(light, tables, xi1, xi2)
                is_done = True
        if wp.static(int(CYLINDER_LIGHT) in kinds):
            if light.kind == CYLINDER_LIGHT:
                sample = sample_cylinder(light, position, xi1, xi2)
                is_done = True
        if wp.static(int(MESH_LIGHT) in kinds):
            if light.kind == MESH_LIGHT:
                sample = sample_mesh(light, tables, position, xi1, xi2)
                is_done = True
        if wp.static(has_images):
            if light.kind == RECT and light.image >= 0:
                sample = sample_rect_image(light, tables, position, xi1, xi2)
                is_done = True
        if not is_done:
            sample = sample_light(light, light.kind, position, xi1, xi2)
        if sample.pdf_solid_angle > 0.0:
            # A point with a density is seen from the front.
            hit = Hit()
            hit.normal = -sample.direction
            point = position + sample.direction * wp.min(sample.distance, 1.0e30)
            sample.radiance = any_radiance(light, tables, hit, point, sample.direction)
        if light.casters != wp.uint32(0):
            sample.only_connected = 1
        return sample

    return intersect_lights, sample_any_light, any_light_pdf, any_radiance
