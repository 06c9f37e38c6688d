"""Commands that look at a dataset: verify, status and report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from generators.commands.common import EXIT_CORRUPT, EXIT_PARTIAL, count_of, progress_bar, start_warp, warn

if TYPE_CHECKING:
    from generators.checking.findings import Verification
    from generators.checking.status import Run, Status

SILENT_SECONDS = 60
"""After so long without an event, a run is said to be silent."""
FAILURES_SHOWN = 5
Location = Annotated[
    str, typer.Argument(metavar="DIR", help="The dataset: a folder, or a URL such as s3://bucket/name.")
]


def verify(
    location: Location,
    deep: Annotated[
        bool, typer.Option("--deep", help="Decode every image and compare it with the plan, the record and its view.")
    ] = False,
    repair: Annotated[
        bool,
        typer.Option("--repair", help="Render damaged samples again, to the same bytes, and write labels and card."),
    ] = False,
) -> None:
    """Check that a dataset is whole: every file there, and as it was written.

    Each thing that is wrong is a line: the file, what was found, what was expected. Sizes and hashes of all files are
    always compared. The exit code is 4 where a file is damaged, else 3 where samples are missing or failed, else 0.
    What does not belong is named, and is no damage.

    A repair renders a damaged sample first and replaces it then. What does not belong stays; where it stands in the
    place of something of the dataset, it gets a name that ends in .aside. Hidden files that a killed run left
    half-written go.

    \b
    Example:
      fgf verify datasets/quickstart --deep
      fgf verify datasets/quickstart --repair
    """  # noqa: D301
    from generators.checking.repair import DEVICES, repair_dataset, restore_plan  # noqa: PLC0415
    from generators.checking.verify import check_plan  # noqa: PLC0415
    from generators.dataset.reader import Dataset  # noqa: PLC0415

    damage = check_plan(location)
    if damage is not None:
        typer.echo(damage)
        if not repair:
            typer.echo("1 damaged: nothing else can be checked without the plan")
            raise typer.Exit(EXIT_CORRUPT)
        restore_plan(location)
        typer.echo(f"made {damage.name} anew")
    found = _verify(location, deep=deep)
    if repair and found.is_repairable:
        if found.damaged_samples():
            start_warp(DEVICES[Dataset(location).meta.device])
        for line in repair_dataset(location, found):
            typer.echo(line)
        found = _verify(location, deep=deep)
    if found.is_damaged or found.is_unfinished:
        raise typer.Exit(EXIT_CORRUPT if found.is_damaged else EXIT_PARTIAL)


def status(
    location: Location,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for other programs.")] = False,
) -> None:
    """Tell how far a dataset is: samples by split, what its runs are doing, and the last failures.

    \b
    Example:
      fgf status datasets/quickstart
    """  # noqa: D301
    from generators.checking.status import read_status  # noqa: PLC0415
    from generators.dataset.reader import Dataset  # noqa: PLC0415

    found = read_status(Dataset(location))
    warn(found.notes)
    if as_json:
        typer.echo(found.to_json())
    else:
        _print_status(found)


def report(
    location: Location,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="The page; default: report.html in the dataset.")
    ] = None,
) -> None:
    """Write a page about a dataset, to open in a browser: one HTML file that needs no other and no network.

    It shows distributions of the parameters and of the images' statistics, the pictures by the axes that you choose,
    time and noise, failures, and of each sample its parameters and the command that renders it again.

    \b
    Example:
      fgf report datasets/quickstart
    """  # noqa: D301
    from fgf_warp.output.atomic import check_writable  # noqa: PLC0415
    from generators.dataset.reader import Dataset  # noqa: PLC0415
    from generators.dataset_report.page import write_dataset_report  # noqa: PLC0415

    dataset = Dataset(location)
    if out is not None:
        check_writable(out)
    with progress_bar(counted=True) as progress:
        task = progress.add_task("pictures", total=None)

        def show(done: int, total: int) -> None:
            progress.update(task, completed=done, total=total)

        written = write_dataset_report(dataset, out, show)
    typer.echo(f"wrote {written}")


def _verify(location: str, *, deep: bool) -> Verification:
    """Looks, and tells what it finds."""
    from generators.checking.verify import verify_dataset  # noqa: PLC0415
    from generators.dataset.reader import Dataset  # noqa: PLC0415

    with progress_bar(counted=True) as progress:
        task = progress.add_task("checking", total=None)

        def show(done: int, total: int) -> None:
            progress.update(task, completed=done, total=total)

        found = verify_dataset(Dataset(location), deep=deep, progress=show)
    _print_findings(found)
    return found


def _print_findings(found: Verification) -> None:
    for finding in found.findings:
        typer.echo(finding)
    seen = (
        f"{found.complete:,} of {found.planned:,} samples, {count_of(found.files, 'file')}, {found.bytes / 1e6:,.4g} MB"
    )
    if found.is_whole:
        typer.echo(f"{seen}: all is as it should be")
        return
    kinds = ", ".join(f"{len(of_kind)} {kind}" for kind, of_kind in found.by_kind().items())
    is_fine = not (found.is_damaged or found.is_unfinished)
    typer.echo(f"{seen}: {'all of the dataset is as it should be; beside it ' if is_fine else ''}{kinds}")


def _print_status(found: Status) -> None:
    typer.echo(f"{found.name}  {found.location}")
    typer.echo(f"{found.counts['complete']:,} of {found.planned:,} samples are there\n")
    typer.echo(f"{'split':<12}" + "".join(f"{state:>10}" for state in found.counts))
    for split, counts in found.splits.items():
        typer.echo(f"{split:<12}" + "".join(f"{count:>10,}" for count in counts.values()))
    for run in found.runs:
        typer.echo(
            f"\nrun of shard {run.shard}: {_describe(run)}" if len(found.runs) > 1 else f"\nrun: {_describe(run)}"
        )
    if found.failures:
        hidden = len(found.failures) - FAILURES_SHOWN
        typer.echo(f"\nfailures{f', the last {FAILURES_SHOWN} of {len(found.failures)}' if hidden > 0 else ''}")
        for index, reason in found.failures[-FAILURES_SHOWN:]:
            typer.echo(f"  sample {index}: {reason}")


def _describe(run: Run) -> str:
    done = f"{run.done:,} of {run.total:,} samples"
    if run.left_seconds is None:
        return f"{run.state}, the last sign of it at {run.last[:19]}; {done}"
    silent = run.silent_seconds > SILENT_SECONDS
    silence = f", silent for {_duration(run.silent_seconds)}" if silent else ""
    return f"{run.state}{silence}, {done}, {run.rate:.3g} samples/s, about {_duration(run.left_seconds)} left"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s" if minutes else f"{rest} s"
