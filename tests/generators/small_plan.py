"""A small plan of the shipped sphere, for tests of running it."""

from pathlib import Path

import usd_scenes
from generators.dataset.reader import Dataset
from generators.planning.document import load_config
from generators.planning.plan import Plan, build_plan

STAGE = Path(usd_scenes.__file__).parent / "stages" / "sphere.usda"
CONFIG = f"""\
name: small
scene: {STAGE}
seed: 7
image: {{width: 16, height: 16}}
spp: 4
aovs: [variance]
axes:
  H: [-0.4, -0.25]
  g: {{linspace: [-0.5, 0.5, 3]}}
"""
TEXT = CONFIG.encode()
NOT_EQUAL = {"index.parquet", "metadata.parquet", "croissant.json", "timing.json", "config.yaml"}
"""Files that hold, or hash, how long renders took; and the config, which holds the way to the stage."""


def write_config(folder: Path) -> Path:
    """A config file of six samples, which share a kernel."""
    path = folder / "small.yaml"
    path.write_text(CONFIG)
    return path


def small_plan(folder: Path, *overrides: str) -> Plan:
    """The plan of `write_config`."""
    return build_plan(load_config(write_config(folder), overrides))


def content(location: Path) -> dict[str, bytes]:
    """What a dataset's files hold, by name: all that two runs of one plan have in common."""
    return {
        str(path.relative_to(location)): path.read_bytes()
        for path in sorted(location.rglob("*"))
        if path.is_file() and path.name not in NOT_EQUAL and path.relative_to(location).parts[0] != "run"
    }


def labels(location: Path | str):
    """The labels, without the time."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    return pq.read_table(pa.BufferReader(Dataset(location).store.read("index.parquet"))).drop_columns("render_seconds")
