"""Arrays of a split: all images on top of each other, and their labels."""

from __future__ import annotations

import shutil
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, cast

import numpy as np
import pyarrow as pa

from fgf_warp.output.exr import AOV_CHANNELS
from fgf_warp.settings import Aov
from generators.dataset.images import decode_channels
from generators.publishing.exports.samples import Split

DATE = (1980, 1, 1, 0, 0, 0)
"""Of each array in the file: the earliest that the format knows, so that equal arrays give equal bytes."""


def write_arrays(split: Split, folder: Path) -> Iterator[int]:
    """Writes ``SPLIT.npz``, which `numpy.load` reads without pickle.

    ``radiance`` is (sample, height, width, 3) float32 and ``alpha`` (sample, height, width); planes are ``aov_depth``
    and so on, with a last axis where they have several channels. Labels are (sample,) arrays, and curves (sample,
    length); numbers that are not known are NaN, and words empty.

    The images lie in files beside it until all are there: memory holds one at a time, and the disk all of them twice.

    Args:
        split: to write.
        folder: that exists.

    Yields:
        1 after each sample.
    """
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        stacks = _open_stacks(split, Path(scratch))
        for place, sample in enumerate(split.samples()):
            channels = decode_channels(sample.exr, f"{sample.key}.exr")
            for name, stack in stacks.items():
                planes = [channels[channel] for channel in _channels(split)[name]]
                stack[place] = planes[0] if len(planes) == 1 else np.stack(planes, axis=2)
            yield 1
        files = [Path(cast("str", stack.filename)) for stack in stacks.values()]
        for stack in stacks.values():
            stack.flush()
        with zipfile.ZipFile(folder / f"{split.name}.npz", "w") as archive:
            for file in files:
                with file.open("rb") as source, _member(archive, file.name) as member:
                    shutil.copyfileobj(source, member, 2**20)
            for name in split.labels.column_names:
                with _member(archive, f"{name}.npy") as member:
                    np.lib.format.write_array(member, _array(name, split.labels[name]), allow_pickle=False)


def _channels(split: Split) -> Mapping[str, tuple[str, ...]]:
    """The channels of the EXR that each stack of images holds."""
    planes = {f"aov_{name}": AOV_CHANNELS[Aov(name)] for name in sorted(split.dataset.meta.aovs)}
    return {"radiance": ("R", "G", "B"), "alpha": ("A",), **planes}


def _open_stacks(split: Split, folder: Path) -> dict[str, np.memmap]:
    meta = split.dataset.meta
    shape = (split.labels.num_rows, meta.height, meta.width)
    return {
        name: np.lib.format.open_memmap(
            folder / f"{name}.npy", "w+", np.float32, shape if len(channels) == 1 else (*shape, len(channels))
        )
        for name, channels in _channels(split).items()
    }


def _member(archive: zipfile.ZipFile, name: str) -> IO[bytes]:
    return archive.open(zipfile.ZipInfo(name, DATE), "w", force_zip64=True)


def _array(name: str, column: pa.ChunkedArray) -> np.ndarray:
    values = column.to_pylist()
    if pa.types.is_string(column.type):
        return np.array([value or "" for value in values], np.str_)
    if pa.types.is_list(column.type):
        length = max((len(value) for value in values if value is not None), default=0)
        return np.array([[np.nan] * length if value is None else value for value in values], np.float64)
    if column.null_count:
        return np.array([np.nan if value is None else value for value in values], np.float64)
    return np.array(values)
