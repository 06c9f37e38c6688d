"""Puts the stages of a plan into its dataset, so that the dataset needs nothing beside it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from fgf_warp.errors import CorruptFileError
from fgf_warp.output.atomic import flush_to_disk
from fgf_warp.settings import GIB
from generators.dataset import layout
from generators.dataset.record import STAGES_COME_BACK, SceneRecord, encode, file_entry_at
from generators.dataset.scene_files import scene_problems
from generators.dataset.store import Store

if TYPE_CHECKING:
    from generators.planning.plan import Plan

LARGE = GIB
"""[byte]; of more than that a user is told before it is copied."""
Tell = Callable[[str], None]
"""Called with a line for the user."""


def keep_stages(plan: Plan, store: Store, tell: Tell | None = None) -> None:
    """Writes the stages of a plan, with all that they are made of, where the dataset does not hold them intact.

    Args:
        plan: of the dataset.
        store: of the dataset, whose own files nobody else writes meanwhile.
        tell: see `Tell`.

    Raises:
        CorruptFileError: where they are damaged, and the plan was made of these.
        SceneError: where a stage cannot be read.
        OutputError: where they cannot be written.
    """
    problems = scene_problems(store)
    if not problems:
        return
    stages = plan.scenes.recipe.stages
    own = store.folder and (store.folder / layout.SCENE).resolve()
    if any(Path(path).resolve().parent == own for path in stages.values()):
        name, found, expected = problems[0]
        raise CorruptFileError(f"{store.location}/{name}: {found}; expected: {expected}; {STAGES_COME_BACK}")
    from usd_scenes.localizing import StageFiles  # noqa: PLC0415 - USD is slow to import

    files = StageFiles(stages)
    if tell is not None and files.bytes > LARGE:
        tell(f"the stages and their pictures are {files.bytes / GIB:.3g} GiB, which are copied into the dataset")

    def fill(folder: Path) -> None:
        files.write(folder)
        record = SceneRecord({name: file_entry_at(folder / name) for name in files.names})
        (folder / Path(layout.SCENE_RECORD).name).write_bytes(encode(record))
        for path in folder.iterdir():
            flush_to_disk(path)

    store.place(layout.SCENE, fill, last=Path(layout.SCENE_RECORD).name)
