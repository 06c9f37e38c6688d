"""Exports of a dataset, in one of several forms."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from fgf_warp.errors import ConfigError
from generators.dataset.reader import Dataset
from generators.publishing.columns import COMPLETE, STATUS
from generators.publishing.exports.card import write_export_card
from generators.publishing.exports.destination import destination
from generators.publishing.exports.npz import write_arrays
from generators.publishing.exports.parquet import write_table
from generators.publishing.exports.samples import Split, splits_of
from generators.publishing.exports.webdataset import write_shards
from generators.publishing.index import build_index

KINDS: Mapping[str, Callable[[Split, Path], Iterator[int]]] = {
    "webdataset": write_shards,
    "parquet": write_table,
    "npz": write_arrays,
}
"""Writer of a split by the name of its form; each yields after every sample."""


@dataclass(frozen=True)
class Export:
    """How an export went.

    Args:
        samples: that are in it.
        left_out: number of the samples that are not there, by their status.
        files: that were written, in order.
    """

    samples: int
    left_out: Mapping[str, int]
    files: tuple[str, ...]


def export(dataset: Dataset, kind: str, out: str, progress: Callable[[int, int], None] | None = None) -> Export:
    """Writes the complete samples of a dataset in another form.

    Args:
        dataset: to export.
        kind: one of `KINDS`.
        out: a folder or URL that is new or empty; it holds the whole export, or nothing of it.
        progress: called with the number of samples that are written, and of all.

    Raises:
        ConfigError: where `out` is not accepted, or no sample is complete.
        CorruptFileError: for a sample that is not what its record says.
        OutputError: where something cannot be written.
    """
    index = build_index(dataset)
    statuses = Counter(index[STATUS].to_pylist())
    if not statuses[COMPLETE]:
        raise ConfigError(f"{dataset.store.location}: has no complete sample to export")
    done = 0
    with destination(out, dataset) as folder:
        splits = splits_of(dataset, index)
        for split in splits:
            for count in KINDS[kind](split, folder):
                done += count
                if progress:
                    progress(done, statuses[COMPLETE])
        (folder / "README.md").write_text(write_export_card(dataset.meta, kind, splits), encoding="utf-8")
        files = tuple(sorted(file.name for file in folder.iterdir()))
    left_out = {status: count for status, count in sorted(statuses.items()) if status != COMPLETE}
    return Export(done, left_out, files)
