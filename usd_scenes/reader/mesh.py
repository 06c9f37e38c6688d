"""UsdGeom.Mesh: polygons to triangles in world space."""

from __future__ import annotations

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from fgf_warp.errors import SceneError
from fgf_warp.scene import Mesh
from usd_scenes.reader.attributes import read_array
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.materials import Look
from usd_scenes.reader.triangulation import signed_volume, triangulate


def read_mesh(prim: Usd.Prim, context: StageContext, look: Look) -> Mesh | None:
    """A polygon mesh as its control cage; None, with a warning, where it has no faces.

    Raises:
        SceneError: for a topology that does not fit together, points that are not finite, or a medium in a mesh
            that is not closed.
    """
    mesh, notes, path = UsdGeom.Mesh(prim), context.notes, prim.GetPath()
    points = read_array(mesh.GetPointsAttr(), context.time, np.float64, width=3)
    counts, indices = _topology(mesh, context, len(points))
    if not counts.size:
        notes.add("mesh without faces is left out", path)
        return None
    if mesh.GetSubdivisionSchemeAttr().Get() != UsdGeom.Tokens.none:
        notes.add("subdivision is not supported: the control cage is rendered", path)
    if UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
        notes.add("materials of GeomSubsets are not supported: the mesh's own is used", path)

    to_world = context.local_to_world(prim)
    world_points = points @ to_world[:3, :3].T + to_world[:3, 3]
    triangles = triangulate(points, counts, indices)
    if _is_left_handed(mesh, context.time) != (np.linalg.det(to_world[:3, :3]) < 0):
        triangles = triangles[:, ::-1]
    if look.medium is not None and signed_volume(world_points, triangles) < 0:
        notes.add("the mesh of a medium is inside out, and was turned", path)
        triangles = triangles[:, ::-1]
    return Mesh(
        name=str(path),
        points=world_points,
        triangles=np.ascontiguousarray(triangles),
        surface=look.surface,
        medium=look.medium,
    )


def _topology(mesh: UsdGeom.Mesh, context: StageContext, n_points: int) -> tuple[np.ndarray, np.ndarray]:
    """Corner counts and corners of the faces that are not holes, checked."""
    counts_attribute, indices_attribute = mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()
    counts = read_array(counts_attribute, context.time, np.int64)
    indices = read_array(indices_attribute, context.time, np.int64)
    if (counts < 0).any() or counts.sum() != len(indices):
        raise SceneError(
            f"{counts_attribute.GetPath()} adds up to {counts.sum()}; accepted: counts >= 0 that add up to the "
            f"{len(indices)} entries of faceVertexIndices"
        )
    if len(indices) and not (indices.min() >= 0 and indices.max() < n_points):
        raise SceneError(
            f"{indices_attribute.GetPath()} spans [{indices.min()}, {indices.max()}]; "
            f"accepted: [0, {n_points - 1}], as there are {n_points} points"
        )
    return _without_holes(mesh, context, counts, indices)


def _without_holes(
    mesh: UsdGeom.Mesh, context: StageContext, counts: np.ndarray, indices: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    attribute = mesh.GetHoleIndicesAttr()
    holes = read_array(attribute, context.time, np.int64)
    if len(holes) and (holes.min() < 0 or holes.max() >= len(counts)):
        raise SceneError(
            f"{attribute.GetPath()} spans [{holes.min()}, {holes.max()}]; accepted: [0, {len(counts) - 1}]"
        )
    kept = counts >= 3
    kept[holes] = False
    return counts[kept], indices[np.repeat(kept, counts)]


def _is_left_handed(mesh: UsdGeom.Mesh, time: Usd.TimeCode) -> bool:
    return mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded
