"""Files that one process at a time holds."""

from __future__ import annotations

import errno
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from fgf_warp.errors import OutputError

NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP)
"""What a file system says that has no locks."""


class HeldError(Exception):
    """Another process, or another thread, holds the lock."""


@contextmanager
def hold(path: Path, *, wait: bool) -> Iterator[None]:
    """Holds the lock of a file, which ends with its process; the file stays.

    Where the file system has no locks, a warning says so, and nothing is held.

    Args:
        path: of the file; its folder exists.
        wait: until the lock is free.

    Raises:
        HeldError: where it is not free and `wait` is False.
        OutputError: where the file cannot be made.
    """
    lock = FileLock(path)
    try:
        lock.acquire(timeout=-1 if wait else 0)
    except Timeout as error:
        raise HeldError(str(path)) from error
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise OutputError(f"{path}: cannot be locked: {error.strerror or error}") from error
        logging.getLogger(__name__).warning("%s: no file locks here; see that no other process is at work", path)
    try:
        yield
    finally:
        lock.release()
