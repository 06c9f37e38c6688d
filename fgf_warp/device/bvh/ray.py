"""A ray against the boxes of a node and the triangles of a leaf: one test goes through all lanes of a row.

Its loop is one that the CPU's compiler makes vector code: without branches, without calls, with a count that it knows
and that is too much to unroll, and over arrays made in the kernel, as in `integrator/pool_layout.py`.

Triangles are met watertight: Woop, Benthin and Wald 2013, "Watertight ray/triangle intersection"; boxes with the
slack of Ize 2013, "Robust BVH ray traversal".
"""

import warp as wp

from fgf_warp.device.bvh.data import CORNER_FLOATS, LEAF, LEAF_FLOATS, WIDTH, vec8

vec16 = wp.types.vector(length=16, dtype=wp.float32)

BOX_SLACK = wp.constant(1.0000005)
"""1 + 2 gamma(3) of Ize, and some more since it scales the inverse of the slope."""
TINY_SLOPE = wp.constant(1.0e-30)
"""Stands for a slope of 0, whose inverse is no float32."""


@wp.struct
class Ray:
    """A ray as boxes and triangles are met by it."""

    origin: wp.vec3
    direction: wp.vec3
    inverse: wp.vec3
    """Of its slopes."""
    slackened: wp.vec3
    """The same with `BOX_SLACK`."""
    near: wp.vec3i
    far: wp.vec3i
    """Where the rows of a node's planes begin that it meets first and last, for each axis."""
    axes: wp.vec3i
    """Of its frame: z is its longest axis, and x and y are sheared so that the ray is the z axis (Woop et al.)."""
    shear: wp.vec3


@wp.func
def safe_inverse(slope: float) -> float:
    """1 / slope, finite; that of 0 is as large as 1e30."""
    return 1.0 / wp.where(wp.abs(slope) > TINY_SLOPE, slope, wp.where(slope < 0.0, -TINY_SLOPE, TINY_SLOPE))


@wp.func(inline=True)
def lower(a: float, b: float) -> float:
    """The lower of two numbers; unlike `wp.min`, a single instruction."""
    return wp.where(a < b, a, b)


@wp.func(inline=True)
def upper(a: float, b: float) -> float:
    """The upper of two numbers; unlike `wp.max`, a single instruction."""
    return wp.where(a > b, a, b)


@wp.func(inline=True)
def lowest_lane(mask: int) -> int:
    """Number of the lowest bit that is set in a mask other than 0."""
    return wp.bit_count((mask & (-mask)) - 1)


@wp.func(inline=True)
def longest_axis(direction: wp.vec3) -> int:
    """The axis, 0 to 2, along which a ray runs farthest."""
    x = wp.abs(direction[0])
    y = wp.abs(direction[1])
    z = wp.abs(direction[2])
    return wp.where(x > y, wp.where(x > z, 0, 2), wp.where(y > z, 1, 2))


@wp.func(inline=True)
def intersect_boxes(boxes: wp.array(dtype=float), row: int, ray: Ray, t_least: float, t_most: float):
    """Tests the boxes of a node's children: distances at which the ray enters them, and bits of those that it meets.

    row: where the node begins.
    t_least, t_most: distances along the ray between which a box counts [stage unit].
    """
    near = ray.near + wp.vec3i(row, row, row)
    far = ray.far + wp.vec3i(row, row, row)
    origin = ray.origin
    inverse = ray.inverse
    slackened = ray.slackened
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
def intersect_triangles(triangles: wp.array(dtype=float), row: int, ray: Ray, t_least: float, t_most: float):
    """Tests a leaf's triangles: their distances, and bits of those that the ray meets, eight of fronts, eight of backs.

    row: where the leaf begins.
    t_least, t_most: distances along the ray between which a triangle counts, without the ends [stage unit].
    """
    # In the ray's frame.
    rows = ray.axes * LEAF + wp.vec3i(row, row, row)
    origin = wp.vec3(ray.origin[ray.axes[0]], ray.origin[ray.axes[1]], ray.origin[ray.axes[2]])
    shear = ray.shear
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


@wp.func(inline=True)
def corner_of(triangles: wp.array(dtype=float), leaf: int, lane: int, corner: int) -> wp.vec3:
    """The corner of this number, 0 to 2, of one triangle of a leaf."""
    x = leaf * LEAF_FLOATS + corner * CORNER_FLOATS + lane
    return wp.vec3(triangles[x], triangles[x + LEAF], triangles[x + 2 * LEAF])


@wp.func
def triangle_normal(triangles: wp.array(dtype=float), leaf: int, lane: int) -> wp.vec3:
    """Unit normal of one triangle."""
    a = corner_of(triangles, leaf, lane, 0)
    b = corner_of(triangles, leaf, lane, 1)
    return wp.normalize(wp.cross(b - a, corner_of(triangles, leaf, lane, 2) - a))


@wp.func(inline=True)
def shear_corner(corner: wp.vec3, ray: Ray) -> wp.vec2:
    """Where a corner lies across the ray [stage unit]."""
    p = corner - ray.origin
    z = p[ray.axes[2]]
    return wp.vec2(p[ray.axes[0]] + z * ray.shear[0], p[ray.axes[1]] + z * ray.shear[1])


@wp.func
def corner_weights(triangles: wp.array(dtype=float), leaf: int, lane: int, ray: Ray) -> wp.vec2:
    """Weights, in [0, 1], of the second and third corners at the point where the ray meets a triangle."""
    a = shear_corner(corner_of(triangles, leaf, lane, 0), ray)
    b = shear_corner(corner_of(triangles, leaf, lane, 1), ray)
    c = shear_corner(corner_of(triangles, leaf, lane, 2), ray)
    u = c[0] * b[1] - c[1] * b[0]
    v = a[0] * c[1] - a[1] * c[0]
    w = b[0] * a[1] - b[1] * a[0]
    # One division: of two, the compiler makes one or leaves both, so the last bit would differ from kernel to kernel.
    inverse = 1.0 / (u + v + w)
    return wp.vec2(v * inverse, w * inverse)


@wp.func(inline=True)
def prepare_ray(origin: wp.vec3, direction: wp.vec3) -> Ray:
    """The ray as all boxes and triangles are met by it; the direction need not be of unit length."""
    ray = Ray()
    ray.origin = origin
    ray.direction = direction
    ray.inverse = wp.vec3(safe_inverse(direction[0]), safe_inverse(direction[1]), safe_inverse(direction[2]))
    ray.slackened = ray.inverse * BOX_SLACK
    ray.near = wp.vec3i(
        wp.where(direction[0] < 0.0, WIDTH, 0),
        wp.where(direction[1] < 0.0, 3 * WIDTH, 2 * WIDTH),
        wp.where(direction[2] < 0.0, 5 * WIDTH, 4 * WIDTH),
    )
    ray.far = wp.vec3i(WIDTH, 5 * WIDTH, 9 * WIDTH) - ray.near
    kz = longest_axis(direction)
    is_turned = direction[kz] < 0.0
    after = wp.where(kz == 2, 0, kz + 1)
    before = wp.where(kz == 0, 2, kz - 1)
    kx = wp.where(is_turned, before, after)
    ky = wp.where(is_turned, after, before)
    ray.axes = wp.vec3i(kx, ky, kz)
    ray.shear = wp.vec3(-direction[kx], -direction[ky], 1.0) / direction[kz]
    return ray
