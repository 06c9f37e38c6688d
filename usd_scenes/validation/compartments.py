"""Which parts of space share light.

Opaque closed shapes, the walls, part space into compartments that no light passes between. The compartment of a point
is the set of the walls around it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fgf_warp.scene import (
    AreaLight,
    DistantLight,
    DomeLight,
    Instances,
    Light,
    Mesh,
    MeshLight,
    Shape,
    Solid,
    count_open_edges,
    encloses,
    points_in,
    shape_bounds,
)

Compartment = frozenset[str]
"""Names of walls."""
OUTSIDE: Compartment = frozenset()

MESH_SAMPLES = 8
"""Triangles of a mesh that stand for all of it."""
INSTANCE_SAMPLES = 8
"""Instances that stand for all of them."""
ABOVE_LIGHT = 1e-3
"""How far above a flat light its compartment is looked for, in units of its size: it may lie in a wall."""
POLES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=np.float64)


class Walls:
    """The opaque closed shapes of a scene.

    Args:
        shapes: all of a scene's.
    """

    def __init__(self, shapes: Sequence[Shape]) -> None:
        self._walls = [shape for shape in shapes if is_opaque(shape)]
        boxes = np.array([shape_bounds(wall) for wall in self._walls]).reshape(-1, 2, 3)
        self._lows, self._highs = boxes[:, 0], boxes[:, 1]
        self._closed: dict[int, bool] = {}

    def around(self, point: np.ndarray, but: Shape | None = None) -> Compartment:
        """The compartment of a point, (3,) float64; `but` is not taken as a wall."""
        near = np.flatnonzero(((self._lows < point) & (point < self._highs)).all(axis=1))
        return frozenset(
            self._walls[k].name
            for k in map(int, near)
            if self._walls[k] is not but and is_inside(self._walls[k], point) and self._is_closed(k)
        )

    def _is_closed(self, k: int) -> bool:
        wall = self._walls[k]
        mesh = wall.prototype if isinstance(wall, Instances) else wall
        if isinstance(mesh, Solid):
            return True
        if k not in self._closed:
            self._closed[k] = count_open_edges(mesh.points, mesh.triangles) == 0
        return self._closed[k]


def is_inside(shape: Shape, point: np.ndarray) -> bool:
    """True where the point, (3,) float64 in world space, lies in the closed shape."""
    if isinstance(shape, Instances):
        return any(is_inside(shape.prototype, local) for local in points_in(shape, point))
    return count_crossings(shape, point) > 0 if isinstance(shape, Mesh) else encloses(shape, point)


def count_crossings(mesh: Mesh, point: np.ndarray) -> int:
    """How often a closed mesh winds around a point, by what a ray along x leaves less what it enters.

    Only the triangles that the ray's line passes are looked at, so this is much faster than the solid angles of
    `winding_number`. Of an edge, which two triangles share, both see the same side of the line.

    Args:
        mesh: closed, in world space.
        point: (3,) float64, in world space.

    Returns:
        1 inside a mesh that faces outwards, 0 outside; more or less than that where the mesh lies in itself or is
        turned.
    """
    points, triangles = np.asarray(mesh.points), np.asarray(mesh.triangles)
    above = points[:, 1] > point[1]
    sides = above[triangles]
    some = np.flatnonzero(sides.any(axis=1) & ~sides.all(axis=1))
    corners = points[triangles[some]].astype(np.float64) - point
    turns = np.zeros(len(some), dtype=np.int64)
    for first in range(3):
        a, b = corners[:, first], corners[:, (first + 1) % 3]
        rises = (b[:, 1] > 0).astype(np.int64) - (a[:, 1] > 0)
        # From the lower end to the upper, whichever way the triangle goes along the edge.
        low, high = (np.where(rises[:, None] > 0, *pair) for pair in ((a, b), (b, a)))
        rise = np.where(rises != 0, high[:, 1] - low[:, 1], 1.0)
        turns += rises * (low[:, 2] - low[:, 1] / rise * (high[:, 2] - low[:, 2]) < 0)
    passed = np.flatnonzero(turns)
    a, b, c = (corners[passed, corner] for corner in range(3))
    normals = np.cross(b - a, c - a)
    ahead = np.einsum("ij,ij->i", normals, a) * normals[:, 0] > 0
    return int(turns[passed][ahead].sum())


def is_opaque(shape: Shape) -> bool:
    """True where no light passes the shape's surface."""
    return shape.surface is not None and not shape.surface.may_be_transparent


def lit_compartments(walls: Walls, shapes: Sequence[Shape], lights: Sequence[Light]) -> set[Compartment]:
    """Those that some light shines in: of the scene's lights, or of shapes that emit to both sides."""
    lit = {compartment_of(light, walls) for light in lights}
    for shape in shapes:
        if shape.surface is not None and shape.surface.emits:
            for outside in compartments_of(shape, walls):
                lit |= {outside, outside | {shape.name}}
    return lit


def compartment_of(light: Light, walls: Walls) -> Compartment:
    """Where a light shines from; those at infinity are outside."""
    if isinstance(light, DistantLight | DomeLight):
        return OUTSIDE
    if isinstance(light, MeshLight):
        a, b, c = light.corners[0]
        return walls.around((a + b + c) / 3 + ABOVE_LIGHT * np.cross(b - a, c - a) / np.sqrt(2 * light.areas[0] or 1.0))
    center = np.array(light.center)
    if isinstance(light, AreaLight):
        normal = np.cross(light.half_u, light.half_v)
        center += ABOVE_LIGHT * normal / np.sqrt(np.linalg.norm(normal))
    return walls.around(center)


def compartments_of(shape: Shape, walls: Walls) -> set[Compartment]:
    """Those that a shape lies in, by some points on it."""
    return {walls.around(point, but=shape) for point in _points_on(shape)}


def _points_on(shape: Shape) -> Iterator[np.ndarray]:
    if isinstance(shape, Mesh):
        some = np.unique(np.linspace(0, len(shape.triangles) - 1, MESH_SAMPLES).astype(int))
        yield from shape.points[shape.triangles[some]].mean(axis=1)
        return
    if isinstance(shape, Instances):
        some = np.unique(np.linspace(0, shape.count - 1, INSTANCE_SAMPLES).astype(int))
        matrices, local = shape.object_to_world[some], list(_points_on(shape.prototype))
    else:
        matrices, local = shape.object_to_world[None], list(POLES)
    yield from (matrix[:3, :3] @ point + matrix[:3, 3] for matrix in matrices for point in local)
