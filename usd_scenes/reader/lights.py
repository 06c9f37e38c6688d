"""UsdLux: lights whose radiance is intensity x 2^exposure x color, in the formulas of the UsdLux documentation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Literal

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdShade

from fgf_warp.errors import SceneError
from fgf_warp.scene import (
    AreaLight,
    Camera,
    CylinderLight,
    DistantLight,
    DomeLight,
    Light,
    MeshLight,
    SphereLight,
    unit_axes,
)
from usd_scenes.reader.attributes import read_mended_flag, read_mended_token
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.light_images import PLAIN, read_light_image
from usd_scenes.reader.light_values import (
    CONE,
    axis,
    emission,
    note_hints,
    note_not_read,
    number,
    read_shaping,
    scaled,
    size,
    vec3,
)
from usd_scenes.reader.mesh import read_corners

DEFAULT_DOME = DomeLight(name="default dome", radiance=(0.25, 0.25, 0.25))
DEFAULT_KEY_FROM = (-0.5, 0.7, 1.0)
"""From where the default key light shines: over the viewer's left shoulder, in the camera's axes."""
DEFAULT_KEY_HALF_ANGLE = 0.1
"""Of the key light [radian]: shadows with a soft edge."""
DEFAULT_KEY_RADIANCE = 0.75
"""Of a white diffuse surface that faces the key light: with the dome's, 1."""

SCALE_TOLERANCE = 1e-4
"""Relative difference of the axes' scales, and cosine between axes, up to which they count as equal and square."""
FORMATS = ("automatic", "latlong", "mirroredBall", "angular", "cubeMapVerticalCross")
LATITUDE_FORMATS = FORMATS[:2]
POLE_AXES = ("scene", "Y", "Z")
IMAGE_AXES = ((0.0, -0.5, 0.5), (0.5, 0.0, 0.5))
"""Of a rect whose half_u is y and half_v is x: s runs against x, since the image is seen from -z, and t along y."""
MIRRORED_IMAGE_AXES = ((-0.5, 0.0, 0.5), (0.0, 0.5, 0.5))
"""The same where half_u is x and half_v is y."""
UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Turns a dome whose pole is y until it is z: 90 degrees around x."""


def read_distant_light(prim: Usd.Prim, context: StageContext) -> DistantLight:
    """A DistantLight, which shines along its local -z.

    Returns:
        Its direction in world space, its half-angle in radian; the radiance is before `normalize`.

    Raises:
        SceneError: for a transform that leaves it no direction.
    """
    angle = number(prim, "inputs:angle", CONE, context)
    return DistantLight(
        name=str(prim.GetPath()),
        direction=axis(prim, context),
        half_angle=math.radians(angle) / 2,
        radiance=emission(prim, context),
    )


def read_dome_light(prim: Usd.Prim, context: StageContext) -> DomeLight:
    """A DomeLight or a DomeLight_1; `normalize` does not apply to it.

    The pole of its image is the local y axis of a DomeLight, and that which its poleAxis says of a DomeLight_1.

    Returns:
        Where it has an image, with its axes in world space; the radiance is what the image is multiplied with.

    Raises:
        SceneError: for an image whose dome has a transform that leaves no volume.
    """
    radiance = emission(prim, context)
    layout = read_mended_token(prim.GetAttribute("inputs:texture:format"), context, FORMATS, FORMATS[0])
    if layout not in LATITUDE_FORMATS:
        accepted = ", ".join(LATITUDE_FORMATS)
        text = f"an image of format {layout} is not supported, accepted: {accepted}; {PLAIN}"
        context.notes.add(text, prim.GetPath())
        return DomeLight(name=str(prim.GetPath()), radiance=radiance)
    image = read_light_image(prim, context)
    if image is None:
        return DomeLight(name=str(prim.GetPath()), radiance=radiance)
    x, y, z = _turn(prim, context)
    return DomeLight(
        name=str(prim.GetPath()), radiance=radiance, image=image, light_to_world=(vec3(x), vec3(y), vec3(z))
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
    axis = dome.GetAttribute("poleAxis")
    pole = read_mended_token(axis, context, POLE_AXES, "scene") if axis else "Y"
    is_upright = (context.up_axis if pole == "scene" else pole) == "Z"
    turn: np.ndarray = left @ right
    return turn @ UPRIGHT if is_upright else turn


def read_rect_light(prim: Usd.Prim, context: StageContext) -> AreaLight:
    """A RectLight, which emits along its local -z.

    Seen from there, its image is upright and not mirrored.

    Returns:
        In world space; the radiance is before `normalize`.

    Raises:
        SceneError: for a light without extent.
    """
    half_width = size(prim, "inputs:width", context) / 2
    half_height = size(prim, "inputs:height", context) / 2
    light = _area_light("rect", prim, half_width, half_height, context)
    image = read_light_image(prim, context)
    if image is None:
        return light
    is_mirrored = np.linalg.det(context.local_to_world(prim)[:3, :3]) < 0
    return replace(light, image=image, image_axes=MIRRORED_IMAGE_AXES if is_mirrored else IMAGE_AXES)


def read_disk_light(prim: Usd.Prim, context: StageContext) -> AreaLight:
    """A DiskLight, which emits along its local -z.

    Returns:
        In world space; the radiance is before `normalize`.

    Raises:
        SceneError: for a light without extent.
    """
    radius = size(prim, "inputs:radius", context)
    return _area_light("disk", prim, radius, radius, context)


def read_sphere_light(prim: Usd.Prim, context: StageContext) -> SphereLight:
    """A SphereLight; under a scale that is not uniform, a sphere of the same volume, with a warning.

    Returns:
        In world space; the radiance is before `normalize`.

    Raises:
        SceneError: for a light without extent.
    """
    to_world = context.local_to_world(prim)
    scales = np.linalg.svd(to_world[:3, :3], compute_uv=False)
    if scales.max() - scales.min() > SCALE_TOLERANCE * scales.max():
        context.notes.add("scale is not uniform: a sphere of the same volume is rendered", prim.GetPath())
    radius = size(prim, "inputs:radius", context) * float(np.prod(scales)) ** (1 / 3)
    return SphereLight(
        name=str(prim.GetPath()),
        center=vec3(to_world[:3, 3]),
        radius=radius,
        radiance=emission(prim, context),
        shaping=read_shaping(prim, context, whole_angle=180.0),
    )


def read_cylinder_light(prim: Usd.Prim, context: StageContext) -> CylinderLight:
    """A CylinderLight along its local x axis; across a scale that is not uniform, a round one, with a warning.

    The round one has the same volume.

    Returns:
        In world space; the radiance is before `normalize`.

    Raises:
        SceneError: for a light without extent.
    """
    to_world = context.local_to_world(prim)
    half_axis = to_world[:3, 0] * size(prim, "inputs:length", context) / 2
    along = to_world[:3, 0] / max(float(np.linalg.norm(to_world[:3, 0])), np.finfo(float).tiny)
    across = to_world[:3, 1:3] - np.outer(along, along @ to_world[:3, 1:3])
    scales = np.linalg.svd(across, compute_uv=False)
    slant = np.abs(along @ to_world[:3, 1:3]).max()
    if max(scales[0] - scales[1], slant) > SCALE_TOLERANCE * scales[0]:
        context.notes.add("scale is not uniform: a round tube of the same volume is rendered", prim.GetPath())
    return CylinderLight(
        name=str(prim.GetPath()),
        center=vec3(to_world[:3, 3]),
        half_axis=vec3(half_axis),
        radius=size(prim, "inputs:radius", context) * math.sqrt(float(np.prod(scales))),
        radiance=emission(prim, context),
        shaping=read_shaping(prim, context, whole_angle=180.0),
    )


def read_mesh_light(prim: Usd.Prim, context: StageContext) -> MeshLight | None:
    """A Mesh with MeshLightAPI, or the one that a GeometryLight names; None, with a warning, where there is no face.

    Returns:
        Its triangles in world space, counter-clockwise seen from outside; the radiance is before `normalize`.

    Raises:
        SceneError: for a mesh that does not fit together.
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
        radiance=emission(prim, context),
        shaping=read_shaping(prim, context, whole_angle=180.0),
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


def read_light(prim: Usd.Prim, context: StageContext) -> Light | None:
    """Any light; None, with a warning, for a kind that is not supported.

    A value out of its range is mended.

    Returns:
        In world space. Where it is normalized, its radiance is divided by its area, and that of a distant light by the
        irradiance that a radiance of 1 would give.

    Raises:
        SceneError: for a light that cannot be, such as one without extent; and for what is mended or missing, where the
            stage is read strictly.
    """
    reader = LIGHT_READERS.get(prim.GetTypeName())
    if reader is None:
        context.notes.add(f"light of type {prim.GetTypeName()} is not supported and gives no light", prim.GetPath())
        return None
    note_not_read(prim, context)
    light = reader(prim, context)
    if light:
        note_hints(prim, context)
    if light and read_mended_flag(prim.GetAttribute("inputs:normalize"), context):
        return replace(light, radiance=scaled(light.radiance, 1 / _extent(light)))
    return light


def default_lights(camera: Camera) -> tuple[Light, ...]:
    """What lights a stage that has no light of its own: a key light that goes with the camera, and a dim dome.

    Returns:
        A DistantLight from beside the camera, and `DEFAULT_DOME`.
    """
    axes = unit_axes(camera.camera_to_world)
    towards = axes @ DEFAULT_KEY_FROM
    radiance = DEFAULT_KEY_RADIANCE / math.sin(DEFAULT_KEY_HALF_ANGLE) ** 2
    key = DistantLight(
        name="default key",
        direction=vec3(-towards / np.linalg.norm(towards)),
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
        center=vec3(to_world[:3, 3]),
        half_u=vec3(half_u),
        half_v=vec3(half_v),
        radiance=emission(prim, context),
        shaping=read_shaping(prim, context, whole_angle=90.0),
    )


def _extent(light: Light) -> float:
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


def _note_material(geometry: Usd.Prim, light: Usd.Prim, context: StageContext) -> None:
    mode = light.GetAttribute("light:materialSyncMode").Get(context.time)
    material, _ = UsdShade.MaterialBindingAPI(geometry).ComputeBoundMaterial(UsdShade.Tokens.full)
    if material and mode != UsdLux.Tokens.noMaterialResponse:
        context.notes.add(f"a mesh that emits makes no use of its material, whatever {mode} says", light.GetPath())
