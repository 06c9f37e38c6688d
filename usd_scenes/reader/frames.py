"""Times that a stage is read at, and what is the same at several of them."""

from __future__ import annotations

import re
from typing import Literal

Frame = float | Literal["default"]
"""A time code, or USD's default time, at which attributes have their default values and no samples."""

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")
"""In a text, not in a name."""


def name_of(frame: Frame | None, word: str = "frame ") -> str:
    """What a frame is called in messages; None is where the stage starts."""
    if frame is None:
        return "the stage's start"
    return "the default time" if frame == "default" else f"{word}{frame:.12g}"


def kind_of(text: str) -> str:
    """A text without its numbers, which may differ between frames in which the same is wrong."""
    return NUMBER.sub("#", text)
