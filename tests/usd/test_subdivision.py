"""Subdivision surfaces against closed forms of their limits."""

from __future__ import annotations

import numpy as np
import pytest

from fgf_warp.errors import SceneError
from fgf_warp.scene import count_open_edges
from usd_scenes.reader.primvars import Polygons, Primvar
from usd_scenes.reader.subdivision import Rules, refine
from usd_scenes.reader.triangulation import cut_faces, signed_volume

CUBE_POINTS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
CUBE_QUADS = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
CUBE = Polygons(8, np.full(6, 4), CUBE_QUADS.ravel())
OCTAHEDRON_POINTS = np.concatenate([np.eye(3), -np.eye(3)])
OCTAHEDRON = Polygons(
    6,
    np.full(8, 3),
    np.array([(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]).ravel(),
)
TOP_EDGES = [(1, 3), (3, 7), (7, 5), (5, 1)]
"""Around the cube's face z = 1."""
CATMULL_CLARK, LOOP, BILINEAR = Rules("catmullClark"), Rules("loop"), Rules("bilinear")


def grid(n: int) -> tuple[np.ndarray, Polygons]:
    """n x n quads on [0, n]^2, with heights that vary."""
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    points = np.stack([x, y, np.sin(x) * np.cos(2 * y) + 0.3 * x * y], axis=-1).reshape(-1, 3)
    i, j = (index.ravel() for index in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    corner = i * (n + 1) + j
    quads = np.stack([corner, corner + n + 1, corner + n + 2, corner + 1], axis=1)
    return points, Polygons(len(points), np.full(len(quads), 4), quads.ravel())


def volume(points: np.ndarray, polygons: Polygons) -> float:
    return signed_volume(points, polygons.indices[cut_faces(points, polygons.counts, polygons.indices)])


@pytest.mark.parametrize("levels", [1, 2, 4])
def test_the_cubes_corners_go_to_their_limit(levels: int) -> None:
    # One step of Catmull-Clark takes the cube's corners to 5/9 (n = 3: face mean 1/3, edge mean 2/3), edge points to
    # 3/4 and face points to 1; the limit stencil (n^2 V + 4 sum E + sum F) / (n (n + 5)) of these is 1/2.
    limit = refine(CUBE, CATMULL_CLARK, levels).smooth(CUBE_POINTS)
    np.testing.assert_allclose(limit[:8], CUBE_POINTS / 2, atol=1e-12)


def test_the_cubes_face_middles_go_to_their_limit() -> None:
    # A face point is regular (valence 4): itself (0, 0, 1), edge points (3/4, 0, 3/4) and corners 5/9 around it.
    limit = refine(CUBE, CATMULL_CLARK, 1).smooth(CUBE_POINTS)
    expected = (16 * 1 + 4 * 4 * 3 / 4 + 4 * 5 / 9) / 36
    middles = limit[8 + 12 :]
    assert sorted(np.linalg.norm(middles, axis=1)) == pytest.approx([expected] * 6)
    np.testing.assert_allclose(np.abs(middles).max(axis=1), expected)


@pytest.mark.parametrize("levels", [1, 3])
def test_loop_takes_the_octahedrons_corners_to_their_limit(levels: int) -> None:
    # Valence 4: weight of a neighbour w = (5/8 - (3/8 + cos(pi/2) / 4)^2) / 4 = 31/256; the limit weighs the vertex
    # by 3 / (8 w) against 1 for each neighbour, and those four cancel.
    weight = 31 / 256
    limit = refine(OCTAHEDRON, LOOP, levels).smooth(OCTAHEDRON_POINTS)
    expected = (3 / (8 * weight)) / (3 / (8 * weight) + 4)
    np.testing.assert_allclose(limit[:6], OCTAHEDRON_POINTS * expected, atol=1e-12)


def test_inside_a_regular_grid_the_limit_is_the_cubic_b_spline() -> None:
    points, polygons = grid(6)
    limit = refine(polygons, CATMULL_CLARK, 1).smooth(points)
    weights = np.array([1, 4, 1]) / 6
    at = points.reshape(7, 7, 3)
    expected = np.einsum("i,j,ijk->k", weights, weights, at[2:5, 2:5])
    np.testing.assert_allclose(limit[3 * 7 + 3], expected, atol=1e-12)


def test_the_boundary_is_a_cubic_b_spline_whatever_lies_inside() -> None:
    points, polygons = grid(6)
    limit = refine(polygons, CATMULL_CLARK, 2).smooth(points)
    np.testing.assert_allclose(limit[3], (points[2] + 4 * points[3] + points[4]) / 6, atol=1e-12)


@pytest.mark.parametrize(("boundary", "is_pinned"), [("edgeAndCorner", True), ("edgeOnly", False)])
def test_corners_of_the_boundary(boundary: str, is_pinned: bool) -> None:
    points, polygons = grid(4)
    limit = refine(polygons, Rules("catmullClark", boundary=boundary), 2).smooth(points)
    rounded = (4 * points[0] + points[1] + points[5]) / 6
    np.testing.assert_allclose(limit[0], points[0] if is_pinned else rounded, atol=1e-12)


def test_without_interpolation_faces_at_the_boundary_are_not_drawn() -> None:
    _, polygons = grid(4)
    drawn = refine(polygons, Rules("catmullClark", boundary="none"), 1).drawn
    np.testing.assert_array_equal(np.flatnonzero(drawn), [5, 6, 9, 10])


@pytest.mark.parametrize("scheme", ["catmullClark", "loop"])
def test_an_infinitely_sharp_crease_is_a_cubic_b_spline(scheme: str) -> None:
    if scheme == "catmullClark":
        creases = [(a, b, 10.0) for a, b in TOP_EDGES]
        limit = refine(CUBE, CATMULL_CLARK, 3, creases).smooth(CUBE_POINTS)
        a, b, c = CUBE_POINTS[[1, 3, 7]]
        np.testing.assert_allclose(limit[3], (a + 4 * b + c) / 6, atol=1e-12)
    else:
        ring = [0, 1, 3, 4]
        creases = [(ring[i], ring[(i + 1) % 4], 12.0) for i in range(4)]
        limit = refine(OCTAHEDRON, LOOP, 3, creases).smooth(OCTAHEDRON_POINTS)
        a, b, c = OCTAHEDRON_POINTS[[0, 1, 3]]
        np.testing.assert_allclose(limit[1], (a + 4 * b + c) / 6, atol=1e-12)


def test_a_semi_sharp_crease_first_is_sharp_and_then_smooth() -> None:
    """Sharpness 1 is one sharp step and smooth ones after it: DeRose et al. 1998, section 3."""
    creases = [(a, b, 1.0) for a, b in TOP_EDGES]
    once = refine(CUBE, CATMULL_CLARK, 1, creases).net.polygons
    limit = refine(CUBE, CATMULL_CLARK, 3, creases).smooth(CUBE_POINTS)
    smoothly = refine(once, CATMULL_CLARK, 2).smooth(_one_step(creases))
    np.testing.assert_allclose(limit[: once.n_points], smoothly[: once.n_points], atol=1e-12)


def _one_step(creases: list) -> np.ndarray:
    """The cube after one step with the top's edges sharp, by hand."""
    points, edges = CUBE_POINTS, [tuple(edge) for edge in refine(CUBE, CATMULL_CLARK, 0).net.ends]
    faces = points[CUBE_QUADS].mean(axis=1)
    sharp = {tuple(sorted(edge[:2])) for edge in creases}
    new = []
    for vertex in range(8):
        around = [edge for edge in edges if vertex in edge]
        others = [points[edge[0] + edge[1] - vertex] for edge in around]
        creased = [other for edge, other in zip(around, others, strict=True) if edge in sharp]
        at = [face for face, quad in zip(faces, CUBE_QUADS, strict=True) if vertex in quad]
        smooth = points[vertex] / 3 + sum(others) / 9 + sum(at) / 9
        new.append(0.75 * points[vertex] + sum(creased) / 8 if len(creased) == 2 else smooth)
    for a, b in edges:
        middle = (points[a] + points[b]) / 2
        at = [face for face, quad in zip(faces, CUBE_QUADS, strict=True) if a in quad and b in quad]
        new.append(middle if (a, b) in sharp else middle / 2 + sum(at) / 4)
    return np.array([*new, *faces])


def test_sharpness_between_whole_numbers_lies_between_the_surfaces() -> None:
    def corner(sharpness: float) -> np.ndarray:
        return refine(CUBE, CATMULL_CLARK, 3, [(a, b, sharpness) for a, b in TOP_EDGES]).smooth(CUBE_POINTS)[3]

    np.testing.assert_allclose(corner(0.25), 0.75 * corner(0) + 0.25 * corner(1), atol=1e-12)
    heights = [corner(sharpness)[2] for sharpness in (0, 0.5, 1, 1.5, 2, 3, 10)]
    assert heights == sorted(heights)


def test_sharp_corners_stay() -> None:
    sharp = np.zeros(8)
    sharp[7] = 10
    limit = refine(CUBE, CATMULL_CLARK, 3, (), sharp).smooth(CUBE_POINTS)
    np.testing.assert_allclose(limit[7], CUBE_POINTS[7])
    assert np.linalg.norm(limit[0]) < np.linalg.norm(CUBE_POINTS[0])


@pytest.mark.parametrize(
    ("polygons", "points", "rules"), [(CUBE, CUBE_POINTS, CATMULL_CLARK), (OCTAHEDRON, OCTAHEDRON_POINTS, LOOP)]
)
def test_volumes_converge_with_the_square_of_the_edges(polygons, points, rules) -> None:
    volumes = []
    for levels in range(2, 6):
        refined = refine(polygons, rules, levels)
        volumes.append(volume(refined.smooth(points), refined.polygons))
    steps = np.diff(volumes)
    np.testing.assert_allclose(steps[:-1] / steps[1:], 4, rtol=0.06)
    np.testing.assert_allclose(steps[-2] / steps[-1], 4, rtol=0.02)


def test_bilinear_keeps_the_surface_and_splits_it() -> None:
    refined = refine(CUBE, BILINEAR, 2)
    points = refined.smooth(CUBE_POINTS)
    assert len(refined.polygons.counts) == 6 * 16
    np.testing.assert_allclose(np.abs(points).max(axis=1), 1)
    assert volume(points, refined.polygons) == pytest.approx(8)
    assert refined.normals(points, np.arange(12).reshape(4, 3)) is None


def test_smooth_triangles_weigh_their_faces_more() -> None:
    plain = refine(OCTAHEDRON, CATMULL_CLARK, 2).smooth(OCTAHEDRON_POINTS)
    smooth = refine(OCTAHEDRON, Rules("catmullClark", smooth_triangles=True), 2).smooth(OCTAHEDRON_POINTS)
    lengths = [np.linalg.norm(points, axis=1) for points in (plain, smooth)]
    # Rounder: the new edge points have 0.47 of either face instead of 0.25.
    assert np.ptp(lengths[1]) < np.ptp(lengths[0])


@pytest.mark.parametrize("levels", [0, 1, 3])
@pytest.mark.parametrize(
    ("polygons", "points", "rules"), [(CUBE, CUBE_POINTS, CATMULL_CLARK), (OCTAHEDRON, OCTAHEDRON_POINTS, LOOP)]
)
def test_refined_meshes_are_closed_and_face_outwards(levels: int, polygons, points, rules) -> None:
    refined = refine(polygons, rules, levels)
    places = refined.smooth(points)
    corners = cut_faces(places, refined.polygons.counts, refined.polygons.indices)
    triangles = refined.polygons.indices[corners]
    assert count_open_edges(places, triangles) == 0
    assert signed_volume(places, triangles) > 0
    normals = refined.normals(places, corners)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-6)
    assert np.einsum("mck,mck->mc", normals, places[triangles]).min() > 0
    # Corners of one vertex share their normal.
    first = np.zeros((len(places), 3))
    first[triangles] = normals
    np.testing.assert_allclose(first[triangles], normals, atol=1e-6)


def test_normals_of_a_grid_are_those_of_its_spline() -> None:
    n = 12
    points, polygons = grid(n)
    points[:, 2] = 0.05 * (points[:, 0] ** 2 - points[:, 1] ** 2)
    refined = refine(polygons, CATMULL_CLARK, 3)
    places = refined.smooth(points)
    corners = cut_faces(places, refined.polygons.counts, refined.polygons.indices)
    normals, at = refined.normals(places, corners), places[refined.polygons.indices[corners]]
    # Cubic splines reproduce the slopes of a quadratic.
    expected = np.stack([-0.1 * at[..., 0], 0.1 * at[..., 1], np.ones(at.shape[:-1])], axis=-1)
    expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
    inside = ((at[..., :2] > 2) & (at[..., :2] < n - 2)).all(axis=(1, 2))
    assert inside.sum() > 1000
    np.testing.assert_allclose(normals[inside], expected[inside], atol=1e-3)


def test_normals_are_parted_at_edges_that_stay_sharp() -> None:
    creases = [(a, b, 10.0) for a, b in TOP_EDGES]
    refined = refine(CUBE, CATMULL_CLARK, 3, creases)
    places = refined.smooth(CUBE_POINTS)
    corners = cut_faces(places, refined.polygons.counts, refined.polygons.indices)
    normals = refined.normals(places, corners)
    at_corner = normals[refined.polygons.indices[corners] == 3]
    groups = np.unique(at_corner.round(4), axis=0)
    assert len(groups) == 2
    assert groups[:, 2].max() == pytest.approx(1, abs=1e-3)  # The top's outline, and so the top, is flat.


class TestPrimvars:
    """Values on the cage come to where the surface is."""

    def test_vertex_values_follow_the_points(self) -> None:
        refined = refine(CUBE, CATMULL_CLARK, 2)
        carried = refined.carry(Primvar(CUBE_POINTS, "vertex"))
        np.testing.assert_allclose(carried.values, refined.smooth(CUBE_POINTS))

    def test_varying_values_are_linear(self) -> None:
        points, polygons = grid(3)
        refined = refine(polygons, CATMULL_CLARK, 2)
        carried = refined.carry(Primvar(points[:, :2], "varying")).values
        assert (carried * 4 == np.round(carried * 4)).all()

    def test_uniform_values_go_to_the_pieces(self) -> None:
        refined = refine(CUBE, CATMULL_CLARK, 2)
        carried = refined.carry(Primvar(np.arange(6.0)[:, None], "uniform"))
        np.testing.assert_array_equal(np.bincount(carried.values[:, 0].astype(int)), [16] * 6)
        centers = refine(CUBE, BILINEAR, 2)
        middles = centers.smooth(CUBE_POINTS)[centers.polygons.indices.reshape(-1, 4)].mean(axis=1)
        for face in range(6):
            axis, side = [(0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1)][face]
            np.testing.assert_allclose(middles[centers.cage_faces == face, axis], side)

    @pytest.mark.parametrize("rule", ["none", "cornersOnly", "cornersPlus1", "cornersPlus2", "boundaries", "all"])
    def test_values_at_corners_without_seams_are_those_of_vertices(self, rule: str) -> None:
        refined = refine(CUBE, Rules("catmullClark", face_varying=rule), 2)
        carried = refined.carry(Primvar(CUBE_POINTS, "faceVarying", CUBE.indices)).values
        linear = rule == "all"
        expected = (refined.linear if linear else refined.smooth)(CUBE_POINTS)
        np.testing.assert_allclose(carried, expected[refined.polygons.indices], atol=1e-12)

    def test_values_of_faces_alone_are_linear_unless_their_corners_may_move(self) -> None:
        values = np.tile([(0.0, 0.0), (1, 0), (1, 1), (0, 1)], (6, 1))
        for rule, is_linear in (("none", False), ("cornersOnly", True), ("boundaries", True), ("all", True)):
            refined = refine(CUBE, Rules("catmullClark", face_varying=rule), 2)
            carried = refined.carry(Primvar(values, "faceVarying")).values
            at_quarters = np.isclose(carried * 4, np.round(carried * 4)).all()
            assert at_quarters == is_linear, rule

    def test_seams_between_two_islands_are_smooth_curves_or_linear(self) -> None:
        points, polygons = grid(4)
        right = points[polygons.indices.reshape(-1, 4)][..., 0].mean(axis=1) > 2
        bent = points[:, :2] + np.stack([np.zeros(25), points[:, 0] ** 2], axis=1)
        both = np.concatenate([bent, bent + 10])
        indices = (polygons.indices.reshape(-1, 4) + 25 * right[:, None]).ravel()
        seam = {}
        for rule in ("cornersPlus1", "boundaries"):
            refined = refine(polygons, Rules("catmullClark", face_varying=rule), 1)
            carried = refined.carry(Primvar(both, "faceVarying", indices)).values
            on_seam = (refined.polygons.indices == 12) & ~right[refined.cage_faces].repeat(4)
            seam[rule] = carried[on_seam]
        np.testing.assert_allclose(seam["boundaries"], np.broadcast_to(bent[12], seam["boundaries"].shape))
        curve = (bent[11] + 4 * bent[12] + bent[13]) / 6
        np.testing.assert_allclose(seam["cornersPlus1"], np.broadcast_to(curve, seam["cornersPlus1"].shape))


QUAD = """def Mesh "M"
{
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
"""


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("int[] creaseIndices = [0, 1]\nint[] creaseLengths = [3]\nfloat[] creaseSharpnesses = [1]", "creaseLengths"),
        ("int[] creaseIndices = [0, 4]\nint[] creaseLengths = [2]\nfloat[] creaseSharpnesses = [1]", "creaseIndices"),
        ("int[] creaseIndices = [0, 1]\nint[] creaseLengths = [2]\nfloat[] creaseSharpnesses = [-1]", "holds -1"),
        ("int[] creaseIndices = [0, 1, 2, 3]\nint[] creaseLengths = [4]\nfloat[] creaseSharpnesses = [1, 1]", "1 or 3"),
        ("int[] cornerIndices = [0]\nfloat[] cornerSharpnesses = [1, 2]", "cornerSharpnesses has 2"),
        ("int[] cornerIndices = [9]\nfloat[] cornerSharpnesses = [1]", r"cornerIndices spans \[9, 9\]"),
    ],
)
def test_creases_that_do_not_fit_are_left_out(read, lines: str, message: str) -> None:
    with pytest.raises(SceneError, match=rf"/M\..*{message}|/M\.{message}"):
        read(QUAD + lines + "\n}", strict=True)
    mended, smooth = read(QUAD + lines + "\n}"), read(QUAD + "}")
    np.testing.assert_array_equal(mended.scene.shapes[0].points, smooth.scene.shapes[0].points)
    assert len(mended.warnings) == len(smooth.warnings) + 1


def test_loop_of_quads_is_named(read) -> None:
    reading = read(QUAD + 'uniform token subdivisionScheme = "loop"\n}')
    assert "loop subdivision of faces that are no triangles: catmullClark is used: /M" in reading.warnings


def test_an_unauthored_scheme_is_catmull_clark_with_smooth_normals(read) -> None:
    (mesh,) = read(QUAD + "}", complexity="high").scene.shapes
    assert len(mesh.triangles) == 2 * 16
    np.testing.assert_allclose(mesh.normals, np.broadcast_to([0, 0, 1], mesh.normals.shape), atol=1e-6)


def test_authored_normals_of_subdivision_surfaces_are_not_used(read) -> None:
    lines = 'normal3f[] normals = [(1, 0, 0)] (\n interpolation = "constant"\n)\n}'
    (mesh,) = read(QUAD + lines, complexity="high").scene.shapes
    np.testing.assert_allclose(mesh.normals, np.broadcast_to([0, 0, 1], mesh.normals.shape), atol=1e-6)


def test_creases_along_no_edge_are_named(read) -> None:
    lines = "int[] creaseIndices = [0, 2]\nint[] creaseLengths = [2]\nfloat[] creaseSharpnesses = [1]\n}"
    assert "creases along no edge of the mesh; they are left out: /M" in read(QUAD + lines).warnings


def test_levels_are_lowered_where_there_would_be_too_many_triangles(read, monkeypatch) -> None:
    monkeypatch.setattr("usd_scenes.reader.subdivision.TRIANGLES_MAX", 10)
    reading = read(QUAD + "}", complexity="high")
    assert len(reading.scene.shapes[0].triangles) == 8
    assert "2 levels of subdivision are more than 10 triangles: 1 are used: /M" in reading.warnings


@pytest.mark.parametrize(
    "name", ["subdivisionScheme", "interpolateBoundary", "faceVaryingLinearInterpolation", "triangleSubdivisionRule"]
)
def test_unknown_rules_are_usds_own(read, name: str) -> None:
    prim = QUAD + f'token {name} = "wavy"\n}}'
    with pytest.raises(SceneError, match=rf"/M\.{name} = wavy; accepted: "):
        read(prim, strict=True)
    np.testing.assert_array_equal(read(prim).scene.shapes[0].points, read(QUAD + "}").scene.shapes[0].points)
