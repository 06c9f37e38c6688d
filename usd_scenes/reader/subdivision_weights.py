"""Where subdivision takes values at the vertices of a net: after one split, and in the limit.

Catmull and Clark 1978 and Loop 1987, with the sharp and semi-sharp creases of DeRose, Kass and Truong 1998.
"""

from __future__ import annotations

import numpy as np

from usd_scenes.reader.subdivision_net import Net, Rules, decremented, sums

SMOOTH_TRIANGLE_WEIGHT = 0.470
"""Of a triangle's face point in the new point of its edge, for the triangle rule ``smooth`` (OpenSubdiv)."""


def refined(net: Net, rules: Rules, smoothly: bool, values: np.ndarray, is_cage: bool) -> np.ndarray:
    """The values after one split.

    Args:
        net: of the values.
        rules: how it is split.
        smoothly: False for values that are linear between vertices.
        values: (v, k).
        is_cage: True for the first split, in which triangles of the cage may have a rule of their own.

    Returns:
        (child vertices, k), in the order of `subdivision_net.child`.
    """
    corner_values = values[net.polygons.indices]
    face_values = sums(net.face_of_corner, corner_values, len(net.polygons.counts))
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
    faces = sums(net.polygons.indices, face_values[net.face_of_corner], len(values))
    return ((n - 2) * values + (net.around_vertices(values) + faces) / n) / n


def _catmull_clark_edges(net: Net, middles: np.ndarray, face_values: np.ndarray, smooth_triangles: bool) -> np.ndarray:
    faces = sums(net.edge_of_corner, face_values[net.face_of_corner], len(net.ends))
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
    return middles * 3 / 4 + sums(net.edge_of_corner, opposite, len(net.ends)) / 8


def _loop_weight(n: np.ndarray) -> np.ndarray:
    """Of each neighbour in the new place of a vertex with n edges (Loop 1987)."""
    return (5 / 8 - (3 / 8 + np.cos(2 * np.pi / n) / 4) ** 2) / n


def limits(net: Net, rules: Rules, values: np.ndarray) -> np.ndarray:
    """(v, k), where further refinement takes the vertices (Halstead et al. 1993; Loop 1987)."""
    n = np.maximum(net.valence, 1)[:, None]
    around = net.around_vertices(values)
    if rules.scheme == "loop":
        weight = 3 / (8 * _loop_weight(n))
        smooth = (weight * values + around) / (weight + n)
    else:
        opposite = net.polygons.indices[net.next_corner[net.next_corner]]
        across = sums(net.polygons.indices, values[opposite], len(values))
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
    child_edges, child_vertices = decremented(net.edge_sharpness), decremented(net.vertex_sharpness)
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
    along = sums(ends[:, 0], values[ends[:, 1]], len(values)) + sums(ends[:, 1], values[ends[:, 0]], len(values))
    result[on_crease] = (1 - 2 * weight) * values[on_crease] + weight * along[on_crease]
    return result


def _mixed(sharpness: np.ndarray, sharp: np.ndarray, smooth: np.ndarray) -> np.ndarray:
    share = np.minimum(sharpness, 1)[:, None]
    return share * sharp + (1 - share) * smooth
