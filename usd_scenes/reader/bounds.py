"""The box that holds a scene."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fgf_warp.scene import Shape, shape_bounds


def scene_bounds(shapes: Iterable[Shape]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner, (3,) each, of a box that holds all shapes; [-1, 1]^3 where there is none."""
    boxes = [shape_bounds(shape) for shape in shapes]
    if not boxes:
        return np.full(3, -1.0), np.full(3, 1.0)
    return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)
