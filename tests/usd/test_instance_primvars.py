"""What a PointInstancer says of each of its instances: the value of each, from the reader to the picture."""

from __future__ import annotations

import numpy as np
import pytest

from fgf_warp.renderer import render
from fgf_warp.scene import MANY_SOLIDS, Instances, PrimvarInput, Shape
from fgf_warp.settings import Aov, RenderSettings

MESH = """def Mesh "M"
{
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    %s
}"""
BALL = 'def Sphere "M"\n{\n    %s\n}'
COLORS = [(1, 0, 0), (0, 0.5, 0), (0, 0, 1)]
READER = """def Material "Look"
{
    token outputs:surface.connect = </Look/Shader.outputs:surface>
    def Shader "Shader"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Look/Reader.outputs:result>
        float inputs:ior = 1
        token outputs:surface
    }
    def Shader "Reader"
    {
        uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "tint"
        float3 inputs:fallback = (0.5, 0.5, 0.5)
        float3 outputs:result
    }
}
"""
BOUND = 'rel material:binding = </Look>\nuniform token[] apiSchemas = ["MaterialBindingAPI"]'


def instancer(lines: str, prototype: str = MESH % "", name: str = "P", count: int = 3, below: str = "") -> str:
    """`count` instances of </name/M>, two units apart."""
    positions = ", ".join(f"({3 * k}, 0, 0)" for k in range(count))
    return (
        f'def PointInstancer "{name}"\n{{\npoint3f[] positions = [{positions}]\nint[] protoIndices = {[0] * count}\n'
        f"rel prototypes = <{below}/{name}/M>\n{lines}\n{prototype}\n}}\n"
    )


def primvar(values: list, interpolation: str, name: str = "displayColor", indices: str = "") -> str:
    shown = ", ".join(map(str, values))
    line = f'color3f[] primvars:{name} = [{shown}] (interpolation = "{interpolation}")'
    return f"{line}\nint[] primvars:{name}:indices = {indices}" if indices else line


def colors(shapes: tuple[Shape, ...], name: str = "displayColor") -> dict[int, tuple[float, ...]]:
    """Of each instance, by its number."""
    found = {}
    for shape in shapes:
        assert shape.surface is not None
        diffuse = shape.surface.diffuse
        count = shape.count if isinstance(shape, Instances) else 1
        numbers = shape.numbers if isinstance(shape, Instances) else [shape.instance]
        if isinstance(diffuse, PrimvarInput):
            assert diffuse.primvar == name
            of_prototype = shape.prototype.primvars if isinstance(shape, Instances) else {}
            values = {**of_prototype, **shape.primvars}.get(name)
            values = np.broadcast_to(diffuse.fallback if values is None else np.reshape(values, (-1, 3)), (count, 3))
        else:
            values = np.broadcast_to(diffuse, (count, 3))
        found |= dict(zip(map(int, numbers), map(tuple, values.round(6).tolist()), strict=True))
    return found


@pytest.mark.parametrize("interpolation", ["varying", "vertex", "faceVarying"])
@pytest.mark.parametrize("prototype", [MESH, BALL])
@pytest.mark.parametrize("count", [1, 3, MANY_SOLIDS + 1])
def test_each_instance_has_its_own_value(read, interpolation: str, prototype: str, count: int) -> None:
    values = [COLORS[k % 3] for k in range(count)]
    shapes = read(instancer(primvar(values, interpolation), prototype % "", count=count)).scene.shapes
    assert colors(shapes) == dict(enumerate(values))
    if count > MANY_SOLIDS:
        assert len(shapes) == 1


@pytest.mark.parametrize("interpolation", ["constant", "uniform"])
def test_one_value_holds_for_all(read, interpolation: str) -> None:
    (shape,) = read(instancer(primvar(COLORS[:1], interpolation))).scene.shapes
    assert shape.surface.diffuse == (1, 0, 0)


def test_indexed_values_and_masked_instances(read) -> None:
    lines = (
        primvar(COLORS[:2], "varying", indices="[1, 0, 1]") + "\nint64[] ids = [7, 8, 9]\nint64[] invisibleIds = [8]"
    )
    assert colors(read(instancer(lines)).scene.shapes) == {0: COLORS[1], 2: COLORS[1]}


def test_values_that_do_not_fit_are_named(read) -> None:
    reading = read(instancer(primvar(COLORS[:2], "varying")))
    assert "varying primvar of 2 values where 3 are expected is left out: /P.primvars:displayColor" in reading.warnings
    assert set(colors(reading.scene.shapes).values()) == {(0.18, 0.18, 0.18)}


def test_what_the_prototype_says_stands_before_it(read) -> None:
    own = primvar([(0.25, 0.25, 0.25)], "constant")
    shapes = read(instancer(primvar(COLORS, "varying"), MESH % own)).scene.shapes
    assert set(colors(shapes).values()) == {(0.25, 0.25, 0.25)}
    inherited = f'def Xform "M"\n{{\n{own}\n{MESH % ""}\n}}'
    shapes = read(instancer(primvar(COLORS, "varying"), inherited)).scene.shapes
    assert set(colors(shapes).values()) == {(0.25, 0.25, 0.25)}


def test_prototypes_elsewhere_have_the_instancers_values_too(read) -> None:
    aside = f'over "Aside"\n{{\n{MESH % ""}\n}}\n'
    for values, interpolation in ((COLORS, "varying"), (COLORS[1:2], "constant")):
        prims = aside + instancer(primvar(values, interpolation), "").replace("</P/M>", "</Aside/M>")
        expected = values if interpolation == "varying" else values * 3
        assert colors(read(prims).scene.shapes) == dict(enumerate(expected))


def test_nested_instancers(read) -> None:
    """Each inner instance has the inner instancer's value for it, and else that of the outer instance that it is in."""
    inner = instancer("%s", name="M", below="/P", count=2)
    for lines, expected in (
        ("", [0, 0, 1, 1, 2, 2]),
        (primvar(COLORS[1:], "varying"), [1, 2, 1, 2, 1, 2]),
        (primvar(COLORS[2:], "constant"), [2] * 6),
    ):
        nested = inner.replace("%s", lines)
        (shape,) = read(instancer(primvar(COLORS, "varying"), nested)).scene.shapes
        assert list(shape.numbers) == [0, 0, 1, 1, 2, 2]
        of_each = shape.primvars.get("displayColor")
        values = np.broadcast_to(shape.surface.diffuse, (6, 3)) if of_each is None else of_each
        assert np.array_equal(values, np.float32([COLORS[k] for k in expected]))


def test_what_a_material_reads_varies_too(read) -> None:
    for prototype in (MESH, BALL):
        bound = (prototype % BOUND).replace('"M"', '"M" (prepend apiSchemas = ["MaterialBindingAPI"])', 1)
        bound = bound.replace('uniform token[] apiSchemas = ["MaterialBindingAPI"]', "")
        shapes = read(READER + instancer(primvar(COLORS, "vertex", "tint"), bound)).scene.shapes
        assert colors(shapes, "tint") == dict(enumerate(COLORS))


def test_the_picture_has_the_colors(read) -> None:
    """Meshes and spheres, few and in a tree: the albedo of each is what its instancer says."""
    many = [COLORS[k % 3] for k in range(MANY_SOLIDS + 1)]
    prims = instancer(primvar(COLORS, "varying")) + "".join(
        f'def Xform "X{k}"\n{{\n double3 xformOp:translate = (0, {3 + 3 * k}, 0)\n'
        f'uniform token[] xformOpOrder = ["xformOp:translate"]\n'
        + instancer(primvar(values, "varying"), prototype % "", count=len(values), below=f"/X{k}")
        + "}\n"
        for k, (values, prototype) in enumerate([(COLORS[::-1], BALL), (many, BALL)])
    )
    camera = """def Camera "Camera"
{
    token projection = "orthographic"
    float horizontalAperture = 90
    float verticalAperture = 90
    double3 xformOp:translate = (3, 3, 20)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    scene = read(prims, camera=camera).scene
    aovs = frozenset({Aov.ALBEDO, Aov.PRIM_ID, Aov.INSTANCE_ID})
    found = render(scene, RenderSettings(width=9, height=9, spp=4, aovs=aovs)).aovs
    assert [scene.prims.index(name) + 1 for name in ("/P/M", "/X0/P/M", "/X1/P/M")] == [1, 2, 3]
    for row, (prim, values) in enumerate([(3, COLORS), (2, COLORS[::-1]), (1, COLORS)]):
        for column in range(3):
            at = 3 * row + 1, 3 * column + 1
            assert (found[Aov.PRIM_ID][at], found[Aov.INSTANCE_ID][at]) == (prim, column)
            assert found[Aov.ALBEDO][at] == pytest.approx(values[column], abs=1e-6)
