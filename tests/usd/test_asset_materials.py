"""Materials of third-party stages come to what their authors mean."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

from fgf_warp.scene import PrimvarInput, Surface, TextureInput
from usd_scenes import schema
from usd_scenes.reader import StageReading, read_scene, read_stage

ASSETS = Path(__file__).parents[3] / "shared" / "usd_assets"
WORKING_GROUP = "usd-wg__assets"
IMAGING = "PixarAnimationStudios__OpenUSD/pxr/usdImaging/usdImagingGL/testenv"
pytestmark = pytest.mark.skipif(
    not ASSETS.is_dir(), reason="the third-party stages of ../shared/usd_assets are not on this machine"
)


@cache
def reading(path: str) -> StageReading:
    return read_scene(ASSETS / path)


def surfaces(path: str) -> dict[str, Surface]:
    """By the last name of the shape's path."""
    return {shape.name.rpartition("/")[2]: shape.surface for shape in reading(path).scene.shapes}


def notes_on_materials(path: str) -> list[str]:
    words = ("shader", "texture", "connected", "picture", "material", "normal map")
    return [text for text in reading(path).warnings if any(word in text for word in words)]


def test_transforms_of_textures() -> None:
    path = f"{WORKING_GROUP}/test_assets/TextureTransformTest/TextureTransformTest.usd"
    found = surfaces(path)
    moved = found["Offset_UV"].diffuse
    assert (moved.transform, moved.primvar) == (((1.0, 0.0, 0.5), (0.0, 1.0, -0.5)), "st")
    assert (moved.texture.wrap_s, moved.texture.wrap_t) == ("clamp", "clamp")
    turned = np.array(found["Rotation"].diffuse.transform)
    # It turns about the corner of glTF's coordinates, st = (0, 1), which so stays where it is.
    np.testing.assert_allclose(turned @ (0, 1, 1), (0, 1), atol=1e-6)
    assert np.linalg.det(turned[:, :2]) == pytest.approx(1)
    everything = np.array(found["All"].diffuse.transform)
    assert np.linalg.det(everything[:, :2]) == pytest.approx(1.5**2)
    assert notes_on_materials(path) == []
    check = found["Rotation___Correct"].diffuse
    assert check.transform == ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert check.texture.wrap_s == "repeat"


def test_pictures_are_shared_by_the_shapes_that_show_them() -> None:
    path = f"{WORKING_GROUP}/test_assets/TextureCoordinateTest/TextureCoordinateTest.usda"
    found = [shape.surface.diffuse for shape in reading(path).scene.shapes]
    textured = [diffuse for diffuse in found if isinstance(diffuse, TextureInput)]
    assert len(textured) == 4
    assert len({id(found.texture.tiles[0, 0]) for found in textured}) == 1
    assert textured[0].texture.tiles[0, 0].is_srgb


@pytest.mark.parametrize("variant", ["Fancy", "Utah"])
def test_the_teapot(variant: str) -> None:
    schema.register()
    stage = Usd.Stage.Open(str(ASSETS / WORKING_GROUP / "full_assets/Teapot/Teapot.usd"), Usd.Stage.LoadAll)
    session = stage.GetSessionLayer()
    with Usd.EditContext(stage, session):
        stage.GetDefaultPrim().GetVariantSet("modelVariant").SetVariantSelection(variant)
    found = read_stage(stage)
    assert found.scene.shapes
    assert all(shape.surface.ior != 1 for shape in found.scene.shapes)
    assert not [text for text in found.warnings if "texture" in text or "connected" in text]


def test_materials_of_subsets() -> None:
    path = f"{IMAGING}/testUsdImagingGLGeomSubsets/testUsdImagingGLGeomSubsets.usda"
    found = [shape.surface for shape in reading(path).scene.shapes]
    assert any(isinstance(surface.diffuse, PrimvarInput) for surface in found)
    assert [text for text in notes_on_materials(path) if "HwPtexTexture_1" in text]


def test_materials_inside_of_instances() -> None:
    shapes = reading(f"{IMAGING}/testUsdImagingGLInstancing/instancedCubes.usda").scene.shapes
    assert {shape.surface.diffuse for shape in shapes} == {(0.0, 0.0, 1.0)}
    assert len({id(shape.surface) for shape in shapes}) < len(shapes)


def test_a_material_for_another_renderer() -> None:
    path = "Autodesk__arnold-usd/testsuite/test_0026/data/scene.usda"
    assert notes_on_materials(path) == ["material without a surface: the display color is used: /materials/material"]
