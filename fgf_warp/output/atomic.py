"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fgf_warp.errors import OutputError

PARTIAL_GLOB = f".*.{'[0-9a-f]' * 12}.partial*"
"""Matches the hidden names of files that are being written, or were when the machine stopped, and no one else's."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A hidden name beside `path` to write to, which takes the place of `path` when the block has ended well.

    Args:
        path: the file to write; an older one of that name stays until the new one is on the disk.

    Yields:
        The name to write to. It ends like `path`, since image libraries choose the format by it.

    Raises:
        OutputError: where the file cannot be written. The hidden file is removed, `path` is as before.
    """
    temporary = path.with_name(f".{path.stem}.{uuid.uuid4().hex[:12]}.partial{path.suffix}")
    try:
        yield temporary
        flush_to_disk(temporary)
        temporary.replace(path)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error
        raise


def write_bytes(path: Path, content: bytes) -> None:
    """Writes a small file whole or not at all.

    Raises:
        OutputError: where it cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def sweep_partial(folder: Path) -> None:
    """Removes what an interrupted machine left half-written in a folder.

    Raises:
        OutputError: where a leftover cannot be removed.
    """
    for leftover in folder.glob(PARTIAL_GLOB):
        try:
            leftover.unlink()
        except OSError as error:
            raise OutputError(f"{leftover}: cannot be removed: {error.strerror}") from error


def check_writable(path: Path) -> None:
    """Finds out before hours of rendering whether `path` can be written at the end of them.

    Args:
        path: a file that need not exist, in a folder that must.

    Raises:
        OutputError: where the folder is missing or not writable, or `path` is itself a folder.
    """
    probe = path.with_name(f".{path.stem}.{uuid.uuid4().hex[:12]}.partial")
    try:
        if path.is_dir():
            raise OutputError(f"{path}: is a folder; accepted: the name of a file")
        if not path.parent.is_dir():
            raise OutputError(f"{path}: there is no folder {path.parent}")
        # Only creating a file tells: permission bits say nothing to root or about read-only mounts.
        probe.touch(exist_ok=False)
        probe.unlink()
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from error


def make_folder(folder: Path, files: Iterable[str]) -> None:
    """Makes a folder for files that come later, so that it is known before the work begins whether they can be written.

    Args:
        folder: may be there already.
        files: names of what is to be written into it.

    Raises:
        OutputError: where the folder cannot be made, or a file cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made: {error.strerror}") from error
    for name in files:
        check_writable(folder / name)


def flush_to_disk(path: Path) -> None:
    """Returns when a file's content, or a folder's list of names, is on the disk."""
    descriptor = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
