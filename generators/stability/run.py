"""All parts of `fgf stability`: measured, judged, and written to a folder."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from fgf_warp.output.atomic import write_bytes
from generators.stability import law
from generators.stability.extremes import Extremes
from generators.stability.furnace import run_experiment
from generators.stability.outcome import CELLS, Outcome
from generators.stability.parameters import measure_parameters

REPORT = "index.html"

Progress = Callable[[str, int, int], None]
"""Called with what is under way, how much of it is done, and how much there is."""


def measure(extremes: Extremes, device: str, progress: Progress | None = None) -> Outcome:
    """Runs all parts on a device.

    Args:
        extremes: what to try.
        device: a Warp device.
        progress: called as it goes on.
    """
    started = time.perf_counter()

    def show(part: str, done: int = 0, total: int = 1) -> None:
        if progress is not None:
            progress(part, done, total)

    show("law")
    of_law = law.measure_law(extremes.bs, extremes.kappas, extremes.depths, device)
    show("flights")
    flights = law.measure_flights(extremes.bs, extremes.kappas, extremes.draws, device)
    show("exact variance")
    exact_fbm = law.measure_exact_fbm(extremes.exact, extremes.draws, device)
    show("phase functions")
    phase = law.measure_phase(extremes.asymmetries, device)
    show("parameters")
    parameters = measure_parameters(
        extremes.hursts,
        extremes.white_noise_scales,
        extremes.extinctions,
        extremes.outer_scales,
        extremes.scales,
    )
    rendered = []
    for experiment in extremes.experiments:
        name = f"renders: {experiment.name}"
        show(name)
        rendered.append(run_experiment(experiment, device, partial(show, name)))
    seconds = time.perf_counter() - started
    return Outcome(
        tuple(of_law),
        tuple(flights),
        tuple(exact_fbm),
        tuple(phase),
        tuple(parameters),
        tuple(rendered),
        device,
        seconds,
    )


def write(outcome: Outcome, folder: Path, command: str) -> Path:
    """Writes the report, and every cell as a row of a table.

    Args:
        outcome: of `measure`.
        folder: where to.
        command: that was given, for the report.

    Returns:
        The report.

    Raises:
        OutputError: where it cannot be written.
    """
    from generators.stability.report import write_stability_report  # noqa: PLC0415 - slow to import

    write_bytes(folder / CELLS, _table(outcome))
    write_stability_report(outcome, folder / REPORT, command)
    return folder / REPORT


def _table(outcome: Outcome) -> bytes:
    """Parquet: part, quantity, the axes, value, bound, whether it is outside, and why it was refused."""
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet as pq  # noqa: PLC0415

    tables = []
    for part, found in outcome.measurements:
        grid = np.indices(found.values.shape).reshape(len(found.axes), -1)
        columns = {
            axis.name: pa.array([axis.values[i] for i in places]) for axis, places in zip(found.axes, grid, strict=True)
        }
        refusals = np.full(found.values.shape, "") if found.refusals is None else found.refusals
        tables.append(
            pa.table(
                {
                    "part": [part] * found.values.size,
                    "quantity": [found.quantity] * found.values.size,
                    **columns,
                    "value": found.values.ravel(),
                    "bound": found.bounds.ravel(),
                    "outside": found.outside.ravel(),
                    "refusal": refusals.ravel().astype(str).tolist(),
                }
            )
        )
    sink = pa.BufferOutputStream()
    pq.write_table(pa.concat_tables(tables, promote_options="default"), sink)
    return bytes(sink.getvalue())
