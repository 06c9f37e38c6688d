"""The nearest triangle that a ray meets: through the world's tree, and from the tree over instances into theirs."""

from typing import Any

import warp as wp

from fgf_warp.device.bvh.data import LEAF, LEAF_FLOATS, MAX_LEVELS, NODE_FLOATS, NONE, WIDTH, Bvh, Mesh, vec8
from fgf_warp.device.bvh.ray import (
    BOX_SLACK,
    Ray,
    corner_weights,
    intersect_boxes,
    intersect_triangles,
    lower,
    lowest_lane,
    prepare_ray,
    triangle_normal,
    upper,
)
from fgf_warp.device.geometry import (
    BOUNDARY,
    LIGHT,
    SURFACE,
    Hit,
    Placement,
    Start,
    build_intersect_solid,
    casts_shadow,
    coordinate_reach,
    is_inside,
    place_at,
)
from fgf_warp.device.numerics import INFINITE, unit

LEVELS_PLACES = MAX_LEVELS * (WIDTH - 1)
"""Of the traversal's stack: on each level all children but one may wait."""
LEAVE = wp.constant(2147483646)
"""Stands for the end of the tree of an instance, or of the world's triangles."""
ROUNDING = wp.constant(1.0e-6)
"""Relative error of a distance along a ray, amply."""
FLATTEST = wp.constant(100.0)
"""1 / cosine of the flattest angle at which a face just behind the ray's origin is looked for."""


@wp.struct
class Space:
    """What a space whose tree a ray is in, the world's or an instance's, has of its own beside the ray in it."""

    t_least: float
    """From where on triangles are looked for: a little before the ray's origin."""
    instance: int
    """-1: the world's."""
    placement: Placement
    rounding: float
    """How far rounding on the way into the instance's space may move the ray [its unit]."""


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
def ray_in_instance(placement: Placement, origin: wp.vec3, direction: wp.vec3) -> Ray:
    """The ray in an instance's space."""
    return prepare_ray(placement.to_object * (origin - placement.position), placement.to_object * direction)


def build_enter_instance(features: Any) -> Any:
    """The function that takes a ray into an instance: it gives the instance's `Space`, and the ray in it.

    It has the arguments (trees, instance, origin, direction, time, begin, t_least).

    begin: distance at which the ray begins.
    t_least: from where on triangles are looked for in the world.
    """
    place_instance = build_place_instance(features)

    @wp.func(inline=True)
    def enter_instance(
        trees: wp.array(dtype=Bvh),
        instance: int,
        origin: wp.vec3,
        direction: wp.vec3,
        time: float,
        begin: float,
        t_least: float,
    ):
        space = Space()
        space.instance = instance
        space.placement = place_instance(trees, instance, time)
        ray = ray_in_instance(space.placement, origin, direction)
        # Of coordinates in its space; distances along the ray are those of the world.
        speed = wp.length(ray.direction)
        space.rounding = ROUNDING * coordinate_reach(ray.origin, begin * speed)
        space.t_least = t_least - FLATTEST * space.rounding / speed
        return space, ray

    return enter_instance


def build_accepts(features: Any) -> Any:
    """The function of (mesh, is_front, t, start) that tells whether a path can meet a triangle there.

    A surface is met from both sides, a boundary from the side that the path is on.
    """
    has_light_triangles = "mesh" in features.shaped_lights

    @wp.func
    def accepts(mesh: Mesh, is_front: bool, t: float, start: Start) -> bool:
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

    return accepts


def build_choose_triangle(features: Any) -> Any:
    """The function that chooses among the triangles of a leaf that a ray hits, in a scene of these features.

    It has the arguments (trees, triangles, owners, leaf, distances, hits, direction, space, start, slack, t_most), and
    gives distance, lane, kind and item of the nearest triangle before `t_most` that the path can meet; the lane is -1
    where there is none. These are single numbers, since a struct that goes in and out costs 4 % of the traversal.

    distances, hits: of `intersect_triangles`.
    direction: of the ray, in the space of the triangles.
    slack: how far the ray's origin may be from where it should be [stage unit].
    """
    has_light_triangles = "mesh" in features.shaped_lights
    accepts = build_accepts(features)

    @wp.func(inline=True)
    def choose_triangle(
        trees: wp.array(dtype=Bvh),
        triangles: wp.array(dtype=float),
        owners: wp.array(dtype=int),
        leaf: int,
        distances: vec8,
        hits: int,
        direction: wp.vec3,
        space: Space,
        start: Start,
        slack: float,
        t_most: float,
    ):
        nearest_t = t_most
        nearest_lane = int(-1)
        kind = int(0)
        item = int(0)
        waiting = hits
        while waiting != 0:
            lane = lowest_lane(waiting)
            is_front = lane < LEAF
            lane = wp.where(is_front, lane, lane - LEAF)
            waiting = waiting & (waiting - 1)
            t = distances[lane]
            owner = int(0)
            if trees[0].meshes.shape[0] > 1:
                owner = owners[leaf * LEAF + lane]
            if wp.static(features.instances) and space.instance >= 0:
                owner = trees[0].instances[space.instance].owner
            mesh = trees[0].meshes[owner]
            is_met = t < nearest_t and accepts(mesh, is_front, t, start)
            if is_met and t < start.t_min:
                # Behind: as far as rounding can have moved the ray across the face, and no farther.
                normal = triangle_normal(triangles, leaf, lane)
                allowed = slack
                if wp.static(features.instances) and space.instance >= 0:
                    allowed = slack * wp.length(wp.transpose(space.placement.to_object) * normal) + space.rounding
                is_met = (start.t_min - t) * wp.abs(wp.dot(normal, direction)) < allowed
            if is_met:
                nearest_t = upper(t, start.t_min)
                nearest_lane = lane
                kind = wp.where(mesh.surface >= 0, SURFACE, BOUNDARY)
                item = wp.where(mesh.surface >= 0, mesh.surface, mesh.container)
                if wp.static(features.instances) and space.instance >= 0 and mesh.surface >= 0:
                    item = trees[0].instances[space.instance].item
                if wp.static(has_light_triangles):
                    if mesh.light >= 0:
                        kind = LIGHT
                        item = mesh.light
        return nearest_t, nearest_lane, kind, item

    return choose_triangle


def build_describe_hit(features: Any) -> Any:
    """The function that completes the hit of a triangle's surface, in a scene of these features.

    It has the arguments (trees, triangles, hit, leaf, lane, instance, world_ray, time). It adds the unit normal in the
    world, and where textures vary the face and the weights of its corners. A leaf of -1 stands for no triangle.
    """
    place_instance = build_place_instance(features)

    @wp.func(inline=True)
    def describe_hit(
        trees: wp.array(dtype=Bvh),
        triangles: wp.array(dtype=float),
        found: Hit,
        leaf: int,
        lane: int,
        instance: int,
        world_ray: Ray,
        time: float,
    ) -> Hit:
        hit = found
        if leaf >= 0 and hit.kind != BOUNDARY:
            hit.normal = triangle_normal(triangles, leaf, lane)
            ray = world_ray
            if wp.static(features.instances):
                if instance >= 0:
                    placement = place_instance(trees, instance, time)
                    ray = ray_in_instance(placement, world_ray.origin, world_ray.direction)
                    hit.normal = unit(wp.transpose(placement.to_object) * hit.normal)
            if wp.static(features.faces):
                weights = corner_weights(triangles, leaf, lane, ray)
                hit.face = trees[0].faces[leaf][lane]
                hit.u = weights[0]
                hit.v = weights[1]
        return hit

    return describe_hit


def build_stack(features: Any) -> tuple[Any, Any, int]:
    """What waits while a ray is elsewhere in the trees of a scene of these features.

    Returns:
        The vectors of nodes and of the distances at which the ray enters them; and the bits of a place in these.
    """
    # A tree over instances, a tree below it, and what stands for the ends of both and of the world's triangles.
    places = 2 * LEVELS_PLACES + 3 if features.instances else LEVELS_PLACES + 1
    nodes = wp.types.vector(length=places, dtype=wp.int32)
    distances = wp.types.vector(length=places, dtype=wp.float32)
    return nodes, distances, wp.constant((1 << places.bit_length()) - 1)


def build_intersect_meshes(features: Any) -> Any:
    """The function that meets a ray with the triangles of a scene of these features.

    It has the arguments (trees, origin, direction, start, nearest), and gives `nearest`, or the triangle before it that
    the path can meet.
    """
    enter_instance, intersect_solid = build_enter_instance(features), build_intersect_solid(features)
    choose_triangle, describe_hit = build_choose_triangle(features), build_describe_hit(features)
    waiting_nodes, waiting_distances, depth_bits = build_stack(features)

    @wp.func
    def intersect_meshes(
        trees: wp.array(dtype=Bvh), origin: wp.vec3, direction: wp.vec3, start: Start, nearest: Hit
    ) -> Hit:
        if trees[0].children.shape[0] == 0:
            return nearest
        # The shape is where a negative index counts from; there is none, and from 0 that costs nothing.
        boxes = wp.array(ptr=trees[0].boxes.ptr, shape=(0,), dtype=float)
        children = wp.array(ptr=trees[0].children.ptr, shape=(0,), dtype=int)
        triangles = wp.array(ptr=trees[0].triangles.ptr, shape=(0,), dtype=float)
        owners = wp.array(ptr=trees[0].owners.ptr, shape=(0,), dtype=int)

        begin = upper(start.t_min, start.passed)
        slack = upper(start.slack, ROUNDING * coordinate_reach(origin, begin))
        t_least = begin - FLATTEST * slack
        ray = prepare_ray(origin, direction)
        space = Space()
        space.t_least = t_least
        space.instance = -1
        hit = nearest
        hit_leaf = int(-1)
        hit_lane = int(0)
        hit_instance = int(-1)
        # Below all that waits there is no node, nearer than any hit.
        waiting = waiting_nodes()
        waiting_t = waiting_distances(-INFINITE)
        waiting[0] = NONE
        depth = int(1)
        node = int(0)
        # The ray is among the instances, or in the tree of one, or in that of the world's triangles, which is none.
        is_among = bool(False)
        if wp.static(features.instances):
            node = trees[0].top
            is_among = trees[0].world < 0
            if not is_among:
                node = trees[0].world
                waiting[1] = trees[0].top
                waiting[2] = LEAVE
                depth = 3

        while node != NONE:
            if wp.static(features.instances) and node == LEAVE:
                is_among = True
                space.instance = -1
                ray = prepare_ray(origin, direction)
                space.t_least = t_least
            elif wp.static(features.instances) and is_among and node < 0:
                root = trees[0].instances[-1 - node].root
                if wp.static(features.solids_in_tree) and root < 0:
                    solid = trees[0].solids[-1 - root]
                    nearer = intersect_solid(solid, trees[0].motions, origin, direction, start, hit)
                    if nearer.t < hit.t:
                        hit = nearer
                        hit_leaf = -1
                else:
                    is_among = False
                    space, ray = enter_instance(trees, -1 - node, origin, direction, start.time, begin, t_least)
                    waiting[depth & depth_bits] = LEAVE
                    waiting_t[depth & depth_bits] = -INFINITE
                    depth += 1
                    node = root
                    continue
            elif node >= 0:
                entries, hits = intersect_boxes(boxes, node * NODE_FLOATS, ray, space.t_least, hit.t * BOX_SLACK)
                if hits != 0:
                    # The nearest child comes next, the others wait.
                    first_child = node * WIDTH
                    lane = lowest_lane(hits)
                    node = children[first_child + lane]
                    node_t = entries[lane]
                    hits = hits & (hits - 1)
                    while hits != 0:
                        lane = lowest_lane(hits)
                        hits = hits & (hits - 1)
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
                distances, hits = intersect_triangles(triangles, leaf * LEAF_FLOATS, ray, space.t_least, hit.t)
                if hits != 0:
                    t, lane, kind, item = choose_triangle(
                        trees, triangles, owners, leaf, distances, hits, ray.direction, space, start, slack, hit.t
                    )
                    if lane >= 0:
                        hit.t = t
                        hit.kind = kind
                        hit.item = item
                        hit_leaf = leaf
                        hit_lane = lane
                        hit_instance = space.instance

            # What waits, and is not behind what was met.
            depth -= 1
            while waiting_t[depth & depth_bits] > hit.t:
                depth -= 1
            node = waiting[depth & depth_bits]

        return describe_hit(trees, triangles, hit, hit_leaf, hit_lane, hit_instance, ray, start.time)

    return intersect_meshes
