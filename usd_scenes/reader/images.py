"""Files of pictures, of any format that OpenImageIO reads, as the images that textures are made of."""

from __future__ import annotations

import stat
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its own documentation uses
from pxr import Ar

from fgf_warp.errors import SceneError
from fgf_warp.scene import Image, Wrap
from usd_scenes.reader.color_encoding import Encoding, Transfer, decode, read_encoding

ColorSpace = Literal["auto", "raw", "sRGB"]
COLOR_SPACES: tuple[ColorSpace, ...] = ("auto", "raw", "sRGB")
TRANSFERS: dict[ColorSpace, Transfer] = {"raw": "linear", "sRGB": "sRGB"}
HALF_MAX = 65504.0
"""The largest number of the 16 bits that most files of light have: what such a file has as infinite is beyond it."""
WRAPS_OF_FILES: dict[str, Wrap] = {"black": "black", "clamp": "clamp", "periodic": "repeat", "mirror": "mirror"}
"""OpenImageIO's names of wrap modes in the metadata of files."""


@dataclass(frozen=True, eq=False)
class ImageFile:
    """A picture, and what its file says of it.

    Args:
        image: the pixels.
        is_encoded: True where the file's colors were taken to be encoded, by the transfer function of sRGB or another.
        wraps: in s and t, None where the file does not say.
        mended: what was wrong with its pixels and what was done about it, one text each.
        told: what it says of its colors that is not followed, one text each.
    """

    image: Image
    is_encoded: bool
    wraps: tuple[Wrap | None, Wrap | None]
    mended: tuple[str, ...] = ()
    told: tuple[str, ...] = ()


class ImageFiles:
    """Reads each file once for each color space that it is taken to be in."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, ColorSpace], ImageFile | str] = {}

    def read(self, path: str, color_space: ColorSpace = "auto") -> ImageFile:
        """The picture at a path that USD resolved, be it a file or inside a package.

        8-bit pixels stay as they are unless they are encoded by a power, and all others become float32. One channel is
        grey, a second one its alpha. ``auto`` follows the file, and where that does not say takes 8-bit files of three
        channels or more for sRGB and all others for linear, as the specification of UsdPreviewSurface asks for.

        Returns:
            Pixels (height, width, 4), uint8 as in the file, or float32, linear and finite; the same object each time.

        Raises:
            SceneError: for a file that is not there or no picture; the message holds the reason alone.
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
    # What is no plain file, such as a pipe, may keep whoever opens it waiting for ever.
    outer, _ = Ar.SplitPackageRelativePathOuter(path)
    if not outer:
        raise SceneError("there is no such file")
    try:
        found = Path(outer).stat()
    except (OSError, ValueError):
        raise SceneError("there is no such file") from None
    if not stat.S_ISREG(found.st_mode):
        raise SceneError("it is no plain file")
    if outer == path:
        if not found.st_size:
            raise SceneError("the file is empty")
        return _decoded(path, path, color_space)
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(path))
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
        file_format = reader.format_name()
    finally:
        reader.close()
    said = (
        read_encoding(file, spec.getattribute, file_format)
        if color_space == "auto"
        else Encoding(TRANSFERS[color_space])
    )
    usual: Transfer = "sRGB" if is_8_bit and spec.nchannels >= 3 else "linear"
    transfer = usual if said.transfer is None else said.transfer
    rgba = _rgba(pixels, 255 if is_8_bit else 1, spec.alpha_channel)
    if is_8_bit and transfer in ("linear", "sRGB"):
        image = Image(name, rgba, is_srgb=transfer == "sRGB")
        return ImageFile(image, transfer != "linear", _wraps(spec), told=said.told)
    if is_8_bit:
        rgba = rgba.astype(np.float32) / np.float32(255)
    mended = _make_finite(rgba)
    if transfer != "linear":
        rgba[..., :3] = decode(rgba[..., :3], transfer)
    return ImageFile(Image(name, rgba), transfer != "linear", _wraps(spec), mended, said.told)


def _make_finite(rgba: np.ndarray) -> tuple[str, ...]:
    """Puts numbers in the place of what is none, and says of how many pixels."""
    is_finite = np.isfinite(rgba)
    if is_finite.all():
        return ()
    count = int((~is_finite.all(axis=-1)).sum())
    np.nan_to_num(rgba, copy=False, nan=0.0, posinf=HALF_MAX, neginf=-HALF_MAX)
    text = (
        f"{count} of {is_finite.shape[0] * is_finite.shape[1]} pixels are not finite; {HALF_MAX:g} is used for what is"
    )
    return (f"{text} infinite, and 0 for what is no number",)


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


def _wraps(spec: oiio.ImageSpec) -> tuple[Wrap | None, Wrap | None]:
    s, _, t = (spec.getattribute("wrapmodes") or "").partition(",")
    return WRAPS_OF_FILES.get(s), WRAPS_OF_FILES.get(t or s)


def _first_line(text: str) -> str:
    return text.strip().partition("\n")[0]
