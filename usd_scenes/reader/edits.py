"""Other values for attributes and variant sets of a stage, without a change to its files."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager

from pxr import Sdf, Usd, UsdGeom, Vt

from fgf_warp.errors import SceneError
from usd_scenes.reader.attributes import plain_source

Edits = Mapping[str, float | str]
"""Values by what takes them: a number by ``/prim.path:attribute`` or, of a vector or color, by
``/prim.path:attribute[i]``; the name of a variant by ``/prim/path{variants}``."""

NUMBERS = {
    Sdf.ValueTypeNames.Double,
    Sdf.ValueTypeNames.Float,
    Sdf.ValueTypeNames.Half,
    Sdf.ValueTypeNames.TimeCode,
}
INTEGERS = {
    Sdf.ValueTypeNames.Int: (-(2**31), 2**31 - 1),
    Sdf.ValueTypeNames.Int64: (-(2**63), 2**63 - 1),
    Sdf.ValueTypeNames.UInt: (0, 2**32 - 1),
    Sdf.ValueTypeNames.UInt64: (0, 2**64 - 1),
    Sdf.ValueTypeNames.UChar: (0, 255),
}
"""Types of whole numbers, and the least and largest."""
VECTOR = re.compile(r"GfVec(?P<size>[234])(?P<type>[hfdi])")
NEAR_MOST = 4
"""Names that an error lists."""


class EditError(SceneError):
    """A stage has no such thing to edit, or it takes no such value; the message names what was to be edited."""


@contextmanager
def edited(stage: Usd.Stage, edits: Edits, time: Usd.TimeCode) -> Iterator[None]:
    """Within it the stage has the values of the edits, at all times.

    Args:
        stage: whose session layer is free.
        edits: see `Edits`.
        time: at which the other components of vectors are taken.

    Raises:
        EditError: for what is not there, has no numbers, or would be of no effect.
    """
    try:
        with Usd.EditContext(stage, stage.GetSessionLayer()):
            # A variant may bring the prim whose attribute is edited.
            for target, value in sorted(edits.items(), key=lambda edit: not edit[0].endswith("}")):
                _author(stage, target, value, time)
        yield
    finally:
        if edits:
            stage.GetSessionLayer().Clear()


def _author(stage: Usd.Stage, target: str, value: float | str, time: Usd.TimeCode) -> None:
    if target.endswith("}"):
        path, _, name = target[:-1].partition("{")
        _select(_find_prim(stage, path, target), name, str(value), target)
        return
    path, _, attribute = target.partition(".")
    name, _, component = attribute.removesuffix("]").partition("[")
    found = _find_attribute(_find_prim(stage, path, target), name, target)
    found.Set(_with_component(found, int(component) if component else None, value, time, target))


def _find_prim(stage: Usd.Stage, path: str, target: str) -> Usd.Prim:
    prim = stage.GetPrimAtPath(path)
    if not prim or not prim.IsActive():
        there = [str(other.GetPath()) for other in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies())]
        raise EditError(f"{target}: there is no prim {path}{_near(path, there)}")
    if prim.IsInstanceProxy() or prim.IsInPrototype():
        raise EditError(f"{target}: {path} is shared by instances; accepted: a prim outside of them, or no instancing")
    return prim


def _select(prim: Usd.Prim, name: str, variant: str, target: str) -> None:
    sets = prim.GetVariantSets()
    if not sets.HasVariantSet(name):
        raise EditError(f"{target}: {prim.GetPath()} has no variant set {name}{_near(name, sets.GetNames())}")
    variants = sets.GetVariantSet(name)
    if not variants.HasAuthoredVariant(variant):
        raise EditError(f"{target}: no variant {variant!r}; accepted: {', '.join(variants.GetVariantNames())}")
    variants.SetVariantSelection(variant)


def _find_attribute(prim: Usd.Prim, name: str, target: str) -> Usd.Attribute:
    attribute = prim.GetAttribute(name)
    if not attribute:
        there = [other.GetName() for other in prim.GetAttributes()]
        raise EditError(f"{target}: {prim.GetPath()} has no attribute {name}{_near(name, there)}")
    source = plain_source(attribute)
    if source is None or source.GetPath() != attribute.GetPath():
        taken = "that of a shader" if source is None else f"that of {source.GetPath()}"
        raise EditError(f"{target}: is connected, so its own value is not taken but {taken}")
    order = UsdGeom.Xformable(prim).GetXformOpOrderAttr().Get()
    if name.startswith("xformOp:") and name not in (order if isinstance(order, Vt.TokenArray) else ()):
        raise EditError(f"{target}: is of no effect, since xformOpOrder of {prim.GetPath()} does not name it")
    return attribute


def _with_component(
    attribute: Usd.Attribute, component: int | None, value: float | str, time: Usd.TimeCode, target: str
) -> object:
    """The attribute's value with one number of it replaced."""
    type_name = attribute.GetTypeName()
    vector = None if type_name.isArray else VECTOR.fullmatch(type_name.type.typeName)
    if vector is None and type_name not in NUMBERS and type_name not in INTEGERS:
        raise EditError(f"{target}: is of type {type_name}; accepted: a number, or one of a vector or color")
    size = int(vector["size"]) if vector else None
    if (component is None) != (size is None) or (component is not None and size is not None and component >= size):
        accepted = f"{target.partition('[')[0]}" + (f"[0] to [{size - 1}]" if size else "")
        raise EditError(f"{target}: is of type {type_name}; accepted: {accepted}")
    is_whole = type_name in INTEGERS or bool(vector and vector["type"] == "i")
    number = _number(value, INTEGERS.get(type_name, INTEGERS[Sdf.ValueTypeNames.Int]) if is_whole else None, target)
    if component is None:
        return number
    whole = attribute.Get(time)
    if whole is None:
        raise EditError(f"{target}: has no value, of which one number could be replaced")
    whole[component] = number
    return whole


def _number(value: float | str, limits: tuple[int, int] | None, target: str) -> float | int:
    if isinstance(value, str) or not math.isfinite(value):
        raise EditError(f"{target}: found {value!r}; accepted: a finite number")
    if limits is None:
        return float(value)
    if value != int(value) or not limits[0] <= value <= limits[1]:
        raise EditError(f"{target}: found {value:g}; accepted: a whole number in [{limits[0]}, {limits[1]}]")
    return int(value)


def _near(name: str, there: Iterable[str] | Sequence[str]) -> str:
    names = list(there)
    nearest = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    if nearest:
        return f"; did you mean {nearest[0]}?"
    more = ", ..." if len(names) > NEAR_MOST else ""
    return f"; it has: {', '.join(names[:NEAR_MOST])}{more}" if names else "; it has none"
