"""The closed surfaces that a mesh is made of, and which of them may be crossed as one.

A path knows by one bit whether it is in a closed surface. That holds for surfaces that lie apart, and for a cavity in
the one around it, but not for surfaces that overlap, nest or touch: these are put into different groups, of a bit each.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

ROUNDING = 1e-5
"""Of coordinates in float32, amply and relative: surfaces that are so near each other may touch."""
MANY_PAIRS = 1000
"""Of shells whose boxes overlap: of more it is not looked whether the shells themselves do."""
PAIRS_AT_ONCE = 4_000_000
"""Of boxes that are compared in one step, which bounds the memory that it takes."""


@dataclass(frozen=True, eq=False)
class Shells:
    """How the triangles of a closed mesh bound a volume.

    Args:
        groups: (m,) int32, per triangle the number of its group, from 0 on; -1 of one that bounds nothing, since it is
            there twice, facing both ways. The shells of a group lie apart.
        turned: (m,) bool, those of shells that face inwards though nothing is around them.
    """

    groups: np.ndarray
    turned: np.ndarray

    @property
    def count(self) -> int:
        """Of groups; 0 where the mesh encloses no volume."""
        return int(self.groups.max(initial=-1)) + 1

    @property
    def are_plain(self) -> bool:
        """True where the mesh can be crossed as it is."""
        return self.count == 1 and not self.turned.any() and not (self.groups < 0).any()


def find_shells(points: np.ndarray, triangles: np.ndarray) -> Shells:
    """Takes a closed mesh apart.

    Triangles that share points make a shell; where they are open, as at seams, those too whose points coincide. A
    shell that faces inwards is a cavity of the smallest one around it. Triangles of a shell, and whole shells, that
    are there facing both ways are left out.

    Args:
        points: (n, 3) float.
        triangles: (m, 3) int, of a mesh without open edges; counter-clockwise seen from outside.
    """
    corners = weld(points)[triangles]
    labels = _label(triangles, corners)
    is_left = ~_are_doubled(corners, labels)
    if not is_left.all() and is_left.any():
        # What they joined may lie apart.
        labels[is_left] = _label(triangles[is_left], corners[is_left])
    shells = _Parts(np.asarray(points, dtype=np.float64), np.asarray(triangles), labels, is_left)
    is_shell = ~shells.cancelled(corners)
    around, turned = shells.find_cavities(is_shell)
    bodies = shells.merged(around)
    color = np.append(bodies.color(is_shell & (around == np.arange(len(around)))), -1)
    # Without a cavity's own: it has its body's, and what cancels has none.
    of_shell = np.where(is_shell, color[around], -1)
    groups = np.where(is_left, of_shell[shells.labels], -1).astype(np.int32)
    return Shells(groups, is_left & turned[shells.labels])


def weld(points: np.ndarray) -> np.ndarray:
    """(n,) int, a number for each point, the same for those that coincide."""
    return np.unique(np.asarray(points), axis=0, return_inverse=True)[1].reshape(-1)


def count_unmatched(corners: np.ndarray, labels: np.ndarray | None = None) -> np.ndarray:
    """Directed edges that no triangle of the same label runs along in the other direction.

    Args:
        corners: (m, 3) int, welded points.
        labels: (m,) int from 0 on; None: one for all.

    Returns:
        (labels,) int64, their number.
    """
    labels = np.zeros(len(corners), dtype=np.int64) if labels is None else labels
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]).astype(np.int64)
    of_edge = np.tile(labels, 3)
    runs = edges[:, 0] != edges[:, 1]
    edges, of_edge = edges[runs], of_edge[runs]
    low, high = edges.min(axis=1), edges.max(axis=1)
    order = np.lexsort((high, low, of_edge))
    sign = np.where(edges[:, 0] < edges[:, 1], 1, -1)[order]
    starts = _starts(of_edge[order], low[order], high[order])
    balance = np.abs(np.add.reduceat(sign, starts)) if len(starts) else np.zeros(0, dtype=np.int64)
    return np.bincount(of_edge[order][starts], weights=balance, minlength=int(labels.max(initial=-1)) + 1).astype(int)


def winding_number(points: np.ndarray, triangles: np.ndarray, point: np.ndarray) -> float:
    """How often a closed mesh winds around a point: 1 inside, 0 outside (van Oosterom and Strackee 1983)."""
    a, b, c = (np.asarray(points, dtype=np.float64)[triangles[:, corner]] - point for corner in range(3))
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    denominator = (
        la * lb * lc
        + np.einsum("ij,ij->i", a, b) * lc
        + np.einsum("ij,ij->i", b, c) * la
        + np.einsum("ij,ij->i", c, a) * lb
    )
    return float(np.arctan2(volume, denominator).sum() / (2 * np.pi))


def meeting_boxes(low: np.ndarray, high: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Pairs (i, j), i != j, of boxes that overlap or touch, each once, some at a time.

    Args:
        low: (n, 3) float, lowest corners.
        high: (n, 3) float, highest.
    """
    # Along the axis that they overlap in least, each meets those that begin before it ends.
    axis = int(np.argmin((high - low).mean(axis=0) / np.maximum(np.ptp(low, axis=0), 1e-300)))
    order = np.argsort(low[:, axis], kind="stable")
    ends = np.searchsorted(low[order, axis], high[order, axis], side="right")
    counts = np.maximum(ends - np.arange(1, len(order) + 1), 0)
    total = np.cumsum(counts)
    first = 0
    while first < len(order):
        done = total[first - 1] if first else 0
        last = max(int(np.searchsorted(total, done + PAIRS_AT_ONCE, side="right")), first + 1)
        some = counts[first:last]
        i = np.repeat(np.arange(first, last), some)
        j = i + 1 + np.arange(len(i)) - np.repeat(np.cumsum(some) - some, some)
        i, j = order[i], order[j]
        meets = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1)
        yield i[meets], j[meets]
        first = last


def _starts(*sorted_keys: np.ndarray) -> np.ndarray:
    """Where runs of equal keys begin."""
    if not len(sorted_keys[0]):
        return np.zeros(0, dtype=np.int64)
    changes = np.any([key[1:] != key[:-1] for key in sorted_keys], axis=0)
    return np.flatnonzero(np.append(True, changes))


def _connect(triangles: np.ndarray) -> np.ndarray:
    """(m,) int, the same for triangles that share points, numbered by their first triangle."""
    from scipy.sparse import coo_array  # noqa: PLC0415 - slow to import, and scenes rarely need it
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    count = int(triangles.max()) + 1
    rows, columns = triangles[:, [0, 1]].reshape(-1), triangles[:, [1, 2]].reshape(-1)
    graph = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(count, count))
    of_point = connected_components(graph, directed=False)[1]
    _, first, labels = np.unique(of_point[triangles[:, 0]], return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[labels.reshape(-1)]


def _label(triangles: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(m,) int, the shell of each triangle: those that share points, or where these are open, coinciding ones."""
    labels = _connect(triangles)
    is_open = count_unmatched(corners, labels)[labels] > 0
    if is_open.any():
        labels[is_open] = labels.max() + 1 + _connect(corners[is_open])
        labels = np.unique(labels, return_inverse=True)[1].reshape(-1)
    return labels


def _are_doubled(corners: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """(m,) bool, the triangles that are there facing both ways within their shell, pair by pair."""
    a, b, c = corners.T
    ordered = np.sort(corners, axis=1)
    has_area = (ordered[:, 0] != ordered[:, 1]) & (ordered[:, 1] != ordered[:, 2])
    # Of the two orders around a triangle: the lower one of the other two corners comes after the lowest, or not.
    is_lowest_a, is_lowest_b = a == ordered[:, 0], b == ordered[:, 0]
    after = np.where(is_lowest_a, b, np.where(is_lowest_b, c, a))
    faces_on = after == ordered[:, 1]
    order = np.lexsort((faces_on, *ordered.T[::-1], labels))
    keys = [labels[order], *ordered[order].T]
    of_face = np.repeat(starts := _starts(*keys), np.diff(np.append(starts, len(order))))
    number = np.searchsorted(starts, of_face)
    fronts = np.bincount(number, weights=faces_on[order]).astype(int)[number]
    backs = np.bincount(number, weights=~faces_on[order]).astype(int)[number]
    pairs = np.minimum(fronts, backs)
    # Within a face the backs come first.
    rank = np.arange(len(order)) - of_face
    rank = np.where(faces_on[order], rank - backs, rank)
    doubled = np.zeros(len(corners), dtype=bool)
    doubled[order] = (rank < pairs) & has_area[order]
    return doubled


class _Parts:
    """Parts of a mesh by the labels of its triangles."""

    def __init__(self, points: np.ndarray, triangles: np.ndarray, labels: np.ndarray, is_left: np.ndarray) -> None:
        self.points, self.triangles, self.labels, self.is_left = points, triangles, labels, is_left
        self.count = int(labels.max()) + 1
        left = np.flatnonzero(is_left)
        self._order = left[np.argsort(labels[left], kind="stable")]
        self._begins = np.searchsorted(labels[self._order], np.arange(self.count + 1))

    def of(self, label: int) -> np.ndarray:
        """(k, 3), its triangles."""
        return self.triangles[self._order[self._begins[label] : self._begins[label + 1]]]

    @cached_property
    def boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corners, (labels, 3) each; inside out of what has no triangles."""
        low, high = np.full((self.count, 3), np.inf), np.full((self.count, 3), -np.inf)
        has_some = np.diff(self._begins) > 0
        if has_some.any():
            corners = self.points[self.triangles[self._order]]
            begins = self._begins[:-1][has_some]
            low[has_some] = np.minimum.reduceat(corners.min(axis=1), begins)
            high[has_some] = np.maximum.reduceat(corners.max(axis=1), begins)
        return low, high

    @cached_property
    def volumes(self) -> np.ndarray:
        """(labels,) float64 [unit^3], > 0 where the triangles face outwards."""
        middle = np.nan_to_num((self.boxes[0] + self.boxes[1]) / 2)[self.labels[self._order]]
        a, b, c = (self.points[self.triangles[self._order, corner]] - middle for corner in range(3))
        six_fold = np.einsum("ij,ij->i", a, np.cross(b, c))
        return np.bincount(self.labels[self._order], weights=six_fold, minlength=self.count) / 6

    def cancelled(self, corners: np.ndarray) -> np.ndarray:
        """(labels,) bool, those without triangles, and pairs of the same triangles facing both ways."""
        sizes = np.diff(self._begins)
        cancelled = sizes == 0
        if self.count == 1:
            return cancelled
        # The sum of a hash of the triangles tells parts apart, whatever their order.
        ordered = np.sort(corners[self._order], axis=1).astype(np.uint64)
        mixed = np.zeros(len(ordered), dtype=np.uint64)
        for column in ordered.T:
            mixed = (mixed ^ (column + np.uint64(0x9E3779B97F4A7C15))) * np.uint64(0xBF58476D1CE4E5B9)
            mixed ^= mixed >> np.uint64(29)
        sums = np.concatenate([[np.uint64(0)], np.cumsum(mixed, dtype=np.uint64)])
        hashes = sums[self._begins[1:]] - sums[self._begins[:-1]]
        waiting: dict[tuple[int, int, bool], list[int]] = {}
        _, inverse, counts = np.unique(hashes, return_inverse=True, return_counts=True)
        for label in np.flatnonzero((counts[inverse.reshape(-1)] > 1) & ~cancelled):
            key = (int(hashes[label]), int(sizes[label]), bool(self.volumes[label] < 0))
            if other := waiting.get((*key[:2], not key[2])):
                cancelled[[label, other.pop()]] = True
            else:
                waiting.setdefault(key, []).append(int(label))
        return cancelled

    def find_cavities(self, is_shell: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(labels,) int, the shell that each is a part of: itself, or of a cavity the smallest around it.

        And (labels,) bool, those that face inwards with nothing around them.
        """
        around, turned = np.arange(self.count), np.zeros(self.count, dtype=bool)
        low, high = self.boxes
        outward = np.flatnonzero(is_shell & (self.volumes >= 0))
        outward = outward[np.argsort(self.volumes[outward], kind="stable")]
        for inner in np.flatnonzero(is_shell & (self.volumes < 0)):
            holds = (low[outward] <= low[inner]).all(axis=1) & (high[outward] >= high[inner]).all(axis=1)
            point = self.points[self.of(inner)[0, 0]]
            found = (o for o in outward[holds] if winding_number(self.points, self.of(o), point) > 0.5)
            around[inner] = next(found, inner)
            turned[inner] = around[inner] == inner
        return around, turned

    def merged(self, around: np.ndarray) -> _Parts:
        """The bodies: shells with their cavities."""
        if np.array_equal(around, np.arange(self.count)):
            return self
        return _Parts(self.points, self.triangles, around[self.labels], self.is_left)

    def color(self, is_body: np.ndarray) -> np.ndarray:
        """(labels,) int, a group for each body, of which those of the same lie apart."""
        neighbours: dict[int, set[int]] = {}
        bodies = np.flatnonzero(is_body)
        low, high = self.boxes[0][bodies], self.boxes[1][bodies]
        margin = ROUNDING * max(np.abs(low).max(initial=0), np.abs(high).max(initial=0))
        pairs = [np.stack([bodies[i], bodies[j]], axis=1) for i, j in meeting_boxes(low - margin, high + margin)]
        found = np.concatenate([np.zeros((0, 2), dtype=np.int64), *pairs])
        is_many = len(found) > MANY_PAIRS
        for a, b in map(tuple, found.tolist()):
            if is_many or self._meet(a, b, margin):
                neighbours.setdefault(a, set()).add(b)
                neighbours.setdefault(b, set()).add(a)
        colors = np.zeros(self.count, dtype=np.int64)
        for body in sorted(neighbours):
            taken = {int(colors[other]) for other in neighbours[body] if other < body}
            colors[body] = next(color for color in range(len(taken) + 1) if color not in taken)
        return colors

    def _meet(self, a: int, b: int, margin: float) -> bool:
        """True where two bodies overlap, or may touch: where the boxes of two of their triangles do."""
        (low_a, low_b), (high_a, high_b) = self.boxes[0][[a, b]], self.boxes[1][[a, b]]
        low, high = np.maximum(low_a, low_b) - margin, np.minimum(high_a, high_b) + margin
        corners = [self.points[self.of(label)] for label in (a, b)]
        near = [c[(c.min(axis=1) <= high).all(axis=1) & (c.max(axis=1) >= low).all(axis=1)] for c in corners]
        if all(map(len, near)):
            both = np.concatenate(near)
            is_of_a = np.arange(len(both)) < len(near[0])
            for i, j in meeting_boxes(both.min(axis=1) - margin, both.max(axis=1) + margin):
                if (is_of_a[i] != is_of_a[j]).any():
                    return True
        return self._holds(a, corners[1][0, 0]) or self._holds(b, corners[0][0, 0])

    def _holds(self, body: int, point: np.ndarray) -> bool:
        return winding_number(self.points, self.of(body), point) > 0.5
