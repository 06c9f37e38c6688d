"""What a measurement leaves behind: numbers, report and figure in a folder."""

from __future__ import annotations

from pathlib import Path

from fgf_warp.errors import OutputError
from fgf_warp.output.atomic import check_writable, write_bytes
from generators.tradeoff.front import write_front
from generators.tradeoff.measure import Outcome

NUMBERS, REPORT, FIGURE = "tradeoff.json", "tradeoff.html", "front.svg"


def make_folder(folder: Path) -> None:
    """Makes the folder of a report, so that it is known before the work begins whether it can be written.

    Raises:
        OutputError: where it cannot.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made: {error.strerror}") from error
    for name in (NUMBERS, REPORT, FIGURE):
        check_writable(folder / name)


def write(outcome: Outcome, folder: Path, command: str) -> list[Path]:
    """Writes numbers, report and leading figure.

    Args:
        outcome: of `generators.tradeoff.measure.measure`.
        folder: where to, see `make_folder`.
        command: that was given, for the report.

    Returns:
        The files.

    Raises:
        OutputError: where one cannot be written.
    """
    from generators.tradeoff.report import draw_front, write_tradeoff_report  # noqa: PLC0415 - slow to import

    write_front(folder / NUMBERS, outcome.front)
    write_bytes(folder / FIGURE, draw_front(outcome.front))
    write_tradeoff_report(outcome, folder / REPORT, command)
    return [folder / name for name in (NUMBERS, FIGURE, REPORT)]
