"""The one way in and out of OpenImageIO for whole files, with every sign of failure looked at."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its own documentation uses

from fgf_warp import __version__
from fgf_warp.errors import CorruptFileError, OutputError
from fgf_warp.output.atomic import replacing

FIXED_DATE = "1970:01:01 00:00:00"
"""In every header, so that equal pixels give equal bytes."""
OIIO_TYPES = {"float32": "float", "uint8": "uint8"}
"""OpenImageIO takes a type name it does not know for half, without an error."""


def write_image(path: Path, pixels: np.ndarray, channels: Sequence[str], attributes: Mapping[str, str]) -> None:
    """Writes an image file whole or not at all; the format follows from the ending of the name.

    Args:
        path: the file.
        pixels: (height, width, channel), float32 or uint8.
        channels: one name per channel.
        attributes: of the header, beside the date and the software's name.

    Raises:
        OutputError: where the file cannot be written.
    """
    height, width, _ = pixels.shape
    spec = oiio.ImageSpec(width, height, len(channels), OIIO_TYPES[pixels.dtype.name])
    spec.channelnames = tuple(channels)
    spec.alpha_channel = channels.index("A") if "A" in channels else -1
    spec.z_channel = channels.index("Z") if "Z" in channels else -1
    spec.attribute("Software", f"FGF-Warp {__version__}")
    spec.attribute("DateTime", FIXED_DATE)
    for name, value in attributes.items():
        spec.attribute(name, value)
    with replacing(path) as temporary:
        image = oiio.ImageOutput.create(str(temporary))
        if image is None:
            raise OutputError(f"{path}: no writer for files of this ending: {_in_a_line(_said(oiio.geterror))}")
        written = image.open(str(temporary), spec) and image.write_image(np.ascontiguousarray(pixels))
        problem = _said(image.geterror)
        # Closed in any case: only then are the last bytes out, and only then can that fail.
        closed = image.close()
        if not (written and closed) or problem:
            reason = _full_disk(temporary, pixels.nbytes) or _in_a_line(problem or _said(image.geterror))
            raise OutputError(f"{path}: cannot be written: {reason}")
        _check_last_bytes(path, temporary, pixels.nbytes)


def _check_last_bytes(path: Path, file: Path, size: int) -> None:
    """Reads a new file back where the disk is nearly full: of the last bytes that found no room nothing is said.

    Raises:
        OutputError: where the file is not whole.
    """
    if shutil.disk_usage(file.parent).free < size:
        try:
            read_image(file)
        except CorruptFileError as error:
            raise OutputError(f"{path}: cannot be written: {os.strerror(errno.ENOSPC)}") from error


def _full_disk(file: Path, size: int) -> str:
    """The system's words for a full disk, which OpenImageIO's errors do not have, where there is no room for a file."""
    with suppress(OSError):
        written = file.stat().st_size if file.exists() else 0
        if shutil.disk_usage(file.parent).free + written < size:
            return os.strerror(errno.ENOSPC)
    return ""


def read_image(path: Path) -> tuple[np.ndarray, tuple[str, ...], dict[str, Any]]:
    """Reads an image file with all its channels.

    Returns:
        Pixels as (height, width, channel) float32, the channels' names in the file's order, and the header.

    Raises:
        CorruptFileError: where the file is missing, is no image, or is incomplete.
    """
    image = oiio.ImageInput.open(str(path))
    if image is None:
        raise CorruptFileError(f"{path}: cannot be read: {_in_a_line(_said(oiio.geterror))}")
    spec = image.spec()
    pixels = image.read_image("float")
    problem = _said(image.geterror)
    image.close()
    if pixels is None or problem:
        raise CorruptFileError(f"{path}: is incomplete: {_in_a_line(problem)}")
    header = {attribute.name: attribute.value for attribute in spec.extra_attribs}
    return pixels.reshape(spec.height, spec.width, spec.nchannels), tuple(spec.channelnames), header


def _said(geterror: Callable[[], str]) -> str:
    """What OpenImageIO says, which quotes a damaged file's bytes, be they text or not."""
    try:
        return geterror()
    except UnicodeDecodeError as error:
        return error.object.decode(errors="replace")


def _in_a_line(problem: str) -> str:
    """The first that the library says, which repeats it for each part that it then misses."""
    return next((line.strip() for line in problem.splitlines() if line.strip()), "is no image")
