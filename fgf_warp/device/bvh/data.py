"""The layout of the trees: a row holds one coordinate of the sixteen boxes of a node or of a leaf's eight triangles."""

import warp as wp

from fgf_warp.device.geometry import Motion, Solid

vec8 = wp.types.vector(length=8, dtype=wp.float32)
vec8i = wp.types.vector(length=8, dtype=wp.int32)

WIDTH = wp.constant(16)
"""Children of a node, at most."""
LEAF = wp.constant(8)
"""Triangles of a leaf, at most."""
MAX_LEVELS = wp.constant(7)
"""Of a tree, which then has room for 16^7 full leaves."""
NODE_FLOATS = wp.constant(6 * 16)
"""Lower x, upper x, lower y and so on of the children's boxes, a row each; none is flat, and an empty child's is inside
out."""
LEAF_FLOATS = wp.constant(9 * 8)
"""x, y, z of the first, second and third corners, a row each; an empty place is NaN, and no ray meets it."""
CORNER_FLOATS = wp.constant(3 * 8)
"""From a corner's rows to those of the next."""
NONE = wp.constant(2147483647)
"""Stands for no node."""


@wp.struct
class Mesh:
    """What the triangles of one mesh or light are."""

    surface: int
    """-1: a bare boundary, or a light."""
    container: int
    """Bit of the medium that fills it, or -1."""
    is_open: int
    """1: light may enter the medium through its surface, which is then a boundary too."""
    light: int
    """Its index, or -1."""
    shadow_links: wp.uint32
    """Bits of the lights in whose light it casts a shadow."""


@wp.struct
class Instance:
    """A mesh under a transform, or a solid."""

    root: int
    """Of its mesh's tree; or -1 - the index of the solid."""
    owner: int
    """Index of what its triangles are."""
    item: int
    """What a hit of its surface tells in place of the mesh's own: instances share that."""
    motion: int
    """Index of its motion, or -1."""
    to_object: wp.mat33
    position: wp.vec3
    """Its `Placement`, where it rests."""


@wp.struct
class Bvh:
    """The trees; without meshes there are no nodes."""

    boxes: wp.array(dtype=vec8)
    """Per node: six rows of sixteen, lower x, upper x, lower y and so on [stage unit]."""
    children: wp.array(dtype=vec8i)
    """Per node: the indices of sixteen inner nodes, or -1 - the index of a leaf, or of an instance."""
    triangles: wp.array(dtype=vec8)
    """Per leaf: nine rows of eight, see `LEAF_FLOATS` [stage unit]."""
    owners: wp.array(dtype=vec8i)
    """Per leaf: index of the triangles' meshes."""
    faces: wp.array(dtype=vec8i)
    """Per leaf: the triangles' numbers in their meshes."""
    meshes: wp.array(dtype=Mesh)
    """Of the world, and then of instances."""
    world: int
    """Root of the tree of the triangles in world space, or -1."""
    top: int
    """Root of the tree over the instances, or `NONE`."""
    instances: wp.array(dtype=Instance)
    motions: wp.array(dtype=Motion)
    solids: wp.array(dtype=Solid)
    """Those among the instances."""
