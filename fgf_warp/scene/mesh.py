"""Triangle meshes, and what one must be to bound a medium."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fgf_warp.errors import OpenMeshError, SceneError
from fgf_warp.scene.boxes import Box
from fgf_warp.scene.checks import check_finite_array, check_primvars
from fgf_warp.scene.shells import Shells, count_unmatched, find_shells, weld
from fgf_warp.scene.surface import Surface, lets_light_through

NO_VOLUME = (
    "a medium needs a closed mesh, and of this one the faces are there twice, facing both ways: it encloses no volume"
)
DOUBLED_FACES = "faces of the mesh of a medium are there twice, facing both ways, and bound nothing; they are left out"
INWARD_SHELL = "a part of the mesh of a medium faces inwards with nothing around it; it is turned"


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh: in world space, or in that of its instances.

    Args:
        name: the prim path.
        points: (n, 3) float, finite [stage unit].
        triangles: (m, 3) int32 indices into points; counter-clockwise seen from outside.
        surface: as for `Solid`.
        medium: index into `Scene.media` of what fills it, or None. The mesh must then be closed: the medium is in any
            of its shells but not in their cavities, which face inwards. A shell that faces inwards with nothing around
            it is turned.
        normals: (m, 3, 3) float32, unit shading normals at the corners of each triangle; None: the triangles' own.
        primvars: name to (1, 1, k), (m, 1, k) or (m, 3, k) float32, the values of the whole mesh, of each triangle, or
            at the corners of each, between which they are interpolated.
        instance: as for `Solid`.
        light_links: as for `Solid`.
        shadow_links: as for `Solid`.

    Raises:
        SceneError: for points or normals that are not finite, indices out of range, or arrays that do not fit.
        OpenMeshError: for a medium in a mesh that is not closed (an edge that two triangles do not share in opposite
            directions) or encloses no volume.
    """

    name: str
    points: np.ndarray
    triangles: np.ndarray
    surface: Surface | None = None
    medium: int | None = None
    normals: np.ndarray | None = None
    primvars: Mapping[str, np.ndarray] = field(default_factory=dict)
    instance: int = -1
    light_links: int = 0
    shadow_links: int = 0

    def __post_init__(self) -> None:
        check_finite_array(self.name, "points", self.points, ("n", 3))
        if self.triangles.ndim != 2 or self.triangles.shape[1] != 3 or not len(self.triangles):
            raise SceneError(f"{self.name}: the mesh has no triangles")
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.points):
            raise SceneError(f"{self.name}: face vertex indices must lie in [0, {len(self.points) - 1}]")
        count = len(self.triangles)
        if self.normals is not None:
            check_finite_array(self.name, "normals", self.normals, (count, 3, 3))
        check_primvars(self.name, self.primvars, ((1, 1), (count, 1), (count, 3)))
        if self.medium is not None:
            open_edges = int(count_unmatched(self._welded).sum())
            if open_edges:
                raise OpenMeshError(
                    f"{self.name}: a medium needs a closed mesh, and this one has {open_edges} open or "
                    "inconsistently oriented edges"
                )
            if not self._shells.count:
                raise OpenMeshError(f"{self.name}: {NO_VOLUME}")
            del self.__dict__["_welded"]  # As large as the mesh, and of no further use.

    @cached_property
    def _welded(self) -> np.ndarray:
        """(m, 3) int, the triangles with one number for points that coincide."""
        return weld(self.points)[self.triangles]

    @cached_property
    def _shells(self) -> Shells:
        """The closed surfaces that it is made of; only of a mesh that a medium fills."""
        return find_shells(self.points, self.triangles, self._welded)

    @property
    def _is_crossed(self) -> bool:
        """True where paths enter the medium through the mesh, so that its shells must be told apart."""
        return self.medium is not None and lets_light_through(self.surface)

    @cached_property
    def bodies(self) -> tuple[Mesh, ...]:
        """The mesh itself, or where shells of it overlap, nest or touch, several meshes of which none has such."""
        if not self._is_crossed or self._shells.are_plain:
            return (self,)
        return tuple(self._part(self._shells.groups == group) for group in range(self._shells.count))

    @property
    def separate_count(self) -> int:
        """Number of `separate_bodies`, which need not be made to be counted."""
        return self._shells.body_count if self._is_crossed else 1

    @cached_property
    def separate_bodies(self) -> tuple[Mesh, ...]:
        """The mesh itself, or where several shells of it lie apart, a mesh of each with its cavities."""
        if self.separate_count == 1:
            return (self,)
        return tuple(self._part(self._shells.bodies == body, own_points=True) for body in range(self.separate_count))

    def _part(self, is_part: np.ndarray, *, own_points: bool = False) -> Mesh:
        """Some shells as a mesh of their own.

        Args:
            is_part: (m,) bool, the triangles of these shells.
            own_points: whether it has the points of these shells alone, and not all of them.
        """
        chosen = np.flatnonzero(is_part)
        corners = np.where(self._shells.turned[chosen, None], [2, 1, 0], [0, 1, 2])

        def part(values: np.ndarray) -> np.ndarray:
            rows = values if len(values) == 1 else values[chosen]
            return rows if rows.shape[1] == 1 else np.take_along_axis(rows, corners[..., None], axis=1)

        points, triangles = self.points, np.take_along_axis(self.triangles[chosen], corners, axis=1)
        if own_points:
            used, numbers = np.unique(triangles, return_inverse=True)
            points, triangles = points[used], numbers.reshape(-1, 3).astype(np.int32)
        return replace(
            self,
            points=points,
            triangles=triangles,
            normals=None if self.normals is None else part(self.normals),
            primvars={name: part(values) for name, values in self.primvars.items()},
        )

    @cached_property
    def mended(self) -> tuple[str, ...]:
        """What had to be done for the mesh to bound its medium, one sentence each."""
        found = []
        if self._is_crossed and self._shells.turned.any():
            found.append(INWARD_SHELL)
        if self._is_crossed and (self._shells.groups < 0).any():
            found.append(DOUBLED_FACES)
        return tuple(found)

    @cached_property
    def bounds(self) -> Box:
        """Lowest and highest corner, (3,) of the points' type each, of the box around the triangles."""
        is_used = np.zeros(len(self.points), dtype=bool)
        is_used[self.triangles] = True
        points = self.points[is_used]
        return points.min(axis=0), points.max(axis=0)


def count_open_edges(points: np.ndarray, triangles: np.ndarray) -> int:
    """Number of directed edges of a mesh that no triangle runs along in the other direction.

    Points that coincide are taken as one, so seams between texture or normal islands do not count.

    Args:
        points: (n, 3) float.
        triangles: (m, 3) int.

    Returns:
        Their number; 0 for a closed, consistently oriented mesh.
    """
    return int(count_unmatched(weld(points)[triangles]).sum())
