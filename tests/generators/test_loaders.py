"""A dataset and its exports load with the libraries that others use, and nothing of ours."""

import hashlib
import io
import json
import logging
import os
import re
import shutil
from pathlib import Path
from unittest import mock

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pandas as pd
import pytest

from generators.dataset import layout
from generators.dataset.plan_table import read_plan, write_plan
from generators.dataset.reader import Dataset
from generators.publishing.exports.export import export
from generators.publishing.publish import publish
from tests.generators.made_up import make_dataset, plan_rows

MISSING, FAILED = (3,), (5,)
SPLITS = {"train": 15, "validation": 4, "test": 3}


@pytest.fixture(scope="module")
def offline(tmp_path_factory):
    """The libraries see no network, and keep what they keep in a folder of this test."""
    home = tmp_path_factory.mktemp("home")
    with mock.patch.dict(os.environ, {"HF_HUB_OFFLINE": "1", "HF_HOME": str(home), "CROISSANT_CACHE": str(home)}):
        import datasets

        with mock.patch.object(datasets.config, "HF_DATASETS_CACHE", home / "datasets"):
            datasets.disable_progress_bars()
            yield datasets


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """In a folder whose name alone would make all of it the test split, with pictures that are parts of a stage."""
    dataset = make_dataset(tmp_path_factory.mktemp("made") / "test_x", MISSING, FAILED)
    picture = dataset.store.read(f"{dataset.folders[0]}/{layout.IMAGE}")
    for name in ("train.png", "validation-00000-of-00001.png"):
        dataset.store.write(layout.scene_file(name), picture)
    publish(dataset)
    return dataset


@pytest.fixture(scope="module")
def exports(dataset, tmp_path_factory):
    """Folders of the exports by their form, with names like that of the dataset."""
    parent = tmp_path_factory.mktemp("exports")
    folders = {kind: parent / f"train_{kind}" for kind in ("webdataset", "parquet", "npz")}
    for kind, folder in folders.items():
        export(dataset, kind, str(folder))
    return folders


def pixels_of(file):
    image = oiio.ImageInput.open(str(file))
    return image.read_image("uint8")


def test_datasets_loads_views_with_all_labels_by_split(offline, dataset):
    loaded = offline.load_dataset(dataset.store.location)
    assert {split: rows.num_rows for split, rows in loaded.items()} == SPLITS
    columns = set(pd.read_parquet(dataset.store.folder / layout.INDEX)) - {"status"}
    for rows in loaded.values():
        assert set(rows.column_names) == {*columns, "image"}
        for row in rows:
            assert plan_rows()[row["index"]].items() <= row.items()
            assert np.array_equal(np.asarray(row["image"]), pixels_of(dataset.store.folder / row["png"]))


def test_datasets_streams_them(offline, dataset):
    rows = list(offline.load_dataset(dataset.store.location, split="validation", streaming=True))
    assert [row["index"] for row in rows] == [4, 10, 16, 22]
    assert all(row["image"].size == (16, 12) for row in rows)


def test_a_split_of_one_sample_is_a_folder_of_images_too(offline, dataset, tmp_path):
    """Of as many tables as images in a split, `datasets` would take it for tables."""
    shutil.copytree(dataset.store.folder, tmp_path / "one")
    one = Dataset(tmp_path / "one")
    for index in (11, 17):
        shutil.rmtree(one.store.folder / one.folders[index])
    publish(one)
    loaded = offline.load_dataset(str(tmp_path / "one"))
    assert {split: rows.num_rows for split, rows in loaded.items()} == {**SPLITS, "test": 1}
    assert loaded["test"][0]["image"].size == (16, 12)


def test_without_views_datasets_loads_the_labels(offline, dataset, tmp_path):
    shutil.copytree(dataset.store.folder, tmp_path / "train_labels")
    plain = Dataset(tmp_path / "train_labels")
    meta, table = read_plan(plain.store.read(layout.PLAN), "plan")
    plain.store.write(layout.PLAN, write_plan(type(meta)(**{**vars(meta), "png": False}), table))
    for folder in plain.folders:
        plain.store.remove(f"{folder}/{layout.IMAGE}")
    publish(Dataset(tmp_path / "train_labels"))
    loaded = offline.load_dataset(str(tmp_path / "train_labels"))
    assert {split: rows.num_rows for split, rows in loaded.items()} == SPLITS
    for row in loaded["train"]:
        assert plan_rows()[row["index"]].items() <= row.items()


def test_croissant_is_valid_and_its_hash_is_that_of_the_labels(offline, dataset, caplog):
    import mlcroissant

    with caplog.at_level(logging.WARNING):
        described = mlcroissant.Dataset(dataset.store.folder / layout.CROISSANT)
    assert not caplog.records
    assert not described.metadata.issues.errors
    assert not described.metadata.issues.warnings
    assert json.loads(dataset.store.read(layout.CROISSANT))["conformsTo"].endswith("/croissant/1.1")
    # What the validator does not look at.
    file = next(item for item in described.metadata.distribution if item.uuid == "index")
    content = dataset.store.read(file.content_url)
    assert file.sha256 == hashlib.sha256(content).hexdigest()
    assert file.content_size == f"{len(content)} B"


def test_croissant_reads_labels_and_views(offline, dataset):
    import mlcroissant

    described = mlcroissant.Dataset(dataset.store.folder / layout.CROISSANT)
    samples = [plain(record) for record in described.records("samples")]
    assert [sample["index"] for sample in samples] == list(range(24))
    for sample, planned in zip(samples, plan_rows(), strict=True):
        assert planned.items() <= sample.items()
    views = {record["path"]: record["image"] for record in map(plain, described.records("views"))}
    complete = [sample for sample in samples if sample["status"] == "complete"]
    assert len(views) == len(complete) == sum(SPLITS.values())
    for sample in complete:
        assert np.array_equal(np.asarray(views[sample["png"]]), pixels_of(dataset.store.folder / sample["png"]))
    assert [plain(record)["name"] for record in described.records("splits")] == list(SPLITS)


def plain(record):
    """A record of mlcroissant without the name of its set, and text as text."""
    return {
        name.rpartition("/")[2]: value.decode() if isinstance(value, bytes) else value for name, value in record.items()
    }


def shards_of(folder, split):
    return sorted(str(path) for path in folder.glob(f"{split}-*.tar"))


@pytest.mark.parametrize("split", SPLITS)
def test_webdataset_loads_the_shards(offline, dataset, exports, split):
    import webdataset

    samples = list(webdataset.WebDataset(shards_of(exports["webdataset"], split), shardshuffle=False).decode("pil"))
    assert len(samples) == SPLITS[split]
    for sample in samples:
        assert re.fullmatch(r"\d{6}", sample["__key__"])
        labels = sample["json"]
        assert plan_rows()[int(sample["__key__"])].items() <= labels.items()
        assert type(labels["S_w"]) is float
        assert type(labels["spp"]) is int
        folder = dataset.store.folder / dataset.folders[labels["index"]]
        assert np.array_equal(np.asarray(sample["png"]), pixels_of(folder / layout.IMAGE))
        assert sample["exr"] == (folder / layout.RADIANCE).read_bytes()


def test_datasets_loads_the_shards(offline, exports):
    loaded = offline.load_dataset(str(exports["webdataset"]))
    assert {split: rows.num_rows for split, rows in loaded.items()} == SPLITS
    row = loaded["validation"][0]
    assert (row["__key__"], row["json"]["index"], row["png"].size) == ("000004", 4, (16, 12))


def test_datasets_loads_the_tables(offline, dataset, exports):
    loaded = offline.load_dataset(str(exports["parquet"]))
    assert {split: rows.num_rows for split, rows in loaded.items()} == SPLITS
    for row in loaded["test"]:
        assert plan_rows()[row["index"]].items() <= row.items()
        folder = dataset.store.folder / dataset.folders[row["index"]]
        assert np.array_equal(np.asarray(row["image"]), pixels_of(folder / layout.IMAGE))
        assert row["exr"] == (folder / layout.RADIANCE).read_bytes()


def test_pandas_reads_the_tables(dataset, exports):
    from PIL import Image

    table = pd.read_parquet(exports["parquet"] / "train.parquet")
    row = table.iloc[-1]
    folder = dataset.store.folder / dataset.folders[row["index"]]
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(row["image"]["bytes"]))), pixels_of(folder / layout.IMAGE))
    assert table["H"].tolist() == [plan_rows()[index]["H"] for index in table["index"]]


def test_code_of_the_card_runs_as_it_stands(offline, dataset, exports, monkeypatch):
    """A reader copies it: from the dataset's folder, with shards beside it."""
    blocks = re.findall(r"```python\n(.*?)```", dataset.store.read(layout.CARD).decode(), re.DOTALL)
    assert len(blocks) == 4
    monkeypatch.chdir(dataset.store.folder)
    shards = Path("../shards")
    if not shards.exists():
        shutil.copytree(exports["webdataset"], shards)
    names = {}
    for block in blocks:
        exec(block.replace("PATH/TO/THIS/FOLDER", str(dataset.store.folder)), names)
    assert len(names["labels"]) == sum(SPLITS.values())
    assert names["pixels"].shape == (12, 16, len(names["names"]))
    view, labels = next(iter(names["samples"]))
    assert (view.size, labels["split"]) == ((16, 12), "train")


def test_code_of_the_exports_runs_as_it_stands(offline, exports, monkeypatch):
    for folder in exports.values():
        monkeypatch.chdir(folder)
        (block,) = re.findall(r"```python\n(.*?)```", (folder / "README.md").read_text(), re.DOTALL)
        exec(block, {})
