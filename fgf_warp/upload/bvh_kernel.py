"""The tree builder's kernels: one thread on the CPU, since the builder is sequential and kernels live in files."""

import warp as wp

# Its loops over bins and children are short; unrolled they take seven times as long to compile.
wp.set_module_options({"enable_backward": False, "max_unroll": 2})

WIDTH = wp.constant(16)
"""Children of a node, at most."""
BINS = wp.constant(32)
FEW = wp.constant(16)
"""Boxes that are sorted into their bins, since most of these would be empty."""
MAX_LEVELS = wp.constant(7)
"""As deep as the traversal's stack, and room for 16^7 full leaves."""
UNBOUNDED = wp.constant(3.0e38)
NO_WIDTH = wp.constant(1.0e-30)
"""A narrower range is not binned: the inverse of its width is not a float32."""


@wp.func
def half_area(extent: wp.vec3) -> float:
    """Half the surface area of a box of these sides."""
    return extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0]


@wp.func
def bin_of(lo: wp.vec3, hi: wp.vec3, axis: int, start: float, scale: float) -> int:
    """The bin in which a box has its (doubled) centre."""
    return wp.clamp(int((lo[axis] + hi[axis] - start) * scale), 0, BINS - 1)


@wp.func
def split_cost(extent: wp.vec3, count: int, leaf: int) -> float:
    """Of one side of a split: whole leaves, so that leaves are full."""
    return half_area(extent) * float((count + leaf - 1) // leaf)


@wp.func
def splittable(width: float) -> bool:
    """True where boxes whose centroids are spread so wide along an axis can be binned along it."""
    return width > NO_WIDTH and width < UNBOUNDED


@wp.func
def plan_few(
    lo: wp.array(dtype=wp.vec3),
    hi: wp.array(dtype=wp.vec3),
    first: int,
    count: int,
    c_lo: wp.vec3,
    c_hi: wp.vec3,
    leaf: int,
):
    """The same as `plan_many`, of at most `FEW` boxes: these are sorted by their bins, and no bin is empty."""
    best_cost = float(UNBOUNDED)
    best_axis = int(-1)
    best_plane = int(0)
    sorted = wp.zeros(shape=(FEW,), dtype=int)
    bins = wp.zeros(shape=(FEW,), dtype=int)
    right_cost = wp.zeros(shape=(FEW,), dtype=float)
    for axis in range(3):
        width = c_hi[axis] - c_lo[axis]
        if splittable(width):
            scale = float(BINS) / width
            for i in range(count):
                b = bin_of(lo[first + i], hi[first + i], axis, c_lo[axis], scale)
                place = int(i)
                while place > 0 and bins[place - 1] > b:
                    bins[place] = bins[place - 1]
                    sorted[place] = sorted[place - 1]
                    place -= 1
                bins[place] = b
                sorted[place] = first + i
            box_lo = wp.vec3(UNBOUNDED)
            box_hi = wp.vec3(-UNBOUNDED)
            for j in range(1, count):
                place = count - j
                box_lo = wp.min(box_lo, lo[sorted[place]])
                box_hi = wp.max(box_hi, hi[sorted[place]])
                right_cost[place] = split_cost(box_hi - box_lo, j, leaf)
            box_lo = wp.vec3(UNBOUNDED)
            box_hi = wp.vec3(-UNBOUNDED)
            for place in range(1, count):
                box_lo = wp.min(box_lo, lo[sorted[place - 1]])
                box_hi = wp.max(box_hi, hi[sorted[place - 1]])
                if bins[place] > bins[place - 1] and right_cost[place] < UNBOUNDED:
                    cost = split_cost(box_hi - box_lo, place, leaf) + right_cost[place]
                    if cost < best_cost:
                        best_cost = cost
                        best_axis = axis
                        best_plane = bins[place - 1] + 1
    return best_axis, best_plane


@wp.func
def plan_many(
    lo: wp.array(dtype=wp.vec3),
    hi: wp.array(dtype=wp.vec3),
    first: int,
    count: int,
    c_lo: wp.vec3,
    c_hi: wp.vec3,
    leaf: int,
):
    """The axis and the first bin of the right side for the cheapest split of a range; -1 where no plane parts it."""
    best_cost = float(UNBOUNDED)
    best_axis = int(-1)
    best_plane = int(0)
    bin_count = wp.zeros(shape=(BINS,), dtype=int)
    bin_lo = wp.zeros(shape=(BINS,), dtype=wp.vec3)
    bin_hi = wp.zeros(shape=(BINS,), dtype=wp.vec3)
    right_cost = wp.zeros(shape=(BINS,), dtype=float)
    for axis in range(3):
        width = c_hi[axis] - c_lo[axis]
        if splittable(width):
            scale = float(BINS) / width
            for b in range(BINS):
                bin_count[b] = 0
                bin_lo[b] = wp.vec3(UNBOUNDED)
                bin_hi[b] = wp.vec3(-UNBOUNDED)
            for i in range(first, first + count):
                b = bin_of(lo[i], hi[i], axis, c_lo[axis], scale)
                bin_count[b] = bin_count[b] + 1
                bin_lo[b] = wp.min(bin_lo[b], lo[i])
                bin_hi[b] = wp.max(bin_hi[b], hi[i])
            right_lo = wp.vec3(UNBOUNDED)
            right_hi = wp.vec3(-UNBOUNDED)
            right_count = int(0)
            for j in range(1, BINS):
                b = BINS - j
                right_lo = wp.min(right_lo, bin_lo[b])
                right_hi = wp.max(right_hi, bin_hi[b])
                right_count += bin_count[b]
                right_cost[b] = UNBOUNDED
                if right_count > 0:
                    right_cost[b] = split_cost(right_hi - right_lo, right_count, leaf)
            left_lo = wp.vec3(UNBOUNDED)
            left_hi = wp.vec3(-UNBOUNDED)
            left_count = int(0)
            for b in range(1, BINS):
                left_lo = wp.min(left_lo, bin_lo[b - 1])
                left_hi = wp.max(left_hi, bin_hi[b - 1])
                left_count += bin_count[b - 1]
                if left_count > 0 and right_cost[b] < UNBOUNDED:
                    cost = split_cost(left_hi - left_lo, left_count, leaf) + right_cost[b]
                    if cost < best_cost:
                        best_cost = cost
                        best_axis = axis
                        best_plane = b
    return best_axis, best_plane


@wp.func
def split(
    lo: wp.array(dtype=wp.vec3),
    hi: wp.array(dtype=wp.vec3),
    order: wp.array(dtype=int),
    first: int,
    count: int,
    leaf: int,
):
    """Reorders a range of boxes into two: the size of the left one, and the range's area; binned, over all three axes.

    Where no plane between bins parts the centroids, the range is halved as it stands.
    """
    box_lo = wp.vec3(UNBOUNDED)
    box_hi = wp.vec3(-UNBOUNDED)
    c_lo = wp.vec3(UNBOUNDED)
    c_hi = wp.vec3(-UNBOUNDED)
    for i in range(first, first + count):
        box_lo = wp.min(box_lo, lo[i])
        box_hi = wp.max(box_hi, hi[i])
        c = lo[i] + hi[i]
        c_lo = wp.min(c_lo, c)
        c_hi = wp.max(c_hi, c)
    area = half_area(box_hi - box_lo)
    axis = int(0)
    plane = int(0)
    if count <= FEW:
        axis, plane = plan_few(lo, hi, first, count, c_lo, c_hi, leaf)
    else:
        axis, plane = plan_many(lo, hi, first, count, c_lo, c_hi, leaf)
    if axis < 0:
        return count // 2, area
    scale = float(BINS) / (c_hi[axis] - c_lo[axis])
    left = first
    right = first + count - 1
    while left <= right:
        if bin_of(lo[left], hi[left], axis, c_lo[axis], scale) < plane:
            left += 1
        else:
            one = order[left]
            order[left] = order[right]
            order[right] = one
            corner = lo[left]
            lo[left] = lo[right]
            lo[right] = corner
            corner = hi[left]
            hi[left] = hi[right]
            hi[right] = corner
            right -= 1
    return left - first, area


@wp.kernel
def split_ranges(
    lo: wp.array(dtype=wp.vec3),
    hi: wp.array(dtype=wp.vec3),
    leaf: int,
    most: int,
    order: wp.array(dtype=int),
    waiting: wp.array2d(dtype=int),
    ranges: wp.array2d(dtype=int),
    areas: wp.array(dtype=float),
    size: wp.array(dtype=int),
):
    """Splits all boxes until every range fits in a leaf, which holds `leaf` of them at most, and reorders them so.

    most: ranges, after which it ends.
    waiting: right parts, while what is left of them is split: (first, count, the range that they are of).
    ranges: that do not fit in a leaf: (size of the left part, right part); a part that does not fit comes after the
        whole, the left one next, and one that fits is no range: -1.
    size: how many ranges there are.
    """
    made = int(0)
    first = int(0)
    count = int(lo.shape[0])
    depth = int(0)
    while depth >= 0 and made < most:
        if count > leaf:
            left, area = split(lo, hi, order, first, count, leaf)
            areas[made] = area
            ranges[made, 0] = left
            ranges[made, 1] = -1
            waiting[depth, 0] = first + left
            waiting[depth, 1] = count - left
            waiting[depth, 2] = made
            depth += 1
            made += 1
            count = left
        else:
            depth -= 1
            if depth >= 0:
                first = waiting[depth, 0]
                count = waiting[depth, 1]
                if count > leaf:
                    ranges[waiting[depth, 2], 1] = made
    size[0] = made


@wp.kernel
def choose_cuts(
    leaf: int,
    below: int,
    ranges: wp.array2d(dtype=int),
    areas: wp.array(dtype=float),
    costs: wp.array2d(dtype=float),
    cuts: wp.array2d(dtype=wp.uint8),
):
    """Which ranges become nodes, for the least total area of nodes (Ylitie, Karras and Laine 2017, section 3).

    below: parts of a single range whose costs are there already, the left one's last, of those that are ranges too.
    costs: of ranges whose wholes come later, as at most s children of a node above them; row 0 is that of all that fits
        in a leaf. In the end row 1 is that of the first range.
    cuts: how many of these s the left part has; 0 if s - 1 do as well. With s = WIDTH, those of its own node.
    """
    for s in range(WIDTH + 1):
        costs[0, s] = 0.0
    held = 1 + below
    for i in range(ranges.shape[0]):
        one = ranges.shape[0] - 1 - i
        # Parts come after the whole, so from the end the left one comes last.
        left = int(0)
        right = int(0)
        if ranges[one, 0] > leaf:
            held -= 1
            left = held
        if ranges[one, 1] >= 0:
            held -= 1
            right = held
        # A row that nothing holds, as both parts are read to the end.
        own = held + 2
        for s in range(2, WIDTH + 1):
            best = float(UNBOUNDED)
            cut = int(1)
            for k in range(1, s):
                cost = costs[left, k] + costs[right, s - k]
                if cost < best:
                    best = cost
                    cut = k
            costs[own, s] = best
            cuts[one, s] = wp.uint8(cut)
        costs[own, 1] = areas[one] + costs[own, WIDTH]
        for s in range(2, WIDTH):
            if costs[own, s - 1] <= costs[own, s]:
                costs[own, s] = costs[own, s - 1]
                cuts[one, s] = wp.uint8(0)
        for s in range(1, WIDTH + 1):
            costs[held, s] = costs[own, s]
        held += 1


@wp.kernel
def open_nodes(
    lo: wp.array(dtype=wp.vec3),
    hi: wp.array(dtype=wp.vec3),
    leaf: int,
    ranges: wp.array2d(dtype=int),
    cuts: wp.array2d(dtype=wp.uint8),
    waiting: wp.array2d(dtype=int),
    boxes: wp.array3d(dtype=float),
    children: wp.array2d(dtype=int),
    leaves: wp.array2d(dtype=int),
    sizes: wp.array(dtype=int),
):
    """Writes nodes (boxes, children), leaves (first, count) and sizes (nodes, leaves).

    waiting: what is to become a node, at its place: (range or -1, first, count, level).

    The surface area heuristic may part one box from all others, so a node is opened by it only while the levels
    below have room for all of its boxes. Else it and all below are opened into parts of equal counts, and they have:
    a node with k levels below it never holds more than 16^(k + 1) full leaves.
    """
    node_count = int(1)
    leaf_count = int(0)
    waiting[0, 0] = wp.where(ranges.shape[0] > 0, 0, -1)
    waiting[0, 1] = 0
    waiting[0, 2] = lo.shape[0]
    waiting[0, 3] = 1
    node = int(0)
    part_range = wp.zeros(shape=(WIDTH,), dtype=int)
    part_first = wp.zeros(shape=(WIDTH,), dtype=int)
    part_count = wp.zeros(shape=(WIDTH,), dtype=int)
    part_slots = wp.zeros(shape=(WIDTH,), dtype=int)
    while node < node_count:
        first = waiting[node, 1]
        count = waiting[node, 2]
        level = waiting[node, 3]
        parts = wp.min((count + leaf - 1) // leaf, WIDTH)
        for part in range(WIDTH):
            part_range[part] = -1
            part_first[part] = first + count // parts * part + wp.min(part, count % parts)
            part_count[part] = count // parts + wp.where(part < count % parts, 1, 0)
        # 16 = 2^4; below the 31st bit, where int32 ends.
        if waiting[node, 0] >= 0 and count <= leaf << wp.min(4 * (MAX_LEVELS - level), 27):
            part_range[0] = waiting[node, 0]
            part_first[0] = first
            part_count[0] = count
            part_slots[0] = WIDTH
            parts = int(1)
            part = int(0)
            while part < parts:
                one = part_range[part]
                slots = part_slots[part]
                while slots > 1 and one >= 0 and cuts[one, slots] == wp.uint8(0):
                    slots -= 1
                if slots > 1 and one >= 0:
                    cut = int(cuts[one, slots])
                    left = ranges[one, 0]
                    part_range[parts] = ranges[one, 1]
                    part_first[parts] = part_first[part] + left
                    part_count[parts] = part_count[part] - left
                    part_slots[parts] = slots - cut
                    part_range[part] = wp.where(left > leaf, one + 1, -1)
                    part_count[part] = left
                    part_slots[part] = cut
                    parts += 1
                else:
                    part += 1
        for part in range(WIDTH):
            box_lo = wp.vec3(UNBOUNDED)
            box_hi = wp.vec3(-UNBOUNDED)
            children[node, part] = 0
            if part < parts:
                for i in range(part_first[part], part_first[part] + part_count[part]):
                    box_lo = wp.min(box_lo, lo[i])
                    box_hi = wp.max(box_hi, hi[i])
                if part_count[part] > leaf:
                    waiting[node_count, 0] = part_range[part]
                    waiting[node_count, 1] = part_first[part]
                    waiting[node_count, 2] = part_count[part]
                    waiting[node_count, 3] = level + 1
                    children[node, part] = node_count
                    node_count += 1
                else:
                    leaves[leaf_count, 0] = part_first[part]
                    leaves[leaf_count, 1] = part_count[part]
                    children[node, part] = -1 - leaf_count
                    leaf_count += 1
            for axis in range(3):
                boxes[node, 2 * axis, part] = box_lo[axis]
                boxes[node, 2 * axis + 1, part] = box_hi[axis]
        node += 1
    sizes[0] = node_count
    sizes[1] = leaf_count
