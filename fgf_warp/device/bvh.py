"""Triangles in trees of sixteen-wide nodes, and rays against them.

All meshes in world space are in one tree. A mesh that has instances is in a tree of its own, in its own space, and the
instances' boxes are in one tree over them: a ray that meets such a box goes on in the instance's space, where its
direction is not of unit length, so that distances along it stay what they are.

A row holds one coordinate of the sixteen boxes of a node or of the eight triangles of a leaf, and one test goes
through its lanes in a loop that the CPU's compiler makes vector code: without branches, without calls, with a count
that it knows and that is too much to unroll, and over arrays made in the kernel, as in `device/lanes.py`.

Triangles are met watertight: Woop, Benthin and Wald 2013, "Watertight ray/triangle intersection"; boxes with the
slack of Ize 2013, "Robust BVH ray traversal".
"""

from typing import Any

import warp as wp

from fgf_warp.device.geometry import (
    BOUNDARY,
    LIGHT,
    SURFACE,
    Hit,
    Motion,
    Placement,
    Solid,
    Start,
    build_meet_solid,
    casts_shadow,
    coordinate_reach,
    is_inside,
    place_at,
)
from fgf_warp.device.numerics import INFINITE, unit

vec8 = wp.types.vector(length=8, dtype=wp.float32)
vec8i = wp.types.vector(length=8, dtype=wp.int32)
vec16 = wp.types.vector(length=16, dtype=wp.float32)

WIDTH = wp.constant(16)
"""Children of a node, at most."""
LEAF = wp.constant(8)
"""Triangles of a leaf, at most."""
MAX_LEVELS = wp.constant(7)
"""Of a tree, which then has room for 16^7 full leaves."""
NODE_FLOATS = wp.constant(6 * 16)
"""Lower and upper x, y, z of the children's boxes, a row each; none is flat, and an empty child's is inside out."""
LEAF_FLOATS = wp.constant(9 * 8)
"""x, y, z of the first, second and third corners, a row each; an empty place is NaN, and no ray meets it."""
CORNER_FLOATS = wp.constant(3 * 8)
LEVELS_PLACES = MAX_LEVELS * (WIDTH - 1)
"""Of the traversal's stack: on each level all children but one may wait."""
BOX_SLACK = wp.constant(1.0000005)
"""1 + 2 gamma(3) of Ize, and some more since it scales the inverse of the slope."""
NONE = wp.constant(2147483647)
"""Stands for no node."""
LEAVE = wp.constant(2147483646)
"""Stands for the end of the tree of an instance, or of the world's triangles."""
ROUNDING = wp.constant(1.0e-6)
"""Relative error of a distance along a ray, amply."""
FLATTEST = wp.constant(100.0)
"""1 / cosine of the flattest angle at which a face just behind the ray's origin is looked for."""
TINY_SLOPE = wp.constant(1.0e-30)


@wp.struct
class Mesh:
    """What the triangles of one mesh or light are."""

    surface: int
    """-1: a bare boundary, or a light."""
    container: int
    """Bit of the medium that fills it, or -1."""
    is_open: int
    """1: light may enter the medium through its surface, which is then a boundary too."""
    light: int
    """Its index, or -1."""
    shadow_links: wp.uint32
    """Bits of the lights in whose light it casts a shadow."""


@wp.struct
class Instance:
    """A mesh under a transform, or a solid."""

    root: int
    """Of its mesh's tree; or -1 - the index of the solid."""
    owner: int
    """Index of what its triangles are."""
    item: int
    """What a hit of its surface tells in place of the mesh's own: instances share that."""
    motion: int
    """Index of its motion, or -1."""
    to_object: wp.mat33
    position: wp.vec3
    """Its `Placement`, where it rests."""


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


@wp.struct
class Bvh:
    """The trees; without meshes there are no nodes."""

    boxes: wp.array(dtype=vec8)
    """Per node: six rows of sixteen."""
    children: wp.array(dtype=vec8i)
    """Per node: the indices of sixteen inner nodes, or -1 - the index of a leaf, or of an instance."""
    triangles: wp.array(dtype=vec8)
    """Per leaf: nine rows of eight."""
    owners: wp.array(dtype=vec8i)
    """Per leaf: index of the triangles' meshes."""
    faces: wp.array(dtype=vec8i)
    """Per leaf: the triangles' numbers in their meshes."""
    meshes: wp.array(dtype=Mesh)
    """Of the world, and then of instances."""
    world: int
    """Root of the tree of the triangles in world space, or -1."""
    top: int
    """Root of the tree over the instances, or `NONE`."""
    instances: wp.array(dtype=Instance)
    motions: wp.array(dtype=Motion)
    solids: wp.array(dtype=Solid)
    """Those among the instances."""


@wp.func
def safe_inverse(slope: float) -> float:
    """1 / slope, finite."""
    return 1.0 / wp.where(wp.abs(slope) > TINY_SLOPE, slope, wp.where(slope < 0.0, -TINY_SLOPE, TINY_SLOPE))


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
def enter_boxes(boxes: wp.array(dtype=float), row: int, ray: Ray, t_least: float, t_most: float):
    """Where the ray enters the children of a node, and bits of those that it is in between t_least and t_most.

    row: where the node begins.
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
def meet_triangles(triangles: wp.array(dtype=float), row: int, ray: Ray, t_least: float, t_most: float):
    """Distances of a leaf's triangles, and bits of those between t_least and t_most: eight of fronts, eight of backs.

    row: where the leaf begins.
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
    """Of one triangle of a leaf."""
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
    """Where a corner lies across the ray."""
    p = corner - ray.origin
    z = p[ray.axes[2]]
    return wp.vec2(p[ray.axes[0]] + z * ray.shear[0], p[ray.axes[1]] + z * ray.shear[1])


@wp.func
def weigh_corners(triangles: wp.array(dtype=float), leaf: int, lane: int, ray: Ray) -> wp.vec2:
    """Weights of the second and third corners at the point where the ray meets a triangle; none is negative."""
    a = shear_corner(corner_of(triangles, leaf, lane, 0), ray)
    b = shear_corner(corner_of(triangles, leaf, lane, 1), ray)
    c = shear_corner(corner_of(triangles, leaf, lane, 2), ray)
    u = c[0] * b[1] - c[1] * b[0]
    v = a[0] * c[1] - a[1] * c[0]
    w = b[0] * a[1] - b[1] * a[0]
    return wp.vec2(v, w) / (u + v + w)


@wp.func(inline=True)
def aim(origin: wp.vec3, direction: wp.vec3) -> Ray:
    """What is the same for all boxes and triangles; the direction need not be of unit length."""
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


def build_place_instance(features: Any) -> Any:
    """The function of (trees, instance, time) that tells where an instance is, in a scene of these features."""

    @wp.func
    def place_instance(trees: wp.array(dtype=Bvh), instance: int, time: float) -> Placement:
        placed = trees[0].instances[instance]
        if wp.static(features.motion):
            if placed.motion >= 0:
                return place_at(trees[0].motions[placed.motion], time)
        placement = Placement()
        placement.to_object = placed.to_object
        placement.position = placed.position
        return placement

    return place_instance


@wp.func
def aim_at_instance(placement: Placement, origin: wp.vec3, direction: wp.vec3) -> Ray:
    """The ray in an instance's space."""
    return aim(placement.to_object * (origin - placement.position), placement.to_object * direction)


def build_intersect_meshes(features: Any) -> Any:
    """The function that meets a ray with the triangles of a scene of these features.

    It has the arguments (trees, origin, direction, start, nearest), and gives `nearest`, or the triangle before it that
    the path can meet.
    """
    has_light_triangles = "mesh" in features.shaped_lights
    place_instance, meet_solid = build_place_instance(features), build_meet_solid(features)
    # A tree over instances, a tree below it, and what stands for the ends of both and of the world's triangles.
    places = 2 * LEVELS_PLACES + 3 if features.instances else LEVELS_PLACES + 1
    depth_bits = wp.constant(255 if features.instances else 127)
    waiting_nodes = wp.types.vector(length=places, dtype=wp.int32)
    waiting_distances = wp.types.vector(length=places, dtype=wp.float32)

    @wp.func
    def accepts(mesh: Mesh, is_front: bool, t: float, start: Start) -> bool:
        """A surface is met from both sides, a boundary from the side that the path is on."""
        if wp.static(has_light_triangles):
            if mesh.light >= 0:
                return t > 0.0 and start.casters == wp.uint32(0)
        if mesh.surface >= 0:
            if wp.static(features.links):
                if not casts_shadow(mesh.shadow_links, start.casters):
                    return False
            if wp.static(features.passes):
                if mesh.is_open == 0:
                    return t > start.passed
            else:
                return t > start.passed
        if is_inside(start.inside, mesh.container) == is_front:
            return False
        # Behind there may be a face that the ray should have crossed; not one of the mesh that it has just crossed.
        return t > start.t_min or mesh.container != start.crossed

    @wp.func
    def intersect_meshes(
        trees: wp.array(dtype=Bvh), origin: wp.vec3, direction: wp.vec3, start: Start, nearest: Hit
    ) -> Hit:
        hit = nearest
        if trees[0].children.shape[0] == 0:
            return hit
        # The shape is where a negative index counts from; there is none, and from 0 that costs nothing.
        boxes = wp.array(ptr=trees[0].boxes.ptr, shape=(0,), dtype=float)
        children = wp.array(ptr=trees[0].children.ptr, shape=(0,), dtype=int)
        triangles = wp.array(ptr=trees[0].triangles.ptr, shape=(0,), dtype=float)
        owners = wp.array(ptr=trees[0].owners.ptr, shape=(0,), dtype=int)

        begin = upper(start.t_min, start.passed)
        slack = upper(start.slack, ROUNDING * coordinate_reach(origin, begin))
        t_least_of_world = begin - FLATTEST * slack
        t_least = t_least_of_world
        ray = aim(origin, direction)

        # Below all that waits there is no node, nearer than any hit.
        waiting = waiting_nodes()
        waiting_t = waiting_distances()
        waiting[0] = NONE
        waiting_t[0] = -INFINITE
        depth = int(1)
        node = int(0)
        hit_leaf = int(-1)
        hit_lane = int(0)
        # The ray is among the instances, or in the tree of one, or in that of the world's triangles, which is none.
        is_among = bool(False)
        instance = int(-1)
        hit_instance = int(-1)
        place = Placement()
        rounding = float(0.0)
        if wp.static(features.instances):
            node = trees[0].top
            is_among = trees[0].world < 0
            if not is_among:
                node = trees[0].world
                waiting[1] = trees[0].top
                waiting_t[1] = -INFINITE
                waiting[2] = LEAVE
                waiting_t[2] = -INFINITE
                depth = 3

        while node != NONE:
            if wp.static(features.instances) and node == LEAVE:
                is_among = True
                instance = -1
                ray = aim(origin, direction)
                t_least = t_least_of_world
            elif wp.static(features.instances) and is_among and node < 0:
                root = trees[0].instances[-1 - node].root
                if wp.static(features.solids_in_tree) and root < 0:
                    nearer = meet_solid(trees[0].solids[-1 - root], trees[0].motions, origin, direction, start, hit)
                    if nearer.t < hit.t:
                        hit = nearer
                        hit_leaf = -1
                else:
                    is_among = False
                    instance = -1 - node
                    place = place_instance(trees, instance, start.time)
                    ray = aim_at_instance(place, origin, direction)
                    # Of coordinates in its space; distances along the ray are those of the world.
                    speed = wp.length(ray.direction)
                    rounding = ROUNDING * coordinate_reach(ray.origin, begin * speed)
                    t_least = t_least_of_world - FLATTEST * rounding / speed
                    waiting[depth & depth_bits] = LEAVE
                    waiting_t[depth & depth_bits] = -INFINITE
                    depth += 1
                    node = root
                    continue
            elif node >= 0:
                entries, met = enter_boxes(boxes, node * NODE_FLOATS, ray, t_least, hit.t * BOX_SLACK)
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
                        free = depth & depth_bits
                        waiting[free] = wp.where(is_nearer, node, other)
                        waiting_t[free] = upper(node_t, other_t)
                        node = wp.where(is_nearer, other, node)
                        node_t = lower(node_t, other_t)
                        depth += 1
                    continue
            else:
                leaf = -1 - node
                distances, met = meet_triangles(triangles, leaf * LEAF_FLOATS, ray, t_least, hit.t)
                while met != 0:
                    lane = lowest_lane(met)
                    is_front = lane < LEAF
                    lane = wp.where(is_front, lane, lane - LEAF)
                    met = met & (met - 1)
                    t = distances[lane]
                    owner = int(0)
                    if trees[0].meshes.shape[0] > 1:
                        owner = owners[leaf * LEAF + lane]
                    if wp.static(features.instances) and instance >= 0:
                        owner = trees[0].instances[instance].owner
                    mesh = trees[0].meshes[owner]
                    is_met = t < hit.t and accepts(mesh, is_front, t, start)
                    if is_met and t < start.t_min:
                        # Behind: as far as rounding can have moved the ray across the face, and no farther.
                        normal = triangle_normal(triangles, leaf, lane)
                        allowed = slack
                        if wp.static(features.instances) and instance >= 0:
                            allowed = slack * wp.length(wp.transpose(place.to_object) * normal) + rounding
                        is_met = (start.t_min - t) * wp.abs(wp.dot(normal, ray.direction)) < allowed
                    if is_met:
                        hit.t = upper(t, start.t_min)
                        hit_leaf = leaf
                        hit_lane = lane
                        hit_instance = instance
                        hit.kind = wp.where(mesh.surface >= 0, SURFACE, BOUNDARY)
                        hit.item = wp.where(mesh.surface >= 0, mesh.surface, mesh.container)
                        if wp.static(features.instances) and instance >= 0 and mesh.surface >= 0:
                            hit.item = trees[0].instances[instance].item
                        if wp.static(has_light_triangles):
                            if mesh.light >= 0:
                                hit.kind = LIGHT
                                hit.item = mesh.light

            # What waits, and is not behind what was met.
            depth -= 1
            while waiting_t[depth & depth_bits] > hit.t:
                depth -= 1
            node = waiting[depth & depth_bits]

        if hit_leaf >= 0 and hit.kind != BOUNDARY:
            hit.normal = triangle_normal(triangles, hit_leaf, hit_lane)
            if wp.static(features.instances):
                ray = aim(origin, direction)
                if hit_instance >= 0:
                    place = place_instance(trees, hit_instance, start.time)
                    ray = aim_at_instance(place, origin, direction)
                    hit.normal = unit(wp.transpose(place.to_object) * hit.normal)
            if wp.static(features.faces):
                weights = weigh_corners(triangles, hit_leaf, hit_lane, ray)
                hit.face = trees[0].faces[hit_leaf][hit_lane]
                hit.u = weights[0]
                hit.v = weights[1]
        return hit

    return intersect_meshes
