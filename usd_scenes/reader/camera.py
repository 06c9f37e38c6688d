"""UsdGeom.Camera: which camera to take, and its film and lens."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from pxr import Usd, UsdGeom

from fgf_warp.errors import SceneError, UnsupportedFeatureError
from fgf_warp.scene import Camera, Shape
from usd_scenes.reader.attributes import is_authored, read_number
from usd_scenes.reader.bounds import scene_bounds
from usd_scenes.reader.context import StageContext

DEFAULT_CAMERA = "default camera"
DEFAULT_ELEVATION = math.radians(15)
"""Of the default view above the horizon."""
NOT_READ = ("clippingRange", "clippingPlanes", "exposure", "shutter:open", "shutter:close")


def choose_camera(context: StageContext, asked: str | None, from_settings: str | None) -> Usd.Prim | None:
    """The camera that is asked for, else the render settings', else the stage's first, else None.

    Args:
        context: the stage.
        asked: prim path, or a prim name that only one camera has.
        from_settings: prim path.

    Raises:
        SceneError: where no single camera is what is asked for; it lists those there are.
    """
    cameras = [prim for prim in _all_prims(context.stage) if prim.IsA(UsdGeom.Camera)]
    if asked is not None:
        return _find_camera(cameras, asked)
    if from_settings is not None:
        return _find_camera(cameras, from_settings)
    if len(cameras) > 1:
        context.notes.add(f"{len(cameras)} cameras and none asked for: the first is used", cameras[0].GetPath())
    return cameras[0] if cameras else None


def read_camera(prim: Usd.Prim, context: StageContext) -> Camera:
    """A perspective camera.

    Raises:
        SceneError: for a film or lens without extent.
        UnsupportedFeatureError: for an orthographic camera.
    """
    camera = UsdGeom.Camera(prim)
    path, time = prim.GetPath(), context.time
    if camera.GetProjectionAttr().Get(time) == UsdGeom.Tokens.orthographic:
        raise UnsupportedFeatureError(f"{path}.projection = orthographic; accepted: perspective")
    _note_what_is_not_read(camera, context)
    return Camera(
        name=str(path),
        camera_to_world=context.local_to_world(prim),
        focal_length=_positive(camera.GetFocalLengthAttr(), time),
        horizontal_aperture=_positive(camera.GetHorizontalApertureAttr(), time),
        vertical_aperture=_positive(camera.GetVerticalApertureAttr(), time),
        horizontal_offset=read_number(camera.GetHorizontalApertureOffsetAttr(), time),
        vertical_offset=read_number(camera.GetVerticalApertureOffsetAttr(), time),
    )


def default_camera(shapes: Iterable[Shape], up_axis: str) -> Camera:
    """A view from the front and slightly above that holds all shapes.

    Args:
        shapes: in world space.
        up_axis: ``Y`` (the front is +z) or ``Z`` (the front is -y).
    """
    low, high = scene_bounds(shapes)
    center, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-6)
    up, front = (np.eye(3)[2], -np.eye(3)[1]) if up_axis == "Z" else (np.eye(3)[1], np.eye(3)[2])
    towards_camera = math.cos(DEFAULT_ELEVATION) * front + math.sin(DEFAULT_ELEVATION) * up
    film = Camera(name=DEFAULT_CAMERA, camera_to_world=np.eye(4))
    half_angle = math.atan(min(film.horizontal_aperture, film.vertical_aperture) / 2 / film.focal_length)
    eye = center + towards_camera * radius / math.sin(half_angle)
    return Camera(name=DEFAULT_CAMERA, camera_to_world=look_at(eye, center, up))


def look_at(eye: np.ndarray, target: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(4, 4) camera-to-world matrix of a camera at `eye` that looks at `target`."""
    backward = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross(up, backward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([right, np.cross(backward, right), backward, eye])
    return matrix


def _find_camera(cameras: list[Usd.Prim], asked: str) -> Usd.Prim:
    found = [prim for prim in cameras if asked in (str(prim.GetPath()), prim.GetName())]
    if len(found) != 1:
        names = ", ".join(str(prim.GetPath()) for prim in cameras) or "none"
        problem = "is not a camera of the stage" if not found else "is the name of several cameras"
        raise SceneError(f"camera {asked!r} {problem}; it has: {names}")
    return found[0]


def _all_prims(stage: Usd.Stage) -> Iterable[Usd.Prim]:
    return Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies())


def _positive(attribute: Usd.Attribute, time: Usd.TimeCode) -> float:
    return read_number(attribute, time, accepted="> 0", holds=lambda x: x > 0)


def _note_what_is_not_read(camera: UsdGeom.Camera, context: StageContext) -> None:
    prim = camera.GetPrim()
    ignored = [name for name in NOT_READ if is_authored(prim.GetAttribute(name))]
    if read_number(camera.GetFStopAttr(), context.time) > 0:
        ignored.append("fStop")
    if ignored:
        text = f"the camera is a pinhole without clipping and makes no use of {', '.join(ignored)}"
        context.notes.add(text, prim.GetPath())
