"""Instances stand where USD puts them and share what they are made of."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from math import prod
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, Vt

from fgf_warp.errors import SceneError, UnsupportedFeatureError
from fgf_warp.scene import MAX_CONTAINERS, Mesh, Shape, Solid
from fgf_warp.scene.placements import squared
from fgf_warp.upload import number_motions
from tests.usd.prims import as_told
from usd_scenes.reader import read_scene, read_stage
from usd_scenes.reader import shapes as shapes_reader
from usd_scenes.reader.bounds import scene_bounds
from usd_scenes.reader.instancing import MAX_INSTANCES
from usd_scenes.reader.stage import survey_stage

OPENUSD = "PixarAnimationStudios__OpenUSD/pxr/usdImaging/usdImagingGL/testenv"
THIRD_PARTY = Path(__file__).resolve().parents[3] / "shared" / "usd_assets"
NEEDS_THIRD_PARTY = pytest.mark.skipif(
    not THIRD_PARTY.is_dir(), reason="the third-party stages of ../shared/usd_assets are not on this machine"
)

TRIANGLE = """def Mesh "M"
        {
            point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
            int[] faceVertexCounts = [3]
            int[] faceVertexIndices = [0, 1, 2]
            uniform token subdivisionScheme = "none"
        }"""


def instancer(stage: Usd.Stage, path: str, prototypes: list[str], count: int, seed: int) -> UsdGeom.PointInstancer:
    """Instances of all prototypes, moved, turned and scaled."""
    rng = np.random.default_rng(seed)
    prim = UsdGeom.PointInstancer.Define(stage, path)
    prim.CreatePrototypesRel().SetTargets(prototypes)
    prim.CreateProtoIndicesAttr([int(i) for i in rng.integers(0, len(prototypes), count)])
    prim.CreatePositionsAttr([Gf.Vec3f(*map(float, p)) for p in rng.normal(size=(count, 3))])
    turns = [Gf.Quatf(*map(float, q / np.linalg.norm(q))) for q in rng.normal(size=(count, 4))]
    prim.CreateOrientationsfAttr(turns)
    prim.CreateScalesAttr([Gf.Vec3f(*map(float, s)) for s in rng.uniform(0.5, 2, size=(count, 3))])
    return prim


def mesh(stage: Usd.Stage, path: str) -> UsdGeom.Mesh:
    prim = UsdGeom.Mesh.Define(stage, path)
    prim.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    prim.CreateFaceVertexCountsAttr([3])
    prim.CreateFaceVertexIndicesAttr([0, 1, 2])
    prim.CreateSubdivisionSchemeAttr("none")
    return prim


def matrix(gf: Gf.Matrix4d) -> np.ndarray:
    return np.array(gf).T


@dataclass(frozen=True, eq=False)
class Placed:
    """One place of a shape: (4, 4) matrices, and its number in its instancer."""

    name: str
    shape: Mesh | Solid
    matrix: np.ndarray
    closing: np.ndarray | None
    instance: int
    is_instance: bool = False


def placed(shapes: Iterable[Shape]) -> list[Placed]:
    """Each instance by itself."""
    found = []
    for shape in shapes:
        if isinstance(shape, Mesh):
            found.append(Placed(shape.name, shape, np.eye(4), None, shape.instance))
        elif isinstance(shape, Solid):
            found.append(Placed(shape.name, shape, shape.object_to_world, shape.closing, shape.instance))
        else:
            closing = shape.object_to_world if shape.closing is None else shape.closing
            numbers = np.full(shape.count, -1) if shape.numbers is None else shape.numbers
            found += [
                Placed(shape.name, shape.prototype, *places, int(number), is_instance=True)
                for *places, number in zip(squared(shape.object_to_world), squared(closing), numbers, strict=True)
            ]
    return found


def read_shapes(stage: Usd.Stage) -> list[Placed]:
    return placed(read_stage(stage).scene.shapes)


def test_point_instances_are_those_of_usd() -> None:
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.Xform.Define(stage, "/World").AddRotateXYZOp().Set((10, 20, 30))
    prim = instancer(stage, "/World/P", ["/World/P/A", "/World/P/B"], 20, 1)
    prim.AddTranslateOp().Set((1, 2, 3))
    UsdGeom.Xform.Define(stage, "/World/P/A").AddScaleOp().Set((1, 2, 1))
    mesh(stage, "/World/P/A/M").AddTranslateOp().Set((0, 0, 5))
    UsdGeom.Cube.Define(stage, "/World/P/B").AddTranslateOp().Set((4, 0, 0))
    prim.CreateIdsAttr(list(range(100, 120)))
    prim.CreateInvisibleIdsAttr([103, 117])
    prim.DeactivateId(105)

    shapes = read_shapes(stage)
    chosen, hidden = np.array(prim.GetProtoIndicesAttr().Get()), {3, 5, 17}
    found = {shape.instance: shape for shape in shapes}
    assert sorted(found) == sorted(set(range(20)) - hidden)
    everywhere = prim.ComputeInstanceTransformsAtTime(
        Usd.TimeCode.EarliestTime(),
        Usd.TimeCode.EarliestTime(),
        UsdGeom.PointInstancer.IncludeProtoXform,
        UsdGeom.PointInstancer.IgnoreMask,
    )
    base = matrix(UsdGeom.XformCache().GetLocalToWorldTransform(prim.GetPrim()))
    inner = np.eye(4)
    inner[2, 3] = 5
    for number, shape in found.items():
        expected = base @ matrix(everywhere[number])
        if chosen[number] == 0:
            assert shape.is_instance and shape.name == "/World/P/A/M"
            np.testing.assert_allclose(shape.matrix, expected @ inner, atol=1e-12)
        else:
            assert isinstance(shape.shape, Solid) and shape.name == "/World/P/B"
            np.testing.assert_allclose(shape.matrix, expected, atol=1e-12)
    assert len({id(shape.shape) for shape in shapes if shape.is_instance}) == 1


def test_nested_instancers_multiply_and_count_in_the_outermost() -> None:
    stage = Usd.Stage.CreateInMemory()
    outer = instancer(stage, "/Outer", ["/Outer/Proto"], 4, 2)
    UsdGeom.Xform.Define(stage, "/Outer/Proto").AddTranslateOp().Set((0, 1, 0))
    inner = instancer(stage, "/Outer/Proto/Inner", ["/Outer/Proto/Inner/M"], 3, 3)
    inner.AddRotateZOp().Set(25.0)
    mesh(stage, "/Outer/Proto/Inner/M")

    shapes = read_shapes(stage)
    assert [shape.instance for shape in shapes] == list(np.repeat(np.arange(4), 3))
    time = Usd.TimeCode.EarliestTime()
    outers = [matrix(m) for m in outer.ComputeInstanceTransformsAtTime(time, time)]
    inners = [matrix(m) for m in inner.ComputeInstanceTransformsAtTime(time, time)]
    turn = matrix(inner.ComputeLocalToWorldTransform(time))
    turn = np.linalg.inv(matrix(UsdGeom.XformCache().GetLocalToWorldTransform(inner.GetPrim().GetParent()))) @ turn
    expected = [o @ turn @ i for o in outers for i in inners]
    np.testing.assert_allclose([shape.matrix for shape in shapes], expected, atol=1e-12)


@pytest.mark.parametrize("count", [1, 2])
def test_meshes_have_the_numbers_of_their_copies_also_where_there_is_one(count: int) -> None:
    stage = Usd.Stage.CreateInMemory()
    instancer(stage, "/P", ["/P/M"], count, 4)
    mesh(stage, "/P/M")
    assert [shape.instance for shape in read_shapes(stage)] == list(range(count))


def test_prototypes_elsewhere_are_also_drawn_unless_they_are_abstract() -> None:
    for path, is_drawn in (("/Protos/M", True), ("/Class/M", False), ("/Over/M", False)):
        stage = Usd.Stage.CreateInMemory()
        UsdGeom.Xform.Define(stage, "/Protos")
        stage.CreateClassPrim("/Class")
        stage.OverridePrim("/Over")
        mesh(stage, path)
        stage.GetPrimAtPath("/Over").SetSpecifier(Sdf.SpecifierOver)
        instancer(stage, "/P", [path], 3, 4)
        assert sorted(shape.instance for shape in read_shapes(stage)) == ([-1] if is_drawn else []) + [0, 1, 2]


def test_an_instancer_within_its_own_prototype_ends() -> None:
    stage = Usd.Stage.CreateInMemory()
    prim = instancer(stage, "/World/P", ["/World"], 2, 5)
    mesh(stage, "/World/M")
    assert prim
    reading = read_stage(stage)
    assert sorted(shape.instance for shape in placed(reading.scene.shapes)) == [-1, 0, 1]
    assert any("part of its own prototype" in text and "/World/P" in text for text in reading.warnings)


def test_invisible_parts_of_prototypes_and_purposes() -> None:
    stage = Usd.Stage.CreateInMemory()
    instancer(stage, "/P", ["/P/A"], 2, 6)
    mesh(stage, "/P/A/Seen")
    mesh(stage, "/P/A/Unseen").CreateVisibilityAttr("invisible")
    mesh(stage, "/P/A/Guide").CreatePurposeAttr("guide")
    assert {shape.name for shape in read_shapes(stage)} == {"/P/A/Seen"}


def test_velocities_move_instances_between_the_shutters_times(read) -> None:
    reading = read(
        f"""def PointInstancer "P"
{{
    int[] protoIndices = [0, 0]
    rel prototypes = </P/M>
    point3f[] positions.timeSamples = {{ 1: [(0, 0, 0), (5, 0, 0)] }}
    vector3f[] velocities.timeSamples = {{ 1: [(24, 0, 0), (0, 0, 0)] }}
    {TRIANGLE}
}}""",
        camera="""def Camera "Camera"
{
    double shutter:open = 0
    double shutter:close = 0.5
}
""",
        frame=1.0,
    )
    (shape,) = reading.scene.shapes
    np.testing.assert_allclose(shape.object_to_world[:, :, 3], [(0, 0, 0), (5, 0, 0)])
    np.testing.assert_allclose(shape.closing[:, :, 3], [(0.5, 0, 0), (5, 0, 0)])
    assert np.array_equal(number_motions([shape])[shape], [0, -1])


REST, LIFTED = "[(0, 0, 0), (1, 0, 0), (0, 1, 0)]", "[(0, 0, 1), (1, 0, 0), (0, 1, 0)]"


@pytest.mark.parametrize(
    ("lines", "is_told"),
    [
        (f"point3f[] points.timeSamples = {{1: {REST}, 2: {LIFTED}}}", True),
        (f"point3f[] points.timeSamples = {{1: {REST}, 2: {REST}}}", False),
        (f"point3f[] points = {REST}\n vector3f[] velocities = [(0, 0, 1), (0, 0, 0), (0, 0, 0)]", True),
    ],
)
@pytest.mark.parametrize("closing", [0, 0.5])
def test_points_that_move_while_the_shutter_is_open_are_named(read, lines: str, is_told: bool, closing: float) -> None:
    triangle = TRIANGLE.replace(f"point3f[] points = {REST}", lines)
    camera = f'def Camera "Camera"\n{{\n    double shutter:close = {closing}\n}}\n'
    warnings = read(triangle, camera=camera, frame=1.0).warnings
    text = "points that move while the shutter is open are not supported: they rest where they are at the frame: /M"
    assert (text in warnings) == (is_told and closing > 0)


def test_a_mesh_that_moves_is_an_instance_with_a_closing_transform(read) -> None:
    shutter = 'def Camera "Camera"\n{\n double shutter:open = 0\n double shutter:close = 1\n}\n'
    move = """double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 2: (4, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]"""
    prims = f'def Xform "X"\n{{\n {move}\n {TRIANGLE}\n def Sphere "S"\n{{\n}}\n}}\ndef Xform "Y"\n{{\n {TRIANGLE}\n}}'
    shapes = {shape.name: shape for shape in placed(read(prims, camera=shutter, frame=0.0).scene.shapes)}
    assert not shapes["/Y/M"].is_instance
    for name in ("/X/M", "/X/S"):
        np.testing.assert_allclose(shapes[name].closing[:3, 3], (2, 0, 0))
    assert isinstance(read(prims, frame=0.0).scene.shapes[0], Mesh)


class TestNativeInstances:
    """Prims of one prototype."""

    @staticmethod
    def stage(count: int) -> Usd.Stage:
        stage = Usd.Stage.CreateInMemory()
        stage.CreateClassPrim("/Asset")
        mesh(stage, "/Asset/M").AddTranslateOp().Set((0, 0, 1))
        for number in range(count):
            prim = UsdGeom.Xform.Define(stage, f"/I{number}")
            prim.GetPrim().GetReferences().AddInternalReference("/Asset")
            prim.GetPrim().SetInstanceable(True)
            prim.AddTranslateOp().Set((number, 0, 0))
        return stage

    def test_they_share_their_arrays(self) -> None:
        shapes = read_shapes(self.stage(3))
        assert [shape.name for shape in shapes] == ["/I0/M", "/I1/M", "/I2/M"]
        assert len({id(shape.shape) for shape in shapes}) == 1
        np.testing.assert_allclose([shape.matrix[:3, 3] for shape in shapes], [(i, 0, 1) for i in range(3)])

    def test_one_alone_is_a_mesh_in_the_world(self) -> None:
        (shape,) = read_shapes(self.stage(1))
        assert not shape.is_instance
        np.testing.assert_allclose(shape.shape.points[1], (1, 0, 1))

    def test_what_they_inherit_may_differ(self) -> None:
        stage = self.stage(3)
        color = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/I1")).CreatePrimvar(
            "displayColor", Sdf.ValueTypeNames.Color3fArray, "constant"
        )
        color.Set([(1, 0, 0)])
        first, second, third = (shape.shape for shape in read_shapes(stage))
        assert second.surface.diffuse == (1, 0, 0)
        assert first is third
        assert second is not first
        assert second.points is first.points
        assert second.triangles is first.triangles

    def test_as_prototypes_of_an_instancer(self) -> None:
        stage = self.stage(2)
        prim = instancer(stage, "/P", ["/I0"], 3, 7)
        shapes = [shape for shape in read_shapes(stage) if shape.instance >= 0]
        time = Usd.TimeCode.EarliestTime()
        expected = [matrix(m) @ _moved(0, 0, 1) for m in prim.ComputeInstanceTransformsAtTime(time, time)]
        np.testing.assert_allclose([shape.matrix for shape in shapes], expected, atol=1e-12)


def _moved(x: float, y: float, z: float) -> np.ndarray:
    moved = np.eye(4)
    moved[:3, 3] = x, y, z
    return moved


@pytest.mark.parametrize(
    ("lines", "left", "warning"),
    [
        (
            "int[] protoIndices = [0, 0, 0]",
            [],
            "has 2 entries; accepted: 3, as there are in protoIndices; the instancer is left out: /P.positions",
        ),
        (
            "int[] protoIndices = [0, 0]\nfloat3[] scales = [(1, 1, 1)]",
            [],
            "has 1 entries; accepted: 2, as there are in protoIndices; the instancer is left out: /P.scales",
        ),
        (
            "int[] protoIndices.timeSamples = {nan: [0, 0], 1: [0, 0]}",
            [],
            "has a sample at a time code that is not a number; the instancer is left out: /P.protoIndices",
        ),
        (
            "int64[] protoIndices = [0, 0]",
            [],
            "is of type int64[]; accepted: int[]; the instancer is left out: /P.protoIndices",
        ),
        (
            "int[] protoIndices = [0, 0]\nvector3f[] velocities = [(1, 0, 0)]",
            [0, 1],
            "1 entries, where there are 2 in protoIndices; nothing moves by it: /P.velocities",
        ),
        (
            "int[] protoIndices = [0, 7]",
            [0],
            "1 of 2 indices lie out of [0, 0], as 7 does, where there are 1 prototypes; those instances are left out: "
            "/P.protoIndices",
        ),
        (
            "int[] protoIndices = [0, 0]\nfloat3[] scales = [(1, inf, 1), (1, 1, 1)]",
            [1],
            "1 transforms hold numbers that are not finite; those instances are left out: /P",
        ),
        (
            "int[] protoIndices = [0, 0]\nint64[] ids = [1, 2, 3]\nint64[] invisibleIds = [2]",
            [0, 1],
            "3 entries, where there are 2 in protoIndices; no instance is hidden by its id: /P.ids",
        ),
        *(
            (
                f"int[] protoIndices = [0, 0]\n{ids}\nint64[] invisibleIds = [2]",
                [0, 1],
                "is no array of integers of 64 bits; no instance is hidden by its id: /P.ids",
            )
            for ids in ("int[] ids = [1, 2]", "unknown[] ids = [1, 2]", "unknown ids = 3")
        ),
    ],
)
def test_what_does_not_fit_costs_the_instances_that_it_is_of(read, lines: str, left: list[int], warning: str) -> None:
    body = f"point3f[] positions = [(0, 0, 0), (1, 0, 0)]\nrel prototypes = </P/M>\n{TRIANGLE}"
    prims = f'def PointInstancer "P"\n{{\n{lines}\n{body}\n}}'
    reading = read(prims)
    assert as_told(warning) in reading.warnings
    assert [shape.instance for shape in placed(reading.scene.shapes)] == left
    with pytest.raises(SceneError, match="/P"):
        read(prims, strict=True)


def test_what_is_missing_and_what_is_flat_is_named(read) -> None:
    body = f"point3f[] positions = [(0, 0, 0), (1, 0, 0), (2, 0, 0)]\n{TRIANGLE}\nint[] protoIndices = [0, 0, 1]"
    lines = "rel prototypes = [</P/M>, </Nowhere>]\nfloat3[] scales = [(1, 1, 1), (1, 0, 1), (1, 1, 1)]"
    reading = read(f'def PointInstancer "P"\n{{\n{body}\n{lines}\n}}')
    assert [shape.instance for shape in placed(reading.scene.shapes)] == [0]
    assert "the prototype /Nowhere is not there; its instances are left out: /P" in reading.warnings
    assert "the transform leaves no volume, and the prim is left out: /P/M" in reading.warnings


def nested(stage: Usd.Stage, counts: list[int]) -> None:
    """Instancers in the prototypes of instancers, so many of each in the one around it."""
    path = ""
    for count in counts:
        path += "/P"
        prim = UsdGeom.PointInstancer.Define(stage, path)
        prim.CreatePrototypesRel().SetTargets([f"{path}/P"])
        prim.CreateProtoIndicesAttr(Vt.IntArray(count, 0))
        prim.CreatePositionsAttr(Vt.Vec3fArray(count, Gf.Vec3f(0)))
    mesh(stage, f"{path}/P")


@pytest.mark.parametrize("counts", [[1000, 1000, 1000], [MAX_INSTANCES + 1], [MAX_INSTANCES // 2 + 1, 2]])
def test_too_many_instances_are_refused_before_they_are_made(counts: list[int]) -> None:
    stage = Usd.Stage.CreateInMemory()
    nested(stage, counts)
    shown = " x ".join(f"{count:,}" for count in counts)
    shown += f" = {prod(counts):,}" if len(counts) > 1 else ""
    message = f"{'/P' * len(counts)}: {shown} instances; accepted: at most 4,000,000 in a stage"
    with pytest.raises(UnsupportedFeatureError, match=re.escape(message)):
        read_stage(stage)
    assert [str(refusal) for refusal in survey_stage(stage).refusals] == [message]


def test_too_many_instances_of_several_prims_are_refused(monkeypatch) -> None:
    monkeypatch.setattr(shapes_reader, "MAX_INSTANCES", 50)
    stage = Usd.Stage.CreateInMemory()
    instancer(stage, "/P", ["/P/A", "/P/B"], 40, 1)
    for name in ("A", "B"):
        mesh(stage, f"/P/{name}/M")
        UsdGeom.Sphere.Define(stage, f"/P/{name}/S")
    with pytest.raises(UnsupportedFeatureError, match=r"instances the stage has \d+ shapes; accepted: at most 50"):
        read_stage(stage)


def test_more_instances_of_a_medium_than_there_are_bits_are_refused_by_name(read) -> None:
    medium = 'def Material "Look" (apiSchemas = ["FgfMediumAPI"])\n{\nfloat inputs:fgf:meanExtinction = 1\n}\n'
    ball = 'def Sphere "M" (apiSchemas = ["MaterialBindingAPI"])\n{\nrel material:binding = </Look>\n}'
    for count in (MAX_CONTAINERS, MAX_CONTAINERS + 1):
        positions = ", ".join(f"({3 * k}, 0, 0)" for k in range(count))
        body = f"point3f[] positions = [{positions}]\nint[] protoIndices = {[0] * count}\nrel prototypes = </P/M>"
        prims = f'{medium}def PointInstancer "P"\n{{\n{body}\n{ball}\n}}'
        if count == MAX_CONTAINERS:
            assert all(isinstance(shape, Solid) for shape in read(prims).scene.shapes)
        else:
            with pytest.raises(
                UnsupportedFeatureError, match="/P/M: a medium fills 33 instances, each of them a shape"
            ):
                read(prims)


def test_lights_of_instancers_are_named(read) -> None:
    body = "point3f[] positions = [(0, 0, 0)]\nint[] protoIndices = [0]\nrel prototypes = </P/L>\n"
    body += 'def SphereLight "L"\n{\n}'
    reading = read(f'def PointInstancer "P"\n{{\n{body}\n}}')
    assert "a light that is part of an instancer gives no light: /P/L" in reading.warnings


def corners(one: Placed) -> np.ndarray:
    """(m, 3, 3) in world space."""
    assert isinstance(one.shape, Mesh)
    return (one.shape.points @ one.matrix[:3, :3].T + one.matrix[:3, 3])[one.shape.triangles]


@NEEDS_THIRD_PARTY
@pytest.mark.parametrize("name", ["instancedCubes2", "nestedInstance", "nestedInstancedCubes", "instance3"])
def test_a_stage_without_its_instancing_is_the_same(name: str) -> None:
    stage = Usd.Stage.Open(str(THIRD_PARTY / OPENUSD / "testUsdImagingGLInstancing" / f"{name}.usda"))
    shared = {shape.name: shape for shape in read_shapes(stage)}
    stage.SetEditTarget(stage.GetSessionLayer())
    while instances := [prim for prim in stage.Traverse() if prim.IsInstance()]:
        instances[0].SetInstanceable(False)
    alone = {shape.name: shape for shape in read_shapes(stage)}
    assert shared and shared.keys() == alone.keys()
    for path, shape in alone.items():
        assert shape.shape.surface == shared[path].shape.surface
        if isinstance(shape.shape, Solid):
            np.testing.assert_allclose(shape.matrix, shared[path].matrix, atol=1e-12)
        else:
            np.testing.assert_allclose(corners(shape), corners(shared[path]), atol=1e-9)


@NEEDS_THIRD_PARTY
@pytest.mark.parametrize(
    ("name", "count"), [("pi_masking", 4), ("pi_pi", 24), ("pi_ni_pi", 9), ("ni_pi", 8), ("ni_pi_xform", 8)]
)
def test_third_party_instancers_have_the_count_and_box_of_usd(name: str, count: int) -> None:
    path = THIRD_PARTY / OPENUSD / "testUsdImagingGLPointInstancer" / f"{name}.usda"
    shapes = read_scene(path).scene.shapes
    assert len(placed(shapes)) == count
    stage = Usd.Stage.Open(str(path))
    boxes = UsdGeom.BBoxCache(Usd.TimeCode.EarliestTime(), ["default", "render"])
    box = boxes.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
    np.testing.assert_allclose(
        scene_bounds(shapes), (box.GetMin(), box.GetMax()), atol=1e-3
    )  # USD rounds boxes and orientations.
