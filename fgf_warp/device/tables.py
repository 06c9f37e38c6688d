"""Tables of the laws: rows of one array, in which a law has its own."""

import warp as wp


@wp.struct
class Table:
    """Rows, one after the other."""

    first: int
    count: int


@wp.struct
class Flights:
    """Of `theory.fbm.FlightTable`: rows (ln u, slope)."""

    table: Table
    start: float
    step: float
    largest_exponent: float


@wp.func(inline=True)
def find_row(tables: wp.array(dtype=wp.vec3), table: Table, x: float) -> int:
    """How many rows of a table, which rise in their first number, begin with one below x."""
    low = int(0)
    high = int(table.count)
    while low < high:
        middle = (low + high) // 2
        if tables[table.first + middle][0] < x:
            low = middle + 1
        else:
            high = middle
    return low


@wp.func(inline=True)
def draw_from(tables: wp.array(dtype=wp.vec3), table: Table, xi: float) -> float:
    """One of the values of a discrete distribution, whose rows are (cumulative weight, value)."""
    row = wp.min(find_row(tables, table, xi), table.count - 1)
    return tables[table.first + row][1]
