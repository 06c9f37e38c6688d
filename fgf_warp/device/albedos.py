"""Directional albedos of surfaces, looked up in tables of `theory.bsdf`.

All tables are in one array. A block of it is addressed by where it begins:

* the first, of GGX: albedo, albedo of (1 - cos)^5, and the averages of each;
* of a dielectric: albedo, averages, averages of the products with its own albedo and those of GGX, average reflectance;
* of glass: albedo and averages.

Between its rows and columns a table is off by at most `theory.bsdf.ALBEDO_ERROR`.
"""

import warp as wp

SMOOTH_ROUGHNESS = wp.constant(0.0316227766)
"""Of the first row, the square root of `device.microfacet.SMOOTH_ALPHA`; that of the last is 1."""
ROWS = wp.constant(32)
COLUMNS = wp.constant(65)
TABLE = wp.constant(32 * 65)
SQUARE = wp.constant(32 * 32)
"""Sizes of the tables of `theory.bsdf`."""
GGX_AVERAGES = wp.constant(2 * 32 * 65)
DIELECTRIC_PRODUCTS = wp.constant(32 * 65 + 32)
DIELECTRIC_FRESNEL = wp.constant(32 * 65 + 32 + 3 * 32 * 32)
"""Where in their blocks they begin."""


@wp.func
def roughness_row(roughness: float) -> float:
    """Place among the rows of a table, in [0, ROWS - 1]."""
    return wp.clamp((roughness - SMOOTH_ROUGHNESS) / (1.0 - SMOOTH_ROUGHNESS), 0.0, 1.0) * float(ROWS - 1)


@wp.func
def read_bilinear(
    tables: wp.array(dtype=float), first: int, width: int, row: float, column: float, columns: int
) -> float:
    """A value between the rows and columns of a table, bilinear.

    first: where the table begins.
    width: numbers in a row of it.
    row, column: places, counted from 0.
    columns: of the table.
    """
    r = wp.min(int(row), ROWS - 2)
    c = wp.min(int(column), columns - 2)
    along = row - float(r)
    across = column - float(c)
    at = first + r * width + c
    upper = tables[at] * (1.0 - across) + tables[at + 1] * across
    lower = tables[at + width] * (1.0 - across) + tables[at + width + 1] * across
    return upper * (1.0 - along) + lower * along


@wp.func
def albedo_at(tables: wp.array(dtype=float), first: int, roughness: float, cosine: float) -> float:
    """The directional albedo of the table that begins at `first`; the cosine is limited to [0, 1]."""
    column = wp.sqrt(wp.clamp(cosine, 0.0, 1.0)) * float(COLUMNS - 1)
    return read_bilinear(tables, first, COLUMNS, roughness_row(roughness), column, COLUMNS)


@wp.func
def product_at(tables: wp.array(dtype=float), first: int, roughness: float, other: float) -> float:
    """The average of the product of two albedos over light from everywhere, of the first roughness and the other."""
    return read_bilinear(tables, first, ROWS, roughness_row(roughness), roughness_row(other), ROWS)


@wp.func
def average_at(tables: wp.array(dtype=float), first: int, roughness: float) -> float:
    """The average of an albedo over light from everywhere."""
    row = roughness_row(roughness)
    r = wp.min(int(row), ROWS - 2)
    return tables[first + r] * (1.0 - (row - float(r))) + tables[first + r + 1] * (row - float(r))
