"""From a USD stage to the scene that the renderer sees."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Unpack

import numpy as np
from pxr import Usd, UsdGeom, UsdShade, UsdSkel

from fgf_warp.errors import FgfError, SceneError
from fgf_warp.scene import Camera, Light, Scene, Shape
from usd_scenes import schema
from usd_scenes.reader.camera import as_asked, choose_camera, default_camera, note_clipped, read_camera, read_shutter
from usd_scenes.reader.choices import Choices, ReadOptions
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.diagnostics import (
    leave_out_what_is_missing,
    note_warnings,
    open_stage,
    usd_errors_as_scene_errors,
)
from usd_scenes.reader.edits import Edits, edited
from usd_scenes.reader.frames import Frame
from usd_scenes.reader.lights import DEFAULT_DOME, default_lights, emitting_meshes, is_light, read_light
from usd_scenes.reader.links import link_lights
from usd_scenes.reader.listening import Heard, listening, tell_of_no_text
from usd_scenes.reader.materials import MaterialReader
from usd_scenes.reader.metadata import check_metadata, meters_per_unit, start_of
from usd_scenes.reader.open_stages import OpenStages
from usd_scenes.reader.policy import Policy
from usd_scenes.reader.readings import StageReading, StageSurvey
from usd_scenes.reader.settings import PURPOSES, Product, StageSettings, read_settings
from usd_scenes.reader.shapes import ShapeReader
from usd_scenes.reader.traversal import Met, walk
from usd_scenes.reader.unread import PropertyCheck

DEFAULT_PURPOSES = frozenset({"default", "render"})
COMPLEXITIES = ("low", "medium", "high", "veryhigh")
"""As usdrecord names them: each subdivides once more than the one before, ``low`` not at all."""
CONTAINERS = ("SkelRoot", "PointInstancer")
"""Boundable prims that draw nothing of their own."""


def read_scene(
    path: str | Path, *, edits: Edits | None = None, stages: OpenStages | None = None, **options: Unpack[ReadOptions]
) -> StageReading:
    """Reads a USD file, and so validates it.

    Args:
        path: a .usd, .usda, .usdc or .usdz file.
        edits: values in place of the file's.
        stages: which have been entered. Where nothing but numbers of lights has been edited since their last reading,
            only lights are read again.
        **options: ``camera``, ``frame``, ``purposes``, ``complexity``, ``strict``, ``render_settings`` and ``product``;
            see `ReadOptions`.

    Returns:
        The scene, and what of the stage is not rendered as it is written.

    Raises:
        EditError: for an edit of what is not there, or of a value that it does not take.
        SceneError: naming file, prim, attribute, the value found and what is accepted.
        UnsupportedFeatureError: for what cannot be rendered and cannot be left out.
    """
    choices = Choices(**options, asked_for=frozenset(target.partition("[")[0] for target in edits or {}))
    schema.register()
    with usd_errors_as_scene_errors(str(path)) as heard:
        stage = open_stage(Path(path))
        with edited(stage, edits or {}, _time_code(stage, choices.frame)):
            again = stages.read_again(stage, choices, edits, heard) if stages and edits else None
            if again is not None:
                return again
            survey, context = _read(stage, str(path), choices, heard)
            if stages and edits and survey.reading:
                stages.keep(survey.reading, choices, edits, context)
            return _whole(survey)


def read_stage(stage: Usd.Stage, **options: Unpack[ReadOptions]) -> StageReading:
    """Reads a stage that is open already; otherwise as `read_scene`.

    Returns:
        As `read_scene`; the source of the scene is the name of the root layer.
    """
    choices = Choices(**options)
    schema.register()
    source = _source(stage)
    with usd_errors_as_scene_errors(source) as heard:
        return _whole(_read(stage, source, choices, heard)[0])


def read_products(
    path: str | Path, *, frame: Frame | None = None, render_settings: str | None = None
) -> tuple[Product, ...]:
    """The images that a USD file asks for, at least one; its geometry is not read.

    Args:
        path: as for `read_scene`.
        frame: as for `read_scene`; names of products may have samples.
        render_settings: as for `read_scene`.

    Returns:
        Those of the render settings in their order; where there are none, the settings' own.

    Raises:
        SceneError: for a stage that cannot be opened, or settings that are not there or out of their range.
    """
    schema.register()
    with usd_errors_as_scene_errors(str(path)):
        stage = open_stage(Path(path))
        context = StageContext(stage=stage, time=_time_code(stage, frame), purposes=frozenset())
        return read_settings(context, render_settings).products


def survey_stage(
    stage: Usd.Stage,
    frame: Frame | None = None,
    *,
    camera: str | None = None,
    purposes: Sequence[str] | None = None,
    strict: bool = False,
) -> StageSurvey:
    """Reads what of an open stage can be read, and collects what is mended, left out or refused.

    Args:
        stage: the open stage.
        frame: as for `read_scene`.
        camera: as for `read_scene`.
        purposes: as for `read_scene`.
        strict: True where what would be mended or left out is among the refusals.

    Returns:
        All that could be read, with one entry for each refusal and each warning.

    Raises:
        SceneError: for what is asked for and is not there.
    """
    schema.register()
    choices = Choices(camera, frame, purposes, strict=strict)
    with listening() as heard:
        return _read(stage, _source(stage), choices, heard, refusals=[])[0]


def stage_context(stage: Usd.Stage, frame: Frame | None = None, policy: Policy | None = None) -> StageContext:
    """What `read_stage` reads a stage in where nothing else is asked for."""
    time = _time_code(stage, frame)
    return StageContext(stage=stage, time=time, purposes=DEFAULT_PURPOSES, policy=policy or Policy())


@np.errstate(all="ignore")  # What overflows is found where it is not finite.
def _read(
    stage: Usd.Stage,
    source: str,
    choices: Choices,
    heard: Heard,
    refusals: list[FgfError] | None = None,
) -> tuple[StageSurvey, StageContext]:
    """Reads a stage; the first refusal is raised where they are not collected in `refusals`."""
    context = StageContext(
        stage=stage,
        time=_time_code(stage, choices.frame),
        purposes=DEFAULT_PURPOSES,
        refinement=_refinement(choices.complexity),
        policy=Policy(strict=choices.strict, refusals=refusals, asked_for=choices.asked_for),
    )
    with context.going_on():
        leave_out_what_is_missing(context)
    with context.going_on():
        check_metadata(context, needs_start=choices.frame is None)
    settings = StageSettings()
    with context.going_on():
        settings = read_settings(context, choices.render_settings)
    product = settings.product(choices.product)
    purposes = next(asked for asked in (choices.purposes, settings.purposes, DEFAULT_PURPOSES) if asked is not None)
    context = replace(context, purposes=_checked(purposes))
    view = None
    with context.going_on():
        view = _View.of(context, choices.camera, product)
        context = replace(context, shutter=view.shutter)
    materials = MaterialReader(context)
    shapes, lights = _read_prims(context, materials)
    camera = None
    if view is not None:
        with context.going_on():
            camera = view.camera(context, shapes)
    if not shapes and not refusals:
        context.notes.add("no geometry: only the lights are seen; a medium needs a closed shape that it is bound to")
    if _is_dark(lights, shapes):
        if not refusals:
            context.notes.add("no light: a dim environment and a light from beside the camera are used")
        lights = [DEFAULT_DOME] if camera is None else [*default_lights(camera)]
    scene = None
    with context.going_on():
        unit = meters_per_unit(context)
        if camera is not None:
            scene = Scene(
                camera=as_asked(camera, product),
                shapes=tuple(shapes),
                media=materials.media,
                lights=tuple(lights),
                meters_per_unit=unit,
                source=source,
            )
            _note_law_warnings(context, scene)
    with context.going_on():
        tell_of_no_text(heard, context)
    note_warnings(heard, context.notes, stage)
    reading = None
    if scene is not None and not refusals:
        reading = StageReading(scene, product.resolution, context.notes.texts(), product.sources, context.up_axis)
    survey = StageSurvey(
        tuple(shapes),
        materials.media,
        tuple(lights),
        camera,
        tuple(refusals or ()),
        context.notes.entries(),
        reading,
    )
    return survey, context


@dataclass(frozen=True)
class _View:
    """The prim that is looked through, or None for a view from the front; when its shutter is open; who chose it."""

    prim: Usd.Prim | None
    shutter: tuple[Usd.TimeCode, Usd.TimeCode] | None
    is_asked_for: bool

    @classmethod
    def of(cls, context: StageContext, asked: str | None, product: Product) -> _View:
        prim = choose_camera(context, asked, product.camera)
        shutter = read_shutter(prim, context) if prim and product.has_motion_blur else None
        return cls(prim, shutter, asked is not None)

    def camera(self, context: StageContext, shapes: Sequence[Shape]) -> Camera:
        if self.prim is None:
            context.notes.add("no camera: the view is from the front and holds everything")
        elif self.is_asked_for:
            return self._read(self.prim, context, shapes)
        else:
            with context.leaving_out(self.prim.GetPath(), "the view is from the front and holds everything"):
                return self._read(self.prim, context, shapes)
        return default_camera(shapes, context.up_axis)

    @staticmethod
    def _read(prim: Usd.Prim, context: StageContext, shapes: Sequence[Shape]) -> Camera:
        camera = read_camera(prim, context)
        note_clipped(camera, shapes, context)
        return camera


def _whole(survey: StageSurvey) -> StageReading:
    if survey.reading is None:
        raise AssertionError("what refuses a stage is raised where it is not collected")
    return survey.reading


def _source(stage: Usd.Stage) -> str:
    """What a stage that was opened by someone else is called in messages."""
    layer = stage.GetRootLayer()
    return (layer.GetDisplayName() if layer.anonymous else layer.identifier) or "stage"


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
            if met.has_purpose and not emits and not _read_shape(met, shapes, materials, context):
                context.notes.add(f"{prim.GetTypeName()} is not supported and is left out", prim.GetPath())
    placed = shapes.shapes()
    linked_lights, linked_shapes = [light for _, light in lights], [shape for _, shape in placed]
    with context.going_on():
        linked_lights, linked_shapes = link_lights(lights, placed, context)
    return linked_shapes, linked_lights


def _read_shape(met: Met, shapes: ShapeReader, materials: MaterialReader, context: StageContext) -> bool:
    """Reads a prim that may be a shape; False where it draws something that is not supported."""
    prim = met.prim
    with context.leaving_out(prim.GetPath(), "the shape is left out", lambda: materials.bounds_medium(prim)):
        return shapes.read(met) or not _is_unsupported(prim)
    return True


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


def _time_code(stage: Usd.Stage, frame: Frame | None) -> Usd.TimeCode:
    if frame == "default":
        return Usd.TimeCode.Default()
    if frame is not None:
        if not math.isfinite(frame):
            raise SceneError(f"frame = {frame:g}; accepted: a finite number")
        return Usd.TimeCode(frame)
    return start_of(stage)


def _refinement(complexity: str) -> int:
    if complexity not in COMPLEXITIES:
        raise SceneError(f"complexity = {complexity}; accepted: {', '.join(COMPLEXITIES)}")
    return COMPLEXITIES.index(complexity)


def _checked(purposes: Collection[str]) -> frozenset[str]:
    unknown = sorted(set(purposes) - set(PURPOSES))
    if unknown:
        raise SceneError(f"purposes = {', '.join(unknown)}; accepted: {', '.join(PURPOSES)}")
    return frozenset(purposes)
