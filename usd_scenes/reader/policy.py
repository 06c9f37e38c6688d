"""What becomes of a stage of which something is wrong.

What is wrong in one place costs that place: a missing asset or target, a malformed mesh, an index or a value out of its
range. The prim is mended or left out, and a warning names it, what was found and what was done (`Policy.mend` and
`Policy.leaving_out`); where the stage is read strictly, it is an error. Refused is what cannot be mended without
changing what the picture is of: a parameter of a medium's law, a shape that is to hold a medium and cannot
(`MediumError`), and what the stage as a whole lacks.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from pxr import Tf

from fgf_warp.errors import FgfError, MediumError, SceneError
from usd_scenes.reader.notes import Notes


@dataclass(frozen=True, eq=False)
class Policy:
    """Mends, leaves out or refuses.

    Args:
        strict: True where what would be mended or left out is an error.
        notes: collects warnings.
        refusals: collects errors, so that all of a stage's are found; None: the first one is raised.
    """

    strict: bool = False
    notes: Notes = field(default_factory=Notes)
    refusals: list[FgfError] | None = None

    def mend(self, text: str, path: object) -> None:
        """Tells what is wrong with one prim or attribute and what is done about it, in this order: "found; done".

        Raises:
            SceneError: where the stage is read strictly.
        """
        if self.strict:
            raise SceneError(_found(path, text))
        self.notes.add(text, path)

    @contextmanager
    def leaving_out(self, path: object, done: str) -> Iterator[None]:
        """Mends what is refused inside by doing without it.

        Args:
            path: of the prim that is left out.
            done: what is done, such as "the mesh is left out".

        Raises:
            MediumError: that was raised inside.
            SceneError: that was raised inside, where the stage is read strictly.
        """
        try:
            yield
        except MediumError:
            raise
        except (SceneError, Tf.ErrorException) as error:
            if self.strict:
                raise
            self.notes.add(f"{_without_path(str(path), _text(error))}; {done}", path)

    @contextmanager
    def going_on(self) -> Iterator[None]:
        """Keeps an error of what is read inside for `refusals`, where errors are collected."""
        try:
            yield
        except (FgfError, Tf.ErrorException) as error:
            if self.refusals is None:
                raise
            self.refusals.append(error if isinstance(error, FgfError) else SceneError(_text(error)))


def _text(error: Exception) -> str:
    return " ".join(error.args[0].commentary.split()) if isinstance(error, Tf.ErrorException) else str(error)


def _without_path(path: str, text: str) -> str:
    """A message without the path that it begins with, which the warning names anyway."""
    return text.removeprefix(f"{path}: ").removeprefix(f"{path}.")


def _found(path: object, text: str) -> str:
    """What `Policy.mend` is told, without what would be done; a value follows its attribute's path."""
    found = text.rpartition("; ")[0] or text
    return f"{path} {found}" if found.startswith(("= ", "is ")) else f"{path}: {found}"
