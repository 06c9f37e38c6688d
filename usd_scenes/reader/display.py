"""displayColor and displayOpacity: the look of shapes without a material."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from fgf_warp.scene import PrimvarInput, Rgb, Surface
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.instance_primvars import find_source, of_each, varies
from usd_scenes.reader.instancing import Copies
from usd_scenes.reader.primvars import cut_display, fit_values

DEFAULTS: dict[str, Rgb | float] = {"displayColor": Surface().diffuse, "displayOpacity": Surface().opacity}  # type: ignore[dict-item]


def display_surface(prim: Usd.Prim, context: StageContext, copies: Copies | None = None) -> Surface:
    """A diffuse surface of the display color and opacity of a geometry prim, or of the mesh of a GeomSubset.

    Values out of [0, 1] are mended.

    Args:
        prim: the geometry.
        context: the stage.
        copies: of the prototype that it is part of: where their values differ, it reads the primvar of each.

    Returns:
        Its color and opacity are constants in [0, 1], or read from primvars where they differ over the geometry or its
        copies.

    Raises:
        SceneError: for such values, where the stage is read strictly.
    """
    shape = _shape_of(prim)
    found: dict[str, Any] = {
        field: value
        for field, name, width in (("diffuse", "displayColor", 3), ("opacity", "displayOpacity", 1))
        if (value := _display_input(shape, name, width, context, copies)) is not None
    }
    return Surface(**found)


def display_sources(prim: Usd.Prim, copies: Copies | None = None) -> tuple[object, ...]:
    """What the display surface of a prim depends on; equal for instances that have it from one prototype."""
    shape = _shape_of(prim)
    found = [find_source(shape, name, copies) for name in ("displayColor", "displayOpacity")]
    return shape.IsA(UsdGeom.Mesh), *(
        (_place(primvar.GetAttr()), copies.key if copies and varies(primvar, level) else None) if primvar else None
        for primvar, level in found
    )


def _place(attribute: Usd.Attribute) -> Sdf.Path:
    prim = attribute.GetPrim()
    owner = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
    return owner.GetPath().AppendProperty(attribute.GetName())


def _shape_of(prim: Usd.Prim) -> Usd.Prim:
    """The prim, or the mesh of a GeomSubset."""
    return prim.GetParent() if prim.IsA(UsdGeom.Subset) else prim


def _display_input(
    shape: Usd.Prim, name: str, width: int, context: StageContext, copies: Copies | None
) -> PrimvarInput | Rgb | float | None:
    """A primvar's value, or the primvar where it varies over a mesh or from copy to copy; None where there is none."""
    primvar, level = find_source(shape, name, copies)
    values = _values(primvar, width, context) if primvar else np.empty((0, width))
    is_of_each = varies(primvar, level)
    if copies and level and is_of_each and len(values):
        found = of_each(values, None, primvar, copies, level, context)
        values = np.empty((0, width)) if found is None else found
    if not len(values):
        return None
    first = tuple(float(str(number)) for number in values[0])
    value = cast(Rgb, first) if width == 3 else first[0]
    if (values == values[0]).all():
        return value
    if shape.IsA(UsdGeom.Mesh) or is_of_each:
        # Where the primvar does not fit and is left out, the surface is as it is without one.
        return PrimvarInput(name, fallback=DEFAULTS[name])
    context.notes.add(
        f"{name} varies over a shape that is no mesh: its first value is used", primvar.GetAttr().GetPath()
    )
    return value


def _values(primvar: UsdGeom.Primvar, width: int, context: StageContext) -> np.ndarray:
    """(n, width) float32, of which there may be none."""
    if not fit_values(primvar, context):
        return np.zeros((0, width), dtype=np.float32)
    flattened = primvar.ComputeFlattened(context.time)
    try:
        values = np.asarray([] if flattened is None else flattened, dtype=np.float32).reshape(-1, width)
    except (TypeError, ValueError):
        text = f"is no array; accepted: an array of {_entries(width)}; it is not used"
        context.mend(text, primvar.GetAttr().GetPath())
        return np.zeros((0, width), dtype=np.float32)
    is_accepted = ((values >= 0) & (values <= 1)).all()
    return values if is_accepted else cut_display(primvar, values, context)


def _entries(width: int) -> str:
    return "numbers" if width == 1 else f"entries of {width} numbers"
