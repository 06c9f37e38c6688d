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

INSTANCE_MARGIN = 1e-6
"""Of an instance's box, relative to the coordinates on the way into its space: amply more than is rounded there."""
UNIT_BOX = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))

Item = Solid | Instances
"""What hangs in the tree over instances."""


def is_open(shape: Shape) -> bool:
    """True where light may enter a medium through the shape's surface."""
    return shape.medium is not None and shape.surface is not None and shape.surface.may_be_transparent


def number_surfaces(shapes: Sequence[Shape]) -> dict[Any, int]:
    """The number of the first of each shape's surfaces, of those that have one: there are as many as places."""
    having = [shape for shape in shapes if shape.surface is not None]
    return dict(zip(having, accumulate(map(count_of, having), initial=0), strict=False))


def number_containers(shapes: Sequence[Shape]) -> dict[Any, int]:
    """The bit of each shape that a medium fills."""
    return {shape: bit for bit, shape in enumerate(shape for shape in shapes if shape.medium is not None)}


def number_motions(shapes: Sequence[Shape]) -> dict[Any, np.ndarray]:
    """Of each shape that moves, for each of its places the index of its motion, or -1 where that rests: (n,) int32."""
    found, made = {}, 0
    for shape in shapes:
        if isinstance(shape, Mesh) or not moves(shape):
            continue
        opening, closing = (_places(shape, slice(None), is_closing=end) for end in (False, True))
        does_move = (opening != closing).any(axis=(1, 2)) | isinstance(shape, Solid)
        found[shape] = np.where(does_move, made + np.cumsum(does_move) - 1, -1).astype(np.int32)
        made += int(does_move.sum())
    return found


def upload_structs(dtype: Any, device: str, **fields: Any) -> wp.array:
    """An array of structs from the columns of their fields; from a list of structs it would take a hundred times it."""
    rows = _rows(dtype, len(next(iter(fields.values()))))
    for name, values in fields.items():
        rows[name] = values
    return upload_array(rows, dtype, device)


def upload_array(values: np.ndarray, dtype: Any, device: str) -> wp.array:
    """An array of the device's; on the CPU the same memory, which nobody may write to any more."""
    return wp.array(values, dtype=dtype, device=device, copy=False)


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
    """
    surfaces, motions = number_surfaces(shapes), number_motions(shapes)
    counts = [count_of(item) for item in items]
    rows = _rows(bvh.Instance, sum(counts))
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
    """The device's view of some of the shapes, whose surfaces, containers and motions are numbered in their order."""
    containers, counts = number_containers(shapes), [count_of(solid) for solid in solids]
    kinds = [_kind_of(solid) for solid in solids]
    rows = _rows(geometry.Solid, sum(counts))
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
    """The device's `Motion`s, in the order of `number_motions`."""
    numbers = number_motions(shapes)
    rows = _rows(geometry.Motion, sum(int((of_shape >= 0).sum()) for of_shape in numbers.values()))
    for shape, of_shape in numbers.items():
        for at in blocks(len(of_shape)):
            does_move = of_shape[at] >= 0
            to = of_shape[at][does_move]
            opening, closing = (_places(shape, at, is_closing=end)[does_move] for end in (False, True))
            rows["axes"][to], rows["position"][to] = opening[:, :, :3], opening[:, :, 3]
            rows["closing_axes"][to], rows["closing_position"][to] = closing[:, :, :3], closing[:, :, 3]
    return upload_array(rows, geometry.Motion, device)


def bound_items(items: Sequence[Item]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corners, (n, 3) float32 each, of boxes that hold what is instanced wherever it moves."""
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
    """What meshes that share their triangles have in common."""
    return id(mesh.points), id(mesh.triangles)


def mesh_of(item: Shape) -> Mesh | None:
    """The mesh that is instanced, where it is one."""
    return item.prototype if isinstance(item, Instances) and isinstance(item.prototype, Mesh) else None


def _kind_of(item: Item) -> str:
    solid = item.prototype if isinstance(item, Instances) else item
    assert isinstance(solid, Solid)
    return solid.kind


def _rows(dtype: Any, count: int) -> Any:
    return np.zeros(count, dtype=dtype.numpy_dtype())


def _numbers(items: Sequence[Item], firsts: Mapping[Any, int]) -> np.ndarray:
    """Of each place, counted on from that of the shape's first; -1 where that has none."""
    counts = np.array([count_of(item) for item in items], dtype=np.int64)
    first = np.array([firsts.get(item, -1) for item in items], dtype=np.int64)
    found = np.repeat(first - (np.cumsum(counts) - counts), counts) + np.arange(counts.sum())
    return np.where(np.repeat(first, counts) < 0, -1, found)


def _motions(items: Sequence[Item], motions: Mapping[Any, np.ndarray]) -> np.ndarray | int:
    """Of each place, the index of its motion or -1."""
    if not motions:
        return -1
    return np.concatenate([np.zeros(0, np.int32), *(motions.get(i, np.full(count_of(i), -1)) for i in items)])


def _places(item: Item, at: slice, *, is_closing: bool = False) -> np.ndarray:
    """(m, 3, 4), some of the places of a mesh or a solid, when the shutter opens or when it closes."""
    places = item.object_to_world if item.closing is None or not is_closing else item.closing
    if isinstance(item, Solid):
        return places[None, :3]
    return compose(places[at], item.prototype.object_to_world) if isinstance(item.prototype, Solid) else places[at]


def _blocks(items: Sequence[Item], *, is_closing: bool = False) -> Iterator[tuple[slice, np.ndarray]]:
    """All places, few at once but those of many shapes together, each time with which of all they are."""
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
