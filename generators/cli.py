"""The command line `fgf`: renders, datasets and the transmittance law.

Exit codes: 0 fine; 2 the input is not accepted; 3 only a part could be made, or keeps its bounds; 4 a file is
damaged, or samples were not finite; 5 a measurement is not as the theory says. What takes long to import is imported
by the command that needs it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer
from typer.core import TyperGroup

from fgf_warp.errors import ConfigError, CorruptFileError, FgfError, NumericalError
from fgf_warp.settings import PRESETS, USUAL_AOVS, Aov, RenderSettings, Sampler
from generators.commands import check, validate
from generators.commands import plan as planning
from generators.commands.common import (
    EXIT_BAD_INPUT,
    EXIT_CORRUPT,
    EXIT_PARTIAL,
    EXIT_UNEXPECTED,
    Device,
    Memory,
    check_choice,
    fail,
    progress_bar,
    start_warp,
    warn,
)
from generators.commands.export import export
from generators.commands.generate import generate
from generators.commands.tradeoff import tradeoff

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fgf_warp.features import Reason
    from fgf_warp.result import RenderResult
    from fgf_warp.scene import Scene
    from fgf_warp.theory.law import LineVariance
    from generators.pictures import Picture
    from usd_scenes.reader import Frame

UsageError: type[Exception] = typer.BadParameter.__bases__[0]
"""What typer raises for a wrong option; it has no public name."""


class _Group(TyperGroup):
    """The one place where errors become a line on stderr and an exit code."""

    def main(self, *args: Any, **extra: Any) -> Any:
        extra["standalone_mode"] = False  # typer then raises its errors instead of printing them
        try:
            code = super().main(*args, **extra)
        except UsageError as error:
            fail(error.format_message(), EXIT_BAD_INPUT)  # type: ignore[attr-defined]
        except (CorruptFileError, NumericalError) as error:
            fail(str(error), EXIT_CORRUPT)
        except FgfError as error:
            fail(str(error), EXIT_BAD_INPUT)
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


@app.command()
def render(
    stage: Annotated[Path, typer.Argument(metavar="STAGE", help="The USD file.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="OUT.exr",
            help="The image to write; of several frames with #### for their number. "
            "Default: as the stage's RenderProducts say.",
        ),
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option("--camera", "-cam", metavar="PATH", help="Camera; default: the render settings', or the first."),
    ] = None,
    width: Annotated[
        int | None, typer.Option("--imageWidth", "-w", metavar="N", help="[pixel]; default: as the stage says, or 960.")
    ] = None,
    height: Annotated[
        int | None, typer.Option("--imageHeight", metavar="N", help="[pixel]; default: from the aspect ratio.")
    ] = None,
    spp: Annotated[int | None, typer.Option(metavar="N", help="Samples per pixel, in place of the preset's.")] = None,
    preset: Annotated[str, typer.Option(help=f"{', '.join(PRESETS)}.")] = "balanced",
    seed: Annotated[int, typer.Option(metavar="N", help="Equal seeds give equal pixels.")] = 0,
    sampler: Annotated[
        str, typer.Option(help="lattice: less noise than the reported error says; independent: as much as it says.")
    ] = Sampler.LATTICE.value,
    device: Device = "cpu",
    memory: Memory = RenderSettings.memory,
    frames: Annotated[
        str | None,
        typer.Option(
            "--frames",
            "--frame",
            "-f",
            metavar="SPEC",
            help="Frames: 7, 1:24, 1:24x2 or 101,105:110; default: the stage's start, or the earliest.",
        ),
    ] = None,
    default_time: Annotated[
        bool, typer.Option("--defaultTime", "-d", help="Take attributes' default values, not those of a frame.")
    ] = False,
    purposes: Annotated[
        str | None,
        typer.Option(
            "--purposes",
            "-p",
            metavar="LIST",
            help="Purposes of the geometry to include beside default, with commas; default: as the stage says, or "
            "render.",
        ),
    ] = None,
    complexity: Annotated[
        str, typer.Option("--complexity", "-c", help="Subdivision of surfaces: low, medium, high or veryhigh.")
    ] = "high",
    render_settings: Annotated[
        str | None,
        typer.Option(
            "--renderSettingsPrimPath",
            "-rs",
            metavar="PATH",
            help="RenderSettings; default: those that the stage names, or the first.",
        ),
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Refuse a stage of which something is missing, such as a texture.")
    ] = False,
    png: Annotated[Path | None, typer.Option(metavar="OUT.png", help="Write an sRGB view too.")] = None,
    aov: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help=f"Only these planes, repeatable: {', '.join(Aov)}; default: as the stage's RenderVars say, or those "
            "up to prim_id.",
        ),
    ] = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="Say what the kernel is built for and why, and render nothing.")
    ] = False,
) -> None:
    """Render a stage: one image, or one for each frame.

    \b
    Example:
      fgf render usd_scenes/stages/cloud_block.usda -o cloud.exr --imageWidth 480 --spp 64 --png cloud.png
      fgf render shot.usd -o shot.####.exr --frames 101:124 --camera main_cam
    """  # noqa: D301
    from fgf_warp.output.atomic import check_writable  # noqa: PLC0415
    from generators.stage import load_scene  # noqa: PLC0415
    from usd_scenes.reader import COMPLEXITIES, OpenStages  # noqa: PLC0415

    aovs = _choose_aovs(aov)
    check_choice("--preset", preset, PRESETS)
    check_choice("--sampler", sampler, Sampler)
    check_choice("--complexity", complexity, COMPLEXITIES)
    times = _choose_frames(frames, default_time=default_time)
    warned: set[str] = set()

    def load(frame: Frame | None, product: str | None) -> tuple[Scene, RenderSettings]:
        base = load_scene(
            stage,
            camera=camera,
            frame=frame,
            purposes=None if purposes is None else ["default", *purposes.split(",")],
            complexity=complexity,
            strict=strict,
            render_settings=render_settings,
            product=product,
            width=width,
            height=height,
        )
        settings = RenderSettings(
            width=base.width,
            height=base.height,
            spp=PRESETS[preset].spp if spp is None else spp,
            seed=seed,
            max_depth=PRESETS[preset].max_depth,
            roulette_depth=PRESETS[preset].roulette_depth,
            aovs=next(planes for planes in (aovs, base.aovs, USUAL_AOVS) if planes is not None),
            sampler=Sampler(sampler),
            device=device,
            memory=memory,
        )
        warn([warning for warning in base.warnings if warning not in warned])
        warned.update(base.warnings)
        return base.scene, settings

    with OpenStages():
        if explain:
            from fgf_warp.features import explain as explain_kernel  # noqa: PLC0415

            _print_reasons(explain_kernel(*load(times[0], None)))
            return
        from generators.pictures import plan_pictures  # noqa: PLC0415

        pictures, warnings = plan_pictures(stage, times, output, png, render_settings)
        for picture in pictures:
            for file in picture.files:
                check_writable(file)
        warn(warnings)
        start_warp(device)
        for done, picture in enumerate(pictures):
            try:
                _render_picture(picture, *load(picture.frame, picture.product))
            except KeyboardInterrupt:
                fail(f"stopped; {done} of {len(pictures)} images are written", EXIT_PARTIAL)


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

    from fgf_warp.theory.law import LINE_VARIANCES, REGIME_NAMES  # noqa: PLC0415
    from generators.law import evaluate_law  # noqa: PLC0415

    check_choice("--lineVariance", line_variance, LINE_VARIANCES)
    found = evaluate_law(
        hurst=hurst,
        white_noise_scale=white_noise_scale,
        mean_extinction=mean_extinction,
        outer_scale=outer_scale,
        kappa=kappa,
        line_variance=cast("LineVariance", line_variance),
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
    from generators.stability import run  # noqa: PLC0415
    from generators.stability.extremes import FULL, QUICK  # noqa: PLC0415

    folder = out or Path("stability-quick" if quick else "stability")
    run.make_folder(folder)
    with progress_bar(counted=True) as progress:
        task = progress.add_task("", total=None)

        def show(part: str, done: int, total: int) -> None:
            progress.update(task, description=part, completed=done, total=total)

        outcome = run.measure(QUICK if quick else FULL, device, show)
        progress.update(task, description="drawing", completed=0, total=1)
        report = run.write(outcome, folder, f"fgf stability --device {device}{' --quick' if quick else ''}")
        progress.update(task, description="done", completed=1)
    typer.echo(run.conclude(outcome))
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
    """Entry point of the console script."""
    app()


def _choose_frames(spec: str | None, *, default_time: bool) -> Sequence[Frame | None]:
    """The times to render; None is where the stage starts."""
    if spec is None:
        return ["default" if default_time else None]
    if default_time:
        raise ConfigError("--defaultTime and --frames exclude each other; accepted: one of them")
    from generators.pictures import parse_frames  # noqa: PLC0415

    return parse_frames(spec)


def _render_picture(picture: Picture, scene: Scene, settings: RenderSettings) -> None:
    """Renders one image and writes its files, each whole or not at all."""
    from fgf_warp.output.color import write_png  # noqa: PLC0415
    from fgf_warp.output.exr import write_exr  # noqa: PLC0415
    from fgf_warp.renderer import check_memory, prepare  # noqa: PLC0415 - starts Warp
    from fgf_warp.renderer import render as render_scene  # noqa: PLC0415

    check_memory(settings)
    with progress_bar(counted=False) as progress:
        task = progress.add_task("building the kernel", total=None)
        prepare(scene, settings)

        def show(done: int, total: int) -> None:
            progress.update(task, description=f"rendering {picture.exr.name}", completed=done, total=total)

        result = render_scene(scene, settings, show)
    write_exr(picture.exr, result)
    if picture.png:
        write_png(picture.png, result)
    _print_render(result, picture.files)


def _choose_aovs(names: list[str] | None) -> frozenset[Aov] | None:
    """None where nothing is asked for."""
    if not names:
        return None
    unknown = [name for name in names if name not in list(Aov)]
    if unknown:
        raise ConfigError(f"--aov {unknown[0]}: accepted: {', '.join(Aov)}")
    return frozenset(Aov(name) for name in names)


def _print_render(result: RenderResult, files: Sequence[Path]) -> None:
    typer.echo(
        f"{result.seconds:.2f} s, {result.samples_per_second:.4g} samples/s, {result.samples} samples per pixel, "
        f"mean relative standard error {result.relative_standard_error:.2%}"
    )
    if result.truncated_count:
        share = result.truncated_count / result.path_count
        warn(
            [
                f"{result.truncated_count} paths ({share:.2g} of all) were cut after {result.settings.max_depth} "
                "scattering events, so the image is a little too dark; a higher --preset cuts later"
            ]
        )
    for file in files:
        typer.echo(f"wrote {file}")


def _print_reasons(reasons: Sequence[Reason]) -> None:
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    table = Table("part", "in the kernel", "why")
    for reason in reasons:
        table.add_row(reason.part, "yes" if reason.built else "-", reason.why)
    Console(markup=False, highlight=False).print(table)


def _parse_lengths(text: str | None) -> list[float] | None:
    if text is None:
        return None
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise ConfigError(f"--t {text}: accepted: numbers with commas between them") from error
