"""FgfMediumAPI: the medium that a material stands for."""

from __future__ import annotations

import difflib
from typing import Any

from pxr import Usd

from fgf_warp.errors import MediumError, SceneError
from fgf_warp.scene import LINE_VARIANCES, PHASE_FUNCTIONS, TRANSPORTS, Medium
from usd_scenes import schema
from usd_scenes.reader.attributes import WHOLE, is_authored, plain_source, read_color, read_number, read_token
from usd_scenes.reader.context import StageContext

COLORS = ("extinction_color", "albedo")
TOKENS: dict[str, tuple[str, ...]] = {
    "transport": TRANSPORTS,
    "line_variance": LINE_VARIANCES,
    "phase_function": PHASE_FUNCTIONS,
}
ONLY_WHERE_AUTHORED = ("outer_scale", "kappa")
SYMBOLS = {
    "sigma_m": "mean_extinction",
    "g": "asymmetry",
    "H": "hurst",
    "S_w": "white_noise_scale",
    "L": "outer_scale",
}
"""How messages of `Medium` begin, where that is not the name of a field."""


def has_medium(material: Usd.Prim, context: StageContext) -> bool:
    """True where FgfMediumAPI is applied; a warning where only its attributes are authored."""
    if schema.SCHEMA_NAME in material.GetAppliedSchemas():
        return True
    if material.GetPropertiesInNamespace("inputs:fgf") or material.GetPropertiesInNamespace("fgf"):
        context.notes.add(f"fgf attributes without {schema.SCHEMA_NAME} applied make no medium", material.GetPath())
    return False


def read_medium(material: Usd.Prim, context: StageContext) -> Medium:
    """The medium of a material that FgfMediumAPI is applied to.

    Returns:
        Of the name of its material, with parameters as authored, see `fgf_warp.scene.Medium` for their units and
        ranges.

    Raises:
        MediumError: for an unknown fgf attribute, or a value out of its range.
    """
    values, problems = _read_values(material, context)
    if problems:
        raise MediumError(str(problems[0])) from problems[0]
    return _build(material, values)


def medium_problems(material: Usd.Prim, context: StageContext) -> list[SceneError]:
    """All that is wrong with a medium, of which `read_medium` raises the first; one error per attribute."""
    values, problems = _read_values(material, context)
    while True:
        try:
            _build(material, values)
            return problems
        except SceneError as error:
            problems.append(error)
            field = _blamed_field(str(material.GetPath()), str(error.__cause__))
            # Without the value that is wrong, the next one is seen.
            if values.pop(field, None) is None:
                return problems
            values.setdefault("mean_extinction", 1.0)


def _read_values(material: Usd.Prim, context: StageContext) -> tuple[dict[str, Any], list[SceneError]]:
    """The fields of `Medium` that can be read, and what is wrong with the others."""
    values: dict[str, Any] = {}
    problems = _unknown_attributes(material)
    for field, name in schema.MEDIUM_ATTRIBUTES.items():
        attribute = material.GetAttribute(name)
        if field in ONLY_WHERE_AUTHORED and not is_authored(attribute):
            continue
        try:
            values[field] = _read_field(field, _source(attribute, context), context.time)
        except SceneError as error:
            problems.append(error)
    return {"mean_extinction": 1.0, **values}, problems


def _build(material: Usd.Prim, values: dict[str, Any]) -> Medium:
    path = str(material.GetPath())
    try:
        return Medium(name=path, **values)
    except SceneError as error:
        raise MediumError(_with_attribute(path, str(error))) from error


def ends_in_surface(material: Usd.Prim, context: StageContext) -> bool:
    """True where the material's surface bounds the medium, False where nothing does.

    Raises:
        MediumError: for an unknown kind of boundary.
    """
    attribute = material.GetAttribute(schema.BOUNDARY_ATTRIBUTE)
    try:
        return read_token(attribute, context.time, schema.BOUNDARIES) == "surface"
    except SceneError as error:
        raise MediumError(str(error)) from error


def _read_field(field: str, attribute: Usd.Attribute, time: Usd.TimeCode) -> object:
    if field in COLORS:
        return read_color(attribute, time)
    if field in TOKENS:
        return read_token(attribute, time, TOKENS[field])
    if field == "priority":
        return int(read_number(attribute, time, WHOLE))
    return read_number(attribute, time)


def _source(attribute: Usd.Attribute, context: StageContext) -> Usd.Attribute:
    source = plain_source(attribute)
    if source is None:
        context.notes.add(
            "connection to a shader is not followed: the attribute's own value is used", attribute.GetPath()
        )
        return attribute
    return source


def _unknown_attributes(material: Usd.Prim) -> list[SceneError]:
    known = {*schema.MEDIUM_ATTRIBUTES.values(), schema.BOUNDARY_ATTRIBUTE}
    authored = material.GetPropertiesInNamespace("inputs:fgf") + material.GetPropertiesInNamespace("fgf")
    return [
        SceneError(
            f"{attribute.GetPath()} is unknown{_suggestion(attribute.GetName(), known)}; "
            f"accepted: {', '.join(sorted(known))}"
        )
        for attribute in authored
        if attribute.GetName() not in known
    ]


def _suggestion(name: str, known: set[str]) -> str:
    by_last_word = {accepted.rpartition(":")[2]: accepted for accepted in known}
    nearest = difflib.get_close_matches(name.rpartition(":")[2], by_last_word, n=1)
    return f", maybe {by_last_word[nearest[0]]} is meant" if nearest else ""


def _with_attribute(path: str, message: str) -> str:
    """The message of `Medium` with the attribute that it is about behind the prim path."""
    attribute = schema.MEDIUM_ATTRIBUTES.get(_blamed_field(path, message))
    return f"{path}.{attribute}: {message.removeprefix(f'{path}: ')}" if attribute else message


def _blamed_field(path: str, message: str) -> str:
    """The field that a message of `Medium` begins with."""
    symbol = message.removeprefix(f"{path}: ").split()[0]
    return SYMBOLS.get(symbol, symbol)
