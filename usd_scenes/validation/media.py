"""Checks of single prims: materials with a medium, and the shapes that they are bound to."""

from __future__ import annotations

from pxr import Usd, UsdShade, UsdValidation

from fgf_warp.errors import SceneError
from usd_scenes import schema
from usd_scenes.reader.frames import Frame
from usd_scenes.reader.materials import RENDER_CONTEXT
from usd_scenes.reader.medium import ends_in_surface, medium_problems
from usd_scenes.reader.stage import stage_context
from usd_scenes.validation.findings import error, refusal, warning

CLOSED_SHAPES = ("Sphere", "Cube", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1", "Mesh")
Errors = list[UsdValidation.ValidationError]


def check_values(prim: Usd.Prim, frame: Frame | None = None) -> Errors:
    """That every value of a medium is accepted at a frame; None is where the stage starts."""
    if not _is_medium(prim):
        return []
    problems = medium_problems(prim, stage_context(prim.GetStage(), frame))
    return [refusal("ValueOutOfDomain", prim.GetStage(), str(problem)) for problem in problems]


def check_terminals(prim: Usd.Prim, frame: Frame | None = None) -> Errors:
    """That a material whose values say that it has a medium has one, and its boundary has what it says."""
    if not _is_medium(prim):
        if prim.GetPropertiesInNamespace("inputs:fgf") or prim.GetPropertiesInNamespace("fgf"):
            text = f"fgf attributes make no medium; accepted: {schema.SCHEMA_NAME} in the prim's apiSchemas"
            return [error("UnappliedSchema", prim, text)]
        return []
    found = [
        warning(
            "UnconnectedTerminal", prim, f"{output.GetFullName()} is connected to nothing; accepted: a shader's output"
        )
        for output in UsdShade.Material(prim).GetOutputs()
        if not output.HasConnectedSource()
    ]
    try:
        needs_surface = ends_in_surface(prim, stage_context(prim.GetStage(), frame))
    except SceneError as problem:
        return [*found, refusal("UnknownBoundary", prim.GetStage(), str(problem))]
    if needs_surface and not UsdShade.Material(prim).ComputeSurfaceSource(RENDER_CONTEXT)[0]:
        text = (
            f"{schema.BOUNDARY_ATTRIBUTE} = surface, and the material has none, so that an opaque one in the display "
            f"color hides the medium; accepted: a connected outputs:surface, or {schema.BOUNDARY_ATTRIBUTE} = none"
        )
        found.append(warning("MissingSurface", prim, text))
    return found


def check_binding(prim: Usd.Prim, _frame: Frame | None = None) -> Errors:
    """That a medium is bound to what can be filled."""
    if prim.GetTypeName() in CLOSED_SHAPES or not _is_filled(prim):
        return []
    text = f"a {prim.GetTypeName()} cannot be filled with a medium; accepted: {', '.join(CLOSED_SHAPES)}"
    return [error("NothingToFill", prim, text)]


def _is_filled(prim: Usd.Prim) -> bool:
    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(UsdShade.Tokens.full)[0]
    return bool(material) and _is_medium(material.GetPrim())


def _is_medium(material: Usd.Prim) -> bool:
    return schema.SCHEMA_NAME in material.GetAppliedSchemas()
