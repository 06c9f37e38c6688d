"""From shapes to the device's triangles: trees, instances, and how things move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from fgf_warp.bvh import BoxTree, build_box_tree, build_wide_tree, join_trees
from fgf_warp.device import bvh, geometry
from fgf_warp.integrator import SOLID_KINDS
from fgf_warp.scene import Light, Mesh, MeshInstance, MeshLight, Shape, Solid, solids_in_tree

INSTANCE_MARGIN = 1e-6
"""Of an instance's box, relative to the coordinates on the way into its space: amply more than is rounded there."""


def build_device_meshes(shapes: Sequence[Shape], lights: Sequence[Light], device: str) -> Any:
    """The device's view of all triangles, and of how shapes move.

    Args:
        shapes: whose meshes there are; surfaces, bits of `inside`, motions and instances are numbered in their order.
        lights: among which those of triangles are, numbered in their order.
        device: to copy it to.
    """
    meshes = [shape for shape in shapes if isinstance(shape, Mesh)]
    instances = [shape for shape in shapes if isinstance(shape, MeshInstance)]
    hanging = solids_in_tree(shapes)
    items: list[MeshInstance | Solid] = [*instances, *hanging]
    index_of_light = {light: index for index, light in enumerate(lights) if isinstance(light, MeshLight)}
    # What instances share is known by its arrays.
    shared = {_arrays_of(instance): instance.mesh for instance in instances}

    in_world = [*map(_corners, meshes), *(light.corners.astype(np.float32) for light in index_of_light)]
    trees = [build_wide_tree(in_world), *(build_wide_tree([_corners(mesh)]) for mesh in shared.values())]
    joined, roots = join_trees(trees, _tree_over(items) if items else None)
    result = bvh.Bvh()
    result.boxes = wp.array(joined.boxes, dtype=bvh.vec8, device=device)
    result.children = wp.array(joined.children, dtype=bvh.vec8i, device=device)
    result.triangles = wp.array(joined.triangles, dtype=bvh.vec8, device=device)
    result.owners = wp.array(joined.owners, dtype=bvh.vec8i, device=device)
    result.faces = wp.array(joined.faces, dtype=bvh.vec8i, device=device)
    result.world, result.top = roots[0], roots[-1] if items else int(bvh.NONE)

    surface_of, container_of, motion_of = number_surfaces(shapes), number_containers(shapes), number_motions(shapes)
    owners: list[Any] = [*meshes, *index_of_light, *instances]
    result.meshes = upload_structs(
        bvh.Mesh,
        device,
        surface=[surface_of.get(owner, -1) for owner in owners],
        container=[container_of.get(owner, -1) for owner in owners],
        is_open=[not isinstance(owner, MeshLight) and is_open(owner) for owner in owners],
        light=[index_of_light.get(owner, -1) for owner in owners],
        shadow_links=[0 if isinstance(owner, MeshLight) else owner.shadow_links for owner in owners],
    )
    root_of = dict(zip(shared, roots[1:], strict=False))
    placed = _matrices([item.object_to_world for item in items])
    result.instances = upload_structs(
        bvh.Instance,
        device,
        root=[*(root_of[_arrays_of(instance)] for instance in instances), *range(-1, -1 - len(hanging), -1)],
        owner=[*range(len(in_world), len(owners)), *(-1 for _ in hanging)],
        motion=[motion_of.get(item, -1) for item in items],
        to_object=np.linalg.inv(placed[:, :3, :3]),
        position=placed[:, :3, 3],
    )
    result.solids = upload_solids(hanging, shapes, device)
    opening = _matrices([shape.object_to_world for shape in motion_of])
    closing = _matrices([shape.closing for shape in motion_of if shape.closing is not None])
    result.motions = upload_structs(
        geometry.Motion,
        device,
        axes=opening[:, :3, :3],
        position=opening[:, :3, 3],
        closing_axes=closing[:, :3, :3],
        closing_position=closing[:, :3, 3],
    )
    return result


def is_open(shape: Shape) -> bool:
    """True where light may enter a medium through the shape's surface."""
    return shape.medium is not None and shape.surface is not None and shape.surface.may_be_transparent


def number_surfaces(shapes: Sequence[Shape]) -> dict[Any, int]:
    """The index of each shape's surface, of those that have one."""
    return {shape: index for index, shape in enumerate(shape for shape in shapes if shape.surface is not None)}


def number_containers(shapes: Sequence[Shape]) -> dict[Any, int]:
    """The bit of each shape that a medium fills."""
    return {shape: bit for bit, shape in enumerate(shape for shape in shapes if shape.medium is not None)}


def number_motions(shapes: Sequence[Shape]) -> dict[Any, int]:
    """The index of each shape's motion, of those that move."""
    moving = (shape for shape in shapes if isinstance(shape, Solid | MeshInstance) and shape.closing is not None)
    return {shape: index for index, shape in enumerate(moving)}


def upload_structs(dtype: Any, device: str, **fields: Any) -> wp.array:
    """An array of structs from the columns of their fields; from a list of structs it would take a hundred times it."""
    rows = np.zeros(len(next(iter(fields.values()))), dtype=dtype.numpy_dtype())
    for name, values in fields.items():
        rows[name] = values
    return wp.array(rows, dtype=dtype, device=device)


def upload_solids(solids: Sequence[Solid], shapes: Sequence[Shape], device: str) -> wp.array:
    """The device's view of some of the shapes, whose surfaces, containers and motions are numbered in their order."""
    surface_of, container_of, motion_of = number_surfaces(shapes), number_containers(shapes), number_motions(shapes)
    to_object = np.linalg.inv(_matrices([solid.object_to_world for solid in solids]))
    return upload_structs(
        geometry.Solid,
        device,
        kind=[SOLID_KINDS[solid.kind] for solid in solids],
        to_object=to_object[:, :3, :3],
        to_object_offset=to_object[:, :3, 3],
        surface=[surface_of.get(solid, -1) for solid in solids],
        is_open=[is_open(solid) for solid in solids],
        container=[container_of.get(solid, -1) for solid in solids],
        shadow_links=[solid.shadow_links for solid in solids],
        motion=[motion_of.get(solid, -1) for solid in solids],
    )


def bound_instances(instances: Sequence[MeshInstance | Solid]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corners, (n, 3) float32 each, of boxes that hold instances wherever they move."""
    bounds_of: dict[Any, Any] = {}
    for instance in instances:
        if isinstance(instance, MeshInstance):
            bounds_of.setdefault(_arrays_of(instance), instance.mesh.bounds)
    unit = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
    bounds = np.array([unit if isinstance(item, Solid) else bounds_of[_arrays_of(item)] for item in instances])
    middle, half, reach = bounds.mean(axis=1), np.ptp(bounds, axis=1) / 2, np.abs(bounds).max(axis=1)
    opening = [instance.object_to_world for instance in instances]
    closing = [instance.object_to_world if instance.closing is None else instance.closing for instance in instances]
    low, high = np.full((len(instances), 3), np.inf), np.full((len(instances), 3), -np.inf)
    for matrices in (_matrices(opening), _matrices(closing)):
        axes = matrices[:, :3, :3]
        center = np.einsum("nij,nj->ni", axes, middle) + matrices[:, :3, 3]
        extent = np.einsum("nij,nj->ni", np.abs(axes), half)
        rounded = np.abs(center) + extent + np.einsum("nij,nj->ni", np.abs(axes), reach)
        extent += INSTANCE_MARGIN * rounded.max(axis=1, keepdims=True)
        low, high = np.minimum(low, center - extent), np.maximum(high, center + extent)
    return np.nextafter(low.astype(np.float32), -np.inf), np.nextafter(high.astype(np.float32), np.inf)


def _tree_over(instances: Sequence[MeshInstance | Solid]) -> BoxTree:
    return build_box_tree(*bound_instances(instances), leaf=1)


def _arrays_of(instance: MeshInstance) -> tuple[int, int]:
    return id(instance.mesh.points), id(instance.mesh.triangles)


def _corners(mesh: Mesh) -> np.ndarray:
    """(m, 3, 3) float32."""
    return np.asarray(mesh.points, dtype=np.float32)[mesh.triangles]


def _matrices(matrices: Sequence[np.ndarray]) -> np.ndarray:
    """(n, 4, 4), of none as well."""
    return np.array(matrices, dtype=np.float64).reshape(-1, 4, 4)
