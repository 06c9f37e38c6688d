"""The page of `fgf tradeoff`."""

from __future__ import annotations

from pathlib import Path

from generators.plots import image_bytes, new_figure, plot_style
from generators.report import Section, write_report
from generators.tradeoff.front import Front
from generators.tradeoff.measure import Outcome


def write_tradeoff_report(outcome: Outcome, path: Path) -> None:
    """Writes the page."""
    write_report(path, title="Time against error", lead=[], sections=[Section("x")])


def draw_front(front: Front) -> bytes:
    """The leading figure."""
    with plot_style():
        return image_bytes(new_figure(6, 4))
