"""Whether two renderers make the same image: z on the means of 8x8 blocks of pixels, and of the whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from tests.stats import sidak_z

BLOCK = 8
"""Side of a block [pixel]."""
ROWS = 20
"""Comparisons of a benchmark, which are one family."""
ROUNDING = 1e-6
"""Relative error of float32 sums, far below every bias that is looked for."""
TINY, LOG_TINY = 1e-300, -690.0


@dataclass(frozen=True)
class Agreement:
    """What comparing two sets of images came to.

    Args:
        max_z: the largest |z| of all checks.
        limit: that the `max_z` of any of ROWS comparisons exceeds by chance with probability
            `tests.stats.FAMILY_LEVEL`.
        bias_seen: the bias that would be seen in the noisiest block, with 2 standard errors to spare,
            relative to the mean of the image it is in.
        checks: number of sums over blocks and the image, per channel.
    """

    max_z: float
    limit: float
    bias_seen: float
    checks: int

    @property
    def holds(self) -> bool:
        return self.max_z <= self.limit


@dataclass(frozen=True)
class Estimate:
    """An image, and what is known of its noise.

    Args:
        mean: (height, width, 3).
        variance: of `mean`, pixel by pixel.
        freedom: degrees of freedom of each pixel's variance.
    """

    mean: np.ndarray
    variance: np.ndarray
    freedom: float


def estimate(images: np.ndarray) -> Estimate:
    """Of n >= 2 renders by different seeds, (n, height, width, 3)."""
    variance = images.var(axis=0, ddof=1, dtype=np.float64) / len(images)
    return Estimate(images.mean(axis=0, dtype=np.float64), variance, len(images) - 1)


def compare(ours: Estimate, theirs: Estimate) -> Agreement:
    """Compares independent renders of one image; the variance of a block is that of its pixels, on both sides."""
    sides = (ours, theirs)
    variance = sum(_sums(side.variance) for side in sides)
    # Welch and Satterthwaite: every pixel of either side is a term with its own degrees of freedom.
    spread = sum(_sums(side.variance**2) / side.freedom for side in sides)
    scale = _sums(np.full_like(ours.mean, ours.mean.mean()))
    return _judge(_sums(ours.mean) - _sums(theirs.mean), variance, spread, scale)


def compare_means(ours: Sequence[float], theirs: Sequence[float]) -> Agreement:
    """Compares means of whole images, each of its own seed; at least two on each side."""
    sides = [np.asarray(side, dtype=np.float64) for side in (ours, theirs)]
    parts = [side.var(ddof=1) / len(side) for side in sides]
    spread = sum(part**2 / (len(side) - 1) for part, side in zip(parts, sides, strict=True))
    values = (sides[0].mean() - sides[1].mean(), sum(parts), spread, sides[0].mean())
    return _judge(*(np.array([value]) for value in values))


def compare_pairs(ours: np.ndarray, theirs: np.ndarray) -> Agreement:
    """Compares one render by either side of each of many images.

    Where the renderers agree, the differences of pixels have mean 0, and their squares estimate both variances.

    Args:
        ours: (n, height, width, 3), n images.
        theirs: the same, by the other side.
    """
    differences, variance, scale = [], [], []
    for our_image, their_image in zip(ours.astype(np.float64), theirs.astype(np.float64), strict=True):
        differences.append(_sums(our_image - their_image))
        variance.append(_sums((our_image - their_image) ** 2))
        scale.append(_sums(np.full_like(our_image, our_image.mean())))
    return _judge(np.stack(differences), np.stack(variance), None, np.stack(scale))


def mean_squared_error(image: np.ndarray, reference: Estimate) -> float:
    """Of an image, without what the reference's own noise adds to it."""
    difference = image.astype(np.float64) - reference.mean
    return float(np.mean(difference**2) - np.mean(reference.variance, dtype=np.float64))


def _judge(differences: np.ndarray, variance: np.ndarray, spread: np.ndarray | None, scale: np.ndarray) -> Agreement:
    """Judges the differences of sums.

    Args:
        differences: of the sums.
        variance: of the differences.
        spread: the sum of variance^2 over degrees of freedom of its terms; None where the differences over their
            errors are normal already, as sums are that their own squares normalise.
        scale: what biases are relative to.
    """
    errors = np.hypot(np.sqrt(variance), ROUNDING * scale)
    z = np.abs(differences) / errors
    if spread is not None:
        # The z of equal probability; the tail in logarithms, as it may be smaller than any float.
        freedom = variance**2 / np.maximum(spread, TINY)
        tail = stats.t.logsf(z, np.maximum(freedom, 1.0))
        z = np.where(variance > 0, -stats.norm.ppf(np.exp(np.maximum(tail, LOG_TINY))), z)
    limit = sidak_z(ROWS * z.size)
    bias = (limit + 2) * errors / scale
    return Agreement(float(z.max()), limit, float(bias.max()), z.size)


def _sums(image: np.ndarray) -> np.ndarray:
    """Of every block, and of the whole image, per channel."""
    height, width, channels = image.shape
    tiles = image.astype(np.float64).reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, channels)
    blocks = tiles.sum(axis=(1, 3))
    return np.concatenate([blocks.reshape(-1, channels), blocks.sum(axis=(0, 1))[None]]).ravel()
