"""The table of labels: one row per sample of the plan, whether it is there or not."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from generators.dataset import layout
from generators.dataset.plan_table import INDEX, SPLIT, PlanMeta
from generators.dataset.reader import Dataset
from generators.dataset.record import Record, Timing
from generators.publishing.columns import COMPLETE, EXR, FAILED, MISSING, PNG, STATUS, columns_of


def build_index(dataset: Dataset, complete: Sequence[int] | None = None) -> pa.Table:
    """The labels of all samples by index, with meaning and unit of each column in its field's metadata.

    Args:
        dataset: complete or not.
        complete: indices of the samples to take for complete, in order; by default all that are there.

    Returns:
        A row for each sample of the plan; results are null where it is not complete.

    Raises:
        CorruptFileError: for a record that cannot be read, by name.
    """
    complete = dataset.complete() if complete is None else complete
    records = dict(zip(complete, dataset.records(complete), strict=True))
    timings = dict(zip(complete, dataset.timings(complete), strict=True))
    failed = dataset.failures()
    rows = []
    for index, planned in enumerate(dataset.plan.to_pylist()):
        row = {**planned, STATUS: FAILED if index in failed else MISSING, "config_hash": dataset.meta.digest}
        if index in records:
            row |= _reached(records[index], timings[index], dataset.folders[index], png=dataset.meta.png)
        rows.append(row)
    schema = pa.schema([column.field for column in columns_of(dataset, records.values())])
    return pa.Table.from_pylist(rows, schema=schema)


def _reached(record: Record, timing: Timing, folder: str, *, png: bool) -> Mapping[str, Any]:
    return {
        STATUS: COMPLETE,
        "spp": record.spp,
        "standard_error": record.standard_error,
        "reached_error": record.reached_error,
        "chosen_settings": record.chosen_settings,
        "truncated": record.truncated,
        "nonfinite": record.nonfinite,
        "render_seconds": timing.render_seconds,
        **record.statistics,
        **record.targets,
        EXR: f"{folder}/{layout.RADIANCE}",
        PNG: f"{folder}/{layout.IMAGE}" if png else None,
    }


def split_labels(index: pa.Table, split: str) -> pa.Table:
    """The labels of the complete samples of a split.

    Args:
        index: of `build_index`.
        split: its name.

    Returns:
        Without the column that says how far a sample is.
    """
    there = index.filter(pc.and_(pc.equal(index[SPLIT], split), pc.equal(index[STATUS], COMPLETE)))
    return there.drop_columns([STATUS])


def split_table(meta: PlanMeta, index: pa.Table, split: str) -> pa.Table | None:
    """The table of a split's complete samples, with the paths of their views where there are any.

    Args:
        meta: of the dataset.
        index: of `build_index`.
        split: its name.

    Returns:
        None where the split has no complete sample.
    """
    labels = split_labels(index, split)
    if not labels.num_rows:
        return None
    return with_file_names(labels) if meta.png else labels


def with_file_names(labels: pa.Table) -> pa.Table:
    """Labels with the path of each view from their folder, by which ``datasets`` puts the image in its place."""
    names = [f"{layout.sample_name(sample)}/{layout.IMAGE}" for sample in labels[INDEX].to_pylist()]
    return labels.append_column(pa.field("file_name", pa.string()), [names])


def parquet_bytes(table: pa.Table) -> bytes:
    """The table as the content of a file."""
    buffer = io.BytesIO()
    pq.write_table(table, buffer)
    return buffer.getvalue()
