"""Subdivision surfaces: uniform refinement of a control cage, and its vertices' limits.

Catmull and Clark 1978 and Loop 1987, with the sharp and semi-sharp creases of DeRose, Kass and Truong 1998, in the
rules of OpenSubdiv, which USD refers to. The last vertices are moved to where further refinement would take them, so
a refined mesh touches the limit surface in all of its vertices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pxr import UsdGeom
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from usd_scenes.reader.attributes import read_mended_token
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.creases import read_corner_sharpness, read_creases
from usd_scenes.reader.primvars import Polygons, Primvar

TRIANGLES_MAX = 2_000_000
"""More than these no mesh is refined to."""
INFINITE_SHARPNESS = 10.0
"""From here on a crease never gets smooth, as in OpenSubdiv."""
SMOOTH_TRIANGLE_WEIGHT = 0.470
"""Of a triangle's face point in the new point of its edge, for the triangle rule ``smooth`` (OpenSubdiv)."""

SCHEMES = ("catmullClark", "loop", "bilinear", "none")
BOUNDARIES = ("none", "edgeOnly", "edgeAndCorner")
FACE_VARYING = ("none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all")
TRIANGLE_RULES = ("catmullClark", "smooth")

Apply = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Rules:
    """How a mesh is subdivided.

    Args:
        scheme: ``catmullClark``, ``loop`` or ``bilinear``.
        boundary: interpolateBoundary: ``none``, ``edgeOnly`` or ``edgeAndCorner``.
        face_varying: faceVaryingLinearInterpolation.
        smooth_triangles: the triangle rule ``smooth`` of Catmull-Clark, for triangles of the cage.
    """

    scheme: str
    boundary: str = "edgeAndCorner"
    face_varying: str = "cornersPlus1"
    smooth_triangles: bool = False


@dataclass(frozen=True, eq=False)
class Net:
    """Polygons with their edges, and how sharp these and their vertices are.

    A corner's edge is the one that leaves it to the next corner of its face.

    Args:
        polygons: the faces.
        edge_of_corner: (c,) int.
        ends: (e, 2) int, the vertices of each edge.
        edge_sharpness: (e,) float >= 0.
        vertex_sharpness: (v,) float >= 0.
    """

    polygons: Polygons
    edge_of_corner: np.ndarray
    ends: np.ndarray
    edge_sharpness: np.ndarray
    vertex_sharpness: np.ndarray

    @cached_property
    def next_corner(self) -> np.ndarray:
        """(c,) int, of the same face."""
        counts = self.polygons.counts
        following = np.arange(1, len(self.polygons.indices) + 1)
        filled = counts > 0
        following[np.cumsum(counts)[filled] - 1] = (np.cumsum(counts) - counts)[filled]
        return following

    @cached_property
    def previous_corner(self) -> np.ndarray:
        """(c,) int, of the same face."""
        previous = np.empty_like(self.next_corner)
        previous[self.next_corner] = np.arange(len(previous))
        return previous

    @cached_property
    def face_of_corner(self) -> np.ndarray:
        """(c,) int."""
        return self.polygons.face_of_corner

    @cached_property
    def edge_faces(self) -> np.ndarray:
        """(e,) int, how many faces meet at each edge."""
        return np.bincount(self.edge_of_corner, minlength=len(self.ends))

    @cached_property
    def valence(self) -> np.ndarray:
        """(v,) int, how many edges meet at each vertex."""
        return np.bincount(self.ends.ravel(), minlength=self.polygons.n_points)

    def around_vertices(self, values: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
        """(v, k) sums over the other ends of each vertex's edges, each with the weight of the edge.

        Args:
            values: (v, k), at the vertices.
            weights: (e,), of the edges; None: 1.
        """
        a, b = self.ends.T
        at_a, at_b = values[b], values[a]
        if weights is not None:
            at_a, at_b = at_a * weights[:, None], at_b * weights[:, None]
        return _sums(a, at_a, len(values)) + _sums(b, at_b, len(values))


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
        groups = _smoothing_groups(self.net)[corners]
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
            total += _sums(groups[:, corner], flat * angles[:, None], n_groups)
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
    if creases and not _on_edges(_connect(cage), creases)[1].all():
        context.mend("creases along no edge of the mesh; they are left out", path)
    return refine(cage, rules, levels, creases, corners)


def refine(
    cage: Polygons,
    rules: Rules,
    levels: int,
    creases: Iterable[tuple[int, int, float]] = (),
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
    net = _tagged(_connect(cage), rules, creases, vertex_sharpness)
    nets, cage_faces = [net], np.arange(len(cage.counts))
    for _ in range(levels):
        cage_faces = cage_faces[_parents(nets[-1], rules)]
        nets.append(_child(nets[-1], rules))
    is_smooth = rules.scheme != "bilinear"

    def refined_with(nets: list[Net], smoothly: bool) -> Apply:
        def apply(values: np.ndarray) -> np.ndarray:
            for level, parent in enumerate(nets[:-1]):
                values = _refined(parent, rules, smoothly, values, is_cage=level == 0)
            return _limits(nets[-1], rules, values) if smoothly and len(nets) > 1 else values

        return apply

    def face_varying(primvar: Primvar) -> np.ndarray:
        first, values = _face_varying_net(net, rules, primvar)
        chain = [first]
        for _ in range(levels):
            chain.append(_child(chain[-1], rules))
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


def _connect(polygons: Polygons) -> Net:
    """A net of which nothing is sharp."""
    n = polygons.n_points
    bare = Net(polygons, *(np.empty(0),) * 4)
    starts, stops = polygons.indices, polygons.indices[bare.next_corner]
    keys = np.minimum(starts, stops) * n + np.maximum(starts, stops)
    edges, edge_of_corner = np.unique(keys, return_inverse=True)
    ends = np.stack([edges // n, edges % n], axis=1)
    return Net(polygons, edge_of_corner, ends, np.zeros(len(edges)), np.zeros(n))


def _tagged(
    net: Net, rules: Rules, creases: Iterable[tuple[int, int, float]], vertex_sharpness: np.ndarray | None
) -> Net:
    """The net of a cage with its creases, corners and boundaries."""
    edges = np.where(net.edge_faces == 2, 0.0, INFINITE_SHARPNESS)
    n = net.polygons.n_points
    if listed := list(creases):
        at, is_edge = _on_edges(net, listed)
        np.maximum.at(edges, at[is_edge], np.array([sharpness for _, _, sharpness in listed])[is_edge])
    vertices = np.zeros(n) if vertex_sharpness is None else vertex_sharpness.astype(np.float64)
    if rules.boundary == "edgeAndCorner":
        is_corner = np.bincount(net.polygons.indices, minlength=n) == 1
        vertices = np.where(is_corner, INFINITE_SHARPNESS, vertices)
    return Net(net.polygons, net.edge_of_corner, net.ends, edges, vertices)


def _on_edges(net: Net, creases: Sequence[tuple[int, int, float]]) -> tuple[np.ndarray, np.ndarray]:
    """The edge that each crease is on, and whether there is one."""
    n = net.polygons.n_points
    pairs = np.sort([crease[:2] for crease in creases], axis=1).astype(np.int64)
    keys, asked = net.ends[:, 0] * n + net.ends[:, 1], pairs[:, 0] * n + pairs[:, 1]
    at = np.minimum(np.searchsorted(keys, asked), len(keys) - 1)
    return at, keys[at] == asked


def _drawn_faces(net: Net, rules: Rules) -> np.ndarray:
    """(f,) bool: without interpolation of the boundary, faces that touch it have no surface."""
    drawn = np.ones(len(net.polygons.counts), dtype=bool)
    if rules.boundary == "none" and rules.scheme != "bilinear":
        on_boundary = np.zeros(net.polygons.n_points, dtype=bool)
        on_boundary[net.ends[net.edge_faces == 1]] = True
        drawn[net.face_of_corner[on_boundary[net.polygons.indices]]] = False
    return drawn


def _face_varying_net(net: Net, rules: Rules, primvar: Primvar) -> tuple[Net, np.ndarray]:
    """The net of a primvar's values, which has boundaries where these do not run on across an edge, and the values.

    The values at a vertex of the mesh that share an index are one vertex of it.
    """
    vertices = net.polygons.indices
    indices = np.arange(len(vertices)) if primvar.indices is None else primvar.indices
    n_values = len(primvar.values)
    keys, place = np.unique(vertices * n_values + indices, return_inverse=True)
    owners, values = keys // n_values, primvar.values[keys % n_values]
    own = _connect(Polygons(len(keys), net.polygons.counts, place))
    edges = np.zeros(len(own.ends))
    edges[own.edge_of_corner] = net.edge_sharpness[net.edge_of_corner]
    edges[own.edge_faces != 2] = INFINITE_SHARPNESS

    sharp = np.zeros(len(keys), dtype=bool)
    on_seam = np.zeros(len(keys), dtype=bool)
    on_seam[own.ends[own.edge_faces != 2]] = True
    values_at = np.bincount(owners, minlength=net.polygons.n_points)
    faces_at = np.bincount(place, minlength=len(keys))
    is_corner = on_seam & (faces_at == 1)
    if rules.face_varying == "boundaries":
        sharp = on_seam
    elif rules.face_varying != "none":
        sharp = is_corner
    if rules.face_varying in ("cornersPlus1", "cornersPlus2"):
        sharp = sharp | (on_seam & (values_at[owners] > 2))
    if rules.face_varying == "cornersPlus2":
        at_inner_vertex = np.ones(net.polygons.n_points, dtype=bool)
        at_inner_vertex[net.ends[net.edge_faces != 2]] = False
        is_dart = on_seam & (values_at[owners] == 1) & at_inner_vertex[owners]
        has_corner = np.zeros(net.polygons.n_points, dtype=bool)
        has_corner[owners[is_corner]] = True
        is_concave = on_seam & (values_at[owners] == 2) & has_corner[owners]
        sharp = sharp | is_dart | is_concave
    vertex_sharpness = np.where(sharp, INFINITE_SHARPNESS, net.vertex_sharpness[owners])
    return Net(own.polygons, own.edge_of_corner, own.ends, edges, vertex_sharpness), values


def _parents(net: Net, rules: Rules) -> np.ndarray:
    """(child faces,) int, the faces that they are pieces of."""
    if rules.scheme == "loop":
        return np.concatenate([net.face_of_corner, np.arange(len(net.polygons.counts))])
    return net.face_of_corner


def _child(net: Net, rules: Rules) -> Net:
    """The net after one split; its vertices are those of `net`, then its edges', then, but for Loop, its faces'."""
    n, n_edges, n_faces = net.polygons.n_points, len(net.ends), len(net.polygons.counts)
    corners = np.arange(len(net.polygons.indices))
    vertex, edge, edge_before = net.polygons.indices, net.edge_of_corner, net.edge_of_corner[net.previous_corner]
    halves = np.stack([net.ends.ravel(), n + np.repeat(np.arange(n_edges), 2)], axis=1)
    half, half_before = (2 * e + (net.ends[e, 0] != vertex) for e in (edge, edge_before))
    inner = 2 * n_edges + corners
    if rules.scheme == "loop":
        # In each corner a triangle, then one in the middle; the inner edges cut the corners off.
        middle = corners.reshape(-1, 3)
        indices = np.concatenate(
            [np.stack([vertex, n + edge, n + edge_before], axis=1), n + net.edge_of_corner[middle]]
        )
        edges = np.concatenate(
            [np.stack([half, inner, half_before], axis=1), inner[net.next_corner[middle.ravel()].reshape(-1, 3)]]
        )
        inner_ends = np.stack([n + edge, n + edge_before], axis=1)
        n_points = n + n_edges
    else:
        # In each corner a quad; the inner edges join the edges' points with the face's.
        center = n + n_edges + net.face_of_corner
        indices = np.stack([vertex, n + edge, center, n + edge_before], axis=1)
        edges = np.stack([half, inner, inner[net.previous_corner], half_before], axis=1)
        inner_ends = np.stack([n + edge, center], axis=1)
        n_points = n + n_edges + n_faces
    sharpness = np.repeat(_decremented(net.edge_sharpness), 2)
    return Net(
        Polygons(n_points, np.full(len(indices), indices.shape[1]), indices.ravel()),
        edges.ravel(),
        np.concatenate([halves, inner_ends]),
        np.concatenate([sharpness, np.zeros(len(corners))]),
        np.concatenate([_decremented(net.vertex_sharpness), np.zeros(n_points - n)]),
    )


def _refined(net: Net, rules: Rules, smoothly: bool, values: np.ndarray, is_cage: bool) -> np.ndarray:
    """(child vertices, k) of (v, k)."""
    corner_values = values[net.polygons.indices]
    face_values = _sums(net.face_of_corner, corner_values, len(net.polygons.counts))
    face_values /= np.maximum(net.polygons.counts, 1)[:, None]
    middles = (values[net.ends[:, 0]] + values[net.ends[:, 1]]) / 2
    if not smoothly:
        new = [values, middles]
    elif rules.scheme == "loop":
        new = [
            _blended(net, values, _loop_vertices(net, values)),
            _mixed(net.edge_sharpness, middles, _loop_edges(net, values, middles)),
        ]
    else:
        smooth_triangles = rules.smooth_triangles and is_cage
        new = [
            _blended(net, values, _catmull_clark_vertices(net, values, face_values)),
            _mixed(net.edge_sharpness, middles, _catmull_clark_edges(net, middles, face_values, smooth_triangles)),
        ]
    return np.concatenate(new if rules.scheme == "loop" else [*new, face_values])


def _catmull_clark_vertices(net: Net, values: np.ndarray, face_values: np.ndarray) -> np.ndarray:
    n = np.maximum(net.valence, 1)[:, None]
    faces = _sums(net.polygons.indices, face_values[net.face_of_corner], len(values))
    return ((n - 2) * values + (net.around_vertices(values) + faces) / n) / n


def _catmull_clark_edges(net: Net, middles: np.ndarray, face_values: np.ndarray, smooth_triangles: bool) -> np.ndarray:
    faces = _sums(net.edge_of_corner, face_values[net.face_of_corner], len(net.ends))
    if not smooth_triangles:
        return middles / 2 + faces / 4
    weights = np.where(net.polygons.counts == 3, SMOOTH_TRIANGLE_WEIGHT, 0.25)[net.face_of_corner]
    weight = np.bincount(net.edge_of_corner, weights, minlength=len(net.ends))[:, None] / 2
    return (1 - 2 * weight) * middles + weight * faces


def _loop_vertices(net: Net, values: np.ndarray) -> np.ndarray:
    n = np.maximum(net.valence, 1)[:, None]
    weight = _loop_weight(n)
    return (1 - n * weight) * values + weight * net.around_vertices(values)


def _loop_edges(net: Net, values: np.ndarray, middles: np.ndarray) -> np.ndarray:
    opposite = values[net.polygons.indices[net.previous_corner]]
    return middles * 3 / 4 + _sums(net.edge_of_corner, opposite, len(net.ends)) / 8


def _loop_weight(n: np.ndarray) -> np.ndarray:
    """Of each neighbour in the new place of a vertex with n edges (Loop 1987)."""
    return (5 / 8 - (3 / 8 + np.cos(2 * np.pi / n) / 4) ** 2) / n


def _limits(net: Net, rules: Rules, values: np.ndarray) -> np.ndarray:
    """(v, k), where further refinement takes the vertices (Halstead et al. 1993; Loop 1987)."""
    n = np.maximum(net.valence, 1)[:, None]
    around = net.around_vertices(values)
    if rules.scheme == "loop":
        weight = 3 / (8 * _loop_weight(n))
        smooth = (weight * values + around) / (weight + n)
    else:
        opposite = net.polygons.indices[net.next_corner[net.next_corner]]
        across = _sums(net.polygons.indices, values[opposite], len(values))
        smooth = (n**2 * values + 4 * around + across) / (n * (n + 5))
    return _blended(net, values, smooth, crease_weight=1 / 6)


def _blended(net: Net, values: np.ndarray, smooth: np.ndarray, crease_weight: float = 1 / 8) -> np.ndarray:
    """(v, k), smooth or as the creases and corners want it, or between these where they end within this level.

    Args:
        net: the mesh.
        values: (v, k), as they are.
        smooth: (v, k), by the smooth rule.
        crease_weight: of either neighbour along a crease.
    """
    if not (net.edge_sharpness.any() or net.vertex_sharpness.any()):
        return smooth
    child_edges, child_vertices = _decremented(net.edge_sharpness), _decremented(net.vertex_sharpness)
    now = _by_rule(net, values, smooth, net.edge_sharpness > 0, net.vertex_sharpness > 0, crease_weight)
    later = _by_rule(net, values, smooth, child_edges > 0, child_vertices > 0, crease_weight)
    # Of what ends within this level, the mean sharpness is the share of the rule that still holds.
    ending_edges = (net.edge_sharpness > 0) & (child_edges == 0)
    ending_vertices = (net.vertex_sharpness > 0) & (child_vertices == 0)
    ends = net.ends[ending_edges].ravel()
    count = np.bincount(ends, minlength=len(values)) + ending_vertices
    total = np.bincount(ends, np.repeat(net.edge_sharpness[ending_edges], 2), minlength=len(values))
    total = total + np.where(ending_vertices, net.vertex_sharpness, 0)
    share = np.where(count > 0, np.minimum(total / np.maximum(count, 1), 1), 1)[:, None]
    return share * now + (1 - share) * later


def _by_rule(
    net: Net, values: np.ndarray, smooth: np.ndarray, sharp_edges: np.ndarray, sharp: np.ndarray, weight: float
) -> np.ndarray:
    ends = net.ends[sharp_edges]
    n_sharp = np.bincount(ends.ravel(), minlength=len(values))
    on_crease = (n_sharp == 2) & ~sharp
    result = np.where((sharp | (n_sharp > 2))[:, None], values, smooth)
    along = _sums(ends[:, 0], values[ends[:, 1]], len(values)) + _sums(ends[:, 1], values[ends[:, 0]], len(values))
    result[on_crease] = (1 - 2 * weight) * values[on_crease] + weight * along[on_crease]
    return result


def _mixed(sharpness: np.ndarray, sharp: np.ndarray, smooth: np.ndarray) -> np.ndarray:
    share = np.minimum(sharpness, 1)[:, None]
    return share * sharp + (1 - share) * smooth


def _decremented(sharpness: np.ndarray) -> np.ndarray:
    return np.where(sharpness >= INFINITE_SHARPNESS, sharpness, np.maximum(sharpness - 1, 0))


def _sums(places: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """(count, k), the rows of `values` summed where their `places` agree."""
    return np.stack([np.bincount(places, column, minlength=count) for column in values.T], axis=1)


def _smoothing_groups(net: Net) -> np.ndarray:
    """(c,) int, equal for corners that share a normal: of one vertex, and not parted by edges that stay sharp."""
    groups = net.polygons.indices.copy()
    is_sharp = (net.edge_sharpness >= INFINITE_SHARPNESS) & (net.edge_faces > 1)
    if not is_sharp.any():
        return groups
    parted = np.zeros(net.polygons.n_points, dtype=bool)
    parted[net.ends[is_sharp]] = True
    at_parted = np.flatnonzero(parted[groups])
    # Every corner there starts as a group of its own; across a smooth edge two of one vertex are joined.
    labels = np.full(len(groups), -1)
    labels[at_parted] = np.arange(len(at_parted))
    smooth_edges = ~is_sharp[net.edge_of_corner]
    order = np.argsort(net.edge_of_corner, kind="stable")
    first, second = order[:-1], order[1:]
    same = (net.edge_of_corner[first] == net.edge_of_corner[second]) & smooth_edges[first]
    first, second = first[same], second[same]
    pairs = []
    for ours in (first, net.next_corner[first]):
        for theirs in (second, net.next_corner[second]):
            meet = (net.polygons.indices[ours] == net.polygons.indices[theirs]) & (labels[ours] >= 0)
            pairs.append(np.stack([ours[meet], theirs[meet]]))
    a, b = labels[np.concatenate(pairs, axis=1)]
    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(len(at_parted),) * 2)
    _, components = connected_components(graph, directed=False)
    groups[at_parted] = net.polygons.n_points + components
    return groups


def _triangles_after(rules: Rules, cage: Polygons, levels: int) -> int:
    if rules.scheme == "loop":
        return len(cage.counts) * 4**levels
    return len(cage.indices) * 4 ** (levels - 1) * 2
