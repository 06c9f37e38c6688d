"""Walks over what of a stage is to be seen, into instances and into the prototypes of instancers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from pxr import Sdf, Usd, UsdGeom

from usd_scenes.reader.context import StageContext
from usd_scenes.reader.instancing import Copies, read_copies

PROTOTYPE_PRIMS = Usd.PrimIsActive & Usd.PrimIsLoaded & Usd.PrimHasDefiningSpecifier
"""Prototypes may stand below an `over` or a `class`, which keeps them from being drawn by themselves."""


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


def walk(context: StageContext) -> Iterator[Met]:
    """The visible prims, parents first; those of an instancer's prototype come once, with its copies."""
    for prim in context.stage.GetPseudoRoot().GetChildren():
        yield from _walk_from(prim, context, None, None)


def _walk_from(
    prim: Usd.Prim, context: StageContext, copies: Copies | None, purpose: UsdGeom.Imageable.PurposeInfo | None
) -> Iterator[Met]:
    imageable = UsdGeom.Imageable(prim)
    if imageable:
        if imageable.GetVisibilityAttr().Get(context.time) == UsdGeom.Tokens.invisible:
            return
        purpose = imageable.ComputePurposeInfo(purpose) if purpose else imageable.ComputePurposeInfo()
    yield Met(prim, copies, purpose is None or purpose.purpose in context.purposes)
    if prim.IsA(UsdGeom.PointInstancer):
        if copies and any(prim == level.instancer for level in copies.levels):
            context.notes.add("instancer that is part of its own prototype is left out there", prim.GetPath())
            return
        inners: list[Copies] = []
        with context.going_on():
            inners = read_copies(prim, context, copies)
        for inner in inners:
            yield from _walk_from(inner.root, context, inner, purpose)
        return  # What else is below an instancer is not drawn by itself.
    predicate = PROTOTYPE_PRIMS if copies else Usd.PrimDefaultPredicate
    for child in prim.GetFilteredChildren(Usd.TraverseInstanceProxies(predicate)):
        if copies is None or child.GetSpecifier() != Sdf.SpecifierClass:
            yield from _walk_from(child, context, copies, purpose)
