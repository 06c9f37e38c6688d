"""Files of pictures, of any format that OpenImageIO reads, as the images that textures are made of."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its own documentation uses
from pxr import Ar

from fgf_warp.errors import SceneError
from fgf_warp.scene import Image, Wrap

ColorSpace = Literal["auto", "raw", "sRGB"]
COLOR_SPACES: tuple[ColorSpace, ...] = ("auto", "raw", "sRGB")
WRAPS_OF_FILES: dict[str, Wrap] = {"black": "black", "clamp": "clamp", "periodic": "repeat", "mirror": "mirror"}
"""OpenImageIO's names of wrap modes in the metadata of files."""


@dataclass(frozen=True, eq=False)
class ImageFile:
    """A picture, and what its file says of it.

    Args:
        image: the pixels.
        is_encoded: True where the file's colors were taken to be encoded by the transfer function of sRGB.
        wraps: in s and t, None where the file does not say.
    """

    image: Image
    is_encoded: bool
    wraps: tuple[Wrap | None, Wrap | None]


class ImageFiles:
    """Reads each file once for each color space that it is taken to be in."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, ColorSpace], ImageFile | str] = {}

    def read(self, path: str, color_space: ColorSpace = "auto") -> ImageFile:
        """The picture at a path that USD resolved, be it a file or inside a package.

        8-bit pixels stay as they are, and all others become float32. One channel is grey, a second one its alpha.
        ``auto`` takes 8-bit files of three channels or more for sRGB and all others for linear, as the specification
        of UsdPreviewSurface asks for where a file does not say.

        Raises:
            SceneError: for a file that is not there or no picture, and for pixels that are not finite; the message
                holds the reason alone.
        """
        key = (path, color_space)
        if key not in self._found:
            try:
                self._found[key] = _read(path, color_space)
            except SceneError as error:
                self._found[key] = str(error)
        found = self._found[key]
        if isinstance(found, str):
            raise SceneError(found)
        return found


def is_picture(path: str) -> bool:
    """Whether a file on disk begins as a picture does; whether all of it can be read is not known."""
    reader = oiio.ImageInput.open(path)
    if reader is None:
        oiio.geterror()  # else it would be told with the next one
        return False
    reader.close()
    return True


def _read(path: str, color_space: ColorSpace) -> ImageFile:
    if Path(path).is_file():
        return _decoded(path, path, color_space)
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path)) if path else None
    if asset is None:
        raise SceneError("there is no such file")
    with tempfile.NamedTemporaryFile(suffix=f".{Ar.GetResolver().GetExtension(path)}") as copy:
        copy.write(asset.GetBuffer())
        copy.flush()
        return _decoded(copy.name, path, color_space)


def _decoded(file: str, name: str, color_space: ColorSpace) -> ImageFile:
    reader = oiio.ImageInput.open(file, _straight_alpha())
    if reader is None:
        raise SceneError(f"it is no picture that can be read: {_first_line(oiio.geterror())}")
    try:
        spec = reader.spec()
        is_8_bit = spec.format == oiio.UINT8
        pixels = _pixels(reader, spec, oiio.UINT8 if is_8_bit else oiio.FLOAT)
    finally:
        reader.close()
    is_encoded = color_space == "sRGB" or (color_space == "auto" and is_8_bit and spec.nchannels >= 3)
    rgba = _rgba(pixels, 255 if is_8_bit else 1, spec.alpha_channel)
    if not is_8_bit and is_encoded:
        rgba[..., :3] = _decode_srgb(rgba[..., :3])
    if not is_8_bit and not np.isfinite(rgba).all():
        raise SceneError("it holds pixels that are not finite")
    return ImageFile(Image(name, rgba, is_srgb=is_8_bit and is_encoded), is_encoded, _wraps(spec))


def _straight_alpha() -> oiio.ImageSpec:
    """Leaves colors as files hold them, where OpenImageIO would multiply them by alpha.

    Made anew each time: one that outlived the interpreter would be told of as a leak.
    """
    spec = oiio.ImageSpec()
    spec.attribute("oiio:UnassociatedAlpha", 1)
    return spec


def _pixels(reader: oiio.ImageInput, spec: oiio.ImageSpec, kind: oiio.BASETYPE) -> np.ndarray:
    """(height, width, channels) of the display window; black where the file holds no pixels of it."""
    try:
        pixels = reader.read_image(0, 0, 0, spec.nchannels, kind)
        if pixels is None:
            raise SceneError(f"it is damaged: {_first_line(reader.geterror())}")
        if spec.roi != spec.roi_full:
            part = oiio.ImageBuf(spec)
            part.set_pixels(spec.roi, pixels)
            pixels = part.get_pixels(kind, spec.roi_full)
    except MemoryError:
        raise SceneError(f"{spec.width} x {spec.height} pixels do not fit into memory") from None
    return np.asarray(pixels).reshape(spec.full_height, spec.full_width, spec.nchannels)


def _rgba(pixels: np.ndarray, opaque: int, alpha_channel: int) -> np.ndarray:
    """(height, width, 4) of an image with any number of channels."""
    channels = pixels.shape[2]
    rgba = np.full((*pixels.shape[:2], 4), opaque, dtype=pixels.dtype)
    rgba[..., :3] = pixels[..., :3] if channels >= 3 else pixels[..., :1]
    alpha = 1 if channels == 2 else alpha_channel
    if alpha > 0:
        rgba[..., 3] = pixels[..., alpha]
    return rgba


def _decode_srgb(encoded: np.ndarray) -> np.ndarray:
    """Linear from encoded values, by the transfer function of IEC 61966-2-1."""
    steep = np.maximum((encoded + 0.055) / 1.055, 0.0) ** 2.4
    return np.where(encoded <= 0.04045, encoded / 12.92, steep)


def _wraps(spec: oiio.ImageSpec) -> tuple[Wrap | None, Wrap | None]:
    s, _, t = (spec.getattribute("wrapmodes") or "").partition(",")
    return WRAPS_OF_FILES.get(s), WRAPS_OF_FILES.get(t or s)


def _first_line(text: str) -> str:
    return text.strip().partition("\n")[0]
