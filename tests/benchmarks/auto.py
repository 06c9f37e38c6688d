"""`python -m tests.benchmarks.auto`: whether `--preset auto:1%` ends at 1 %, and `auto:5s` in 5 s.

Twelve pairs of a stage and a medium, most of which `configs/tradeoff.yaml` has not measured, are rendered as
`fgf render` does. What they come to is compared with long renders, which are kept in a folder from one run to the next.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import warp as wp

from fgf_warp.finishing import render_image
from fgf_warp.renderer import render
from fgf_warp.result import RenderResult, block_errors
from fgf_warp.scene import Scene, Solid
from fgf_warp.settings import PRESETS, RenderSettings
from generators.auto import choose
from generators.stage import load_scene
from generators.tradeoff.config import MediumConfig
from generators.tradeoff.front import Front, read_front
from generators.tradeoff.reference import default_cache, render_reference
from generators.wish import Wish
from tests.benchmarks import scenes
from usd_scenes.examples import stage_path

ERROR, ERROR_RANGE = "auto:1%", (0.005, 0.012)
TIME, TIME_RANGE = "auto:5s", (4.0, 6.0)
"""What is asked for, and what counts as kept."""
LEAST_KEPT = 11
"""Of the twelve."""
REFERENCE_ERROR = 0.003
"""Relative, rms over blocks, that references are rendered to where REFERENCE_PATHS allow it."""
REFERENCE_PATHS = 2e8
REFERENCE_PARTS = 8
PILOT_SPP = 64
"""By which the samples of a reference are chosen."""


@dataclass(frozen=True)
class Pair:
    """What is rendered.

    Args:
        name: of the pair.
        stage: of the library, or ``box`` for scene B of the benchmark.
        medium: what its media are changed to.
        size: of the image, square [pixel].
        edit: of the scene, in what a `MediumConfig` cannot say.
    """

    name: str
    stage: str
    medium: MediumConfig
    size: int = 64
    edit: Callable[[Scene], Scene] = lambda scene: scene

    def scene(self, folder: Path) -> Scene:
        """The scene; stages that are made are written into the folder."""
        path = scenes.author("B", folder) if self.stage == "box" else stage_path(self.stage)
        scene = load_scene(path, width=self.size, height=self.size).scene
        return self.edit(scene.with_media(tuple(self.medium.apply(medium) for medium in scene.media)))


def colored(scene: Scene) -> Scene:
    """Denser for blue than for red light."""
    return scene.with_media(tuple(replace(medium, extinction_color=(0.4, 0.7, 1.0)) for medium in scene.media))


def nested(scene: Scene) -> Scene:
    """A dense ball of classical medium within the first."""
    (outer,) = (shape for shape in scene.shapes if shape.medium == 0)
    matrix = outer.object_to_world @ np.diag([0.5, 0.5, 0.5, 1.0])
    core = replace(
        scene.media[0], name="/core", hurst=-0.5, white_noise_scale=0.0, mean_extinction=8.0, albedo=(0.9, 0.6, 0.3)
    )
    ball = Solid("/core", "sphere", matrix, medium=len(scene.media))
    return replace(scene, shapes=(*scene.shapes, ball), media=(*scene.media, core))


def medium(**values: float | str) -> MediumConfig:
    """Parameters by their short names."""
    return MediumConfig.model_validate(values)


PAIRS = (
    Pair("exponential", "sphere", medium(H=-0.5, S_w=0, g=0, sigma_m=3, albedo=0.9), 96),
    Pair("negative", "sphere", medium(H=-0.9, S_w=3, g=0.3, sigma_m=2, albedo=0.95)),
    Pair("pink", "studio", medium(H=-0.25, S_w=1, g=0, sigma_m=3, albedo=0.8)),
    Pair("colored", "sphere", medium(H=-0.3, S_w=2, g=0.5, sigma_m=6, albedo=0.98), edit=colored),
    Pair("exact fBm", "cloud_block", medium(H=0.25, S_w=1, L=10, g=0, sigma_m=3, albedo=0.5, line_variance="exact")),
    Pair("fBm", "sphere", medium(H=0.5, S_w=0.5, L=6, g=0.2, sigma_m=4, albedo=0.9), 128),
    Pair("mixed", "studio", medium(H=-0.25, S_w=3, g=0.5, sigma_m=5, albedo=0.95, transport="mixed")),
    Pair("forward, thick", "sphere", medium(H=-0.4, S_w=2, g=0.9, sigma_m=20, albedo=0.99)),
    Pair("thin fog", "cloud_block", medium(H=-0.5, S_w=0, g=0.6, sigma_m=0.1, albedo=1)),
    Pair("knot", "knot", medium(H=-0.2, S_w=1, g=0.3, sigma_m=4, albedo=0.9)),
    Pair("box", "box", medium()),
    Pair("nested", "sphere", medium(H=-0.25, S_w=1, g=0.4, sigma_m=1.5, albedo=0.95), edit=nested),
)


@dataclass(frozen=True)
class Errors:
    """Relative errors of an image.

    Args:
        rms: over blocks, as the goal is.
        mean: over blocks.
        plain: root of the mean squared error over the mean radiance.
    """

    rms: float
    mean: float
    plain: float


def true_errors(image: np.ndarray, reference: np.ndarray, variance: np.ndarray) -> Errors:
    """Errors of an image, without what the reference's own noise adds to them.

    Args:
        image: (height, width, 3).
        reference: what it should be.
        variance: of the reference.
    """
    difference = (image.astype(np.float64) - reference) ** 2
    found, pixels = block_errors(reference, difference)
    own, _ = block_errors(reference, variance)
    squares = found**2 - own**2
    plain = max(float(difference.mean() - variance.mean()), 0.0)
    return Errors(
        rms=math.sqrt(max(float(np.average(squares, weights=pixels)), 0.0)),
        mean=float(np.average(np.sqrt(np.maximum(squares, 0.0)), weights=pixels)),
        plain=math.sqrt(plain) / float(reference.mean()),
    )


def reference(scene: Scene, settings: RenderSettings, cache: Path) -> tuple[np.ndarray, np.ndarray]:
    """A long render without a bound that paths could meet, and its variance."""
    settings = replace(settings, max_depth=PRESETS["reference"].max_depth)
    pixels = settings.width * settings.height
    pilot = render(scene, replace(settings, spp=PILOT_SPP, seed=1))
    spp = PILOT_SPP * (pilot.relative_error("rms") / REFERENCE_ERROR) ** 2
    spp = max(1, int(min(spp, REFERENCE_PATHS / pixels) / REFERENCE_PARTS))
    parts = render_reference(scene, replace(settings, spp=spp), REFERENCE_PARTS, cache).parts
    return parts.mean(axis=0, dtype=np.float64), parts.var(axis=0, ddof=1, dtype=np.float64) / len(parts)


def render_as(preset: str, scene: Scene, settings: RenderSettings, front: Front) -> tuple[str, RenderResult, float]:
    """The rung that a preset picks, the image, and the wall time that both took once kernels are built."""
    choice = choose(scene, settings, Wish.parse(preset), front)
    began = time.perf_counter()
    result = render_image(scene, choice.settings, choice.goal)
    return choice.rung, result, choice.seconds + time.perf_counter() - began


def main() -> int:
    """Returns the exit code: 0 where as many keep what is asked for as there should be, else 1."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.auto", description=__doc__)
    parser.add_argument("--only", help=f"a list of {', '.join(pair.name for pair in PAIRS)}, separated by semicolons")
    parser.add_argument("--front", type=Path, help="tradeoff.json to choose from, in place of the package's own")
    parser.add_argument("--cache", type=Path, default=default_cache(), help="folder of the long renders")
    parser.add_argument("--seed", type=int, default=0, help="of the images")
    arguments = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    arguments.cache.mkdir(parents=True, exist_ok=True)
    front = read_front(arguments.front)
    only = arguments.only.split(";") if arguments.only else [pair.name for pair in PAIRS]
    pairs = [pair for pair in PAIRS if pair.name in only]
    heads = ("told", "rms", "mean", "plain", "ref. SE", "kept?")
    print(f"{'pair':15} {f'{ERROR} picks':18}" + "".join(f"{head:>9}" for head in heads), end="")
    print(f"   {f'{TIME} picks':18}{'time':>8}{'kept?':>7}{'rms':>9}")
    kept = {ERROR: 0, TIME: 0}
    with tempfile.TemporaryDirectory() as folder:
        for pair in pairs:
            scene, settings = pair.scene(Path(folder)), RenderSettings(pair.size, pair.size, seed=arguments.seed)
            truth, variance = reference(scene, settings, arguments.cache)
            own = true_errors(truth + np.sqrt(variance), truth, np.zeros_like(variance)).rms
            rung, result, _ = render_as(ERROR, scene, settings, front)
            errors, told = true_errors(result.radiance, truth, variance), result.relative_error("rms")
            is_kept = ERROR_RANGE[0] <= errors.rms <= ERROR_RANGE[1]
            shares = "".join(f"{100 * value:8.2f}%" for value in (told, errors.rms, errors.mean, errors.plain, own))
            print(f"{pair.name:15} {rung:18}{shares}{'yes' if is_kept else 'NO':>9}", end="", flush=True)
            rung, result, seconds = render_as(TIME, scene, settings, front)
            is_in_time = TIME_RANGE[0] <= seconds <= TIME_RANGE[1]
            rms = true_errors(result.radiance, truth, variance).rms
            print(f"   {rung:18}{seconds:7.2f}s{'yes' if is_in_time else 'NO':>7}{100 * rms:8.2f}%", flush=True)
            kept[ERROR] += is_kept
            kept[TIME] += is_in_time
    for preset, count in kept.items():
        print(f"{preset}: {count} of {len(pairs)}")
    return 0 if min(kept.values()) >= len(pairs) - (len(PAIRS) - LEAST_KEPT) else 1


if __name__ == "__main__":
    sys.exit(main())
