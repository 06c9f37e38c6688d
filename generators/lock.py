"""One run at a time in one folder."""

from __future__ import annotations

import errno
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fgf_warp.errors import ConfigError, OutputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP)
"""What a file system says that has no locks."""


@contextmanager
def exclusive(path: Path) -> Iterator[None]:
    """Holds the lock file, against other processes and threads.

    A lock ends with its process, and the file stays. Where the system has no such locks, it is the file's existence
    that counts, and a run that was killed leaves it behind.

    Raises:
        ConfigError: where another run holds it.
        OutputError: where it cannot be written.
    """
    if fcntl is None:
        with _existing(path):
            yield
        return
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from error
    try:
        _lock(descriptor, path)
        yield
    finally:
        os.close(descriptor)


def _lock(descriptor: int, path: Path) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise ConfigError(f"{_folder(path)}: another run is under way in this folder; wait for its end") from error
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise OutputError(f"{path}: cannot be locked: {error.strerror}") from error
        logging.getLogger(__name__).warning("%s: no file locks here; see that no other run uses the folder", path)


@contextmanager
def _existing(path: Path) -> Iterator[None]:
    try:
        os.close(os.open(path, os.O_CREAT | os.O_EXCL))
    except FileExistsError as error:
        raise ConfigError(
            f"{_folder(path)}: another run is under way in this folder; wait for its end, or delete {path} if it "
            "was killed"
        ) from error
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from error
    try:
        yield
    finally:
        path.unlink(missing_ok=True)


def _folder(path: Path) -> Path:
    return path.parent.parent
