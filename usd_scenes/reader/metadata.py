"""What a stage says of itself as a whole: its unit, which way is up, and when it starts."""

from __future__ import annotations

import math

from pxr import Usd

from usd_scenes.reader.attributes import POSITIVE
from usd_scenes.reader.context import StageContext

UP_AXES = ("Y", "Z")
METERS_PER_UNIT = 0.01
"""USD's fallback."""
STAGE_PATH = "/"
"""In warnings of the whole stage."""


def meters_per_unit(context: StageContext) -> float:
    """Of the stage, > 0; USD's fallback, with a warning, where it is no such number.

    Raises:
        SceneError: in place of the warning, where the stage is read strictly.
    """
    value = context.stage.GetMetadata("metersPerUnit")  # Whatever its type: the function of UsdGeom refuses a float.
    if _is_number(value) and POSITIVE.holds(value):
        return float(value)
    text = f"metersPerUnit = {_shown(value)}; accepted: {POSITIVE.words}; {METERS_PER_UNIT:g} is used"
    context.mend(text, STAGE_PATH)
    return METERS_PER_UNIT


def check_metadata(context: StageContext, needs_start: bool) -> None:
    """Tells of what is mended: the axis that is up, and the start where no frame is asked for.

    Raises:
        SceneError: in place of a warning, where the stage is read strictly.
    """
    axis = context.stage.GetMetadata("upAxis")
    if axis not in UP_AXES:
        accepted = ", ".join(UP_AXES)
        context.mend(f"upAxis = {axis}; accepted: {accepted}; {context.up_axis} is used", STAGE_PATH)
    start = context.stage.GetMetadata("startTimeCode")
    if needs_start and context.stage.HasAuthoredMetadata("startTimeCode") and not _is_number(start):
        text = f"startTimeCode = {_shown(start)}; accepted: a finite number; each attribute's earliest sample is used"
        context.mend(text, STAGE_PATH)


def start_of(stage: Usd.Stage) -> Usd.TimeCode:
    """The stage's authored start, else the time at which each attribute has its earliest sample.

    The default time would leave attributes that have only samples without a value.
    """
    start = stage.GetMetadata("startTimeCode")
    is_given = stage.HasAuthoredMetadata("startTimeCode") and _is_number(start)
    return Usd.TimeCode(float(start)) if is_given else Usd.TimeCode.EarliestTime()


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _shown(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
