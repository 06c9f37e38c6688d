"""Rays against solids, and what all that rays can meet has in common.

A boundary of a medium is a switch: from outside only its front is met, from inside only its back. Which side a path
is on is known from what it crossed (its `inside` bits), not from coordinates, and a ray keeps its origin when it
crosses: what it meets next is sought from the distance `t_min` of the crossing on. So rounding cannot toggle a
boundary, and boundaries that touch each other or a surface are crossed one after the other, each once.
"""

from typing import Any

import warp as wp

from fgf_warp.device.numerics import INFINITE, choose, unit

MISS = wp.constant(0)
BOUNDARY = wp.constant(1)
"""Of a medium, with nothing on it: `item` is the container's bit."""
SURFACE = wp.constant(2)
"""`item` is the surface."""
LIGHT = wp.constant(3)
"""`item` is the light."""

SPHERE = wp.constant(0)
CUBE = wp.constant(1)
CYLINDER = wp.constant(2)

MARGIN = wp.constant(1.0e-6)
"""Relative distance that a scattering event keeps from the face of a mesh ahead."""
OFFSET = wp.constant(4.0e-6)
"""Relative step off a surface: some fifty units in the last place of the coordinates."""
TOUCH = wp.constant(1.0e-5)
"""Relative distance between crossings that are one: by which rounding parts faces that coincide, at slants too."""


@wp.struct
class Hit:
    """The nearest thing on a ray."""

    t: float
    kind: int
    item: int
    normal: wp.vec3
    """Unit outward normal of a surface or light; not set for a boundary."""
    face: int
    """Of a triangle: its number in its mesh; -1 on a solid. Set where the scene has shading or mesh lights."""
    u: float
    v: float
    """Of a triangle: weights of its second and third corners."""


@wp.struct
class Start:
    """Where on its ray a path is."""

    t_min: float
    """Distance of the last crossing, 0 at the ray's origin."""
    inside: wp.uint32
    """Containers around it there, one bit each."""
    crossed: int
    """The container last crossed on this ray, or -1."""
    slack: float
    """How far the ray's origin may be from where it should be, across a face."""
    passed: float
    """Distance of the surface last passed on this ray: surfaces up to it are not met; 0 at the ray's origin."""
    time: float
    """In [0, 1): from the opening of the shutter to its closing."""
    casters: wp.uint32
    """Of a connection to a light whose shadows some shapes cast: its bit; 0: all cast them."""
    entered: wp.uint32
    """Those of `inside` that were entered at the last crossing or within rounding of it."""


@wp.struct
class Placement:
    """Where an object is."""

    to_object: wp.mat33
    """Inverse of the object's axes in the world."""
    position: wp.vec3
    """Of the object's origin in the world."""


@wp.struct
class Motion:
    """The matrix that takes an object to the world, when the shutter opens and when it closes."""

    axes: wp.mat33
    position: wp.vec3
    closing_axes: wp.mat33
    closing_position: wp.vec3


@wp.struct
class Solid:
    """A canonical solid: unit sphere, [-1, 1]^3, or unit cylinder around z between -1 and 1."""

    kind: int
    to_object: wp.mat33
    to_object_offset: wp.vec3
    surface: int
    """-1: a bare boundary."""
    container: int
    """Bit of the medium that fills it, or -1."""
    is_open: int
    """1: light may enter the medium through its surface, which is then a boundary too."""
    shadow_links: wp.uint32
    """Bits of the lights in whose light it casts a shadow."""
    motion: int
    """Index of its motion, or -1."""


@wp.func
def place_at(motion: Motion, time: float) -> Placement:
    """Where a moving object is at a time in [0, 1]: its matrix moves linearly, so its points move along lines."""
    placement = Placement()
    placement.to_object = wp.inverse(motion.axes * (1.0 - time) + motion.closing_axes * time)
    placement.position = motion.position * (1.0 - time) + motion.closing_position * time
    return placement


@wp.func
def solid_at(solid: Solid, motions: wp.array(dtype=Motion), time: float) -> Solid:
    """The solid where it is at a time in [0, 1]."""
    placed = solid
    if solid.motion >= 0:
        placement = place_at(motions[solid.motion], time)
        placed.to_object = placement.to_object
        placed.to_object_offset = -(placement.to_object * placement.position)
    return placed


@wp.func(inline=True)
def is_inside(inside: wp.uint32, container: int) -> bool:
    """True where the path is in this container."""
    return ((inside >> wp.uint32(container)) & wp.uint32(1)) == wp.uint32(1)


@wp.func(inline=True)
def cross_boundary(inside: wp.uint32, container: int) -> wp.uint32:
    """The path's containers after it has crossed the boundary of one."""
    return inside ^ (wp.uint32(1) << wp.uint32(container))


@wp.func(inline=True)
def casts_shadow(shadow_links: wp.uint32, casters: wp.uint32) -> bool:
    """True where a shape of these `shadow_links` blocks a ray with `Start.casters`."""
    return casters == wp.uint32(0) or (shadow_links & casters) != wp.uint32(0)


@wp.func(inline=True)
def coordinate_reach(position: wp.vec3, t: float) -> float:
    """Size of the coordinates along a ray up to t: rounding moves a point of it by some 1e-7 of that."""
    return wp.max(wp.max(wp.abs(position[0]), wp.abs(position[1])), wp.abs(position[2])) + t


@wp.func(inline=True)
def entered_at(start: Start, container: int, origin: wp.vec3, t: float, rounding: float) -> wp.uint32:
    """`Start.entered` after the boundary of one is crossed at t; `rounding` is that of boundaries, beside the ray's."""
    beyond = cross_boundary(start.inside, container)
    is_near = t - start.t_min <= TOUCH * coordinate_reach(origin, t) + rounding
    return wp.where(is_near, start.entered, wp.uint32(0)) | (beyond & (beyond ^ start.inside))


@wp.func(inline=True)
def offset_from_surface(position: wp.vec3, normal: wp.vec3, t: float) -> wp.vec3:
    """A start for the next ray that rounding cannot put behind the surface."""
    return position + normal * (coordinate_reach(position, t) * OFFSET)


@wp.func(inline=True)
def slab_interval(o: float, d: float) -> wp.vec2:
    """Where a ray is between -1 and 1 along one axis: (t_enter, t_exit), empty if t_enter > t_exit."""
    slope = wp.where(d == 0.0, 1.0, d)
    t0 = (-1.0 - o) / slope
    t1 = (1.0 - o) / slope
    reach = wp.where(wp.abs(o) <= 1.0, INFINITE, -INFINITE)
    return wp.vec2(wp.where(d == 0.0, -reach, wp.min(t0, t1)), wp.where(d == 0.0, reach, wp.max(t0, t1)))


@wp.func(inline=True)
def round_interval(o: wp.vec3, d: wp.vec3) -> wp.vec2:
    """Where a ray is within distance 1 of the origin; (t_enter, t_exit), empty if t_enter > t_exit.

    The distance is taken at the nearest point, which keeps its digits far away (Haines et al. 2019).
    """
    a = wp.dot(d, d)
    slope = wp.where(a == 0.0, 1.0, a)
    t_near = -wp.dot(o, d) / slope
    closest = o + d * t_near
    room = 1.0 - wp.dot(closest, closest)
    half = wp.where(a == 0.0, INFINITE, wp.sqrt(wp.max(room, 0.0) / slope))
    return wp.vec2(wp.where(room < 0.0, INFINITE, t_near - half), wp.where(room < 0.0, -INFINITE, t_near + half))


@wp.func(inline=True)
def solid_interval(kind: int, o: wp.vec3, d: wp.vec3) -> wp.vec2:
    """Where a ray is in a canonical solid; (t_enter, t_exit), empty if t_enter > t_exit."""
    if kind == SPHERE:
        return round_interval(o, d)
    z = slab_interval(o[2], d[2])
    if kind == CUBE:
        x = slab_interval(o[0], d[0])
        y = slab_interval(o[1], d[1])
        return wp.vec2(wp.max(wp.max(x[0], y[0]), z[0]), wp.min(wp.min(x[1], y[1]), z[1]))
    side = round_interval(wp.vec3(o[0], o[1], 0.0), wp.vec3(d[0], d[1], 0.0))
    return wp.vec2(wp.max(side[0], z[0]), wp.min(side[1], z[1]))


@wp.func(inline=True)
def solid_normal(kind: int, p: wp.vec3) -> wp.vec3:
    """Outward normal, not normalised, of a canonical solid at a point of its surface."""
    x = wp.abs(p[0])
    y = wp.abs(p[1])
    z = wp.abs(p[2])
    on_x = x >= y and x >= z
    on_y = y >= z and not on_x
    of_cube = wp.vec3(wp.where(on_x, p[0], 0.0), wp.where(on_y, p[1], 0.0), wp.where(on_x or on_y, 0.0, p[2]))
    on_cap = z >= wp.sqrt(x * x + y * y)
    of_cylinder = wp.vec3(wp.where(on_cap, 0.0, p[0]), wp.where(on_cap, 0.0, p[1]), wp.where(on_cap, p[2], 0.0))
    return choose(kind == SPHERE, p, choose(kind == CUBE, of_cube, of_cylinder))


@wp.func(inline=True)
def boundary_distance(span: wp.vec2, t_min: float, is_within: bool) -> float:
    """Distance, t_min or more, at which a ray crosses the boundary that spans (t_enter, t_exit), else INFINITE.

    A ray that is in what it has not entered, since it stepped off a surface in it or was rounded across a face that
    two boundaries share, enters at t_min; one that is out of what it has not left, leaves at t_min.
    """
    meets = span[0] <= span[1]
    leaves = wp.where(meets, wp.max(span[1], t_min), t_min)
    enters = wp.where(meets and span[1] > t_min, wp.max(span[0], t_min), INFINITE)
    return wp.where(is_within, leaves, enters)


@wp.func(inline=True)
def chord(span: wp.vec2, is_within: bool) -> wp.vec2:
    """Where a ray is in the solid that spans (t_enter, t_exit): from 0 on, and empty where it never is.

    Whether its origin is within is known, not computed, as for `boundary_distance`.
    """
    meets = span[0] <= span[1]
    leaves = wp.where(meets, wp.max(span[1], 0.0), 0.0)
    enters = meets and span[1] > 0.0
    first = wp.where(enters, wp.max(span[0], 0.0), INFINITE)
    last = wp.where(enters, span[1], -INFINITE)
    return wp.vec2(wp.where(is_within, 0.0, first), wp.where(is_within, leaves, last))


@wp.func(inline=True)
def surface_distance(span: wp.vec2, passed: float) -> float:
    """Distance beyond `passed` at which a ray meets the surface that spans (t_enter, t_exit); INFINITE for none."""
    ahead = wp.where(span[0] > passed, span[0], span[1])
    return wp.where(span[0] <= span[1] and span[1] > passed, ahead, INFINITE)


@wp.func(inline=True)
def intersect_solid_boundary(solid: Solid, span: wp.vec2, start: Start, nearest: Hit) -> Hit:
    """`nearest`, or the boundary before it."""
    hit = nearest
    t = boundary_distance(span, start.t_min, is_inside(start.inside, solid.container))
    is_nearer = t < nearest.t
    hit.t = wp.where(is_nearer, t, nearest.t)
    hit.kind = wp.where(is_nearer, BOUNDARY, nearest.kind)
    hit.item = wp.where(is_nearer, solid.container, nearest.item)
    return hit


@wp.func(inline=True)
def intersect_solid_surface(
    solid: Solid, span: wp.vec2, origin: wp.vec3, direction: wp.vec3, start: Start, nearest: Hit
) -> Hit:
    """`nearest`, or the surface before it."""
    return take_surface_at(solid, surface_distance(span, start.passed), origin, direction, nearest)


@wp.func(inline=True)
def intersect_open_surface(
    solid: Solid, span: wp.vec2, origin: wp.vec3, direction: wp.vec3, start: Start, nearest: Hit
) -> Hit:
    """The same among surfaces that light may enter media through, which are met as boundaries are."""
    t = surface_distance(span, start.passed)
    if solid.is_open == 1:
        t = boundary_distance(span, start.t_min, is_inside(start.inside, solid.container))
    return take_surface_at(solid, t, origin, direction, nearest)


@wp.func(inline=True)
def take_surface_at(solid: Solid, t: float, origin: wp.vec3, direction: wp.vec3, nearest: Hit) -> Hit:
    """`nearest`, or the surface at distance t."""
    hit = nearest
    is_nearer = t < nearest.t
    p = solid.to_object * (origin + direction * wp.where(is_nearer, t, 0.0)) + solid.to_object_offset
    normal = unit(wp.transpose(solid.to_object) * solid_normal(solid.kind, p))
    hit.t = wp.where(is_nearer, t, nearest.t)
    hit.kind = wp.where(is_nearer, SURFACE, nearest.kind)
    hit.item = wp.where(is_nearer, solid.surface, nearest.item)
    hit.normal = choose(is_nearer, normal, nearest.normal)
    hit.face = wp.where(is_nearer, -1, nearest.face)
    return hit


@wp.func(inline=True)
def solid_span(solid: Solid, kind: int, origin: wp.vec3, direction: wp.vec3) -> wp.vec2:
    """Where a ray is in a solid of this kind."""
    o = solid.to_object * origin + solid.to_object_offset
    d = solid.to_object * direction
    return solid_interval(kind, o, d)


def build_intersect_solid(features: Any) -> Any:
    """The function that meets a ray with a solid in a scene of these features.

    It has the arguments (solid, motions, origin, direction, start, nearest), and gives `nearest`, or the solid where it
    is before that.
    """
    intersect_surface = intersect_open_surface if features.passes else intersect_solid_surface

    @wp.func
    def intersect_solid(
        solid: Solid, motions: wp.array(dtype=Motion), origin: wp.vec3, direction: wp.vec3, start: Start, nearest: Hit
    ) -> Hit:
        placed = solid
        if wp.static(features.motion):
            placed = solid_at(solid, motions, start.time)
        span = solid_span(placed, placed.kind, origin, direction)
        if placed.surface < 0:
            return intersect_solid_boundary(placed, span, start, nearest)
        if wp.static(features.links):
            if not casts_shadow(placed.shadow_links, start.casters):
                return nearest
        return intersect_surface(placed, span, origin, direction, start, nearest)

    return intersect_solid


def build_intersect_solids(features: Any) -> Any:
    """The same for all of the solids that are tried one after the other, an array in the place of one."""
    intersect_solid = build_intersect_solid(features)

    @wp.func
    def intersect_solids(
        solids: wp.array(dtype=Solid),
        motions: wp.array(dtype=Motion),
        origin: wp.vec3,
        direction: wp.vec3,
        start: Start,
        nearest: Hit,
    ) -> Hit:
        hit = nearest
        for i in range(solids.shape[0]):
            hit = intersect_solid(solids[i], motions, origin, direction, start, hit)
        return hit

    return intersect_solids
