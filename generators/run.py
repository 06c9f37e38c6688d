"""Renders the samples of a plan into a folder: in any order, by any number of workers, with interruptions.

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
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fgf_warp.errors import ConfigError, CorruptFileError, NumericalError, OutputError
from fgf_warp.output.atomic import check_writable, sweep_partial, write_bytes
from fgf_warp.output.color import write_png
from fgf_warp.output.exr import write_exr
from generators.config import LoadedConfig
from generators.contact_sheet import write_contact_sheet
from generators.lock import exclusive
from generators.manifest import Record, exr_name, png_name, write_manifest
from generators.plan import Plan, Sample

CONTACT_SHEET = "contact_sheet.png"
INDEX = "index.parquet"
PLAN_RECORD = "run/plan.json"
LOCK = "run/lock"

Progress = Callable[[int, int], None]
"""Called with the number of finished samples, those of earlier runs included, and of all."""


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


class _StoppedError(Exception):
    """Ends a render that the user no longer waits for."""


def generate(
    plan: Plan, loaded: LoadedConfig, folder: Path, *, workers: int | None = None, progress: Progress | None = None
) -> Report:
    """Renders what the folder does not have yet, and writes labels and contact sheet of all it has.

    Args:
        plan: what to render.
        loaded: the config that the plan was made from, kept with the dataset.
        folder: of the dataset; created where missing.
        workers: samples in flight, >= 1; it changes no file. None: the number of cores, and 1 on CUDA.
        progress: see `Progress`.

    Raises:
        ConfigError: where the folder holds something else or another run is under way in it, or for a number of
            workers below 1.
        OutputError: where a file cannot be written. What is finished stays.
        CorruptFileError: where a record or an image in the folder cannot be read.
    """
    started = time.perf_counter()
    worker_count = _worker_count(plan, workers)
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
        if progress:
            progress(len(records) + len(failures), len(plan.samples))

    if progress:
        progress(reused, len(plan.samples))
    interrupted = _render_all(plan, folder, pending, workers, on_finished)
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
    on_finished: Callable[[Sample, Record | NumericalError], None],
) -> bool:
    """Renders the samples; returns whether the user stopped it."""
    from fgf_warp.renderer import prepare  # noqa: PLC0415 - starts Warp

    stop = threading.Event()
    threads = 1 if workers > 1 else None
    futures: dict[Future[Record], Sample] = {}
    with ThreadPoolExecutor(workers) as pool:
        try:
            for sample in pending:
                prepare(plan.scene_of(sample), plan.settings_of(sample, threads))
            for sample in pending:
                futures[pool.submit(_render_sample, plan, folder, sample, threads, stop)] = sample
            for future in as_completed(futures):
                try:
                    on_finished(futures[future], future.result())
                except NumericalError as error:
                    on_finished(futures[future], error)
        except KeyboardInterrupt:
            _stop(pool, stop)
            for future, sample in futures.items():
                # as_completed may not have come to samples that were finished meanwhile.
                if future.done() and not future.cancelled() and future.exception() is None:
                    on_finished(sample, future.result())
            return True
        except BaseException:
            _stop(pool, stop)
            raise
    return False


def _stop(pool: ThreadPoolExecutor, stop: threading.Event) -> None:
    stop.set()
    pool.shutdown(wait=True, cancel_futures=True)


def _render_sample(plan: Plan, folder: Path, sample: Sample, threads: int | None, stop: threading.Event) -> Record:
    """Renders and writes one sample, its record last."""
    from fgf_warp.renderer import render  # noqa: PLC0415

    def stop_if_asked(_done: int, _total: int) -> None:
        if stop.is_set():
            raise _StoppedError

    result = render(plan.scene_of(sample), plan.settings_of(sample, threads), stop_if_asked)
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
