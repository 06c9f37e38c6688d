"""UsdGeom.PointInstancer: where the copies of its prototypes stand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pxr import Sdf, Usd, UsdGeom, Vt

from fgf_warp.errors import SceneError, UnsupportedFeatureError
from fgf_warp.scene.placements import blocks, compose, squared
from usd_scenes.reader.attributes import read_array
from usd_scenes.reader.context import StageContext

Matrices = tuple[np.ndarray, np.ndarray]
"""(n, 3, 4) float64, the upper rows of matrices that act on column vectors, when the shutter opens and when it closes;
one and the same array where nothing moves."""
MAX_INSTANCES = 4_000_000
"""Of a stage, so that all of them, with USD's own matrices of theirs, fit in 2 GiB."""


@dataclass(frozen=True, eq=False)
class Copies:
    """The copies of one prototype.

    Args:
        root: the prototype's root.
        instancer: whose prototype it is.
        index: of the prototype in the instancer.
        around: the copies of the instancer itself, where it is part of a prototype.
        own: (m,) int32, the numbers in the instancer of those of its instances that are copies of this prototype; in
            each copy of the instancer there are as many.
        total: instances of the instancer, of whichever prototype.
        to_world: from the root's space.
    """

    root: Usd.Prim
    instancer: Usd.Prim
    index: int
    around: Copies | None
    own: np.ndarray
    total: int
    to_world: Matrices

    @property
    def count(self) -> int:
        """How many copies there are."""
        return len(self.to_world[0])

    @property
    def levels(self) -> tuple[Copies, ...]:
        """These copies, and those that they are in, the innermost first."""
        return (self, *(self.around.levels if self.around else ()))

    @property
    def key(self) -> tuple[object, ...]:
        """The same of no other copies."""
        return tuple((level.instancer.GetPath(), level.index) for level in self.levels)

    @property
    def numbers(self) -> np.ndarray:
        """(n,) int32, of each copy in the outermost instancer."""
        return self.numbers_in(self.levels[-1])

    def numbers_in(self, level: Copies) -> np.ndarray:
        """(n,) int32, of each copy in the instancer of one of `levels`."""
        if self.around is None:
            return self.own
        if level is self:
            return np.tile(self.own, self.around.count)
        return np.repeat(self.around.numbers_in(level), len(self.own))

    def matrices(self, prim: Usd.Prim, context: StageContext) -> Matrices:
        """From the space of a prim of the prototype to the world, for each copy.

        Returns:
            Two (n, 3, 4) float64, at the opening and at the closing of the shutter; one and the same array where
            nothing moves.
        """
        (opening, closing), (first, last) = self.to_world, context.local_to_ancestor(prim, self.root)
        moved = _moved(opening, first)
        return moved, moved if closing is opening and np.array_equal(first, last) else _moved(closing, last)


def read_copies(prim: Usd.Prim, context: StageContext, around: Copies | None) -> list[Copies]:
    """The copies that a PointInstancer makes of each of its prototypes.

    Instances of what is not there, or whose transforms are not finite, are left out with a warning; all of them where
    the arrays do not fit together.

    Args:
        prim: the instancer.
        context: the stage.
        around: the copies of the instancer itself, where it is part of a prototype.

    Returns:
        One for each prototype of which there is a copy, in the instancer's order.

    Raises:
        SceneError: for what is left out, where the stage is read strictly.
        UnsupportedFeatureError: for more than `MAX_INSTANCES`, before they are made.
    """
    with context.leaving_out(prim.GetPath(), "the instancer is left out"):
        return _read_copies(prim, context, around)
    return []


def _read_copies(prim: Usd.Prim, context: StageContext, around: Copies | None) -> list[Copies]:
    instancer, path = UsdGeom.PointInstancer(prim), prim.GetPath()
    _check_types(instancer, context)
    roots = instancer.GetPrototypesRel().GetForwardedTargets()
    chosen = read_array(instancer.GetProtoIndicesAttr(), context.time, np.int32)
    given = {"prototypes": roots, "protoIndices": chosen, "positions": instancer.GetPositionsAttr().Get(context.time)}
    if missing := [name for name, values in given.items() if values is None or not len(values)]:
        context.notes.add(f"instancer without {', '.join(missing)} draws nothing", path)
        return []
    _check_counts(instancer, len(chosen), context)
    chosen = _shown(instancer, chosen, len(roots), context)
    places = [np.flatnonzero(chosen == index).astype(np.int32) for index in range(len(roots))]
    for own, target in zip(places, roots, strict=True):
        if len(own):
            _check_bound(path, [*(len(level.own) for level in reversed(around.levels if around else ())), len(own)])
            if not context.stage.GetPrimAtPath(target):
                context.mend(f"the prototype {target} is not there; its instances are left out", path)
    if not any(map(len, places)):
        return []
    local = _transforms(instancer, roots, len(chosen), context)
    bases = _bases(prim, context, around)
    found = []
    for index, (own, target) in enumerate(zip(places, roots, strict=True)):
        root = context.stage.GetPrimAtPath(target)
        kept = _finite(own, local, instancer, context)
        if root and len(kept):
            first, last = context.local_to_ancestor(root, root.GetParent())
            opening = _moved(_products(bases[0], local[0], kept), first)
            moves = len(local) > 1 or bases[1] is not bases[0]
            closing = _moved(_products(bases[1], local[-1], kept), last) if moves else opening
            found.append(Copies(root, prim, index, around, kept, len(chosen), (opening, closing)))
    return found


def _bases(prim: Usd.Prim, context: StageContext, around: Copies | None) -> Matrices:
    """Where the instancer itself stands."""
    if around:
        return around.matrices(prim, context)
    opening, closing = context.local_to_world(prim)[None, :3], context.closing_to_world(prim)
    return opening, opening if closing is None else closing[None, :3]


def _moved(places: np.ndarray, inner: np.ndarray) -> np.ndarray:
    return places if np.array_equal(inner, np.eye(4)) else compose(places, inner)


def _products(bases: np.ndarray, local: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Of each base, (n, 3, 4), and each of some of USD's matrices, which act on row vectors: (n * m, 3, 4)."""
    made = np.empty((len(bases), len(own), 3, 4))
    if len(bases) > len(own):
        for number, to in zip(own, made.swapaxes(0, 1), strict=True):
            to[:] = compose(bases, local[number].T)
        return made.reshape(-1, 3, 4)
    for at in blocks(len(own)):
        inner = local[own[at]].reshape(-1, 4)
        for base, to in zip(squared(bases), made, strict=True):
            to[at] = (inner @ base.T).reshape(-1, 4, 4)[:, :, :3].transpose(0, 2, 1)
    return made.reshape(-1, 3, 4)


def _check_bound(path: Sdf.Path, counts: Sequence[int]) -> None:
    product = math.prod(counts)
    if product > MAX_INSTANCES:
        factors = " x ".join(f"{count:,}" for count in counts)
        shown = f"{factors} = {product:,}" if len(counts) > 1 else factors
        raise UnsupportedFeatureError(f"{path}: {shown} instances; accepted: at most {MAX_INSTANCES:,} in a stage")


def _check_types(instancer: UsdGeom.PointInstancer, context: StageContext) -> None:
    """Refuses what USD itself would take for missing, or cannot look up."""
    for attribute, accepted, expected in (
        (instancer.GetProtoIndicesAttr(), "int[]", Vt.IntArray),
        (instancer.GetPositionsAttr(), "point3f[]", Vt.Vec3fArray),
        (instancer.GetOrientationsAttr(), "quath[]", Vt.QuathArray),
        (instancer.GetOrientationsfAttr(), "quatf[]", Vt.QuatfArray),
        (instancer.GetScalesAttr(), "float3[]", Vt.Vec3fArray),
    ):
        specs, value = attribute.GetPropertyStack(), attribute.Get(context.time)
        if value is not None and not isinstance(value, expected):
            raise SceneError(f"{attribute.GetPath()} is of type {specs[0].typeName}; accepted: {accepted}")
        if any(math.isnan(time) for spec in specs for time in spec.layer.ListTimeSamplesForPath(spec.path)):
            raise SceneError(f"{attribute.GetPath()} has a sample at a time code that is not a number")


def _check_counts(instancer: UsdGeom.PointInstancer, expected: int, context: StageContext) -> None:
    for attribute in (
        instancer.GetPositionsAttr(),
        instancer.GetOrientationsAttr(),
        instancer.GetOrientationsfAttr(),
        instancer.GetScalesAttr(),
    ):
        found = _length(attribute, context)
        if found not in (0, expected):
            raise SceneError(
                f"{attribute.GetPath()} has {found} entries; accepted: {expected}, as there are in protoIndices"
            )
    for attribute in _rates(instancer):
        if (found := _length(attribute, context)) not in (0, expected):
            text = f"{found} entries, where there are {expected} in protoIndices; nothing moves by it"
            context.mend(text, attribute.GetPath())


def _length(attribute: Usd.Attribute, context: StageContext) -> int:
    values = attribute.Get(context.time)
    return len(values) if hasattr(values, "__len__") else 0


def _rates(instancer: UsdGeom.PointInstancer) -> tuple[Usd.Attribute, ...]:
    return instancer.GetVelocitiesAttr(), instancer.GetAccelerationsAttr(), instancer.GetAngularVelocitiesAttr()


def _shown(instancer: UsdGeom.PointInstancer, chosen: np.ndarray, n_roots: int, context: StageContext) -> np.ndarray:
    """(n,), the prototypes of all instances; -1 of those that are inactive, invisible or of none."""
    is_there = (chosen >= 0) & (chosen < n_roots)
    if not is_there.all():
        wrong = chosen[~is_there]
        context.mend(
            f"{len(wrong)} of {len(chosen)} indices lie out of [0, {n_roots - 1}], as {wrong[0]} does, where there are "
            f"{n_roots} prototypes; those instances are left out",
            instancer.GetProtoIndicesAttr().GetPath(),
        )
    ids = instancer.GetIdsAttr().Get(context.time)
    if ids is not None and not isinstance(ids, Vt.Int64Array):
        text = "is no array of integers of 64 bits; no instance is hidden by its id"
        context.mend(text, instancer.GetIdsAttr().GetPath())
    elif ids is not None and len(ids) not in (0, len(chosen)):
        text = f"{len(ids)} entries, where there are {len(chosen)} in protoIndices; no instance is hidden by its id"
        context.mend(text, instancer.GetIdsAttr().GetPath())
    else:
        mask = instancer.ComputeMaskAtTime(context.time)
        is_there &= np.array(mask, dtype=bool) if mask else True
    return np.where(is_there, chosen, -1)


def _transforms(
    instancer: UsdGeom.PointInstancer, roots: Sequence[Sdf.Path], count: int, context: StageContext
) -> list[np.ndarray]:
    """(n, 4, 4) float64 that act on row vectors, from above the prototypes' roots to the instancer: USD's own arrays.

    One when the shutter opens, and one when it closes where something may move until then.
    """
    (opening, closing), base = context.shutter_times, context.time
    if base.IsEarliestTime() and (samples := instancer.GetPositionsAttr().GetTimeSamples()):
        # USD takes this time for minus infinity where it computes how far velocities reach.
        opening = closing = base = Usd.TimeCode(samples[0])
    rests = opening == closing or not _may_move(instancer, roots, context)
    found = instancer.ComputeInstanceTransformsAtTimes(
        [opening] if rests else [opening, closing],
        base,
        # With them, USD makes none at all where one index is out of range.
        UsdGeom.PointInstancer.ExcludeProtoXform,
        UsdGeom.PointInstancer.IgnoreMask,
    )
    local = [np.asarray(matrices) for matrices in found]
    if any(len(matrices) != count for matrices in local) or not local:
        raise SceneError(
            f"{instancer.GetPath()}: USD makes no transforms of its arrays; accepted: those that fit together"
        )
    return local


def _may_move(instancer: UsdGeom.PointInstancer, roots: Sequence[Sdf.Path], context: StageContext) -> bool:
    attributes = (
        instancer.GetPositionsAttr(),
        instancer.GetOrientationsAttr(),
        instancer.GetOrientationsfAttr(),
        instancer.GetScalesAttr(),
    )
    prims = (UsdGeom.Xformable(context.stage.GetPrimAtPath(root)) for root in roots)
    return (
        any(attribute.ValueMightBeTimeVarying() for attribute in attributes)
        or any(attribute.HasAuthoredValue() for attribute in _rates(instancer))
        or any(prim and prim.TransformMightBeTimeVarying() for prim in prims)
    )


def _finite(
    own: np.ndarray, local: Sequence[np.ndarray], instancer: UsdGeom.PointInstancer, context: StageContext
) -> np.ndarray:
    """Those of some instances whose transforms are finite."""
    kept = [
        own[at][np.logical_and.reduce([np.isfinite(matrices[own[at]]).all(axis=(1, 2)) for matrices in local])]
        for at in blocks(len(own))
    ]
    found = np.concatenate([own[:0], *kept])
    if len(found) < len(own):
        text = f"{len(own) - len(found)} transforms hold numbers that are not finite; those instances are left out"
        context.mend(text, instancer.GetPath())
    return found
