"""From a USD stage to the scene that the renderer sees."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from pxr import Tf, Usd, UsdGeom, UsdShade, UsdSkel

from fgf_warp.errors import FgfError, SceneError
from fgf_warp.scene import Camera, Light, Medium, Scene, Shape
from usd_scenes import schema
from usd_scenes.reader.camera import as_asked, choose_camera, default_camera, read_camera, read_shutter
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.diagnostics import (
    note_warnings,
    open_stage,
    refuse_composition_errors,
    usd_errors_as_scene_errors,
)
from usd_scenes.reader.edits import Edits, edited
from usd_scenes.reader.lights import DEFAULT_DOME, default_lights, emitting_meshes, is_light, read_light
from usd_scenes.reader.links import link_lights
from usd_scenes.reader.materials import MaterialReader
from usd_scenes.reader.policy import Policy
from usd_scenes.reader.settings import Product, StageSettings, read_settings
from usd_scenes.reader.shapes import ShapeReader
from usd_scenes.reader.traversal import walk
from usd_scenes.reader.unread import PropertyCheck

PURPOSES = ("default", "render", "proxy", "guide")
DEFAULT_PURPOSES = frozenset({"default", "render"})
COMPLEXITIES = ("low", "medium", "high", "veryhigh")
"""As usdrecord names them: each subdivides once more than the one before, ``low`` not at all."""
UP_AXES = ("Y", "Z")
CONTAINERS = ("SkelRoot", "PointInstancer")
"""Boundable prims that draw nothing of their own."""


Frame = float | Literal["default"]
"""A time code, or USD's default time, at which attributes have their default values and no samples."""


@dataclass(frozen=True)
class StageReading:
    """What a stage came to.

    Args:
        scene: for the renderer.
        resolution: width and height [pixel] of the stage's render settings, or None.
        warnings: what of the stage is not rendered as it is written, one text each.
        sources: what the stage wants in the image's planes, the sourceName of each RenderVar; None where it does not
            say.
        up_axis: ``Y`` or ``Z``.
    """

    scene: Scene
    resolution: tuple[int, int] | None
    warnings: tuple[str, ...]
    sources: tuple[str, ...] | None = None
    up_axis: str = "Y"


@dataclass(frozen=True)
class _Choices:
    """What is asked of a stage; see `read_scene`."""

    camera: str | None
    frame: Frame | None
    purposes: Sequence[str] | None
    complexity: str
    strict: bool
    render_settings: str | None
    product: str | None


@dataclass(frozen=True)
class StageSurvey:
    """What of a stage can be read, whatever is refused.

    Args:
        shapes: those that are accepted.
        media: that they are filled with.
        lights: those that are accepted, or the default ones where nothing else gives light.
        camera: the one that is taken where none is asked for, or None where it is refused.
        refusals: for what reading would stop.
        warnings: what is mended, left out or not rendered as it is written: a text and the path that it holds for.
    """

    shapes: tuple[Shape, ...]
    media: tuple[Medium, ...]
    lights: tuple[Light, ...]
    camera: Camera | None
    refusals: tuple[FgfError, ...]
    warnings: tuple[tuple[str, str], ...] = ()


def read_scene(
    path: str | Path,
    *,
    camera: str | None = None,
    frame: Frame | None = None,
    purposes: Sequence[str] | None = None,
    complexity: str = "high",
    strict: bool = False,
    render_settings: str | None = None,
    product: str | None = None,
    edits: Edits | None = None,
) -> StageReading:
    """Reads a USD file, and so validates it.

    Args:
        path: a .usd, .usda, .usdc or .usdz file.
        camera: path or name of a camera; None takes the render settings', else the first, else a view from the
            front that holds everything.
        frame: time code at which attributes are sampled, or ``default``; None takes the stage's authored start, else
            each attribute's earliest sample.
        purposes: which geometry to read, of ``default``, ``render``, ``proxy`` and ``guide``; None takes the render
            settings', else ``default`` and ``render``.
        complexity: how far surfaces are subdivided, ``low``, ``medium``, ``high`` or ``veryhigh``.
        strict: True where what is missing, such as a texture's file, is an error instead of a warning.
        render_settings: path of the RenderSettings; None takes those that the stage's metadata name, else the first.
        product: path of the RenderProduct that is meant; None takes the settings' first.
        edits: values in place of the file's.

    Raises:
        EditError: for an edit of what is not there, or of a value that it does not take.
        SceneError: naming file, prim, attribute, the value found and what is accepted.
        UnsupportedFeatureError: for what cannot be rendered and cannot be left out.
    """
    choices = _Choices(camera, frame, purposes, complexity, strict, render_settings, product)
    schema.register()
    with usd_errors_as_scene_errors(str(path)) as trap:
        stage = open_stage(Path(path))
        with edited(stage, edits or {}, _time_code(stage, frame)):
            return _read(stage, str(path), choices, trap)


def read_stage(
    stage: Usd.Stage,
    *,
    camera: str | None = None,
    frame: Frame | None = None,
    purposes: Sequence[str] | None = None,
    complexity: str = "high",
    strict: bool = False,
    render_settings: str | None = None,
    product: str | None = None,
) -> StageReading:
    """Reads a stage that is open already; otherwise as `read_scene`."""
    choices = _Choices(camera, frame, purposes, complexity, strict, render_settings, product)
    schema.register()
    layer = stage.GetRootLayer()
    source = (layer.GetDisplayName() if layer.anonymous else layer.identifier) or "stage"
    with usd_errors_as_scene_errors(source) as trap:
        return _read(stage, source, choices, trap)


def read_products(
    path: str | Path, *, frame: Frame | None = None, render_settings: str | None = None
) -> tuple[Product, ...]:
    """The images that a USD file asks for, at least one; its geometry is not read.

    Args:
        path: as for `read_scene`.
        frame: as for `read_scene`; names of products may have samples.
        render_settings: as for `read_scene`.

    Raises:
        SceneError: for a stage that cannot be opened, or settings that are not there or out of their range.
    """
    schema.register()
    with usd_errors_as_scene_errors(str(path)):
        stage = open_stage(Path(path))
        context = StageContext(stage=stage, time=_time_code(stage, frame), purposes=frozenset())
        return read_settings(context, render_settings).products


class OpenStages:
    """Within it, as a context, a file that is read again, as for another frame, is not opened again."""

    def __init__(self) -> None:
        self._cache = Usd.StageCache()
        self._contexts: list[Usd.StageCacheContext] = []

    def __enter__(self) -> None:
        self._contexts.append(Usd.StageCacheContext(self._cache))
        self._contexts[-1].__enter__()

    def __exit__(self, *raised: object) -> None:
        self._contexts.pop().__exit__(*raised)


def survey_stage(stage: Usd.Stage, frame: Frame | None = None) -> StageSurvey:
    """Reads what of an open stage can be read, and collects what is mended, left out or refused."""
    schema.register()
    refusals: list[FgfError] = []
    context = stage_context(stage, frame, Policy(refusals=refusals))
    materials = MaterialReader(context)
    settings, camera = StageSettings(), None
    shapes, lights = _read_prims(context, materials)
    with context.going_on():
        _meters_per_unit(stage)
    with context.going_on():
        settings = read_settings(context)
    with context.going_on():
        prim = choose_camera(context, None, settings.product(None).camera)
        camera = read_camera(prim, context) if prim else default_camera(shapes, context.up_axis)
        if prim:
            read_shutter(prim, context)
        Scene(camera=camera, shapes=tuple(shapes), media=materials.media)
    if _is_dark(lights, shapes):
        lights = [DEFAULT_DOME] if camera is None else [*default_lights(camera)]
    warnings = context.notes.entries()
    return StageSurvey(tuple(shapes), materials.media, tuple(lights), camera, tuple(refusals), warnings)


def stage_context(stage: Usd.Stage, frame: Frame | None = None, policy: Policy | None = None) -> StageContext:
    """What `read_stage` reads a stage in where nothing else is asked for."""
    time = _time_code(stage, frame)
    return StageContext(stage=stage, time=time, purposes=DEFAULT_PURPOSES, policy=policy or Policy())


def _read(stage: Usd.Stage, source: str, choices: _Choices, trap: Tf.DiagnosticTrap) -> StageReading:
    context = StageContext(
        stage=stage,
        time=_time_code(stage, choices.frame),
        purposes=DEFAULT_PURPOSES,
        refinement=_refinement(choices.complexity),
        policy=Policy(strict=choices.strict),
    )
    refuse_composition_errors(context)
    _note_up_axis(context)
    settings = read_settings(context, choices.render_settings)
    product = settings.product(choices.product)
    camera_prim = choose_camera(context, choices.camera, product.camera)
    purposes = next(asked for asked in (choices.purposes, settings.purposes, DEFAULT_PURPOSES) if asked is not None)
    context = replace(
        context,
        purposes=_checked(purposes),
        shutter=read_shutter(camera_prim, context) if camera_prim and product.has_motion_blur else None,
    )
    materials = MaterialReader(context)
    shapes, lights = _read_prims(context, materials)
    if camera_prim is None:
        context.notes.add("no camera: the view is from the front and holds everything")
    if not shapes:
        context.notes.add("no geometry: only the lights are seen; a medium needs a closed shape that it is bound to")
    camera = read_camera(camera_prim, context) if camera_prim else default_camera(shapes, context.up_axis)
    if _is_dark(lights, shapes):
        context.notes.add("no light: a dim environment and a light from beside the camera are used")
        lights = [*default_lights(camera)]
    scene = Scene(
        camera=as_asked(camera, product),
        shapes=tuple(shapes),
        media=materials.media,
        lights=tuple(lights),
        meters_per_unit=_meters_per_unit(stage),
        source=source,
    )
    _note_law_warnings(context, scene)
    note_warnings(trap, context.notes)
    return StageReading(scene, product.resolution, context.notes.texts(), product.sources, context.up_axis)


def _read_prims(context: StageContext, materials: MaterialReader) -> tuple[list[Shape], list[Light]]:
    shapes = ShapeReader(context, materials)
    properties = PropertyCheck(context)
    lights: list[tuple[Usd.Prim, Light]] = []
    found = list(walk(context))
    emitting = emitting_meshes(met.prim for met in found if met.has_purpose and not met.copies)
    for met in found:
        with context.going_on():
            prim = met.prim
            _note_misplaced(prim, context)
            properties.check(prim)
            if is_light(prim):
                if met.copies:
                    context.notes.add("a light that is part of an instancer gives no light", prim.GetPath())
                elif met.has_purpose:
                    with context.leaving_out(prim.GetPath(), "the light is left out"):
                        light = read_light(prim, context)
                        lights.extend([(prim, light)] if light else [])
            emits = prim.GetPath() in emitting or (is_light(prim) and prim.IsA(UsdGeom.Mesh))
            if met.has_purpose and not emits and not shapes.read(met) and _is_unsupported(prim):
                context.notes.add(f"{prim.GetTypeName()} is not supported and is left out", prim.GetPath())
    placed = shapes.shapes()
    linked_lights, linked_shapes = [light for _, light in lights], [shape for _, shape in placed]
    with context.going_on():
        linked_lights, linked_shapes = link_lights(lights, placed, context)
    return linked_shapes, linked_lights


def _is_dark(lights: Sequence[Light], shapes: Sequence[Shape]) -> bool:
    """True where nothing gives light, neither a light nor a surface that glows."""
    return not lights and not any(shape.surface and shape.surface.emits for shape in shapes)


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


def _note_up_axis(context: StageContext) -> None:
    axis = UsdGeom.GetStageUpAxis(context.stage)
    if axis not in UP_AXES:
        context.notes.add(f"upAxis = {axis} is not supported; accepted: {', '.join(UP_AXES)}; Y is taken")


def _time_code(stage: Usd.Stage, frame: Frame | None) -> Usd.TimeCode:
    if frame == "default":
        return Usd.TimeCode.Default()
    if frame is not None:
        if not math.isfinite(frame):
            raise SceneError(f"frame = {frame:g}; accepted: a finite number")
        return Usd.TimeCode(frame)
    # The default time would leave attributes that have only samples without a value.
    if stage.HasAuthoredMetadata("startTimeCode"):
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.EarliestTime()


def _refinement(complexity: str) -> int:
    if complexity not in COMPLEXITIES:
        raise SceneError(f"complexity = {complexity}; accepted: {', '.join(COMPLEXITIES)}")
    return COMPLEXITIES.index(complexity)


def _checked(purposes: Collection[str]) -> frozenset[str]:
    unknown = sorted(set(purposes) - set(PURPOSES))
    if unknown:
        raise SceneError(f"purposes = {', '.join(unknown)}; accepted: {', '.join(PURPOSES)}")
    return frozenset(purposes)
