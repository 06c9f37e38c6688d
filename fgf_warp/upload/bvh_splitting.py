"""Splits the boxes of a tree on all cores, into what one core would split them into."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import warp as wp

from fgf_warp.device.bvh import WIDTH
from fgf_warp.upload.bvh_kernel import choose_cuts, split_ranges

PARTS, PART_MIN = 16, 1 << 14
"""A range of more boxes than one of `PARTS` parts of all, and than `PART_MIN`, is split once, and its halves are two
tasks."""


def split_boxes(lo: wp.array, hi: wp.array, leaf: int, order: wp.array) -> tuple[wp.array, wp.array]:
    """Reorders boxes into ranges.

    Args:
        lo: (n,) vec3, n > 0, their lowest corners, which are reordered.
        hi: (n,) vec3, their highest, likewise.
        leaf: boxes of a leaf, at most.
        order: (n,) int, the boxes' numbers, likewise.

    Returns:
        The ranges, (m, 2) int, see `split_ranges`; and how they are cut, (m, 17) uint8, see `choose_cuts`.
    """
    parts = _Splitting(lo, hi, leaf, order).parts()
    ranges, cuts = (
        np.concatenate(arrays) for arrays in zip(*((part.ranges, part.cuts) for part in parts), strict=True)
    )
    return wp.array(ranges, dtype=int, device="cpu", copy=False), wp.array(
        cuts, dtype=wp.uint8, device="cpu", copy=False
    )


@dataclass(eq=False)
class _Part:
    """Ranges that follow one another.

    Args:
        ranges: (m, 2) int32.
        areas: (m,) float32.
        cuts: (m, 17) uint8.
        costs: (17,) float32, of the first range, once they are known; of no effect where there is no range.
        halves: what the left and the right part of its only range come to, where they are not in it.
    """

    ranges: np.ndarray
    areas: np.ndarray
    cuts: np.ndarray
    costs: np.ndarray | None = None
    halves: tuple[Future[_Part], ...] = ()


class _Splitting:
    """See `split_boxes`."""

    def __init__(self, lo: wp.array, hi: wp.array, leaf: int, order: wp.array) -> None:
        count = len(order)
        self._lo, self._hi, self._leaf, self._order = lo, hi, leaf, order
        self._grain = max(count // PARTS, PART_MIN)
        # What is not written takes no memory. No two tasks write to the same places.
        self._waiting = wp.empty(shape=(count, 3), dtype=int, device="cpu")
        self._ranges = wp.empty(shape=(count, 2), dtype=int, device="cpu")
        self._areas = wp.empty(shape=count, dtype=float, device="cpu")
        self._cuts = wp.empty(shape=(count, WIDTH + 1), dtype=wp.uint8, device="cpu")

    def parts(self) -> list[_Part]:
        """All ranges, in the order of `split_ranges`."""
        count = len(self._order)
        if count <= self._grain:
            return [self._split(0, count, count)]
        found: list[_Part] = []
        made = 0
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            # Of each part also the range that it is the right one of.
            waiting: list[tuple[Future[_Part], np.ndarray | None]] = [(pool.submit(self._part, pool, 0, count), None)]
            while waiting:
                future, above = waiting.pop()
                part = future.result()
                if above is not None and len(part.ranges):
                    above[0, 1] = made
                if part.halves:
                    waiting += [(part.halves[1], part.ranges), (part.halves[0], None)]
                else:
                    part.ranges[part.ranges[:, 1] >= 0, 1] += made
                found.append(part)
                made += len(part.ranges)
        for part in reversed(found):
            if part.halves:
                below = [half.result() for half in reversed(part.halves)]
                self._choose(part, [half.costs for half in below if half.costs is not None])
        return found

    def _part(self, pool: ThreadPoolExecutor, first: int, count: int) -> _Part:
        if count <= self._grain:
            return self._split(first, count, count)
        part = self._split(first, count, 1)
        left = int(part.ranges[0, 0])
        # The left one writes to the same places.
        part.ranges, part.areas, part.cuts = part.ranges.copy(), part.areas.copy(), part.cuts.copy()
        part.halves = tuple(
            pool.submit(self._part, pool, *half) for half in ((first, left), (first + left, count - left))
        )
        return part

    def _split(self, first: int, count: int, most: int) -> _Part:
        """So many ranges of some of the boxes, with their costs if these are all."""
        at = slice(first, first + count)
        size = wp.zeros(1, dtype=int, device="cpu")
        wp.launch(
            split_ranges,
            dim=1,
            inputs=[self._lo[at], self._hi[at], self._leaf, most],
            outputs=[self._order[at], self._waiting[at], self._ranges[at], self._areas[at], size],
            device="cpu",
        )
        made = slice(first, first + int(size.numpy()[0]))
        part = _Part(*(array.numpy()[made] for array in (self._ranges, self._areas, self._cuts)))
        if most == count and len(part.ranges):
            self._choose(part, [])
        return part

    def _choose(self, part: _Part, below: Sequence[np.ndarray]) -> None:
        """Cuts the ranges of a part; of its only one the costs of what is below it may be known, the left one last."""
        costs = wp.empty(shape=(len(part.ranges) + len(below) + 3, WIDTH + 1), dtype=float, device="cpu")
        for row, known in enumerate(below, start=1):
            costs.numpy()[row] = known
        inputs = [
            wp.array(part.ranges, dtype=int, device="cpu", copy=False),
            wp.array(part.areas, dtype=float, device="cpu", copy=False),
        ]
        cuts = wp.array(part.cuts, dtype=wp.uint8, device="cpu", copy=False)
        wp.launch(choose_cuts, dim=1, inputs=[self._leaf, len(below), *inputs], outputs=[costs, cuts], device="cpu")
        part.costs = costs.numpy()[1].copy()
