"""What a figure is made from, and what becomes of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fgf_warp.result import RenderResult
from fgf_warp.scene import Medium
from generators.report import Figure, Table, Verdict


@dataclass(frozen=True, eq=False)
class Shot:
    """A render of the studio.

    Args:
        medium: of the ball.
        result: the picture.
    """

    medium: Medium
    result: RenderResult


@dataclass(frozen=True)
class Chapter:
    """A figure that is done.

    Args:
        paragraphs: that explain it.
        figures: its pictures by the name of their file, without the ending.
        tables: its numbers.
        verdict: where it claims something that can fail.
    """

    paragraphs: tuple[str, ...]
    figures: dict[str, Figure]
    tables: tuple[Table, ...] = ()
    verdict: Verdict | None = None


@dataclass(frozen=True)
class Exhibit:
    """A figure that can be made.

    Args:
        name: by which it is asked for.
        title: its heading.
        media: that it shows, made from the studio's own.
        draw: from a shot of each of them, in their order.
    """

    name: str
    title: str
    media: Callable[[Medium], Sequence[Medium]]
    draw: Callable[[Sequence[Shot]], Chapter]


def no_media(cloud: Medium) -> Sequence[Medium]:
    """Of a figure that shows curves alone."""
    return ()
