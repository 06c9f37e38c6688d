"""The closed surfaces that a mesh is made of, and which of them may be crossed as one.

A path knows by one bit whether it is in a closed surface. That holds for surfaces that lie apart, and for a cavity in
the one around it, but not for surfaces that overlap, nest or touch: these are put into different groups, of a bit each.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fgf_warp.scene.boxes import CONTACT_ROUNDING, meeting_boxes

MANY_PAIRS = 1000
"""Pairs of shells whose boxes overlap: where there are more, it is not looked whether the shells themselves do."""
FLAT = 1e-7
"""Volume over area and diagonal below which a shell encloses none: it is as flat as float32 can tell."""


@dataclass(frozen=True, eq=False)
class Shells:
    """How the triangles of a closed mesh bound a volume.

    Args:
        groups: (m,) int32, per triangle the number of its group, from 0 on; -1 of one that bounds nothing, since it is
            there twice, facing both ways. The shells of a group lie apart.
        bodies: (m,) int32, per triangle the number of its body, a shell with its cavities, from 0 on; -1 where `groups`
            are.
        turned: (m,) bool, those of shells that face inwards though nothing is around them.
    """

    groups: np.ndarray
    bodies: np.ndarray
    turned: np.ndarray

    @property
    def count(self) -> int:
        """Number of groups; 0 where the mesh encloses no volume."""
        return int(self.groups.max(initial=-1)) + 1

    @property
    def body_count(self) -> int:
        """Number of bodies; 0 where the mesh encloses no volume."""
        return int(self.bodies.max(initial=-1)) + 1

    @property
    def are_plain(self) -> bool:
        """True where the mesh can be crossed as it is."""
        return self.count == 1 and not self.turned.any() and not (self.groups < 0).any()


def find_shells(points: np.ndarray, triangles: np.ndarray, corners: np.ndarray) -> Shells:
    """Takes a closed mesh apart into shells, and puts these into groups.

    Triangles that share points make a shell; where they are open, as at seams, so do those whose points coincide. A
    shell that faces inwards is a cavity of the smallest one around it. Left out are triangles and whole shells that are
    there twice, facing both ways, and what encloses no volume.

    Args:
        points: (n, 3) float.
        triangles: (m, 3) int, of a mesh without open edges; counter-clockwise seen from outside.
        corners: (m, 3) int, the triangles with points that coincide welded, as by `weld`.
    """
    labels = _label(triangles, corners)
    is_kept = ~_find_doubled(corners, labels)
    if not is_kept.all() and is_kept.any():
        # What the doubled triangles joined may lie apart without them.
        labels[is_kept] = _label(triangles[is_kept], corners[is_kept])
    shells = _Parts(np.asarray(points, dtype=np.float64), np.asarray(triangles), labels, is_kept)
    is_shell = ~shells.find_cancelled(corners) & ~shells.are_flat
    around, turned = shells.find_cavities(is_shell)
    bodies = shells.merged(around)
    is_shell &= ~bodies.are_flat[around]
    groups = bodies.color_groups(is_shell & (around == np.arange(len(around))))
    numbers = np.cumsum(is_shell & (around == np.arange(len(around)))) - 1

    def of_triangles(of_body: np.ndarray) -> np.ndarray:
        """(m,) int32, of each triangle what its body has."""
        of_shell = np.where(is_shell, of_body[around], -1)
        return np.where(is_kept, of_shell[labels], -1).astype(np.int32)

    return Shells(of_triangles(groups), of_triangles(numbers), is_kept & turned[labels])


def weld(points: np.ndarray) -> np.ndarray:
    """Numbers points such that those that coincide have one number.

    Args:
        points: (n, 3) float.

    Returns:
        (n,) int, from 0 on.
    """
    number = np.zeros(len(points), dtype=np.int64)
    for column in np.asarray(points).T:
        values, rank = np.unique(column, return_inverse=True)
        number = np.unique(number * len(values) + rank, return_inverse=True)[1]
    return number


def count_unmatched(corners: np.ndarray, labels: np.ndarray | None = None) -> np.ndarray:
    """Counts the directed edges that no triangle of the same label runs along in the other direction.

    Args:
        corners: (m, 3) int, triangles of welded points.
        labels: (m,) int from 0 on, of each triangle; None: one for all.

    Returns:
        (k,) int, the number of such edges for each of the k labels.
    """
    edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]).astype(np.int64)
    of_edge = np.zeros(len(edges), dtype=np.int64) if labels is None else np.tile(labels, 3)
    runs = edges[:, 0] != edges[:, 1]
    edges, of_edge = edges[runs], of_edge[runs]
    low, high = np.minimum(*edges.T), np.maximum(*edges.T)
    count = int(corners.max(initial=0)) + 1
    first = low if labels is None else np.unique(of_edge * count + low, return_inverse=True)[1]
    keys = first * count + high
    order = np.argsort(keys)
    sign = np.where(edges[:, 0] < edges[:, 1], 1, -1)[order]
    starts = _starts(keys[order])
    balance = np.abs(np.add.reduceat(sign, starts)) if len(starts) else np.zeros(0)
    return np.bincount(of_edge[order][starts], weights=balance).astype(int)


def winding_number(points: np.ndarray, triangles: np.ndarray, point: np.ndarray) -> float:
    """How often a closed mesh winds around a point, by solid angles (van Oosterom and Strackee 1983).

    Args:
        points: (n, 3) float.
        triangles: (m, 3) int.
        point: (3,) float64.

    Returns:
        1 inside, 0 outside; more where parts of the mesh overlap, and -1 in one that faces inwards.
    """
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


def _starts(keys: np.ndarray) -> np.ndarray:
    """Where runs of equal keys begin, (r,) int; the keys, (n,), are sorted."""
    return np.flatnonzero(np.append(True, keys[1:] != keys[:-1])) if len(keys) else np.zeros(0, dtype=np.int64)


def _connect(triangles: np.ndarray) -> np.ndarray:
    """Labels triangles by what is connected.

    Args:
        triangles: (m, 3) int.

    Returns:
        (m,) int from 0 on, the same for triangles that share points, in the order of the first triangle of each.
    """
    from scipy.sparse import coo_array  # noqa: PLC0415 - slow to import, and scenes rarely need it
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415

    count = int(triangles.max()) + 1
    rows, columns = triangles[:, [0, 1]].reshape(-1), triangles[:, [1, 2]].reshape(-1)
    graph = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(count, count))
    of_point = connected_components(graph, directed=False)[1]
    _, first, labels = np.unique(of_point[triangles[:, 0]], return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[labels.reshape(-1)]


def _label(triangles: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """The shell of each triangle, (m,) int from 0 on.

    Triangles make a shell that share points, or where that leaves them open, points that coincide.
    """
    labels = _connect(triangles)
    if labels.max() == 0:
        return labels
    is_open = count_unmatched(corners, labels)[labels] > 0
    if is_open.any():
        labels[is_open] = labels.max() + 1 + _connect(corners[is_open])
        labels = np.unique(labels, return_inverse=True)[1]
    return labels


def _hashes(corners: np.ndarray) -> np.ndarray:
    """A hash of each triangle, (m,) uint64, which does not depend on the order of its corners."""
    mixed = np.zeros(len(corners), dtype=np.uint64)
    for column in np.sort(corners, axis=1).astype(np.uint64).T:
        mixed = (mixed ^ (column + np.uint64(0x9E3779B97F4A7C15))) * np.uint64(0xBF58476D1CE4E5B9)
        mixed ^= mixed >> np.uint64(29)
    return mixed


def _find_doubled(corners: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """The triangles that are there twice in their shell, facing both ways, pair by pair: (m,) bool."""
    doubled = np.zeros(len(corners), dtype=bool)
    hashes = _hashes(corners)
    order = np.argsort(hashes)
    is_same = hashes[order][1:] == hashes[order][:-1]
    facing: dict[tuple[int, ...], list[int]] = {}
    for at in order[np.append(is_same, False) | np.append(False, is_same)].tolist():
        a, b, c = corners[at].tolist()
        if len({a, b, c}) < 3:
            continue
        first = min((a, b, c), (b, c, a), (c, a, b))
        label = int(labels[at])
        if opposite := facing.get((label, first[0], first[2], first[1])):
            doubled[[at, opposite.pop()]] = True
        else:
            facing.setdefault((label, *first), []).append(at)
    return doubled


def _bounds_of(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The boxes around triangles, (m, 3, 3): lowest and highest corners, (m, 3) each."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


class _Parts:
    """Parts of a mesh by the labels of its triangles.

    Args:
        points: (n, 3) float64.
        triangles: (m, 3) int.
        labels: (m,) int from 0 on.
        is_kept: (m,) bool, the triangles that belong to a part; the others bound nothing.
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray, labels: np.ndarray, is_kept: np.ndarray) -> None:
        self.points, self.triangles, self.labels, self.is_kept = points, triangles, labels, is_kept
        self.count = int(labels.max()) + 1
        kept = np.flatnonzero(is_kept)
        self._order = kept[np.argsort(labels[kept], kind="stable")]
        self._begins = np.searchsorted(labels[self._order], np.arange(self.count + 1))

    def of(self, label: int) -> np.ndarray:
        """The triangles of one part, (k, 3) int."""
        return self.triangles[self._order[self._begins[label] : self._begins[label + 1]]]

    @cached_property
    def boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corners, (labels, 3) float64 each; inside out of what has no triangles."""
        low, high = np.full((self.count, 3), np.inf), np.full((self.count, 3), -np.inf)
        has_some = np.diff(self._begins) > 0
        if has_some.any():
            begins = self._begins[:-1][has_some]
            lowest, highest = _bounds_of(self.points[self.triangles[self._order]])
            low[has_some], high[has_some] = np.minimum.reduceat(lowest, begins), np.maximum.reduceat(highest, begins)
        return low, high

    @cached_property
    def volumes(self) -> np.ndarray:
        """(labels,) float64 [unit^3], > 0 where the triangles face outwards; 0 of what is flat."""
        labels = self.labels[self._order]
        low, high = (side[labels] for side in self.boxes)
        middle = (low + high) / 2
        a, b, c = (self.points[self.triangles[self._order, corner]] - middle for corner in range(3))
        normal = np.cross(b - a, c - a)
        six_fold = np.bincount(labels, weights=np.einsum("ij,ij->i", a, normal), minlength=self.count)
        doubled_area = np.bincount(labels, weights=np.linalg.norm(normal, axis=1), minlength=self.count)
        low, high = self.boxes
        diagonal = np.linalg.norm(np.maximum(high - low, 0.0), axis=1)
        return np.where(np.abs(six_fold) > 3 * FLAT * doubled_area * diagonal, six_fold, 0.0) / 6

    @property
    def are_flat(self) -> np.ndarray:
        """The parts that enclose no volume, (labels,) bool."""
        return self.volumes == 0

    def find_cancelled(self, corners: np.ndarray) -> np.ndarray:
        """The parts without triangles, and pairs of parts of the same triangles facing both ways: (labels,) bool."""
        sizes = np.diff(self._begins)
        cancelled = sizes == 0
        if self.count == 1:
            return cancelled
        # Parts of the same triangles have the same sum of hashes, in whatever order the triangles come.
        mixed = _hashes(corners[self._order])
        sums = np.concatenate([[np.uint64(0)], np.cumsum(mixed, dtype=np.uint64)])
        hashes = sums[self._begins[1:]] - sums[self._begins[:-1]]
        waiting: dict[tuple[int, int, bool], list[int]] = {}
        _, inverse, counts = np.unique(hashes, return_inverse=True, return_counts=True)
        for label in np.flatnonzero((counts[inverse] > 1) & ~cancelled):
            key = (int(hashes[label]), int(sizes[label]), bool(self.volumes[label] < 0))
            if other := waiting.get((*key[:2], not key[2])):
                cancelled[[label, other.pop()]] = True
            else:
                waiting.setdefault(key, []).append(int(label))
        return cancelled

    def find_cavities(self, is_shell: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which shells are cavities, and of which others.

        Args:
            is_shell: (labels,) bool, the parts that are looked at.

        Returns:
            (labels,) int, the shell that each belongs to: itself, or of a cavity the smallest shell around it; and
            (labels,) bool, the shells that face inwards with nothing around them.
        """
        around, turned = np.arange(self.count), is_shell & (self.volumes < 0)
        if not turned.any():
            return around, turned
        candidates = self._pairs(np.flatnonzero(is_shell), 0.0)
        candidates = np.concatenate([candidates, candidates[:, ::-1]])
        low, high = self.boxes
        inner, outer = candidates.T
        holds = turned[inner] & ~turned[outer] & (low[outer] <= low[inner]).all(axis=1)
        candidates = candidates[holds & (high[outer] >= high[inner]).all(axis=1)]
        is_many = len(candidates) > MANY_PAIRS
        for inside, outside in candidates[np.argsort(self.volumes[candidates[:, 1]], kind="stable")].tolist():
            if turned[inside] and (is_many or self._encloses(outside, self._point_in_front(inside))):
                around[inside], turned[inside] = outside, False
        return around, turned

    def _pairs(self, labels: np.ndarray, margin: float) -> np.ndarray:
        """Pairs of these labels whose boxes, widened by a margin, overlap or touch: (k, 2) int."""
        low, high = self.boxes[0][labels] - margin, self.boxes[1][labels] + margin
        if len(labels) < 2:
            return np.zeros((0, 2), dtype=np.int64)
        return np.concatenate([np.stack([labels[i], labels[j]], axis=1) for i, j in meeting_boxes(low, high)])

    def merged(self, around: np.ndarray) -> _Parts:
        """The bodies: shells together with their cavities, where `around` is as from `find_cavities`."""
        if np.array_equal(around, np.arange(self.count)):
            return self
        return _Parts(self.points, self.triangles, around[self.labels], self.is_kept)

    def color_groups(self, is_body: np.ndarray) -> np.ndarray:
        """Colours bodies greedily, so that those of one group lie apart: (labels,) int, the group of each."""
        neighbours: dict[int, set[int]] = {}
        colors = np.zeros(self.count, dtype=np.int64)
        bodies = np.flatnonzero(is_body)
        margin = CONTACT_ROUNDING * np.abs([side[bodies] for side in self.boxes]).max(initial=0)
        found = self._pairs(bodies, margin)
        is_many = len(found) > MANY_PAIRS
        for a, b in map(tuple, found.tolist()):
            if is_many or self._touch(a, b, margin):
                neighbours.setdefault(a, set()).add(b)
                neighbours.setdefault(b, set()).add(a)
        for body in sorted(neighbours):
            taken = {int(colors[other]) for other in neighbours[body] if other < body}
            colors[body] = next(color for color in range(len(taken) + 1) if color not in taken)
        return colors

    def _touch(self, a: int, b: int, margin: float) -> bool:
        """True where two bodies overlap, or may touch: where the boxes of two of their triangles do."""
        (low_a, low_b), (high_a, high_b) = self.boxes[0][[a, b]], self.boxes[1][[a, b]]
        low, high = np.maximum(low_a, low_b) - margin, np.minimum(high_a, high_b) + margin
        corners = [self.points[self.of(label)] for label in (a, b)]
        near = []
        for c in corners:
            lowest, highest = _bounds_of(c)
            near.append(c[(lowest <= high).all(axis=1) & (highest >= low).all(axis=1)])
        if all(map(len, near)):
            lows, highs = _bounds_of(np.concatenate(near))
            is_of_a = np.arange(len(lows)) < len(near[0])
            for i, j in meeting_boxes(lows - margin, highs + margin):
                if (is_of_a[i] != is_of_a[j]).any():
                    return True
        return self._encloses(a, corners[1][0, 0]) or self._encloses(b, corners[0][0, 0])

    def _point_in_front(self, label: int) -> np.ndarray:
        """A point close to the largest triangle of a shell, on the side that it faces: (3,) float64."""
        a, b, c = self.points[self.of(label)].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        sizes = np.linalg.norm(normals, axis=1)
        at = int(np.argmax(sizes))
        return (a + b + c)[at] / 3 + 1e-3 * normals[at] / np.sqrt(sizes[at])

    def _encloses(self, body: int, point: np.ndarray) -> bool:
        """True where a point, (3,) float64, lies in a body."""
        return winding_number(self.points, self.of(body), point) > 0.5
