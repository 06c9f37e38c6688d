"""Exports of a dataset: what is in them, and that they are whole or not there."""

import re
import tarfile
from dataclasses import replace

import fsspec
import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from fgf_warp.errors import ConfigError, CorruptFileError, OutputError
from generators.cli import app
from generators.dataset import layout
from generators.dataset.images import read_channels
from generators.dataset.record import encode
from generators.publishing.exports import webdataset
from generators.publishing.exports.export import KINDS, export
from generators.publishing.exports.parquet import write_table
from generators.publishing.exports.samples import splits_of
from generators.publishing.exports.webdataset import write_shards
from generators.publishing.index import build_index
from tests.generators.made_up import make_dataset, plan_rows

MISSING, FAILED = (3,), (5,)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return make_dataset(tmp_path_factory.mktemp("made") / "set", MISSING, FAILED)


@pytest.fixture(scope="module")
def train(dataset):
    return splits_of(dataset, build_index(dataset))[0]


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("kind", KINDS)
def test_equal_samples_give_equal_bytes(dataset, tmp_path, kind):
    """Another folder, another day, other render times."""
    other = make_dataset(tmp_path / "other", MISSING, FAILED)
    for index in other.complete():
        name = f"{other.folders[index]}/{layout.TIMING}"
        other.store.write(name, encode(replace(other.timing(index), render_seconds=9.0)))
    export(dataset, kind, str(tmp_path / "a"))
    export(other, kind, str(tmp_path / "b"))
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_only_complete_samples_are_exported_and_the_others_counted(dataset, tmp_path):
    steps = []
    done = export(dataset, "webdataset", str(tmp_path / "out"), lambda *step: steps.append(step))
    assert (done.samples, done.left_out) == (22, {"failed": 1, "missing": 1})
    assert steps == [(count, 22) for count in range(1, 23)]
    assert done.files == ("README.md", "test-000000.tar", "train-000000.tar", "validation-000000.tar")
    assert set(done.files) == {path.name for path in (tmp_path / "out").iterdir()}


def test_shards_are_bounded_and_hold_every_sample_once(train, tmp_path):
    bound = 40_000
    assert sum(write_shards(train, tmp_path, bound)) == 15
    shards = sorted(tmp_path.iterdir())
    assert [shard.name for shard in shards] == [f"train-{i:06d}.tar" for i in range(len(shards))]
    assert len(shards) > 2
    assert all(shard.stat().st_size <= bound for shard in shards)
    names = []
    for shard in shards:
        with tarfile.open(shard) as tar:
            assert all((entry.mtime, entry.uid, entry.uname) == (0, 0, "") for entry in tar)
            names += tar.getnames()
    keys = [f"{index:06d}" for index in train.labels["index"].to_pylist()]
    assert names == [f"{key}.{suffix}" for key in keys for suffix in ("exr", "png", "json")]


def test_a_sample_larger_than_a_shard_has_its_own(train, tmp_path):
    assert sum(write_shards(train, tmp_path, shard_bytes=1)) == 15
    assert len(list(tmp_path.iterdir())) == 15


def test_row_groups_are_bounded(train, tmp_path):
    assert sum(write_table(train, tmp_path, group_bytes=20_000)) == 15
    file = pq.ParquetFile(tmp_path / "train.parquet")
    assert file.num_row_groups > 2
    assert file.read()["index"].to_pylist() == train.labels["index"].to_pylist()
    assert file.schema_arrow.field("S_w").metadata[b"unit"] == b"unit^(-2-2H)"


def test_arrays_hold_images_and_labels(dataset, tmp_path):
    export(dataset, "npz", str(tmp_path / "out"))
    assert [path.name for path in sorted((tmp_path / "out").iterdir())] == [
        *("README.md", "test.npz", "train.npz", "validation.npz")
    ]
    arrays = np.load(tmp_path / "out/validation.npz", allow_pickle=False)
    rows = [row for row in plan_rows() if row["split"] == "validation"]
    assert arrays["seed"].dtype == np.int64
    assert arrays["seed"].tolist() == [row["seed"] for row in rows]
    assert arrays["look"].tolist() == [row["look"] for row in rows]
    assert np.isnan(arrays["L"]).all()
    for place, row in enumerate(rows):
        channels = read_channels(dataset, row["index"])
        assert np.array_equal(arrays["radiance"][place], np.stack([channels[name] for name in "RGB"], axis=2))
        assert np.array_equal(arrays["alpha"][place], channels["A"])
        assert np.array_equal(arrays["aov_depth"][place], channels["Z"])
        assert np.array_equal(arrays["aov_variance"][place, ..., 1], channels["variance.G"])
    assert arrays["radiance"].dtype == np.float32


def test_curves_are_rows_of_an_array(tmp_path):
    dataset = make_dataset(tmp_path / "set", missing=range(6, 24))
    for index in range(6):
        record = replace(dataset.record(index), targets={"transmittance": [1.0, index / 10], "mean_free_path": None})
        dataset.store.write(f"{dataset.folders[index]}/{layout.RECORD}", encode(record))
    export(dataset, "npz", str(tmp_path / "out"))
    arrays = np.load(tmp_path / "out/train.npz")
    assert arrays["transmittance"].tolist() == [[1, 0], [1, 0.1], [1, 0.2], [1, 0.3]]
    assert np.isnan(arrays["mean_free_path"]).all()


def test_an_image_that_is_too_large_is_not_read(tmp_path):
    """It may be larger than memory."""
    dataset = make_dataset(tmp_path / "set", missing=range(6, 24))
    file = f"{dataset.folders[2]}/{layout.RADIANCE}"
    with (tmp_path / "set" / file).open("r+b") as image:
        image.truncate(2**42)  # a hole
    with pytest.raises(CorruptFileError, match=f"{file}: is not what its record says"):
        export(dataset, "npz", str(tmp_path / "out"))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("damage", ["flipped", "gone"])
def test_a_damaged_sample_is_named_and_leaves_no_export(tmp_path, kind, damage):
    dataset = make_dataset(tmp_path / "set", missing=range(6, 24))
    file = f"{dataset.folders[2]}/{layout.RADIANCE}"
    content = bytearray(dataset.store.read(file))
    content[-20] ^= 1
    dataset.store.remove(file)
    if damage == "flipped":
        dataset.store.write(file, bytes(content))
    with pytest.raises(CorruptFileError, match=re.escape(file)):
        export(dataset, kind, str(tmp_path / "out"))
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


def test_an_interrupted_export_leaves_nothing(dataset, tmp_path):
    def stop(count, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export(dataset, "parquet", str(tmp_path / "out"), stop)
    assert not list(tmp_path.iterdir())


def test_a_full_disk_leaves_nothing(dataset, tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(webdataset.tarfile.TarFile, "addfile", full)
    with pytest.raises(OutputError, match="No space left"):
        export(dataset, "webdataset", str(tmp_path / "out"))
    assert not list(tmp_path.iterdir())


def test_what_is_there_is_not_overwritten(dataset, tmp_path):
    (tmp_path / "mine").write_text("mine")
    for out in (tmp_path, tmp_path / "mine", dataset.store.folder / "shards", dataset.store.folder):
        with pytest.raises(ConfigError, match=re.escape(str(out))):
            export(dataset, "npz", str(out))
    assert contents(tmp_path) == {"mine": b"mine"}
    assert not (dataset.store.folder / "shards").exists()


def test_an_empty_folder_is_accepted(dataset, tmp_path):
    export(dataset, "webdataset", str(tmp_path))
    assert (tmp_path / "train-000000.tar").is_file()


def test_exports_go_to_object_stores_and_come_from_them(dataset, tmp_path):
    remote = make_dataset("memory://exported/set", MISSING, FAILED)
    for kind in KINDS:
        export(dataset, kind, str(tmp_path / kind))
        export(remote, kind, f"memory://exports/{kind}")
        files = fsspec.filesystem("memory")
        assert contents(tmp_path / kind) == {
            path.rpartition("/")[2]: files.cat_file(path) for path in files.ls(f"/exports/{kind}", detail=False)
        }
    with pytest.raises(ConfigError, match="not empty"):
        export(remote, "npz", "memory://exports/npz")


def test_command_says_what_is_left_out(dataset, tmp_path):
    done = CliRunner().invoke(app, ["export", "webdataset", dataset.store.location, "--out", str(tmp_path / "out")])
    assert done.exit_code == 3
    assert "22 samples in 4 files" in done.output
    assert "1 failed and 1 missing samples are not in it" in done.output


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["export", "tar", "{set}", "--out", "{out}"], "accepted: webdataset, parquet, npz"),
        (["export", "npz", "{out}/none", "--out", "{out}"], "holds no dataset"),
        (["export", "npz", "{set}", "--out", "{set}/out"], "lies in the dataset"),
        (["export", "npz", "{set}"], "--out"),
    ],
)
def test_command_refuses(dataset, tmp_path, arguments, expected):
    filled = [argument.format(set=dataset.store.location, out=tmp_path) for argument in arguments]
    done = CliRunner().invoke(app, filled)
    assert done.exit_code == 2
    assert expected in done.output


def test_nothing_complete_is_nothing_to_export(tmp_path):
    dataset = make_dataset(tmp_path / "set", missing=range(24))
    with pytest.raises(ConfigError, match="no complete sample"):
        export(dataset, "npz", str(tmp_path / "out"))


def test_commands_forms_are_those_there_are():
    from generators.commands.export import FORMS

    assert tuple(KINDS) == FORMS
