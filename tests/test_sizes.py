"""No file and no function is longer than a reader keeps in mind, but kernels, which Warp wants in one piece."""

import ast
from pathlib import Path

import pytest

from tests.test_layers import SOURCES, module_name

FILE_LINES, FUNCTION_LINES = 600, 120
"""The most of a file and of a function, whose docstring counts and whose decorators do not."""


def is_kernel(function: ast.FunctionDef) -> bool:
    """True for what is decorated with ``wp.kernel``, with options or without."""
    decorators = (d.func if isinstance(d, ast.Call) else d for d in function.decorator_list)
    return any(ast.unparse(decorator) == "wp.kernel" for decorator in decorators)


def functions_in(source: str) -> dict[str, int]:
    """Lines of each function that is no kernel, without those of the kernels in it, by its name and first line."""
    found = {}
    for function in ast.walk(ast.parse(source)):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef) and not is_kernel(function):
            kernels = [n for n in ast.walk(function) if isinstance(n, ast.FunctionDef) and is_kernel(n)]
            lines = sum(_lines(kernel) for kernel in kernels)
            found[f"{function.name}:{function.lineno}"] = _lines(function) - lines
    return found


def _lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    return function.end_lineno - function.lineno + 1


@pytest.mark.parametrize("path", SOURCES, ids=module_name)
def test_size(path: Path) -> None:
    source = path.read_text()
    lines = len(source.splitlines())
    assert lines <= FILE_LINES, f"{path}: {lines} lines"
    long = {name: lines for name, lines in functions_in(source).items() if lines > FUNCTION_LINES}
    assert not long, f"{path}: functions of more than {FUNCTION_LINES} lines: {long}"


def test_kernels_do_not_count() -> None:
    source = """
def build():
    n = 1

    @wp.kernel(module="unique")
    def kernel():
        n = 2
        n = 3

    @wp.func
    def function():
        n = 4

    return kernel
"""
    assert functions_in(source) == {"build:2": 10, "function:11": 2}
