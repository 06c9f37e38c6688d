"""Runs in one process; most of them without rendering."""

import errno
import json
import os
import shutil
import signal
import subprocess
import threading
import time
import uuid
import weakref
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
from typer.testing import CliRunner

import fgf_warp.renderer
from fgf_warp.errors import ConfigError, CorruptFileError, NumericalError, OutputError
from fgf_warp.locks import HeldError, hold
from fgf_warp.output.exr import read_exr
from generators.checking.verify import verify_dataset
from generators.cli import app
from generators.dataset import layout, store
from generators.dataset.plan_table import read_plan, write_plan
from generators.dataset.reader import Dataset
from generators.dataset.record import Failure, encode
from generators.dataset.store import GoneError, Store
from generators.planning.document import load_config
from generators.planning.plan import build_plan
from generators.running import render
from generators.running.messages import Chunk
from generators.running.render import render_chunk
from generators.running.run import Progress, Workers, generate, render_again
from generators.running.shard import Shard, samples_of
from tests.generators.small_plan import TEXT, content, labels, small_plan, write_config
from tests.renders import made_up_render


@pytest.fixture
def plan(tmp_path):
    """Of six samples."""
    return small_plan(tmp_path)


@pytest.fixture
def data(tmp_path):
    return tmp_path / "data"


def events(location, suffix=""):
    lines = Store(location).read(layout.events(suffix)).decode().splitlines()
    return [json.loads(line) for line in lines]


def told(location, event, suffix=""):
    return [line for line in events(location, suffix) if line["event"] == event]


def snapshot(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_run_makes_all_that_is_promised(data, plan, fake_renderer):
    report = generate(plan, TEXT, data)
    assert (report.total, report.finished, report.reused, report.failures) == (6, 6, 0, ())
    assert report.is_complete
    assert not report.interrupted
    assert sorted(path.name for path in data.iterdir()) == sorted(
        [
            layout.CARD,
            layout.CONFIG,
            layout.CONTACT_SHEET,
            layout.CROISSANT,
            layout.INDEX,
            layout.PLAN,
            "data",
            "run",
            "scene",
        ]
    )
    dataset = Dataset(data)
    assert dataset.complete() == list(range(6))
    assert dataset.store.read(layout.PLAN) == plan.to_bytes()
    assert dataset.store.read(layout.CONFIG) == TEXT
    assert sorted(fake_renderer) == sorted(sample.seed for sample in plan.samples)


def test_records_say_what_was_reached(data, plan, fake_renderer):
    generate(plan, TEXT, data)
    for sample in plan.samples:
        record, timing = Dataset(data).record(sample.index), Dataset(data).timing(sample.index)
        expected = made_up_render(replace(plan.settings, seed=sample.seed))
        assert (record.index, record.plan, record.spp) == (sample.index, plan.meta.digest, 4)
        assert record.standard_error == expected.relative_standard_error
        assert record.statistics["luminance_mean"] > 0
        assert (timing.render_seconds, timing.attempts) == (0.25, 1)
        folder = data / layout.sample_folder("train", sample.index)
        assert set(record.files) == {path.name for path in folder.iterdir()} - {layout.RECORD, layout.TIMING}
        channels, header = read_exr(folder / layout.RADIANCE)
        assert "variance.R" in channels
        assert header["dataset"] == {
            "name": "small",
            "plan": plan.meta.digest,
            "index": sample.index,
            "swept": dict(sample.parameters),
        }


def test_targets_are_computed_where_they_are_asked_for(tmp_path, data, fake_renderer):
    plan = small_plan(tmp_path, "targets={mean_free_path: true, transmittance: [0, 1]}")
    generate(plan, TEXT, data)
    targets = Dataset(data).record(3).targets
    assert targets["mean_free_path"] > 1 / 3
    assert targets["transmittance"][0] == 1.0


def test_a_finished_dataset_is_not_rendered_again(data, plan, fake_renderer):
    generate(plan, TEXT, data)
    fake_renderer.clear()
    assert generate(plan, TEXT, data).reused == 6
    assert fake_renderer == []


def test_a_lost_sample_is_rendered_again(data, plan, fake_renderer):
    generate(plan, TEXT, data)
    fake_renderer.clear()
    shutil.rmtree(data / layout.sample_folder("train", 3))
    assert generate(plan, TEXT, data).reused == 5
    assert fake_renderer == [plan.samples[3].seed]


@pytest.mark.parametrize("kept", [layout.RADIANCE, layout.TIMING])
def test_a_sample_without_a_record_is_rendered_again(tmp_path, data, plan, fake_renderer, kept):
    """As somebody who deletes files leaves it."""
    generate(plan, TEXT, data)
    before = content(data)
    folder = data / layout.sample_folder("train", 3)
    for path in folder.iterdir():
        if path.name != kept:
            path.unlink()
    assert generate(plan, TEXT, data).is_complete
    assert content(data) == before
    assert not list(data.rglob("*.partial*"))


def test_a_repair_that_meets_a_full_disk_loses_nothing(data, plan, fake_renderer, monkeypatch):
    generate(plan, TEXT, data)
    before = snapshot(data / "data")

    def sync(folder):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(store, "flush_to_disk", sync)
    with pytest.raises(OutputError, match="No space left on device"):
        list(render_again(plan, Store(data), [2], {}))
    assert snapshot(data / "data") == before


def test_output_goes_to_an_object_store(data, plan, fake_renderer):
    url = f"memory://{uuid.uuid4().hex}"
    generate(plan, TEXT, url, shard=Shard(0, 2))
    report = generate(plan, TEXT, url)
    assert (report.reused, report.is_complete) == (3, True)
    generate(plan, TEXT, data)
    assert labels(url).equals(labels(data))
    there = {name: Store(url).read(name) for name in Store(url).sizes()}
    assert {name: there[name] for name in content(data)} == content(data)
    assert [line["event"] for line in events(url)] == ["start", "chunk", "sample", "sample", "sample", "end"]
    # In the memory of this process.
    with pytest.raises(ConfigError, match="is seen by one process alone"):
        generate(plan, TEXT, f"memory://{uuid.uuid4().hex}", workers=Workers(count=2))


def test_events_tell_the_course_of_a_run(data, plan, fake_renderer):
    generate(plan, TEXT, data)
    (start,), (end,), samples = told(data, "start"), told(data, "end"), told(data, "sample")
    assert (start["plan"], start["samples"], start["reused"]) == (plan.meta.digest, 6, 0)
    assert [(line["done"], line["failed"]) for line in samples] == [(count, 0) for count in range(1, 7)]
    assert {line["index"] for line in samples} == set(range(6))
    assert all(line["rate"] > 0 and line["left"] >= 0 and line["status"] == "complete" for line in samples)
    assert (end["complete"], end["failed"], end["interrupted"]) == (6, 0, False)
    # Of a second run behind those of the first, and behind what a power cut left of a line.
    with (data / layout.events()).open("a") as file:
        file.write('{"event": "sam')
    generate(plan, TEXT, data)
    assert [line["reused"] for line in told(data, "start")] == [0, 6]


def test_progress_counts_earlier_samples_and_failures(data, plan, fake_renderer, monkeypatch):
    generate(plan, TEXT, data, shard=Shard(0, 2))
    monkeypatch.setattr(fgf_warp.renderer, "develop", fail)
    calls = []
    generate(plan, TEXT, data, on_progress=calls.append)
    assert calls[0] == Progress(3, 6)
    assert calls[-1] == Progress(6, 6, 3)


def fail(*_):
    raise NumericalError("3 samples are not finite")


def test_progress_counts_parts_of_samples(data, plan, fake_renderer, monkeypatch):
    calls = []

    def advance(model, state, samples, progress, images):
        progress(1, 4)
        progress(3, 4)
        yield from images

    monkeypatch.setattr(fgf_warp.renderer, "advance", advance)
    generate(plan, TEXT, data, on_progress=lambda progress: calls.append(progress.done))
    assert calls[:3] == [0, 1.5, 4.5]


def test_a_sample_that_is_not_finite_is_noted_and_the_others_go_on(data, plan, fake_renderer, monkeypatch):
    develop = fgf_warp.renderer.develop

    def fail_once(model, state, image):
        if model.variants[image].seed == plan.samples[1].seed:
            fail()
        return develop(model, state, image)

    monkeypatch.setattr(fgf_warp.renderer, "develop", fail_once)
    report = generate(plan, TEXT, data)
    assert report.failures == ((1, "3 samples are not finite"),)
    assert (report.finished, report.is_complete) == (5, False)
    assert Dataset(data).failures()[1].reason == "3 samples are not finite"
    assert labels(data)["status"].to_pylist() == ["complete", "failed", *["complete"] * 4]

    monkeypatch.setattr(fgf_warp.renderer, "develop", develop)
    assert generate(plan, TEXT, data).is_complete
    assert Dataset(data).failures() == {}


def test_paths_that_were_cut_are_counted_in_this_run_and_the_next(data, plan, fake_renderer, monkeypatch):
    develop = fgf_warp.renderer.develop
    cut = {plan.samples[1].seed: 5, plan.samples[4].seed: 2}

    def cut_some(model, state, image):
        return replace(develop(model, state, image), truncated_count=cut.get(model.variants[image].seed, 0))

    monkeypatch.setattr(fgf_warp.renderer, "develop", cut_some)
    for _ in range(2):
        report = generate(plan, TEXT, data)
        assert (report.truncated_paths, report.truncated_samples) == (7, 2)


def test_shards_are_of_equal_size_and_make_the_whole(tmp_path, data, fake_renderer):
    plan = small_plan(tmp_path, "axes={H: [-0.5, -0.25, 0.3], L: [100], g: [-0.5, 0, 0.5, 0.7], S_w: [0.1, 1]}")
    parts = [samples_of(plan, Shard(index, 4)) for index in range(4)]
    assert sorted(index for part in parts for index in part) == list(range(24))
    for part in parts:
        kinds = [plan.samples[index].medium.line_law.kind for index in part]
        # Those of one kernel after each other, and of each as many.
        assert kinds == ["exponential"] * 2 + ["fractional"] * 2 + ["power"] * 2
    # The last axis is in step with the shards' number, and still in none of them alone.
    assert all(len({plan.samples[index].parameters["S_w"] for index in part}) == 2 for part in parts)
    whole = tmp_path / "whole"
    generate(plan, TEXT, whole)
    for index in (2, 0, 3, 1):
        report = generate(plan, TEXT, data, shard=Shard(index, 4))
        assert (report.total, report.is_complete) == (6, True)
    assert content(data) == content(whole)
    assert labels(data).equals(labels(whole))
    assert len(told(data, "sample", "-3-of-4")) == 6


@pytest.mark.parametrize("text", ["4/4", "1", "-1/2", "0/0", "a/b", "1/2/3"])
def test_a_shard_that_is_none_is_refused(text):
    with pytest.raises(ConfigError, match="accepted: i/n with 0 <= i < n"):
        Shard.parse(text)


@pytest.mark.parametrize(
    ("workers", "message"),
    [
        ({"executor": "dask"}, "executor dask: accepted: local, ray, slurm"),
        ({"count": 0}, "workers = 0; accepted: an integer >= 1"),
        ({"cores": 0}, "cores = 0; accepted: an integer >= 1"),
    ],
)
def test_workers_that_are_none_are_refused(workers, message):
    with pytest.raises(ConfigError, match=message):
        Workers(**workers)


def run_from_within(monkeypatch, second):
    """Runs `second` within the first render."""
    develop, caught = fgf_warp.renderer.develop, []

    def develop_and_run(model, state, image):
        if not caught:
            caught.append(None)
            caught[0] = second()
        return develop(model, state, image)

    monkeypatch.setattr(fgf_warp.renderer, "develop", develop_and_run)
    return caught


@pytest.mark.parametrize(("first", "second"), [("0/1", "0/1"), ("1/2", "1/2"), ("0/1", "1/3"), ("1/2", "0/1")])
def test_a_second_run_on_the_same_samples_is_refused(data, plan, fake_renderer, monkeypatch, first, second):
    def run_again():
        before = snapshot(data)
        with pytest.raises(ConfigError) as error:
            generate(plan, TEXT, data, shard=Shard.parse(second))
        assert {path: before[path] for path in snapshot(data) if path in before} == before
        return str(error.value)

    caught = run_from_within(monkeypatch, run_again)
    assert generate(plan, TEXT, data, shard=Shard.parse(first)).is_complete
    assert caught == [
        f"{data}: another run is under way in this folder, on shard {first}; wait for its end",
    ]


def test_shards_run_at_the_same_time(tmp_path, data, plan, fake_renderer, monkeypatch):
    first, second = Shard(0, 2), Shard(1, 2)

    def run_again():
        for index in range(6):
            (data / "data" / "train" / f".{index:06d}.0a1b2c3d4e5f.partial").mkdir(parents=True)
        report = generate(plan, TEXT, data, shard=second)
        # What the other run may be writing at this moment is not swept.
        assert {int(path.name[1:7]) for path in data.rglob("*.partial")} == set(samples_of(plan, first))
        return report

    caught = run_from_within(monkeypatch, run_again)
    assert generate(plan, TEXT, data, shard=first).is_complete
    assert caught[0].is_complete
    generate(plan, TEXT, tmp_path / "whole")
    assert content(data) == content(tmp_path / "whole")
    assert labels(data)["status"].to_pylist() == ["complete"] * 6
    assert not list(data.rglob("*.partial"))


def test_without_locks_each_sample_is_committed_once(data, plan, fake_renderer, monkeypatch, caplog):
    def no_locks(*_, **__):
        raise OSError(errno.ENOLCK, "no locks")

    monkeypatch.setattr("filelock.FileLock.acquire", no_locks)
    caught = run_from_within(monkeypatch, lambda: generate(plan, TEXT, data))
    before = {}
    commit = Store.commit

    def commit_once(self, folder, files, *, replaces, made_in):
        made = commit(self, folder, files, replaces=replaces, made_in=made_in)
        assert made == (folder not in before)
        before[folder] = self.read(f"{folder}/{layout.TIMING}")
        return made

    monkeypatch.setattr(Store, "commit", commit_once)
    assert generate(plan, TEXT, data).is_complete
    assert caught[0].is_complete
    assert len(before) == 6
    assert "no file locks here" in caplog.text


def test_leftovers_of_a_power_cut_are_swept(data, plan, fake_renderer):
    generate(plan, TEXT, data)
    leftovers = [
        data / ".index.0123456789ab.partial.parquet",
        data / "data" / "train" / ".metadata.0123456789ab.partial.parquet",
        data / "run" / "failures" / ".000002.0123456789ab.partial.json",
    ]
    for leftover in leftovers:
        leftover.parent.mkdir(exist_ok=True)
        leftover.write_text("half")
    (data / "data" / "train" / ".000001.0123456789ab.partial").mkdir()
    generate(plan, TEXT, data)
    assert not list(data.rglob("*.partial*"))


def test_a_run_that_was_killed_between_plan_and_config_leaves_no_obstacle(data, plan, fake_renderer, monkeypatch):
    write = Store.write

    def be_killed(self, name, content):
        if list(data.glob("*.*")):
            raise KeyboardInterrupt
        write(self, name, content)

    monkeypatch.setattr(Store, "write", be_killed)
    with pytest.raises(KeyboardInterrupt):
        generate(plan, TEXT, data)
    assert len(list(data.glob("*.*"))) == 1
    monkeypatch.setattr(Store, "write", write)
    assert generate(plan, TEXT, data).is_complete
    assert (data / layout.CONFIG).read_bytes() == TEXT


def test_what_another_run_is_writing_is_not_swept_at_the_end(data, plan, fake_renderer, monkeypatch):
    """The labels of a shard that publishes have a hidden name for a moment."""
    sweep, swept = Store.sweep, []

    def sweep_alone(self, samples):
        with pytest.raises(HeldError), hold(data / layout.RUN / "lock", wait=False):
            pass
        swept.append(samples)
        sweep(self, samples)

    monkeypatch.setattr(Store, "sweep", sweep_alone)
    assert generate(plan, TEXT, data).is_complete
    assert len(swept) == 2


def test_a_note_that_another_run_is_writing_or_removes_is_none(data, plan, fake_renderer, monkeypatch):
    generate(plan, TEXT, data)
    dataset = Dataset(data)
    dataset.store.write(layout.failure(1), encode(Failure(1, "none", 1)))
    dataset.store.write(layout.failure(2), encode(Failure(2, "none", 1)))
    (data / layout.FAILURES / ".000003.0123456789ab.partial.json").write_text("half")
    read = Store.read

    def read_late(self, name):
        if name == layout.failure(2):
            self.remove(name)
        return read(self, name)

    monkeypatch.setattr(Store, "read", read_late)
    assert list(dataset.failures()) == [1]


def test_a_run_that_was_killed_early_leaves_no_obstacle(data, plan, fake_renderer):
    (data / "run").mkdir(parents=True)
    (data / "run" / "lock").touch()
    (data / ".config.0123456789ab.partial.yaml").touch()
    assert generate(plan, TEXT, data).is_complete


def test_a_folder_of_another_plan_is_refused_untouched(tmp_path, data, plan, fake_renderer):
    generate(plan, TEXT, data)
    before = snapshot(data)
    with pytest.raises(ConfigError, match="holds a dataset of another plan"):
        generate(small_plan(tmp_path, "seed=8"), TEXT, data)
    assert snapshot(data) == before


def test_a_folder_of_something_else_is_refused(data, plan, fake_renderer):
    data.mkdir()
    (data / "thesis.tex").write_text("")
    with pytest.raises(ConfigError, match="is not empty and holds no dataset"):
        generate(plan, TEXT, data)
    assert [path.name for path in data.rglob("*")] == ["thesis.tex"]


def test_a_parent_that_is_a_file_is_refused(tmp_path, plan, fake_renderer):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be made a dataset's folder"):
        generate(plan, TEXT, tmp_path / "file" / "data")


def test_an_image_that_the_memory_does_not_hold_is_refused_before_the_folder_is_made(data, plan):
    plan = replace(plan, settings=replace(plan.settings, memory=1e-9))
    with pytest.raises(ConfigError, match=r"16 x 16 pixels needs .* GiB; accepted: at most memory = 1e-09 GiB"):
        generate(plan, TEXT, data)
    assert not data.exists()


def test_an_interrupted_run_goes_on_where_it_was(tmp_path, data, plan, fake_renderer, monkeypatch):
    generate(plan, TEXT, tmp_path / "whole")
    fake_renderer.clear()
    advance = fgf_warp.renderer.advance

    def interrupt_the_third(*arguments):
        for image in advance(*arguments):
            if len(fake_renderer) == 2:
                os.kill(os.getpid(), signal.SIGINT)
                threading.Event().wait(30)
                raise AssertionError("the interrupt did not stop the run")
            yield image

    monkeypatch.setattr(fgf_warp.renderer, "advance", interrupt_the_third)
    # A process that was started in the background may ignore the signal.
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        report = generate(plan, TEXT, data)
    finally:
        signal.signal(signal.SIGINT, handler)
    assert (report.interrupted, report.finished, report.is_complete) == (True, 2, False)
    assert labels(data)["status"].to_pylist() == ["complete"] * 2 + ["missing"] * 4
    assert not list(data.rglob(".*"))
    assert told(data, "end")[0]["interrupted"]

    monkeypatch.setattr(fgf_warp.renderer, "advance", advance)
    fake_renderer.clear()
    report = generate(plan, TEXT, data)
    assert (report.reused, report.is_complete) == (2, True)
    assert fake_renderer == [sample.seed for sample in plan.samples[2:]]
    assert content(data) == content(tmp_path / "whole")
    assert labels(data).equals(labels(tmp_path / "whole"))


def be_removed(data):
    shutil.rmtree(data)


def be_moved(data):
    data.rename(data.with_name("moved"))


@pytest.mark.parametrize("way", [be_removed, be_moved])
def test_a_dataset_that_is_removed_meanwhile_is_not_made_anew(data, plan, fake_renderer, monkeypatch, way):
    advance = fgf_warp.renderer.advance

    def remove_after_the_second(*arguments):
        for image in advance(*arguments):
            if len(fake_renderer) == 2:
                while len(Dataset(data).complete()) < 2:
                    time.sleep(0.01)
                way(data)
            yield image

    monkeypatch.setattr(fgf_warp.renderer, "advance", remove_after_the_second)
    with pytest.raises(GoneError, match=r"plan.parquet is gone: the dataset was removed or moved while a run was at"):
        generate(plan, TEXT, data)
    assert not data.exists()


def test_a_removed_dataset_ends_the_command_with_what_to_know(tmp_path, data, fake_renderer, monkeypatch):
    monkeypatch.setattr(Store, "check_there", lambda self: (_ for _ in ()).throw(GoneError(f"{data}: is gone")))
    outcome = CliRunner().invoke(app, ["generate", str(write_config(tmp_path)), "--out", str(data)])
    assert outcome.exit_code == 3, outcome.output
    assert [line for line in outcome.stderr.splitlines() if "gone" in line] == [f"error: {data}: is gone"]


def test_a_changed_plan_is_not_published_as_if_it_were_the_datasets(data, plan, fake_renderer):
    generate(plan, TEXT, data)
    meta, table = read_plan((data / layout.PLAN).read_bytes(), "")
    for changed in (write_plan(replace(meta, description="changed"), table), write_plan(meta, table.slice(0, 3))):
        (data / layout.PLAN).write_bytes(changed)
        with pytest.raises(CorruptFileError, match=r"plan.parquet: is not as it was written; fgf verify --repair"):
            generate(plan, TEXT, data)


def test_a_full_disk_ends_the_run_and_leaves_what_is_finished(tmp_path, data, plan, fake_renderer, monkeypatch):
    commit = store._commit_folder

    def fill_the_disk(target, *others):
        if target.name == "000001":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return commit(target, *others)

    monkeypatch.setattr(store, "_commit_folder", fill_the_disk)
    with pytest.raises(OutputError, match="000001: cannot be written: No space left on device"):
        generate(plan, TEXT, data)
    finished = Dataset(data).complete()
    assert 1 not in finished
    assert 5 not in finished  # The renderer was told.
    assert "No space left" in told(data, "end")[0]["error"]

    monkeypatch.setattr(store, "_commit_folder", commit)
    report = generate(plan, TEXT, data)
    assert (report.reused, report.is_complete) == (len(finished), True)
    generate(plan, TEXT, tmp_path / "whole")
    assert content(data) == content(tmp_path / "whole")


def test_few_images_wait_for_their_files(tmp_path, data, fake_renderer, monkeypatch):
    plan = small_plan(tmp_path, "draws=4")
    encode, written, waiting = render.encode_images, [], []

    def encode_slowly(*arguments):
        waiting.append(len(fake_renderer) - len(written))
        time.sleep(0.02)
        found = encode(*arguments)
        written.append(found)
        return found

    monkeypatch.setattr(render, "encode_images", encode_slowly)
    assert generate(plan, TEXT, data, workers=Workers(cores=2)).is_complete
    # Two for each thread, and the one that is being made.
    assert 2 < max(waiting) <= 2 * 2 + 1


def test_films_of_two_batches_are_never_there_at_once(tmp_path, data, fake_renderer, monkeypatch):
    plan = small_plan(tmp_path, "axes={H: [-0.5, -0.25, -0.4], S_w: [1]}")
    films = []

    class Film:
        pass

    def begin(model):
        assert not any(film() for film in films)
        state = Film()
        films.append(weakref.ref(state))
        return state

    monkeypatch.setattr(fgf_warp.renderer, "begin", begin)
    generate(plan, TEXT, data)
    assert len(films) == 2


@pytest.mark.parametrize("cores", [1, 3])
def test_threads_that_render_are_as_many_as_the_cores(data, plan, fake_renderer, monkeypatch, cores):
    threads = set()

    def develop(model, state, image):
        threads.add(model.settings.threads)
        return made_up_render(replace(model.settings, seed=model.variants[image].seed))

    monkeypatch.setattr(fgf_warp.renderer, "develop", develop)
    generate(plan, TEXT, data, workers=Workers(cores=cores))
    assert threads == {cores}


def test_rendering_again_takes_the_place_of_what_is_there(data, plan, fake_renderer):
    generate(plan, TEXT, data)
    before = content(data)
    folder = data / layout.sample_folder("train", 2)
    (folder / layout.RADIANCE).write_bytes(b"damaged")
    (folder / "surplus").write_text("of someone else")
    (data / layout.sample_folder("train", 4) / layout.RECORD).unlink()
    finished = list(render_again(plan, Store(data), [4, 2], {2: 4}))
    assert sorted(sample.index for sample in finished) == [2, 4]
    assert (folder / "surplus").read_text() == "of someone else"
    (folder / "surplus").unlink()
    assert content(data) == before


def test_a_chunk_of_an_object_store_or_a_folder_is_the_same(tmp_path, plan, fake_renderer):
    """The code path of every executor, called as a worker does."""
    for location in (tmp_path / "chunk", f"memory://{uuid.uuid4().hex}"):
        store = Store(location)
        store.write(layout.PLAN, plan.to_bytes())
        finished = list(render_chunk(plan, store, Chunk((3, 5), attempt=2)))
        assert sorted(sample.index for sample in finished) == [3, 5]
        assert all(sample.seconds == 0.25 and sample.error is None for sample in finished)
        assert sum(name.endswith(layout.RECORD) for name in store.sizes()) == 2


def test_a_disk_that_is_full_and_then_larger(tmp_path, small_disk, fake_renderer):
    plan = small_plan(tmp_path, "draws=6", "image={width: 32, height: 32}")
    with pytest.raises(OutputError, match="No space left on device"):
        generate(plan, TEXT, small_disk / "data")
    finished = Dataset(small_disk / "data").complete()
    assert 0 < len(finished) < 36
    assert not list((small_disk / "data" / "data").rglob(".*"))
    subprocess.run(["mount", "-o", "remount,size=100m", str(small_disk)], check=True)
    report = generate(plan, TEXT, small_disk / "data")
    assert (report.reused, report.is_complete) == (len(finished), True)
    generate(plan, TEXT, tmp_path / "whole")
    assert content(small_disk / "data") == content(tmp_path / "whole")


def test_folders_that_others_make_meanwhile_are_not_moved_aside(tmp_path):
    """Each round, sixteen threads make the folders of a new dataset at once; a file that stands there moves once."""
    for round_ in range(30):
        data = tmp_path / str(round_)
        data.mkdir()
        if round_ % 2:
            (data / "data").write_text("a file of someone else")
        place = Store(data)

        def put(index, place=place):
            with place.workspace(f"data/train/{index:06d}") as folder:
                (folder / "a").write_text("")
                place.commit(f"data/train/{index:06d}", {"a": b"", "record.json": b""}, made_in=folder)

        with ThreadPoolExecutor(16) as pool:
            list(pool.map(put, range(16)))
        assert len(list((data / "data/train").glob("*/record.json"))) == 16
        assert [path.name for path in sorted(data.iterdir())] == ["data", *(["data.aside"] if round_ % 2 else [])]


def test_of_one_sample_per_pixel_the_error_is_not_known(tmp_path):
    loaded = load_config(write_config(tmp_path), ["spp=1", "axes.g=[0]"])
    generate(build_plan(loaded), loaded.to_bytes(), tmp_path / "data")
    dataset = Dataset(tmp_path / "data")
    assert verify_dataset(dataset, deep=True).is_whole
    assert labels(tmp_path / "data")["standard_error"].to_pylist() == [None, None]
