"""Which edges and vertices of a subdivision surface stay sharp."""

from __future__ import annotations

import numpy as np
from pxr import UsdGeom

from fgf_warp.errors import SceneError
from usd_scenes.reader.attributes import read_array
from usd_scenes.reader.cage import are_there
from usd_scenes.reader.context import StageContext

Crease = tuple[int, int, float]
"""Two points, and how sharp the edge between them is, >= 0."""


def read_creases(mesh: UsdGeom.Mesh, n_points: int, context: StageContext) -> list[Crease]:
    """The edges of a mesh that are sharp; those that do not fit it are left out, with a warning.

    Returns:
        Pairs of points in [0, n_points) and their sharpness, along each crease one for each of its edges.

    Raises:
        SceneError: for what is left out, where the stage is read strictly.
    """
    with context.leaving_out(mesh.GetPath(), "no edge is creased"):
        return _read_creases(mesh, n_points, context)
    return []


def read_corner_sharpness(mesh: UsdGeom.Mesh, n_points: int, context: StageContext) -> np.ndarray:
    """(n_points,) float >= 0; corners that do not fit the mesh are left out, with a warning.

    Raises:
        SceneError: for what is left out, where the stage is read strictly.
    """
    found = np.zeros(n_points)
    path = mesh.GetPath()
    with context.leaving_out(path, "no vertex is a sharp corner"):
        indices = read_array(mesh.GetCornerIndicesAttr(), context.time, np.int64)
        sharpness = read_array(mesh.GetCornerSharpnessesAttr(), context.time, np.float64)
        _check_count(f"{path}.cornerSharpnesses", sharpness, {len(indices)}, len(indices))
        kept = are_there(mesh.GetCornerIndicesAttr(), indices, context, n_points, "points")
        found[indices[kept]] = _not_negative(f"{path}.cornerSharpnesses", sharpness, context)[kept]
    return found


def _read_creases(mesh: UsdGeom.Mesh, n_points: int, context: StageContext) -> list[Crease]:
    indices = read_array(mesh.GetCreaseIndicesAttr(), context.time, np.int64)
    lengths = read_array(mesh.GetCreaseLengthsAttr(), context.time, np.int64)
    sharpness = read_array(mesh.GetCreaseSharpnessesAttr(), context.time, np.float64)
    path = mesh.GetPath()
    if (len(lengths) and (lengths.min() < 2 or lengths.sum() != len(indices))) or (len(indices) and not len(lengths)):
        raise SceneError(
            f"{path}.creaseLengths adds up to {lengths.sum()}; accepted: lengths >= 2 that add up to the "
            f"{len(indices)} entries of creaseIndices"
        )
    n_edges = int(lengths.sum() - len(lengths))
    if len(sharpness) == len(lengths):
        sharpness = np.repeat(sharpness, lengths - 1)
    _check_count(f"{path}.creaseSharpnesses", sharpness, {len(lengths), n_edges}, n_edges)
    sharpness = _not_negative(f"{path}.creaseSharpnesses", sharpness, context)
    is_start = np.ones(len(indices), dtype=bool)
    is_start[np.cumsum(lengths) - 1] = False
    starts = np.flatnonzero(is_start)
    is_there = are_there(mesh.GetCreaseIndicesAttr(), indices, context, n_points, "points")
    kept = is_there[starts] & is_there[starts + 1]
    starts, sharpness = starts[kept], sharpness[kept]
    return list(zip(indices[starts].tolist(), indices[starts + 1].tolist(), sharpness.tolist(), strict=True))


def _check_count(name: str, sharpness: np.ndarray, accepted: set[int], used: int) -> None:
    if len(sharpness) != used:
        counts = " or ".join(str(count) for count in sorted(accepted))
        raise SceneError(f"{name} has {len(sharpness)} entries; accepted: {counts}")


def _not_negative(name: str, sharpness: np.ndarray, context: StageContext) -> np.ndarray:
    if (sharpness < 0).any():
        context.mend(f"holds {sharpness.min():g}; accepted: sharpnesses >= 0; 0 is used", name)
    return np.maximum(sharpness, 0)
