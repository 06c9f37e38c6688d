"""UsdGeom.Camera: which camera to take, its film, lens and shutter."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from pxr import Usd, UsdGeom

from fgf_warp.errors import SceneError
from fgf_warp.scene import FLOAT32_MAX, PROJECTIONS, Camera, Shape
from usd_scenes.reader.attributes import is_authored, read_array, read_number, read_token
from usd_scenes.reader.bounds import scene_bounds
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.settings import Product

DEFAULT_CAMERA = "default camera"
DEFAULT_ELEVATION = math.radians(15)
"""Of the default view above the horizon."""


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


def read_shutter(prim: Usd.Prim, context: StageContext) -> tuple[Usd.TimeCode, Usd.TimeCode] | None:
    """When a camera's shutter opens and closes; None where it takes its picture in an instant.

    USD has these times relative to the frame. Where there is no frame, as at the default time or where the stage has
    no start, the shutter is left shut, with a warning.

    Raises:
        SceneError: for a shutter that closes before it opens.
    """
    camera, time = UsdGeom.Camera(prim), context.time
    opening = read_number(camera.GetShutterOpenAttr(), time)
    attribute = camera.GetShutterCloseAttr()
    closing = read_number(attribute, time, accepted=f">= shutter:open = {opening:g}", holds=lambda x: x >= opening)
    if opening == closing:
        return None
    if time.IsDefault() or time.IsEarliestTime():
        context.notes.add("no frame is chosen for the shutter to open at: nothing moves", prim.GetPath())
        return None
    return Usd.TimeCode(time.GetValue() + opening), Usd.TimeCode(time.GetValue() + closing)


def read_camera(prim: Usd.Prim, context: StageContext) -> Camera:
    """A camera.

    Its clipping range is in force where it is authored: USD's fallback begins at one stage unit from the camera,
    which would cut what a scene in metres has in front.

    Raises:
        SceneError: for a film or lens without extent, a lens that is focused at no distance, or a range without extent.
    """
    camera = UsdGeom.Camera(prim)
    time = context.time
    projection = read_token(camera.GetProjectionAttr(), time, PROJECTIONS)
    f_stop, focus_distance = _focus(camera, context, has_lens=projection != "orthographic")
    _note_what_is_not_read(camera, context)
    return Camera(
        name=str(prim.GetPath()),
        camera_to_world=context.local_to_world(prim),
        focal_length=_positive(camera.GetFocalLengthAttr(), time),
        horizontal_aperture=_positive(camera.GetHorizontalApertureAttr(), time),
        vertical_aperture=_positive(camera.GetVerticalApertureAttr(), time),
        horizontal_offset=read_number(camera.GetHorizontalApertureOffsetAttr(), time),
        vertical_offset=read_number(camera.GetVerticalApertureOffsetAttr(), time),
        projection="orthographic" if projection == "orthographic" else "perspective",
        f_stop=f_stop,
        focus_distance=focus_distance,
        clipping_range=_clipping_range(camera.GetClippingRangeAttr(), time),
        exposure_scale=_exposure_scale(camera, time),
        closing=context.closing_to_world(prim),
    )


def as_asked(camera: Camera, product: Product) -> Camera:
    """A camera with what an image's settings say of its lens and film."""
    return replace(
        camera,
        f_stop=camera.f_stop if product.has_depth_of_field else 0.0,
        conform_policy=product.conform_policy,
        pixel_aspect_ratio=product.pixel_aspect_ratio,
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
    right = _cross(up, backward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    for column, axis in enumerate((right, _cross(backward, right), backward, eye)):
        matrix[:3, column] = axis
    return matrix


def _cross(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """As NumPy's, to the bit, which takes ten times as long for a single pair: a sweep makes one of each sample."""
    (a, b, c), (x, y, z) = one.tolist(), other.tolist()
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


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


def _focus(camera: UsdGeom.Camera, context: StageContext, *, has_lens: bool) -> tuple[float, float]:
    """f-stop, 0 for a pinhole, and the distance of what is sharp."""
    f_stop = read_number(camera.GetFStopAttr(), context.time, accepted=">= 0", holds=lambda x: x >= 0)
    distance = camera.GetFocusDistanceAttr()
    if has_lens and f_stop > 0:
        if is_authored(distance):
            accepted = f"> 0 with fStop = {f_stop:g}; a pinhole has fStop = 0"
            return f_stop, read_number(distance, context.time, accepted=accepted, holds=lambda x: x > 0)
        context.notes.add("fStop without a focusDistance is not used: the camera is a pinhole", camera.GetPath())
    return 0.0, read_number(distance, context.time, accepted=">= 0", holds=lambda x: x >= 0)


def _clipping_range(attribute: Usd.Attribute, time: Usd.TimeCode) -> tuple[float, float]:
    if not is_authored(attribute):
        return 0.0, math.inf
    limits = read_array(attribute, time, np.float64)
    if len(limits) != 2 or not 0 <= limits[0] < limits[1]:
        shown = ", ".join(f"{limit:g}" for limit in limits)
        raise SceneError(f"{attribute.GetPath()} = ({shown}); accepted: two numbers, 0 <= near < far")
    return float(limits[0]), float(limits[1])


def _exposure_scale(camera: UsdGeom.Camera, time: Usd.TimeCode) -> float:
    """What UsdGeom.Camera's exposure, time, iso, fStop and responsivity come to."""
    scale = float(camera.ComputeLinearExposureScale(time))
    if not 0 < scale <= FLOAT32_MAX:
        raise SceneError(
            f"{camera.GetPath()}: exposure, exposure:time, exposure:iso, exposure:fStop and exposure:responsivity come "
            f"to a scale of {scale:g}; accepted: finite and > 0"
        )
    return scale


def _note_what_is_not_read(camera: UsdGeom.Camera, context: StageContext) -> None:
    if camera.GetClippingPlanesAttr().Get(context.time):
        context.notes.add("clippingPlanes of a camera are not supported and are ignored", camera.GetPath())
