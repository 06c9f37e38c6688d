"""A dataset that is there, whole or in part."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path

import pyarrow as pa

from fgf_warp.errors import ConfigError, CorruptFileError
from generators.dataset import layout
from generators.dataset.plan_table import INDEX, SPLIT, PlanMeta, read_plan
from generators.dataset.record import (
    Failure,
    Record,
    Timing,
    decode_failure,
    decode_record,
    decode_timing,
)
from generators.dataset.store import Store


class Dataset:
    """Reads a dataset by its plan and the records of its samples.

    Args:
        location: a folder or a URL, see `Store`.

    Raises:
        ConfigError: where there is no dataset.
        CorruptFileError: where its plan is damaged.
    """

    def __init__(self, location: str | Path) -> None:
        self.store = Store(location)
        try:
            is_there = self.store.exists(layout.PLAN)
            content = self.store.read(layout.PLAN) if is_there else b""
        except FileNotFoundError:
            is_there = False
        if not is_there:
            raise ConfigError(f"{location}: holds no dataset; accepted: a folder that fgf generate made")
        self.meta: PlanMeta
        self.plan: pa.Table
        self.meta, self.plan = read_plan(content, f"{location}/{layout.PLAN}")

    @cached_property
    def folders(self) -> tuple[str, ...]:
        """The folder of every sample of the plan, by index, whether it is there or not."""
        rows = zip(self.plan[SPLIT].to_pylist(), self.plan[INDEX].to_pylist(), strict=True)
        return tuple(layout.sample_folder(split, index) for split, index in rows)

    @cached_property
    def splits(self) -> tuple[str, ...]:
        """The splits that the plan has samples of, in their order."""
        planned = set(self.plan[SPLIT].to_pylist())
        return tuple(split for split in layout.SPLITS if split in planned)

    def is_complete(self, index: int) -> bool:
        """Whether a sample is there."""
        return self.store.exists(f"{self.folders[index]}/{layout.RECORD}")

    def complete(self) -> list[int]:
        """Indices of the samples that are there, in order."""
        there = self.store.sizes(layout.DATA)
        return [index for index, folder in enumerate(self.folders) if f"{folder}/{layout.RECORD}" in there]

    def record(self, index: int) -> Record:
        """What a complete sample reached.

        Raises:
            CorruptFileError: where it cannot be read.
        """
        return self.records([index])[0]

    def records(self, indices: Sequence[int]) -> list[Record]:
        """What complete samples reached; raises as `record` does."""
        return [decode_record(content, name) for name, content in self._read(indices, layout.RECORD)]

    def timing(self, index: int) -> Timing:
        """How long a complete sample took; raises as `record` does."""
        return self.timings([index])[0]

    def timings(self, indices: Sequence[int]) -> list[Timing]:
        """How long complete samples took; raises as `record` does."""
        return [decode_timing(content, name) for name, content in self._read(indices, layout.TIMING)]

    def failures(self) -> dict[int, Failure]:
        """Why samples that were tried are not there, by index.

        Raises:
            CorruptFileError: for a note that cannot be read, by name.
        """
        found = {}
        for _, note in self._notes():
            if isinstance(note, CorruptFileError):
                raise note
            found[note.index] = note
        return found

    def damaged_notes(self) -> list[str]:
        """Names of all notes on failures that cannot be read."""
        return [name for name, note in self._notes() if isinstance(note, CorruptFileError)]

    def _notes(self) -> Iterator[tuple[str, Failure | CorruptFileError]]:
        for name in self.store.sizes(layout.FAILURES):
            if not layout.is_failure(name):
                continue  # it is being written, by another shard's run, or is not of the dataset
            located = f"{self.store.location}/{name}"
            try:
                failure = decode_failure(self.store.read(name), located)
                if layout.failure(failure.index) != name or failure.index >= self.plan.num_rows:
                    raise CorruptFileError(f"{located}: is of sample {failure.index}")
                yield name, failure
            except FileNotFoundError:
                continue  # the sample has been finished since
            except CorruptFileError as error:
                yield name, error

    def _read(self, indices: Sequence[int], name: str) -> Iterator[tuple[str, bytes]]:
        """One file of each sample: its name for an error, and its content."""
        names = [f"{self.folders[index]}/{name}" for index in indices]
        located = [f"{self.store.location}/{name}" for name in names]
        try:
            return zip(located, self.store.read_all(names), strict=True)
        except FileNotFoundError as error:
            raise CorruptFileError(
                f"{error.filename or error}: is missing; fgf verify --repair makes it anew"
            ) from error
