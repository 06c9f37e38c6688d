"""Numbers that describe an image, telling of its medium and cheap beside its render."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fgf_warp.result import RenderResult

REC_709 = (0.2126, 0.7152, 0.0722)
"""Weights of luminance."""
PERCENTILES = (1, 5, 25, 50, 75, 95, 99)
ALPHA_PERCENTILES = (25, 50, 75)
LAGS = (1, 2, 4, 8, 16)
"""[pixel] Distances at which pixels are compared."""

STATISTICS: dict[str, str] = {
    "luminance_mean": "mean luminance",
    "luminance_std": "standard deviation of luminance over the pixels",
    "luminance_min": "least luminance",
    "luminance_max": "greatest luminance",
    **{f"luminance_p{p:02d}": f"luminance below which {p} % of the pixels lie" for p in PERCENTILES},
    "red_mean": "mean of the red channel",
    "green_mean": "mean of the green channel",
    "blue_mean": "mean of the blue channel",
    "alpha_mean": "mean of alpha, the share of camera rays that meet a surface or a light or scatter",
    "alpha_std": "standard deviation of alpha over the pixels",
    "alpha_min": "least alpha",
    "alpha_max": "greatest alpha",
    **{f"alpha_p{p:02d}": f"alpha below which {p} % of the pixels lie" for p in ALPHA_PERCENTILES},
    "centroid_x": "mean place of the light, from -0.5 at the left edge to 0.5 at the right",
    "centroid_y": "mean place of the light, from -0.5 at the top edge to 0.5 at the bottom",
    "gradient_energy": "mean squared gradient of luminance, noise included [radiance^2/pixel^2]",
    **{
        f"structure_{lag}": f"mean squared difference of the luminance of pixels {lag} apart, noise included"
        for lag in LAGS
    },
}
"""What `image_statistics` finds, with its meaning. Radiance is linear Rec.709."""


def image_statistics(image: RenderResult | Mapping[str, np.ndarray]) -> dict[str, float]:
    """Describes an image.

    Args:
        image: a render, or the channels of its EXR by name: ``R``, ``G``, ``B`` and ``A`` of (height, width) float32,
            finite. Both give the same numbers.

    Returns:
        A number for each name of `STATISTICS`, but for lags that are not below both sides of the image.
    """
    red, green, blue, alpha = (plane.astype(np.float64) for plane in _planes(image))
    luminance = REC_709[0] * red + REC_709[1] * green + REC_709[2] * blue
    found = {
        **_distribution("luminance", luminance, PERCENTILES),
        "red_mean": red.mean(),
        "green_mean": green.mean(),
        "blue_mean": blue.mean(),
        **_distribution("alpha", alpha, ALPHA_PERCENTILES),
        "centroid_x": _centroid(luminance.sum(axis=0)),
        "centroid_y": _centroid(luminance.sum(axis=1)),
        "gradient_energy": sum(_mean_square(part) for part in _central_differences(luminance)),
        **{f"structure_{lag}": _structure(luminance, lag) for lag in LAGS if lag < min(luminance.shape)},
    }
    return {name: float(found[name]) for name in STATISTICS if name in found}


def _planes(image: RenderResult | Mapping[str, np.ndarray]) -> Sequence[np.ndarray]:
    if isinstance(image, RenderResult):
        return [*np.moveaxis(image.radiance, 2, 0), image.alpha]
    return [image[name] for name in "RGBA"]


def _distribution(name: str, values: np.ndarray, percentiles: tuple[int, ...]) -> dict[str, float]:
    ordered = np.sort(values, axis=None)
    ranks = np.array(percentiles) / 100 * (ordered.size - 1)
    quantiles = np.interp(ranks, np.arange(ordered.size), ordered)
    return {
        f"{name}_mean": values.mean(),
        f"{name}_std": values.std(),
        f"{name}_min": ordered[0],
        f"{name}_max": ordered[-1],
        **{f"{name}_p{p:02d}": value for p, value in zip(percentiles, quantiles, strict=True)},
    }


def _centroid(profile: np.ndarray) -> float:
    """Of light along one side of the image; 0, the middle, where there is none."""
    total = profile.sum()
    places = (np.arange(profile.size) + 0.5) / profile.size - 0.5
    return float((profile * places).sum() / total) if total > 0 else 0.0


def _central_differences(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Along both sides, without the edges; empty where the image is too narrow."""
    return (values[2:] - values[:-2]) / 2, (values[:, 2:] - values[:, :-2]) / 2


def _structure(values: np.ndarray, lag: int) -> float:
    """The mean over both directions."""
    down, across = values[lag:] - values[:-lag], values[:, lag:] - values[:, :-lag]
    return (_mean_square(down) + _mean_square(across)) / 2


def _mean_square(values: np.ndarray) -> float:
    """0 of nothing. No BLAS: its threads cost more than they give here, and their sums differ in the last digits."""
    return float(np.square(values).sum()) / max(1, values.size)
