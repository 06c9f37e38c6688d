"""FgfMediumAPI is registered, and its fallbacks and documentation are what the theory says."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from pxr import Sdf, Sdr, Usd, UsdShade

from fgf_warp.scene import PHASE_FUNCTIONS
from fgf_warp.theory.phase import DRAINE_ALPHA_MAX
from usd_scenes import schema

FALLBACKS = {
    "inputs:fgf:meanExtinction": 1.0,
    "inputs:fgf:extinctionColor": (1, 1, 1),
    "inputs:fgf:albedo": (1, 1, 1),
    "inputs:fgf:asymmetry": 0.0,
    "fgf:phaseFunction": "hg",
    "inputs:fgf:backAsymmetry": 0.0,
    "inputs:fgf:backWeight": 0.0,
    "inputs:fgf:draineAlpha": 0.0,
    "inputs:fgf:hurst": -0.5,
    "inputs:fgf:whiteNoiseScale": 0.0,
    "inputs:fgf:outerScale": None,
    "inputs:fgf:kappa": None,
    "fgf:transport": None,
    "fgf:lineVariance": "asymptotic",
    "fgf:boundary": "none",
    "fgf:priority": 0,
}


@pytest.fixture
def material() -> Iterator[Usd.Prim]:
    schema.register()
    stage = Usd.Stage.CreateInMemory()
    prim = UsdShade.Material.Define(stage, "/Look").GetPrim()
    prim.ApplyAPI(schema.SCHEMA_NAME)
    yield prim  # Prims do not keep their stage alive: it must not go out of scope here.


def test_fallbacks_are_read_back(material: Usd.Prim) -> None:
    assert {name: material.GetAttribute(name).Get() for name in FALLBACKS} == FALLBACKS


def test_the_schema_has_no_attribute_beyond_the_documented_ones() -> None:
    schema.register()
    definition = Usd.SchemaRegistry().FindAppliedAPIPrimDefinition(schema.SCHEMA_NAME)
    assert set(definition.GetPropertyNames()) == set(FALLBACKS)
    assert set(FALLBACKS) == {*schema.MEDIUM_ATTRIBUTES.values(), schema.BOUNDARY_ATTRIBUTE}


def test_every_attribute_is_documented_and_named_for_people(material: Usd.Prim) -> None:
    definition = Usd.SchemaRegistry().FindAppliedAPIPrimDefinition(schema.SCHEMA_NAME)
    for name in FALLBACKS:
        assert definition.GetPropertyMetadata(name, "displayName"), name
        assert len(definition.GetPropertyDocumentation(name)) > 30, name


def test_limits_are_those_of_the_law(material: Usd.Prim) -> None:
    assert material.GetAttribute("inputs:fgf:kappa").GetHardLimits().GetMaximum() == pytest.approx(1e8)
    assert material.GetAttribute("inputs:fgf:hurst").GetHardLimits().GetMinimum() == pytest.approx(-0.98)
    assert material.GetAttribute("inputs:fgf:asymmetry").GetHardLimits().GetMinimum() == -1
    assert material.GetAttribute("inputs:fgf:draineAlpha").GetHardLimits().GetMaximum() == DRAINE_ALPHA_MAX
    assert tuple(material.GetAttribute("fgf:phaseFunction").GetMetadata("allowedTokens")) == PHASE_FUNCTIONS


def test_only_what_cannot_vary_is_uniform(material: Usd.Prim) -> None:
    uniform = {name for name in FALLBACKS if material.GetAttribute(name).GetVariability() == Sdf.VariabilityUniform}
    words = {"fgf:phaseFunction", "fgf:transport", "fgf:lineVariance", "fgf:boundary"}
    assert uniform == words | {"fgf:priority"}


def test_registering_twice_is_harmless() -> None:
    schema.register()
    schema.register()


def test_applies_to_materials_only() -> None:
    schema.register()
    stage = Usd.Stage.CreateInMemory()
    assert not stage.DefinePrim("/Ball", "Sphere").CanApplyAPI(schema.SCHEMA_NAME)


def test_registering_too_late_says_what_to_do() -> None:
    script = (
        "from pxr import Usd; Usd.SchemaRegistry().FindAppliedAPIPrimDefinition('CollectionAPI')\n"
        "from usd_scenes import schema\n"
        "try: schema.register()\n"
        "except Exception as error: print(type(error).__name__, error)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("SceneError USD does not know FgfMediumAPI")
    assert "import usd_scenes first" in done.stdout


def test_generated_files_are_those_of_the_source(tmp_path: Path) -> None:
    pytest.importorskip("jinja2")
    for name in ("schema.usda", "plugInfo.json"):
        (tmp_path / name).write_text((schema.FOLDER / name).read_text())
    command = [sys.executable, "-m", "pxr.Usd.usdGenSchema", "schema.usda", "."]
    subprocess.run(command, cwd=tmp_path, capture_output=True, check=True)
    for name in ("generatedSchema.usda", "plugInfo.json"):
        assert (tmp_path / name).read_text() == (schema.FOLDER / name).read_text(), name


def test_the_shader_takes_what_the_schema_has(material: Usd.Prim) -> None:
    schema.register_shader()
    node = Sdr.Registry().GetShaderNodeByIdentifier(schema.SHADER_NAME)
    inputs = {name for name in schema.MEDIUM_ATTRIBUTES.values() if name.startswith("inputs:")}
    assert {f"inputs:fgf:{name}" for name in node.GetShaderInputNames()} == inputs
    for name in inputs:
        default = node.GetShaderInput(name.removeprefix("inputs:fgf:")).GetDefaultValue()
        fallback = material.GetAttribute(name).Get()
        assert default == fallback
    assert list(node.GetShaderOutputNames()) == ["volume"]
