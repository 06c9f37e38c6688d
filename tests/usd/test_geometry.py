"""Shapes stand in the world as USD puts them there."""

from __future__ import annotations

import re

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from fgf_warp.errors import SceneError
from fgf_warp.scene import count_open_edges, shape_bounds
from usd_scenes.reader import read_stage
from usd_scenes.reader.triangulation import cut_faces, signed_volume

MIRROR = """double3 xformOp:translate = (5, 0, 0)
    float3 xformOp:scale = (-2, 1, 1)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]"""
TETRAHEDRON = """point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    int[] faceVertexCounts = [3, 3, 3, 3]
    int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
    uniform token subdivisionScheme = "none"
"""
MEDIUM = """def Material "Look" (
    prepend apiSchemas = ["FgfMediumAPI"]
)
{
}
"""


def bound(kind: str, body: str) -> str:
    """A prim /Shape bound to a medium."""
    return f"""def {kind} "Shape" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{{
    rel material:binding = </Look>
    {body}
}}
{MEDIUM}"""


def test_world_transforms_are_those_of_usd() -> None:
    rng = np.random.default_rng(3)
    stage = Usd.Stage.CreateInMemory()
    for depth, path in enumerate(["/A", "/A/B", "/A/B/C"]):
        xform = UsdGeom.Xform.Define(stage, path)
        xform.AddTranslateOp().Set(tuple(rng.normal(size=3)))
        xform.AddRotateZYXOp().Set(tuple(rng.uniform(-180, 180, size=3)))
        xform.AddScaleOp().Set(tuple(rng.uniform(0.5, 2, size=3) * (-1) ** depth))
        UsdGeom.Cube.Define(stage, f"{path}/Cube").AddRotateXOp(UsdGeom.XformOp.PrecisionDouble).Set(30.0 * depth)
    solids = {shape.name: shape for shape in read_stage(stage).scene.shapes}
    cache = UsdGeom.XformCache()
    assert len(solids) == 3
    for path, solid in solids.items():
        expected = np.array(cache.GetLocalToWorldTransform(stage.GetPrimAtPath(path))).T
        np.testing.assert_allclose(solid.object_to_world, expected, atol=1e-12)  # size 2 is the canonical cube


@pytest.mark.parametrize(
    ("prim", "kind", "half_sides"),
    [
        ('def Sphere "S"\n{\n double radius = 3\n}', "sphere", (3, 3, 3)),
        ('def Sphere "S"\n{\n}', "sphere", (1, 1, 1)),
        ('def Cube "S"\n{\n double size = 5\n}', "cube", (2.5, 2.5, 2.5)),
        ('def Cylinder "S"\n{\n double radius = 3\n double height = 10\n}', "cylinder", (3, 3, 5)),
        (
            'def Cylinder "S"\n{\n double radius = 3\n double height = 10\n uniform token axis = "X"\n}',
            "cylinder",
            (5, 3, 3),
        ),
        (
            'def Cylinder "S"\n{\n double radius = 3\n double height = 10\n uniform token axis = "Y"\n}',
            "cylinder",
            (3, 5, 3),
        ),
        (
            'def Cylinder_1 "S"\n{\n double radiusTop = 3\n double radiusBottom = 3\n double height = 10\n'
            ' uniform token axis = "Y"\n}',
            "cylinder",
            (3, 5, 3),
        ),
    ],
)
def test_solids_have_their_size_and_axis(read, prim: str, kind: str, half_sides: tuple) -> None:
    (solid,) = read(prim).scene.shapes
    low, high = shape_bounds(solid)
    assert solid.kind == kind
    np.testing.assert_allclose(high, half_sides)
    np.testing.assert_allclose(low, -np.array(half_sides))
    assert np.linalg.det(solid.object_to_world[:3, :3]) > 0


@pytest.mark.parametrize(("axis", "column"), [("X", 0), ("Y", 1), ("Z", 2)])
def test_the_canonical_cylinders_axis_becomes_the_named_one(read, axis: str, column: int) -> None:
    (solid,) = read(f'def Cylinder "S"\n{{\n double height = 6\n uniform token axis = "{axis}"\n}}').scene.shapes
    np.testing.assert_allclose(solid.object_to_world[:3, 2], 3 * np.eye(3)[column])


@pytest.mark.parametrize("attribute", ["radius", "height"])
@pytest.mark.parametrize("value", ["0", "-1", "inf", "nan"])
def test_lengths_must_be_positive(read, attribute: str, value: str) -> None:
    prim = f'def Cylinder "S"\n{{\n double {attribute} = {value}\n}}'
    with pytest.raises(SceneError, match=rf"stage.usda: /S.{attribute} = .*; accepted: > 0"):
        read(prim, strict=True)
    assert read(prim).scene.shapes == ()
    assert any(
        re.fullmatch(rf"/S.{attribute} = .*; accepted: > 0; the shape is left out", w) for w in read(prim).warnings
    )


@pytest.mark.parametrize(
    ("kind", "name"),
    [("Capsule", "height"), ("Cone", "radius"), ("Plane", "width"), ("Sphere", "radius"), ("Cylinder_1", "radiusTop")],
)
def test_lengths_that_overflow_are_told_and_nothing_is_computed_with_them(read, kind: str, name: str, recwarn) -> None:
    prim = f'def {kind} "S"\n{{\n double {name} = 1e300\n}}'
    reading = read(prim)
    assert f"/S.{name} = 1e+300; accepted: at most 3.4e+38; the shape is left out" in reading.warnings
    assert reading.scene.shapes == ()
    assert not recwarn.list


def test_numbers_that_overflow_print_nothing(read, recwarn) -> None:
    """Transforms whose products are larger than any number, as of a light and a mesh."""
    scale = 'float3 xformOp:scale = (1e38, 1e38, 1e38)\nuniform token[] xformOpOrder = ["xformOp:scale"]\n'
    inner = f'def SphereLight "Lamp"\n{{\n{scale}}}\ndef Capsule "Ball"\n{{\n{scale}}}\n'
    prim = f'def Xform "A"\n{{\n{scale}def Xform "B"\n{{\n{scale}{inner}}}\n}}\n'
    assert {text.rpartition(": ")[2] for text in read(prim).warnings} >= {"/A/B/Lamp", "/A/B/Ball"}
    assert not recwarn.list


def test_what_is_not_rendered_is_named(read) -> None:
    kinds = ("BasisCurves", "HermiteCurves", "NurbsPatch", "NurbsCurves", "Points", "TetMesh", "Volume", "Nonsense")
    reading = read("".join(f'def {kind} "{kind}A"\n{{\n}}\ndef {kind} "{kind}B"\n{{\n}}\n' for kind in kinds))
    assert reading.scene.shapes == ()
    for kind in kinds:
        assert f"{kind} is not supported and is left out: /{kind}A, /{kind}B" in reading.warnings


def test_long_lists_are_cut_and_counted(read) -> None:
    reading = read("".join(f'def Points "C{i}"\n{{\n}}\n' for i in range(8)))
    assert "Points is not supported and is left out: /C0, /C1, /C2, /C3, /C4 and 3 more" in reading.warnings


def test_a_flat_solid_is_left_out_and_named(read) -> None:
    reading = read(
        'def Cube "C"\n{\n float3 xformOp:scale = (1, 0, 1)\n uniform token[] xformOpOrder = ["xformOp:scale"]\n}'
    )
    assert reading.scene.shapes == ()
    assert any(text.endswith("left out: /C") for text in reading.warnings)


def test_a_mesh_faces_outwards(read) -> None:
    (mesh,) = read(bound("Mesh", TETRAHEDRON)).scene.shapes
    assert signed_volume(mesh.points, mesh.triangles) == pytest.approx(1 / 6)
    assert mesh.triangles.dtype == np.int32


def test_a_left_handed_mesh_is_turned(read) -> None:
    flipped = TETRAHEDRON.replace("0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3", "1, 2, 0, 3, 1, 0, 2, 3, 0, 3, 2, 1")
    reading = read(bound("Mesh", flipped + 'uniform token orientation = "leftHanded"'))
    (mesh,) = reading.scene.shapes
    assert signed_volume(mesh.points, mesh.triangles) == pytest.approx(1 / 6)
    assert reading.warnings == ()


def test_a_mirrored_mesh_still_faces_outwards(read) -> None:
    reading = read(bound("Mesh", TETRAHEDRON + MIRROR))
    (mesh,) = reading.scene.shapes
    assert signed_volume(mesh.points, mesh.triangles) == pytest.approx(2 / 6)
    assert mesh.points[1] == pytest.approx([3, 0, 0])
    assert reading.warnings == ()


def test_a_medium_turned_inside_out_is_mended_with_a_warning(read) -> None:
    reading = read(bound("Mesh", TETRAHEDRON + 'uniform token orientation = "leftHanded"'))
    (mesh,) = reading.scene.shapes
    assert signed_volume(mesh.points, mesh.triangles) == pytest.approx(1 / 6)
    assert "the mesh of a medium is inside out, and was turned: /Shape" in reading.warnings


QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
"""Of a cube whose corners are (-1, -1, -1), (-1, -1, 1), (-1, 1, -1), ..."""


def mesh_of(points, faces) -> str:
    counts, indices = [len(face) for face in faces], [corner for face in faces for corner in face]
    listed = [tuple(map(float, point)) for point in points]
    return bound(
        "Mesh",
        f"""point3f[] points = {listed}
    int[] faceVertexCounts = {counts}
    int[] faceVertexIndices = {indices}
    uniform token subdivisionScheme = "none"
""",
    )


def bent_cube(scale=1.0, at=(0, 0, 0)) -> np.ndarray:
    """(8, 3), of which no quad is flat."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return scale * (corners + np.random.default_rng(2).uniform(-0.2, 0.2, (8, 3))) + np.array(at)


def test_a_mesh_whose_faces_are_all_there_twice_is_refused(read) -> None:
    """Though each of two opposite quads is cut along its own diagonal, so that they bound slivers."""
    with pytest.raises(SceneError, match=r"/Shape: .* there twice, facing both ways: it encloses no volume"):
        read(mesh_of(bent_cube(), [*QUADS, *(np.roll(face[::-1], 1).tolist() for face in QUADS)]))


def test_faces_that_are_there_twice_beside_others_are_left_out(read) -> None:
    points = [*bent_cube(), (3, 3, 0)]
    flap = [(7, 6, 4, 8), (8, 4, 6, 7)]
    reading = read(mesh_of(points, [*QUADS, *flap]))
    assert any("bound nothing; they are left out: /Shape" in text for text in reading.warnings)
    (mesh,) = reading.scene.shapes
    assert len(mesh.triangles) == 12
    with pytest.raises(SceneError, match="/Shape: faces of the mesh of a medium are there twice"):
        read(mesh_of(points, [*QUADS, *flap]), strict=True)


def test_shells_of_a_mesh_that_overlap_are_shapes_of_one_name(read) -> None:
    points = [*bent_cube(), *bent_cube(at=(0.5, 0, 0))]
    second = [tuple(corner + 8 for corner in face) for face in QUADS]
    reading = read(mesh_of(points, [*QUADS, *second]))
    assert [shape.name for shape in reading.scene.shapes] == ["/Shape", "/Shape"]
    assert reading.scene.prims == ("/Shape",)
    assert reading.warnings == ()
    inwards = [face[::-1] for face in second]
    (cavity,) = read(mesh_of([*bent_cube(), *bent_cube(0.5)], [*QUADS, *inwards])).scene.shapes
    assert len(cavity.triangles) == 24


def test_a_part_that_faces_inwards_alone_is_turned_with_a_warning(read) -> None:
    points = [*bent_cube(), *bent_cube(0.5, at=(4, 0, 0))]
    inwards = [tuple(corner + 8 for corner in face[::-1]) for face in QUADS]
    reading = read(mesh_of(points, [*QUADS, *inwards]))
    (mesh,) = reading.scene.shapes
    assert any("faces inwards with nothing around it; it is turned: /Shape" in text for text in reading.warnings)
    both = signed_volume(mesh.points, mesh.triangles)
    assert both == pytest.approx(signed_volume(mesh.points, mesh.triangles[:12]) * (1 + 0.5**3), rel=0.01)


def test_a_medium_in_an_open_mesh_is_refused(read) -> None:
    with pytest.raises(SceneError, match=r"stage.usda: /Shape: a medium needs a closed mesh.* 3 open"):
        read(bound("Mesh", TETRAHEDRON + "int[] holeIndices = [3]"))


def test_holes_are_left_out(read) -> None:
    (mesh,) = read(f'def Mesh "M"\n{{\n {TETRAHEDRON} int[] holeIndices = [0, 2]\n}}').scene.shapes
    assert sorted(map(sorted, mesh.triangles.tolist())) == [[0, 1, 3], [1, 2, 3]]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[3, 3, 3, 3]", "[3, 3, 3]", r"/Shape.faceVertexCounts adds up to 9; accepted: .*12"),
        ("1, 2, 3]", "1, 2, 4]", r"/Shape.faceVertexIndices spans \[0, 4\]; accepted: \[0, 3\]"),
        ("1, 2, 3]", "1, 2, -1]", r"/Shape.faceVertexIndices spans \[-1, 3\]; accepted: \[0, 3\]"),
        ("(0, 0, 1)]", "(0, 0, nan)]", "/Shape.points holds numbers that are not finite"),
    ],
)
def test_a_broken_mesh_is_refused(read, old: str, new: str, message: str) -> None:
    assert old in TETRAHEDRON
    with pytest.raises(SceneError, match=message):
        read(bound("Mesh", TETRAHEDRON.replace(old, new)))


def test_a_mesh_without_faces_is_named(read) -> None:
    assert "mesh without faces is left out: /M" in read('def Mesh "M"\n{\n}').warnings


def polygon_area(points: np.ndarray, triangles: np.ndarray) -> tuple[float, float]:
    """Sum of the signed areas seen along z, and of the absolute ones."""
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    signed = np.cross(b - a, c - a)[:, 2] / 2
    return float(signed.sum()), float(np.abs(signed).sum())


@pytest.mark.parametrize(
    ("outline", "area"),
    [
        ([(0, 0), (4, 0), (4, 4), (0, 4)], 16.0),  # convex
        ([(1, 1), (0, 4), (0, 0), (4, 0)], 4.0),  # a concave quad, concave at its first corner
        ([(0, 4), (0, 0), (4, 0), (1, 1)], 4.0),  # the same, concave at its last
        ([(0, 0), (6, 0), (6, 4), (4, 4), (4, 1), (2, 1), (2, 4), (0, 4)], 18.0),  # a U, which no fan covers
    ],
)
@pytest.mark.parametrize("turned", [False, True])
def test_triangles_cover_a_polygon_once(outline: list, area: float, turned: bool) -> None:
    points = np.column_stack([np.array(outline, dtype=float), np.zeros(len(outline))])
    order = np.arange(len(outline))[:: -1 if turned else 1]
    triangles = order[cut_faces(points, np.array([len(outline)]), order)]
    signed, absolute = polygon_area(points, triangles)
    assert len(triangles) == len(outline) - 2
    assert signed == pytest.approx(-area if turned else area)
    assert absolute == pytest.approx(area)


def test_faces_of_mixed_size_are_all_kept() -> None:
    points = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0), (3, 0.5, 0)], dtype=float)
    counts, indices = np.array([4, 3, 2, 5]), np.array([0, 1, 2, 3, 1, 4, 5, 0, 1, 1, 4, 6, 5, 2])
    triangles = indices[cut_faces(points, counts, indices)]
    assert len(triangles) == 2 + 1 + 3
    assert polygon_area(points, triangles)[1] == pytest.approx(1 + 0.5 + 1.5)


def test_a_primvar_of_an_unknown_interpolation_is_left_out(read) -> None:
    prim = """def Mesh "Shape"
{
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1)] (
        interpolation = "Surface"
    )
}
"""
    accepted = "constant, uniform, varying, vertex, faceVarying"
    text = f"primvar of interpolation 'Surface' is left out; accepted: {accepted}: /Shape.primvars:displayColor"
    assert text in read(prim).warnings


REVOLVED = [
    # prim type, attributes, volume, lowest and highest corner for the axis Z
    ("Cone", "", 2 * np.pi / 3, (-1, -1, -1), (1, 1, 1)),
    ("Cone", "double radius = 2\ndouble height = 3", 4 * np.pi, (-2, -2, -1.5), (2, 2, 1.5)),
    ("Cylinder_1", "double radiusBottom = 2", 14 * np.pi / 3, (-2, -2, -1), (2, 2, 1)),
    ("Cylinder_1", "double radiusTop = 0", 2 * np.pi / 3, (-1, -1, -1), (1, 1, 1)),
    ("Capsule", "", np.pi * (1 / 4 + 4 / 3 / 8), (-0.5, -0.5, -1), (0.5, 0.5, 1)),
    ("Capsule", "double radius = 1\ndouble height = 0", 4 * np.pi / 3, (-1, -1, -1), (1, 1, 1)),
    (
        "Capsule_1",
        "double radiusTop = 1\ndouble radiusBottom = 2\ndouble height = 3",
        np.pi * (7 + 18 / 3),
        (-2, -2, -3.5),
        (2, 2, 2.5),
    ),
]


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
@pytest.mark.parametrize(("kind", "lines", "volume", "low", "high"), REVOLVED)
def test_shapes_of_revolution(read, axis: str, kind: str, lines: str, volume: float, low: tuple, high: tuple) -> None:
    reading = read(f'def {kind} "S"\n{{\n uniform token axis = "{axis}"\n{lines}\n}}')
    (mesh,) = reading.scene.shapes
    turn = {"Z": 0, "X": 1, "Y": 2}[axis]
    np.testing.assert_allclose(shape_bounds(mesh), (np.roll(low, turn), np.roll(high, turn)), atol=1e-12)
    assert count_open_edges(mesh.points, mesh.triangles) == 0
    found = signed_volume(mesh.points, mesh.triangles)
    assert volume * (1 - 2.6e-4) < found < volume
    # Normals are those of the shape, so within half a segment of the triangles' own.
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=2), 1, atol=1e-6)
    a, b, c = (mesh.points[mesh.triangles[:, corner]] for corner in range(3))
    flat = np.cross(b - a, c - a)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert np.einsum("mck,mk->mc", mesh.normals, flat).min() > np.cos(2.1 * np.pi / 256)


@pytest.mark.parametrize(("axis", "sides"), [("X", (0, 5, 3)), ("Y", (3, 0, 5)), ("Z", (3, 5, 0))])
def test_planes(read, axis: str, sides: tuple) -> None:
    lines = f'double width = 3\ndouble length = 5\nuniform token axis = "{axis}"'
    (mesh,) = read(f'def Plane "S"\n{{\n{lines}\n}}').scene.shapes
    np.testing.assert_allclose(shape_bounds(mesh), (-np.array(sides) / 2, np.array(sides) / 2))
    a, b, c = (mesh.points[mesh.triangles[:, corner]] for corner in range(3))
    np.testing.assert_allclose(np.cross(b - a, c - a), np.tile(15 * np.eye(3)["XYZ".index(axis)], (2, 1)))


def test_shapes_of_revolution_hold_media_and_mirror(read) -> None:
    (mesh,) = read(bound("Cone", MIRROR)).scene.shapes
    assert mesh.medium == 0 and mesh.normals is None
    assert signed_volume(mesh.points, mesh.triangles) == pytest.approx(2 * 2 * np.pi / 3, rel=2e-4)


def test_solids_have_display_colors_from_above(read) -> None:
    color = 'color3f[] primvars:displayColor = [(1, 0, 0)] (\n interpolation = "constant"\n)'
    opacity = "float[] primvars:displayOpacity = [0.25]"
    prims = f'def Xform "X"\n{{\n{color}\n def Cone "A"\n{{\n}}\ndef Sphere "B"\n{{\n{opacity}\n}}\n}}'
    cone, sphere = read(prims).scene.shapes
    assert cone.surface.diffuse == sphere.surface.diffuse == (1, 0, 0)
    assert (cone.surface.opacity, sphere.surface.opacity) == (1, 0.25)
