"""Concave faces, also of many corners, are cut into triangles that cover them once."""

from __future__ import annotations

import numpy as np
import pytest

from usd_scenes.reader.triangulation import EARS_MAX, cut_faces

MANY = 100_000


def star(n: int, seed: int = 0) -> np.ndarray:
    """Of random radii, so that a line over it cuts up to a third of its edges."""
    turns, radii = np.arange(n) * (2 * np.pi / n), np.random.default_rng(seed).uniform(0.2, 1, n)
    return np.stack([radii * np.cos(turns), radii * np.sin(turns)], axis=1)


def comb(n: int) -> np.ndarray:
    """A band that goes up and down."""
    x, is_odd = np.arange(n // 2), np.arange(n // 2) % 2
    above, below = np.stack([x, 0.1 + 9.9 * (1 - is_odd)], axis=1), np.stack([x, 9.9 * (1 - is_odd)], axis=1)
    return np.concatenate([below, above[::-1]]).astype(float)


def spiral(n: int) -> np.ndarray:
    """A band that winds around its beginning a thousand times."""
    share = np.linspace(0, 1, n // 2)
    turns, radii = share * 1000 * 2 * np.pi, 1 + share * 1000
    ways = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return np.concatenate([radii[:, None] * ways, ((radii - 0.5)[:, None] * ways)[::-1]])


def stairs(n: int) -> np.ndarray:
    """Steps, so that edges are along the axes and all corners on two lines."""
    step = np.arange((n - 2) // 2)
    corners = np.stack([np.repeat(step, 2)[1:], np.repeat(step, 2)[:-1]], axis=1)
    return np.concatenate([corners, [[step[-1], len(step)], [-1, len(step)], [-1, 0]]]).astype(float)


def keyhole(seed: int) -> np.ndarray:
    """A ring that is one face: a bridge, whose two sides are in one place, joins the outline and the hole."""
    rng = np.random.default_rng(seed)
    turns = np.arange(11) * (2 * np.pi / 11)
    outline = np.stack([np.cos(turns), np.sin(turns)], axis=1) * rng.uniform(2, 4, (11, 1))
    turns = np.arange(7)[::-1] * (2 * np.pi / 7)
    hole = np.stack([np.cos(turns), np.sin(turns)], axis=1) * rng.uniform(0.3, 1, (7, 1))
    distances = np.linalg.norm(outline[:, None] - hole[None], axis=2)
    a, b = np.unravel_index(distances.argmin(), distances.shape)
    ring = [outline[: a + 1], np.roll(hole, -b, axis=0), hole[b : b + 1], outline[a:]]
    return np.roll(np.concatenate(ring), int(rng.integers(20)), axis=0)


def turned(flat: np.ndarray, seed: int = 0) -> np.ndarray:
    """(n, 3): a polygon somewhere in space."""
    axes, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return flat @ axes[:2] + axes[2]


def cut(corners: np.ndarray) -> np.ndarray:
    """The triangles of one face of these corners, (n, 3)."""
    return cut_faces(corners, np.array([len(corners)]), np.arange(len(corners)))


def doubled_areas(corners: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(m,) along the normal of the whole face."""
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    centered = corners - corners.mean(axis=0)
    whole = np.cross(centered, np.roll(centered, -1, axis=0)).sum(axis=0)
    return np.cross(b - a, c - a) @ (whole / np.linalg.norm(whole))


def newell(corners: np.ndarray) -> float:
    """Twice the area of a flat face."""
    centered = corners - corners.mean(axis=0)
    return float(np.linalg.norm(np.cross(centered, np.roll(centered, -1, axis=0)).sum(axis=0)))


def assert_covered_once(corners: np.ndarray) -> None:
    triangles = cut(corners)
    areas, whole = doubled_areas(corners, triangles), newell(corners)
    assert len(triangles) == len(corners) - 2
    assert areas.min() > -1e-12 * whole  # None is turned over, and so none lies on another:
    assert areas.sum() == pytest.approx(whole, rel=1e-8)
    sides = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    inner = {tuple(side) for side in sides.tolist()}
    outer = {(a, b) for a, b in inner if (b, a) not in inner}
    assert outer == {(k, (k + 1) % len(corners)) for k in range(len(corners))}  # As the neighbours have.


@pytest.mark.parametrize("seed", range(40))
def test_concave_faces_are_covered_once(seed: int) -> None:
    rng = np.random.default_rng(seed)
    assert_covered_once(turned(star(int(rng.integers(5, 400)), seed), seed))
    assert_covered_once(turned(keyhole(seed), seed))


@pytest.mark.parametrize("seed", range(20))
def test_corners_that_are_there_twice_stay_corners(seed: int) -> None:
    rng = np.random.default_rng(seed)
    repeated = np.repeat(star(24, seed), rng.integers(1, 4, 24), axis=0)
    assert_covered_once(turned(np.roll(repeated, int(rng.integers(9)), axis=0), seed))


@pytest.mark.parametrize("shape", [star, comb, spiral, stairs])
def test_a_hundred_thousand_corners_are_covered_once(shape) -> None:
    assert_covered_once(turned(shape(MANY)))


def test_a_face_that_crosses_itself_has_all_its_edges_all_the_same() -> None:
    for count in (7, EARS_MAX + 1):
        corners = turned(np.random.default_rng(1).normal(size=(count, 2)))
        triangles = cut(corners)
        assert len(triangles) == count - 2
        assert set(np.unique(triangles)) == set(range(count))
