"""Checks of the whole stage: that the renderer accepts it, and that its camera, media and lights meet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from pxr import Usd, UsdGeom, UsdShade, UsdValidation

from fgf_warp.errors import FgfError, OpenMeshError, SceneError
from fgf_warp.scene import MAX_CONTAINERS, Camera, Light, bodies_of, encloses, shape_bounds
from usd_scenes import schema
from usd_scenes.reader.readings import StageSurvey
from usd_scenes.reader.stage import survey_stage
from usd_scenes.validation.compartments import (
    Compartment,
    Walls,
    compartment_of,
    compartments_of,
    is_opaque,
    lit_compartments,
)
from usd_scenes.validation.findings import OPEN_MESH, REFUSED, error, info, mended, refusal, warning

DEPTH_MIN, DEPTH_MAX = 1e-4, 1e4
"""Mean optical depths across a medium, beyond which it is clear or opaque whatever else is true of it."""
Errors = Iterator[UsdValidation.ValidationError]


def check_scene(stage: Usd.Stage) -> list[UsdValidation.ValidationError]:
    """What is wrong with the stage as a whole, where it starts."""
    try:
        return check_survey(stage, survey_stage(stage))
    except SceneError as problem:
        return [_refusal(stage, problem)]


def check_survey(stage: Usd.Stage, survey: StageSurvey) -> list[UsdValidation.ValidationError]:
    """What is wrong with what of a stage could be read."""
    checks = (_refusals, _mended, _count, _depths, _unbound, _shadowed, _shut_off)
    return [found for check in checks for found in check(stage, survey)]


def _refusals(stage: Usd.Stage, survey: StageSurvey) -> Errors:
    """A medium that is refused is so for every shape that it is bound to, and is told of once."""
    return (_refusal(stage, problem) for problem in {str(problem): problem for problem in survey.refusals}.values())


def _mended(stage: Usd.Stage, survey: StageSurvey) -> Errors:
    return (mended(stage, text, path) for text, path in survey.warnings)


def _refusal(stage: Usd.Stage, problem: FgfError) -> UsdValidation.ValidationError:
    return refusal(OPEN_MESH if isinstance(problem, OpenMeshError) else REFUSED, stage, str(problem))


def _count(stage: Usd.Stage, survey: StageSurvey) -> Errors:
    count = sum(len(bodies_of(shape)) for shape in survey.shapes if shape.medium is not None)
    if count > MAX_CONTAINERS:
        text = f"{count} shapes are filled with media, each instance by itself; accepted: at most {MAX_CONTAINERS}"
        yield error("TooManyFilledShapes", stage.GetPseudoRoot(), text)


def _depths(stage: Usd.Stage, survey: StageSurvey) -> Errors:
    """Media that are opaque or clear by orders of magnitude, as they are in units that were not meant."""
    for index, medium in enumerate(survey.media):
        extents = [np.ptp(shape_bounds(shape), axis=0).max() for shape in survey.shapes if shape.medium == index]
        extinction = max(law.mean_extinction for law in medium.channel_laws)
        extent = max(extents, default=0.0)
        depth = extinction * extent
        if depth and not DEPTH_MIN <= depth <= DEPTH_MAX:
            name, look = ("OpaqueMedium", "opaque") if depth > DEPTH_MAX else ("ClearMedium", "clear")
            text = (
                f"the mean optical depth across its {extent:.4g} units is {depth:.3g}, {look} by orders of magnitude; "
                f"accepted: [{DEPTH_MIN:g}, {DEPTH_MAX:g}]. sigma_m = {extinction:g} {_unit_hint(stage, extinction)}"
            )
            yield warning(name, _prim(stage, medium.name), text)


def _unit_hint(stage: Usd.Stage, extinction: float) -> str:
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    authored = "" if UsdGeom.StageHasAuthoredMetersPerUnit(stage) else ", which is not authored"
    hint = f"is per stage unit, of {unit:g} m (metersPerUnit{authored})"
    return hint if unit == 1 else f"{hint}; meant per metre, it is {extinction * unit:g} per unit"


def _unbound(stage: Usd.Stage, _survey: StageSurvey) -> Errors:
    prims = list(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()))
    materials = [prim for prim in prims if prim.IsA(UsdShade.Material)]
    media = {_shared_path(prim): prim for prim in materials if schema.SCHEMA_NAME in prim.GetAppliedSchemas()}
    if media:
        drawn = [prim for prim in prims if prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.Subset)]
        for material in UsdShade.MaterialBindingAPI.ComputeBoundMaterials(drawn)[0]:
            if material:
                media.pop(_shared_path(material.GetPrim()), None)
    for prim in media.values():
        yield warning("UnboundMedium", prim, "the medium fills nothing; accepted: bound to a closed shape")


def _shared_path(prim: Usd.Prim) -> object:
    """The same for a material that instances share."""
    return (prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath()


def _shadowed(stage: Usd.Stage, survey: StageSurvey) -> Errors:
    """Media behind boundaries that no light passes."""
    opaque = {shape.medium: shape for shape in survey.shapes if shape.medium is not None and is_opaque(shape)}
    for index, shape in opaque.items():
        text = (
            f"{schema.BOUNDARY_ATTRIBUTE} = surface, and the surface of {shape.name} is opaque: nothing is seen of "
            f"the medium; accepted: an opacity < 1, or {schema.BOUNDARY_ATTRIBUTE} = none"
        )
        yield warning("ShadowedMedium", _prim(stage, survey.media[index].name), text)


def _shut_off(stage: Usd.Stage, survey: StageSurvey) -> Errors:
    """Camera, lights and media that opaque closed shapes part from each other."""
    walls = Walls(survey.shapes)
    lit = lit_compartments(walls, survey.shapes, survey.lights)
    if survey.camera is not None:
        yield from _camera(stage, survey, survey.camera, walls.around(survey.camera.position), lit)
        yield from _lights(stage, survey.lights, walls, walls.around(survey.camera.position))
    yield from _unlit(stage, survey, walls, lit)


def _camera(
    stage: Usd.Stage, survey: StageSurvey, camera: Camera, around: Compartment, lit: set[Compartment]
) -> Errors:
    prim = _prim(stage, camera.name)
    if around not in lit:
        yield warning("UnlitCamera", prim, f"no light reaches the camera, {_behind(around)}")
    for shape in survey.shapes:
        if shape.medium is not None and not is_opaque(shape) and encloses(shape, camera.position):
            text = f"the camera is inside {shape.name}, filled with {survey.media[shape.medium].name}"
            yield info("CameraInMedium", prim, text)


def _lights(stage: Usd.Stage, lights: Sequence[Light], walls: Walls, seen: Compartment) -> Errors:
    for light in lights:
        if hiding := compartment_of(light, walls) - seen:
            yield warning(
                "EnclosedLight", _prim(stage, light.name), f"the camera sees no light of it, {_behind(hiding)}"
            )


def _unlit(stage: Usd.Stage, survey: StageSurvey, walls: Walls, lit: set[Compartment]) -> Errors:
    for index, medium in enumerate(survey.media):
        filled = [shape for shape in survey.shapes if shape.medium == index and not is_opaque(shape)]
        arounds = [compartments_of(shape, walls) for shape in filled]
        if arounds and not any(around & lit for around in arounds):
            text = f"no light reaches the medium in {filled[0].name}, {_behind(min(arounds[0], key=len))}"
            yield warning("UnlitMedium", _prim(stage, medium.name), text)


def _behind(walls: Compartment) -> str:
    found = f"inside {min(walls)}, an opaque closed shape" if walls else "outside of the opaque closed shapes"
    return f"{found}; accepted: a light on the same side of it, or an opacity < 1"


def _prim(stage: Usd.Stage, name: str) -> Usd.Prim:
    """The prim of that path, or the pseudo-root for a part of the scene that is not of the stage."""
    return (stage.GetPrimAtPath(name) if name.startswith("/") else None) or stage.GetPseudoRoot()
