"""The executor of one process: this one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from generators.dataset.store import Store
from generators.running.messages import Chunk, Ended, Message
from generators.running.render import Share, Way, render_chunk

if TYPE_CHECKING:
    from generators.planning.plan import Plan


class InProcess:
    """Renders one chunk at a time, with all threads; see `Executor`.

    Args:
        plan: to render of.
        store: to render into.
        way: how to render.
        share: called with the samples of the chunk whose render is done, the begun ones by their share.
    """

    slots, chunks_per_slot = 1, 1

    def __init__(self, plan: Plan, store: Store, way: Way, share: Share | None = None) -> None:
        self._plan, self._store, self._way, self._share = plan, store, way, share
        self._rendering: Iterator[Message] = iter(())

    def submit(self, chunks: list[Chunk]) -> None:
        """Takes one chunk."""
        (chunk,) = chunks
        self._rendering = self._render(chunk)

    def wait(self) -> list[Message]:
        """Renders on, up to the next sample."""
        return [next(self._rendering)]

    def close(self) -> None:
        """Waits for the samples that are being written."""
        close = getattr(self._rendering, "close", None)
        if close:
            close()

    def _render(self, chunk: Chunk) -> Iterator[Message]:
        yield from render_chunk(self._plan, self._store, chunk, self._way, self._share)
        yield Ended(chunk)
