"""One-point statistics of fBm against the length of the segment: how far they are independent of it."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from fgf_warp.theory.fbm import variance_ratio
from fgf_warp.theory.kernels import log1p_ratio
from generators.figures.chapter import Chapter, Exhibit, Shot, no_media
from generators.plots import SEQUENTIAL, image_bytes, new_figure, plot_style
from generators.report import Figure, Table

HURSTS = (0.1, 0.25, 0.4, 0.5, 0.75, 0.9)
KAPPA, HURST = 1.0, 0.25
OUTER_DEPTHS = (10.0, 100.0, 1000.0, 10000.0)
"""sigma_m L of the curves of Tr."""
FARTHEST = 100.0
"""u of the last point of these curves."""
TABLE_RATIOS = (0.001, 0.01, 0.1)
"""t/L."""


def draw(shots: Sequence[Shot]) -> Chapter:
    """The ratio, its distance from 1 with the order that it should have, and what becomes of Tr."""
    return Chapter(
        paragraphs=(
            "For fractional Brownian motion (0 < H < 1) with an outer scale L the extinction averaged over a segment "
            "has, as long as the segment is short, a variance that does not depend on the segment's length t: the "
            "one-point statistic is independent of scale, and Tr is the power law (1 + kappa u)^(-1/kappa).",
            "How short is short follows from the exact variance at finite t, which the supplement gives in (11): over "
            "the asymptotic one of (13) it is R(t/L) = ((1+tau)^n - tau^n - 1)/(n tau) - tau^(2H)/n, with n = 2H + 2 "
            "and tau = t/L. For small tau, R - 1 = -tau^(2H)/n + (2H+1)/2 tau + ..., so its order is tau^min(1, 2H). "
            "The second term is missing in the supplement's (15) and (20), whose order 2H is right below H = 1/2 "
            "only. For small H the convergence is slow.",
        ),
        figures={
            "scale-independence": Figure(
                "Independence of scale, and its order",
                "Left: exact over asymptotic variance; 1 is independence of scale. Middle: its distance from 1, with "
                "dotted lines of the order min(1, 2H), drawn through the smallest t/L; below H = 1/2 the two terms "
                "cancel at one length, at which the distance dips. Right: transmittance with the exact variance over "
                "the power law, up to one outer scale, for outer scales of 10 to 10000 mean free paths, "
                f"H = {HURST:g}, kappa = {KAPPA:g}: a longer outer scale brings them together, slowly at this H.",
                _plot(),
                "svg",
            )
        },
        tables=(
            Table(
                title="Relative error of the asymptotic variance",
                caption="R(t/L) - 1, and the order of R - 1 in t/L as measured between t/L = 1e-8 and 1e-7.",
                columns=("H", *(f"t/L = {ratio:g}" for ratio in TABLE_RATIOS), "order", "min(1, 2H)"),
                rows=tuple(_row(hurst) for hurst in HURSTS),
            ),
        ),
    )


def measured_order(hurst: float) -> float:
    """d ln|R - 1| / d ln tau between tau = 1e-8 and 1e-7.

    Returns:
        A number without a unit; by the theory the power of tau that R - 1 falls with.
    """
    near, far = np.log(np.abs(variance_ratio(hurst, np.array([1e-8, 1e-7])) - 1))
    return float((far - near) / np.log(10))


def _row(hurst: float) -> tuple[str, ...]:
    errors = (f"{float(variance_ratio(hurst, ratio)) - 1:+.2%}" for ratio in TABLE_RATIOS)
    return f"{hurst:g}", *errors, f"{measured_order(hurst):.3f}", f"{min(1.0, 2 * hurst):g}"


def _plot() -> bytes:
    tau = np.geomspace(1e-6, 1, 400)
    with plot_style():
        figure = new_figure(12, 4)
        ratio, distance, light = figure.subplots(1, 3)
        ratio.axhline(1, color="black", linewidth=0.8)
        for color, hurst in zip(_colors(len(HURSTS)), HURSTS, strict=True):
            exact = variance_ratio(hurst, tau)
            off = np.abs(exact - 1)
            ratio.plot(tau, exact, color=color, label=f"H = {hurst:g}")
            distance.plot(tau, off, color=color)
            distance.plot(tau, off[0] * (tau / tau[0]) ** min(1, 2 * hurst), ":", color=color)
        ratio.set(title="exact over asymptotic variance", xlabel="t / L", xscale="log", ylim=(0.4, 1.6))
        ratio.legend(fontsize=8)
        distance.set(title="distance from 1", xlabel="t / L", xscale="log", yscale="log", ylim=(1e-7, 2))
        _plot_light(light)
        return image_bytes(figure)


def _plot_light(axis: Axes) -> None:
    axis.axhline(1, color="black", linewidth=0.8)
    for color, depth in zip(_colors(len(OUTER_DEPTHS)), OUTER_DEPTHS, strict=True):
        u = np.geomspace(1e-2, min(depth, FARTHEST), 400)
        exact = u * log1p_ratio(KAPPA * u * variance_ratio(HURST, u / depth))
        axis.plot(u, np.exp(u * log1p_ratio(KAPPA * u) - exact), color=color, label=f"sigma_m L = {depth:g}")
    axis.set(title=f"exact over asymptotic Tr, H = {HURST:g}", xlabel="mean optical depth u", xscale="log")
    axis.legend(fontsize=8)


def _colors(count: int) -> np.ndarray:
    return mpl.colormaps[SEQUENTIAL](np.linspace(0.0, 0.85, count))


EXHIBIT = Exhibit("scale", "Independence of scale", no_media, draw)
