"""A render as a simulation: an immutable model, a state, and a step that adds samples to it."""

from __future__ import annotations

import os
import platform
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from fgf_warp import __version__
from fgf_warp.bvh import load_builder
from fgf_warp.errors import ConfigError, NumericalError
from fgf_warp.features import RenderFeatures, required_features
from fgf_warp.headers import load_on_cpu
from fgf_warp.integrator import NOT_SEEN, Counts, Film, Program, Round, build_program
from fgf_warp.locks import hold
from fgf_warp.result import RenderResult
from fgf_warp.scene import Instances, Medium, Scene, Shape, count_of
from fgf_warp.settings import GIB, PRIM_AOVS, RENDERED_AOVS, SPLIT_AOVS, Aov, RenderSettings
from fgf_warp.upload import UploadedScene, upload

Progress = Callable[[int, int], None]
"""Called with the camera paths done so far, and in all."""

PATHS_PER_LAUNCH = 1 << 18
"""On the CPU: so many that the lanes are rarely idle at the end, so few that a launch is soon over."""
PIXELS_PER_TASK = 1 << 12
"""On the CPU, at most: some pixels for each lane, so that dark ones do not leave lanes idle."""
TASKS_PER_THREAD = 4
"""On the CPU, at least, so that threads end together."""
PATHS_PER_CUDA_LAUNCH = 1 << 24
"""On CUDA: enough to fill the device."""
FARTHEST = 1e38
"""Depths beyond it stand for nothing met."""
BLOCK_DIM = 128
"""Threads of a CUDA block."""
MEAN_AOVS = (
    Aov.TRANSMITTANCE,
    Aov.ALBEDO,
    Aov.COLLISIONS,
    Aov.PATH_LENGTH,
    Aov.NORMAL,
    Aov.MOTION,
    Aov.OPTICAL_DEPTH,
    Aov.DIRECT,
)
"""Planes of vectors that are means over the samples; the film has their sums under the same names."""
DEVELOPING_BYTES = 128
"""Per pixel, while the image of a film is made: radiance and its variance, and float64 values on the way to planes."""
PLANE_BYTES = 12
"""Per pixel of each further plane, at most: three channels of float32."""
LOCK = "fgf-warp.lock"
"""In the folder of the kernel cache."""

_build_lock = threading.Lock()


@dataclass(frozen=True)
class Variant:
    """What one image of a batch has of its own.

    Args:
        media: in place of the scene's, one for each.
        seed: in place of the settings', in [0, 2^64).
    """

    media: tuple[Medium, ...]
    seed: int


@dataclass(frozen=True, eq=False)
class Model:
    """What stays the same during a render: the scene on its device, and the kernel made for it.

    Args:
        scene: what is rendered.
        settings: how.
        variants: one for each image.
        program: the kernels.
        uploaded: scene and variants on the device.
    """

    scene: Scene
    settings: RenderSettings
    variants: tuple[Variant, ...]
    program: Program
    uploaded: UploadedScene


@dataclass(eq=False)
class State:
    """What a render changes.

    Args:
        film: sums over samples, for each pixel of each image.
        samples: (images, height, width) int32, that each pixel has so far.
        seconds: (images,) that each image took: the time of all threads over their number.
    """

    film: Any
    samples: np.ndarray
    seconds: np.ndarray


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
    _check_plain(settings)
    with _build_lock, _kernel_cache():
        program = build_program(required_features(scene, settings))
        if program.features.meshes:
            load_builder()
        if settings.device == "cpu":
            load_on_cpu(program.render_pool.module)
        else:
            program.render_threads.module.load(wp.get_device(settings.device), BLOCK_DIM)
    return program


def _check_plain(settings: RenderSettings) -> None:
    """Refuses what `finishing` takes out of settings before it renders, since here it would do nothing."""
    plain = replace(settings, upscale=1, transport=None, line_variance=None, aovs=settings.aovs & RENDERED_AOVS)
    changed = [key for key, value in asdict(plain).items() if value != getattr(settings, key)]
    if changed:
        raise ConfigError(
            f"{changed[0]} = {getattr(settings, changed[0])!r} is not the renderer's own to follow; accepted: "
            "fgf_warp.finishing.render_image, or settings without it"
        )


def _kernel_cache() -> AbstractContextManager[None]:
    """Keeps other processes from building into the same cache; what one has built, the next one finds."""
    folder = Path(wp.config.kernel_cache_dir)
    # Into one that cannot be written, such as that of an image of a container, nobody builds.
    return hold(folder / LOCK, wait=True) if os.access(folder, os.W_OK) else nullcontext()


def build_model(scene: Scene, settings: RenderSettings, variants: Sequence[Variant] | None = None) -> Model:
    """All that `step` needs.

    Args:
        scene: what to render.
        settings: how.
        variants: one for each image, all of one kind of kernel, see `batches`; by default the scene as it is.

    Raises:
        ConfigError: for a device that is not there, or images that need more memory than `settings.memory`.
        UnsupportedFeatureError: for a scene that this version cannot render.
    """
    images = tuple(variants) if variants is not None else (Variant(scene.media, settings.seed),)
    check_memory(settings, len(images))
    scene = scene.with_media(images[0].media)  # What is frozen decides which shells are bodies of their own.
    program = prepare(scene, settings)
    media, seeds = [image.media for image in images], [image.seed for image in images]
    uploaded = upload(scene, settings, media, seeds, shading=program.features.shading)
    return Model(scene, settings, images, program, uploaded)


def batches(scene: Scene, variants: Sequence[Variant], settings: RenderSettings, together: int = 1) -> Iterator[Model]:
    """Models of as many successive images as one kernel renders and `settings.memory` holds.

    Args:
        scene: whose media the variants replace.
        variants: one for each image.
        settings: that the images share, but for the seed.
        together: so many successive images, of one kind of kernel, are in one model.

    Raises:
        ConfigError: where the memory does not hold a single image, or for a device that is not there.
        UnsupportedFeatureError: for a scene that this version cannot render.
    """
    check_memory(settings, together)
    at_once = together * int(memory_in_force(settings) * GIB // (together * image_bytes(settings)))

    def kind(variant: Variant) -> tuple[RenderFeatures, list[bool]]:
        """The same for images that one kernel renders with one set of bodies."""
        features = required_features(scene.with_media(variant.media), settings)
        return features, [medium.freezes_paths for medium in variant.media]

    for _, group in groupby(variants, kind):
        images = list(group)
        for first in range(0, len(images), at_once):
            yield build_model(scene, settings, images[first : first + at_once])


def image_bytes(settings: RenderSettings) -> int:
    """Memory that one image takes while it is rendered, beside the scene."""
    film = 2 * 24 + 8 + 6 * 4  # radiance and its square, alpha, six counts
    film += 24 * len(_summed(settings)) + 4 * (Aov.DEPTH in settings.aovs)
    film += 8 * (Aov.SCATTERINGS in settings.aovs) + 2 * 4 * bool(settings.aovs & PRIM_AOVS)
    return settings.width * settings.height * (film + DEVELOPING_BYTES + PLANE_BYTES * len(settings.aovs))


def _summed(settings: RenderSettings) -> set[Aov]:
    """Vector planes that the film sums: of the two parts of the radiance one."""
    return {aov for aov in MEAN_AOVS if aov in settings.aovs} | ({Aov.DIRECT} if settings.aovs & SPLIT_AOVS else set())


def check_memory(settings: RenderSettings, images: int = 1) -> None:
    """Checks that `settings.memory`, and on the CPU the machine's, holds these images.

    Raises:
        ConfigError: naming what they need.
    """
    needed, most = images * image_bytes(settings) / GIB, memory_in_force(settings)
    if needed > most:
        size = f"{settings.width} x {settings.height} pixels"
        what = f"an image of {size}" if images == 1 else f"a batch of {images} images of {size}"
        whose = "memory" if most == settings.memory else "this machine's memory"
        raise ConfigError(f"{what} needs {needed:.3g} GiB; accepted: at most {whose} = {most:.4g} GiB")


def memory_in_force(settings: RenderSettings) -> float:
    """What images may take [GiB]: as asked for, and on the CPU no more than the machine has."""
    if settings.device != "cpu":
        return settings.memory
    return min(settings.memory, os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / GIB)


def begin(model: Model) -> State:
    """Empty films."""
    settings = model.settings
    pixels = settings.width * settings.height * len(model.variants)

    def plane(dtype: Any, needed: bool = True) -> wp.array:
        return wp.zeros(pixels if needed else 0, dtype=dtype, device=settings.device)

    film = Film()
    film.radiance = plane(wp.vec3d)
    film.radiance_sq = plane(wp.vec3d)
    film.alpha = plane(wp.float64)
    film.depth = plane(wp.float32, Aov.DEPTH in settings.aovs)
    film.depth.fill_(np.inf)
    for aov in MEAN_AOVS:
        setattr(film, aov, plane(wp.vec3d, aov in _summed(settings)))
    film.scatterings = plane(wp.float64, Aov.SCATTERINGS in settings.aovs)
    tells_prims = bool(settings.aovs & PRIM_AOVS)
    film.seen = plane(wp.float32, tells_prims)
    film.seen.fill_(np.inf)
    film.seen_item = plane(wp.int32, tells_prims)
    film.seen_item.fill_(NOT_SEEN)
    film.invalid = plane(wp.int32)
    film.truncated = plane(wp.int32)
    images = len(model.variants)
    return State(film, np.zeros((images, settings.height, settings.width), dtype=np.int32), np.zeros(images))


def step(model: Model, state: State, samples: int | np.ndarray, progress: Progress | None = None) -> None:
    """Adds `samples` per pixel to every image; how a render is cut into steps does not change its pixels."""
    for _ in advance(model, state, samples, progress):
        pass


def advance(
    model: Model,
    state: State,
    samples: int | np.ndarray,
    progress: Progress | None = None,
    images: Sequence[int] | None = None,
) -> Iterator[int]:
    """The same, image by image.

    Args:
        model: what to render.
        state: so far.
        samples: to add per pixel, >= 0; of pixels that get different numbers (images, height, width).
        progress: called with the camera paths done and in all.
        images: that get them; by default all images.

    Yields:
        The index of each image, in order, as soon as all its samples are there.
    """
    chosen = range(len(model.variants)) if images is None else images
    if not chosen:
        return
    wanted = state.samples.copy()
    wanted[list(chosen)] += np.asarray(samples, dtype=np.int32)
    advance_on = _advance_cpu if model.settings.device == "cpu" else _advance_cuda
    for image in advance_on(model, state, chosen, wanted, progress):
        state.samples[image] = wanted[image]
        yield image


def render(scene: Scene, settings: RenderSettings, progress: Progress | None = None) -> RenderResult:
    """Renders a scene.

    Args:
        scene: what to render.
        settings: how far.
        progress: called with the camera paths done and in all.

    Raises:
        ConfigError: for a device that is not there, or an image that needs more memory than `settings.memory`.
        UnsupportedFeatureError: for a scene that this version cannot render.
        NumericalError: where a sample was not finite.
    """
    return next(render_batch(scene, [Variant(scene.media, settings.seed)], settings, progress))


def render_batch(
    scene: Scene, variants: Sequence[Variant], settings: RenderSettings, progress: Progress | None = None
) -> Iterator[RenderResult]:
    """Renders many images of one scene whose media differ: a sweep.

    An image is the same, to the bit on one device, in whatever batch it is rendered. Nothing is compiled for a change
    of a medium's parameters within one kind of law (`theory.law.LawKind`), of paths (frozen or not) and of phase
    function.

    Args:
        scene: whose media the variants replace.
        variants: one for each image. Those with laws of one kind should follow each other.
        settings: that the images share, but for the seed.
        progress: called with the camera paths done and in all of one batch.

    Yields:
        The images, in order.

    Raises:
        ConfigError: where the memory does not hold a single image, or for a device that is not there.
        UnsupportedFeatureError: for a scene that this version cannot render.
        NumericalError: where a sample was not finite.
    """
    for model in batches(scene, variants, settings):
        # In a function, so that the films of a batch are gone before the next are made.
        yield from _render_batch(model, progress)


def _render_batch(model: Model, progress: Progress | None) -> Iterator[RenderResult]:
    state = begin(model)
    for image in advance(model, state, model.settings.spp, progress):
        yield develop(model, state, image)


def develop(model: Model, state: State, image: int = 0) -> RenderResult:
    """One image of a state, of at least one sample.

    Raises:
        NumericalError: where a sample was not finite, naming its pixel.
    """
    settings, film, counts = model.settings, state.film, state.samples[image]
    pixels = settings.width * settings.height

    def plane(sums: wp.array) -> np.ndarray:
        values = sums[image * pixels : (image + 1) * pixels].numpy()
        return values.reshape(settings.height, settings.width, *values.shape[1:])

    def mean(sums: wp.array) -> np.ndarray:
        values = plane(sums)
        return values / counts.reshape(*counts.shape, *(1,) * (values.ndim - 2))

    _check_finite(model, image, plane(film.invalid))
    radiance = mean(film.radiance)
    spread = np.maximum(mean(film.radiance_sq) - radiance**2, 0.0)
    several = counts[..., None] > 1
    variance = np.where(several, spread / np.where(several, counts[..., None] - 1, 1), np.inf)
    exposure = model.scene.camera.exposure_scale
    aovs: dict[Aov, np.ndarray] = {}
    if Aov.DEPTH in settings.aovs:
        depth = plane(film.depth)
        aovs[Aov.DEPTH] = np.where(depth < FARTHEST, depth, np.inf).astype(np.float32)
    for aov in MEAN_AOVS:
        if aov in settings.aovs:
            aovs[aov] = mean(getattr(film, aov)).astype(np.float32)
    if Aov.MOTION in settings.aovs:
        aovs[Aov.MOTION] = aovs[Aov.MOTION][..., :2]
    if Aov.DIRECT in settings.aovs:
        aovs[Aov.DIRECT] *= np.float32(exposure)
    if Aov.INDIRECT in settings.aovs:
        aovs[Aov.INDIRECT] = (exposure * (radiance - mean(film.direct))).astype(np.float32)
    if Aov.SCATTERINGS in settings.aovs:
        aovs[Aov.SCATTERINGS] = mean(film.scatterings).astype(np.float32)
    if Aov.SAMPLES in settings.aovs:
        aovs[Aov.SAMPLES] = counts.copy()
    numbers, instances = _prim_numbers(model.scene)
    if Aov.PRIM_ID in settings.aovs:
        aovs[Aov.PRIM_ID] = numbers[plane(film.seen_item)]
    if Aov.INSTANCE_ID in settings.aovs:
        aovs[Aov.INSTANCE_ID] = instances[plane(film.seen_item)]
    return RenderResult(
        radiance=(exposure * radiance).astype(np.float32),
        alpha=mean(film.alpha).astype(np.float32),
        variance=(exposure**2 * variance).astype(np.float32),
        aovs=aovs,
        samples=round(float(counts.mean())),
        path_count=int(counts.sum(dtype=np.int64)),
        truncated_count=int(plane(film.truncated).sum(dtype=np.int64)),
        seconds=float(state.seconds[image]),
        settings=replace(settings, seed=model.variants[image].seed),
        provenance=_provenance(model, image, round(float(counts.mean()))),
    )


def _prim_numbers(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Of each `Path.seen_item`, as an index: the number of its prim and that in its instancer, int32.

    Surfaces count from the front, and nothing and the containers from the back.
    """
    prims = {name: number for number, name in enumerate(scene.prims, start=1)}

    def numbers(shape: Shape) -> np.ndarray:
        rows = np.full((count_of(shape), 2), (prims[shape.name], -1), dtype=np.int32)
        of_instancer = shape.numbers if isinstance(shape, Instances) else shape.instance
        if of_instancer is not None:
            rows[:, 1] = of_instancer
        return rows

    surfaces = [numbers(shape) for shape in scene.shapes if shape.surface is not None]
    containers = [numbers(shape) for shape in scene.shapes if shape.medium is not None]
    table = np.concatenate([*surfaces, *reversed(containers), np.array([(0, -1)], dtype=np.int32)])
    return table[:, 0], table[:, 1]


@dataclass(frozen=True)
class _Task:
    """Some of an image's pixels, which follow each other in `_order`."""

    image: int
    first: int
    samples: np.ndarray
    """(pixels,) that they get."""


def _advance_cpu(
    model: Model, state: State, images: Sequence[int], wanted: np.ndarray, progress: Progress | None
) -> Iterator[int]:
    """Threads pull tasks; a launch runs on the thread that asks for it and releases the GIL."""
    settings = model.settings
    pixels = settings.width * settings.height
    threads = settings.threads or os.cpu_count() or 1
    task_pixels = min(pixels, PIXELS_PER_TASK, max(-(-pixels * len(images) // (TASKS_PER_THREAD * threads)), 1))
    added = (wanted - state.samples).reshape(-1, pixels)
    order = _order(added)
    for first in range(0, pixels, task_pixels):
        # In each task as they are in the image, where neighbours meet the same.
        order[:, first : first + task_pixels].sort(axis=1)
    total, done, lock = int(added.sum(dtype=np.int64)), 0, threading.Lock()
    counts = _counts(state, wanted, order, "cpu")
    stopped = threading.Event()
    own = threading.local()

    def run(task: _Task) -> None:
        nonlocal done
        if not hasattr(own, "scratch"):
            own.scratch = wp.empty(model.program.scratch_floats, dtype=float, device="cpu")
        for part in _rounds(task.samples, PATHS_PER_LAUNCH):
            if stopped.is_set():
                return
            of_part = np.clip(task.samples - part.skipped, 0, part.samples)
            started = time.perf_counter()
            wp.launch(
                model.program.render_pool,
                dim=1,
                inputs=[
                    *_inputs(model, state),
                    own.scratch,
                    task.image,
                    pixels,
                    task.first,
                    task.samples.size,
                    counts,
                    part,
                ],
                device="cpu",
            )
            with lock:
                state.seconds[task.image] += (time.perf_counter() - started) / threads
                done += int(of_part.sum(dtype=np.int64))
                if progress is not None:
                    progress(done, total)

    with ThreadPoolExecutor(threads) as pool:
        try:
            running = [
                [
                    pool.submit(run, _Task(image, first, added[image, order[image, first : first + task_pixels]]))
                    for first in range(0, pixels, task_pixels)
                ]
                for image in images
            ]
            for image, tasks in zip(images, running, strict=True):
                for task in tasks:
                    task.result()
                yield image
        finally:
            # Where something went wrong, or nobody wants the rest, what is under way ends soon.
            stopped.set()
            pool.shutdown(cancel_futures=True)


def _advance_cuda(
    model: Model, state: State, images: Sequence[int], wanted: np.ndarray, progress: Progress | None
) -> Iterator[int]:
    """All images at once, some samples a launch."""
    settings = model.settings
    pixels, chosen = settings.width * settings.height, np.array(images, dtype=np.int32)
    on_device = wp.array(chosen, dtype=int, device=settings.device)
    all_added = (wanted - state.samples).reshape(-1, pixels)
    added = all_added[chosen]
    total, done = int(added.sum(dtype=np.int64)), 0
    counts = _counts(state, wanted, _order(all_added), settings.device)
    started = time.perf_counter()
    for part in _rounds(added, PATHS_PER_CUDA_LAUNCH):
        wp.launch(
            model.program.render_threads,
            dim=(len(images), pixels),
            inputs=[*_inputs(model, state), on_device, pixels, counts, part],
            device=settings.device,
            block_dim=BLOCK_DIM,
        )
        wp.synchronize_device(settings.device)
        done += int(np.clip(added - part.skipped, 0, part.samples).sum(dtype=np.int64))
        if progress is not None:
            progress(done, total)
    state.seconds[chosen] += (time.perf_counter() - started) / len(images)
    yield from images


def _order(added: np.ndarray) -> np.ndarray:
    """(images, pixels) the pixels of each image, those that get most samples first."""
    return np.argsort(-added, axis=1, kind="stable").astype(np.int32)


def _counts(state: State, wanted: np.ndarray, order: np.ndarray, device: str) -> Any:
    counts = Counts()
    # Copies: the samples that an image has are changed while others are still rendered.
    counts.done = wp.array(state.samples.ravel(), dtype=int, device=device)
    counts.wanted = wp.array(wanted.ravel(), dtype=int, device=device)
    counts.order = wp.array(order.ravel(), dtype=int, device=device)
    return counts


def _rounds(added: np.ndarray, paths: int) -> Iterator[Any]:
    """The samples that pixels get, in launches of about so many paths."""
    skipped, most = 0, int(added.max())
    while skipped < most:
        part = Round()
        part.skipped, part.samples = skipped, max(1, paths // int(np.count_nonzero(added > skipped)))
        yield part
        skipped += part.samples


def _inputs(model: Model, state: State) -> list[Any]:
    return [model.uploaded.data, model.uploaded.limits, state.film]


def _check_finite(model: Model, image: int, invalid: np.ndarray) -> None:
    if not invalid.any():
        return
    row, column = np.unravel_index(int(np.argmax(invalid)), invalid.shape)
    variant = model.variants[image]
    media = "; ".join(
        f"{m.name}: H = {m.hurst:g}, S_w = {m.white_noise_scale:g}, sigma_m = {m.mean_extinction:g}, "
        f"phase function = {m.phase_function}, g = {m.asymmetry:g}"
        for m in variant.media
    )
    raise NumericalError(
        f"{int(invalid.sum())} samples are not finite, most of them in pixel ({column}, {row}) "
        f"with seed {variant.seed} ({media})"
    )


def _provenance(model: Model, image: int, samples: int) -> dict[str, Any]:
    settings, scene, variant = model.settings, model.scene, model.variants[image]
    return {
        "scene": scene.source,
        "meters_per_unit": scene.meters_per_unit,
        "camera": scene.camera.name,
        "exposure_scale": scene.camera.exposure_scale,
        **({"prims": list(scene.prims)} if Aov.PRIM_ID in settings.aovs else {}),
        "media": [
            {
                "name": m.name,
                "H": m.hurst,
                "phase_function": m.phase_function,
                "g": m.asymmetry,
                "back_asymmetry": m.back_asymmetry,
                "back_weight": m.back_weight,
                "draine_alpha": m.draine_alpha,
                "S_w": m.white_noise_scale,
                "sigma_m": m.mean_extinction,
                "extinction_color": list(m.extinction_color),
                "albedo": list(m.albedo),
                "L": m.outer_scale,
                "regime": m.line_law.regime,
                "b": m.line_law.b,
                "kappa": m.line_law.kappa,
                "transport": m.resolved_transport,
                "frozen_share": scene.frozen_share(index, m),
                "line_variance": m.line_variance,
                "priority": m.priority,
            }
            for index, m in enumerate(variant.media)
        ],
        "settings": {
            key: value
            for key, value in asdict(settings).items()
            if key in ("width", "height", "max_depth", "roulette_depth", "similarity_order", "sampler")
        }
        | {"seed": variant.seed, "spp": samples, "device": settings.device.split(":")[0]},
        "versions": {"fgf-warp": __version__, "warp-lang": wp.config.version, "python": platform.python_version()},
    }
