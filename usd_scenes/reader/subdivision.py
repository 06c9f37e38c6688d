"""Subdivision surfaces: uniform refinement of a control cage, and its vertices' limits.

Catmull and Clark 1978 and Loop 1987, with the sharp and semi-sharp creases of DeRose, Kass and Truong 1998, in the
rules of OpenSubdiv, which USD refers to. The last vertices are moved to where further refinement would take them, so
a refined mesh touches the limit surface in all of its vertices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from pxr import UsdGeom

from usd_scenes.reader.attributes import read_mended_token
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.creases import Crease, read_corner_sharpness, read_creases
from usd_scenes.reader.primvars import Polygons, Primvar
from usd_scenes.reader.subdivision_net import (
    Net,
    Rules,
    child,
    connect,
    face_varying_net,
    on_edges,
    parents,
    smoothing_groups,
    sums,
    tagged,
)
from usd_scenes.reader.subdivision_weights import limits, refined

TRIANGLES_MAX = 2_000_000
"""More than these no mesh is refined to."""
SCHEMES = ("catmullClark", "loop", "bilinear", "none")
BOUNDARIES = ("none", "edgeOnly", "edgeAndCorner")
FACE_VARYING = ("none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all")
TRIANGLE_RULES = ("catmullClark", "smooth")

Apply = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Refinement:
    """A refined cage, and how what is on the cage comes to be on it.

    Args:
        polygons: the refined faces.
        cage_faces: (f,) int, the face of the cage that each is a piece of.
        drawn: (cage's faces,) bool, False where the boundary's rule leaves out a face of the cage.
        smooth: vertex values of the cage, (v, k), to those of the refined faces.
        linear: the same for varying values.
        face_varying: the same for primvars at corners, to (c, k) of the refined corners.
        net: of the refined faces.
        is_smooth: False for the bilinear scheme.
    """

    polygons: Polygons
    cage_faces: np.ndarray
    drawn: np.ndarray
    smooth: Apply
    linear: Apply
    face_varying: Callable[[Primvar], np.ndarray]
    net: Net
    is_smooth: bool

    def carry(self, primvar: Primvar) -> Primvar:
        """A primvar of the cage on the refined faces.

        Returns:
            Of the same interpolation, its values without indices but where they are constant.
        """
        match primvar.interpolation:
            case "constant":
                return primvar
            case "uniform":
                return Primvar(primvar.elements[self.cage_faces], "uniform")
            case "varying":
                return Primvar(self.linear(primvar.elements), "varying")
            case "vertex":
                return Primvar(self.smooth(primvar.elements), "vertex")
            case _:
                return Primvar(self.face_varying(primvar), "faceVarying")

    def normals(self, points: np.ndarray, corners: np.ndarray) -> np.ndarray | None:
        """Unit normals of the surface, means over the triangles at each vertex by their angles there.

        Across edges that stay sharp they are not shared.

        Args:
            points: (n, 3), of the refined vertices.
            corners: (m, 3) int, the refined corners at those of the triangles.

        Returns:
            (m, 3, 3) float32; None for the bilinear scheme, which is faceted.
        """
        if not self.is_smooth:
            return None
        triangles = self.polygons.indices[corners]
        groups = smoothing_groups(self.net)[corners]
        ends = points[triangles]
        n_groups = int(groups.max(initial=-1)) + 1
        total = np.zeros((n_groups, 3))
        flat = np.cross(ends[:, 1] - ends[:, 0], ends[:, 2] - ends[:, 0])
        flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), np.finfo(float).tiny)
        for corner in range(3):
            to_next, to_last = (ends[:, (corner + step) % 3] - ends[:, corner] for step in (1, 2))
            angles = np.arctan2(
                np.linalg.norm(np.cross(to_next, to_last), axis=1), np.einsum("ij,ij->i", to_next, to_last)
            )
            total += sums(groups[:, corner], flat * angles[:, None], n_groups)
        lengths = np.linalg.norm(total, axis=1, keepdims=True)
        unit = total / np.where(lengths > 0, lengths, 1)
        # Where the triangles around a vertex have no area, or face against each other.
        return np.where(lengths[groups] > 0, unit[groups], flat[:, None]).astype(np.float32)


def read_refinement(mesh: UsdGeom.Mesh, cage: Polygons, context: StageContext) -> Refinement | None:
    """How a mesh is refined; None where it is no subdivision surface.

    Returns:
        Refined as often as the complexity says, with creases, corners and boundary as the mesh has them.

    Raises:
        SceneError: for creases or corners that do not fit the mesh, or an unknown rule, where it is read strictly.
    """
    path = mesh.GetPath()
    scheme = read_mended_token(mesh.GetSubdivisionSchemeAttr(), context, SCHEMES, "catmullClark")
    if scheme == "none" or not len(cage.counts):
        return None
    rules = Rules(
        scheme=scheme,
        boundary=read_mended_token(mesh.GetInterpolateBoundaryAttr(), context, BOUNDARIES, "edgeAndCorner"),
        face_varying=read_mended_token(
            mesh.GetFaceVaryingLinearInterpolationAttr(), context, FACE_VARYING, "cornersPlus1"
        ),
        smooth_triangles=read_mended_token(
            mesh.GetTriangleSubdivisionRuleAttr(), context, TRIANGLE_RULES, "catmullClark"
        )
        == "smooth",
    )
    if rules.scheme == "loop" and (cage.counts != 3).any():
        context.notes.add("loop subdivision of faces that are no triangles: catmullClark is used", path)
        rules = Rules("catmullClark", rules.boundary, rules.face_varying, rules.smooth_triangles)
    levels = context.refinement
    while levels and _triangles_after(rules, cage, levels) > TRIANGLES_MAX:
        levels -= 1
    if levels < context.refinement:
        text = (
            f"{context.refinement} levels of subdivision are more than {TRIANGLES_MAX:,} triangles: {levels} are used"
        )
        context.notes.add(text, path)
    creases = read_creases(mesh, cage.n_points, context)
    corners = read_corner_sharpness(mesh, cage.n_points, context)
    if creases and not on_edges(connect(cage), creases)[1].all():
        context.mend("creases along no edge of the mesh; they are left out", path)
    return refine(cage, rules, levels, creases, corners)


def refine(
    cage: Polygons,
    rules: Rules,
    levels: int,
    creases: Iterable[Crease] = (),
    vertex_sharpness: np.ndarray | None = None,
) -> Refinement:
    """Refines a cage uniformly.

    Args:
        cage: the faces.
        rules: how.
        levels: how often each face is split, >= 0.
        creases: pairs of vertices and the sharpness of the edge between them, >= 0.
        vertex_sharpness: (v,), >= 0; None: 0.

    Returns:
        Of 0 levels the cage itself; else vertices of a smooth scheme come to lie on the limit surface.
    """
    net = tagged(connect(cage), rules, creases, vertex_sharpness)
    nets, cage_faces = [net], np.arange(len(cage.counts))
    for _ in range(levels):
        cage_faces = cage_faces[parents(nets[-1], rules)]
        nets.append(child(nets[-1], rules))
    is_smooth = rules.scheme != "bilinear"

    def refined_with(nets: list[Net], smoothly: bool) -> Apply:
        def apply(values: np.ndarray) -> np.ndarray:
            for level, parent in enumerate(nets[:-1]):
                values = refined(parent, rules, smoothly, values, is_cage=level == 0)
            return limits(nets[-1], rules, values) if smoothly and len(nets) > 1 else values

        return apply

    def face_varying(primvar: Primvar) -> np.ndarray:
        first, values = face_varying_net(net, rules, primvar)
        chain = [first]
        for _ in range(levels):
            chain.append(child(chain[-1], rules))
        smoothly = is_smooth and rules.face_varying != "all"
        return refined_with(chain, smoothly)(values)[chain[-1].polygons.indices]

    return Refinement(
        polygons=nets[-1].polygons,
        cage_faces=cage_faces,
        drawn=_drawn_faces(net, rules),
        smooth=refined_with(nets, is_smooth),
        linear=refined_with(nets, smoothly=False),
        face_varying=face_varying,
        net=nets[-1],
        is_smooth=is_smooth,
    )


def _drawn_faces(net: Net, rules: Rules) -> np.ndarray:
    """(f,) bool: without interpolation of the boundary, faces that touch it have no surface."""
    drawn = np.ones(len(net.polygons.counts), dtype=bool)
    if rules.boundary == "none" and rules.scheme != "bilinear":
        on_boundary = np.zeros(net.polygons.n_points, dtype=bool)
        on_boundary[net.ends[net.edge_faces == 1]] = True
        drawn[net.face_of_corner[on_boundary[net.polygons.indices]]] = False
    return drawn


def _triangles_after(rules: Rules, cage: Polygons, levels: int) -> int:
    if rules.scheme == "loop":
        return len(cage.counts) * 4**levels
    return len(cage.indices) * 4 ** (levels - 1) * 2
