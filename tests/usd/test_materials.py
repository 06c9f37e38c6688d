"""Media and surfaces come out of materials as they are written, or are refused by name."""

from __future__ import annotations

import pytest

from fgf_warp.errors import SceneError
from fgf_warp.scene import Medium, Surface
from tests.usd.prims import medium_sphere


def test_unauthored_values_are_the_schemas(read) -> None:
    scene = read(medium_sphere("")).scene
    assert scene.media == (Medium(name="/Look", mean_extinction=1.0),)
    assert (scene.shapes[0].surface, scene.shapes[0].medium) == (None, 0)
    assert scene.media[0].line_law.regime == "exponential"


def test_float32_values_come_out_as_they_were_written(read) -> None:
    (medium,) = read(
        medium_sphere("float inputs:fgf:hurst = -0.49\ncolor3f inputs:fgf:albedo = (0.9, 0.1, 0.3)")
    ).scene.media
    assert medium.hurst == -0.49
    assert medium.albedo == (0.9, 0.1, 0.3)


@pytest.mark.parametrize(
    ("attribute", "message"),
    [
        ("float inputs:fgf:hurst = 0", "hurst: H = 0; accepted: at least 0.01 away from 0"),
        ("float inputs:fgf:hurst = -1", "hurst: H = -1; accepted: > -0.98"),
        ("float inputs:fgf:hurst = nan", "hurst = nan; accepted: a finite number"),
        (
            "float inputs:fgf:hurst = 0.5\nfloat inputs:fgf:whiteNoiseScale = 1",
            "hurst: H = 0.5 needs an outer scale L; accepted: > 0",
        ),
        ("float inputs:fgf:whiteNoiseScale = -1", "whiteNoiseScale: S_w = -1; accepted: >= 0"),
        ("float inputs:fgf:asymmetry = 1", r"asymmetry: g = 1; accepted: in \(-1, 1\)"),
        (
            'float inputs:fgf:asymmetry = 0.5\nuniform token fgf:phaseFunction = "isotropic"',
            "asymmetry: g = 0.5 with phase_function = 'isotropic'; accepted: 0, or a phase function that has it: hg, ",
        ),
        ("float inputs:fgf:backWeight = 0.5", "backWeight: back_weight = 0.5 with phase_function = 'hg'; accepted: 0"),
        (
            'float inputs:fgf:draineAlpha = 2000\nuniform token fgf:phaseFunction = "draine"',
            r"draineAlpha: draine_alpha = 2000; accepted: in \[0, 1000\]",
        ),
        ("float inputs:fgf:meanExtinction = -2", "meanExtinction: sigma_m = -2; accepted: >= 0"),
        ("float inputs:fgf:outerScale = 0", "outerScale: L = 0; accepted: > 0"),
        ("float inputs:fgf:kappa = 2e8", r"kappa: kappa = 2e\+08; accepted: in \[0, 1e\+08\]"),
        (
            "color3f inputs:fgf:albedo = (1.5, 0, 0)",
            r"albedo: albedo = \(1.5, 0, 0\); accepted: three numbers in \[0, 1\]",
        ),
        ("color3f inputs:fgf:extinctionColor = (-1, 0, 0)", "extinctionColor: extinction_color = .*; accepted: .*>= 0"),
    ],
)
def test_values_out_of_range_are_refused(read, attribute: str, message: str) -> None:
    with pytest.raises(SceneError, match=r"stage.usda: /Look.inputs:fgf:" + message) as caught:
        read(medium_sphere(attribute))
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("attribute", "message"),
    [
        ('uniform token fgf:transport = "frozen"', "/Look.fgf:transport = frozen; accepted: reciprocal, renewal"),
        (
            'uniform token fgf:phaseFunction = "mie"',
            "/Look.fgf:phaseFunction = mie; accepted: isotropic, hg, two_lobe, draine",
        ),
        ('uniform token fgf:boundary = "glass"', "/Look.fgf:boundary = glass; accepted: none, surface"),
        ('string inputs:fgf:hurst = "rough"', '/Look.inputs:fgf:hurst = "rough"; accepted: a finite number'),
        (
            "float inputs:fgf:hurts = 1",
            "/Look.inputs:fgf:hurts is unknown, maybe inputs:fgf:hurst is meant; accepted: fgf:boundary",
        ),
        ("float fgf:kapa = 1", "/Look.fgf:kapa is unknown, maybe inputs:fgf:kappa is meant; accepted: fgf:boundary"),
        ("float inputs:fgf:qqq = 1", "/Look.inputs:fgf:qqq is unknown; accepted: fgf:boundary"),
        (
            'float inputs:fgf:hurst = -0.75\nuniform token fgf:transport = "reciprocal"',
            "/Look.fgf:transport: transport = 'reciprocal' with H = -0.75; accepted for H < -0.5: renewal only",
        ),
    ],
)
def test_words_and_names_are_checked(read, attribute: str, message: str) -> None:
    with pytest.raises(SceneError, match=r"stage.usda: " + message):
        read(medium_sphere(attribute))


def test_values_are_followed_to_the_interface(read) -> None:
    body = "float inputs:roughening = -0.2\nfloat inputs:fgf:hurst.connect = </Look.inputs:roughening>"
    (medium,) = read(medium_sphere(body)).scene.media
    assert medium.hurst == -0.2


def test_a_connection_to_a_shader_is_named(read) -> None:
    texture = 'def Shader "T"\n{\n uniform token info:id = "UsdUVTexture"\n float outputs:r\n}'
    body = "float inputs:fgf:hurst = -0.3\nfloat inputs:fgf:hurst.connect = </Look/T.outputs:r>"
    reading = read(medium_sphere(body, inside=texture))
    assert reading.scene.media[0].hurst == -0.3
    assert any(text.endswith("/Look.inputs:fgf:hurst") for text in reading.warnings)


def test_time_samples_are_read_at_the_frame(read) -> None:
    prims = medium_sphere("float inputs:fgf:hurst.timeSamples = { 1: -0.4, 11: -0.2 }")
    assert read(prims).scene.media[0].hurst == -0.4
    assert read(prims, frame=6).scene.media[0].hurst == pytest.approx(-0.3)
    assert read(prims, frame=11).scene.media[0].hurst == -0.2


def test_one_medium_serves_all_the_prims_it_is_bound_to(read) -> None:
    prims = medium_sphere("") + (
        'def Cube "Box" (\n prepend apiSchemas = ["MaterialBindingAPI"]\n)\n{\n rel material:binding = </Look>\n}\n'
    )
    scene = read(prims).scene
    assert [(shape.name, shape.medium) for shape in scene.shapes] == [("/Ball", 0), ("/Box", 0)]
    assert len(scene.media) == 1


def test_attributes_without_the_schema_are_named(read) -> None:
    reading = read(medium_sphere("float inputs:fgf:hurst = -0.3", schemas=""))
    assert reading.scene.media == ()
    assert "fgf attributes without FgfMediumAPI applied make no medium: /Look" in reading.warnings


def test_the_schema_on_a_shape_is_named(read) -> None:
    reading = read('def Sphere "Ball" (\n prepend apiSchemas = ["FgfMediumAPI"]\n)\n{\n}')
    assert "FgfMediumAPI is of no effect on a prim that is no Material: /Ball" in reading.warnings


SURFACE = """def Shader "S"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.5, 0.4, 0.3)
        float inputs:opacity = 0.25
        token outputs:surface
    }"""
TERMINAL = "token outputs:surface.connect = </Look/S.outputs:surface>"


def test_a_boundary_of_none_leaves_the_surface_out_and_says_so(read) -> None:
    reading = read(medium_sphere(TERMINAL, inside=SURFACE))
    assert reading.scene.shapes[0].surface is None
    assert "fgf:boundary = none: the material's surface is not used: /Look" in reading.warnings


def test_a_boundary_of_surface_keeps_both(read) -> None:
    reading = read(medium_sphere(TERMINAL + '\nuniform token fgf:boundary = "surface"', inside=SURFACE))
    (shape,) = reading.scene.shapes
    assert shape.surface == Surface(diffuse=(0.5, 0.4, 0.3), ior=1.5, opacity=0.25)
    assert shape.medium == 0
    assert reading.warnings == ()


def test_an_opaque_boundary_is_named(read) -> None:
    opaque = SURFACE.replace("inputs:opacity = 0.25", "inputs:opacity = 1")
    reading = read(medium_sphere(TERMINAL + '\nuniform token fgf:boundary = "surface"', inside=opaque))
    assert reading.scene.shapes[0].medium == 0
    assert reading.warnings == ("the medium is never seen, as the surface around it is opaque: /Look",)


def test_a_boundary_of_surface_without_a_surface_is_named(read) -> None:
    reading = read(medium_sphere('uniform token fgf:boundary = "surface"'))
    assert reading.scene.shapes[0].surface == Surface()
    assert reading.warnings == ("material without a surface: the display color is used: /Look",)


def test_warnings_of_the_law_name_the_medium(read) -> None:
    body = "float inputs:fgf:hurst = 0.5\nfloat inputs:fgf:whiteNoiseScale = 0.001\nfloat inputs:fgf:outerScale = 4"
    (warning,) = read(medium_sphere(body)).warnings
    assert warning.startswith("/Look: t = 2 is not far below the outer scale L = 4")
