"""Light linking: which shapes a light shines on, and which cast shadows in its light."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdLux

from fgf_warp.errors import UnsupportedFeatureError
from fgf_warp.scene import MAX_LINKS, Light, Shape
from usd_scenes.reader.attributes import read_mended_flag
from usd_scenes.reader.context import StageContext

Membership = Callable[[Sdf.Path], bool]


def link_lights(
    lights: Sequence[tuple[Usd.Prim, Light]], shapes: Sequence[tuple[Sdf.Path, Shape]], context: StageContext
) -> tuple[list[Light], list[Shape]]:
    """Gives lights that are linked to some of the shapes their numbers, and those shapes the bits.

    A light that is linked to every shape there is keeps no link.

    Args:
        lights: each with its prim.
        shapes: each with the path that collections name it by.
        context: the stage.

    Returns:
        Both in their order: the lights with `link` and `shadow_link`, numbers from 0 on, and the shapes with
        `light_links` and `shadow_links`, whose bit k is that of the lights of number k.

    Raises:
        UnsupportedFeatureError: for more different sets of shapes than there are bits.
    """
    paths = [path for path, _ in shapes]
    light_sets, shadow_sets = _Sets("light", paths), _Sets("shadow", paths)
    linked = [
        replace(
            light,
            link=light_sets.number(_light_link(prim, paths, context)),
            shadow_link=shadow_sets.number(_shadow_link(prim, paths, context)),
        )
        for prim, light in lights
    ]
    if not (light_sets.count or shadow_sets.count):
        return linked, [shape for _, shape in shapes]
    bits = zip(light_sets.bits(), shadow_sets.bits(), strict=True)
    return linked, [
        replace(shape, light_links=light, shadow_links=shadow)
        for (_, shape), (light, shadow) in zip(shapes, bits, strict=True)
    ]


class _Sets:
    """The different sets of shapes that lights are linked to, each with a number.

    Args:
        kind: for messages.
        paths: of the shapes.
    """

    def __init__(self, kind: str, paths: Sequence[Sdf.Path]) -> None:
        self._kind = kind
        self._paths = paths
        self._numbers: dict[bytes, int] = {}

    @property
    def count(self) -> int:
        return len(self._numbers)

    def number(self, is_member: Membership | None) -> int | None:
        """Of the set of those that are members; None of the set of all."""
        if is_member is None:
            return None
        members = np.array([is_member(path) for path in self._paths], dtype=bool)
        if members.size and members.all():
            return None
        number = self._numbers.setdefault(members.tobytes(), len(self._numbers))
        if number >= MAX_LINKS:
            raise UnsupportedFeatureError(
                f"{self._kind} links of the stage name more than {MAX_LINKS} different sets of shapes; accepted: at "
                f"most {MAX_LINKS}"
            )
        return number

    def bits(self) -> list[int]:
        """Of each shape: bit k is set where it is in the set of number k."""
        bits = [0] * len(self._paths)
        for members, number in self._numbers.items():
            for shape in np.flatnonzero(np.frombuffer(members, dtype=bool)):
                bits[shape] |= 1 << number
        return bits


def _light_link(prim: Usd.Prim, paths: Sequence[Sdf.Path], context: StageContext) -> Membership | None:
    return _membership(UsdLux.LightAPI(prim).GetLightLinkCollectionAPI(), paths, context)


def _shadow_link(prim: Usd.Prim, paths: Sequence[Sdf.Path], context: StageContext) -> Membership | None:
    shadow = UsdLux.ShadowAPI(prim)
    if prim.HasAPI(UsdLux.ShadowAPI) and not read_mended_flag(shadow.GetShadowEnableAttr(), context, default=True):
        return lambda path: False
    return _membership(UsdLux.LightAPI(prim).GetShadowLinkCollectionAPI(), paths, context)


def _membership(collection: Usd.CollectionAPI, paths: Sequence[Sdf.Path], context: StageContext) -> Membership | None:
    """Tests whether a path is in the collection; None where it is the whole stage."""
    includes, excludes = collection.GetIncludesRel().GetTargets(), collection.GetExcludesRel().GetTargets()
    expression = collection.GetMembershipExpressionAttr()
    includes_root = collection.GetIncludeRootAttr().Get(context.time)
    if includes_root and not excludes and not expression.HasAuthoredValue():
        return None
    stage = context.stage
    for path in (*includes, *excludes):
        if UsdGeom.Subset(stage.GetPrimAtPath(path)) and path not in paths:
            context.notes.add("a light cannot be linked to a part of a mesh that has no material of its own", path)
    return collection.ComputeMembershipQuery().IsPathIncluded
