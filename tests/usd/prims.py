"""Parts of stages as text, and what is told of them."""

from usd_scenes.reader.notes import VALUES

HEADER = '#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "Y"\n)\n'
CAMERA = """def Camera "Camera"
{
    double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
TWO_CAMERAS = (
    'def Camera "A"\n{\n}\ndef Xform "X"\n{\n def Camera "B"\n {\n }\n}\ndef Xform "Y"\n{\n def Camera "B"\n {\n }\n}\n'
)
DOME = 'def DomeLight "Dome"\n{\n}\n'


def medium_sphere(attributes: str, schemas: str = 'prepend apiSchemas = ["FgfMediumAPI"]', inside: str = "") -> str:
    """A sphere whose material /Look has these attributes."""
    return f"""
def Sphere "Ball" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{{
    rel material:binding = </Look>
}}
def Material "Look" (
    {schemas}
)
{{
    {attributes}
    {inside}
}}
"""


def preview_sphere(inputs: str, inside: str = "") -> str:
    """A sphere whose material /Look is a UsdPreviewSurface with these inputs, beside what else is `inside` of it."""
    return medium_sphere(
        "token outputs:surface.connect = </Look/Surface.outputs:surface>",
        schemas="",
        inside=f"""def Shader "Surface"
    {{
        uniform token info:id = "UsdPreviewSurface"
        {inputs}
        token outputs:surface
    }}
    {inside}""",
    )


def as_told(text: str) -> str:
    """The warning of "text: paths", which goes on from the paths where it is of their values."""
    found, _, paths = text.rpartition(": ")
    return f"{paths} {found}" if found.startswith(VALUES) else text
