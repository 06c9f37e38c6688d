"""What every reader of a prim needs: the stage, the time, the transforms, and where to put warnings."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field

import numpy as np
from pxr import Tf, Usd, UsdGeom

from fgf_warp.errors import SceneError
from usd_scenes.reader.images import ImageFiles
from usd_scenes.reader.notes import Notes
from usd_scenes.reader.policy import Policy


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

        Raises:
            SceneError: as for `local_to_world`.
        """
        opening, closing = (self._matrix(cache, prim, ancestor) for cache in (self._opening, self._closing))
        return opening, closing

    @property
    def shutter_times(self) -> tuple[Usd.TimeCode, Usd.TimeCode]:
        """When the shutter opens and closes."""
        return self.shutter or (self.time, self.time)

    def _matrix(self, transforms: UsdGeom.XformCache, prim: Usd.Prim, ancestor: Usd.Prim | None = None) -> np.ndarray:
        try:
            if ancestor is None:
                found = transforms.GetLocalToWorldTransform(prim)
            else:
                found, _ = transforms.ComputeRelativeTransform(prim, ancestor)
            matrix = np.array(found).T
        except Tf.ErrorException as error:
            raise SceneError(f"{prim.GetPath()}.xformOpOrder: {error.args[0].commentary.strip()}") from None
        if not np.isfinite(matrix).all():
            raise SceneError(f"{prim.GetPath()}: the world transform holds numbers that are not finite")
        return matrix

    @property
    def up_axis(self) -> str:
        """``Y`` or ``Z``; Y where the stage says neither."""
        axis = str(self.stage.GetMetadata("upAxis")).upper()
        return "Z" if axis == "Z" else "Y"
