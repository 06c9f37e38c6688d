"""The tree builder's kernel: one thread on the CPU, since the builder is sequential and kernels live in files."""

import warp as wp

BINS = wp.constant(16)
MAX_LEVELS = 13
"""As deep as the traversal's stack."""
UNBOUNDED = wp.constant(3.0e38)


@wp.func
def half_area(extent: wp.vec3) -> float:
    """Half the surface area of a box of these sides."""
    return extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0]


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
        if width > 0.0:
            scale = float(BINS) * 0.9999 / width
            bin_count = wp.zeros(shape=(16,), dtype=int)
            bin_lo = wp.zeros(shape=(16,), dtype=wp.vec3)
            bin_hi = wp.zeros(shape=(16,), dtype=wp.vec3)
            for b in range(BINS):
                bin_count[b] = 0
                bin_lo[b] = wp.vec3(UNBOUNDED)
                bin_hi[b] = wp.vec3(-UNBOUNDED)
            for i in range(first, first + count):
                one = order[i]
                b = int((lo[one][axis] + hi[one][axis] - c_lo[axis]) * scale)
                bin_count[b] = bin_count[b] + 1
                bin_lo[b] = wp.min(bin_lo[b], lo[one])
                bin_hi[b] = wp.max(bin_hi[b], hi[one])
            right_cost = wp.zeros(shape=(16,), dtype=float)
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
    scale = float(BINS) * 0.9999 / (c_hi[best_axis] - c_lo[best_axis])
    left = first
    right = first + count - 1
    while left <= right:
        one = order[left]
        if int((lo[one][best_axis] + hi[one][best_axis] - c_lo[best_axis]) * scale) < best_plane:
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
    leaf_size: int,
    order: wp.array(dtype=int),
    waiting: wp.array2d(dtype=int),
    boxes: wp.array3d(dtype=float),
    children: wp.array2d(dtype=int),
    leaves: wp.array2d(dtype=int),
    sizes: wp.array(dtype=int),
):
    """Writes nodes (boxes, children), leaves (first, count) and sizes (nodes, leaves, levels).

    waiting: ranges that are to become nodes, (first, count, level) at the place of the node.
    """
    node_count = int(1)
    leaf_count = int(0)
    levels = int(1)
    waiting[0, 0] = 0
    waiting[0, 1] = lo.shape[0]
    waiting[0, 2] = 1
    node = int(0)
    first = wp.zeros(shape=(8,), dtype=int)
    count = wp.zeros(shape=(8,), dtype=int)
    area = wp.zeros(shape=(8,), dtype=float)
    while node < node_count:
        # Open the largest child until there are eight.
        first[0] = waiting[node, 0]
        count[0] = waiting[node, 1]
        area[0] = 1.0
        level = waiting[node, 2]
        levels = wp.max(levels, level)
        parts = int(1)
        opening = int(0)
        while parts < 8 and opening >= 0:
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
                area[part] = half_area(box_hi - box_lo)
            parts += 1
            opening = int(-1)
            largest = float(-1.0)
            for part in range(parts):
                if count[part] > leaf_size and area[part] > largest:
                    largest = area[part]
                    opening = part
        for part in range(8):
            box_lo = wp.vec3(UNBOUNDED)
            box_hi = wp.vec3(-UNBOUNDED)
            if part < parts:
                for i in range(first[part], first[part] + count[part]):
                    box_lo = wp.min(box_lo, lo[order[i]])
                    box_hi = wp.max(box_hi, hi[order[i]])
                if count[part] > leaf_size:
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
    sizes[2] = levels
