"""Makes a dataset of a plan, or completes one."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from fgf_warp import __version__
from fgf_warp.errors import ConfigError, FgfError, OutputError
from fgf_warp.settings import Aov
from generators.dataset import layout
from generators.dataset.plan_table import is_open
from generators.dataset.reader import Dataset
from generators.dataset.record import Failure, encode
from generators.dataset.store import Store
from generators.interrupts import held_back
from generators.publishing.columns import COMPLETE, STATUS
from generators.publishing.publish import publish
from generators.running.dispatch import run_chunks
from generators.running.events import EventLog
from generators.running.in_process import InProcess
from generators.running.local_pool import LocalPool
from generators.running.messages import Chunk, Executor, Finished
from generators.running.on_ray import OnRay
from generators.running.on_slurm import OnSlurm
from generators.running.opening import opened, sole
from generators.running.render import Way, cores, render_chunk
from generators.running.shard import Shard, cut_chunks
from generators.running.stages import Tell

if TYPE_CHECKING:
    from generators.planning.plan import Plan

EXECUTORS = ("local", "ray", "slurm")


@dataclass(frozen=True)
class Progress:
    """How far a run is.

    Args:
        done: samples that are finished, those of earlier runs included, and in one process the begun ones by their
            share.
        total: of the shard.
        failed: of the finished.
    """

    done: float
    total: int
    failed: int = 0


OnProgress = Callable[[Progress], None]


@dataclass(frozen=True)
class Report:
    """How a run went.

    Args:
        location: of the dataset.
        total: samples of the shard.
        finished: of these, complete now.
        reused: of these, from earlier runs.
        failures: index and reason of each sample that could not be rendered.
        truncated_paths: cut at the bound on their length, of the finished samples.
        truncated_samples: finished samples that have such paths.
        interrupted: whether the user stopped the run.
        seconds: wall time.
    """

    location: str
    total: int
    finished: int
    reused: int
    failures: tuple[tuple[int, str], ...]
    truncated_paths: int
    truncated_samples: int
    interrupted: bool
    seconds: float

    @property
    def contact_sheet(self) -> str:
        """Where it is."""
        return f"{self.location.rstrip('/')}/{layout.CONTACT_SHEET}"

    @property
    def is_complete(self) -> bool:
        """Whether every sample of the shard is there."""
        return self.finished == self.total


@dataclass(frozen=True)
class Workers:
    """Who renders.

    Args:
        executor: one of `EXECUTORS`.
        count: processes, >= 1; None takes this process alone with ``local``, and all that is free with ``ray``.
        cores: of each; None takes the cores of the machine in equal parts with ``local``, and one with the others.
        slurm: parameters of the jobs, such as ``partition``, by the names of sbatch's options.

    Raises:
        ConfigError: for others.
    """

    executor: str = "local"
    count: int | None = None
    cores: int | None = None
    slurm: Mapping[str, str | int] | None = None

    def __post_init__(self) -> None:
        if self.executor not in EXECUTORS:
            raise ConfigError(f"executor {self.executor}: accepted: {', '.join(EXECUTORS)}")
        for name, value in (("workers", self.count), ("cores", self.cores)):
            if value is not None and value < 1:
                raise ConfigError(f"{name} = {value}; accepted: an integer >= 1")


def generate(
    plan: Plan,
    config: bytes,
    location: str | os.PathLike[str],
    *,
    shard: Shard | None = None,
    only: Collection[int] | None = None,
    workers: Workers | None = None,
    on_progress: OnProgress | None = None,
    tell: Tell | None = None,
) -> Report:
    """Renders the samples that a dataset does not have yet, and publishes all that it has.

    Args:
        plan: what to render.
        config: that the plan was made from, as YAML; kept with the dataset.
        location: of the dataset, a folder or a URL; created where missing.
        shard: of the plan, to render no more than that.
        only: indices of samples, to render no others.
        workers: who renders; by default this process with all cores. They change no file but the timing.
        on_progress: called with each finished sample, and in one process with parts of one, from any thread.
        tell: called with a line for the user, before much is copied.

    Raises:
        ConfigError: where there is something else at this location, where another run is under way on these samples,
            where the settings' memory does not hold one image, or where a denoiser is asked for and not installed.
        OutputError: where a file cannot be written. What is finished stays.
        GoneError: where the dataset is removed meanwhile; nothing more is written then.
        CorruptFileError: where a record of the dataset cannot be read, or its own stages, of which the plan was made,
            are damaged.
    """
    from fgf_warp.output.denoise import check_denoiser  # noqa: PLC0415
    from fgf_warp.renderer import check_memory  # noqa: PLC0415 - starts Warp

    check_memory(plan.settings, images=2 if is_open(plan.meta.quality) else 1)
    if Aov.DENOISED in plan.settings.aovs:
        check_denoiser()
    started = time.perf_counter()
    store, shard, workers = Store(os.fspath(location)), shard or Shard(), workers or Workers()
    with opened(plan, config, store, shard, tell) as indices, EventLog(store, layout.events(shard.suffix)) as log:
        try:
            # What is rendered is what the dataset holds, so it can be rendered again without anything else.
            plan = plan.of_dataset(str(store.folder or store.location))
            run = _Run(plan, store, _chosen(indices, only), log, on_progress)
            interrupted = run.render(workers, shard)
            with held_back():
                with sole(store):
                    publish(Dataset(store.location))
                report = run.report(interrupted, time.perf_counter() - started)
                log.write("end", interrupted=interrupted, complete=report.finished, failed=len(report.failures))
        except FgfError as error:
            with suppress(OutputError):
                log.write("end", error=str(error))
            if isinstance(error, OutputError):
                store.check_there()  # which is then what there is to know
            raise
        return report


def _chosen(indices: Sequence[int], only: Collection[int] | None) -> list[int]:
    return [index for index in indices if only is None or index in only]


def render_again(plan: Plan, store: Store, indices: Sequence[int], spp: Mapping[int, int]) -> Iterator[Finished]:
    """Renders samples anew, each in the place of what is there of it.

    Args:
        plan: of the dataset.
        store: of the dataset.
        indices: of the samples.
        spp: samples per pixel that a sample had, by index; the others are rendered to the plan's quality.

    Yields:
        Each sample, as soon as it is in the dataset or could not be rendered.

    Raises:
        ConfigError: where a run is under way in the dataset, or where it is not of this plan.
        OutputError: where a file cannot be written.
    """
    with opened(plan, None, store, Shard()) as order:
        chosen = set(indices)
        chunk = Chunk(tuple(index for index in order if index in chosen))
        for finished in render_chunk(plan, store, chunk, Way(repairs=True, spp=spp)):
            if finished.error is None:
                store.remove(layout.failure(finished.index))
            yield finished


class _Run:
    """What is rendered, told and noted by one run in an opened dataset."""

    def __init__(
        self, plan: Plan, store: Store, indices: Sequence[int], log: EventLog, on_progress: OnProgress | None
    ) -> None:
        self._plan, self._store, self._indices, self._log = plan, store, indices, log
        self._on_progress = on_progress
        dataset = Dataset(store.location)
        there = set(dataset.complete())
        self._pending = [index for index in indices if index not in there]
        self._noted = set(dataset.failures())
        self._failures: dict[int, str] = {}
        self._finished, self._share = 0, 0.0
        self._started = time.perf_counter()

    def render(self, workers: Workers, shard: Shard) -> bool:
        """Has what is missing rendered; returns whether the user stopped it."""
        self._log.write(
            "start",
            plan=self._plan.meta.digest,
            version=__version__,
            shard=str(shard),
            executor=workers.executor,
            samples=len(self._indices),
            reused=len(self._indices) - len(self._pending),
        )
        try:
            self._tell()
            if self._pending:
                self._render(self._executor(workers))
        except KeyboardInterrupt:
            return True
        return False

    def _render(self, executor: Executor) -> None:
        self._started = time.perf_counter()
        try:
            chunks = cut_chunks(self._pending, executor.slots * executor.chunks_per_slot)
            run_chunks(chunks, executor, self._log, self._is_there, self._finish)
        finally:
            with held_back():
                executor.close()
                if self._store.exists(layout.PLAN):
                    # Alone, since another shard's run may be publishing by way of files that look half-written.
                    with sole(self._store):
                        self._store.sweep([layout.sample_name(index) for index in self._indices])

    def report(self, interrupted: bool, seconds: float) -> Report:
        """How it went, by the labels."""
        labels = pq.read_table(pa.BufferReader(self._store.read(layout.INDEX)), columns=[STATUS, "truncated"])
        mine = labels.take(self._indices)
        cut = mine.filter(pc.equal(mine[STATUS], COMPLETE))["truncated"].to_pylist()
        return Report(
            location=self._store.location,
            total=len(self._indices),
            finished=len(cut),
            reused=len(self._indices) - len(self._pending),
            failures=tuple(sorted(self._failures.items())),
            truncated_paths=sum(cut),
            truncated_samples=sum(count > 0 for count in cut),
            interrupted=interrupted,
            seconds=seconds,
        )

    def _executor(self, workers: Workers) -> Executor:
        plan, store, way, count = self._plan, self._store, Way(workers.cores), workers.count
        if workers.executor == "local" and count in (None, 1):
            return InProcess(plan, store, way, self._on_share)
        if not store.is_shared:
            raise ConfigError(f"{store.location}: is seen by one process alone; accepted: no other workers")
        if workers.executor == "ray":
            return OnRay(plan, store, count, way)
        if workers.executor == "slurm":
            return OnSlurm(plan, store, count or 1, way, workers.slurm or {})
        assert count is not None
        return LocalPool(plan, store, count, Way(workers.cores or max(1, cores() // count)))

    def _is_there(self, index: int) -> bool:
        sample = self._plan.samples[index]
        return self._store.exists(f"{layout.sample_folder(sample.split, index)}/{layout.RECORD}")

    def _finish(self, finished: Finished, attempt: int) -> None:
        """Notes what came of a sample."""
        index, name = finished.index, layout.failure(finished.index)
        self._store.check_there()
        if finished.error is not None:
            self._failures[index] = finished.error
            self._store.write(name, encode(Failure(index, finished.error, attempt)))
        elif index in self._noted:
            self._store.remove(name)
        self._finished += 1
        rate = self._finished / (time.perf_counter() - self._started)
        self._log.write(
            "sample",
            index=index,
            status="complete" if finished.error is None else "failed",
            seconds=round(finished.seconds, 6),
            **({} if finished.error is None else {"reason": finished.error}),
            done=len(self._indices) - len(self._pending) + self._finished,
            total=len(self._indices),
            failed=len(self._failures),
            rate=round(rate, 6),
            left=round((len(self._pending) - self._finished) / rate, 3),
        )
        self._tell()

    def _on_share(self, share: float) -> None:
        self._share = share
        self._tell()

    def _tell(self) -> None:
        if self._on_progress:
            reused = len(self._indices) - len(self._pending)
            done = reused + max(self._share, self._finished)
            self._on_progress(Progress(done, len(self._indices), len(self._failures)))
