"""How what a user wrote is shown in messages: in one line, without what steers a terminal, and not too long."""

from __future__ import annotations

NUMBER_LENGTH = 40
"""Characters of a number, or another short value, that are shown whole."""
BEGIN_LENGTH = 20
"""Of a longer one."""


def one_line(text: str, length: int | None = None) -> str:
    """A text without breaks and control characters, cut where it is longer than `length`."""
    plain = " ".join(printable(text).split())
    return plain if length is None or len(plain) <= length else plain[: length - 3] + "..."


def printable(text: str) -> str:
    """A text whose control characters are written out, but for breaks and other space."""
    return "".join(char if char.isprintable() or char.isspace() else f"\\x{ord(char):02x}" for char in text)


def shortened(text: str) -> str:
    """A short value as it is, and of a longer one its begin and length."""
    plain = one_line(text)
    return plain if len(plain) <= NUMBER_LENGTH else f"{plain[:BEGIN_LENGTH]}... ({len(plain)} characters)"
