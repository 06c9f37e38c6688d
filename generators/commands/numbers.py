"""Numbers on the command line: each option tells its range, whatever was written."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import typer

from fgf_warp.errors import ConfigError
from generators.wording import shortened

LENGTH_MAX = 40
"""Characters of a number; no accepted one needs more."""


def whole(option: str, lowest: int, highest: int) -> Callable[[str], int]:
    """Reads an integer.

    Args:
        option: for the message.
        lowest: accepted.
        highest: accepted.

    Returns:
        A parser, which raises a ConfigError naming the option, what was found and the range.
    """

    def parse(text: str | int) -> int:
        written = str(text)
        try:
            value = int(written) if len(written) <= LENGTH_MAX else None
        except ValueError:
            value = None
        if value is None or not lowest <= value <= highest:
            raise ConfigError(f"{option} {shortened(written)}: accepted: an integer in [{lowest}, {highest}]")
        return value

    return parse


def whole_option(
    name: str, lowest: int, highest: int, text: str, *, short: str | None = None, metavar: str = "N"
) -> Any:
    """An option that takes an integer.

    Args:
        name: of the option, with its dashes.
        lowest: accepted.
        highest: accepted.
        text: its help.
        short: another name.
        metavar: what stands for the number in the help.

    Returns:
        What Typer finds in the annotation of a parameter.
    """
    names = (name,) if short is None else (name, short)
    return typer.Option(*names, metavar=metavar, parser=whole(name, lowest, highest), help=text)


def number(option: str, accepted: str, holds: Callable[[float], bool]) -> Callable[[str], float]:
    """Reads a finite number.

    Args:
        option: for the message.
        accepted: for the message.
        holds: tells whether a number is accepted.

    Returns:
        A parser, which raises a ConfigError naming the option, what was found and what is accepted.
    """

    def parse(text: str | float) -> float:
        written = str(text)
        try:
            value = float(written) if len(written) <= LENGTH_MAX else math.nan
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or not holds(value):
            raise ConfigError(f"{option} {shortened(written)}: accepted: {accepted}")
        return value

    return parse
