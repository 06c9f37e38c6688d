"""The page of `fgf stability`: verdict, worst cells, heat maps, and what they were measured with."""

from __future__ import annotations

import math
import platform
from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.patches import Rectangle

from fgf_warp import __version__
from generators.plots import SEQUENTIAL, image_bytes, new_figure, plot_style
from generators.report import Figure, Section, Table, Verdict, write_report
from generators.stability import furnace
from generators.stability.furnace import BALANCE, COLLISIONS, CUT, RESCALED, SECONDS, SHOWN, Rendered
from generators.stability.measurement import Axis, Measurement, Plane, Value
from generators.stability.outcome import CELLS, Outcome, conclude

REFUSED, OUTSIDE = "#c9ced6", "#d7263d"
Panel = tuple[Measurement, Plane]
"""A map and what it is of."""
LEAST_ERROR = 1e-9
"""Errors below it have one colour."""
VERSIONS = ("warp-lang", "numpy", "scipy")


def write_stability_report(outcome: Outcome, path: Path, command: str) -> None:
    """Writes the page.

    Args:
        outcome: what was measured.
        path: of the HTML file.
        command: that was given.

    Raises:
        OutputError: where it cannot be written.
    """
    with plot_style():
        sections = [
            _summary(outcome),
            _law(outcome),
            _flights(outcome),
            _exact_fbm(outcome),
            _phase(outcome),
            _parameters(outcome),
            _judgement(),
            *(_renders(one) for one in outcome.rendered),
            _environment(outcome, command),
        ]
    write_report(
        path,
        title="Stability at the extremes",
        lead=_lead(outcome),
        sections=sections,
        verdict=Verdict(outcome.outside_count == 0, conclude(outcome)),
    )


def _lead(outcome: Outcome) -> list[str]:
    renders = [one.measurements[BALANCE] for one in outcome.rendered]
    count = sum(int((~np.isnan(m.values)).sum()) for m in renders)
    refused = sum(int(m.refused.sum()) for m in renders)
    cut = sum(int((one.measurements[CUT].values > 0).sum()) for one in outcome.rendered)
    return [
        "The law, its samplers, the parameters and small renders were tried at values where floating point, formulas "
        "and paths come to their limits: H towards every value where the variance is infinite, S_w up to 1e8, sigma_m "
        "from 1e-6 to 1e6, g to +-0.9999, albedo from 0 to 1, and scenes from 1e-4 to 1e5 units.",
        f"{count:,} renders were made on {outcome.device} in {outcome.seconds:,.0f} s with all the rest, and "
        f"{refused:,} combinations were refused because their parameters are not accepted. In {cut:,} renders paths "
        "reached the bound on their length; they are counted below, and the light that they carry is part of the "
        "balance.",
        "In every map, hatched grey is refused, white is not measured, and a red frame is outside its bound. A map "
        f"shows two axes, and the largest value over all others. Every cell is a row of {CELLS}, beside this page.",
    ]


# ---- tables


def _summary(outcome: Outcome) -> Section:
    rows: list[tuple[str, ...]] = []
    failed: set[int] = set()
    for part, found in outcome.measurements:
        worst = found.worst()
        if found.bound is None or worst is None:
            continue
        outside = int(found.outside.sum())
        if outside:
            failed.add(len(rows))
        measured = int((~np.isnan(found.values)).sum())
        value, bound = float(found.values[worst]), float(found.bounds[worst])
        share = f"{found.shares[worst]:.0%}" if math.isfinite(found.shares[worst]) else "beyond"
        rows.append(
            (
                part,
                found.quantity,
                f"{value:.2g}",
                f"{bound:.2g}",
                share,
                f"{measured:,}",
                f"{outside:,}",
                found.describe(worst),
            )
        )
    table = Table(
        "The worst cell of each quantity",
        "The share is the value over its bound: 100 % is the limit.",
        ("part", "quantity", "worst", "bound", "share", "cells", "outside", "where"),
        tuple(rows),
        frozenset(failed),
    )
    failures = tuple((message,) for one in outcome.rendered for message in one.failures)
    parts: list[Figure | Table] = [table]
    if failures:
        parts.append(
            Table(
                "Renders with samples that are not finite",
                "As the renderer refuses them.",
                ("message",),
                failures,
                frozenset(range(len(failures))),
            )
        )
    return Section("Bounds and margins", (), tuple(parts))


def _environment(outcome: Outcome, command: str) -> Section:
    rows = [
        ("command", command),
        ("device", outcome.device),
        ("fgf-warp", __version__),
        *((name, version(name)) for name in VERSIONS),
        ("python", platform.python_version()),
        ("platform", f"{platform.system()} {platform.machine()}"),
        ("seed", "0; the seed of each render follows from its place in the grid"),
        (
            "renders",
            f"{furnace.SETTINGS.width} x {furnace.SETTINGS.height} pixels, {furnace.SETTINGS.spp} samples per pixel, "
            f"{furnace.NOISY_SPP} where there is noise; paths are cut after {furnace.SETTINGS.max_depth} events",
        ),
        ("seconds", f"{outcome.seconds:.1f}, kernels that were not yet built included"),
    ]
    return Section("Environment", (), (Table("Made with", "", ("", ""), tuple(rows)),))


# ---- sections


def _law(outcome: Outcome) -> Section:
    return Section(
        "The law in float32",
        (
            "f is the exponent of the transmittance, f' and f'' its derivatives; below them the four kernels between "
            "uncorrelated ends (s) and medium vertices (m). Each is compared with its float64 twin at the same "
            "parameters, over mean optical depth u and kappa; a cell is the worst of all b. Where a kernel is the "
            "exponential of f, a relative error of f becomes one of f times as much, and so does the bound.",
        ),
        (
            _figure(
                "Relative error of float32 against float64",
                "Errors grow towards thick segments, where Tr is the exponential of a large number. Values below the "
                "smallest float32 must be found as zero, and then have no error.",
                [[(m, m.plane("kappa", "u")) for m in outcome.law if len(m.axes) == 3]],
                wrap=4,
                norm=LogNorm(LEAST_ERROR, 1e-2),
            ),
        ),
    )


def _flights(outcome: Outcome) -> Section:
    errors, escaped = (
        [m for m in outcome.flights if m.bound is not None],
        [m for m in outcome.flights if m.bound is None],
    )
    return Section(
        "Flights",
        (
            "Free flights from an uncorrelated end (sample_sm) and between medium vertices (sample_mm), drawn from the "
            "same random numbers as their float64 twins, the smallest and the largest of the generator among them.",
            "For b = 1 and large kappa most flights are beyond every scene: they saturate at u = 1e30, which is "
            "legitimate. They are counted, not compared.",
        ),
        (
            _figure(
                "Relative error of a flight, the largest of all draws",
                "Between medium vertices u^b is drawn, so that for small b the error grows as 1/b, as does the bound. "
                "There is no such flight for b < 0.",
                [[(m, m.plane("b", "kappa")) for m in errors]],
                norm=LogNorm(1e-7, 1e-2),
            ),
            _figure(
                "Share of flights that escape",
                "",
                [[(m, m.plane("b", "kappa")) for m in escaped]],
                norm=Normalize(0, 1),
            ),
        ),
    )


def _exact_fbm(outcome: Outcome) -> Section:
    of_law, flights = (
        [m for m in outcome.exact_fbm if len(m.axes) == 4],
        [m for m in outcome.exact_fbm if len(m.axes) == 3],
    )
    return Section(
        "Fractional Brownian motion with its exact variance",
        (
            "The same functions and flights with the exact variance of a finite segment, as far as the transmittance "
            "falls, which for large kappa is well before ten outer scales. A flight is judged by the uniform number "
            "that survives as far: it may be off by what the stated error of the flight makes of it.",
        ),
        (
            _figure(
                "Relative error of float32 against float64",
                "A cell is the worst of all H and sigma_m L.",
                [[(m, m.plane("kappa", "t/L")) for m in of_law]],
                wrap=4,
                norm=LogNorm(LEAST_ERROR, 1e-2),
            ),
            _figure("Flights", "", [[(m, m.plane("H", "kappa")) for m in flights]], norm=Normalize(0, 1)),
        ),
    )


def _phase(outcome: Outcome) -> Section:
    planes = [(m, m.plane(m.axes[0].name, m.axes[1].name)) for m in outcome.phase]
    return Section(
        "Phase functions",
        (
            "Values, sampled angles and lengths of sampled directions. A direction is itself rounded to float32, which "
            "beside a peak of |g| = 0.9999 changes the value by far more than the formula's own error; so the bound of "
            "eval_phase is wider there.",
        ),
        (_figure("Errors of values, directions and angles", "", [planes], norm=LogNorm(LEAST_ERROR, 1e-2)),),
    )


def _parameters(outcome: Outcome) -> Section:
    kappa = next(m for m in outcome.parameters if m.bound is not None and m.quantity == "kappa")
    middle: dict[str, Any] = {"sigma_m": 1.0, "S_w": 1.0, "L": 10.0, "scale": 1.0}
    pairs = (("H", "S_w"), ("H", "sigma_m"), ("H", "L"))
    planes = [
        (kappa, kappa.plane(*pair, **{name: value for name, value in middle.items() if name not in pair}))
        for pair in pairs
    ]
    assert kappa.refusals is not None
    reasons = Counter(kappa.refusals.ravel().tolist())
    accepted = reasons.pop("")
    rows = (
        ("accepted", f"{accepted:,}"),
        *((f"refused: {reason}", f"{count:,}") for reason, count in reasons.most_common()),
    )
    return Section(
        "Parameters",
        (
            "Nothing that a user writes is clamped. Each combination of H, S_w, sigma_m and L, in several units of "
            "length, is either refused with an error that names the parameter and the accepted range, or has the kappa "
            "of the theory's own formulas, evaluated one by one. On the device, every parameter of every medium that "
            "was rendered is that value in float32: the rows 'parameters changed on the device' of the first table.",
        ),
        (
            _figure(
                "kappa, where it is accepted",
                "With sigma_m = 1, S_w = 1 and L = 10 where they are not on an axis.",
                [planes],
                norm=LogNorm(1e-8, 1e8),
            ),
            Table("Combinations", "Counted over the whole grid.", ("", "combinations"), rows),
        ),
    )


def _judgement() -> Section:
    return Section(
        "What the renders are judged by",
        (
            "The balance: radiance + (1 - albedo) x scattering events + what was cut = 1. It holds wherever the path "
            "scatters and leaves, so it sees samples that are NaN, light that is lost or gained, weights, and albedos "
            "that are clamped, and it cannot see wrong flights, a wrong law or wrong geometry.",
            "The absorbing sphere sees those: where nothing scatters, what passes through the centre of a sphere of "
            "radius R is Tr(2 R sigma_m), and nothing else is. Each path passes or does not, so the error of the mean "
            f"is the binomial one; with {furnace.SETTINGS.width * furnace.SETTINGS.height * furnace.NOISY_SPP:,} paths "
            "it sees a transmittance of 1/2 that is off by 0.017. It says nothing of flights between scattering "
            "events, for which the section on flights and the laws' own tests are there.",
            "The balance of a chromatic medium is noisy, as a path that is drawn for one channel has a weight in the "
            "others; it holds in the mean where those weights fit the flights, and all three channels are judged.",
        ),
        (),
    )


def _renders(one: Rendered) -> Section:
    experiment, found = one.experiment, one.measurements
    balance = found[BALANCE]
    quantities = [name for name in (BALANCE, SHOWN, RESCALED, COLLISIONS, CUT, SECONDS) if name in found]
    count, refused = int((~np.isnan(balance.values)).sum()), int(balance.refused.sum())
    paragraphs = [experiment.question, _balance_text(one)]
    if refused:
        paragraphs.append(f"{count:,} renders, and {refused:,} combinations refused.")
    transports = next(axis for axis in experiment.axes if axis.name == "transport")
    names = [axis.name for axis in experiment.axes]
    figures = []
    for rows, columns in experiment.planes:
        elsewhere = {
            name: value for name, value in experiment.middle.items() if name in names and name not in (rows, columns)
        }
        grid = [
            [_panel(found[name], rows, columns, transport, elsewhere) for name in quantities]
            for transport in transports.values
        ]
        what = ", ".join(f"{name} = {value:g}" for name, value in elsewhere.items())
        caption = f"What is bounded: the worst over all else; the rest: at {what}." if what else ""
        figures.append(
            _figure(f"{rows} and {columns}", caption, grid, row_labels=[str(name) for name in transports.values])
        )
    return Section(f"Renders: {experiment.name}", tuple(paragraphs), tuple(figures))


def _panel(found: Measurement, rows: str, columns: str, transport: Value, elsewhere: dict[str, Any]) -> Panel:
    """Of what has a bound the worst of all, as a share of the bound; of what has none, at values in the middle."""
    if found.bound is not None:
        return found, found.plane(rows, columns, of_bound=True, transport=transport)
    return found, found.plane(rows, columns, transport=transport, **elsewhere)


def _balance_text(one: Rendered) -> str:
    exact = (
        "Radiance, what was absorbed, and the paths that were cut add up to 1 path by path, so that the balance is "
        f"without noise and its bound the rounding of float32, {furnace.FLOOR:g}."
    )
    if one.experiment.shows_law:
        return f"{exact} What passes is the law's transmittance in the mean; {_noise_text(one)}"
    if one.experiment.is_noisy:
        return f"Radiance, what was absorbed, and the paths that were cut add up to 1 in the mean; {_noise_text(one)}"
    return exact


def _noise_text(one: Rendered) -> str:
    count = int((~np.isnan(one.measurements[BALANCE].values)).sum())
    return (
        f"the bound is {furnace.STANDARD_ERRORS:g} standard errors, one event rarer than the samples can show "
        f"included. A render beyond it is repeated once with other random numbers and {furnace.SECOND_LOOK} times the "
        f"samples, which decides: of {count:,} renders {one.looked_again:,} were, and by chance alone "
        f"{0.0027 * count:.1f} would be."
    )


# ---- maps


def _figure(
    title: str,
    caption: str,
    panels: Sequence[Sequence[Panel]],
    *,
    norm: Any = None,
    wrap: int = 0,
    row_labels: Sequence[str] = (),
) -> Figure:
    """Maps in rows, or one row of them wrapped after so many.

    Colours are those of `norm` for all of them, or where it is None those of each column's quantity.
    """
    rows = [list(row) for row in panels]
    if wrap:
        rows = [rows[0][i : i + wrap] for i in range(0, len(rows[0]), wrap)]
    width = max(len(row) for row in rows)
    tallest = max(len(plane.rows.values) for row in rows for _, plane in row)
    figure = new_figure(3.4 * width + 0.6, len(rows) * (1.2 + 0.13 * max(tallest, 10)))
    # Labels are most of the work: where the maps have the same axes, only the outer ones have labels.
    is_shared = len({(plane.rows, plane.columns) for row in rows for _, plane in row}) == 1
    axes = figure.subplots(len(rows), width, squeeze=False)
    for i, row in enumerate(rows):
        for ax in axes[i, len(row) :]:
            ax.set_axis_off()
        for j, (found, plane) in enumerate(row):
            image = _draw(axes[i, j], plane, norm or _norm_of(found, plane))
            if is_shared and j > 0:
                axes[i, j].tick_params(labelleft=False)
                axes[i, j].set_ylabel("")
            if is_shared and i + 1 < len(rows) and j < len(rows[i + 1]):
                axes[i, j].tick_params(labelbottom=False)
                axes[i, j].set_xlabel("")
            axes[i, j].set_title(_title(found, plane) + (f"\n{row_labels[i]}" if row_labels else ""), fontsize=9)
            if norm is None and i == 0:
                _color_bar(figure, image, axes[:, j])
    if norm is not None:
        _color_bar(figure, image, axes)
    return Figure(title, caption, image_bytes(figure), "svg")


def _color_bar(figure: Any, image: Any, axes: Any) -> None:
    bar = figure.colorbar(image, ax=axes, fraction=0.05, pad=0.01, aspect=30, format="{x:g}")
    bar.ax.minorticks_off()
    bar.ax.tick_params(labelsize=7)


def _title(found: Measurement, plane: Plane) -> str:
    return f"{found.quantity}, share of the bound" if plane.is_share else found.quantity


def _norm_of(found: Measurement, plane: Plane) -> Any:
    if plane.is_share or found.quantity == CUT:
        return Normalize(0, 1)
    return LogNorm(*{COLLISIONS: (1e-3, 1e3), SECONDS: (1e-4, 1.0)}[found.quantity])


def _draw(ax: Any, plane: Plane, norm: Any) -> Any:
    shown = np.ma.masked_invalid(np.clip(plane.values, norm.vmin, norm.vmax))
    ax.set_facecolor("white")
    ax.grid(False)
    image = ax.imshow(shown, aspect="auto", cmap=SEQUENTIAL, norm=norm, interpolation="none")
    _cover(ax, plane.refused & np.isnan(plane.values), facecolor=REFUSED, edgecolor="white", hatch="///", lw=0)
    _cover(ax, plane.outside, facecolor="none", edgecolor=OUTSIDE, lw=1.8)
    _label(ax.set_xticks, plane.columns, most=12, rotation=60)
    _label(ax.set_yticks, plane.rows, most=26, rotation=0)
    ax.set_xlabel(plane.columns.name)
    ax.set_ylabel(plane.rows.name)
    return image


def _cover(ax: Any, where: np.ndarray, **style: Any) -> None:
    """Draws over cells."""
    cells = [Rectangle((column - 0.5, row - 0.5), 1, 1) for row, column in np.argwhere(where)]
    # Inside the map, so that the layout need not look at each.
    ax.add_collection(PatchCollection(cells, **style), autolim=False).set_in_layout(False)


def _label(set_ticks: Any, axis: Axis, most: int, rotation: float) -> None:
    places = range(0, len(axis.values), math.ceil(len(axis.values) / most))
    set_ticks(places, [axis.label(place) for place in places], fontsize=7, rotation=rotation)
