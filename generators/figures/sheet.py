"""Rendered pictures side by side, pixel by pixel as they were rendered."""

from __future__ import annotations

import io
from collections.abc import Sequence

import matplotlib.image
import numpy as np

from fgf_warp.output.color import to_display
from fgf_warp.output.drawing import Canvas, text_width

SMALLEST = 144
"""[pixel] Pictures below are enlarged by a whole factor, as far as they stay within it or until words fit."""
GAP, LABEL_SIZE, NOTE_SIZE = 6, 17, 14
PAPER, INK, FAINT = (1.0, 1.0, 1.0), (0.11, 0.14, 0.19), (0.33, 0.38, 0.44)


def picture_sheet(
    pictures: Sequence[Sequence[np.ndarray]],
    *,
    columns: Sequence[str],
    rows: Sequence[str],
    notes: Sequence[Sequence[str]],
    exposure: float = 0.0,
) -> bytes:
    """A PNG of pictures in rows and columns.

    Args:
        pictures: linear radiance, (height, width, 3) each, all of one size.
        columns: a label above each column.
        rows: a label beside each row; may be empty.
        notes: a line below each picture.
        exposure: [stop].

    Returns:
        The content of a PNG file.
    """
    height, width, _ = pictures[0][0].shape
    factor = -(-SMALLEST // width)
    width, height = width * factor, height * factor
    left = max(text_width(row, LABEL_SIZE, bold=True) for row in rows) + (2 * GAP if any(rows) else 0)
    top, line = round(1.6 * LABEL_SIZE), round(1.7 * NOTE_SIZE)
    canvas = Canvas(left + len(columns) * (width + GAP) - GAP, top + len(rows) * (height + line + GAP) - GAP, PAPER)
    for j, column in enumerate(columns):
        middle = left + j * (width + GAP) + width // 2
        canvas.text(middle - text_width(column, LABEL_SIZE, bold=True) // 2, 0, column, LABEL_SIZE, INK, bold=True)
    for i, row in enumerate(rows):
        y = top + i * (height + line + GAP)
        canvas.text(0, y + height // 2 - LABEL_SIZE // 2, row, LABEL_SIZE, INK, bold=True)
        for j, radiance in enumerate(pictures[i]):
            x, note = left + j * (width + GAP), notes[i][j]
            canvas.paste(to_display(radiance, exposure).repeat(factor, axis=0).repeat(factor, axis=1), x, y)
            canvas.text(x + (width - text_width(note, NOTE_SIZE)) // 2, y + height + 3, note, NOTE_SIZE, FAINT)
    with io.BytesIO() as file:
        matplotlib.image.imsave(file, canvas.pixels, format="png")
        return file.getvalue()
