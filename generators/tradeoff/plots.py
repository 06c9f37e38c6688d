"""The plots of `fgf tradeoff`: time against error, and bias."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import geometric_mean

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, NullFormatter

from generators.plots import image_bytes, new_figure, plot_style
from generators.tradeoff.front import BASE, Front, Pair, Rung

PRESETS_SHOWN = ("preview", BASE)
FAMILIES: dict[str, tuple[str, str, tuple[int, int]]] = {
    "spp": ("samples per pixel", "#1f5fae", (-3, -11)),
    "sampler": ("sampler", "#d98200", (-4, 7)),
    "max_depth": ("maximum depth", "#b3261e", (-9, 5)),
    "roulette_depth": ("roulette depth", "#1a7f4e", (5, -3)),
    "similarity_order": ("similarity order", "#7a3fb5", (4, 4)),
    "transport": ("transport", "#008c9e", (4, 4)),
    "line_variance": ("line variance", "#8a6d3b", (4, 4)),
    "upscale": ("upscaling", "#c2418f", (4, 4)),
    "denoise": ("denoising", "#5b6470", (4, -9)),
}
"""Name and colour of each knob, and where its labels are beside their marks [point], so that few are on others."""
PRESETS_LOOK = ("presets", "#111111", (6, 5))


@dataclass(frozen=True)
class Point:
    """A rung in a plot.

    Args:
        rung: that it stands for.
        time: [s/Mpixel].
        error: > 0.
    """

    rung: Rung
    time: float
    error: float


def draw_front(front: Front) -> bytes:
    """The leading figure as SVG: every choice of settings on the way from quick to accurate, over all pairs."""
    with plot_style():
        figure = new_figure(7.2, 4.8)
        axes = figure.add_subplot()
        points = _mean_points(front)
        if points:
            _draw_points(axes, points)
            _draw_more_samples(axes, points)
            _percent_axis(axes, points)
            axes.legend(loc="upper right", fontsize=8)
        axes.set_ylabel("relative error, by blocks of 8 x 8 pixels")
        axes.set_title(f"Mean of {len(front.pairs)} scenes and media: left and low is good", loc="left")
        return image_bytes(figure)


def trade_plot(front: Front, pair: Pair, error_of: Callable[[Rung], float]) -> bytes:
    """Time and error of each rung of a pair, as SVG.

    Args:
        front: that the pair is of, for the size of its images.
        pair: the pair.
        error_of: the error of a rung, >= 0; those without are left out.
    """
    figure = new_figure(4.4, 3.4)
    axes = figure.add_subplot()
    points = [
        Point(rung, per_megapixel(rung.seconds, front.pixels), error_of(rung))
        for rung in pair.rungs
        if error_of(rung) > 0
    ]
    if points:
        _draw_points(axes, points)
    else:
        axes.text(0.5, 0.5, "no error at all", ha="center", transform=axes.transAxes)
    return image_bytes(figure)


def _draw_points(axes: Axes, points: Sequence[Point]) -> None:
    """Marks coloured by what they change, and the line through those that nothing beats."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    best = sorted((p for p in points if not any(_beats(other, p) for other in points)), key=lambda p: p.time)
    axes.plot([p.time for p in best], [p.error for p in best], color="#9aa4b2", linewidth=2.5, zorder=1)
    named: set[str] = set()
    for point in points:
        family, color, place = _family(point.rung)
        axes.plot(
            point.time,
            point.error,
            marker="D" if family == "presets" else "o",
            markersize=6,
            linestyle="",
            color=color,
            label=None if family in named else family,
            zorder=3,
        )
        named.add(family)
        axes.annotate(
            _label(point.rung),
            (point.time, point.error),
            xytext=place,
            textcoords="offset points",
            fontsize=7.5,
            color=color,
        )
    axes.margins(0.12)
    axes.set_xlabel("CPU time [s / million pixels]")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _draw_more_samples(axes: Axes, points: Sequence[Point]) -> None:
    base = next(point for point in points if point.rung.name == BASE)
    times = np.array([min(point.time for point in points) / 1.5, max(point.time for point in points) * 1.5])
    errors = base.error * np.sqrt(base.time / times)
    axes.plot(times, errors, "--", color="#6b7685", linewidth=1, zorder=0, label="balanced, fewer or more samples")


def bias_plot(pair: Pair) -> bytes:
    """The bias of each rung of a pair with its 95 % interval, as SVG."""
    figure = new_figure(4.4, 3.4)
    axes = figure.add_subplot()
    for row, rung in enumerate(reversed(pair.rungs)):
        _, color, _ = _family(rung)
        axes.plot([rung.bias_low, rung.bias_high], [row, row], color=color, linewidth=2)
        axes.plot(rung.bias, row, "o", color=color, markersize=4)
    axes.axvline(0.0, color="#1d2430", linewidth=0.8)
    axes.set_yticks(range(len(pair.rungs)), [rung.name for rung in reversed(pair.rungs)], fontsize=8)
    axes.set_xscale("symlog", linthresh=0.005)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.1%}"))
    axes.tick_params(axis="x", labelsize=7.5)
    return image_bytes(figure)


def _percent_axis(axes: Axes, points: Sequence[Point]) -> None:
    low, high = min(point.error for point in points) / 1.4, max(point.error for point in points) * 1.4
    ticks = [tick for tick in (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0) if low <= tick <= high]
    axes.set_yticks(ticks, [f"{tick:.0%}" if tick >= 0.01 else f"{tick:.1%}" for tick in ticks])
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylim(low, high)


def _mean_points(front: Front) -> list[Point]:
    """Of every rung, over the pairs that have it and where nothing is without error; as ratios to balanced."""
    pairs = [pair for pair in front.pairs if all(rung.relative_rmse > 0 for rung in pair.rungs)]
    if not pairs:
        return []
    bases = [pair.rung(BASE) for pair in pairs]
    time = geometric_mean([per_megapixel(base.seconds, front.pixels) for base in bases])
    error = geometric_mean([base.relative_rmse for base in bases])
    points = []
    for name in rung_names(front):
        found = [(rung, pair.rung(BASE)) for pair in pairs for rung in pair.rungs if rung.name == name]
        if found:
            slower = geometric_mean([rung.seconds / base.seconds for rung, base in found])
            worse = geometric_mean([rung.relative_rmse / base.relative_rmse for rung, base in found])
            points.append(Point(found[0][0], time * slower, error * worse))
    return points


def _beats(one: Point, other: Point) -> bool:
    return one.time <= other.time and one.error <= other.error and (one.time, one.error) != (other.time, other.error)


def _family(rung: Rung) -> tuple[str, str, tuple[int, int]]:
    changed = [name for name in rung.settings if name != "spp"] or list(rung.settings)
    return FAMILIES[changed[0]] if len(changed) == 1 and rung.name not in PRESETS_SHOWN else PRESETS_LOOK


def _label(rung: Rung) -> str:
    """Short where the colour says the rest: the value of the one setting that is changed."""
    (value, *others) = rung.settings.values() or (True,)
    return rung.name if others or value is True or rung.name in PRESETS_SHOWN else str(value)


def rung_names(front: Front) -> list[str]:
    """In the order of the ladder; some pairs have rungs that others have not."""
    return list(dict.fromkeys(rung.name for pair in front.pairs for rung in pair.rungs))


def per_megapixel(seconds: float, pixels: int) -> float:
    """Time of a million pixels [s], of the time of an image of so many pixels each way."""
    return seconds / pixels**2 * 1e6
