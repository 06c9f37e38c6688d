"""What is authored and not read is named once, with what may be meant; what is not for this renderer is left alone."""

from __future__ import annotations

import pytest
from pxr import Usd

from fgf_warp.errors import SceneError
from tests.usd.prims import preview_sphere
from usd_scenes.reader import unread as unread_module
from usd_scenes.reader.context import StageContext

BALL = 'def Sphere "Ball"\n{\n}\n'
MEANT = [
    ("DomeLight", "float intensity = 0.1", "inputs:intensity"),
    ("DistantLight", "float angle = 5", "inputs:angle"),
    ("SphereLight", "color3f color = (1, 0, 0)", "inputs:color"),
    ("RectLight", "float shaping:cone:angle = 20", "inputs:shaping:cone:angle"),
    ("RectLight", "asset texture:file = @a.png@", "inputs:texture:file"),
    ("SphereLight", "bool shadow:enable = 0", "inputs:shadow:enable"),
    ("SphereLight", "float inputs:itensity = 3", "inputs:intensity"),
    ("SphereLight", "float inputs:intenstiy = 3", "inputs:intensity"),
    ("SphereLight", "bool treatAsPiont = 1", "treatAsPoint"),
    ("Camera", "float focallength = 20", "focalLength"),
    ("Camera", "float fstop = 2", "fStop"),
    ("Camera", "float focusDistence = 2", "focusDistance"),
    ("Mesh", 'uniform token subdivisionscheme = "none"', "subdivisionScheme"),
    ("Mesh", "point3f[] point = []", "points"),
    ("Xform", 'token visiblity = "invisible"', "visibility"),
    ("Sphere", "color3f[] displayColor = [(1, 0, 0)]", "primvars:displayColor"),
    ("Mesh", "color3f[] primvars:displaycolor = [(1, 0, 0)]", "primvars:displayColor"),
    ("Xform", "float[] primvars:displayOpactiy = [0.5]", "primvars:displayOpacity"),
    ("Cube", "rel material:Binding = </Look>", "material:binding"),
    ("PointInstancer", "vector3f[] velocity = []", "velocities"),
    ("GeomSubset", "int[] indexes = [0]", "indices"),
    ("RenderSettings", "int2 resolutoin = (4, 4)", "resolution"),
    ("RenderProduct", "float pixelaspectratio = 2", "pixelAspectRatio"),
]


def unread(reading) -> list[str]:
    return [text for text in reading.warnings if "is not read" in text]


@pytest.mark.parametrize(("kind", "body", "meant"), MEANT)
def test_names_that_are_not_quite_right_are_told(read, kind: str, body: str, meant: str) -> None:
    name = body.split(" =", maxsplit=1)[0].rsplit(maxsplit=1)[-1]
    prim = f'def {kind} "P"\n{{\n{body}\n}}\n'
    assert unread(read(BALL + prim)) == [f"/P.{name} is not read: {meant} may be meant"]
    with pytest.raises(SceneError, match=f"/P.{name} is not read: {meant} may be meant"):
        read(BALL + prim, strict=True)


@pytest.mark.parametrize(
    ("inputs", "text"),
    [
        ("float inputs:rougness = 0.1", "inputs:roughness may be meant"),
        ("color3f inputs:diffusecolor = (1, 0, 0)", "inputs:diffuseColor may be meant"),
        ("float roughness = 0.1", "inputs:roughness may be meant"),
        ("float inputs:sparkle = 0.1", "a UsdPreviewSurface has no such input"),
    ],
)
def test_inputs_of_shaders_that_are_none_are_told(read, inputs: str, text: str) -> None:
    name = inputs.split(" =", maxsplit=1)[0].rsplit(maxsplit=1)[-1]
    assert unread(read(preview_sphere(inputs))) == [f"/Look/Surface.{name} is not read: {text}"]


def test_inputs_of_lights_that_are_none_are_told(read) -> None:
    light = 'def DiskLight "L"\n{\nasset inputs:texture:file = @a.png@\nfloat inputs:sparkle = 1\n}\n'
    paths = "/L.inputs:sparkle, /L.inputs:texture:file"
    assert unread(read(BALL + light)) == [f"{paths} is not read: a DiskLight has no such input"]


def test_prims_with_one_fault_have_one_warning(read) -> None:
    lamps = "".join(f'def SphereLight "L{i}"\n{{\nfloat intensity = 1\n}}\n' for i in range(3))
    paths = ", ".join(f"/L{i}.intensity" for i in range(3))
    assert unread(read(BALL + lamps)) == [f"{paths} is not read: inputs:intensity may be meant"]


@pytest.mark.parametrize(
    ("kind", "body"),
    [
        ("SphereLight", "float intensity = 1\nfloat inputs:intensity = 1"),  # Both are written for readers old and new.
        ("SphereLight", "float ri:light:intensity = 1\nfloat karma:intensity = 1\nfloat inputs:arnold:exposure = 1"),
        ("Mesh", "int[] faceVertexCounts = []\nfloat[] primvars:point = []\nfloat userProperties:points = 1"),
        ("Mesh", "color3f[] primvars:displayColor2 = []\nfloat[] primvars:radius = [1]\nfloat[] primvars:widths = [1]"),
        ("Xform", 'string comment = "mine"\nfloat weight = 3\ncustom float size = 2'),
        ("Camera", "float3[] extent = []\ndouble3 xformOp:translate = (0, 0, 0)"),
        ("RenderSettings", "int arnold:global:AA_samples = 3"),
        ("Sphere", "uniform bool doubleSided = 1"),
        ("BasisCurves", "float[] widths = [1]\nfloat[] width = [1]"),
        ("Scope", "rel thing = </Ball>"),
    ],
)
def test_what_is_for_others_needs_no_warning(read, kind: str, body: str) -> None:
    assert unread(read(BALL + f'def {kind} "P"\n{{\n{body}\n}}\n')) == []


MOVED = "double3 xformOp:translate = (1, 2, 3)\n"
ORDER = "uniform token[] xformOpOrder = "


@pytest.mark.parametrize(
    ("kind", "body", "text"),
    [
        ("Sphere", MOVED, "is not read: xformOpOrder does not name it"),
        ("Xform", MOVED + ORDER + "[]", "is not read: xformOpOrder does not name it"),
        ("Scope", MOVED + ORDER + '["xformOp:translate"]', "is not read: a Scope has no transform"),
        (
            "",
            MOVED + ORDER + '["xformOp:translate"]',
            "is not read: a prim without a type has no transform",
        ),
    ],
)
def test_operations_that_move_nothing_are_told(read, kind: str, body: str, text: str) -> None:
    prim = f'def {kind} "P"\n{{\n{body}\ndef Sphere "S"\n{{\n}}\n}}\n'
    assert unread(read(BALL + prim)) == [f"/P.xformOp:translate {text}"]


def test_an_order_that_names_what_is_not_there_is_told(read) -> None:
    prim = f'def Sphere "P"\n{{\n{MOVED}{ORDER}["xformOp:translate", "!invert!xformOp:rotateX"]\n}}\n'
    reading = read(prim)
    assert reading.warnings == ("/P.xformOpOrder names xformOp:rotateX, which is not there; it is left out",)
    assert tuple(reading.scene.shapes[0].object_to_world[:3, 3]) == (1, 2, 3)
    with pytest.raises(SceneError, match=r"/P.xformOpOrder names xformOp:rotateX"):
        read(prim, strict=True)


def test_what_a_schema_has_and_is_not_rendered_is_told_unless_it_changes_nothing(read) -> None:
    for value, is_told in (("bounds", True), ("inherited", False)):
        model = f"""def Xform "M" (
    prepend apiSchemas = ["GeomModelAPI", "MotionAPI"]
)
{{
    uniform token model:drawMode = "{value}"
    float motion:blurScale = {2 if is_told else 1}
}}
"""
        told = ["model:drawMode is not read: /M", "motion:blurScale is not read: /M"]
        assert sorted(unread(read(BALL + model))) == (told if is_told else [])


def test_a_name_is_looked_into_once_for_all_prims_of_a_type(monkeypatch) -> None:
    """So that 10,000 prims take less than a second."""
    stage = Usd.Stage.CreateInMemory()
    lamps = (f'def SphereLight "L{i}"\n{{\nfloat intensity = 1\nfloat inputs:radius = 2\n}}\n' for i in range(10_000))
    stage.GetRootLayer().ImportFromString("#usda 1.0\n" + "".join(lamps))
    context = StageContext(stage=stage, time=Usd.TimeCode.Default(), purposes=frozenset())
    looked, nearest = [], unread_module._nearest
    monkeypatch.setattr(unread_module, "_nearest", lambda name, meant: looked.append(name) or nearest(name, meant))
    check = unread_module.PropertyCheck(context)
    for prim in stage.Traverse():
        check.check(prim)
    assert looked == ["intensity"]
    assert len(context.notes.entries()) == 10_000


def test_relationships_that_are_named_like_operations_are_told(read) -> None:
    prim = 'def Sphere "P"\n{\nrel xformOp:scale = </P>\n}\n'
    assert read(prim).warnings == ("/P.xformOp:scale is not read: xformOpOrder does not name it",)


@pytest.mark.parametrize("kind", ["unknown[]", "unknown"])
def test_an_order_of_another_type_is_left_out(read, kind: str) -> None:
    """Neither USD nor this reader makes anything of it."""
    value = '["xformOp:scale"]' if "[" in kind else '"xformOp:scale"'
    ball = f'def Sphere "P"\n{{\nfloat3 xformOp:scale = (2, 2, 2)\nuniform {kind} xformOpOrder = {value}\n}}\n'
    order, scale = read(ball).warnings
    assert order.startswith("/P.xformOpOrder = ")
    assert order.endswith("; accepted: an array of tokens; it is left out")
    assert scale == "/P.xformOp:scale is not read: xformOpOrder does not name it"
    with pytest.raises(SceneError, match=r"/P.xformOpOrder = .*; accepted: an array of tokens"):
        read(ball, strict=True)


# Variants


def varied(selections: str, more: str = "") -> str:
    """A prim with a variant set of two balls."""
    return f"""def Xform "V" (
    variants = {{
        {selections}
    }}
    prepend variantSets = "look"
)
{{
    {more}
    variantSet "look" = {{
        "red" {{
            def Sphere "Red"
            {{
            }}
        }}
        "blue" {{
            def Sphere "Blue"
            {{
            }}
        }}
    }}
}}
"""


def test_a_variant_that_is_not_there_is_told(read) -> None:
    found = "selects gone of the variant set look; accepted: blue, red"
    reading = read(BALL + varied('string look = "gone"'))
    assert reading.warnings == (f"/V {found}; none is used",)
    assert [shape.name for shape in reading.scene.shapes] == ["/Ball"]
    with pytest.raises(SceneError, match=f"/V {found}"):
        read(BALL + varied('string look = "gone"'), strict=True)


def test_a_variant_set_that_is_not_there_is_told(read) -> None:
    reading = read(varied('string look = "red"\nstring size = "big"'), strict=True)
    assert reading.warnings == ("/V selects big of a variant set size, which is not there; it is of no effect",)
    assert [shape.name for shape in reading.scene.shapes] == ["/V/Red"]


@pytest.mark.parametrize("selection", ['string look = "blue"', 'string look = ""', ""])
def test_variants_that_are_there_or_not_chosen_need_no_warning(read, selection: str) -> None:
    assert read(BALL + varied(selection)).warnings == ()


# Collections


def collection(includes: str, excludes: str = "") -> str:
    return f"""def Xform "G" (
    prepend apiSchemas = ["CollectionAPI:some", "CollectionAPI:other"]
)
{{
    rel collection:some:includes = [{includes}]
    rel collection:some:excludes = [{excludes}]
}}
"""


@pytest.mark.parametrize(
    ("includes", "excludes", "of"),
    [
        ("</Ball>, </Gone>", "", "includes = /Gone"),
        ("</Ball>", "</Gone/Below>", "excludes = /Gone/Below"),
        ("</Ball.gone>", "", "includes = /Ball.gone"),
        ("</Ball.collection:gone>", "", "includes = /Ball.collection:gone"),
    ],
)
def test_members_of_collections_that_are_not_there_are_told(read, includes: str, excludes: str, of: str) -> None:
    prims = BALL + collection(includes, excludes)
    assert read(prims).warnings == (f"/G.collection:some:{of}, which is not there; it is left out",)
    with pytest.raises(SceneError, match=f"/G.collection:some:{of}, which is not there"):
        read(prims, strict=True)


def test_members_of_what_a_light_is_linked_to_are_told_once(read) -> None:
    light = """def SphereLight "Lamp"
{
    rel collection:lightLink:includes = [</Gone>, </Ball>]
    uniform bool collection:lightLink:includeRoot = 0
}
"""
    reading = read(BALL + light)
    assert reading.warnings == ("/Lamp.collection:lightLink:includes = /Gone, which is not there; it is left out",)


def test_members_of_collections_that_are_there_need_no_warning(read) -> None:
    prims = BALL + collection("</Ball>, </G>, </Ball.radius>, </G.collection:other>", "</Ball>")
    assert read(prims, strict=True).warnings == ()
