"""Writes image files for tests."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its own documentation uses


def write_picture(path: Path, pixels: np.ndarray, **metadata: str) -> Path:
    """Writes (height, width, channels) uint8, uint16 or float32 pixels in the format that the path's suffix names.

    A PNG says nothing of its colors unless the metadata do.
    """
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, str(pixels.dtype).replace("float32", "float"))
    spec.attribute("oiio:UnassociatedAlpha", 1)
    for name, value in metadata.items():
        spec.attribute(name, value)
    path.parent.mkdir(parents=True, exist_ok=True)
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), spec), file.geterror()
    assert file.write_image(np.ascontiguousarray(pixels)), file.geterror()
    assert file.close(), file.geterror()
    if path.suffix == ".png" and "oiio:ColorSpace" not in metadata:
        path.write_bytes(png_without(path.read_bytes(), SAYS_COLORS))
    return path


SAYS_COLORS = (b"sRGB", b"gAMA", b"cHRM", b"eXIf")
"""Chunks that OpenImageIO writes into every PNG."""


def png_without(data: bytes, kinds: tuple[bytes, ...], added: bytes = b"") -> bytes:
    """A PNG without chunks of some kinds, with others behind its header."""
    parts, at = [data[:33], added], 33
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        parts += [] if kind in kinds else [data[at : at + 12 + length]]
        at += 12 + length
    return b"".join(parts)


def chunk(kind: bytes, data: bytes) -> bytes:
    """A chunk of a PNG."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def noise(channels: int, dtype: type = np.uint8, seed: int = 1) -> np.ndarray:
    """(5, 7, channels) random pixels that span the type's range, floats [0, 1)."""
    rng = np.random.default_rng(seed)
    if dtype is np.float32:
        return rng.random((5, 7, channels), dtype=np.float32)
    return rng.integers(0, np.iinfo(dtype).max, (5, 7, channels), dtype=dtype, endpoint=True)
