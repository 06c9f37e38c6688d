"""Shapes get the material that USD says is theirs, or their display color."""

from __future__ import annotations

import pytest
from pxr import Usd, UsdGeom

from fgf_warp.errors import SceneError
from fgf_warp.scene import PrimvarInput, Surface
from usd_scenes import schema
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.materials import MaterialReader

API = 'prepend apiSchemas = ["MaterialBindingAPI"]'
QUAD = """int[] faceVertexCounts = [3, 3]
    int[] faceVertexIndices = [0, 1, 2, 0, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]"""


def material(name: str, red: float, *, context: str = "", more: str = "") -> str:
    """A matte material, told from others by its red."""
    return f"""
def Material "{name}"
{{
    token outputs:{context}surface.connect = </{name}/S.outputs:surface>
    {more}
    def Shader "S"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = ({red}, 0, 0)
        float inputs:ior = 1
        token outputs:surface
    }}
}}
"""


RED = material("Red", 0.9)
DARK = material("Dark", 0.1)


def sphere(body: str, schemas: str = API) -> str:
    return f'def Sphere "Ball" (\n {schemas}\n)\n{{\n {body}\n}}\n'


def reds(reading) -> list[float]:
    return [shape.surface.diffuse[0] for shape in reading.scene.shapes]


@pytest.mark.parametrize(
    ("body", "red"),
    [
        ("rel material:binding = </Red>", 0.9),
        ("rel material:binding:full = </Red>", 0.9),
        ("rel material:binding = </Dark>\nrel material:binding:full = </Red>", 0.9),
        ("rel material:binding = </Dark>\nrel material:binding:preview = </Red>", 0.1),
    ],
)
def test_the_binding_for_full_renders_stands_before_that_for_all(read, body: str, red: float) -> None:
    assert reds(read(RED + DARK + sphere(body))) == [red]


def test_a_binding_for_previews_is_not_for_renders(read) -> None:
    reading = read(RED + sphere("rel material:binding:preview = </Red>"))
    assert reading.scene.shapes[0].surface == Surface()
    assert reading.warnings == ("bound for previews only: the display color is used: /Ball",)


@pytest.mark.parametrize(("strength", "red"), [("strongerThanDescendants", 0.1), ("weakerThanDescendants", 0.9)])
def test_bindings_are_inherited_by_strength(read, strength: str, red: float) -> None:
    parent = f"""def Xform "X" (\n {API}\n)\n{{
    rel material:binding = </Dark> (bindMaterialAs = "{strength}")
    {sphere("rel material:binding = </Red>")}
    {sphere("", "").replace("Ball", "Other")}
}}
"""
    assert reds(read(RED + DARK + parent)) == [red, 0.1]


def test_collections_bind(read) -> None:
    group = f"""def Xform "X" (\n prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:shiny"]\n)\n{{
    rel collection:shiny:includes = </X/Ball>
    rel material:binding:collection:shiny = [</X.collection:shiny>, </Red>]
    rel material:binding = </Dark>
    {sphere("", "")}
    {sphere("", "").replace("Ball", "Other")}
}}
"""
    assert reds(read(RED + DARK + group)) == [0.9, 0.1]


def test_subsets_have_looks_of_their_own() -> None:
    schema.register()
    stage = Usd.Stage.CreateInMemory("subsets.usda")
    stage.GetRootLayer().ImportFromString(
        "#usda 1.0\n"
        + RED
        + DARK
        + f"""def Mesh "M" (\n {API}\n)\n{{
    rel material:binding = </Dark>
    {QUAD}
    def GeomSubset "Bound" (\n {API}\n)\n{{
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [0]
        rel material:binding = </Red>
    }}
    def GeomSubset "Free"\n{{
        int[] indices = [1]
    }}
}}
def Mesh "N"\n{{
    {QUAD}
    color3f[] primvars:displayColor = [(0.1, 0, 0), (0.2, 0, 0)] (interpolation = "uniform")
    def GeomSubset "Free"\n{{
        int[] indices = [1]
    }}
}}
"""
    )
    context = StageContext(stage=stage, time=Usd.TimeCode.EarliestTime(), purposes=frozenset({"default"}))
    reader = MaterialReader(context)

    def diffuse(path: str):
        return reader.look_of(stage.GetPrimAtPath(path)).surface.diffuse

    assert UsdGeom.Subset.Get(stage, "/M/Bound")
    assert diffuse("/M/Bound")[0] == 0.9
    assert diffuse("/M/Free")[0] == 0.1
    assert diffuse("/M")[0] == 0.1
    assert diffuse("/N/Free") == PrimvarInput("displayColor", fallback=(0.18, 0.18, 0.18))


def test_instances_are_bound_inside_their_prototype(read) -> None:
    inside = RED.replace("/Red/", "/Model/Red/") + sphere("rel material:binding = </Model/Red>")
    model = f'class "Model"\n{{\n{inside}\n}}\n'
    instances = "".join(
        f'def Xform "I{i}" (\n instanceable = true\n inherits = </Model>\n)\n{{\n}}\n' for i in range(2)
    )
    first, second = read(model + instances).scene.shapes
    assert (first.name, second.name) == ("/I0/Ball", "/I1/Ball")
    assert first.surface is second.surface
    assert first.surface.diffuse[0] == 0.9


@pytest.mark.parametrize("target", ["/Gone", "/Ball"])
def test_a_binding_to_no_material_is_named(read, target: str) -> None:
    prims = sphere(f"rel material:binding = <{target}>")
    reading = read(prims)
    assert (
        "bound to something that is no Material; the display color is used: /Ball.material:binding" in reading.warnings
    )
    assert reading.scene.shapes[0].surface == Surface()
    with pytest.raises(SceneError, match=r"/Ball.material:binding: bound to something that is no Material"):
        read(prims, strict=True)


def test_terminals_for_this_renderer_stand_before_the_universal_ones(read) -> None:
    both = material("Red", 0.9, more="token outputs:fgf:surface.connect = </Dark/S.outputs:surface>")
    assert reds(read(both + DARK + sphere("rel material:binding = </Red>"))) == [0.1]
    own = material("Red", 0.9, context="fgf:")
    assert reds(read(own + sphere("rel material:binding = </Red>"))) == [0.9]
    others = material("Red", 0.9, context="ri:")
    reading = read(others + sphere("rel material:binding = </Red>"))
    assert reading.warnings == ("material without a surface: the display color is used: /Red",)


@pytest.mark.parametrize(
    ("terminal", "text"),
    [("displacement", "displacement is not rendered"), ("volume", "a volume is rendered where FgfMediumAPI says what")],
)
def test_terminals_that_are_not_rendered_are_named(read, terminal: str, text: str) -> None:
    more = f"""token outputs:{terminal}.connect = </Red/V.outputs:out>
    def Shader "V"
    {{
        uniform token info:id = "V"
        token outputs:out
    }}"""
    (warning,) = read(material("Red", 0.9, more=more) + sphere("rel material:binding = </Red>")).warnings
    assert warning.startswith(text)
    assert warning.endswith(": /Red")


def test_display_color_where_there_is_no_material(read) -> None:
    prims = (
        'def Xform "X"\n{\n color3f[] primvars:displayColor = [(0.1, 0.2, 0.3)]\n'
        ' def Sphere "A"\n{\n}\n def Sphere "B"\n{\n color3f[] primvars:displayColor = [(0.9, 0.2, 0.3)]\n}\n}\n'
        'def Sphere "C"\n{\n}\n'
    )
    surfaces = [shape.surface for shape in read(prims).scene.shapes]
    assert surfaces == [Surface((0.1, 0.2, 0.3)), Surface((0.9, 0.2, 0.3)), Surface((0.18, 0.18, 0.18))]
    assert all(surface.is_matte for surface in surfaces)


def mesh(primvars: str) -> str:
    return f'def Mesh "M"\n{{\n    {QUAD}\n    uniform token subdivisionScheme = "none"\n    {primvars}\n}}\n'


def test_display_color_and_opacity_may_vary_over_a_mesh(read) -> None:
    primvars = """color3f[] primvars:displayColor = [(0.1, 0, 0), (0.2, 0, 0)] (interpolation = "uniform")
    float[] primvars:displayOpacity = [0.5]"""
    surface = read(mesh(primvars)).scene.shapes[0].surface
    assert surface == Surface(PrimvarInput("displayColor", fallback=(0.18, 0.18, 0.18)), opacity=0.5)


def test_equal_display_colors_are_one(read) -> None:
    primvars = """color3f[] primvars:displayColor = [(0.1, 0, 0), (0.7, 0, 0)] (interpolation = "uniform")
    int[] primvars:displayColor:indices = [1, 1]"""
    assert read(mesh(primvars)).scene.shapes[0].surface == Surface((0.7, 0.0, 0.0))


def test_display_colors_of_solids_are_one_by_name(read) -> None:
    colors = 'color3f[] primvars:displayColor = [(0.1, 0, 0), (0.2, 0, 0)] (interpolation = "uniform")'
    reading = read(sphere(colors, ""))
    assert reading.scene.shapes[0].surface == Surface((0.1, 0.0, 0.0))
    assert reading.warnings == (
        "displayColor varies over a shape that is no mesh: its first value is used: /Ball.primvars:displayColor",
    )


def test_shapes_of_one_material_share_its_surface(read) -> None:
    prims = RED + "".join(sphere("rel material:binding = </Red>").replace("Ball", name) for name in ("Ball", "Other"))
    first, second = (shape.surface for shape in read(prims).scene.shapes)
    assert first is second
