"""Tables of what a record holds, from which its struct and the code that copies it are made.

A record, such as a path or the sums of a pixel, is a table with a row for each number or vector in it. A kernel's
record has only the rows that the kernel's features need. Warp compiles source text, so the copying functions are
written as text, one line for each row.
"""

import linecache
from collections.abc import Callable, Iterable, Sequence
from itertools import count
from typing import Any, NamedTuple

import numpy as np
import warp as wp

from fgf_warp.features import RenderFeatures

LANES = wp.constant(128)
"""Paths that a pool takes through each stage together."""

Needs = Callable[[RenderFeatures], bool]

COMPONENTS = {wp.vec3: 3, wp.vec4: 4, wp.vec3d: 3}
_numbers = count()


def always(features: RenderFeatures) -> bool:
    """Every kernel needs it."""
    return True


class Row(NamedTuple):
    """A number or vector of a path.

    Args:
        name: of the field; with a dot, of a field of a nested struct.
        dtype: a Warp type.
        meaning: one line.
        needs: whether a kernel of these features has it.
        initial: its value when a path is born; None stands for 0.
        lives: whether it lives from one stage to the next, so that a pool keeps it for each lane; None: as `needs`.
    """

    name: str
    dtype: Any
    meaning: str
    needs: Needs = always
    initial: Any = None
    lives: Needs | None = None

    def is_kept(self, features: RenderFeatures) -> bool:
        """True where a pool has rows of it."""
        return self.needs(features) and (self.lives is None or self.lives(features))


def make_struct(name: str, fields: dict[str, Any]) -> Any:
    """A Warp struct of these fields, name -> type."""
    return wp.struct(type(name, (), {"__annotations__": fields, "__module__": __name__}))


def make_function(signature: str, lines: Iterable[str], names: dict[str, Any], *, inline: bool = True) -> Any:
    """A Warp function from its text.

    Args:
        signature: ``name(arguments) -> type``.
        lines: of its body, without indentation.
        names: what the text refers to, beside `wp` and `LANES`.
        inline: whether the compiler must put it in where it is called; otherwise it may.
    """
    function = signature.partition("(")[0]
    text = "\n".join(
        [
            f"def build({', '.join(names)}):",
            "    @wp.func(inline=True)" if inline else "    @wp.func",
            f"    def {signature}:",
            *(f"        {line}" for line in lines),
            f"    return {function}",
            "",
        ]
    )
    # Warp reads the source of a function through `inspect`, which finds text without a file in this cache.
    file = f"<{function} {next(_numbers)}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    space = {"wp": wp, "LANES": LANES, "__name__": __name__}
    exec(compile(text, file, "exec"), space)
    return space["build"](**names)


def places(rows: Iterable[tuple[str, Any]]) -> tuple[dict[str, int], int]:
    """Where in an array each of the rows (name, type) begins, in units of `LANES` numbers, and how many there are."""
    found, place = {}, 0
    for name, dtype in rows:
        found[name] = place
        place += COMPONENTS.get(dtype, 1)
    return found, place


def literal(value: Any, dtype: Any) -> str:
    """A value of a Warp type as source text."""
    if dtype in COMPONENTS:
        values: Sequence[float] = [value] * COMPONENTS[dtype]
        return f"wp.{dtype.__name__}({', '.join(repr(float(v)) for v in values)})"
    if dtype is wp.uint32:
        # Warp's integers are signed where they are written.
        return f"wp.uint32({np.uint32(value).view(np.int32)})"
    return repr(dtype(value))
