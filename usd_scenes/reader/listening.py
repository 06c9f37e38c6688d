"""What USD says beside its answers: kept off the terminal, whatever thread it is said on, and told as warnings."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import TracebackType

from pxr import Tf, Usd, UsdUtils

from usd_scenes.reader.context import StageContext
from usd_scenes.reader.metadata import STAGE_PATH
from usd_scenes.reader.policy import commentary_of

TEXTS = ("token", "string", "pathExpression")
"""How the types' names begin of attributes that hold text."""
NO_TEXT = "text that is not UTF-8, as of a damaged file; no value is used"


@dataclass(frozen=True, eq=False)
class Heard:
    """What USD has said since `listening` began.

    Args:
        trap: holds the warnings of this thread.
        others: holds those of the threads that USD starts.
        no_text: USD gives None for a value that is no text, and would print these.
    """

    trap: Tf.DiagnosticTrap
    others: UsdUtils.CoalescingDiagnosticDelegate
    no_text: list[UnicodeDecodeError] = field(default_factory=list)
    _of_others: list[str] = field(default_factory=list)

    def warnings(self) -> list[str]:
        """All so far, as USD words them."""
        # Taken once, as they are else printed in the end.
        self._of_others.extend(commentary_of(said) for said in self.others.TakeUncoalescedDiagnostics())
        return [*(commentary_of(said) for said in self.trap.GetWarnings()), *self._of_others]


@contextmanager
def listening() -> Iterator[Heard]:
    """Keeps what USD says off the terminal.

    Yields:
        What is heard.
    """
    hook = sys.excepthook
    with Tf.DiagnosticTrap() as trap:
        heard = Heard(trap, UsdUtils.CoalescingDiagnosticDelegate())

        def keep(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
            if isinstance(error, UnicodeDecodeError):
                heard.no_text.append(error)
            else:
                hook(kind, error, trace)

        # Where a value has no form in Python, USD calls this and goes on.
        sys.excepthook = keep
        try:
            yield heard
        finally:
            sys.excepthook = hook
            heard.warnings()
            trap.Clear()


def tell_of_no_text(heard: Heard, context: StageContext) -> None:
    """Names what was read and is no text; it is looked for only where there was such a value.

    Raises:
        SceneError: for the first one, where the stage is read strictly.
    """
    if not heard.no_text:
        return
    paths = [*_without_text(heard, context)]
    for path in paths:
        context.mend(f"holds {NO_TEXT}", path)
    if not paths:
        context.mend(f"the stage holds {NO_TEXT}", STAGE_PATH)


def _without_text(heard: Heard, context: StageContext) -> Iterator[str]:
    """Paths of the attributes of which a value is no text."""
    times = (context.time, Usd.TimeCode.EarliestTime(), Usd.TimeCode.Default())
    for prim in context.stage.Traverse(Usd.TraverseInstanceProxies()):
        for attribute in prim.GetAuthoredAttributes():
            if str(attribute.GetTypeName()).startswith(TEXTS):
                before = len(heard.no_text)
                _ = [str(attribute.Get(time)) for time in times]  # Of an array, each entry.
                if len(heard.no_text) > before:
                    yield str(attribute.GetPath())
