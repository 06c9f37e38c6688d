"""FgfMediumAPI: the medium that a material stands for."""

from __future__ import annotations

import difflib
from typing import Any

from pxr import Usd

from fgf_warp.errors import SceneError
from fgf_warp.scene import LINE_VARIANCES, PHASE_FUNCTIONS, TRANSPORTS, Medium
from usd_scenes import schema
from usd_scenes.reader.attributes import is_authored, plain_source, read_color, read_number, read_token
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

    Raises:
        SceneError: for an unknown fgf attribute, or a value out of its range.
    """
    _refuse_unknown_attributes(material)
    values: dict[str, Any] = {}
    for field, name in schema.MEDIUM_ATTRIBUTES.items():
        attribute = material.GetAttribute(name)
        if field in ONLY_WHERE_AUTHORED and not is_authored(attribute):
            continue
        values[field] = _read_field(field, _source(attribute, context), context.time)
    path = str(material.GetPath())
    try:
        return Medium(name=path, **values)
    except SceneError as error:
        raise SceneError(_with_attribute(path, str(error))) from error


def ends_in_surface(material: Usd.Prim, context: StageContext) -> bool:
    """True where the material's surface bounds the medium, False where nothing does.

    Raises:
        SceneError: for an unknown kind of boundary.
    """
    attribute = material.GetAttribute(schema.BOUNDARY_ATTRIBUTE)
    return read_token(attribute, context.time, schema.BOUNDARIES) == "surface"


def _read_field(field: str, attribute: Usd.Attribute, time: Usd.TimeCode) -> object:
    if field in COLORS:
        return read_color(attribute, time)
    if field in TOKENS:
        return read_token(attribute, time, TOKENS[field])
    if field == "priority":
        return int(read_number(attribute, time, accepted="an integer", holds=float.is_integer))
    return read_number(attribute, time)


def _source(attribute: Usd.Attribute, context: StageContext) -> Usd.Attribute:
    source = plain_source(attribute)
    if source is None:
        context.notes.add(
            "connection to a shader is not followed: the attribute's own value is used", attribute.GetPath()
        )
        return attribute
    return source


def _refuse_unknown_attributes(material: Usd.Prim) -> None:
    known = {*schema.MEDIUM_ATTRIBUTES.values(), schema.BOUNDARY_ATTRIBUTE}
    authored = material.GetPropertiesInNamespace("inputs:fgf") + material.GetPropertiesInNamespace("fgf")
    for attribute in authored:
        if (name := attribute.GetName()) not in known:
            nearest = difflib.get_close_matches(name, known, n=1)
            meant = f", maybe {nearest[0]} is meant" if nearest else ""
            raise SceneError(f"{attribute.GetPath()} is unknown{meant}; accepted: {', '.join(sorted(known))}")


def _with_attribute(path: str, message: str) -> str:
    """The message of `Medium` with the attribute that it is about behind the prim path."""
    text = message.removeprefix(f"{path}: ")
    symbol = text.split()[0]
    attribute = schema.MEDIUM_ATTRIBUTES.get(SYMBOLS.get(symbol, symbol))
    return f"{path}.{attribute}: {text}" if attribute else message
