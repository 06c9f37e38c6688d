"""Whether two renders are estimates of one image: differences in units of their standard error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from fgf_warp.result import RenderResult

GREEN = 1
"""The channel that is compared: the three share their paths, so they are not independent of each other."""
BLOCK = 8
"""[pixel] Side of the blocks over which differences are averaged, so that they are normally distributed."""
LEVEL = 1e-3
"""Probability with which chance alone makes each of the two tests of `Agreement.holds` fail."""
SILENT = 1e-5
"""Relative error of a block below which it counts as free of noise, as where the sky alone is seen: there is only
rounding in float32."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """An image and how far it may be off.

    Args:
        mean: (height, width) float64.
        variance: (height, width) float64, of the mean.
    """

    mean: np.ndarray
    variance: np.ndarray

    def __sub__(self, other: Estimate) -> Estimate:
        """The difference of independent estimates."""
        return Estimate(self.mean - other.mean, self.variance + other.variance)

    def blocks(self, size: int = BLOCK) -> Estimate:
        """The means over blocks of size x size pixels; size divides width and height.

        Returns:
            (height / size, width / size), with the variance of those means.
        """
        height, width = self.mean.shape
        shape = (height // size, size, width // size, size)
        return Estimate(
            self.mean.reshape(shape).mean(axis=(1, 3)), self.variance.reshape(shape).mean(axis=(1, 3)) / size**2
        )


@dataclass(frozen=True, eq=False)
class Agreement:
    """Two estimates compared.

    Args:
        z: difference over its standard error in each block; NaN where there is no noise and no difference.
        mean: difference of the images' means, relative to the mean that is expected.
        mean_error: standard error of `mean`.
    """

    z: np.ndarray
    mean: float
    mean_error: float

    @property
    def noisy_z(self) -> np.ndarray:
        """(n,) the z of the blocks that are not free of noise."""
        return self.z[~np.isnan(self.z)]

    @property
    def rms_z(self) -> float:
        """1 within sampling error where the estimates are of one image."""
        return float(np.sqrt(np.mean(self.noisy_z**2)))

    @property
    def chi_square_p(self) -> float:
        """Probability of a sum of squared z as large as this, or larger, by chance.

        Returns:
            In [0, 1], with one degree of freedom for each block that has noise.
        """
        return float(stats.chi2.sf(np.sum(self.noisy_z**2), self.noisy_z.size))

    @property
    def mean_z(self) -> float:
        """Difference of the means over its standard error."""
        return self.mean / self.mean_error

    @property
    def mean_p(self) -> float:
        """Probability of a difference of the means as large as this, or larger, by chance.

        Returns:
            In [0, 1], of both sides.
        """
        return float(2 * stats.norm.sf(abs(self.mean_z)))

    @property
    def holds(self) -> bool:
        """Whether neither the blocks nor the means tell the images apart."""
        return min(self.chi_square_p, self.mean_p) >= LEVEL

    @property
    def visible_mean(self) -> float:
        """Relative difference of the means that the test would see with a probability of 98 %."""
        return float(stats.norm.isf(LEVEL / 2) + 2) * self.mean_error


def estimate_of(result: RenderResult) -> Estimate:
    """The channel of a render that is compared; its sampler must be the independent one.

    Returns:
        (height, width) of the green channel, with the variance of each pixel.
    """
    return Estimate(result.radiance[..., GREEN].astype(np.float64), result.variance[..., GREEN].astype(np.float64))


def extrapolate(near: Estimate, far: Estimate) -> Estimate:
    """The image at b = 0 from those at b and 2b, as a straight line.

    Returns:
        Twice the near one less the far one, with the variance of that: they must be independent.
    """
    return Estimate(2 * near.mean - far.mean, 4 * near.variance + far.variance)


def compare(found: Estimate, expected: Estimate) -> Agreement:
    """Compares two independent estimates, block by block and in their means.

    Args:
        found: of which `BLOCK` divides width and height.
        expected: of the same size.
    """
    difference = found - expected
    block, scale = difference.blocks(), np.abs(expected.blocks().mean)
    error = np.sqrt(block.variance)
    silent = error <= SILENT * scale
    same = silent & (np.abs(block.mean) <= SILENT * scale)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(same, np.nan, block.mean / error)
    total = expected.mean.sum()
    return Agreement(
        z=z,
        mean=float(difference.mean.sum() / total),
        mean_error=float(np.sqrt(difference.variance.sum()) / total),
    )
