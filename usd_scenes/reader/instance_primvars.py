"""Primvars of a PointInstancer: they are constant on each instance, and have one value for all of them or one for each.

USD has them as if they were authored on the root of each instance: `constant` and `uniform` values hold for every
instance as a whole, and of `varying`, `vertex` and `faceVarying` ones each instance has its own element. What is
authored in the prototype stands before them.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from pxr import Usd, UsdGeom

from usd_scenes.reader.context import StageContext
from usd_scenes.reader.instancing import Copies
from usd_scenes.reader.primvars import Polygons, Primvar, find_primvar, fitted, read_indices, read_values

WHOLE = ("constant", "uniform")
"""Interpolations of values that hold for every instance."""


def find_source(prim: Usd.Prim, name: str, copies: Copies | None) -> tuple[UsdGeom.Primvar, Copies | None]:
    """Where a prim has a primvar from.

    Args:
        prim: in a prototype, or in none.
        name: of the primvar.
        copies: of the prototype.

    Returns:
        The primvar, invalid where there is none, and the one of `copies.levels` that it comes from: whose instancer has
        it, or whose prototype has it for an instancer within. None where the prim has it, or inherits it by itself.
    """
    here = prim
    for level in copies.levels if copies else ():
        found = find_primvar(here, name)
        if found and found.GetAttr().GetPath().HasPrefix(level.root.GetPath()):
            return found, None if level is copies else level
        own = UsdGeom.PrimvarsAPI(level.instancer).GetPrimvar(name)
        if own and own.HasAuthoredValue():
            return own, level
        here = level.instancer
    return find_primvar(prim, name), None


def varies(primvar: UsdGeom.Primvar, level: Copies | None) -> bool:
    """True where each instance has a value of its own."""
    return level is not None and primvar.GetInterpolation() not in WHOLE


def of_each(
    values: np.ndarray,
    indices: np.ndarray | None,
    primvar: UsdGeom.Primvar,
    copies: Copies,
    level: Copies,
    context: StageContext,
) -> np.ndarray | None:
    """(n, k), the element of each copy; None, with a warning, where there are not as many as instances.

    Args:
        values: (m, k), of the primvar.
        indices: into them, or None.
        primvar: of the instancer of `level`.
        copies: whose elements these are.
        level: one of `copies.levels`.
        context: the stage.
    """
    none = np.empty(0, dtype=np.int64)
    interpolation = primvar.GetInterpolation()
    # On points, and so on instances, a corner of a face is a point.
    as_points = "vertex" if interpolation == "faceVarying" else interpolation
    found = fitted(
        Primvar(values, as_points, indices),
        Polygons(level.total, none, none),
        str(primvar.GetAttr().GetPath()),
        context,
    )
    return None if found is None else found.elements[copies.numbers_in(level)]


def read_of_instances(
    prim: Usd.Prim, names: Iterable[str], copies: Copies | None, context: StageContext
) -> dict[str, np.ndarray]:
    """Primvars that a prim of a prototype has from instancers and does not find by itself: name to (n, k) float32."""
    found = {}
    for name in names:
        primvar, level = find_source(prim, name, copies)
        if copies is None or level is None:
            continue
        values = None
        if varies(primvar, level):
            all_values = read_values(primvar, context)
            if all_values is not None:
                values = of_each(all_values, read_indices(primvar, context), primvar, copies, level, context)
        elif find_primvar(prim, name).GetAttr() != primvar.GetAttr():
            values = read_values(primvar, context)
            if values is not None and len(values) != 1:
                text = "primvar of several values, which holds for every instance as a whole, is left out"
                context.notes.add(text, primvar.GetAttr().GetPath())
                values = None
        if values is not None:
            found[name] = np.ascontiguousarray(
                np.broadcast_to(values.astype(np.float32), (copies.count, values.shape[1]))
            )
    return found
