"""Textures and their images on their way to the device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from fgf_warp.device import textures
from fgf_warp.scene import WRAPS, Image, Texture
from fgf_warp.upload.arrays import upload_structs


class ImageRows:
    """Images, of which each is there once."""

    def __init__(self) -> None:
        self._images: dict[int, tuple[int, Image]] = {}

    def add(self, image: Image) -> int:
        """Adds an image; returns its index."""
        return self._images.setdefault(id(image), (len(self._images), image))[0]

    def upload(self, device: str) -> Any:
        """The device's `Images`."""
        images = [image for _, image in self._images.values()]
        firsts, counts = [], {True: 0, False: 0}
        for image in images:
            is_float = image.pixels.dtype == np.float32
            firsts.append(counts[is_float])
            counts[is_float] += image.pixels.size // 4
        result = textures.Images()
        result.images = upload_structs(
            textures.Image,
            device,
            first=firsts,
            width=[image.pixels.shape[1] for image in images],
            height=[image.pixels.shape[0] for image in images],
            kind=[_texel_kind(image) for image in images],
        )
        result.texels = wp.array(_texels(images, np.uint8).view("<u4").ravel(), dtype=wp.uint32, device=device)
        result.float_texels = wp.array(_texels(images, np.float32), dtype=wp.vec4, device=device)
        result.decoded = wp.array(decoded_srgb().astype(np.float32), dtype=float, device=device)
        return result


def decoded_srgb() -> np.ndarray:
    """(256,) float64 in [0, 1]: the linear values of the bytes of sRGB (IEC 61966-2-1)."""
    encoded = np.arange(256) / 255
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def _texels(images: Sequence[Image], dtype: Any) -> np.ndarray:
    """(n, 4) RGBA of the images of this dtype, one after the other."""
    found = [image.pixels.reshape(-1, 4) for image in images if image.pixels.dtype == dtype]
    return np.ascontiguousarray(np.concatenate([np.zeros((0, 4), dtype), *found]))


def _texel_kind(image: Image) -> int:
    if image.pixels.dtype == np.float32:
        return int(textures.FLOATS)
    return int(textures.SRGB_BYTES if image.is_srgb else textures.BYTES)


class TextureRows:
    """Textures, of which each is there once."""

    def __init__(self) -> None:
        self.images = ImageRows()
        self._found: dict[int, int] = {}
        self._rows: list[Any] = []
        self._tiles: list[int] = []
        self._kept: list[Texture] = []

    def add(self, texture: Texture) -> int:
        """Adds a texture; returns its index."""
        if id(texture) not in self._found:
            self._found[id(texture)] = len(self._rows)
            self._kept.append(texture)
            row = textures.Texture()
            row.first_tile = len(self._tiles)
            row.wrap_s, row.wrap_t = WRAPS.index(texture.wrap_s), WRAPS.index(texture.wrap_t)
            row.fallback = wp.vec4(*texture.fallback)
            if texture.is_udim:
                row.tile_rows = max((v for _, v in texture.tiles), default=0) + 1
                places = [(u, v) for v in range(row.tile_rows) for u in range(int(textures.UDIM_COLUMNS))]
            else:
                places = [(0, 0)]
            self._tiles += [self.images.add(texture.tiles[at]) if at in texture.tiles else -1 for at in places]
            self._rows.append(row)
        return self._found[id(texture)]

    def upload(self, device: str) -> Any:
        """The device's `Textures`."""
        result = textures.Textures()
        result.textures = wp.array(self._rows, dtype=textures.Texture, device=device)
        result.tiles = wp.array(np.array(self._tiles, dtype=np.int32), dtype=int, device=device)
        result.images = self.images.upload(device)
        return result
