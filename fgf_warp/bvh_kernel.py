"""The tree builder's kernel: one thread on the CPU, since the builder is sequential and kernels live in files."""

import warp as wp

WIDTH = wp.constant(8)
"""Children of a node and triangles of a leaf, at most: lanes of a row."""
BINS = wp.constant(16)
MAX_LEVELS = wp.constant(13)
"""As deep as the traversal's stack, and room for 8^14 triangles."""
UNBOUNDED = wp.constant(3.0e38)
NO_WIDTH = wp.constant(1.0e-30)
"""A narrower range is not binned: the inverse of its width is not a float32."""


@wp.func
def half_area(extent: wp.vec3) -> float:
    """Half the surface area of a box of these sides."""
    return extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0]


@wp.func
def bin_of(lo: wp.vec3, hi: wp.vec3, axis: int, start: float, scale: float) -> int:
    """The bin in which a triangle's box has its (doubled) centre."""
    return wp.clamp(int((lo[axis] + hi[axis] - start) * scale), 0, BINS - 1)


@wp.func
def split(
    lo: wp.array(dtype=wp.vec3), hi: wp.array(dtype=wp.vec3), order: wp.array(dtype=int), first: int, count: int
) -> int:
    """Reorders a range of triangles into two and returns the size of the left one; binned, over all three axes.

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
                    right_cost[b] = half_area(right_hi - right_lo) * float(right_count)
            left_lo = wp.vec3(UNBOUNDED)
            left_hi = wp.vec3(-UNBOUNDED)
            left_count = int(0)
            for b in range(1, BINS):
                left_lo = wp.min(left_lo, bin_lo[b - 1])
                left_hi = wp.max(left_hi, bin_hi[b - 1])
                left_count += bin_count[b - 1]
                if left_count > 0 and right_cost[b] < UNBOUNDED:
                    cost = half_area(left_hi - left_lo) * float(left_count) + right_cost[b]
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


@wp.kernel(enable_backward=False)
def build_tree(
    lo: wp.array(dtype=wp.vec3),
    hi: wp.array(dtype=wp.vec3),
    order: wp.array(dtype=int),
    waiting: wp.array2d(dtype=int),
    boxes: wp.array3d(dtype=float),
    children: wp.array2d(dtype=int),
    leaves: wp.array2d(dtype=int),
    sizes: wp.array(dtype=int),
):
    """Writes nodes (boxes, children), leaves (first, count) and sizes (nodes, leaves).

    waiting: ranges that are to become nodes, (first, count, level) at the place of the node.

    The surface area heuristic may part one triangle from all others, so a node is opened by it only while the
    levels below have room for all of its triangles. Else it is opened into eight parts of equal counts, and they
    have: a node with k levels below it never holds more than 8^(k + 2) triangles.
    """
    node_count = int(1)
    leaf_count = int(0)
    waiting[0, 0] = 0
    waiting[0, 1] = lo.shape[0]
    waiting[0, 2] = 1
    node = int(0)
    first = wp.zeros(shape=(WIDTH,), dtype=int)
    count = wp.zeros(shape=(WIDTH,), dtype=int)
    size = wp.zeros(shape=(WIDTH,), dtype=float)
    while node < node_count:
        level = waiting[node, 2]
        # 8 = 2^3; below the 31st bit, where int32 ends.
        by_area = waiting[node, 1] <= 1 << wp.min(3 * (MAX_LEVELS - level + 1), 30)
        # Open the largest child until there are eight.
        first[0] = waiting[node, 0]
        count[0] = waiting[node, 1]
        parts = int(1)
        opening = wp.where(count[0] > WIDTH, 0, -1)
        while parts < WIDTH and opening >= 0:
            left = count[opening] // 2
            if by_area:
                left = split(lo, hi, order, first[opening], count[opening])
            first[parts] = first[opening] + left
            count[parts] = count[opening] - left
            count[opening] = left
            for side in range(2):
                part = wp.where(side == 0, opening, parts)
                box_lo = wp.vec3(UNBOUNDED)
                box_hi = wp.vec3(-UNBOUNDED)
                for i in range(first[part], first[part] + count[part]):
                    box_lo = wp.min(box_lo, lo[order[i]])
                    box_hi = wp.max(box_hi, hi[order[i]])
                size[part] = wp.where(by_area, half_area(box_hi - box_lo), float(count[part]))
            parts += 1
            opening = int(-1)
            largest = float(-1.0)
            for part in range(parts):
                if count[part] > WIDTH and size[part] > largest:
                    largest = size[part]
                    opening = part
        for part in range(WIDTH):
            box_lo = wp.vec3(UNBOUNDED)
            box_hi = wp.vec3(-UNBOUNDED)
            if part < parts:
                for i in range(first[part], first[part] + count[part]):
                    box_lo = wp.min(box_lo, lo[order[i]])
                    box_hi = wp.max(box_hi, hi[order[i]])
                if count[part] > WIDTH:
                    waiting[node_count, 0] = first[part]
                    waiting[node_count, 1] = count[part]
                    waiting[node_count, 2] = level + 1
                    children[node, part] = node_count
                    node_count += 1
                else:
                    leaves[leaf_count, 0] = first[part]
                    leaves[leaf_count, 1] = count[part]
                    children[node, part] = -1 - leaf_count
                    leaf_count += 1
            for axis in range(3):
                boxes[node, 2 * axis, part] = box_lo[axis]
                boxes[node, 2 * axis + 1, part] = box_hi[axis]
        node += 1
    sizes[0] = node_count
    sizes[1] = leaf_count
