"""Keeps Warp's precompiled header from one process to the next, which takes half of the time to build a kernel.

Warp compiles its own header anew in every process that builds a kernel for the CPU. Here it is kept beside the kernels,
in a folder for each set of compiler flags, processor and installation of Warp, since a header fits no other.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import warp as wp
from warp._src import context

PREFIX = "header_"
"""Of the folders' names in the kernel cache."""
UNFINISHED = f"{PREFIX}new_"


def load_on_cpu(module: Any) -> None:
    """Loads a Warp module on the CPU, and builds it before where that has not been done.

    Args:
        module: a `warp.Module`; into its kernel cache no other process builds meanwhile.
    """
    with _kept_header(Path(wp.config.kernel_cache_dir), module.options):
        # A launch on the CPU asks for blocks of one thread, and would build anew for any other.
        module.load(wp.get_device("cpu"), 1)


@contextmanager
def _kept_header(cache: Path, options: dict[str, Any]) -> Iterator[None]:
    """Within it, a kernel is built with the header that is kept, or with one that is kept from then on."""
    if not (hasattr(context.runtime, "get_clang_pch_dir") and os.access(cache, os.W_OK)):
        yield
        return
    kept = cache / f"{PREFIX}{_digest(options)}"
    made: list[Path] = []

    def folder() -> str:
        """Asked for when the compiler is about to run."""
        if kept.is_dir():
            return str(kept)
        # A header that is cut off would spoil every later build, so it gets its name when it is whole.
        for left_by_a_killed_process in cache.glob(f"{UNFINISHED}*"):
            shutil.rmtree(left_by_a_killed_process, ignore_errors=True)
        made.append(Path(tempfile.mkdtemp(prefix=UNFINISHED, dir=cache)))
        return str(made[-1])

    runtime = context.runtime
    own = runtime.get_clang_pch_dir
    runtime.get_clang_pch_dir = folder
    try:
        yield
        for place in made:
            with suppress(OSError):  # Another name for it is no reason to fail.
                place.rename(kept)
    finally:
        runtime.get_clang_pch_dir = own
        for place in made:
            shutil.rmtree(place, ignore_errors=True)


def _digest(options: dict[str, Any]) -> str:
    """Of all that a header depends on."""
    native = Path(wp.__file__).parent / "native"
    parts = [wp.__version__, str(native), (native / "builtin.h").stat().st_mtime_ns, _processor()]
    parts += [wp.config.mode, wp.config.verify_fp]
    parts += [f"{key}={options[key]}" for key in sorted(options)]
    return hashlib.sha256("\n".join(map(str, parts)).encode()).hexdigest()[:12]


def _processor() -> str:
    """What the compiler's ``native`` stands for: the model and what it can do."""
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return "\n".join(sorted({line for line in lines if line.startswith(("model name", "flags", "Features"))}))
    return f"{platform.machine()} {platform.processor()}"
