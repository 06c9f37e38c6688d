"""Renders every pair with every rung and compares the images with the reference."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from fgf_warp import __version__
from fgf_warp.errors import ConfigError, SceneError
from fgf_warp.output.color import mean_delta_e, to_display
from fgf_warp.output.flip import mean_flip
from fgf_warp.scene import Medium, Scene
from fgf_warp.settings import PRESETS, Aov, RenderSettings
from generators.stage import load_scene
from generators.tradeoff.config import LoadedTradeoff, MediumConfig, RungConfig, variations
from generators.tradeoff.features import FEATURE_AOVS, read_features
from generators.tradeoff.front import BASE, Front, Pair, Reference, Rung
from generators.tradeoff.metrics import compare, relative_standard_error
from generators.tradeoff.reference import LongRender, clock, reference_settings, render_reference

Progress = Callable[[str, int, int], None]
"""Called with what is under way, the images that are done, and how many there are."""
FEATURE_SPP = 64
"""Samples per pixel of the image that the features are read from."""
STARTS = 5
"""Renders of which the quickest tells what comes before the first sample; one before them warms up."""
CLOCK_TICK = 1e-6
"""[s] No time that is measured is shorter."""


@dataclass(frozen=True, eq=False)
class Subject:
    """A stage with a medium, before it is measured.

    Args:
        name: of the pair.
        stage: as the config names it.
        scene: to render.
    """

    name: str
    stage: str
    scene: Scene


@dataclass(frozen=True, eq=False)
class Measured:
    """A pair with what is shown of it.

    Args:
        pair: the numbers.
        reference: what it was compared with.
        pictures: radiance of the first image of each rung, by its name.
    """

    pair: Pair
    reference: LongRender
    pictures: Mapping[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a run found.

    Args:
        front: the numbers.
        measured: the same with pictures, in the same order.
        warnings: of the stages.
    """

    front: Front
    measured: tuple[Measured, ...]


def list_subjects(loaded: LoadedTradeoff) -> tuple[list[Subject], list[str]]:
    """What is to be measured, and the warnings of the stages; all of it is read and checked before work begins.

    Args:
        loaded: the config.

    Returns:
        For each stage a subject for each medium that the config asks for; and the warnings, which begin with the stage.

    Raises:
        FgfError: where a stage cannot be read, or its media cannot be as the config says.
    """
    subjects, warnings = [], []
    for stage in loaded.config.stages:
        base = load_scene(loaded.stage_file(stage), width=loaded.config.size, height=loaded.config.size)
        warnings += [f"{stage}: {warning}" for warning in base.warnings]
        own = base.scene.media
        for edit in loaded.config.media or (variations(own[0]) if own else [MediumConfig()]):
            name = f"{Path(stage).stem}: {edit}"
            if not own and edit.overrides():
                raise ConfigError(f"{loaded.path}: media: {edit}: stage {stage} has no medium to change")
            try:
                subjects.append(Subject(name, stage, base.scene.with_media(tuple(edit.apply(m) for m in own))))
            except SceneError as error:
                raise ConfigError(f"{loaded.path}: {name}: {error}") from error
    return subjects, warnings


def applicable_rungs(scene: Scene, rungs: Mapping[str, RungConfig]) -> dict[str, RungConfig]:
    """The rungs that change anything in a scene and that its media can have."""
    return {name: rung for name, rung in rungs.items() if rung.matters(scene.media) and _accepts(scene, rung)}


def _accepts(scene: Scene, rung: RungConfig) -> bool:
    asked = {"transport": rung.transport, "line_variance": rung.line_variance}
    changes: dict[str, Any] = {name: value for name, value in asked.items() if value is not None}
    try:
        scene.with_media(tuple(replace(medium, **changes) for medium in scene.media))
    except SceneError:
        return False
    return True


def measure(
    loaded: LoadedTradeoff, subjects: list[Subject], cache: Path, device: str, progress: Progress | None = None
) -> Outcome:
    """Measures all pairs.

    Args:
        loaded: the config.
        subjects: of `list_subjects`.
        cache: folder of the references, which is there.
        device: a Warp device.
        progress: called as it goes on.

    Raises:
        NumericalError: where a sample was not finite.
        OutputError: where a reference cannot be put into the cache.
    """
    config = loaded.config
    ladders = [applicable_rungs(subject.scene, config.rungs) for subject in subjects]
    total = config.replicates * sum(1 + len(ladder) for ladder in ladders)
    done = 0

    def advance(name: str) -> Callable[[], None]:
        def count() -> None:
            nonlocal done
            done += 1
            if progress is not None:
                progress(name, done, total)

        return count

    preset = PRESETS[BASE]
    settings = RenderSettings(
        width=config.size,
        height=config.size,
        spp=preset.spp,
        max_depth=preset.max_depth,
        roulette_depth=preset.roulette_depth,
        device=device,
    )
    measured = [
        measure_pair(subject, settings, ladder, config.replicates, cache, advance(subject.name))
        for subject, ladder in zip(subjects, ladders, strict=True)
    ]
    front = Front(_versions(), _machine(device), config.size, config.replicates, tuple(one.pair for one in measured))
    return Outcome(front, tuple(measured))


def measure_pair(
    subject: Subject,
    settings: RenderSettings,
    rungs: Mapping[str, RungConfig],
    replicates: int,
    cache: Path,
    progress: Callable[[], None] = lambda: None,
) -> Measured:
    """Measures one pair.

    Args:
        subject: what to render.
        settings: of the rung that says nothing.
        rungs: by name; `BASE` is among them.
        replicates: images of each.
        cache: folder of the references.
        progress: called after each image.
    """
    most = max(rung.apply(settings).spp for rung in rungs.values())
    long_settings = reference_settings(settings, spp=most, replicates=replicates)
    reference = render_reference(subject.scene, long_settings, replicates, cache, progress)
    start = _start_seconds(subject.scene, settings)
    found, pictures = [], {}
    for place, (name, rung) in enumerate(rungs.items()):
        first_seed = place * replicates
        images, seconds = _render_replicates(subject.scene, rung.apply(settings), replicates, first_seed, progress)
        pictures[name] = images[0]
        found.append(_rung(name, rung, rung.apply(settings), images, max(seconds - start, CLOCK_TICK), reference))
    pair = Pair(
        name=subject.name,
        stage=subject.stage,
        medium=describe_medium(subject.scene.media[0]) if subject.scene.media else {},
        features=_measure_features(subject.scene, settings),
        start_seconds=start,
        reference=Reference(reference.spp, relative_standard_error(reference.parts), reference.seconds),
        rungs=tuple(_judge(found)),
    )
    return Measured(pair, reference, pictures)


def describe_medium(medium: Medium) -> dict[str, Any]:
    """Parameters of a medium by their short names."""
    return {
        "H": medium.hurst,
        "g": medium.asymmetry,
        "S_w": medium.white_noise_scale,
        "sigma_m": medium.mean_extinction,
        "albedo": list(medium.albedo),
        "L": medium.outer_scale,
        "kappa": medium.line_law.kappa,
        "regime": medium.line_law.regime,
        "transport": medium.resolved_transport,
        "line_variance": medium.line_variance,
    }


def _measure_features(scene: Scene, settings: RenderSettings) -> dict[str, Any]:
    from fgf_warp.renderer import render  # noqa: PLC0415 - starts Warp

    return read_features(scene, render(scene, replace(settings, spp=FEATURE_SPP, aovs=FEATURE_AOVS)))


def _start_seconds(scene: Scene, settings: RenderSettings) -> float:
    """The least time of a few renders that end with their first sample."""
    from fgf_warp.renderer import render  # noqa: PLC0415

    seconds = []
    for _ in range(STARTS + 1):
        began = clock(settings)
        render(scene, replace(settings, spp=1))
        seconds.append(clock(settings) - began)
    return min(seconds[1:])


def _render_replicates(
    scene: Scene, settings: RenderSettings, replicates: int, first_seed: int, progress: Callable[[], None]
) -> tuple[np.ndarray, float]:
    """Independent images and the median of the times that they took, once the kernel is there and warm."""
    from fgf_warp.finishing import render_image  # noqa: PLC0415 - starts Warp

    render_image(scene, replace(settings, spp=1))
    images, seconds = [], []
    for replicate in range(replicates):
        began = clock(settings)
        result = render_image(scene, replace(settings, seed=first_seed + replicate))
        seconds.append(clock(settings) - began)
        images.append(result.aovs.get(Aov.DENOISED, result.radiance))
        progress()
    return np.stack(images), median(seconds)


def _rung(
    name: str,
    rung: RungConfig,
    settings: RenderSettings,
    images: np.ndarray,
    seconds: float,
    reference: LongRender,
) -> Rung:
    errors = compare(images, reference.parts)
    shown, expected = to_display(images[0]), to_display(reference.picture)
    return Rung(
        name=name,
        settings=rung.overrides(),
        spp=settings.spp,
        seconds=seconds,
        rmse=errors.rmse,
        relative_mse=errors.relative_mse,
        relative_rmse=errors.relative_mse**0.5,
        bias=errors.bias,
        bias_low=errors.bias_low,
        bias_high=errors.bias_high,
        bias_rms=errors.bias_rms,
        bias_rms_high=errors.bias_rms_high,
        noise=errors.noise,
        flip=mean_flip(shown, expected),
        delta_e=mean_delta_e(shown, expected),
        efficiency=None,
        pareto=False,
    )


def _judge(rungs: list[Rung]) -> list[Rung]:
    """The same with what follows from comparing them with each other."""
    base = next(rung for rung in rungs if rung.name == BASE)

    def cost(rung: Rung) -> float:
        return rung.relative_mse * rung.seconds

    def is_beaten(rung: Rung) -> bool:
        return any(
            other.seconds <= rung.seconds
            and other.relative_mse <= rung.relative_mse
            and (other.seconds, other.relative_mse) != (rung.seconds, rung.relative_mse)
            for other in rungs
        )

    def efficiency(rung: Rung) -> float | None:
        return cost(base) / cost(rung) if cost(base) > 0 and cost(rung) > 0 else None

    return [replace(rung, efficiency=efficiency(rung), pareto=not is_beaten(rung)) for rung in rungs]


def _versions() -> dict[str, str]:
    return {"fgf-warp": __version__, "warp-lang": version("warp-lang"), "python": platform.python_version()}


def _machine(device: str) -> str:
    return f"{platform.machine()}, {os.cpu_count()} cores, on {device}"
