"""World-space bounding boxes of shapes."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product

import numpy as np

from fgf_warp.scene import Shape, Solid

CUBE_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


def shape_bounds(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner, (3,) each, of a box that holds the shape; not tight for a turned round solid."""
    if isinstance(shape, Solid):
        points = CUBE_CORNERS @ shape.object_to_world[:3, :3].T + shape.object_to_world[:3, 3]
    else:
        points = shape.points[np.unique(shape.triangles)]
    return points.min(axis=0), points.max(axis=0)


def scene_bounds(shapes: Iterable[Shape]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner, (3,) each, of a box that holds all shapes; [-1, 1]^3 where there is none."""
    boxes = [shape_bounds(shape) for shape in shapes]
    if not boxes:
        return np.full(3, -1.0), np.full(3, 1.0)
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def longest_side(shape: Shape) -> float:
    """Of the shape's bounding box [stage unit]."""
    low, high = shape_bounds(shape)
    return float((high - low).max())
