"""Statistical tests with fixed seeds: every one is a p-value, and many of them are corrected as one family."""

import numpy as np
from scipy import stats

FAMILY_LEVEL = 1e-3
"""Probability that one family of checks fails by chance."""


def sidak_z(checks: int) -> float:
    """The |z| that `checks` independent standard normals exceed with probability FAMILY_LEVEL in all."""
    return float(stats.norm.isf((1 - (1 - FAMILY_LEVEL) ** (1 / checks)) / 2))


def assert_means(values, errors, expected, *, detects: float) -> None:
    """Asserts that means agree with what they should be, as one family.

    Args:
        values: means.
        errors: their standard errors.
        expected: the true values.
        detects: the relative bias that the test must be able to see in every one, with 2 standard errors to spare;
            it fails where the errors are too large for that, so that a weak test cannot pass.
    """
    values, errors, expected = (np.atleast_1d(np.asarray(x, dtype=np.float64)) for x in (values, errors, expected))
    limit = sidak_z(values.size)
    weakest = ((limit + 2) * errors / np.abs(expected)).max()
    assert weakest <= detects, f"the test sees a bias of {weakest:.2e} only, not {detects:.2e}"
    # Rounding of float32 sums and inputs, far below every bias that is looked for.
    z = (values - expected) / np.hypot(errors, 1e-6 * np.abs(expected))
    worst = int(np.abs(z).argmax())
    assert abs(z[worst]) <= limit, f"mean {values[worst]:.6g} against {expected[worst]:.6g}: z = {z[worst]:.2f}"


def assert_distributed(samples, cdf) -> None:
    """Asserts by Kolmogorov-Smirnov that samples follow a continuous cdf; sees a distance of 4 / sqrt(n)."""
    p = stats.kstest(np.asarray(samples, dtype=np.float64), cdf).pvalue
    assert p >= FAMILY_LEVEL, f"p = {p:.2e}"


def assert_histogram(counts, expected) -> None:
    """Asserts by chi-square that bin counts follow expected counts; bins below 10 expected are merged."""
    counts, expected = np.ravel(counts), np.ravel(expected)
    order = np.argsort(expected)
    counts, expected = counts[order], expected[order]
    first = int(np.searchsorted(expected, 10))
    if first:
        counts = np.append(counts[first:], counts[:first].sum())
        expected = np.append(expected[first:], expected[:first].sum())
    keep = expected > 0
    assert not counts[~keep].any()
    if keep.sum() == 1:
        return
    p = stats.chisquare(counts[keep], expected[keep] * counts[keep].sum() / expected[keep].sum()).pvalue
    assert p >= FAMILY_LEVEL, f"p = {p:.2e}"


def image_mean(result, channel: int = 0, *, aov=None) -> tuple[float, float]:
    """Mean of an image or a plane whose pixels are all alike, and its standard error from the spread of the pixels."""
    pixels = (result.radiance if aov is None else result.aovs[aov])[..., channel].astype(np.float64)
    return float(pixels.mean()), float(pixels.std(ddof=1) / np.sqrt(pixels.size))


def assert_images_agree(a, b, *, blocks: int, detects: float) -> None:
    """Asserts that two independent renders agree in the means of `blocks` x `blocks` blocks of pixels.

    Args:
        a: one result.
        b: the other, of the same size.
        blocks: along each side; must divide it.
        detects: the bias that the test must be able to see in every block, relative to the image's mean.
    """
    block_a, block_b = _block_means(a.radiance, blocks), _block_means(b.radiance, blocks)
    per_block = a.radiance.shape[0] * a.radiance.shape[1] / blocks**2
    errors = np.sqrt((_block_means(a.variance, blocks) + _block_means(b.variance, blocks)) / per_block)
    black = (errors == 0) & (block_a == block_b)
    assert not black.all()
    floor = block_b.mean()
    assert_means((floor + block_a - block_b)[~black], errors[~black], np.full((~black).sum(), floor), detects=detects)


def plane_mean(a, b) -> tuple[float, float]:
    """Mean of a plane of two independent renders, and its standard error from the spread of the pixels' differences.

    So the pixels need not be alike.
    """
    mean, half = (np.asarray(a, dtype=np.float64) + b) / 2, (np.asarray(a, dtype=np.float64) - b) / 2
    return float(mean.mean()), float(half.std(ddof=1) / np.sqrt(half.size))


def assert_planes_agree(a, b, *, detects: float) -> None:
    """Asserts that a plane of two independent renders has the same mean in each channel.

    The errors follow from the spread of the pixels' differences, whatever the picture.

    Args:
        a: (height, width, channels).
        b: of the same shape.
        detects: as for `assert_means`.
    """
    difference = (a.astype(np.float64) - b).reshape(-1, a.shape[-1])
    expected = b.mean(axis=(0, 1), dtype=np.float64)
    errors = difference.std(axis=0, ddof=1) / np.sqrt(len(difference))
    assert_means(expected + difference.mean(axis=0), errors, expected, detects=detects)


def _block_means(image, blocks: int):
    height, width, channels = image.shape
    tiles = image.astype(np.float64).reshape(blocks, height // blocks, blocks, width // blocks, channels)
    return tiles.mean(axis=(1, 3)).ravel()
