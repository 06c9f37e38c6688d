"""The command that checks a stage or a config."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fgf_warp.errors import FgfError
from generators.commands.common import EXIT_BAD_INPUT, count_of, warn
from generators.commands.plan import make_plan

if TYPE_CHECKING:
    from fgf_warp.scene import Medium, Scene


def validate(
    path: Annotated[Path, typer.Argument(metavar="STAGE_OR_CONFIG", help="A USD file, or a dataset's YAML file.")],
) -> None:
    """Check a stage or a config and say what is in it.

    Of a stage it tells everything that is wrong, by USD's own validators and by those of FGF-Warp, one line each. Where
    there is an error, the exit code is 2.

    \b
    Example:
      fgf validate usd_scenes/stages/cloud_block.usda
    """  # noqa: D301
    if path.suffix.lower() in (".yaml", ".yml"):
        _, made = make_plan(path, None, "cpu")
        swept = ", ".join(axis.name for axis in made.meta.axes) or "nothing"
        typer.echo(f"{path}: {count_of(len(made.samples), 'sample')}, sweeping {swept}, of {made.meta.scene}")
        _print_scene(made.scene_of(made.samples[0]), made.meta.width, made.meta.height)
        warn(made.warnings)
        return
    from generators.stage import load_scene  # noqa: PLC0415
    from usd_scenes.validation import validate_stage  # noqa: PLC0415

    findings = validate_stage(path)
    for finding in findings:
        typer.echo(finding)
    counts = {kind: sum(finding.severity == kind for finding in findings) for kind in ("error", "warning")}
    typer.echo(f"{path}: {count_of(counts['error'], 'error')}, {count_of(counts['warning'], 'warning')}")
    try:
        base = load_scene(path)
    except FgfError:
        if not counts["error"]:
            raise
        typer.echo("not accepted by the renderer")
    else:
        _print_scene(base.scene, base.width, base.height)
        warn(base.warnings)
    if counts["error"]:
        raise typer.Exit(EXIT_BAD_INPUT)


def _print_scene(scene: Scene, width: int, height: int) -> None:
    typer.echo(f"image   {width} x {height} pixels, {scene.meters_per_unit:g} m per unit")
    typer.echo(f"camera  {scene.camera.name}")
    for medium in scene.media:
        typer.echo(f"medium  {medium.name}: {_describe(medium)}")
    for shape in scene.shapes:
        inside = f", filled with {scene.media[shape.medium].name}" if shape.medium is not None else ""
        count = getattr(shape, "count", 1)
        kind = getattr(getattr(shape, "prototype", shape), "kind", "mesh")
        times = f", {count:,} instances" if count > 1 else ""
        typer.echo(f"shape   {shape.name}: {kind}{times}{inside}")
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
