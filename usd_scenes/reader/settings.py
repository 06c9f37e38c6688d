"""UsdRender.Settings: the resolution and the camera that a stage asks for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom, UsdRender

from fgf_warp.errors import SceneError
from usd_scenes.reader.attributes import is_authored, read_array
from usd_scenes.reader.context import StageContext

RESOLUTION_MAX = 65536
NOT_READ = ("aspectRatioConformPolicy", "dataWindowNDC", "disableDepthOfField", "pixelAspectRatio")


@dataclass(frozen=True)
class StageSettings:
    """What the stage's render settings say.

    Args:
        resolution: width and height [pixel], or None.
        camera: prim path, or None.
    """

    resolution: tuple[int, int] | None = None
    camera: str | None = None


def read_settings(context: StageContext) -> StageSettings:
    """The settings that the stage's metadata name, else the first RenderSettings prim, else none.

    Raises:
        SceneError: for a resolution out of [1, 65536] or a camera that is not there.
    """
    settings = UsdRender.Settings.GetStageRenderSettings(context.stage) or _first_settings(context.stage)
    if not settings:
        return StageSettings()
    prim = settings.GetPrim()
    for name in NOT_READ:
        if prim.GetAttribute(name).HasAuthoredValue():
            context.notes.add("render setting is not used", prim.GetPath().AppendProperty(name))
    return StageSettings(resolution=_resolution(settings, context.time), camera=_camera_path(settings))


def _first_settings(stage: Usd.Stage) -> UsdRender.Settings | None:
    return next((UsdRender.Settings(prim) for prim in stage.Traverse() if prim.IsA(UsdRender.Settings)), None)


def _resolution(settings: UsdRender.Settings, time: Usd.TimeCode) -> tuple[int, int] | None:
    attribute = settings.GetResolutionAttr()
    if not is_authored(attribute):
        return None
    size = read_array(attribute, time, np.int64)
    if len(size) != 2:
        raise SceneError(f"{attribute.GetPath()} holds {len(size)} numbers; accepted: two")
    width, height = size
    if not (1 <= width <= RESOLUTION_MAX and 1 <= height <= RESOLUTION_MAX):
        raise SceneError(
            f"{attribute.GetPath()} = ({width}, {height}); accepted: two integers in [1, {RESOLUTION_MAX}]"
        )
    return int(width), int(height)


def _camera_path(settings: UsdRender.Settings) -> str | None:
    targets = settings.GetCameraRel().GetForwardedTargets()
    if not targets:
        return None
    if not UsdGeom.Camera.Get(settings.GetPrim().GetStage(), targets[0]):
        raise SceneError(f"{settings.GetCameraRel().GetPath()} = {targets[0]}; accepted: the path of a Camera")
    return str(targets[0])
