"""The page of `fgf tradeoff`: the front, what keeps which error, and each pair with its pictures."""

from __future__ import annotations

import io
from collections.abc import Iterable
from pathlib import Path
from statistics import geometric_mean
from typing import Any

import matplotlib as mpl
import matplotlib.image
import numpy as np

from fgf_warp.output.color import to_display
from generators.plots import DIVERGING, plot_style
from generators.report import Figure, Gallery, Section, Table, Verdict, write_report
from generators.tradeoff.front import BASE, Front, Pair, Rung
from generators.tradeoff.measure import Measured, Outcome
from generators.tradeoff.metrics import relative_difference
from generators.tradeoff.plots import PRESETS_SHOWN, bias_plot, draw_front, per_megapixel, rung_names, trade_plot

TARGETS = (0.10, 0.05, 0.02, 0.01)
"""Relative errors that people ask for."""
ERROR_SHOWN = 0.2
"""Relative error at which the colours of the error pictures end."""
REFERENCE_MARGIN = 4.0
"""The reference's error should be so many times below any that is measured against it."""
MEDIUM_COLUMNS = ("H", "g", "S_w", "sigma_m")


def write_tradeoff_report(outcome: Outcome, path: Path, command: str) -> None:
    """Writes the page.

    Args:
        outcome: what was measured.
        path: of the HTML file.
        command: that was given.

    Raises:
        OutputError: where it cannot be written.
    """
    front = outcome.front
    with plot_style():
        sections = [
            _overview(front),
            _kept(front),
            *(_pair_section(front, one) for one in outcome.measured),
            _method(outcome, command),
        ]
    write_report(path, title="Time against error", lead=_lead(front), sections=sections, verdict=_verdict(front))


# ---- words and tables


def _lead(front: Front) -> list[str]:
    rungs = len(front.pairs[0].rungs)
    return [
        f"{len(front.pairs)} scenes and media were each rendered with up to {rungs} choices of settings, "
        f"{front.replicates} independent images of {front.pixels} x {front.pixels} pixels each, and compared with a "
        "long render. Errors are relative to the mean radiance of blocks of 8 x 8 pixels. Noise falls as one over the "
        "root of the samples per pixel; bias stays, whatever the samples.",
        f"Times are CPU seconds of all threads together, for a million pixels, on {front.machine}. The few "
        "milliseconds that any render takes before its first sample are not in them.",
    ]


def _verdict(front: Front) -> Verdict:
    margins = [
        (rung.relative_rmse / pair.reference.relative_standard_error, pair.name, rung.name)
        for pair in front.pairs
        for rung in pair.rungs
        if pair.reference.relative_standard_error > 0
    ]
    if not margins:
        return Verdict(True, "No image differs from its reference.")
    margin, pair, rung = min(margins)
    worst = max(pair.reference.relative_standard_error for pair in front.pairs)
    text = (
        f"The references are known to {worst:.2%} or better, and at least {margin:.1f} times better than any image "
        "that is compared with them."
    )
    if margin < REFERENCE_MARGIN:
        text += f" Below {REFERENCE_MARGIN:g}, the errors of the best are uncertain: {pair}, {rung}."
    return Verdict(margin >= REFERENCE_MARGIN, text)


def _overview(front: Front) -> Section:
    return Section(
        "At a glance",
        (
            "Each mark is a choice of settings: the preset balanced with one thing changed. Marks on the line are the "
            "best at their time. The dashed line is what balanced does with fewer or more samples: a mark below it "
            "brings more than samples do, one above brings less.",
        ),
        (
            Figure(
                "Error against time, over all scenes and media",
                "Geometric means over the pairs; both axes are logarithmic. What only some media have, such as another "
                "transport, is placed by its ratios to balanced on these.",
                draw_front(front),
                "svg",
            ),
            _rung_table(front),
        ),
    )


def _rung_table(front: Front) -> Table:
    rows = []
    for name in rung_names(front):
        rungs = [rung for pair in front.pairs for rung in pair.rungs if rung.name == name]
        bases = [pair.rung(BASE) for pair in front.pairs for rung in pair.rungs if rung.name == name]
        gains = [rung.efficiency for rung in rungs if rung.efficiency is not None]
        rows.append(
            (
                name,
                f"{geometric_mean([rung.seconds / base.seconds for rung, base in zip(rungs, bases, strict=True)]):.2f}",
                f"{_median(rung.noise for rung in rungs):.2%}",
                f"{_median(rung.bias_rms for rung in rungs):.2%}",
                f"{max(rung.bias_rms for rung in rungs):.1%}",
                f"{geometric_mean(gains):.2g}" if gains else "-",
                f"{min(gains):.2g} to {max(gains):.2g}" if gains else "-",
                f"{_median(rung.flip for rung in rungs):.3f}",
                f"{_median(rung.delta_e for rung in rungs):.2f}",
            )
        )
    return Table(
        "Every choice in one line",
        "Time and efficiency, 1 / (relative MSE x time), are over those of balanced: geometric means, and the range "
        "over the pairs. Noise, bias, FLIP and CIE 2000 colour difference are medians over the pairs.",
        ("settings", "time", "noise", "bias (rms)", "largest", "efficiency", "range", "FLIP", "delta E"),
        tuple(rows),
    )


def _kept(front: Front) -> Section:
    media = [tuple(_shown(pair.medium.get(key)) for key in MEDIUM_COLUMNS) for pair in front.pairs]
    names = [name for name in PRESETS_SHOWN if name in rung_names(front)]
    return Section(
        "What keeps which error",
        (),
        (
            Table(
                "The presets",
                "Their relative error, noise and bias together, and the least of "
                f"{', '.join(f'{target:.0%}' for target in reversed(TARGETS))} that it keeps.",
                (*MEDIUM_COLUMNS, *names, "scene and medium"),
                tuple(
                    (*medium, *(_error_text(pair.rung(name)) for name in names), pair.name)
                    for medium, pair in zip(media, front.pairs, strict=True)
                ),
            ),
            Table(
                "The quickest settings for an error",
                "What is changed beside the samples per pixel, how many of these are needed, and the CPU seconds for a "
                "million pixels. Where a setting has a bias, it must leave room for the noise.",
                (*MEDIUM_COLUMNS, *(f"for {target:.0%}" for target in TARGETS)),
                tuple(
                    (*medium, *(_cheapest(pair, target, front.pixels) for target in TARGETS))
                    for medium, pair in zip(media, front.pairs, strict=True)
                ),
            ),
        ),
    )


def _error_text(rung: Rung) -> str:
    kept = [target for target in TARGETS if rung.relative_rmse <= target]
    return f"{rung.relative_rmse:.2%} ({f'keeps {min(kept):.0%}' if kept else f'not {TARGETS[0]:.0%}'})"


def _cheapest(pair: Pair, target: float, pixels: int) -> str:
    found = [(seconds, rung) for rung in pair.rungs if (seconds := rung.seconds_for(target)) is not None]
    if not found:
        return "none"
    seconds, rung = min(found, key=lambda one: one[0])
    spp = max(round(rung.spp_for(target) or 0), 1)
    return f"{_setting_text(rung)}: {spp} spp, {per_megapixel(seconds, pixels):.3g} s"


def _setting_text(rung: Rung) -> str:
    """What it changes beside the samples, whose number is told apart."""
    changed = {name: value for name, value in rung.settings.items() if name != "spp"}
    return ", ".join(f"{name} {value}" for name, value in changed.items()) or BASE


def _method(outcome: Outcome, command: str) -> Section:
    front = outcome.front
    rows = tuple(
        (
            one.pair.name,
            f"{one.reference.spp:,}",
            f"{one.pair.reference.relative_standard_error:.3%}",
            f"{one.pair.reference.seconds:.1f}",
            f"{one.reference.truncated_share:.1g}" if one.reference.truncated_share else "none",
            f"{one.pair.features['optical_depth']:.3g}",
            f"{one.pair.features['scatterings']:.3g}",
            "cache" if one.reference.cached else "rendered now",
        )
        for one in outcome.measured
    )
    versions = ", ".join(f"{name} {version}" for name, version in front.versions.items())
    return Section(
        "How it was measured",
        (
            f"Of every choice of settings, {front.replicates} images with seeds of their own were rendered, and of the "
            "reference as many parts, with independent samples, up to 65536 scattering events and seeds of their own. "
            "The first image is compared with the first part, the second with the second, and so on: these differences "
            "are independent and alike, so the interval of Student's t from their spread covers the true bias with "
            "95 % probability, the uncertainty of the reference included.",
            "Noise is the variance between the images. The squared bias is the mean product of two different "
            "differences, in which noise cancels; its interval is by the jackknife. Relative MSE is the sum of both, "
            "so the reference's own error is in none of them. Time is the median over the images, with the kernel "
            "built and warm. FLIP and the colour difference are of the first image, displayed at exposure 0.",
            f"{versions}. {command}",
        ),
        (
            Table(
                "References",
                "Samples per pixel, relative standard error, CPU time [s], share of the paths that were cut; mean "
                "optical depth of the pixels that see a medium, and mean number of events of a path that scatters.",
                ("pair", "spp", "error", "time", "cut", "depth", "events", "from"),
                rows,
            ),
        ),
    )


def _pair_section(front: Front, one: Measured) -> Section:
    pair = one.pair
    medium = ", ".join(f"{name} = {_shown(value)}" for name, value in pair.medium.items() if value is not None)
    return Section(
        pair.name,
        (medium or "No medium.",),
        (
            Gallery(
                "Time and error",
                "Marks on the line are the best at their time. Bars of the bias are its 95 % interval.",
                (
                    Figure("Relative MSE", "", trade_plot(front, pair, lambda rung: rung.relative_mse), "svg"),
                    Figure("RMSE", "In units of radiance.", trade_plot(front, pair, lambda rung: rung.rmse), "svg"),
                    Figure("Bias", "Signed mean, relative.", bias_plot(pair), "svg"),
                ),
                330,
            ),
            _pair_table(front, pair),
            _strip(one),
        ),
    )


def _pair_table(front: Front, pair: Pair) -> Table:
    return Table(
        "Numbers",
        "Time in CPU seconds for a million pixels. A star marks the front.",
        (
            *("settings", "spp", "time", "RMSE", "relative MSE", "noise", "bias", "95 %", "bias (rms)"),
            *("below", "FLIP", "delta E", "efficiency"),
        ),
        tuple(
            (
                f"{rung.name}{' *' if rung.pareto else ''}",
                f"{rung.spp}",
                f"{per_megapixel(rung.seconds, front.pixels):.3g}",
                f"{rung.rmse:.2e}",
                f"{rung.relative_mse:.2e}",
                f"{rung.noise:.2%}",
                f"{rung.bias:+.2%}",
                f"{rung.bias_low:+.2%} to {rung.bias_high:+.2%}",
                f"{rung.bias_rms:.2%}",
                f"{rung.bias_rms_high:.2%}",
                f"{rung.flip:.3f}",
                f"{rung.delta_e:.2f}",
                "-" if rung.efficiency is None else f"{rung.efficiency:.2g}",
            )
            for rung in pair.rungs
        ),
    )


def _strip(one: Measured) -> Gallery:
    reference = one.reference.picture
    figures = [Figure("reference", f"{one.reference.spp:,} samples per pixel", _png(to_display(reference)), "png")]
    for rung in one.pair.rungs:
        picture = one.pictures[rung.name]
        shown = _side_by_side(to_display(picture), _error_colors(relative_difference(picture, reference)))
        note = f"noise {rung.noise:.1%}, bias {rung.bias:+.1%}, FLIP {rung.flip:.3f}"
        figures.append(Figure(rung.name, note, _png(shown), "png"))
    return Gallery(
        "Pictures and their errors",
        f"Beside each picture its relative error: red is too bright and blue too dark, and the colours end at "
        f"{ERROR_SHOWN:.0%}.",
        tuple(figures),
        190,
    )


# ---- pictures


def _error_colors(error: np.ndarray) -> np.ndarray:
    colors = mpl.colormaps[DIVERGING](0.5 + 0.5 * np.clip(error / ERROR_SHOWN, -1, 1))
    return np.rint(colors[..., :3] * 255).astype(np.uint8)


def _side_by_side(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    gap = np.full((left.shape[0], 1, 3), 255, np.uint8)
    return np.concatenate([left, gap, right], axis=1)


def _png(pixels: np.ndarray) -> bytes:
    with io.BytesIO() as file:
        matplotlib.image.imsave(file, pixels, format="png")
        return file.getvalue()


def _median(values: Iterable[float]) -> float:
    return float(np.median(list(values)))


def _shown(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, list):
        return ", ".join(f"{item:.3g}" for item in (value[:1] if len(set(value)) == 1 else value))
    return f"{value:.4g}" if isinstance(value, float | int) else str(value)
