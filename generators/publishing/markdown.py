"""Words that others chose, such as names, as Markdown and YAML that say just these words."""

from __future__ import annotations

import json
import re

import jinja2

SPECIAL = re.compile(r"([\\`*\[\]<>|&$~])")
"""Means something anywhere in a line."""
UNDERSCORE = re.compile(r"(?<![^\W_])_|_(?![^\W_])")
"""Within a word it means nothing."""
FIRST = re.compile(r"^(?:(#{1,6}(?=\s|$)|[-+=](?=[-+=\s]|$))|(\d{1,9})([.)])(?=\s|$))")
"""Makes a heading, a list or a line of what it begins."""
UNPRINTABLE = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff\ud800-\udfff]")
REPLACEMENT = "\ufffd"


def plain(text: str) -> str:
    """In Markdown, the same words as text and nothing else, in one line."""
    words = SPECIAL.sub(r"\\\1", _in_a_line(text))
    words = UNDERSCORE.sub(r"\\_", words)
    return FIRST.sub(lambda found: f"\\{found[1]}" if found[1] else f"{found[2]}\\{found[3]}", words)


def code(text: str) -> str:
    """In Markdown, the same words as code, in a line or in a cell of a table."""
    words = _in_a_line(text).replace("|", "\\|")
    if not words:
        return ""
    fence = "`" * (1 + max((len(run) for run in re.findall("`+", words)), default=0))
    room = " " if words.startswith("`") or words.endswith("`") else ""
    return f"{fence}{room}{words}{room}{fence}"


def quoted(text: str) -> str:
    """In YAML, the same text between quotes."""
    return json.dumps(UNPRINTABLE.sub(_replaced, text), ensure_ascii=False)


def markdown_template(source: str) -> jinja2.Template:
    """A template with the filters ``plain``, ``code`` and ``quoted``."""
    environment = jinja2.Environment(autoescape=False, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True)
    environment.filters |= {"plain": plain, "code": code, "quoted": quoted}
    return environment.from_string(source)


def _in_a_line(text: str) -> str:
    return " ".join(UNPRINTABLE.sub(_replaced, text).split())


def _replaced(found: re.Match[str]) -> str:
    """Blanks stay blanks; what no page can show is shown as such."""
    return " " if found[0].isspace() else REPLACEMENT
