"""What a light says that cannot be costs that input, or that light: it is mended or left out, with a warning."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from pxr import UsdLux

from fgf_warp.errors import SceneError
from tests.usd.pictures import write_picture
from usd_scenes.reader import read_scene


def lamp(kind: str, body: str, apis: str = "") -> str:
    schemas = f"(\n prepend apiSchemas = [{apis}]\n)\n" if apis else ""
    return f'def {kind} "Lamp" {schemas}{{\n{body}\n}}\n'


def only_light(reading):
    (light,) = reading.scene.lights
    return light


WARM = "bool inputs:enableColorTemperature = 1\nfloat inputs:colorTemperature = {}"
SHAPING = '"ShapingAPI"'
VALUES = [
    ("DomeLight", "float inputs:intensity = -1", "= -1; accepted: >= 0; 0 is used"),
    ("DomeLight", "float inputs:intensity = nan", "= nan; accepted: >= 0; 1 is used"),
    ("DomeLight", "color3f inputs:color = (-1, 0, 3)", "= (-1, 0, 3); accepted: three numbers >= 0; (0, 0, 3) is used"),
    (
        "DomeLight",
        "color3f inputs:color = (nan, 0, 0)",
        "= (nan, 0, 0); accepted: three numbers >= 0; (1, 0, 0) is used",
    ),
    ("DomeLight", "float inputs:exposure = 2000", "= 2000; accepted: [-127, 127]; 0 is used"),
    ("RectLight", "float inputs:width = -2", "= -2; accepted: > 0; 1 is used"),
    ("RectLight", "float inputs:height = nan", "= nan; accepted: > 0; 1 is used"),
    ("SphereLight", "float inputs:radius = -1e-5", "= -1e-05; accepted: > 0; 0.5 is used"),
    ("DistantLight", "float inputs:angle = -1", "= -1; accepted: [0, 180] degrees; 0 is used"),
    ("DistantLight", "float inputs:angle = 200", "= 200; accepted: [0, 180] degrees; 180 is used"),
    ("DomeLight", WARM.format(500), "= 500; accepted: [1000, 10000] K; 1000 is used"),
    ("DomeLight", WARM.format(11000), "= 11000; accepted: [1000, 10000] K; 10000 is used"),
    ("SphereLight", "float inputs:shaping:cone:angle = 181", "= 181; accepted: [0, 180] degrees; 180 is used"),
    ("SphereLight", "float inputs:shaping:cone:softness = 1.5", "= 1.5; accepted: [0, 1]; 1 is used"),
    ("SphereLight", "float inputs:shaping:focus = -1", "= -1; accepted: >= 0; 0 is used"),
    (
        "SphereLight",
        "color3f inputs:shaping:focusTint = (-1, 0, 0)",
        "= (-1, 0, 0); accepted: three numbers >= 0; (0, 0, 0) is used",
    ),
]


@pytest.mark.parametrize(("kind", "body", "text"), VALUES)
def test_values_that_cannot_be_are_mended_or_refused(read, kind: str, body: str, text: str) -> None:
    prim = lamp(kind, body, SHAPING if "shaping" in body else "")
    name = re.findall(r"inputs:[\w:]+", body)[-1]
    reading = read(prim + 'def Sphere "Ball"\n{\n}\n', light="")
    assert reading.warnings == (f"/Lamp.{name} {text}",)
    assert np.isfinite(only_light(reading).radiance).all()
    found = re.escape(text.rpartition("; ")[0])
    with pytest.raises(SceneError, match=rf"stage.usda: /Lamp\.{name} {found}$"):
        read(prim, light="", strict=True)


@pytest.mark.parametrize("kind", ["RectLight", "DistantLight", "DomeLight"])
@pytest.mark.parametrize("name", ["intensity", "color", "shaping:cone:angle", "shaping:focus", "texture:file"])
@pytest.mark.parametrize("value", ['string inputs:{} = "x"', "float[] inputs:{} = [1]"])
def test_values_of_another_type_cost_that_input(read, kind: str, name: str, value: str) -> None:
    reading = read(lamp(kind, value.format(name), SHAPING), light="")
    assert only_light(reading).name == "/Lamp"
    is_read = not (name.startswith("shaping") and kind != "RectLight")  # Of the others shaping is not rendered.
    assert any(name in text or (not is_read and "ShapingAPI" in text) for text in reading.warnings)


FLAGS = [
    ("bool inputs:normalize = 1", True, ""),
    ("int inputs:normalize = 1", True, ""),
    ("int inputs:normalize = 0", False, ""),
    ('token inputs:normalize = "False"', False, '"False"; accepted: true, false; false is used'),
    ('token inputs:normalize = "true"', True, '"true"; accepted: true, false; true is used'),
    ("float inputs:normalize = 0.5", False, "0.5; accepted: true, false; false is used"),
    ("float[] inputs:normalize = [1]", False, "[1]; accepted: true, false; false is used"),
]


@pytest.mark.parametrize(("line", "is_normalized", "told"), FLAGS)
def test_flags_of_other_types_are_what_they_say(read, line: str, is_normalized: bool, told: str) -> None:
    reading = read(f'def RectLight "Lamp"\n{{\nfloat inputs:width = 4\n{line}\n}}\n')
    lamp = next(light for light in reading.scene.lights if light.name == "/Lamp")
    assert lamp.radiance[0] == pytest.approx(0.25 if is_normalized else 1)
    warnings = [text for text in reading.warnings if "normalize" in text]
    assert warnings == ([f"/Lamp.inputs:normalize = {told}"] if told else [])


def test_shadows_that_an_integer_turns_off_are_off(read) -> None:
    lamp = 'def RectLight "Lamp" (\nprepend apiSchemas = ["ShadowAPI"]\n)\n{\nint inputs:shadow:enable = 0\n}\n'
    reading = read('def Sphere "Ball"\n{\n}\n' + lamp)
    assert [light.shadow_link for light in reading.scene.lights if light.name == "/Lamp"] == [0]


def test_what_is_used_in_their_place(read) -> None:
    hot = only_light(read(lamp("DomeLight", WARM.format(12000)), light=""))
    assert hot.radiance == pytest.approx(tuple(UsdLux.BlackbodyTemperatureAsRgb(10000)))
    wide = only_light(read(lamp("DistantLight", "float inputs:angle = 200"), light=""))
    assert wide.half_angle == pytest.approx(math.pi / 2)
    body = "float inputs:shaping:cone:angle = 30\nfloat inputs:shaping:cone:softness = 1.5"
    assert only_light(read(lamp("SphereLight", body, SHAPING), light="")).shaping.cone_softness == 1
    fallback = only_light(read(lamp("SphereLight", "float inputs:radius = -3"), light=""))
    assert fallback.radius == 0.5


def test_a_temperature_that_leaves_its_range_does_not_end_a_sequence(read) -> None:
    body = "bool inputs:enableColorTemperature = 1\nfloat inputs:colorTemperature.timeSamples = {0: 9000, 20: 11000}"
    for frame, is_told in ((19, True), (5, False), (20, True)):
        reading = read(lamp("DomeLight", body), light="", frame=frame)
        assert any("10000 is used" in text for text in reading.warnings) == is_told


# Lights without a size


SIZES = [
    ("SphereLight", "bool treatAsPoint = 1\nfloat inputs:radius = 0", "inputs:radius"),
    ("SphereLight", "float inputs:radius = 0", "inputs:radius"),
    ("CylinderLight", "bool treatAsLine = 1\nfloat inputs:radius = 0", "inputs:radius"),
    ("CylinderLight", "float inputs:length = 0", "inputs:length"),
    ("RectLight", "float inputs:width = 0", "inputs:width"),
    ("DiskLight", "float inputs:radius = 0", "inputs:radius"),
]
PLANE = """def Mesh "Floor"
{
    float3[] extent = [(-30, 0, -40), (30, 0, 40)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-30, 0, -40), (-30, 0, 40), (30, 0, 40), (30, 0, -40)]
    uniform token subdivisionScheme = "none"
}
"""


@pytest.mark.parametrize(("kind", "body", "name"), SIZES)
def test_a_light_without_a_size_keeps_its_power_where_it_is_normalized(read, kind: str, body: str, name: str) -> None:
    """Its size is small beside what there is to shine on, which is 50 units away, and its power does not hang on it."""
    power = "float inputs:intensity = 7\nbool inputs:normalize = 1\n"
    reading = read(lamp(kind, power + body) + PLANE, light="")
    light = only_light(reading)
    assert light.radiance[0] * light.area == pytest.approx(7)
    assert 0 < light.area < 0.1
    if kind == "SphereLight":
        assert light.radius == pytest.approx(50e-4, rel=0.01)
    (text,) = reading.warnings
    assert re.fullmatch(rf"/Lamp\.{name} = 0; accepted: > 0; 0\.00\d+ is used, and the light's power stays", text)
    with pytest.raises(SceneError, match=rf"/Lamp\.{name} = 0; accepted: > 0$"):
        read(lamp(kind, power + body), strict=True)


@pytest.mark.parametrize(("kind", "body", "name"), SIZES)
def test_a_light_without_area_or_power_is_left_out(read, kind: str, body: str, name: str) -> None:
    reading = read(lamp(kind, body) + PLANE)
    assert [light.name for light in reading.scene.lights] == ["/Dome"]
    (text,) = (text for text in reading.warnings if "treatAs" not in text)
    assert text.startswith(f"/Lamp.{name} = 0, where the light has no area and so no power; accepted: > 0, or 0 with")
    assert text.endswith("the light is left out")
    with pytest.raises(SceneError, match=rf"/Lamp\.{name} = 0"):
        read(lamp(kind, body), strict=True)


@pytest.mark.parametrize(
    ("kind", "scale"), [("DistantLight", "(1, 1, 0)"), ("RectLight", "(0, 1, 1)"), ("SphereLight", "(0, 0, 0)")]
)
def test_a_light_whose_transform_leaves_nothing_of_it_is_left_out(read, kind: str, scale: str) -> None:
    body = f'float3 xformOp:scale = {scale}\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    reading = read(lamp(kind, body))
    assert [light.name for light in reading.scene.lights] == ["/Dome"]
    (text,) = (text for text in reading.warnings if "left out" in text)
    assert text.endswith("; the light is left out: /Lamp")


# What needs no warning


@pytest.mark.parametrize(
    ("kind", "body", "apis"),
    [
        ("RectLight", "asset inputs:shaping:ies:file = @@", SHAPING),
        ("RectLight", "asset inputs:shaping:ies:file = @@", ""),
        ("RectLight", "rel light:filters = None\nrel portals = None", ""),
        ("DomeLight", "rel portals = []", ""),
        ("DistantLight", "float inputs:shaping:cone:angle = 180", SHAPING),
        ("DomeLight", "float inputs:shaping:focus = 0", SHAPING),
        ("RectLight", "float photometric:power = 10", '"PhotometricAreaLightAPI"'),
        ("RectLight", "float inputs:shadow:falloff = -1\nbool inputs:shadow:enable = 1", '"ShadowAPI"'),
    ],
)
def test_what_changes_nothing_needs_no_warning(read, kind: str, body: str, apis: str) -> None:
    assert read(lamp(kind, body, apis) + 'def Sphere "Ball"\n{\n}\n', light="").warnings == ()


# Purposes


def test_lights_hold_to_purposes(read) -> None:
    prims = "".join(
        f'def Xform "{purpose}"\n{{\n uniform token purpose = "{purpose}"\n def SphereLight "L"\n {{\n }}\n}}\n'
        for purpose in ("guide", "proxy", "render", "default")
    )
    names = lambda reading: [light.name for light in reading.scene.lights]  # noqa: E731
    assert names(read(prims, light="")) == ["/render/L", "/default/L"]
    assert names(read(prims, light="", purposes=("default", "guide"))) == ["/guide/L", "/default/L"]


def test_a_geometry_light_of_a_purpose_that_is_not_asked_for_leaves_its_mesh(read) -> None:
    light = 'def GeometryLight "G"\n{\n uniform token purpose = "guide"\n rel geometry = </Floor>\n}\n'
    scene = read(PLANE + light, light="").scene
    assert [shape.name for shape in scene.shapes] == ["/Floor"]
    assert "/G" not in [found.name for found in scene.lights]


# Images


def sky(folder: Path, pixels: np.ndarray) -> Path:
    return write_picture(folder / "pictures" / "sky.exr", pixels.astype(np.float32))


@pytest.mark.parametrize("kind", ["DomeLight", "RectLight"])
def test_light_that_is_none_is_mended_and_counted(read, tmp_path: Path, kind: str) -> None:
    pixels = np.full((4, 8, 3), 0.05)
    pixels[1, 2] = np.inf
    pixels[2, 3] = (np.nan, 0.5, -2)
    picture = sky(tmp_path, pixels)
    prim = lamp(kind, f"asset inputs:texture:file = @{picture}@")
    reading = read(prim + 'def Sphere "Ball"\n{\n}\n', light="")
    found = only_light(reading).image.pixels[..., :3]
    assert found[1, 2].tolist() == [65504, 65504, 65504]
    assert found[2, 3].tolist() == [0, 0.5, 0]
    assert (found == np.float32(0.05)).all(axis=-1).sum() == 30
    not_finite, negative = reading.warnings
    assert "2 of 32 pixels are not finite; 65504 is used for what is infinite, and 0 for what is no" in not_finite
    assert "1 of 32 pixels are below 0; 0 is used for what is" in negative
    with pytest.raises(SceneError, match="2 of 32 pixels are not finite"):
        read(prim, light="", strict=True)


@pytest.mark.parametrize("kind", ["DomeLight", "RectLight"])
def test_a_light_without_its_picture_says_that_it_is_plain(read, kind: str) -> None:
    reading = read(lamp(kind, "asset inputs:texture:file = @gone.exr@"), light="")
    assert only_light(reading).image is None
    text = "gone.exr: there is no such file; the light has no picture: it is plain, of its own color and intensity"
    assert f"{text}: /Lamp.inputs:texture:file" in reading.warnings


def test_words_for_the_layout_of_a_picture(read, tmp_path: Path) -> None:
    body = f"asset inputs:texture:file = @{sky(tmp_path, np.ones((4, 8, 3)))}@\n"
    for word, has_image in (("latLong", True), ("spherical", True), ("angular", False)):
        reading = read(lamp("DomeLight", body + f'token inputs:texture:format = "{word}"'), light="")
        assert (only_light(reading).image is not None) == has_image
        assert any(word in text and "/Lamp" in text for text in reading.warnings)
    reading = read(lamp("DomeLight_1", body + 'uniform token poleAxis = "X"'), light="")
    assert "/Lamp.poleAxis = X; accepted: scene, Y, Z; scene is used" in reading.warnings


SHARED_CASES = Path(__file__).parents[3] / "shared" / "cases" / "usd"


@pytest.mark.skipif(not SHARED_CASES.is_dir(), reason="the cases of ../shared are not on this machine")
def test_the_shared_case_of_no_false_alarm() -> None:
    warnings = read_scene(SHARED_CASES / "false_warnings.usda").warnings
    assert [text for text in warnings if not text.startswith("no camera")] == []
