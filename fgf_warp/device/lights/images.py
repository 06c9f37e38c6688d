"""Domes and rects with an image, whose texels are drawn in proportion to what they send."""

import warp as wp

from fgf_warp.device.lights.data import DOME, Light, LightSample, LightTables, draw_place, sample_towards
from fgf_warp.device.lights.plain import flat_light_pdf
from fgf_warp.device.numerics import INFINITE, PI
from fgf_warp.device.textures import CLAMP, REPEAT, read_image


@wp.func
def row_of_columns(light: Light, row: int) -> int:
    """Where the cumulative shares of a row's columns begin."""
    return light.first_place + light.rows + 1 + row * (light.columns + 1)


@wp.func
def texel_share(light: Light, tables: LightTables, column: int, row: int) -> float:
    """Probability, in [0, 1], with which this texel of the light's image is drawn."""
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
    """A direction of a texel drawn in proportion to its share, even in its solid angle, from two uniforms."""
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
    """pdf_solid_angle of `sample_dome` [1/sr]."""
    st = dome_coordinates(light.to_light * direction)
    column = wp.min(int(st[0] * float(light.columns)), light.columns - 1)
    row = wp.min(int(st[1] * float(light.rows)), light.rows - 1)
    cap = row_cap(light.rows, row)
    return texel_share(light, tables, column, row) * float(light.columns) / (2.0 * PI * cap[1])


@wp.func
def rect_coordinates(light: Light, position: wp.vec3) -> wp.vec2:
    """s and t of a point of a rect with an image, in [0, 1]; t from the top."""
    p = position - light.center
    s = 0.5 + 0.5 * wp.dot(light.dual_u, p)
    t = 0.5 - 0.5 * wp.dot(light.dual_v, p)
    return wp.vec2(wp.clamp(s, 0.0, 1.0), wp.clamp(t, 0.0, 1.0))


@wp.func
def sample_rect_image(light: Light, tables: LightTables, position: wp.vec3, xi1: float, xi2: float) -> LightSample:
    """Towards a point of a texel drawn in proportion to its share, even in its area, from two uniforms."""
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
    """pdf_solid_angle of `sample_rect_image` [1/sr]."""
    st = rect_coordinates(light, position)
    column = wp.min(int(st[0] * float(light.columns)), light.columns - 1)
    row = wp.min(int(st[1] * float(light.rows)), light.rows - 1)
    density = texel_share(light, tables, column, row) * float(light.columns) * float(light.rows)
    return density * flat_light_pdf(light, direction, wp.length(position - vertex))
