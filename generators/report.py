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
class Gallery:
    """Figures beside each other, as many in a row as there is room for; small pictures keep their pixels sharp.

    Args:
        title: short, above them.
        caption: what they share.
        figures: in order.
        column: least width of each [CSS pixel].
    """

    title: str
    caption: str
    figures: tuple[Figure, ...]
    column: int


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
    parts: tuple[Figure | Gallery | Table, ...] = ()


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
    page = _TEMPLATE.render(title=title, lead=lead, sections=sections, verdict=verdict, kind_of=_kind_of)
    write_bytes(path, page.encode())


def _kind_of(part: Figure | Gallery | Table) -> str:
    return type(part).__name__


_TEMPLATE = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(
    """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<link rel="icon" href="data:,">
<title>{{ title }}</title>
<style>
:root { color-scheme: light dark; --page: #fff; --text: #1d2430; --quiet: #556070; --line: #d9dee6; --link: #1f5fae;
        --good: #e9f6ef; --good-edge: #1a7f4e; --bad: #fdecea; --bad-edge: #b3261e; --bad-text: #8c1d18; }
@media (prefers-color-scheme: dark) {
  :root { --page: #14171c; --text: #e6e9ee; --quiet: #a3adba; --line: #343b46; --link: #86b8ff;
          --good: #14291f; --good-edge: #4cb388; --bad: #341a1a; --bad-edge: #ff8a80; --bad-text: #ffb4ac; }
}
body { font: 16px/1.55 system-ui, sans-serif; color: var(--text); background: var(--page); margin: 0 auto;
       padding: 2.5rem clamp(.9rem, 4vw, 1.5rem); max-width: 72rem; overflow-wrap: break-word; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 1rem; }
h2 { font-size: 1.35rem; margin: 3rem 0 .6rem; padding-top: 1.2rem; border-top: 1px solid var(--line); }
h3 { font-size: 1rem; margin: 1.8rem 0 .4rem; }
p, figcaption { max-width: 48rem; }
figure { margin: 0 0 1rem; }
/* Drawn on white. */
figure img { max-width: 100%; height: auto; background: #fff; }
figcaption, .note { color: var(--quiet); font-size: .9rem; text-align: left; }
.gallery { display: grid; gap: .8rem 1.2rem;
           grid-template-columns: repeat(auto-fill, minmax(min(100%, var(--column)), 1fr)); }
.gallery figure { margin: 0; min-width: 0; }
.gallery h4 { font-size: .88rem; margin: 0 0 .2rem; }
.gallery img { width: 100%; image-rendering: pixelated; }
.gallery figcaption { font-size: .8rem; line-height: 1.35; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .88rem; font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: 600; border-bottom: 2px solid var(--text); }
th, td { padding: .3rem .9rem .3rem 0; white-space: nowrap; }
td:last-child { white-space: normal; min-width: 14rem; padding-right: 0; }
td { border-bottom: 1px solid var(--line); }
tr.failed td { background: var(--bad); color: var(--bad-text); font-weight: 600; }
.verdict { padding: .7rem 1rem; border-left: 6px solid var(--good-edge); background: var(--good); font-weight: 600; }
.verdict.failed { border-color: var(--bad-edge); background: var(--bad); }
nav ul { columns: 2 18rem; padding-left: 1.2rem; }
nav a { color: var(--link); }
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
{% if kind_of(part) == "Figure" %}
<figure>
<h3>{{ part.title }}</h3>
<img src="{{ part.data_uri }}" alt="{{ part.title }}"{% if part.width %} width="{{ part.width }}"{% endif %}>
<figcaption>{{ part.caption }}</figcaption>
</figure>
{% elif kind_of(part) == "Gallery" %}
<h3>{{ part.title }}</h3>
<p class="note">{{ part.caption }}</p>
<div class="gallery" style="--column: {{ part.column }}px">
{% for figure in part.figures %}
<figure>
<h4>{{ figure.title }}</h4>
<img src="{{ figure.data_uri }}" alt="{{ figure.title }}">
<figcaption>{{ figure.caption }}</figcaption>
</figure>
{% endfor %}
</div>
{% else %}
<h3>{{ part.title }}</h3>
<p class="note">{{ part.caption }}</p>
<div class="scroll">
<table>
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
