"""Builds the trees of `device/bvh.py`: binary by the surface area heuristic, then collapsed to sixteen children.

Where that would make a tree deeper than a ray can keep track of, nodes have children of equal counts instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from fgf_warp.device.bvh import LEAF, WIDTH
from fgf_warp.headers import load_on_cpu
from fgf_warp.upload.bvh_kernel import open_nodes
from fgf_warp.upload.bvh_splitting import split_boxes

MARGIN = 1e-7
"""Of a box, relative to the largest coordinate: a flat box is met even where it is just behind a ray's origin, and
slack relative to the distance makes it no thicker."""


@dataclass(frozen=True, eq=False)
class BoxTree:
    """A tree over boxes, on the host.

    Args:
        boxes: (nodes, 6, 16) float32, lower x, upper x, lower y and so on of sixteen boxes; an empty child's box is
            inside out.
        children: (nodes, 16) int32, another node, or -1 - the index of a leaf; node 0 is the root.
        leaves: (leaves, 2) int32, the first place in `order`, and how many.
        order: (n,) int32, the boxes' numbers.
    """

    boxes: np.ndarray
    children: np.ndarray
    leaves: np.ndarray
    order: np.ndarray


@dataclass(frozen=True, eq=False)
class WideTree:
    """Arrays of trees over triangles, on the host.

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

    @property
    def node_count(self) -> int:
        """Nodes of all trees."""
        return len(self.children) // 2


def load_builder() -> None:
    """Compiles the builder where that has not been done, so that threads do not do it at the same time."""
    load_on_cpu(open_nodes.module)


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
    low, high = bound_triangles(all_corners)
    tree = build_box_tree(low, high, LEAF)
    return WideTree(
        boxes=_widen(tree.boxes, MARGIN * max(np.abs(low).max(), np.abs(high).max())).reshape(-1, LEAF),
        children=tree.children.reshape(-1, LEAF),
        **_fill_leaves(tree, all_corners, owner, face),
    )


def join_trees(trees: Sequence[WideTree], top: BoxTree | None) -> tuple[WideTree, list[int]]:
    """Trees in the same arrays, one after the other.

    Args:
        trees: over triangles.
        top: over boxes, one in each leaf; comes last, and its leaves are the numbers of its boxes.

    Returns:
        All of them in one, and the root of each, -1 where it has no nodes; that of `top` comes last.
    """
    roots, children, nodes, leaves = [], [], 0, 0
    for tree in trees:
        roots.append(nodes if tree.node_count else -1)
        children.append(_shift(tree.children, nodes, leaves))
        nodes += tree.node_count
        leaves += len(tree.owners)
    boxes = [tree.boxes for tree in trees]
    if top is not None:
        roots.append(nodes)
        number_of = np.append(-1 - top.order[top.leaves[:, 0]], 0).astype(np.int32)
        boxes.append(top.boxes.reshape(-1, LEAF))
        inner = np.where(top.children > 0, top.children + np.int32(nodes), np.int32(0))
        children.append(np.where(top.children < 0, number_of[-1 - top.children], inner).reshape(-1, LEAF))
    joined = WideTree(
        boxes=np.concatenate(boxes),
        children=np.concatenate(children).astype(np.int32, copy=False),
        **{key: np.concatenate([getattr(tree, key) for tree in trees]) for key in ("triangles", "owners", "faces")},
    )
    return joined, roots


def _shift(children: np.ndarray, nodes: int, leaves: int) -> np.ndarray:
    """The children of a tree that comes after so many nodes and leaves, (2 nodes, 8) int32."""
    return np.where(children < 0, children - np.int32(leaves), children + np.int32(nodes))


def bound_triangles(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The box of each triangle.

    Args:
        corners: (m, 3, 3) float32.

    Returns:
        Lowest and highest corners, (m, 3) float32 each.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def build_box_tree(low: np.ndarray, high: np.ndarray, leaf: int) -> BoxTree:
    """The tree over boxes.

    Args:
        low: (n, 3) float32, n > 0, their lowest corners, which are reordered.
        high: (n, 3) float32, their highest, which are reordered too.
        leaf: how many of them a leaf holds, at most.

    Returns:
        A tree of at most `MAX_LEVELS` levels.
    """
    lo, hi = (wp.array(corners, dtype=wp.vec3, device="cpu", copy=False) for corners in (low, high))
    order = wp.array(np.arange(len(low), dtype=np.int32), dtype=int, device="cpu", copy=False)
    ranges, cuts = split_boxes(lo, hi, leaf, order)
    # What is not written takes no memory.
    boxes = wp.empty(shape=(len(low), 6, WIDTH), dtype=float, device="cpu")
    children = wp.empty(shape=(len(low), WIDTH), dtype=int, device="cpu")
    leaves = wp.empty(shape=(len(low), 2), dtype=int, device="cpu")
    sizes = wp.zeros(2, dtype=int, device="cpu")
    waiting = wp.empty(shape=(len(low), 4), dtype=int, device="cpu")
    wp.launch(
        open_nodes,
        dim=1,
        inputs=[lo, hi, leaf, ranges, cuts],
        outputs=[waiting, boxes, children, leaves, sizes],
        device="cpu",
    )
    node_count, leaf_count = (int(size) for size in sizes.numpy())
    return BoxTree(
        boxes.numpy()[:node_count], children.numpy()[:node_count], leaves.numpy()[:leaf_count], order.numpy()
    )


def _widen(boxes: np.ndarray, margin: np.float32) -> np.ndarray:
    """Boxes, (n, 6, 16), with all sides moved outwards by a margin and a unit in the last place."""
    lower, upper = boxes[:, 0::2] - margin, boxes[:, 1::2] + margin
    return np.stack([np.nextafter(lower, -np.inf), np.nextafter(upper, np.inf)], axis=2).reshape(boxes.shape)


def _fill_leaves(tree: BoxTree, corners: np.ndarray, owner: np.ndarray, face: np.ndarray) -> dict[str, np.ndarray]:
    """The rows of a tree's leaves, by the names of `WideTree`.

    Args:
        tree: over the triangles' boxes.
        corners: of all triangles, (m, 3, 3) float32.
        owner: index of each triangle's mesh, (m,) int32.
        face: number of each triangle in its mesh, (m,) int32.
    """
    lane = np.arange(LEAF)
    first = tree.leaves[:, :1]
    is_filled = lane < tree.leaves[:, 1:]
    picked = tree.order[np.where(is_filled, first + lane, first)]
    rows = np.where(is_filled[:, :, None, None], corners[picked], np.float32(np.nan))
    return {
        "triangles": np.ascontiguousarray(rows.transpose(0, 2, 3, 1)).reshape(-1, LEAF),
        "owners": np.where(is_filled, owner[picked], np.int32(-1)),
        "faces": np.where(is_filled, face[picked], np.int32(-1)),
    }
