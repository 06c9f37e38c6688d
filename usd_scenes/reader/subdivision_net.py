"""The net of a subdivision surface: polygons with their edges, and how one is split into the next."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from usd_scenes.reader.creases import Crease
from usd_scenes.reader.primvars import Polygons, Primvar

INFINITE_SHARPNESS = 10.0
"""From here on a crease never gets smooth, as in OpenSubdiv."""


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
        return sums(a, at_a, len(values)) + sums(b, at_b, len(values))


def connect(polygons: Polygons) -> Net:
    """A net of which nothing is sharp."""
    n = polygons.n_points
    bare = Net(polygons, *(np.empty(0),) * 4)
    starts, stops = polygons.indices, polygons.indices[bare.next_corner]
    keys = np.minimum(starts, stops) * n + np.maximum(starts, stops)
    edges, edge_of_corner = np.unique(keys, return_inverse=True)
    ends = np.stack([edges // n, edges % n], axis=1)
    return Net(polygons, edge_of_corner, ends, np.zeros(len(edges)), np.zeros(n))


def tagged(net: Net, rules: Rules, creases: Iterable[Crease], vertex_sharpness: np.ndarray | None) -> Net:
    """The net of a cage with its creases, corners and boundaries.

    Args:
        net: of the cage, of which nothing is sharp.
        rules: what becomes of the boundary.
        creases: of the cage; what is along none of its edges counts for nothing.
        vertex_sharpness: (v,), >= 0; None: 0.
    """
    edges = np.where(net.edge_faces == 2, 0.0, INFINITE_SHARPNESS)
    n = net.polygons.n_points
    if listed := list(creases):
        at, is_edge = on_edges(net, listed)
        np.maximum.at(edges, at[is_edge], np.array([sharpness for _, _, sharpness in listed])[is_edge])
    vertices = np.zeros(n) if vertex_sharpness is None else vertex_sharpness.astype(np.float64)
    if rules.boundary == "edgeAndCorner":
        is_corner = np.bincount(net.polygons.indices, minlength=n) == 1
        vertices = np.where(is_corner, INFINITE_SHARPNESS, vertices)
    return Net(net.polygons, net.edge_of_corner, net.ends, edges, vertices)


def on_edges(net: Net, creases: Sequence[Crease]) -> tuple[np.ndarray, np.ndarray]:
    """The edge that each crease is on, and whether there is one.

    Returns:
        (n,) int places in `Net.ends`, of no meaning where there is none, and (n,) bool.
    """
    n = net.polygons.n_points
    pairs = np.sort([crease[:2] for crease in creases], axis=1).astype(np.int64)
    keys, asked = net.ends[:, 0] * n + net.ends[:, 1], pairs[:, 0] * n + pairs[:, 1]
    at = np.minimum(np.searchsorted(keys, asked), len(keys) - 1)
    return at, keys[at] == asked


def face_varying_net(net: Net, rules: Rules, primvar: Primvar) -> tuple[Net, np.ndarray]:
    """The net of a primvar's values, which has boundaries where these do not run on across an edge, and the values.

    The values at a vertex of the mesh that share an index are one vertex of it.

    Returns:
        The net, of n vertices and the faces of the mesh, and (n, k) values at its vertices.
    """
    vertices = net.polygons.indices
    indices = np.arange(len(vertices)) if primvar.indices is None else primvar.indices
    n_values = len(primvar.values)
    keys, place = np.unique(vertices * n_values + indices, return_inverse=True)
    owners, values = keys // n_values, primvar.values[keys % n_values]
    own = connect(Polygons(len(keys), net.polygons.counts, place))
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


def parents(net: Net, rules: Rules) -> np.ndarray:
    """(child faces,) int, the faces that they are pieces of."""
    if rules.scheme == "loop":
        return np.concatenate([net.face_of_corner, np.arange(len(net.polygons.counts))])
    return net.face_of_corner


def child(net: Net, rules: Rules) -> Net:
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
    sharpness = np.repeat(decremented(net.edge_sharpness), 2)
    return Net(
        Polygons(n_points, np.full(len(indices), indices.shape[1]), indices.ravel()),
        edges.ravel(),
        np.concatenate([halves, inner_ends]),
        np.concatenate([sharpness, np.zeros(len(corners))]),
        np.concatenate([decremented(net.vertex_sharpness), np.zeros(n_points - n)]),
    )


def smoothing_groups(net: Net) -> np.ndarray:
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


def decremented(sharpness: np.ndarray) -> np.ndarray:
    """Sharpness, >= 0, on the next net: less by 1, but for what never gets smooth."""
    return np.where(sharpness >= INFINITE_SHARPNESS, sharpness, np.maximum(sharpness - 1, 0))


def sums(places: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """(count, k), the rows of `values` summed where their `places` agree.

    Args:
        places: (n,) int in [0, count).
        values: (n, k).
        count: of places.
    """
    return np.stack([np.bincount(places, column, minlength=count) for column in values.T], axis=1)
