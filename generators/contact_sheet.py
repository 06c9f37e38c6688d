"""One picture of a whole dataset, laid out along its axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fgf_warp.output.color import to_display, write_png
from fgf_warp.output.drawing import Canvas, resize_linear, text_width
from fgf_warp.output.exr import read_exr
from generators.manifest import exr_name
from generators.plan import Plan, Sample

THUMBNAILS_MAX = 240
"""Above it the sheet shows an evenly spaced part of the samples."""
THUMBNAIL_WIDTH, MANY, THUMBNAIL_WIDTH_OF_MANY = 256, 60, 160
"""[pixel] Widest thumbnail of a sheet, and of one with many samples."""
ASPECT = 1.5
"""Width over height that a sheet aims at."""
MARGIN, GAP, GROUP_GAP, LABEL_GAP = 40, 10, 18, 14
TITLE_SIZE, SUBTITLE_SIZE, LABEL_SIZE, CAPTION_SIZE = 32, 17, 17, 14
BACKGROUND = (0.105, 0.11, 0.12)
EMPTY = (0.15, 0.155, 0.165)
TITLE_COLOR = (0.96, 0.96, 0.95)
LABEL_COLOR = (0.87, 0.88, 0.88)
CAPTION_COLOR = (0.62, 0.64, 0.66)


@dataclass(frozen=True)
class Level:
    """One axis along an edge of the sheet, the outermost first.

    Args:
        labels: of its values, in order.
    """

    labels: tuple[str, ...]


@dataclass(frozen=True)
class Layout:
    """Which samples are shown where.

    Args:
        indices: of the samples shown, row by row.
        rows: levels of axes that run down; none where the sheet only flows.
        columns: levels of axes that run across.
        row_count: of thumbnails.
        column_count: of thumbnails.
    """

    indices: tuple[int, ...]
    rows: tuple[Level, ...]
    columns: tuple[Level, ...]
    row_count: int
    column_count: int


@dataclass(frozen=True)
class Cell:
    """Sizes of what repeats on the sheet [pixel]."""

    width: int
    image_height: int
    height: int


def write_contact_sheet(path: Path, plan: Plan, folder: Path) -> None:
    """Draws the finished samples of a dataset; those that are missing stay empty.

    With two axes or more the first runs down and the last runs across, each value written at the edge. Every
    thumbnail has its swept parameters under it.

    Args:
        path: the PNG to write.
        plan: the dataset.
        folder: where its images lie.

    Raises:
        CorruptFileError: where an image cannot be read back.
        OutputError: where the sheet cannot be written.
    """
    shape = _thumbnail_shape(plan)
    layout = _choose_layout(plan, shape)
    shown = [plan.samples[index] for index in layout.indices]
    captions = {sample.index: _wrap(_caption(sample), shape[1]) for sample in shown}
    lines = max(len(caption) for caption in captions.values())
    cell = Cell(shape[1], shape[0], shape[0] + 4 + lines * _line(CAPTION_SIZE))
    canvas, left, top = _draw_frame(plan, layout, cell)
    xs, ys = (
        _positions(layout.columns, layout.column_count, cell.width),
        _positions(layout.rows, layout.row_count, cell.height),
    )
    _draw_labels(canvas, layout, cell, left, top, xs, ys)
    for place, sample in enumerate(shown):
        x, y = left + xs[place % layout.column_count], top + ys[place // layout.column_count]
        file = folder / exr_name(sample)
        if file.exists():
            canvas.paste(_thumbnail(file, plan), x, y)
        else:
            canvas.fill(x, y, cell.width, cell.image_height, EMPTY)
        for i, words in enumerate(captions[sample.index]):
            canvas.text(x, y + cell.image_height + 4 + i * _line(CAPTION_SIZE), words, CAPTION_SIZE, CAPTION_COLOR)
    write_png(path, canvas.pixels)


def _thumbnail(file: Path, plan: Plan) -> np.ndarray:
    channels, _ = read_exr(file)
    radiance = np.stack([channels[name] for name in "RGB"], axis=2)
    return to_display(resize_linear(radiance, _thumbnail_width(plan)), plan.exposure)


def _thumbnail_shape(plan: Plan) -> tuple[int, int]:
    """Height and width."""
    blank = np.zeros((plan.settings.height, plan.settings.width, 3), np.float32)
    height, width, _ = resize_linear(blank, _thumbnail_width(plan)).shape
    return height, width


def _thumbnail_width(plan: Plan) -> int:
    return THUMBNAIL_WIDTH if len(plan.samples) <= MANY else THUMBNAIL_WIDTH_OF_MANY


def _choose_layout(plan: Plan, shape: tuple[int, int]) -> Layout:
    levels = [Level(tuple(f"{axis.name} = {value:g}" for value in axis.values)) for axis in plan.grid]
    if plan.draws > 1:
        levels.append(Level(tuple(f"draw {i + 1}" for i in range(plan.draws))))
    count = len(plan.samples)
    if len(levels) < 2 or count > THUMBNAILS_MAX:
        return _flow(count, shape)
    layouts = [_grid(count, levels[:split], levels[split:]) for split in range(1, len(levels))]
    return min(layouts, key=lambda layout: _distance_from_aspect(layout.row_count, layout.column_count, shape))


def _grid(count: int, rows: Sequence[Level], columns: Sequence[Level]) -> Layout:
    row_count = math.prod(len(level.labels) for level in rows)
    column_count = math.prod(len(level.labels) for level in columns)
    return Layout(tuple(range(count)), tuple(rows), tuple(columns), row_count, column_count)


def _flow(count: int, shape: tuple[int, int]) -> Layout:
    shown = min(count, THUMBNAILS_MAX)
    indices = tuple(i * count // shown for i in range(shown))
    columns = min(range(1, shown + 1), key=lambda n: _distance_from_aspect(math.ceil(shown / n), n, shape))
    return Layout(indices, (), (), math.ceil(shown / columns), columns)


def _distance_from_aspect(rows: int, columns: int, shape: tuple[int, int]) -> float:
    cell_height = shape[0] + _line(CAPTION_SIZE) + GAP
    return abs(math.log(columns * (shape[1] + GAP) / (rows * cell_height) / ASPECT))


def _positions(levels: Sequence[Level], count: int, size: int) -> list[int]:
    """Offsets of the cells along one edge, with a wider gap where an outer axis steps."""
    inner = len(levels[-1].labels) if len(levels) > 1 else count
    return [i * (size + GAP) + i // inner * GROUP_GAP for i in range(count)]


def _draw_frame(plan: Plan, layout: Layout, cell: Cell) -> tuple[Canvas, int, int]:
    """The empty sheet with its title, and where the thumbnails begin."""
    subtitle = _subtitle(plan, len(layout.indices))
    label_widths = [_level_width(level) for level in layout.rows]
    left = MARGIN + sum(label_widths)
    title_height = _line(TITLE_SIZE) + _line(SUBTITLE_SIZE) + LABEL_GAP
    top = MARGIN + title_height + len(layout.columns) * _line(LABEL_SIZE) + (4 if layout.columns else 0)
    width = left + _positions(layout.columns, layout.column_count, cell.width)[-1] + cell.width
    height = top + _positions(layout.rows, layout.row_count, cell.height)[-1] + cell.height
    words = max(text_width(plan.name, TITLE_SIZE, bold=True), text_width(subtitle, SUBTITLE_SIZE))
    canvas = Canvas(max(width, MARGIN + words) + MARGIN, height + MARGIN, BACKGROUND)
    canvas.text(MARGIN, MARGIN, plan.name, TITLE_SIZE, TITLE_COLOR, bold=True)
    canvas.text(MARGIN, MARGIN + _line(TITLE_SIZE), subtitle, SUBTITLE_SIZE, CAPTION_COLOR)
    return canvas, left, top


def _draw_labels(
    canvas: Canvas, layout: Layout, cell: Cell, left: int, top: int, xs: Sequence[int], ys: Sequence[int]
) -> None:
    """The axes' values: across above their columns, down beside their rows, each in the middle of what it spans."""
    y = top - len(layout.columns) * _line(LABEL_SIZE) - 4
    for level, span in zip(layout.columns, _spans(layout.columns), strict=True):
        for start in range(0, layout.column_count, span):
            label = level.labels[start // span % len(level.labels)]
            middle = (xs[start] + xs[start + span - 1] + cell.width) // 2
            canvas.text(left + middle - text_width(label, LABEL_SIZE) // 2, y, label, LABEL_SIZE, LABEL_COLOR)
        y += _line(LABEL_SIZE)
    x = MARGIN
    for level, span in zip(layout.rows, _spans(layout.rows), strict=True):
        for start in range(0, layout.row_count, span):
            label = level.labels[start // span % len(level.labels)]
            middle = (ys[start] + ys[start + span - 1] + cell.image_height) // 2
            canvas.text(x, top + middle - LABEL_SIZE // 2, label, LABEL_SIZE, LABEL_COLOR)
        x += _level_width(level)


def _spans(levels: Sequence[Level]) -> list[int]:
    """How many cells each value of each level covers."""
    sizes = [len(level.labels) for level in levels]
    return [math.prod(sizes[i + 1 :]) for i in range(len(sizes))]


def _level_width(level: Level) -> int:
    return max(text_width(label, LABEL_SIZE) for label in level.labels) + LABEL_GAP


def _subtitle(plan: Plan, shown: int) -> str:
    count = len(plan.samples)
    samples = f"{count:,} samples" if shown == count else f"{shown:,} of {count:,} samples, evenly spaced"
    settings = plan.settings
    parts = [samples, f"{settings.width} × {settings.height}", f"{settings.spp} spp", f"seed {plan.seed}"]
    if plan.scene.source:
        parts.insert(1, Path(plan.scene.source).name)
    return "  ·  ".join(parts)


def _caption(sample: Sample) -> list[str]:
    if not sample.parameters:
        return [f"sample {sample.index}"]
    return [f"{name} {value:.4g}" for name, value in sample.parameters.items()]


def _wrap(parts: Sequence[str], width: int) -> list[str]:
    """Joins the parts into as few lines as fit the width; a part that alone is too wide keeps its own."""
    lines = [parts[0]]
    for part in parts[1:]:
        longer = f"{lines[-1]}   {part}"
        if text_width(longer, CAPTION_SIZE) <= width:
            lines[-1] = longer
        else:
            lines.append(part)
    return lines


def _line(size: int) -> int:
    """Height of a line of text with its leading."""
    return round(1.3 * size)
