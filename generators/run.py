"""Renders the samples of a plan into a folder: in batches, by any number of workers, with interruptions.

A dataset's folder holds::

    index.parquet       labels, one row per finished sample
    images/000000.exr   and .png where asked for
    contact_sheet.png
    config.yaml         the config in force
    run/lock            held by the run that is under way
    run/plan.json       whose digest says which plan the folder belongs to
    run/000000.json     written last of a sample's files: where it is there, the sample is whole

Every file is written under a hidden name and renamed, so none is ever seen half-written.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fgf_warp.errors import ConfigError, CorruptFileError, NumericalError, OutputError
from fgf_warp.output.atomic import check_writable, sweep_partial, write_bytes
from fgf_warp.output.color import write_png
from fgf_warp.output.exr import write_exr
from fgf_warp.result import RenderResult
from generators.config import LoadedConfig
from generators.contact_sheet import write_contact_sheet
from generators.lock import exclusive
from generators.manifest import Record, exr_name, png_name, write_manifest
from generators.plan import Plan, Sample

if TYPE_CHECKING:
    from fgf_warp.renderer import Model

CONTACT_SHEET = "contact_sheet.png"
INDEX = "index.parquet"
PLAN_RECORD = "run/plan.json"
LOCK = "run/lock"

Progress = Callable[[float, int], None]
"""Called with the number of samples rendered, those of earlier runs included and the begun ones by their share, and of
all; from any thread, though never from two at once."""
OnFinished = Callable[[Sample, Record | NumericalError], None]
"""Called with each sample that is written, or that could not be rendered."""


@dataclass(frozen=True)
class Report:
    """How a run went.

    Args:
        folder: of the dataset.
        total: samples of the plan.
        finished: samples that are there now.
        reused: of these, from earlier runs.
        failures: index and reason of each sample that could not be rendered.
        truncated_paths: cut at the bound on their length, of the finished samples.
        truncated_samples: finished samples that have such paths.
        interrupted: whether the user stopped the run.
        seconds: wall time.
    """

    folder: Path
    total: int
    finished: int
    reused: int
    failures: tuple[tuple[int, str], ...]
    truncated_paths: int
    truncated_samples: int
    interrupted: bool
    seconds: float

    @property
    def is_complete(self) -> bool:
        """True where every sample is there."""
        return self.finished == self.total


def generate(
    plan: Plan, loaded: LoadedConfig, folder: Path, *, workers: int | None = None, progress: Progress | None = None
) -> Report:
    """Renders what the folder does not have yet, and writes labels and contact sheet of all it has.

    Args:
        plan: what to render.
        loaded: the config that the plan was made from, kept with the dataset.
        folder: of the dataset; created where missing.
        workers: threads that render, and as many that write, >= 1; they change no file. None: the number of cores,
            and 1 on CUDA.
        progress: see `Progress`.

    Raises:
        ConfigError: where the folder holds something else or another run is under way in it, for a number of workers
            below 1, or where the settings' memory does not hold one image.
        OutputError: where a file cannot be written. What is finished stays.
        CorruptFileError: where a record or an image in the folder cannot be read.
    """
    started = time.perf_counter()
    worker_count = _worker_count(plan, workers)
    from fgf_warp.renderer import check_memory  # noqa: PLC0415 - starts Warp

    check_memory(plan.settings)
    _make_folder(plan, folder)
    with exclusive(folder / LOCK):
        return _generate(plan, loaded, folder, worker_count, progress, started)


def _generate(
    plan: Plan, loaded: LoadedConfig, folder: Path, workers: int, progress: Progress | None, started: float
) -> Report:
    _open_folder(plan, loaded, folder)
    records = {sample.index: record for sample in plan.samples if (record := _read_record(plan, folder, sample))}
    reused = len(records)
    pending = [sample for sample in plan.samples if sample.index not in records]
    failures: list[tuple[int, str]] = []

    def on_finished(sample: Sample, outcome: Record | NumericalError) -> None:
        if isinstance(outcome, Record):
            records[sample.index] = outcome
        else:
            failures.append((sample.index, str(outcome)))

    def on_rendered(count: float) -> None:
        if progress:
            progress(reused + count, len(plan.samples))

    on_rendered(0)
    interrupted = _render_all(plan, folder, pending, workers, on_finished, on_rendered)
    write_manifest(folder / INDEX, plan, records.values())
    write_contact_sheet(folder / CONTACT_SHEET, plan, folder)
    return Report(
        folder=folder,
        total=len(plan.samples),
        finished=len(records),
        reused=reused,
        failures=tuple(sorted(failures)),
        truncated_paths=sum(record.truncated for record in records.values()),
        truncated_samples=sum(record.truncated > 0 for record in records.values()),
        interrupted=interrupted,
        seconds=time.perf_counter() - started,
    )


def _worker_count(plan: Plan, workers: int | None) -> int:
    if workers is None:
        return 1 if plan.settings.device.startswith("cuda") else os.cpu_count() or 1
    if workers < 1:
        raise ConfigError(f"workers = {workers}; accepted: an integer >= 1")
    return workers


def _make_folder(plan: Plan, folder: Path) -> None:
    """Makes the folder, and leaves one that is not this plan's as it is."""
    try:
        # A folder that has a lock is looked at under the lock.
        if folder.exists() and not (folder / LOCK).exists():
            _refuse_other_content(plan, folder)
        for name in ("run", "images"):
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made the dataset's folder: {error.strerror}") from error


def _open_folder(plan: Plan, loaded: LoadedConfig, folder: Path) -> None:
    """Makes the folder this plan's; another run may have come first, before the lock."""
    _refuse_other_content(plan, folder)
    for inside in (folder, folder / "images", folder / "run"):
        sweep_partial(inside)
        check_writable(inside / "probe")
    content = {"plan": plan.digest, "name": plan.name, "samples": len(plan.samples)}
    write_bytes(folder / PLAN_RECORD, json.dumps(content, indent=1).encode())
    loaded.write(folder)


def _refuse_other_content(plan: Plan, folder: Path) -> None:
    record = folder / PLAN_RECORD
    if not record.exists():
        if any(not entry.is_dir() and entry != folder / LOCK for entry in folder.rglob("*")):
            raise ConfigError(f"{folder}: is not empty and holds no dataset; choose another folder with --out")
        return
    if _read_json(record).get("plan") != plan.digest:
        raise ConfigError(
            f"{folder}: holds a dataset of another plan (config, scene or version differ); "
            "choose another folder with --out, or delete this one"
        )


def _render_all(
    plan: Plan,
    folder: Path,
    pending: Sequence[Sample],
    workers: int,
    on_finished: OnFinished,
    on_rendered: Callable[[float], None],
) -> bool:
    """Renders the samples in batches and writes each as soon as it is there; returns whether the user stopped it."""
    from fgf_warp.renderer import Variant, batches  # noqa: PLC0415 - starts Warp

    # Laws of one kind share a kernel, and so a batch.
    ordered = sorted(pending, key=lambda sample: sample.medium.line_law.kind)
    variants = [Variant(plan.media_of(sample), sample.seed) for sample in ordered]
    begun = 0
    with closing(_Writer(plan, folder, workers, on_finished)) as writer:
        try:
            for model in batches(plan.scene, variants, replace(plan.settings, threads=workers)):
                _render_batch(model, ordered, begun, writer, on_rendered)
                begun += len(model.variants)
            writer.collect(until=0)
        except KeyboardInterrupt:
            writer.collect(until=0)
            return True
    return False


def _render_batch(
    model: Model, ordered: Sequence[Sample], begun: int, writer: _Writer, on_rendered: Callable[[float], None]
) -> None:
    """Renders the samples from `begun` on, one for each image of the model.

    The films are gone when it returns: those of two batches are never there at once.
    """
    from fgf_warp.renderer import advance, begin, develop  # noqa: PLC0415

    images = len(model.variants)
    # The memory of a batch is enough to develop all its images, so of that many one may wait for its files.
    waiting_most = min(2 * writer.threads, images - 1)
    state = begin(model)
    for image in advance(
        model, state, model.settings.spp, lambda done, total: on_rendered(begun + images * done / total)
    ):
        sample = ordered[begun + image]
        try:
            result = develop(model, state, image)
        except NumericalError as error:
            writer.on_finished(sample, error)
            continue
        writer.add(sample, result)
        writer.collect(until=waiting_most)


class _Writer:
    """Writes samples in threads of its own, and reports them in the thread that renders.

    Args:
        plan: of the samples.
        folder: of the dataset.
        threads: that write.
        on_finished: called by `collect`.
    """

    def __init__(self, plan: Plan, folder: Path, threads: int, on_finished: OnFinished) -> None:
        self.threads = threads
        self.on_finished = on_finished
        self._write = partial(_write_sample, plan, folder)
        self._pool = ThreadPoolExecutor(threads)
        self._writing: dict[Future[Record], Sample] = {}

    def add(self, sample: Sample, result: RenderResult) -> None:
        """Hands a sample over."""
        self._writing[self._pool.submit(self._write, sample, result)] = sample

    def collect(self, until: int) -> None:
        """Reports what is written, and waits while more than `until` samples are not.

        Raises:
            OutputError: where a file could not be written.
        """
        while True:
            for future in [future for future in self._writing if future.done()]:
                self.on_finished(self._writing.pop(future), future.result())
            if len(self._writing) <= until:
                return
            wait(self._writing, return_when=FIRST_COMPLETED)

    def close(self) -> None:
        """Waits for all that was handed over."""
        self._pool.shutdown()


def _write_sample(plan: Plan, folder: Path, sample: Sample, result: RenderResult) -> Record:
    """Writes one sample, its record last."""
    dataset = {"name": plan.name, "plan": plan.digest, "index": sample.index, "swept": dict(sample.parameters)}
    write_exr(folder / exr_name(sample), replace(result, provenance={**result.provenance, "dataset": dataset}))
    if plan.png:
        write_png(folder / png_name(sample), result, plan.exposure)
    record = Record(sample, result.seconds, result.relative_standard_error, result.truncated_count)
    _write_record(plan, folder, record)
    return record


def _record_path(folder: Path, sample: Sample) -> Path:
    return folder / "run" / f"{sample.name}.json"


def _write_record(plan: Plan, folder: Path, record: Record) -> None:
    content = {
        "plan": plan.digest,
        "index": record.sample.index,
        "render_seconds": record.render_seconds,
        "standard_error": record.standard_error,
        "truncated": record.truncated,
    }
    write_bytes(_record_path(folder, record.sample), json.dumps(content).encode())


def _read_record(plan: Plan, folder: Path, sample: Sample) -> Record | None:
    """What an earlier run wrote of this sample; None where it is to be rendered."""
    path = _record_path(folder, sample)
    images = [exr_name(sample), *([png_name(sample)] if plan.png else [])]
    if not path.exists() or not all((folder / image).exists() for image in images):
        return None
    content = _read_json(path)
    if content.get("plan") != plan.digest:
        return None
    try:
        return Record(
            sample, float(content["render_seconds"]), float(content["standard_error"]), int(content["truncated"])
        )
    except (KeyError, TypeError, ValueError) as error:
        raise _corrupt(path) from error


def _read_json(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise _corrupt(path) from error
    if not isinstance(content, dict):
        raise _corrupt(path)
    return content


def _corrupt(path: Path) -> CorruptFileError:
    return CorruptFileError(f"{path}: is damaged; delete it, and its sample is rendered again")
