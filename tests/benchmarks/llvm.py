"""Finds the LLVM library that Mitsuba's llvm variants compile with."""

from __future__ import annotations

import ctypes.util
import os
import re
from collections.abc import Iterator
from pathlib import Path

VARIABLE = "DRJIT_LIBLLVM_PATH"
OLDEST = 16
NEWEST = 30
"""Versions that are asked for by name."""
FOLDERS = (
    "/usr/lib/*-linux-gnu",
    "/usr/lib64",
    "/usr/lib",
    "/usr/lib/llvm*/lib",
    "/usr/lib64/llvm*/lib",
    "/usr/local/lib",
    "/usr/local/opt/llvm*/lib",
    "/opt/homebrew/opt/llvm*/lib",
)
HELP = (
    f"Mitsuba's llvm variants need LLVM {OLDEST} or newer, and none was found. On Debian and Ubuntu: "
    f"apt-get install libllvm19. Where the library lies elsewhere, set {VARIABLE} to its file."
)


class LlvmNotFoundError(RuntimeError):
    """No LLVM of a version that Mitsuba takes."""


def provide_llvm() -> str:
    """Sets DRJIT_LIBLLVM_PATH, unless it is set already.

    Returns:
        The library's path or name.

    Raises:
        LlvmNotFoundError: saying how to get it.
    """
    if not os.environ.get(VARIABLE):
        found = max(_candidates(), default=None)
        if found is None:
            raise LlvmNotFoundError(HELP)
        os.environ[VARIABLE] = found[1]
    return os.environ[VARIABLE]


def _candidates() -> Iterator[tuple[int, str]]:
    """Versions and paths."""
    for pattern in FOLDERS:
        for path in Path("/").glob(f"{pattern}/libLLVM*".removeprefix("/")):
            version = _version(path.name)
            if version >= OLDEST:
                yield version, str(path)
    for version in range(OLDEST, NEWEST):
        name = ctypes.util.find_library(f"LLVM-{version}")
        if name:
            yield version, name


def _version(name: str) -> int:
    """Of a library's file name, such as libLLVM-19.so, libLLVM-19.so.1, libLLVM.so.19.1; 0 where it does not say."""
    found = re.fullmatch(r"libLLVM(?:-(\d+)[\w.]*\.(?:so|dylib)[\d.]*|\.so\.(\d+)[\d.]*)", name)
    return int(found[1] or found[2]) if found else 0
