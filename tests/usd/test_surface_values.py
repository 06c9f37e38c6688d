"""What a surface says that cannot be costs that input alone: it is mended, and a warning says how."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from fgf_warp.errors import SceneError
from fgf_warp.scene import PrimvarInput
from tests.usd.pictures import noise, write_picture
from tests.usd.prims import medium_sphere, preview_sphere

VALUES = [
    ("color3f inputs:diffuseColor = (2, 0.5, nan)", "diffuse", (1, 0.5, 0.18), r"\(2, 0.5, nan\); accepted: three num"),
    ("color3f inputs:diffuseColor = (1.0000001, 0, 0)", "diffuse", (1, 0, 0), r"\(1.0000001, 0, 0\); accepted: three"),
    ("color3f inputs:emissiveColor = (-2, 3, 1)", "emission", (0, 3, 1), r"\(-2, 3, 1\); accepted: three numbers >= 0"),
    ("float inputs:roughness = 1.5", "roughness", 1, r"1.5; accepted: \[0, 1\]"),
    ("float inputs:roughness = 1.0000001", "roughness", 1, r"1.0000001; accepted: \[0, 1\]"),
    ("float inputs:roughness = inf", "roughness", 1, r"inf; accepted: \[0, 1\]"),
    ("float inputs:metallic = -1e-5", "metallic", 0, r"-1e-05; accepted: \[0, 1\]"),
    ("float inputs:opacity = nan", "opacity", 1, r"nan; accepted: \[0, 1\]"),
    ("float inputs:clearcoat = 2", "clearcoat", 1, r"2; accepted: \[0, 1\]"),
    ("float inputs:clearcoatRoughness = nan", "clearcoat_roughness", 0.01, r"nan; accepted: \[0, 1\]"),
    ("float inputs:ior = 0", "ior", 1.5, "0; accepted: > 0"),
    ("float inputs:opacityThreshold = 3", "opacity_threshold", 1, r"3; accepted: \[0, 1\]"),
    ("int inputs:useSpecularWorkflow = 2", "specular", (0, 0, 0), "2; accepted: 0 or 1"),
    ('token inputs:opacityMode = "glass"', "is_presence", False, "glass; accepted: transparent, presence"),
    ('token inputs:opacityMode = "Presence"', "is_presence", True, "Presence; accepted: transparent, presence"),
    ('string inputs:roughness = "much"', "roughness", 0.5, r"\"much\"; accepted: \[0, 1\]"),
]


@pytest.mark.parametrize(("value", "field", "used", "found"), VALUES)
def test_values_out_of_range_are_mended_or_refused(read, value: str, field: str, used: object, found: str) -> None:
    name = re.match(r"\w+ (inputs:\w+)", value)[1]
    reading = read(preview_sphere(value))
    (shape,) = reading.scene.shapes
    assert getattr(shape.surface, field) == used
    (text,) = reading.warnings
    assert re.fullmatch(rf"/Look/Surface\.{name} = {found}.*; .+ is used", text)
    assert not re.search(r"= \(?1[;,]", text)
    with pytest.raises(SceneError, match=rf"stage.usda: /Look/Surface\.{name} = {found}(?!.*is used)"):
        read(preview_sphere(value), strict=True)


SHOWN = "color3f inputs:diffuseColor.connect = </Look/T.outputs:rgb>"
OF_A_NUMBER = "float inputs:roughness.connect = </Look/T.outputs:r>"


def texture(file: Path | str, settings: str) -> str:
    return f"""def Shader "T"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        float2 inputs:st = (0.5, 0.5)
        {settings}
        float3 outputs:rgb
        float outputs:r
    }}
    """


@pytest.mark.parametrize(
    ("setting", "is_srgb", "wrap"),
    [
        ('token inputs:sourceColorSpace = "srgb"', True, None),
        ('token inputs:sourceColorSpace = "srgb_texture"', True, None),
        ('token inputs:sourceColorSpace = "Raw"', False, None),
        ('token inputs:sourceColorSpace = "lin_rec709"', False, None),
        ('token inputs:sourceColorSpace = "ACEScg"', True, None),
        ('token inputs:wrapS = "clampToEdge"', True, "clamp"),
        ('token inputs:wrapS = "Repeat"', True, "repeat"),
        ('token inputs:wrapS = "clampToBorder"', True, "black"),
        ('token inputs:wrapS = "mirroredRepeat"', True, "mirror"),
        ('token inputs:wrapS = "often"', True, "black"),
    ],
)
def test_words_of_others_are_taken_for_the_nearest(read, tmp_path: Path, setting, is_srgb: bool, wrap) -> None:
    """Where there is none, what holds is what would without the word."""
    picture = write_picture(tmp_path / "pictures" / "a.png", noise(3))
    reading = read(preview_sphere(SHOWN, texture(picture, setting)))
    found = reading.scene.shapes[0].surface.diffuse.texture
    assert found.tiles[0, 0].is_srgb == is_srgb
    assert wrap is None or found.wrap_s == wrap
    (text,) = reading.warnings
    name, word = re.search(r"(inputs:\w+) = \"(\w+)\"", setting).groups()
    assert re.fullmatch(rf"/Look/T\.{name} = {word}; accepted: .+ is used", text)


def test_numbers_of_a_texture_are_mended(read, tmp_path: Path) -> None:
    picture = write_picture(tmp_path / "pictures" / "a.png", noise(3))
    settings = "float4 inputs:scale = (2, nan, 1, 1)\nfloat4 inputs:fallback = (inf, 0.5, 0, 1)"
    reading = read(preview_sphere(SHOWN, texture(picture, settings)))
    found = reading.scene.shapes[0].surface.diffuse
    assert (found.scale, found.texture.fallback) == ((2, 1, 1, 1), (0, 0.5, 0, 1))
    assert sorted(text.partition(" ")[0] for text in reading.warnings) == [
        "/Look/T.inputs:fallback",
        "/Look/T.inputs:scale",
    ]


def test_a_fallback_that_is_no_reflectance_is_cut(read) -> None:
    settings = "float4 inputs:fallback = (0.75, 0, 0, 1)\nfloat4 inputs:scale = (2, 1, 1, 1)"
    reading = read(preview_sphere(OF_A_NUMBER, texture("gone.png", settings)))
    assert reading.scene.shapes[0].surface.roughness == 1
    assert "scale * fallback + bias is out of [0, 1] and is cut to it: /Look/T.inputs:fallback" in reading.warnings


def test_pixels_of_a_texture_that_are_no_numbers_are_told(read, tmp_path: Path) -> None:
    pixels = noise(3, np.float32)
    pixels[0, 0, 0] = np.inf
    picture = write_picture(tmp_path / "pictures" / "a.exr", pixels)
    reading = read(preview_sphere(SHOWN, texture(picture, "")))
    (text,) = reading.warnings
    assert "a.exr: 1 of 35 pixels are not finite" in text
    assert text.endswith("/Look/T.inputs:file")
    with pytest.raises(SceneError, match="1 of 35 pixels are not finite"):
        read(preview_sphere(SHOWN, texture(picture, "")), strict=True)


# Display colors


@pytest.mark.parametrize(
    ("primvar", "field", "used", "found"),
    [
        ("color3f[] primvars:displayColor = [(1.0000001, 0.5, 1.2)]", "diffuse", (1, 0.5, 1), "(1.0000001, 0.5, 1.2)"),
        ("color3f[] primvars:displayColor = [(-1e-5, 0.5, nan)]", "diffuse", (0, 0.5, 0.18), "(-1e-05, 0.5, nan)"),
        ("float[] primvars:displayOpacity = [1.5]", "opacity", 1, "(1.5)"),
        ("float[] primvars:displayOpacity = [nan]", "opacity", 1, "(nan)"),
        ("float primvars:displayOpacity = 2", "opacity", 1, "(2)"),
    ],
)
def test_display_colors_are_cut_with_one_warning(read, primvar: str, field: str, used, found: str) -> None:
    ball = f'def Sphere "Ball"\n{{\n{primvar}\n}}\n'
    reading = read(ball)
    assert getattr(reading.scene.shapes[0].surface, field) == pytest.approx(used)
    (text,) = reading.warnings
    assert text.startswith(
        f"1 of 1 values are out of [0, 1], the first is [0] = {found}; numbers are cut to [0, 1], and"
    )
    assert "/Ball.primvars:display" in text
    with pytest.raises(SceneError, match=r"/Ball.primvars:display\w+: 1 of 1 values are out of"):
        read(ball, strict=True)


def test_one_display_color_that_is_none_costs_that_alone(read) -> None:
    mesh = """def Mesh "M"
{
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
    color3f[] primvars:displayColor = [(0.5, 0, 0), (0, nan, 0), (0, 0, 1)] (interpolation = "vertex")
}
"""
    reading = read(mesh)
    (shape,) = reading.scene.shapes
    assert isinstance(shape.surface.diffuse, PrimvarInput)
    colors = shape.primvars["displayColor"].reshape(-1, 3)
    np.testing.assert_allclose(np.unique(colors, axis=0), [[0, 0, 1], [0, 0.18, 0], [0.5, 0, 0]])
    (text,) = reading.warnings
    assert text.startswith("1 of 3 values are out of [0, 1], the first is [1] = (0, nan, 0)")


# Displacement


@pytest.mark.parametrize(
    ("value", "is_told"),
    [("", False), ("float inputs:displacement = 0", False), ("float inputs:displacement = 1", True)],
)
def test_a_displacement_that_moves_nothing_needs_no_warning(read, value: str, is_told: bool) -> None:
    prims = medium_sphere(
        "token outputs:surface.connect = </Look/S.outputs:surface>\n"
        "token outputs:displacement.connect = </Look/S.outputs:displacement>",
        schemas="",
        inside=f"""def Shader "S"
        {{
            uniform token info:id = "UsdPreviewSurface"
            {value}
            token outputs:surface
            token outputs:displacement
        }}""",
    )
    assert any("displacement is not rendered" in text for text in read(prims).warnings) == is_told


@pytest.mark.parametrize(
    "declared", ["the[] primvars:displayColor = [(1, 0, 0)]", 'string[] primvars:displayColor = ["r"]']
)
def test_a_display_color_that_is_no_numbers_is_left_out(read, declared: str) -> None:
    triangle = """def Mesh "M" {
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        rel material:binding = </Looks>
        %s (interpolation = "constant")
    }
    def Material "Looks" {
        token outputs:surface.connect = </Looks/S.outputs:surface>
        def Shader "S" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </Looks/R.outputs:result>
            token outputs:surface
        }
        def Shader "R" {
            uniform token info:id = "UsdPrimvarReader_float3"
            string inputs:varname = "displayColor"
            float3 outputs:result
        }
    }
    """
    reading = read(triangle % declared)
    assert any("/M.primvars:displayColor" in text for text in reading.warnings)
    assert reading.scene.shapes[0].primvars == {}
