"""The stages that mistakes are made in: one with a bit of everything, some of few prims, and the project's own."""

from __future__ import annotations

from pathlib import Path

import OpenImageIO as oiio  # noqa: N813 - the name that its own documentation uses

from usd_scenes.examples import stage_names, stage_path

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

MESHES = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Z"
    startTimeCode = 1
    endTimeCode = 3
)

def Xform "World"
{
    def Mesh "Creased"
    {
        point3f[] points.timeSamples = {
            1: [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)],
            3: [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (-1, -1, 2), (1, -1, 2), (1, 1, 2), (-1, 1, 2)],
        }
        vector3f[] velocities = [(1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0), (0, 1, 0), (0, 1, 0), (0, 1, 0), (0, 1, 0)]
        int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
        int[] faceVertexIndices = [0, 3, 2, 1, 4, 5, 6, 7, 0, 1, 5, 4, 2, 3, 7, 6, 1, 2, 6, 5, 0, 4, 7, 3]
        int[] creaseIndices = [0, 1, 2, 3]
        int[] creaseLengths = [4]
        float[] creaseSharpnesses = [3]
        int[] cornerIndices = [5]
        float[] cornerSharpnesses = [10]
        int[] holeIndices = [2]
        uniform token orientation = "leftHanded"
        uniform token subdivisionScheme = "catmullClark"
        token interpolateBoundary = "edgeAndCorner"
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] (
            interpolation = "faceVarying"
        )
        int[] primvars:displayColor:indices = [0, 1, 0, 1, 0, 0, 0, 0, 1, 1, 1, 1, 0, 1, 0, 1, 0, 0, 0, 0, 1, 1, 1, 1]
        float[] primvars:displayOpacity = [0.5, 1, 1, 1, 0.5, 1, 1, 1] (
            interpolation = "vertex"
        )
    }
    def Mesh "Concave"
    {
        point3f[] points = [(0, 0, 0), (4, 0, 0), (4, 4, 0), (2, 1, 0), (0, 4, 0), (9, 9, 9)]
        int[] faceVertexCounts = [5]
        int[] faceVertexIndices = [0, 1, 2, 3, 4]
        normal3f[] primvars:normals = [(0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1)] (
            interpolation = "faceVarying"
        )
        uniform token subdivisionScheme = "none"
        bool doubleSided = 1
        float3 xformOp:scale = (0.5, 0.5, -0.5)
        matrix4d xformOp:transform = ( (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (3, 0, 0, 1) )
        uniform token[] xformOpOrder = ["xformOp:transform", "xformOp:scale"]

        def GeomSubset "Some"
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [0]
        }
    }
    def Mesh "Loop"
    {
        point3f[] points = [(0, 0, 3), (1, 0, 3), (0, 1, 3), (0, 0, 4)]
        int[] faceVertexCounts = [3, 3, 3, 3]
        int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
        uniform token subdivisionScheme = "loop"
        uniform token visibility = "inherited"
        uniform token purpose = "render"
    }
}
"""
INSTANCES = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 0.01
    upAxis = "Y"
)

def Xform "World"
{
    def PointInstancer "Outer"
    {
        point3f[] positions = [(0, 0, 0), (5, 0, 0), (0, 5, 0)]
        vector3f[] velocities = [(1, 0, 0), (1, 0, 0), (1, 0, 0)]
        quatf[] orientationsf = [(1, 0, 0, 0), (0.7, 0, 0.7, 0), (1, 0, 0, 0)]
        vector3f[] angularVelocities = [(0, 90, 0), (0, 0, 0), (0, 0, 0)]
        int[] protoIndices = [0, 0, 1]
        int64[] ids = [7, 8, 9]
        rel prototypes = [</World/Outer/Inner>, </World/Outer/Ball>]
        color3f[] primvars:displayColor = [(1, 0, 0), (0, 0, 1), (0, 1, 0)] (
            interpolation = "vertex"
        )

        def PointInstancer "Inner"
        {
            point3f[] positions = [(0, 0, 0), (0, 0, 2)]
            int[] protoIndices = [0, 0]
            rel prototypes = </World/Outer/Inner/Box>

            def Cube "Box"
            {
            }
        }
        def Sphere "Ball"
        {
        }
    }
    def Xform "First" (
        instanceable = true
        references = </Kept>
    )
    {
    }
    def Xform "Second" (
        instanceable = true
        inherits = </Kept>
        variants = {
            string look = "red"
        }
        prepend variantSets = "look"
    )
    {
        double3 xformOp:translate = (0, 3, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        variantSet "look" = {
            "red" {
                color3f[] primvars:displayColor = [(1, 0, 0)]
            }
        }
    }
}

class Xform "Kept"
{
    def Cylinder "Rod"
    {
        uniform token axis = "X"
        double height = 3
        double radius = 0.2
    }
}
"""
REQUESTS = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
    timeCodesPerSecond = 24
    renderSettingsPrimPath = "/Render/Settings"
)

def Xform "World"
{
    def Camera "Wide"
    {
        token projection = "orthographic"
        float horizontalAperture = 80
        float verticalAperture = 60
        float4[] clippingPlanes = [(0, 0, -1, 20)]
        float3 xformOp:scale = (2, 2, 2)
        double3 xformOp:translate = (0, 0, 9)
        uniform token[] xformOpOrder = ["xformOp:scale", "xformOp:translate"]
    }
    def Sphere "Ball"
    {
    }
    def SphereLight "Point"
    {
        bool treatAsPoint = 1
        bool inputs:enableColorTemperature = 1
        float inputs:colorTemperature = 3000
        double3 xformOp:translate = (0, 4, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DistantLight "Old"
    {
        float intensity = 2
        float angle = 3
    }
}

def Scope "Render"
{
    def RenderSettings "Settings"
    {
        uniform token[] includedPurposes = ["default", "proxy"]
        rel products = [</Render/Beauty>]
    }
    def RenderProduct "Beauty"
    {
        token productName = "beauty.exr"
        uniform token productType = "raster"
        rel camera = </World/Wide>
        uniform int2 resolution = (16, 8)
        uniform float pixelAspectRatio = 1
        uniform float4 dataWindowNDC = (0, 0, 1, 1)
        bool disableMotionBlur = 1
        rel orderedVars = [</Render/Color>]
    }
    def RenderVar "Color"
    {
        uniform string sourceName = "color"
        uniform token dataType = "color3f"
    }
}
"""
BASES = (RICH, RICH, MESHES, INSTANCES, REQUESTS)
"""Each as often as it is here."""


def base_stages() -> list[str]:
    """The text of each, that with a bit of everything twice."""
    return [*BASES, *(stage_path(name).read_text() for name in stage_names())]


def write_pictures(folder: Path) -> None:
    """Those that textures are made of, and what no picture is."""
    for name in ("sky", "paint"):
        picture = oiio.ImageBuf(oiio.ImageSpec(8, 4, 3, "uint8"))
        oiio.ImageBufAlgo.fill(picture, (0.5, 0.2, 0.7))
        picture.write(str(folder / f"{name}.png"))
    (folder / "text.png").write_text("no picture")
    (folder / "empty.png").write_bytes(b"")
    (folder / "cut.png").write_bytes((folder / "sky.png").read_bytes()[:60])
    (folder / "folder.png").mkdir(exist_ok=True)
    odd = oiio.ImageBuf(oiio.ImageSpec(4, 2, 3, "float"))
    for x, value in enumerate((float("nan"), float("inf"), -1.0, 1e30)):
        odd.setpixel(x, 0, (value, value, value))
    odd.write(str(folder / "odd.exr"))
    (folder / "loop.usda").write_text('#usda 1.0\n(\n    subLayers = [@loop.usda@]\n)\ndef Sphere "Loop"\n{\n}\n')
    (folder / "broken.usda").write_text("#usda 1.0\ndef {")
    (folder / "good.usda").write_text('#usda 1.0\n(\n    defaultPrim = "Good"\n)\ndef Cube "Good"\n{\n}\n')
