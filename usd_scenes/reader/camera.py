"""UsdGeom.Camera: which camera to take, its film, lens and shutter."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from pxr import Usd, UsdGeom

from fgf_warp.errors import SceneError
from fgf_warp.scene import FLOAT32_MAX, PROJECTIONS, Camera, Shape, unit_axes
from usd_scenes.reader.attributes import (
    FINITE,
    NOT_NEGATIVE,
    POSITIVE,
    Range,
    is_authored,
    read_array,
    read_mended,
    read_mended_token,
)
from usd_scenes.reader.bounds import scene_bounds
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.settings import Product

FOCAL_LENGTH = 50.0
APERTURES = (20.955, 15.2908)
"""USD's fallbacks."""
SCALE_ROUNDING = 1e-6
"""By so much less than float32 can tell a scale may differ from 1."""
DEFAULT_CAMERA = "default camera"
DEFAULT_ELEVATION = math.radians(15)
"""Of the default view above the horizon."""


def choose_camera(context: StageContext, asked: str | None, from_settings: str | None) -> Usd.Prim | None:
    """The camera that is asked for, else the render settings', else the stage's first, else None.

    Args:
        context: the stage.
        asked: prim path, or a prim name that only one camera has.
        from_settings: prim path.

    Returns:
        A prim of type Camera; None of a stage without any.

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

    Returns:
        Two time codes of the stage, the opening first, which is not later than the closing.

    Raises:
        SceneError: for a shutter that closes before it opens, where the stage is read strictly.
    """
    camera, time = UsdGeom.Camera(prim), context.time
    opening = read_mended(camera.GetShutterOpenAttr(), context, FINITE, 0.0)
    attribute = camera.GetShutterCloseAttr()
    closing = read_mended(attribute, context, Range(f">= shutter:open = {opening:g}", opening), opening)
    if opening == closing:
        return None
    if time.IsDefault() or time.IsEarliestTime():
        context.notes.add("no frame is chosen for the shutter to open at: nothing moves", prim.GetPath())
        return None
    return Usd.TimeCode(time.GetValue() + opening), Usd.TimeCode(time.GetValue() + closing)


def read_camera(prim: Usd.Prim, context: StageContext) -> Camera:
    """A camera, whose lengths are those of its own space: what is above it may scale them.

    Its clipping range is in force where it is authored: USD's fallback begins at one stage unit from the camera,
    which would cut what a scene in metres has in front. What is out of its range is mended, with a warning.

    Returns:
        Lengths and matrices are those of world space, scaled by what is above the camera; see `Camera` for their units.

    Raises:
        SceneError: for a transform that cannot be undone, or a film that is too wide for its lens.
    """
    camera = UsdGeom.Camera(prim)
    projection = read_mended_token(camera.GetProjectionAttr(), context, PROJECTIONS, "perspective")
    f_stop, focus_distance = _focus(camera, context, has_lens=projection != "orthographic")
    _note_what_is_not_read(camera, context)
    return _in_the_world(
        Camera(
            name=str(prim.GetPath()),
            camera_to_world=context.local_to_world(prim),
            focal_length=read_mended(camera.GetFocalLengthAttr(), context, POSITIVE, FOCAL_LENGTH),
            horizontal_aperture=read_mended(camera.GetHorizontalApertureAttr(), context, POSITIVE, APERTURES[0]),
            vertical_aperture=read_mended(camera.GetVerticalApertureAttr(), context, POSITIVE, APERTURES[1]),
            horizontal_offset=read_mended(camera.GetHorizontalApertureOffsetAttr(), context, FINITE, 0.0),
            vertical_offset=read_mended(camera.GetVerticalApertureOffsetAttr(), context, FINITE, 0.0),
            projection="orthographic" if projection == "orthographic" else "perspective",
            f_stop=f_stop,
            focus_distance=focus_distance,
            clipping_range=_clipping_range(camera.GetClippingRangeAttr(), context),
            exposure_scale=_exposure_scale(camera, context),
            closing=context.closing_to_world(prim),
        ),
        context,
    )


def note_clipped(camera: Camera, shapes: Sequence[Shape], context: StageContext) -> None:
    """Warns where nothing of what is before the camera is within its clipping range."""
    near, far = camera.clipping_range
    if not shapes or (near, far) == (0.0, math.inf):
        return
    low, high = scene_bounds(shapes)
    corners = np.array(list(product(*zip(low, high, strict=True))))
    depths = (corners - camera.position) @ -unit_axes(camera.camera_to_world)[:, 2]
    nearest, farthest = max(float(depths.min()), 0.0), float(depths.max())
    if farthest > 0 and (near >= farthest or far <= nearest):
        text = (
            f"clippingRange cuts all that there is: in the world's units it is ({near:g}, {far:g}), and what is before "
            f"the camera is at ({nearest:g}, {farthest:g})"
        )
        context.notes.add(text, camera.name)


def as_asked(camera: Camera, product: Product) -> Camera:
    """A camera with what an image's settings say of its lens and film."""
    return replace(
        camera,
        f_stop=camera.f_stop if product.has_depth_of_field else 0.0,
        conform_policy=product.conform_policy,
        pixel_aspect_ratio=camera.pixel_aspect_ratio * product.pixel_aspect_ratio,
    )


def default_camera(shapes: Iterable[Shape], up_axis: str) -> Camera:
    """A view from the front and slightly above that holds all shapes.

    Args:
        shapes: in world space.
        up_axis: ``Y`` (the front is +z) or ``Z`` (the front is -y).

    Returns:
        Of the default lens and film. A sphere around the box of all shapes fills the lesser side of its view.
    """
    low, high = scene_bounds(shapes)
    center, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-6)
    up, front = (np.eye(3)[2], -np.eye(3)[1]) if up_axis == "Z" else (np.eye(3)[1], np.eye(3)[2])
    towards_camera = math.cos(DEFAULT_ELEVATION) * front + math.sin(DEFAULT_ELEVATION) * up
    film = Camera(name=DEFAULT_CAMERA, camera_to_world=np.eye(4))
    half_angle = math.atan(min(film.horizontal_aperture, film.vertical_aperture) / 2 / film.focal_length)
    eye = center + towards_camera * radius / math.sin(half_angle)
    return Camera(name=DEFAULT_CAMERA, camera_to_world=look_at(eye, center, up))


@np.errstate(all="ignore")
def look_at(eye: np.ndarray, target: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(4, 4) camera-to-world matrix of a camera at `eye` that looks at `target`.

    Args:
        eye: (3,), in world space.
        target: (3,), another point than `eye`.
        up: (3,), of any length, not along the view.

    Returns:
        float64, whose columns are right, up, backward and the eye: it looks along its own -z. It is not finite where
        there is no such camera, as where the points coincide in float64, and no `Camera` takes it then.
    """
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


def _in_the_world(camera: Camera, context: StageContext) -> Camera:
    """A camera with its lengths in the world's units.

    A picture is what the inverse of the camera's whole transform makes of the world, as in Hydra. So a scale of what is
    above the camera scales its clipping range, its focus, its lens and what an orthographic one sees; an uneven one
    stretches the picture too, and with it the pixels.
    """
    across, up, along = (_scale(length) for length in np.linalg.norm(camera.camera_to_world[:3, :3], axis=0))
    # Of a pinhole only the shape of its film matters.
    film = along if camera.has_lens or camera.projection == "orthographic" else 1.0
    wide, high = film * _scale(across / along), film * _scale(up / along)
    if camera.has_lens and not wide == high == film:
        context.notes.add("the scale of a camera with a lens is not uniform: the lens stays round", camera.name)
    near, far = camera.clipping_range
    return replace(
        camera,
        focal_length=film * camera.focal_length,
        horizontal_aperture=wide * camera.horizontal_aperture,
        vertical_aperture=high * camera.vertical_aperture,
        horizontal_offset=wide * camera.horizontal_offset,
        vertical_offset=high * camera.vertical_offset,
        focus_distance=along * camera.focus_distance,
        clipping_range=(along * near, along * far),
        pixel_aspect_ratio=wide / high,
    )


def _scale(length: float) -> float:
    """1 for what differs from it by rounding alone."""
    return 1.0 if abs(length - 1) < SCALE_ROUNDING else float(length)


def _focus(camera: UsdGeom.Camera, context: StageContext, *, has_lens: bool) -> tuple[float, float]:
    """f-stop, 0 for a pinhole, and the distance of what is sharp."""
    f_stop = read_mended(camera.GetFStopAttr(), context, NOT_NEGATIVE, 0.0)
    attribute = camera.GetFocusDistanceAttr()
    distance = read_mended(attribute, context, NOT_NEGATIVE, 0.0)
    if not has_lens or f_stop == 0:
        return 0.0, distance
    if not is_authored(attribute):
        context.notes.add("fStop without a focusDistance is not used: the camera is a pinhole", camera.GetPath())
    elif distance == 0:
        accepted = f"> 0 with fStop = {f_stop:g}; a pinhole has fStop = 0"
        context.mend(f"= 0; accepted: {accepted}; the camera is a pinhole", attribute.GetPath())
    else:
        return f_stop, distance
    return 0.0, distance


def _clipping_range(attribute: Usd.Attribute, context: StageContext) -> tuple[float, float]:
    if not is_authored(attribute):
        return 0.0, math.inf
    with context.leaving_out(attribute.GetPath(), "it is left out"):
        limits = read_array(attribute, context.time, np.float64)
        if len(limits) != 2 or not 0 <= limits[0] < limits[1]:
            shown = ", ".join(f"{limit:g}" for limit in limits)
            raise SceneError(f"{attribute.GetPath()} = ({shown}); accepted: two numbers, 0 <= near < far")
        return float(limits[0]), float(limits[1])
    return 0.0, math.inf


def _exposure_scale(camera: UsdGeom.Camera, context: StageContext) -> float:
    """What UsdGeom.Camera's exposure, time, iso, fStop and responsivity come to."""
    scale = float(camera.ComputeLinearExposureScale(context.time))
    if 0 < scale <= FLOAT32_MAX:
        return scale
    text = (
        "exposure, exposure:time, exposure:iso, exposure:fStop and exposure:responsivity come to a scale of "
        f"{scale:g}; accepted: finite and > 0; 1 is used"
    )
    context.mend(text, camera.GetPath())
    return 1.0


def _note_what_is_not_read(camera: UsdGeom.Camera, context: StageContext) -> None:
    if camera.GetClippingPlanesAttr().Get(context.time):
        context.notes.add("clippingPlanes of a camera are not supported and are ignored", camera.GetPath())
