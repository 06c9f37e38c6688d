"""Renders as OpenEXR files: float32, ZIP compression, all parameters in the header.

| channels | what |
|---|---|
| ``R`` ``G`` ``B`` | radiance, linear Rec.709, over black |
| ``A`` | alpha |
| ``Z`` | `Aov.DEPTH` |
| ``variance.R`` ``.G`` ``.B`` | `Aov.VARIANCE` |
| ``transmittance.R`` ``.G`` ``.B`` | `Aov.TRANSMITTANCE` |
| ``albedo.R`` ``.G`` ``.B`` | `Aov.ALBEDO` |
| ``samples.Y`` | `Aov.SAMPLES`; Y is the name that viewers show as a single grey plane |
| ``collisions.R`` ``.G`` ``.B`` | `Aov.COLLISIONS` |
| ``path_length.R`` ``.G`` ``.B`` | `Aov.PATH_LENGTH` |
| ``normal.X`` ``.Y`` ``.Z`` | `Aov.NORMAL` |
| ``prim_id.Y`` | `Aov.PRIM_ID`, whose names are ``prims`` in the header |
| ``instance_id.Y`` | `Aov.INSTANCE_ID` |
| ``motion.X`` ``.Y`` | `Aov.MOTION` |
| ``optical_depth.R`` ``.G`` ``.B`` | `Aov.OPTICAL_DEPTH` |
| ``scatterings.Y`` | `Aov.SCATTERINGS` |
| ``direct.R`` ``.G`` ``.B`` | `Aov.DIRECT` |
| ``indirect.R`` ``.G`` ``.B`` | `Aov.INDIRECT` |
| ``denoised.R`` ``.G`` ``.B`` | `Aov.DENOISED` |

The string attribute ``fgf:parameters`` is one JSON object, `RenderResult.provenance`; EXR has no attribute type
that keeps nested parameters in double precision.
"""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from fgf_warp.errors import CorruptFileError
from fgf_warp.output.images import read_image, write_image
from fgf_warp.result import RenderResult
from fgf_warp.settings import Aov

PARAMETERS_ATTRIBUTE = "fgf:parameters"
GREY = {Aov.SAMPLES, Aov.PRIM_ID, Aov.INSTANCE_ID, Aov.SCATTERINGS}
"""Planes of one channel; the others are colours but for those with channels of their own."""
AOV_CHANNELS = {aov: tuple(f"{aov}.{channel}" for channel in ("Y" if aov in GREY else "RGB")) for aov in Aov} | {
    Aov.DEPTH: ("Z",),
    Aov.NORMAL: ("normal.X", "normal.Y", "normal.Z"),
    Aov.MOTION: ("motion.X", "motion.Y"),
}


def channel_names(aovs: Collection[Aov]) -> tuple[str, ...]:
    """Names of the channels of a file with these AOVs, in the order in which they are written."""
    return ("R", "G", "B", "A", *(name for aov in _ordered(aovs) for name in AOV_CHANNELS[aov]))


def write_exr(path: Path, result: RenderResult) -> None:
    """Writes a render with the AOVs that its settings ask for. Equal renders give equal bytes.

    Args:
        path: ends in ``.exr``; its folder exists.
        result: the render.

    Raises:
        OutputError: where the file cannot be written; nothing is then left behind.
    """
    aovs = result.settings.aovs
    planes = [result.radiance, result.alpha[..., None], *(_plane(result, aov) for aov in _ordered(aovs))]
    pixels = np.concatenate(planes, axis=2).astype(np.float32, copy=False)
    # NaN is no JSON; the parameters of a scene are finite.
    parameters = json.dumps(result.provenance, sort_keys=True, allow_nan=False)
    write_image(path, pixels, channel_names(aovs), {"compression": "zip", PARAMETERS_ATTRIBUTE: parameters})


def read_exr(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Reads a file of `write_exr`.

    Returns:
        Each channel by name as (height, width) float32, and the parameters of the header.

    Raises:
        CorruptFileError: where the file is missing, incomplete, or has no parameters.
    """
    pixels, names, header = read_image(path)
    try:
        parameters = json.loads(header[PARAMETERS_ATTRIBUTE])
    except (KeyError, ValueError, RecursionError) as error:
        raise CorruptFileError(f"{path}: the header has no readable {PARAMETERS_ATTRIBUTE}") from error
    return {name: pixels[..., i] for i, name in enumerate(names)}, parameters


def _ordered(aovs: Collection[Aov]) -> list[Aov]:
    return [aov for aov in Aov if aov in aovs]


def _plane(result: RenderResult, aov: Aov) -> np.ndarray:
    """(height, width, channel) of one AOV."""
    shape = (*result.alpha.shape, len(AOV_CHANNELS[aov]))
    if aov is Aov.VARIANCE:
        return result.variance
    plane = result.aovs[aov]
    return np.broadcast_to(plane if plane.ndim == 3 else plane[..., None], shape)
