"""Triangles in trees of sixteen-wide nodes, and rays against them.

All meshes in world space are in one tree. A mesh that has instances is in a tree of its own, in its own space, and the
instances' boxes are in one tree over them: a ray that meets such a box goes on in the instance's space, where its
direction is not of unit length, so that distances along it stay what they are.
"""

from fgf_warp.device.bvh.data import LEAF, MAX_LEVELS, NONE, WIDTH, Bvh, Instance, Mesh, vec8, vec8i
from fgf_warp.device.bvh.traversal import build_intersect_meshes, build_place_instance

__all__ = [
    "LEAF",
    "MAX_LEVELS",
    "NONE",
    "WIDTH",
    "Bvh",
    "Instance",
    "Mesh",
    "build_intersect_meshes",
    "build_place_instance",
    "vec8",
    "vec8i",
]
