"""What becomes of a stage of which something is wrong.

What is wrong in one place costs that place: a missing asset or target, a malformed mesh, an index or a value out of its
range. The prim is mended or left out, and a warning names it, what was found and what was done (`Policy.mend` and
`Policy.leaving_out`); where the stage is read strictly, it is an error. Refused is what cannot be mended without
changing what the picture is of: a parameter of a medium's law, a shape that is to hold a medium and cannot
(`MediumError`), a stage that cannot be parsed, and what is asked for and not there.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from pxr import Tf

from fgf_warp.errors import FgfError, MediumError, SceneError
from usd_scenes.reader.notes import VALUES, Notes

OF_USD = (Tf.ErrorException, UnicodeDecodeError)
"""What USD raises; the latter for names, as of applied schemas, that are not UTF-8."""


@dataclass(frozen=True, eq=False)
class Policy:
    """Mends, leaves out or refuses.

    Args:
        strict: True where what would be mended or left out is an error.
        notes: collects warnings.
        refusals: collects errors, so that all of a stage's are found; None: the first one is raised.
        asked_for: attributes whose values were asked for in place of the stage's, of which none is mended.
    """

    strict: bool = False
    notes: Notes = field(default_factory=Notes)
    refusals: list[FgfError] | None = None
    asked_for: frozenset[str] = frozenset()

    def mend(self, text: str, path: object) -> None:
        """Tells what is wrong with one prim or attribute and what is done about it, in this order: "found; done".

        Raises:
            SceneError: where the stage is read strictly, or the value was asked for.
        """
        if self.strict or str(path) in self.asked_for:
            self._refuse(SceneError(_found(path, text)))
        else:
            self.notes.add(text, path)

    @contextmanager
    def leaving_out(self, path: object, done: str, bounds_medium: Callable[[], bool] = lambda: False) -> Iterator[None]:
        """Mends what is refused inside by doing without it.

        Args:
            path: of the prim that is left out.
            done: what is done, such as "the mesh is left out".
            bounds_medium: tells whether it is to hold a medium, and so cannot be left out.

        Raises:
            MediumError: that was raised inside, or for what is refused of a prim that is to hold a medium.
            SceneError: that was raised inside, where the stage is read strictly, or of a value that was asked for.
        """
        try:
            yield
        except MediumError:
            raise
        except (SceneError, *OF_USD) as error:
            if bounds_medium():
                raise MediumError(_text(error)) from error
            text = _text(error)
            if self.strict or text.startswith(tuple(f"{asked}{end}" for asked in self.asked_for for end in " :")):
                self._refuse(error)
            else:
                blamed, found = _blamed(str(path), text)
                self.notes.add(f"{found}; {done}", blamed)

    @contextmanager
    def going_on(self) -> Iterator[None]:
        """Keeps an error of what is read inside for `refusals`, where errors are collected."""
        try:
            yield
        except (FgfError, *OF_USD) as error:
            self._refuse(error)

    def _refuse(self, error: Exception) -> None:
        if self.refusals is None:
            raise error
        self.refusals.append(error if isinstance(error, FgfError) else SceneError(_text(error)))


def commentary_of(told: object) -> str:
    """What an error or a warning of USD says; damaged files make it quote bytes that are no text."""
    try:
        return str(told.commentary)  # type: ignore[attr-defined]
    except UnicodeDecodeError:
        return "the file is damaged: what USD says of it is no text"


def text_of(error: Tf.ErrorException | UnicodeDecodeError) -> str:
    """What one of `OF_USD` says."""
    if isinstance(error, UnicodeDecodeError):
        return "the file is damaged: a name in it is no text"
    return commentary_of(error.args[0])


def _text(error: Exception) -> str:
    return " ".join(text_of(error).split()) if isinstance(error, OF_USD) else str(error)


def _blamed(path: str, text: str) -> tuple[str, str]:
    """The path of a message that begins with one, of the prim or of a property of it, and what it says of that."""
    begins = re.match(rf"({re.escape(path)}(?:\.\w+(?::\w+)*)?)(?:: | )", text)
    return (begins[1], text[begins.end() :]) if begins else (path, text)


def _found(path: object, text: str) -> str:
    """What `Policy.mend` is told, without what would be done; a value follows its attribute's path."""
    found = text.rpartition("; ")[0] or text
    return f"{path} {found}" if found.startswith(VALUES) else f"{path}: {found}"
