import json
import os
import signal
import threading
import time
import weakref
from dataclasses import replace

import pyarrow.parquet as pq
import pytest

import fgf_warp.renderer
from fgf_warp.errors import ConfigError, CorruptFileError, NumericalError, OutputError
from fgf_warp.output.exr import read_exr
from generators import lock, run
from generators.config import load_config
from generators.manifest import SCHEMA
from generators.plan import build_plan
from tests.renders import made_up_render
from tests.scenes import furnace


@pytest.fixture
def dataset(config_path, scene):
    """The config and its plan of six samples."""
    loaded = load_config(config_path)
    return build_plan(loaded.config, scene, 12, 8), loaded


def labels(folder):
    return pq.read_table(folder / "index.parquet").drop_columns(["render_seconds"])


def image_bytes(folder):
    return {path.name: path.read_bytes() for path in (folder / "images").iterdir()}


def test_folder_has_all_that_is_promised(tmp_path, dataset, fake_renderer):
    plan, loaded = dataset
    folder = tmp_path / "data"
    report = run.generate(plan, loaded, folder)
    assert report.is_complete
    assert not report.interrupted
    assert sorted(path.name for path in folder.iterdir()) == [
        "config.yaml",
        "contact_sheet.png",
        "images",
        "index.parquet",
        "run",
    ]
    assert set(image_bytes(folder)) == {f"{i:06d}.{ending}" for i in range(6) for ending in ("exr", "png")}
    assert len(list((folder / "run").glob("0*.json"))) == 6
    assert sorted(fake_renderer) == sorted(sample.seed for sample in plan.samples)


def test_labels_say_what_was_rendered(tmp_path, dataset, fake_renderer):
    plan, loaded = dataset
    run.generate(plan, loaded, tmp_path / "data")
    table = pq.read_table(tmp_path / "data" / "index.parquet")
    assert table.schema.remove_metadata().equals(SCHEMA)
    for row, sample in zip(table.to_pylist(), plan.samples, strict=True):
        medium = sample.medium
        assert row["index"] == sample.index
        assert (row["H"], row["g"], row["S_w"]) == tuple(sample.parameters[name] for name in ("H", "g", "S_w"))
        assert (row["b"], row["kappa"], row["regime"]) == (
            medium.line_law.b,
            medium.line_law.kappa,
            medium.line_law.regime,
        )
        assert (row["seed"], row["spp"], row["L"]) == (sample.seed, 4, None)
        assert row["phase_function"] == medium.phase_function
        assert row["render_seconds"] == 0.25
        assert row["truncated"] == 0
        channels, header = read_exr(tmp_path / "data" / row["exr"])
        assert header["H"] == row["H"]
        assert header["dataset"] == {
            "name": "trial",
            "plan": plan.digest,
            "index": sample.index,
            "swept": dict(sample.parameters),
        }
        assert "variance.R" in channels
        assert (tmp_path / "data" / row["png"]).is_file()


def test_labels_hold_the_extinction_in_force(tmp_path, config_path, fake_renderer):
    loaded = load_config(config_path, ["axes={sigma_m: [4], S_w: [1]}"])
    for color, expected in (((0.5,) * 3, 2.0), ((0.5, 1.0, 1.0), 4.0)):
        plan = build_plan(loaded.config, furnace(extinction_color=color), 12, 8)
        run.generate(plan, loaded, tmp_path / str(expected))
        (row,) = labels(tmp_path / str(expected)).to_pylist()
        # White noise: kappa = S_w / sigma_m.
        assert (row["sigma_m"], row["kappa"]) == pytest.approx((expected, 1 / expected))


def test_paths_that_were_cut_are_counted_in_this_run_and_the_next(tmp_path, dataset, fake_renderer, monkeypatch):
    plan, loaded = dataset
    render = fgf_warp.renderer.render
    cut = {plan.samples[1].seed: 5, plan.samples[4].seed: 2}

    def cut_some(scene, settings, progress=None):
        return replace(render(scene, settings, progress), truncated_count=cut.get(settings.seed, 0))

    monkeypatch.setattr(fgf_warp.renderer, "render", cut_some)
    for _ in range(2):
        report = run.generate(plan, loaded, tmp_path / "data")
        assert (report.truncated_paths, report.truncated_samples) == (7, 2)
        assert labels(tmp_path / "data")["truncated"].to_pylist() == [0, 5, 0, 0, 2, 0]


def snapshot(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def refuse_a_second_run(plan, loaded, folder, monkeypatch):
    """Runs, and from within the first render runs again; returns the error of the second."""
    render, errors = fgf_warp.renderer.render, []

    def run_again(scene, settings, progress=None):
        if not errors:
            errors.append(None)
            before = snapshot(folder)
            with pytest.raises(ConfigError) as caught:
                run.generate(plan, loaded, folder)
            errors[0] = str(caught.value)
            assert snapshot(folder) == before
        return render(scene, settings, progress)

    monkeypatch.setattr(fgf_warp.renderer, "render", run_again)
    assert run.generate(plan, loaded, folder, workers=1).is_complete
    assert run.generate(plan, loaded, folder).reused == len(plan.samples)
    return errors[0]


def test_a_second_run_at_the_same_time_is_refused(tmp_path, dataset, fake_renderer, monkeypatch):
    message = refuse_a_second_run(*dataset, tmp_path / "data", monkeypatch)
    assert message.startswith(f"{tmp_path / 'data'}: another run is under way in this folder; wait for its end")


def test_a_second_run_is_refused_where_there_is_no_fcntl(tmp_path, dataset, fake_renderer, monkeypatch):
    monkeypatch.setattr(lock, "fcntl", None)
    message = refuse_a_second_run(*dataset, tmp_path / "data", monkeypatch)
    assert f"delete {tmp_path / 'data' / 'run' / 'lock'} if it was killed" in message
    assert not (tmp_path / "data" / "run" / "lock").exists()


def test_a_run_that_was_killed_early_leaves_no_obstacle(tmp_path, dataset, fake_renderer):
    (tmp_path / "data" / "run").mkdir(parents=True)
    (tmp_path / "data" / "run" / "lock").touch()
    assert run.generate(*dataset, tmp_path / "data").is_complete


def test_number_of_workers_changes_no_byte(tmp_path, dataset, fake_renderer):
    plan, loaded = dataset
    for workers in (1, 2, 5):
        run.generate(plan, loaded, tmp_path / str(workers), workers=workers)
    first = tmp_path / "1"
    for other in (tmp_path / "2", tmp_path / "5"):
        assert image_bytes(other) == image_bytes(first)
        assert labels(other).equals(labels(first))
        for name in ("contact_sheet.png", "config.yaml", "index.parquet"):
            assert (other / name).read_bytes() == (first / name).read_bytes()


@pytest.mark.parametrize("workers", [1, 3])
def test_threads_that_render_are_as_many_as_the_workers(tmp_path, dataset, fake_renderer, monkeypatch, workers):
    plan, loaded = dataset
    threads = set()

    def render(scene, settings, progress=None):
        threads.add(settings.threads)
        return made_up_render(settings)

    monkeypatch.setattr(fgf_warp.renderer, "render", render)
    run.generate(plan, loaded, tmp_path / "data", workers=workers)
    assert threads == {workers}


def test_few_images_wait_for_their_files(tmp_path, config_path, scene, fake_renderer, monkeypatch):
    loaded = load_config(config_path, ["draws=4"])
    written, waiting = [], []

    def write_slowly(path, result):
        waiting.append(len(fake_renderer) - len(written))
        time.sleep(0.02)
        write_exr(path, result)
        written.append(path)

    write_exr = run.write_exr
    monkeypatch.setattr(run, "write_exr", write_slowly)
    assert run.generate(build_plan(loaded.config, scene, 12, 8), loaded, tmp_path / "data", workers=2).is_complete
    # Twelve images of each of two laws. Two for each worker, and the one that is being made.
    assert 2 < max(waiting) <= 2 * 2 + 1


def test_films_of_two_batches_are_never_there_at_once(tmp_path, dataset, fake_renderer, monkeypatch):
    plan, loaded = dataset
    films = []

    class Film:
        pass

    def begin(model):
        assert not any(film() for film in films)
        state = Film()
        films.append(weakref.ref(state))
        return state

    monkeypatch.setattr(fgf_warp.renderer, "begin", begin)
    run.generate(plan, loaded, tmp_path / "data")
    assert len(films) == 2


def test_interrupted_run_goes_on_where_it_was(tmp_path, dataset, fake_renderer, monkeypatch):
    plan, loaded = dataset
    folder = tmp_path / "data"
    whole = tmp_path / "whole"
    run.generate(plan, loaded, whole)
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
        report = run.generate(plan, loaded, folder, workers=1)
    finally:
        signal.signal(signal.SIGINT, handler)
    assert (report.interrupted, report.finished, report.is_complete) == (True, 2, False)
    assert labels(folder).num_rows == 2
    assert len(image_bytes(folder)) == 4
    assert not list(folder.rglob(".*"))

    monkeypatch.setattr(fgf_warp.renderer, "advance", advance)
    fake_renderer.clear()
    report = run.generate(plan, loaded, folder, workers=1)
    assert (report.reused, report.is_complete) == (2, True)
    assert fake_renderer == [sample.seed for sample in plan.samples[2:]]
    assert image_bytes(folder) == image_bytes(whole)
    assert labels(folder).equals(labels(whole))


def test_finished_dataset_is_not_rendered_again(tmp_path, dataset, fake_renderer):
    plan, loaded = dataset
    run.generate(plan, loaded, tmp_path / "data")
    fake_renderer.clear()
    assert run.generate(plan, loaded, tmp_path / "data").reused == 6
    assert fake_renderer == []


@pytest.mark.parametrize("lost", ["images/000003.exr", "images/000003.png", "run/000003.json"])
def test_sample_with_a_lost_file_is_rendered_again(tmp_path, dataset, fake_renderer, lost):
    plan, loaded = dataset
    folder = tmp_path / "data"
    run.generate(plan, loaded, folder)
    fake_renderer.clear()
    (folder / lost).unlink()
    run.generate(plan, loaded, folder)
    assert fake_renderer == [plan.samples[3].seed]
    assert (folder / lost).is_file()


def test_folder_of_another_plan_is_refused_untouched(tmp_path, dataset, fake_renderer, config_path, scene):
    plan, loaded = dataset
    folder = tmp_path / "data"
    run.generate(plan, loaded, folder)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    other = load_config(config_path, ["seed=8"])
    with pytest.raises(ConfigError, match="holds a dataset of another plan"):
        run.generate(build_plan(other.config, scene, 12, 8), other, folder)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_folder_of_something_else_is_refused(tmp_path, dataset, fake_renderer):
    plan, loaded = dataset
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "thesis.tex").write_text("")
    with pytest.raises(ConfigError, match="is not empty and holds no dataset"):
        run.generate(plan, loaded, tmp_path / "data")
    assert [path.name for path in (tmp_path / "data").rglob("*")] == ["thesis.tex"]


def test_damaged_record_is_reported(tmp_path, dataset, fake_renderer):
    plan, loaded = dataset
    run.generate(plan, loaded, tmp_path / "data")
    (tmp_path / "data" / "run" / "000002.json").write_text("{")
    with pytest.raises(CorruptFileError, match=r"000002.json: is damaged"):
        run.generate(plan, loaded, tmp_path / "data")


def test_leftovers_of_a_power_cut_are_swept(tmp_path, dataset, fake_renderer):
    plan, loaded = dataset
    folder = tmp_path / "data"
    run.generate(plan, loaded, folder)
    leftovers = [folder / ".index.12ab.partial.parquet", folder / "images" / ".000001.12ab.partial.exr"]
    for leftover in leftovers:
        leftover.write_text("half")
    run.generate(plan, loaded, folder)
    assert not any(leftover.exists() for leftover in leftovers)


def test_sample_that_is_not_finite_is_reported_and_the_others_go_on(tmp_path, dataset, fake_renderer, monkeypatch):
    plan, loaded = dataset
    render = fgf_warp.renderer.render

    def fail_once(scene, settings, progress=None):
        if settings.seed == plan.samples[1].seed:
            raise NumericalError("3 samples are not finite")
        return render(scene, settings, progress)

    monkeypatch.setattr(fgf_warp.renderer, "render", fail_once)
    report = run.generate(plan, loaded, tmp_path / "data", workers=2)
    assert report.failures == ((1, "3 samples are not finite"),)
    assert (report.finished, report.is_complete) == (5, False)
    assert labels(tmp_path / "data")["index"].to_pylist() == [0, 2, 3, 4, 5]


def test_record_is_the_last_of_a_samples_files(tmp_path, dataset, fake_renderer, monkeypatch):
    plan, loaded = dataset
    folder = tmp_path / "data"

    def refuse(*_):
        raise OutputError("no space left")

    monkeypatch.setattr(run, "write_png", refuse)
    with pytest.raises(OutputError, match="no space left"):
        run.generate(plan, loaded, folder, workers=1)
    assert not list((folder / "run").glob("0*.json"))


def test_a_file_that_cannot_be_written_ends_the_run_and_leaves_what_is_finished(
    tmp_path, config_path, scene, fake_renderer, monkeypatch
):
    loaded = load_config(config_path, ["axes.H=[-0.5]", "draws=3"])
    plan = build_plan(loaded.config, scene, 12, 8)
    folder = tmp_path / "data"
    write_exr, advance, ended = run.write_exr, fgf_warp.renderer.advance, []

    def fill_the_disk(path, result):
        if path.stem == "000001":
            raise OutputError("no space left")
        write_exr(path, result)

    def see_the_end(*arguments):
        try:
            yield from advance(*arguments)
        finally:
            ended.append(len(fake_renderer))

    monkeypatch.setattr(run, "write_exr", fill_the_disk)
    monkeypatch.setattr(fgf_warp.renderer, "advance", see_the_end)
    with pytest.raises(OutputError, match="no space left"):
        run.generate(plan, loaded, folder, workers=1)
    # The renderer was told, and what was handed over is written.
    (rendered,) = ended
    assert rendered < len(plan.samples)
    finished = {path.stem for path in (folder / "run").glob("0*.json")}
    assert finished == {f"{i:06d}" for i in range(rendered)} - {"000001"}

    monkeypatch.setattr(run, "write_exr", write_exr)
    report = run.generate(plan, loaded, folder)
    assert (report.reused, report.is_complete) == (rendered - 1, True)


def test_progress_counts_earlier_samples(tmp_path, dataset, fake_renderer):
    plan, loaded = dataset
    run.generate(plan, loaded, tmp_path / "data")
    (tmp_path / "data" / "run" / "000000.json").unlink()
    calls = []
    run.generate(plan, loaded, tmp_path / "data", progress=lambda done, total: calls.append((done, total)))
    assert calls == [(5, 6), (5, 6), (6, 6)]


def test_progress_counts_parts_of_samples(tmp_path, config_path, fake_renderer, monkeypatch):
    loaded = load_config(config_path, ["axes={H: [-0.5, -0.25, -0.3]}"])
    calls = []

    def advance(model, state, samples, progress):
        progress(1, 4)
        progress(3, 4)
        yield from range(len(model.variants))

    monkeypatch.setattr(fgf_warp.renderer, "advance", advance)
    plan = build_plan(loaded.config, furnace(white_noise_scale=1.0), 12, 8)
    run.generate(plan, loaded, tmp_path / "data", progress=lambda done, total: calls.append((done, total)))
    assert calls == [(0, 3), (0.25, 3), (0.75, 3), (1.5, 3), (2.5, 3)]


def test_fewer_than_one_worker_is_refused(tmp_path, dataset):
    with pytest.raises(ConfigError, match="workers = 0"):
        run.generate(*dataset, tmp_path / "data", workers=0)


def test_an_image_that_the_memory_does_not_hold_is_refused_before_the_folder_is_made(tmp_path, dataset):
    plan, loaded = dataset
    plan = replace(plan, settings=replace(plan.settings, memory=1e-9))
    with pytest.raises(ConfigError, match=r"12 x 8 pixels needs .* GiB; accepted: at most memory = 1e-09 GiB"):
        run.generate(plan, loaded, tmp_path / "deep" / "data")
    assert not (tmp_path / "deep").exists()


def test_parent_that_is_a_file_is_refused(tmp_path, dataset):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be made the dataset's folder"):
        run.generate(*dataset, tmp_path / "file" / "data")


def test_records_are_small_json(tmp_path, dataset, fake_renderer):
    plan, loaded = dataset
    run.generate(plan, loaded, tmp_path / "data")
    record = json.loads((tmp_path / "data" / "run" / "000005.json").read_text())
    assert record["plan"] == plan.digest
    assert record["index"] == 5
