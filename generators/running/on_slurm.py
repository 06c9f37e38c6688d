"""The executor of a cluster that Slurm runs: an array of jobs, by way of submitit."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from fgf_warp.errors import ConfigError, FgfError
from generators.dataset import layout
from generators.dataset.store import Store
from generators.running.messages import Chunk, Ended, Finished, Lost, Message, in_one_line
from generators.running.render import Way, render_chunk

if TYPE_CHECKING:
    from generators.planning.plan import Plan

LOGS = f"{layout.RUN}/slurm"
"""What the jobs are given and what they print."""
WAIT_SECONDS = 3.0
"""Between two looks at the jobs."""


class OnSlurm:
    """A job for each chunk, all of them in one array. See `Executor`.

    What runs this asks for the jobs, watches them and tries those that are lost again, so it stays until their end.
    A job that Slurm takes off its machine is put into the queue again, and goes on where it was.

    Args:
        plan: to render of.
        store: to render into; a folder that all machines see.
        workers: jobs at once, >= 1.
        way: how each renders, with one core unless it says more.
        parameters: of sbatch, such as ``partition`` or ``time``.
        cluster: ``slurm``; ``local`` or ``debug`` run the jobs here, for a trial.

    Raises:
        ConfigError: where submitit or Slurm is not there, for a parameter that it does not know, or where the dataset
            is no folder.
    """

    chunks_per_slot = 1

    def __init__(
        self,
        plan: Plan,
        store: Store,
        workers: int,
        way: Way,
        parameters: Mapping[str, Any],
        cluster: str = "slurm",
    ) -> None:
        try:
            import submitit  # noqa: PLC0415 - an extra
        except ImportError as error:
            raise ConfigError("executor slurm: not installed; pip install 'fgf-warp[slurm]'") from error
        if store.folder is None:
            raise ConfigError(f"executor slurm: {store.location}: accepted: a folder that all machines see")
        self.slots = workers
        self._plan, self._store, self._way = plan, store, Way(way.threads or 1)
        try:
            self._executor = submitit.AutoExecutor(store.folder / LOGS, cluster=cluster)
            self._executor.update_parameters(
                name=f"fgf-{plan.meta.name}",
                cpus_per_task=way.threads or 1,
                gpus_per_node=int(plan.settings.device.startswith("cuda")),
                **{f"slurm_{name}": value for name, value in parameters.items()},
            )
        except (RuntimeError, NameError, ValueError) as error:
            raise ConfigError(f"executor slurm: {error}") from error
        self._jobs: dict[Chunk, Any] = {}
        self._told: set[int] = set()

    def submit(self, chunks: list[Chunk]) -> None:
        """Puts the chunks into the queue, as one array."""
        with self._executor.batch():
            jobs = [
                self._executor.submit(SlurmTask(self._plan, str(self._store.folder), self._way, chunk))
                for chunk in chunks
            ]
        self._jobs |= dict(zip(chunks, jobs, strict=True))

    def wait(self) -> list[Message]:
        """Which samples have appeared, and which jobs have come to their end."""
        ended = [chunk for chunk, job in self._jobs.items() if job.done()]
        if not ended:
            time.sleep(WAIT_SECONDS)
        messages = self._appeared()
        for chunk in ended:
            messages += self._end(chunk, self._jobs.pop(chunk))
        return messages

    def close(self) -> None:
        """Cancels the jobs."""
        for job in self._jobs.values():
            job.cancel()
        self._jobs.clear()

    def _appeared(self) -> list[Message]:
        awaited = [index for chunk in self._jobs for index in chunk.indices if index not in self._told]
        appeared = _complete(self._plan, self._store, awaited)
        self._told.update(appeared)
        return [Finished(index) for index in appeared]

    def _end(self, chunk: Chunk, job: Any) -> list[Message]:
        error = job.exception()
        if error is not None:
            return [Lost(chunk, f"job {job.job_id}", in_one_line(error))]
        found = job.result()
        if isinstance(found, FgfError):
            raise found
        return [*(failed for failed in found if failed.index not in self._told), Ended(chunk)]


class SlurmTask:
    """What a job does; it goes through pickle.

    Args:
        plan: to render of.
        location: of the dataset.
        way: how to render.
        chunk: to render.
    """

    def __init__(self, plan: Plan, location: str, way: Way, chunk: Chunk) -> None:
        self._plan, self._location, self._way, self._chunk = plan, location, way, chunk

    def __call__(self) -> list[Finished] | FgfError:
        """The finished samples."""
        from generators.commands.common import start_warp  # noqa: PLC0415 - starts Warp

        start_warp(self._plan.settings.device)
        store = Store(self._location)
        there = set(_complete(self._plan, store, self._chunk.indices))
        left = tuple(index for index in self._chunk.indices if index not in there)
        try:
            return list(render_chunk(self._plan, store, replace(self._chunk, indices=left), self._way))
        except FgfError as error:
            return error

    def checkpoint(self, *_: Any) -> Any:
        """What to put into the queue where Slurm takes the job off its machine."""
        import submitit  # noqa: PLC0415 - an extra

        return submitit.helpers.DelayedSubmission(self)


def _complete(plan: Plan, store: Store, indices: Iterable[int]) -> list[int]:
    """Those of the samples that are there.

    A look at three folders tells which ones have a folder, so that not each sample costs a look over the network.
    """
    assert store.folder
    listed = {path.name for split in layout.SPLITS for path in (store.folder / layout.DATA / split).glob("[0-9]*")}
    samples = (plan.samples[index] for index in indices)
    return [
        sample.index
        for sample in samples
        if sample.name in listed and store.exists(f"{layout.sample_folder(sample.split, sample.index)}/{layout.RECORD}")
    ]
