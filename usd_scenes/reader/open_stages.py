"""Stages that stay open, and what was read of the last one, while a file is read again and again."""

from __future__ import annotations

from dataclasses import replace

from pxr import Usd

from usd_scenes.reader.choices import Choices
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.diagnostics import FROM_USD
from usd_scenes.reader.edits import Edits
from usd_scenes.reader.listening import Heard
from usd_scenes.reader.readings import StageReading
from usd_scenes.reader.rereading import KeptScene


class OpenStages:
    """Within it, as a context, a file that is read again, as for another frame, is not opened again."""

    def __init__(self) -> None:
        self._cache = Usd.StageCache()
        self._contexts: list[Usd.StageCacheContext] = []
        self._last: tuple[StageReading, Choices, KeptScene] | None = None

    def __enter__(self) -> None:
        self._contexts.append(Usd.StageCacheContext(self._cache))
        self._contexts[-1].__enter__()

    def __exit__(self, *raised: object) -> None:
        self._contexts.pop().__exit__(*raised)

    def keep(self, reading: StageReading, choices: Choices, edits: Edits, context: StageContext) -> None:
        """Keeps a reading of a stage that has these edits now, if another may differ in the lights' numbers alone."""
        kept = None
        if not any(text.startswith(FROM_USD) for text in reading.warnings):  # Whatever they are of.
            kept = KeptScene.of(reading.scene, edits, context)
        self._last = None if kept is None else (reading, choices, kept)

    def read_again(self, stage: Usd.Stage, choices: Choices, edits: Edits, heard: Heard) -> StageReading | None:
        """What the stage comes to with the edits that it has now; None where it must be read as a whole."""
        if self._last is None:
            return None
        reading, as_chosen, kept = self._last
        if stage != kept.context.stage or choices != as_chosen:
            return None
        scene = kept.with_lights(edits)
        return None if scene is None or heard.warnings() else replace(reading, scene=scene)
