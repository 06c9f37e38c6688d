"""Whether labels, card, metadata and contact sheet are as they were written, and those of the samples that are there.

`croissant.json` has the hashes of the others. Where a label and a sample disagree, they tell which of the two has
changed since.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from itertools import zip_longest
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from fgf_warp import __version__
from generators.checking.findings import Finding, Kind
from generators.checking.samples import read
from generators.dataset import layout
from generators.dataset.plan_table import INDEX
from generators.dataset.reader import Dataset
from generators.dataset.record import file_entry
from generators.publishing.card import write_card
from generators.publishing.columns import COMPLETE, STATUS
from generators.publishing.croissant import claimed_hashes, described_files, write_croissant
from generators.publishing.index import build_index, parquet_bytes, split_table

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

    Returns:
        What is missing, and what is damaged or not made of the samples that are there.
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
    croissant = _read_json(dataset) if layout.CROISSANT in there else None
    if isinstance(croissant, str):
        yield _damaged(layout.CROISSANT, croissant, "a document that can be read")
        croissant = None
    hashes = claimed_hashes(dataset.store.read(layout.CROISSANT)) if croissant else {}
    if croissant is not None:
        yield from _wrong_list(dataset, croissant, there)
    changed = list(_changed(dataset, there, hashes))
    yield from changed
    labels = read_labels(dataset) if layout.INDEX in there else None
    if labels is None:
        if layout.INDEX in there and layout.INDEX not in hashes:
            yield _damaged(layout.INDEX, "is damaged", "a table that can be read")
        yield from _lost_samples(dataset, there, samples)
        return
    names = {finding.name for finding in changed}
    if names.isdisjoint((layout.INDEX, layout.PLAN)):
        yield from _wrong_labels(dataset, labels, samples, is_as_written=layout.INDEX in hashes)
    # The words of another version may be others.
    if dataset.meta.version == __version__ and names.isdisjoint((layout.INDEX, layout.PLAN)):
        if croissant is not None:
            yield from _wrong_metadata(dataset, there, labels, croissant, names)
        yield from _wrong_words(dataset, there, labels, names)


def _changed(dataset: Dataset, there: Collection[str], hashes: Mapping[str, str]) -> Iterator[Finding]:
    """The files that are not as they were when the metadata took their hashes."""
    for name in sorted({*hashes}.intersection(there, described_files(dataset.splits))):
        content = read(dataset, name)
        if isinstance(content, str):
            yield _damaged(name, content, "a file that can be read")
        elif (found := file_entry(content).sha256) == hashes[name]:
            continue
        elif _is_misprint(found, hashes[name]):
            yield _damaged(layout.CROISSANT, f"sha256 {hashes[name]} of {name}", found)
        else:
            yield _damaged(name, f"sha256 {found}", f"{hashes[name]}, as {layout.CROISSANT} says")


# ---- the labels, against plan, records and timings


def _lost_samples(dataset: Dataset, there: Collection[str], samples: Samples) -> Iterator[Finding]:
    """Samples that were there once, as the tables of their splits say where the labels cannot."""
    for split in dataset.splits:
        name = layout.split_metadata(split)
        table = read_table(dataset, name) if name in there else None
        if table is None or INDEX not in table.column_names:
            continue
        known = {index for index in table[INDEX].to_pylist() if index in range(len(dataset.folders))}
        for sample in sorted(known - samples.there):
            yield _gone(dataset, sample, name)


def _gone(dataset: Dataset, sample: int, witness: str) -> Finding:
    return Finding(Kind.DAMAGED, dataset.folders[sample], "missing", f"the sample, as {witness} says", sample)


def _wrong_labels(dataset: Dataset, labels: pa.Table, samples: Samples, *, is_as_written: bool) -> Iterator[Finding]:
    expected = build_index(dataset, sorted(samples.intact))
    if labels.num_rows != expected.num_rows or STATUS not in labels.column_names:
        yield _damaged(layout.INDEX, f"{labels.num_rows:,} rows", f"{expected.num_rows:,} rows, as of the plan")
        return
    found = labels[STATUS].to_pylist()
    for sample in sorted({i for i, status in enumerate(found) if status == COMPLETE} - samples.there):
        yield _gone(dataset, sample, layout.INDEX)
    if late := [i for i in sorted(samples.intact) if found[i] != COMPLETE]:
        expectation = "the labels of all samples that are there"
        yield Finding(Kind.OUTDATED, layout.INDEX, f"{len(late)} samples came after it", expectation)
    differences = list(_differences(dataset, labels, expected, sorted(samples.intact.difference(late))))
    if is_as_written:
        yield from (_blame_sample(dataset, *difference) for difference in differences)
    elif differences:
        column, sample, label, value = differences[0]
        what = f"{len(differences)} labels that are not those of plan and samples"
        yield _damaged(layout.INDEX, f"{what}, such as {column} = {label} of sample {sample}", f"{value}")


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


# ---- metadata, card and tables, which are made anew and compared


def _wrong_list(dataset: Dataset, croissant: Mapping[str, Any], there: Collection[str]) -> Iterator[Finding]:
    """Whether the metadata list every file that they should, once and by its name."""
    listed, described = Counter(_urls(croissant)), described_files(dataset.splits)
    for name in [name for name in listed if name not in described]:
        yield _damaged(layout.CROISSANT, f"contentUrl {name}", f"one of {', '.join(described)}")
    # They are written last, when these are there in any case.
    always = (layout.INDEX, layout.PLAN, layout.CARD, layout.CONTACT_SHEET)
    for name in [name for name in described if (name in there or name in always) and listed[name] != 1]:
        found = f"{listed[name]} entries with a hash of {name}"
        yield _damaged(layout.CROISSANT, found, "one")


def _wrong_metadata(
    dataset: Dataset, there: Collection[str], labels: pa.Table, croissant: Mapping[str, Any], named: Collection[str]
) -> Iterator[Finding]:
    """Whether the metadata are what would be written of these files.

    Args:
        dataset: that they are of.
        there: names of the dataset's files.
        labels: its labels.
        croissant: the metadata.
        named: files that are not as the metadata say, which is told already.
    """
    published = croissant.get(DATE)
    if not _is_date(published):
        yield _damaged(layout.CROISSANT, f"{DATE} {published}", "a day")
        published = None
    described = described_files(dataset.splits)
    gone = [name for name in _urls(croissant) if name in described and name not in there]
    files = {name: _content(dataset, name) for name in described if name in there or name in gone}
    expected = write_croissant(dataset.meta, labels, files, published)
    if dataset.store.read(layout.CROISSANT) == expected:
        return
    untold = {*named, *gone}
    one, other = (_without_hashes(document, untold) for document in (croissant, json.loads(expected)))
    keys = {*one, *other} - ({DATE} if published is None else set())
    if different := sorted(key for key in keys if one.get(key) != other.get(key)):
        yield _damaged(layout.CROISSANT, f"other content of {', '.join(different)}", "what plan, labels and files say")
    elif not untold and published is not None:
        yield _damaged(layout.CROISSANT, "is not as it was written", "the same without a change")


def _without_hashes(document: Mapping[str, Any], names: Collection[str]) -> dict[str, Any]:
    """The metadata without what they say of the content of some files."""

    def shown(entry: Any) -> Any:
        if isinstance(entry, dict) and str(entry.get("contentUrl")) in names:
            return {key: value for key, value in entry.items() if key not in ("sha256", "contentSize")}
        return entry

    entries = document.get("distribution")
    return {**document, "distribution": [shown(entry) for entry in entries] if isinstance(entries, list) else entries}


def _wrong_words(
    dataset: Dataset, there: Collection[str], labels: pa.Table, named: Collection[str]
) -> Iterator[Finding]:
    """Whether card and tables are what would be written, though metadata that were changed with them say so."""
    if layout.CARD in there and layout.CARD not in named:
        expected = write_card(dataset.meta, labels).encode()
        if dataset.store.read(layout.CARD) != expected:
            yield _damaged(layout.CARD, "other words", "what plan and labels say")
    for split in dataset.splits:
        name = layout.split_metadata(split)
        if name not in there or name in named:
            continue
        table = split_table(dataset.meta, labels, split)
        content = dataset.store.read(name)
        if table is None or (content != parquet_bytes(table) and not _holds(content, table)):
            yield _damaged(name, "other labels", f"those of {layout.INDEX}")


def _holds(content: bytes, table: pa.Table) -> bool:
    """Whether a file is one of this table, which another version of the library may write to other bytes."""
    try:
        return bool(pq.read_table(pa.BufferReader(content)).equals(table, check_metadata=True))
    except (pa.ArrowException, OSError, ValueError):
        return False


def _content(dataset: Dataset, name: str) -> bytes:
    """Of a file, or nothing where it cannot be read."""
    content = read(dataset, name)
    return content if isinstance(content, bytes) else b""


def _urls(croissant: Mapping[str, Any]) -> list[str]:
    """The files that the metadata have hashes of, or that are listed as if they had."""
    entries = croissant.get("distribution")
    listed = [entry for entry in entries if isinstance(entry, dict)] if isinstance(entries, list) else []
    return [str(entry["contentUrl"]) for entry in listed if "contentUrl" in entry]


def read_labels(dataset: Dataset) -> pa.Table | None:
    """The labels as they were written; None where they cannot be read."""
    return read_table(dataset, layout.INDEX)


def read_table(dataset: Dataset, name: str) -> pa.Table | None:
    """A table of the dataset as it was written; None where it cannot be read."""
    content = read(dataset, name)
    try:
        return None if isinstance(content, str) else pq.read_table(pa.BufferReader(content))
    except (pa.ArrowException, OSError, ValueError):
        return None


def _read_json(dataset: Dataset) -> dict[str, Any] | str:
    content = read(dataset, layout.CROISSANT)
    if isinstance(content, str):
        return content
    try:
        found = json.loads(content)
    except (ValueError, RecursionError):
        return "is damaged"
    return found if isinstance(found, dict) else "is damaged"


def _is_date(text: object) -> bool:
    try:
        date.fromisoformat(str(text))
    except ValueError:
        return False
    return True


def _is_misprint(found: str, claimed: str) -> bool:
    """Hashes of two contents differ in nearly all digits; one that differs in a few has itself been changed."""
    return sum(a != b for a, b in zip_longest(found, claimed)) <= MISPRINTS


def _damaged(name: str, found: str, expected: str) -> Finding:
    return Finding(Kind.DAMAGED, name, found, expected)
