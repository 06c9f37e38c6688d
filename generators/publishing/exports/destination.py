"""A folder or URL that holds all of an export, or nothing."""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fgf_warp.errors import ConfigError, OutputError
from generators.dataset.reader import Dataset
from generators.dataset.scratch import scratch_folder
from generators.dataset.store import Store


@contextmanager
def destination(out: str, dataset: Dataset) -> Iterator[Path]:
    """A folder to write to, which becomes `out` when the block has ended well; else nothing is left of it.

    Args:
        out: a folder or a URL, see `Store`.
        dataset: that is exported, which `out` must not lie in: loaders would take it for a part.

    Raises:
        ConfigError: where `out` holds something, or lies in the dataset.
        OutputError: where it cannot be written.
    """
    store = Store(out)
    folder = store.folder
    if dataset.store.folder and folder and folder.resolve().is_relative_to(dataset.store.folder.resolve()):
        raise ConfigError(f"--out {out}: lies in the dataset; accepted: a folder beside it")
    if store.sizes() or (folder and folder.exists() and not (folder.is_dir() and not any(folder.iterdir()))):
        raise ConfigError(f"--out {out}: is there and not empty; accepted: a folder that is new or empty")
    try:
        if folder is None:
            with scratch_folder() as scratch:
                yield scratch
                store.upload(scratch)
        else:
            with _hidden_beside(folder) as hidden:
                yield hidden
    except OSError as error:
        raise OutputError(f"{out}: cannot be written: {error.strerror or error}") from error


@contextmanager
def _hidden_beside(folder: Path) -> Iterator[Path]:
    hidden = folder.with_name(f".{folder.name}.{uuid.uuid4().hex[:12]}.partial")
    hidden.mkdir(parents=True)
    try:
        yield hidden
        for file in hidden.iterdir():
            descriptor = os.open(file, os.O_RDONLY)
            try:
                os.fsync(descriptor)
            finally:
                os.close(descriptor)
        hidden.rename(folder)
    except BaseException:
        shutil.rmtree(hidden, ignore_errors=True)
        raise
