"""Primvars: values that vary over a shape, brought to the corners of its triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from fgf_warp.scene import Surface
from usd_scenes.reader.attributes import as_written, shown
from usd_scenes.reader.context import StageContext

INTERPOLATIONS = ("constant", "uniform", "varying", "vertex", "faceVarying")


DISPLAY_FALLBACKS = {"displayColor": 0.18, "displayOpacity": 1.0}
"""What takes the place of a number that is none, as where nothing is authored."""
DISPLAY_WIDTHS = {"displayColor": 3, "displayOpacity": 1}
"""Numbers of each value."""


@dataclass(frozen=True, eq=False)
class Primvar:
    """Values on a polygon mesh.

    Args:
        values: (n, k) float64.
        interpolation: one of `INTERPOLATIONS`.
        indices: (l,) int into `values`, or None where the values follow one another.
    """

    values: np.ndarray
    interpolation: str
    indices: np.ndarray | None = None

    @property
    def elements(self) -> np.ndarray:
        """(l, k), the values without indices."""
        return self.values if self.indices is None else self.values[self.indices]


@dataclass(frozen=True, eq=False)
class Polygons:
    """The faces of a mesh.

    Args:
        n_points: points that `indices` count in.
        counts: (f,) int64, corners of each face.
        indices: (sum(counts),) int64, the points at the corners of all faces.
    """

    n_points: int
    counts: np.ndarray
    indices: np.ndarray

    @property
    def face_of_corner(self) -> np.ndarray:
        """(sum(counts),) int64."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    def count_of(self, interpolation: str) -> int:
        """Number of elements that a primvar of this interpolation has."""
        return {
            "constant": 1,
            "uniform": len(self.counts),
            "varying": self.n_points,
            "vertex": self.n_points,
            "faceVarying": len(self.indices),
        }[interpolation]


def find_primvar(prim: Usd.Prim, name: str) -> UsdGeom.Primvar:
    """The primvar of a prim, or the constant one that it inherits; an invalid one where there is none with a value."""
    found = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    return found if found and found.HasValue() else UsdGeom.Primvar()  # displayColor is there without a value too.


def read_primvar(primvar: UsdGeom.Primvar, polygons: Polygons, context: StageContext) -> Primvar | None:
    """The values of a primvar; None, with a warning, where they do not fit the mesh or are no numbers.

    Returns:
        Values (n, k) float64 and their indices, as many as the interpolation asks for.
    """
    values = read_values(primvar, context)
    if values is None:
        return None
    return fitted(
        Primvar(values, primvar.GetInterpolation(), read_indices(primvar, context)),
        polygons,
        str(primvar.GetAttr().GetPath()),
        context,
    )


def read_values(primvar: UsdGeom.Primvar, context: StageContext) -> np.ndarray | None:
    """(n, k) float64, of a primvar; None, with a warning, where these are no finite numbers."""
    path = primvar.GetAttr().GetPath()
    if primvar.GetElementSize() != 1:
        context.notes.add("primvar of an elementSize that is not 1 is not supported and is left out", path)
        return None
    value = primvar.Get(context.time)
    try:
        values = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        context.mend("primvar that is no array of numbers is left out", path)
        return None
    width = DISPLAY_WIDTHS.get(primvar.GetPrimvarName(), 0)
    if width and values.size % width == 0 and not np.isfinite(values).all():
        values = cut_display(primvar, values, context)
    if not np.isfinite(values).all():
        context.mend("primvar without finite numbers is left out", path)
        return None
    if not primvar.GetTypeName().isArray:
        values = values[None]
    return values.reshape(len(values), -1) if values.size else values.reshape(0, 1)


def cut_display(primvar: UsdGeom.Primvar, values: np.ndarray, context: StageContext) -> np.ndarray:
    """Values of displayColor or displayOpacity in [0, 1], with a warning that says what some of them were.

    Args:
        primvar: either of them.
        values: its values, with or without indices, some of them out of [0, 1] or not finite.
        context: the stage.

    Returns:
        Of the shape and type of `values`, all in [0, 1].

    Raises:
        SceneError: in place of the warning, where the stage is read strictly.
    """
    name = primvar.GetPrimvarName()
    fallback = DISPLAY_FALLBACKS[name]
    own = np.asarray(primvar.Get(context.time), dtype=np.float64).reshape(-1, DISPLAY_WIDTHS[name])
    outside = ~((own >= 0) & (own <= 1)).all(axis=1)
    at = int(np.argmax(outside))
    found = ", ".join(shown(as_written(number)) for number in own[at])
    text = (
        f"{int(outside.sum())} of {len(own)} values are out of [0, 1], the first is [{at}] = ({found}); numbers are "
        f"cut to [0, 1], and what is none becomes {fallback:g}"
    )
    context.mend(text, primvar.GetAttr().GetPath())
    cut: np.ndarray = np.where(np.isnan(values), values.dtype.type(fallback), np.clip(values, 0, 1))
    return cut


def read_indices(primvar: UsdGeom.Primvar, context: StageContext) -> np.ndarray | None:
    """(l,) int64 of an indexed primvar.

    Returns:
        Places in the values of the primvar; None of one without indices.
    """
    return np.asarray(primvar.GetIndices(context.time), dtype=np.int64) if primvar.IsIndexed() else None


def fit_values(primvar: UsdGeom.Primvar, context: StageContext) -> bool:
    """False, with a warning, of a primvar whose indices are no places in its values."""
    indices, values = read_indices(primvar, context), primvar.Get(context.time)
    if indices is None or not hasattr(values, "__len__"):
        return True
    text = _out_of(indices, len(values))
    if text:
        context.mend(text, primvar.GetAttr().GetPath())
    return not text


def _out_of(indices: np.ndarray, count: int) -> str:
    """What is wrong with indices into so many values; empty where nothing is."""
    if not len(indices) or (indices.min() >= 0 and indices.max() < count):
        return ""
    return f"primvar with indices in [{indices.min()}, {indices.max()}] for {count} values is left out"


def fitted(primvar: Primvar, polygons: Polygons, path: str, context: StageContext) -> Primvar | None:
    """The primvar, or None, with a warning, where it does not fit the mesh."""
    values, indices = primvar.values, primvar.indices
    if indices is not None and (text := _out_of(indices, len(values))):
        context.mend(text, path)
        return None
    if primvar.interpolation not in INTERPOLATIONS:
        accepted = ", ".join(INTERPOLATIONS)
        context.mend(f"primvar of interpolation {primvar.interpolation!r} is left out; accepted: {accepted}", path)
        return None
    found = len(values) if indices is None else len(indices)
    expected = polygons.count_of(primvar.interpolation)
    if found != expected:
        text = f"{primvar.interpolation} primvar of {found} values where {expected} are expected is left out"
        context.mend(text, path)
        return None
    return primvar


def fits_textures(values: np.ndarray, name: str, surface: Surface | None, path: str, context: StageContext) -> bool:
    """False, with a warning, of a primvar whose values, (.., k), are too short for the textures that are read there."""
    if surface is None or values.shape[-1] >= 2 or name not in surface.coordinates:
        return True
    context.mend(f"primvar {name} of one number, where textures need two, is left out", path)
    return False


def at_corners(primvar: Primvar, polygons: Polygons, corners: np.ndarray) -> np.ndarray:
    """A primvar on triangles.

    Args:
        primvar: that fits the polygons.
        polygons: the mesh.
        corners: (m, 3) int, the polygons' corners that the triangles' lie at.

    Returns:
        (1, 1, k), (m, 1, k) or (m, 3, k) float32: constant, uniform, or any other.
    """
    elements = primvar.elements.astype(np.float32)
    match primvar.interpolation:
        case "constant":
            return elements[:, None]
        case "uniform":
            return elements[polygons.face_of_corner[corners[:, :1]]]
        case "faceVarying":
            return elements[corners]
        case _:
            return elements[polygons.indices[corners]]
