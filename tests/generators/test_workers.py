"""Runs in several processes, and runs that are killed: real renders, whose files must not tell of it."""

import os
import random
import signal
import subprocess
import sys
import time
from functools import partial

import pytest

from fgf_warp.errors import ConfigError, OutputError
from generators.dataset import layout
from generators.dataset.reader import Dataset
from generators.dataset.store import Store
from generators.planning.plan import Plan
from generators.running import run
from generators.running.local_pool import LocalPool
from generators.running.messages import Chunk
from generators.running.on_ray import OnRay
from generators.running.on_slurm import OnSlurm, SlurmTask
from generators.running.run import Workers, generate
from generators.running.shard import Shard
from tests.generators.small_plan import TEXT, content, labels, small_plan, write_config
from tests.generators.test_run import told

DRAWS = "draws=8"
"""48 samples."""
FGF = [sys.executable, "-c", "from generators.entry import main; main()"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The dataset of an uninterrupted run in one process."""
    folder = tmp_path_factory.mktemp("whole")
    generate(small_plan(folder, DRAWS), TEXT, folder / "data")
    return folder / "data"


@pytest.fixture
def plan(tmp_path):
    return small_plan(tmp_path, DRAWS)


@pytest.fixture
def data(tmp_path):
    return tmp_path / "data"


def assert_same(location, whole):
    assert content(location) == content(whole)
    assert labels(location).equals(labels(whole))
    assert not list(location.rglob("*.partial*"))


def kill_a_worker(location, done):
    """Kills the process that rendered the third sample; to be told of the progress."""
    killed = []

    def kill(progress):
        if progress.done == done and not killed:
            dataset = Dataset(location)
            killed.append(int(dataset.timing(dataset.complete()[0]).worker.rpartition(":")[2]))
            assert killed[0] != os.getpid()
            os.kill(killed[0], signal.SIGKILL)

    return kill, killed


def test_a_killed_process_is_replaced_and_its_samples_are_rendered_elsewhere(data, plan, whole, monkeypatch):
    monkeypatch.setattr(LocalPool, "chunks_per_slot", 1)
    kill, killed = kill_a_worker(data, 3)
    report = generate(plan, TEXT, data, workers=Workers(count=2), on_progress=kill)
    assert report.is_complete
    assert_same(data, whole)
    (lost,), (retry,) = told(data, "lost"), told(data, "retry")
    assert (lost["worker"], lost["reason"]) == (f"process {killed[0]}", "killed by SIGKILL")
    assert (retry["attempt"], retry["reason"]) == (2, "killed by SIGKILL")
    again = {index for index in range(48) if Dataset(data).timing(index).attempts == 2}
    # One may have been written and not told of.
    assert again
    assert again <= set(retry["samples"])


def wait_until(condition, seconds=120.0):
    started = time.monotonic()
    while not condition():
        assert time.monotonic() - started < seconds
        time.sleep(0.01)


def start(config, location, *options):
    arguments = [*FGF, "generate", str(config), "--set", DRAWS, "--out", str(location), *options]
    return subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def complete_count(location):
    return len(list((location / "data").glob("*/[0-9]*")))


def children_of(pid):
    found = subprocess.run(["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True, check=False)
    return [int(line) for line in found.stdout.split()]


def is_alive(pid):
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True, check=False).stdout
    return bool(state.strip()) and not state.startswith("Z")


def kill_and_resume(folder, whole, samples_before, options, resumes):
    """Kills a run of the command line once so many samples are there, and goes on with it in other ways."""
    plan, data = small_plan(folder, DRAWS), folder / "data"
    process = start(write_config(folder), data, *options)
    try:
        wait_until(lambda: complete_count(data) >= samples_before or process.poll() is not None)
        workers = children_of(process.pid)
    finally:
        process.kill()
        process.wait()
    wait_until(lambda: not any(is_alive(worker) for worker in workers))
    for workers, shard in resumes:
        assert generate(plan, TEXT, data, workers=Workers(count=workers), shard=shard).is_complete
    assert_same(data, whole)


def test_a_run_that_is_killed_goes_on_in_another_way(tmp_path, whole):
    kill_and_resume(tmp_path, whole, 5, [], [(1, Shard(1, 2)), (1, Shard(0, 2))])


WAYS = [[(1, Shard())], [(2, Shard())], [(1, Shard(0, 3)), (2, Shard(2, 3)), (1, Shard(1, 3))]]


@pytest.mark.slow
@pytest.mark.parametrize("trial", range(10))
def test_a_run_that_is_killed_at_a_random_moment_goes_on(tmp_path, whole, trial):
    """Before the first sample, in the midst of them, and while they are published."""
    rng = random.Random(trial)
    options = rng.choice([[], ["--workers", "2"], ["--workers", "3"], ["--shard", "1/2"]])
    kill_and_resume(tmp_path, whole, rng.randint(0, 48), options, WAYS[trial % 3])


@pytest.mark.slow
def test_of_two_runs_at_once_one_is_refused(tmp_path, whole):
    processes = [start(write_config(tmp_path), tmp_path / "data") for _ in range(2)]
    outcomes = [(process.communicate()[1], process.returncode) for process in processes]
    codes = sorted(code for _, code in outcomes)
    assert codes == [0, 2]
    assert any("another run is under way in this folder, on shard 0/1" in errors for errors, _ in outcomes)
    assert_same(tmp_path / "data", whole)


class DeadlyPlan(Plan):
    """Whose sample 4 ends the process that renders it."""

    def media_of(self, sample):
        if sample.index == 4:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().media_of(sample)


@pytest.mark.slow
def test_a_sample_that_ends_its_worker_fails_alone(tmp_path, data):
    plan = small_plan(tmp_path)
    report = generate(DeadlyPlan(**vars(plan)), TEXT, data, workers=Workers(count=2))
    ((index, reason),) = report.failures
    assert index == 4
    assert reason.endswith("killed by SIGKILL")
    assert report.finished == 5
    assert Dataset(data).failures()[4].attempts == 3


class BrokenPlan(Plan):
    """Whose sample 4 meets an error that nobody thought of."""

    def media_of(self, sample):
        if sample.index == 4:
            raise RuntimeError("out of memory\non the device")
        return super().media_of(sample)


@pytest.mark.slow
def test_a_sample_with_an_unknown_error_fails_alone(tmp_path, data):
    """A worker that ends after its error gets no other sample, which would be lost with it."""
    plan = small_plan(tmp_path)
    report = generate(BrokenPlan(**vars(plan)), TEXT, data, workers=Workers(count=2))
    ((index, reason),) = report.failures
    assert (index, report.finished) == (4, 5)
    assert reason.endswith("RuntimeError: out of memory")
    assert {line["reason"] for line in told(data, "lost")} == {"RuntimeError: out of memory"}


class FullDiskPlan(Plan):
    """Whose sample 4 meets a full disk."""

    def media_of(self, sample):
        if sample.index == 4:
            raise OutputError("no space left")
        return super().media_of(sample)


@pytest.mark.slow
def test_what_a_process_finds_wrong_ends_the_run(tmp_path, data):
    plan = FullDiskPlan(**vars(small_plan(tmp_path)))
    with pytest.raises(OutputError, match="no space left"):
        generate(plan, TEXT, data, workers=Workers(count=2))
    assert generate(small_plan(tmp_path), TEXT, data).is_complete


@pytest.mark.slow
def test_a_killed_worker_of_ray_is_replaced(data, plan, whole, monkeypatch):
    monkeypatch.setattr(OnRay, "chunks_per_slot", 1)
    kill, killed = kill_a_worker(data, 3)
    report = generate(plan, TEXT, data, workers=Workers("ray", 2), on_progress=kill)
    assert report.is_complete
    assert_same(data, whole)
    assert killed
    (lost,), (retry,) = told(data, "lost"), told(data, "retry")
    assert "died" in lost["reason"] or "Crashed" in lost["reason"]
    assert retry["reason"] == lost["reason"]
    assert {Dataset(data).timing(index).attempts for index in range(48)} == {1, 2}


@pytest.mark.slow
def test_an_array_of_slurm_makes_the_same_dataset(data, plan, whole, monkeypatch):
    monkeypatch.setattr(run, "OnSlurm", partial(OnSlurm, cluster="local"))
    report = generate(plan, TEXT, data, workers=Workers("slurm", 2))
    assert report.is_complete
    assert_same(data, whole)
    assert len(list((data / layout.RUN / "slurm").glob("*_submitted.pkl"))) == 2


@pytest.mark.slow
def test_a_lost_job_of_slurm_is_submitted_again(tmp_path, data, monkeypatch):
    monkeypatch.setattr(run, "OnSlurm", partial(OnSlurm, cluster="local"))
    plan = small_plan(tmp_path)
    report = generate(DeadlyPlan(**vars(plan)), TEXT, data, workers=Workers("slurm", 2))
    assert [index for index, _ in report.failures] == [4]
    assert report.finished == 5
    assert [line["attempt"] for line in told(data, "retry")] == [2, 3]


def test_a_job_of_slurm_renders_what_has_a_folder_and_no_record(tmp_path, data, fake_renderer):
    plan = small_plan(tmp_path)
    generate(plan, TEXT, data)
    fake_renderer.clear()
    (data / layout.sample_folder("train", 3) / layout.RECORD).unlink()
    finished = SlurmTask(plan, str(data), run.Way(1), Chunk((2, 3)))()
    assert [sample.index for sample in finished] == [3]
    assert fake_renderer == [plan.samples[3].seed]


def test_slurm_is_refused_where_it_is_not(data, plan):
    with pytest.raises(ConfigError, match="are you indeed on a slurm cluster"):
        generate(plan, TEXT, data, workers=Workers("slurm", 2))
    with pytest.raises(ConfigError, match="accepted: a folder that all machines see"):
        OnSlurm(plan, Store("memory://somewhere"), 1, run.Way(), {})
