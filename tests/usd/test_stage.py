"""Traversal, time, and what a stage that cannot be read says."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdUtils

from fgf_warp.errors import SceneError
from fgf_warp.scene import count_open_edges
from tests.usd.conftest import write
from tests.usd.prims import CAMERA, HEADER
from usd_scenes.examples import STAGES, stage_names, stage_path, trefoil_tube
from usd_scenes.reader import OpenStages, read_scene, read_stage
from usd_scenes.reader.bounds import scene_bounds
from usd_scenes.reader.triangulation import cut_faces, signed_volume

# Traversal


def names(reading) -> list[str]:
    return [shape.name for shape in reading.scene.shapes]


def test_invisible_and_inactive_prims_are_skipped(read) -> None:
    prims = """def Xform "Hidden"
{
    token visibility = "invisible"
    def Sphere "Inside"
    {
        token visibility = "inherited"
    }
}
def Sphere "Off" (
    active = false
)
{
}
over Sphere "Over"
{
}
class Sphere "Class"
{
}
def Sphere "On"
{
}
"""
    assert names(read(prims)) == ["/On"]


def test_visibility_is_read_at_the_frame(read) -> None:
    prims = 'def Sphere "S"\n{\n token visibility.timeSamples = { 1: "inherited", 5: "invisible" }\n}'
    assert names(read(prims, frame=1)) == ["/S"]
    assert names(read(prims, frame=5)) == []


def test_purposes_are_filtered_and_inherited(read) -> None:
    prims = "".join(
        f'def Xform "{purpose}"\n{{\n uniform token purpose = "{purpose}"\n def Sphere "S"\n {{\n }}\n}}\n'
        for purpose in ("default", "render", "proxy", "guide")
    )
    assert names(read(prims)) == ["/default/S", "/render/S"]
    assert names(read(prims, purposes=("proxy",))) == ["/proxy/S"]
    with pytest.raises(SceneError, match="purposes = beauty; accepted: default, render, proxy, guide"):
        read(prims, purposes=("beauty",))


INSTANCES = """class Xform "Model"
{
    def Sphere "Ball" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        rel material:binding = </Model/Look>
    }
    def Material "Look" (
        prepend apiSchemas = ["FgfMediumAPI"]
    )
    {
        float inputs:fgf:meanExtinction = 2
    }
}
def Xform "One" (
    instanceable = true
    references = </Model>
)
{
}
def Xform "Two" (
    instanceable = true
    references = </Model>
)
{
    double3 xformOp:translate = (7, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""


def test_instances_are_read_in_their_places_and_share_a_medium(read) -> None:
    scene = read(INSTANCES).scene
    assert [shape.name for shape in scene.shapes] == ["/One/Ball", "/Two/Ball"]
    assert [shape.object_to_world[0, 3] for shape in scene.shapes] == [0, 7]
    assert [shape.medium for shape in scene.shapes] == [0, 0]
    assert [medium.name for medium in scene.media] == ["/One/Look"]


def test_the_prototypes_of_a_point_instancer_are_not_drawn(read) -> None:
    reading = read('def PointInstancer "P"\n{\n def Sphere "Prototype"\n {\n }\n}')
    assert names(reading) == []
    assert "instancer without prototypes, protoIndices, positions draws nothing: /P" in reading.warnings


def test_samples_are_read_at_the_start_the_earliest_or_the_frame(read) -> None:
    prims = 'def Sphere "S"\n{\n double radius.timeSamples = { 1: 1, 3: 3, 5: 5 }\n}'
    started = HEADER.replace("(\n", "(\n    startTimeCode = 2\n", 1)
    readings = read(prims), read(prims, header=started), read(prims, frame=4)
    assert [reading.scene.shapes[0].object_to_world[0, 0] for reading in readings] == [1, 2, 4]
    with pytest.raises(SceneError, match="frame = nan; accepted: a finite number"):
        read(prims, frame=float("nan"))


def test_stages_can_be_kept_open_between_frames(tmp_path: Path) -> None:
    path = write(tmp_path, HEADER + 'def Sphere "S"\n{\n double radius.timeSamples = { 1: 1, 2: 2 }\n}')
    with OpenStages():
        radii = [read_scene(path, frame=frame).scene.shapes[0].object_to_world[0, 0] for frame in (1, 2)]
        assert Sdf.Layer.Find(str(path))
    assert radii == [1, 2]
    assert not Sdf.Layer.Find(str(path))


def test_meters_per_unit_is_recorded_and_checked(read) -> None:
    assert read("").scene.meters_per_unit == 1
    assert read("", header="#usda 1.0\n").scene.meters_per_unit == 0.01
    nothing = HEADER.replace("metersPerUnit = 1", "metersPerUnit = 0")
    reading = read("", header=nothing)
    assert "metersPerUnit = 0; accepted: > 0; 0.01 is used: /" in reading.warnings
    assert reading.scene.meters_per_unit == 0.01
    with pytest.raises(SceneError, match=r"/: metersPerUnit = 0; accepted: > 0$"):
        read("", header=nothing, strict=True)


def test_up_axes_that_are_none_are_told(read) -> None:
    reading = read("", camera="", header=HEADER.replace('"Y"', '"X"'))
    assert "upAxis = X; accepted: Y, Z; Y is used: /" in reading.warnings
    assert reading.scene.camera.camera_to_world[1, 1] > 0.9


@pytest.mark.parametrize("name", ["stage.usd", "stage.usdc", "stage.usdz"])
def test_a_stage_is_the_same_in_every_format(read, tmp_path: Path, name: str) -> None:
    written = write(tmp_path, HEADER + CAMERA + 'def Sphere "Ball"\n{\n double radius = 3\n}\n')
    path = tmp_path / name
    if name.endswith(".usdz"):
        assert UsdUtils.CreateNewUsdzPackage(str(written), str(path))
    else:
        Usd.Stage.Open(str(written)).Export(str(path))
    scene, expected = read_scene(path).scene, read_scene(written).scene
    assert scene.shapes[0].object_to_world[0, 0] == expected.shapes[0].object_to_world[0, 0] == 3
    assert scene.camera.name == expected.camera.name


# Stages that cannot be read


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("gone.usda", None, "gone.usda: no such file"),
        ("notes.txt", "hello", "notes.txt: not a USD file; accepted: .usd, .usda, .usdc and .usdz"),
        ("noise.usd", "\x00\x01noise", "noise.usd: not a USD file"),
        ("empty.usda", "", "empty.usda"),
        ("syntax.usda", '#usda 1.0\ndef Xform "A"\n{\n    float x = = 3\n}\n', "syntax.usda:4:.*float x = = 3"),
        (
            "asset.usda",
            '#usda 1.0\ndef "A" (\n references = @away.usda@\n)\n{\n}\n',
            "/A: Could not open asset @.*away.usda@",
        ),
        (
            "prim.usda",
            '#usda 1.0\ndef "A" (\n references = </B>\n)\n{\n}\n',
            "/A: Unresolved reference prim path .*</B>",
        ),
        (
            "circle.usda",
            '#usda 1.0\ndef "A" (\n references = </B>\n)\n{\n}\ndef "B" (\n references = </A>\n)\n{\n}\n',
            "circle.usda: /[AB]: Cycle detected",
        ),
        (
            "both.usda",  # the circle is named first, as it may be the cause of the rest
            '#usda 1.0\ndef "A" (\n references = @away.usda@\n)\n{\n}\ndef "B" (\n references = </C>\n)\n{\n}\n'
            'def "C" (\n references = </B>\n)\n{\n}\n',
            "both.usda: /[BC]: Cycle detected",
        ),
        (
            "layer.usda",
            "#usda 1.0\n(\n subLayers = [@layer.usda@]\n)\n",
            "layer.usda: /: Sublayer hierarchy .* has cycles",
        ),
        (
            "load.usda",
            '#usda 1.0\ndef "A" (\n payload = @away.usdc@\n)\n{\n}\n',
            "/A: Could not open asset @.*away.usdc@",
        ),
    ],
)
def test_unreadable_files_say_so_in_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, text: str | None, message: str
) -> None:
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.raises(SceneError, match=message) as caught:
        read_scene(path, strict=True)
    assert name in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    assert capfd.readouterr() == ("", "")


MISTYPED = [
    ("Sphere", 'string radius = "wide"', '/P.radius = "wide"; accepted: > 0'),
    ("Sphere", "float primvars:displayColor = 3", "/P.primvars:displayColor is no array"),
    (
        "Sphere",
        'double3 xformOp:translate = (nan, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]',
        "/P: the world transform holds numbers that are not finite",
    ),
    ("Sphere", 'uniform token[] xformOpOrder = ["xformOp:none"]', "/P.xformOpOrder: "),
    ("Mesh", "float[] points = [1, 2]", "/P.points is no array; accepted: an array of entries of 3 numbers"),
    ("Camera", 'string focalLength = "long"', '/P.focalLength = "long"; accepted: > 0'),
    ("RectLight", 'string inputs:intensity = "bright"', '/P.inputs:intensity = "bright"; accepted: >= 0'),
    ("RectLight", "float inputs:color = 1", "/P.inputs:color = 1; accepted: three numbers >= 0"),
    ("RenderSettings", "float resolution = 3", "/P.resolution is no array; accepted: an array of numbers"),
]


@pytest.mark.parametrize(("kind", "attribute", "message"), MISTYPED)
def test_values_of_the_wrong_type_are_refused_by_name_strictly(read, kind: str, attribute: str, message: str) -> None:
    prim = f'def {kind} "P"\n{{\n{attribute}\n}}\n'
    with pytest.raises(SceneError, match="stage.usda: " + message):
        read(prim, camera="", strict=True)
    assert any("; " in warning and "/P" in warning for warning in read(prim, camera="").warnings)


def test_a_folder_is_no_stage(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="no such file"):
        read_scene(tmp_path)


def test_usds_warnings_are_handed_on_and_kept_off_the_terminal(read, capfd: pytest.CaptureFixture[str]) -> None:
    reading = read('def Sphere "S"\n{\n rel material:binding = </M>\n}\ndef Material "M"\n{\n}')
    assert any(text.startswith("USD: ") and "/S" in text for text in reading.warnings)
    assert capfd.readouterr() == ("", "")


def test_an_open_stage_is_read_under_its_layers_name() -> None:
    stage = Usd.Stage.CreateInMemory("mine.usda")
    UsdGeom.Sphere.Define(stage, "/S").CreateRadiusAttr(-1)
    with pytest.raises(SceneError, match=r"mine.usda: /S.radius = -1; accepted: > 0"):
        read_stage(stage, strict=True)


# Stages that come with the package, and those of others


@pytest.mark.parametrize("name", stage_names())
def test_shipped_stages_read_without_a_warning(name: str) -> None:
    reading = read_scene(stage_path(name))
    assert reading.warnings == ()
    assert reading.resolution is not None
    assert reading.scene.media
    assert (STAGES / f"{name}.usda").stat().st_size < 100_000


def test_a_name_that_is_no_stage_is_refused() -> None:
    with pytest.raises(SceneError, match="no stage 'teapot'; there are: cloud_block, glass, knot"):
        stage_path("teapot")


def test_the_cloud_clears_as_hurst_rises_to_zero() -> None:
    scene = read_scene(stage_path("cloud_block")).scene
    (medium,) = scene.media
    (block,) = (shape for shape in scene.shapes if shape.medium is not None)
    assert medium.name == "/World/Looks/Cloud"
    thickness = np.ptp([corner[0] for corner in scene_bounds([block])])
    laws = [transmittance(medium, hurst, thickness) for hurst in (-0.5, -0.25, -0.05, -0.01)]
    assert laws[0] < 0.005 and laws[-1] > 0.4
    assert laws == sorted(laws)


def transmittance(medium, hurst: float, t: float) -> float:
    """Tr(t) = (1 + t v / sigma_m)^(-sigma_m^2 / v) of the medium at another H."""
    v = replace(medium, hurst=hurst).line_law.variance(t)
    return (1 + t * v / medium.mean_extinction) ** (-(medium.mean_extinction**2) / v)


def test_the_knots_mesh_is_the_one_that_is_documented() -> None:
    stage = Usd.Stage.Open(str(stage_path("knot")))
    mesh = UsdGeom.Mesh.Get(stage, "/World/Knot")
    points, quads = trefoil_tube(around=14, along=112, tube_radius=0.26, radius=0.4)
    np.testing.assert_allclose(mesh.GetPointsAttr().Get(), points, atol=1e-4)
    np.testing.assert_array_equal(mesh.GetFaceVertexIndicesAttr().Get(), quads.reshape(-1))


def test_the_trefoil_is_closed_and_faces_outwards() -> None:
    points, quads = trefoil_tube()
    triangles = quads.reshape(-1)[cut_faces(points, np.full(len(quads), 4), quads.reshape(-1))]
    assert count_open_edges(points, triangles) == 0
    t = np.linspace(0, 2 * np.pi, 100_001)
    spine = np.column_stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)])
    length = np.linalg.norm(np.diff(spine, axis=0), axis=1).sum()
    assert signed_volume(points, triangles) == pytest.approx(np.pi * 0.35**2 * length, rel=0.05)


def test_a_reference_to_a_file_that_this_usd_cannot_read_is_left_out(read, tmp_path: Path) -> None:
    prim = 'def Xform "Looks" (\n    references = @../looks.mtlx@\n)\n{\n}\n'
    (tmp_path / "looks.mtlx").write_text("<materialx/>")
    warnings = [warning for warning in read(prim).warnings if "looks.mtlx" in warning]
    assert warnings == ["this USD cannot read looks.mtlx; what it refers to is left out: /Looks"]
    with pytest.raises(SceneError, match="/Looks: this USD cannot read"):
        read(prim, strict=True)


def test_reading_imports_no_renderer() -> None:
    script = "import sys, usd_scenes.reader, usd_scenes.examples; print('warp' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
    assert done.stderr == ""  # libraries tell of what is left over at the end
