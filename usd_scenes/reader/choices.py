"""What is asked of a stage that is read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict

from usd_scenes.reader.frames import Frame


class ReadOptions(TypedDict, total=False):
    """Keywords of those who read a stage; each may be left out.

    Args:
        camera: path or name of a camera; None takes the render settings', else the first (with a warning where there
            are several), else a view from the front that holds everything.
        frame: time code at which attributes are sampled, or ``default``; None takes the stage's authored start, else
            each attribute's earliest sample.
        purposes: which geometry to read, of ``default``, ``render``, ``proxy`` and ``guide``; None takes the render
            settings', else ``default`` and ``render``.
        complexity: how far surfaces are subdivided, ``low``, ``medium``, ``high`` or ``veryhigh``; else ``high``.
        strict: True where what is missing, such as a texture's file, is an error instead of a warning; else False.
        render_settings: path of the RenderSettings; None takes those that the stage's metadata name, else the first.
        product: path of the RenderProduct that is meant; None takes the settings' first.
    """

    camera: str | None
    frame: Frame | None
    purposes: Sequence[str] | None
    complexity: str
    strict: bool
    render_settings: str | None
    product: str | None


@dataclass(frozen=True)
class Choices:
    """`ReadOptions` with what is taken where one is left out.

    Args:
        asked_for: attributes whose values were asked for in place of the stage's.
    """

    camera: str | None = None
    frame: Frame | None = None
    purposes: Sequence[str] | None = None
    complexity: str = "high"
    strict: bool = False
    render_settings: str | None = None
    product: str | None = None
    asked_for: frozenset[str] = frozenset()
