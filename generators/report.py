"""Reports to look at: one HTML file that needs no other, with figures, tables and the words that explain them."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import jinja2

from fgf_warp.output.atomic import write_bytes


@dataclass(frozen=True)
class Figure:
    """A picture with a caption.

    Args:
        title: short, above the picture.
        caption: what is to be seen, and what it means.
        image: the file's content.
        kind: of the file.
        width: at which it is shown [CSS pixel]; None for its own.
    """

    title: str
    caption: str
    image: bytes
    kind: Literal["svg", "png"]
    width: int | None = None

    @property
    def data_uri(self) -> str:
        """The picture as part of a page."""
        mime = {"svg": "image/svg+xml", "png": "image/png"}[self.kind]
        return f"data:{mime};base64,{base64.b64encode(self.image).decode('ascii')}"


@dataclass(frozen=True)
class Table:
    """Rows of text.

    Args:
        title: short, above the table.
        caption: how to read it.
        columns: their heads.
        rows: cells as they are shown.
        failed: indices of rows that are outside what is asked for.
    """

    title: str
    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    failed: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Section:
    """A heading, paragraphs, and what is shown below them.

    Args:
        title: the heading.
        paragraphs: plain text.
        parts: in order.
    """

    title: str
    paragraphs: tuple[str, ...] = ()
    parts: tuple[Figure | Table, ...] = ()


@dataclass(frozen=True)
class Verdict:
    """Whether all is as it should be, in one line at the top.

    Args:
        passed: decides the colour.
        text: what it says.
    """

    passed: bool
    text: str


def write_report(
    path: Path, *, title: str, lead: Sequence[str], sections: Sequence[Section], verdict: Verdict | None = None
) -> None:
    """Writes a page that needs no network and no other file.

    Args:
        path: of the HTML file.
        title: of the page.
        lead: paragraphs below it.
        sections: in order.
        verdict: shown below the title where there is one.

    Raises:
        OutputError: where it cannot be written.
    """
    page = _TEMPLATE.render(title=title, lead=lead, sections=sections, verdict=verdict, is_figure=_is_figure)
    write_bytes(path, page.encode())


def _is_figure(part: Figure | Table) -> bool:
    return isinstance(part, Figure)


_TEMPLATE = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(
    """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ title }}</title>
<style>
body { font: 16px/1.55 system-ui, sans-serif; color: #1d2430; background: #fff; margin: 0 auto; padding: 2.5rem 1.5rem;
       max-width: 72rem; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 1rem; }
h2 { font-size: 1.35rem; margin: 3rem 0 .6rem; padding-top: 1.2rem; border-top: 1px solid #d9dee6; }
h3 { font-size: 1rem; margin: 1.8rem 0 .4rem; }
p, figcaption, caption { max-width: 48rem; }
figure { margin: 0 0 1rem; }
figure img { max-width: 100%; height: auto; }
figcaption, caption { color: #556070; font-size: .9rem; text-align: left; }
caption { padding-bottom: .5rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .88rem; font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: 600; border-bottom: 2px solid #1d2430; }
th, td { padding: .3rem .9rem .3rem 0; white-space: nowrap; }
td:last-child { white-space: normal; min-width: 14rem; padding-right: 0; }
td { border-bottom: 1px solid #e8ebf0; }
tr.failed td { background: #fdecea; color: #8c1d18; font-weight: 600; }
.verdict { padding: .7rem 1rem; border-left: 6px solid #1a7f4e; background: #e9f6ef; font-weight: 600; }
.verdict.failed { border-color: #b3261e; background: #fdecea; }
nav ul { columns: 2; padding-left: 1.2rem; }
nav a { color: #1f5fae; }
</style>
</head>
<body>
<h1>{{ title }}</h1>
{% if verdict %}
<p class="verdict{{ '' if verdict.passed else ' failed' }}">{{ verdict.text }}</p>
{% endif %}
{% for paragraph in lead %}
<p>{{ paragraph }}</p>
{% endfor %}
{% if sections|length > 2 %}
<nav><ul>
{% for section in sections %}
<li><a href="#s{{ loop.index }}">{{ section.title }}</a></li>
{% endfor %}
</ul></nav>
{% endif %}
{% for section in sections %}
<h2 id="s{{ loop.index }}">{{ section.title }}</h2>
{% for paragraph in section.paragraphs %}
<p>{{ paragraph }}</p>
{% endfor %}
{% for part in section.parts %}
{% if is_figure(part) %}
<figure>
<h3>{{ part.title }}</h3>
<img src="{{ part.data_uri }}" alt="{{ part.title }}"{% if part.width %} width="{{ part.width }}"{% endif %}>
<figcaption>{{ part.caption }}</figcaption>
</figure>
{% else %}
<h3>{{ part.title }}</h3>
<div class="scroll">
<table>
<caption>{{ part.caption }}</caption>
<thead><tr>{% for column in part.columns %}<th>{{ column }}</th>{% endfor %}</tr></thead>
<tbody>
{% set table = part %}
{% for row in part.rows %}
<tr{% if loop.index0 in table.failed %} class="failed"{% endif %}>
{%- for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>
{% endfor %}
</tbody>
</table>
</div>
{% endif %}
{% endfor %}
{% endfor %}
</body>
</html>
"""
)
