"""UsdGeom.Mesh: polygons to triangles that share a look, in the prim's own space."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from fgf_warp.errors import OpenMeshError
from fgf_warp.scene import DOUBLED_FACES, NO_VOLUME, Mesh, lets_light_through
from usd_scenes.reader.attributes import read_array, read_mended_token
from usd_scenes.reader.cage import read_cage, read_places, read_points
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.materials import Look
from usd_scenes.reader.primvars import (
    Polygons,
    Primvar,
    at_corners,
    find_primvar,
    fits_textures,
    fitted,
    read_indices,
    read_primvar,
    read_values,
)
from usd_scenes.reader.subdivision import read_refinement
from usd_scenes.reader.triangulation import cut_faces, signed_volume

NO_FACES = Polygons(0, np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
"""What only constant primvars fit."""
ORIENTATIONS = ("rightHanded", "leftHanded")


class Form:
    """Triangles of a prim in its own space, read once for all its instances.

    Args:
        points: (n, 3) float64.
        triangles: (m, 3) int32, counter-clockwise seen from outside.
        normals: (m, 3, 3) float32, or None.
        context: the stage.
    """

    def __init__(
        self, points: np.ndarray, triangles: np.ndarray, normals: np.ndarray | None, context: StageContext
    ) -> None:
        self.points = points
        self.triangles = triangles
        self.context = context
        self._normals = normals
        self._carried: dict[str, np.ndarray | None] = {}

    @property
    def normals(self) -> np.ndarray | None:
        """(m, 3, 3) float32, unit normals at the corners of the triangles; None: the triangles' own."""
        return self._normals

    def primvar(self, prim: Usd.Prim, name: str) -> np.ndarray | None:
        """A primvar of a prim of this form: (1, 1, k), (m, 1, k) or (m, 3, k) float32; None where there is none."""
        found = find_primvar(prim, name)
        if not found:
            return None
        if found.GetAttr().GetPrim() != prim:  # Instances may inherit different values of it.
            return self._carry(found)
        if name not in self._carried:
            self._carried[name] = self._carry(found)
        return self._carried[name]

    @property
    def doubled(self) -> np.ndarray | None:
        """(m,) bool, the triangles of faces that are there twice, facing both ways; None: none are."""
        return None

    def looks(self, prim: Usd.Prim, look_of: Callable[[Usd.Prim], Look]) -> list[Assignment]:
        """What the triangles are made of.

        Returns:
            No triangle is in two of them.
        """
        return [Assignment(str(prim.GetPath()), look_of(prim))]

    def _carry(self, found: UsdGeom.Primvar) -> np.ndarray | None:
        primvar = read_primvar(found, NO_FACES, self.context)
        return None if primvar is None else at_corners(primvar, NO_FACES, np.empty((0, 3), dtype=np.int64))


@dataclass(frozen=True, eq=False)
class Assignment:
    """A look and the triangles that have it.

    Args:
        name: path of the prim that binds it.
        look: what they are made of.
        triangles: (m,) bool, which; None: all.
    """

    name: str
    look: Look
    triangles: np.ndarray | None = None


class MeshForm(Form):
    """The triangles of a UsdGeom.Mesh.

    Args:
        prim: the mesh.
        context: the stage.

    Raises:
        SceneError: for a topology that does not fit together.
    """

    def __init__(self, prim: Usd.Prim, context: StageContext) -> None:
        mesh = UsdGeom.Mesh(prim)
        points = read_points(mesh, context)
        self._prim = prim
        self._cage = read_cage(mesh, len(points), context)
        self._polygons = self._cage.polygons
        self._refinement = read_refinement(mesh, self._polygons, context)
        is_drawn, cage_faces = self._cage.is_drawn, None
        if self._refinement:
            points = self._refinement.smooth(points)
            self._polygons = self._refinement.polygons
            cage_faces = self._refinement.cage_faces
            is_drawn = is_drawn & self._refinement.drawn
        corners = cut_faces(points, self._polygons.counts, self._polygons.indices)
        faces = self._polygons.face_of_corner[corners[:, 0]]
        self._cage_faces = faces if cage_faces is None else cage_faces[faces]
        if not is_drawn.all():
            shown = is_drawn[self._cage_faces]
            corners, self._cage_faces = corners[shown], self._cage_faces[shown]
        orientation = read_mended_token(mesh.GetOrientationAttr(), context, ORIENTATIONS, "rightHanded")
        if orientation == UsdGeom.Tokens.leftHanded:
            corners = corners[:, ::-1]
        self._corners = corners
        super().__init__(points, self._polygons.indices[corners].astype(np.int32), None, context)

    @cached_property
    def normals(self) -> np.ndarray | None:
        """As authored, or of the refined surface."""
        if self._refinement:
            return self._refinement.normals(self.points, self._corners)
        normals = self._authored_normals()
        return None if normals is None else self._unit_normals(normals)

    @cached_property
    def doubled(self) -> np.ndarray | None:
        """Of polygons that were cut, each by its own diagonals: so their triangles do not tell it."""
        doubled = doubled_faces(self._polygons.counts, self._polygons.indices)
        return doubled[self._polygons.face_of_corner[self._corners[:, 0]]] if doubled.any() else None

    def looks(self, prim: Usd.Prim, look_of: Callable[[Usd.Prim], Look]) -> list[Assignment]:
        """One look for each GeomSubset that binds a material, and one for the faces that are left."""
        subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
        path = str(prim.GetPath())
        if not subsets:
            return [Assignment(path, look_of(prim))]
        owners = self._owners(subsets)[self._cage.faces[self._cage_faces]]
        assignments = [
            Assignment(str(subset.GetPath()), look_of(subset.GetPrim()), owners == number)
            for number, subset in enumerate(subsets)
            if (owners == number).any()
        ]
        if (owners < 0).any():
            assignments.append(Assignment(path, look_of(prim), owners < 0))
        looks = [assignment.look for assignment in assignments]
        if all(look.surface is None and look.medium == looks[0].medium for look in looks):
            # Only together do the parts bound the medium.
            return [Assignment(path, looks[0])]
        return assignments

    def _owners(self, subsets: list[UsdGeom.Subset]) -> np.ndarray:
        """(f,) int, the subset that each authored face belongs to; -1: none."""
        owners = np.full(len(self._cage.authored.counts), -1)
        for number, subset in enumerate(subsets):
            if subset.GetElementTypeAttr().Get() != UsdGeom.Tokens.face:
                self.context.notes.add("GeomSubset of anything but faces binds no material", subset.GetPath())
                continue
            faces = read_places(subset.GetIndicesAttr(), self.context, len(owners), "faces")
            if (owners[faces] >= 0).any():
                text = "faces that an earlier GeomSubset holds too keep the material of that"
                self.context.mend(text, subset.GetPath())
            faces = faces[owners[faces] < 0]
            owners[faces] = number
        return owners

    def _carry(self, found: UsdGeom.Primvar) -> np.ndarray | None:
        primvar = read_primvar(found, self._cage.authored, self.context)
        if primvar is None:
            return None
        primvar = self._cage.without_the_rest(primvar)
        if self._refinement:
            primvar = self._refinement.carry(primvar)
        return at_corners(primvar, self._polygons, self._corners)

    def _authored_normals(self) -> np.ndarray | None:
        """(m, 3, 3), or (.., 1, 3) where they do not vary."""
        primvar = UsdGeom.PrimvarsAPI(self._prim).GetPrimvar("normals")
        if primvar and primvar.HasAuthoredValue():
            attribute, interpolation = primvar.GetAttr(), primvar.GetInterpolation()
            values, indices = read_values(primvar, self.context), read_indices(primvar, self.context)
        else:
            mesh = UsdGeom.Mesh(self._prim)
            attribute, interpolation, indices = mesh.GetNormalsAttr(), mesh.GetNormalsInterpolation(), None
            if not attribute.HasAuthoredValue():
                return None
            values = read_array(attribute, self.context.time, np.float64, width=3)
        if values is None or not len(values):
            return None
        if values.shape[1] != 3:
            text = f"normals of {values.shape[1]} numbers, and not of three, are left out"
            self.context.mend(text, attribute.GetPath())
            return None
        primvar = Primvar(values, interpolation, indices)
        found = fitted(primvar, self._cage.authored, str(attribute.GetPath()), self.context)
        return None if found is None else at_corners(self._cage.without_the_rest(found), self._polygons, self._corners)

    def _unit_normals(self, normals: np.ndarray) -> np.ndarray:
        """(m, 3, 3) float32, of length 1, and the triangle's own where an authored one has no direction."""
        lengths = np.sqrt(np.einsum("...i,...i->...", normals, normals))[..., None]
        is_usable = lengths > 0
        unit = normals / np.where(is_usable, lengths, 1)
        unit = np.broadcast_to(unit, (len(self.triangles), 3, 3))
        if not is_usable.all():
            text = "normals that are zero: the triangles' own are used there"
            self.context.notes.add(text, self._prim.GetPath())
            unit = np.where(is_usable, unit, triangle_normals(self.points, self.triangles)[:, None])
        return np.ascontiguousarray(unit, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one look, in the space of the prim that they come from; the arrays are those of `Mesh`."""

    name: str
    look: Look
    points: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray | None
    primvars: Mapping[str, np.ndarray] = field(default_factory=dict)

    def mesh(self, instance: int = -1) -> Mesh:
        """As it lies, in the world or for instances to share.

        Args:
            instance: its number in its instancer, where it is the only copy, or -1.

        Raises:
            SceneError: for points that are not finite, or a medium in a mesh that is not closed.
        """
        return Mesh(
            name=self.name,
            points=self.points,
            triangles=self.triangles,
            surface=self.look.surface,
            medium=self.look.medium,
            normals=self.normals,
            primvars=self.primvars,
            instance=instance,
        )

    def moved(self, to_world: np.ndarray) -> Part:
        """The same under a (4, 4) transform; a mirroring one leaves the outside outside.

        Returns:
            Its points in the space that the transform leads to.
        """
        matrix = to_world[:3, :3]
        normals = None if self.normals is None else _moved_normals(self.normals, matrix)
        points = self.points @ matrix.T + to_world[:3, 3]
        moved = Part(self.name, self.look, points, self.triangles, normals, self.primvars)
        return moved.turned() if np.linalg.det(matrix) < 0 else moved

    def turned(self) -> Part:
        """The same with the corners of each triangle in the other order."""
        return Part(
            self.name,
            self.look,
            self.points,
            np.ascontiguousarray(self.triangles[:, ::-1]),
            None if self.normals is None else np.ascontiguousarray(self.normals[:, ::-1]),
            {name: np.ascontiguousarray(values[:, ::-1]) for name, values in self.primvars.items()},
        )


def build_part(form: Form, prim: Usd.Prim, assignment: Assignment, without: Collection[str] = ()) -> Part:
    """The triangles of a look, with the normals and primvars that it asks for.

    Args:
        form: the prim's triangles.
        prim: that inherits primvars.
        assignment: the look and its triangles.
        without: primvars that each instance has a value of.

    Returns:
        The part, which shares the arrays of `form` where it is all of it.

    Raises:
        OpenMeshError: for a medium in a mesh whose faces are all there twice, facing both ways.
    """
    look, chosen = assignment.look, assignment.triangles
    if look.medium is not None and lets_light_through(look.surface) and form.doubled is not None:
        chosen = ~form.doubled if chosen is None else chosen & ~form.doubled
        if not chosen.any():
            raise OpenMeshError(f"{assignment.name}: {NO_VOLUME}")
        form.context.mend(DOUBLED_FACES, assignment.name)
    normals = form.normals if look.surface else None
    names = sorted(look.surface.primvars) if look.surface else []
    primvars = {
        name: values
        for name in names
        if name not in without
        and (values := form.primvar(prim, name)) is not None
        and fits_textures(values, name, look.surface, assignment.name, form.context)
    }
    triangles = form.triangles
    if chosen is not None:
        triangles = triangles[chosen]
        normals = None if normals is None else normals[chosen]
        primvars = {name: values if len(values) == 1 else values[chosen] for name, values in primvars.items()}
    part = Part(assignment.name, look, form.points, triangles, normals, primvars)
    if look.medium is None or signed_volume(form.points, triangles) >= 0:
        return part
    form.context.notes.add("the mesh of a medium is inside out, and was turned", assignment.name)
    return part.turned()


def doubled_faces(counts: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """(f,) bool, the faces of more than three corners that are there facing both ways, pair by pair.

    Args:
        counts: (f,) int, corners of each face.
        indices: (sum(counts),) int, the points at the corners of all faces.
    """
    doubled = np.zeros(len(counts), dtype=bool)
    starts = np.cumsum(counts) - counts
    for count in np.unique(counts[counts > 3]):
        faces = np.flatnonzero(counts == count)
        loops = indices[starts[faces, None] + np.arange(count)]
        # From the lowest point on, and to its lower neighbour first.
        loops = np.take_along_axis(loops, (loops.argmin(axis=1)[:, None] + np.arange(count)) % count, axis=1)
        is_turned = loops[:, 1] > loops[:, -1]
        loops = np.where(is_turned[:, None], np.roll(loops[:, ::-1], 1, axis=1), loops)
        number = np.unique(loops, axis=0, return_inverse=True)[1].reshape(-1)
        order = np.lexsort((is_turned, number))
        number, turned = number[order], is_turned[order]
        turned_count = np.bincount(number, weights=turned).astype(int)[number]
        total = np.bincount(number)[number]
        nth = np.arange(len(order)) - np.searchsorted(number, number)
        nth = np.where(turned, nth - (total - turned_count), nth)
        doubled[faces[order]] = nth < np.minimum(turned_count, total - turned_count)
    return doubled


def read_corners(prim: Usd.Prim, context: StageContext) -> np.ndarray:
    """(m, 3, 3) float64, the corners of a mesh's triangles in world space, counter-clockwise seen from outside.

    Raises:
        SceneError: for a topology that does not fit together.
    """
    form = MeshForm(prim, context)
    part = build_part(form, prim, Assignment(str(prim.GetPath()), Look(surface=None, medium=None)))
    part = part.moved(context.local_to_world(prim))
    return part.points[part.triangles]


def triangle_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(m, 3), of length 1, or 0 of triangles without area.

    Args:
        points: (n, 3) float.
        triangles: (m, 3) int.

    Returns:
        To the side from which the corners run counter-clockwise.
    """
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(lengths > 0, lengths, 1)


def _moved_normals(normals: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Normals under the inverse transpose of a (3, 3) matrix, which also exists, up to a factor, where it is flat."""
    a, b, c = matrix.T
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    scale = np.abs(cofactors).max() * (-1 if np.linalg.det(matrix) < 0 else 1)
    moved = normals @ (cofactors.T / (scale or 1)).astype(np.float32)
    lengths = np.sqrt(np.einsum("...i,...i->...", moved, moved))[..., None]
    return moved / np.where(lengths > 0, lengths, 1)
