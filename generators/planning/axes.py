"""The values that an axis takes.

| form | values |
|---|---|
| ``[a, b, c]`` or ``{values: [a, b, c]}`` | as listed; numbers, or names of what has names |
| ``{linspace: [start, stop, n]}`` | n values at equal distances, ends included |
| ``{logspace: [start, stop, n]}`` | n values at equal ratios, ends included; start and stop are the values themselves |
| ``{geometric: [first, ratio, n]}`` | n values, each the one before times the ratio |
| ``{uniform: [low, high]}`` | drawn anew for each sample, evenly in the value |
| ``{loguniform: [low, high]}`` | drawn anew for each sample, evenly in the logarithm |
| ``{normal: [mean, deviation]}`` | drawn anew for each sample, from a normal distribution |
| ``{expression: "2 * S_w"}`` | follows from the other axes, see `generators.planning.expressions` |

Spaced values are rounded to 12 digits, so that a step from -0.7 to -0.1 meets -0.5 itself: H = -0.5 is white noise,
and its nearest neighbour among the doubles is not.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, GetJsonSchemaHandler, model_validator
from pydantic_core import CoreSchema, PydanticCustomError
from scipy.special import ndtri

GRID_FORMS = ("values", "linspace", "logspace", "geometric")
RANDOM_FORMS = ("uniform", "loguniform", "normal")
AXIS_FORMS = (*GRID_FORMS, *RANDOM_FORMS, "expression")
SPACING_DIGITS = 12
"""Of spaced values: far below what a picture shows, far above the rounding of the spacing."""

VALUES_MAX = 1_000_000
"""Of an axis, as many as a dataset may have samples; known before one is made."""
NUMBER_MAX = 1e100
"""Of an axis, in size: far beyond what a scene takes, and far from where a span or a ratio is no double."""

Count = Annotated[int, Field(ge=1)]
# A YAML sequence is a list; not being strict about the sequence leaves its items strict.
Number = Annotated[float, Field(ge=-NUMBER_MAX, le=NUMBER_MAX)]
Spacing = Annotated[tuple[Number, Number, Annotated[int, Field(ge=1, le=VALUES_MAX)]], Field(strict=False)]
Pair = Annotated[tuple[Number, Number], Field(strict=False)]


def _number_or_name(found: Any) -> float | str:
    if isinstance(found, str):
        return found
    if isinstance(found, bool) or not isinstance(found, int | float):
        raise PydanticCustomError("axis_value", "a number or a name")
    if not math.isfinite(found):
        raise PydanticCustomError("axis_value", "a finite number")
    return float(found)


Value = Annotated[float | str, BeforeValidator(_number_or_name, json_schema_input_type=float | str)]


class Model(BaseModel):
    """A part of a config: only the keys it knows, and values of their own types."""

    # Strict: "0.5" in quotes or `true` for a number is a slip of the pen.
    model_config = ConfigDict(
        extra="forbid", strict=True, allow_inf_nan=False, frozen=True, use_attribute_docstrings=True
    )


class GridConfig(Model):
    """Values in order; the module's table lists the forms."""

    values: Annotated[list[Value], Field(min_length=1)] | None = None
    """As listed."""
    linspace: Spacing | None = None
    """[start, stop, n]: n values at equal distances, ends included."""
    logspace: Spacing | None = None
    """[start, stop, n]: n values at equal ratios, ends included."""
    geometric: Spacing | None = None
    """[first, ratio, n]: n values, each the one before times the ratio."""

    @model_validator(mode="before")
    @classmethod
    def _accept_list(cls, found: Any) -> Any:
        if isinstance(found, list):
            return {"values": found}
        if not isinstance(found, dict):
            raise PydanticCustomError("axis_form", f"a list of numbers, or one of {', '.join(cls._forms())}")
        return found

    @model_validator(mode="after")
    def _check_form(self) -> GridConfig:
        if sum(getattr(self, form) is not None for form in self._forms()) != 1:
            raise PydanticCustomError("axis_form", f"exactly one of {', '.join(self._forms())}")
        for form in ("logspace", "loguniform", "geometric"):
            bounds = getattr(self, form, None)
            if bounds is not None and min(bounds[:2]) <= 0:
                named = "first and ratio" if form == "geometric" else "both ends"
                raise PydanticCustomError("axis_positive", f"{form} with {named} > 0")
            if bounds is not None and form != "geometric" and not min(bounds[:2]) >= 1 / NUMBER_MAX:
                raise PydanticCustomError("axis_small", f"{form} with both ends >= {1 / NUMBER_MAX:g}")
        if self.geometric is not None:
            first, ratio, count = self.geometric
            if abs(math.log(first) + (count - 1) * math.log(ratio)) > math.log(NUMBER_MAX):
                last = f"a last value from {1 / NUMBER_MAX:g} to {NUMBER_MAX:g}"
                raise PydanticCustomError("axis_last", f"geometric with {last}")
        return self

    @classmethod
    def _forms(cls) -> tuple[str, ...]:
        return tuple(form for form in AXIS_FORMS if form in cls.model_fields)

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """A list may stand in the place of the keys."""
        as_keys = handler.resolve_ref_schema(handler(core))
        listed = {"type": "array", "minItems": 1, "items": {"type": ["number", "string"]}}
        return {"description": as_keys.pop("description", ""), "anyOf": [listed, as_keys]}

    @property
    def count(self) -> int:
        """Number of values of an axis on the grid, without making them."""
        if self.values is not None:
            return len(self.values)
        spacing = self.linspace or self.logspace or self.geometric
        assert spacing is not None
        return spacing[2]

    def grid_values(self) -> tuple[float | str, ...]:
        """The values of an axis on the grid, in order.

        Returns:
            Numbers in the unit of the axis, rounded to what tells them apart, or names.
        """
        if self.values is not None:
            return tuple(self.values)
        if self.linspace is not None:
            # Near zero the rounding left by the spacing is relative to the span, not to the value.
            values = np.linspace(*self.linspace)
            negligible = 1e-12 * abs(self.linspace[1] - self.linspace[0])
            return _rounded(np.where(np.abs(values) < negligible, 0.0, values), *self.linspace[:2])
        if self.logspace is not None:
            return _rounded(np.geomspace(*self.logspace), *self.logspace[:2])
        assert self.geometric is not None
        first, ratio, count = self.geometric
        return _rounded(first * ratio ** np.arange(count), first)


class AxisConfig(GridConfig):
    """What one axis changes and the values it takes."""

    target: str | None = None
    """What it changes: H and the like of the swept medium, /World/Key.inputs:intensity, /World/Camera.focalLength,
    /World/Ball.xformOp:translate[0], or a variant set /World/Ball{look}. Not needed where the axis' name says it."""
    uniform: Pair | None = None
    """[low, high]: drawn anew for each sample, evenly in the value."""
    loguniform: Pair | None = None
    """[low, high]: drawn anew for each sample, evenly in the logarithm."""
    normal: Pair | None = None
    """[mean, deviation]: drawn anew for each sample, from a normal distribution."""
    expression: str | None = None
    """Follows from other axes, such as 2 * S_w."""

    @model_validator(mode="after")
    def _check_draw(self) -> AxisConfig:
        for form in ("uniform", "loguniform"):
            bounds = getattr(self, form)
            if bounds is not None and not bounds[0] < bounds[1]:
                raise PydanticCustomError("axis_order", f"{form}: [low, high] with low < high")
        if self.normal is not None and not self.normal[1] > 0:
            raise PydanticCustomError("axis_deviation", "normal: [mean, deviation] with a deviation > 0")
        return self

    @property
    def is_random(self) -> bool:
        """True where each sample draws its own value."""
        return any(getattr(self, form) is not None for form in RANDOM_FORMS)

    @property
    def is_on_grid(self) -> bool:
        """True where its values are laid out in order."""
        return not self.is_random and self.expression is None

    def value_at(self, quantile: float) -> float:
        """The value of a random axis below which a share `quantile` in [0, 1) of all draws lies.

        Returns:
            A finite number in the unit of the axis.
        """
        if self.uniform is not None:
            low, high = self.uniform
            return low + (high - low) * quantile
        if self.loguniform is not None:
            low, high = self.loguniform
            return low * math.exp(quantile * math.log(high / low))
        assert self.normal is not None
        mean, deviation = self.normal
        # Half of the quantiles' step: 0 has a finite value too.
        return float(mean + deviation * ndtri(quantile + 2.0**-54))


def _rounded(values: np.ndarray, first: float, last: float | None = None) -> tuple[float, ...]:
    """Spaced values at 12 digits; the ends as they were written."""
    found = [float(f"{value:.{SPACING_DIGITS}g}") for value in values]
    found[0] = float(first)
    if len(found) > 1 and last is not None:
        found[-1] = float(last)
    return tuple(found)
