"""What the commands share: exit codes, options, and how they speak to who calls them."""

from __future__ import annotations

import math
import re
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from fgf_warp.errors import ConfigError
from fgf_warp.settings import MEMORY_MAX
from generators.commands.numbers import number
from generators.wording import printable, shortened

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from rich.progress import Progress

    from usd_scenes.reader import Frame

LONG_NUMBER = re.compile(r"\d{41,}")
EXIT_BAD_INPUT, EXIT_PARTIAL, EXIT_CORRUPT, EXIT_UNEXPECTED = 2, 3, 4, 5

Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Replace a value of the config, e.g. spp=16 or axes.H=[-0.4]."),
]
Device = Annotated[str, typer.Option(help="Where to render: cpu, or a GPU such as cuda:0.")]
Frames = Annotated[
    str | None,
    typer.Option(
        "--frames",
        "--frame",
        "-f",
        metavar="SPEC",
        help="Frames: 7, 1:24, 1:24x2 or 101,105:110; default: the stage's start, or the earliest.",
    ),
]
DefaultTime = Annotated[
    bool, typer.Option("--defaultTime", "-d", help="Take attributes' default values, not those of a frame.")
]
Purposes = Annotated[
    str | None,
    typer.Option(
        "--purposes",
        "-p",
        metavar="LIST",
        help="Purposes of the geometry to include beside default, with commas; default: as the stage says, or render.",
    ),
]
Strict = Annotated[
    bool, typer.Option("--strict", help="Refuse a stage of which something is missing or wrong, such as a texture.")
]
CameraPath = Annotated[
    str | None,
    typer.Option("--camera", "-cam", metavar="PATH", help="Camera; default: the render settings', or the first."),
]
Memory = Annotated[
    float,
    typer.Option(
        metavar="GIB",
        parser=number("--memory", f"GiB > 0, at most {MEMORY_MAX}", lambda gib: 0 < gib <= MEMORY_MAX),
        help="Most memory for the images that are rendered at once; changes no pixel.",
    ),
]


def fail(message: str, code: int) -> NoReturn:
    """Ends the program with a line on stderr."""
    typer.echo(f"error: {LONG_NUMBER.sub(lambda found: shortened(found[0]), printable(message))}", err=True)
    sys.exit(code)


def warn(warnings: Sequence[str]) -> None:
    """Prints a line on stderr for each."""
    for warning in warnings:
        typer.echo(f"warning: {printable(warning)}", err=True)


def count_of(number: int, thing: str) -> str:
    """``1 image``, ``2 images``."""
    return f"{number} {thing}{'' if number == 1 else 's'}"


def check_choice(option: str, value: str, accepted: Iterable[str]) -> None:
    """Refuses what is not among the accepted.

    Raises:
        ConfigError: naming the option, the value and what is accepted.
    """
    if value not in list(accepted):
        raise ConfigError(f"{option} {shortened(value)}: accepted: {', '.join(accepted)}")


def parse_share(option: str, text: str) -> float:
    """A share such as 0.01 or 1%, in (0, 1).

    Raises:
        ConfigError: naming the option, for anything else.
    """
    try:
        share = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        share = math.nan
    if not 0 < share < 1:
        raise ConfigError(f"{option} {shortened(text)}: accepted: a share in (0, 1), such as 0.01 or 1%")
    return share


def choose_frames(spec: str | None, *, default_time: bool) -> Sequence[Frame | None]:
    """The times to read a stage at; None is where it starts.

    Returns:
        At least one, in the order in which they are named.

    Raises:
        ConfigError: for what is no list of frames, or one beside the default time.
    """
    if spec is None:
        return ["default" if default_time else None]
    if default_time:
        raise ConfigError("--defaultTime and --frames exclude each other; accepted: one of them")
    from generators.pictures import parse_frames  # noqa: PLC0415

    return parse_frames(spec)


def start_warp(device: str) -> None:
    """Starts Warp without its banner and sees that the device is there."""
    import warp as wp  # noqa: PLC0415

    wp.config.log_level = wp.LOG_WARNING
    from fgf_warp.renderer import check_device  # noqa: PLC0415

    check_device(device)


@contextmanager
def telling(text: str) -> Iterator[None]:
    """Says on a terminal what is being done, for as long as it takes."""
    from rich.console import Console  # noqa: PLC0415

    with Console(stderr=True).status(text):
        yield


@contextmanager
def progress_bar(*, counted: bool) -> Iterator[Progress]:
    """A bar on stderr with rate and time left, and the count where it is worth reading."""
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import (  # noqa: PLC0415
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text  # noqa: PLC0415

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(f"{task.speed:,.3g}/s" if task.speed else "")

    count = [MofNCompleteColumn()] if counted else []
    columns = [TextColumn("{task.description}"), BarColumn(), *count, Rate(), TimeRemainingColumn()]
    with Progress(*columns, console=Console(stderr=True)) as progress:
        yield progress
