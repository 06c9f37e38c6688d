"""Damaged datasets that `fgf verify --repair` makes whole again, with the real renderer on a small sphere."""

import os
import random
import shutil

import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import fgf_warp.renderer
from fgf_warp.errors import NumericalError
from fgf_warp.locks import hold
from generators.checking.verify import verify_dataset
from generators.cli import app
from generators.dataset import layout
from generators.dataset.reader import Dataset
from generators.planning.document import load_config
from generators.planning.plan import build_plan
from generators.running.run import generate
from tests.generators.small_plan import content, write_config

SAMPLES = ("data/train/000000", "data/train/000001", "data/train/000002", "data/train/000003")
DAMAGED = (
    *(f"{SAMPLES[0]}/radiance.exr", f"{SAMPLES[1]}/image.png", f"{SAMPLES[2]}/record.json"),
    *(f"{SAMPLES[3]}/timing.json", "index.parquet", "data/train/metadata.parquet", "README.md", "contact_sheet.png"),
)
"""One of each kind of file, but those that tell of the others' hashes, and the config, which nothing else tells."""


def make(folder, tmp_path, *overrides):
    loaded = load_config(write_config(tmp_path), overrides)
    generate(build_plan(loaded), loaded.to_bytes(), folder)
    return folder


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    """Six samples, not to be changed."""
    temporary = tmp_path_factory.mktemp("rendered")
    return make(temporary / "small", temporary)


@pytest.fixture
def folder(rendered, tmp_path):
    """A copy of them."""
    return shutil.copytree(rendered, tmp_path / "small")


def repair(folder):
    return CliRunner().invoke(app, ["verify", str(folder), "--repair"])


def is_whole(folder):
    return verify_dataset(Dataset(folder), deep=True).is_whole


def flip(path):
    data = bytearray(path.read_bytes())
    data[random.Random(path.name).randrange(len(data))] ^= 4
    path.write_bytes(bytes(data))


def truncate(path):
    path.write_bytes(path.read_bytes()[:-30])


def delete(path):
    path.unlink()


@pytest.mark.parametrize("damage", [flip, truncate, delete])
def test_every_kind_of_file_is_named_and_healed(folder, rendered, damage):
    before = content(folder)
    for name in DAMAGED:
        damage(folder / name)
    outcome = repair(folder)
    assert outcome.exit_code == 0, outcome.output
    assert [name for name in DAMAGED if f"{name}: " not in outcome.stdout] == []
    assert "all is as it should be" in outcome.stdout
    assert content(folder) == before
    assert is_whole(folder)


@pytest.mark.parametrize("damage", [flip, truncate, delete])
@pytest.mark.parametrize("name", ["plan.parquet", "croissant.json"])
def test_plan_and_metadata_are_named_and_healed(folder, name, damage):
    before = content(folder)
    damage(folder / name)
    outcome = repair(folder)
    assert outcome.exit_code == 0, outcome.output
    assert f"{name}: " in outcome.stdout
    assert content(folder) == before
    assert is_whole(folder)


def test_a_sample_that_is_gone_comes_back(folder):
    before = content(folder)
    shutil.rmtree(folder / SAMPLES[1])
    assert repair(folder).exit_code == 0
    assert content(folder) == before


def test_samples_of_different_depth_come_back_as_deep(tmp_path):
    """With an error to aim at, each sample has its own number of samples per pixel, reached in several rounds."""
    data = make(tmp_path / "data", tmp_path, "spp=null", "quality={target_error: 0.03, max_spp: 512}")
    spp = pq.read_table(data / "index.parquet")["spp"].to_pylist()
    assert len(set(spp)) > 1
    before = content(data)
    flip(data / SAMPLES[0] / "radiance.exr")
    (data / SAMPLES[1] / "record.json").unlink()
    outcome = repair(data)
    assert outcome.exit_code == 0, outcome.output
    assert content(data) == before


def test_damaged_labels_are_not_taken_at_their_word(folder):
    """They would tell how far to render a sample whose record is gone."""
    before = content(folder)
    labels = pq.read_table(folder / "index.parquet")
    place = labels.column_names.index("spp")
    pq.write_table(labels.set_column(place, "spp", [[3] * labels.num_rows]), folder / "index.parquet")
    (folder / SAMPLES[1] / "record.json").unlink()
    outcome = repair(folder)
    assert outcome.exit_code == 0, outcome.output
    assert content(folder) == before


def test_what_a_person_wrote_is_kept(folder):
    text = (folder / "README.md").read_text() + "\nOur own words.\n"
    (folder / "README.md").write_text(text)
    (folder / "notes.txt").write_text("mine")
    (folder / "data/train/.000003.0123456789ab.partial").mkdir()
    outcome = repair(folder)
    assert outcome.exit_code == 0
    assert (folder / "run/README.replaced.md").read_text() == text
    assert (folder / "notes.txt").read_text() == "mine"
    assert not (folder / "data/train/.000003.0123456789ab.partial").exists()
    assert "notes.txt: a file that is not of the dataset" in outcome.stdout.splitlines()[-2]


def test_what_is_not_of_the_dataset_is_never_removed(folder):
    """Beside files of a damaged sample, in the place of a file, of a folder, and among the notes on failures."""
    before = content(folder)
    flip(folder / SAMPLES[0] / "radiance.exr")
    (folder / SAMPLES[0] / "notes.txt").write_text("mine")
    (folder / SAMPLES[0] / "old").mkdir()
    (folder / SAMPLES[0] / "old/notes.txt").write_text("mine too")
    (folder / SAMPLES[1] / "record.json").unlink()
    (folder / SAMPLES[1] / "record.json").mkdir()
    (folder / SAMPLES[1] / "record.json/notes.txt").write_text("and mine")
    shutil.rmtree(folder / SAMPLES[2])
    (folder / SAMPLES[2]).write_text("a file")
    (folder / "index.parquet").unlink()
    (folder / "index.parquet").mkdir()
    (folder / "index.parquet/notes.txt").write_text("mine as well")
    (folder / "run/failures").mkdir()
    (folder / "run/failures/notes.txt").write_text("mine")
    outcome = repair(folder)
    assert outcome.exit_code == 0, outcome.output
    theirs = {
        f"{SAMPLES[0]}/notes.txt": b"mine",
        f"{SAMPLES[0]}/old/notes.txt": b"mine too",
        f"{SAMPLES[1]}/record.json.aside/notes.txt": b"and mine",
        f"{SAMPLES[2]}.aside": b"a file",
        "index.parquet.aside/notes.txt": b"mine as well",
    }
    assert content(folder) == before | theirs
    assert (folder / "run/failures/notes.txt").read_text() == "mine"
    assert "index.parquet.aside: a folder of 1 files that is not of the dataset" in outcome.stdout
    assert f"{SAMPLES[2]}.aside: a file that is not of the dataset" in outcome.stdout


def test_nothing_is_lost_where_a_render_fails(folder, monkeypatch):
    flip(folder / SAMPLES[0] / "radiance.exr")
    (folder / SAMPLES[1] / "image.png").unlink()
    before = content(folder)

    def fails(*_):
        raise NumericalError("3 samples are not finite")

    monkeypatch.setattr(fgf_warp.renderer, "develop", fails)
    outcome = repair(folder)
    assert outcome.exit_code == 4
    assert "sample 0 could not be rendered again: 3 samples are not finite" in outcome.stdout
    assert content(folder) == before


def test_a_config_of_something_else_makes_nothing_anew(folder):
    flip(folder / SAMPLES[0] / "image.png")
    config = folder / "config.yaml"
    config.write_text(config.read_text().replace("seed: 7", "seed: 8"))
    before = content(folder)
    outcome = repair(folder)
    assert outcome.exit_code == 2
    assert "config.yaml: plans another dataset than the one that is there" in outcome.stderr
    config.unlink()
    outcome = repair(folder)
    assert outcome.exit_code == 2
    assert "config.yaml is missing" in outcome.stderr
    assert content(folder).items() <= before.items()


def test_a_dataset_that_a_run_is_at_work_on_is_left_alone(folder):
    flip(folder / SAMPLES[0] / "image.png")
    (folder / "data/train/.000003.0123456789ab.partial").mkdir()
    with hold(folder / "run/shard-0-of-1.lock", wait=False):
        looked = CliRunner().invoke(app, ["verify", str(folder)])
        outcome = repair(folder)
    assert "half-written" not in looked.stdout
    assert outcome.exit_code == 2
    assert "a run is under way in this folder, on shard 0/1" in outcome.stderr


def test_a_single_sample_is_rendered_again_elsewhere(folder, tmp_path):
    """By the command that the report shows."""
    command = ["generate", str(folder / "config.yaml"), "--sample", "2", "--out", str(tmp_path / "again")]
    outcome = CliRunner().invoke(app, command)
    assert outcome.exit_code == 0, outcome.output
    assert Dataset(tmp_path / "again").complete() == [2]
    for name in ("radiance.exr", "image.png", "record.json"):
        assert (tmp_path / "again" / SAMPLES[2] / name).read_bytes() == (folder / SAMPLES[2] / name).read_bytes()
    refused = CliRunner().invoke(app, ["generate", str(folder / "config.yaml"), "--sample", "6"])
    assert refused.exit_code == 2
    assert "--sample 6: accepted: 0 to 5" in refused.stderr


def test_links_out_of_a_dataset_are_moved_aside_and_never_written_through(folder, tmp_path):
    """In the place of a sample's folder, of a split's, of a file, and of what a run appends to."""
    before = content(folder)
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    for name in ("radiance.exr", "notes.txt", "events.jsonl"):
        (theirs / name).write_text("mine")
    shutil.rmtree(folder / SAMPLES[1])
    (folder / SAMPLES[1]).symlink_to(theirs)
    (folder / SAMPLES[2] / "radiance.exr").unlink()
    (folder / SAMPLES[2] / "radiance.exr").symlink_to(theirs / "notes.txt")
    looked = CliRunner().invoke(app, ["verify", str(folder)])
    assert f"{SAMPLES[1]}: a link that is not of the dataset" in looked.stdout
    outcome = repair(folder)
    assert outcome.exit_code == 0, outcome.output
    assert (folder / f"{SAMPLES[1]}.aside").readlink() == theirs
    (folder / f"{SAMPLES[1]}.aside").unlink()
    assert content(folder) == before
    shutil.rmtree(folder / "data/train")
    (folder / "data/train").symlink_to(theirs)
    (folder / "run/events.jsonl").unlink(missing_ok=True)
    (folder / "run/events.jsonl").symlink_to(theirs / "events.jsonl")
    (folder / "run/lock").unlink()
    (folder / "run/lock").symlink_to(theirs / "lock")
    again = CliRunner().invoke(app, ["generate", str(folder)])
    assert again.exit_code == 0, again.output
    assert {path.name: path.read_text() for path in theirs.iterdir()} == dict.fromkeys(
        ("radiance.exr", "notes.txt", "events.jsonl"), "mine"
    )
    (folder / "data/train.aside").unlink()
    assert content(folder) == before


def test_a_table_of_a_split_that_the_plan_does_not_have_is_of_someone_else(folder):
    before = content(folder)
    (folder / "data/test").mkdir()
    (folder / "data/test/metadata.parquet").write_text("mine")
    flip(folder / "README.md")
    looked = CliRunner().invoke(app, ["verify", str(folder)])
    assert "1 damaged, 1 surplus" in looked.stdout
    assert repair(folder).exit_code == 0
    assert (folder / "data/test/metadata.parquet").read_text() == "mine"
    assert content(folder) == before


def test_samples_of_a_damaged_stage_wait_for_it(folder, rendered):
    before = content(folder)
    flip(folder / SAMPLES[0] / "radiance.exr")
    (stage,) = (folder / "scene").glob("*.usda")
    stage.write_text(stage.read_text().replace("}", "", 1))
    outcome = repair(folder)
    assert outcome.exit_code == 4
    assert "samples that wait for the stages to be rendered again: 0\n" in outcome.stdout
    back = CliRunner().invoke(app, ["generate", str(rendered / "config.yaml"), "--out", str(folder)])
    assert back.exit_code == 4, back.output  # the labels wait for the sample
    assert repair(folder).exit_code == 0
    assert content(folder) == before


def test_a_changed_plan_is_seen_where_the_metadata_cannot_tell_of_it(folder):
    before = content(folder)
    path = folder / "plan.parquet"
    table = pq.read_table(path)
    ((key, said),) = table.schema.metadata.items()
    pq.write_table(table.replace_schema_metadata({key: said.replace(b'"exposure": 0', b'"exposure": 3')}), path)
    assert path.read_bytes() != before["plan.parquet"]
    (folder / "croissant.json").unlink()
    outcome = repair(folder)
    assert outcome.exit_code == 0, outcome.output
    assert "made plan.parquet anew" in outcome.stdout
    assert content(folder) == before


def test_metadata_that_cannot_be_read_keep_no_stage_from_coming_back(folder, rendered):
    before = content(folder)
    with (folder / "croissant.json").open("r+b") as file:
        file.truncate(2**32)
    (folder / "scene/files.json").write_text("{}")
    flip(folder / SAMPLES[0] / "radiance.exr")
    assert repair(folder).exit_code == 4
    CliRunner().invoke(app, ["generate", str(rendered / "config.yaml"), "--out", str(folder)])
    assert repair(folder).exit_code == 0
    assert content(folder) == before


def test_plan_and_stage_that_are_both_damaged_are_told(folder):
    flip(folder / "plan.parquet")
    (stage,) = (folder / "scene").glob("*.usda")
    stage.write_text("#usda 1.0")
    outcome = repair(folder)
    assert outcome.exit_code == 4
    assert f"scene/{stage.name}: 9 bytes; plan.parquet follows from it and is damaged too" in outcome.stderr


def test_damaged_notes_do_not_hide_other_damage(folder):
    """Whatever they are, a file or a pipe, all are removed, and a changed plan is still found and made anew."""
    plan = (folder / layout.PLAN).read_bytes()
    flip(folder / layout.PLAN)
    notes = [folder / layout.failure(index) for index in (3, 98, 99)]
    notes[0].parent.mkdir(parents=True, exist_ok=True)
    for note in notes[:2]:
        note.write_bytes(b"{")
    os.mkfifo(notes[2])
    result = repair(folder)
    assert result.exit_code == 0, result.output
    assert not any(note.exists() for note in notes)
    assert (folder / layout.PLAN).read_bytes() == plan
    assert is_whole(folder)
