"""UsdUVTexture: which images it reads, and where."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
from pxr import UsdShade

from fgf_warp.scene import WRAPS, Image, Texture, TextureInput, Vec3, Vec4, Wrap
from usd_scenes.reader.attributes import (
    FINITE,
    Range,
    is_authored,
    read_mended,
    read_mended_token,
    read_mended_vector,
)
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.images import COLOR_SPACES, ColorSpace, ImageFile
from usd_scenes.reader.shading_network import Output, ignore, primvar_name, source_of, value_of
from usd_scenes.reader.textures import is_udim, read_image, read_tiles

Channels = Literal["rgb", "r", "g", "b", "a"]
KIND = "UsdUVTexture"
CHANNELS = ("r", "g", "b", "a")
NORMAL_SCALE = (2.0, 2.0, 2.0)
NORMAL_BIAS = (-1.0, -1.0, -1.0)
"""Take the texels of a normal map from [0, 1] to [-1, 1]."""
FALLBACK = (0.0, 0.0, 0.0, 1.0)
OTHER_COLOR_SPACES = {
    "srgbtexture": "sRGB",
    "srgbrec709scene": "sRGB",
    "srgbrec709display": "sRGB",
    "linear": "raw",
    "linrec709": "raw",
    "linrec709scene": "raw",
    "linsrgb": "raw",
    "data": "raw",
    "noncolor": "raw",
}
"""What color configurations call the spaces that a UsdUVTexture names otherwise."""
OTHER_WRAPS = {"clamptoedge": "clamp", "clamptoborder": "black", "mirroredrepeat": "mirror", "periodic": "repeat"}
"""What OpenGL and OpenImageIO call the ways to wrap."""


def _squares() -> Image:
    pixels = np.zeros((64, 64, 4), dtype=np.uint8)
    pixels[(np.indices((64, 64)) // 8).sum(axis=0) % 2 == 0] = (255, 0, 255, 0)
    pixels[..., 3] = 255
    return Image("a texture that is missing", pixels)


MISSING = Texture({(0, 0): _squares()})
"""Magenta and black squares, which stand for a texture of colors that cannot be read and has no fallback."""


def read_texture_input(output: Output, context: StageContext, done: str) -> TextureInput | None:
    """An output of a UsdUVTexture; None, with a warning, where none of its images can be read.

    Args:
        output: of the texture.
        context: the stage.
        done: what is done without a picture, for the warning.

    Returns:
        The pictures, and how texels become values: channels, scale and bias, and where the texture is read.

    Raises:
        SceneError: in place of a warning, where the stage is read strictly.
    """
    files = _files(output.shader, context, done)
    return _texture_input(output, _texture(output.shader, files, context), context) if files else None


def constant_alpha(texture_input: TextureInput) -> float | None:
    """The one value that the alpha of opaque pictures comes to; None where it may vary.

    Opacity is often connected to the alpha of a picture that has none. A surface that is known to be opaque takes far
    less time.

    Returns:
        Scale plus bias of the alpha, since the alpha of an opaque picture is 1.
    """
    texture = texture_input.texture
    has_bounds = texture.is_udim or "black" in (texture.wrap_s, texture.wrap_t)
    if texture_input.channels != "a" or has_bounds:
        return None
    (image,) = texture.tiles.values()
    is_opaque = bool((image.pixels[..., 3] == (255 if image.pixels.dtype == np.uint8 else 1)).all())
    return texture_input.scale[3] + texture_input.bias[3] if is_opaque else None


def read_fallback(output: Output, accepted: Range, context: StageContext) -> tuple[float, ...] | None:
    """What the output is where no image can be read: three numbers or one; None where no fallback is authored.

    Args:
        output: of the texture.
        accepted: numbers of the input that it is connected to; what is out of them is mended.
        context: the stage.

    Returns:
        The numbers after scale and bias, mended into the accepted range.
    """
    attribute = value_of(output.shader, "fallback", context)
    if not attribute or not is_authored(attribute):
        return None
    rgba = [
        value * scale + bias
        for value, scale, bias in zip(
            read_mended_vector(attribute, context, FALLBACK), *_scale_and_bias(output.shader, context), strict=True
        )
    ]
    found = rgba[:3] if output.name == "rgb" else [rgba[CHANNELS.index(output.name)]]
    used = tuple(number if near is None else near for number in found for near in [accepted.nearest(number)])
    if used != tuple(found):
        text = f"scale * fallback + bias is out of {accepted.words} and is cut to it"
        context.mend(text, attribute.GetPath())
    return used


def missing_colors(output: Output, context: StageContext) -> TextureInput:
    """The texture that stands for one of colors that is missing, where that would be."""
    return TextureInput(MISSING, **vars(_coordinates(output.shader, context)))


def read_normal_map(output: Output, context: StageContext) -> TextureInput | None:
    """As `read_texture_input`, with warnings where the texels cannot be meant as normals.

    Raises:
        SceneError: as `read_texture_input`.
    """
    files = _files(output.shader, context, "the shape's own normals are used")
    if not files:
        return None
    normals = _texture_input(output, _texture(output.shader, files, context), context)
    path = output.shader.GetPath()
    if any(file.is_encoded for file in files.values()):
        context.notes.add("a normal map is read as sRGB, which bends normals: sourceColorSpace should be raw", path)
    is_usual = normals.scale[:3] == NORMAL_SCALE and normals.bias[:3] == NORMAL_BIAS
    if not is_usual and any(file.image.pixels.dtype == np.uint8 for file in files.values()):
        text = "a normal map of 8 bits without scale = (2, 2, 2, 1) and bias = (-1, -1, -1, 0) holds no such normals"
        context.notes.add(text, path)
    return normals


def _files(shader: UsdShade.Shader, context: StageContext, done: str) -> Mapping[tuple[int, int], ImageFile]:
    attribute = value_of(shader, "file", context)
    if not attribute:
        context.mend(f"names no picture; {done}", f"{shader.GetPath()}.inputs:file")
        return {}
    space = value_of(shader, "sourceColorSpace", context)
    color_space = cast(ColorSpace, read_mended_token(space, context, COLOR_SPACES, "auto", OTHER_COLOR_SPACES))
    if is_udim(attribute, context.time):
        return read_tiles(attribute, context, color_space, done)
    file = read_image(attribute, context, color_space, done)
    return {(0, 0): file} if file else {}


def _texture(shader: UsdShade.Shader, files: Mapping[tuple[int, int], ImageFile], context: StageContext) -> Texture:
    r, g, b, a = read_mended_vector(value_of(shader, "fallback", context), context, FALLBACK)
    wrap_s, wrap_t = (
        _wrap(shader, name, of_file, context)
        for name, of_file in zip(("wrapS", "wrapT"), next(iter(files.values())).wraps, strict=True)
    )
    return Texture(
        tiles={place: file.image for place, file in files.items()},
        is_udim=is_udim(value_of(shader, "file", context), context.time),
        wrap_s=wrap_s,
        wrap_t=wrap_t,
        fallback=(r, g, b, a),
    )


def _wrap(shader: UsdShade.Shader, name: str, of_file: Wrap | None, context: StageContext) -> Wrap:
    accepted = (*WRAPS, "useMetadata")
    token = read_mended_token(value_of(shader, name, context), context, accepted, "useMetadata", OTHER_WRAPS)
    return next((wrap for wrap in WRAPS if wrap == token), of_file or "black")


def _texture_input(output: Output, texture: Texture, context: StageContext) -> TextureInput:
    scale, bias = _scale_and_bias(output.shader, context)
    channels = cast(Channels, output.name)
    return TextureInput(
        texture, channels=channels, scale=scale, bias=bias, **vars(_coordinates(output.shader, context))
    )


def _scale_and_bias(shader: UsdShade.Shader, context: StageContext) -> tuple[Vec4, Vec4]:
    scale = read_mended_vector(value_of(shader, "scale", context), context, (1.0, 1.0, 1.0, 1.0))
    bias = read_mended_vector(value_of(shader, "bias", context), context, (0.0, 0.0, 0.0, 0.0))
    return cast(Vec4, scale), cast(Vec4, bias)


@dataclass(frozen=True)
class _Coordinates:
    """Where a texture is read, as `TextureInput` says."""

    primvar: str
    st: tuple[float, float]
    transform: tuple[Vec3, Vec3]


def _coordinates(texture: UsdShade.Shader, context: StageContext) -> _Coordinates:
    shader, name, to_texture, passed = texture, "st", np.eye(3), {texture.GetPath()}
    while True:
        source = source_of(shader, name, context)
        is_new = isinstance(source, Output) and source.shader.GetPath() not in passed
        if not (isinstance(source, Output) and source.kind == "UsdTransform2d" and is_new):
            break
        shader, name, to_texture = source.shader, "in", to_texture @ _transform_2d(source.shader, context)
        passed.add(shader.GetPath())
    primvar, value = "", source
    if isinstance(source, Output):
        if source.kind == "UsdPrimvarReader_float2":
            primvar, value = primvar_name(source.shader, context), value_of(source.shader, "fallback", context)
        else:
            value = ignore(source, shader, name, context)
    elif not source:
        context.notes.add("texture without texture coordinates shows one texel", texture.GetPath())
    s, t = read_mended_vector(value, context, (0.0, 0.0))
    first, second = (cast(Vec3, tuple(map(float, row))) for row in to_texture[:2])
    return _Coordinates(primvar, (s, t), (first, second))


def _transform_2d(shader: UsdShade.Shader, context: StageContext) -> np.ndarray:
    """(3, 3) of a UsdTransform2d, which scales, then turns, then moves."""
    angle = math.radians(read_mended(value_of(shader, "rotation", context), context, FINITE, 0.0))
    scale_s, scale_t = read_mended_vector(value_of(shader, "scale", context), context, (1.0, 1.0))
    move_s, move_t = read_mended_vector(value_of(shader, "translation", context), context, (0.0, 0.0))
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos * scale_s, -sin * scale_t, move_s], [sin * scale_s, cos * scale_t, move_t], [0.0, 0.0, 1.0]])
