"""Looks at the damaged datasets that it is told of, line by line, with all commands, and answers in lines of JSON.

Before each command it tells its name; the last answer on a dataset is an object.
"""

import faulthandler
import json
import os
import shutil
import sys
import time
import traceback
import warnings
from collections.abc import Iterator, Set
from fnmatch import fnmatch
from pathlib import Path

import warp as wp
from typer.testing import CliRunner

from fgf_warp.output.atomic import PARTIAL_GLOB
from generators.cli import app
from tests.generators.fuzz import STRANGER
from tests.generators.small_plan import NOT_EQUAL

SECONDS = 20
"""Of all its threads, that no command may need."""
MEMORY = 2 * 2**30
"""[byte] That no command may need."""
PROGRESS = "━"
"""What lines with a bar hold."""
ANSWERS = os.fdopen(os.dup(1), "w", buffering=1)
CODES = {0, 2, 3, 4}


class FoundError(Exception):
    """What must not be."""


def run(*arguments: object) -> tuple[int, str]:
    """One command; its exit code and what it said."""
    print(json.dumps(" ".join(map(str, arguments))), file=ANSWERS)
    _reset_peak()
    began = time.process_time()
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    said = f"{arguments[0]}: exit code {done.exit_code}: {done.output}"
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise FoundError(f"{said}\n{''.join(traceback.format_exception(done.exception))}")
    lines = [line for line in done.stderr.splitlines() if line.strip() and PROGRESS not in line]
    errors = [line for line in lines if not line.startswith("warning: ")]
    if done.exit_code not in CODES or "Traceback" in done.output or not all(_is_told(line) for line in errors):
        raise FoundError(said)
    if (seconds := time.process_time() - began) > SECONDS:
        raise FoundError(f"{said}: {seconds:.1f} s")
    if (peak := _peak()) > MEMORY:
        raise FoundError(f"{said}: {peak / 2**30:.2f} GiB")
    return done.exit_code, said


def _is_told(line: str) -> bool:
    return line.startswith(("error: ", "stopped at ", "  "))


def _reset_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def _peak() -> int:
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) * 1024


def walk(folder: Path) -> Iterator[Path]:
    """All that is there; links are not followed."""
    for root, folders, files in os.walk(folder):
        yield from (Path(root, name) for name in [*folders, *files])


def snapshot(folder: Path) -> dict[str, object]:
    """What a command that only looks must not change."""
    found = (path for path in walk(folder) if path.parent.name != "run" and not path.is_dir())
    return {str(path): path.lstat().st_mtime_ns for path in found}


def strangers(folder: Path, ours: Set[str] = frozenset()) -> set[str]:
    """Contents of files that are of someone else and have none of our names."""
    found = (path for path in walk(folder) if path.is_file() and path.stat().st_size < 1000)
    found = (path for path in found if str(path.relative_to(folder)) not in ours)
    return {text for path in found if (text := path.read_bytes().decode(errors="replace")).startswith(STRANGER)}


def half_written(folder: Path) -> set[Path]:
    return {path for path in walk(folder) if fnmatch(path.name, PARTIAL_GLOB)}


def content(location: Path, names: set[str]) -> dict[str, bytes]:
    """Of the files of the dataset, all that two runs of one plan have in common."""
    found = {name: location / name for name in names if (location / name).is_file()}
    return {name: path.read_bytes() for name, path in found.items()}


def names_of(whole: Path) -> set[str]:
    names = {path.relative_to(whole) for path in walk(whole) if path.is_file()}
    return {str(name) for name in names if name.parts[0] != "run" and name.name not in NOT_EQUAL}


def examine(folder: Path, whole: Path, generates: bool) -> str:
    """Returns ``whole`` where a repair healed all, else ``told``.

    Raises:
        FoundError: for what must not be.
    """
    partial, names = half_written(folder), names_of(whole)
    # What a swap has put under a name of the dataset cannot be told from damage to it.
    theirs = strangers(folder, names)
    config = folder / "config.yaml"
    has_config = config.is_file() and config.stat().st_size < 10_000 and config.read_bytes() == CONFIGS[whole]
    stages = {name for name in names if name.startswith("scene/")}

    def check(said: str) -> None:
        if lost := theirs - strangers(folder):
            raise FoundError(f"{said}: lost {len(lost)} files of someone else")
        if left := half_written(folder) - partial:
            raise FoundError(f"{said}: left {left}")

    generate = ("generate", whole / "config.yaml", "--out", folder)
    if generates:
        check(run(*generate)[1])
    before = snapshot(folder)
    for look in (("status",), ("status", "--json"), ("verify",), ("verify", "--deep")):
        code, said = run(look[0], folder, *look[1:])
        if snapshot(folder) != before:
            raise FoundError(f"{said}: changed the dataset")
    out = folder.with_name(f"{folder.name}-out")
    run("export", ("webdataset", "parquet", "npz")[len(theirs) % 3], folder, "--out", out)
    shutil.rmtree(out, ignore_errors=True)
    run("report", folder, "--out", folder.with_name(f"{folder.name}.html"))
    code, said = run("verify", folder, "--repair")
    check(said)
    if code == 4 and has_config and content(folder, stages) != content(whole, stages):
        # Stages come back by the config that the dataset was made from, and after them what is rendered of them.
        check(run(*generate)[1])
        code, said = run("verify", folder, "--repair")
        check(said)
    if code == 3:
        # Samples of which nothing tells any more that they were there.
        check(run(*generate)[1])
        code, said = run("verify", folder, "--deep")
    if code != 0:
        # Plan and stage follow from each other.
        if has_config and "so both cannot be made anew" not in said:
            raise FoundError(said)
        return "told"
    again, said = run("verify", folder, "--deep")
    if again != 0:
        raise FoundError(said)
    if has_config and content(folder, names) != content(whole, names):
        ours, others = content(folder, names), content(whole, names)
        differing = sorted(name for name in names if ours.get(name) != others.get(name))
        raise FoundError(f"{said}: after the repair other bytes of {', '.join(differing)}")
    check(said)
    return "whole"


CONFIGS: dict[Path, bytes] = {}


def main() -> None:
    wp.config.log_level = wp.LOG_WARNING
    faulthandler.enable()
    # What libraries print must not mix with the answers.
    os.dup2(2, 1)
    warnings.simplefilter("error", RuntimeWarning)
    whole = Path(sys.argv[1])
    CONFIGS[whole] = (whole / "config.yaml").read_bytes()
    warm = whole.with_name("warm")
    CliRunner().invoke(app, ["generate", str(whole / "config.yaml"), "--out", str(warm)])
    shutil.rmtree(warm)
    print('"ready"', file=ANSWERS)
    for line in sys.stdin:
        folder, generates = json.loads(line)
        try:
            kind, text = examine(Path(folder), whole, generates), ""
        except FoundError as error:
            kind, text = "found", str(error)
        print(json.dumps({"kind": kind, "text": text}), file=ANSWERS)


if __name__ == "__main__":
    main()
