"""Tar shards for the WebDataset loaders: of each sample an EXR, a PNG and its labels as JSON."""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

from generators.publishing.exports.samples import Sample, Split

SHARD_BYTES = 256 * 2**20
"""Size that a shard does not exceed, but for a single sample that is larger."""
BLOCK = 512
"""[byte] Of a tar file: a header is one, and files fill whole ones."""


def write_shards(split: Split, folder: Path, shard_bytes: int = SHARD_BYTES) -> Iterator[int]:
    """Writes ``SPLIT-000000.tar`` and so on. Equal samples give equal bytes.

    Args:
        split: to write.
        folder: that exists.
        shard_bytes: largest size of a shard.

    Yields:
        1 after each sample.
    """
    shard, size = 0, shard_bytes
    with ExitStack() as opened:
        for sample in split.samples():
            files = _files(sample)
            needed = sum(BLOCK + -(-len(content) // BLOCK) * BLOCK for content in files.values())
            if size + needed > shard_bytes:
                opened.close()
                path = folder / f"{split.name}-{shard:06d}.tar"
                tar = opened.enter_context(tarfile.open(path, "w", format=tarfile.USTAR_FORMAT))
                shard, size = shard + 1, tarfile.RECORDSIZE  # what closes the file is at most this long
            for suffix, content in files.items():
                # The defaults of TarInfo are no one's: neither a date nor an owner.
                entry = tarfile.TarInfo(f"{sample.key}.{suffix}")
                entry.size = len(content)
                tar.addfile(entry, io.BytesIO(content))
            size += needed
            yield 1


def _files(sample: Sample) -> dict[str, bytes]:
    """Content by suffix."""
    labels = json.dumps(sample.labels, allow_nan=False).encode()
    return {"exr": sample.exr, **({"png": sample.png} if sample.png is not None else {}), "json": labels}
