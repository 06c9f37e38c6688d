"""Planes of an image brought to a larger size."""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its own documentation uses

from fgf_warp.errors import OutputError

FILTER = "triangle"
"""Linear between the centres of pixels, so that no value leaves the range of its neighbours. Against long renders of
sphere and cloud_block, 128 pixels wide, from a half and a quarter of the pixels each way at 512 samples, its relative
RMSE is 1.5 %, 3.6 %, 2.8 % and 6.4 %; of ``lanczos3``, the nearest, 1.2 %, 3.1 %, 2.3 % and 5.5 %, but that makes
negative radiance around what is bright, and of a half at 64 samples it is the worse of the two."""


def enlarge(plane: np.ndarray, width: int, height: int) -> np.ndarray:
    """Brings a plane to a size by interpolation between its pixels' centres.

    Args:
        plane: (rows, columns) or (rows, columns, channel) float32, finite.
        width: [pixel], >= columns.
        height: [pixel], >= rows; the pixels need not stay square.

    Returns:
        (height, width) or (height, width, channel) float32.

    Raises:
        OutputError: where it cannot be resized.
    """
    source = oiio.ImageBuf(np.ascontiguousarray(plane, dtype=np.float32))
    channels = source.nchannels
    large = oiio.ImageBufAlgo.resize(source, filtername=FILTER, roi=oiio.ROI(0, width, 0, height, 0, 1, 0, channels))
    pixels = None if large.has_error else large.get_pixels(oiio.FLOAT)
    if pixels is None:
        raise OutputError(f"the image cannot be enlarged: {large.geterror()}")
    return pixels.reshape(height, width, *plane.shape[2:])


def repeat(plane: np.ndarray, width: int, height: int) -> np.ndarray:
    """Brings a plane to a size in which each pixel has the value of the one that it lies in.

    Args:
        plane: (rows, columns) or (rows, columns, channel), of any type.
        width: [pixel].
        height: [pixel].
    """
    rows, columns = plane.shape[:2]
    return plane[_nearest(rows, height)[:, None], _nearest(columns, width)]


def _nearest(count: int, size: int) -> np.ndarray:
    """(size,) of indices below count."""
    return (2 * np.arange(size) + 1) * count // (2 * size)
