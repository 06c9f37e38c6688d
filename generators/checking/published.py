"""Whether labels, card, metadata and contact sheet are those of the samples that are there.

`croissant.json` holds the hash of the labels. Where a label and a sample disagree, it tells which of them has changed
since they were written.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from itertools import zip_longest
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from fgf_warp.errors import CorruptFileError
from fgf_warp.output.images import read_image
from generators.checking.findings import Finding, Kind
from generators.checking.samples import read
from generators.dataset import layout
from generators.dataset.reader import Dataset
from generators.dataset.record import file_entry
from generators.publishing.card import write_card
from generators.publishing.columns import COMPLETE, STATUS
from generators.publishing.croissant import FILES, write_croissant
from generators.publishing.index import build_index, parquet_bytes, split_labels, with_file_names

OF_TIMING = ("render_seconds",)
"""Columns of the labels that come from the timing; the others come from the plan or the record."""
DATE = "datePublished"
MISPRINTS = 8
"""Digits of a hash, of 64: by chance so few differ once in 10^60."""


@dataclass(frozen=True)
class Samples:
    """What was found of the samples.

    Args:
        there: indices of those that have a folder.
        complete: of these, with a record.
        intact: of these, without damage.
    """

    there: frozenset[int]
    complete: frozenset[int]
    intact: frozenset[int]


def check_published(dataset: Dataset, there: Collection[str], samples: Samples) -> list[Finding]:
    """Looks at the files that describe a dataset.

    Args:
        dataset: that they belong to.
        there: names of the dataset's files.
        samples: what was found of them.
    """
    return [*_absent(dataset, there, samples), *_wrong(dataset, there, samples)]


def _absent(dataset: Dataset, there: Collection[str], samples: Samples) -> Iterator[Finding]:
    """They are written at the end of a run: until all samples are there, that may be to come."""
    is_whole = len(samples.complete) == len(dataset.folders)
    splits = {dataset.folders[index].split("/")[1] for index in samples.complete}
    tables = [layout.split_metadata(split) for split in sorted(splits)]
    for name in (layout.CONFIG, layout.CARD, layout.INDEX, layout.CROISSANT, layout.CONTACT_SHEET, *tables):
        if name not in there:
            kind = Kind.DAMAGED if is_whole or name == layout.CONFIG else Kind.OUTDATED
            yield Finding(kind, name, "missing", "there, as in every dataset")


def _wrong(dataset: Dataset, there: Collection[str], samples: Samples) -> Iterator[Finding]:
    if layout.CONTACT_SHEET in there:
        yield from _undecodable(dataset, layout.CONTACT_SHEET)
    croissant = _read_json(dataset, layout.CROISSANT) if layout.CROISSANT in there else None
    if isinstance(croissant, str):
        yield _damaged(layout.CROISSANT, croissant, "a document that can be read")
        croissant = None
    hashes = _hashes(croissant) if croissant else {}
    wrong = list(_wrong_sources(dataset, there, hashes))
    content = read(dataset, layout.INDEX) if layout.INDEX in there else None
    index = _read_table(content) if isinstance(content, bytes) else content
    if isinstance(index, str):
        wrong.append(_damaged(layout.INDEX, index, "a table that can be read"))
    elif isinstance(content, bytes) and index is not None:
        wrong += _wrong_labels(dataset, content, index, hashes.get(layout.INDEX), samples)
    yield from wrong
    if isinstance(index, pa.Table) and not any(f.name in (layout.INDEX, layout.PLAN) for f in _damage(wrong)):
        yield from _wrong_words(dataset, there, index, croissant, wrong_files=bool(wrong))
        yield from _wrong_tables(dataset, there, index)


def _wrong_sources(dataset: Dataset, there: Collection[str], hashes: Mapping[str, str]) -> Iterator[Finding]:
    """Plan and config, by the hashes of the metadata."""
    for name in (layout.PLAN, layout.CONFIG):
        if name in there and name in hashes:
            content = read(dataset, name)
            if isinstance(content, str):
                yield _damaged(name, content, "a file that can be read")
            elif (found := file_entry(content).sha256) != hashes[name]:
                if _is_misprint(found, hashes[name]):
                    yield _damaged(layout.CROISSANT, f"sha256 {hashes[name]} of {name}", found)
                else:
                    yield _hash_differs(name, content, hashes[name])


# ---- the labels, against plan, records and timings


def _wrong_labels(
    dataset: Dataset, content: bytes, index: pa.Table, claimed: str | None, samples: Samples
) -> Iterator[Finding]:
    expected = build_index(dataset, sorted(samples.intact))
    if samples.intact == samples.complete and content == parquet_bytes(expected):
        return
    is_as_written = claimed == file_entry(content).sha256
    if set(index.column_names) < {*dataset.plan.column_names, STATUS} or index.num_rows != expected.num_rows:
        yield _damaged(layout.INDEX, f"{index.num_rows} rows of other labels", f"{expected.num_rows} rows of the plan")
        return
    found = index[STATUS].to_pylist()
    for sample in sorted({i for i, status in enumerate(found) if status == COMPLETE} - samples.there):
        name = dataset.folders[sample]
        yield Finding(Kind.DAMAGED, name, "missing", f"the sample, as {layout.INDEX} says", sample)
    if late := [i for i in sorted(samples.intact) if found[i] != COMPLETE]:
        expectation = "the labels of all samples that are there"
        yield Finding(Kind.OUTDATED, layout.INDEX, f"{len(late)} samples came after it", expectation)
    differences = list(_differences(dataset, index, expected, [i for i in sorted(samples.intact) if i not in late]))
    if is_as_written:
        yield from (_blame_sample(dataset, *difference) for difference in differences)
    elif differences:
        column, sample, label, value = differences[0]
        yield _damaged(
            layout.INDEX,
            f"{len(differences)} labels that are not those of plan and samples, such as {column} = {label} of "
            f"sample {sample}",
            f"{value}",
        )
    elif claimed is not None:
        yield _hash_differs(layout.INDEX, content, claimed)


def _differences(
    dataset: Dataset, index: pa.Table, expected: pa.Table, known: Sequence[int]
) -> Iterator[tuple[str, int, Any, Any]]:
    """Column, sample, the label, and what plan, record or timing say."""
    planned = set(dataset.plan.column_names)
    for column in expected.column_names:
        if column == STATUS:
            continue
        if column not in index.column_names:
            yield column, 0, "no such column", "one"
            continue
        labels, values = index[column].to_pylist(), expected[column].to_pylist()
        for sample in range(len(values)) if column in planned else known:
            if labels[sample] != values[sample]:
                yield column, sample, labels[sample], values[sample]


def _blame_sample(dataset: Dataset, column: str, sample: int, label: Any, value: Any) -> Finding:
    """The labels are as they were written, so plan, record or timing have changed since."""
    found, expected = f"{column} = {value} of sample {sample}", f"{label}, as {layout.INDEX} says"
    if column in dataset.plan.column_names:
        return _damaged(layout.PLAN, found, expected)
    name = layout.TIMING if column in OF_TIMING else layout.RECORD
    return Finding(Kind.DAMAGED, f"{dataset.folders[sample]}/{name}", found, expected, sample)


# ---- what is written from the labels


def _wrong_words(
    dataset: Dataset, there: Collection[str], index: pa.Table, croissant: dict[str, Any] | None, *, wrong_files: bool
) -> Iterator[Finding]:
    """Card and metadata are written anew and compared."""
    if croissant is not None:
        files = {name: dataset.store.read(name) for name in FILES if name in there}
        expected = json.loads(write_croissant(dataset.meta, index, files))
        # The day on which it was written is known to it alone; files whose hashes differ are named themselves.
        told = {DATE, "distribution"} if wrong_files or len(files) < len(FILES) else {DATE}
        different = sorted(key for key in {*croissant, *expected} - told if croissant.get(key) != expected.get(key))
        if not _is_date(croissant.get(DATE)):
            different.append(DATE)
        if different:
            yield _damaged(layout.CROISSANT, f"other content of {', '.join(different)}", "what plan and labels say")
    if layout.CARD in there:
        card = read(dataset, layout.CARD)
        if isinstance(card, str):
            yield _damaged(layout.CARD, card, "a text that can be read")
        elif card != write_card(dataset.meta, index).encode():
            yield _damaged(layout.CARD, "is not as it was written", "the card that follows from plan and labels")


def _wrong_tables(dataset: Dataset, there: Collection[str], index: pa.Table) -> Iterator[Finding]:
    for split in layout.SPLITS:
        name = layout.split_metadata(split)
        labels = split_labels(index, split)
        if name not in there:
            continue
        content = read(dataset, name)
        table = content if isinstance(content, str) else _read_table(content)
        expected = with_file_names(labels) if dataset.meta.png else labels
        if isinstance(content, str) or isinstance(table, str):
            yield _damaged(name, str(table), "a table that can be read")
        elif not _is_table(content, table, expected):
            yield _damaged(name, "is not as it was written", f"the labels of {split} in {layout.INDEX}")


def _is_table(content: bytes, table: pa.Table, expected: pa.Table) -> bool:
    """Byte by byte, unless another version of the library wrote it."""
    written = parquet_bytes(expected)
    writer, ours = (pq.read_metadata(pa.BufferReader(one)).created_by for one in (content, written))
    return content == written if writer == ours else table.equals(expected)


def _undecodable(dataset: Dataset, name: str) -> Iterator[Finding]:
    content = read(dataset, name)
    if isinstance(content, str):
        yield _damaged(name, content, "a picture that can be read")
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, name)
        path.write_bytes(content)
        try:
            read_image(path)
        except CorruptFileError:
            yield _damaged(name, "is damaged", "a picture that decodes")


def _hashes(croissant: Mapping[str, Any]) -> dict[str, str]:
    """What the metadata says of the dataset's files, by name."""
    try:
        files = [entry for entry in croissant["distribution"] if "sha256" in entry]
        return {entry["contentUrl"]: entry["sha256"] for entry in files}
    except (KeyError, TypeError):
        return {}


def read_labels(dataset: Dataset) -> pa.Table | None:
    """The labels as they were written; None where they cannot be read."""
    content = read(dataset, layout.INDEX)
    table = content if isinstance(content, str) else _read_table(content)
    return None if isinstance(table, str) else table


def _read_json(dataset: Dataset, name: str) -> dict[str, Any] | str:
    content = read(dataset, name)
    if isinstance(content, str):
        return content
    try:
        found = json.loads(content)
    except ValueError:
        return "is damaged"
    return found if isinstance(found, dict) else "is damaged"


def _read_table(content: bytes) -> pa.Table | str:
    try:
        return pq.read_table(pa.BufferReader(content))
    except (pa.ArrowException, OSError, ValueError):
        return "is damaged"


def _is_date(text: object) -> bool:
    try:
        date.fromisoformat(str(text))
    except ValueError:
        return False
    return True


def _is_misprint(found: str, claimed: str) -> bool:
    """Hashes of two contents differ in nearly all digits; one that differs in a few has itself been changed."""
    return sum(a != b for a, b in zip_longest(found, claimed)) <= MISPRINTS


def _hash_differs(name: str, content: bytes, claimed: str) -> Finding:
    return _damaged(name, f"sha256 {file_entry(content).sha256}", f"{claimed}, as {layout.CROISSANT} says")


def _damage(findings: Sequence[Finding]) -> list[Finding]:
    return [finding for finding in findings if finding.kind is Kind.DAMAGED]


def _damaged(name: str, found: str, expected: str) -> Finding:
    return Finding(Kind.DAMAGED, name, found, expected)
