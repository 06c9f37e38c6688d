"""Labels and card of a dataset, made from its files alone."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from markdown_it import MarkdownIt
from ruamel.yaml import YAML

from fgf_warp.errors import CorruptFileError
from generators.dataset import layout
from generators.dataset.plan_table import read_plan, write_plan
from generators.dataset.reader import Dataset
from generators.dataset.record import encode
from generators.publishing.columns import RESERVED
from generators.publishing.publish import publish
from tests.generators.made_up import META, make_dataset, plan_rows

MISSING, FAILED = (3,), (5, 23)


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    dataset = make_dataset(tmp_path_factory.mktemp("made") / "set", MISSING, FAILED)
    publish(dataset)
    return dataset


@pytest.fixture
def dataset(published, tmp_path):
    """A copy to change."""
    shutil.copytree(published.store.folder, tmp_path, dirs_exist_ok=True)
    return Dataset(tmp_path)


def change_plan(dataset, table=None, **changes):
    """Publishes the dataset under another plan."""
    meta, planned = read_plan(dataset.store.read(layout.PLAN), "plan")
    dataset.store.write(layout.PLAN, write_plan(replace(meta, **changes), planned if table is None else table))
    publish(Dataset(dataset.store.location))


@pytest.fixture(scope="module")
def labels(published):
    return pd.read_parquet(published.store.folder / layout.INDEX)


def rewrite(dataset, index, **changes):
    """Changes the record of a sample."""
    name = f"{dataset.folders[index]}/{layout.RECORD}"
    dataset.store.write(name, encode(replace(dataset.record(index), **changes)))


def test_every_sample_of_the_plan_has_a_row_with_its_status(labels):
    assert labels["index"].tolist() == list(range(24))
    by_status = {status: tuple(rows["index"]) for status, rows in labels.groupby("status")}
    assert by_status.pop("complete") == tuple(i for i in range(24) if i not in (*MISSING, *FAILED))
    assert by_status == {"missing": MISSING, "failed": FAILED}


def test_labels_are_those_of_plan_record_and_timing(published, labels):
    for row, planned in zip(labels.to_dict("records"), plan_rows(), strict=True):
        for name, value in planned.items():
            assert row[name] == value or (value is None and np.isnan(row[name])), name
        assert row["config_hash"] == META.digest
        if row["status"] == "complete":
            record, timing = published.record(row["index"]), published.timing(row["index"])
            assert row["spp"] == record.spp
            assert row["standard_error"] == record.standard_error
            assert row["truncated"] == record.truncated
            assert row["render_seconds"] == timing.render_seconds
            assert row["luminance_mean"] == record.statistics["luminance_mean"]
            for name in ("exr", "png"):
                assert (published.store.folder / row[name]).is_file()
        else:
            assert pd.isna(row["spp"])
            assert row["exr"] is None or pd.isna(row["exr"])


def test_seeds_keep_all_their_bits(published):
    table = pq.read_table(published.store.folder / layout.INDEX)
    assert table.schema.field("seed").type == pa.int64()
    assert table["seed"].to_pylist() == [row["seed"] for row in plan_rows()]
    train = pq.read_table(published.store.folder / layout.split_metadata("train"))
    assert train["seed"].to_pylist() == [plan_rows()[index]["seed"] for index in train["index"].to_pylist()]


def test_every_column_is_flat_and_says_what_it_means(published):
    schema = pq.read_schema(published.store.folder / layout.INDEX)
    for field in schema:
        assert re.fullmatch(r"[A-Za-z]\w*", field.name), "a dot is a step into a structure to some loaders"
        assert not re.search(r"file_names?$", field.name), "datasets takes such a column for the path of an image"
        assert field.metadata[b"meaning"]
        assert b"unit" in field.metadata
    assert schema.field("S_w").metadata[b"unit"] == b"unit^(-2-2H)"
    assert not {axis.name for axis in META.axes} & RESERVED


def test_splits_hold_their_complete_samples(published, labels):
    complete = labels[labels.status == "complete"]
    for split, rows in complete.groupby("split"):
        table = pd.read_parquet(published.store.folder / layout.split_metadata(split))
        assert table["index"].tolist() == rows["index"].tolist()
        assert table["file_name"].tolist() == [f"{index:06d}/image.png" for index in rows["index"]]
        assert "status" not in table


def test_labels_of_all_splits_have_the_same_types(published):
    schemas = [
        pq.read_schema(published.store.folder / layout.split_metadata(split)).remove_metadata()
        for split in layout.SPLITS
    ]
    assert schemas[0] == schemas[1] == schemas[2]


def test_publishing_again_changes_nothing(published):
    before = {name: published.store.read(name) for name in (layout.INDEX, layout.CARD, layout.CONTACT_SHEET)}
    publish(Dataset(published.store.location))
    assert before == {name: published.store.read(name) for name in before}


def test_an_object_store_holds_the_same_files(published):
    dataset = make_dataset("memory://published", MISSING, FAILED)
    publish(dataset)
    for name in (layout.INDEX, layout.CARD, layout.CONTACT_SHEET, *map(layout.split_metadata, layout.SPLITS)):
        assert dataset.store.read(name) == published.store.read(name), name


def test_a_split_that_lost_its_samples_loses_its_labels(dataset):
    shutil.rmtree(dataset.store.folder / "data/test")
    publish(dataset)
    assert not dataset.store.exists(layout.split_metadata("test"))
    assert [files["split"] for files in front_matter(dataset)["configs"][0]["data_files"]] == ["train", "validation"]


def test_nothing_rendered_yet_is_a_table_of_what_is_missing(tmp_path):
    dataset = make_dataset(tmp_path, missing=range(24))
    publish(dataset)
    assert set(pd.read_parquet(tmp_path / layout.INDEX)["status"]) == {"missing"}
    assert "configs" not in front_matter(dataset)


def test_curves_are_lists_and_infinite_means_are_null(dataset):
    for index in dataset.complete():
        mean = None if index == 0 else 1.5
        rewrite(
            dataset, index, targets={"transmittance": [1.0, 0.5], "transmittance_t": [0, 1], "mean_free_path": mean}
        )
    publish(dataset)
    table = pq.read_table(dataset.store.folder / layout.INDEX)
    assert table.schema.field("transmittance").type == pa.list_(pa.float64())
    assert table.schema.field("mean_free_path").metadata[b"unit"] == b"unit"
    assert table["transmittance_t"][7].as_py() == [0.0, 1.0]
    assert table["mean_free_path"][0].as_py() is None
    assert table["mean_free_path"][1].as_py() == 1.5


def test_a_column_without_any_value_is_a_number(dataset):
    place = dataset.plan.column_names.index("L")
    change_plan(dataset, dataset.plan.set_column(place, "L", pa.nulls(24)))
    assert pq.read_schema(dataset.store.folder / layout.INDEX).field("L").type == pa.float64()


@pytest.mark.parametrize(("name", "content"), [(layout.RECORD, b"{"), (layout.TIMING, b"{"), (layout.TIMING, None)])
def test_a_damaged_record_is_named(dataset, name, content):
    file = f"{dataset.folders[4]}/{name}"
    dataset.store.remove(file)
    if content is not None:
        dataset.store.write(file, content)
    with pytest.raises(CorruptFileError, match=re.escape(file)):
        publish(dataset)


def test_views_are_optional(dataset):
    change_plan(dataset, png=False)
    assert "file_name" not in pq.read_schema(dataset.store.folder / layout.split_metadata("train")).names
    assert pd.read_parquet(dataset.store.folder / layout.INDEX)["png"].isna().all()
    assert front_matter(dataset)["configs"][0]["data_files"][0]["path"] == ["data/train/metadata.parquet"]
    croissant = json.loads(dataset.store.read(layout.CROISSANT))
    assert "views" not in [record_set["name"] for record_set in croissant["recordSet"]]


def card_of(dataset):
    return dataset.store.read(layout.CARD).decode()


def front_matter(dataset):
    return YAML(typ="safe").load(card_of(dataset).split("---\n")[1])


def test_the_card_says_what_there_is(published):
    card = card_of(published)
    assert front_matter(published)["license"] == "cc0-1.0"
    assert "| samples | 21 of 24 planned |" in card
    assert "| `H` | Hurst exponent of the field; -0.5 is white noise |  | -0.5, -0.25, -0.1 |" in card
    assert "0.5 to 2, drawn or computed for each sample" in card
    assert "| train | 15 | 0 | 1 |" in card
    assert "`sigma_m` = 2" in card
    assert META.digest in card
    assert "![" in card
    assert "](contact_sheet.png)" in card
    for name in pq.read_schema(published.store.folder / layout.INDEX).names:
        assert f"| `{name}` |" in card


def test_tables_of_the_card_have_cells_for_their_heads(published):
    width = 0
    for line in card_of(published).splitlines():
        if not line.startswith("|"):
            width = 0
            continue
        cells = len(re.findall(r"(?<!\\)\|", line))
        assert width in (0, cells), line
        width = cells


def test_a_name_that_yaml_would_read_otherwise_stays_a_name(dataset):
    change_plan(dataset, name="no: 1", license="")
    assert front_matter(dataset)["pretty_name"] == "no: 1"
    assert "license" not in front_matter(dataset)


NASTY = (
    "a | b",
    "`ticks` ``` and ``two``",
    "<script>alert(1)</script> &amp; &lt;",
    "# heading\n---\n\n- item\r\n| x |",
    "*stars* _lines_ ~~gone~~ [link](http://x) ![picture](y)",
    "1. first\n\n    code\n",
    "$x_1$ \\| \\` \\\\",
    "\u2028\u0007\ud800 ends {{ meta.name }} {% raw %}",
    "---\nlicense: mit",
    "--- \u2603 \U0001f600",
    "<!-- \n\n```python",
)


def as_read(text):
    """What a page shows of a text in one line."""
    shown = re.sub(r"[\x00-\x1f\ufeff\ud800-\udfff]", lambda found: " " if found[0].isspace() else "\ufffd", text)
    return " ".join(shown.split())


def cells_of(tokens):
    """The tables of a page: rows of cells, as text."""
    rows, row, text = [], None, None
    for token in tokens:
        if token.type == "tr_open":
            row = []
        elif token.type in ("td_open", "th_open"):
            text = None
        elif token.type == "inline" and row is not None:
            text = "".join(child.content for child in token.children)
        elif token.type in ("td_close", "th_close"):
            row.append(text or "")
        elif token.type == "tr_close":
            rows.append(row)
            row = None
    return rows


KINDS = {"text", "text_special", "code_inline", "softbreak", "strong_open", "strong_close", "image"} | {
    "link_open",
    "link_close",
}
"""What lines of our cards consist of."""
TITLES = ["What varies", "The physics", "Load it", "Columns", "Files", "Check it, render it again", "Licence", "Cite"]


@pytest.mark.parametrize("text", NASTY)
def test_words_of_others_are_only_words_in_the_card(dataset, text):
    """Of the dataset, the stage, the medium, an axis, its target, unit and values, and of the licence."""
    name = text.replace("\ud800", "")  # a table cannot hold it
    axis = replace(META.axes[3], name=name, target=f"/World{{{name}}}", unit=name, values=None)
    table = dataset.plan
    values = [f"{name} {look}" for look in table["look"].to_pylist()]
    table = table.set_column(table.column_names.index("look"), name, [values])
    words = dict.fromkeys(("name", "description", "license", "scene", "medium"), text)
    change_plan(dataset, table, axes=(*META.axes[:3], axis), **words)
    _, head, body = re.split(r"^---\n", dataset.store.read(layout.CARD).decode(), maxsplit=2, flags=re.M)
    front = YAML(typ="safe").load(head)
    assert as_read(front["pretty_name"]) == as_read(text)
    assert as_read(front["license"]) == as_read(text.lower())
    tokens = MarkdownIt("gfm-like", {"linkify": False}).parse(body)
    headings = [tokens[i + 1] for i, token in enumerate(tokens) if token.type == "heading_open"]
    assert "".join(child.content for child in headings[0].children) == as_read(text)
    assert [heading.content for heading in headings[1:]] == TITLES
    assert {child.type for token in tokens for child in token.children or ()} <= KINDS
    assert not [token for token in tokens if token.type.startswith("html")]
    rows = cells_of(tokens)
    facts = {row[0]: row[1] for row in rows if len(row) == 2}
    assert facts["scene"] == f"{as_read(text)}, medium {as_read(text)}"
    assert facts["licence"] == as_read(text)
    (swept, column) = (row for row in rows if row[0] == as_read(name))
    assert swept[1:3] == [f"value of {as_read(axis.target)}", as_read(name)]
    assert swept[3] == f"{as_read(values[0])}, {as_read(values[1])}"
    assert column == [as_read(name), "string", as_read(name), f"value of {as_read(axis.target)}"]
