"""One table per split that holds labels and images alike."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from generators.publishing.exports.samples import Split

GROUP_BYTES = 64 * 2**20
"""Of images in a row group: what memory holds when writing, and when a reader takes a part."""
IMAGE_TYPE = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
"""As ``datasets`` keeps images."""


def write_table(split: Split, folder: Path, group_bytes: int = GROUP_BYTES) -> Iterator[int]:
    """Writes ``SPLIT.parquet``: the labels, the view as ``image`` and the file of the radiance as ``exr``.

    Args:
        split: to write.
        folder: that exists.
        group_bytes: size of images after which a row group ends.

    Yields:
        1 after each sample.
    """
    schema = _schema(split)
    with pq.ParquetWriter(folder / f"{split.name}.parquet", schema) as writer:
        rows: list[dict[str, Any]] = []
        size = 0
        for sample in split.samples():
            view = {"image": {"bytes": sample.png, "path": f"{sample.key}.png"}} if sample.png is not None else {}
            rows.append({**sample.labels, **view, "exr": sample.exr})
            size += len(sample.exr) + len(sample.png or b"")
            if size >= group_bytes:
                writer.write_table(pa.Table.from_pylist(rows, schema))
                rows, size = [], 0
            yield 1
        if rows:
            writer.write_table(pa.Table.from_pylist(rows, schema))


def _schema(split: Split) -> pa.Schema:
    view = [pa.field("image", IMAGE_TYPE)] if split.dataset.meta.png else []
    fields = [*split.labels.schema, *view, pa.field("exr", pa.binary())]
    # By this `datasets` knows the column as images; it finds the types of the others by itself.
    features = {"info": {"features": {"image": {"_type": "Image"}}}}
    return pa.schema(fields, metadata={"huggingface": json.dumps(features)} if view else None)
