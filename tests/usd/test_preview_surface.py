"""Every input of UsdPreviewSurface reaches the scene, through whatever network gives it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import UsdUtils

from fgf_warp.errors import SceneError
from fgf_warp.scene import BLACK, PrimvarInput, Surface, TextureInput
from tests.usd.pictures import noise, write_picture
from tests.usd.prims import preview_sphere
from usd_scenes.reader import read_scene

DEFAULTS = Surface(diffuse=(0.18, 0.18, 0.18), ior=1.5)
"""What the specification says of what is not authored."""


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    """An 8-bit RGBA picture beside which stages may lie."""
    return write_picture(tmp_path / "pictures" / "a.png", noise(4))


def surface_of(reading) -> Surface:
    return reading.scene.shapes[0].surface


def texture(picture: object, inputs: str = "", *, name: str = "T", st: str = "") -> str:
    """A UsdUVTexture in /Look that reads the picture at the primvar st."""
    return f"""
    def Shader "{name}"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{picture}@
        {st or "float2 inputs:st.connect = </Look/Coordinates.outputs:result>"}
        {inputs}
        float3 outputs:rgb
        float outputs:r
        float outputs:a
    }}
"""


COORDINATES = """
    def Shader "Coordinates"
    {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "map1"
        float2 inputs:fallback = (0.25, 0.75)
        float2 outputs:result
    }
"""
DIFFUSE_MAP = "color3f inputs:diffuseColor.connect = </Look/T.outputs:rgb>"


def test_what_is_not_authored_is_as_the_specification_says(read) -> None:
    reading = read(preview_sphere(""))
    assert surface_of(reading) == DEFAULTS
    assert not DEFAULTS.is_matte
    assert reading.warnings == ()


@pytest.mark.parametrize(
    ("inputs", "expected"),
    [
        ("color3f inputs:diffuseColor = (0.2, 0.3, 0.4)", {"diffuse": (0.2, 0.3, 0.4)}),
        ("color3f inputs:emissiveColor = (5, 6, 7)", {"emission": (5.0, 6.0, 7.0)}),
        ("float inputs:metallic = 0.9", {"metallic": 0.9}),
        ("float inputs:roughness = 0", {"roughness": 0.0}),
        ("float inputs:clearcoat = 0.7\nfloat inputs:clearcoatRoughness = 0.2", {"clearcoat": 0.7}),
        ("float inputs:clearcoatRoughness = 0.2", {"clearcoat_roughness": 0.2}),
        ("float inputs:ior = 1.33", {"ior": 1.33}),
        ("float inputs:opacity = 0.4", {"opacity": 0.4}),
        ("float inputs:opacityThreshold = 0.1", {"opacity_threshold": 0.1}),
        ('token inputs:opacityMode = "presence"', {"is_presence": True}),
        ('token inputs:opacityMode = "transparent"', {"is_presence": False}),
        ("int inputs:useSpecularWorkflow = 1", {"specular": BLACK}),
        (
            "int inputs:useSpecularWorkflow = 1\ncolor3f inputs:specularColor = (0.1, 0.2, 0.3)",
            {"specular": (0.1, 0.2, 0.3)},
        ),
        ("color3f inputs:specularColor = (0.1, 0.2, 0.3)", {"specular": None}),
        ("int inputs:useSpecularWorkflow = 1\nfloat inputs:metallic = 1", {"specular": BLACK, "metallic": 0.0}),
        ("normal3f inputs:normal = (0, 0, 1)", {"normal": None}),
    ],
)
def test_constants(read, inputs: str, expected: dict) -> None:
    reading = read(preview_sphere(inputs))
    assert {name: getattr(surface_of(reading), name) for name in expected} == expected
    assert reading.warnings == ()


@pytest.mark.parametrize(
    ("inputs", "name"),
    [
        ("float inputs:displacement = 0.1", "displacement"),
        ("float inputs:occlusion = 0.5", "occlusion"),
        ("normal3f inputs:normal = (1, 0, 0)", "normals are read from textures only: the shape's own are used"),
    ],
)
def test_what_is_not_rendered_is_named(read, inputs: str, name: str) -> None:
    (warning,) = read(preview_sphere(inputs)).warnings
    assert name in warning
    assert "/Look/Surface.inputs:" in warning
    assert not read(preview_sphere("float inputs:displacement = 0\nfloat inputs:occlusion = 1")).warnings


def test_values_come_through_interfaces_and_node_graphs(read) -> None:
    inside = """
    float inputs:gloss = 0.3
    def NodeGraph "G"
    {
        color3f inputs:tint = (0.1, 0.2, 0.3)
        color3f outputs:tint.connect = </Look/G.inputs:tint>
        float inputs:shine.connect = </Look.inputs:gloss>
        float outputs:shine.connect = </Look/G.inputs:shine>
    }
"""
    inputs = """color3f inputs:diffuseColor.connect = </Look/G.outputs:tint>
        float inputs:roughness.connect = </Look/G.outputs:shine>"""
    reading = read(preview_sphere(inputs, inside))
    assert surface_of(reading) == Surface(diffuse=(0.1, 0.2, 0.3), roughness=0.3, ior=1.5)
    assert reading.warnings == ()


def connected(target: str) -> str:
    return f"color3f inputs:diffuseColor = (0.1, 0.2, 0.3)\ncolor3f inputs:diffuseColor.connect = <{target}>"


@pytest.mark.parametrize("target", ["/Look/Gone.outputs:rgb", "/Look.inputs:nothing", "/Look/G.outputs:free"])
def test_a_connection_to_nothing_is_named_and_the_inputs_own_value_taken(read, target: str) -> None:
    prims = preview_sphere(connected(target), 'def NodeGraph "G"\n{\n color3f outputs:free\n}')
    reading = read(prims)
    assert surface_of(reading).diffuse == (0.1, 0.2, 0.3)
    assert "connected to nothing: the input's own value is used: /Look/Surface.inputs:diffuseColor" in reading.warnings
    with pytest.raises(SceneError, match=r"/Look/Surface.inputs:diffuseColor: connected to nothing"):
        read(prims, strict=True)


def test_of_several_connections_the_first_is_taken(read) -> None:
    inside = "color3f inputs:first = (0.4, 0.5, 0.6)\ncolor3f inputs:second"
    targets = "color3f inputs:diffuseColor.connect = [</Look.inputs:first>, </Look.inputs:second>]"
    reading = read(preview_sphere(targets, inside.replace("second", "second = (1, 1, 1)")))
    assert surface_of(reading).diffuse == (0.4, 0.5, 0.6)
    assert reading.warnings == ("connected to several: the first is used: /Look/Surface.inputs:diffuseColor",)
    assert read(preview_sphere(targets, inside)).warnings == ()


def test_circles_of_connections_end(read) -> None:
    circle = """def NodeGraph "G"
    {
        color3f outputs:a.connect = </Look/G.inputs:b>
        color3f inputs:b.connect = </Look/G.outputs:a>
    }"""
    reading = read(preview_sphere("color3f inputs:diffuseColor.connect = </Look/G.outputs:a>", circle))
    assert surface_of(reading) == DEFAULTS
    assert any("connected to nothing" in warning for warning in reading.warnings)


def test_an_interface_may_leave_values_open(read) -> None:
    reading = read(preview_sphere(connected("/Look.inputs:tint"), "color3f inputs:tint"), strict=True)
    assert surface_of(reading).diffuse == (0.1, 0.2, 0.3)
    assert reading.warnings == ()


def test_an_unknown_shader_is_named_and_the_inputs_own_value_taken(read) -> None:
    inside = 'def Shader "N"\n{\n uniform token info:id = "ND_noise"\n float3 outputs:out\n}'
    inputs = """color3f inputs:diffuseColor = (0.1, 0.2, 0.3)
        color3f inputs:diffuseColor.connect = </Look/N.outputs:out>
        float inputs:ior.connect = </Look/N.outputs:out>
        float inputs:metallic.connect = </Look/N.outputs:out>
        normal3f inputs:normal.connect = </Look/N.outputs:out>"""
    reading = read(preview_sphere(inputs, inside))
    assert surface_of(reading) == Surface(diffuse=(0.1, 0.2, 0.3), ior=1.5)
    (warning,) = reading.warnings
    assert warning.startswith("connected to out of ND_noise, which is not rendered here: the input's own value is used")
    for name in ("diffuseColor", "ior", "metallic", "normal"):
        assert f"/Look/Surface.inputs:{name}" in warning


def test_primvars(read) -> None:
    inside = """
    def Shader "C"
    {
        uniform token info:id = "UsdPrimvarReader_float3"
        token inputs:varname = "displayColor"
        float3 inputs:fallback = (0.1, 0.2, 0.3)
        float3 outputs:result
    }
    string inputs:which = "wear"
    def Shader "R"
    {
        uniform token info:id = "UsdPrimvarReader_float"
        string inputs:varname.connect = </Look.inputs:which>
        float outputs:result
    }
"""
    inputs = """color3f inputs:diffuseColor.connect = </Look/C.outputs:result>
        float inputs:roughness.connect = </Look/R.outputs:result>"""
    reading = read(preview_sphere(inputs, inside))
    surface = surface_of(reading)
    assert surface.diffuse == PrimvarInput("displayColor", fallback=(0.1, 0.2, 0.3))
    assert surface.roughness == PrimvarInput("wear", fallback=0.0)
    assert surface.primvars == {"displayColor", "wear"}
    assert reading.warnings == ()


def test_a_reader_of_no_primvar_is_named(read) -> None:
    inside = 'def Shader "R"\n{\n uniform token info:id = "UsdPrimvarReader_float"\n float outputs:result\n}'
    prims = preview_sphere("float inputs:roughness.connect = </Look/R.outputs:result>", inside)
    reading = read(prims)
    assert surface_of(reading).roughness == 0.5
    assert "/Look/R.inputs:varname names no primvar" in reading.warnings
    with pytest.raises(SceneError, match=r"/Look/R.inputs:varname names no primvar"):
        read(prims, strict=True)


@pytest.mark.parametrize(("count", "shape"), [("", "Sphere"), ("[]", "Mesh")])
def test_texture_coordinates_of_one_number_are_left_out(read, picture: Path, count: str, shape: str) -> None:
    prims = preview_sphere(DIFFUSE_MAP, texture(picture) + COORDINATES)
    value = "[0.5]" if count else "0.5"
    lines = f'float{count} primvars:map1 = {value} (\n interpolation = "constant"\n)'
    if shape == "Mesh":
        lines += """
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]"""
    prims = prims.replace("def Sphere", f"def {shape}").replace("{", "{\n    " + lines, 1)
    reading = read(prims)
    assert not reading.scene.shapes[0].primvars
    name = reading.scene.shapes[0].name
    assert f"primvar map1 of one number, where textures need two, is left out: {name}" in reading.warnings


def test_textures(read, picture: Path) -> None:
    inputs = f"""{DIFFUSE_MAP}
        float inputs:roughness.connect = </Look/T.outputs:r>
        float inputs:opacity.connect = </Look/T.outputs:a>"""
    settings = """token inputs:wrapS = "mirror"
        token inputs:wrapT = "clamp"
        float4 inputs:scale = (0.5, 1, 1, 1)
        float4 inputs:bias = (0.25, 0, 0, 0)
        float4 inputs:fallback = (0.1, 0.2, 0.3, 0.4)"""
    reading = read(preview_sphere(inputs, texture(picture, settings) + COORDINATES))
    surface = surface_of(reading)
    found = surface.diffuse
    assert isinstance(found, TextureInput)
    np.testing.assert_array_equal(found.texture.tiles[0, 0].pixels, noise(4))
    assert found.texture.tiles[0, 0].is_srgb
    assert (found.texture.wrap_s, found.texture.wrap_t) == ("mirror", "clamp")
    assert found.texture.fallback == (0.1, 0.2, 0.3, 0.4)
    assert (found.scale, found.bias) == ((0.5, 1.0, 1.0, 1.0), (0.25, 0.0, 0.0, 0.0))
    assert (found.primvar, found.st, found.channels) == ("map1", (0.25, 0.75), "rgb")
    assert found.transform == ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    assert (surface.roughness.channels, surface.opacity.channels) == ("r", "a")
    assert surface.roughness.texture.tiles[0, 0] is found.texture.tiles[0, 0]
    assert surface.primvars == {"map1"}
    assert reading.warnings == ()


@pytest.mark.parametrize(
    ("channels", "wrap", "is_constant"), [(3, "repeat", True), (3, "black", False), (4, "repeat", False)]
)
def test_the_alpha_of_a_picture_without_one_is_no_texture(
    read, tmp_path: Path, channels: int, wrap: str, is_constant: bool
) -> None:
    path = write_picture(tmp_path / "pictures" / "a.png", noise(channels))
    settings = f'token inputs:wrapS = "{wrap}"\ntoken inputs:wrapT = "{wrap}"'
    inputs = "float inputs:opacity.connect = </Look/T.outputs:a>"
    surface = surface_of(read(preview_sphere(inputs, texture(path, settings) + COORDINATES)))
    assert (surface.opacity == 1) == is_constant
    assert surface.may_be_transparent != is_constant


@pytest.mark.parametrize(("color_space", "is_srgb"), [("raw", False), ("sRGB", True), ("auto", True)])
def test_color_spaces(read, picture: Path, color_space: str, is_srgb: bool) -> None:
    setting = f'token inputs:sourceColorSpace = "{color_space}"'
    reading = read(preview_sphere(DIFFUSE_MAP, texture(picture, setting) + COORDINATES))
    assert surface_of(reading).diffuse.texture.tiles[0, 0].is_srgb == is_srgb


def test_wrap_modes_default_to_the_files_and_to_black(read, picture: Path, tmp_path: Path) -> None:
    says = write_picture(tmp_path / "pictures" / "b.exr", noise(3, np.float32), wrapmodes="periodic,clamp")
    metadata = 'token inputs:wrapS = "useMetadata"'
    found = surface_of(read(preview_sphere(DIFFUSE_MAP, texture(says, metadata) + COORDINATES))).diffuse.texture
    assert (found.wrap_s, found.wrap_t) == ("repeat", "clamp")
    found = surface_of(read(preview_sphere(DIFFUSE_MAP, texture(picture, metadata) + COORDINATES))).diffuse.texture
    assert (found.wrap_s, found.wrap_t) == ("black", "black")


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ('token inputs:wrapS = "often"', "wrapS = often; accepted: black, clamp, repeat, mirror, useMetadata"),
        ('token inputs:sourceColorSpace = "Rec709"', "sourceColorSpace = Rec709; accepted: auto, raw, sRGB"),
        ('string inputs:scale = "2"', 'scale = "2"; accepted: 4 finite numbers'),
    ],
)
def test_settings_of_textures_are_checked(read, picture: Path, setting: str, message: str) -> None:
    with pytest.raises(SceneError, match="/Look/T.inputs:" + message):
        read(preview_sphere(DIFFUSE_MAP, texture(picture, setting) + COORDINATES), strict=True)


def transform(name: str, source: str, inputs: str) -> str:
    return f"""
    def Shader "{name}"
    {{
        uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = <{source}>
        {inputs}
        float2 outputs:result
    }}
"""


def test_transforms_scale_then_turn_then_move(read, picture: Path) -> None:
    inside = (
        transform(
            "A",
            "/Look/Coordinates.outputs:result",
            "float inputs:rotation = 90\nfloat2 inputs:scale = (2, 3)\nfloat2 inputs:translation = (10, 20)",
        )
        + transform("B", "/Look/A.outputs:result", "float2 inputs:scale = (0.5, 0.5)")
        + texture(picture, st="float2 inputs:st.connect = </Look/B.outputs:result>")
        + COORDINATES
    )
    found = surface_of(read(preview_sphere(DIFFUSE_MAP, inside))).diffuse
    # (1, 0) is scaled to (2, 0), turned to (0, 2), moved to (10, 22), and halved.
    np.testing.assert_allclose(np.array(found.transform) @ (1, 0, 1), (5, 11), atol=1e-12)
    np.testing.assert_allclose(np.array(found.transform) @ (0, 1, 1), (3.5, 10), atol=1e-12)
    assert (found.primvar, found.st) == ("map1", (0.25, 0.75))


def test_transforms_in_a_circle_end(read, picture: Path) -> None:
    inside = (
        transform("A", "/Look/B.outputs:result", "")
        + transform("B", "/Look/A.outputs:result", "")
        + texture(picture, st="float2 inputs:st.connect = </Look/A.outputs:result>")
    )
    reading = read(preview_sphere(DIFFUSE_MAP, inside))
    assert surface_of(reading).diffuse.primvar == ""
    assert any("/Look/B.inputs:in" in warning for warning in reading.warnings)


def test_a_texture_may_have_the_same_coordinates_everywhere(read, picture: Path) -> None:
    inside = texture(picture, st="float2 inputs:st = (0.5, 0.25)")
    surface = surface_of(read(preview_sphere(DIFFUSE_MAP, inside)))
    assert (surface.diffuse.primvar, surface.diffuse.st) == ("", (0.5, 0.25))
    assert surface.primvars == frozenset()


def test_a_texture_without_coordinates_is_named(read, picture: Path) -> None:
    reading = read(preview_sphere(DIFFUSE_MAP, texture(picture, st=" ")))
    assert reading.warnings == ("texture without texture coordinates shows one texel: /Look/T",)


def test_the_tiles_of_a_udim_set(read, tmp_path: Path) -> None:
    pixels = {(0, 0): noise(3, seed=3), (2, 0): noise(3, seed=4), (0, 1): noise(3, seed=5)}
    for (u, v), tile in pixels.items():
        write_picture(tmp_path / "pictures" / f"body.{1001 + u + 10 * v}.png", tile)
    reading = read(preview_sphere(DIFFUSE_MAP, texture("../pictures/body.<UDIM>.png") + COORDINATES))
    found = surface_of(reading).diffuse.texture
    assert found.is_udim
    assert set(found.tiles) == set(pixels)
    for place, tile in pixels.items():
        np.testing.assert_array_equal(found.tiles[place].pixels[..., :3], tile)
    assert reading.warnings == ()


def test_textures_inside_of_packages(read, picture: Path, tmp_path: Path) -> None:
    for tile in (1001, 1012):
        write_picture(tmp_path / "pictures" / f"body.{tile}.png", noise(3, seed=tile))
    inputs = f"{DIFFUSE_MAP}\ncolor3f inputs:emissiveColor.connect = </Look/U.outputs:rgb>"
    udim = texture("../pictures/body.<UDIM>.png", name="U")
    found = read(preview_sphere(inputs, texture(picture) + udim + COORDINATES))
    package = tmp_path / "packed.usdz"
    assert UsdUtils.CreateNewUsdzPackage(found.scene.source, str(package))
    packed = surface_of(read_scene(package, strict=True))
    for name in ("diffuse", "emission"):
        before, after = (getattr(surface, name).texture.tiles for surface in (surface_of(found), packed))
        assert set(before) == set(after)
        for place in before:
            np.testing.assert_array_equal(before[place].pixels, after[place].pixels)
    assert set(packed.emission.texture.tiles) == {(0, 0), (1, 1)}


def test_a_missing_texture_of_colors_is_plain_to_see(read) -> None:
    prims = preview_sphere(DIFFUSE_MAP, texture("./gone.png") + COORDINATES)
    reading = read(prims)
    found = surface_of(reading).diffuse
    assert {tuple(color) for color in found.texture.tiles[0, 0].pixels.reshape(-1, 4)} == {
        (255, 0, 255, 255),
        (0, 0, 0, 255),
    }
    assert found.primvar == "map1"
    assert reading.warnings == (
        "./gone.png: there is no such file; it is magenta and black squares: /Look/T.inputs:file",
    )
    with pytest.raises(SceneError, match=r"stage.usda: /Look/T.inputs:file: ./gone.png: there is no such file"):
        read(prims, strict=True)


def test_the_fallback_stands_for_a_missing_texture_where_it_is_authored(read) -> None:
    inputs = f"{DIFFUSE_MAP}\nfloat inputs:roughness.connect = </Look/T.outputs:a>"
    fallback = "float4 inputs:fallback = (0.1, 0.2, 0.3, 0.4)\nfloat4 inputs:bias = (0.5, 0, 0, 0)"
    reading = read(preview_sphere(inputs, texture("./gone.png", fallback) + COORDINATES))
    assert reading.warnings == ("./gone.png: there is no such file; its fallback is used: /Look/T.inputs:file",)
    surface = surface_of(reading)
    assert surface.diffuse == pytest.approx((0.6, 0.2, 0.3))
    assert surface.roughness == pytest.approx(0.4)


def test_a_missing_texture_of_numbers_leaves_the_inputs_own(read) -> None:
    inputs = "float inputs:roughness.connect = </Look/T.outputs:r>\nfloat inputs:metallic.connect = </Look/T.outputs:r>"
    reading = read(preview_sphere(inputs + "\nfloat inputs:metallic = 0.75", texture("./gone.png") + COORDINATES))
    assert (surface_of(reading).roughness, surface_of(reading).metallic) == (0.5, 0.75)
    assert reading.warnings == (
        "./gone.png: there is no such file; the input's own value is used: /Look/T.inputs:file",
    )


def test_missing_tiles_and_damaged_files_are_named(read, tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "a.png").write_bytes(b"no picture")
    reading = read(preview_sphere(DIFFUSE_MAP, texture("../pictures/a.png") + COORDINATES))
    assert any("../pictures/a.png: it is no picture" in warning for warning in reading.warnings)
    prims = preview_sphere(DIFFUSE_MAP, texture("./b.<UDIM>.png") + COORDINATES)
    assert (
        "./b.<UDIM>.png: there are no such files; it is magenta and black squares: /Look/T.inputs:file"
        in read(prims).warnings
    )
    prims = preview_sphere(DIFFUSE_MAP, texture("") + COORDINATES)
    with pytest.raises(SceneError, match=r"/Look/T.inputs:file names no picture"):
        read(prims, strict=True)


NORMAL_MAP = "normal3f inputs:normal.connect = </Look/T.outputs:rgb>"
USUAL = "float4 inputs:scale = (2, 2, 2, 1)\nfloat4 inputs:bias = (-1, -1, -1, 0)"


def test_normal_maps(read, picture: Path) -> None:
    settings = USUAL + '\ntoken inputs:sourceColorSpace = "raw"'
    reading = read(preview_sphere(NORMAL_MAP, texture(picture, settings) + COORDINATES))
    normal = surface_of(reading).normal
    assert (normal.scale, normal.bias) == ((2.0, 2.0, 2.0, 1.0), (-1.0, -1.0, -1.0, 0.0))
    assert reading.warnings == ()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (USUAL, "a normal map is read as sRGB"),
        (USUAL + '\ntoken inputs:sourceColorSpace = "sRGB"', "a normal map is read as sRGB"),
        ('token inputs:sourceColorSpace = "raw"', "a normal map of 8 bits without scale"),
    ],
)
def test_what_cannot_be_meant_as_normals_is_named(read, picture: Path, settings: str, message: str) -> None:
    (warning,) = read(preview_sphere(NORMAL_MAP, texture(picture, settings) + COORDINATES)).warnings
    assert message in warning
    assert warning.endswith(": /Look/T")


def test_normals_in_floats_need_no_scale(read, tmp_path: Path) -> None:
    path = write_picture(tmp_path / "pictures" / "n.exr", noise(3, np.float32))
    assert read(preview_sphere(NORMAL_MAP, texture(path) + COORDINATES)).warnings == ()
