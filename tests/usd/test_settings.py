"""What RenderSettings, RenderProducts and RenderVars ask for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from fgf_warp.errors import SceneError
from tests.usd.conftest import write
from tests.usd.prims import HEADER, TWO_CAMERAS
from usd_scenes.reader import Product, read_products

SETTINGS = 'def RenderSettings "Settings"\n{\n rel camera = </Y/B>\n uniform int2 resolution = (64, 48)\n}\n'


def test_render_settings_give_resolution_and_camera(read) -> None:
    reading = read(TWO_CAMERAS + SETTINGS)
    assert (reading.resolution, reading.scene.camera.name) == ((64, 48), "/Y/B")
    assert read(TWO_CAMERAS + SETTINGS, chosen="A").scene.camera.name == "/A"


def test_the_metadata_choose_among_render_settings(read) -> None:
    header = HEADER.replace("(\n", '(\n    renderSettingsPrimPath = "/Chosen"\n', 1)
    other = SETTINGS.replace('Settings"', 'Chosen"').replace("(64, 48)", "(12, 8)")
    assert read(TWO_CAMERAS + SETTINGS + other, header=header).resolution == (12, 8)


def test_without_render_settings_there_is_no_resolution(read) -> None:
    assert read("").resolution is None


PRODUCT = 'def RenderProduct "P"\n{\n rel camera = </A>\n rel orderedVars = [</V>]\n}\n'
VAR = 'def RenderVar "V"\n{\n uniform string sourceName = "Ci"\n}\n'
BALL = 'def Sphere "Ball"\n{\n}\n'


def test_products_and_vars_that_nothing_names_are_told(read) -> None:
    product = "a RenderProduct that no RenderSettings names in its products is left out: /P"
    var = "a RenderVar that no RenderProduct names in its orderedVars is left out: /V"
    named = SETTINGS.replace("rel camera", "rel products = </P>\n rel camera")
    stage = TWO_CAMERAS + BALL
    assert read(stage + named + PRODUCT + VAR, camera="").warnings == ()
    assert read(stage + SETTINGS + PRODUCT + VAR, camera="").warnings == (product,)
    assert read(stage + SETTINGS + VAR, camera="").warnings == (var,)
    assert product in read(stage + PRODUCT + VAR, camera="").warnings  # Without RenderSettings too.


def test_products_of_settings_that_were_not_chosen_need_no_warning(read) -> None:
    header = HEADER.replace("(\n", '(\n    renderSettingsPrimPath = "/Settings"\n', 1)
    other = SETTINGS.replace('Settings"', 'Other"').replace("rel camera", "rel products = </P>\n rel camera")
    reading = read(TWO_CAMERAS + SETTINGS + other + PRODUCT + VAR + BALL, header=header, camera="")
    assert reading.warnings == ()


def test_where_the_only_product_is_not_there_the_settings_are_used(read) -> None:
    gone = SETTINGS.replace("rel camera", "rel products = </Gone>\n rel camera")
    reading = read(TWO_CAMERAS + gone + BALL, camera="")
    assert (reading.scene.camera.name, reading.sources) == ("/Y/B", None)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (SETTINGS.replace("64", "0"), r"/Settings.resolution = \(0, 48\); accepted: two integers in \[1, 65536\]"),
        (SETTINGS.replace("/Y/B", "/Gone"), "/Settings.camera = /Gone; accepted: the path of a Camera"),
    ],
)
def test_bad_render_settings_are_refused_strictly(read, settings: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        read(TWO_CAMERAS + settings, strict=True)


def test_metadata_that_name_no_settings_are_told(read) -> None:
    header = HEADER.replace("(\n", '(\n    renderSettingsPrimPath = "/Gone"\n', 1)
    reading = read(TWO_CAMERAS + SETTINGS, header=header)
    assert "the stage's renderSettingsPrimPath is the path of no RenderSettings: /Gone" in reading.warnings
    assert reading.resolution == (64, 48)
    with pytest.raises(SceneError, match="/Gone: the stage's renderSettingsPrimPath"):
        read(TWO_CAMERAS + SETTINGS, header=header, strict=True)


def test_of_several_settings_the_first_are_used_with_a_warning_or_those_asked_for(read) -> None:
    other = SETTINGS.replace('Settings"', 'Other"').replace("(64, 48)", "(12, 8)")
    reading = read(TWO_CAMERAS + SETTINGS + other)
    assert "several RenderSettings and none chosen: the first are used: /Settings" in reading.warnings
    assert read(TWO_CAMERAS + SETTINGS + other, render_settings="/Other").resolution == (12, 8)
    with pytest.raises(SceneError, match="render settings '/No' are not in the stage; it has: /Settings, /Other"):
        read(TWO_CAMERAS + SETTINGS + other, render_settings="/No")


PRODUCTS = """def RenderSettings "Settings"
{
    rel products = [</Wide>, </Deep>, </Tall>]
    rel camera = </A>
    uniform int2 resolution = (64, 48)
    uniform bool disableMotionBlur = 1
    uniform float pixelAspectRatio = 2
    uniform token[] includedPurposes = ["default", "proxy"]
}
def RenderProduct "Wide"
{
    uniform int2 resolution = (100, 10)
    token productName = "wide.exr"
    rel orderedVars = [</Color>, </Depth>, </Lobe>]
}
def RenderProduct "Deep"
{
    uniform token productType = "deepRaster"
}
def RenderProduct "Tall"
{
    rel camera = </Y/B>
    token productName.timeSamples = { 1: "one.exr", 2: "two.exr" }
    uniform bool disableMotionBlur = 0
    uniform bool disableDepthOfField = 1
    uniform float pixelAspectRatio = 0.5
    uniform token aspectRatioConformPolicy = "cropAperture"
}
def RenderVar "Color"
{
    string sourceName = "Ci"
}
def RenderVar "Depth"
{
    string sourceName = "depth"
}
def RenderVar "Lobe"
{
    uniform token sourceType = "lpe"
    string sourceName = "C<RD>L"
}
"""


@pytest.fixture
def products(tmp_path: Path) -> Callable[..., tuple[Product, ...]]:
    """Reads the products of a stage with cameras and the given prims."""
    return lambda prims, **asked: read_products(write(tmp_path, HEADER + TWO_CAMERAS + prims), **asked)


def test_products_take_from_the_settings_what_they_do_not_say(products) -> None:
    wide, tall = products(PRODUCTS, frame=2)
    assert wide == Product(
        path="/Wide",
        file="wide.exr",
        camera="/A",
        resolution=(100, 10),
        pixel_aspect_ratio=2,
        has_motion_blur=False,
        sources=("Ci", "depth"),
    )
    assert tall == Product(
        path="/Tall",
        file="two.exr",
        camera="/Y/B",
        resolution=(64, 48),
        pixel_aspect_ratio=0.5,
        conform_policy="cropAperture",
        has_depth_of_field=False,
    )


def test_a_product_is_read_by_its_path(read) -> None:
    first, tall = read(TWO_CAMERAS + PRODUCTS), read(TWO_CAMERAS + PRODUCTS, product="/Tall")
    assert (first.resolution, first.scene.camera.name, first.sources) == ((100, 10), "/A", ("Ci", "depth"))
    assert (tall.resolution, tall.scene.camera.name, tall.sources) == ((64, 48), "/Y/B", None)
    assert (tall.scene.camera.conform_policy, tall.scene.camera.pixel_aspect_ratio) == ("cropAperture", 0.5)
    assert "a product of type deepRaster is not supported and is left out: /Deep" in first.warnings
    assert "a render var of sourceType lpe is not supported and is left out: /Lobe" in first.warnings
    with pytest.raises(SceneError, match="render product '/No' is not there; accepted: /Wide, /Tall"):
        read(TWO_CAMERAS + PRODUCTS, product="/No")


def test_depth_of_field_and_motion_can_be_turned_off(read) -> None:
    camera = """def Camera "A"
{
    float fStop = 2
    float focusDistance = 3
    double shutter:close = 0.5
    double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 10: (20, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    settings = (
        'def RenderSettings "S"\n{\n uniform bool disableDepthOfField = 1\n uniform bool disableMotionBlur = 1\n}'
    )
    with_both = read(camera, camera="", frame=1).scene.camera
    with_none = read(camera + settings, camera="", frame=1).scene.camera
    assert with_both.has_lens and with_both.closing is not None
    assert with_none.is_pinhole


def test_the_settings_purposes_are_read_unless_others_are_asked_for(read) -> None:
    prims = "".join(
        f'def Sphere "{purpose}"\n{{\n uniform token purpose = "{purpose}"\n}}\n' for purpose in ("render", "proxy")
    )
    names = [
        [shape.name for shape in read(TWO_CAMERAS + settings + prims, **asked).scene.shapes]
        for settings, asked in ((PRODUCTS, {}), (SETTINGS, {}), (PRODUCTS, {"purposes": ("render",)}))
    ]
    assert names == [["/proxy"], ["/render"], ["/render"]]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "rel products = [</Wide>",
            "rel products = [</A>",
            "/Settings.products = /A; accepted: the paths of RenderProd",
        ),
        (
            "rel orderedVars = [</Color>",
            "rel orderedVars = [</A>",
            "/Wide.orderedVars = /A; accepted: the paths of Rend",
        ),
        ("pixelAspectRatio = 0.5", "pixelAspectRatio = 0", "/Tall.pixelAspectRatio = 0; accepted: > 0"),
        (
            '"cropAperture"',
            '"squash"',
            "/Tall.aspectRatioConformPolicy = squash; accepted: expandAperture, cropAperture",
        ),
        (
            '["default", "proxy"]',
            '["default", "beauty"]',
            "includedPurposes holds beauty; accepted: default, render, proxy, guide",
        ),
    ],
)
def test_bad_products_are_refused_strictly(read, old: str, new: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        read(TWO_CAMERAS + PRODUCTS.replace(old, new), strict=True)


@pytest.mark.parametrize(
    ("setting", "warning"),
    [
        (
            "uniform float4 dataWindowNDC = (0, 0, 0.5, 1)",
            "dataWindowNDC is not supported: the whole image is rendered",
        ),
        ('uniform token[] materialBindingPurposes = ["preview"]', "materials are those bound for the purpose full"),
        ('uniform token renderingColorSpace = "acescg"', "images are rendered in linear Rec.709, whatever it says"),
    ],
)
def test_settings_that_are_not_used_are_named(read, setting: str, warning: str) -> None:
    warnings = read(f'def RenderSettings "S"\n{{\n {setting}\n}}\ndef Sphere "Ball"\n{{\n}}').warnings
    assert [text for text in warnings if text.startswith(warning) and "/S" in text]


def test_complexity_is_one_of_usdrecords(read) -> None:
    with pytest.raises(SceneError, match="complexity = best; accepted: low, medium, high, veryhigh"):
        read("", complexity="best")
