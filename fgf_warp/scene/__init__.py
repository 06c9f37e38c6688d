"""What the renderer sees of a scene: plain frozen values, checked on construction.

Lengths are in the stage's units, since extinction is authored per stage unit and nothing in the transport
depends on the metre; `Scene.meters_per_unit` is carried along for the files' headers. Radiance is linear
Rec.709. Matrices are 4x4 float64 that act on column vectors: ``p_world = M @ p_local``.

Everything here is imported from `fgf_warp.scene` itself, but for the arithmetic of many places, `placements`.
"""

from fgf_warp.scene.boxes import boxes_meet
from fgf_warp.scene.camera import CONFORM_POLICIES, PROJECTIONS, Camera, ConformPolicy, Projection
from fgf_warp.scene.lights import (
    MAX_LINKS,
    AreaLight,
    CylinderLight,
    DistantLight,
    DomeLight,
    Light,
    LightSource,
    MeshLight,
    Shaping,
    SphereLight,
)
from fgf_warp.scene.medium import PHASE_FUNCTIONS, PHASE_PARAMETERS, Medium, PhaseFunction
from fgf_warp.scene.mesh import DOUBLED_FACES, INWARD_SHELL, NO_VOLUME, Mesh, count_open_edges
from fgf_warp.scene.placements import unit_axes
from fgf_warp.scene.scene import Scene
from fgf_warp.scene.shapes import (
    MANY_SOLIDS,
    MAX_CONTAINERS,
    Instances,
    Shape,
    Solid,
    bodies_of,
    count_of,
    drifts_of,
    encloses,
    moves,
    points_in,
    shape_bounds,
    shape_widths,
    solids_in_tree,
)
from fgf_warp.scene.shells import winding_number
from fgf_warp.scene.surface import ColorInput, FloatInput, PrimvarInput, Surface, lets_light_through
from fgf_warp.scene.textures import IDENTITY_ST, WRAPS, Image, Texture, TextureInput, Wrap
from fgf_warp.scene.values import BLACK, FLOAT32_MAX, WHITE, Rgb, Vec3, Vec4
from fgf_warp.theory.choices import LINE_VARIANCES, TRANSPORTS, LineVariance, Transport

__all__ = [
    "BLACK",
    "CONFORM_POLICIES",
    "DOUBLED_FACES",
    "FLOAT32_MAX",
    "IDENTITY_ST",
    "INWARD_SHELL",
    "LINE_VARIANCES",
    "MANY_SOLIDS",
    "MAX_CONTAINERS",
    "MAX_LINKS",
    "NO_VOLUME",
    "PHASE_FUNCTIONS",
    "PHASE_PARAMETERS",
    "PROJECTIONS",
    "TRANSPORTS",
    "WHITE",
    "WRAPS",
    "AreaLight",
    "Camera",
    "ColorInput",
    "ConformPolicy",
    "CylinderLight",
    "DistantLight",
    "DomeLight",
    "FloatInput",
    "Image",
    "Instances",
    "Light",
    "LightSource",
    "LineVariance",
    "Medium",
    "Mesh",
    "MeshLight",
    "PhaseFunction",
    "PrimvarInput",
    "Projection",
    "Rgb",
    "Scene",
    "Shape",
    "Shaping",
    "Solid",
    "SphereLight",
    "Surface",
    "Texture",
    "TextureInput",
    "Transport",
    "Vec3",
    "Vec4",
    "Wrap",
    "bodies_of",
    "boxes_meet",
    "count_of",
    "count_open_edges",
    "drifts_of",
    "encloses",
    "lets_light_through",
    "moves",
    "points_in",
    "shape_bounds",
    "shape_widths",
    "solids_in_tree",
    "unit_axes",
    "winding_number",
]
