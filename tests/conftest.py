"""Set-up of every test: a quiet Warp, and the theory's check values where they are at hand."""

import csv
import os
import subprocess
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
import warp as wp

wp.config.log_level = wp.LOG_WARNING
if worker := os.environ.get("PYTEST_XDIST_WORKER"):
    # Processes that compile into one folder disturb each other; those that a test starts take its worker's.
    shared_cache = Path(os.environ.get("WARP_CACHE_PATH", Path.home() / ".cache" / "fgf-warp-tests"))
    os.environ["WARP_CACHE_PATH"] = str(shared_cache / worker)

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def reference():
    """Reads a table of check values: column name -> float64 array (strings stay strings)."""

    def read(name: str) -> dict[str, np.ndarray]:
        path = SHARED / "theory" / "reference" / name
        if not path.exists():
            pytest.skip(f"the check values {name} are not on this machine")
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))
        return {key: _column([row[key] for row in rows]) for key in rows[0]}

    return read


@pytest.fixture
def small_disk(tmp_path):
    """A folder on a file system of its own, of 220 kB: room for a small plan and two or three samples."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=220k", "tmpfs", str(disk)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip("only root may mount a file system")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


def _column(values: list[str]) -> np.ndarray:
    try:
        return np.array([float(Decimal(value)) for value in values])
    except ArithmeticError:
        return np.array(values)
