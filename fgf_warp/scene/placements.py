"""Where things stand: matrices, and of instances arrays of their upper rows.

These *places* are gone through in blocks, so that none of the arrays is copied whole.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fgf_warp.scene.values import FLOAT32_MAX

BLOCK = 1 << 12
"""Matrices at once: so many that NumPy's cost per call does not matter, and so few that they stay in the processor's
cache and that products of them are not shared among threads, which takes ten times as long."""
AFTER, BEFORE = [1, 2, 0], [2, 0, 1]
"""For x, y and z the axis that follows, and the one before."""


def keyframes(opening: np.ndarray, closing: np.ndarray | None) -> tuple[np.ndarray, ...]:
    """The matrix, or places, when the shutter opens, and when it closes where they are others; None: at rest."""
    return (opening,) if closing is None else (opening, closing)


def unit_axes(matrix: np.ndarray) -> np.ndarray:
    """The directions of a matrix's axes, without their lengths.

    Args:
        matrix: (4, 4) or (3, 4) float64, whose axes have lengths > 0.

    Returns:
        (3, 3) float64, a unit vector in each column.
    """
    return matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)


def blocks(count: int) -> Iterator[slice]:
    """Slices that cover `count` places, of `BLOCK` each but the last."""
    return (slice(first, min(first + BLOCK, count)) for first in range(0, count, BLOCK))


def squared(places: np.ndarray) -> np.ndarray:
    """Whole matrices, (n, 4, 4) float64, of their upper rows, (n, 3, 4)."""
    whole = np.zeros((len(places), 4, 4))
    whole[:, :3], whole[:, 3, 3] = places, 1
    return whole


def compose(places: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Places with a transform before each.

    Args:
        places: (n, 3, 4) float64.
        inner: (4, 4) float64, which acts first.

    Returns:
        (n, 3, 4) float64.
    """
    made = np.empty((len(places), 3, 4))
    for at in blocks(len(places)):
        made[at] = (places[at].reshape(-1, 4) @ inner).reshape(-1, 3, 4)
    return made


def are_usable(places: np.ndarray) -> np.ndarray:
    """Which places are finite and invertible, and their inverses finite, all as float32.

    Args:
        places: (n, 3, 4) float64.

    Returns:
        (n,) bool.
    """
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
    """The inverse of what places do to directions; for few of them, since all are gone through at once.

    Args:
        places: (n, 3, 4) float64, of which each is usable.

    Returns:
        (n, 3, 3) float64.
    """
    cofactors, volume = _cofactors(np.ascontiguousarray(places[:, :, :3].transpose(2, 1, 0)))
    return (cofactors / volume).transpose(2, 0, 1)


def _cofactors(axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What inverses are made of, for many matrices at once.

    Args:
        axes: (3, 3, n) float64: column, row and number of the matrix.

    Returns:
        (3, 3, n), the rows of the inverses times the determinants, and (n,), the determinants.
    """
    after, before = axes[AFTER], axes[BEFORE]
    cofactors = after[:, AFTER] * before[:, BEFORE] - after[:, BEFORE] * before[:, AFTER]
    return cofactors, np.einsum("in,in->n", axes[0], cofactors[0])


def bound_places(places: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes that hold one box in each place.

    Args:
        places: (n, 3, 4) float64.
        low: (3,) float, the box's lowest corner.
        high: (3,) float, its highest corner.

    Returns:
        Lowest and highest corners, (n, 3) float64 each.
    """
    one, other = places[:, :, :3] * low, places[:, :, :3] * high
    least, most = np.minimum(one, other), np.maximum(one, other)
    position = places[:, :, 3]
    return (
        least[:, :, 0] + least[:, :, 1] + least[:, :, 2] + position,
        most[:, :, 0] + most[:, :, 1] + most[:, :, 2] + position,
    )
