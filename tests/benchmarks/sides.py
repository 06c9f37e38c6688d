"""One process per renderer, alive through the whole benchmark and asked in turn, so that both meet the same machine."""

from __future__ import annotations

import multiprocessing
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

STOP = "stop"


class SideError(RuntimeError):
    """What went wrong in a renderer's process, with its traceback."""


class Side:
    """The parent's end of a renderer in a process of its own; methods called on it run there.

    Args:
        name: for messages.
        renderer: makes the renderer, in the process; picklable.
        arguments: of `renderer`.
    """

    def __init__(self, name: str, renderer: Callable[..., Any], *arguments: Any) -> None:
        self.name = name
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, renderer, arguments), daemon=True)
        self._process.start()
        theirs.close()
        self._receive()

    def __getattr__(self, method: str) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            self._connection.send((method, arguments, named))
            return self._receive()

        return call

    def close(self) -> None:
        """Ends the process."""
        if self._process.is_alive():
            self._connection.send((STOP, (), {}))
            self._process.join()

    def _receive(self) -> Any:
        try:
            fine, value = self._connection.recv()
        except EOFError as error:
            self._process.join()
            raise SideError(f"{self.name}: the process ended with exit code {self._process.exitcode}") from error
        if not fine:
            raise SideError(f"{self.name}: {value}")
        return value


def _serve(connection: Connection, renderer: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    """Makes the renderer, then answers calls until it is told to stop or the parent is gone."""
    try:
        served = renderer(*arguments)
    except Exception:
        connection.send((False, traceback.format_exc()))
        return
    connection.send((True, None))
    while True:
        try:
            method, positional, named = connection.recv()
        except EOFError:
            return
        if method == STOP:
            return
        try:
            connection.send((True, getattr(served, method)(*positional, **named)))
        except Exception:
            connection.send((False, traceback.format_exc()))
