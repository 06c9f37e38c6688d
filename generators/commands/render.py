"""`fgf render`: images of a stage."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, cast

import typer

from fgf_warp.errors import ConfigError, FgfError
from fgf_warp.settings import PRESETS, USUAL_AOVS, Aov, RenderSettings, Sampler
from fgf_warp.theory.choices import LINE_VARIANCES, TRANSPORTS, LineVariance, Transport
from generators.commands.common import (
    EXIT_PARTIAL,
    CameraPath,
    DefaultTime,
    Device,
    Frames,
    Memory,
    Purposes,
    Strict,
    check_choice,
    choose_frames,
    fail,
    parse_share,
    progress_bar,
    start_warp,
    warn,
)
from generators.wish import AUTO, FORMS, Wish

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from fgf_warp.convergence import Goal
    from fgf_warp.features import Reason
    from fgf_warp.result import RenderResult
    from fgf_warp.scene import Scene
    from generators.auto import Choice
    from generators.pictures import Picture
    from usd_scenes.reader import Frame


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
    output_root: Annotated[
        Path | None,
        typer.Option(
            "--outputRoot",
            metavar="DIR",
            help="Folder that the stage's productNames are paths from and stay below; default: the working directory.",
        ),
    ] = None,
    camera: CameraPath = None,
    width: Annotated[
        int | None, typer.Option("--imageWidth", "-w", metavar="N", help="[pixel]; default: as the stage says, or 960.")
    ] = None,
    height: Annotated[
        int | None, typer.Option("--imageHeight", metavar="N", help="[pixel]; default: from the aspect ratio.")
    ] = None,
    spp: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Samples per pixel, in place of the preset's; with --targetError or --time the most on average.",
        ),
    ] = None,
    target_error: Annotated[
        str | None,
        typer.Option(
            "--targetError",
            "--target-error",
            metavar="ERROR",
            help="Render until the relative standard error of the image is this, such as 0.01 or 1%.",
        ),
    ] = None,
    error_over: Annotated[
        str | None,
        typer.Option(
            "--errorOver",
            metavar="HOW",
            help="Over its blocks of 8 x 8 pixels, of which: mean, rms, or a percentile such as p95; default: mean.",
        ),
    ] = None,
    time: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Render so long at most, beside building the kernel and denoising."),
    ] = None,
    preset: Annotated[
        str,
        typer.Option(help=f"{', '.join(PRESETS)}; or the cheapest settings for an error or a time: auto:1%, auto:5s."),
    ] = "balanced",
    seed: Annotated[int, typer.Option(metavar="N", help="Equal seeds give equal pixels.")] = 0,
    max_depth: Annotated[
        int | None,
        typer.Option(
            "--maxDepth",
            metavar="N",
            help="Scattering events after which a path is cut, in place of the preset's; 1 is single scattering only.",
        ),
    ] = None,
    similarity_order: Annotated[
        int | None,
        typer.Option(
            "--similarityOrder",
            metavar="N",
            help="Scattering events after which a path sees the similar medium that scatters evenly; default: never.",
        ),
    ] = None,
    transport: Annotated[
        str | None, typer.Option(help=f"Of all media, in place of their own: {', '.join(TRANSPORTS)}.")
    ] = None,
    line_variance: Annotated[
        str | None,
        typer.Option("--lineVariance", help=f"Of all media, in place of their own: {', '.join(LINE_VARIANCES)}."),
    ] = None,
    upscale: Annotated[
        int, typer.Option(metavar="N", help="Render one of so many pixels each way, and enlarge the picture.")
    ] = 1,
    sampler: Annotated[
        str, typer.Option(help="lattice: less noise than the reported error says; independent: as much as it says.")
    ] = Sampler.LATTICE.value,
    device: Device = "cpu",
    memory: Memory = RenderSettings.memory,
    frames: Frames = None,
    default_time: DefaultTime = False,
    purposes: Purposes = None,
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
    strict: Strict = False,
    png: Annotated[Path | None, typer.Option(metavar="OUT.png", help="Write an sRGB view too.")] = None,
    aov: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help=f"Only these planes, repeatable: {', '.join(Aov)}; default: as the stage's RenderVars say, or those "
            "up to prim_id.",
        ),
    ] = None,
    denoise: Annotated[
        bool,
        typer.Option("--denoise", help="Add the plane denoised, which the PNG then shows; needs the extra denoise."),
    ] = False,
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
    from generators.stage import load_scene, split_purposes  # noqa: PLC0415
    from usd_scenes.reader import COMPLEXITIES, OpenStages  # noqa: PLC0415

    aovs = _choose_aovs(aov)
    chosen = {
        "--spp": spp,
        "--targetError": target_error,
        "--errorOver": error_over,
        "--time": time,
        "--maxDepth": max_depth,
        "--similarityOrder": similarity_order,
        "--upscale": None if upscale == 1 else upscale,
    }
    if output is not None and output_root is not None:
        raise ConfigError("--outputRoot is of the stage's productNames, which --output takes the place of")
    wish = _choose_wish(preset, chosen)
    depths = PRESETS["balanced" if wish else preset]
    check_choice("--sampler", sampler, Sampler)
    if transport is not None:
        check_choice("--transport", transport, TRANSPORTS)
    if line_variance is not None:
        check_choice("--lineVariance", line_variance, LINE_VARIANCES)
    check_choice("--complexity", complexity, COMPLEXITIES)
    goal = _choose_goal(target_error, error_over, time, spp)
    times = choose_frames(frames, default_time=default_time)
    told: set[str] = set()

    def load(frame: Frame | None, product: str | None) -> tuple[Scene, RenderSettings]:
        base = load_scene(
            stage,
            camera=camera,
            frame=frame,
            purposes=split_purposes(purposes),
            complexity=complexity,
            strict=strict,
            render_settings=render_settings,
            product=product,
            width=width,
            height=height,
        )
        planes = next(planes for planes in (aovs, base.aovs, USUAL_AOVS) if planes is not None)
        settings = RenderSettings(
            width=base.width,
            height=base.height,
            spp=depths.spp if spp is None else spp,
            seed=seed,
            max_depth=depths.max_depth if max_depth is None else max_depth,
            roulette_depth=depths.roulette_depth,
            similarity_order=similarity_order,
            aovs=planes | {Aov.DENOISED} if denoise else planes,
            sampler=Sampler(sampler),
            transport=cast("Transport | None", transport),
            line_variance=cast("LineVariance | None", line_variance),
            upscale=upscale,
            device=device,
            memory=memory,
        )
        _warn_once(base.warnings, frame, times, told)
        return base.scene, settings

    with OpenStages():
        if explain:
            from fgf_warp.features import explain as explain_kernel  # noqa: PLC0415
            from fgf_warp.finishing import as_rendered  # noqa: PLC0415 - starts Warp

            _print_reasons(explain_kernel(*as_rendered(*load(times[0], None))))
            return
        from generators.pictures import plan_pictures  # noqa: PLC0415

        pictures, warnings = plan_pictures(stage, times, output, png, render_settings, output_root)
        for picture in pictures:
            for file in picture.files:
                check_writable(file)
        warn(warnings)
        done = 0
        try:
            if len(pictures) > 1:
                _check_frames(pictures, load)
            start_warp(device)
            for picture in pictures:
                base = load(picture.frame, picture.product)
                _render_picture(picture, *base, goal, wish, depth_is_asked=max_depth is not None)
                done += 1
        except KeyboardInterrupt:
            fail(f"stopped; {done} of {len(pictures)} images are written", EXIT_PARTIAL)


def _check_frames(pictures: Sequence[Picture], load: Callable[[Frame | None, str | None], object]) -> None:
    """Reads all that is to be rendered before the first image is, and keeps nothing of it.

    Raises:
        FgfError: as `load` raises it, with the frame.
    """
    from usd_scenes.reader import name_of  # noqa: PLC0415 - USD is slow to import

    with progress_bar(counted=True) as progress:
        task = progress.add_task("reading", total=len(pictures))
        for picture in pictures:
            try:
                load(picture.frame, picture.product)
            except FgfError as error:
                raise type(error)(f"{error} ({name_of(picture.frame)})") from error
            progress.advance(task)


def _warn_once(warnings: Iterable[str], frame: Frame | None, frames: Sequence[Frame | None], told: set[str]) -> None:
    """Warns of each kind of thing at the first frame where it is met, and names that unless it is the first of all."""
    from usd_scenes.reader import kind_of, name_of  # noqa: PLC0415 - USD is slow to import

    new = {kind: warning for warning in warnings if (kind := kind_of(warning)) not in told}
    told.update(new)
    warn([warning if frame == frames[0] else f"{warning} ({name_of(frame)})" for warning in new.values()])


def _choose_wish(preset: str, others: Mapping[str, object]) -> Wish | None:
    """None for settings that have a name; options that say the same as a wish, or take a choice away, are refused."""
    if not preset.startswith(AUTO):
        check_choice("--preset", preset, [*PRESETS, FORMS])
        return None
    wish = Wish.parse(preset)
    for option, value in others.items():
        if value is not None:
            raise ConfigError(f"{option}: is chosen by --preset {preset}; accepted: one of them")
    return wish


def _choose_settings(scene: Scene, settings: RenderSettings, wish: Wish) -> Choice:
    """Says what it chose and why."""
    from generators.auto import choose  # noqa: PLC0415 - starts Warp
    from generators.tradeoff.front import read_front  # noqa: PLC0415

    with progress_bar(counted=False) as progress:
        progress.add_task("choosing the settings", total=None)
        choice = choose(scene, settings, wish, read_front())
    for line in choice.lines:
        typer.echo(line)
    return choice


def _render_picture(
    picture: Picture,
    scene: Scene,
    settings: RenderSettings,
    goal: Goal | None,
    wish: Wish | None,
    *,
    depth_is_asked: bool,
) -> None:
    """Renders one image and writes its files, each whole or not at all.

    Args:
        picture: its files.
        scene: what is rendered.
        settings: how.
        goal: what ends it, or None.
        wish: what its settings are chosen for, or None.
        depth_is_asked: True where paths end early because that was asked for, which needs no warning.
    """
    from fgf_warp.convergence import FIRST_SPP  # noqa: PLC0415 - starts Warp
    from fgf_warp.finishing import as_rendered, render_image  # noqa: PLC0415
    from fgf_warp.output.color import write_png  # noqa: PLC0415
    from fgf_warp.output.exr import write_exr  # noqa: PLC0415
    from fgf_warp.renderer import check_memory, prepare  # noqa: PLC0415

    check_memory(settings)
    choice = None if wish is None else _choose_settings(scene, settings, wish)
    if choice is not None:
        settings, goal = choice.settings, choice.goal
    with progress_bar(counted=False) as progress:
        task = progress.add_task("building the kernel", total=None)
        plain, asked = as_rendered(scene, settings)
        prepare(plain, asked)

        def show(done: int, total: int) -> None:
            # How much is needed for a goal is known after the first round.
            is_known = goal is None or total > FIRST_SPP * asked.width * asked.height
            expected = total if is_known else None
            progress.update(task, description=f"rendering {picture.exr.name}", completed=done, total=expected)

        began = perf_counter()
        result = render_image(scene, settings, goal, show)
        wall = perf_counter() - began
    write_exr(picture.exr, result)
    if picture.png:
        write_png(picture.png, result.aovs.get(Aov.DENOISED, result.radiance))
    _print_render(result, goal, depth_is_asked=depth_is_asked)
    if choice is not None:
        typer.echo(f"{choice.seconds + wall:.2f} s in all, with {choice.seconds:.2f} s of the pilot")
    elif goal is not None:
        typer.echo(f"ended by {_ended_by(result, goal)}")
    for file in picture.files:
        typer.echo(f"wrote {file}")


def _choose_goal(target_error: str | None, error_over: str | None, time: float | None, spp: int | None) -> Goal | None:
    """None where the number of samples per pixel is given beforehand."""
    if error_over is not None and target_error is None:
        raise ConfigError("--errorOver is of the error that --targetError asks for, which is missing")
    if target_error is None and time is None:
        return None
    from fgf_warp.convergence import MAX_SPP, Goal  # noqa: PLC0415 - starts Warp

    return Goal(
        error=None if target_error is None else parse_share("--targetError", target_error),
        over=error_over or "mean",
        time=time,
        max_spp=MAX_SPP if spp is None else spp,
    )


def _choose_aovs(names: list[str] | None) -> frozenset[Aov] | None:
    """None where nothing is asked for."""
    if not names:
        return None
    unknown = [name for name in names if name not in list(Aov)]
    if unknown:
        raise ConfigError(f"--aov {unknown[0]}: accepted: {', '.join(Aov)}")
    return frozenset(Aov(name) for name in names)


def _print_render(result: RenderResult, goal: Goal | None, *, depth_is_asked: bool) -> None:
    over = "mean" if goal is None else goal.over
    typer.echo(
        f"{result.seconds:.2f} s, {result.samples_per_second:.4g} samples/s, {result.samples} samples per pixel, "
        f"{over} relative standard error {result.relative_error(over):.2%}"
    )
    if result.truncated_count and not depth_is_asked:
        share = result.truncated_count / result.path_count
        warn(
            [
                f"{result.truncated_count} paths ({share:.2g} of all) were cut after {result.settings.max_depth} "
                "scattering events, so the image is a little too dark; a higher --preset cuts later"
            ]
        )


def _ended_by(result: RenderResult, goal: Goal) -> str:
    """The bound that was met first."""
    if goal.is_met_by(result):
        return f"--targetError {goal.error:.4g}"
    return f"--spp {goal.max_spp}" if goal.time is None or result.samples >= goal.max_spp else f"--time {goal.time:g}"


def _print_reasons(reasons: Sequence[Reason]) -> None:
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    table = Table("part", "in the kernel", "why")
    for reason in reasons:
        table.add_row(reason.part, "yes" if reason.built else "-", reason.why)
    Console(markup=False, highlight=False).print(table)
