"""Hands chunks to an executor, and tries those of a lost worker again."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace

from generators.running.events import EventLog
from generators.running.messages import Chunk, Ended, Executor, Finished, Lost

ATTEMPTS = 3
"""At a sample. The last one is at each sample alone, so that one that ends its worker takes no other with it."""


def run_chunks(
    chunks: Sequence[Chunk],
    executor: Executor,
    log: EventLog,
    is_there: Callable[[int], bool],
    on_finished: Callable[[Finished, int], None],
) -> None:
    """Has all chunks rendered.

    Args:
        chunks: to render.
        executor: that has them rendered.
        log: is told of chunks and lost workers.
        is_there: whether a sample is complete.
        on_finished: called with each sample that is finished, and the number of attempts.

    Raises:
        FgfError: that a worker met and that the others would meet too.
    """
    waiting = deque(chunks)
    left: dict[Chunk, set[int]] = {}

    def finish(finished: Finished) -> None:
        for chunk, indices in left.items():
            if finished.index in indices:
                indices.remove(finished.index)
                on_finished(finished, chunk.attempt)

    while waiting or left:
        taken = [waiting.popleft() for _ in range(min(len(waiting), executor.slots - len(left)))]
        for chunk in taken:
            left[chunk] = set(chunk.indices)
            log.write("chunk", first=chunk.indices[0], samples=len(chunk.indices), attempt=chunk.attempt)
        if taken:
            executor.submit(taken)
        for message in executor.wait():
            if isinstance(message, Finished):
                finish(message)
                continue
            if isinstance(message, Lost):
                log.write("lost", worker=message.worker, reason=message.reason)
            # What was written, though nobody came to tell it.
            for index in [index for index in message.chunk.indices if index in left[message.chunk]]:
                if isinstance(message, Ended) or is_there(index):
                    finish(Finished(index))
            lost = left.pop(message.chunk)
            if isinstance(message, Lost) and lost:
                _try_again(message, lost, waiting, log, on_finished)


def _try_again(
    message: Lost,
    lost: set[int],
    waiting: deque[Chunk],
    log: EventLog,
    on_finished: Callable[[Finished, int], None],
) -> None:
    chunk = replace(message.chunk, indices=tuple(index for index in message.chunk.indices if index in lost))
    if chunk.attempt == ATTEMPTS:
        for index in chunk.indices:
            on_finished(Finished(index, error=f"{message.worker}: {message.reason}"), chunk.attempt)
        return
    attempt = chunk.attempt + 1
    log.write("retry", samples=list(chunk.indices), attempt=attempt, reason=message.reason)
    if attempt < ATTEMPTS:
        waiting.appendleft(Chunk(chunk.indices, attempt))
    else:
        waiting.extend(Chunk((index,), attempt) for index in chunk.indices)
