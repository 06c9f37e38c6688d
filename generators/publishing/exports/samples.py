"""What goes into an export: the complete samples of a split, whole and as they were rendered."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import pyarrow as pa

from fgf_warp.errors import CorruptFileError
from generators.dataset import layout
from generators.dataset.plan_table import INDEX
from generators.dataset.reader import Dataset
from generators.dataset.record import FileEntry, file_entry
from generators.publishing.columns import EXR, PNG
from generators.publishing.index import split_labels

OF_THE_DATASET = (EXR, PNG, "render_seconds")
"""Labels that mean nothing outside the dataset's folder, or differ between two runs of one plan."""


@dataclass(frozen=True)
class Sample:
    """One complete sample.

    Args:
        index: of the sample.
        labels: by name.
        exr: content of its radiance.
        png: content of its view; None where the dataset has none.
    """

    index: int
    labels: dict[str, Any]
    exr: bytes
    png: bytes | None

    @property
    def key(self) -> str:
        """By which loaders tell samples apart; without dots, since they take what follows one for a suffix."""
        return layout.sample_name(self.index)


@dataclass(frozen=True)
class Split:
    """The complete samples of a split.

    Args:
        name: of the split.
        dataset: that it belongs to.
        labels: a row for each sample.
    """

    name: str
    dataset: Dataset
    labels: pa.Table

    def samples(self) -> Iterator[Sample]:
        """One after the other, so that memory holds one at a time.

        Raises:
            CorruptFileError: for a file that is missing or not what its record says.
        """
        for row in self.labels.to_pylist():
            index = row[INDEX]
            files = self.dataset.record(index).files
            png = self._read(index, layout.IMAGE, files) if self.dataset.meta.png else None
            yield Sample(index, row, self._read(index, layout.RADIANCE, files), png)

    def _read(self, index: int, file: str, files: Mapping[str, FileEntry]) -> bytes:
        name, entry = f"{self.dataset.folders[index]}/{file}", files.get(file)
        try:
            path = self.dataset.store.local_file(name)
            # One that is too large is not even read: it may be larger than memory.
            content = None if path and entry and path.stat().st_size > entry.bytes else self.dataset.store.read(name)
        except FileNotFoundError as error:
            raise _damaged(f"{self.dataset.store.location}/{name}", "is missing") from error
        if content is None or file_entry(content) != entry:
            raise _damaged(f"{self.dataset.store.location}/{name}", "is not what its record says")
        return content


def splits_of(dataset: Dataset, index: pa.Table) -> list[Split]:
    """The splits that have complete samples.

    Args:
        dataset: to export.
        index: its labels, see `generators.publishing.index`.

    Returns:
        In the order of `SPLITS`; of each split only the labels are read yet.
    """
    found = (Split(name, dataset, split_labels(index, name).drop_columns(OF_THE_DATASET)) for name in layout.SPLITS)
    return [split for split in found if split.labels.num_rows]


def _damaged(name: str, what: str) -> CorruptFileError:
    return CorruptFileError(f"{name}: {what}; fgf verify --repair makes it anew")
