"""A plain C loop for scene A, as the physical limit of the machine."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

SOURCE = Path(__file__).parent / "walk.c"
FLAGS = ("-O3", "-march=native", "-ffast-math")


@dataclass(frozen=True)
class Walk:
    """One run of the loop.

    Args:
        paths: camera paths.
        events: scattering events in them.
        mean: of the image of scene A.
        cpu_seconds: it took.
    """

    paths: int
    events: int
    mean: float
    cpu_seconds: float

    @property
    def events_per_path(self) -> float:
        return self.events / self.paths

    @property
    def nanoseconds_per_event(self) -> float:
        return 1e9 * self.cpu_seconds / self.events


def build_walk(folder: Path) -> Path | None:
    """The compiled program, in a folder; None where there is no gcc."""
    gcc = shutil.which("gcc")
    if gcc is None:
        return None
    program = folder / "walk"
    subprocess.run([gcc, *FLAGS, "-o", program, SOURCE, "-lm"], check=True)
    return program


def run_walk(program: Path, paths: int, seed: int) -> Walk:
    """Runs it, on one core."""
    done = subprocess.run([program, str(paths), str(seed)], check=True, capture_output=True, text=True)
    return Walk(**json.loads(done.stdout))
