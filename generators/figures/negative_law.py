"""Figure 2: transmittance of negatively correlated media."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np

from fgf_warp.theory.kernels import density_sm, line_exponent_d1, log1p_ratio, transmittance_ss
from generators.figures.chapter import Chapter, Exhibit, Shot, no_media
from generators.plots import SEQUENTIAL, image_bytes, new_figure, plot_style
from generators.report import Figure

HURSTS = (-0.6, -0.7, -0.8, -0.9, -0.97)
POSITIVE = -0.25
"""For contrast."""
KAPPA = 1.0


def draw(shots: Sequence[Shot]) -> Chapter:
    """Four views of one law: Tr on linear and logarithmic axes, local rate and free-flight density."""
    rate = float(log1p_ratio(KAPPA))
    return Chapter(
        paragraphs=(
            "Below H = -1/2 the fluctuations of the extinction cancel along a ray, as where particles keep their "
            "distance, and the variance of the line average falls faster than the 1/t of white noise. No stationary "
            "non-negative field has this law (Tr is concave near 0), so it is empirical; the renewal transport is the "
            "only one for it.",
            "Is that faster than exponential? Not in the sense of less light than exp(-sigma_m t): every law of "
            "this family, of either sign of correlation, transmits at least that much, since the mean of an "
            "exponential is at least the exponential of the mean. What holds is log-concavity: the local rate "
            "-d ln Tr/du rises with distance, from 0 towards 1, where positive correlation makes it fall from 1 "
            f"towards 0. So the curves fall below every exponential of a lower rate: that of white noise of the same "
            f"kappa, exp(-l u) with l = ln(1 + kappa)/kappa = {rate:.3f}, lies below them up to one mean free path and "
            "above them from there on.",
        ),
        figures={
            "negative-law": Figure(
                "Transmittance for H in (-1, -1/2)",
                "Against mean optical depth u = sigma_m t: transmittance on linear and on logarithmic axes, the local "
                "rate at which it falls, and the density of free flights, which shows that flights of about one mean "
                "free path and more are preferred and short ones avoided. Dotted: the exponential exp(-u), which "
                "nothing falls below. Dashed: white noise, H = -1/2. Grey: pink noise, for "
                f"contrast. kappa = {KAPPA:g} for all.",
                _plot(rate),
                "svg",
            )
        },
    )


def _plot(rate: float) -> bytes:
    with plot_style():
        figure = new_figure(10, 7)
        axes = figure.subplots(2, 2)
        u, ratio = np.linspace(1e-4, 4, 400), np.geomspace(1e-2, 1e2, 400)
        for axis, depth, function in (
            (axes[0, 0], u, transmittance_ss),
            (axes[0, 1], np.linspace(1e-4, 12, 400), transmittance_ss),
            (axes[1, 0], ratio, line_exponent_d1),
            (axes[1, 1], u, density_sm),
        ):
            axis.plot(depth, function(0.0, 0.0, depth), ":", color="black", label="exp(-u)")
            axis.plot(depth, function(0.0, KAPPA, depth), "--", color="black", label=f"H = -0.5, exp(-{rate:.3f} u)")
            axis.plot(depth, function(_b(POSITIVE), KAPPA, depth), color="0.6", label=f"H = {POSITIVE:g}")
            for color, hurst in zip(_colors(len(HURSTS)), HURSTS, strict=True):
                axis.plot(depth, function(_b(hurst), KAPPA, depth), color=color, label=f"H = {hurst:g}")
            axis.set_xlabel("mean optical depth u")
        axes[0, 0].set(title="transmittance", xlim=(0, 4), ylim=(0, 1))
        axes[0, 0].legend()
        axes[0, 1].set(title="transmittance, logarithmic", yscale="log", xlim=(0, 12), ylim=(1e-5, 1))
        axes[1, 0].set(title="local rate -d ln Tr/du", xscale="log", xlim=(1e-2, 1e2), ylim=(0, 1.05))
        axes[1, 1].set(title="free-flight density -dTr/du", xlim=(0, 4), ylim=(0, 1))
        return image_bytes(figure)


def _b(hurst: float) -> float:
    return 1 + 2 * hurst


def _colors(count: int) -> np.ndarray:
    return mpl.colormaps[SEQUENTIAL](np.linspace(0.85, 0.05, count))


EXHIBIT = Exhibit("negative-law", "Figure 2: transmittance of negative correlation", no_media, draw)
