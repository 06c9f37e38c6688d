"""`python -m tests.benchmarks.builds BEFORE AFTER`: how long two source trees take to build their kernels.

In seconds of the processor, of scenes A and B of `scenes` and of one that has everything. Each build has a process and
a kernel cache of its own: the first one ever, in an empty cache, and a cold one, where nothing is left of the cache but
the compiler's header, if the tree keeps one (`fgf_warp.headers`). The trees take turns.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.benchmarks import scenes
from tests.benchmarks.one_build import FULL
from tests.benchmarks.report import processor

HEADERS = "header_"
"""What the names of kept headers begin with, in the kernel cache."""
FIRST, COLD = "first build ever", "cold build"


def build(tree: Path, scene: str, cache: Path) -> float:
    """Seconds of the processor to build the kernel of a scene.

    Args:
        tree: a checkout.
        scene: the path of a stage, or `FULL`.
        cache: the folder of the kernel cache.

    Raises:
        RuntimeError: where another tree was imported.
    """
    ran = subprocess.run(
        [sys.executable, Path(__file__).with_name("one_build.py"), scene],
        env={**os.environ, "PYTHONPATH": str(tree), "WARP_CACHE_PATH": str(cache)},
        cwd=tree,
        text=True,
        stdout=subprocess.PIPE,
        check=True,
    )
    imported, seconds = ran.stdout.splitlines()[-1].rsplit(maxsplit=1)
    if Path(imported) != tree:
        raise RuntimeError(f"{imported} was imported in place of {tree}")
    return float(seconds)


def first_and_cold(tree: Path, scene: str) -> dict[str, float]:
    """Seconds of the first build ever, and of a cold one after it."""
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder)
        first = build(tree, scene, cache)
        forget_kernels(cache)
        return {FIRST: first, COLD: build(tree, scene, cache)}


def forget_kernels(cache: Path) -> None:
    """Empties a kernel cache but for the compiler's headers, at whatever depth they are."""
    for path in sorted(cache.rglob("*"), key=lambda path: -len(path.parts)):
        if any(part.startswith(HEADERS) for part in path.relative_to(cache).parts):
            continue
        if path.is_file():
            path.unlink()
        elif not any(path.iterdir()):
            path.rmdir()


def measure(before: Path, after: Path, pairs: int, folder: Path) -> None:
    """Says the medians of both trees and their ratio, and the least and the largest ratio of a pair."""
    places = {"A": str(scenes.author("A", folder)), "B": str(scenes.author("B", folder)), "everything": FULL}
    print(f"{processor()}, {pairs} pairs of each, seconds of the processor", flush=True)
    for name, scene in places.items():
        seconds: dict[Path, list[dict[str, float]]] = {before: [], after: []}
        for pair in range(pairs):
            for tree in (before, after)[:: -1 if pair % 2 else 1]:
                seconds[tree].append(first_and_cold(tree, scene))
        for kind in (FIRST, COLD):
            one, other = ([of_pair[kind] for of_pair in seconds[tree]] for tree in (before, after))
            a, b = statistics.median(one), statistics.median(other)
            ratios = sorted(y / x for x, y in zip(one, other, strict=True))
            print(
                f"{name}, {kind}: {a:.2f} s before, {b:.2f} s after, ratio {b / a:.3f} "
                f"(of pairs {ratios[0]:.3f} to {ratios[-1]:.3f})",
                flush=True,
            )


def main() -> None:
    """Measures."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.builds", description=__doc__)
    parser.add_argument("before", type=Path, help="a checkout")
    parser.add_argument("after", type=Path, help="another one")
    parser.add_argument("--pairs", type=int, default=5, help="of builds, in turn")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        measure(asked.before.resolve(), asked.after.resolve(), asked.pairs, Path(folder))


if __name__ == "__main__":
    main()
