"""The images of a dataset's samples, wherever it lies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fgf_warp.errors import CorruptFileError
from fgf_warp.output.exr import read_exr
from generators.dataset import layout
from generators.dataset.reader import Dataset
from generators.dataset.scratch import scratch_folder


def read_channels(dataset: Dataset, index: int) -> dict[str, np.ndarray]:
    """The channels of a sample's EXR by name, each (height, width) float32.

    Raises:
        CorruptFileError: where it is missing or damaged.
    """
    name = f"{dataset.folders[index]}/{layout.RADIANCE}"
    if file := dataset.store.local_file(name):
        return read_exr(file)[0]
    try:
        content = dataset.store.read(name)
    except FileNotFoundError as error:
        raise CorruptFileError(f"{dataset.store.location}/{name}: is missing") from error
    return decode_channels(content, f"{dataset.store.location}/{name}")


def decode_channels(content: bytes, name: str) -> dict[str, np.ndarray]:
    """The channels of an EXR's content, as `read_channels`.

    Args:
        content: of the file.
        name: of the file, for the error.

    Returns:
        Each (height, width) float32, by name.

    Raises:
        CorruptFileError: where it is damaged.
    """
    # OpenImageIO reads files by name alone.
    with scratch_folder() as folder:
        file = folder / layout.RADIANCE
        file.write_bytes(content)
        try:
            return read_exr(file)[0]
        except CorruptFileError as error:
            raise CorruptFileError(f"{name}: is damaged or no EXR") from error


def choose_shown(samples: Sequence[int], most: int) -> list[int]:
    """The samples that are pictured: all, or as many as there may be, spread over all of them.

    They are cut into as many stretches, and one is drawn of each: at equal distances, some values of an axis that
    repeats along the samples would have no picture at all.

    Returns:
        At most `most` of them, in their order; the same ones each time.
    """
    if len(samples) <= most:
        return list(samples)
    edges = [i * len(samples) // most for i in range(most + 1)]
    return [samples[place] for place in np.random.default_rng(0).integers(edges[:-1], edges[1:])]
