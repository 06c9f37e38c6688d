"""From instances, and from solids and their motion, to rows of the device's structs: block after block, in arrays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate
from typing import Any

import numpy as np
import warp as wp

from fgf_warp.device import bvh, geometry
from fgf_warp.integrator import SOLID_KINDS
from fgf_warp.scene import Instances, Mesh, Shape, Solid, count_of, moves
from fgf_warp.scene.placements import BLOCK, blocks, compose, invert_axes, squared
from fgf_warp.upload.arrays import struct_rows, upload_array

INSTANCE_MARGIN = 1e-6
"""Of an instance's box, relative to the coordinates on the way into its space: amply more than is rounded there."""
UNIT_BOX = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
"""Holds every solid in its own space."""

Item = Solid | Instances
"""What hangs in the tree over instances."""


def is_open(shape: Shape) -> bool:
    """True where light may enter a medium through the shape's surface."""
    return shape.medium is not None and shape.surface is not None and shape.surface.may_be_transparent


def number_surfaces(shapes: Sequence[Shape]) -> dict[Any, int]:
    """For each shape with a surface the number of the first of its surfaces, of which there are as many as places."""
    having = [shape for shape in shapes if shape.surface is not None]
    return dict(zip(having, accumulate(map(count_of, having), initial=0), strict=False))


def number_containers(shapes: Sequence[Shape]) -> dict[Any, int]:
    """For each shape that a medium fills its bit in a path's `inside`."""
    return {shape: bit for bit, shape in enumerate(shape for shape in shapes if shape.medium is not None)}


def number_motions(shapes: Sequence[Shape]) -> dict[Any, np.ndarray]:
    """For each shape that moves the index of the motion of each of its places, (n,) int32; -1 where one rests."""
    found, made = {}, 0
    for shape in shapes:
        if isinstance(shape, Mesh) or not moves(shape):
            continue
        opening, closing = (_places(shape, slice(None), is_closing=end) for end in (False, True))
        does_move = (opening != closing).any(axis=(1, 2)) | isinstance(shape, Solid)
        found[shape] = np.where(does_move, made + np.cumsum(does_move) - 1, -1).astype(np.int32)
        made += int(does_move.sum())
    return found


def upload_instances(
    items: Sequence[Item], roots: Sequence[int], owners: Mapping[Any, int], shapes: Sequence[Shape], device: str
) -> wp.array:
    """The device's `Instance`s.

    Args:
        items: instances of meshes, and then what hangs in the tree of solids.
        roots: of the trees of the former's meshes.
        owners: index of what the triangles of each of the former are.
        shapes: among which surfaces and motions are numbered.
        device: to copy them to.

    Returns:
        (n,) structs, one for each place of each item, in their order.
    """
    surfaces, motions = number_surfaces(shapes), number_motions(shapes)
    counts = [count_of(item) for item in items]
    rows = struct_rows(bvh.Instance, sum(counts))
    rows["root"] = np.repeat([*roots, *(0 for _ in items[len(roots) :])], counts)
    solids = sum(counts[len(roots) :])
    rows["root"][len(rows) - solids :] = -1 - np.arange(solids)
    rows["owner"] = np.repeat([owners.get(item, -1) for item in items], counts)
    rows["item"] = _numbers(items, surfaces)
    rows["motion"] = _motions(items, motions)
    for at, places in _blocks(items):
        rows["to_object"][at] = invert_axes(places)
        rows["position"][at] = places[:, :, 3]
    return upload_array(rows, bvh.Instance, device)


def upload_solids(solids: Sequence[Item], shapes: Sequence[Shape], device: str) -> wp.array:
    """The device's `Solid`s.

    Args:
        solids: some of the shapes.
        shapes: among which surfaces, containers and motions are numbered.
        device: to copy them to.

    Returns:
        (n,) structs, one for each place of each solid, in their order.
    """
    containers, counts = number_containers(shapes), [count_of(solid) for solid in solids]
    kinds = [_kind_of(solid) for solid in solids]
    rows = struct_rows(geometry.Solid, sum(counts))
    rows["kind"] = np.repeat([SOLID_KINDS[kind] for kind in kinds], counts)
    rows["surface"] = _numbers(solids, number_surfaces(shapes))
    rows["is_open"] = np.repeat([is_open(solid) for solid in solids], counts)
    rows["container"] = np.repeat([containers.get(solid, -1) for solid in solids], counts)
    rows["shadow_links"] = np.repeat(np.array([solid.shadow_links for solid in solids], dtype=np.uint32), counts)
    rows["motion"] = _motions(solids, number_motions(shapes))
    for at, places in _blocks(solids):
        to_object = np.linalg.inv(squared(places))
        rows["to_object"][at], rows["to_object_offset"][at] = to_object[:, :3, :3], to_object[:, :3, 3]
    return upload_array(rows, geometry.Solid, device)


def upload_motions(shapes: Sequence[Shape], device: str) -> wp.array:
    """The device's `Motion`s, (n,) structs in the order of `number_motions`."""
    numbers = number_motions(shapes)
    rows = struct_rows(geometry.Motion, sum(int((of_shape >= 0).sum()) for of_shape in numbers.values()))
    for shape, of_shape in numbers.items():
        for at in blocks(len(of_shape)):
            does_move = of_shape[at] >= 0
            to = of_shape[at][does_move]
            opening, closing = (_places(shape, at, is_closing=end)[does_move] for end in (False, True))
            rows["axes"][to], rows["position"][to] = opening[:, :, :3], opening[:, :, 3]
            rows["closing_axes"][to], rows["closing_position"][to] = closing[:, :, :3], closing[:, :, 3]
    return upload_array(rows, geometry.Motion, device)


def bound_items(items: Sequence[Item]) -> tuple[np.ndarray, np.ndarray]:
    """Boxes in the world that hold each place of each item wherever it moves.

    Args:
        items: instances of meshes, and then what hangs in the tree of solids.

    Returns:
        Lowest and highest corners, (n, 3) float32 each [stage unit].
    """
    meshes = [mesh_of(item) for item in items]
    bounds_of = {arrays_of(mesh): mesh.bounds for mesh in meshes if mesh}
    bounds = np.array([bounds_of[arrays_of(mesh)] if mesh else UNIT_BOX for mesh in meshes])
    middle, half, reach = bounds.mean(axis=1), np.ptp(bounds, axis=1) / 2, np.abs(bounds).max(axis=1)
    owner = np.repeat(np.arange(len(items), dtype=np.int32), [count_of(item) for item in items])
    low, high = np.empty((len(owner), 3), dtype=np.float32), np.empty((len(owner), 3), dtype=np.float32)
    for is_closing in (False, True) if any(map(moves, items)) else (False,):
        for at, places in _blocks(items, is_closing=is_closing):
            axes, of = places[:, :, :3], owner[at]
            center = np.einsum("nij,nj->ni", axes, middle[of]) + places[:, :, 3]
            axes = np.abs(axes)
            extent = np.einsum("nij,nj->ni", axes, half[of])
            rounded = np.abs(center) + extent + np.einsum("nij,nj->ni", axes, reach[of])
            extent += INSTANCE_MARGIN * rounded.max(axis=1, keepdims=True)
            lowest = np.nextafter((center - extent).astype(np.float32), np.float32(-np.inf))
            highest = np.nextafter((center + extent).astype(np.float32), np.float32(np.inf))
            low[at] = np.minimum(low[at], lowest) if is_closing else lowest
            high[at] = np.maximum(high[at], highest) if is_closing else highest
    return low, high


def arrays_of(mesh: Mesh) -> tuple[int, int]:
    """Identities of a mesh's arrays: equal for meshes that share their triangles."""
    return id(mesh.points), id(mesh.triangles)


def mesh_of(item: Shape) -> Mesh | None:
    """The mesh that is instanced, where it is one."""
    return item.prototype if isinstance(item, Instances) and isinstance(item.prototype, Mesh) else None


def _kind_of(item: Item) -> str:
    solid = item.prototype if isinstance(item, Instances) else item
    assert isinstance(solid, Solid)
    return solid.kind


def _numbers(items: Sequence[Item], firsts: Mapping[Any, int]) -> np.ndarray:
    """The number of each place of all items, (n,), counted on from the item's first; -1 where the item has none."""
    counts = np.array([count_of(item) for item in items], dtype=np.int64)
    first = np.array([firsts.get(item, -1) for item in items], dtype=np.int64)
    found = np.repeat(first - (np.cumsum(counts) - counts), counts) + np.arange(counts.sum())
    return np.where(np.repeat(first, counts) < 0, -1, found)


def _motions(items: Sequence[Item], motions: Mapping[Any, np.ndarray]) -> np.ndarray | int:
    """The index of the motion of each place of all items, (n,); -1 where it rests, a bare -1 where all do."""
    if not motions:
        return -1
    return np.concatenate([np.zeros(0, np.int32), *(motions.get(i, np.full(count_of(i), -1)) for i in items)])


def _places(item: Item, at: slice, *, is_closing: bool = False) -> np.ndarray:
    """Object-to-world matrices, (m, 3, 4), of some places of an item, when the shutter opens or when it closes."""
    places = item.object_to_world if item.closing is None or not is_closing else item.closing
    if isinstance(item, Solid):
        return places[None, :3]
    return compose(places[at], item.prototype.object_to_world) if isinstance(item.prototype, Solid) else places[at]


def _blocks(items: Sequence[Item], *, is_closing: bool = False) -> Iterator[tuple[slice, np.ndarray]]:
    """All places, a block at a time, so that few are in memory at once.

    Yields:
        Which of all places they are, and their object-to-world matrices, (m, 3, 4) with m <= `BLOCK`.
    """
    first, held = 0, 0
    parts: list[np.ndarray] = []
    for item in items:
        for at in blocks(count_of(item)):
            part = _places(item, at, is_closing=is_closing)
            if held + len(part) > BLOCK:
                yield slice(first, first + held), np.concatenate(parts)
                first, held, parts = first + held, 0, []
            parts.append(part)
            held += len(part)
    if held:
        yield slice(first, first + held), np.concatenate(parts)
