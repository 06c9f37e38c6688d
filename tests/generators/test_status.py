"""How far a dataset is, as `fgf status` tells it."""

import json
from datetime import datetime, timedelta

import pytest
from typer.testing import CliRunner

from fgf_warp.locks import hold
from generators.checking.status import read_status
from generators.checking.verify import verify_dataset
from generators.cli import app
from generators.dataset import layout
from generators.dataset.reader import Dataset
from generators.dataset.store import Store
from tests.generators.made_up import make_dataset

NOW = datetime.fromisoformat("2026-01-02T03:04:05+00:00")


def at(seconds_ago, event, **details):
    return {"time": (NOW - timedelta(seconds=seconds_ago)).isoformat(), "event": event, **details}


def write_events(location, *events, shard=""):
    lines = "".join(json.dumps(event) + "\n" for event in events)
    Store(location).write(layout.events(shard), lines.encode())


def start(shard="0/1"):
    return at(100, "start", shard=shard, executor="local", samples=24, reused=4)


def sample(seconds_ago, done, left):
    return at(seconds_ago, "sample", index=done, status="complete", done=done, total=24, rate=0.5, left=left)


def test_samples_are_counted_by_split(tmp_path):
    status = read_status(make_dataset(tmp_path, missing=[0, 4], failed=[5]))
    assert status.counts == {"complete": 21, "failed": 1, "missing": 2}
    assert status.splits["test"] == {"complete": 3, "failed": 1, "missing": 0}
    assert status.splits["validation"] == {"complete": 3, "failed": 0, "missing": 1}
    assert status.failures == ((5, "3 samples are not finite, most of them in pixel (1, 2)"),)
    assert status.runs == ()


def test_a_run_that_is_under_way_tells_its_rate_and_the_time_left(tmp_path):
    make_dataset(tmp_path, missing=[0])
    lost = at(500, "end", interrupted=True)
    write_events(tmp_path, at(900, "start", shard="0/1"), lost, start(), sample(20, 5, 38), sample(10, 6, 36))
    with (tmp_path / layout.events()).open("a") as file:
        file.write('{"time": "2026-01-02T03:0')  # a line that is being written
    (tmp_path / "run/shard-0-of-1.lock").touch()
    with hold(tmp_path / "run/shard-0-of-1.lock", wait=False):
        (run,) = read_status(Dataset(tmp_path), NOW).runs
    assert (run.state, run.done, run.total, run.rate) == ("under way", 6, 24, 0.5)
    assert run.left_seconds == 26
    assert run.silent_seconds == 10
    (killed,) = read_status(Dataset(tmp_path), NOW).runs
    assert (killed.state, killed.left_seconds) == ("killed", None)


def test_ends_are_told_apart(tmp_path):
    make_dataset(tmp_path)
    for end, state in (
        (at(1, "end", interrupted=False), "finished"),
        (at(1, "end", interrupted=True), "interrupted"),
        (at(1, "end", error="No space left"), "error: No space left"),
    ):
        write_events(tmp_path, start(), sample(2, 24, 0), end)
        assert read_status(Dataset(tmp_path), NOW).runs[0].state == state


def test_each_shard_has_its_run(tmp_path):
    make_dataset(tmp_path)
    for i in range(2):
        write_events(tmp_path, start(f"{i}/2"), at(1, "end", interrupted=False), shard=f"-{i}-of-2")
    assert [run.shard for run in read_status(Dataset(tmp_path), NOW).runs] == ["0/2", "1/2"]


def test_an_object_store_has_no_locks_to_ask():
    make_dataset("memory://status", missing=[0])
    write_events("memory://status", start(), sample(10, 6, 36))
    (run,) = read_status(Dataset("memory://status"), NOW).runs
    assert run.state == "under way or killed"
    assert run.left_seconds == 26


DAMAGED_LINES = (
    "\x00" * 40,
    "[" * 100_000,
    '{"time": "2026-01-02T03:04:05", "event": "sample", "done": 1, "left": 1, "rate": 1}',
    '{"time": 5, "event": "start"}',
    json.dumps(at(50, "start", shard=["0/1"], executor="local", samples=24, reused=4)),
    json.dumps(at(50, "sample", done="many", left=1, rate=1)),
    json.dumps(at(50, "sample", done=3, left=float("nan"), rate=1)),
    json.dumps(at(50, "sample", done=3, left=1e300, rate=True)),
    json.dumps(at(50, "end")),
    '"start"',
    "{",
    "9" * 5000,
)


def test_lines_that_are_no_events_are_counted_and_left_out(tmp_path):
    make_dataset(tmp_path, missing=[0])
    write_events(tmp_path, start(), sample(10, 6, 36))
    with (tmp_path / layout.events()).open("a") as file:
        file.writelines(f"{line}\n" for line in DAMAGED_LINES)
        file.write('{"time": "2026-01-02T03:0')
    status = read_status(Dataset(tmp_path), NOW)
    assert (status.runs[0].done, status.runs[0].state) == (6, "killed")
    assert status.notes == ("run/events.jsonl: 12 of its lines cannot be read, and are left out",)
    told = CliRunner().invoke(app, ["status", str(tmp_path), "--json"])
    assert told.exit_code == 0
    assert "warning: run/events.jsonl: 12 of its lines" in told.stderr
    assert json.loads(told.stdout)["runs"][0]["done"] == 6


def test_files_with_odd_names_are_no_locks(tmp_path):
    make_dataset(tmp_path)
    write_events(tmp_path, start(), sample(10, 6, 36))
    for name in ("shard-a-of-b.lock", "shard-1-of-0.lock", "shard-5-of-2.lock", f"shard-1-of-{'9' * 100}.lock"):
        (tmp_path / "run" / name).touch()
    (tmp_path / "run/shard-0-of-3.lock").mkdir()
    with hold(tmp_path / "run/shard-0-of-1.lock", wait=False):
        assert read_status(Dataset(tmp_path), NOW).runs[0].state == "under way"
    assert verify_dataset(Dataset(tmp_path)).planned == 24


ODD_PLACES = (
    *("zip://x", "zip://x::missing.zip", "nonsense://x", "simplecache::zip://x", "s3://", "::", "ftp://", "\0"),
    *("reference://x", "jar://x", "tar://x", "git://x", "dir://x", "filecache://x", "http://[", "data:,x", ""),
)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("place", ODD_PLACES)
@pytest.mark.parametrize("command", ["status", "verify", "report"])
def test_an_odd_place_is_refused_in_a_line(place, command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    outcome = CliRunner().invoke(app, [command, place])
    assert isinstance(outcome.exception, SystemExit)
    assert outcome.exit_code == 2, outcome.output
    assert len(outcome.stderr.strip().splitlines()) == 1
    assert outcome.stderr.startswith("error: ")


def test_the_command_tells_people_and_programs(tmp_path):
    make_dataset(tmp_path, failed=range(8))
    write_events(tmp_path, start(), sample(10, 16, 0), at(5, "end", interrupted=False))
    told = CliRunner().invoke(app, ["status", str(tmp_path)])
    assert told.exit_code == 0
    assert "16 of 24 samples are there" in told.stdout
    assert "run: finished, the last sign of it at 2026-01-02T03:04:00; 16 of 24 samples" in told.stdout
    assert "failures, the last 5 of 8" in told.stdout
    assert "sample 7: 3 samples are not finite" in told.stdout
    assert "sample 2:" not in told.stdout
    found = json.loads(CliRunner().invoke(app, ["status", str(tmp_path), "--json"]).stdout)
    assert found["planned"] == 24
    assert found["counts"] == {"complete": 16, "failed": 8, "missing": 0}
    assert found["failures"][0] == {"index": 0, "reason": "3 samples are not finite, most of them in pixel (1, 2)"}
    assert found["runs"][0]["state"] == "finished"
