"""The FLIP difference of two pictures as they are seen: the one door to flip-evaluator, of the extra ``quality``."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from fgf_warp.errors import ConfigError, OutputError


def check_flip() -> None:
    """Checks that the extra is installed.

    Raises:
        ConfigError: saying how to install it.
    """
    if find_spec("flip_evaluator") is None:
        raise ConfigError("FLIP needs flip-evaluator, which is not installed: pip install 'fgf-warp[quality]'")


def mean_flip(picture: np.ndarray, reference: np.ndarray) -> float:
    """Mean over the pixels of the LDR-FLIP difference, at the default distance of 67 pixels per degree.

    Source: Andersson et al. 2020, FLIP: A Difference Evaluator for Alternating Images.

    Args:
        picture: (height, width, 3) uint8, as `fgf_warp.output.color.to_display` encodes it.
        reference: of the same shape.

    Returns:
        In [0, 1]; 0 for equal pictures.

    Raises:
        ConfigError: where the extra is not installed.
        OutputError: for anything but two displayed pictures of one size.
    """
    for name, given in (("picture", picture), ("reference", reference)):
        # The library takes integers for values beyond 1, and linear, negative or NaN values for colours, in silence.
        if given.dtype != np.uint8 or given.ndim != 3 or given.shape[2] != 3 or given.size == 0:
            raise OutputError(
                f"{name} of {given.dtype} and shape {given.shape}; accepted: uint8 of shape (height, width, 3)"
            )
    if picture.shape != reference.shape:
        raise OutputError(
            f"a picture of shape {picture.shape} and a reference of {reference.shape}; accepted: one shape"
        )
    check_flip()
    # Where the extra is not installed, all else works. HDR-FLIP is not used: it ends the process on black images.
    import flip_evaluator  # noqa: PLC0415

    shown = [np.ascontiguousarray(image, np.float32) / 255 for image in (reference, picture)]
    _, mean, _ = flip_evaluator.evaluate(*shown, "LDR", applyMagma=False)
    return float(mean)
