"""Writes the page."""

from __future__ import annotations

import json
import os
import shlex
from importlib.resources import files
from pathlib import Path

import jinja2

from fgf_warp import __version__
from fgf_warp.output.atomic import write_bytes
from generators.dataset import layout
from generators.dataset.images import choose_shown
from generators.dataset.reader import Dataset
from generators.dataset_report.content import gather
from generators.dataset_report.thumbnails import SHOWN_MAX, Progress, make_thumbnails
from generators.publishing.index import build_index


def write_dataset_report(dataset: Dataset, path: Path | None = None, progress: Progress | None = None) -> str:
    """Writes one HTML file that needs no other, and no network.

    Args:
        dataset: complete or not.
        path: of the file; None is ``report.html`` in the dataset.
        progress: of its pictures.

    Returns:
        Where it is.

    Raises:
        CorruptFileError: where a record or an image cannot be read.
        OutputError: where it cannot be written.
    """
    complete = dataset.complete()
    content = gather(dataset, build_index(dataset))
    shown = choose_shown(complete, SHOWN_MAX)
    table = {
        **content.table,
        "thumbnails": make_thumbnails(dataset, shown, progress),
        "base": _way_to(dataset, path),
        "command": rerender_command(dataset),
    }
    page = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(_source("page.html"))
    html = page.render(
        meta=dataset.meta,
        content=content,
        thumbnails_text=_thumbnails_text(len(shown), len(complete)),
        version=__version__,
        style=_source("page.css"),
        script=_source("page.js"),
        data=_as_script(table),
    ).encode(errors="replace")
    if path is None:
        dataset.store.write(layout.REPORT, html)
        return f"{dataset.store.location}/{layout.REPORT}"
    write_bytes(path, html)
    return str(path)


def rerender_command(dataset: Dataset) -> str:
    """The command that renders one sample again, with ``{index}`` in the place of its number."""
    location = shlex.quote(dataset.store.location)
    device = " --device cuda:0" if dataset.meta.device == "cuda" else ""
    return f"fgf generate {location} --sample {{index}} --out {shlex.quote(dataset.meta.name)}-sample-{{index}}{device}"


def _way_to(dataset: Dataset, path: Path | None) -> str | None:
    """From the page to the dataset, as the beginning of a link; None where no link leads there."""
    if path is None:
        return ""
    if dataset.store.folder is None:
        return None
    way = os.path.relpath(dataset.store.folder.resolve(), path.resolve().parent)
    return "" if way == "." else f"{Path(way).as_posix()}/"


def _thumbnails_text(shown: int, complete: int) -> str:
    if shown == complete:
        return ""
    return f"{shown:,} of {complete:,} samples are pictured, spread over all of them, so that the page stays small."


def _as_script(table: object) -> str:
    """JSON that ends no script element, whatever a name in it says."""
    text = json.dumps(table, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.replace("<", "\\u003c")


def _source(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")
