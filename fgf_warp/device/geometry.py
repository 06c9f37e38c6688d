"""Rays against solids, and what all that rays can meet has in common.

A boundary of a medium is a switch: from outside only its front is met, from inside only its back. Which side
a path is on is known from what it crossed (its `inside` bits), not from coordinates. So rounding at a crossing
cannot toggle it, and a path that is inside and finds no way out has rounded past the boundary and leaves at once.
"""

import warp as wp

from fgf_warp.device.numerics import INFINITE

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
"""Relative step off a surface, a few units in the last place of the coordinates."""


@wp.struct
class Hit:
    """The nearest thing on a ray."""

    t: float
    kind: int
    item: int
    normal: wp.vec3
    """Unit outward normal of a surface or light; not set for a boundary."""


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


@wp.func
def is_inside(inside: wp.uint64, container: int) -> bool:
    """True where the path is in this container."""
    return ((inside >> wp.uint64(container)) & wp.uint64(1)) == wp.uint64(1)


@wp.func
def cross_boundary(inside: wp.uint64, container: int) -> wp.uint64:
    """The path's containers after it has crossed the boundary of one."""
    return inside ^ (wp.uint64(1) << wp.uint64(container))


@wp.func
def coordinate_reach(position: wp.vec3, t: float) -> float:
    """Size of the coordinates along a ray up to t: rounding moves a point of it by some 1e-7 of that."""
    return wp.max(wp.max(wp.abs(position[0]), wp.abs(position[1])), wp.abs(position[2])) + t


@wp.func
def offset_from_surface(position: wp.vec3, normal: wp.vec3, t: float) -> wp.vec3:
    """A start for the next ray that rounding cannot put behind the surface."""
    return position + normal * (coordinate_reach(position, t) * OFFSET)


@wp.func
def slab_interval(o: float, d: float) -> wp.vec2:
    """Where a ray is between -1 and 1 along one axis: (t_enter, t_exit), empty if t_enter > t_exit."""
    if d == 0.0:
        return wp.where(wp.abs(o) <= 1.0, wp.vec2(-INFINITE, INFINITE), wp.vec2(INFINITE, -INFINITE))
    t0 = (-1.0 - o) / d
    t1 = (1.0 - o) / d
    return wp.vec2(wp.min(t0, t1), wp.max(t0, t1))


@wp.func
def round_interval(o: wp.vec3, d: wp.vec3) -> wp.vec2:
    """Where a ray is within distance 1 of the origin; (t_enter, t_exit), empty if t_enter > t_exit.

    The distance is taken at the nearest point, which keeps its digits far away (Haines et al. 2019).
    """
    a = wp.length_sq(d)
    if a == 0.0:
        return wp.where(wp.length_sq(o) <= 1.0, wp.vec2(-INFINITE, INFINITE), wp.vec2(INFINITE, -INFINITE))
    t_near = -wp.dot(o, d) / a
    half = (1.0 - wp.length_sq(o + d * t_near)) / a
    if half < 0.0:
        return wp.vec2(INFINITE, -INFINITE)
    return wp.vec2(t_near - wp.sqrt(half), t_near + wp.sqrt(half))


@wp.func
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


@wp.func
def solid_normal(kind: int, p: wp.vec3) -> wp.vec3:
    """Outward normal, not normalised, of a canonical solid at a point of its surface."""
    if kind == SPHERE:
        return p
    a = wp.vec3(wp.abs(p[0]), wp.abs(p[1]), wp.abs(p[2]))
    if kind == CUBE:
        if a[0] >= a[1] and a[0] >= a[2]:
            return wp.vec3(p[0], 0.0, 0.0)
        return wp.where(a[1] >= a[2], wp.vec3(0.0, p[1], 0.0), wp.vec3(0.0, 0.0, p[2]))
    on_cap = a[2] >= wp.sqrt(p[0] * p[0] + p[1] * p[1])
    return wp.where(on_cap, wp.vec3(0.0, 0.0, p[2]), wp.vec3(p[0], p[1], 0.0))


@wp.func
def meet_boundary(span: wp.vec2, is_within: bool) -> float:
    """Distance at which a ray crosses the boundary that spans (t_enter, t_exit); INFINITE where it does not."""
    if is_within:
        return wp.where(span[0] <= span[1], wp.max(span[1], 0.0), 0.0)
    return wp.where(span[0] <= span[1] and span[0] > 0.0, span[0], INFINITE)


@wp.func
def meet_surface(span: wp.vec2) -> float:
    """Distance at which a ray meets the surface that spans (t_enter, t_exit); INFINITE where it does not."""
    if span[0] > span[1] or span[1] <= 0.0:
        return INFINITE
    return wp.where(span[0] > 0.0, span[0], span[1])


@wp.func
def intersect_solids(
    solids: wp.array(dtype=Solid), origin: wp.vec3, direction: wp.vec3, inside: wp.uint64, nearest: Hit
) -> Hit:
    """`nearest`, or the solid before it."""
    hit = nearest
    for i in range(solids.shape[0]):
        solid = solids[i]
        o = solid.to_object * origin + solid.to_object_offset
        d = solid.to_object * direction
        span = solid_interval(solid.kind, o, d)
        if solid.surface >= 0:
            t = meet_surface(span)
            if t < hit.t:
                hit.t = t
                hit.kind = SURFACE
                hit.item = solid.surface
                hit.normal = wp.normalize(wp.transpose(solid.to_object) * solid_normal(solid.kind, o + d * t))
        else:
            t = meet_boundary(span, is_inside(inside, solid.container))
            if t < hit.t:
                hit.t = t
                hit.kind = BOUNDARY
                hit.item = solid.container
    return hit
