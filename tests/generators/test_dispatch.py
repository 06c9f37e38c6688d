"""What becomes of the samples of lost workers."""

import pytest

from fgf_warp.errors import OutputError
from generators.running.dispatch import run_chunks
from generators.running.messages import Chunk, Ended, Finished, Lost

LOST = "killed by SIGKILL"


class Log:
    def __init__(self):
        self.lines = []

    def write(self, event, **details):
        self.lines.append({"event": event, **details})

    def of(self, event):
        return [line for line in self.lines if line["event"] == event]


class Mortal:
    """An executor whose workers finish samples in order, and die of some of them, some times each."""

    slots, chunks_per_slot = 2, 1

    def __init__(self, deadly=None, commits_before_death=False):
        self.deadly = dict(deadly or {})
        self.commits_before_death = commits_before_death
        self.there = set()
        self.chunks = []
        self.most_at_once = 0

    def submit(self, chunks):
        self.chunks += chunks
        self.most_at_once = max(self.most_at_once, len(self.chunks))

    def wait(self):
        chunk = self.chunks.pop(0)
        messages = []
        for index in chunk.indices:
            if self.deadly.get(index, 0):
                self.deadly[index] -= 1
                if self.commits_before_death:
                    self.there.add(index)
                return [*messages, Lost(chunk, "worker", LOST)]
            self.there.add(index)
            messages.append(Finished(index))
        return [*messages, Ended(chunk)]

    def close(self):
        pass


def dispatch(executor, chunks):
    log, finished = Log(), []
    run_chunks(
        chunks, executor, log, executor.there.__contains__, lambda sample, attempt: finished.append((sample, attempt))
    )
    return log, finished


CHUNKS = [Chunk((0, 1, 2)), Chunk((3, 4, 5)), Chunk((6, 7))]


def test_every_sample_is_told_of_once():
    executor = Mortal()
    log, finished = dispatch(executor, CHUNKS)
    assert [sample.index for sample, _ in finished] == list(range(8))
    assert executor.most_at_once == 2
    assert [(line["first"], line["samples"], line["attempt"]) for line in log.of("chunk")] == [
        (0, 3, 1),
        (3, 3, 1),
        (6, 2, 1),
    ]


def test_what_a_lost_worker_left_is_tried_again():
    log, finished = dispatch(Mortal({4: 1}), CHUNKS)
    assert sorted(sample.index for sample, _ in finished) == list(range(8))
    assert {sample.index: attempt for sample, attempt in finished if attempt > 1} == {4: 2, 5: 2}
    assert log.of("lost") == [{"event": "lost", "worker": "worker", "reason": LOST}]
    assert log.of("retry") == [{"event": "retry", "samples": [4, 5], "attempt": 2, "reason": LOST}]


def test_a_sample_that_was_written_before_the_end_is_not_tried_again():
    log, finished = dispatch(Mortal({4: 1}, commits_before_death=True), CHUNKS)
    assert sorted(sample.index for sample, _ in finished) == list(range(8))
    assert {sample.index: attempt for sample, attempt in finished if attempt > 1} == {5: 2}
    assert log.of("retry")[0]["samples"] == [5]


def test_a_deadly_sample_fails_alone_after_three_attempts():
    log, finished = dispatch(Mortal({3: 99}), CHUNKS)
    failed = [(sample, attempt) for sample, attempt in finished if sample.error]
    assert failed == [(Finished(3, error=f"worker: {LOST}"), 3)]
    assert sorted(sample.index for sample, _ in finished) == list(range(8))
    assert len(log.of("lost")) == 3
    assert [line["attempt"] for line in log.of("retry")] == [2, 3]


def test_what_all_workers_would_meet_ends_the_run():
    class Full(Mortal):
        def wait(self):
            raise OutputError("no space left")

    with pytest.raises(OutputError, match="no space left"):
        dispatch(Full(), CHUNKS)
