"""What a render gives back."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fgf_warp.settings import Aov, RenderSettings

BLOCK = 8
"""Side of the blocks over which errors are taken [pixel]; those at the right and at the bottom may be smaller."""
OVER = r"mean|rms|p[1-9][0-9]?"
"""What relative errors of blocks can be taken over, as a pattern: all of them, or a percentile."""
DARK = 0.01
"""Of the image's mean: what is darker counts as so bright in relative errors, or next to nothing would decide them."""


@dataclass(frozen=True, eq=False)
class RenderResult:
    """An image with its error, counts and provenance.

    Args:
        radiance: (height, width, 3) float32, linear Rec.709; row 0 is the top.
        alpha: (height, width) float32 in [0, 1]: share of camera paths that met a surface or scattered.
        variance: (height, width, 3) float32, variance of the pixel mean; inf for a single sample.
        aovs: the further planes that the settings ask for, float32: (height, width) of depth and scatterings,
            (height, width, 2) of motion, and (height, width, 3) of the others; of prim and instance id (height, width)
            int32. Variance and samples have their own places here.
        samples: samples per pixel reached.
        path_count: camera paths traced.
        truncated_count: paths cut at the bound on their length.
        seconds: wall time of the render, without building the kernel.
        settings: as rendered.
        provenance: parameters, seed and versions, JSON-ready, for the files' headers; equal renders on one
            device give equal values. With prim ids, ``prims`` lists the names that they count.
    """

    radiance: np.ndarray
    alpha: np.ndarray
    variance: np.ndarray
    aovs: dict[Aov, np.ndarray]
    samples: int
    path_count: int
    truncated_count: int
    seconds: float
    settings: RenderSettings
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def standard_error(self) -> np.ndarray:
        """(height, width, 3) float32, standard error of the pixel mean."""
        return np.sqrt(self.variance)

    @property
    def relative_standard_error(self) -> float:
        """Standard error over mean, averaged over the blocks of pixels that are not black; 0 for a black image."""
        return self.relative_error("mean")

    def relative_error(self, over: str) -> float:
        """Standard error over mean of blocks of pixels, see `block_errors`.

        Args:
            over: ``mean`` or ``rms`` over them, or a percentile, such as ``p95``.
        """
        return error_over(over, *block_errors(self.radiance, self.variance))

    @property
    def samples_per_second(self) -> float:
        """Camera paths per second of wall time."""
        return self.path_count / self.seconds if self.seconds > 0 else 0.0


def block_means(plane: np.ndarray, side: int = BLOCK) -> np.ndarray:
    """Means over the blocks of a plane.

    Args:
        plane: (height, width, ...), the further axes are averaged too.
        side: of the blocks [pixel].

    Returns:
        (rows, columns) of blocks, float64.
    """
    height, width, channels = *plane.shape[:2], math.prod(plane.shape[2:])
    # The channels of a row one after the other, so that one sum takes those of a block's pixels together.
    sums = _sums(plane.reshape(height, -1), side, side * channels)
    return sums / (block_sizes((height, width), side) * channels)


def block_sizes(shape: tuple[int, ...], side: int = BLOCK) -> np.ndarray:
    """(rows, columns) pixels in each block of a plane of this height and width."""
    rows, columns = (np.minimum(side, size - np.arange(0, size, side)) for size in shape)
    return np.outer(rows, columns).astype(np.float64)


def block_sums(plane: np.ndarray, side: int = BLOCK) -> np.ndarray:
    """(rows, columns) sums over the blocks of a plane (height, width)."""
    return _sums(plane, side, side)


def _sums(plane: np.ndarray, height: int, width: int) -> np.ndarray:
    rows = np.add.reduceat(plane, np.arange(0, plane.shape[0], height), axis=0, dtype=np.float64)
    return np.add.reduceat(rows, np.arange(0, plane.shape[1], width), axis=1)


def block_brightness(radiance: np.ndarray) -> np.ndarray:
    """(rows, columns) mean radiance of blocks, no less than `DARK` of the image's, to which errors are relative."""
    bright = np.maximum(block_means(radiance), DARK * radiance.mean(dtype=np.float64))
    return np.where(bright > 0, bright, 1.0)


def block_errors(radiance: np.ndarray, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Relative errors of blocks of pixels: the root of the mean variance, over the mean radiance.

    Args:
        radiance: (height, width, channels).
        variance: the same, or squares of differences.

    Returns:
        (rows, columns) errors, and how many pixels of each count: none of a black block.
    """
    errors = np.sqrt(block_means(variance)) / block_brightness(radiance)
    return errors, np.where(block_means(radiance) > 0, block_sizes(radiance.shape[:2]), 0.0)


def error_over(over: str, errors: np.ndarray, pixels: np.ndarray) -> float:
    """One number for the errors of blocks, see `RenderResult.relative_error`; 0 for a black image."""
    if not pixels.any():
        return 0.0
    if over == "mean":
        return float(np.average(errors, weights=pixels))
    if over == "rms":
        return float(np.sqrt(np.average(errors**2, weights=pixels)))
    share = float(over.removeprefix("p")) / 100
    return float(np.quantile(errors.ravel(), share, weights=pixels.ravel(), method="inverted_cdf"))
