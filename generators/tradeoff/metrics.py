"""Noise, bias and error of images of which there are several, against a reference that is known no better than it is.

Of n independent images x_i and as many independent parts r_i of the reference, the differences d_i = x_i - r_i are
independent and alike, and their expectation is the bias. So intervals of Student's t from the spread of the n numbers
hold the noise of both sides, with no word about how pixels, samples or sampler depend on each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from fgf_warp.result import BLOCK, block_errors

CONFIDENCE = 0.95
REPLICATES_MIN = 4
"""An interval of fewer is too wide to tell anything, and of two the variance of a square cannot be told."""


@dataclass(frozen=True)
class Errors:
    """What `compare` finds; relative to the blocks of 8 x 8 pixels of the reference, see `fgf_warp.result`.

    Args:
        rmse: root of the mean squared error of one image, in units of radiance.
        noise: root of the mean squared relative standard error of one image.
        bias: signed mean relative difference from the reference.
        bias_low: lower end of its confidence interval.
        bias_high: upper end.
        bias_rms: root of the mean squared relative bias of the pixels, the noise taken out; 0 where none is seen.
        bias_rms_high: upper end of its confidence interval.
    """

    rmse: float
    noise: float
    bias: float
    bias_low: float
    bias_high: float
    bias_rms: float
    bias_rms_high: float

    @property
    def relative_mse(self) -> float:
        """Mean squared relative error of one image."""
        return self.noise**2 + self.bias_rms**2


def compare(images: np.ndarray, parts: np.ndarray) -> Errors:
    """Errors of a way to render.

    Args:
        images: (n, height, width, 3) radiance of independent renders, n >= 4.
        parts: of the same shape: independent renders whose mean is the reference. They share no random number with
            the images.

    Returns:
        Errors without those of the reference: its variance widens the intervals, and is no part of any error.
    """
    reference = parts.mean(axis=0, dtype=np.float64)
    differences = images.astype(np.float64) - parts
    scale = relative_weights(reference)
    bias, margin = _mean_with_margin((differences * scale**2 * bright_blocks(reference)).sum(axis=(1, 2, 3)))
    square, square_margin = _squared_mean_with_margin(differences * scale)
    plain = np.full_like(scale, 1 / np.sqrt(reference.size))
    plain_square, _ = _squared_mean_with_margin(differences * plain)
    return Errors(
        rmse=float(np.sqrt(_squared_noise(images * plain) + max(plain_square, 0.0))),
        noise=float(np.sqrt(_squared_noise(images * scale))),
        bias=bias,
        bias_low=bias - margin,
        bias_high=bias + margin,
        bias_rms=float(np.sqrt(max(square, 0.0))),
        bias_rms_high=float(np.sqrt(max(square + square_margin, 0.0))),
    )


def relative_standard_error(parts: np.ndarray) -> float:
    """Root of the mean squared relative standard error of the mean of independent images.

    Args:
        parts: (n, height, width, 3) radiance, n >= 2.

    Returns:
        >= 0; relative to blocks, see `bright_blocks`.
    """
    scale = relative_weights(parts.mean(axis=0, dtype=np.float64))
    return float(np.sqrt(_squared_noise(parts * scale) / len(parts)))


def relative_weights(reference: np.ndarray) -> np.ndarray:
    """(height, width, 1) factors whose squares weight squared errors to their relative mean over pixels and channels.

    Args:
        reference: (height, width, 3) radiance. Its black blocks have weight 0.
    """
    inverse, pixels = block_errors(reference, np.ones_like(reference))
    counted = np.where(pixels > 0, inverse, 0.0) / np.sqrt(max(pixels.sum(), 1.0) * reference.shape[2])
    return _per_pixel(counted, reference.shape)


def bright_blocks(reference: np.ndarray) -> np.ndarray:
    """(height, width, 1) radiance to which errors are relative: the mean of a pixel's block, if it is not too dark.

    Args:
        reference: (height, width, 3) radiance.
    """
    inverse, _ = block_errors(reference, np.ones_like(reference))
    return _per_pixel(1 / inverse, reference.shape)


def relative_difference(image: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """(height, width) signed error of the pixels' mean over the channels, relative to their blocks.

    Args:
        image: (height, width, 3) radiance.
        reference: of the same shape.
    """
    return ((image.astype(np.float64) - reference) / bright_blocks(reference)).mean(axis=2)


def _per_pixel(blocks: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    return blocks.repeat(BLOCK, axis=0).repeat(BLOCK, axis=1)[: shape[0], : shape[1], None]


def _squared_noise(weighted: np.ndarray) -> float:
    return float(weighted.var(axis=0, ddof=1, dtype=np.float64).sum())


def _mean_with_margin(values: np.ndarray) -> tuple[float, float]:
    """Mean of independent values and half the width of its confidence interval."""
    n = len(values)
    quantile = stats.t.ppf((1 + CONFIDENCE) / 2, n - 1)
    return float(values.mean()), float(quantile * values.std(ddof=1) / np.sqrt(n))


def _squared_mean_with_margin(weighted: np.ndarray) -> tuple[float, float]:
    """Squared length of the expectation of independent vectors, and half the width of its confidence interval.

    Products of different vectors only: a vector's own square has the noise in it, and theirs has not. The interval is
    by the jackknife, leaving out one vector after the other.
    """
    n = len(weighted)
    flat = weighted.reshape(n, -1)
    products = flat @ flat.T
    np.fill_diagonal(products, 0.0)
    total = products.sum()
    without_one = (total - 2 * products.sum(axis=1)) / ((n - 1) * (n - 2))
    deviation = np.sqrt((n - 1) / n * ((without_one - without_one.mean()) ** 2).sum())
    return float(total / (n * (n - 1))), float(stats.t.ppf((1 + CONFIDENCE) / 2, n - 1) * deviation)
