"""Primvars, normals and GeomSubsets of meshes come to the corners of triangles."""

from __future__ import annotations

import numpy as np
import pytest

from fgf_warp.errors import SceneError
from fgf_warp.scene import PrimvarInput
from usd_scenes.reader.triangulation import signed_volume

POINTS = np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)], dtype=float)
QUADS = np.array([0, 1, 4, 3, 1, 2, 5, 4])
"""Two quads beside one another; faces of primvars below are triangles of these."""


def two_quads(lines: str = "", quads: np.ndarray = QUADS) -> str:
    return f"""def Mesh "M"
{{
    uniform token subdivisionScheme = "none"
    point3f[] points = {[tuple(point) for point in POINTS.tolist()]}
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = {quads.tolist()}
    {lines}
}}
"""


def colors(values: list, interpolation: str, more: str = "") -> str:
    return f'color3f[] primvars:displayColor = {values} (\n interpolation = "{interpolation}"\n)\n{more}'


RAINBOW = [(0.1 * i, 0.5, 1 - 0.1 * i) for i in range(8)]


def expected_at(mesh, values: np.ndarray, interpolation: str) -> np.ndarray:
    """(m, 3, 3), found by where the corners of the triangles lie."""
    corner_points = mesh.points[mesh.triangles]
    result = np.empty((*corner_points.shape[:2], 3))
    for triangle, corners in enumerate(corner_points):
        face = 0 if corners[:, 0].max() <= 1 else 1
        for corner, point in enumerate(corners):
            at_point = int(np.argmin(np.abs(POINTS - point).sum(axis=1)))
            at_corner = 4 * face + QUADS[4 * face : 4 * face + 4].tolist().index(at_point)
            place = {"uniform": face, "vertex": at_point, "varying": at_point, "faceVarying": at_corner}
            result[triangle, corner] = values[place[interpolation]]
    return result


@pytest.mark.parametrize("left_handed", [False, True])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("is_indexed", [False, True])
@pytest.mark.parametrize(
    ("interpolation", "count"), [("uniform", 2), ("vertex", 6), ("varying", 6), ("faceVarying", 8)]
)
def test_values_follow_the_corners(
    read, interpolation: str, count: int, is_indexed: bool, mirrored: bool, left_handed: bool
) -> None:
    order = np.random.default_rng(5).permutation(count)
    values = np.array(RAINBOW)[:count]
    if is_indexed:
        lines = colors(RAINBOW[:count], interpolation, f"int[] primvars:displayColor:indices = {order.tolist()}")
        values = values[order]
    else:
        lines = colors(RAINBOW[:count], interpolation)
    if left_handed:
        lines += '\nuniform token orientation = "leftHanded"'
    if mirrored:
        lines += '\nfloat3 xformOp:scale = (1, 1, -1)\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    (mesh,) = read(two_quads(lines)).scene.shapes
    assert mesh.surface.diffuse == PrimvarInput("displayColor", fallback=mesh.surface.diffuse.fallback)
    found = mesh.primvars["displayColor"]
    assert found.dtype == np.float32
    assert found.shape[1] == (1 if interpolation == "uniform" else 3)
    expected = expected_at(mesh, values, interpolation)
    np.testing.assert_allclose(np.broadcast_to(found, expected.shape), expected, atol=1e-7)
    up = np.cross(*(mesh.points[mesh.triangles[:, k]] - mesh.points[mesh.triangles[:, 0]] for k in (1, 2)))[:, 2]
    assert (up > 0).all() == (left_handed == mirrored)


def test_only_what_the_surface_reads_is_carried(read) -> None:
    lines = 'float[] primvars:weight = [1, 2] (\n interpolation = "uniform"\n)\n'
    (mesh,) = read(two_quads(lines)).scene.shapes
    assert dict(mesh.primvars) == {}


@pytest.mark.parametrize(
    ("lines", "text"),
    [
        (colors(RAINBOW[:3], "vertex"), "vertex primvar of 3 values where 6 are expected is left out"),
        (colors(RAINBOW[:6], "faceVarying"), "faceVarying primvar of 6 values where 8 are expected is left out"),
        (colors(RAINBOW[:2], "constant"), "constant primvar of 2 values where 1 are expected is left out"),
    ],
)
def test_primvars_of_a_wrong_length_are_named_and_left_out(read, lines: str, text: str) -> None:
    reading = read(two_quads(lines))
    assert f"{text}: /M.primvars:displayColor" in reading.warnings
    assert dict(reading.scene.shapes[0].primvars) == {}


class TestNormals:
    """Shading normals as they are authored."""

    UP, TILTED = (0.0, 0.0, 1.0), (0.6, 0.0, 0.8)

    def normals(self, values: list, interpolation: str, name: str = "normals") -> str:
        return f'normal3f[] {name} = {values} (\n interpolation = "{interpolation}"\n)\n'

    def test_none_are_facets(self, read) -> None:
        assert read(two_quads()).scene.shapes[0].normals is None

    @pytest.mark.parametrize(
        ("interpolation", "count"), [("constant", 1), ("uniform", 2), ("vertex", 6), ("faceVarying", 8)]
    )
    def test_they_follow_the_corners(self, read, interpolation: str, count: int) -> None:
        values = np.array([(0.6, 0.0, 0.8), (0, 0.6, 0.8), (-0.6, 0, 0.8), (0, -0.6, 0.8)] * 2)[:count]
        lines = self.normals([tuple(value) for value in (2 * values).tolist()], interpolation)
        (mesh,) = read(two_quads(lines)).scene.shapes
        if interpolation == "constant":
            expected = np.broadcast_to(values[0], mesh.normals.shape)
        else:
            expected = expected_at(mesh, values, interpolation)
        assert mesh.normals.dtype == np.float32
        np.testing.assert_allclose(mesh.normals, expected, atol=1e-6)

    def test_primvars_normals_come_before_normals(self, read) -> None:
        lines = self.normals([self.UP], "constant") + self.normals([self.TILTED], "constant", "primvars:normals")
        (mesh,) = read(two_quads(lines)).scene.shapes
        np.testing.assert_allclose(mesh.normals[0, 0], self.TILTED, atol=1e-6)

    def test_indexed(self, read) -> None:
        lines = self.normals([self.UP, self.TILTED], "uniform", "primvars:normals")
        (mesh,) = read(two_quads(lines + "int[] primvars:normals:indices = [1, 0]")).scene.shapes
        np.testing.assert_allclose(mesh.normals, expected_at(mesh, np.array([self.TILTED, self.UP]), "uniform"))

    def test_they_stand_upright_on_what_is_sheared_and_mirrored(self, read) -> None:
        # Mirrored in x, stretched in y and sheared along z; the slope's own normal stays that of the plane.
        matrix = "( (-1, 0, 0.5, 0), (0, 3, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1) )"
        move = f'matrix4d xformOp:transform = {matrix}\nuniform token[] xformOpOrder = ["xformOp:transform"]'
        (mesh,) = read(two_quads(self.normals([self.UP], "constant") + move)).scene.shapes
        a, b, c = (mesh.points[mesh.triangles[:, corner]] for corner in range(3))
        flat = np.cross(b - a, c - a)
        flat /= np.linalg.norm(flat, axis=1, keepdims=True)
        np.testing.assert_allclose(mesh.normals, np.broadcast_to(flat[:, None], mesh.normals.shape), atol=1e-6)

    def test_without_a_direction_the_triangles_own_is_used(self, read) -> None:
        lines = self.normals([(0, 0, 0), self.TILTED], "uniform")
        reading = read(two_quads(lines))
        (mesh,) = reading.scene.shapes
        np.testing.assert_allclose(mesh.normals, expected_at(mesh, np.array([self.UP, self.TILTED]), "uniform"))
        assert "normals that are zero: the triangles' own are used there: /M" in reading.warnings

    def test_of_a_wrong_length_are_named(self, read) -> None:
        reading = read(two_quads(self.normals([self.UP] * 3, "vertex")))
        assert reading.scene.shapes[0].normals is None
        assert "vertex primvar of 3 values where 6 are expected is left out: /M.normals" in reading.warnings

    def test_of_two_numbers_are_named(self, read) -> None:
        lines = 'float2[] primvars:normals = [(0, 1)] (\n interpolation = "constant"\n)\n'
        reading = read(two_quads(lines))
        assert reading.scene.shapes[0].normals is None
        assert "normals of 2 numbers, and not of three, are left out: /M.primvars:normals" in reading.warnings

    def test_a_boundary_without_a_surface_has_none(self, read) -> None:
        cube = """def Mesh "M" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    rel material:binding = </Look>
    uniform token subdivisionScheme = "none"
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    int[] faceVertexCounts = [3, 3, 3, 3]
    int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
    normal3f[] normals = [(0, 0, 1)] (
        interpolation = "constant"
    )
}
def Material "Look" (
    prepend apiSchemas = ["FgfMediumAPI"]
)
{
}"""
        assert read(cube).scene.shapes[0].normals is None


def subset(name: str, faces: str, look: str, element: str = "face") -> str:
    return f"""def GeomSubset "{name}" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{{
    uniform token elementType = "{element}"
    uniform token familyName = "materialBind"
    int[] indices = {faces}
    rel material:binding = </{look}>
}}
"""


def diffuse(name: str, color: str) -> str:
    return f"""def Material "{name}"
{{
    token outputs:surface.connect = </{name}/S.outputs:surface>
    def Shader "S"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = {color}
        token outputs:surface
    }}
}}
"""


class TestSubsets:
    """Faces with a material of their own."""

    LOOKS = diffuse("Red", "(1, 0, 0)") + diffuse("Blue", "(0, 0, 1)")

    def test_a_mesh_for_each_and_one_for_the_rest(self, read) -> None:
        reading = read(two_quads(subset("A", "[1]", "Red") + colors([(0.5, 0.5, 0.5)], "constant")) + self.LOOKS)
        shapes = {shape.name: shape for shape in reading.scene.shapes}
        assert sorted(shapes) == ["/M", "/M/A"]
        assert shapes["/M/A"].surface.diffuse == (1, 0, 0)
        assert shapes["/M"].surface.diffuse == (0.5, 0.5, 0.5)
        assert shapes["/M/A"].points[shapes["/M/A"].triangles][..., 0].min() == 1
        assert shapes["/M"].points[shapes["/M"].triangles][..., 0].max() == 1
        assert shapes["/M"].points is not None

    def test_nothing_is_left_where_all_faces_are_bound(self, read) -> None:
        reading = read(two_quads(subset("A", "[1]", "Red") + subset("B", "[0]", "Blue")) + self.LOOKS)
        assert sorted(shape.name for shape in reading.scene.shapes) == ["/M/A", "/M/B"]

    def test_the_first_of_two_keeps_a_face(self, read) -> None:
        reading = read(two_quads(subset("A", "[0, 1]", "Red") + subset("B", "[0]", "Blue")) + self.LOOKS)
        assert [shape.name for shape in reading.scene.shapes] == ["/M/A"]
        assert "faces that an earlier GeomSubset holds too keep the material of that: /M/B" in reading.warnings

    def test_faces_that_are_not_there_are_left_out(self, read) -> None:
        prims = two_quads(subset("A", "[-1, 1, 2]", "Red")) + self.LOOKS
        with pytest.raises(SceneError, match=r"/M/A.indices spans \[-1, 2\]; accepted: \[0, 1\]"):
            read(prims, strict=True)
        reading = read(prims)
        text = "/M/A.indices spans [-1, 2]; accepted: [0, 1], as there are 2 faces; 2 of 3 entries are left out"
        assert text in reading.warnings
        assert [(shape.name, len(shape.triangles)) for shape in reading.scene.shapes] == [("/M/A", 2), ("/M", 2)]

    def test_of_points_bind_nothing(self, read) -> None:
        reading = read(two_quads(subset("A", "[0]", "Red", element="point")) + self.LOOKS)
        assert [shape.name for shape in reading.scene.shapes] == ["/M"]

    def test_values_and_normals_are_split_with_the_faces(self, read) -> None:
        lines = TestNormals().normals([TestNormals.TILTED, TestNormals.UP], "uniform")
        lines += subset("A", "[1]", "Red") + colors(RAINBOW[:2], "uniform")
        shapes = {shape.name: shape for shape in read(two_quads(lines) + self.LOOKS).scene.shapes}
        np.testing.assert_allclose(shapes["/M/A"].normals, np.broadcast_to(TestNormals.UP, (2, 3, 3)))
        np.testing.assert_allclose(shapes["/M"].normals, np.broadcast_to(TestNormals.TILTED, (2, 3, 3)), atol=1e-6)
        np.testing.assert_allclose(shapes["/M"].primvars["displayColor"], [[RAINBOW[0]]] * 2)
        assert dict(shapes["/M/A"].primvars) == {}

    def test_a_subdivided_face_keeps_its_material(self, read) -> None:
        lines = subset("A", "[1]", "Red").replace('"A"', '"A"')
        prims = two_quads(lines).replace('"none"', '"catmullClark"') + self.LOOKS
        shapes = {shape.name: shape for shape in read(prims, complexity="high").scene.shapes}
        assert [len(shapes[name].triangles) for name in ("/M", "/M/A")] == [32, 32]
        assert shapes["/M"].points[shapes["/M"].triangles][..., 0].max() == pytest.approx(1)

    def test_one_medium_without_surfaces_stays_one_mesh(self, read) -> None:
        medium = 'def Material "Fog" (\n prepend apiSchemas = ["FgfMediumAPI"]\n)\n{\n}\n'
        tetrahedron = f"""def Mesh "M" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{{
    rel material:binding = </Fog>
    uniform token subdivisionScheme = "none"
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    int[] faceVertexCounts = [3, 3, 3, 3]
    int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
    {subset("A", "[0, 2]", "Fog")}
}}
"""
        (mesh,) = read(tetrahedron + medium).scene.shapes
        assert mesh.name == "/M" and mesh.medium == 0
        assert signed_volume(mesh.points, mesh.triangles) == pytest.approx(1 / 6)
