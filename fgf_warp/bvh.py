"""Builds the tree of `device/bvh.py`: top down, each node opened to eight children by the surface area heuristic.

Where that would make the tree deeper than a ray can keep track of, by count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from fgf_warp.bvh_kernel import WIDTH, build_tree


@dataclass(frozen=True, eq=False)
class WideTree:
    """Arrays of the tree, on the host.

    Args:
        boxes: (6 nodes, 8) float32; an empty child's box is inside out.
        children: (nodes, 8) int32, another node, or -1 - the index of a leaf.
        triangles: (9 leaves, 8) float32; an empty place repeats one corner.
        owners: (leaves, 8) int32, index of the triangle's mesh; -1 in an empty place.
    """

    boxes: np.ndarray
    children: np.ndarray
    triangles: np.ndarray
    owners: np.ndarray


def load_builder() -> None:
    """Compiles the builder where that has not been done, so that threads do not do it at the same time."""
    build_tree.module.load(wp.get_device("cpu"), 1)


def build_wide_tree(corners: Sequence[np.ndarray]) -> WideTree:
    """The tree over the triangles of all meshes.

    Args:
        corners: for each mesh its triangles' corners, (m, 3, 3) float32.

    Returns:
        A tree of at most `MAX_LEVELS` levels, wherever the triangles lie.
    """
    if not corners:
        return WideTree(*(np.zeros((0, WIDTH), dtype) for dtype in (np.float32, np.int32, np.float32, np.int32)))
    all_corners = np.concatenate(corners)
    owner = np.repeat(np.arange(len(corners), dtype=np.int32), [len(c) for c in corners])
    count = len(all_corners)

    order = wp.array(np.arange(count, dtype=np.int32), dtype=int, device="cpu")
    boxes = wp.empty(shape=(count + 1, 6, WIDTH), dtype=float, device="cpu")
    children = wp.zeros(shape=(count + 1, WIDTH), dtype=int, device="cpu")
    leaves = wp.empty(shape=(count, 2), dtype=int, device="cpu")
    sizes = wp.zeros(2, dtype=int, device="cpu")
    wp.launch(
        build_tree,
        dim=1,
        inputs=[
            wp.array(all_corners.min(axis=1), dtype=wp.vec3, device="cpu"),
            wp.array(all_corners.max(axis=1), dtype=wp.vec3, device="cpu"),
        ],
        outputs=[order, wp.empty(shape=(count + 1, 3), dtype=int, device="cpu"), boxes, children, leaves, sizes],
        device="cpu",
    )
    node_count, leaf_count = (int(size) for size in sizes.numpy())
    return WideTree(
        boxes=boxes.numpy()[:node_count].reshape(-1, WIDTH),
        children=children.numpy()[:node_count],
        **_fill_leaves(leaves.numpy()[:leaf_count], order.numpy(), all_corners, owner),
    )


def _fill_leaves(
    leaves: np.ndarray, order: np.ndarray, corners: np.ndarray, owner: np.ndarray
) -> dict[str, np.ndarray]:
    """The leaves' rows; what a leaf does not fill repeats one corner and has no owner."""
    lane = np.arange(WIDTH)
    is_filled = lane < leaves[:, 1:]
    picked = order[np.where(is_filled, leaves[:, :1] + lane, leaves[:, :1])]
    rows = corners[picked]
    rows = np.where(is_filled[:, :, None, None], rows, rows[:, :, :1])
    return {
        "triangles": np.ascontiguousarray(rows.transpose(0, 2, 3, 1)).reshape(-1, WIDTH),
        "owners": np.where(is_filled, owner[picked], -1).astype(np.int32),
    }
