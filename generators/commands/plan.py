"""Commands about configs: what they would make, how to begin one, and how editors help with them."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from generators.commands.common import Overrides, count_of, progress_bar, warn

if TYPE_CHECKING:
    from rich.table import Table

    from generators.planning.document import LoadedConfig
    from generators.planning.plan import Plan

ROWS_SHOWN = 20
VALUES_SHOWN = 9
WIDTH_MAX = 1000
"""[character], of a table."""
SILENT_SECONDS = 0.5
"""After which one looks for a bar."""


def plan(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="The dataset's YAML file.")],
    overrides: Overrides = None,
) -> None:
    """Show the samples of a dataset without rendering any.

    \b
    Example:
      fgf plan configs/quickstart.yaml --set "axes.S_w={logspace: [0.01, 10, 4]}"
    """  # noqa: D301
    _, made = make_plan(config, overrides, "cpu")
    warn(made.warnings)
    _print_axes(made)
    _print_samples(made)
    _print_totals(made)


def init(
    path: Annotated[
        Path, typer.Argument(metavar="FILE", help="The config to write; one that is there is left as it is.")
    ] = Path("dataset.yaml"),
) -> None:
    """Write a config with comments to begin with; it can be planned and generated as it is.

    \b
    Example:
      fgf init cloud.yaml
      fgf plan cloud.yaml
    """  # noqa: D301
    from generators.planning.template import write_template  # noqa: PLC0415

    write_template(path)
    typer.echo(f"wrote {path}; see what it would make: fgf plan {path}")


def schema() -> None:
    """Print the JSON schema of configs, by which editors complete and check them.

    \b
    Example:
      fgf schema > fgf.schema.json

    In editors with a language server for YAML, the first line of a config then says where it is:

    \b
      # yaml-language-server: $schema=fgf.schema.json
    """  # noqa: D301
    from generators.planning.template import schema_text  # noqa: PLC0415

    typer.echo(schema_text(), nl=False)


def make_plan(config: str | Path, overrides: list[str] | None, device: str) -> tuple[LoadedConfig, Plan]:
    """Reads a config, or that of a dataset, and plans it, with a bar where that takes a while.

    Args:
        config: a YAML file, or the location of a dataset.
        overrides: each ``key.key=value``, or None.
        device: a Warp device name.

    Returns:
        The config as it is in force, and its plan, of which every sample has been checked.
    """
    from generators.dataset import layout  # noqa: PLC0415
    from generators.dataset.scene_files import config_file  # noqa: PLC0415
    from generators.dataset.store import Store  # noqa: PLC0415
    from generators.planning.document import load_config  # noqa: PLC0415
    from generators.planning.plan import build_plan  # noqa: PLC0415

    place = str(config)
    is_dataset = not Path(place).is_file() and Store(place).exists(layout.PLAN)
    loaded = load_config(config_file(place) if is_dataset else Path(place), overrides or ())
    began = perf_counter()
    with progress_bar(counted=True) as progress:

        def show(what: str, done: int, total: int) -> None:
            if perf_counter() - began >= SILENT_SECONDS:
                task = progress.task_ids[0] if progress.tasks else progress.add_task("")
                progress.update(task, description=what, completed=done, total=total)

        return loaded, build_plan(loaded, device, show)


def _print_axes(made: Plan) -> None:
    from rich.table import Table  # noqa: PLC0415

    table = Table("axis", "changes", "values", title=made.meta.name)
    for axis in made.meta.axes:
        of_samples = list(dict.fromkeys(sample.parameters[axis.name] for sample in made.samples))
        unit = f" [{axis.unit}]" if axis.unit else ""
        table.add_row(axis.name, axis.target, f"{_in_brief(of_samples)}{unit}")
    if made.meta.axes:
        _print_whole(table)


def _in_brief(values: list[float | str]) -> str:
    """All of few values, and of many numbers the least and the largest."""
    if len(values) <= VALUES_SHOWN or isinstance(values[0], str):
        return ", ".join(map(_shown, values))
    return f"{len(values)} from {_shown(min(values))} to {_shown(max(values))}"


def _shown(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def _print_whole(table: Table) -> None:
    """However narrow the terminal, no column is cut."""
    from rich.console import Console  # noqa: PLC0415

    needed = Console(width=WIDTH_MAX).measure(table).maximum
    Console(width=max(Console().width, needed), markup=False, highlight=False).print(table)


def _print_samples(made: Plan) -> None:
    from rich.table import Table  # noqa: PLC0415

    axes, has_splits = list(made.samples[0].parameters), len({sample.split for sample in made.samples}) > 1
    laws = ("regime", "b", "kappa", "transport")
    table = Table("index", *(["split"] if has_splits else []), *axes, *laws)
    for sample in made.samples[:ROWS_SHOWN]:
        values = map(_shown, sample.parameters.values())
        of_law = ["-"] * len(laws)
        if sample.medium is not None:
            rule = sample.medium.line_law
            of_law = [rule.regime, f"{rule.b:.4g}", f"{rule.kappa:.4g}", sample.medium.resolved_transport]
        table.add_row(str(sample.index), *([sample.split] if has_splits else []), *values, *of_law)
    _print_whole(table)


def _print_totals(made: Plan) -> None:
    from collections import Counter  # noqa: PLC0415

    from fgf_warp.output.exr import channel_names  # noqa: PLC0415
    from generators.dataset.layout import SPLITS  # noqa: PLC0415
    from generators.publishing.words import describe_quality  # noqa: PLC0415

    count = len(made.samples)
    typer.echo(f"{count_of(count, 'sample')}{f', the first {ROWS_SHOWN} shown' if count > ROWS_SHOWN else ''}")
    if made.left_out:
        typer.echo(f"{made.left_out} more are left out, as the constraints say")
    splits = Counter(sample.split for sample in made.samples)
    if len(splits) > 1:
        typer.echo(", ".join(f"{splits[split]} for {split}" for split in SPLITS if split in splits))
    scenes = len({made.group_key(sample) for sample in made.samples})
    if scenes > 1:
        typer.echo(f"{scenes} different scenes; samples of one are rendered together")
    settings, channels = made.settings, len(channel_names(made.settings.aovs))
    size = count * settings.width * settings.height * (4 * channels + (3 if made.meta.png else 0))
    typer.echo(
        f"{settings.width} x {settings.height} pixels, {describe_quality(made.meta)}, {channels} channels: "
        f"at most about {size / 1e6:,.3g} MB"
    )
