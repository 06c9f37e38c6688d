"""`fgf render`: images of a stage."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from fgf_warp.errors import ConfigError
from fgf_warp.settings import PRESETS, Aov, RenderSettings, Sampler
from fgf_warp.theory.choices import LINE_VARIANCES, TRANSPORTS, LineVariance, Transport
from generators.commands import render_options as option
from generators.commands.common import (
    CameraPath,
    DefaultTime,
    Device,
    Frames,
    Memory,
    Purposes,
    Strict,
    check_choice,
    choose_frames,
    parse_share,
    warn,
)
from generators.commands.render_stage import StageToRender, explain_kernel, render_pictures
from generators.wish import AUTO, FORMS, Wish

if TYPE_CHECKING:
    from collections.abc import Mapping

    from fgf_warp.convergence import Goal


def render(
    stage: option.Stage,
    output: option.Output = None,
    output_root: option.OutputRoot = None,
    camera: CameraPath = None,
    width: option.Width = None,
    height: option.Height = None,
    spp: option.Spp = None,
    target_error: option.TargetError = None,
    error_over: option.ErrorOver = None,
    time: option.Time = None,
    preset: option.PresetName = "balanced",
    seed: option.Seed = 0,
    max_depth: option.MaxDepth = None,
    similarity_order: option.SimilarityOrder = None,
    transport: option.TransportName = None,
    line_variance: option.LineVarianceName = None,
    upscale: option.Upscale = 1,
    sampler: option.SamplerName = Sampler.LATTICE.value,
    device: Device = "cpu",
    memory: Memory = RenderSettings.memory,
    frames: Frames = None,
    default_time: DefaultTime = False,
    purposes: Purposes = None,
    complexity: option.Complexity = "high",
    render_settings: option.SettingsPath = None,
    strict: Strict = False,
    png: option.Png = None,
    aov: option.Planes = None,
    denoise: option.Denoise = False,
    explain: option.Explain = False,
) -> None:
    """Render a stage: one image, or one for each frame.

    \b
    Example:
      fgf render usd_scenes/stages/cloud_block.usda -o cloud.exr --imageWidth 480 --spp 64 --png cloud.png
      fgf render shot.usd -o shot.####.exr --frames 101:124 --camera main_cam
    """  # noqa: D301
    from fgf_warp.output.atomic import check_writable  # noqa: PLC0415
    from generators.stage import split_purposes  # noqa: PLC0415
    from usd_scenes.reader import COMPLEXITIES, OpenStages  # noqa: PLC0415

    aovs = _choose_aovs(aov)
    if output is not None and output_root is not None:
        raise ConfigError("--outputRoot is of the stage's productNames, which --output takes the place of")
    chosen = {
        "--spp": spp,
        "--targetError": target_error,
        "--errorOver": error_over,
        "--time": time,
        "--maxDepth": max_depth,
        "--similarityOrder": similarity_order,
        "--upscale": None if upscale == 1 else upscale,
    }
    wish = _choose_wish(preset, chosen)
    check_choice("--sampler", sampler, Sampler)
    if transport is not None:
        check_choice("--transport", transport, TRANSPORTS)
    if line_variance is not None:
        check_choice("--lineVariance", line_variance, LINE_VARIANCES)
    check_choice("--complexity", complexity, COMPLEXITIES)
    goal = _choose_goal(target_error, error_over, time, spp)
    depths = PRESETS["balanced" if wish else preset]
    settings = RenderSettings(
        spp=depths.spp if spp is None else spp,
        seed=seed,
        max_depth=depths.max_depth if max_depth is None else max_depth,
        roulette_depth=depths.roulette_depth,
        similarity_order=similarity_order,
        sampler=Sampler(sampler),
        transport=cast("Transport | None", transport),
        line_variance=cast("LineVariance | None", line_variance),
        upscale=upscale,
        device=device,
        memory=memory,
    )
    source = StageToRender(
        stage,
        choose_frames(frames, default_time=default_time),
        settings,
        aovs,
        denoise=denoise,
        width=width,
        height=height,
        options={
            "camera": camera,
            "purposes": split_purposes(purposes),
            "complexity": complexity,
            "strict": strict,
            "render_settings": render_settings,
        },
    )
    with OpenStages():
        if explain:
            explain_kernel(source)
            return
        from generators.pictures import plan_pictures  # noqa: PLC0415

        pictures, warnings = plan_pictures(stage, source.times, output, png, render_settings, output_root)
        for picture in pictures:
            for file in picture.files:
                check_writable(file)
        warn(warnings)
        render_pictures(pictures, source, goal, wish, depth_is_asked=max_depth is not None)


def _choose_wish(preset: str, others: Mapping[str, object]) -> Wish | None:
    """None for settings that have a name; options that say the same as a wish, or take a choice away, are refused."""
    if not preset.startswith(AUTO):
        check_choice("--preset", preset, [*PRESETS, FORMS])
        return None
    wish = Wish.parse(preset)
    for name, value in others.items():
        if value is not None:
            raise ConfigError(f"{name}: is chosen by --preset {preset}; accepted: one of them")
    return wish


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
