"""The command that measures what each setting costs in time and in error."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from generators.commands.common import EXIT_PARTIAL, Device, Overrides, count_of, fail, progress_bar, start_warp, warn

if TYPE_CHECKING:
    from generators.tradeoff.config import LoadedTradeoff
    from generators.tradeoff.measure import Outcome, Subject


def tradeoff(
    path: Annotated[Path, typer.Argument(metavar="SCENE|CONFIG", help="A USD file, or a YAML file of several media.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder of report and numbers; default: tradeoff-NAME."),
    ] = None,
    cache: Annotated[
        Path | None,
        typer.Option("--cache", metavar="DIR", help="Folder of the references; default: in the user's cache folder."),
    ] = None,
    overrides: Overrides = None,
    device: Device = "cpu",
) -> None:
    """Measure what each setting costs in time and in error, and write a report.

    Every stage with every medium is rendered with every choice of settings, as several independent images, and these
    are compared with a long render, which is kept for the next time. Of a SCENE, its own medium and a few around it are
    measured. Writes tradeoff.html to look at, tradeoff.json with all numbers and front.svg, the leading figure. Needs
    the extras: pip install 'fgf-warp[quality,denoise]'.

    \b
    Example:
      fgf tradeoff usd_scenes/stages/studio.usda
      fgf tradeoff configs/tradeoff.yaml --set size=32
    """  # noqa: D301
    from fgf_warp.output.atomic import make_folder  # noqa: PLC0415
    from fgf_warp.output.denoise import check_denoiser  # noqa: PLC0415
    from fgf_warp.output.flip import check_flip  # noqa: PLC0415
    from generators.tradeoff import run  # noqa: PLC0415
    from generators.tradeoff.config import load_tradeoff  # noqa: PLC0415
    from generators.tradeoff.measure import list_subjects  # noqa: PLC0415
    from generators.tradeoff.reference import default_cache  # noqa: PLC0415

    check_flip()
    loaded = load_tradeoff(path, overrides)
    if any(rung.denoise for rung in loaded.config.rungs.values()):
        check_denoiser()
    subjects, warnings = list_subjects(loaded)
    folder = out or Path(f"tradeoff-{path.stem}")
    references = cache or default_cache()
    make_folder(folder, run.FILES)
    make_folder(references, ["reference.npz"])
    warn(warnings)
    start_warp(device)
    try:
        outcome = _measure(loaded, subjects, references, device)
    except KeyboardInterrupt:
        fail(f"stopped; no report is written, and finished references are kept in {references}", EXIT_PARTIAL)
    command = " ".join(["fgf tradeoff", path.name, *(f"--set {override}" for override in overrides or ())])
    for file in run.write(outcome, folder, command):
        typer.echo(f"wrote {file}")


def _measure(loaded: LoadedTradeoff, subjects: list[Subject], references: Path, device: str) -> Outcome:
    from generators.tradeoff.measure import measure  # noqa: PLC0415

    with progress_bar(counted=True) as progress:
        task = progress.add_task("reading the scene", total=None)

        def show(name: str, done: int, total: int) -> None:
            progress.update(task, description=name, completed=done, total=total)

        outcome = measure(loaded, subjects, references, device, show)
    kept = sum(one.reference.cached for one in outcome.measured)
    if kept:
        typer.echo(f"{kept} of {count_of(len(outcome.measured), 'reference')} taken from {references}")
    return outcome
