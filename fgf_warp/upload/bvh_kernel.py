"""The tree builder's kernels: one thread on the CPU, since the builder is sequential and kernels live in files."""

import warp as wp

from fgf_warp.device.bvh import MAX_LEVELS, WIDTH
from fgf_warp.upload.bvh_binning import UNBOUNDED, empty_box, grow, split_range

# Its loops over bins and children are short; unrolled they take seven times as long to compile.
wp.set_module_options({"enable_backward": False, "max_unroll": 2})


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

    lo, hi: (n,), corners of the boxes, which are reordered.
    most: ranges, after which it ends.
    order: (n,), the boxes' numbers, which are reordered likewise.
    waiting: (n, 3), right parts while the left ones are split: (first, count, the range that they are of).
    ranges: (n, 2), those that do not fit in a leaf: (size of the left part, right part). A part that does not fit comes
        after the whole, the left one next, and one that fits is no range: -1.
    areas: (n,), half the area of the box around each of the ranges.
    size: (1,), how many ranges there are.
    """
    made = int(0)
    first = int(0)
    count = int(lo.shape[0])
    depth = int(0)
    while depth >= 0 and made < most:
        if count > leaf:
            left, area = split_range(lo, hi, order, first, count, leaf)
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

    leaf: boxes of a leaf, at most.
    below: parts of a single range whose costs are there already, the left one's last, of those that are ranges too.
    ranges, areas: (m, 2) and (m,), of `split_ranges`.
    costs: (k, 17), in column s that of a range whose whole comes later, as at most s children of a node above it; row 0
        is that of all that fits in a leaf. In the end row 1 is that of the first range.
    cuts: (m, 17), how many of these s the left part has; 0 if s - 1 do as well. With s = 16, those of its own node.
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
    """Writes nodes and leaves.

    lo, hi: (n,), corners of the boxes, in the order of the ranges.
    leaf: boxes of a leaf, at most.
    ranges, cuts: (m, 2) and (m, 17), of `split_ranges` and `choose_cuts`.
    waiting: (n, 4), what is to become a node, at its place: (range or -1, first, count, level).
    boxes: (n, 6, 16), of the nodes' children: lower x, upper x, lower y and so on.
    children: (n, 16), another node, or -1 - the index of a leaf.
    leaves: (n, 2), (first, count) of their boxes.
    sizes: (2,), how many nodes and leaves there are.

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
            box = empty_box()
            children[node, part] = 0
            if part < parts:
                for i in range(part_first[part], part_first[part] + part_count[part]):
                    box = grow(box, lo[i], hi[i])
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
                boxes[node, 2 * axis, part] = box.low[axis]
                boxes[node, 2 * axis + 1, part] = box.high[axis]
        node += 1
    sizes[0] = node_count
    sizes[1] = leaf_count
