"""The third-party stages of ../shared/usd_assets: all are read and rendered, and are where USD says they are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from fgf_warp import renderer
from fgf_warp.features import RenderFeatures, required_features
from fgf_warp.renderer import render
from fgf_warp.scene import Scene, shape_bounds
from fgf_warp.settings import RenderSettings
from generators.stage import image_size
from tests.conftest import SHARED
from tests.usd.one_kernel import union, with_lights_of
from usd_scenes.reader import StageReading, read_scene, read_stage
from usd_scenes.validation import validate_stage

ASSETS = SHARED / "usd_assets"
SUFFIXES = {".usd", ".usda", ".usdc", ".usdz"}
FILES = sorted(path for path in ASSETS.rglob("*") if path.suffix.lower() in SUFFIXES) if ASSETS.is_dir() else []
INSTANCING = ASSETS / "PixarAnimationStudios__OpenUSD/pxr/usdImaging/usdImagingGL/testenv/testUsdImagingGLInstancing"

WIDTH, HEIGHT_MAX = 128, 256
SETTINGS = RenderSettings(width=WIDTH, height=WIDTH, spp=2, max_depth=16, aovs=frozenset())

pytestmark = pytest.mark.skipif(not FILES, reason="the third-party stages of ../shared/usd_assets are not here")


@cache
def reading_of(path: Path) -> StageReading:
    return read_scene(path)


@pytest.fixture(scope="module")
def few_kernels() -> Iterator[None]:
    """Makes the renderer build one kernel for all stages with the same kinds of lights."""
    shared = union(required_features(reading_of(path).scene, SETTINGS) for path in FILES)

    def features(scene: Scene, settings: RenderSettings) -> RenderFeatures:
        return with_lights_of(shared, required_features(scene, settings))

    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(renderer, "required_features", features)
        yield


def short(path: Path) -> str:
    return "/".join(path.parts[-2:])


@pytest.mark.parametrize("path", FILES, ids=short)
def test_every_stage_is_read_without_a_word_on_the_terminal(path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert read_scene(path).scene.lights
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("path", FILES, ids=short)
def test_every_stage_is_valid_but_for_warnings(path: Path) -> None:
    """And validating it comes to the same scene as reading it, with a finding for each of its warnings."""
    found = validate_stage(path)
    assert [str(finding) for finding in found.findings if finding.severity == "error"] == []
    reading = reading_of(path)
    assert [shape.name for shape in found.reading.scene.shapes] == [shape.name for shape in reading.scene.shapes]
    # Of an old file USD warns where it is opened first, be it only once.
    warnings = [text for text in reading.warnings if not text.startswith("USD: ")]
    assert [text for text in found.reading.warnings if not text.startswith("USD: ")] == warnings
    assert sum(finding.validator.endswith("Scene.NotAsWritten") for finding in found.findings) >= len(warnings)


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=short)
def test_every_stage_is_rendered(path: Path, few_kernels: None) -> None:
    scene, resolution = reading_of(path).scene, reading_of(path).resolution
    width, height = image_size(scene.camera, resolution, WIDTH, None)
    result = render(scene, replace(SETTINGS, width=width, height=min(height, HEIGHT_MAX)))
    assert np.isfinite(result.radiance).all()
    assert (result.radiance >= 0).all()


@pytest.mark.parametrize("path", FILES, ids=short)
def test_shapes_are_where_usd_puts_them(path: Path) -> None:
    """The boxes of prims that are drawn once, against USD's own transforms of what the prims say."""
    stage, scene = Usd.Stage.Open(str(path)), reading_of(path).scene
    time = default_time(stage)
    transforms = UsdGeom.XformCache(time)
    names = Counter(shape.name for shape in scene.shapes)
    for shape in scene.shapes:
        prim = stage.GetPrimAtPath(shape.name)
        if names[shape.name] > 1 or shape.instance >= 0 or not prim:
            continue
        if prim.IsA(UsdGeom.Subset):
            prim = prim.GetParent()
        corners = local_corners(prim, time)
        world = (
            np.pad(corners, ((0, 0), (0, 1)), constant_values=1) @ np.array(transforms.GetLocalToWorldTransform(prim))
        )[:, :3]
        low, high = world.min(axis=0), world.max(axis=0)
        error = 1e-5 * (high - low).max() + 1e-6 * np.abs(world).max()
        found_low, found_high = shape_bounds(shape)
        assert (found_low >= low - error).all(), shape.name
        assert (found_high <= high + error).all(), shape.name
        if fills_its_corners(prim) and shape.name == prim.GetPath():
            assert (found_low <= low + error).all(), shape.name
            assert (found_high >= high - error).all(), shape.name


@pytest.mark.parametrize("path", FILES, ids=short)
def test_all_that_is_drawn_is_in_the_box_that_usd_computes(path: Path) -> None:
    """That of the whole stage, with all of its instancers, which holds boxes of boxes: so it may be larger."""
    shapes = reading_of(path).scene.shapes
    if not shapes:
        return
    stage = Usd.Stage.Open(str(path))
    stage.SetEditTarget(stage.GetSessionLayer())
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.PrimAllPrimsPredicate):
        if prim.IsA(UsdGeom.Boundable):
            UsdGeom.Boundable(prim).GetExtentAttr().Block()  # What is authored may be stale.
    boxes = UsdGeom.BBoxCache(default_time(stage), [UsdGeom.Tokens.default_, UsdGeom.Tokens.render])
    box = boxes.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
    if box.IsEmpty():  # Of instancers whose extent is not authored it does not always know.
        return
    low, high = np.array(box.GetMin()), np.array(box.GetMax())
    bounds = np.array([shape_bounds(shape) for shape in shapes])
    error = 1e-5 * (high - low).max()
    assert (bounds[:, 0].min(axis=0) >= low - error).all()
    assert (bounds[:, 1].max(axis=0) <= high + error).all()


def default_time(stage: Usd.Stage) -> Usd.TimeCode:
    has_start = stage.HasAuthoredMetadata("startTimeCode")
    return Usd.TimeCode(stage.GetStartTimeCode()) if has_start else Usd.TimeCode.EarliestTime()


def local_corners(prim: Usd.Prim, time: Usd.TimeCode) -> np.ndarray:
    """(n, 3) points in the prim's space whose box, however it is turned, holds the prim."""
    if prim.IsA(UsdGeom.Mesh):
        mesh = UsdGeom.Mesh(prim)
        used = np.unique(np.array(mesh.GetFaceVertexIndicesAttr().Get(time)))
        return np.array(mesh.GetPointsAttr().Get(time), dtype=np.float64)[used]
    extent = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(prim), time)
    return np.array(list(product(*np.array(extent, dtype=np.float64).T)))


def fills_its_corners(prim: Usd.Prim) -> bool:
    """True where the shape's box is that of the corners, as of polygons, and as `shape_bounds` has it of solids."""
    if prim.IsA(UsdGeom.Mesh):
        return UsdGeom.Mesh(prim).GetSubdivisionSchemeAttr().Get() == UsdGeom.Tokens.none
    return prim.GetTypeName() in ("Sphere", "Cube", "Cylinder")


# Units and axes

CONFIGURATION = ASSETS / "usd-wg__assets/test_assets/foundation/stage_configuration"


@pytest.mark.parametrize(
    ("name", "meters"), [("metersPerUnit_1", 1), ("metersPerUnit_10", 10), ("metersPerUnit_mix", 100)]
)
def test_the_root_layer_alone_says_how_long_a_unit_is(name: str, meters: float) -> None:
    assert reading_of(CONFIGURATION / "metersPerUnit" / f"{name}.usda").scene.meters_per_unit == meters


@pytest.mark.parametrize(("axis", "is_told"), [("Y", False), ("Z", False), ("X", True), ("invalid", True)])
def test_up_axes_are_read_or_told(axis: str, is_told: bool) -> None:
    warnings = reading_of(CONFIGURATION / "upAxis" / f"upAxis_{axis}.usda").warnings
    assert any(text.startswith(f"upAxis = {axis}; accepted") for text in warnings) == is_told


# Instancing


@pytest.mark.parametrize("name", ["instancedCubes", "instancedCubes2", "nestedInstancedCubes"])
def test_instancing_is_of_no_effect_on_what_is_read(name: str) -> None:
    stage = Usd.Stage.Open(str(INSTANCING / f"{name}.usda"))
    instanced = read_stage(stage).scene
    plain = read_stage(without_instances(stage)).scene
    assert len(instanced.shapes) == len(plain.shapes) > 1
    for one, other in zip(instanced.shapes, plain.shapes, strict=True):
        assert (one.name, one.surface) == (other.name, other.surface)
        np.testing.assert_array_equal(shape_bounds(one), shape_bounds(other))


def test_instanced_cubes_are_those_of_the_file_without_instancing() -> None:
    """Pixel for pixel, once the sizes agree: the second file makes its first three cubes 0.2, 3 and 4 wide."""
    instanced = read_scene(INSTANCING / "instancedCubes2.usda").scene
    other = Usd.Stage.Open(str(INSTANCING / "instancedCubes2NoInstancing.usda"))
    other.SetEditTarget(other.GetSessionLayer())
    for name, size in (("pCube1", 0.4), ("pCube2", 2.0), ("pCube3", 2.0)):
        UsdGeom.Cube(without_instances(other).GetPrimAtPath(f"/Cubes/{name}")).GetSizeAttr().Set(size)
    plain = read_stage(other).scene
    assert len(instanced.shapes) == len(plain.shapes) == 7
    np.testing.assert_array_equal(render(instanced, SETTINGS).radiance, render(plain, SETTINGS).radiance)


def without_instances(stage: Usd.Stage) -> Usd.Stage:
    """The same stage, edited."""
    while instances := [prim for prim in stage.Traverse() if prim.IsInstance()]:
        for prim in instances:
            prim.SetInstanceable(False)
    return stage
