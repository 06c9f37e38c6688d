"""Renders a chunk of samples and commits each: the one code path of all executors."""

from __future__ import annotations

import math
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from fgf_warp.errors import NumericalError
from fgf_warp.output.color import write_png
from fgf_warp.output.exr import write_exr
from fgf_warp.result import RenderResult
from fgf_warp.settings import GIB, RenderSettings
from generators.dataset import layout
from generators.dataset.plan_table import is_open
from generators.dataset.record import Record, Timing, encode, file_entry
from generators.dataset.store import Store
from generators.publishing.statistics import image_statistics
from generators.publishing.targets import compute_targets
from generators.running.messages import Chunk, Finished
from generators.tradeoff.front import read_front
from generators.wish import Wish

if TYPE_CHECKING:
    from fgf_warp.convergence import Goal
    from fgf_warp.renderer import Model, Progress
    from generators.planning.plan import Plan, Sample

Share = Callable[[float], None]
"""Called with the number of samples of the chunk whose render is done, the begun ones by their share."""


@dataclass(frozen=True)
class Way:
    """How a worker renders; it changes no file but the timing.

    Args:
        threads: that render, and as many that write; None takes every core.
        repairs: whether a sample takes the place of one that is there.
        spp: samples per pixel, by index, at which samples end that are rendered to an error or in a time.
    """

    threads: int | None = None
    repairs: bool = False
    spp: Mapping[int, int] | None = None


def render_chunk(
    plan: Plan, store: Store, chunk: Chunk, way: Way | None = None, share: Share | None = None
) -> Iterator[Finished]:
    """Renders the samples of a chunk in batches, while others are written.

    Args:
        plan: of the dataset.
        store: of the dataset.
        chunk: what to render.
        way: how; by default with all cores.
        share: see `Share`.

    Yields:
        Each sample, as soon as it is in the dataset or could not be rendered.

    Raises:
        OutputError: where a file cannot be written.
        ConfigError: where the settings' memory does not hold one image.
    """
    way = way or Way()
    samples = [plan.samples[index] for index in chunk.indices]
    done = 0.0

    def count(part: float) -> None:
        if share:
            share(done + part)

    with closing(_Writer(plan, store, way, chunk.attempt)) as writer:
        for settings, goal, group in _groups(plan, samples, way):
            for sample, result in _render_group(plan, group, settings, goal, count):
                if isinstance(result, NumericalError):
                    yield Finished(sample.index, error=str(result))
                else:
                    writer.add(sample, result)
                    yield from writer.collect(until=writer.most_waiting)
            done += len(group)
        yield from writer.collect(until=0)


def cores() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _goal(plan: Plan, way: Way, sample: Sample) -> Goal | None:
    """None where the number of samples per pixel is planned."""
    quality = plan.meta.quality
    if not is_open(quality):
        return None
    from fgf_warp.convergence import Goal  # noqa: PLC0415 - starts Warp

    over = quality.get("error_over", "mean")
    if way.spp is not None and sample.index in way.spp:
        # Where each pixel's samples go follows from their number in all, and what they are given for.
        return Goal(over=over, max_spp=way.spp[sample.index])
    return Goal(error=quality.get("target_error"), over=over, time=quality.get("time"), max_spp=quality["spp"])


def _choose(plan: Plan, way: Way, sample: Sample) -> tuple[RenderSettings, Goal | None]:
    """How a sample is rendered, which does not depend on others."""
    settings, goal = replace(plan.settings, threads=way.threads or cores()), _goal(plan, way, sample)
    if goal is None or "chosen_from" not in plan.meta.quality:
        return settings, goal
    from generators.auto import choose  # noqa: PLC0415 - starts Warp

    scene, wish = plan.scene_of(sample).with_media(plan.media_of(sample)), Wish("", plan.meta.quality["target_error"])
    try:
        choice = choose(scene, settings, wish, read_front())
    except NumericalError:
        # The render will tell, with its own settings and seed, whether it is so too.
        return settings, goal
    return choice.settings, goal if goal.error is None else replace(goal, error=choice.goal.error)


def _groups(
    plan: Plan, samples: Sequence[Sample], way: Way
) -> Iterator[tuple[RenderSettings, Goal | None, list[Sample]]]:
    """Successive samples that may share a batch, with how they are rendered."""
    ways = ((sample, *_choose(plan, way, sample)) for sample in samples)
    for (_, settings, goal), group in groupby(ways, lambda chosen: (plan.group_key(chosen[0]), *chosen[1:])):
        yield settings, goal, [sample for sample, *_ in group]


def _render_group(
    plan: Plan, group: Sequence[Sample], asked: RenderSettings, goal: Goal | None, share: Share
) -> Iterator[tuple[Sample, RenderResult | NumericalError]]:
    from fgf_warp.convergence import FIRST_SPP, converge, halved_batches  # noqa: PLC0415 - starts Warp
    from fgf_warp.finishing import as_rendered, finish  # noqa: PLC0415
    from fgf_warp.renderer import Variant, batches  # noqa: PLC0415

    scene, settings = as_rendered(plan.scene_of(group[0]), asked)
    variants = [Variant(plan.media_of(sample), sample.seed) for sample in group]
    begun = 0
    for model in batches(scene, variants, settings) if goal is None else halved_batches(scene, variants, settings):
        images = len(model.variants) if goal is None else len(model.variants) // 2
        # How much an error needs is known after the first round.
        first_round = 0 if goal is None else FIRST_SPP * images * settings.width * settings.height

        def show(done: int, total: int, begun: int = begun, images: int = images, first: int = first_round) -> None:
            if total > first:
                share(begun + images * done / total)

        # In a function, so that the films of a batch are gone before the next are made.
        rendered = _render_batch(model, show) if goal is None else converge(model, goal, show)
        for image, result in rendered:
            yield group[begun + image], result if isinstance(result, NumericalError) else finish(result, asked)
        begun += images


def _render_batch(model: Model, progress: Progress) -> Iterator[tuple[int, RenderResult | NumericalError]]:
    from fgf_warp.renderer import advance, begin, develop  # noqa: PLC0415

    state = begin(model)
    for image in advance(model, state, model.settings.spp, progress, range(len(model.variants))):
        try:
            yield image, develop(model, state, image)
        except NumericalError as error:
            yield image, error


class _Writer:
    """Writes samples in threads of its own.

    Args:
        plan: of the samples.
        store: to write to.
        way: how they are rendered.
        attempt: of the chunk.
    """

    def __init__(self, plan: Plan, store: Store, way: Way, attempt: int) -> None:
        from fgf_warp.renderer import image_bytes  # noqa: PLC0415 - starts Warp

        self._plan, self._store, self._way, self._attempt = plan, store, way, attempt
        threads = way.threads or cores()
        self._pool = ThreadPoolExecutor(threads)
        self._writing: set[Future[Finished]] = set()
        # The memory of a batch is enough to develop all its images, so of that many one may wait for its files.
        self.most_waiting = min(2 * threads, int(plan.settings.memory * GIB // image_bytes(plan.settings)) - 1)

    def add(self, sample: Sample, result: RenderResult) -> None:
        """Hands a sample over."""
        self._writing.add(self._pool.submit(self._write, sample, result))

    def collect(self, until: int) -> Iterator[Finished]:
        """Yields what is written, and waits while more than `until` samples are not.

        Raises:
            OutputError: where a file could not be written.
        """
        while True:
            done = {future for future in self._writing if future.done()}
            self._writing -= done
            for future in done:
                yield future.result()
            if len(self._writing) <= until:
                return
            wait(self._writing, return_when=FIRST_COMPLETED)

    def close(self) -> None:
        """Waits for all that was handed over."""
        self._pool.shutdown()

    def _write(self, sample: Sample, result: RenderResult) -> Finished:
        folder = layout.sample_folder(sample.split, sample.index)
        self._store.check_there()
        with self._store.workspace(folder) as made_in:
            self._commit(sample, result, folder, made_in)
        return Finished(sample.index, result.seconds)

    def _commit(self, sample: Sample, result: RenderResult, folder: str, made_in: Path) -> None:
        started = time.perf_counter()
        files, over = encode_images(self._plan, sample, result, made_in), self._plan.meta.quality.get("error_over")
        record = Record(
            index=sample.index,
            plan=self._plan.meta.digest,
            spp=result.samples,
            standard_error=error if math.isfinite(error := result.relative_standard_error) else None,
            reached_error=None if over is None else result.relative_error(over),
            chosen_settings=_describe_choice(self._plan, result),
            truncated=result.truncated_count,
            nonfinite=0,
            statistics=image_statistics(result),
            targets=compute_targets(sample.medium, self._plan.meta.targets) if sample.medium else {},
            files={name: file_entry(content) for name, content in files.items()},
        )
        seconds = time.perf_counter() - started
        timing = Timing(result.seconds, seconds, f"{platform.node()}:{os.getpid()}", self._attempt)
        files |= {layout.RECORD: encode(record), layout.TIMING: encode(timing)}
        self._store.commit(folder, files, replaces=self._way.repairs, made_in=made_in)


def _describe_choice(plan: Plan, result: RenderResult) -> str | None:
    if "chosen_from" not in plan.meta.quality:
        return None
    chosen = {name: getattr(result.settings, name) for name in ("max_depth", "roulette_depth", "similarity_order")}
    differing = [f"{name} {value}" for name, value in chosen.items() if value != getattr(plan.settings, name)]
    return ", ".join(differing) or "balanced"


def encode_images(plan: Plan, sample: Sample, result: RenderResult, folder: Path) -> dict[str, bytes]:
    """Writes the image files of a sample.

    Args:
        plan: of the dataset.
        sample: that was rendered.
        result: of its render.
        folder: to write them into.

    Returns:
        Their contents by name.
    """
    dataset = {
        "name": plan.meta.name,
        "plan": plan.meta.digest,
        "index": sample.index,
        "swept": dict(sample.parameters),
    }
    write_exr(folder / layout.RADIANCE, replace(result, provenance={**result.provenance, "dataset": dataset}))
    if plan.meta.png:
        write_png(folder / layout.IMAGE, result, plan.meta.exposure)
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
