"""What `fgf verify` finds in a dataset."""

import json
import random
import shutil

import numpy as np
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from fgf_warp.output.color import write_png
from fgf_warp.output.exr import read_exr
from fgf_warp.output.images import write_image
from generators.checking.findings import Kind, name_ranges
from generators.checking.verify import check_plan, verify_dataset
from generators.cli import app
from generators.dataset import layout
from generators.dataset.reader import Dataset
from generators.dataset.record import Failure, decode_record, encode, file_entry
from generators.dataset.store import Store
from generators.publishing.publish import publish
from tests.generators.made_up import make_dataset

SAMPLE = "data/train/000002"
OF_A_SAMPLE = tuple(f"{SAMPLE}/{name}" for name in ("radiance.exr", "image.png", "record.json", "timing.json"))
OF_THE_DATASET = (
    *("plan.parquet", "config.yaml", "index.parquet", "data/train/metadata.parquet"),
    *("croissant.json", "README.md", "contact_sheet.png"),
)
FLIPS = 6


@pytest.fixture(scope="session")
def published(tmp_path_factory):
    """A whole dataset, not to be changed."""
    folder = tmp_path_factory.mktemp("published") / "made-up"
    publish(make_dataset(folder))
    return folder


@pytest.fixture
def folder(published, tmp_path):
    """A copy of it."""
    return shutil.copytree(published, tmp_path / "made-up")


def findings(folder, **options):
    damage = check_plan(str(folder))
    return [damage] if damage else list(verify_dataset(Dataset(folder), **options).findings)


def names(folder, kind=Kind.DAMAGED, **options):
    return {finding.name for finding in findings(folder, **options) if finding.kind is kind}


def replace_file(folder, name, change):
    """Replaces an image, and its entry in the record: only who decodes it sees that."""
    path = folder / SAMPLE / name
    change(path)
    record_path = folder / SAMPLE / layout.RECORD
    record = decode_record(record_path.read_bytes(), "")
    entries = {**record.files, name: file_entry(path.read_bytes())}
    record_path.write_bytes(encode(type(record)(**{**vars(record), "files": entries})))


@pytest.mark.parametrize("deep", [False, True])
def test_a_whole_dataset_is_whole(published, deep):
    found = verify_dataset(Dataset(published), deep=deep)
    assert found.findings == ()
    assert (found.planned, found.complete, found.files) == (24, 24, 4 * 24 + 6 + 3)


@pytest.mark.parametrize("name", [*OF_A_SAMPLE, *OF_THE_DATASET])
def test_any_flipped_byte_is_named(folder, name):
    path = folder / name
    content = path.read_bytes()
    rng = random.Random(name)
    for _ in range(FLIPS):
        at = rng.randrange(len(content))
        path.write_bytes(content[:at] + bytes([content[at] ^ 1 << rng.randrange(8)]) + content[at + 1 :])
        assert name in names(folder), f"byte {at}"


def other_url(document):
    document["distribution"][2]["contentUrl"] = "elsewhere.yaml"


def url_of_another(document):
    document["distribution"][2]["contentUrl"] = "README.md"


def without_a_hash(document):
    del document["distribution"][1]["sha256"]


def without_a_file(document):
    del document["distribution"][3]


def other_size(document):
    document["distribution"][0]["contentSize"] = "1 B"


def other_name(document):
    document["name"] = "something else"


def many_urls(document):
    document["distribution"][0]["contentUrl"] = ["index.parquet", {}]


def table_of_no_split(document):
    listed = next(one for one in document["distribution"] if one.get("contentUrl") == "data/test/metadata.parquet")
    document["distribution"].append({**listed, "contentUrl": "data/other/metadata.parquet"})


def no_list(document):
    document["distribution"] = {"files": []}


def other_column(document):
    document["recordSet"][-1]["field"][3]["description"] = "something else"


CHANGES = (
    *(other_url, url_of_another, many_urls, table_of_no_split, without_a_hash, without_a_file),
    *(other_size, other_name, no_list, other_column),
)


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("beside", [None, "README.md", "data/test/metadata.parquet"])
def test_a_change_of_the_metadata_is_named_whatever_else_is_wrong(folder, change, beside):
    path = folder / layout.CROISSANT
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n")
    if beside:
        (folder / beside).unlink()
    assert names(folder) == {layout.CROISSANT, *([beside] if beside else [])}


def test_blanks_in_the_metadata_are_a_change(folder):
    path = folder / layout.CROISSANT
    path.write_text(json.dumps(json.loads(path.read_text()), ensure_ascii=False))
    (found,) = findings(folder)
    assert str(found) == "croissant.json: is not as it was written; expected: the same without a change"


def claim(folder, name):
    """Has the metadata say that the file is as it should be."""
    path, entry = folder / layout.CROISSANT, file_entry((folder / name).read_bytes())
    document = json.loads(path.read_text())
    (listed,) = (one for one in document["distribution"] if one.get("contentUrl") == name)
    listed |= {"sha256": entry.sha256, "contentSize": f"{entry.bytes} B"}
    path.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n")


def test_card_and_tables_are_what_would_be_published_whatever_the_metadata_say(folder):
    card = folder / layout.CARD
    card.write_text(card.read_text().replace("CC0-1.0", "MIT"))
    claim(folder, layout.CARD)
    table = pq.read_table(folder / "data/train/metadata.parquet")
    pq.write_table(table.slice(1), folder / "data/train/metadata.parquet")
    claim(folder, "data/train/metadata.parquet")
    assert names(folder) == {layout.CARD, "data/train/metadata.parquet"}


@pytest.mark.parametrize("name", [*OF_A_SAMPLE, *OF_THE_DATASET])
def test_truncated_and_deleted_files_are_named(folder, name):
    path = folder / name
    path.write_bytes(path.read_bytes()[:-20])
    assert names(folder) == {name}
    path.unlink()
    assert names(folder) == {name}
    assert findings(folder)[0].found == "missing"


def test_a_sample_that_is_gone_is_missed(folder):
    shutil.rmtree(folder / SAMPLE)
    (found,) = findings(folder)
    assert (found.kind, found.name, found.sample) == (Kind.DAMAGED, SAMPLE, 2)
    assert found.expected == "the sample, as index.parquet says"


def test_an_unfinished_dataset_is_incomplete_and_not_damaged(tmp_path):
    publish(make_dataset(tmp_path, missing=[3, 4, 6, 20], failed=[8]))
    found = verify_dataset(Dataset(tmp_path))
    assert not found.is_damaged
    assert [str(finding) for finding in found.findings] == [
        "data/train/000008: failed after 2 attempts: 3 samples are not finite, most of them in pixel (1, 2); "
        "expected: a sample",
        "data/train: 3 of 16 samples are missing: 3, 6, 20; expected: 16 samples",
        "data/validation: 1 of 4 samples are missing: 4; expected: 4 samples",
    ]


def test_a_run_that_was_killed_leaves_labels_outdated(tmp_path, published):
    publish(make_dataset(tmp_path, missing=[3]))
    shutil.copytree(published / "data/train/000003", tmp_path / "data/train/000003")
    found = verify_dataset(Dataset(tmp_path))
    assert [(finding.kind, finding.name) for finding in found.findings] == [(Kind.OUTDATED, "index.parquet")]
    assert not found.is_damaged
    shutil.rmtree(tmp_path / "data/train/000009")
    (tmp_path / "README.md").unlink()
    assert names(tmp_path, Kind.OUTDATED) == {"index.parquet", "README.md"}


def test_what_does_not_belong_is_named_once(folder):
    for name in ("notes.txt", "old/a.txt", "old/deep/b.txt", f"{SAMPLE}/more.exr", "data/train/000099/radiance.exr"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"x")
    (folder / "data/dev").mkdir()
    (folder / ".git").mkdir()
    (folder / "run/anything").mkdir(parents=True)
    (folder / ".notes.partial.txt").touch()
    surplus = {".notes.partial.txt", "notes.txt", "old", f"{SAMPLE}/more.exr", "data/train/000099", "data/dev"}
    assert names(folder, Kind.SURPLUS) == surplus
    assert len(findings(folder)) == len(surplus)


def test_half_written_leftovers_are_told_from_what_does_not_belong(folder):
    (folder / "data/train/.000003.0123456789ab.partial").mkdir()
    (folder / ".index.0123456789ab.partial.parquet").write_bytes(b"PAR1")
    assert names(folder, Kind.LEFTOVER) == {
        "data/train/.000003.0123456789ab.partial",
        ".index.0123456789ab.partial.parquet",
    }
    assert len(findings(folder)) == 2


def test_a_sample_of_another_plan_is_named(folder):
    path = folder / SAMPLE / layout.RECORD
    record = decode_record(path.read_bytes(), "")
    path.write_bytes(encode(type(record)(**{**vars(record), "plan": "0" * 64, "index": 5, "spp": 9})))
    found = [str(finding) for finding in findings(folder) if finding.name == f"{SAMPLE}/record.json"]
    assert len(found) == 3
    assert found[0].endswith("index 5; expected: 2, as its folder says")
    assert "plan 000" in found[1]
    assert "9 samples per pixel; expected: at most 8, as planned" in found[2]


def test_a_changed_number_is_blamed_on_who_changed(folder):
    """The record is a valid one, and the labels are as they were written."""
    path = folder / SAMPLE / layout.RECORD
    record = decode_record(path.read_bytes(), "")
    path.write_bytes(encode(type(record)(**{**vars(record), "truncated": 77})))
    (found,) = findings(folder)
    assert str(found) == f"{SAMPLE}/record.json: truncated = 77 of sample 2; expected: 0, as index.parquet says"


def write_exr(path, change):
    channels, header = read_exr(path)
    changed = change({name: plane.copy() for name, plane in channels.items()}, header) or channels
    parameters = {"compression": "zip", "fgf:parameters": json.dumps(header)}
    write_image(path, np.stack(list(changed.values()), axis=2), tuple(changed), parameters)


def not_finite(channels, header):
    channels["G"][3, 4] = np.nan
    return channels


def depth_not_a_number(channels, header):
    channels["Z"][3, 4] = np.nan
    return channels


def without_depth(channels, header):
    return {name: plane for name, plane in channels.items() if name != "Z"}


def narrower(channels, header):
    return {name: plane[:, :-1] for name, plane in channels.items()}


def brighter(channels, header):
    channels["R"] += 0.1
    return channels


def other_seed(channels, header):
    header["settings"]["seed"] += 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (not_finite, "1 values of channel G that are not finite; expected: none"),
        (depth_not_a_number, "1 values of channel Z that are not finite; expected: none"),
        (without_depth, "channels A, B, G, R, variance.B, variance.G, variance.R; expected: A, B, G, R, Z, variance.B"),
        (narrower, "15 x 12 pixels; expected: 16 x 12"),
        (brighter, "red_mean = "),
        (other_seed, f"seed {2**62 + 3} in the header; expected: {2**62 + 2}"),
    ],
)
def test_deep_looks_into_the_radiance(folder, change, message):
    replace_file(folder, layout.RADIANCE, lambda path: write_exr(path, change))
    assert findings(folder) == []
    assert any(message in str(finding) for finding in findings(folder, deep=True))


def test_deep_compares_the_view_with_the_radiance(folder):
    def darker(path):
        channels, _ = read_exr(path.with_name(layout.RADIANCE))
        write_png(path, 0.9 * np.stack([channels[name] for name in "RGB"], axis=2))

    replace_file(folder, layout.IMAGE, darker)
    assert findings(folder) == []
    (found,) = findings(folder, deep=True)
    assert found.name == f"{SAMPLE}/image.png"
    assert "pixels that are not those of radiance.exr" in found.found


def test_failures_that_crowd_are_told(tmp_path):
    """Eight of 24 samples, all those of one H: by chance once in 10^5 runs."""
    dataset = make_dataset(tmp_path, failed=range(8))
    crowded = [str(finding) for finding in verify_dataset(dataset).findings if finding.name == layout.FAILURES]
    assert crowded == [
        "run/failures: 8 failed samples that crowd in H, around -0.5; expected: as the others, around -0.175"
    ]
    spread = make_dataset(tmp_path / "spread", failed=range(0, 24, 3))
    assert names(tmp_path / "spread", Kind.INCOMPLETE) == {spread.folders[index] for index in range(0, 24, 3)}


def test_an_object_store_is_looked_at_alike(published):
    store = Store("memory://verified")
    for path in published.rglob("*"):
        if path.is_file():
            store.write(str(path.relative_to(published)), path.read_bytes())
    assert findings("memory://verified", deep=True) == []
    store.remove(f"{SAMPLE}/image.png")
    assert names("memory://verified") == {f"{SAMPLE}/image.png"}


def test_exit_codes(folder, tmp_path):
    runner = CliRunner()
    whole = runner.invoke(app, ["verify", str(folder), "--deep"])
    assert whole.exit_code == 0
    assert "24 of 24 samples, 105 files" in whole.stdout
    assert "all is as it should be" in whole.stdout
    (folder / "notes.txt").touch()
    surplus = runner.invoke(app, ["verify", str(folder)])
    assert surplus.exit_code == 0
    assert "all of the dataset is as it should be; beside it 1 surplus" in surplus.stdout
    assert "notes.txt: a file that is not of the dataset; expected: nothing" in surplus.stdout
    publish(make_dataset(tmp_path / "part", missing=[5]))
    assert runner.invoke(app, ["verify", str(tmp_path / "part")]).exit_code == 3
    (folder / "plan.parquet").write_bytes(b"PAR1")
    lost = runner.invoke(app, ["verify", str(folder)])
    assert lost.exit_code == 4
    assert "plan.parquet: is damaged" in lost.stdout
    nothing = runner.invoke(app, ["verify", str(tmp_path)])
    assert nothing.exit_code == 2
    assert "holds no dataset" in nothing.stderr


def test_a_note_on_a_failure_that_is_damaged_is_named(tmp_path):
    make_dataset(tmp_path, missing=[3])
    Store(tmp_path).write(layout.failure(3), encode(Failure(3, "lost", 1))[:-9])
    assert layout.failure(3) in names(tmp_path)


def test_numbers_are_told_as_ranges():
    assert name_ranges([0, 1, 2, 5, 7, 8]) == "0-2, 5, 7-8"
    assert name_ranges([]) == ""


def test_a_plan_without_samples_is_damaged(folder):
    path = folder / layout.PLAN
    pq.write_table(pq.read_table(path).slice(0, 0), path)
    (found,) = findings(folder)
    assert str(found) == "plan.parquet: is damaged; expected: the table of a plan"


def test_a_finding_is_a_line_whatever_a_file_says(folder):
    path = folder / layout.CROISSANT
    document = json.loads(path.read_text())
    document["distribution"][0]["contentUrl"] = "one\ntwo\x1b[31m"
    path.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n")
    lines = [str(finding) for finding in findings(folder)]
    assert any("contentUrl one\\ntwo\\x1b[31m; expected" in line for line in lines)
    assert all(line.isprintable() for line in lines)


def test_a_plan_whose_bounds_are_no_numbers_is_damaged(folder):
    path = folder / layout.PLAN
    table = pq.read_table(path)
    ((key, content),) = table.schema.metadata.items()
    meta = json.loads(content)
    meta["quality"]["spp"] = "many"
    pq.write_table(table.replace_schema_metadata({key: json.dumps(meta)}), path)
    (found,) = findings(folder)
    assert str(found) == "plan.parquet: is damaged; expected: the table of a plan"
