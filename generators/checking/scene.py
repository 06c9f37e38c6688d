"""Whether the stages that a dataset holds are as they were written."""

from __future__ import annotations

from collections.abc import Collection

from fgf_warp.errors import CorruptFileError
from generators.checking.findings import Finding, Kind
from generators.dataset import layout
from generators.dataset.reader import Dataset
from generators.dataset.scene_files import read_scene_record, scene_problems


def check_scene(dataset: Dataset) -> list[Finding]:
    """What is wrong with them; nothing with a dataset that holds none, as those of before."""
    if not dataset.meta.stages:
        return []
    return [Finding(Kind.DAMAGED, *problem) for problem in scene_problems(dataset.store)]


def scene_files(dataset: Dataset, there: Collection[str]) -> set[str]:
    """The files that belong to the dataset's stages: all that lie with them, where no list can be read.

    Args:
        dataset: that they belong to.
        there: names of the dataset's files.
    """
    try:
        record = read_scene_record(dataset.store)
    except CorruptFileError:
        record = None
    if record is None:
        return {name for name in there if dataset.meta.stages and name.startswith(f"{layout.SCENE}/")}
    return {layout.SCENE_RECORD, *map(layout.scene_file, record.files)}
