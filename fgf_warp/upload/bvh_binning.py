"""How a range of boxes is split in two: by the surface area heuristic, between bins along all three axes.

Wald 2007, "On fast construction of SAH-based bounding volume hierarchies".
"""

import warp as wp

BINS = wp.constant(32)
"""Of equal width along an axis, between which ranges are parted."""
FEW = wp.constant(16)
"""Boxes that are sorted into their bins, since most of these would be empty."""
UNBOUNDED = wp.constant(3.0e38)
"""Beyond all coordinates and areas."""
NO_WIDTH = wp.constant(1.0e-30)
"""A narrower range is not binned: the inverse of its width is not a float32."""


@wp.struct
class Box:
    """Its lowest and highest corners; a box of nothing is inside out."""

    low: wp.vec3
    high: wp.vec3


@wp.func
def empty_box() -> Box:
    """The box of nothing."""
    box = Box()
    box.low = wp.vec3(UNBOUNDED)
    box.high = wp.vec3(-UNBOUNDED)
    return box


@wp.func
def grow(box: Box, low: wp.vec3, high: wp.vec3) -> Box:
    """The box around a box and another one of these corners."""
    grown = Box()
    grown.low = wp.min(box.low, low)
    grown.high = wp.max(box.high, high)
    return grown


@wp.func
def half_area(box: Box) -> float:
    """Half the surface area of a box."""
    extent = box.high - box.low
    return extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0]


@wp.struct
class Range:
    """Boxes that follow each other, and are to be split into two such ranges."""

    first: int
    count: int
    leaf: int
    """Boxes of a leaf, at most."""
    centers: Box
    """Around the doubled centres of the boxes."""


@wp.struct
class Split:
    """A plane between bins, which parts a range."""

    cost: float
    axis: int
    """-1: no plane parts the range."""
    plane: int
    """The first bin of the right side."""


@wp.func
def no_split() -> Split:
    """Of a range that no plane parts; any split is cheaper."""
    split = Split()
    split.cost = UNBOUNDED
    split.axis = -1
    return split


@wp.func
def cheaper(best: Split, cost: float, axis: int, plane: int) -> Split:
    """The best split so far, or another one that costs less."""
    split = best
    if cost < best.cost:
        split.cost = cost
        split.axis = axis
        split.plane = plane
    return split


@wp.func
def side_cost(box: Box, count: int, leaf: int) -> float:
    """Cost of one side of a split, in whole leaves, so that leaves are full."""
    return half_area(box) * float((count + leaf - 1) // leaf)


@wp.func
def is_splittable(width: float) -> bool:
    """True where boxes whose doubled centres are spread so wide along an axis can be binned along it."""
    return width > NO_WIDTH and width < UNBOUNDED


@wp.func
def bin_scale(part: Range, axis: int) -> float:
    """Bins per unit of length of the doubled centres."""
    return float(BINS) / (part.centers.high[axis] - part.centers.low[axis])


@wp.func
def bin_of(low: wp.vec3, high: wp.vec3, part: Range, axis: int, scale: float) -> int:
    """The bin in which a box has its doubled centre, in [0, BINS)."""
    return wp.clamp(int((low[axis] + high[axis] - part.centers.low[axis]) * scale), 0, BINS - 1)


@wp.func
def choose_split_by_sorting(lo: wp.array(dtype=wp.vec3), hi: wp.array(dtype=wp.vec3), part: Range) -> Split:
    """The same as `choose_split`, of at most `FEW` boxes: these are sorted by their bins, and no bin is empty."""
    best = no_split()
    sorted = wp.zeros(shape=(FEW,), dtype=int)
    bins = wp.zeros(shape=(FEW,), dtype=int)
    right_cost = wp.zeros(shape=(FEW,), dtype=float)
    for axis in range(3):
        if is_splittable(part.centers.high[axis] - part.centers.low[axis]):
            scale = bin_scale(part, axis)
            for i in range(part.count):
                b = bin_of(lo[part.first + i], hi[part.first + i], part, axis, scale)
                place = int(i)
                while place > 0 and bins[place - 1] > b:
                    bins[place] = bins[place - 1]
                    sorted[place] = sorted[place - 1]
                    place -= 1
                bins[place] = b
                sorted[place] = part.first + i
            box = empty_box()
            for j in range(1, part.count):
                place = part.count - j
                box = grow(box, lo[sorted[place]], hi[sorted[place]])
                right_cost[place] = side_cost(box, j, part.leaf)
            box = empty_box()
            for place in range(1, part.count):
                box = grow(box, lo[sorted[place - 1]], hi[sorted[place - 1]])
                if bins[place] > bins[place - 1] and right_cost[place] < UNBOUNDED:
                    cost = side_cost(box, place, part.leaf) + right_cost[place]
                    best = cheaper(best, cost, axis, bins[place - 1] + 1)
    return best


@wp.func
def choose_split(lo: wp.array(dtype=wp.vec3), hi: wp.array(dtype=wp.vec3), part: Range) -> Split:
    """The cheapest of the splits of a range between bins, along all three axes."""
    best = no_split()
    bin_count = wp.zeros(shape=(BINS,), dtype=int)
    bin_lo = wp.zeros(shape=(BINS,), dtype=wp.vec3)
    bin_hi = wp.zeros(shape=(BINS,), dtype=wp.vec3)
    right_cost = wp.zeros(shape=(BINS,), dtype=float)
    for axis in range(3):
        if is_splittable(part.centers.high[axis] - part.centers.low[axis]):
            scale = bin_scale(part, axis)
            for b in range(BINS):
                bin_count[b] = 0
                bin_lo[b] = wp.vec3(UNBOUNDED)
                bin_hi[b] = wp.vec3(-UNBOUNDED)
            for i in range(part.first, part.first + part.count):
                b = bin_of(lo[i], hi[i], part, axis, scale)
                bin_count[b] = bin_count[b] + 1
                bin_lo[b] = wp.min(bin_lo[b], lo[i])
                bin_hi[b] = wp.max(bin_hi[b], hi[i])
            box = empty_box()
            count = int(0)
            for j in range(1, BINS):
                b = BINS - j
                box = grow(box, bin_lo[b], bin_hi[b])
                count += bin_count[b]
                right_cost[b] = UNBOUNDED
                if count > 0:
                    right_cost[b] = side_cost(box, count, part.leaf)
            box = empty_box()
            count = int(0)
            for b in range(1, BINS):
                box = grow(box, bin_lo[b - 1], bin_hi[b - 1])
                count += bin_count[b - 1]
                if count > 0 and right_cost[b] < UNBOUNDED:
                    best = cheaper(best, side_cost(box, count, part.leaf) + right_cost[b], axis, b)
    return best


@wp.func
def swap_boxes(
    lo: wp.array(dtype=wp.vec3), hi: wp.array(dtype=wp.vec3), order: wp.array(dtype=int), one: int, other: int
):
    """Swaps two boxes and their numbers."""
    number = order[one]
    order[one] = order[other]
    order[other] = number
    corner = lo[one]
    lo[one] = lo[other]
    lo[other] = corner
    corner = hi[one]
    hi[one] = hi[other]
    hi[other] = corner


@wp.func
def split_range(
    lo: wp.array(dtype=wp.vec3),
    hi: wp.array(dtype=wp.vec3),
    order: wp.array(dtype=int),
    first: int,
    count: int,
    leaf: int,
):
    """Reorders a range of boxes into two: the size of the left one, and half the area of the box around all.

    Where no plane between bins parts the boxes' centres, the range is halved as it stands.
    """
    part = Range()
    part.first = first
    part.count = count
    part.leaf = leaf
    part.centers = empty_box()
    box = empty_box()
    for i in range(first, first + count):
        box = grow(box, lo[i], hi[i])
        center = lo[i] + hi[i]
        part.centers = grow(part.centers, center, center)
    split = no_split()
    if count <= FEW:
        split = choose_split_by_sorting(lo, hi, part)
    else:
        split = choose_split(lo, hi, part)
    if split.axis < 0:
        return count // 2, half_area(box)
    scale = bin_scale(part, split.axis)
    left = first
    right = first + count - 1
    while left <= right:
        if bin_of(lo[left], hi[left], part, split.axis, scale) < split.plane:
            left += 1
        else:
            swap_boxes(lo, hi, order, left, right)
            right -= 1
    return left - first, half_area(box)
