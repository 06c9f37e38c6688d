"""A render as a simulation: an immutable model, a state, and a step that adds samples to it."""

from __future__ import annotations

import os
import platform
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import warp as wp

from fgf_warp import __version__
from fgf_warp.bvh import load_builder
from fgf_warp.errors import ConfigError, NumericalError
from fgf_warp.features import required_features
from fgf_warp.integrator import SAMPLE_FLOATS, Film, Program, build_program, lane_floats
from fgf_warp.result import RenderResult
from fgf_warp.scene import Scene
from fgf_warp.settings import Aov, RenderSettings
from fgf_warp.upload import UploadedScene, upload

Progress = Callable[[int, int], None]
"""Called with the camera paths done so far, and in all."""

PATHS_PER_LAUNCH = 1 << 15
"""On the CPU: so many that the lanes are rarely idle at the end, so few that their samples stay in the cache."""
PATHS_PER_CUDA_LAUNCH = 1 << 24
"""On CUDA: enough to fill the device."""
FARTHEST = 1e38
"""Depths beyond it stand for nothing met."""
BLOCK_DIM = 128
"""Threads of a CUDA block."""

_build_lock = threading.Lock()


@dataclass(frozen=True, eq=False)
class Model:
    """What stays the same during a render: the scene on its device, and the kernel made for it."""

    scene: Scene
    settings: RenderSettings
    program: Program
    uploaded: UploadedScene


@dataclass(eq=False)
class State:
    """What a render changes: sums over samples, and how many there are."""

    film: Any
    samples: int = 0


def check_device(name: str) -> None:
    """Checks that Warp has this device.

    Raises:
        ConfigError: naming the devices there are.
    """
    wp.init()
    found = [device.alias for device in wp.get_devices()]
    if name not in found:
        raise ConfigError(f"device = {name!r}; accepted on this machine: {', '.join(found)}")


def prepare(scene: Scene, settings: RenderSettings) -> Program:
    """The kernel for this scene and these settings, built and loaded on the device.

    Raises:
        ConfigError: for a device that is not there.
    """
    check_device(settings.device)
    with _build_lock:
        program = build_program(required_features(scene, settings))
        if program.features.meshes:
            load_builder()
        if settings.device == "cpu":
            # A launch on the CPU asks for blocks of one thread, and would build anew for any other.
            program.render_pool.module.load(wp.get_device("cpu"), 1)
        else:
            program.render_threads.module.load(wp.get_device(settings.device), BLOCK_DIM)
    return program


def build_model(scene: Scene, settings: RenderSettings) -> Model:
    """All that `step` needs.

    Raises:
        ConfigError: for a device that is not there.
        UnsupportedFeatureError: for a scene that this version cannot render.
    """
    program = prepare(scene, settings)
    return Model(scene, settings, program, upload(scene, settings))


def begin(model: Model) -> State:
    """An empty film."""
    settings = model.settings
    pixels = settings.width * settings.height

    def plane(dtype: Any, needed: bool = True) -> wp.array:
        return wp.zeros(pixels if needed else 0, dtype=dtype, device=settings.device)

    film = Film()
    film.radiance = plane(wp.vec3d)
    film.radiance_sq = plane(wp.vec3d)
    film.alpha = plane(wp.float64)
    film.depth = plane(wp.float32, Aov.DEPTH in settings.aovs)
    film.depth.fill_(np.inf)
    film.transmittance = plane(wp.vec3d, Aov.TRANSMITTANCE in settings.aovs)
    film.albedo = plane(wp.vec3d, Aov.ALBEDO in settings.aovs)
    film.invalid = plane(wp.int32)
    film.truncated = plane(wp.int32)
    return State(film)


def step(model: Model, state: State, samples: int, progress: Progress | None = None) -> None:
    """Adds `samples` per pixel to the state; how a render is cut into steps does not change its pixels.

    Raises:
        NumericalError: where a sample was not finite, naming its pixel.
    """
    settings = model.settings
    if settings.device == "cpu":
        _step_cpu(model, state, samples, progress)
    else:
        _step_cuda(model, state, samples, progress)
    state.samples += samples
    _check_finite(model, state)


def render(scene: Scene, settings: RenderSettings, progress: Progress | None = None) -> RenderResult:
    """Renders a scene.

    Args:
        scene: what to render.
        settings: how far.
        progress: called with the camera paths done and in all.

    Raises:
        ConfigError: for a device that is not there.
        UnsupportedFeatureError: for a scene that this version cannot render.
        NumericalError: where a sample was not finite.
    """
    model = build_model(scene, settings)
    state = begin(model)
    start = time.perf_counter()
    step(model, state, settings.spp, progress)
    return develop(model, state, time.perf_counter() - start)


def develop(model: Model, state: State, seconds: float) -> RenderResult:
    """The image of a state, of at least one sample.

    Args:
        model: what was rendered.
        state: its sums.
        seconds: wall time that the samples took.
    """
    settings, film, n = model.settings, state.film, state.samples

    def mean(plane: wp.array) -> np.ndarray:
        values = plane.numpy() / n
        return values.reshape(settings.height, settings.width, *values.shape[1:])

    radiance = mean(film.radiance)
    spread = np.maximum(mean(film.radiance_sq) - radiance**2, 0.0)
    aovs: dict[Aov, np.ndarray] = {}
    if Aov.DEPTH in settings.aovs:
        depth = film.depth.numpy().reshape(settings.height, settings.width)
        aovs[Aov.DEPTH] = np.where(depth < FARTHEST, depth, np.inf).astype(np.float32)
    if Aov.TRANSMITTANCE in settings.aovs:
        aovs[Aov.TRANSMITTANCE] = mean(film.transmittance).astype(np.float32)
    if Aov.ALBEDO in settings.aovs:
        aovs[Aov.ALBEDO] = mean(film.albedo).astype(np.float32)
    variance = spread / (n - 1) if n > 1 else np.full_like(spread, np.inf)
    return RenderResult(
        radiance=radiance.astype(np.float32),
        alpha=mean(film.alpha).astype(np.float32),
        variance=variance.astype(np.float32),
        aovs=aovs,
        samples=n,
        path_count=n * settings.width * settings.height,
        truncated_count=int(film.truncated.numpy().sum(dtype=np.int64)),
        seconds=seconds,
        settings=settings,
        provenance=_provenance(model, n),
    )


def _step_cpu(model: Model, state: State, samples: int, progress: Progress | None) -> None:
    """Threads pull ranges of pixels; a launch runs on the thread that asks for it and releases the GIL."""
    settings = model.settings
    pixels = settings.width * settings.height
    total, done, lock = pixels * samples, 0, threading.Lock()
    threads = settings.threads or os.cpu_count() or 1
    tile = max(1, min(-(-pixels // (4 * threads)), PATHS_PER_LAUNCH))
    scratch_floats = 2 * lane_floats(model.program.features) + PATHS_PER_LAUNCH * int(SAMPLE_FLOATS)
    own = threading.local()

    def render_range(task: tuple[int, int, int, int]) -> None:
        nonlocal done
        first_pixel, pixel_count, first_sample, sample_count = task
        if not hasattr(own, "scratch"):
            own.scratch = wp.empty(scratch_floats, dtype=float, device="cpu")
        wp.launch(
            model.program.render_pool,
            dim=1,
            inputs=[*_inputs(model, state), own.scratch, first_pixel, pixel_count, first_sample, sample_count],
            device="cpu",
        )
        with lock:
            done += pixel_count * sample_count
            if progress is not None:
                progress(done, total)

    # A pixel's samples stay in order: the ranges of one round are disjoint, and a round ends before the next.
    with ThreadPoolExecutor(threads) as pool:
        for first_sample, sample_count in _rounds(state.samples, samples, max(1, PATHS_PER_LAUNCH // tile)):
            tasks = [(first, min(tile, pixels - first), first_sample, sample_count) for first in range(0, pixels, tile)]
            list(pool.map(render_range, tasks))


def _step_cuda(model: Model, state: State, samples: int, progress: Progress | None) -> None:
    settings = model.settings
    pixels = settings.width * settings.height
    done = 0
    for first_sample, sample_count in _rounds(state.samples, samples, max(1, PATHS_PER_CUDA_LAUNCH // pixels)):
        wp.launch(
            model.program.render_threads,
            dim=pixels,
            inputs=[*_inputs(model, state), 0, first_sample, sample_count],
            device=settings.device,
            block_dim=BLOCK_DIM,
        )
        wp.synchronize_device(settings.device)
        done += pixels * sample_count
        if progress is not None:
            progress(done, pixels * samples)


def _rounds(first: int, samples: int, at_once: int) -> Iterator[tuple[int, int]]:
    for start in range(first, first + samples, at_once):
        yield start, min(at_once, first + samples - start)


def _inputs(model: Model, state: State) -> list[Any]:
    return [model.uploaded.data, model.uploaded.limits, state.film, wp.uint64(model.settings.seed)]


def _check_finite(model: Model, state: State) -> None:
    invalid = state.film.invalid.numpy()
    if not invalid.any():
        return
    row, column = divmod(int(np.argmax(invalid)), model.settings.width)
    media = "; ".join(
        f"{m.name}: H = {m.hurst:g}, S_w = {m.white_noise_scale:g}, sigma_m = {m.mean_extinction:g}, "
        f"g = {m.asymmetry:g}"
        for m in model.scene.media
    )
    raise NumericalError(
        f"{int(invalid.sum())} samples are not finite, most of them in pixel ({column}, {row}) "
        f"with seed {model.settings.seed} ({media})"
    )


def _provenance(model: Model, samples: int) -> dict[str, Any]:
    settings, scene = model.settings, model.scene
    return {
        "scene": scene.source,
        "meters_per_unit": scene.meters_per_unit,
        "camera": scene.camera.name,
        "media": [
            {
                "name": m.name,
                "H": m.hurst,
                "g": m.asymmetry,
                "S_w": m.white_noise_scale,
                "sigma_m": m.mean_extinction,
                "extinction_color": list(m.extinction_color),
                "albedo": list(m.albedo),
                "L": m.outer_scale,
                "regime": m.line_law.regime,
                "b": m.line_law.b,
                "kappa": m.line_law.kappa,
                "transport": m.resolved_transport,
                "priority": m.priority,
            }
            for m in scene.media
        ],
        "settings": {
            key: value
            for key, value in asdict(settings).items()
            if key in ("width", "height", "seed", "max_depth", "roulette_depth")
        }
        | {"spp": samples, "device": settings.device.split(":")[0]},
        "versions": {"fgf-warp": __version__, "warp-lang": wp.config.version, "python": platform.python_version()},
    }
