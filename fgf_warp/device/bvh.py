"""Triangles of all meshes in one tree of sixteen-wide nodes, and rays against it.

A row holds one coordinate of the sixteen boxes of a node or of the eight triangles of a leaf, and one test goes
through its lanes in a loop that the CPU's compiler makes vector code: without branches, without calls, with a count
that it knows and that is too much to unroll, and over arrays made in the kernel, as in `device/lanes.py`.

Triangles are met watertight: Woop, Benthin and Wald 2013, "Watertight ray/triangle intersection"; boxes with the
slack of Ize 2013, "Robust BVH ray traversal".
"""

import warp as wp

from fgf_warp.device.geometry import BOUNDARY, SURFACE, Hit, Start, coordinate_reach, is_inside
from fgf_warp.device.numerics import INFINITE

vec8 = wp.types.vector(length=8, dtype=wp.float32)
vec8i = wp.types.vector(length=8, dtype=wp.int32)
vec16 = wp.types.vector(length=16, dtype=wp.float32)

WIDTH = wp.constant(16)
"""Children of a node."""
LEAF = wp.constant(8)
"""Triangles of a leaf."""
NODE_FLOATS = wp.constant(6 * 16)
"""Lower and upper x, y, z of the children's boxes, a row each; none is flat, and an empty child's is inside out."""
LEAF_FLOATS = wp.constant(9 * 8)
"""x, y, z of the first, second and third corners, a row each; an empty place is NaN, and no ray meets it."""
CORNER_FLOATS = wp.constant(3 * 8)
STACK = 106
"""Enough for 7 levels of 15 waiting children each, and no tree is deeper; and one place for the end."""
BOX_SLACK = wp.constant(1.0000005)
"""1 + 2 gamma(3) of Ize, and some more since it scales the inverse of the slope."""
NONE = wp.constant(2147483647)
"""Stands for no node."""
ROUNDING = wp.constant(1.0e-6)
"""Relative error of a distance along a ray, amply."""
FLATTEST = wp.constant(100.0)
"""1 / cosine of the flattest angle at which a face just behind the ray's origin is looked for."""
TINY_SLOPE = wp.constant(1.0e-30)

WaitingNodes = wp.types.vector(length=STACK, dtype=wp.int32)
WaitingDistances = wp.types.vector(length=STACK, dtype=wp.float32)


@wp.struct
class Mesh:
    """What the triangles of one mesh are."""

    surface: int
    """-1: a bare boundary."""
    container: int
    """Bit of the medium that fills it, or -1."""


@wp.struct
class Bvh:
    """The tree; node 0 is its root, and without meshes it has no nodes."""

    boxes: wp.array(dtype=vec8)
    """Per node: six rows of sixteen."""
    children: wp.array(dtype=vec8i)
    """Per node: the indices of sixteen inner nodes, or -1 - the index of a leaf."""
    triangles: wp.array(dtype=vec8)
    """Per leaf: nine rows of eight."""
    owners: wp.array(dtype=vec8i)
    """Per leaf: index of the triangles' meshes."""
    meshes: wp.array(dtype=Mesh)


@wp.func
def safe_inverse(slope: float) -> float:
    """1 / slope, finite."""
    return 1.0 / wp.where(wp.abs(slope) > TINY_SLOPE, slope, wp.where(slope < 0.0, -TINY_SLOPE, TINY_SLOPE))


@wp.func
def accepts(mesh: Mesh, is_front: bool, t: float, start: Start) -> bool:
    """A surface is met from both sides, a boundary from the side that the path is on."""
    if mesh.surface >= 0:
        return t > 0.0
    if is_inside(start.inside, mesh.container) == is_front:
        return False
    # Behind there may be a face that the ray should have crossed; not one of the mesh that it has just crossed.
    return t > start.t_min or mesh.container != start.crossed


@wp.func(inline=True)
def lower(a: float, b: float) -> float:
    """The lower one; unlike `wp.min`, a single instruction."""
    return wp.where(a < b, a, b)


@wp.func(inline=True)
def upper(a: float, b: float) -> float:
    """The upper one; unlike `wp.max`, a single instruction."""
    return wp.where(a > b, a, b)


@wp.func(inline=True)
def lowest_lane(mask: int) -> int:
    """The lowest bit that is set."""
    return wp.bit_count((mask & (-mask)) - 1)


@wp.func(inline=True)
def longest_axis(direction: wp.vec3) -> int:
    """The axis along which a ray runs farthest."""
    x = wp.abs(direction[0])
    y = wp.abs(direction[1])
    z = wp.abs(direction[2])
    return wp.where(x > y, wp.where(x > z, 0, 2), wp.where(y > z, 1, 2))


@wp.func(inline=True)
def enter_boxes(
    boxes: wp.array(dtype=float),
    near: wp.vec3i,
    far: wp.vec3i,
    origin: wp.vec3,
    inverse: wp.vec3,
    slackened: wp.vec3,
    t_least: float,
    t_most: float,
):
    """Where the ray enters the children of a node, and bits of those that it is in between t_least and t_most.

    near, far: where the rows of the planes begin that the ray meets first and last, for each axis.
    inverse, slackened: of the slopes, for the near planes and with `BOX_SLACK` for the far ones.
    """
    entries = vec16()
    met = int(0)
    lane = int(0)
    while lane < WIDTH:
        x0 = (boxes[near[0] + lane] - origin[0]) * inverse[0]
        x1 = (boxes[far[0] + lane] - origin[0]) * slackened[0]
        y0 = (boxes[near[1] + lane] - origin[1]) * inverse[1]
        y1 = (boxes[far[1] + lane] - origin[1]) * slackened[1]
        z0 = (boxes[near[2] + lane] - origin[2]) * inverse[2]
        z1 = (boxes[far[2] + lane] - origin[2]) * slackened[2]
        t0 = upper(upper(x0, y0), upper(z0, t_least))
        t1 = lower(lower(x1, y1), lower(z1, t_most))
        entries[lane] = t0
        met = met | wp.where(t0 <= t1, 1 << lane, 0)
        lane += 1
    return entries, met


@wp.func(inline=True)
def meet_triangles(
    triangles: wp.array(dtype=float), rows: wp.vec3i, origin: wp.vec3, shear: wp.vec3, t_least: float, t_most: float
):
    """Distances of a leaf's triangles, and bits of those between t_least and t_most: eight of fronts, eight of backs.

    In the ray's frame: `rows`, where the first corners' coordinates begin, and `origin` are along its axes.
    """
    distances = vec8()
    met = int(0)
    lane = int(0)
    while lane < LEAF:
        a = rows[2] + lane
        az = triangles[a] - origin[2]
        bz = triangles[a + CORNER_FLOATS] - origin[2]
        cz = triangles[a + 2 * CORNER_FLOATS] - origin[2]
        a = rows[0] + lane
        ax = triangles[a] - origin[0] + az * shear[0]
        bx = triangles[a + CORNER_FLOATS] - origin[0] + bz * shear[0]
        cx = triangles[a + 2 * CORNER_FLOATS] - origin[0] + cz * shear[0]
        a = rows[1] + lane
        ay = triangles[a] - origin[1] + az * shear[1]
        by = triangles[a + CORNER_FLOATS] - origin[1] + bz * shear[1]
        cy = triangles[a + 2 * CORNER_FLOATS] - origin[1] + cz * shear[1]
        # Edge functions: equal and opposite for the two triangles of an edge, so no ray passes between them.
        u = cx * by - cy * bx
        v = ax * cy - ay * cx
        w = bx * ay - by * ax
        # Not a number for a triangle that the ray sees edge-on, and then not met.
        t = (u * az + v * bz + w * cz) * shear[2] / (u + v + w)
        distances[lane] = t
        front = wp.where(lower(u, lower(v, w)) >= 0.0, 1 << lane, 0)
        back = wp.where(upper(u, upper(v, w)) <= 0.0, 256 << lane, 0)
        met = met | wp.where(t > t_least, wp.where(t < t_most, front | back, 0), 0)
        lane += 1
    return distances, met


@wp.func
def triangle_normal(triangles: wp.array(dtype=float), leaf: int, lane: int) -> wp.vec3:
    """Unit normal of one triangle."""
    x = leaf * LEAF_FLOATS + lane
    y = x + LEAF
    z = y + LEAF
    a = wp.vec3(triangles[x], triangles[y], triangles[z])
    b = wp.vec3(triangles[x + CORNER_FLOATS], triangles[y + CORNER_FLOATS], triangles[z + CORNER_FLOATS])
    x += 2 * CORNER_FLOATS
    y += 2 * CORNER_FLOATS
    z += 2 * CORNER_FLOATS
    return wp.normalize(wp.cross(b - a, wp.vec3(triangles[x], triangles[y], triangles[z]) - a))


@wp.func
def intersect_meshes(bvh: Bvh, origin: wp.vec3, direction: wp.vec3, start: Start, nearest: Hit) -> Hit:
    """`nearest`, or the triangle before it that the path can meet."""
    hit = nearest
    if bvh.children.shape[0] == 0:
        return hit
    # The shape is where a negative index counts from; there is none, and from 0 that costs nothing.
    boxes = wp.array(ptr=bvh.boxes.ptr, shape=(0,), dtype=float)
    children = wp.array(ptr=bvh.children.ptr, shape=(0,), dtype=int)
    triangles = wp.array(ptr=bvh.triangles.ptr, shape=(0,), dtype=float)
    owners = wp.array(ptr=bvh.owners.ptr, shape=(0,), dtype=int)

    slack = upper(start.slack, ROUNDING * coordinate_reach(origin, start.t_min))
    t_least = start.t_min - FLATTEST * slack
    inverse = wp.vec3(safe_inverse(direction[0]), safe_inverse(direction[1]), safe_inverse(direction[2]))
    slackened = inverse * BOX_SLACK
    near = wp.vec3i(
        wp.where(direction[0] < 0.0, WIDTH, 0),
        wp.where(direction[1] < 0.0, 3 * WIDTH, 2 * WIDTH),
        wp.where(direction[2] < 0.0, 5 * WIDTH, 4 * WIDTH),
    )
    far = wp.vec3i(WIDTH, 5 * WIDTH, 9 * WIDTH) - near
    # The ray's frame: z along its longest axis, x and y sheared so that the ray is the z axis (Woop et al.).
    kz = longest_axis(direction)
    is_turned = direction[kz] < 0.0
    after = wp.where(kz == 2, 0, kz + 1)
    before = wp.where(kz == 0, 2, kz - 1)
    kx = wp.where(is_turned, before, after)
    ky = wp.where(is_turned, after, before)
    shear = wp.vec3(-direction[kx], -direction[ky], 1.0) / direction[kz]
    framed_origin = wp.vec3(origin[kx], origin[ky], origin[kz])
    framed_rows = wp.vec3i(LEAF * kx, LEAF * ky, LEAF * kz)

    # Below all that waits there is no node, nearer than any hit.
    waiting = WaitingNodes()
    waiting_t = WaitingDistances()
    waiting[0] = NONE
    waiting_t[0] = -INFINITE
    depth = int(1)
    node = int(0)
    hit_leaf = int(-1)
    hit_lane = int(0)

    while node != NONE:
        if node >= 0:
            row = node * NODE_FLOATS
            rows = wp.vec3i(row, row, row)
            entries, met = enter_boxes(
                boxes, near + rows, far + rows, origin, inverse, slackened, t_least, hit.t * BOX_SLACK
            )
            if met != 0:
                # The nearest child comes next, the others wait.
                first_child = node * WIDTH
                lane = lowest_lane(met)
                node = children[first_child + lane]
                node_t = entries[lane]
                met = met & (met - 1)
                while met != 0:
                    lane = lowest_lane(met)
                    met = met & (met - 1)
                    other = children[first_child + lane]
                    other_t = entries[lane]
                    is_nearer = other_t < node_t
                    # Bits that a depth always has, said to save the wrap of a negative index.
                    place = depth & 127
                    waiting[place] = wp.where(is_nearer, node, other)
                    waiting_t[place] = upper(node_t, other_t)
                    node = wp.where(is_nearer, other, node)
                    node_t = lower(node_t, other_t)
                    depth += 1
                continue
        else:
            leaf = -1 - node
            row = leaf * LEAF_FLOATS
            distances, met = meet_triangles(
                triangles, framed_rows + wp.vec3i(row, row, row), framed_origin, shear, t_least, hit.t
            )
            while met != 0:
                lane = lowest_lane(met)
                is_front = lane < LEAF
                lane = wp.where(is_front, lane, lane - LEAF)
                met = met & (met - 1)
                t = distances[lane]
                owner = int(0)
                if bvh.meshes.shape[0] > 1:
                    owner = owners[leaf * LEAF + lane]
                mesh = bvh.meshes[owner]
                is_met = t < hit.t and accepts(mesh, is_front, t, start)
                if is_met and t < start.t_min:
                    # Behind: as far as rounding can have moved the ray across the face, and no farther.
                    normal = triangle_normal(triangles, leaf, lane)
                    is_met = (start.t_min - t) * wp.abs(wp.dot(normal, direction)) < slack
                if is_met:
                    hit.t = upper(t, start.t_min)
                    hit_leaf = leaf
                    hit_lane = lane
                    hit.kind = wp.where(mesh.surface >= 0, SURFACE, BOUNDARY)
                    hit.item = wp.where(mesh.surface >= 0, mesh.surface, mesh.container)

        # What waits, and is not behind what was met.
        depth -= 1
        while waiting_t[depth & 127] > hit.t:
            depth -= 1
        node = waiting[depth & 127]

    if hit_leaf >= 0 and hit.kind == SURFACE:
        hit.normal = triangle_normal(triangles, hit_leaf, hit_lane)
    return hit
