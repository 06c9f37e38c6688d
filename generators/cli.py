"""The command line `fgf`: renders, datasets and the transmittance law.

Exit codes: 0 fine; 2 the input is not accepted; 3 only a part could be made, or keeps its bounds; 4 a file is
damaged, or samples were not finite; 5 a measurement is not as the theory says. What takes long to import is imported
by the command that needs it.
"""

from __future__ import annotations

import os
import sys
from io import TextIOWrapper
from pathlib import Path
from typing import Annotated, Any, cast

import typer
from typer.core import TyperGroup

from fgf_warp.errors import ConfigError, CorruptFileError, FgfError, NumericalError
from fgf_warp.settings import PRESETS
from fgf_warp.theory.choices import LINE_VARIANCES, LineVariance
from generators.commands import check, validate
from generators.commands import plan as planning
from generators.commands.common import (
    EXIT_BAD_INPUT,
    EXIT_CORRUPT,
    EXIT_PARTIAL,
    EXIT_UNEXPECTED,
    Device,
    check_choice,
    fail,
    progress_bar,
    start_warp,
    warn,
)
from generators.commands.export import export
from generators.commands.generate import generate
from generators.commands.render import render
from generators.commands.tradeoff import tradeoff
from generators.interrupts import listening
from generators.wording import one_line, shortened

PATH_LENGTH = 400
"""Characters of a path that are shown."""
UsageError: type[Exception] = typer.BadParameter.__bases__[0]
"""What typer raises for a wrong option; it has no public name."""


class _Group(TyperGroup):
    """The one place where errors, and being stopped, become a line on stderr and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            fail("stopped before the end; what is written is whole", EXIT_PARTIAL)

    def main(self, *args: Any, **extra: Any) -> Any:
        extra["standalone_mode"] = False  # typer then raises its errors instead of printing them
        for stream in (sys.stdout, sys.stderr):
            # Names of files may hold what no encoding knows.
            if isinstance(stream, TextIOWrapper):
                stream.reconfigure(errors="backslashreplace")
        try:
            with listening():
                code = super().main(*args, **extra)
        except UsageError as error:
            fail(error.format_message(), EXIT_BAD_INPUT)  # type: ignore[attr-defined]
        except (CorruptFileError, NumericalError) as error:
            fail(str(error), EXIT_CORRUPT)
        except FgfError as error:
            fail(str(error), EXIT_BAD_INPUT)
        except BrokenPipeError:
            # Who reads the output, such as head, has seen enough.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            sys.exit(EXIT_PARTIAL)
        except OSError as error:
            place = one_line(str(error.filename), PATH_LENGTH) if error.filename else "file system"
            fail(f"{place}: {error.strerror or error}", EXIT_BAD_INPUT)
        except MemoryError:
            fail("this needs more memory than there is", EXIT_BAD_INPUT)
        sys.exit(code or 0)


app = typer.Typer(
    cls=_Group,
    name="fgf",
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


@app.callback(invoke_without_command=True)
def fgf(context: typer.Context) -> None:
    """Render USD scenes whose media are fractional Gaussian fields, and make datasets of them.

    \b
    First steps:
      fgf generate configs/quickstart.yaml      a small dataset, with a contact sheet
      fgf render stage.usda -o image.exr        one image
      fgf law --H -0.25 --S_w 1 --sigma_m 2     the transmittance law behind them

    Every command explains itself: fgf COMMAND --help.
    """  # noqa: D301 - the escape is typer's, and starts a block that is not rewrapped
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


app.command()(render)
app.command()(generate)


@app.command()
def law(
    hurst: Annotated[float, typer.Option("--H", help="Hurst exponent; -0.5 is white noise.")],
    mean_extinction: Annotated[float, typer.Option("--sigma_m", help="Mean extinction [1/length].")],
    white_noise_scale: Annotated[
        float | None, typer.Option("--S_w", help="White-noise scale [length^(-2-2H)]; 0 is the exponential.")
    ] = None,
    outer_scale: Annotated[float | None, typer.Option("--L", help="Outer scale [length], where H > 0.")] = None,
    kappa: Annotated[float | None, typer.Option("--kappa", help="In place of the value that follows from S_w.")] = None,
    line_variance: Annotated[
        str, typer.Option("--lineVariance", help="Of fractional Brownian motion: asymptotic, or exact.")
    ] = "asymptotic",
    lengths: Annotated[
        str | None, typer.Option("--t", metavar="LIST", help="Segment lengths, with commas; default: around 1/sigma_m.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON in full precision.")] = False,
) -> None:
    """Print the transmittance law of a medium.

    Transmittance and free-flight density by length. The density is per unit length, from an uncorrelated end (a
    surface, a boundary, the camera).

    \b
    Example:
      fgf law --H -0.25 --S_w 1 --sigma_m 2 --t 0.1,1,10
    """  # noqa: D301
    import json  # noqa: PLC0415

    from fgf_warp.theory.law import REGIME_NAMES  # noqa: PLC0415
    from generators.law import evaluate_law  # noqa: PLC0415

    check_choice("--lineVariance", line_variance, LINE_VARIANCES)
    found = evaluate_law(
        hurst=hurst,
        white_noise_scale=white_noise_scale,
        mean_extinction=mean_extinction,
        outer_scale=outer_scale,
        kappa=kappa,
        line_variance=cast(LineVariance, line_variance),
        lengths=_parse_lengths(lengths),
    )
    if as_json:
        typer.echo(json.dumps(found, indent=1, allow_nan=False))
        return
    no_mean = "infinite" if found["law_ends_at"] is None else "none"
    mean_free_path = no_mean if found["mean_free_path"] is None else f"{found['mean_free_path']:.6g}"
    typer.echo(f"regime          {REGIME_NAMES[found['regime']]}")
    typer.echo(f"b               {found['b']:.6g}")
    typer.echo(f"kappa           {found['kappa']:.6g}")
    typer.echo(f"mean free path  {mean_free_path}")
    typer.echo(f"\n{'t':>12}  {'transmittance':>14}  {'free-flight pdf':>16}")
    for row in zip(found["t"], found["transmittance"], found["free_flight_pdf"], strict=True):
        typer.echo("{:12.6g}  {:14.6g}  {:16.6g}".format(*row))
    warn(found["warnings"])


@app.command()
def figures(
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder of page and pictures; default: figures, or figures-NAME."),
    ] = None,
    preset: Annotated[str, typer.Option(help=f"{', '.join(PRESETS)}: size and noise of the pictures.")] = "balanced",
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only this figure, repeatable; default: all.")
    ] = None,
    device: Device = "cpu",
) -> None:
    """Make the figures of the paper's supplement anew, with captions, as files and on one page.

    Names: hurst, negative-law, negative-image, white-limit, scale. Figure white-limit tests whether H = -0.49 looks
    like white noise, and says what it found; where the theory says otherwise, the exit code is 5.

    \b
    Example:
      fgf figures --only white-limit --out trial
    """  # noqa: D301
    start_warp(device)
    from generators.figures.gallery import write_figures  # noqa: PLC0415

    # The page of some figures does not take the place of that of all.
    folder = out or Path("-".join(["figures", *(only or ())]))

    with progress_bar(counted=True) as progress:
        task = progress.add_task("reading the scene", total=None)

        def show(name: str, done: float, total: int) -> None:
            progress.update(task, description=name, completed=done, total=total)

        gallery = write_figures(folder, preset=preset, device=device, only=only or (), progress=show)
    for file in gallery.files:
        typer.echo(f"wrote {file}")
    for verdict in gallery.verdicts:
        typer.echo(verdict.text)
    if not all(verdict.passed for verdict in gallery.verdicts):
        raise typer.Exit(EXIT_UNEXPECTED)


@app.command()
def stability(
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder of the report; default: stability, or stability-quick."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Few of the extremes, in less than half a minute.")] = False,
    device: Device = "cpu",
) -> None:
    """Try law, samplers, parameters and small renders at their extremes, and report how far each is from its bound.

    Writes index.html with heat maps, and every cell as a row of cells.parquet. Where anything is outside its bound,
    the exit code is 3.

    \b
    Example:
      fgf stability --quick
    """  # noqa: D301
    start_warp(device)
    from fgf_warp.output.atomic import make_folder  # noqa: PLC0415
    from generators.stability import run  # noqa: PLC0415
    from generators.stability.extremes import FULL, QUICK  # noqa: PLC0415
    from generators.stability.outcome import CELLS, conclude  # noqa: PLC0415

    folder = out or Path("stability-quick" if quick else "stability")
    make_folder(folder, [run.REPORT, CELLS])
    with progress_bar(counted=True) as progress:
        task = progress.add_task("", total=None)

        def show(part: str, done: int, total: int) -> None:
            progress.update(task, description=part, completed=done, total=total)

        outcome = run.measure(QUICK if quick else FULL, device, show)
        progress.update(task, description="drawing", completed=0, total=1)
        report = run.write(outcome, folder, f"fgf stability --device {device}{' --quick' if quick else ''}")
        progress.update(task, description="done", completed=1)
    typer.echo(conclude(outcome))
    typer.echo(f"report  {report}")
    if outcome.outside_count:
        raise typer.Exit(EXIT_PARTIAL)


app.command()(export)
app.command()(check.verify)
app.command()(check.status)
app.command()(check.report)
app.command()(planning.plan)
app.command()(planning.init)
app.command()(planning.schema)
app.command()(validate.validate)
app.command()(tradeoff)


def main() -> None:
    """Runs the command that the program was called with, see `generators.entry`."""
    # What a library meets when it clears away after an error is nothing that a user could act on.
    sys.unraisablehook = lambda _: None
    app()


def _parse_lengths(text: str | None) -> list[float] | None:
    if text is None:
        return None
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise ConfigError(f"--t {shortened(text)}: accepted: numbers with commas between them") from error
