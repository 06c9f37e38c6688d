"""How far a dataset is, and what its runs are doing."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any

from generators.checking.samples import read
from generators.dataset import layout
from generators.dataset.plan_table import SPLIT
from generators.dataset.reader import Dataset
from generators.publishing.columns import COMPLETE, FAILED, MISSING
from generators.running.opening import shards_under_way

EVENTS = (f"{layout.RUN}/events", ".jsonl")
"""Beginning and end of the names of the files of events: one for each shard."""
UNDER_WAY = "under way"
STATES = (COMPLETE, FAILED, MISSING)
NUMBER = (int, float)
DETAILS: Mapping[str, Mapping[str, Any]] = {
    "start": {"shard": str, "executor": str, "reused": int, "samples": int},
    "sample": {"left": NUMBER, "done": int, "rate": NUMBER},
}
"""What an event holds that is read here."""
MOST = 1e15
"""No number of samples, and no time, is beyond it."""


@dataclass(frozen=True)
class Run:
    """The last run of a shard.

    Args:
        shard: ``i/n``; ``0/1`` is the whole plan.
        executor: that renders.
        started: time in ISO 8601.
        last: of its latest event.
        silent_seconds: since then.
        state: ``under way``; ``finished``, ``interrupted`` or ``error: ...``, as it said at its end; ``killed`` where
            it said nothing; in an object store, which has no locks, ``under way or killed``.
        done: samples that it has finished, those of earlier runs included.
        total: samples of the shard.
        rate: samples finished per second; None before the first.
        left_seconds: that it will take from now on; None where that is not known, or it is not under way.
    """

    shard: str
    executor: str
    started: str
    last: str
    silent_seconds: float
    state: str
    done: int
    total: int
    rate: float | None
    left_seconds: float | None


@dataclass(frozen=True)
class Status:
    """How far a dataset is.

    Args:
        name: of the dataset.
        location: folder or URL.
        counts: samples by `STATES`, of all splits.
        splits: the same, by split.
        runs: the last run of each shard.
        failures: index and reason of each sample that could not be rendered.
        notes: what could not be read of what the runs told.
    """

    name: str
    location: str
    counts: Mapping[str, int]
    splits: Mapping[str, Mapping[str, int]]
    runs: tuple[Run, ...]
    failures: tuple[tuple[int, str], ...]
    notes: tuple[str, ...] = ()

    @property
    def planned(self) -> int:
        """Number of samples of the plan."""
        return sum(self.counts.values())

    def to_json(self) -> str:
        """All of it, for other programs."""
        failures = [{"index": index, "reason": reason} for index, reason in self.failures]
        return json.dumps({**asdict(self), "planned": self.planned, "failures": failures}, indent=1, allow_nan=False)


def read_status(dataset: Dataset, now: datetime | None = None) -> Status:
    """Counts what is there, and reads the events of its runs.

    Args:
        dataset: complete or not.
        now: the time; by default that of the clock.

    Raises:
        CorruptFileError: for the note on a failure that cannot be read.
    """
    complete, failures = set(dataset.complete()), dataset.failures()
    splits = dataset.plan[SPLIT].to_pylist()
    states = [
        COMPLETE if index in complete else FAILED if index in failures else MISSING for index in range(len(splits))
    ]
    counted = Counter(zip(splits, states, strict=True))
    notes: list[str] = []
    return Status(
        name=dataset.meta.name,
        location=dataset.store.location,
        counts={state: states.count(state) for state in STATES},
        splits={
            split: {state: counted[split, state] for state in STATES} for split in layout.SPLITS if split in splits
        },
        runs=tuple(_runs(dataset, now or datetime.now(UTC), notes)),
        failures=tuple((index, failures[index].reason) for index in sorted(failures) if index not in complete),
        notes=tuple(notes),
    )


def _runs(dataset: Dataset, now: datetime, notes: list[str]) -> Iterator[Run]:
    """The last run of each shard; what could not be read of its events is added to the notes."""
    held = {str(shard) for shard in shards_under_way(dataset.store)}
    for name in dataset.store.sizes(layout.RUN):
        if not (name.startswith(EVENTS[0]) and name.endswith(EVENTS[1])):
            continue
        content = read(dataset, name)
        if isinstance(content, str):
            notes.append(f"{name}: {content}")
            continue
        events, damaged = _last_run(content)
        if damaged:
            notes.append(f"{name}: {damaged} of its lines cannot be read, and are left out")
        if events:
            lives = events[0]["shard"] in held if dataset.store.folder else None
            yield _run(events, lives, now)


def _last_run(content: bytes) -> tuple[list[dict[str, Any]], int]:
    """The events from the last start on, and how many lines are none; one that is being written is left out."""
    events: list[dict[str, Any]] = []
    damaged = 0
    for line in content.splitlines(keepends=True):
        event = _read_event(line)
        if event is None:
            damaged += line.endswith(b"\n")
            continue
        if event["event"] == "start":
            events = []
        events.append(event)
    return (events if events and events[0]["event"] == "start" else []), damaged


def _read_event(line: bytes) -> dict[str, Any] | None:
    """An event with all that is asked of its kind; None for anything else."""
    try:
        event = json.loads(line)
        if datetime.fromisoformat(event["time"]).tzinfo is None:
            return None
        needed = DETAILS.get(event["event"], {})
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None
    if event["event"] == "end" and "error" not in event:
        needed = {"interrupted": bool}
    return event if all(_is(event.get(key), kind) for key, kind in needed.items()) else None


def _is(value: Any, kind: Any) -> bool:
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        return False
    return not isinstance(value, int | float) or (math.isfinite(value) and abs(value) < MOST)


def _run(events: list[dict[str, Any]], lives: bool | None, now: datetime) -> Run:
    start, last = events[0], events[-1]
    samples = [event for event in events if event["event"] == "sample"]
    state = _state(last, lives)
    left = samples[-1]["left"] if samples and state.startswith(UNDER_WAY) else None
    if left is not None:
        left = max(0.0, left - _seconds_since(samples[-1], now))
    return Run(
        shard=start["shard"],
        executor=start["executor"],
        started=start["time"],
        last=last["time"],
        silent_seconds=round(_seconds_since(last, now), 3),
        state=state,
        done=samples[-1]["done"] if samples else start["reused"],
        total=start["samples"],
        rate=samples[-1]["rate"] if samples else None,
        left_seconds=left,
    )


def _state(last: Mapping[str, Any], lives: bool | None) -> str:
    """Of a run, by its last event and whether it holds its lock."""
    if last["event"] == "end":
        return (
            f"error: {' '.join(str(last['error']).split())}"
            if "error" in last
            else "interrupted"
            if last["interrupted"]
            else "finished"
        )
    if lives is None:
        return f"{UNDER_WAY} or killed"
    return UNDER_WAY if lives else "killed"


def _seconds_since(event: Mapping[str, Any], now: datetime) -> float:
    return max(0.0, (now - datetime.fromisoformat(event["time"])).total_seconds())
