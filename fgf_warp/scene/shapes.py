"""What a scene's light and paths meet: solids, meshes, and either in many places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Literal

import numpy as np

from fgf_warp.errors import SceneError
from fgf_warp.scene.boxes import Box
from fgf_warp.scene.checks import check_motion, check_places, check_primvars
from fgf_warp.scene.mesh import Mesh
from fgf_warp.scene.placements import blocks, bound_places, keyframes, squared
from fgf_warp.scene.shells import winding_number
from fgf_warp.scene.surface import Surface

CUBE_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
"""(8, 3) float64, of the box around each canonical solid."""
MANY_SOLIDS = 100
"""Where more solids than that have a bare surface, rays look them up in a tree; else they try one after the other."""
MAX_CONTAINERS = 32
"""The most shapes that may be filled with a medium: each has one bit in a path's state."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A canonical solid under an affine transform.

    ``sphere`` has radius 1, ``cube`` is [-1, 1]^3, ``cylinder`` has radius 1 around z with caps at z = -1, 1.

    Args:
        name: the prim path.
        kind: ``sphere``, ``cube`` or ``cylinder``.
        object_to_world: (4, 4) float64, invertible.
        surface: what its surface does to light; None lets light through unchanged, as the boundary of a medium may.
        medium: index into `Scene.media` of what fills it, or None.
        closing: (4, 4) float64, `object_to_world` when the shutter closes; None: it rests.
        primvars: name to the value on all of it, (k,) float32.
        instance: its number in the instancer, or -1.
        light_links: bit k is set where lights whose `link` is k shine on it.
        shadow_links: bit k is set where it casts a shadow in the light of those whose `shadow_link` is k.

    Raises:
        SceneError: for a matrix that is not finite or not invertible, as float32.
    """

    name: str
    kind: Literal["sphere", "cube", "cylinder"]
    object_to_world: np.ndarray
    surface: Surface | None = None
    medium: int | None = None
    closing: np.ndarray | None = None
    primvars: Mapping[str, np.ndarray] = field(default_factory=dict)
    instance: int = -1
    light_links: int = 0
    shadow_links: int = 0

    def __post_init__(self) -> None:
        check_motion(self.name, "object_to_world", self.object_to_world, self.closing)


@dataclass(frozen=True, eq=False)
class Instances:
    """A mesh or a solid in many places, which are one array: a million of them take 100 MB of memory.

    Instances whose prototypes hold the same arrays, as objects, share what is made of these.

    Args:
        name: the prim path.
        prototype: what stands there, with its surface and medium: a mesh in its own space, or a solid that rests, whose
            own transform comes first.
        object_to_world: (n, 3, 4) float64, n > 0, the upper rows of the matrix of each, which is invertible.
        closing: (n, 3, 4) float64, the same when the shutter closes; None: all rest.
        numbers: (n,) int, the number of each in its instancer; None: they are in none.
        primvars: name to (n, k) float32, a value for each, in place of the prototype's.
        light_links: as for `Solid`, of all of them.
        shadow_links: as for `Solid`, of all of them.

    Raises:
        SceneError: for arrays that do not fit, matrices that are not finite or not invertible, or more than one
            instance of what a medium fills, since each is a shape of its own.
    """

    name: str
    prototype: Mesh | Solid
    object_to_world: np.ndarray
    closing: np.ndarray | None = None
    numbers: np.ndarray | None = None
    primvars: Mapping[str, np.ndarray] = field(default_factory=dict)
    light_links: int = 0
    shadow_links: int = 0

    def __post_init__(self) -> None:
        check_places(self.name, "object_to_world", self.object_to_world, self.count)
        if self.closing is not None:
            check_places(self.name, "closing", self.closing, self.count)
        if self.numbers is not None and self.numbers.shape != (self.count,):
            raise SceneError(f"{self.name}: numbers must be a ({self.count},) array")
        check_primvars(self.name, self.primvars, ((self.count,),))
        if isinstance(self.prototype, Solid) and (self.medium is not None or self.prototype.closing is not None):
            raise SceneError(f"{self.name}: a solid that is filled or moves is no prototype; accepted: each as a Solid")
        if self.medium is not None and self.count > 1:
            raise SceneError(
                f"{self.name}: {self.count} instances are filled with a medium; accepted: each as Instances of its own"
            )

    @property
    def count(self) -> int:
        """Number of instances."""
        return len(self.object_to_world)

    @cached_property
    def bounds(self) -> Box:
        """Lowest and highest corner, (3,) float64 each, of a box that holds all of them wherever they move."""
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        box = shape_bounds(self.prototype)
        for places in keyframes(self.object_to_world, self.closing):
            for at in blocks(self.count):
                lows, highs = bound_places(places[at], *box)
                low, high = np.minimum(low, lows.min(axis=0)), np.maximum(high, highs.max(axis=0))
        return low, high

    @property
    def surface(self) -> Surface | None:
        """The prototype's surface."""
        return self.prototype.surface

    @property
    def medium(self) -> int | None:
        """The medium that fills the prototype, as an index, or None."""
        return self.prototype.medium


Shape = Solid | Mesh | Instances


def count_of(shape: Shape) -> int:
    """In how many places a shape is."""
    return shape.count if isinstance(shape, Instances) else 1


def moves(shape: Shape) -> bool:
    """True where a shape moves while the shutter is open."""
    return not isinstance(shape, Mesh) and shape.closing is not None


def drifts_of(shape: Shape) -> np.ndarray:
    """How far points of a shape move while the shutter is open, by where they are at its opening.

    Returns:
        (n, 3, 4) float64, of each of its places the upper rows of the matrix that gives the way [stage unit] of a point
        of the world that moves with it; 0 of what rests.
    """
    if isinstance(shape, Mesh) or shape.closing is None:
        return np.zeros((count_of(shape), 3, 4))
    opening, closing = (
        squared(matrices if isinstance(shape, Instances) else matrices[None, :3])
        for matrices in (shape.object_to_world, shape.closing)
    )
    drifts = (closing @ np.linalg.inv(opening) - np.eye(4))[:, :3]
    drifts[(opening == closing).all(axis=(1, 2))] = 0
    return drifts


def shape_bounds(shape: Shape) -> Box:
    """A box that holds a shape wherever it moves; not tight for a round solid that is turned.

    Returns:
        Lowest and highest corner, (3,) float each, in world space.
    """
    if not isinstance(shape, Solid):
        return shape.bounds
    matrices = keyframes(shape.object_to_world, shape.closing)
    points = np.concatenate([CUBE_CORNERS @ matrix[:3, :3].T + matrix[:3, 3] for matrix in matrices])
    return points.min(axis=0), points.max(axis=0)


def shape_widths(shape: Shape) -> tuple[float, float]:
    """How thin a shape is and how long; other than solids by their bounding boxes.

    Returns:
        Its least width, and a length that no segment in it exceeds [stage unit].
    """
    if not isinstance(shape, Solid):
        low, high = shape_bounds(shape)
        return float((high - low).min()), float(np.linalg.norm(high - low))
    matrix = shape.object_to_world[:3, :3]
    stretches = np.linalg.svd(matrix, compute_uv=False)
    longest = stretches.max() if shape.kind == "sphere" else np.linalg.norm(CUBE_CORNERS @ matrix.T, axis=1).max()
    return 2 * float(stretches.min()), 2 * float(longest)


def encloses(shape: Shape, point: np.ndarray) -> bool:
    """Whether a point lies in a closed shape when the shutter opens.

    Args:
        shape: of instances, any of them counts.
        point: (3,) float64, in world space.
    """
    if isinstance(shape, Mesh):
        return any(winding_number(body.points, body.triangles, point) > 0.5 for body in shape.bodies)
    if isinstance(shape, Instances):
        return any(encloses(shape.prototype, local) for local in points_in(shape, point))
    x, y, z = np.linalg.solve(shape.object_to_world, np.append(point, 1.0))[:3]
    if shape.kind == "sphere":
        return bool(x * x + y * y + z * z < 1)
    if shape.kind == "cube":
        return bool(max(abs(x), abs(y), abs(z)) < 1)
    return bool(x * x + y * y < 1 and abs(z) < 1)


def points_in(instances: Instances, point: np.ndarray) -> np.ndarray:
    """A point in the space of each instance whose bounding box holds it when the shutter opens.

    Args:
        instances: of which most are far from it.
        point: (3,) float64, in world space.

    Returns:
        (m, 3) float64, for those m instances.
    """
    low, high = bound_places(instances.object_to_world, *shape_bounds(instances.prototype))
    near = np.flatnonzero(((low <= point) & (point <= high)).all(axis=1))
    local: np.ndarray = np.linalg.solve(squared(instances.object_to_world[near]), np.append(point, 1.0)[:, None])
    return local[:, :3, 0]


def bodies_of(shape: Shape) -> tuple[Shape, ...]:
    """The shape itself, or in place of a mesh whose shells overlap, nest or touch, the `Mesh.bodies` of it."""
    mesh = _mesh_of(shape)
    return (shape,) if mesh is None else _in_its_place(shape, mesh.bodies)


def separate_count(shape: Shape) -> int:
    """Number of `separate_bodies_of` a shape."""
    mesh = _mesh_of(shape)
    return 1 if mesh is None else mesh.separate_count


def separate_bodies_of(shape: Shape) -> tuple[Shape, ...]:
    """The shape itself, or in place of a mesh of several shells, the `Mesh.separate_bodies` of it."""
    mesh = _mesh_of(shape)
    return (shape,) if mesh is None else _in_its_place(shape, mesh.separate_bodies)


def _mesh_of(shape: Shape) -> Mesh | None:
    """The mesh of a shape, or that its instances are of; None of solids."""
    found = shape.prototype if isinstance(shape, Instances) else shape
    return found if isinstance(found, Mesh) else None


def _in_its_place(shape: Shape, parts: Sequence[Mesh]) -> tuple[Shape, ...]:
    """Parts of the mesh of a shape, where they are instances as the shape is."""
    if isinstance(shape, Instances):
        return tuple(shape if part is shape.prototype else replace(shape, prototype=part) for part in parts)
    return tuple(parts)


def solids_in_tree(shapes: Sequence[Shape]) -> list[Solid | Instances]:
    """The solids that rays look up in a tree: none, or all bare ones, which have a surface and no medium.

    It is all where there are more than `MANY_SOLIDS`, or instances of solids, which are always in the tree.
    """
    solids = [
        shape
        for shape in shapes
        if isinstance(shape, Solid) or (isinstance(shape, Instances) and isinstance(shape.prototype, Solid))
    ]
    bare = [solid for solid in solids if solid.surface is not None and solid.medium is None]
    return bare if len(bare) > MANY_SOLIDS or any(isinstance(solid, Instances) for solid in bare) else []
