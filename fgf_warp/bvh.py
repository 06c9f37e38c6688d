"""Builds the tree of `device/bvh.py`: binary by the surface area heuristic, then collapsed to sixteen children.

Where that would make the tree deeper than a ray can keep track of, nodes have children of equal counts instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from fgf_warp.bvh_kernel import LEAF, WIDTH, open_nodes, split_ranges

MARGIN = 1e-7
"""Of a box, relative to the largest coordinate: a flat box is met even where it is just behind a ray's origin, and
slack relative to the distance makes it no thicker."""


@dataclass(frozen=True, eq=False)
class WideTree:
    """Arrays of the tree, on the host.

    Args:
        boxes: (12 nodes, 8) float32, a coordinate of sixteen boxes in two rows; an empty child's box is inside out.
        children: (2 nodes, 8) int32, another node, or -1 - the index of a leaf.
        triangles: (9 leaves, 8) float32; an empty place is NaN.
        owners: (leaves, 8) int32, index of the triangle's mesh; -1 in an empty place.
        faces: (leaves, 8) int32, the triangle's number in its mesh; -1 in an empty place.
    """

    boxes: np.ndarray
    children: np.ndarray
    triangles: np.ndarray
    owners: np.ndarray
    faces: np.ndarray


def load_builder() -> None:
    """Compiles the builder where that has not been done, so that threads do not do it at the same time."""
    open_nodes.module.load(wp.get_device("cpu"), 1)


def build_wide_tree(corners: Sequence[np.ndarray]) -> WideTree:
    """The tree over the triangles of all meshes.

    Args:
        corners: for each mesh its triangles' corners, (m, 3, 3) float32.

    Returns:
        A tree of at most `MAX_LEVELS` levels, wherever the triangles lie.
    """
    if not corners:
        return WideTree(*(np.zeros((0, LEAF), dtype) for dtype in ("f4", "i4", "f4", "i4", "i4")))
    all_corners = np.concatenate(corners)
    owner = np.repeat(np.arange(len(corners), dtype=np.int32), [len(c) for c in corners])
    face = np.concatenate([np.arange(len(c), dtype=np.int32) for c in corners])
    count = len(all_corners)

    lo = wp.array(all_corners.min(axis=1), dtype=wp.vec3, device="cpu")
    hi = wp.array(all_corners.max(axis=1), dtype=wp.vec3, device="cpu")
    order = wp.array(np.arange(count, dtype=np.int32), dtype=int, device="cpu")
    ranges, areas = _split(lo, hi, order)
    boxes = wp.empty(shape=(count, 6, WIDTH), dtype=float, device="cpu")
    children = wp.zeros(shape=(count, WIDTH), dtype=int, device="cpu")
    leaves = wp.empty(shape=(count, 2), dtype=int, device="cpu")
    sizes = wp.zeros(2, dtype=int, device="cpu")
    costs = wp.empty(shape=(len(areas), WIDTH + 1), dtype=float, device="cpu")
    cuts = wp.empty(shape=(len(areas), WIDTH + 1), dtype=int, device="cpu")
    waiting = wp.empty(shape=(count, 4), dtype=int, device="cpu")
    wp.launch(
        open_nodes,
        dim=1,
        inputs=[lo, hi, order, ranges, areas],
        outputs=[costs, cuts, waiting, boxes, children, leaves, sizes],
        device="cpu",
    )
    node_count, leaf_count = (int(size) for size in sizes.numpy())
    return WideTree(
        boxes=_widen(boxes.numpy()[:node_count], MARGIN * np.abs(all_corners).max()).reshape(-1, LEAF),
        children=children.numpy()[:node_count].reshape(-1, LEAF),
        **_fill_leaves(leaves.numpy()[:leaf_count], order.numpy(), all_corners, owner, face),
    )


def _split(lo: wp.array, hi: wp.array, order: wp.array) -> tuple[wp.array, wp.array]:
    """Reorders triangles into ranges, (n, 3) int, and returns these and their boxes' areas."""
    ranges = wp.empty(shape=(2 * len(order), 3), dtype=int, device="cpu")
    areas = wp.empty(shape=2 * len(order), dtype=float, device="cpu")
    size = wp.zeros(1, dtype=int, device="cpu")
    wp.launch(split_ranges, dim=1, inputs=[lo, hi], outputs=[order, ranges, areas, size], device="cpu")
    made = int(size.numpy()[0])
    return ranges[:made], areas[:made]


def _widen(boxes: np.ndarray, margin: np.float32) -> np.ndarray:
    """Boxes, (n, 6, 16), with all sides moved outwards, by more than a margin and the rounding of that."""
    lower, upper = boxes[:, 0::2] - margin, boxes[:, 1::2] + margin
    return np.stack([np.nextafter(lower, -np.inf), np.nextafter(upper, np.inf)], axis=2).reshape(boxes.shape)


def _fill_leaves(
    leaves: np.ndarray, order: np.ndarray, corners: np.ndarray, owner: np.ndarray, face: np.ndarray
) -> dict[str, np.ndarray]:
    """The leaves' rows."""
    lane = np.arange(LEAF)
    is_filled = lane < leaves[:, 1:]
    picked = order[np.where(is_filled, leaves[:, :1] + lane, leaves[:, :1])]
    rows = np.where(is_filled[:, :, None, None], corners[picked], np.float32(np.nan))
    return {
        "triangles": np.ascontiguousarray(rows.transpose(0, 2, 3, 1)).reshape(-1, LEAF),
        "owners": np.where(is_filled, owner[picked], np.int32(-1)),
        "faces": np.where(is_filled, face[picked], np.int32(-1)),
    }
