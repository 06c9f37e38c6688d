"""The faces of a UsdGeom.Mesh and its points at a time: what is wrong with some of them costs those alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Tf, Usd, UsdGeom

from fgf_warp.errors import SceneError
from usd_scenes.reader.attributes import read_array
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.policy import commentary_of
from usd_scenes.reader.primvars import Polygons, Primvar

FEWEST_CORNERS = 3
"""Of a face."""


@dataclass(frozen=True, eq=False)
class Cage:
    """The faces of a mesh.

    Args:
        authored: as written, which primvars and GeomSubsets count in.
        polygons: those of at least three corners.
        faces: (f,) int, the authored faces that `polygons` are.
        corners: (c,) int, the authored corners that those of `polygons` are.
        is_drawn: (f,) bool, False of holes.
    """

    authored: Polygons
    polygons: Polygons
    faces: np.ndarray
    corners: np.ndarray
    is_drawn: np.ndarray

    def without_the_rest(self, primvar: Primvar) -> Primvar:
        """A primvar of the authored faces, as one of `polygons`."""
        if len(self.faces) == len(self.authored.counts) or primvar.interpolation not in ("uniform", "faceVarying"):
            return primvar
        indices = np.arange(len(primvar.values)) if primvar.indices is None else primvar.indices
        kept = self.faces if primvar.interpolation == "uniform" else self.corners
        return Primvar(primvar.values, primvar.interpolation, indices[kept])


def read_cage(mesh: UsdGeom.Mesh, n_points: int, context: StageContext) -> Cage:
    """The faces of a mesh; those of fewer than three corners are left out, with a warning.

    Raises:
        SceneError: for counts or indices that do not fit together.
    """
    counts_attribute, indices_attribute = mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()
    counts = read_array(counts_attribute, context.time, np.int64)
    indices = read_array(indices_attribute, context.time, np.int64)
    if len(counts) and counts.min() < 0:
        raise SceneError(f"{counts_attribute.GetPath()} holds {counts.min()}; accepted: counts >= 0")
    if counts.sum() != len(indices):
        raise SceneError(
            f"{counts_attribute.GetPath()} adds up to {counts.sum()}; accepted: counts >= 0 that add up to the "
            f"{len(indices)} entries of faceVertexIndices"
        )
    authored = Polygons(n_points, counts, indices)
    is_face = counts >= FEWEST_CORNERS
    faces, corners = np.flatnonzero(is_face), np.flatnonzero(np.repeat(is_face, counts))
    if len(faces) < len(counts):
        text = f"{len(counts) - len(faces)} of {len(counts)} faces have fewer than three corners; they are left out"
        context.mend(text, counts_attribute.GetPath())
    polygons = Polygons(n_points, counts[faces], indices[corners])
    if not _within(polygons.indices, n_points).all():
        raise SceneError(f"{indices_attribute.GetPath()} {_span(polygons.indices, n_points, 'points')}")
    is_drawn = np.ones(len(counts), dtype=bool)
    is_drawn[read_places(mesh.GetHoleIndicesAttr(), context, len(counts), "faces")] = False
    return Cage(authored, polygons, faces, corners, is_drawn[faces])


def read_places(attribute: Usd.Attribute, context: StageContext, count: int, what: str) -> np.ndarray:
    """(n,) int64 indices of an attribute; those that are no places in what it counts in are left out, with a warning.

    Args:
        attribute: of integers.
        context: the stage.
        count: places that there are.
        what: is at those places, in words.

    Raises:
        SceneError: for what is left out, where the stage is read strictly.
    """
    places = np.empty(0, dtype=np.int64)
    with context.leaving_out(attribute.GetPath(), "it is left out"):
        places = read_array(attribute, context.time, np.int64)
    return places[are_there(attribute, places, context, count, what)]


def are_there(attribute: Usd.Attribute, places: np.ndarray, context: StageContext, count: int, what: str) -> np.ndarray:
    """(n,) bool, true of indices in [0, count); of the others a warning tells that they are left out.

    Args:
        attribute: that holds the indices.
        places: (n,) int, its indices.
        context: the stage.
        count: places that there are.
        what: is at those places, in words.

    Raises:
        SceneError: in place of the warning, where the stage is read strictly.
    """
    inside = _within(places, count)
    if not inside.all():
        text = f"{_span(places, count, what)}; {int((~inside).sum())} of {len(places)} entries are left out"
        context.mend(text, attribute.GetPath())
    return inside


def _within(places: np.ndarray, count: int) -> np.ndarray:
    inside: np.ndarray = (places >= 0) & (places < count)
    return inside


def _span(places: np.ndarray, count: int, what: str) -> str:
    found = f"spans [{places.min()}, {places.max()}]"
    return (
        f"{found}; accepted: [0, {count - 1}], as there are {count} {what}"
        if count
        else f"{found}; there are no {what}"
    )


def read_points(mesh: UsdGeom.Mesh, context: StageContext) -> np.ndarray:
    """(n, 3) float64, the points at the time of the stage.

    Between samples they go on by their velocities and accelerations where these are sampled with them, as USD says,
    else straight to the next sample.

    Raises:
        SceneError: for points that are no points, or not finite.
    """
    points = read_array(mesh.GetPointsAttr(), context.time, np.float64, width=3)
    _note_deformation(mesh, context)
    if not _has_velocities(mesh, len(points), context):
        return points
    with Tf.DiagnosticTrap() as trap:
        moved = np.asarray(mesh.ComputePointsAtTime(context.time, context.time), dtype=np.float64)
        warnings = [commentary_of(warning).rpartition("-- ")[2].strip() for warning in trap.GetWarnings()]
        trap.Clear()
    for warning in warnings:
        context.mend(f"{warning}; they are left out", mesh.GetPath())
    if not np.isfinite(moved).all():
        raise SceneError(f"{mesh.GetVelocitiesAttr().GetPath()} takes points to where numbers are not finite")
    return moved if moved.shape == points.shape else points


def _has_velocities(mesh: UsdGeom.Mesh, n_points: int, context: StageContext) -> bool:
    """True where velocities fit the points; at USD's default time and at the first sample nothing has moved."""
    attribute = mesh.GetVelocitiesAttr()
    if context.time.IsDefault() or context.time.IsEarliestTime() or not attribute.HasAuthoredValue():
        return False
    velocities = np.empty((0, 3))
    with context.leaving_out(attribute.GetPath(), "they are left out"):
        velocities = read_array(attribute, context.time, np.float64, width=3)
        if len(velocities) not in (0, n_points):
            raise SceneError(f"{attribute.GetPath()} has {len(velocities)} entries; accepted: {n_points}, as of points")
    return 0 < len(velocities) == n_points


def _note_deformation(mesh: UsdGeom.Mesh, context: StageContext) -> None:
    if context.shutter is None:
        return
    points, velocities = mesh.GetPointsAttr(), mesh.GetVelocitiesAttr().Get(context.time)
    changes = points.ValueMightBeTimeVarying() and not np.array_equal(*(points.Get(t) for t in context.shutter))
    if changes or np.any(velocities or ()):
        text = "points that move while the shutter is open are not supported: they rest where they are at the frame"
        context.notes.add(text, mesh.GetPath())
