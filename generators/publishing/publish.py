"""Writes what makes the samples a dataset: labels, card, metadata and contact sheet."""

from __future__ import annotations

import pyarrow as pa

from fgf_warp.output.color import write_png
from generators.dataset import layout
from generators.dataset.reader import Dataset
from generators.publishing.card import write_card
from generators.publishing.contact_sheet import draw_contact_sheet
from generators.publishing.croissant import described_files, write_croissant
from generators.publishing.index import build_index, parquet_bytes, split_table


def publish(dataset: Dataset) -> None:
    """Writes the labels, the card, the metadata and the contact sheet of what is there, in the place of older ones.

    Args:
        dataset: complete or not.

    Raises:
        CorruptFileError: where a record or an image that is needed cannot be read, by name.
        OutputError: where a file cannot be written.
        GoneError: where the dataset is not there any more.
    """
    dataset.store.check_there()
    index = build_index(dataset)
    _write_labels(dataset, index)
    dataset.store.write(layout.INDEX, parquet_bytes(index))
    dataset.store.write(layout.CONTACT_SHEET, _contact_sheet(dataset, index))
    dataset.store.write(layout.CARD, write_card(dataset.meta, index).encode())
    # The last, since it has the hashes of the others.
    described = described_files(dataset.splits)
    files = {name: dataset.store.read(name) for name in described if dataset.store.exists(name)}
    dataset.store.write(layout.CROISSANT, write_croissant(dataset.meta, index, files))


def _write_labels(dataset: Dataset, index: pa.Table) -> None:
    """The labels of each split that has complete samples."""
    for split in dataset.splits:
        labels = split_table(dataset.meta, index, split)
        if labels is None:
            dataset.store.remove(layout.split_metadata(split))
        else:
            dataset.store.write(layout.split_metadata(split), parquet_bytes(labels))


def _contact_sheet(dataset: Dataset, index: pa.Table) -> bytes:
    # What a run that is killed leaves of it lies with the dataset, whose next run removes it.
    with dataset.store.workspace(layout.CONTACT_SHEET) as folder:
        path = folder / layout.CONTACT_SHEET
        write_png(path, draw_contact_sheet(dataset, index))
        return path.read_bytes()
