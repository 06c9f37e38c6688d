"""Where instances stand: arrays of the upper rows of matrices, gone through in blocks so that none is copied whole."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

FLOAT32_MAX = float(np.finfo(np.float32).max)
"""What is larger is not finite on the device."""
BLOCK = 1 << 12
"""Matrices at once: enough for NumPy's own cost not to matter, and few enough to stay in the processor's cache and for
its products not to be parted among threads, which takes ten times as long."""
AFTER, BEFORE = [1, 2, 0], [2, 0, 1]
"""Of x, y and z, the axis that follows and the one before."""


def blocks(count: int) -> Iterator[slice]:
    """Successive parts of so many places."""
    return (slice(first, min(first + BLOCK, count)) for first in range(0, count, BLOCK))


def squared(places: np.ndarray) -> np.ndarray:
    """(n, 4, 4), of the upper rows of each, (n, 3, 4)."""
    whole = np.zeros((len(places), 4, 4))
    whole[:, :3], whole[:, 3, 3] = places, 1
    return whole


def compose(places: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Places, (n, 3, 4) float64, with a (4, 4) transform before each."""
    made = np.empty((len(places), 3, 4))
    for at in blocks(len(places)):
        made[at] = (places[at].reshape(-1, 4) @ inner).reshape(-1, 3, 4)
    return made


def are_usable(places: np.ndarray) -> np.ndarray:
    """(n,) bool: finite and invertible, the inverse too, as float32."""
    found = np.empty(len(places), dtype=bool)
    with np.errstate(all="ignore"):
        for at in blocks(len(places)):
            columns = np.ascontiguousarray(places[at].transpose(2, 1, 0))
            axes, position = columns[:3], columns[3]
            cofactors, volume = _cofactors(axes)
            volume = np.abs(volume)
            largest = np.maximum(
                np.abs(cofactors).max(axis=(0, 1)), np.abs((cofactors * position).sum(axis=1)).max(axis=0)
            )
            found[at] = (
                (np.abs(columns).max(axis=(0, 1)) <= FLOAT32_MAX) & (volume > 0) & (largest <= FLOAT32_MAX * volume)
            )
    return found


def invert_axes(places: np.ndarray) -> np.ndarray:
    """(n, 3, 3), the inverse of what few places, (n, 3, 4), which `are_usable`, do to directions."""
    cofactors, volume = _cofactors(np.ascontiguousarray(places[:, :, :3].transpose(2, 1, 0)))
    return (cofactors / volume).transpose(2, 0, 1)


def _cofactors(axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of matrices' columns, (3, 3, n), the rows of their inverses, (3, 3, n), times determinants, and these, (n,)."""
    after, before = axes[AFTER], axes[BEFORE]
    cofactors = after[:, AFTER] * before[:, BEFORE] - after[:, BEFORE] * before[:, AFTER]
    return cofactors, np.einsum("in,in->n", axes[0], cofactors[0])


def bound_places(places: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner, (n, 3) each, of boxes that hold a box, (3,) each, in each place, (n, 3, 4)."""
    one, other = places[:, :, :3] * low, places[:, :, :3] * high
    least, most = np.minimum(one, other), np.maximum(one, other)
    position = places[:, :, 3]
    return (
        least[:, :, 0] + least[:, :, 1] + least[:, :, 2] + position,
        most[:, :, 0] + most[:, :, 1] + most[:, :, 2] + position,
    )
