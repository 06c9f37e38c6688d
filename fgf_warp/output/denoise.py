"""The one way to Intel Open Image Denoise, which the extra ``denoise`` installs."""

from __future__ import annotations

from importlib.metadata import version
from importlib.util import find_spec

import numpy as np

from fgf_warp.errors import ConfigError, OutputError

LIBRARY = "pyoidn"


def check_denoiser() -> None:
    """Checks that the denoiser is installed.

    Raises:
        ConfigError: naming the extra that installs it.
    """
    if find_spec(LIBRARY) is None:
        raise ConfigError(
            f"the plane denoised needs {LIBRARY}, which is not installed; accepted: pip install 'fgf-warp[denoise]', "
            "or a render without this plane"
        )


def denoiser_version() -> str:
    """For the header of what it made."""
    return version(LIBRARY)


def denoise(radiance: np.ndarray, albedo: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Takes the noise out of radiance, on all cores of the CPU; equal planes give equal results on one machine.

    Args:
        radiance: (height, width, 3) float32, linear, finite, >= 0.
        albedo: of the same shape, in [0, 1]; may be noisy too.
        normal: of the same shape, in [-1, 1]; 0 where there is none.

    Returns:
        (height, width, 3) float32.

    Raises:
        OutputError: where the denoiser fails.
    """
    import pyoidn  # noqa: PLC0415 - optional, and loads a library of 80 MB

    try:
        return pyoidn.denoise(radiance, albedo, normal, hdr=True)
    except RuntimeError as error:
        raise OutputError(f"the image cannot be denoised: {error}") from error
