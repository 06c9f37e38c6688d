"""What is authored is what is read, in every file format, and a bad value authors nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdShade, UsdUtils

from fgf_warp.errors import SceneError
from fgf_warp.scene import Medium
from usd_scenes import schema
from usd_scenes.authoring import author_fgf_medium, author_interchange
from usd_scenes.reader import read_scene
from usd_scenes.validation import validate_stage

VALUES = {
    "mean_extinction": 3.7,
    "albedo": (0.9, 0.8, 0.7),
    "asymmetry": -0.35,
    "phase_function": "two_lobe",
    "back_asymmetry": -0.8,
    "back_weight": 0.25,
    "hurst": 0.3,
    "white_noise_scale": 0.01,
    "outer_scale": 40.0,
    "extinction_color": (1.0, 0.5, 0.25),
    "transport": "renewal",
    "line_variance": "exact",
    "priority": 3,
}


@pytest.fixture
def stage() -> Usd.Stage:
    schema.register()
    stage = Usd.Stage.CreateInMemory()
    material = UsdShade.Material.Define(stage, "/Look")
    ball = UsdGeom.Sphere.Define(stage, "/Ball").GetPrim()
    UsdShade.MaterialBindingAPI.Apply(ball).Bind(material)
    return stage


@pytest.mark.parametrize("suffix", ["usda", "usdc", "usd"])
def test_values_survive_each_file_format(stage: Usd.Stage, tmp_path: Path, suffix: str) -> None:
    author_fgf_medium(stage.GetPrimAtPath("/Look"), **VALUES)
    path = tmp_path / f"stage.{suffix}"
    stage.Export(str(path))
    (medium,) = read_scene(path).scene.media
    assert medium == Medium(name="/Look", **VALUES)


def test_kappa_replaces_the_white_noise_scale(stage: Usd.Stage, tmp_path: Path) -> None:
    author_fgf_medium(UsdShade.Material.Get(stage, "/Look"), mean_extinction=1, kappa=0.625)
    stage.Export(str(tmp_path / "stage.usda"))
    (medium,) = read_scene(tmp_path / "stage.usda").scene.media
    assert medium.line_law.kappa == 0.625


def test_phase_functions_survive(stage: Usd.Stage, tmp_path: Path) -> None:
    author_fgf_medium(stage.GetPrimAtPath("/Look"), mean_extinction=1, phase_function="draine", draine_alpha=0.7)
    stage.Export(str(tmp_path / "stage.usda"))
    (medium,) = read_scene(tmp_path / "stage.usda").scene.media
    assert (medium.phase_function, medium.draine_alpha) == ("draine", 0.7)


def test_every_value_but_none_is_authored(stage: Usd.Stage) -> None:
    prim = stage.GetPrimAtPath("/Look")
    author_fgf_medium(prim, mean_extinction=2)
    authored = {name for name in schema.MEDIUM_ATTRIBUTES.values() if prim.GetAttribute(name).HasAuthoredValue()}
    left = {"inputs:fgf:outerScale", "inputs:fgf:kappa", "fgf:transport"}
    assert authored == set(schema.MEDIUM_ATTRIBUTES.values()) - left
    assert prim.GetAttribute("fgf:boundary").HasAuthoredValue()


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"asymmetry": 1.0}, r"/Look: g = 1; accepted: in \(-1, 1\)"),
        ({"hurst": 0.0}, "/Look: H = 0; accepted: at least 0.01 away from 0"),
        ({"boundary": "glass"}, "/Look: boundary = 'glass'; accepted: none, surface"),
    ],
)
def test_a_bad_value_authors_nothing(stage: Usd.Stage, bad: dict, message: str) -> None:
    before = stage.GetRootLayer().ExportToString()
    with pytest.raises(SceneError, match=message):
        author_fgf_medium(stage.GetPrimAtPath("/Look"), **{"mean_extinction": 1.0, **bad})
    assert stage.GetRootLayer().ExportToString() == before


def test_a_prim_that_is_no_material_is_refused(stage: Usd.Stage) -> None:
    with pytest.raises(SceneError, match="/Ball: FgfMediumAPI applies to a Material, and this is a Sphere"):
        author_fgf_medium(stage.GetPrimAtPath("/Ball"), mean_extinction=1)


def test_reauthoring_replaces_the_values(stage: Usd.Stage, tmp_path: Path) -> None:
    author_fgf_medium(stage.GetPrimAtPath("/Look"), **VALUES)
    author_fgf_medium(stage.GetPrimAtPath("/Look"), **{**VALUES, "asymmetry": 0.5})
    stage.Export(str(tmp_path / "stage.usdc"))
    (medium,) = read_scene(tmp_path / "stage.usdc").scene.media
    assert medium == replace(Medium(name="/Look", **VALUES), asymmetry=0.5)


def test_numbers_may_come_as_numpy_or_lists():
    stage = Usd.Stage.CreateInMemory()
    material = UsdShade.Material.Define(stage, "/M")
    author_fgf_medium(
        material,
        mean_extinction=np.float32(2.0),
        albedo=np.array([0.5, 0.25, 1.0]),
        hurst=np.float64(-0.25),
        extinction_color=[1, 2, 3],
    )
    assert material.GetPrim().GetAttribute("inputs:fgf:albedo").Get() == Gf.Vec3f(0.5, 0.25, 1.0)
    assert material.GetPrim().GetAttribute("inputs:fgf:extinctionColor").Get() == Gf.Vec3f(1, 2, 3)


@pytest.mark.parametrize("wrong", [dict(albedo=0.9), dict(hurst="a"), dict(priority=1.5), dict(albedo=(1.0, 1.0))])
def test_values_of_the_wrong_kind_author_nothing(wrong):
    stage = Usd.Stage.CreateInMemory()
    material = UsdShade.Material.Define(stage, "/M")
    with pytest.raises(SceneError, match="/M: "):
        author_fgf_medium(material, **(dict(mean_extinction=2.0) | wrong))
    assert not material.GetPrim().GetAppliedSchemas()


def test_interchange_names_the_classical_medium_of_the_same_means(stage: Usd.Stage) -> None:
    author_fgf_medium(stage.GetPrimAtPath("/Look"), **VALUES)
    author_interchange(stage.GetPrimAtPath("/Look"))
    volume, output, _ = UsdShade.Material.Get(stage, "/Look").ComputeVolumeSource()
    assert (volume.GetShaderId(), output) == ("ND_volume", "out")
    (function,) = (source.source for source in volume.GetInput("vdf").GetConnectedSources()[0])
    function = UsdShade.Shader(function.GetPrim())
    assert function.GetShaderId() == "ND_anisotropic_vdf"
    absorption, scattering = (np.array(function.GetInput(name).Get()) for name in ("absorption", "scattering"))
    extinction = VALUES["mean_extinction"] * np.array(VALUES["extinction_color"])
    np.testing.assert_allclose(absorption + scattering, extinction, rtol=1e-6)
    np.testing.assert_allclose(scattering / extinction, VALUES["albedo"], rtol=1e-6)
    assert function.GetInput("anisotropy").Get() == pytest.approx(0.75 * -0.35 + 0.25 * -0.8)


def test_interchange_connects_the_network_to_the_medium(stage: Usd.Stage) -> None:
    author_fgf_medium(stage.GetPrimAtPath("/Look"), **VALUES)
    author_interchange(stage.GetPrimAtPath("/Look"))
    material = UsdShade.Material.Get(stage, "/Look")
    shader, output, _ = material.ComputeVolumeSource("fgf")
    assert (shader.GetShaderId(), output) == ("FgfMedium", "volume")
    inputs = {name for name in schema.MEDIUM_ATTRIBUTES.values() if name.startswith("inputs:")}
    sources = {str(UsdShade.Utils.GetValueProducingAttributes(i)[0].GetName()) for i in shader.GetInputs()}
    assert sources == inputs - {"inputs:fgf:kappa"}
    assert {i.GetBaseName() for i in material.GetInterfaceInputs()} >= {"fgf:hurst", "fgf:albedo"}


@pytest.mark.parametrize("how", ["usda", "usdc", "usdz", "flattened"])
def test_interchange_survives_and_is_not_read(stage: Usd.Stage, tmp_path: Path, how: str) -> None:
    author_fgf_medium(stage.GetPrimAtPath("/Look"), **VALUES)
    author_interchange(stage.GetPrimAtPath("/Look"))
    path = tmp_path / f"stage.{'usdc' if how in ('usdz', 'flattened') else how}"
    stage.GetRootLayer().Export(str(path))
    if how == "usdz":
        path = tmp_path / "packed.usdz"
        assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "stage.usdc"), str(path))
    if how == "flattened":
        outer = Usd.Stage.CreateNew(str(tmp_path / "outer.usda"))
        outer.GetRootLayer().subLayerPaths.append("./stage.usdc")
        path = tmp_path / "flat.usda"
        outer.Flatten().Export(str(path))
    reading = read_scene(path)
    assert reading.scene.media == (Medium(name="/Look", **VALUES),)
    assert not [text for text in reading.warnings if "volume" in text]
    kept = Usd.Stage.Open(str(path))
    material = UsdShade.Material.Get(kept, "/Look")
    assert material.ComputeVolumeSource()[0].GetShaderId() == "ND_volume"
    assert material.ComputeVolumeSource("fgf")[0].GetShaderId() == "FgfMedium"


def test_interchange_is_valid(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "stage.usda"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    material = UsdShade.Material.Define(stage, "/World/Look")
    ball = UsdGeom.Sphere.Define(stage, "/World/Ball").GetPrim()
    UsdGeom.Camera.Define(stage, "/World/Camera").AddTranslateOp().Set((0, 0, 9))
    UsdLux.DomeLight.Define(stage, "/World/Sky")
    UsdShade.MaterialBindingAPI.Apply(ball).Bind(material)
    author_fgf_medium(material, mean_extinction=1)
    author_interchange(material)
    stage.Save()
    assert validate_stage(tmp_path / "stage.usda").findings == ()


def test_interchange_needs_a_medium(stage: Usd.Stage) -> None:
    with pytest.raises(SceneError, match="/Look: FgfMediumAPI is not applied; author a medium first"):
        author_interchange(stage.GetPrimAtPath("/Look"))
    assert not stage.GetPrimAtPath("/Look").GetChildren()
