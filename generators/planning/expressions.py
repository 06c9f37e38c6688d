"""Expressions of a config: axes that follow from others, and constraints.

An expression has numbers, names of axes, texts in quotes, ``+ - * / // % **``, comparisons, ``and``, ``or``, ``not``,
``a if condition else b``, and the functions of `FUNCTIONS`. It is not Python: nothing else is evaluated.
"""

from __future__ import annotations

import ast
import math
import operator
import warnings
from collections.abc import Callable, Mapping
from typing import Any

from fgf_warp.errors import ConfigError
from generators.wording import one_line

FUNCTIONS: dict[str, Callable[..., float]] = {
    "abs": abs,
    "cos": math.cos,
    "exp": math.exp,
    "log": math.log,
    "log10": math.log10,
    "max": max,
    "min": min,
    "sin": math.sin,
    "sqrt": math.sqrt,
}
CONSTANTS = {"pi": math.pi}
OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: math.pow,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
PARTS = (
    *(ast.Name, ast.Load, ast.Compare, ast.IfExp),
    *(ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.And, ast.Or, ast.Not),
)
"""Of an expression, beside operators, constants and calls."""
SHOWN_MAX = 60
"""Characters of an expression in a message."""
LENGTH_MAX = 1000
"""Characters of an expression."""
DEPTH_MAX = 100
"""Of operations inside each other, as in a sum of so many terms; far below what would exhaust Python's stack."""


class Expression:
    """One expression, parsed.

    Args:
        text: as written.

    Raises:
        ConfigError: where it is something else, saying what is accepted.
    """

    def __init__(self, text: str) -> None:
        self.text = " ".join(text.split())
        if len(text) > LENGTH_MAX:
            raise ConfigError(f"found {text[:60]!r} and more; accepted: at most {LENGTH_MAX} characters")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Of what reads like a slip in Python.
                self._tree = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            accepted = "an expression of axes, such as 'H < 0 or L > 1'"
            raise ConfigError(f"found {text[:60]!r}; accepted: {accepted}") from error
        if _depth(self._tree) > DEPTH_MAX:
            raise ConfigError(f"found {text[:60]!r} and more; accepted: at most {DEPTH_MAX} operations in each other")
        for node in ast.walk(self._tree):
            _check_node(node)
        called = {node.func for node in ast.walk(self._tree) if isinstance(node, ast.Call)}
        names = (node for node in ast.walk(self._tree) if isinstance(node, ast.Name) and node not in called)
        self.names: frozenset[str] = frozenset(node.id for node in names) - CONSTANTS.keys()

    def number(self, values: Mapping[str, float | str]) -> float:
        """Its value.

        Args:
            values: of the axes, by name; all `names` among them.

        Returns:
            A finite number.

        Raises:
            ConfigError: where it is no finite number.
        """
        found = self._evaluate(values)
        if isinstance(found, bool | str) or not math.isfinite(found):
            raise ConfigError(f"{self._shown} is {found}; accepted: a finite number")
        return float(found)

    def holds(self, values: Mapping[str, float | str]) -> bool:
        """Whether it is true.

        Args:
            values: as for `number`.

        Raises:
            ConfigError: where it is neither true nor false.
        """
        found = self._evaluate(values)
        if not isinstance(found, bool):
            raise ConfigError(f"{self._shown} is {found}; accepted: a comparison, such as 'H < 0 or L > 1'")
        return found

    def _evaluate(self, values: Mapping[str, float | str]) -> Any:
        try:
            return _evaluate(self._tree, {**CONSTANTS, **values})
        except (ArithmeticError, ValueError, TypeError) as error:
            raise ConfigError(f"{self._shown} has no value: {error}") from error

    @property
    def _shown(self) -> str:
        return one_line(self.text, SHOWN_MAX)


def _depth(tree: ast.AST) -> int:
    """Levels of nodes, without going down as many calls."""
    depth, level = 0, [tree]
    while level:
        depth, level = depth + 1, [child for node in level for child in ast.iter_child_nodes(node)]
    return depth


def _check_node(node: ast.AST) -> None:
    """Refuses what is not part of an expression."""
    if isinstance(node, ast.Constant):
        accepted = isinstance(node.value, int | float | str) and not isinstance(node.value, bool)
    elif isinstance(node, ast.Call):
        accepted = isinstance(node.func, ast.Name) and node.func.id in FUNCTIONS and not node.keywords
    else:
        accepted = isinstance(node, PARTS) or type(node) in OPERATORS
    if not accepted:
        shown = ast.unparse(node) if isinstance(node, ast.expr) else type(node).__name__
        raise ConfigError(
            f"found {shown[:60]}; accepted: numbers, names of axes, arithmetic, comparisons, and, or, not, if else, "
            f"{', '.join(FUNCTIONS)}"
        )


def _evaluate(node: ast.expr, values: Mapping[str, float | str]) -> float | str | bool:  # noqa: PLR0911
    match node:
        case ast.Constant():
            # Powers of whole numbers could grow without end.
            return float(node.value) if isinstance(node.value, int | float) else str(node.value)
        case ast.Name():
            return values[node.id]
        case ast.UnaryOp(op=ast.Not()):
            return not _truth(node.operand, values)
        case ast.UnaryOp():
            return OPERATORS[type(node.op)](_number(node.operand, values))
        case ast.BinOp():
            return OPERATORS[type(node.op)](_number(node.left, values), _number(node.right, values))
        case ast.BoolOp(op=ast.Or()):
            return any(_truth(part, values) for part in node.values)
        case ast.BoolOp():
            return all(_truth(part, values) for part in node.values)
        case ast.Compare():
            operands = [_evaluate(part, values) for part in (node.left, *node.comparators)]
            pairs = zip(node.ops, operands, operands[1:], strict=False)
            return all(OPERATORS[type(compare)](left, right) for compare, left, right in pairs)
        case ast.IfExp():
            return _evaluate(node.body if _truth(node.test, values) else node.orelse, values)
        case ast.Call(func=ast.Name(id=name)):
            return FUNCTIONS[name](*(_number(part, values) for part in node.args))
    raise AssertionError(ast.dump(node))


def _number(node: ast.expr, values: Mapping[str, float | str]) -> float:
    found = _evaluate(node, values)
    if not isinstance(found, float):
        raise TypeError(f"{ast.unparse(node)} is no number")
    return found


def _truth(node: ast.expr, values: Mapping[str, float | str]) -> bool:
    found = _evaluate(node, values)
    if not isinstance(found, bool):
        raise TypeError(f"{ast.unparse(node)} is neither true nor false")
    return found
