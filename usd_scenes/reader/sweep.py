"""Simple polygons to triangles, in n log n.

Of Hertel and Mehlhorn 1985: a line sweeps over the plane. Between two edges that it cuts and that have the polygon
between them, what is not cut into triangles yet ends in a chain of corners, which descends from either edge to the
lowest one. No corner of the chain sees past its neighbours, so a new corner takes away from the chain what it sees.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

FLIP_TOLERANCE = 1e-12
"""Of a polygon's area: by so much a triangle of corners in one line may be turned over by rounding."""

TOUCHING_MAX = 16
"""Edges to either side that may end in one corner."""

_LEFT, _RIGHT, _MERGE, _END, _SPLIT, _START = range(6)
"""What a corner is to the line: on the left or the right of the polygon; where two parts of it, or the part between
two edges, become one or end; where a part becomes two or begins. Of corners in one place those that end an edge come
first."""


@dataclass(slots=True, eq=False)
class _Gap:
    """What is between two edges that the line cuts.

    Args:
        upper: the upper end of the edge on the left.
        lower: its lower end.
        left: the chain from that edge to the lowest corner.
        right: the chain from the edge on the right to the lowest corner, which both hold.
    """

    upper: int
    lower: int
    left: list[int]
    right: list[int]


def sweep_polygon(corners: np.ndarray) -> np.ndarray | None:
    """Triangles of a simple polygon.

    Args:
        corners: (n, 2) float64, n >= 3, counter-clockwise, of which no two that follow one another are the same. Parts
            that lie apart along the polygon may touch.

    Returns:
        (n - 2, 3) int64, counter-clockwise, which together have each edge of the polygon once; None where it crosses
        itself.
    """
    # The line goes down, or from the right to the left: where fewer parts begin, there are fewer to look through.
    turns = [corners, corners[:, ::-1] * (-1.0, 1.0)]
    kinds = [_kinds(turned) for turned in turns]
    best = int(np.argmin([(found >= _SPLIT).sum() for found in kinds]))
    swept, found = turns[best], kinds[best]
    order = np.lexsort((found, swept[:, 0], -swept[:, 1]))
    sweep = _Sweep(swept)
    try:
        for corner, kind in zip(order.tolist(), found[order].tolist(), strict=True):
            sweep.meet(corner, kind)
    except (KeyError, IndexError):  # An edge ends, or a part is split, where no part is.
        return None
    triangles = np.array(sweep.triangles, dtype=np.int64).reshape(-1, 3)
    return None if len(triangles) != len(corners) - 2 or _any_flipped(corners, triangles) else triangles


def doubled_areas(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the signed areas of triangles in the plane, (.., 2) each, > 0 where they turn left.

    Returns:
        (..), in the square of the unit of the points.
    """
    ab, ac = b - a, c - a
    return ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]


class _Sweep:
    """The line on its way, and what it has cut.

    Args:
        corners: (n, 2) float64.
    """

    def __init__(self, corners: np.ndarray) -> None:
        self.triangles: list[int] = []  # One after the other; tuples would keep the garbage collector busy.
        self._x, self._y = corners.T.tolist()
        self._gaps: list[_Gap] = []  # From the left to the right.
        self._ends_left: dict[int, _Gap] = {}  # By the lower end of the edge on their left.
        self._ends_right: dict[int, _Gap] = {}

    def meet(self, corner: int, kind: int) -> None:
        """Goes on to the next corner.

        Raises:
            KeyError: where the polygon crosses itself.
            IndexError: the same.
        """
        if kind == _LEFT:
            gap = self._ends_left.pop(corner)
            self._cut_left(gap, corner)
            self._go_on_left(gap, corner)
        elif kind == _RIGHT:
            gap = self._ends_right.pop(corner)
            self._cut_right(gap, corner)
            self._go_on_right(gap, corner)
        elif kind == _MERGE:
            self._merge(corner)
        elif kind == _END:
            gap = self._ends_left.pop(corner)
            del self._ends_right[corner]
            self._fan(corner, [*gap.left, *gap.right[-2::-1]])
            del self._gaps[self._place_of(gap, corner)]
        elif kind == _SPLIT:
            self._split(corner)
        else:
            gap = _Gap(corner, corner, [corner], [corner])
            place = self._place(corner)
            self._go_on_left(gap, corner)
            self._go_on_right(gap, corner)
            self._gaps.insert(place, gap)

    def _go_on_left(self, gap: _Gap, corner: int) -> None:
        gap.upper, gap.lower = corner, (corner + 1) % len(self._x)
        self._ends_left[gap.lower] = gap

    def _go_on_right(self, gap: _Gap, corner: int) -> None:
        self._ends_right[(corner or len(self._x)) - 1] = gap

    def _cut_left(self, gap: _Gap, corner: int) -> None:
        """A corner below the edge on the left sees all of the chain there, and some on the other side."""
        self._fan(corner, gap.left)
        gap.left = [corner]
        self._cut_chain(gap.right, corner, 1)

    def _cut_right(self, gap: _Gap, corner: int) -> None:
        self._fan(corner, gap.right[::-1])
        gap.right = [corner]
        self._cut_chain(gap.left, corner, -1)

    def _merge(self, corner: int) -> None:
        west, gap = self._ends_right.pop(corner), self._ends_left.pop(corner)
        self._cut_right(west, corner)
        self._cut_left(gap, corner)
        del self._gaps[self._place_of(west, corner)]
        gap.upper, gap.lower, gap.left = west.upper, west.lower, west.left
        self._ends_left[gap.lower] = gap

    def _split(self, corner: int) -> None:
        place = self._place(corner)
        gap = self._gaps[place - 1 if place else len(self._gaps)]
        west = _Gap(gap.upper, gap.lower, gap.left, [corner])
        self._ends_left[gap.lower] = west
        self._cut_chain(west.left, corner, -1)
        gap.left = [corner]
        self._cut_chain(gap.right, corner, 1)
        self._go_on_right(west, corner)
        self._go_on_left(gap, corner)
        self._gaps.insert(place - 1, west)

    def _fan(self, corner: int, chain: list[int]) -> None:
        """Triangles from a corner to a chain above it, which goes from the left to the right."""
        for left, right in pairwise(chain):
            self.triangles += (corner, right, left)

    def _cut_chain(self, chain: list[int], corner: int, side: int) -> None:
        """Triangles from a corner to the end of a chain above it, as far as it sees, and the corner as its new end.

        Args:
            chain: from the edge to the lowest corner.
            corner: below it.
            side: 1 where the edge is on the right, -1 on the left.
        """
        xs, ys = self._x, self._y
        x, y = xs[corner], ys[corner]
        while len(chain) > 1:
            low, high = chain[-1], chain[-2]
            turn = (xs[high] - x) * (ys[low] - y) - (ys[high] - y) * (xs[low] - x)
            if turn * side <= 0:
                break
            chain.pop()
            self.triangles += (corner, high, low) if side > 0 else (corner, low, high)
        chain.append(corner)

    def _place(self, corner: int) -> int:
        """How many gaps begin to the left of a corner, below which a part of the polygon begins or is split."""
        n = len(self._x)
        below = corner - 1 if corner else n - 1, (corner + 1) % n
        # Where it touches an edge, what is below it says on which side it is.
        return self._count(corner, lambda gap: self._side(gap, below[0]) + self._side(gap, below[1]))

    def _place_of(self, gap: _Gap, corner: int) -> int:
        """The place of a gap that ends in a corner.

        Raises:
            KeyError: where it is not there, as the polygon crosses itself.
        """
        count = self._count(corner, lambda touched: 0.0)
        for place in range(max(count - TOUCHING_MAX, 0), min(count + TOUCHING_MAX, len(self._gaps))):
            if self._gaps[place] is gap:
                return place
        raise KeyError(corner)

    def _count(self, corner: int, side_of_touched: Callable[[_Gap], float]) -> int:
        """How many gaps have the edge on their left to the left of a corner."""
        gaps, xs, ys = self._gaps, self._x, self._y
        corner_x, corner_y = xs[corner], ys[corner]
        low, high = 0, len(gaps)
        while low < high:
            middle = (low + high) // 2
            gap = gaps[middle]
            upper, lower = gap.upper, gap.lower
            x, y = xs[upper], ys[upper]
            side = (xs[lower] - x) * (corner_y - y) - (ys[lower] - y) * (corner_x - x)
            if side == 0:
                side = side_of_touched(gap)
            if side > 0:
                low = middle + 1
            else:
                high = middle
        return low

    def _side(self, gap: _Gap, corner: int) -> float:
        """> 0 where a corner is to the right of the edge on the left of a gap."""
        xs, ys, upper = self._x, self._y, gap.upper
        x, y = xs[upper], ys[upper]
        return (xs[gap.lower] - x) * (ys[corner] - y) - (ys[gap.lower] - y) * (xs[corner] - x)


def _kinds(corners: np.ndarray) -> np.ndarray:
    """(n,) int, what each corner is to a line that goes down."""
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    is_left_turn = doubled_areas(before, corners, after) > 0
    down_before, down_after = _is_below(before, corners), _is_below(after, corners)
    kinds = np.where(down_after, _LEFT, _RIGHT)
    kinds[down_before & down_after] = _SPLIT
    kinds[down_before & down_after & is_left_turn] = _START
    kinds[~down_before & ~down_after] = _MERGE
    kinds[~down_before & ~down_after & is_left_turn] = _END
    return kinds


def _is_below(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) bool; of two corners at one height, the one on the right is below."""
    return (a[:, 1] < b[:, 1]) | ((a[:, 1] == b[:, 1]) & (a[:, 0] > b[:, 0]))


def _any_flipped(corners: np.ndarray, triangles: np.ndarray) -> bool:
    areas = doubled_areas(*(corners[triangles[:, corner]] for corner in range(3)))
    return bool((areas < -FLIP_TOLERANCE * np.abs(areas).sum()).any())
