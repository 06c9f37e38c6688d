"""Small pictures of samples that are part of a page."""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from fgf_warp.output.color import to_display
from fgf_warp.output.drawing import resize_linear
from fgf_warp.output.images import write_image
from generators.dataset.images import read_channels
from generators.dataset.reader import Dataset
from generators.dataset.scratch import scratch_folder

SHOWN_MAX = 2000
"""Pictures of a page, so that it stays one that a browser opens at once."""
WIDTH, FEW, WIDTH_OF_FEW = 112, 120, 192
"""[pixel] Widest picture, and the widest where there are few."""
QUALITY = "jpeg:82"
WORKERS = 4
Progress = Callable[[int, int], None]
"""Called with the number of pictures made, and of all."""


def make_thumbnails(dataset: Dataset, indices: Sequence[int], progress: Progress | None = None) -> dict[int, str]:
    """A data URI of each sample's picture.

    Args:
        dataset: that they belong to.
        indices: of complete samples.
        progress: see `Progress`.

    Returns:
        By index; each a ``data:`` URI of a small picture.

    Raises:
        CorruptFileError: where an image cannot be read.
    """
    width = WIDTH_OF_FEW if len(indices) <= FEW else WIDTH
    made = {}
    with scratch_folder() as folder, ThreadPoolExecutor(WORKERS) as pool:
        uris = pool.map(lambda index: _data_uri(dataset, index, width, folder / f"{index}.jpg"), indices)
        for done, (index, uri) in enumerate(zip(indices, uris, strict=True), start=1):
            made[index] = uri
            if progress:
                progress(done, len(indices))
    return made


def _data_uri(dataset: Dataset, index: int, width: int, file: Path) -> str:
    channels = read_channels(dataset, index)
    radiance = np.stack([channels[name] for name in "RGB"], axis=2)
    # Enlarged by the page where it is small.
    shown = radiance if radiance.shape[1] <= width else resize_linear(radiance, width)
    write_image(file, to_display(shown, dataset.meta.exposure), ("R", "G", "B"), {"compression": QUALITY})
    return f"data:image/jpeg;base64,{base64.b64encode(file.read_bytes()).decode('ascii')}"
