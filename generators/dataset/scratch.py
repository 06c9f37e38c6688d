"""Folders for files that live only while something is made of them, of which a killed program leaves none for long."""

from __future__ import annotations

import shutil
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fgf_warp.errors import OutputError
from fgf_warp.locks import HeldError, hold

PREFIX = "fgf-scratch-"
"""Of the names in the system's temporary folder."""
_SWEPT: set[Path] = set()
"""Places that this process has looked at."""


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A folder in the system's temporary folder, gone when the block ends.

    A lock beside it says that its program lives. Folders whose lock is free were left by a killed one, and the first
    use in a process removes them.

    Yields:
        The folder, empty.

    Raises:
        OutputError: where it cannot be made.
    """
    try:
        place = Path(tempfile.gettempdir())
    except FileNotFoundError as error:
        raise OutputError("there is no folder for temporary files that can be written; TMPDIR names one") from error
    folder = place / f"{PREFIX}{uuid.uuid4().hex}"
    lock = _lock_of(folder)
    # The lock first: who sweeps finds no folder without one.
    with hold(lock, wait=True):
        _sweep(place, lock)
        try:
            folder.mkdir(mode=0o700)
        except OSError as error:
            raise OutputError(f"{folder}: cannot be made: {error.strerror or error}") from error
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            lock.unlink(missing_ok=True)


def _sweep(place: Path, mine: Path) -> None:
    """Removes what killed programs left; what others own or hold stays."""
    if place in _SWEPT:
        return
    _SWEPT.add(place)
    try:
        with hold(mine, wait=False):
            return  # there are no locks here that say who lives
    except HeldError:
        pass
    for lock in place.glob(f"{PREFIX}*.lock"):
        with suppress(HeldError, OutputError, OSError), hold(lock, wait=False):
            shutil.rmtree(lock.with_suffix(""), ignore_errors=True)
            lock.unlink(missing_ok=True)


def _lock_of(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}.lock")
