"""From a USD stage to the scene that the renderer sees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pxr import Tf, Usd, UsdGeom, UsdShade, UsdSkel

from fgf_warp.errors import SceneError
from fgf_warp.scene import Light, Scene, Shape
from usd_scenes import schema
from usd_scenes.reader.camera import choose_camera, default_camera, read_camera
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.diagnostics import (
    note_warnings,
    open_stage,
    refuse_composition_errors,
    usd_errors_as_scene_errors,
)
from usd_scenes.reader.lights import DEFAULT_DOME, is_light, read_light
from usd_scenes.reader.materials import MaterialReader
from usd_scenes.reader.settings import read_settings
from usd_scenes.reader.shapes import ShapeReader
from usd_scenes.reader.traversal import walk

PURPOSES = ("default", "render", "proxy", "guide")
CONTAINERS = ("SkelRoot", "PointInstancer")
"""Boundable prims that draw nothing of their own."""


@dataclass(frozen=True)
class StageReading:
    """What a stage came to.

    Args:
        scene: for the renderer.
        resolution: width and height [pixel] of the stage's render settings, or None.
        warnings: what of the stage is not rendered as it is written, one text each.
    """

    scene: Scene
    resolution: tuple[int, int] | None
    warnings: tuple[str, ...]


def read_scene(
    path: str | Path,
    *,
    camera: str | None = None,
    frame: float | None = None,
    purposes: Sequence[str] = ("default", "render"),
) -> StageReading:
    """Reads a USD file, and so validates it.

    Args:
        path: a .usd, .usda, .usdc or .usdz file.
        camera: path or name of a camera; None takes the render settings', else the first, else a view from the
            front that holds everything.
        frame: time code at which attributes are sampled; None takes the stage's authored start, else each
            attribute's earliest sample.
        purposes: which geometry to read, of ``default``, ``render``, ``proxy`` and ``guide``.

    Raises:
        SceneError: naming file, prim, attribute, the value found and what is accepted.
        UnsupportedFeatureError: for what cannot be rendered and cannot be left out.
    """
    schema.register()
    with usd_errors_as_scene_errors(str(path)) as trap:
        return _read(open_stage(Path(path)), str(path), camera, frame, purposes, trap)


def read_stage(
    stage: Usd.Stage,
    *,
    camera: str | None = None,
    frame: float | None = None,
    purposes: Sequence[str] = ("default", "render"),
) -> StageReading:
    """Reads a stage that is open already; otherwise as `read_scene`."""
    schema.register()
    layer = stage.GetRootLayer()
    source = (layer.GetDisplayName() if layer.anonymous else layer.identifier) or "stage"
    with usd_errors_as_scene_errors(source) as trap:
        return _read(stage, source, camera, frame, purposes, trap)


def _read(
    stage: Usd.Stage,
    source: str,
    camera: str | None,
    frame: float | None,
    purposes: Sequence[str],
    trap: Tf.DiagnosticTrap,
) -> StageReading:
    refuse_composition_errors(stage)
    context = StageContext(stage=stage, time=_time_code(stage, frame), purposes=_checked(purposes))
    settings = read_settings(context)
    camera_prim = choose_camera(context, camera, settings.camera)
    materials = MaterialReader(context)
    shapes, lights = _read_prims(context, materials)
    if camera_prim is None:
        context.notes.add("no camera: the view is from the front and holds everything")
    if not shapes:
        context.notes.add("no geometry: only the lights are seen; a medium needs a closed shape that it is bound to")
    if not lights:
        context.notes.add("no light: an environment of radiance 1 is used")
    scene = Scene(
        camera=read_camera(camera_prim, context) if camera_prim else default_camera(shapes, context.up_axis),
        shapes=tuple(shapes),
        media=materials.media,
        lights=tuple(lights) or (DEFAULT_DOME,),
        meters_per_unit=_meters_per_unit(stage),
        source=source,
    )
    _note_law_warnings(context, scene)
    note_warnings(trap, context.notes)
    return StageReading(scene=scene, resolution=settings.resolution, warnings=context.notes.texts())


def _read_prims(context: StageContext, materials: MaterialReader) -> tuple[list[Shape], list[Light]]:
    shapes = ShapeReader(context, materials)
    lights: list[Light | None] = []
    for met in walk(context):
        prim = met.prim
        _note_misplaced(prim, context)
        if is_light(prim):
            if met.copies:
                context.notes.add("light in an instancer's prototype gives no light", prim.GetPath())
            else:
                lights.append(read_light(prim, context))
        if met.has_purpose and not shapes.read(met) and _is_unsupported(prim):
            context.notes.add(f"{prim.GetTypeName()} is not supported and is left out", prim.GetPath())
    return shapes.shapes(), [light for light in lights if light]


def _is_unsupported(prim: Usd.Prim) -> bool:
    draws = prim.IsA(UsdGeom.Boundable) and not is_light(prim) and prim.GetTypeName() not in CONTAINERS
    has_unknown_type = bool(prim.GetTypeName()) and prim.GetPrimTypeInfo().GetSchemaType().isUnknown
    return draws or has_unknown_type


def _note_misplaced(prim: Usd.Prim, context: StageContext) -> None:
    if schema.SCHEMA_NAME in prim.GetAppliedSchemas() and not prim.IsA(UsdShade.Material):
        context.notes.add(f"{schema.SCHEMA_NAME} is of no effect on a prim that is no Material", prim.GetPath())
    if prim.IsA(UsdSkel.Root):
        context.notes.add("skinning is not supported: the rest pose is rendered", prim.GetPath())


def _note_law_warnings(context: StageContext, scene: Scene) -> None:
    for index, medium in enumerate(scene.media):
        for text in scene.medium_warnings(index, medium):
            context.notes.add(f"{medium.name}: {text}")


def _meters_per_unit(stage: Usd.Stage) -> float:
    value = float(UsdGeom.GetStageMetersPerUnit(stage))
    if not (math.isfinite(value) and value > 0):
        raise SceneError(f"metersPerUnit = {value:g}; accepted: > 0")
    return value


def _time_code(stage: Usd.Stage, frame: float | None) -> Usd.TimeCode:
    if frame is not None:
        if not math.isfinite(frame):
            raise SceneError(f"frame = {frame:g}; accepted: a finite number")
        return Usd.TimeCode(frame)
    # The default time would leave attributes that have only samples without a value.
    if stage.HasAuthoredMetadata("startTimeCode"):
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.EarliestTime()


def _checked(purposes: Sequence[str]) -> frozenset[str]:
    unknown = sorted(set(purposes) - set(PURPOSES))
    if unknown:
        raise SceneError(f"purposes = {', '.join(unknown)}; accepted: {', '.join(PURPOSES)}")
    return frozenset(purposes)
