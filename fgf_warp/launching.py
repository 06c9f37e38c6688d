"""Launches of the kernels: how the samples that pixels get are cut into tasks for threads, or into rounds for CUDA."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from fgf_warp.integrator.work import Counts, Round
from fgf_warp.model import Model, State

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
BLOCK_DIM = 128
"""Threads of a CUDA block."""


@dataclass(frozen=True)
class _Task:
    """Some of an image's pixels, which follow each other in `_order`.

    Args:
        image: the image's index.
        first: place of the first of them in `_order`.
        samples: (pixels,) int32, that each of them gets.
    """

    image: int
    first: int
    samples: np.ndarray


def advance_cpu(
    model: Model, state: State, images: Sequence[int], wanted: np.ndarray, progress: Progress | None
) -> Iterator[int]:
    """Adds samples on the CPU: threads pull tasks, and a launch runs on the thread that asks for it, without the GIL.

    Args:
        model: what to render.
        state: so far; its film and its seconds are changed.
        images: indices of those that get samples.
        wanted: (images, height, width) int32, the samples that pixels have in the end.
        progress: called with the camera paths done and in all.

    Yields:
        The index of each image, in order, as soon as all its samples are there.
    """
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


def advance_cuda(
    model: Model, state: State, images: Sequence[int], wanted: np.ndarray, progress: Progress | None
) -> Iterator[int]:
    """Adds samples on CUDA: all images at once, some samples a launch; arguments and yields as in `advance_cpu`."""
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
    """(images, pixels) int32, the pixels of each image, those that get most samples first."""
    return np.argsort(-added, axis=1, kind="stable").astype(np.int32)


def _counts(state: State, wanted: np.ndarray, order: np.ndarray, device: str) -> Any:
    """The device's `Counts`, of the samples before and after a step."""
    counts = Counts()
    # Copies: the samples that an image has are changed while others are still rendered.
    counts.done = wp.array(state.samples.ravel(), dtype=int, device=device)
    counts.wanted = wp.array(wanted.ravel(), dtype=int, device=device)
    counts.order = wp.array(order.ravel(), dtype=int, device=device)
    return counts


def _rounds(added: np.ndarray, paths: int) -> Iterator[Any]:
    """The samples that pixels get, (..., pixels), in launches of about `paths` paths: a `Round` for each."""
    skipped, most = 0, int(added.max())
    while skipped < most:
        part = Round()
        part.skipped, part.samples = skipped, max(1, paths // int(np.count_nonzero(added > skipped)))
        yield part
        skipped += part.samples


def _inputs(model: Model, state: State) -> list[Any]:
    """The first arguments of both drivers."""
    return [model.uploaded.data, model.uploaded.limits, state.film]
