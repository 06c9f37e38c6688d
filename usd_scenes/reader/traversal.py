"""Walks over what of a stage is to be seen, into instances and into the prototypes of instancers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from pxr import Sdf, Usd, UsdGeom

from usd_scenes.reader.attributes import read_mended_token
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.instancing import Copies, read_copies
from usd_scenes.reader.settings import PURPOSES

PROTOTYPE_PRIMS = Usd.PrimIsActive & Usd.PrimIsLoaded & Usd.PrimHasDefiningSpecifier
"""Prototypes may stand below an `over` or a `class`, which keeps them from being drawn by themselves."""


VISIBILITIES = ("inherited", "invisible")


@dataclass(frozen=True, eq=False)
class Met:
    """A visible prim.

    Args:
        prim: the prim; of an instance, the instance's proxy.
        copies: of the instancer's prototype that it is part of, or None.
        has_purpose: True where geometry of its purpose is read.
    """

    prim: Usd.Prim
    copies: Copies | None
    has_purpose: bool


@dataclass(frozen=True, eq=False)
class _Place:
    """A prim to go to, visible or not, with the purpose that what is above it has."""

    prim: Usd.Prim
    copies: Copies | None = None
    purpose: UsdGeom.Imageable.PurposeInfo | None = None


def walk(context: StageContext) -> Iterator[Met]:
    """The visible prims, parents first; those of an instancer's prototype come once, with its copies."""
    # A stack in place of recursion, which prims that are nested a thousand deep would be too much for.
    levels: list[Iterator[_Place]] = [map(_Place, context.stage.GetPseudoRoot().GetChildren())]
    while levels:
        place = next(levels[-1], None)
        if place is None:
            levels.pop()
            continue
        imageable, purpose = UsdGeom.Imageable(place.prim), place.purpose
        if imageable:
            if read_mended_token(imageable.GetVisibilityAttr(), context, VISIBILITIES, "inherited") == "invisible":
                continue
            purpose = imageable.ComputePurposeInfo(purpose) if purpose else imageable.ComputePurposeInfo()
        yield Met(place.prim, place.copies, purpose is None or _is_asked_for(purpose, place.prim, context))
        levels.append(_below(_Place(place.prim, place.copies, purpose), context))


def _is_asked_for(info: UsdGeom.Imageable.PurposeInfo, prim: Usd.Prim, context: StageContext) -> bool:
    purpose = info.purpose
    if purpose not in PURPOSES:
        attribute = UsdGeom.Imageable(prim).GetPurposeAttr()
        if attribute.HasAuthoredValue():  # Below it the same holds, and is not told again.
            text = f"= {attribute.Get()}; accepted: {', '.join(PURPOSES)}; default is used"
            context.mend(text, attribute.GetPath())
        purpose = "default"
    return purpose in context.purposes


def _below(place: _Place, context: StageContext) -> Iterator[_Place]:
    """The prims to go to next."""
    prim, copies, purpose = place.prim, place.copies, place.purpose
    if prim.IsA(UsdGeom.PointInstancer):
        if copies and prim in copies.instancers:
            context.notes.add("instancer that is part of its own prototype is left out there", prim.GetPath())
            return
        for inner in read_copies(prim, context, copies):
            yield _Place(inner.root, inner, purpose)
        return  # What else is below an instancer is not drawn by itself.
    predicate = PROTOTYPE_PRIMS if copies else Usd.PrimDefaultPredicate
    for child in prim.GetFilteredChildren(Usd.TraverseInstanceProxies(predicate)):
        if copies is None or child.GetSpecifier() != Sdf.SpecifierClass:
            yield _Place(child, copies, purpose)
