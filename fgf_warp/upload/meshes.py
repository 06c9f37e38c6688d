"""From shapes to the device's triangles: trees, instances, and how things move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fgf_warp.device import bvh
from fgf_warp.scene import Light, Mesh, MeshLight, Shape, solids_in_tree
from fgf_warp.upload.arrays import upload_array, upload_structs
from fgf_warp.upload.bvh import build_box_tree, build_wide_tree, join_trees
from fgf_warp.upload.instances import (
    arrays_of,
    bound_items,
    is_open,
    mesh_of,
    number_containers,
    number_surfaces,
    upload_instances,
    upload_motions,
    upload_solids,
)


def build_device_meshes(shapes: Sequence[Shape], lights: Sequence[Light], device: str) -> Any:
    """The device's view of all triangles, and of how shapes move.

    Args:
        shapes: whose meshes there are; surfaces, bits of `inside`, motions and instances are numbered in their order.
        lights: among which those of triangles are, numbered in their order.
        device: to copy it to.

    Returns:
        `device.bvh.Bvh`.
    """
    meshes = [shape for shape in shapes if isinstance(shape, Mesh)]
    instances = [(shape, mesh) for shape in shapes if (mesh := mesh_of(shape))]
    hanging = solids_in_tree(shapes)
    items: list[Any] = [*(shape for shape, _ in instances), *hanging]
    index_of_light = {light: index for index, light in enumerate(lights) if isinstance(light, MeshLight)}
    # What instances share is known by its arrays.
    shared = {arrays_of(mesh): mesh for _, mesh in instances}

    in_world = [*map(_corners, meshes), *(light.corners.astype(np.float32) for light in index_of_light)]
    trees = [build_wide_tree(in_world), *(build_wide_tree([_corners(mesh)]) for mesh in shared.values())]
    joined, roots = join_trees(trees, build_box_tree(*bound_items(items), leaf=1) if items else None)
    result = bvh.Bvh()
    result.boxes = upload_array(joined.boxes, bvh.vec8, device)
    result.children = upload_array(joined.children, bvh.vec8i, device)
    result.triangles = upload_array(joined.triangles, bvh.vec8, device)
    result.owners = upload_array(joined.owners, bvh.vec8i, device)
    result.faces = upload_array(joined.faces, bvh.vec8i, device)
    result.world, result.top = roots[0], roots[-1] if items else int(bvh.NONE)

    surface_of, container_of = number_surfaces(shapes), number_containers(shapes)
    owners: list[Any] = [*meshes, *index_of_light, *(shape for shape, _ in instances)]
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
    roots_of_instances = [root_of[arrays_of(mesh)] for _, mesh in instances]
    owner_of = {owner: index for index, owner in enumerate(owners)}
    result.instances = upload_instances(items, roots_of_instances, owner_of, shapes, device)
    result.solids = upload_solids(hanging, shapes, device)
    result.motions = upload_motions(shapes, device)
    return result


def _corners(mesh: Mesh) -> np.ndarray:
    """The corners of each triangle, (m, 3, 3) float32 [stage unit]."""
    return np.asarray(mesh.points, dtype=np.float32)[mesh.triangles]
