"""The executor of a Ray cluster, or of this machine where there is none."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from fgf_warp.errors import ConfigError, FgfError
from generators.dataset.store import Store
from generators.interrupts import handlers_kept
from generators.running.messages import Chunk, Ended, Finished, Lost, Message, in_one_line
from generators.running.render import Way, render_chunk

if TYPE_CHECKING:
    from generators.planning.plan import Plan

WAIT_SECONDS = 1.0
"""So that Ctrl-C is heard."""


class OnRay:
    """A task for each chunk, which tells of each sample as it comes. See `Executor`.

    A task asks for one GPU where the plan's device is one, which is then the first of those that it sees. Connects to
    the cluster that RAY_ADDRESS names or that runs on this machine, else starts one of this machine's cores.

    Args:
        plan: to render of.
        store: to render into; all machines of the cluster see its place.
        workers: tasks at once; None takes as many as the cluster has room for.
        way: how each renders, with one core unless it says more.

    Raises:
        ConfigError: where Ray is not installed.
    """

    chunks_per_slot = 8

    def __init__(self, plan: Plan, store: Store, workers: int | None, way: Way) -> None:
        try:
            import ray  # noqa: PLC0415 - an extra
        except ImportError as error:
            raise ConfigError("executor ray: not installed; pip install 'fgf-warp[ray]'") from error
        self._ray = ray
        self._starts = not ray.is_initialized()
        if self._starts:
            with handlers_kept():
                ray.init(logging_level=logging.WARNING, log_to_driver=False)
        self._workers, self._cores = workers, way.threads or 1
        self._gpus = int(plan.settings.device.startswith("cuda"))
        self._arguments = (ray.put(plan), str(store.folder or store.location), Way(self._cores))
        # Ray's own retries would begin a chunk anew without a word of it.
        task = ray.remote(num_cpus=self._cores, num_gpus=self._gpus, max_retries=0)(_render)
        self._start = task.remote
        self._running: dict[Any, Chunk] = {}

    @property
    def slots(self) -> int:
        """As many as asked for, or as the cluster has room for now."""
        if self._workers is not None:
            return self._workers
        there = self._ray.cluster_resources()
        room = there.get("CPU", 0) // self._cores
        return max(1, int(min(room, there.get("GPU", 0)) if self._gpus else room))

    def submit(self, chunks: list[Chunk]) -> None:
        """Starts a task for each."""
        for chunk in chunks:
            self._running[self._start(*self._arguments, chunk)] = chunk

    def wait(self) -> list[Message]:
        """What the tasks tell."""
        ready, _ = self._ray.wait(list(self._running), num_returns=1, timeout=WAIT_SECONDS, fetch_local=False)
        return [message for task in ready for message in self._receive(task)]

    def close(self) -> None:
        """Ends the tasks, and the cluster where it was started here."""
        for task in self._running:
            self._ray.cancel(task, force=True)
        self._running.clear()
        if self._starts:
            self._ray.shutdown()

    def _receive(self, task: Any) -> Iterator[Message]:
        try:
            found = self._ray.get(next(task))
        except StopIteration:
            yield Ended(self._running.pop(task))
            return
        except self._ray.exceptions.RayError as error:
            yield Lost(self._running.pop(task), "a task of Ray", in_one_line(error))
            return
        if isinstance(found, FgfError):
            raise found
        yield found


def _render(plan: Plan, location: str, way: Way, chunk: Chunk) -> Iterator[Finished | FgfError]:
    """The task."""
    from generators.commands.common import start_warp  # noqa: PLC0415 - starts Warp

    start_warp(plan.settings.device)
    try:
        yield from render_chunk(plan, Store(location), chunk, way)
    except FgfError as error:
        yield error
