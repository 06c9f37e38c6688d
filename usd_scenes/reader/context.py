"""What every reader of a prim needs: the stage, the time, the transforms, and where to put warnings."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from pxr import Tf, Usd, UsdGeom

from fgf_warp.errors import SceneError
from usd_scenes.reader.notes import Notes


@dataclass(frozen=True, eq=False)
class StageContext:
    """A stage at one time.

    Args:
        stage: the open stage; it must outlive the prims that are read.
        time: where attributes are sampled.
        purposes: of the geometry that is read.
        notes: collects warnings.
    """

    stage: Usd.Stage
    time: Usd.TimeCode
    purposes: frozenset[str]
    notes: Notes = field(default_factory=Notes)
    _transforms: UsdGeom.XformCache = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_transforms", UsdGeom.XformCache(self.time))

    def local_to_world(self, prim: Usd.Prim) -> np.ndarray:
        """(4, 4) float64 that acts on column vectors; USD's own matrices act on row vectors.

        Raises:
            SceneError: for a transform that is not finite or that USD cannot make sense of.
        """
        try:
            matrix = np.array(self._transforms.GetLocalToWorldTransform(prim)).T
        except Tf.ErrorException as error:
            raise SceneError(f"{prim.GetPath()}.xformOpOrder: {error.args[0].commentary.strip()}") from None
        if not np.isfinite(matrix).all():
            raise SceneError(f"{prim.GetPath()}: the world transform holds numbers that are not finite")
        return matrix

    @property
    def up_axis(self) -> str:
        """``Y`` or ``Z``."""
        return "Z" if UsdGeom.GetStageUpAxis(self.stage) == UsdGeom.Tokens.z else "Y"
