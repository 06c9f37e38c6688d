"""Datasets with damage in them, and a process of its own that looks at them: a crash is then a finding, not the end."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from generators.planning.document import load_config
from generators.planning.plan import build_plan
from generators.running.run import generate
from tests.answering import AnsweringProcess, Outcome
from tests.generators.small_plan import write_config

TIME_LIMIT = 120
"""Seconds after which a command hangs, on a machine that has much else to do; `fuzz_process` counts its own seconds."""
SPARSE = 3 * 2**30
"""[byte] Of a file that must not be read into memory."""
ODD_NAMES = ("notes.txt", ".hidden", "radiance.exr.bak", "000099", "naïve ☃.txt", "a\nb", "x" * 250, "-rf", ".git")
ODD_VALUES = (None, -1, 0, 1e308, 10**30, "", "x" * 300, [], {}, [[[]]], True, "\ud800", "../../etc", float("nan"))
ODD_LINES = (
    *("{", "[" * 50_000, "null", "{}", '{"event": "start"}', '{"time": 0, "event": "end"}', "\0" * 100, "9" * 6000),
    '{"time": "2026-01-01T00:00:00+00:00", "event": "start", "shard": 7}',
    '{"time": "2026-01-01T00:00:00+00:00", "event": "sample", "done": "x", "left": NaN, "rate": null}',
)
ODD_LOCKS = (
    "shard-x-of-y.lock",
    "shard-3-of-2.lock",
    "shard-0-of-0.lock",
    "shard-.lock",
    f"shard-1-of-{'9' * 20}.lock",
)


@dataclass
class Damaged:
    """A dataset that is being damaged.

    Args:
        folder: of the dataset.
        rng: chooses.
    """

    folder: Path
    rng: random.Random

    def files(self, *suffixes: str) -> list[Path]:
        """The files that are there, of these kinds."""
        found = (path for path in sorted(self.folder.rglob("*")) if path.is_file() and not path.is_symlink())
        return [path for path in found if not suffixes or path.suffix in suffixes]

    def file(self, *suffixes: str) -> Path:
        """One of them."""
        return self.rng.choice(self.files(*suffixes) or self.files())

    def any_folder(self) -> Path:
        """A folder of the dataset, or the dataset's own."""
        found = [path for path in sorted(self.folder.rglob("*")) if path.is_dir() and not path.is_symlink()]
        return self.rng.choice([self.folder, *found])

    def write_stranger(self, path: Path) -> None:
        """A file of someone else, which must outlive all."""
        with suppress(OSError):  # where a name is taken, or too long
            path.parent.mkdir(parents=True, exist_ok=True)
            if not path.exists():
                path.write_text(f"{STRANGER}{self.rng.random()}")


STRANGER = "This is of someone else: "


def truncate(at: Damaged) -> None:
    path = at.file()
    path.write_bytes(path.read_bytes()[: at.rng.randrange(path.stat().st_size + 1)])


def flip(at: Damaged) -> None:
    path = at.file()
    content = bytearray(path.read_bytes())
    for _ in range(at.rng.choice((1, 1, 3, 20))):
        if content:
            content[at.rng.randrange(len(content))] ^= 1 << at.rng.randrange(8)
    path.write_bytes(bytes(content))


def insert(at: Damaged) -> None:
    path = at.file()
    content, place = path.read_bytes(), at.rng.randrange(path.stat().st_size + 1)
    path.write_bytes(content[:place] + at.rng.randbytes(at.rng.choice((1, 30, 3000))) + content[place:])


def append_itself(at: Damaged) -> None:
    path = at.file()
    path.write_bytes(path.read_bytes() * 2)


def empty(at: Damaged) -> None:
    at.file().write_bytes(b"")


def delete(at: Damaged) -> None:
    at.file().unlink()


def delete_folder(at: Damaged) -> None:
    folder = at.any_folder()
    if folder != at.folder:
        shutil.rmtree(folder)


def add_file(at: Damaged) -> None:
    at.write_stranger(at.any_folder() / at.rng.choice(ODD_NAMES))


def add_folder(at: Damaged) -> None:
    at.write_stranger(at.any_folder() / at.rng.choice(ODD_NAMES) / "deep" / at.rng.choice(ODD_NAMES))


def rename(at: Damaged) -> None:
    path = at.rng.choice([at.file(), at.any_folder()])
    name = at.rng.choice(ODD_NAMES)
    if path != at.folder and not path.with_name(name).exists():
        with suppress(OSError):
            path.rename(path.with_name(name))


def swap(at: Damaged) -> None:
    one, other = at.file(), at.file()
    content = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(content)


def swap_samples(at: Damaged) -> None:
    folders = sorted(at.folder.glob("data/*/[0-9]*"))
    if len(folders) > 1:
        one, other = at.rng.sample(folders, 2)
        aside = at.folder / "swapped"
        one.rename(aside)
        other.rename(one)
        aside.rename(other)


def file_to_folder(at: Damaged) -> None:
    path = at.file()
    path.unlink()
    path.mkdir()
    if at.rng.random() < 0.6:
        at.write_stranger(path / at.rng.choice(ODD_NAMES))


def folder_to_file(at: Damaged) -> None:
    folder = at.any_folder()
    if folder != at.folder:
        shutil.rmtree(folder)
        at.write_stranger(folder)


def link(at: Damaged) -> None:
    path = at.file()
    path.unlink()
    path.symlink_to(at.rng.choice((path.name, "nowhere", "/dev/zero", "/dev/null", "..")))


def pipe(at: Damaged) -> None:
    path = at.file()
    path.unlink()
    os.mkfifo(path)


def make_large(at: Damaged) -> None:
    os.truncate(at.file(), SPARSE)


def change_mode(at: Damaged) -> None:
    at.rng.choice([at.file(), at.any_folder()]).chmod(at.rng.choice((0o000, 0o444, 0o555)))


def edit_json(at: Damaged) -> None:
    path = at.file(".json")
    with suppress(ValueError):
        document = json.loads(path.read_bytes())
        place, key = at.rng.choice([*_places(document)])
        if at.rng.random() < 0.2 and isinstance(place, dict):
            del place[key]
        else:
            place[key] = at.rng.choice(ODD_VALUES)
        path.write_text(json.dumps(document))


def _places(value: object) -> Iterator[tuple[dict | list, object]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield value, key
        yield from _places(inner)


def edit_parquet(at: Damaged) -> None:
    path = at.file(".parquet")
    try:
        table = pq.read_table(path)
    except (pa.ArrowException, OSError, ValueError):
        return
    columns = table.column_names
    kind = at.rng.randrange(5) if columns else 4
    if kind == 0:
        table = table.drop_columns([at.rng.choice(columns)])
    elif kind == 1:
        place = at.rng.randrange(len(columns))
        table = table.set_column(place, columns[place], pa.array(["?"] * table.num_rows))
    elif kind == 2:
        table = table.slice(at.rng.randrange(table.num_rows + 1))
    elif kind == 3:
        table = pa.concat_tables([table, table])
    else:
        metadata = {**(table.schema.metadata or {})}
        for key, value in metadata.items():
            with suppress(ValueError):
                document = json.loads(value)
                place, name = at.rng.choice([*_places(document)])
                place[name] = at.rng.choice(ODD_VALUES)
                metadata[key] = json.dumps(document).encode()
        table = table.replace_schema_metadata(metadata if at.rng.random() < 0.8 else None)
    pq.write_table(table, path)


def edit_yaml(at: Damaged) -> None:
    path = at.folder / "config.yaml"
    if path.is_file():
        lines = path.read_text(errors="replace").splitlines()
        at.rng.shuffle(lines)
        path.write_text("\n".join(lines[: at.rng.randrange(len(lines) + 1)]))


def edit_events(at: Damaged) -> None:
    path = at.folder / "run" / at.rng.choice(("events.jsonl", "events-0-of-2.jsonl", "events-x.jsonl"))
    if path.parent.is_dir() and (path.is_file() or not path.exists()):
        with path.open("a") as file:
            file.writelines(f"{at.rng.choice(ODD_LINES)}\n" for _ in range(3))


def add_lock(at: Damaged) -> None:
    run = at.folder / "run"
    if run.is_dir():
        path = run / at.rng.choice((*ODD_LOCKS, "lock", "shard-0-of-1.lock", "shard-0-of-7.lock"))
        if path.is_file():
            path.unlink()
        if not path.exists():
            path.mkdir() if at.rng.random() < 0.5 else path.touch()


def add_note(at: Damaged) -> None:
    run = at.folder / "run"
    if run.is_dir():
        path = run / "failures" / at.rng.choice(("000001.json", "000099.json", "99999999.json", "x.json", "readme"))
        if path.suffix == ".json" and path.stem.isdigit():
            with suppress(OSError):
                path.parent.mkdir(exist_ok=True)
                path.write_text(at.rng.choice(ODD_LINES))
        else:
            at.write_stranger(path)


def add_leftover(at: Damaged) -> None:
    name = f".{at.rng.choice(('000001', '000099', 'index'))}.0123456789ab.partial"
    folder = at.rng.choice([at.folder, at.folder / "data" / "train"])
    if folder.is_dir():
        (folder / name).mkdir(exist_ok=True)
        (folder / name / "radiance.exr").touch()


DAMAGES: dict[Callable[[Damaged], None], int] = {
    truncate: 4,
    flip: 6,
    insert: 2,
    append_itself: 1,
    empty: 2,
    delete: 4,
    delete_folder: 2,
    add_file: 4,
    add_folder: 2,
    rename: 3,
    swap: 2,
    swap_samples: 1,
    file_to_folder: 3,
    folder_to_file: 2,
    link: 2,
    pipe: 2,
    make_large: 2,
    change_mode: 1,
    edit_json: 6,
    edit_parquet: 5,
    edit_yaml: 1,
    edit_events: 2,
    add_lock: 2,
    add_note: 2,
    add_leftover: 1,
}
"""How often each is taken."""


def make_whole(folder: Path) -> Path:
    """The dataset that copies are made of: six samples, rendered, with a page."""
    loaded = load_config(write_config(folder))
    whole = folder / "whole"
    generate(build_plan(loaded), loaded.to_bytes(), whole)
    return whole


def damage(folder: Path, seed: int) -> str:
    """Damages a dataset in one to four ways, and says which."""
    rng = random.Random(seed)
    told = []
    for _ in range(rng.choice((1, 1, 2, 4))):
        (kind,) = rng.choices([*DAMAGES], [*DAMAGES.values()])
        at = Damaged(folder, rng)
        if at.files():
            kind(at)
            told.append(kind.__name__)
    return ", ".join(told)


class Examiner:
    """A process that looks at damaged datasets one after the other.

    Args:
        whole: the dataset without damage.
    """

    def __init__(self, whole: Path) -> None:
        # It says where it was when it is aborted.
        self._process = AnsweringProcess(
            "tests.generators.fuzz_process", whole, seconds=TIME_LIMIT, ending=signal.SIGABRT
        )

    def examine(self, folder: Path, *, generates: bool) -> Outcome:
        """Runs all commands on a dataset; `generates` says whether that comes first.

        Returns:
            ``whole``, ``told``, or what must not be, with the command that it was found by.
        """
        command = "nothing"
        answer = self._process.ask(json.dumps([str(folder), generates]))
        while isinstance(answer, str):  # It tells of each command before it begins.
            command = answer
            answer = self._process.go_on()
        return Outcome(answer.kind, f"{command}: {answer.text}") if isinstance(answer, Outcome) else Outcome(**answer)

    def close(self) -> None:
        """Ends the process."""
        self._process.close()
