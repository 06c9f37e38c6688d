"""How plots look, and how they become files; drawn by matplotlib without a display."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal

import matplotlib as mpl
from matplotlib.figure import Figure

STYLE: Any = {
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#e3e7ed",
    "legend.frameon": False,
    "image.interpolation": "nearest",
    "svg.hashsalt": "fgf-warp",
    "savefig.dpi": 160,
}
"""With a fixed salt, equal plots are equal files."""
SEQUENTIAL, DIVERGING = "viridis", "RdBu_r"
"""Colour maps of quantities that rise from nothing, and of those that have two signs."""


@contextmanager
def plot_style() -> Iterator[None]:
    """All plots are drawn within it."""
    with mpl.rc_context(STYLE):
        yield


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of this size [inch] that lays itself out."""
    return Figure(figsize=(width, height), layout="constrained")


def image_bytes(figure: Figure, kind: Literal["svg", "png"] = "svg") -> bytes:
    """The figure as a file: SVG for lines and maps, PNG for what holds pictures."""
    with io.BytesIO() as file:
        figure.savefig(file, format=kind, metadata={"Date": None} if kind == "svg" else None)
        return file.getvalue()
