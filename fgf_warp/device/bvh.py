"""Triangles of all meshes in one tree of eight-wide nodes, and rays against it.

A row holds one coordinate of eight boxes or eight triangles, so that one test becomes a few vector instructions.
Triangles are met watertight: Woop, Benthin and Wald 2013, "Watertight ray/triangle intersection"; boxes with the
slack of Ize 2013, "Robust BVH ray traversal".
"""

import warp as wp

from fgf_warp.device.geometry import BOUNDARY, SURFACE, Hit, Start, coordinate_reach, is_inside
from fgf_warp.device.numerics import INFINITE

vec8 = wp.types.vector(length=8, dtype=wp.float32)
vec8i = wp.types.vector(length=8, dtype=wp.int32)

BOX_ROWS = wp.constant(6)
"""Rows of a node: lower and upper x, y, z of its children's boxes; an empty child's box is inside out."""
TRIANGLE_ROWS = wp.constant(9)
"""Rows of a leaf: x, y, z of the first, second and third corners; an empty place is a point."""
STACK = wp.constant(96)
"""Enough for 13 levels of 7 waiting children each, and no tree is deeper."""
BOX_SLACK = wp.constant(1.0000004)
"""1 + 2 gamma(3) of Ize."""
NONE = wp.constant(2147483647)
"""Stands for no node."""
ROUNDING = wp.constant(1.0e-6)
"""Relative error of a distance along a ray, amply."""
FLATTEST = wp.constant(100.0)
"""1 / cosine of the flattest angle at which a face just behind the ray's origin is looked for."""
TINY_SLOPE = wp.constant(1.0e-30)


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
    children: wp.array(dtype=vec8i)
    """Per node: the index of an inner node, or -1 - the index of a leaf."""
    triangles: wp.array(dtype=vec8)
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


@wp.func
def lanes_where_le(a: vec8, b: vec8) -> int:
    """Bits of the lanes in which a <= b."""
    mask = int(0)
    for k in range(8):
        mask = mask | wp.where(a[k] <= b[k], 1 << k, 0)
    return mask


@wp.func
def lowest_lane(mask: int) -> int:
    """The lowest bit that is set."""
    return wp.bit_count((mask & (-mask)) - 1)


@wp.func
def leaf_corner(bvh: Bvh, leaf: int, lane: int, corner: int) -> wp.vec3:
    """A corner of one triangle."""
    row = leaf * TRIANGLE_ROWS + 3 * corner
    return wp.vec3(bvh.triangles[row][lane], bvh.triangles[row + 1][lane], bvh.triangles[row + 2][lane])


@wp.func
def triangle_normal(bvh: Bvh, leaf: int, lane: int) -> wp.vec3:
    """Unit normal of one triangle."""
    a = leaf_corner(bvh, leaf, lane, 0)
    return wp.normalize(wp.cross(leaf_corner(bvh, leaf, lane, 1) - a, leaf_corner(bvh, leaf, lane, 2) - a))


@wp.func
def intersect_meshes(bvh: Bvh, origin: wp.vec3, direction: wp.vec3, start: Start, nearest: Hit) -> Hit:
    """`nearest`, or the triangle before it that the path can meet."""
    hit = nearest
    if bvh.children.shape[0] == 0:
        return hit

    slack = wp.max(start.slack, ROUNDING * coordinate_reach(origin, start.t_min))
    # The ray's frame: z along its longest axis, x and y sheared so that the ray is the z axis (Woop et al.).
    size = wp.vec3(wp.abs(direction[0]), wp.abs(direction[1]), wp.abs(direction[2]))
    kz = wp.where(size[0] > size[1], wp.where(size[0] > size[2], 0, 2), wp.where(size[1] > size[2], 1, 2))
    kx = wp.where(kz == 2, 0, kz + 1)
    ky = wp.where(kx == 2, 0, kx + 1)
    turned = direction[kz] < 0.0
    if turned:
        swap = kx
        kx = ky
        ky = swap
    shear_x = -direction[kx] / direction[kz]
    shear_y = -direction[ky] / direction[kz]
    shear_z = 1.0 / direction[kz]
    o_kx = vec8(origin[kx])
    o_ky = vec8(origin[ky])
    o_kz = vec8(origin[kz])

    inverse = wp.vec3(safe_inverse(direction[0]), safe_inverse(direction[1]), safe_inverse(direction[2]))
    ox = vec8(origin[0])
    oy = vec8(origin[1])
    oz = vec8(origin[2])
    near_x = wp.where(direction[0] < 0.0, 1, 0)
    near_y = wp.where(direction[1] < 0.0, 3, 2)
    near_z = wp.where(direction[2] < 0.0, 5, 4)

    waiting = wp.zeros(shape=(wp.static(int(STACK)),), dtype=int)
    waiting_t = wp.zeros(shape=(wp.static(int(STACK)),), dtype=float)
    depth = int(0)
    node = int(0)
    hit_leaf = int(-1)
    hit_lane = int(0)

    while True:
        if node >= 0:
            row = node * BOX_ROWS
            x0 = (bvh.boxes[row + near_x] - ox) * inverse[0]
            x1 = (bvh.boxes[row + 1 - near_x] - ox) * inverse[0]
            y0 = (bvh.boxes[row + near_y] - oy) * inverse[1]
            y1 = (bvh.boxes[row + 5 - near_y] - oy) * inverse[1]
            z0 = (bvh.boxes[row + near_z] - oz) * inverse[2]
            z1 = (bvh.boxes[row + 9 - near_z] - oz) * inverse[2]
            t0 = wp.max(wp.max(x0, y0), wp.max(z0, vec8(start.t_min - FLATTEST * slack)))
            t1 = wp.min(wp.min(x1, y1), wp.min(z1, vec8(hit.t))) * BOX_SLACK
            child = bvh.children[node]
            # The nearest child comes next, the others wait.
            node = int(NONE)
            node_t = INFINITE
            met = lanes_where_le(t0, t1)
            while met != 0:
                k = lowest_lane(met)
                met = met & (met - 1)
                if t0[k] < node_t:
                    if node != NONE:
                        waiting[depth] = node
                        waiting_t[depth] = node_t
                        depth += 1
                    node = child[k]
                    node_t = t0[k]
                else:
                    waiting[depth] = child[k]
                    waiting_t[depth] = t0[k]
                    depth += 1
            if node != NONE:
                continue
        else:
            leaf = -1 - node
            row = leaf * TRIANGLE_ROWS
            az = bvh.triangles[row + kz] - o_kz
            bz = bvh.triangles[row + 3 + kz] - o_kz
            cz = bvh.triangles[row + 6 + kz] - o_kz
            ax = bvh.triangles[row + kx] - o_kx + az * shear_x
            ay = bvh.triangles[row + ky] - o_ky + az * shear_y
            bx = bvh.triangles[row + 3 + kx] - o_kx + bz * shear_x
            by = bvh.triangles[row + 3 + ky] - o_ky + bz * shear_y
            cx = bvh.triangles[row + 6 + kx] - o_kx + cz * shear_x
            cy = bvh.triangles[row + 6 + ky] - o_ky + cz * shear_y
            # Edge functions: equal and opposite for the two triangles of an edge, so no ray passes between them.
            u = wp.cw_mul(cx, by) - wp.cw_mul(cy, bx)
            v = wp.cw_mul(ax, cy) - wp.cw_mul(ay, cx)
            w = wp.cw_mul(bx, ay) - wp.cw_mul(by, ax)
            det = u + v + w
            scaled_t = (wp.cw_mul(u, az) + wp.cw_mul(v, bz) + wp.cw_mul(w, cz)) * shear_z
            lowest = wp.min(u, wp.min(v, w))
            highest = wp.max(u, wp.max(v, w))
            owner = bvh.owners[leaf]
            met = lanes_where_le(vec8(0.0), wp.max(lowest, -highest))
            while met != 0:
                k = lowest_lane(met)
                met = met & (met - 1)
                t = scaled_t[k] / wp.where(det[k] != 0.0, det[k], TINY_SLOPE)
                if det[k] != 0.0 and owner[k] >= 0 and t < hit.t:
                    mesh = bvh.meshes[owner[k]]
                    is_met = accepts(mesh, det[k] > 0.0, t, start)
                    if is_met and t < start.t_min:
                        # Behind: as far as rounding can have moved the ray across the face, and no farther.
                        normal = triangle_normal(bvh, leaf, k)
                        is_met = (start.t_min - t) * wp.abs(wp.dot(normal, direction)) < slack
                    if is_met:
                        hit.t = wp.max(t, start.t_min)
                        hit_leaf = leaf
                        hit_lane = k
                        hit.kind = wp.where(mesh.surface >= 0, SURFACE, BOUNDARY)
                        hit.item = wp.where(mesh.surface >= 0, mesh.surface, mesh.container)

        # What waits, and is not behind what was met.
        node = int(NONE)
        while depth > 0 and node == NONE:
            depth -= 1
            if waiting_t[depth] <= hit.t:
                node = waiting[depth]
        if node == NONE:
            break

    if hit_leaf >= 0 and hit.kind == SURFACE:
        hit.normal = triangle_normal(bvh, hit_leaf, hit_lane)
    return hit
