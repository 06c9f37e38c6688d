"""A render as a simulation: an immutable model, a state, and a step that adds samples to it.

What a user of the renderer calls is here or imported here: `render`, `render_batch`, and what these are made of.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, replace
from itertools import groupby
from pathlib import Path

import numpy as np
import warp as wp

from fgf_warp.errors import ConfigError
from fgf_warp.features import RenderFeatures, required_features
from fgf_warp.film import begin, develop, film_bytes
from fgf_warp.headers import load_on_cpu
from fgf_warp.integrator.program import Program, build_program
from fgf_warp.launching import BLOCK_DIM, Progress, advance_cpu, advance_cuda
from fgf_warp.locks import hold
from fgf_warp.model import Model, State, Variant
from fgf_warp.result import RenderResult
from fgf_warp.scene import Scene
from fgf_warp.settings import GIB, RENDERED_AOVS, RenderSettings
from fgf_warp.upload import load_builder, upload

__all__ = [
    "Model",
    "Progress",
    "State",
    "Variant",
    "advance",
    "batches",
    "begin",
    "build_model",
    "check_device",
    "check_memory",
    "develop",
    "image_bytes",
    "memory_in_force",
    "prepare",
    "render",
    "render_batch",
    "step",
]

DEVELOPING_BYTES = 128
"""Per pixel, while the image of a film is made: radiance and its variance, and float64 values on the way to planes."""
COUNTS_BYTES = 4 * 4
"""Per pixel: its samples so far, and while a step is at work, those before and after it, and the order of pixels."""
PLANE_BYTES = 12
"""Per pixel of each further plane, at most: three channels of float32."""
LOCK = "fgf-warp.lock"
"""In the folder of the kernel cache."""

_build_lock = threading.Lock()


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
    """Builds the kernel for this scene and these settings where there is none yet, and loads it on the device.

    Args:
        scene: what it renders.
        settings: how.

    Returns:
        The kernels.

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

    Returns:
        The model of all images.

    Raises:
        ConfigError: for a device that is not there, or images that need more memory than `settings.memory`.
        UnsupportedFeatureError: for a scene that this version cannot render.
    """
    images = tuple(variants) if variants is not None else (Variant(scene.media, settings.seed),)
    check_memory(settings, len(images))
    scene = scene.with_media(images[0].media)  # What is frozen decides which shells are bodies of their own.
    program = prepare(scene, settings)
    media, seeds = [image.media for image in images], [image.seed for image in images]
    uploaded = upload(scene, settings, media, seeds, program)
    return Model(scene, settings, images, program, uploaded)


def batches(scene: Scene, variants: Sequence[Variant], settings: RenderSettings, together: int = 1) -> Iterator[Model]:
    """Models of as many successive images as one kernel renders and `settings.memory` holds.

    Args:
        scene: whose media the variants replace.
        variants: one for each image.
        settings: that the images share, but for the seed.
        together: so many successive images, of one kind of kernel, are in one model.

    Yields:
        Models, in the order of the variants.

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
    """Memory that one image takes while it is rendered, beside the scene [byte]."""
    developing = DEVELOPING_BYTES + PLANE_BYTES * len(settings.aovs)
    return settings.width * settings.height * (film_bytes(settings) + COUNTS_BYTES + developing)


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


def step(model: Model, state: State, samples: int | np.ndarray, progress: Progress | None = None) -> None:
    """Adds samples to every image; how a render is cut into steps does not change its pixels.

    Args:
        model: what to render.
        state: so far, which is changed.
        samples: to add per pixel, >= 0; of pixels that get different numbers (images, height, width).
        progress: called with the camera paths done and in all.
    """
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
    advance_on = advance_cpu if model.settings.device == "cpu" else advance_cuda
    for image in advance_on(model, state, chosen, wanted, progress):
        state.samples[image] = wanted[image]
        yield image


def render(scene: Scene, settings: RenderSettings, progress: Progress | None = None) -> RenderResult:
    """Renders a scene.

    Args:
        scene: what to render.
        settings: how far.
        progress: called with the camera paths done and in all.

    Returns:
        The image, as float32 arrays.

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
