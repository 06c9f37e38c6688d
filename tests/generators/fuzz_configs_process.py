"""Plans the configs whose folders and overrides it is given, a line of JSON each, and answers each with another.

What is planned is written and read again too: a config that is accepted must work from where the dataset lies.
"""

import json
import math
import os
import resource
import sys
import traceback
import warnings
from pathlib import Path

from typer.testing import CliRunner

from fgf_warp.errors import FgfError
from generators.cli import app
from generators.commands import plan as planning
from generators.planning.document import load_config
from generators.tradeoff.config import load_tradeoff
from tests.generators.fuzz_configs import MEMORY_LIMIT

LINE_MAX = 2000
"""Characters of a message."""
made = []


def answer(folder: Path, overrides: list[str]) -> dict[str, str]:
    """What became of a config, and whether it left files or took more memory than it may."""
    made.clear()
    path = folder / "config.yaml"
    found = measured(path, overrides) if path.read_bytes().startswith(b"stages:") else planned(path, overrides)
    left = [other.name for other in folder.iterdir() if other != path]
    peak = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    if left:
        return {"kind": "littered", "text": ", ".join(left)}
    if peak > MEMORY_LIMIT:
        return {"kind": "fat", "text": f"{peak / 1e9:.3g} GB"}
    return written(folder) if made and found["kind"] == "planned" else found


def planned(path: Path, overrides: list[str]) -> dict[str, str]:
    """What `fgf plan` makes of it."""
    done = CliRunner().invoke(app, ["plan", str(path), *(part for text in overrides for part in ("--set", text))])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return {"kind": "raised", "text": "".join(traceback.format_exception(done.exception))}
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    errors = [line for line in lines if not line.startswith("warning: ")]
    if done.exit_code == 0 and not errors:
        return {"kind": "planned"}
    if done.exit_code != 2 or len(errors) != 1 or not errors[0].startswith("error: ") or len(errors[0]) > LINE_MAX:
        return {"kind": "untidy", "text": f"exit code {done.exit_code}: {done.output}"}
    return {"kind": "refused", "text": errors[0]}


def written(folder: Path) -> dict[str, str]:
    """The config and the plan as a dataset holds them."""
    loaded, plan = made[0]
    try:
        below = folder / "dataset"
        below.mkdir()
        (below / "config.yaml").write_bytes(loaded.to_bytes())
        again = load_config(below / "config.yaml")
        plan.to_bytes()
    except Exception as error:
        return {"kind": "raised", "text": "".join(traceback.format_exception(error))}
    kept = {name: value for name, value in again.config.model_dump().items() if name not in ("scene", "axes")}
    if any(value != kept[name] for name, value in loaded.config.model_dump().items() if name in kept):
        return {"kind": "changed", "text": (below / "config.yaml").read_text(encoding="utf-8")}
    return {"kind": "planned"}


def measured(path: Path, overrides: list[str]) -> dict[str, str]:
    """What `fgf tradeoff` reads."""
    try:
        load_tradeoff(path, overrides)
    except FgfError as error:
        kind = "refused" if "\n" not in str(error) and len(str(error)) <= LINE_MAX else "untidy"
        return {"kind": kind, "text": str(error)}
    except Exception as error:
        return {"kind": "raised", "text": "".join(traceback.format_exception(error))}
    return {"kind": "planned"}


def main() -> None:
    # What libraries print must not mix with the answers.
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    warnings.simplefilter("always")
    planning.SILENT_SECONDS = math.inf
    make_plan = planning.make_plan

    def kept(*arguments: object) -> object:
        made.append(make_plan(*arguments))
        return made[0]

    planning.make_plan = kept
    print("ready", file=out)
    for line in sys.stdin:
        folder, overrides = json.loads(line)
        print(json.dumps(answer(Path(folder), overrides)), file=out)


if __name__ == "__main__":
    main()
