"""Polygons to triangles."""

from __future__ import annotations

import numpy as np

from usd_scenes.reader.sweep import doubled_areas, sweep_polygon

EARS_MAX = 200
"""Corners of a face that crosses itself, of which ears are cut off in time that grows with their number's cube."""


def cut_faces(points: np.ndarray, counts: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Splits polygons into triangles of the same orientation.

    A face is cut into a fan from its first corner, else from its second, which covers all convex faces and all
    quads; the faces that are left, concave ones of more corners, are cut by a line that sweeps over them. A face that
    crosses itself, which no triangles cover once, loses one ear after the other, or is a fan.

    Args:
        points: (n, 3) float.
        counts: (f,) int, corners of each face; faces with fewer than three are dropped.
        indices: (sum(counts),) int, the points at the corners of all faces.

    Returns:
        (m, 3) int64, places in `indices`, grouped by the number of corners.
    """
    starts = np.cumsum(counts) - counts
    found = [np.empty((0, 3), dtype=np.int64)]
    for count in np.unique(counts[counts >= 3]):
        faces = starts[counts == count, None] + np.arange(count)
        if count == 3:
            found.append(faces)
            continue
        for first_corner in (0, 1):
            fan_faces = np.roll(faces, -first_corner, axis=1)
            covered = _fan_covers(points[indices[fan_faces]])
            found.append(_fan(fan_faces[covered]))
            faces = faces[~covered]
        found.extend(face[_cut_concave(points[indices[face]])] for face in faces)
    return np.concatenate(found)


def signed_volume(points: np.ndarray, triangles: np.ndarray) -> float:
    """Volume that a closed mesh encloses [unit^3], > 0 where its triangles face outwards.

    Args:
        points: (n, 3) float [unit].
        triangles: (m, 3) int.
    """
    centered = points - points.mean(axis=0)
    a, b, c = (centered[triangles[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def _fan(faces: np.ndarray) -> np.ndarray:
    first = np.broadcast_to(faces[:, :1], faces[:, 1:-1].shape)
    return np.stack([first, faces[:, 1:-1], faces[:, 2:]], axis=-1).reshape(-1, 3)


def _fan_covers(corners: np.ndarray) -> np.ndarray:
    """(f,) bool for (f, k, 3) corners: no triangle of the fan is turned over against the face."""
    from_first = corners[:, 1:] - corners[:, :1]
    doubled_areas = np.cross(from_first[:, :-1], from_first[:, 1:])
    normal = doubled_areas.sum(axis=1)
    return (np.einsum("fki,fi->fk", doubled_areas, normal) >= 0).all(axis=1)


def _cut_concave(corners: np.ndarray) -> np.ndarray:
    """(k - 2, 3) triangles of one concave face, (k, 3), seen along the axis that it faces most."""
    normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    drop = int(np.argmax(np.abs(normal)))
    flat = corners[:, [(drop + 1) % 3, (drop + 2) % 3]]
    if normal[drop] < 0:  # Seen from behind the face runs clockwise: mirror it.
        flat[:, 0] *= -1
    is_new = (flat != np.roll(flat, 1, axis=0)).any(axis=1)
    if is_new.sum() >= 3 and (cut := sweep_polygon(flat[is_new])) is not None:
        return np.concatenate([np.flatnonzero(is_new)[cut], _between_repeated(is_new)])
    if len(corners) <= EARS_MAX:
        return _cut_ears(flat)
    return _fan(np.arange(len(corners))[None])


def _between_repeated(is_new: np.ndarray) -> np.ndarray:
    """Triangles without area, so that corners which repeat the one before belong to the face's edges too.

    Args:
        is_new: (k,) bool, False of those corners.
    """
    k = len(is_new)
    repeated = np.flatnonzero(~is_new)
    kept = np.flatnonzero(is_new)
    before = kept[np.searchsorted(kept, repeated) - 1]  # The last one, -1, is before the first.
    return np.stack([before, repeated, (repeated + 1) % k], axis=1).reshape(-1, 3)


def _cut_ears(flat: np.ndarray) -> np.ndarray:
    """(k - 2, 3) triangles of a face that crosses or touches itself, (k, 2)."""
    left, triangles = list(range(len(flat))), []
    while len(left) > 3:
        at = next((at for at in range(len(left)) if _is_ear(flat, left, at)), 0)
        triangles.append((left[at - 1], left[at], left[(at + 1) % len(left)]))
        del left[at]
    return np.array([*triangles, tuple(left)])


def _is_ear(flat: np.ndarray, left: list[int], at: int) -> bool:
    before, tip, after = left[at - 1], left[at], left[(at + 1) % len(left)]
    ring = flat[[before, tip, after]]
    others = flat[[corner for corner in left if corner not in (before, tip, after)]]
    sides = np.stack([doubled_areas(ring[i], ring[(i + 1) % 3], others) for i in range(3)])
    return bool(doubled_areas(*ring) > 0 and not (sides > 0).all(axis=0).any())
