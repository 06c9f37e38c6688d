"""``fgf generate``: makes a dataset."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fgf_warp.errors import ConfigError, FgfError, OutputError
from fgf_warp.settings import RenderSettings
from generators.commands.common import (
    EXIT_PARTIAL,
    Device,
    Memory,
    Overrides,
    fail,
    progress_bar,
    start_warp,
    warn,
)
from generators.commands.numbers import whole_option
from generators.commands.plan import make_plan

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from generators.planning.document import LoadedConfig
    from generators.running.run import Progress, Report

FAILURES_SHOWN = 10
WORKERS_MAX = 10_000
"""And cores of each: more would only be a slip."""
INTEGER_DIGITS = 18
SAMPLE_MAX = 999_999
"""As names of six digits number."""


Config = Annotated[str, typer.Argument(metavar="CONFIG", help="The dataset's YAML file, or a dataset to go on with.")]
Out = Annotated[
    str | None,
    typer.Option("--out", metavar="DIR_OR_URL", help="Where to, in place of the config's: a folder, or s3://..."),
]
Part = Annotated[str, typer.Option(metavar="I/N", help="Only part I of N, from 0; other parts may be made meanwhile.")]
Samples = Annotated[
    list[int] | None,
    whole_option(
        "--sample", 0, SAMPLE_MAX, "Only this sample, repeatable, such as to look at it again.", metavar="INDEX"
    ),
]
Executor = Annotated[str, typer.Option(help="Who renders: local; ray, a cluster of Ray; slurm, an array of jobs.")]
WorkerCount = Annotated[
    int | None,
    whole_option(
        "--workers",
        1,
        WORKERS_MAX,
        "Processes that render; default: local 1, with all cores; ray as many as there is room for; slurm 1.",
    ),
]
CoreCount = Annotated[
    int | None,
    whole_option("--cores", 1, WORKERS_MAX, "Of each worker; default: local an equal part of all, ray and slurm 1."),
]
SlurmOptions = Annotated[
    list[str] | None,
    typer.Option("--slurm", metavar="KEY=VALUE", help="Option of sbatch, repeatable, such as partition=cpu."),
]


def generate(
    config: Config,
    overrides: Overrides = None,
    out: Out = None,
    shard: Part = "0/1",
    sample: Samples = None,
    executor: Executor = "local",
    workers: WorkerCount = None,
    cores: CoreCount = None,
    slurm: SlurmOptions = None,
    device: Device = "cpu",
    memory: Memory = RenderSettings.memory,
) -> None:
    """Make a dataset from a config, or complete one.

    It consists of images, their labels in index.parquet, a card, and a contact sheet.

    Stopped with Ctrl-C, by SIGTERM or SIGHUP, or by anything else, the same command goes on where it was: finished
    samples are not rendered again. The images do not depend on shards, workers, executor or memory.

    \b
    Example:
      fgf generate configs/quickstart.yaml --set spp=16 --out datasets/trial
      fgf generate datasets/trial                    goes on with it, from nothing but what it holds
      fgf generate datasets/trial --sample 17 --out again
      fgf generate sweep.yaml --shard 0/4            on the first of four machines that share a folder
      fgf generate sweep.yaml --executor slurm --workers 32 --cores 4 --slurm partition=cpu --slurm time=240
    """  # noqa: D301
    from generators.dataset.store import GoneError  # noqa: PLC0415
    from generators.running import run  # noqa: PLC0415
    from generators.running.shard import Shard  # noqa: PLC0415

    asked = run.Workers(executor, workers, cores, _slurm_parameters(slurm or []))
    part = Shard.parse(shard)
    try:
        loaded, plan = make_plan(config, overrides, device)
    except FgfError as error:
        raise _pointing_to_its_dataset(error, config, overrides, out) from error
    plan = replace(plan, settings=replace(plan.settings, memory=memory))
    for index in sample or ():
        if not 0 <= index < len(plan.samples):
            raise ConfigError(f"--sample {index}: accepted: 0 to {len(plan.samples) - 1}")
    location = _location(config, out, loaded)
    if executor == "local":
        start_warp(device)
    warn(plan.warnings)
    with _shown_progress() as (show, begun):
        try:
            report = run.generate(
                plan,
                loaded.to_bytes(),
                location,
                shard=part,
                only=sample,
                workers=asked,
                on_progress=show,
                tell=lambda line: warn([line]),
            )
        except GoneError as error:
            fail(str(error), EXIT_PARTIAL)
        except OutputError as error:
            if not begun():
                raise  # the place itself is not accepted
            fail(f"{error}; what is finished stays, and the same command goes on from here", EXIT_PARTIAL)
    _print_report(report, plan.settings.max_depth)
    if not report.is_complete:
        raise typer.Exit(EXIT_PARTIAL)


def _location(config: str, out: str | None, loaded: LoadedConfig) -> str:
    own = None if Path(config).is_file() else config
    return out or own or loaded.config.output or f"datasets/{loaded.config.name}"


def _pointing_to_its_dataset(error: FgfError, config: str, overrides: list[str] | None, out: str | None) -> FgfError:
    """The same error; where the stage of a config is gone, with the dataset that holds it, if there is one."""
    from generators.dataset import layout  # noqa: PLC0415
    from generators.dataset.store import Store  # noqa: PLC0415
    from generators.planning.document import load_config  # noqa: PLC0415
    from generators.stage import NoStageError  # noqa: PLC0415

    if not isinstance(error, NoStageError) and not isinstance(error.__cause__, NoStageError):
        return error
    location = _location(config, out, load_config(Path(config), overrides or ())) if Path(config).is_file() else config
    if location == config or not Store(location).exists(layout.PLAN):
        return error
    return ConfigError(f"{error}; the dataset holds what it was made from: fgf generate {location} goes on with it")


def _slurm_parameters(options: list[str]) -> dict[str, str | int]:
    parameters: dict[str, str | int] = {}
    for option in options:
        name, separator, value = option.partition("=")
        if not separator or not name.isidentifier():
            raise ConfigError(f"--slurm {option}: accepted: KEY=VALUE, the key an option of sbatch with _ for -")
        parameters[name] = int(value) if value.isdecimal() and len(value) <= INTEGER_DIGITS else value
    return parameters


@contextmanager
def _shown_progress() -> Iterator[tuple[Callable[[Progress], None], Callable[[], bool]]]:
    """A bar; what to call with the progress, and whether that has been called."""
    with progress_bar(counted=True) as bar:

        def show(progress: Progress) -> None:
            # The first call comes before the first sample, while the kernel is built.
            building = not bar.tasks
            task = bar.add_task("", total=progress.total) if building else bar.task_ids[0]
            failed = f", {progress.failed} failed" if progress.failed else ""
            bar.update(task, description="building the kernel" if building else f"rendering{failed}")
            bar.update(task, completed=progress.done)

        yield show, lambda: bool(bar.tasks)


def _print_report(report: Report, max_depth: int) -> None:
    for index, reason in report.failures[:FAILURES_SHOWN]:
        typer.echo(f"error: sample {index}: {reason}", err=True)
    if len(report.failures) > FAILURES_SHOWN:
        typer.echo(f"error: and {len(report.failures) - FAILURES_SHOWN} more; see the label status", err=True)
    rendered = report.finished - report.reused
    reused = f", {report.reused} from earlier runs" if report.reused else ""
    typer.echo(f"{rendered} of {report.total} samples rendered{reused}, in {report.seconds:.1f} s")
    typer.echo(f"dataset        {report.location}")
    typer.echo(f"contact sheet  {report.contact_sheet}")
    if report.truncated_paths:
        share = report.truncated_samples / report.finished
        warn(
            [
                f"{report.truncated_paths} paths in {report.truncated_samples} of {report.finished} samples "
                f"({share:.2g} of all) were cut after {max_depth} scattering events, so their images are a little "
                "too dark; the labels' column truncated says which, and a higher preset cuts later"
            ]
        )
    if report.interrupted:
        typer.echo(f"stopped at {report.finished} of {report.total}; the same command goes on from here", err=True)
