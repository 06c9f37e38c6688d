"""The executor of several processes on this machine."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import TYPE_CHECKING

from fgf_warp.errors import FgfError
from generators.dataset.store import Store
from generators.interrupts import unheard
from generators.running.messages import Chunk, Ended, Lost, Message, in_one_line
from generators.running.render import Way, render_chunk

if TYPE_CHECKING:
    from generators.planning.plan import Plan

SPAWN = multiprocessing.get_context("spawn")
"""Warp's threads and CUDA do not survive a fork."""


@dataclass(eq=False)
class _Worker:
    """A process, and the end of the pipe to it.

    Args:
        process: that renders.
        pipe: takes chunks, and gives messages and errors.
        chunk: at work.
    """

    process: BaseProcess
    pipe: Connection
    chunk: Chunk | None = None

    @property
    def name(self) -> str:
        return f"process {self.process.pid}"


class LocalPool:
    """Processes that render a chunk each; one that dies is replaced. See `Executor`.

    Args:
        plan: to render of.
        store: to render into.
        workers: processes, >= 1.
        way: how each renders.
    """

    chunks_per_slot = 8

    def __init__(self, plan: Plan, store: Store, workers: int, way: Way) -> None:
        self.slots = workers
        self._arguments = (plan, store.location, way)
        self._workers: list[_Worker] = []

    def submit(self, chunks: list[Chunk]) -> None:
        """Hands each chunk to an idle process, or to a new one."""
        for chunk in chunks:
            idle = (worker for worker in self._workers if worker.chunk is None and worker.process.is_alive())
            worker = next(idle, None) or self._start()
            worker.chunk = chunk
            # One that dies now is found by `wait`.
            with suppress(OSError):
                worker.pipe.send(chunk)

    def wait(self) -> list[Message]:
        """What the processes tell, or that one of them is gone."""
        ready = wait([worker.pipe for worker in self._workers])
        return [message for worker in list(self._workers) if worker.pipe in ready for message in self._receive(worker)]

    def close(self) -> None:
        """Ends the processes."""
        for worker in self._workers:
            worker.process.kill()
        for worker in self._workers:
            worker.process.join()
            worker.pipe.close()
        self._workers.clear()

    def _start(self) -> _Worker:
        ours, theirs = SPAWN.Pipe()
        process = SPAWN.Process(target=_serve, args=(theirs, *self._arguments), daemon=True)
        with unheard():
            # It is started with the first process, and would let the signals through again.
            resource_tracker.ensure_running()
        with unheard():
            process.start()
        theirs.close()
        worker = _Worker(process, ours)
        self._workers.append(worker)
        return worker

    def _receive(self, worker: _Worker) -> Iterator[Message]:
        try:
            found = worker.pipe.recv()
        except (EOFError, OSError):
            self._retire(worker)
            if worker.chunk:
                yield Lost(worker.chunk, worker.name, _end_of(worker.process))
            return
        if isinstance(found, FgfError):
            raise found
        if isinstance(found, Lost):
            # It has told why it ends; a chunk that it got now would be lost for nothing.
            self._retire(worker)
        elif isinstance(found, Ended):
            worker.chunk = None
        yield found

    def _retire(self, worker: _Worker) -> None:
        """Waits for the end of a process, which gets no further chunk."""
        self._workers.remove(worker)
        worker.process.join()
        worker.pipe.close()


def _end_of(process: BaseProcess) -> str:
    code = process.exitcode or 0
    return f"killed by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"


def _serve(pipe: Connection, plan: Plan, location: str, way: Way) -> None:
    """Renders the chunks that come through the pipe."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    from generators.commands.common import start_warp  # noqa: PLC0415 - starts Warp

    start_warp(plan.settings.device)
    store = Store(location)
    while True:
        chunk = pipe.recv()
        try:
            for finished in render_chunk(plan, store, chunk, way):
                pipe.send(finished)
        except FgfError as error:
            pipe.send(error)
        except Exception as error:
            pipe.send(Lost(chunk, f"process {os.getpid()}", in_one_line(error)))
            raise
        else:
            pipe.send(Ended(chunk))


def _end_with_parent() -> None:
    """So that nothing goes on writing where the run was killed."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)
