"""Radiance and geometry of lights, after the UsdLux documentation."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pxr import UsdLux

from fgf_warp.errors import SceneError, UnsupportedFeatureError
from fgf_warp.scene import AreaLight, DistantLight, DomeLight, SphereLight


def only_light(read, prim: str):
    (light,) = read(prim, light="").scene.lights
    return light


def light_prim(kind: str, body: str) -> str:
    return f'def {kind} "Lamp"\n{{\n{body}\n}}\n'


def test_radiance_is_intensity_times_two_to_the_exposure_times_color(read) -> None:
    light = only_light(
        read,
        light_prim(
            "DomeLight", "float inputs:intensity = 3\nfloat inputs:exposure = 2\ncolor3f inputs:color = (1, 0.5, 0)"
        ),
    )
    assert light == DomeLight(name="/Lamp", radiance=(12.0, 6.0, 0.0))


def test_color_temperature_multiplies_the_color(read) -> None:
    body = "bool inputs:enableColorTemperature = 1\nfloat inputs:colorTemperature = 3000\n"
    body += "color3f inputs:color = (1, 0.5, 1)"
    warm = np.array(UsdLux.BlackbodyTemperatureAsRgb(3000))
    light = only_light(read, light_prim("DomeLight", body))
    np.testing.assert_allclose(light.radiance, warm * [1, 0.5, 1], rtol=1e-6)
    assert light.radiance[0] > 2 * light.radiance[2]


def test_color_temperature_is_off_by_default(read) -> None:
    assert only_light(read, light_prim("DomeLight", "float inputs:colorTemperature = 3000")).radiance == (1, 1, 1)


def test_distant_light_shines_along_its_minus_z(read) -> None:
    body = 'float xformOp:rotateX = -90\nuniform token[] xformOpOrder = ["xformOp:rotateX"]'
    light = only_light(read, light_prim("DistantLight", body))
    assert isinstance(light, DistantLight)
    assert light.direction == pytest.approx((0, -1, 0), abs=1e-12)
    assert light.half_angle == pytest.approx(math.radians(0.53) / 2)
    assert light.radiance == (50000, 50000, 50000)


def test_normalized_distant_light_has_its_intensity_as_irradiance(read) -> None:
    light = only_light(
        read,
        light_prim("DistantLight", "float inputs:angle = 40\nfloat inputs:intensity = 3\nbool inputs:normalize = 1"),
    )
    irradiance = light.radiance[0] * math.pi * math.sin(light.half_angle) ** 2
    assert irradiance == pytest.approx(3)


def test_parallel_light_keeps_its_intensity_as_irradiance(read) -> None:
    for normalize in (0, 1):
        light = only_light(
            read,
            light_prim(
                "DistantLight",
                f"float inputs:angle = 0\nfloat inputs:intensity = 3\nbool inputs:normalize = {normalize}",
            ),
        )
        assert (light.half_angle, light.radiance) == (0, (3, 3, 3))


TURNED = """double3 xformOp:translate = (1, 2, 3)
float3 xformOp:rotateXYZ = (20, 50, -70)
float3 xformOp:scale = ({sign}2, 3, 1)
uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale"]
"""


@pytest.mark.parametrize("sign", ["", "-"])
@pytest.mark.parametrize(
    ("kind", "size", "area"),
    [
        ("RectLight", "float inputs:width = 0.5\nfloat inputs:height = 4", 0.5 * 4 * 6),
        ("DiskLight", "float inputs:radius = 0.25", math.pi * 0.25**2 * 6),
    ],
)
def test_area_lights_emit_along_their_minus_z(read, kind: str, size: str, area: float, sign: str) -> None:
    reading = read(light_prim(kind, size + "\n" + TURNED.format(sign=sign)), light="")
    (light,) = reading.scene.lights
    assert isinstance(light, AreaLight)
    assert light.center == (1, 2, 3)
    assert light.area == pytest.approx(area)
    side = np.cross(light.half_u, light.half_v)
    turns = [math.radians(angle) for angle in (20, 50, -70)]
    minus_z = rotation_xyz(*turns) @ [0, 0, -1]
    np.testing.assert_allclose(side / np.linalg.norm(side), minus_z, atol=1e-6)


def rotation_xyz(x: float, y: float, z: float) -> np.ndarray:
    """First about x, then y, then z, for column vectors."""
    about_x = np.array([[1, 0, 0], [0, math.cos(x), -math.sin(x)], [0, math.sin(x), math.cos(x)]])
    about_y = np.array([[math.cos(y), 0, math.sin(y)], [0, 1, 0], [-math.sin(y), 0, math.cos(y)]])
    about_z = np.array([[math.cos(z), -math.sin(z), 0], [math.sin(z), math.cos(z), 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


@pytest.mark.parametrize(
    ("kind", "size"),
    [("RectLight", "float inputs:width = 0.5"), ("DiskLight", ""), ("SphereLight", "float inputs:radius = 2")],
)
def test_normalize_divides_by_the_world_area(read, kind: str, size: str) -> None:
    scale = 'float3 xformOp:scale = (3, 3, 3)\nuniform token[] xformOpOrder = ["xformOp:scale"]\n'
    scale += "float inputs:intensity = 7\n"
    plain = only_light(read, light_prim(kind, scale + size))
    normalized = only_light(read, light_prim(kind, scale + size + "\nbool inputs:normalize = 1"))
    area = 4 * math.pi * plain.radius**2 if isinstance(plain, SphereLight) else plain.area
    assert plain.radiance == (7, 7, 7)
    assert normalized.radiance[1] == pytest.approx(7 / area)


def test_a_stretched_sphere_light_keeps_its_volume_with_a_warning(read) -> None:
    scale = 'float3 xformOp:scale = (8, 1, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    reading = read(light_prim("SphereLight", scale), light="")
    (light,) = reading.scene.lights
    assert light.radius == pytest.approx(1.0)  # 0.5 (8 x 1 x 1)^(1/3)
    assert any("not uniform" in text and text.endswith("/Lamp") for text in reading.warnings)


@pytest.mark.parametrize(
    ("kind", "body", "message"),
    [
        ("DomeLight", "float inputs:intensity = -1", "/Lamp.inputs:intensity = -1; accepted: >= 0"),
        ("DomeLight", "color3f inputs:color = (-1, 0, 0)", "/Lamp: radiance = .*; accepted: three finite numbers >= 0"),
        ("DomeLight", "color3f inputs:color = (nan, 0, 0)", "/Lamp.inputs:color = .*; accepted: three finite numbers"),
        ("DomeLight", "float inputs:exposure = 2000", r"/Lamp.inputs:exposure = 2000; accepted: \[-127, 127\]"),
        ("SphereLight", "float inputs:radius = 0", "/Lamp.inputs:radius = 0; accepted: > 0"),
        ("RectLight", "float inputs:width = -2", "/Lamp.inputs:width = -2; accepted: > 0"),
        ("DistantLight", "float inputs:angle = -1", "/Lamp.inputs:angle = -1; accepted: >= 0"),
        (
            "DomeLight",
            "bool inputs:enableColorTemperature = 1\nfloat inputs:colorTemperature = 500",
            r"/Lamp.inputs:colorTemperature = 500; accepted: \[1000, 10000\] K",
        ),
    ],
)
def test_bad_values_are_refused(read, kind: str, body: str, message: str) -> None:
    with pytest.raises(SceneError, match="stage.usda: " + message):
        read(light_prim(kind, body))


def test_a_distant_light_beyond_a_hemisphere_is_not_supported(read) -> None:
    with pytest.raises(UnsupportedFeatureError, match=r"/Lamp.inputs:angle = 200; accepted: \[0, 180\] degrees"):
        read(light_prim("DistantLight", "float inputs:angle = 200"))


@pytest.mark.parametrize(
    ("kind", "body", "name"),
    [
        ("SphereLight", "bool treatAsPoint = 1", "treatAsPoint"),
        ("DomeLight", "asset inputs:texture:file = @sky.exr@", "inputs:texture:file"),
        ("RectLight", "float inputs:diffuse = 0.5", "inputs:diffuse"),
        ("RectLight", "rel light:filters = </F>", "light:filters"),
        ("RectLight", "rel collection:lightLink:includes = </F>", "collection:lightLink:includes"),
    ],
)
def test_what_is_ignored_is_named(read, kind: str, body: str, name: str) -> None:
    assert f"{name} of lights is not supported and is ignored: /Lamp" in read(light_prim(kind, body)).warnings


def test_default_values_need_no_warning(read) -> None:
    light = light_prim("RectLight", "float inputs:diffuse = 1\nbool inputs:shadow:enable = 1")
    assert read(light + 'def Sphere "Ball"\n{\n}\n').warnings == ()


def test_a_stage_without_geometry_is_named(read) -> None:
    assert [w for w in read(light_prim("RectLight", "")).warnings if w.startswith("no geometry")]


def test_unsupported_lights_are_named(read) -> None:
    reading = read(light_prim("CylinderLight", ""))
    assert "light of type CylinderLight is not supported and gives no light: /Lamp" in reading.warnings
    assert [light.name for light in reading.scene.lights] == ["/Dome"]


def test_invisible_lights_are_skipped(read) -> None:
    reading = read(light_prim("RectLight", 'token visibility = "invisible"'))
    assert [light.name for light in reading.scene.lights] == ["/Dome"]


def test_a_stage_without_light_gets_a_dome_and_a_warning(read) -> None:
    reading = read("", light="")
    assert reading.scene.lights == (DomeLight(name="default dome", radiance=(1, 1, 1)),)
    assert "no light: an environment of radiance 1 is used" in reading.warnings
