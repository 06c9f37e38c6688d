"""From linear Rec.709 radiance to what a screen shows."""

from __future__ import annotations

import warnings
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np

from fgf_warp.errors import OutputError
from fgf_warp.output.images import write_image
from fgf_warp.result import RenderResult


def to_display(radiance: np.ndarray, exposure: float = 0.0) -> np.ndarray:
    """Encodes linear Rec.709 for an sRGB display.

    Both spaces have the same primaries and white, so only the sRGB curve (IEC 61966-2-1) is applied. There is no
    tone mapping: after exposure, values above 1 clip to white, channel by channel.

    Args:
        radiance: (height, width, 3), linear Rec.709, finite.
        exposure: [stop]; radiance is multiplied by 2^exposure.

    Returns:
        (height, width, 3) uint8.

    Raises:
        OutputError: where a value is not finite.
    """
    if not np.isfinite(radiance).all():
        raise OutputError("the image has values that are not finite, so it cannot be shown")
    linear = np.clip(np.asarray(radiance, np.float64) * 2.0**exposure, 0.0, 1.0)
    return np.rint(_colour().RGB_COLOURSPACES["sRGB"].cctf_encoding(linear) * 255.0).astype(np.uint8)


def write_png(path: Path, picture: RenderResult | np.ndarray, exposure: float = 0.0) -> None:
    """Writes an 8-bit sRGB PNG, tagged as such.

    Args:
        path: ends in ``.png``; its folder exists.
        picture: a render or linear radiance, shown by `to_display`; or (height, width, 3) uint8, written as it is.
        exposure: [stop], of linear radiance.

    Raises:
        OutputError: where the file cannot be written, or a value is not finite.
    """
    pixels = picture.radiance if isinstance(picture, RenderResult) else picture
    if pixels.dtype != np.uint8:
        pixels = to_display(pixels, exposure)
    write_image(path, pixels, ("R", "G", "B"), {"oiio:ColorSpace": "srgb_rec709_scene"})


def mean_delta_e(picture: np.ndarray, reference: np.ndarray) -> float:
    """Mean over the pixels of the CIE 2000 colour difference of two displayed pictures, under D65.

    Args:
        picture: (height, width, 3) uint8, as `to_display` encodes it.
        reference: of the same shape.

    Returns:
        About 1 where an eye just sees a difference of plain patches side by side; 0 for equal pictures.
    """
    library = _colour()
    space = library.RGB_COLOURSPACES["sRGB"]
    first, second = (
        library.XYZ_to_Lab(library.RGB_to_XYZ(image / 255.0, space, apply_cctf_decoding=True), space.whitepoint)
        for image in (picture, reference)
    )
    return float(np.mean(library.delta_E(first, second, method="CIE 2000")))


@cache
def _colour() -> ModuleType:
    with warnings.catch_warnings():
        # colour-science takes more than a second to import, and warns of an absent Matplotlib not needed here.
        warnings.simplefilter("ignore")
        import colour  # noqa: PLC0415
    return colour
