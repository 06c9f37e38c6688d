"""The tree builder's kernels: one thread on the CPU, since the builder is sequential and kernels live in files."""

import warp as wp

# Its loops over bins and children are short; unrolled they take seven times as long to compile.
wp.set_module_options({"enable_backward": False, "max_unroll": 2})

WIDTH = wp.constant(16)
"""Children of a node, at most."""
BINS = wp.constant(32)
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
def split(
    lo: wp.array(dtype=wp.vec3),
    hi: wp.array(dtype=wp.vec3),
    order: wp.array(dtype=int),
    first: int,
    count: int,
    leaf: int,
) -> int:
    """Reorders a range of boxes into two and returns the size of the left one; binned, over all three axes.

    Where no plane between bins parts the centroids, the range is halved as it stands.
    """
    c_lo = wp.vec3(UNBOUNDED)
    c_hi = wp.vec3(-UNBOUNDED)
    for i in range(first, first + count):
        c = lo[order[i]] + hi[order[i]]
        c_lo = wp.min(c_lo, c)
        c_hi = wp.max(c_hi, c)
    best_cost = float(UNBOUNDED)
    best_axis = int(-1)
    best_plane = int(0)
    for axis in range(3):
        width = c_hi[axis] - c_lo[axis]
        if width > NO_WIDTH and width < UNBOUNDED:
            scale = float(BINS) / width
            bin_count = wp.zeros(shape=(BINS,), dtype=int)
            bin_lo = wp.zeros(shape=(BINS,), dtype=wp.vec3)
            bin_hi = wp.zeros(shape=(BINS,), dtype=wp.vec3)
            for b in range(BINS):
                bin_count[b] = 0
                bin_lo[b] = wp.vec3(UNBOUNDED)
                bin_hi[b] = wp.vec3(-UNBOUNDED)
            for i in range(first, first + count):
                one = order[i]
                b = bin_of(lo[one], hi[one], axis, c_lo[axis], scale)
                bin_count[b] = bin_count[b] + 1
                bin_lo[b] = wp.min(bin_lo[b], lo[one])
                bin_hi[b] = wp.max(bin_hi[b], hi[one])
            right_cost = wp.zeros(shape=(BINS,), dtype=float)
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
    if best_axis < 0:
        return count // 2
    scale = float(BINS) / (c_hi[best_axis] - c_lo[best_axis])
    left = first
    right = first + count - 1
    while left <= right:
        one = order[left]
        if bin_of(lo[one], hi[one], best_axis, c_lo[best_axis], scale) < best_plane:
            left += 1
        else:
            order[left] = order[right]
            order[right] = one
            right -= 1
    return left - first


@wp.kernel
def split_ranges(
    lo: wp.array(dtype=wp.vec3),
    hi: wp.array(dtype=wp.vec3),
    leaf: int,
    order: wp.array(dtype=int),
    ranges: wp.array2d(dtype=int),
    areas: wp.array(dtype=float),
    size: wp.array(dtype=int),
):
    """Splits all boxes until every range fits in a leaf, which holds `leaf` of them at most.

    ranges: (first, count, left part or 0); the right part follows the left one, and both come after the whole.
    size: how many ranges there are.
    """
    made = int(1)
    ranges[0, 0] = 0
    ranges[0, 1] = lo.shape[0]
    one = int(0)
    while one < made:
        first = ranges[one, 0]
        count = ranges[one, 1]
        box_lo = wp.vec3(UNBOUNDED)
        box_hi = wp.vec3(-UNBOUNDED)
        for i in range(first, first + count):
            box_lo = wp.min(box_lo, lo[order[i]])
            box_hi = wp.max(box_hi, hi[order[i]])
        areas[one] = half_area(box_hi - box_lo)
        ranges[one, 2] = 0
        if count > leaf:
            left = split(lo, hi, order, first, count, leaf)
            ranges[one, 2] = made
            ranges[made, 0] = first
            ranges[made, 1] = left
            ranges[made + 1, 0] = first + left
            ranges[made + 1, 1] = count - left
            made += 2
        one += 1
    size[0] = made


@wp.func
def choose_cuts(
    ranges: wp.array2d(dtype=int),
    areas: wp.array(dtype=float),
    costs: wp.array2d(dtype=float),
    cuts: wp.array2d(dtype=int),
):
    """Which ranges become nodes, for the least total area of nodes (Ylitie, Karras and Laine 2017, section 3).

    costs: of a range as at most s children of a node above it.
    cuts: how many of these s its left part has; 0 if s - 1 do as well. With s = WIDTH, those of its own node.
    """
    for i in range(ranges.shape[0]):
        one = ranges.shape[0] - 1 - i
        left = ranges[one, 2]
        for s in range(1, WIDTH + 1):
            costs[one, s] = 0.0
            cuts[one, s] = 0
        if left > 0:
            for s in range(2, WIDTH + 1):
                costs[one, s] = UNBOUNDED
                cuts[one, s] = 1
                for k in range(1, s):
                    cost = costs[left, k] + costs[left + 1, s - k]
                    if cost < costs[one, s]:
                        costs[one, s] = cost
                        cuts[one, s] = k
            costs[one, 1] = areas[one] + costs[one, WIDTH]
            for s in range(2, WIDTH):
                if costs[one, s - 1] <= costs[one, s]:
                    costs[one, s] = costs[one, s - 1]
                    cuts[one, s] = 0


@wp.kernel
def open_nodes(
    lo: wp.array(dtype=wp.vec3),
    hi: wp.array(dtype=wp.vec3),
    leaf: int,
    order: wp.array(dtype=int),
    ranges: wp.array2d(dtype=int),
    areas: wp.array(dtype=float),
    costs: wp.array2d(dtype=float),
    cuts: wp.array2d(dtype=int),
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
    choose_cuts(ranges, areas, costs, cuts)
    node_count = int(1)
    leaf_count = int(0)
    waiting[0, 0] = 0
    waiting[0, 1] = 0
    waiting[0, 2] = lo.shape[0]
    waiting[0, 3] = 1
    node = int(0)
    part_range = wp.zeros(shape=(WIDTH,), dtype=int)
    part_slots = wp.zeros(shape=(WIDTH,), dtype=int)
    while node < node_count:
        first = waiting[node, 1]
        count = waiting[node, 2]
        level = waiting[node, 3]
        # 16 = 2^4; below the 31st bit, where int32 ends.
        by_area = waiting[node, 0] >= 0 and count <= leaf << wp.min(4 * (MAX_LEVELS - level), 27)
        parts = wp.min((count + leaf - 1) // leaf, WIDTH)
        if by_area:
            part_range[0] = waiting[node, 0]
            part_slots[0] = WIDTH
            parts = int(1)
            part = int(0)
            while part < parts:
                one = part_range[part]
                slots = part_slots[part]
                while slots > 1 and cuts[one, slots] == 0:
                    slots -= 1
                if slots > 1:
                    cut = cuts[one, slots]
                    part_range[part] = ranges[one, 2]
                    part_slots[part] = cut
                    part_range[parts] = ranges[one, 2] + 1
                    part_slots[parts] = slots - cut
                    parts += 1
                else:
                    part += 1
        for part in range(WIDTH):
            box_lo = wp.vec3(UNBOUNDED)
            box_hi = wp.vec3(-UNBOUNDED)
            if part < parts:
                one = int(-1)
                part_first = first + count // parts * part + wp.min(part, count % parts)
                part_count = count // parts + wp.where(part < count % parts, 1, 0)
                if by_area:
                    one = part_range[part]
                    part_first = ranges[one, 0]
                    part_count = ranges[one, 1]
                for i in range(part_first, part_first + part_count):
                    box_lo = wp.min(box_lo, lo[order[i]])
                    box_hi = wp.max(box_hi, hi[order[i]])
                if part_count > leaf:
                    waiting[node_count, 0] = one
                    waiting[node_count, 1] = part_first
                    waiting[node_count, 2] = part_count
                    waiting[node_count, 3] = level + 1
                    children[node, part] = node_count
                    node_count += 1
                else:
                    leaves[leaf_count, 0] = part_first
                    leaves[leaf_count, 1] = part_count
                    children[node, part] = -1 - leaf_count
                    leaf_count += 1
            for axis in range(3):
                boxes[node, 2 * axis, part] = box_lo[axis]
                boxes[node, 2 * axis + 1, part] = box_hi[axis]
        node += 1
    sizes[0] = node_count
    sizes[1] = leaf_count
