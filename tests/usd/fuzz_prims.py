"""Prims of any type that USD knows, with values of the right type that nobody would write, and networks of shaders."""

from __future__ import annotations

import random
from functools import cache

from pxr import Sdf, Usd

PRIMS = [
    "Sphere",
    "Cube",
    "Cylinder",
    "Cylinder_1",
    "Cone",
    "Capsule",
    "Capsule_1",
    "Plane",
    "Mesh",
    "Xform",
    "Scope",
    "Camera",
    "GeomSubset",
    "BasisCurves",
    "NurbsPatch",
    "Points",
    "PointInstancer",
    "Volume",
    "TetMesh",
    "Material",
    "Shader",
    "NodeGraph",
    "DomeLight",
    "DomeLight_1",
    "SphereLight",
    "DiskLight",
    "RectLight",
    "CylinderLight",
    "DistantLight",
    "GeometryLight",
    "PortalLight",
    "PluginLight",
    "LightFilter",
    "RenderSettings",
    "RenderProduct",
    "RenderVar",
    "RenderPass",
    "SkelRoot",
    "Skeleton",
    "BlendShape",
]
NUMBERS = (
    "0",
    "-1",
    "1",
    "0.5",
    "2",
    "1.0000001",
    "-1e-5",
    "180",
    "1e-45",
    "1e38",
    "-1e38",
    "1e300",
    "nan",
    "inf",
    "-inf",
)
INTEGERS = ("0", "1", "2", "-1", "3", "255", "2147483647", "-2147483648")
WORDS = (
    "",
    "none",
    "Y",
    "auto",
    "sRGB",
    "srgb",
    "X",
    "faceVarying",
    "vertex",
    "\\u00fc",
    "日本",
    "a" * 300,
    "../../up",
    "/World",
    "st",
)
ASSETS = (
    "sky.png", "gone.png", "text.png", "empty.png", "cut.png", "folder.png", "odd.exr", "", "good.usda",
    "x" * 300 + ".png",
    "http://a.invalid/b.png", "sky.<UDIM>.png", ".", "日本.png",
)  # fmt: skip
TARGETS = ("/World", "/Gone", "/World/Quad", "/World/Looks/Glass", "/World/Gone.attr", "/World/Many", "/World/Looks")
SHADERS = {
    "UsdPreviewSurface": (
        "diffuseColor",
        "emissiveColor",
        "roughness",
        "opacity",
        "normal",
        "ior",
        "metallic",
        "displacement",
    ),
    "UsdUVTexture": ("st", "file", "scale", "bias", "wrapS", "sourceColorSpace", "fallback"),
    "UsdTransform2d": ("in", "rotation", "scale", "translation"),
    "UsdPrimvarReader_float2": ("varname", "fallback"),
    "UsdPrimvarReader_float3": ("varname", "fallback"),
    "UsdPrimvarReader_string": ("varname",),
    "FgfMedium": ("hurst",),
    "ND_image_color3": ("file",),
    "Nonsense": ("in",),
}
UNWRITABLE = ("opaque", "group", "pathExpression")
OUTPUTS = {"UsdPreviewSurface": "surface", "UsdUVTexture": "rgb"}


@cache
def attributes_of(prim_type: str) -> tuple[tuple[str, str], ...]:
    """Name and type of each attribute that the schema has."""
    definition = Usd.SchemaRegistry().FindConcretePrimDefinition(prim_type)
    if definition is None:
        return ()
    found = ((name, definition.GetAttributeDefinition(name)) for name in definition.GetPropertyNames())
    named = ((name, str(attribute.GetTypeNameToken())) for name, attribute in found if attribute)
    return tuple((name, type_name) for name, type_name in named if not type_name.startswith(UNWRITABLE))


def literal(type_name: str, rng: random.Random) -> str:
    """A value of the type, as a stage writes it; mostly plain, at times not."""
    if type_name.endswith("[]"):
        count = rng.choice((0, 1, 2, 3, 4, 4, 8))
        return f"[{', '.join(literal(type_name[:-2], rng) for _ in range(count))}]"
    if type_name in ("string", "token"):
        return f'"{rng.choice(WORDS)}"'
    if type_name == "asset":
        return f"@{rng.choice(ASSETS)}@"
    if type_name == "bool":
        return rng.choice("01")
    is_whole = type_name.startswith(("int", "uint", "uchar"))
    kind = Sdf.ValueTypeNames.Find(type_name).cppTypeName
    some = INTEGERS if is_whole else NUMBERS
    odd = rng.random() < 0.3

    def number() -> str:
        return rng.choice(some) if odd else rng.choice(some[:5])

    size = 4 if "Quat" in kind else int(kind[-2]) if kind.startswith("Gf") and kind[-2].isdigit() else 1
    if "Matrix" in kind:
        return "( " + ", ".join("(" + ", ".join(number() for _ in range(size)) + ")" for _ in range(size)) + " )"
    return number() if size == 1 else "(" + ", ".join(number() for _ in range(size)) + ")"


def prim(name: str, rng: random.Random, indent: str) -> str:
    """A prim of some type, with some of its attributes and relationships authored."""
    prim_type = rng.choice(PRIMS)
    known = attributes_of(prim_type)
    lines = [f'{indent}def {prim_type} "{name}"', f"{indent}{{"]
    for attribute, type_name in sorted(set(rng.choices(known, k=rng.randrange(8)))) if known else ():
        time = ".timeSamples" if rng.random() < 0.15 else ""
        value = literal(type_name, rng)
        shown = f"{{ {rng.choice(NUMBERS)}: {value}, 2: {literal(type_name, rng)} }}" if time else value
        lines.append(f"{indent}    {type_name} {attribute}{time} = {shown}")
    if rng.random() < 0.3:
        interpolation = rng.choice(("constant", "uniform", "vertex", "varying", "faceVarying", "odd"))
        primvar = rng.choice(("displayColor", "displayOpacity", "st", "normals"))
        type_name = rng.choice(("color3f[]", "float[]", "texCoord2f[]", "float2", "half3[]", "string[]", "int[]"))
        value = literal(type_name, rng)
        lines += [
            f"{indent}    {type_name} primvars:{primvar} = {value} (",
            f'{indent}        interpolation = "{interpolation}"',
            f"{indent}    )",
        ]
    for relationship in (
        "material:binding",
        "prototypes",
        "camera",
        "products",
        "light:filters",
        "portals",
        "proxyPrim",
    ):
        if rng.random() < 0.08:
            lines.append(f"{indent}    rel {relationship} = {target(rng)}")
    return "\n".join([*lines, f"{indent}}}", ""])


def target(rng: random.Random) -> str:
    """Of a relationship."""
    some = [f"<{rng.choice(TARGETS)}>" for _ in range(rng.randrange(3))]
    return "None" if not some else some[0] if len(some) == 1 else f"[{', '.join(some)}]"


def network(path: str, rng: random.Random, indent: str) -> str:
    """A material below the prim at `path`, whose shaders are connected at random, in circles too."""
    name = f"Net{rng.randrange(1000)}"
    base = f"{path}/{name}"
    kinds = ["UsdPreviewSurface", *rng.choices([*SHADERS], k=rng.randrange(1, 6))]
    lines = [f'{indent}def Material "{name}"', f"{indent}{{"]
    lines.append(f"{indent}    token outputs:surface.connect = <{base}/S0.outputs:{rng.choice(('surface', 'out'))}>")
    for index, kind in enumerate(kinds):
        lines += [f'{indent}    def Shader "S{index}"', f"{indent}    {{"]
        lines.append(f'{indent}        uniform token info:id = "{kind}"')
        for port in rng.sample(SHADERS[kind], rng.randrange(1, 1 + len(SHADERS[kind]))):
            type_name = rng.choice(
                ("float", "color3f", "float2", "float3", "normal3f", "token", "string", "asset", "float4")
            )
            if rng.random() < 0.6:
                other = rng.randrange(len(kinds) + 1)
                output = rng.choice((OUTPUTS.get(kinds[other % len(kinds)], "result"), "r", "a", "gone"))
                lines.append(f"{indent}        {type_name} inputs:{port}.connect = <{base}/S{other}.outputs:{output}>")
            else:
                lines.append(f"{indent}        {type_name} inputs:{port} = {literal(type_name, rng)}")
        lines += [f"{indent}        token outputs:{OUTPUTS.get(kind, 'result')}", f"{indent}    }}"]
    return "\n".join([*lines, f"{indent}}}", ""])
