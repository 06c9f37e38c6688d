"""What happens in a run, as lines of JSON."""

from __future__ import annotations

import json
import os
import time
from contextlib import suppress
from datetime import UTC, datetime
from types import TracebackType
from typing import Any, BinaryIO

from fgf_warp.errors import OutputError
from generators.dataset.store import Store

LONGEST_LINE = 2**20
"""[byte]"""
UPLOAD_SECONDS = 10.0
"""Between two uploads to an object store, which has no appending."""


class EventLog:
    """Appends to a file of a dataset; every line is whole, also where a run is killed.

    Args:
        store: of the dataset.
        name: of the file.

    Raises:
        OutputError: where it cannot be written.
    """

    def __init__(self, store: Store, name: str) -> None:
        self._store, self._name = store, name
        self._file: BinaryIO | None = None
        self._content = b""
        self._uploaded = time.monotonic()
        if store.folder is None:
            self._content = store.read(name) if store.exists(name) else b""
            return
        path = store.folder / name
        store.make_folder(name.rpartition("/")[0])
        store.clear_way(name, even_links=True)
        try:
            self._file = path.open("a+b", buffering=0)
            self._drop_torn_line()
        except OSError as error:
            raise self._error(error) from error

    def __enter__(self) -> EventLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file:
            self._file.close()
            return
        # What ended the run is worth telling too, and more than that it could not be told.
        with suppress(*() if error is None else (OutputError,)):
            self._upload()

    def write(self, event: str, **details: Any) -> None:
        """Appends an event.

        Args:
            event: ``start``, ``chunk``, ``sample``, ``lost``, ``retry`` or ``end``.
            details: JSON-ready.

        Raises:
            OutputError: where it cannot be written.
        """
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        line = (json.dumps({"time": now, "event": event, **details}, allow_nan=False) + "\n").encode()
        if self._file is None:
            self._content += line
            if time.monotonic() - self._uploaded > UPLOAD_SECONDS:
                self._upload()
            return
        try:
            self._file.write(line)
        except OSError as error:
            raise self._error(error) from error

    def _drop_torn_line(self) -> None:
        """What a machine that stopped left of the last line."""
        assert self._file
        end = self._file.seek(0, os.SEEK_END)
        start = self._file.seek(max(0, end - LONGEST_LINE))
        tail = self._file.read()
        if not tail or tail.endswith(b"\n"):
            return
        if b"\n" in tail or start == 0:
            self._file.truncate(start + tail.rfind(b"\n") + 1)
        else:
            self._file.write(b"\n")  # what is so long is no line of ours

    def _upload(self) -> None:
        self._store.write(self._name, self._content)
        self._uploaded = time.monotonic()

    def _error(self, error: OSError) -> OutputError:
        return OutputError(f"{self._store.location}/{self._name}: cannot be written: {error.strerror or error}")
