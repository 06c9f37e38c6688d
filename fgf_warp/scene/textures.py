"""Pictures, and how a material's input is read from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fgf_warp.errors import SceneError
from fgf_warp.scene.checks import check_choice
from fgf_warp.scene.values import Vec3, Vec4

Wrap = Literal["black", "clamp", "repeat", "mirror"]
WRAPS: tuple[Wrap, ...] = ("black", "clamp", "repeat", "mirror")

IDENTITY_ST = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""The transform of a `TextureInput` that leaves s and t as they are."""


@dataclass(frozen=True, eq=False)
class Image:
    """A picture that textures read.

    Args:
        name: the asset path, for messages.
        pixels: (height, width, 4) RGBA, the first row at the top; uint8, where 255 stands for 1, or float32.
        is_srgb: True where R, G and B are encoded by the transfer function of sRGB (uint8 only), else linear.

    Raises:
        SceneError: for another shape or type, or float32 pixels that are said to be encoded.
    """

    name: str
    pixels: np.ndarray
    is_srgb: bool = False

    def __post_init__(self) -> None:
        if self.pixels.ndim != 3 or self.pixels.shape[2] != 4 or not self.pixels.size:
            raise SceneError(f"{self.name}: pixels have the shape {self.pixels.shape}; accepted: (height, width, 4)")
        if self.pixels.dtype not in (np.uint8, np.float32):
            raise SceneError(f"{self.name}: pixels are {self.pixels.dtype}; accepted: uint8 and float32")
        if self.is_srgb and self.pixels.dtype != np.uint8:
            raise SceneError(f"{self.name}: float32 pixels are linear; accepted: is_srgb of uint8 pixels")


@dataclass(frozen=True, eq=False)
class Texture:
    """One image, or the tiles of a UDIM set, over the plane of texture coordinates; bilinear.

    Args:
        tiles: the image of each unit square (u, v) of texture coordinates; of a plain texture {(0, 0): image}.
        is_udim: True where each tile fills its own square and nothing is wrapped; beyond them the fallback is shown.
        wrap_s: what is shown beyond the unit square in s, of a plain texture.
        wrap_t: the same in t.
        fallback: RGBA where there is no image or no tile.

    Raises:
        SceneError: for a wrap that is none of `WRAPS`.
    """

    tiles: Mapping[tuple[int, int], Image]
    is_udim: bool = False
    wrap_s: Wrap = "repeat"
    wrap_t: Wrap = "repeat"
    fallback: Vec4 = (0.0, 0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        for key, wrap in (("wrap_s", self.wrap_s), ("wrap_t", self.wrap_t)):
            check_choice("texture", key, wrap, WRAPS)


@dataclass(frozen=True, eq=False)
class TextureInput:
    """A material's input that is read from a texture: channels of scale * texel + bias.

    Args:
        texture: where it is read from.
        primvar: name of the texture coordinates, empty for none; a shape that has none of that name is read at `st`.
        st: texture coordinates of such shapes.
        transform: two rows of three, applied to (s, t, 1).
        channels: ``rgb``, or one of ``r``, ``g``, ``b`` and ``a``.
        scale: of R, G, B and A.
        bias: of R, G, B and A.
    """

    texture: Texture
    primvar: str = "st"
    st: tuple[float, float] = (0.0, 0.0)
    transform: tuple[Vec3, Vec3] = IDENTITY_ST
    channels: Literal["rgb", "r", "g", "b", "a"] = "rgb"
    scale: Vec4 = (1.0, 1.0, 1.0, 1.0)
    bias: Vec4 = (0.0, 0.0, 0.0, 0.0)
