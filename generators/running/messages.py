"""What those who render and those who have them render tell each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class Chunk:
    """Samples that one worker renders in one go.

    Args:
        indices: of the samples; those of equal scenes follow each other.
        attempt: 1 for the first.
    """

    indices: tuple[int, ...]
    attempt: int = 1


@dataclass(frozen=True)
class Finished:
    """A sample that is there now, or that could not be rendered.

    Args:
        index: of the sample.
        seconds: of its render.
        error: why it could not be rendered.
    """

    index: int
    seconds: float = 0.0
    error: str | None = None


@dataclass(frozen=True)
class Ended:
    """All samples of a chunk are finished."""

    chunk: Chunk


@dataclass(frozen=True)
class Lost:
    """The worker of a chunk did not come to its end.

    Args:
        chunk: that it had.
        worker: its name.
        reason: in one line.
    """

    chunk: Chunk
    worker: str
    reason: str


Message = Finished | Ended | Lost


class Executor(Protocol):
    """Has chunks rendered somewhere."""

    @property
    def slots(self) -> int:
        """Chunks that it takes at once."""

    @property
    def chunks_per_slot(self) -> int:
        """Parts that it wants the work of a slot in: many end together, few cost little between them."""

    def submit(self, chunks: list[Chunk]) -> None:
        """Takes chunks, no more than there are slots for."""

    def wait(self) -> list[Message]:
        """What has happened; waits until something has, or for a short while.

        Returns:
            At times nothing.

        Raises:
            FgfError: that a worker met and that the others would meet too, such as a full disk.
        """

    def close(self) -> None:
        """Ends all workers, whatever they do."""


def in_one_line(error: BaseException) -> str:
    """Kind and first line of an error, as the reason of a `Lost`."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return f"{type(error).__name__}: {lines[0] if lines else ''}"
