"""What a stage gets wrong in one place costs that place: it is told, and the rest rendered; strictly it is refused."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

from fgf_warp.errors import MediumError, SceneError
from tests.usd.conftest import write
from tests.usd.prims import CAMERA, DOME, HEADER, TWO_CAMERAS, as_told, medium_sphere
from usd_scenes.reader import StageReading, read_scene

BALL = 'def Sphere "Ball"\n{\n}\n'
POINTS = "point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]"
QUAD = f"""int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    {POINTS}
    uniform token subdivisionScheme = "none"
"""


def mesh(body: str, name: str = "M") -> str:
    return f'def Mesh "{name}"\n{{\n    {body}\n}}\n'


@pytest.fixture
def mended(read) -> Callable[..., StageReading]:
    """Reads prims of which one thing is wrong, which is to be told, and refused where they are read strictly."""

    def check(prims: str, warning: str, **arguments) -> StageReading:
        reading = read(prims, **arguments)
        assert reading.warnings == (as_told(warning),)
        found, _, path = warning.rpartition(": ")
        with pytest.raises(SceneError) as refused:
            read(prims, strict=True, **arguments)
        assert path in str(refused.value)
        assert found.rpartition("; ")[0].removeprefix("= ") in str(refused.value)
        return reading

    return check


# What a stage is composed of


@pytest.mark.parametrize(
    ("prim", "warning"),
    [
        (
            'def "Gone" ( references = @gone.usda@ ) {}',
            "Could not open asset @gone.usda@ for reference; it is left out",
        ),
        ('def "Gone" ( payload = @gone.usda@ ) {}', "Could not open asset @gone.usda@ for payload; it is left out"),
    ],
)
def test_what_is_not_there_is_left_out(mended, prim: str, warning: str) -> None:
    reading = mended(BALL + prim, f"{warning}: /Gone")
    assert [shape.name for shape in reading.scene.shapes] == ["/Ball"]


def test_targets_and_layers_that_are_not_there_are_left_out(read) -> None:
    (warning,) = read(BALL + 'def "Gone" ( references = </Away> ) {}').warnings
    assert warning.startswith("Unresolved reference prim path @") and warning.endswith("</Away>; it is left out: /Gone")
    reading = read(BALL, header=HEADER.replace("(\n", "(\n    subLayers = [@gone.usda@]\n", 1))
    (warning,) = reading.warnings
    assert warning.startswith("Could not load sublayer @gone.usda@") and warning.endswith("; it is left out: /")
    assert [shape.name for shape in reading.scene.shapes] == ["/Ball"]


def test_a_circle_is_left_open_where_it_closes(read) -> None:
    prims = 'def Xform "A" ( references = </B> ) { }\ndef "B" ( references = </A> ) {\n def Sphere "S" {\n }\n}\n'
    reading = read(prims)
    assert all("Cycle detected" in text and "what closes the circle is left out" in text for text in reading.warnings)
    assert {"/A/S", "/B/S"} == {shape.name for shape in reading.scene.shapes}


def test_display_colors_with_indices_out_of_range_are_left_out(mended) -> None:
    colors = 'color3f[] primvars:displayColor = [(1, 0, 0)] (\n interpolation = "vertex"\n)\n'
    body = QUAD + colors + "int[] primvars:displayColor:indices = [0, 0, 1, 0]\n"
    reading = mended(mesh(body), "primvar with indices in [0, 1] for 1 values is left out: /M.primvars:displayColor")
    assert reading.scene.shapes[0].surface.diffuse == (0.18, 0.18, 0.18)


@pytest.mark.parametrize(
    "broken", ["float xformOp:rotateXYZ = 3\n{}['xformOp:rotateXYZ']", "{}['xformOp:turn']"], ids=["value", "operation"]
)
def test_all_that_is_below_a_broken_transform_is_left_out(read, broken: str) -> None:
    """USD tells it once for each time, and places what comes later without it."""
    order = broken.format("uniform token[] xformOpOrder = ")
    kinds = {"S": "Sphere", "C": "Cube", "L": "SphereLight"}
    inside = "".join(f'def {kind} "{name}"\n{{\n}}\n' for name, kind in kinds.items())
    prims = f'def Xform "A"\n{{\n{order}\ndef Xform "B"\n{{\n{inside}}}\n}}\n'
    reading = read(BALL + prims)
    assert [shape.name for shape in reading.scene.shapes] == ["/Ball"]
    assert [light.name for light in reading.scene.lights] == ["/Dome"]
    told = [text for text in reading.warnings if text.startswith("/A.xformOpOrder: Invalid")]
    assert [text.rpartition("; ")[2] for text in told] == [
        "the shape is left out: /A/B/S, /A/B/C",
        "the light is left out: /A/B/L",
    ]


# Meshes


@pytest.mark.parametrize(
    ("old", "new", "warning"),
    [
        (
            "[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]",
            "[]",
            "spans [0, 3]; there are no points; the shape is left out: /M.faceVertexIndices",
        ),
        ("[4]", "[5]", "adds up to 5; accepted: counts >= 0 that add up to the 4 entries of faceVertexIndices; {}"),
        ("[4]", "[5, -1]", "holds -1; accepted: counts >= 0; {}"),
        ("(0, 0, 0)", "(inf, 0, 0)", "holds numbers that are not finite; accepted: finite numbers; {}"),
        ("int[] faceVertexCounts = [4]", "float[] faceVertexCounts = [3.5]", "holds 3.5; accepted: integers; {}"),
        (
            "int[] faceVertexCounts = [4]",
            'string[] faceVertexCounts = ["4"]',
            "is no array; accepted: an array of numbers; {}",
        ),
        (
            POINTS,
            "float4[] points = [(0, 0, 0, 1), (0, 0, 0, 1), (0, 0, 0, 1), (0, 0, 0, 1)]",
            "is no array; accepted: an array of entries of 3 numbers; {}",
        ),
    ],
)
def test_a_malformed_mesh_is_left_out(mended, old: str, new: str, warning: str) -> None:
    body = QUAD.replace(old, new)
    assert body != QUAD
    blamed = "points" if "point" in old or "0, 0" in old else "faceVertexCounts"
    reading = mended(BALL + mesh(body), warning.format(f"the shape is left out: /M.{blamed}"))
    assert [shape.name for shape in reading.scene.shapes] == ["/Ball"]


def test_a_malformed_mesh_of_a_medium_is_refused_by_name(read) -> None:
    prims = (
        medium_sphere("").replace('Sphere "Ball"', 'Mesh "Ball"').replace("{", "{\n" + QUAD.replace("[4]", "[5]"), 1)
    )
    with pytest.raises(MediumError, match=r"/Ball.faceVertexCounts adds up to 5"):
        read(prims)
    with pytest.raises(MediumError, match=r"/Ball.radius = -1; accepted: > 0"):
        read(medium_sphere("").replace("{", "{\n    double radius = -1", 1))


def test_faces_of_few_corners_are_no_faces(mended, read) -> None:
    colors = 'color3f[] primvars:displayColor = {} (\n interpolation = "uniform"\n)\n'
    points = "point3f[] points = [(-1,-1,0), (1,-1,0), (1,1,0), (-1,1,0)]\n"
    odd = mesh(
        "int[] faceVertexCounts = [2, 4, 1, 0]\nint[] faceVertexIndices = [0,1, 0,1,2,3, 2]\nint[] holeIndices = [2]\n"
        + points
        + colors.format("[(1,0,0), (0,1,0), (0,0,1), (1,1,1)]")
    )
    plain = mesh(
        "int[] faceVertexCounts = [4]\nint[] faceVertexIndices = [0,1,2,3]\n"
        + points
        + 'color3f[] primvars:displayColor = [(0,1,0), (0,1,0), (0,1,0), (0,1,0)] (\n interpolation = "vertex"\n)\n'
    )
    warning = "3 of 4 faces have fewer than three corners; they are left out: /M.faceVertexCounts"
    (shape,), (expected,) = mended(odd, warning).scene.shapes, read(plain).scene.shapes
    np.testing.assert_array_equal(shape.points, expected.points)
    np.testing.assert_array_equal(shape.triangles, expected.triangles)
    found = shape.primvars["displayColor"]
    np.testing.assert_array_equal(np.broadcast_to(found, (len(shape.triangles), 3, 3)), np.tile([0, 1, 0], (32, 3, 1)))


def test_values_at_corners_stay_at_theirs_without_such_faces(mended) -> None:
    body = """int[] faceVertexCounts = [1, 3, 2, 3]
    int[] faceVertexIndices = [3, 0, 1, 2, 0, 1, 0, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
    normal3f[] normals = [(1,0,0), (0,0,1), (0,0,1), (0,0,1), (1,0,0), (1,0,0), (0,1,0), (0,1,0), (0,1,0)] (
        interpolation = "faceVarying"
    )
"""
    warning = "2 of 4 faces have fewer than three corners; they are left out: /M.faceVertexCounts"
    (shape,) = mended(mesh(body), warning).scene.shapes
    np.testing.assert_array_equal(shape.triangles, [[0, 1, 2], [0, 2, 3]])
    np.testing.assert_array_equal(shape.normals, np.repeat([[[0, 0, 1]], [[0, 1, 0]]], 3, axis=1))


@pytest.mark.parametrize("scheme", ["none", "catmullClark", "loop", "bilinear"])
def test_a_mesh_of_such_faces_alone_is_none(read, scheme: str) -> None:
    body = "int[] faceVertexCounts = [0]\nint[] faceVertexIndices = []\npoint3f[] points = []\n"
    reading = read(BALL + mesh(body + f'token subdivisionScheme = "{scheme}"'))
    assert [shape.name for shape in reading.scene.shapes] == ["/Ball"]
    assert reading.warnings == (
        "1 of 1 faces have fewer than three corners; they are left out: /M.faceVertexCounts",
        "mesh without faces is left out: /M",
    )


def test_holes_out_of_range_are_left_out(mended) -> None:
    body = "int[] faceVertexCounts = [3, 3]\nint[] faceVertexIndices = [0, 1, 2, 0, 2, 3]\n"
    body += "int[] holeIndices = [7, 1, -1]\n" + "\n".join(QUAD.splitlines()[2:])
    warning = "spans [-1, 7]; accepted: [0, 1], as there are 2 faces; 2 of 3 entries are left out: /M.holeIndices"
    (shape,) = mended(mesh(body), warning).scene.shapes
    np.testing.assert_array_equal(shape.triangles, [[0, 1, 2]])


def test_creases_out_of_range_leave_the_others(read) -> None:
    cage = 'def Mesh "M"\n{\n' + "\n".join(QUAD.splitlines()[:3]) + "\n"
    sharp = cage + "int[] cornerIndices = [2]\nfloat[] cornerSharpnesses = [3]\n}"
    more = cage + "int[] cornerIndices = [9, 2]\nfloat[] cornerSharpnesses = [1, 3]\n}"
    np.testing.assert_array_equal(read(more).scene.shapes[0].points, read(sharp).scene.shapes[0].points)
    warning = "/M.cornerIndices spans [2, 9]; accepted: [0, 3], as there are 4 points; 1 of 2 entries are left out"
    assert read(more).warnings == (warning,)


def test_a_malformed_mesh_gives_no_light(mended) -> None:
    body = QUAD.replace("[4]", "[5]")
    prim = mesh(body).replace("\n{", ' (\n prepend apiSchemas = ["MeshLightAPI"]\n)\n{', 1)
    warning = (
        "adds up to 5; accepted: counts >= 0 that add up to the 4 entries of faceVertexIndices; {} is left out: {}"
    )
    reading = mended(BALL + prim, warning.format("the light", "/M.faceVertexCounts"))
    assert [light.name for light in reading.scene.lights] == ["/Dome"]


@pytest.mark.parametrize(
    ("lines", "warning"),
    [
        (
            'double3 xformOp:translate = (nan, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]',
            "the world transform holds numbers that are not finite; the shape is left out: /Odd",
        ),
        (
            'float3 xformOp:scale = (1, 0, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]',
            "the transform leaves no volume, and the prim is left out: /Odd",
        ),
    ],
)
def test_transforms_that_are_none_leave_out_what_they_are_of(read, lines: str, warning: str) -> None:
    reading = read(BALL + f'def Cube "Odd"\n{{\n{lines}\n}}\n')
    assert [shape.name for shape in reading.scene.shapes] == ["/Ball"]
    assert reading.warnings == (as_told(warning),)


@pytest.mark.parametrize(
    ("line", "warning", "is_seen"),
    [
        (
            'token visibility = "hidden"',
            "= hidden; accepted: inherited, invisible; inherited is used: /A.visibility",
            True,
        ),
        (
            'token visibility = "Invisible"',
            "= Invisible; accepted: inherited, invisible; invisible is used: /A.visibility",
            False,
        ),
        (
            'uniform token purpose = "beauty"',
            "= beauty; accepted: default, render, proxy, guide; default is used: /A.purpose",
            True,
        ),
    ],
)
def test_words_that_say_whether_a_prim_is_seen(mended, line: str, warning: str, is_seen: bool) -> None:
    group = f'def Xform "A"\n{{\n{line}\ndef Cube "Below"\n{{\n}}\n}}\n'
    reading = mended(BALL + group, warning)
    assert [shape.name for shape in reading.scene.shapes] == ["/Ball", "/A/Below"][: 1 + is_seen]


def test_normals_that_do_not_fit_are_left_out(mended) -> None:
    warning = "vertex primvar of 1 values where 4 are expected is left out: /M.normals"
    (shape,) = mended(mesh(QUAD + "normal3f[] normals = [(0, 0, 1)]"), warning).scene.shapes
    assert shape.normals is None


def test_prims_that_are_nested_a_thousand_deep_are_read(tmp_path: Path) -> None:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    Sdf.CreatePrimInLayer(layer, "/" + "/".join(f"a{k}" for k in range(1000)) + "/Ball").typeName = "Sphere"
    path = Sdf.Path("/")
    for name in [f"a{k}" for k in range(1000)] + ["Ball"]:
        path = path.AppendChild(name)
        layer.GetPrimAtPath(path).specifier = Sdf.SpecifierDef
    layer.Export(str(tmp_path / "deep.usdc"))
    (shape,) = read_scene(tmp_path / "deep.usdc").scene.shapes
    assert shape.name == str(path)


# Points that move

MOVING = """int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    uniform token subdivisionScheme = "none"
    point3f[] points.timeSamples = {{ 0: [(0,0,0), (1,0,0), (1,1,0)], 24: [(4,0,0), (5,0,0), (5,1,0)] }}
    {}
"""
VELOCITIES = (
    "vector3f[] velocities.timeSamples = { 0: [(10,0,0), (10,0,0), (10,0,0)], 24: [(0,0,0), (0,0,0), (0,0,0)] }\n"
)
ACCELERATIONS = (
    "vector3f[] accelerations.timeSamples = { 0: [(8,0,0), (8,0,0), (8,0,0)], 24: [(0,0,0), (0,0,0), (0,0,0)] }"
)


@pytest.mark.parametrize(
    ("lines", "frame", "x"),
    [
        ("", 12, 2.0),  # straight from 0 to 4
        (VELOCITIES, 12, 5.0),  # half a second at 10 a second
        (VELOCITIES, 0, 0.0),
        (VELOCITIES, 24, 4.0),
        (VELOCITIES + ACCELERATIONS, 12, 6.0),  # and 8 / 2 times a quarter
    ],
)
def test_points_go_on_by_their_velocities(read, lines: str, frame: float, x: float) -> None:
    reading = read(mesh(MOVING.format(lines)), frame=frame)
    np.testing.assert_allclose(reading.scene.shapes[0].points[:, 0], [x, x + 1, x + 1], rtol=1e-6)
    assert reading.warnings == ()


@pytest.mark.parametrize("frame", [None, "default"])
def test_at_no_frame_nothing_has_moved(read, frame: str | None) -> None:
    body = MOVING.format(VELOCITIES).replace(
        "point3f[] points.", "point3f[] points = [(9,0,0), (9,1,0), (9,1,1)]\npoint3f[] points."
    )
    expected = 0 if frame is None else 9
    assert read(mesh(body), frame=frame).scene.shapes[0].points[0, 0] == expected


def test_instances_with_velocities_are_read_where_there_is_no_frame(read) -> None:
    lines = """rel prototypes = </P/S>
    int[] protoIndices = [0]
    point3f[] positions.timeSamples = { 3: [(1, 0, 0)], 24: [(5, 0, 0)] }
    vector3f[] velocities.timeSamples = { 3: [(10, 0, 0)], 24: [(0, 0, 0)] }
    def Sphere "S" {
    }
"""
    (shape,) = read(f'def PointInstancer "P"\n{{\n{lines}}}\n').scene.shapes
    np.testing.assert_array_equal(shape.object_to_world[:3, 3], [1, 0, 0])


@pytest.mark.parametrize(
    ("lines", "warning", "x"),
    [
        (
            "vector3f[] velocities.timeSamples = { 0: [(10,0,0)], 24: [(0,0,0)] }",
            "has 1 entries; accepted: 3, as of points; they are left out: /M.velocities",
            2.0,
        ),
        (
            "vector3f[] velocities.timeSamples = { 6: [(10,0,0), (10,0,0), (10,0,0)] }",
            "velocity samples are not aligned with position samples; they are left out: /M",
            2.0,
        ),
        (
            VELOCITIES + "vector3f[] accelerations.timeSamples = { 0: [(8,0,0)], 24: [(0,0,0)] }",
            "found [1] accelerations, but expected [3]; they are left out: /M",
            5.0,
        ),
    ],
)
def test_velocities_that_do_not_fit_are_left_out(mended, lines: str, warning: str, x: float) -> None:
    reading = mended(mesh(MOVING.format(lines)), warning, frame=12)
    assert reading.scene.shapes[0].points[0, 0] == pytest.approx(x)


# Cameras


def rig(scale: str, camera: str) -> str:
    """A camera at z = 300 of a space with a scale, and a ball of radius 50 there."""
    place = 'double3 xformOp:translate = (0, 0, 300)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    return (
        f'def Xform "Shot"\n{{\nfloat3 xformOp:scale = {scale}\nuniform token[] xformOpOrder = ["xformOp:scale"]\n'
        f'def Sphere "Ball"\n{{\ndouble radius = 50\n}}\ndef Camera "Cam"\n{{\n{camera}\n{place}\n}}\n}}\n'
    )


FILM = """float focalLength = 35
    float horizontalAperture = 24
    float verticalAperture = 18
    float horizontalApertureOffset = 2
"""
CLIPPED = FILM + "float2 clippingRange = (10, 1000)"
LENS = FILM + "float fStop = 1\nfloat focusDistance = 250\n"
PARALLEL = 'token projection = "orthographic"\nfloat horizontalAperture = 2000\nfloat verticalAperture = 1000\n'


@pytest.mark.parametrize(
    "body", [FILM + "float2 clippingRange = (10, 1000)", LENS, PARALLEL], ids=["clip", "lens", "ortho"]
)
@pytest.mark.parametrize("scale", [0.01, 30.0, -2.0])
def test_a_scale_above_a_camera_scales_all_of_it(read, body: str, scale: float) -> None:
    whole, scaled = (read(rig(f"({s}, {s}, {s})", body), camera="").scene.camera for s in (1.0, scale))
    size = abs(scale)
    parallel = whole.projection == "orthographic"
    expected = np.array(whole.window(64, 48)) * (size if parallel else 1)
    np.testing.assert_allclose(scaled.window(64, 48), expected, rtol=1e-6)
    np.testing.assert_allclose(scaled.clipping_range, np.array(whole.clipping_range) * size, rtol=1e-6)
    assert scaled.focus_distance == pytest.approx(whole.focus_distance * size, rel=1e-6)
    assert scaled.lens_radius == pytest.approx(whole.lens_radius * size, rel=1e-6)
    assert scaled.pixel_aspect_ratio == 1


@pytest.mark.parametrize("body", [FILM, PARALLEL], ids=["pinhole", "ortho"])
def test_an_uneven_scale_stretches_the_picture(read, body: str) -> None:
    """The ray of a pixel is that of the camera's own space under the whole matrix, which is what Hydra inverts."""
    plain, uneven = (read(rig(s, body), camera="").scene.camera for s in ("(1, 1, 1)", "(2, 0.5, 3)"))
    for width, height in ((64, 64), (200, 50)):
        left, right, bottom, top = plain.window(width, height)
        if body is FILM:
            expected = left * 2 / 3, right * 2 / 3, bottom * 0.5 / 3, top * 0.5 / 3
        else:
            expected = left * 2, right * 2, bottom * 0.5, top * 0.5
        np.testing.assert_allclose(uneven.window(width, height), expected, rtol=1e-6)


def test_a_pinhole_below_an_even_scale_is_as_it_was(read) -> None:
    whole, scaled = (read(rig(f"({s}, {s}, {s})", FILM), camera="").scene.camera for s in (1.0, 0.3))
    assert scaled.window(64, 48) == whole.window(64, 48)
    assert scaled.is_pinhole


def test_clipping_that_cuts_everything_is_told(read) -> None:
    reading = read(rig("(0.01, 0.01, 0.01)", FILM + "float2 clippingRange = (400, 1000)"), camera="")
    assert reading.warnings == (
        "clippingRange cuts all that there is: in the world's units it is (4, 10), and what is before the camera is at "
        "(2.5, 3.5): /Shot/Cam",
    )
    assert read(rig("(0.01, 0.01, 0.01)", FILM + "float2 clippingRange = (340, 1000)"), camera="").warnings == ()


@pytest.mark.parametrize(
    ("line", "warning", "key", "value"),
    [
        ("float focalLength = 0", "focalLength: = 0; accepted: > 0; 50 is used", "focal_length", 50),
        (
            "float horizontalAperture = -1",
            "horizontalAperture: = -1; accepted: > 0; 20.955 is used",
            "horizontal_aperture",
            20.955,
        ),
        ("float fStop = -2", "fStop: = -2; accepted: >= 0; 0 is used", "f_stop", 0),
        (
            "float2 clippingRange = (3, 2)",
            "clippingRange: = (3, 2); accepted: two numbers, 0 <= near < far; it is left out",
            "clipping_range",
            (0, math.inf),
        ),
        (
            'token projection = "fisheye"',
            "projection: = fisheye; accepted: perspective, orthographic; perspective is used",
            "projection",
            "perspective",
        ),
        (
            "float exposure:time = -1",
            ": exposure, exposure:time, exposure:iso, exposure:fStop and exposure:responsivity come to a scale of -1; "
            "accepted: finite and > 0; 1 is used",
            "exposure_scale",
            1,
        ),
    ],
)
def test_a_camera_is_mended(mended, line: str, warning: str, key: str, value: object) -> None:
    name, _, text = warning.partition(": ")
    path = f"/Film.{name}" if name else "/Film"
    reading = mended(f'def Camera "Film"\n{{\n{line}\n}}\n' + BALL, f"{text}: {path}", camera="")
    assert getattr(reading.scene.camera, key) == value


def test_a_value_that_was_asked_for_is_not_mended(tmp_path: Path) -> None:
    path = write(tmp_path, HEADER + 'def Camera "Film"\n{\nfloat focalLength = -2\n}\n' + BALL)
    assert read_scene(path).scene.camera.focal_length == 50
    with pytest.raises(SceneError, match=r"/Film.focalLength = -1; accepted: > 0"):
        read_scene(path, edits={"/Film.focalLength": -1.0})


def test_a_camera_that_cannot_be_is_left_out_unless_it_is_asked_for(read) -> None:
    prims = (
        'def Camera "Flat"\n{\nfloat3 xformOp:scale = (1, 0, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]\n}\n'
        + BALL
    )
    reading = read(prims, camera="")
    assert reading.scene.camera.name == "default camera"
    (warning,) = reading.warnings
    assert warning.endswith("; the view is from the front and holds everything: /Flat")
    with pytest.raises(SceneError, match="/Flat: camera_to_world must be"):
        read(prims, camera="", chosen="/Flat")


# Render settings and metadata

SETTINGS = """def RenderSettings "Settings"
{
    uniform int2 resolution = (64, 48)
    rel products = [</Product>]
    rel camera = </Y/B>
}
def RenderProduct "Product"
{
    rel camera = </A>
    rel orderedVars = [</Var>]
}
def RenderVar "Var"
{
    uniform string sourceName = "Ci"
}
"""


@pytest.mark.parametrize(
    ("old", "new", "warning", "camera"),
    [
        ("camera = </A>", "camera = </Gone>", "= /Gone; accepted: the path of a Camera; {}: /Product.camera", "/Y/B"),
        (
            "[</Product>]",
            "[</Gone>, </Product>]",
            "= /Gone; accepted: the paths of RenderProducts; {}: /Settings.products",
            "/A",
        ),
        ("[</Var>]", "[</Var>, </A>]", "= /A; accepted: the paths of RenderVars; {}: /Product.orderedVars", "/A"),
        (
            "(64, 48)",
            "(64, 0)",
            "= (64, 0); accepted: two integers in [1, 65536]; {}: /Settings.resolution",
            "/A",
        ),
        (
            "rel products",
            'uniform token[] includedPurposes = ["default", "beauty"]\nrel products',
            "holds beauty; accepted: default, render, proxy, guide; default is used: /Settings.includedPurposes",
            "/A",
        ),
    ],
)
def test_render_settings_are_mended(mended, old: str, new: str, warning: str, camera: str) -> None:
    reading = mended(TWO_CAMERAS + SETTINGS.replace(old, new, 1) + BALL, warning.format("it is left out"), camera="")
    assert reading.scene.camera.name == camera
    assert reading.resolution == (None if "(64, 0)" in new else (64, 48))
    assert reading.sources == ("Ci",)


@pytest.mark.parametrize(
    ("line", "warning"),
    [
        ("metersPerUnit = -1", "metersPerUnit = -1; accepted: > 0; 0.01 is used: /"),
        ("metersPerUnit = inf", "metersPerUnit = inf; accepted: > 0; 0.01 is used: /"),
        ('upAxis = "z"', "upAxis = z; accepted: Y, Z; Z is used: /"),
        (
            "startTimeCode = nan",
            "startTimeCode = nan; accepted: a finite number; each attribute's earliest sample is used: /",
        ),
    ],
)
def test_metadata_are_mended(read, line: str, warning: str) -> None:
    key = line.split(maxsplit=1)[0]
    kept = "\n".join(known for known in HEADER.splitlines() if key not in known)
    header = kept.replace("(\n", f"(\n    {line}\n", 1) + "\n"
    reading = read(BALL, header=header)
    assert reading.warnings == (as_told(warning),)
    assert reading.up_axis == ("Z" if "z" in line else "Y")
    assert reading.scene.meters_per_unit == (0.01 if "meters" in line else 1)
    with pytest.raises(SceneError, match=f"/: {key} = "):
        read(BALL, header=header, strict=True)


def test_a_unit_that_is_stored_as_float_is_read(tmp_path: Path) -> None:
    path = tmp_path / "double.usdc"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 0.25)
    UsdGeom.Sphere.Define(stage, "/Ball")
    stage.Save()
    # In crate files a value that float32 holds stands beside the number of its type: 9 is double and 8 float.
    value = struct.pack("<fH", 0.25, 0)
    data = path.read_bytes()
    assert data.count(value + b"\x09\x40") == 1
    (tmp_path / "float.usdc").write_bytes(data.replace(value + b"\x09\x40", value + b"\x08\x40"))
    assert read_scene(tmp_path / "float.usdc").scene.meters_per_unit == 0.25


def test_what_cannot_be_parsed_stays_refused(tmp_path: Path) -> None:
    path = write(tmp_path, HEADER + CAMERA + DOME + 'def Sphere "Ball"\n{\n')
    with pytest.raises(SceneError, match=r"stage.usda"):
        read_scene(path)


def test_what_usd_quotes_of_a_damaged_file_may_be_no_text(tmp_path) -> None:
    path = tmp_path / "stage.usda"
    path.write_bytes(b'#usda 1.0\n\xbe\xff def "A" { \xbe = }\n')
    with pytest.raises(SceneError, match="no text"):
        read_scene(path)
