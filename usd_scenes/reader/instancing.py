"""UsdGeom.PointInstancer: where the copies of its prototypes stand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from fgf_warp.errors import SceneError
from usd_scenes.reader.attributes import read_array
from usd_scenes.reader.context import StageContext

Matrices = tuple[np.ndarray, np.ndarray]
"""(n, 4, 4) float64 that act on column vectors, when the shutter opens and when it closes."""


@dataclass(frozen=True, eq=False)
class Copies:
    """The copies of one prototype.

    Args:
        root: the prototype's root.
        instancers: the instancers that it is in, the outermost first.
        numbers: (n,) int, of each copy in the outermost instancer.
        to_world: from the root's space.
    """

    root: Usd.Prim
    instancers: tuple[Usd.Prim, ...]
    numbers: np.ndarray
    to_world: Matrices

    def matrices(self, prim: Usd.Prim, context: StageContext) -> Matrices:
        """From the space of a prim of the prototype to the world, for each copy."""
        (opening, closing), (first, last) = self.to_world, context.local_to_ancestor(prim, self.root)
        return opening @ first, closing @ last


def read_copies(prim: Usd.Prim, context: StageContext, around: Copies | None) -> Iterator[Copies]:
    """The copies that a PointInstancer makes of each of its prototypes.

    Args:
        prim: the instancer.
        context: the stage.
        around: the copies of the instancer itself, where it is part of a prototype.

    Raises:
        SceneError: for arrays that do not fit together, or transforms that are not finite.
    """
    instancer, path = UsdGeom.PointInstancer(prim), prim.GetPath()
    roots = instancer.GetPrototypesRel().GetForwardedTargets()
    chosen = read_array(instancer.GetProtoIndicesAttr(), context.time, np.int64)
    given = {"prototypes": roots, "protoIndices": chosen, "positions": instancer.GetPositionsAttr().Get(context.time)}
    if missing := [name for name, values in given.items() if values is None or not len(values)]:
        context.notes.add(f"instancer without {', '.join(missing)} draws nothing", path)
        return
    _check(instancer, chosen, len(roots), context)
    is_shown = _shown(instancer, len(chosen), context)
    opening, closing = _transforms(instancer, len(chosen), context)
    if around is None:
        start = context.local_to_world(prim)
        end = context.closing_to_world(prim)
        bases = start[None], (start if end is None else end)[None]
        numbers, instancers = None, (prim,)
    else:
        bases, numbers, instancers = around.matrices(prim, context), around.numbers, (*around.instancers, prim)
    for index, target in enumerate(roots):
        places = np.flatnonzero(is_shown & (chosen == index))
        root = context.stage.GetPrimAtPath(target)
        if not len(places):
            continue
        if not root:
            context.mend(f"the prototype {target} is not there", path)
            continue
        yield Copies(
            root=root,
            instancers=instancers,
            numbers=places if numbers is None else np.repeat(numbers, len(places)),
            to_world=(_products(bases[0], opening[places]), _products(bases[1], closing[places])),
        )


def _products(bases: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """(n * m, 4, 4) of (n, 4, 4) and (m, 4, 4)."""
    return (bases[:, None] @ inner).reshape(-1, 4, 4)


def _check(instancer: UsdGeom.PointInstancer, chosen: np.ndarray, n_roots: int, context: StageContext) -> None:
    if chosen.min() < 0 or chosen.max() >= n_roots:
        raise SceneError(
            f"{instancer.GetProtoIndicesAttr().GetPath()} spans [{chosen.min()}, {chosen.max()}]; "
            f"accepted: [0, {n_roots - 1}], as there are {n_roots} prototypes"
        )
    for attribute, may_be_absent in (
        (instancer.GetPositionsAttr(), False),
        (instancer.GetOrientationsAttr(), True),
        (instancer.GetOrientationsfAttr(), True),
        (instancer.GetScalesAttr(), True),
        (instancer.GetIdsAttr(), True),
    ):
        found = len(attribute.Get(context.time) or ())
        if found != len(chosen) and not (may_be_absent and found == 0):
            raise SceneError(
                f"{attribute.GetPath()} has {found} entries; accepted: {len(chosen)}, as there are in protoIndices"
            )


def _shown(instancer: UsdGeom.PointInstancer, count: int, context: StageContext) -> np.ndarray:
    """(count,) bool: neither inactive nor invisible."""
    mask = instancer.ComputeMaskAtTime(context.time)
    return np.array(mask, dtype=bool) if mask else np.ones(count, dtype=bool)


def _transforms(instancer: UsdGeom.PointInstancer, count: int, context: StageContext) -> Matrices:
    """From the prototypes' roots to the instancer."""
    times, base = context.shutter_times, context.time
    if base.IsEarliestTime() and (samples := instancer.GetPositionsAttr().GetTimeSamples()):
        # USD takes this time for minus infinity where it computes how far velocities reach.
        base = Usd.TimeCode(samples[0])
        times = base, base
    found = instancer.ComputeInstanceTransformsAtTimes(
        times,
        base,
        UsdGeom.PointInstancer.IncludeProtoXform,
        UsdGeom.PointInstancer.IgnoreMask,
    )
    opening, closing = (np.asarray(matrices, dtype=np.float64).transpose(0, 2, 1) for matrices in found)
    if len(opening) != count or len(closing) != count:
        raise SceneError(f"{instancer.GetPath()}: {len(opening)} transforms for {count} instances")
    if not (np.isfinite(opening).all() and np.isfinite(closing).all()):
        raise SceneError(f"{instancer.GetPath()}: the instances' transforms hold numbers that are not finite")
    return opening, closing
