"""The command that checks a stage or a config."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fgf_warp.errors import ConfigError
from generators.commands.common import (
    EXIT_BAD_INPUT,
    CameraPath,
    DefaultTime,
    Frames,
    Purposes,
    Strict,
    choose_frames,
    count_of,
    progress_bar,
    warn,
)
from generators.commands.plan import make_plan

if TYPE_CHECKING:
    from collections.abc import Mapping

    from fgf_warp.scene import Medium, Scene


def validate(
    path: Annotated[Path, typer.Argument(metavar="STAGE_OR_CONFIG", help="A USD file, or a dataset's YAML file.")],
    frames: Frames = None,
    default_time: DefaultTime = False,
    camera: CameraPath = None,
    purposes: Purposes = None,
    strict: Strict = False,
) -> None:
    """Check a stage or a config and say what is in it.

    Of a stage it tells everything that is wrong, by USD's own validators and by those of FGF-Warp, one line each. Where
    there is an error, the exit code is 2: the renderer refuses the stage, or would leave out a medium.

    \b
    Example:
      fgf validate usd_scenes/stages/cloud_block.usda
      fgf validate shot.usd --frames 101:124 --strict
    """  # noqa: D301
    asked = {"--frames": frames, "--defaultTime": default_time, "--camera": camera, "--purposes": purposes}
    if path.suffix.lower() in (".yaml", ".yml"):
        _validate_config(path, {**asked, "--strict": strict})
        return
    from generators.stage import base_scene, split_purposes  # noqa: PLC0415
    from usd_scenes.validation import Asked, validate_stage  # noqa: PLC0415

    times = choose_frames(frames, default_time=default_time)
    with progress_bar(counted=False) as progress:
        task = progress.add_task("checking", total=None)

        def show(step: str, done: int, total: int) -> None:
            progress.update(task, description=f"checking: {step}", completed=done, total=total, refresh=True)

        found = validate_stage(path, times, Asked(camera, split_purposes(purposes), strict), show)
        progress.remove_task(task)
    for finding in found.findings:
        typer.echo(finding)
    errors, warnings = (sum(finding.severity == kind for finding in found.findings) for kind in ("error", "warning"))
    typer.echo(f"{path}: {count_of(errors, 'error')}, {count_of(warnings, 'warning')}")
    if found.reading is None:
        typer.echo("not accepted by the renderer")
    else:
        base, more = base_scene(found.reading)
        _print_scene(base.scene, base.width, base.height)
        warn(more)
    if errors:
        raise typer.Exit(EXIT_BAD_INPUT)


def _validate_config(path: Path, of_stages: Mapping[str, object]) -> None:
    for option, value in of_stages.items():
        if value:
            raise ConfigError(f"{option} is of a stage; {path} is the config of a dataset")
    _, made = make_plan(path, None, "cpu")
    swept = ", ".join(axis.name for axis in made.meta.axes) or "nothing"
    typer.echo(f"{path}: {count_of(len(made.samples), 'sample')}, sweeping {swept}, of {made.meta.scene}")
    _print_scene(made.scene_of(made.samples[0]), made.meta.width, made.meta.height)
    warn(made.warnings)


def _print_scene(scene: Scene, width: int, height: int) -> None:
    typer.echo(f"image   {width} x {height} pixels, {scene.meters_per_unit:g} m per unit")
    typer.echo(f"camera  {scene.camera.name}")
    for medium in scene.media:
        typer.echo(f"medium  {medium.name}: {_describe(medium)}")
    for shape in scene.shapes:
        inside = f", filled with {scene.media[shape.medium].name}" if shape.medium is not None else ""
        typer.echo(f"shape   {shape.name}: {getattr(shape, 'kind', 'mesh')}{inside}")
    for light in scene.lights:
        typer.echo(f"light   {light.name}: {type(light).__name__}")


def _describe(medium: Medium) -> str:
    from fgf_warp.theory.law import REGIME_NAMES  # noqa: PLC0415
    from generators.planning.plan import PHASE_PARAMETERS  # noqa: PLC0415

    rule = medium.line_law
    parameters = [f"{name} = {value:g}" for name in PHASE_PARAMETERS if (value := getattr(medium, name))]
    return (
        f"H = {medium.hurst:g}, g = {medium.asymmetry:g}, S_w = {medium.white_noise_scale:g}, "
        f"sigma_m = {rule.mean_extinction:g}; {REGIME_NAMES[rule.regime]}, b = {rule.b:.4g}, kappa = {rule.kappa:.4g}, "
        f"{medium.resolved_transport} transport, {medium.phase_function} phase function"
        + (f" ({', '.join(parameters)})" if parameters else "")
        + (f", L = {medium.outer_scale:g}" if medium.outer_scale is not None else "")
        + (", exact line variance" if rule.exact_fbm else "")
    )
