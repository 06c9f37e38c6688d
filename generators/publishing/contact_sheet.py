"""One picture of a whole dataset, laid out along its axes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from fgf_warp.output.color import to_display
from fgf_warp.output.drawing import Canvas, resize_linear, text_width
from generators.dataset.images import choose_shown, read_channels
from generators.dataset.plan_table import AxisMeta, PlanMeta
from generators.dataset.reader import Dataset
from generators.publishing.columns import COMPLETE, STATUS
from generators.publishing.words import describe_quality

THUMBNAILS_MAX = 240
"""Above it the sheet shows a part that is spread over all samples."""
FILLED_LEAST = 0.5
"""Share of a grid's places that have a sample; axes that are zipped or constrained may leave too many empty."""
THUMBNAIL_WIDTH, MANY, THUMBNAIL_WIDTH_OF_MANY = 256, 60, 160
"""[pixel] Widest thumbnail of a sheet, and of one with many samples."""
ASPECT = 1.5
"""Width over height that a sheet aims at."""
NAME_LENGTH = 160
"""[character] Longest name in the title."""
LABEL_WIDTH = 280
"""[pixel] Widest label beside a row."""
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
        indices: of the samples shown, row by row; None where the plan has none.
        rows: levels of axes that run down; none where the sheet only flows.
        columns: levels of axes that run across.
        row_count: of thumbnails.
        column_count: of thumbnails.
    """

    indices: tuple[int | None, ...]
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


def draw_contact_sheet(dataset: Dataset, index: pa.Table) -> np.ndarray:
    """Draws the finished samples of a dataset; those that are missing stay empty.

    Axes whose values are on a grid are laid out along the edges, the first down and the last across, where there are
    two of them or more. Every thumbnail has the values of its axes under it.

    Args:
        dataset: to draw.
        index: its labels, see `generators.publishing.index`.

    Returns:
        (height, width, 3) uint8, sRGB.

    Raises:
        CorruptFileError: where an image cannot be read back.
    """
    meta = dataset.meta
    shape = _thumbnail_shape(meta, index.num_rows)
    layout = _choose_layout(meta, index, shape)
    shown = [sample for sample in layout.indices if sample is not None]
    complete = index[STATUS].to_pylist()
    captions = {sample: _wrap(_caption(meta, index, sample), shape[1]) for sample in shown}
    lines = max(len(caption) for caption in captions.values())
    cell = Cell(shape[1], shape[0], shape[0] + 4 + lines * _line(CAPTION_SIZE))
    canvas, left, top = _draw_frame(_title(meta, index, len(shown)), layout, cell)
    xs, ys = (
        _positions(layout.columns, layout.column_count, cell.width),
        _positions(layout.rows, layout.row_count, cell.height),
    )
    _draw_labels(canvas, layout, cell, left, top, xs, ys)
    for place, sample in enumerate(layout.indices):
        if sample is None:
            continue
        x, y = left + xs[place % layout.column_count], top + ys[place // layout.column_count]
        if complete[sample] == COMPLETE:
            canvas.paste(_thumbnail(dataset, sample, shape[1]), x, y)
        else:
            canvas.fill(x, y, cell.width, cell.image_height, EMPTY)
        for i, words in enumerate(captions[sample]):
            canvas.text(x, y + cell.image_height + 4 + i * _line(CAPTION_SIZE), words, CAPTION_SIZE, CAPTION_COLOR)
    return canvas.pixels


def _thumbnail(dataset: Dataset, sample: int, width: int) -> np.ndarray:
    channels = read_channels(dataset, sample)
    radiance = np.stack([channels[name] for name in "RGB"], axis=2)
    return to_display(resize_linear(radiance, width), dataset.meta.exposure)


def _thumbnail_shape(meta: PlanMeta, count: int) -> tuple[int, int]:
    """Height and width."""
    blank = np.zeros((meta.height, meta.width, 3), np.float32)
    height, width, _ = resize_linear(blank, THUMBNAIL_WIDTH if count <= MANY else THUMBNAIL_WIDTH_OF_MANY).shape
    return height, width


def _choose_layout(meta: PlanMeta, index: pa.Table, shape: tuple[int, int]) -> Layout:
    """A grid where the axes span one and it is small enough, else rows that flow."""
    axes = [axis for axis in meta.axes if axis.values is not None and len(axis.values) > 1]
    cells = _cells(axes, index)
    draws = max((len(samples) for samples in cells.values()), default=0)
    levels = [Level(tuple(f"{axis.name} = {_shown(value)}" for value in axis.values or ())) for axis in axes]
    if draws > 1:
        levels.append(Level(tuple(f"draw {i + 1}" for i in range(draws))))
    sizes = [len(level.labels) for level in levels]
    spans_grid = len(levels) > 1 and index.num_rows >= math.prod(sizes) * FILLED_LEAST
    if not spans_grid or math.prod(sizes) > THUMBNAILS_MAX:
        return _flow(index.num_rows, shape)
    places: list[int | None] = [None] * math.prod(sizes)
    for position, samples in cells.items():
        for draw, sample in enumerate(samples):
            places[int(np.ravel_multi_index((*position, draw)[: len(sizes)], sizes))] = sample
    layouts = [_grid(places, levels[:split], levels[split:]) for split in range(1, len(levels))]
    return min(layouts, key=lambda layout: _distance_from_aspect(layout.row_count, layout.column_count, shape))


def _cells(axes: Sequence[AxisMeta], index: pa.Table) -> dict[tuple[int, ...], list[int]]:
    """Which samples lie at each place of the grid of these axes."""
    ranks = [{value: rank for rank, value in enumerate(axis.values or ())} for axis in axes]
    found: dict[tuple[int, ...], list[int]] = {}
    columns = [index[axis.name].to_pylist() for axis in axes]
    for sample in range(index.num_rows):
        position = tuple(rank[column[sample]] for rank, column in zip(ranks, columns, strict=True))
        found.setdefault(position, []).append(sample)
    return found


def _grid(places: Sequence[int | None], rows: Sequence[Level], columns: Sequence[Level]) -> Layout:
    row_count = math.prod(len(level.labels) for level in rows)
    column_count = math.prod(len(level.labels) for level in columns)
    return Layout(tuple(places), tuple(rows), tuple(columns), row_count, column_count)


def _flow(count: int, shape: tuple[int, int]) -> Layout:
    indices = tuple(choose_shown(range(count), THUMBNAILS_MAX))
    shown = len(indices)
    columns = min(range(1, shown + 1), key=lambda n: _distance_from_aspect(math.ceil(shown / n), n, shape))
    return Layout(indices, (), (), math.ceil(shown / columns), columns)


def _distance_from_aspect(rows: int, columns: int, shape: tuple[int, int]) -> float:
    cell_height = shape[0] + _line(CAPTION_SIZE) + GAP
    return abs(math.log(columns * (shape[1] + GAP) / (rows * cell_height) / ASPECT))


def _positions(levels: Sequence[Level], count: int, size: int) -> list[int]:
    """Offsets of the cells along one edge, with a wider gap where an outer axis steps."""
    inner = len(levels[-1].labels) if len(levels) > 1 else count
    return [i * (size + GAP) + i // inner * GROUP_GAP for i in range(count)]


def _draw_frame(title: tuple[str, str], layout: Layout, cell: Cell) -> tuple[Canvas, int, int]:
    """The empty sheet with its title and what is below it, and where the thumbnails begin."""
    name, subtitle = title
    label_widths = [_level_width(level) for level in layout.rows]
    left = MARGIN + sum(label_widths)
    title_height = _line(TITLE_SIZE) + _line(SUBTITLE_SIZE) + LABEL_GAP
    top = MARGIN + title_height + len(layout.columns) * _line(LABEL_SIZE) + (4 if layout.columns else 0)
    width = left + _positions(layout.columns, layout.column_count, cell.width)[-1] + cell.width
    height = top + _positions(layout.rows, layout.row_count, cell.height)[-1] + cell.height
    words = max(text_width(name, TITLE_SIZE, bold=True), text_width(subtitle, SUBTITLE_SIZE))
    canvas = Canvas(max(width, MARGIN + words) + MARGIN, height + MARGIN, BACKGROUND)
    canvas.text(MARGIN, MARGIN, name, TITLE_SIZE, TITLE_COLOR, bold=True)
    canvas.text(MARGIN, MARGIN + _line(TITLE_SIZE), subtitle, SUBTITLE_SIZE, CAPTION_COLOR)
    return canvas, left, top


def _draw_labels(
    canvas: Canvas, layout: Layout, cell: Cell, left: int, top: int, xs: Sequence[int], ys: Sequence[int]
) -> None:
    """The axes' values: across above their columns, down beside their rows, each in the middle of what it spans."""
    y = top - len(layout.columns) * _line(LABEL_SIZE) - 4
    for level, span in zip(layout.columns, _spans(layout.columns), strict=True):
        for start in range(0, layout.column_count, span):
            wide = xs[start + span - 1] + cell.width - xs[start]
            label = _fitted(level.labels[start // span % len(level.labels)], LABEL_SIZE, wide)
            middle = (xs[start] + xs[start + span - 1] + cell.width) // 2
            canvas.text(left + middle - text_width(label, LABEL_SIZE) // 2, y, label, LABEL_SIZE, LABEL_COLOR)
        y += _line(LABEL_SIZE)
    x = MARGIN
    for level, span in zip(layout.rows, _spans(layout.rows), strict=True):
        for start in range(0, layout.row_count, span):
            label = _fitted(level.labels[start // span % len(level.labels)], LABEL_SIZE, LABEL_WIDTH)
            middle = (ys[start] + ys[start + span - 1] + cell.image_height) // 2
            canvas.text(x, top + middle - LABEL_SIZE // 2, label, LABEL_SIZE, LABEL_COLOR)
        x += _level_width(level)


def _spans(levels: Sequence[Level]) -> list[int]:
    """How many cells each value of each level covers."""
    sizes = [len(level.labels) for level in levels]
    return [math.prod(sizes[i + 1 :]) for i in range(len(sizes))]


def _level_width(level: Level) -> int:
    return min(LABEL_WIDTH, max(text_width(label, LABEL_SIZE) for label in level.labels)) + LABEL_GAP


def _title(meta: PlanMeta, index: pa.Table, shown: int) -> tuple[str, str]:
    """The name of the dataset, and a line on what is shown of it."""
    count = index.num_rows
    samples = (
        f"{count:,} sample{'' if count == 1 else 's'}"
        if shown == count
        else f"{shown:,} of {count:,} samples, spread over all"
    )
    absent = count - index[STATUS].to_pylist().count(COMPLETE)
    parts = [samples, meta.scene, f"{meta.width} × {meta.height}", describe_quality(meta), f"seed {meta.seed}"]
    if absent:
        parts.insert(1, f"{absent:,} not there")
    return _shortened(meta.name), "  ·  ".join(_shortened(part) for part in parts if part)


def _shortened(words: str) -> str:
    """So that no name makes the sheet wider than any screen."""
    return words if len(words) <= NAME_LENGTH else f"{words[: NAME_LENGTH - 3]}..."


def _caption(meta: PlanMeta, index: pa.Table, sample: int) -> list[str]:
    if not meta.axes:
        return [f"sample {sample}"]
    return [f"{axis.name} {_shown(index[axis.name][sample].as_py())}" for axis in meta.axes]


def _shown(value: float | str | None) -> str:
    return f"{value:.4g}" if isinstance(value, int | float) else str(value)


def _wrap(parts: Sequence[str], width: int) -> list[str]:
    """Joins the parts into as few lines as fit the width."""
    lines = [_fitted(parts[0], CAPTION_SIZE, width)]
    for part in parts[1:]:
        longer = f"{lines[-1]}   {part}"
        if text_width(longer, CAPTION_SIZE) <= width:
            lines[-1] = longer
        else:
            lines.append(_fitted(part, CAPTION_SIZE, width))
    return lines


def _fitted(words: str, size: int, width: int) -> str:
    """The words, or as much of their end as fits: of a path or the name of a file, that tells the most."""
    shown = words if len(words) <= NAME_LENGTH else f"...{words[-NAME_LENGTH:]}"
    while text_width(shown, size) > width and len(shown) > 4:
        shown = f"...{shown[4:]}"
    return shown


def _line(size: int) -> int:
    """Height of a line of text with its leading."""
    return round(1.3 * size)
