"""Where the files of a dataset lie.

::

    README.md                      the dataset card
    index.parquet                  labels, one row per sample of the plan
    plan.parquet                   the frozen plan: what each sample is to be
    croissant.json                 metadata of Croissant 1.1
    config.yaml                    the config in force, whose stages are those in scene/
    contact_sheet.png
    report.html                    where asked for
    data/SPLIT/metadata.parquet    the labels of a split's complete samples, for ``datasets.load_dataset``
    data/SPLIT/000000/             one folder per complete sample, which appears whole or not at all
        radiance.exr
        image.png                  where asked for
        record.json                what was reached, with size and hash of the other files
        timing.json                what differs between two runs of one plan
    scene/                         the stages and all that they are made of, which appears whole or not at all
        NAME.usda                  a stage; beside it its other layers and pictures
        files.json                 size and hash of each
    run/                           events, locks, failures: nothing that a reader needs

Every path is relative to the dataset's location, with ``/`` between its parts. Names of samples have no dots, since
loaders take what follows a dot for a suffix.
"""

from __future__ import annotations

import re

CARD = "README.md"
INDEX = "index.parquet"
PLAN = "plan.parquet"
CROISSANT = "croissant.json"
CONFIG = "config.yaml"
CONTACT_SHEET = "contact_sheet.png"
REPORT = "report.html"
DATA = "data"
SCENE = "scene"
SCENE_RECORD = "scene/files.json"
RUN = "run"
FAILURES = "run/failures"

RADIANCE = "radiance.exr"
IMAGE = "image.png"
RECORD = "record.json"
TIMING = "timing.json"

SPLITS = ("train", "validation", "test")
"""Without splits in the config, every sample is in the first."""


def sample_name(index: int) -> str:
    """Of a sample's folder: its index with leading zeros."""
    return f"{index:06d}"


def sample_folder(split: str, index: int) -> str:
    """Path of the folder of one sample."""
    return f"{DATA}/{split}/{sample_name(index)}"


def scene_file(name: str) -> str:
    """Path of a stage, or of another file that one is made of."""
    return f"{SCENE}/{name}"


def split_metadata(split: str) -> str:
    """Path of the labels of a split's complete samples."""
    return f"{DATA}/{split}/metadata.parquet"


def events(shard: str = "") -> str:
    """Path of what happened in a run, as lines of JSON; of a shard with a suffix such as ``-0-of-4``."""
    return f"{RUN}/events{shard}.jsonl"


def is_failure(name: str) -> bool:
    """Whether a path is that of a note on a sample that could not be rendered."""
    return re.fullmatch(rf"{FAILURES}/\d{{6,18}}\.json", name) is not None


def failure(index: int) -> str:
    """Path of the note on a sample that could not be rendered; it goes once the sample is complete."""
    return f"{FAILURES}/{sample_name(index)}.json"
