"""Stages with mistakes in them, and a process of its own that renders them: a crash is then a finding, not the end."""

from __future__ import annotations

import json
import random
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Timer

import OpenImageIO as oiio  # noqa: N813 - the name that its own documentation uses

from usd_scenes.examples import stage_names, stage_path

TIME_LIMIT = 60
"""Seconds that one stage may take."""
ROOT = Path(__file__).resolve().parents[2]

RICH = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
    startTimeCode = 1
    endTimeCode = 4
    renderSettingsPrimPath = "/Render/Settings"
)

def Xform "World"
{
    def Camera "Camera"
    {
        float focalLength = 30
        float fStop = 2.8
        float focusDistance = 9
        float2 clippingRange = (0.1, 1000)
        float exposure = 0.5
        double shutter:open = 0
        double shutter:close = 0.5
        double3 xformOp:translate.timeSamples = {
            1: (0, 0, 9),
            4: (1, 0, 9),
        }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DomeLight "Sky"
    {
        float inputs:intensity = 0.5
        asset inputs:texture:file = @sky.png@
    }
    def DomeLight "Air"
    {
        color3f inputs:color = (0.1, 0.1, 0.2)
    }
    def RectLight "Lamp" (
        prepend apiSchemas = ["ShapingAPI", "CollectionAPI:lightLink"]
    )
    {
        float inputs:width = 2
        float inputs:shaping:cone:angle = 60
        float inputs:shaping:focus = 2
        bool inputs:normalize = 1
        uniform token collection:lightLink:expansionRule = "expandPrims"
        rel collection:lightLink:excludes = </World/Quad>
        double3 xformOp:translate = (0, 5, 0)
        float3 xformOp:rotateXYZ = (-90, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }
    def CylinderLight "Tube"
    {
        float inputs:length = 3
        float inputs:radius = 0.1
        double3 xformOp:translate = (0, -5, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def SphereLight "Bulb"
    {
        float inputs:radius = 0.1
        double3 xformOp:translate = (-3, 3, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DiskLight "Disk"
    {
        float inputs:radius = 0.3
        asset inputs:texture:file = @sky.png@
        double3 xformOp:translate = (3, 3, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def RectLight "Window"
    {
        asset inputs:texture:file = @sky.png@
        double3 xformOp:translate = (0, 3, 4)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DistantLight "Sun"
    {
        float inputs:intensity = 1
        float inputs:angle = 1
    }
    def Mesh "Screen" (
        prepend apiSchemas = ["MeshLightAPI"]
    )
    {
        point3f[] points = [(-1, 4, -3), (1, 4, -3), (0, 5, -3)]
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
    }
    def Cube "Fog" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        double size = 1
        double3 xformOp:translate.timeSamples = {
            1: (-3, 0, 0),
            2: (-3, 1, 0),
        }
        uniform token[] xformOpOrder = ["xformOp:translate"]
        rel material:binding = </World/Looks/Fog>
    }
    def Cylinder "Dust" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        double radius = 0.5
        double height = 1
        double3 xformOp:translate = (0, 0, -3)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        rel material:binding = </World/Looks/Dust>
    }
    def Sphere "Haze" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        double radius = 0.4
        rel material:binding = </World/Looks/Haze>
    }
    def Mesh "Quad" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        point3f[] points = [(-4, -2, -4), (4, -2, -4), (4, -2, 4), (-4, -2, 4), (0, -2, 0)]
        int[] faceVertexCounts = [3, 3, 3, 3]
        int[] faceVertexIndices = [1, 0, 4, 2, 1, 4, 3, 2, 4, 0, 3, 4]
        normal3f[] normals = [(0, 1, 0), (0, 1, 0), (0, 1, 0), (0, 1, 0), (0, 1, 0)] (
            interpolation = "vertex"
        )
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0.5)] (
            interpolation = "vertex"
        )
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0)] (
            interpolation = "uniform"
        )
        uniform token subdivisionScheme = "catmullClark"
        uniform token subsetFamily:materialBind:familyType = "nonOverlapping"
        rel material:binding = </World/Looks/Paint>

        def GeomSubset "Half" (
            prepend apiSchemas = ["MaterialBindingAPI"]
        )
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [0, 1]
            rel material:binding = </World/Looks/Glass>
        }
    }
    def PointInstancer "Many"
    {
        point3f[] positions = [(-2, 1, 0), (2, 1, 0), (0, 2, -1), (2, 2, 0)]
        quath[] orientations = [(1, 0, 0, 0), (0.7, 0.7, 0, 0), (1, 0, 0, 0), (1, 0, 0, 0)]
        float3[] scales = [(1, 1, 1), (0.5, 1, 1), (1, 1, 2), (1, 1, 1)]
        int[] protoIndices = [0, 1, 0, 1]
        int64[] invisibleIds = [2]
        rel prototypes = [</World/Many/Ball>, </World/Many/Tent>]

        def Sphere "Ball"
        {
            double radius = 0.5
        }
        def Cone "Tent" (
            prepend apiSchemas = ["MaterialBindingAPI"]
        )
        {
            rel material:binding = </World/Looks/Glass>
        }
    }
    def Xform "Copy" (
        instanceable = true
        prepend references = </World/Drop>
    )
    {
        double3 xformOp:translate = (3, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Xform "Drop"
    {
        def Capsule "Body" (
            prepend apiSchemas = ["MaterialBindingAPI"]
        )
        {
            rel material:binding = </World/Looks/Milk>
        }
    }
    def Scope "Looks"
    {
        def Material "Fog" (
            prepend apiSchemas = ["FgfMediumAPI"]
        )
        {
            float inputs:fgf:hurst = -0.3
            float inputs:fgf:whiteNoiseScale = 1
            uniform token fgf:phaseFunction = "draine"
            float inputs:fgf:draineAlpha = 1
        }
        def Material "Dust" (
            prepend apiSchemas = ["FgfMediumAPI"]
        )
        {
            float inputs:fgf:hurst = -0.7
            float inputs:fgf:whiteNoiseScale = 0.1
            uniform token fgf:phaseFunction = "isotropic"
        }
        def Material "Haze" (
            prepend apiSchemas = ["FgfMediumAPI"]
        )
        {
            float inputs:fgf:hurst = 0.3
            float inputs:fgf:whiteNoiseScale = 0.01
            float inputs:fgf:outerScale = 100
            float inputs:fgf:asymmetry = 0.5
            uniform token fgf:lineVariance = "exact"
        }
        def Material "Paint"
        {
            token outputs:surface.connect = </World/Looks/Paint/Surface.outputs:surface>
            def Shader "Surface"
            {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </World/Looks/Paint/Picture.outputs:rgb>
                float inputs:roughness = 0.3
                float inputs:clearcoat = 0.5
                token outputs:surface
            }
            def Shader "Picture"
            {
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @paint.png@
                token inputs:wrapS = "mirror"
                float4 inputs:scale = (1, 1, 1, 1)
                float2 inputs:st.connect = </World/Looks/Paint/Place.outputs:result>
                float3 outputs:rgb
            }
            def Shader "Place"
            {
                uniform token info:id = "UsdTransform2d"
                float inputs:rotation = 30
                float2 inputs:in.connect = </World/Looks/Paint/Reader.outputs:result>
                float2 outputs:result
            }
            def Shader "Reader"
            {
                uniform token info:id = "UsdPrimvarReader_float2"
                string inputs:varname = "st"
                float2 outputs:result
            }
        }
        def Material "Glass"
        {
            token outputs:surface.connect = </World/Looks/Glass/Surface.outputs:surface>
            def Shader "Surface"
            {
                uniform token info:id = "UsdPreviewSurface"
                float inputs:opacity = 0.4
                float inputs:ior = 1.4
                float inputs:metallic = 0.2
                color3f inputs:emissiveColor = (0.1, 0, 0)
                token outputs:surface
            }
        }
        def Material "Milk" (
            prepend apiSchemas = ["FgfMediumAPI"]
        )
        {
            float inputs:fgf:meanExtinction = 2
            color3f inputs:fgf:extinctionColor = (1, 0.5, 1)
            float inputs:fgf:hurst = 0.2
            float inputs:fgf:whiteNoiseScale = 1
            float inputs:fgf:outerScale = 100
            uniform token fgf:phaseFunction = "two_lobe"
            float inputs:fgf:backAsymmetry = -0.3
            float inputs:fgf:backWeight = 0.2
            uniform token fgf:transport = "mixed"
            uniform token fgf:boundary = "surface"
            token outputs:surface.connect = </World/Looks/Milk/Surface.outputs:surface>
            def Shader "Surface"
            {
                uniform token info:id = "UsdPreviewSurface"
                float inputs:opacity = 0
                float inputs:ior = 1.33
                token outputs:surface
            }
        }
    }
}

def Scope "Render"
{
    def RenderSettings "Settings"
    {
        uniform int2 resolution = (64, 48)
        rel camera = </World/Camera>
        uniform token aspectRatioConformPolicy = "cropAperture"
    }
}
"""
"""A bit of everything that the reader knows."""

NUMBERS = [
    "nan",
    "inf",
    "-inf",
    "0",
    "-1",
    "1e38",
    "-1e38",
    "1e300",
    "1e-45",
    "2147483647",
    "-2147483648",
    "99999999999",
]
NUMBER = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e-?\d+)?(?![\w.])")
WORD = re.compile(r"[A-Za-z_][\w:]*")
TYPES = [
    "float",
    "double",
    "int",
    "bool",
    "string",
    "token",
    "asset",
    "color3f",
    "point3f[]",
    "int[]",
    "matrix4d",
    "half",
]
PRIMS = [
    "Sphere",
    "Cube",
    "Cylinder",
    "Cone",
    "Capsule",
    "Plane",
    "Mesh",
    "Xform",
    "Camera",
    "DomeLight",
    "SphereLight",
    "DiskLight",
    "DistantLight",
    "PointInstancer",
    "BasisCurves",
    "Points",
    "Material",
    "Shader",
    "RenderSettings",
    "Nonsense",
]


def _choose(found: list[re.Match[str]], rng: random.Random) -> re.Match[str] | None:
    return rng.choice(found) if found else None


def _replace(text: str, match: re.Match[str] | None, by: str) -> str:
    return text if match is None else text[: match.start()] + by + text[match.end() :]


def flip_byte(text: str, rng: random.Random) -> str:
    at = rng.randrange(len(text))
    return text[:at] + chr(rng.choice((0, 9, 34, 40, 64, 91, 123, 127, 233, rng.randrange(32, 127)))) + text[at + 1 :]


def replace_number(text: str, rng: random.Random) -> str:
    return _replace(text, _choose([*NUMBER.finditer(text, 10)], rng), rng.choice(NUMBERS))


def swap_words(text: str, rng: random.Random) -> str:
    words = [*WORD.finditer(text)]
    one, other = sorted(rng.sample(range(len(words)), 2))
    return _replace(_replace(text, words[other], words[one].group()), words[one], words[other].group())


def delete_line(text: str, rng: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    del lines[rng.randrange(1, len(lines))]
    return "".join(lines)


def repeat_line(text: str, rng: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    at = rng.randrange(1, len(lines))
    return "".join([*lines[:at], lines[at], *lines[at:]])


def empty_array(text: str, rng: random.Random) -> str:
    return _replace(text, _choose([*re.finditer(r"\[[^\[\]]*\](?= *\(|\n)", text)], rng), "[]")


def shorten_array(text: str, rng: random.Random) -> str:
    return _replace(text, _choose([*re.finditer(r", [^,\[\]]*\](?= *\(|\n)", text)], rng), "]")


def change_type(text: str, rng: random.Random) -> str:
    found = _choose([*re.finditer(r"(?<=\n)( *(?:uniform )?)\w+(?:\[\])?(?= [\w:]+(?: =|\.))", text)], rng)
    return _replace(text, found, f"{found.group(1) if found else ''}{rng.choice(TYPES)}")


def change_prim(text: str, rng: random.Random) -> str:
    return _replace(text, _choose([*re.finditer(r"(?<=def )\w+", text)], rng), rng.choice(PRIMS))


def drop_bracket(text: str, rng: random.Random) -> str:
    return _replace(text, _choose([*re.finditer(r"[\[\](){}<>\"@]", text)], rng), "")


def cut_off(text: str, rng: random.Random) -> str:
    return text[: rng.randrange(len(text))]


MUTATIONS: dict[Callable[[str, random.Random], str], int] = {
    replace_number: 10,
    shorten_array: 4,
    empty_array: 3,
    change_prim: 3,
    swap_words: 3,
    delete_line: 3,
    change_type: 2,
    repeat_line: 1,
    flip_byte: 1,
    drop_bracket: 1,
    cut_off: 1,
}
"""How often each is taken; those after which nothing can be parsed are rare."""


def write_pictures(folder: Path) -> None:
    """Those that the textures of `RICH` are made of."""
    for name in ("sky", "paint"):
        picture = oiio.ImageBuf(oiio.ImageSpec(8, 4, 3, "uint8"))
        oiio.ImageBufAlgo.fill(picture, (0.5, 0.2, 0.7))
        picture.write(str(folder / f"{name}.png"))


def mutant(seed: int) -> str:
    """A stage with one to three mistakes."""
    rng = random.Random(seed)
    text = rng.choice([RICH, RICH, *(stage_path(name).read_text() for name in stage_names())])
    for _ in range(rng.choice((1, 1, 2, 3))):
        (mutation,) = rng.choices([*MUTATIONS], [*MUTATIONS.values()])
        text = mutation(text, rng)
    return text


@dataclass(frozen=True)
class Outcome:
    """What became of a stage: ``rendered``, ``refused``, ``read``, or what must not be.

    Args:
        kind: one word.
        text: the message, the traceback, or how the process ended.
    """

    kind: str
    text: str = ""


class Renderer:
    """A process that renders stages one after the other with one kernel, started anew where it ended.

    Args:
        folder: for what it needs.
    """

    def __init__(self, folder: Path) -> None:
        write_pictures(folder)
        self._companion = folder / "rich.usda"
        self._companion.write_text(RICH)
        self._process: subprocess.Popen[str] | None = None

    def render(self, path: Path) -> Outcome:
        """Renders 8 by 8 pixels into a file beside the stage."""
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.usd.fuzz_process", str(self._companion)],
                cwd=ROOT,
                text=True,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            )
            self._process.stdout.readline()  # The kernel is ready.
        process = self._process
        timer = Timer(TIME_LIMIT, process.kill)
        timer.start()
        process.stdin.write(f"{path}\n")
        process.stdin.flush()
        answer = process.stdout.readline()
        hung = not timer.is_alive()
        timer.cancel()
        if answer:
            return Outcome(**json.loads(answer))
        self.close()
        return Outcome("hung" if hung else "crashed", f"exit code {process.returncode}")

    def close(self) -> None:
        """Ends the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
