"""What a measurement leaves behind: numbers, report and figure in a folder."""

from __future__ import annotations

from pathlib import Path

from fgf_warp.output.atomic import write_bytes
from generators.tradeoff.front import write_front
from generators.tradeoff.measure import Outcome

NUMBERS, FIGURE, REPORT = FILES = ("tradeoff.json", "front.svg", "tradeoff.html")


def write(outcome: Outcome, folder: Path, command: str) -> list[Path]:
    """Writes numbers, report and leading figure.

    Args:
        outcome: of `generators.tradeoff.measure.measure`.
        folder: where to.
        command: that was given, for the report.

    Returns:
        The files.

    Raises:
        OutputError: where one cannot be written.
    """
    from generators.tradeoff.plots import draw_front  # noqa: PLC0415 - slow to import
    from generators.tradeoff.report import write_tradeoff_report  # noqa: PLC0415

    write_front(folder / NUMBERS, outcome.front)
    write_bytes(folder / FIGURE, draw_front(outcome.front))
    write_tradeoff_report(outcome, folder / REPORT, command)
    return [folder / name for name in FILES]
