"""Writes what makes the samples a dataset: labels, card, metadata and contact sheet."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pyarrow as pa

from fgf_warp.output.color import write_png
from generators.dataset import layout
from generators.dataset.reader import Dataset
from generators.publishing.card import write_card
from generators.publishing.contact_sheet import draw_contact_sheet
from generators.publishing.croissant import FILES, write_croissant
from generators.publishing.index import build_index, parquet_bytes, split_labels, with_file_names


def publish(dataset: Dataset) -> None:
    """Writes the labels, the card, the metadata and the contact sheet of what is there, in the place of older ones.

    Args:
        dataset: complete or not.

    Raises:
        CorruptFileError: where a record or an image that is needed cannot be read, by name.
        OutputError: where a file cannot be written.
    """
    index = build_index(dataset)
    _write_labels(dataset, index)
    dataset.store.write(layout.INDEX, parquet_bytes(index))
    dataset.store.write(layout.CONTACT_SHEET, _contact_sheet(dataset, index))
    dataset.store.write(layout.CARD, write_card(dataset.meta, index).encode())
    # The last, since it has the hashes of the others.
    files = {name: dataset.store.read(name) for name in FILES if dataset.store.exists(name)}
    dataset.store.write(layout.CROISSANT, write_croissant(dataset.meta, index, files))


def _write_labels(dataset: Dataset, index: pa.Table) -> None:
    """The labels of each split that has complete samples."""
    for split in layout.SPLITS:
        labels = split_labels(index, split)
        if labels.num_rows:
            content = parquet_bytes(with_file_names(labels) if dataset.meta.png else labels)
            dataset.store.write(layout.split_metadata(split), content)
        else:
            dataset.store.remove(layout.split_metadata(split))


def _contact_sheet(dataset: Dataset, index: pa.Table) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, layout.CONTACT_SHEET)
        write_png(path, draw_contact_sheet(dataset, index))
        return path.read_bytes()
