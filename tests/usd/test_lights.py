"""Radiance and geometry of lights, after the UsdLux documentation."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from pxr import Usd, UsdLux

from fgf_warp.errors import SceneError, UnsupportedFeatureError
from fgf_warp.scene import AreaLight, CylinderLight, DistantLight, DomeLight, MeshLight, SphereLight
from tests.usd.prims import HEADER
from usd_scenes.reader import read_scene
from usd_scenes.reader.lights import DEFAULT_KEY_FROM

ASSETS = Path(__file__).parents[3] / "shared" / "usd_assets"
LINKING = ASSETS / "PixarAnimationStudios__OpenUSD/pxr/usd/usdLux/testenv/testUsdLuxLinkingAPI/linking_example.usda"


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
    ("kind", "body", "name"),
    [
        ("RectLight", "float inputs:diffuse = 0.5", "inputs:diffuse"),
        ("RectLight", "rel light:filters = </F>", "light:filters"),
    ],
)
def test_what_is_ignored_is_named(read, kind: str, body: str, name: str) -> None:
    assert f"{name} of lights is not supported and is ignored: /Lamp" in read(light_prim(kind, body)).warnings


BALL = 'def Sphere "Ball"\n{\n}\n'
HINT = "is a hint that is not followed: the light has its radius: /Lamp"


@pytest.mark.parametrize(("kind", "hint"), [("SphereLight", "treatAsPoint"), ("CylinderLight", "treatAsLine")])
def test_a_light_that_may_be_without_a_radius_keeps_it(read, kind: str, hint: str) -> None:
    """The hint is told in one sentence, of a light that gives light alone, and not where there is nothing to tell."""
    reading = read(light_prim(kind, f"bool {hint} = 1") + BALL, light="")
    assert reading.warnings == (f"{hint} {HINT}",)
    (light,) = reading.scene.lights
    assert light.radius == pytest.approx(0.5)
    assert read(light_prim(kind, f"bool {hint} = 0") + BALL).warnings == ()
    flat = 'float3 xformOp:scale = (0, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:scale"]\n'
    (warning,) = read(light_prim(kind, f"{flat}bool {hint} = 1") + BALL).warnings
    assert warning.endswith("the light is left out: /Lamp")
    point = f"float inputs:radius = 0\nbool inputs:normalize = 1\nbool {hint} = 1"
    assert not any(hint in warning for warning in read(light_prim(kind, point) + BALL).warnings)


def test_default_values_need_no_warning(read) -> None:
    light = light_prim("RectLight", "float inputs:diffuse = 1\nbool inputs:shadow:enable = 1")
    assert read(light + BALL).warnings == ()


# Images


@pytest.fixture
def sky(tmp_path: Path) -> Path:
    """A small image of light, of linear float32."""
    path = tmp_path / "sky.exr"
    pixels = np.arange(8 * 4 * 3, dtype=np.float32).reshape(4, 8, 3)
    image = OpenImageIO.ImageBuf(pixels)
    assert image.write(str(path)), image.geterror()
    return path


def test_a_dome_has_its_image(read, sky: Path) -> None:
    light = only_light(
        read, light_prim("DomeLight", f"float inputs:intensity = 2\nasset inputs:texture:file = @{sky}@")
    )
    assert light.radiance == (2, 2, 2)
    assert light.light_to_world == ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    np.testing.assert_array_equal(light.image.pixels[..., :3].reshape(-1), np.arange(8 * 4 * 3))
    assert not light.image.is_srgb


POLES = [
    ("DomeLight", "", "Y", (0, 1, 0)),
    ("DomeLight", "", "Z", (0, 1, 0)),
    ("DomeLight_1", "", "Y", (0, 1, 0)),
    ("DomeLight_1", "", "Z", (0, 0, 1)),
    ("DomeLight_1", 'uniform token poleAxis = "Y"', "Z", (0, 1, 0)),
    ("DomeLight_1", 'uniform token poleAxis = "Z"', "Y", (0, 0, 1)),
]


@pytest.mark.parametrize(("kind", "body", "up", "pole"), POLES)
def test_the_pole_of_a_dome(read, sky: Path, kind: str, body: str, up: str, pole) -> None:
    header = HEADER.replace('"Y"', f'"{up}"')
    reading = read(light_prim(kind, f"asset inputs:texture:file = @{sky}@\n{body}"), light="", header=header)
    turn = np.array(reading.scene.lights[0].light_to_world)
    np.testing.assert_allclose(turn @ [0, 1, 0], pole, atol=1e-12)
    # Turned about x: what is to the right stays there.
    np.testing.assert_allclose(turn @ [1, 0, 0], [1, 0, 0], atol=1e-12)


def test_a_dome_turns_with_its_transform_but_does_not_grow(read, sky: Path) -> None:
    body = f"""asset inputs:texture:file = @{sky}@
    float xformOp:rotateY = 90
    float3 xformOp:scale = (7, 8, 9)
    uniform token[] xformOpOrder = ["xformOp:rotateY", "xformOp:scale"]"""
    turn = np.array(only_light(read, light_prim("DomeLight", body)).light_to_world)
    np.testing.assert_allclose(turn @ [0, 0, 1], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)


def test_an_image_that_is_not_there_is_told_or_refused(read) -> None:
    prim = light_prim("DomeLight", "float inputs:intensity = 2\nasset inputs:texture:file = @gone.exr@")
    reading = read(prim, light="")
    assert reading.scene.lights == (DomeLight(name="/Lamp", radiance=(2, 2, 2)),)
    assert any("gone.exr" in text and text.endswith("/Lamp.inputs:texture:file") for text in reading.warnings)
    with pytest.raises(SceneError, match=r"/Lamp.inputs:texture:file: .*gone.exr"):
        read(prim, light="", strict=True)


def test_other_layouts_of_a_dome_are_left_out(read, sky: Path) -> None:
    body = f'asset inputs:texture:file = @{sky}@\ntoken inputs:texture:format = "angular"'
    reading = read(light_prim("DomeLight", body), light="")
    assert reading.scene.lights[0].image is None
    assert any(text.startswith("an image of format angular is not supported") for text in reading.warnings)


@pytest.mark.parametrize("sign", ["", "-"])
def test_the_image_of_a_rect_is_upright_where_it_shines(read, sky: Path, sign: str) -> None:
    """Seen from -z with +y up, +x is to the left: there the image begins."""
    body = f"asset inputs:texture:file = @{sky}@\n" + TURNED.format(sign=sign)
    light = only_light(read, light_prim("RectLight", body))
    (s_axis, t_axis), (u, v) = np.array(light.image_axes), (np.array(light.half_u), np.array(light.half_v))
    scale = np.array([float(f"{sign}2"), 3, 1])
    local = rotation_xyz(*(math.radians(angle) for angle in (20, 50, -70))) * scale
    right, up = local @ [-0.5, 0, 0], local @ [0, 0.5, 0]
    for at, expected in ((right, (1, 0.5)), (-right, (0, 0.5)), (up, (0.5, 1)), (-up, (0.5, 0))):
        place = [at @ u / (u @ u), at @ v / (v @ v), 1]
        assert (s_axis @ place, t_axis @ place) == pytest.approx(expected, abs=1e-6)


# Tubes and meshes


def test_a_cylinder_light_lies_along_its_x(read) -> None:
    light = only_light(
        read, light_prim("CylinderLight", "float inputs:length = 4\nfloat inputs:radius = 0.25\n" + MOVED)
    )
    assert isinstance(light, CylinderLight)
    assert (light.center, light.radiance) == ((1, 2, 3), (1, 1, 1))
    assert light.radius == pytest.approx(0.75)
    assert light.half_axis == pytest.approx((0, 0, -6), abs=1e-12)


MOVED = """double3 xformOp:translate = (1, 2, 3)
float xformOp:rotateY = 90
float3 xformOp:scale = (3, 3, 3)
uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateY", "xformOp:scale"]
"""


def test_a_cylinder_lights_ends_do_not_count_when_it_is_normalized(read) -> None:
    light = only_light(read, light_prim("CylinderLight", "float inputs:length = 4\nbool inputs:normalize = 1"))
    assert light.radiance[0] == pytest.approx(1 / (2 * math.pi * 0.5 * 4))


def test_a_tube_may_be_stretched_along_but_not_across(read) -> None:
    for scale, radius, is_told in (("(5, 1, 1)", 0.5, False), ("(1, 4, 1)", 1.0, True)):
        body = f'float3 xformOp:scale = {scale}\nuniform token[] xformOpOrder = ["xformOp:scale"]'
        reading = read(light_prim("CylinderLight", body), light="")
        assert reading.scene.lights[0].radius == pytest.approx(radius)
        assert any("a round tube of the same volume" in text for text in reading.warnings) == is_told


MESH_LIGHT = """def Mesh "Lamp" (
    prepend apiSchemas = [{schemas}]
)
{{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
    {body}
}}
"""


@pytest.mark.parametrize("sign", [1, -1])
def test_a_mesh_light_emits_to_its_front_and_is_no_shape(read, sign: int) -> None:
    body = f"""float inputs:intensity = 3
    bool inputs:normalize = 1
    float3 xformOp:scale = (2, {2 * sign}, 2)
    uniform token[] xformOpOrder = ["xformOp:scale"]"""
    reading = read(MESH_LIGHT.format(schemas='"MeshLightAPI"', body=body), light="")
    (light,) = reading.scene.lights
    assert isinstance(light, MeshLight)
    assert reading.scene.shapes == ()
    assert light.area == pytest.approx(8)
    assert light.radiance[0] == pytest.approx(3 / 8)
    a, b, c = (light.corners[:, corner] for corner in range(3))
    normals = np.cross(b - a, c - a)
    # A mirrored mesh keeps its outside, which is that of its points in their order before the mirror.
    assert (normals[:, 2] > 0).all()


def test_the_material_of_a_mesh_light_is_not_used_with_a_warning(read) -> None:
    schemas = '"MeshLightAPI", "MaterialBindingAPI"'
    bound = "rel material:binding = </M>\n{}\n"
    material = 'def Material "M"\n{\n}\n'
    text = "a mesh that emits makes no use of its material, whatever materialGlowTintsLight says: /Lamp"
    tinted = read(MESH_LIGHT.format(schemas=schemas, body=bound.format("")) + material)
    assert text in tinted.warnings
    silent = bound.format('uniform token light:materialSyncMode = "noMaterialResponse"')
    assert not any(
        "makes no use" in t for t in read(MESH_LIGHT.format(schemas=schemas, body=silent) + material).warnings
    )


def test_a_geometry_light_emits_in_place_of_its_mesh(read) -> None:
    mesh = MESH_LIGHT.format(schemas="", body="").replace('"Lamp" (\n    prepend apiSchemas = []\n)', '"Panel"')
    light = 'def GeometryLight "G"\n{\n rel geometry = </Panel>\n float inputs:intensity = 5\n}\n'
    reading = read(mesh + light, light="")
    assert [(item.name, item.area, item.radiance) for item in reading.scene.lights] == [("/G", 2, (5, 5, 5))]
    assert reading.scene.shapes == ()
    lost = read(light)
    assert "a GeometryLight gives light where its geometry is one Mesh, and is left out: /G" in lost.warnings


# Shaping


def shaped(kind: str, body: str) -> str:
    return f'def {kind} "Lamp" (\n prepend apiSchemas = ["ShapingAPI", "ShadowAPI"]\n)\n{{\n{body}\n}}\n'


def test_shaping_is_read(read) -> None:
    body = """float inputs:shaping:cone:angle = 30
    float inputs:shaping:cone:softness = 0.25
    float inputs:shaping:focus = 2
    color3f inputs:shaping:focusTint = (1, 0.5, 0)
    float xformOp:rotateX = -90
    uniform token[] xformOpOrder = ["xformOp:rotateX"]"""
    for kind in ("SphereLight", "RectLight", "DiskLight", "CylinderLight"):
        shaping = only_light(read, shaped(kind, body)).shaping
        assert shaping.axis == pytest.approx((0, -1, 0), abs=1e-12)
        assert shaping.cone_angle == pytest.approx(math.radians(30))
        assert (shaping.cone_softness, shaping.focus, shaping.focus_tint) == (0.25, 2, (1, 0.5, 0))


@pytest.mark.parametrize(
    ("kind", "angle", "is_even"),
    [("RectLight", 90, True), ("RectLight", 89, False), ("SphereLight", 90, False), ("SphereLight", 180, True)],
)
def test_a_cone_that_cuts_nothing_is_no_shaping(read, kind: str, angle: float, is_even: bool) -> None:
    light = only_light(read, shaped(kind, f"float inputs:shaping:cone:angle = {angle}"))
    assert (light.shaping is None) == is_even


def test_what_shaping_does_not_do_is_named(read) -> None:
    text = "ShapingAPI of a DistantLight is not supported and is ignored: /Lamp"
    for body, is_told in (("", False), ("float inputs:shaping:cone:angle = 20", True)):
        assert (text in read(shaped("DistantLight", body)).warnings) == is_told
    unapplied = read(light_prim("SphereLight", "float inputs:shaping:cone:angle = 30"))
    assert (
        "/Lamp.inputs:shaping:cone:angle is of no effect on a light to which ShapingAPI is not applied"
        in unapplied.warnings
    )
    assert unapplied.scene.lights[-1].shaping is None


def test_a_light_that_moves_is_told(read) -> None:
    camera = 'def Camera "C"\n{\n double shutter:close = 0.5\n}\n'
    body = """double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 10: (20, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]"""
    reading = read(light_prim("SphereLight", body), camera=camera, frame=1)
    assert reading.scene.lights[-1].center == (2, 0, 0)
    assert "a light that moves is rendered where it is when the shutter opens: /Lamp" in reading.warnings


# Links

BALLS = "".join(f'def Sphere "{name}"\n{{\n}}\n' for name in "abc")


def link(collection: str, includes: str, name: str = "Lamp", root: int = 0) -> str:
    return f"""def SphereLight "{name}"
{{
    rel collection:{collection}:includes = [{includes}]
    uniform bool collection:{collection}:includeRoot = {root}
}}
"""


def test_equal_sets_of_links_share_a_bit(read) -> None:
    lamps = link("lightLink", "</a>", "A") + link("lightLink", "</b>, </c>", "B") + link("lightLink", "</a>", "C")
    scene = read(BALLS + lamps).scene
    assert [light.link for light in scene.lights] == [None, 0, 1, 0]
    assert [shape.light_links for shape in scene.shapes] == [0b01, 0b10, 0b10]
    assert [shape.shadow_links for shape in scene.shapes] == [0, 0, 0]


def test_a_light_that_is_linked_to_all_has_no_link(read) -> None:
    lamps = link("lightLink", "</a>, </b>, </c>", "A") + link("shadowLink", "</a>", "B", root=1)
    assert [(light.link, light.shadow_link) for light in read(BALLS + lamps).scene.lights] == [(None, None)] * 3


def test_shadow_links_are_bits_of_their_own(read) -> None:
    scene = read(BALLS + link("lightLink", "</a>", "A") + link("shadowLink", "</b>", "B")).scene
    assert [(light.link, light.shadow_link) for light in scene.lights] == [(None, None), (0, None), (None, 0)]
    assert [(shape.light_links, shape.shadow_links) for shape in scene.shapes] == [(1, 0), (0, 1), (0, 0)]


def test_a_light_without_shadows_has_them_from_no_shape(read) -> None:
    scene = read(BALLS + shaped("SphereLight", "bool inputs:shadow:enable = 0")).scene
    assert scene.lights[1].shadow_link == 0
    assert [shape.shadow_links for shape in scene.shapes] == [0, 0, 0]


def test_more_sets_than_bits_are_not_supported(read) -> None:
    balls = "".join(f'def Sphere "s{i}"\n{{\n}}\n' for i in range(33))
    with pytest.raises(UnsupportedFeatureError, match="light links of the stage name more than 32 different sets"):
        read(balls + "".join(link("lightLink", f"</s{i}>", f"L{i}") for i in range(33)))


def test_expressions_are_links_too(read) -> None:
    lamp = """def SphereLight "Lamp"
{
    uniform bool collection:lightLink:includeRoot = 0
    uniform pathExpression collection:lightLink:membershipExpression = "/a /c"
}
"""
    assert [shape.light_links for shape in read(BALLS + lamp).scene.shapes] == [1, 0, 1]


def test_instances_are_linked_by_their_own_paths(read) -> None:
    instances = 'class Xform "Model"\n{\n def Sphere "Ball"\n {\n }\n}\n' + "".join(
        f'def Xform "{name}" (\n instanceable = true\n references = </Model>\n)\n{{\n}}\n' for name in ("One", "Two")
    )
    shapes = read(instances + link("lightLink", "</Two>")).scene.shapes
    assert {shape.name: shape.light_links for shape in shapes} == {"/One/Ball": 0, "/Two/Ball": 1}


INSTANCER = """def PointInstancer "Cloud"
{{
    rel prototypes = [{prototype}]
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 0), (5, 0, 0)]
    def Sphere "Near"
    {{
    }}
}}
over "Library"
{{
    def Sphere "Far"
    {{
    }}
}}
"""


@pytest.mark.parametrize("prototype", ["</Cloud/Near>", "</Library/Far>"])
def test_instancers_are_linked_with_all_their_copies(read, prototype: str) -> None:
    prims = INSTANCER.format(prototype=prototype) + BALLS
    shapes = read(prims + link("lightLink", "</Cloud>")).scene.shapes
    assert [shape.light_links for shape in shapes] == [1, 1, 0, 0, 0]


PARTS = """def Mesh "Two"
{{
    int[] faceVertexCounts = [3, 3]
    int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
    point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
    def GeomSubset "Part" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
        uniform token elementType = "face"
        uniform token familyName = "{family}"
        int[] indices = [1]
        {binding}
    }}
}}
def Material "M"
{{
}}
"""


def test_parts_of_a_mesh_are_linked_where_they_are_shapes(read) -> None:
    lamp = link("lightLink", "</Two/Part>")
    bound = read(PARTS.format(family="materialBind", binding="rel material:binding = </M>") + lamp)
    assert {shape.name: shape.light_links for shape in bound.scene.shapes} == {"/Two": 0, "/Two/Part": 1}
    plain = read(PARTS.format(family="other", binding="") + lamp)
    text = "a light cannot be linked to a part of a mesh that has no material of its own: /Two/Part"
    assert text in plain.warnings
    assert text not in bound.warnings


@pytest.mark.skipif(
    not LINKING.is_file(), reason="the third-party stages of ../shared/usd_assets are not on this machine"
)
def test_links_of_others_are_those_of_usd() -> None:
    scene = read_scene(LINKING).scene
    stage = Usd.Stage.Open(str(LINKING))
    for light in scene.lights:
        collection = UsdLux.LightAPI(stage.GetPrimAtPath(light.name)).GetLightLinkCollectionAPI()
        query = collection.ComputeMembershipQuery()
        for shape in scene.shapes:
            is_lit = light.link is None or bool(shape.light_links >> light.link & 1)
            assert is_lit == query.IsPathIncluded(shape.name), (light.name, shape.name)
    assert len({light.link for light in scene.lights}) == 7


def test_a_stage_without_geometry_is_named(read) -> None:
    assert [w for w in read(light_prim("RectLight", "")).warnings if w.startswith("no geometry")]


def test_unsupported_lights_are_named(read) -> None:
    reading = read(light_prim("PortalLight", ""))
    assert "light of type PortalLight is not supported and gives no light: /Lamp" in reading.warnings
    assert [light.name for light in reading.scene.lights] == ["/Dome"]


def test_invisible_lights_are_skipped(read) -> None:
    reading = read(light_prim("RectLight", 'token visibility = "invisible"'))
    assert [light.name for light in reading.scene.lights] == ["/Dome"]


def test_a_stage_without_light_is_lit_from_beside_the_camera(read) -> None:
    reading = read("", light="")
    key, dome = reading.scene.lights
    assert "no light: a dim environment and a light from beside the camera are used" in reading.warnings
    seen_from = -np.array(key.direction) @ reading.scene.camera.camera_to_world[:3, :3]
    np.testing.assert_allclose(seen_from / seen_from[2], DEFAULT_KEY_FROM, atol=1e-6)
    # A white diffuse surface that faces the light has radiance 1.
    irradiance = math.pi * math.sin(key.half_angle) ** 2 * np.array(key.radiance) + math.pi * np.array(dome.radiance)
    np.testing.assert_allclose(irradiance / math.pi, 1, rtol=1e-12)


def test_what_glows_is_light_enough(read) -> None:
    prims = """def Sphere "Lamp" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    rel material:binding = </Glow>
}
def Material "Glow"
{
    token outputs:surface.connect = </Glow/Surface.outputs:surface>
    def Shader "Surface"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:emissiveColor = (1, 1, 1)
        token outputs:surface
    }
}
"""
    assert read(prims, light="").scene.lights == ()
