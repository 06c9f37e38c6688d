"""UsdPreviewSurface: its inputs, as constants, textures and primvars."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from pxr import Usd, UsdShade

from fgf_warp.errors import SceneError
from fgf_warp.scene import BLACK, ColorInput, FloatInput, PrimvarInput, Rgb, Surface, TextureInput
from usd_scenes.reader import uv_texture
from usd_scenes.reader.attributes import (
    FINITE,
    NOT_NEGATIVE,
    POSITIVE,
    UNIT,
    Range,
    read_mended,
    read_mended_color,
    read_mended_token,
)
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.shading_network import Output, ignore, own_attribute, primvar_name, source_of, value_of
from usd_scenes.reader.uv_texture import (
    constant_alpha,
    missing_colors,
    read_fallback,
    read_normal_map,
    read_texture_input,
)

T = TypeVar("T", float, Rgb)

KIND = "UsdPreviewSurface"
DIFFUSE: Rgb = (0.18, 0.18, 0.18)
COLOR_READERS = ("UsdPrimvarReader_float3", "UsdPrimvarReader_vector", "UsdPrimvarReader_point")
NUMBER_READERS = ("UsdPrimvarReader_float", "UsdPrimvarReader_int")
UNBENT = (0.0, 0.0, 1.0)
"""The normal, in tangent space, that leaves the shape's own as it is."""
NOT_USED = {"displacement": 0.0, "occlusion": 1.0}
"""Inputs that are not rendered, and the values at which that needs no warning."""


ZERO_OR_ONE = Range("0 or 1", 0.0, 1.0)
FALLBACK_IS_USED, OWN_IS_USED = "its fallback is used", "the input's own value is used"
OPACITY_MODES = ("transparent", "presence")


def read_preview_surface(shader: UsdShade.Shader, context: StageContext) -> Surface:
    """The surface that a UsdPreviewSurface stands for; what is not authored is as its specification says.

    What an input is connected to and cannot be rendered is named in a warning, and the input's own value is used.

    A value out of its range is mended.

    Returns:
        Colors in linear Rec.709; each input is a constant in its range or a texture.

    Raises:
        SceneError: for what is missing or out of its range, where the stage is read strictly.
    """
    _note_what_is_not_used(shader, context)
    has_specular_color = _constant(shader, "useSpecularWorkflow", 0.0, ZERO_OR_ONE, context)
    mode = read_mended_token(value_of(shader, "opacityMode", context), context, OPACITY_MODES, OPACITY_MODES[0])
    values: dict[str, Any] = dict(
        diffuse=_color(shader, "diffuseColor", DIFFUSE, UNIT, context),
        emission=_color(shader, "emissiveColor", BLACK, NOT_NEGATIVE, context),
        specular=_color(shader, "specularColor", BLACK, UNIT, context) if has_specular_color else None,
        metallic=0.0 if has_specular_color else _number(shader, "metallic", 0.0, context),
        roughness=_number(shader, "roughness", 0.5, context),
        clearcoat=_number(shader, "clearcoat", 0.0, context),
        clearcoat_roughness=_number(shader, "clearcoatRoughness", 0.01, context),
        ior=_constant(shader, "ior", 1.5, POSITIVE, context),
        opacity=_number(shader, "opacity", 1.0, context),
        opacity_threshold=_constant(shader, "opacityThreshold", 0.0, UNIT, context),
        is_presence=mode == "presence",
        normal=_normal(shader, context),
    )
    try:
        return Surface(**values)
    except SceneError as error:
        raise SceneError(f"{shader.GetPath()}: {error}") from error


def displaces(shader: UsdShade.Shader, context: StageContext) -> bool:
    """False of what a material's displacement may be connected to without moving anything."""
    return shader.GetShaderId() != KIND or not _is_harmless(shader, "displacement", context)


def _constant(shader: UsdShade.Shader, name: str, default: float, accepted: Range, context: StageContext) -> float:
    return read_mended(value_of(shader, name, context), context, accepted, default)


def _number(shader: UsdShade.Shader, name: str, default: float, context: StageContext) -> FloatInput:
    def read(attribute: Usd.Attribute, default: float) -> float:
        return read_mended(attribute, context, UNIT, default)

    source = source_of(shader, name, context)
    if not isinstance(source, Output):
        return read(source, default)
    if source.kind == uv_texture.KIND and source.name in uv_texture.CHANNELS:
        fallback = read_fallback(source, UNIT, context)
        texture = read_texture_input(source, context, FALLBACK_IS_USED if fallback else OWN_IS_USED)
        if texture:
            alpha = constant_alpha(texture)
            return alpha if alpha is not None and UNIT.holds(alpha) else texture
        return fallback[0] if fallback else read(own_attribute(shader, name), default)
    return _primvar(source, NUMBER_READERS, read, 0.0, context) or read(ignore(source, shader, name, context), default)


def _color(shader: UsdShade.Shader, name: str, default: Rgb, accepted: Range, context: StageContext) -> ColorInput:
    def read(attribute: Usd.Attribute, default: Rgb) -> Rgb:
        return read_mended_color(attribute, context, accepted, default)

    source = source_of(shader, name, context)
    if not isinstance(source, Output):
        return read(source, default)
    if source.kind == uv_texture.KIND and source.name == "rgb":
        fallback = cast(Rgb | None, read_fallback(source, accepted, context))
        done = FALLBACK_IS_USED if fallback else "it is magenta and black squares"
        return read_texture_input(source, context, done) or fallback or missing_colors(source, context)
    return _primvar(source, COLOR_READERS, read, BLACK, context) or read(ignore(source, shader, name, context), default)


def _primvar(
    source: Output, readers: tuple[str, ...], read: Callable[[Usd.Attribute, T], T], default: T, context: StageContext
) -> PrimvarInput | None:
    """What one of these readers gives; None where the source is another, or, with a warning, reads no primvar."""
    name = primvar_name(source.shader, context) if source.kind in readers else ""
    return PrimvarInput(name, read(value_of(source.shader, "fallback", context), default)) if name else None


def _normal(shader: UsdShade.Shader, context: StageContext) -> TextureInput | None:
    source = source_of(shader, "normal", context)
    if isinstance(source, Output) and source.kind == uv_texture.KIND and source.name == "rgb":
        return read_normal_map(source, context)
    if isinstance(source, Output):
        source = ignore(source, shader, "normal", context)
    if read_mended_color(source, context, FINITE, UNBENT) != UNBENT:
        context.notes.add("normals are read from textures only: the shape's own are used", source.GetPath())
    return None


def _note_what_is_not_used(shader: UsdShade.Shader, context: StageContext) -> None:
    for name in NOT_USED:
        if not _is_harmless(shader, name, context):
            context.notes.add(f"{name} is not rendered", f"{shader.GetPath()}.inputs:{name}")


def _is_harmless(shader: UsdShade.Shader, name: str, context: StageContext) -> bool:
    source = source_of(shader, name, context)
    return not isinstance(source, Output) and (not source or source.Get(context.time) in (None, NOT_USED[name]))
