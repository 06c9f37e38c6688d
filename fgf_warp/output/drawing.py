"""Pictures made of pictures and words, such as contact sheets."""

from __future__ import annotations

import math

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its own documentation uses

from fgf_warp.errors import OutputError

Color = tuple[float, float, float]
FONT = "DroidSans"
"""Comes with OpenImageIO, so that a sheet looks the same everywhere."""
FONT_BOLD = "DroidSans-Bold"


class Canvas:
    """An 8-bit RGB picture to draw on; y runs down from the top.

    Args:
        width: [pixel].
        height: [pixel].
        background: in [0, 1] per channel, sRGB-encoded.
    """

    def __init__(self, width: int, height: int, background: Color) -> None:
        self._image = oiio.ImageBuf(oiio.ImageSpec(width, height, 3, "uint8"))
        self._check(oiio.ImageBufAlgo.fill(self._image, background))

    @property
    def pixels(self) -> np.ndarray:
        """(height, width, 3) uint8."""
        return _pixels_of(self._image, oiio.UINT8)

    def paste(self, picture: np.ndarray, x: int, y: int) -> None:
        """Places a (height, width, 3) uint8 picture with its top left corner at (x, y)."""
        source = oiio.ImageBuf(np.ascontiguousarray(picture))
        self._check(oiio.ImageBufAlgo.paste(self._image, x, y, 0, 0, source))

    def fill(self, x: int, y: int, width: int, height: int, color: Color) -> None:
        """Fills a rectangle."""
        self._check(oiio.ImageBufAlgo.fill(self._image, color, oiio.ROI(x, x + width, y, y + height)))

    def text(self, x: int, y: int, words: str, size: int, color: Color, *, bold: bool = False) -> None:
        """Writes a line whose top left corner is at (x, y); `size` is the height of a line [pixel]."""
        font = FONT_BOLD if bold else FONT
        baseline = y + round(0.8 * size)
        self._check(oiio.ImageBufAlgo.render_text(self._image, x, baseline, _drawn(words), size, font, color))

    def _check(self, done: bool) -> None:
        if not done:
            raise OutputError(f"the picture cannot be drawn: {self._image.geterror()}")


def text_width(words: str, size: int, *, bold: bool = False) -> int:
    """Width of a line of text [pixel]."""
    return oiio.ImageBufAlgo.text_size(_drawn(words), size, FONT_BOLD if bold else FONT).width


def _drawn(words: str) -> str:
    """The words in a line; what no font draws, such as half a character, leaves a blank."""
    return "".join(character if character.isprintable() else " " for character in words)


def resize_linear(radiance: np.ndarray, width: int) -> np.ndarray:
    """Brings linear radiance to a width, keeping its aspect ratio.

    Args:
        radiance: (height, width, 3) float32, finite.
        width: [pixel], >= 1. Enlargement is by whole factors, so that pixels stay square and true: the result is
            then the widest that is no wider than `width`.

    Returns:
        (height, width, 3) float32.

    Raises:
        OutputError: where it cannot be resized.
    """
    rows, columns, _ = radiance.shape
    if columns <= width:
        factor = width // columns
        return radiance.repeat(factor, axis=0).repeat(factor, axis=1)
    source = oiio.ImageBuf(np.ascontiguousarray(radiance, dtype=np.float32))
    # A box, since filters with negative lobes ring around bright lights.
    small = oiio.ImageBufAlgo.resize(
        source,
        filtername="box",
        roi=oiio.ROI(0, width, 0, max(1, math.floor(rows * width / columns + 0.5)), 0, 1, 0, 3),
    )
    if small.has_error:
        raise OutputError(f"the picture cannot be resized: {small.geterror()}")
    return _pixels_of(small, oiio.FLOAT)


def _pixels_of(image: oiio.ImageBuf, kind: oiio.BASETYPE) -> np.ndarray:
    pixels = image.get_pixels(kind)
    if pixels is None:
        raise OutputError(f"the picture cannot be drawn: {image.geterror()}")
    return pixels
