"""The small inputs of ../shared/cases, each with the value that is right."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fgf_warp import renderer
from fgf_warp.errors import FgfError, SceneError
from fgf_warp.features import RenderFeatures, required_features
from fgf_warp.renderer import render
from fgf_warp.scene import DomeLight, Mesh, Scene, shape_bounds
from fgf_warp.settings import Aov, RenderSettings
from generators.commands.plan import make_plan
from tests.conftest import SHARED
from tests.usd.one_kernel import union, with_lights_of
from usd_scenes.reader import StageReading, read_scene
from usd_scenes.validation import Asked, validate_stage

CASES = SHARED / "cases"
USD = CASES / "usd"
VIEW = ("no camera: ", "no light: ", "no geometry: ")
"""Of what a stage may well leave to the renderer."""
SETTINGS = RenderSettings(width=24, height=24, spp=256, max_depth=16, aovs=frozenset({Aov.ALBEDO}))
TOLERANCE = 0.006
"""Four standard errors of a mean of 24 x 24 pixels x 256 samples that are 0 or 1, at most 0.0013 each."""
CAMERAS = ("Cam", "CamFocus", "CamOrtho")
EMITTER = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
)
def Camera "Camera"
{{
    token projection = "orthographic"
    float horizontalAperture = 4
    float verticalAperture = 4
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def Mesh "Screen" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    rel material:binding = </Look>
}}
def Material "Look"
{{
    token outputs:surface.connect = </Look/Surface.outputs:surface>
    def Shader "Surface"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 0)
        color3f inputs:specularColor = (0, 0, 0)
        int inputs:useSpecularWorkflow = 1
        color3f inputs:emissiveColor.connect = </Look/Picture.outputs:rgb>
        token outputs:surface
    }}
    def Shader "Picture"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        token inputs:wrapS = "repeat"
        token inputs:wrapT = "repeat"
        float3 outputs:rgb
    }}
}}
"""

pytestmark = pytest.mark.skipif(not USD.is_dir(), reason="the small inputs of ../shared/cases are not here")


def read(name: str, **asked: object) -> StageReading:
    return read_scene(USD / f"{name}.usda", **asked)


def told(reading: StageReading) -> list[str]:
    """The warnings but for those of what a stage leaves to the renderer."""
    return [text for text in reading.warnings if not text.startswith(VIEW)]


@pytest.fixture(scope="module")
def few_kernels() -> Iterator[None]:
    """Makes the renderer build one kernel for all stages here with the same kinds of lights."""
    shared = union(required_features(scene, SETTINGS) for scene in rendered_scenes())

    def features(scene: Scene, settings: RenderSettings) -> RenderFeatures:
        return with_lights_of(shared, required_features(scene, settings))

    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(renderer, "required_features", features)
        yield


def rendered_scenes() -> Iterator[Scene]:
    for name in ("overlap_along_view_0.2725", "overlap_two_prims_0.2725", "inner_same", "instance_primvars"):
        yield read(name).scene
    for name in ("cam_scaled", "cam_unscaled"):
        for camera in CAMERAS:
            yield read(name, camera=camera).scene


# Bodies that overlap


@pytest.mark.parametrize(
    ("name", "depth"), [("overlap_along_view_0.2725", 1.3), ("overlap_two_prims_0.2725", 1.3), ("inner_same", 1.0)]
)
def test_bodies_of_one_mesh_or_medium_that_overlap_are_their_union(name: str, depth: float, few_kernels: None) -> None:
    assert render(read(name).scene, SETTINGS).radiance.mean() == pytest.approx(math.exp(-depth), abs=TOLERANCE)


def test_a_mesh_that_encloses_no_volume_is_refused_by_name() -> None:
    with pytest.raises(SceneError, match="/Box"):
        read("double_layer_reversed")


# Attributes and values


def test_attributes_of_old_lights_are_named_as_they_are_called_now() -> None:
    reading = read("old_lights")
    text = "\n".join(told(reading))
    for name in ("intensity", "color", "angle", "exposure", "width", "shaping:cone:angle", "texture:file"):
        assert f"inputs:{name}" in text, name
    for path in ("/Env", "/Sun", "/R"):
        assert path in text


@pytest.mark.parametrize(("name", "color"), [("dc_ulp", (1, 0.5, 0.5)), ("dc_over", (1, 0.5, 1))])
def test_a_display_color_beyond_one_is_cut_with_a_warning(name: str, color: tuple[float, ...]) -> None:
    reading = read(name)
    assert reading.scene.shapes[0].surface.diffuse == pytest.approx(color, abs=1e-7)
    assert any("displayColor" in text and "/Quad" in text for text in told(reading))


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_camera_below_a_scale_sees_what_it_sees_without(camera: str, few_kernels: None) -> None:
    scaled, plain = (
        render(read(name, camera=camera).scene, SETTINGS).radiance for name in ("cam_scaled", "cam_unscaled")
    )
    assert np.ptp(plain) > 0.05
    np.testing.assert_allclose(scaled.mean(axis=(0, 1)), plain.mean(axis=(0, 1)), rtol=0.01)
    assert np.abs(scaled - plain).mean() < 0.01


def test_a_color_space_in_another_spelling_is_taken_with_a_warning() -> None:
    assert any("sourceColorSpace" in text and "srgb" in text and "sRGB" in text for text in told(read("cs_lower")))


@pytest.mark.parametrize(("name", "light"), [("spot_k12000", "/L"), ("temperature", "/World/Sun")])
def test_a_temperature_beyond_the_table_is_that_of_its_end(name: str, light: str, tmp_path: Path) -> None:
    reading = read(name)
    assert any("colorTemperature" in text and "10000" in text and light in text for text in told(reading))
    text = (USD / f"{name}.usda").read_text().replace("= 12000", "= 10000").replace("= 11000", "= 10000")
    (tmp_path / "end.usda").write_text(text)
    end = read_scene(tmp_path / "end.usda")
    assert told(end) == []
    assert reading.scene.lights == end.scene.lights


def test_guides_give_no_light() -> None:
    reading = read("F7")
    assert "/Guides/NotShown" not in [light.name for light in reading.scene.lights]
    assert [shape.name for shape in reading.scene.shapes] == ["/Ball"]


def test_what_is_harmless_is_not_warned_of() -> None:
    assert told(read("false_warnings")) == []


# Meshes


def test_a_face_of_two_corners_is_no_face() -> None:
    (odd,), (plain,) = (read(name).scene.shapes for name in ("ngon2_sub", "quad_sub"))
    low, high = shape_bounds(odd)
    assert (low[1], high[1]) == (-1, 1)
    np.testing.assert_array_equal(corners_of(odd), corners_of(plain))
    np.testing.assert_array_equal(odd.triangles, plain.triangles)
    assert any("/M" in text for text in told(read("ngon2_sub")))
    assert odd.surface.diffuse == plain.surface.diffuse or colors_of(odd) == colors_of(plain) == {(0, 1, 0)}


def corners_of(mesh: Mesh) -> np.ndarray:
    return np.asarray(mesh.points)[mesh.triangles]


def colors_of(mesh: Mesh) -> set[tuple[float, ...]]:
    return {tuple(map(float, row)) for primvar in mesh.primvars.values() for row in np.asarray(primvar).reshape(-1, 3)}


def test_a_face_without_corners_is_left_out() -> None:
    reading = read("zero_corner_face")
    assert reading.scene.shapes == ()
    assert any("/Empty" in text for text in told(reading))
    with_triangle = read("zero_corner_face_and_triangle")
    (mesh,) = with_triangle.scene.shapes
    assert len(mesh.triangles) >= 1
    assert any("/Empty" in text for text in told(with_triangle))


def test_points_move_by_their_velocities_between_samples() -> None:
    (mesh,) = read("velocity", frame=12).scene.shapes
    low, high = shape_bounds(mesh)
    assert (low[0], high[0]) == pytest.approx((5, 6), abs=1e-6)


def test_instances_have_the_primvars_of_their_own(few_kernels: None) -> None:
    albedo = render(read("instance_primvars").scene, SETTINGS).aovs[Aov.ALBEDO]
    of_two = [half.reshape(-1, 3)[half.sum(axis=2).argmax()] for half in np.split(albedo, 2, axis=1)]
    np.testing.assert_allclose(of_two, [(1, 0, 0), (0, 0, 1)], atol=0.01)


# Pictures


def test_a_pixel_of_a_sky_that_is_not_finite_is_the_largest_there_is() -> None:
    reading = read_scene(USD / "hdri" / "sun_inf.usda")
    (dome,) = (light for light in reading.scene.lights if isinstance(light, DomeLight))
    values = np.sort(dome.image.pixels[..., :3].reshape(-1, 3).max(axis=1))
    assert values[-1] == 65504
    np.testing.assert_allclose(values[:-1], 0.05, rtol=1e-3)
    assert any("sun_inf.exr" in text and "1 " in text and "65504" in text for text in told(reading))


@pytest.mark.parametrize(("name", "linear"), [("rgb16_srgb", 0.216), ("rgb8_gama1", 0.502)])
def test_what_a_picture_says_of_its_own_encoding_holds(name: str, linear: float, tmp_path: Path) -> None:
    (tmp_path / "screen.usda").write_text(EMITTER.format(file=USD / "tex" / f"{name}.png"))
    scene = read_scene(tmp_path / "screen.usda").scene
    found = render(scene, replace(SETTINGS, spp=1)).radiance
    np.testing.assert_allclose(found, linear, atol=0.002)


# What is wrong in one place


@pytest.mark.parametrize(
    ("name", "wrong", "kept"),
    [
        ("missing_reference", ("/World/Gone", "not_there.usda"), ["/World/Ball"]),
        ("one_bad_mesh", ("/World/NoPoints",), ["/World/Ball"]),
        ("subset", ("/Quad/part", "indices"), ["/Quad"]),
        ("point_light", ("/World/Point", "radius"), ["/World/Ball"]),
    ],
)
def test_what_is_wrong_in_one_place_costs_that_place(name: str, wrong: tuple[str, ...], kept: list[str]) -> None:
    reading = read(name)
    assert any(all(word in text for word in wrong) for text in told(reading)), reading.warnings
    assert {shape.name.split("/part")[0] for shape in reading.scene.shapes} == set(kept)
    with pytest.raises(FgfError, match=wrong[0]):
        read(name, strict=True)
    path = USD / f"{name}.usda"
    warnings, errors = (validate_stage(path, asked=Asked(strict=strict)).findings for strict in (False, True))
    assert any(finding.path.startswith(wrong[0]) and finding.severity == "warning" for finding in warnings)
    assert not [finding for finding in warnings if finding.severity == "error"]
    assert any(finding.path.startswith(wrong[0]) and finding.severity == "error" for finding in errors)


def test_a_stage_of_which_nothing_is_wrong_is_read() -> None:
    reading = read("metadata", strict=True)
    assert told(reading) == []
    assert [shape.name for shape in reading.scene.shapes] == ["/Ball"]


# Configs


def test_an_anchored_boolean_is_what_it_says() -> None:
    loaded, _ = make_plan(CASES / "config" / "F8.yaml", None, "cpu")
    assert loaded.config.png is False


def test_a_value_that_is_set_changes_no_other_place_that_shares_it() -> None:
    _, made = make_plan(CASES / "config" / "F9.yaml", ["axes.sigma_m.linspace=[10, 20, 2]"], "cpu")
    assert {sample.parameters["S_w"] for sample in made.samples} == {1, 4}
    assert {sample.parameters["sigma_m"] for sample in made.samples} == {10, 20}
