"""UsdLux: lights whose radiance is intensity x 2^exposure x color, in the formulas of the UsdLux documentation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Literal

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from fgf_warp.errors import SceneError, UnsupportedFeatureError
from fgf_warp.scene import (
    AreaLight,
    Camera,
    CylinderLight,
    DistantLight,
    DomeLight,
    Image,
    Light,
    MeshLight,
    Rgb,
    Shaping,
    SphereLight,
    Vec3,
    unit_axes,
)
from usd_scenes.reader.attributes import is_authored, read_color, read_number, read_token
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.mesh import read_corners
from usd_scenes.reader.textures import read_image

DEFAULT_DOME = DomeLight(name="default dome", radiance=(0.25, 0.25, 0.25))
DEFAULT_KEY_FROM = (-0.5, 0.7, 1.0)
"""From where the default key light shines: over the viewer's left shoulder, in the camera's axes."""
DEFAULT_KEY_HALF_ANGLE = 0.1
"""Of the key light [radian]: shadows with a soft edge."""
DEFAULT_KEY_RADIANCE = 0.75
"""Of a white diffuse surface that faces the key light: with the dome's, 1."""

HARMLESS: dict[str, object] = {
    "inputs:diffuse": 1.0,
    "inputs:specular": 1.0,
    "inputs:shadow:color": Gf.Vec3f(0.0),
    "inputs:shadow:distance": -1.0,
    "inputs:shaping:ies:file": None,
    "treatAsLine": False,
    "treatAsPoint": False,
}
"""Attributes of lights that are not rendered, and the values at which that needs no warning."""
RELATIONSHIPS_NOT_READ = ("light:filters", "portals")
EXPOSURE_MAX = 127
"""2^127 is the largest power of two in float32."""
SCALE_TOLERANCE = 1e-4
"""Relative difference of the axes' scales, and cosine between axes, up to which they count as equal and square."""
LATITUDE_FORMATS = ("automatic", "latlong")
POLE_AXES = ("scene", "Y", "Z")
IMAGE_AXES = ((0.0, -0.5, 0.5), (0.5, 0.0, 0.5))
"""Of a rect whose half_u is y and half_v is x: s runs against x, since the image is seen from -z, and t along y."""
MIRRORED_IMAGE_AXES = ((-0.5, 0.0, 0.5), (0.0, 0.5, 0.5))
"""The same where half_u is x and half_v is y."""
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Turns a dome whose pole is y until it is z: 90 degrees around x."""


def read_distant_light(prim: Usd.Prim, context: StageContext) -> DistantLight:
    """A DistantLight, which shines along its local -z.

    Raises:
        SceneError: for a value out of its range.
        UnsupportedFeatureError: for an angle above 180 degrees.
    """
    angle = _non_negative(prim, "inputs:angle", context.time)
    if angle > 180:
        raise UnsupportedFeatureError(f"{prim.GetPath()}.inputs:angle = {angle:g}; accepted: [0, 180] degrees")
    return DistantLight(
        name=str(prim.GetPath()),
        direction=_axis(prim, context),
        half_angle=math.radians(angle) / 2,
        radiance=_emission(prim, context.time),
    )


def read_dome_light(prim: Usd.Prim, context: StageContext) -> DomeLight:
    """A DomeLight or a DomeLight_1; `normalize` does not apply to it.

    The pole of its image is the local y axis of a DomeLight, and that which its poleAxis says of a DomeLight_1.

    Raises:
        SceneError: for a value out of its range.
    """
    radiance = _emission(prim, context.time)
    layout = prim.GetAttribute("inputs:texture:format").Get(context.time)
    if layout not in LATITUDE_FORMATS:
        text = f"an image of format {layout} is not supported, accepted: {', '.join(LATITUDE_FORMATS)}; it is left out"
        context.notes.add(text, prim.GetPath())
        return DomeLight(name=str(prim.GetPath()), radiance=radiance)
    image = _image(prim, context)
    if image is None:
        return DomeLight(name=str(prim.GetPath()), radiance=radiance)
    x, y, z = _turn(prim, context)
    return DomeLight(
        name=str(prim.GetPath()), radiance=radiance, image=image, light_to_world=(_vec3(x), _vec3(y), _vec3(z))
    )


def _turn(dome: Usd.Prim, context: StageContext) -> np.ndarray:
    """(3, 3), the rotation, or reflection, nearest to the transform of a dome, from where its pole is y."""
    to_world = context.local_to_world(dome)[:3, :3]
    left, scales, right = np.linalg.svd(to_world)
    if scales.min() == 0:
        raise SceneError(f"{dome.GetPath()}: the transform leaves no volume; accepted: a scale that is not 0")
    lengths = np.linalg.norm(to_world, axis=0)
    if np.abs(to_world.T @ to_world / np.outer(lengths, lengths) - np.eye(3)).max() > SCALE_TOLERANCE:
        context.notes.add("a dome does not shear: it is turned by the nearest rotation", dome.GetPath())
    pole = read_token(dome.GetAttribute("poleAxis"), context.time, POLE_AXES) or "Y"
    is_upright = (context.up_axis if pole == "scene" else pole) == "Z"
    turn: np.ndarray = left @ right
    return turn @ UPRIGHT if is_upright else turn


def read_rect_light(prim: Usd.Prim, context: StageContext) -> AreaLight:
    """A RectLight, which emits along its local -z.

    Seen from there, its image is upright and not mirrored.

    Raises:
        SceneError: for a value out of its range.
    """
    half_width = _positive(prim, "inputs:width", context.time) / 2
    half_height = _positive(prim, "inputs:height", context.time) / 2
    light = _area_light("rect", prim, half_width, half_height, context)
    image = _image(prim, context)
    if image is None:
        return light
    is_mirrored = np.linalg.det(context.local_to_world(prim)[:3, :3]) < 0
    return replace(light, image=image, image_axes=MIRRORED_IMAGE_AXES if is_mirrored else IMAGE_AXES)


def read_disk_light(prim: Usd.Prim, context: StageContext) -> AreaLight:
    """A DiskLight, which emits along its local -z.

    Raises:
        SceneError: for a value out of its range.
    """
    radius = _positive(prim, "inputs:radius", context.time)
    return _area_light("disk", prim, radius, radius, context)


def read_sphere_light(prim: Usd.Prim, context: StageContext) -> SphereLight:
    """A SphereLight; under a scale that is not uniform, a sphere of the same volume, with a warning.

    Raises:
        SceneError: for a value out of its range.
    """
    to_world = context.local_to_world(prim)
    scales = np.linalg.svd(to_world[:3, :3], compute_uv=False)
    if scales.max() - scales.min() > SCALE_TOLERANCE * scales.max():
        context.notes.add("scale is not uniform: a sphere of the same volume is rendered", prim.GetPath())
    radius = _positive(prim, "inputs:radius", context.time) * float(np.prod(scales)) ** (1 / 3)
    return SphereLight(
        name=str(prim.GetPath()),
        center=_vec3(to_world[:3, 3]),
        radius=radius,
        radiance=_emission(prim, context.time),
        shaping=_read_shaping(prim, context, whole_angle=180.0),
    )


def read_cylinder_light(prim: Usd.Prim, context: StageContext) -> CylinderLight:
    """A CylinderLight along its local x axis; across a scale that is not uniform, a round one, with a warning.

    The round one has the same volume.

    Raises:
        SceneError: for a value out of its range.
    """
    to_world = context.local_to_world(prim)
    half_axis = to_world[:3, 0] * _positive(prim, "inputs:length", context.time) / 2
    along = to_world[:3, 0] / max(float(np.linalg.norm(to_world[:3, 0])), np.finfo(float).tiny)
    across = to_world[:3, 1:3] - np.outer(along, along @ to_world[:3, 1:3])
    scales = np.linalg.svd(across, compute_uv=False)
    slant = np.abs(along @ to_world[:3, 1:3]).max()
    if max(scales[0] - scales[1], slant) > SCALE_TOLERANCE * scales[0]:
        context.notes.add("scale is not uniform: a round tube of the same volume is rendered", prim.GetPath())
    return CylinderLight(
        name=str(prim.GetPath()),
        center=_vec3(to_world[:3, 3]),
        half_axis=_vec3(half_axis),
        radius=_positive(prim, "inputs:radius", context.time) * math.sqrt(float(np.prod(scales))),
        radiance=_emission(prim, context.time),
        shaping=_read_shaping(prim, context, whole_angle=180.0),
    )


def read_mesh_light(prim: Usd.Prim, context: StageContext) -> MeshLight | None:
    """A Mesh with MeshLightAPI, or the one that a GeometryLight names; None, with a warning, where there is no face.

    Raises:
        SceneError: for a value out of its range, or a mesh that does not fit together.
    """
    geometry = prim if prim.IsA(UsdGeom.Mesh) else _emitting_geometry(prim)
    if geometry is None:
        context.notes.add("a GeometryLight gives light where its geometry is one Mesh, and is left out", prim.GetPath())
        return None
    corners = read_corners(geometry, context)
    if not len(corners):
        context.notes.add("mesh without faces gives no light", geometry.GetPath())
        return None
    _note_material(geometry, prim, context)
    return MeshLight(
        name=str(prim.GetPath()),
        corners=corners,
        radiance=_emission(prim, context.time),
        shaping=_read_shaping(prim, context, whole_angle=180.0),
    )


LIGHT_READERS: dict[str, Callable[[Usd.Prim, StageContext], Light | None]] = {
    "DistantLight": read_distant_light,
    "DomeLight": read_dome_light,
    "DomeLight_1": read_dome_light,
    "RectLight": read_rect_light,
    "DiskLight": read_disk_light,
    "SphereLight": read_sphere_light,
    "CylinderLight": read_cylinder_light,
    "GeometryLight": read_mesh_light,
    "Mesh": read_mesh_light,
}
LIGHTS_WITHOUT_A_PLACE = ("DistantLight", "DomeLight", "DomeLight_1")


def read_light(prim: Usd.Prim, context: StageContext) -> Light | None:
    """Any light; None, with a warning, for a kind that is not supported.

    Raises:
        SceneError: for a value out of its range.
        UnsupportedFeatureError: for a DistantLight wider than a hemisphere.
    """
    reader = LIGHT_READERS.get(prim.GetTypeName())
    if reader is None:
        context.notes.add(f"light of type {prim.GetTypeName()} is not supported and gives no light", prim.GetPath())
        return None
    for name in _ignored(prim, context.time):
        context.notes.add(f"{name} of lights is not supported and is ignored", prim.GetPath())
    _note_unapplied(prim, context)
    if context.closing_to_world(prim) is not None:
        context.notes.add("a light that moves is rendered where it is when the shutter opens", prim.GetPath())
    light = reader(prim, context)
    if light and prim.GetAttribute("inputs:normalize").Get(context.time):
        return replace(light, radiance=_scaled(light.radiance, 1 / _size(light)))
    return light


def default_lights(camera: Camera) -> tuple[Light, ...]:
    """What lights a stage that has no light of its own: a key light that goes with the camera, and a dim dome."""
    axes = unit_axes(camera.camera_to_world)
    towards = axes @ DEFAULT_KEY_FROM
    radiance = DEFAULT_KEY_RADIANCE / math.sin(DEFAULT_KEY_HALF_ANGLE) ** 2
    key = DistantLight(
        name="default key",
        direction=_vec3(-towards / np.linalg.norm(towards)),
        half_angle=DEFAULT_KEY_HALF_ANGLE,
        radiance=(radiance, radiance, radiance),
    )
    return (key, DEFAULT_DOME)


def is_light(prim: Usd.Prim) -> bool:
    """True for every kind of light, supported or not."""
    return prim.HasAPI(UsdLux.LightAPI)


def emitting_meshes(prims: Iterable[Usd.Prim]) -> frozenset[Sdf.Path]:
    """The meshes that GeometryLights among these prims name: they emit, and are no shapes besides."""
    found = (_emitting_geometry(prim) for prim in prims if prim.GetTypeName() == "GeometryLight")
    return frozenset(mesh.GetPath() for mesh in found if mesh)


def _emitting_geometry(light: Usd.Prim) -> Usd.Prim | None:
    targets = light.GetRelationship("geometry").GetForwardedTargets()
    mesh = light.GetStage().GetPrimAtPath(targets[0]) if len(targets) == 1 else None
    return mesh if mesh and mesh.IsA(UsdGeom.Mesh) else None


def _area_light(
    shape: Literal["rect", "disk"], prim: Usd.Prim, half_x: float, half_y: float, context: StageContext
) -> AreaLight:
    to_world = context.local_to_world(prim)
    x, y = to_world[:3, 0] * half_x, to_world[:3, 1] * half_y
    # Locally y cross x is -z, the side that emits; a mirroring transform turns cross products over.
    half_u, half_v = (y, x) if np.linalg.det(to_world[:3, :3]) >= 0 else (x, y)
    return AreaLight(
        name=str(prim.GetPath()),
        shape=shape,
        center=_vec3(to_world[:3, 3]),
        half_u=_vec3(half_u),
        half_v=_vec3(half_v),
        radiance=_emission(prim, context.time),
        shaping=_read_shaping(prim, context, whole_angle=90.0),
    )


def _image(prim: Usd.Prim, context: StageContext) -> Image | None:
    """The image that a light's radiance is multiplied by; None where it names none, or none that can be read."""
    attribute = prim.GetAttribute("inputs:texture:file")
    asset = attribute.Get(context.time)
    if not asset or not asset.path:
        return None
    file = read_image(attribute, context)
    return file.image if file else None


def _size(light: Light) -> float:
    """What normalizing divides radiance by: the area, or of a distant light the irradiance of a radiance of 1."""
    if isinstance(light, DistantLight):
        return math.pi * math.sin(light.half_angle) ** 2 or 1.0
    if isinstance(light, DomeLight):
        return 1.0
    if isinstance(light, SphereLight):
        return 4 * math.pi * light.radius**2
    if isinstance(light, CylinderLight):
        return 4 * math.pi * light.radius * math.hypot(*light.half_axis)
    return light.area


def _read_shaping(prim: Usd.Prim, context: StageContext, whole_angle: float) -> Shaping | None:
    """What ShapingAPI says; None where the light emits evenly.

    Args:
        prim: the light.
        context: the stage.
        whole_angle: that a light of this kind emits up to from its axis anyway [degree].
    """
    if not prim.HasAPI(UsdLux.ShapingAPI):
        return None
    api, time = UsdLux.ShapingAPI(prim), context.time
    angle = read_number(api.GetShapingConeAngleAttr(), time, accepted="[0, 180] degrees", holds=lambda x: 0 <= x <= 180)
    softness = read_number(api.GetShapingConeSoftnessAttr(), time, accepted="[0, 1]", holds=lambda x: 0 <= x <= 1)
    focus = read_number(api.GetShapingFocusAttr(), time, accepted=">= 0", holds=lambda x: x >= 0)
    tint = read_color(api.GetShapingFocusTintAttr(), time)
    if focus == 0 and softness == 0 and angle >= whole_angle:
        return None
    return Shaping(
        axis=_axis(prim, context),
        cone_angle=math.radians(angle),
        cone_softness=softness,
        focus=focus,
        focus_tint=tint,
    )


def _axis(prim: Usd.Prim, context: StageContext) -> Vec3:
    """The direction of a light's local -z, of unit length."""
    axis = -context.local_to_world(prim)[:3, 2]
    if not axis.any():
        raise SceneError(
            f"{prim.GetPath()}: the transform leaves the light no direction; accepted: a scale that is not 0"
        )
    return _vec3(axis / np.linalg.norm(axis))


def _note_unapplied(prim: Usd.Prim, context: StageContext) -> None:
    registry = Usd.SchemaRegistry()
    for api in (UsdLux.ShadowAPI, UsdLux.ShapingAPI):
        if prim.HasAPI(api):
            continue
        schema = registry.FindAppliedAPIPrimDefinition(api.__name__)
        for name in schema.GetPropertyNames():
            attribute = prim.GetAttribute(name)
            if is_authored(attribute) and attribute.Get(context.time) != schema.GetAttributeFallbackValue(name):
                text = f"is of no effect on a light to which {api.__name__} is not applied"
                context.notes.add(text, attribute.GetPath())


def _note_material(geometry: Usd.Prim, light: Usd.Prim, context: StageContext) -> None:
    mode = light.GetAttribute("light:materialSyncMode").Get(context.time)
    material, _ = UsdShade.MaterialBindingAPI(geometry).ComputeBoundMaterial(UsdShade.Tokens.full)
    if material and mode != UsdLux.Tokens.noMaterialResponse:
        context.notes.add(f"a mesh that emits makes no use of its material, whatever {mode} says", light.GetPath())


def _emission(prim: Usd.Prim, time: Usd.TimeCode) -> Rgb:
    """Radiance per channel before `normalize`."""
    intensity = _non_negative(prim, "inputs:intensity", time)
    exposure = read_number(
        prim.GetAttribute("inputs:exposure"), time, accepted=f"[-{EXPOSURE_MAX}, {EXPOSURE_MAX}]", holds=_is_exposure
    )
    color = read_color(prim.GetAttribute("inputs:color"), time)
    if prim.GetAttribute("inputs:enableColorTemperature").Get(time):
        kelvin = read_number(
            prim.GetAttribute("inputs:colorTemperature"), time, accepted="[1000, 10000] K", holds=_is_blackbody
        )
        white = UsdLux.BlackbodyTemperatureAsRgb(kelvin)
        color = (color[0] * white[0], color[1] * white[1], color[2] * white[2])
    return _scaled(color, intensity * 2.0**exposure)


def _ignored(prim: Usd.Prim, time: Usd.TimeCode) -> Iterator[str]:
    for name, harmless in HARMLESS.items():
        attribute = prim.GetAttribute(name)
        if is_authored(attribute) and attribute.Get(time) != harmless:
            yield name
    if prim.GetTypeName() in LIGHTS_WITHOUT_A_PLACE and prim.HasAPI(UsdLux.ShapingAPI):
        yield f"ShapingAPI of a {prim.GetTypeName()}"
    for name in RELATIONSHIPS_NOT_READ:
        if prim.GetRelationship(name).HasAuthoredTargets():
            yield name
    for light_input in UsdShade.ConnectableAPI(prim).GetInputs():
        if light_input.HasConnectedSource():
            yield f"connection of {light_input.GetFullName()}"


def _is_blackbody(kelvin: float) -> bool:
    return 1000 <= kelvin <= 10000


def _is_exposure(exposure: float) -> bool:
    return abs(exposure) <= EXPOSURE_MAX


def _non_negative(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> float:
    return read_number(prim.GetAttribute(name), time, accepted=">= 0", holds=lambda x: x >= 0)


def _positive(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> float:
    return read_number(prim.GetAttribute(name), time, accepted="> 0", holds=lambda x: x > 0)


def _scaled(color: Rgb, factor: float) -> Rgb:
    return (color[0] * factor, color[1] * factor, color[2] * factor)


def _vec3(values: np.ndarray) -> Vec3:
    return (float(values[0]), float(values[1]), float(values[2]))
