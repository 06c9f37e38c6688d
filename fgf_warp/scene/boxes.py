"""Boxes along the axes, by which is told what may touch: those of two shapes, and pairs among very many."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

Box = tuple[np.ndarray, np.ndarray]
"""Lowest and highest corner, (3,) float each."""

CONTACT_ROUNDING = 1e-5
"""Of coordinates in float32, amply and relative: surfaces that are so near each other may touch."""
PAIRS_AT_ONCE = 4_000_000
"""Pairs of boxes that are compared in one step, which bounds the memory that it takes."""


def box_around(boxes: Iterable[Box]) -> Box:
    """The smallest box that holds all of them, of which there is one at least."""
    lows, highs = zip(*boxes, strict=True)
    return np.min(lows, axis=0), np.max(highs, axis=0)


def boxes_overlap(first: Box, second: Box, margin: float) -> bool:
    """True where two boxes overlap or touch, or lie no farther apart than a margin along each axis."""
    (low, high), (lowest, highest) = first, second
    return bool((low <= highest + margin).all() and (high >= lowest - margin).all())


def boxes_meet(first: Box, second: Box) -> bool:
    """True where two boxes overlap or touch, if only by rounding."""
    return boxes_overlap(first, second, CONTACT_ROUNDING * max(np.abs(corner).max() for corner in (*first, *second)))


def meeting_boxes(low: np.ndarray, high: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Finds the pairs of boxes that overlap or touch, each once, by a sweep along one axis.

    Args:
        low: (n, 3) float, lowest corners, with n > 0.
        high: (n, 3) float, highest corners.

    Yields:
        Some of the pairs at a time, i and j, (k,) int each, with i != j in any order.
    """
    start, spread = low.min(axis=0), np.maximum(np.ptp(low, axis=0), 1e-300)
    crowding = (high - low).mean(axis=0) / spread
    along, across = np.argsort(crowding)[:2]
    # The boxes are sorted along the axis that they overlap in least, where each meets those that begin before it ends.
    # Along the next such axis they are cut into strips about as wide as a box, so that only those of a strip meet.
    count = int(np.clip(np.sqrt(len(low)), 1, 1 + 1 / max(crowding[across], 1e-9)))
    to_strip = count / spread[across]
    first_strip = np.clip((low[:, across] - start[across]) * to_strip, 0, count - 1).astype(np.int64)
    last_strip = np.clip((high[:, across] - start[across]) * to_strip, 0, count - 1).astype(np.int64)
    box, nth = _spread_out(last_strip - first_strip + 1)
    strip = first_strip[box] + nth
    # On the sorted axis the strips follow each other at a distance of 2: the boxes of one begin within 1 of its start,
    # and what ends beyond 1.5 is cut there, so that it ends before the next strip.
    begin = 2.0 * strip + (low[box, along] - start[along]) / spread[along]
    end = 2.0 * strip + np.minimum((high[box, along] - start[along]) / spread[along], 1.5)
    order = np.argsort(begin)
    box, strip, begin, end = box[order], strip[order], begin[order], end[order]
    counts = np.searchsorted(begin, end, side="right") - np.arange(1, len(order) + 1)
    total = np.append(0, np.cumsum(counts))
    first = 0
    while first < len(order):
        last = max(int(np.searchsorted(total, total[first] + PAIRS_AT_ONCE, side="right")) - 1, first + 1)
        one, nth = _spread_out(counts[first:last])
        one += first
        i, j, here = box[one], box[one + 1 + nth], strip[one]
        meets = here == np.maximum(first_strip[i], first_strip[j])
        for axis in range(3):
            meets &= (low[i, axis] <= high[j, axis]) & (low[j, axis] <= high[i, axis])
        yield i[meets], j[meets]
        first = last


def _spread_out(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lists the members of groups one after the other.

    Args:
        counts: (n,) int, how many members each group has.

    Returns:
        The group of each member, and its number in the group, (sum of counts,) int each.
    """
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
