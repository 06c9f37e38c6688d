"""What every reader of a prim needs: the stage, the time, the transforms, and where to put warnings."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom

from fgf_warp.errors import SceneError
from usd_scenes.reader.images import ImageFiles
from usd_scenes.reader.notes import Notes
from usd_scenes.reader.policy import Policy, commentary_of


@dataclass(frozen=True, eq=False)
class StageContext:
    """A stage at one time.

    Args:
        stage: the open stage; it must outlive the prims that are read.
        time: where attributes other than transforms are sampled.
        purposes: of the geometry that is read.
        shutter: times at which the shutter opens and closes, where transforms are sampled; None: both at `time`.
        refinement: levels of subdivision, >= 0.
        policy: what becomes of what is wrong.
        images: keeps the pictures that were read.
    """

    stage: Usd.Stage
    time: Usd.TimeCode
    purposes: frozenset[str]
    shutter: tuple[Usd.TimeCode, Usd.TimeCode] | None = None
    refinement: int = 2
    policy: Policy = field(default_factory=Policy)
    images: ImageFiles = field(default_factory=ImageFiles)
    _opening: UsdGeom.XformCache = field(init=False)
    _closing: UsdGeom.XformCache = field(init=False)
    _broken: dict[Sdf.Path, str] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        opening, closing = self.shutter_times
        object.__setattr__(self, "_opening", UsdGeom.XformCache(opening))
        object.__setattr__(self, "_closing", UsdGeom.XformCache(closing))

    @property
    def notes(self) -> Notes:
        """Where warnings go of what is not wrong, only not rendered as it is written."""
        return self.policy.notes

    def mend(self, text: str, path: object) -> None:
        """See `Policy.mend`."""
        self.policy.mend(text, path)

    def leaving_out(
        self, path: object, done: str, bounds_medium: Callable[[], bool] = lambda: False
    ) -> AbstractContextManager[None]:
        """See `Policy.leaving_out`."""
        return self.policy.leaving_out(path, done, bounds_medium)

    def going_on(self) -> AbstractContextManager[None]:
        """See `Policy.going_on`."""
        return self.policy.going_on()

    def local_to_world(self, prim: Usd.Prim) -> np.ndarray:
        """(4, 4) float64 that acts on column vectors, when the shutter opens; USD's own matrices act on row vectors.

        Raises:
            SceneError: for a transform that is not finite or that USD cannot make sense of.
        """
        return self._matrix(self._opening, prim)

    def closing_to_world(self, prim: Usd.Prim) -> np.ndarray | None:
        """The same when the shutter closes; None where the prim rests until then.

        Raises:
            SceneError: as for `local_to_world`.
        """
        if self.shutter is None or self.shutter[0] == self.shutter[1]:
            return None
        closing = self._matrix(self._closing, prim)
        return None if np.array_equal(closing, self.local_to_world(prim)) else closing

    def local_to_ancestor(self, prim: Usd.Prim, ancestor: Usd.Prim) -> tuple[np.ndarray, np.ndarray]:
        """The same from a prim's space to that of a prim above it, when the shutter opens and when it closes.

        Returns:
            Two (4, 4) float64, at the opening and at the closing.

        Raises:
            SceneError: as for `local_to_world`.
        """
        opening, closing = (self._matrix(cache, prim, ancestor) for cache in (self._opening, self._closing))
        return opening, closing

    @property
    def shutter_times(self) -> tuple[Usd.TimeCode, Usd.TimeCode]:
        """When the shutter opens and closes.

        Returns:
            Two time codes; both are the time of the stage where the shutter opens for an instant.
        """
        return self.shutter or (self.time, self.time)

    def _matrix(self, transforms: UsdGeom.XformCache, prim: Usd.Prim, ancestor: Usd.Prim | None = None) -> np.ndarray:
        try:
            if ancestor is None:
                found = transforms.GetLocalToWorldTransform(prim)
            else:
                found, _ = transforms.ComputeRelativeTransform(prim, ancestor)
            matrix = np.array(found).T
        except Tf.ErrorException as error:
            self._note_broken(prim, transforms.GetTime(), error)
        # The caches of USD tell it once, and then give what is below the transform one without what is wrong.
        if self._broken and (text := next((self._broken[p] for p in _upwards(prim) if p in self._broken), "")):
            raise SceneError(text)
        if not np.isfinite(matrix).all():
            raise SceneError(f"{prim.GetPath()}: the world transform holds numbers that are not finite")
        return matrix

    def _note_broken(self, prim: Usd.Prim, time: Usd.TimeCode, error: Tf.ErrorException) -> None:
        """Keeps whose transform, of a prim and those above it, USD cannot make sense of."""
        texts = {path: text for path in _upwards(prim) if (text := _broken_order(prim.GetStage(), path, time))}
        self._broken.update(texts or {prim.GetPath(): f"{prim.GetPath()}.xformOpOrder: {_first_sentence(error)}"})

    @property
    def up_axis(self) -> str:
        """``Y`` or ``Z``; Y where the stage says neither."""
        axis = str(self.stage.GetMetadata("upAxis")).upper()
        return "Z" if axis == "Z" else "Y"


def _upwards(prim: Usd.Prim) -> list[Sdf.Path]:
    """The paths of a prim and of those above it."""
    return [path for path in prim.GetPath().GetAncestorsRange() if not path.IsAbsoluteRootPath()]


def _broken_order(stage: Usd.Stage, path: Sdf.Path, time: Usd.TimeCode) -> str:
    """What USD says against the transform of one prim; empty where it says nothing."""
    with Tf.DiagnosticTrap() as trap:
        try:
            UsdGeom.XformCache(time).GetLocalTransformation(stage.GetPrimAtPath(path))
        except Tf.ErrorException as error:
            return f"{path}.xformOpOrder: {_first_sentence(error)}"
        finally:
            trap.Clear()
    return ""


def _first_sentence(error: Tf.ErrorException) -> str:
    """What USD says, without what it has done."""
    return str(commentary_of(error.args[0]).strip().split(". ")[0].rstrip("."))
