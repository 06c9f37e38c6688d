"""What a reader has to tell about a stage without refusing it."""

from __future__ import annotations

PATHS_SHOWN = 5
VALUES = ("= ", "is ", "spans ", "holds ", "has ", "adds up ", "names ", "selects ")
"""What a text begins with that goes on from the path of an attribute."""


class Notes:
    """Collects warnings: one text per kind, which lists the prims it holds for."""

    def __init__(self) -> None:
        self._paths: dict[str, dict[str, None]] = {}

    def add(self, text: str, path: object = "") -> None:
        """Notes `text` for the prim or attribute at `path`, or for the whole stage."""
        paths = self._paths.setdefault(text, {})
        if path:
            paths[str(path)] = None

    def entries(self) -> tuple[tuple[str, str], ...]:
        """Each warning for each path that it holds for, as (text, path); the path is empty of the whole stage."""
        return tuple((text, path) for text, paths in self._paths.items() for path in paths or ("",))

    def texts(self) -> tuple[str, ...]:
        """The warnings in the order in which their kinds were met."""
        return tuple(_with_paths(text, [*paths]) for text, paths in self._paths.items())


def _with_paths(text: str, paths: list[str]) -> str:
    if not paths:
        return text
    more = len(paths) - PATHS_SHOWN
    shown = ", ".join(paths[:PATHS_SHOWN]) + (f" and {more} more" if more > 0 else "")
    return f"{shown} {text}" if text.startswith(VALUES) else f"{text}: {shown}"
