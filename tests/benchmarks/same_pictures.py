"""`python -m tests.benchmarks.same_pictures BEFORE AFTER`: whether two source trees render the same, to the byte.

Renders all of the stages of the first tree with both, each in a process of its own, with each of the transports and
with no planes, the usual ones and all; tells which arrays differ, and how far. With ``--time`` it then renders without
planes in turn, and tells the ratio of the seconds of the processor.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fgf_warp.theory.choices import TRANSPORTS
from tests.benchmarks.report import processor

WIDTH, SPP = 64, 4
TIMED_WIDTH, TIMED_SPP = 128, 32
OWN = "its own"
CASES = [(transport, "none") for transport in TRANSPORTS] + [(OWN, "usual"), (OWN, "all")]


class Tree:
    """A process that renders with a source tree.

    Args:
        path: of the checkout.
    """

    def __init__(self, path: Path) -> None:
        self.path = path.resolve()
        self._process = subprocess.Popen(
            [sys.executable, Path(__file__).with_name("one_tree.py")],
            env={**os.environ, "PYTHONPATH": str(self.path)},
            cwd=self.path,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )

    def render(
        self, stage: Path, transport: str, planes: str, file: Path | None, width: int = WIDTH, spp: int = SPP
    ) -> float:
        """Seconds of the processor.

        Raises:
            RuntimeError: for what the renderer refused.
        """
        asked = {
            "stage": str(stage),
            "transport": None if transport == OWN else transport,
            "planes": planes,
            "file": str(file or ""),
            "width": width,
            "spp": spp,
        }
        self._process.stdin.write(json.dumps(asked) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        found = json.loads(answer or '{"error": "the process ended"}')
        if "error" in found:
            raise RuntimeError(f"{self.path}: {stage.name}: {found['error']}")
        if Path(found["tree"]) != self.path:
            raise RuntimeError(f"{found['tree']} was imported in place of {self.path}")
        return found["seconds"]

    def close(self) -> None:
        """Ends the process."""
        self._process.stdin.close()
        self._process.wait()


def differences(before: Path, after: Path) -> Iterator[str]:
    """What of two files of arrays is not equal to the byte."""
    one, other = np.load(before), np.load(after)
    for name in sorted({*one.files, *other.files}):
        if name not in one.files or name not in other.files:
            yield f"{name}: only {'before' if name in one.files else 'after'}"
        elif one[name].shape != other[name].shape or one[name].dtype != other[name].dtype:
            yield f"{name}: {one[name].dtype}{one[name].shape} and {other[name].dtype}{other[name].shape}"
        elif one[name].tobytes() != other[name].tobytes():
            apart = one[name] != other[name]
            furthest = np.nanmax(np.abs(one[name].astype(np.float64) - other[name])) if apart.any() else 0
            yield f"{name}: {int(apart.sum())} of {apart.size} numbers, by {furthest:.3g} at most"


def compare(trees: tuple[Tree, Tree], stages: list[Path]) -> int:
    """Number of renders that differ; says what does."""
    count = 0
    with tempfile.TemporaryDirectory() as folder:
        files = Path(folder) / "before.npz", Path(folder) / "after.npz"
        for stage in stages:
            for transport, planes in CASES:
                for tree, file in zip(trees, files, strict=True):
                    tree.render(stage, transport, planes, file)
                found = [*differences(*files)]
                count += bool(found)
                print(
                    f"{stage.stem}, {transport} transport, {planes} planes: {'; '.join(found) or 'equal to the byte'}",
                    flush=True,
                )
    return count


def measure(trees: tuple[Tree, Tree], stages: list[Path], pairs: int) -> None:
    """Says the ratio of the seconds that both take, by pairs whose order alternates."""
    print(f"{processor()}, {pairs} pairs of {TIMED_WIDTH} x {TIMED_WIDTH} pixels, {TIMED_SPP} samples each")
    every = []
    for stage in stages:
        ratios = []
        for pair in range(-1, pairs):  # The first pair builds what has to be built.
            order = trees if pair % 2 else trees[::-1]
            seconds = {tree: tree.render(stage, OWN, "none", None, TIMED_WIDTH, TIMED_SPP) for tree in order}
            if pair >= 0:
                ratios.append(seconds[trees[1]] / seconds[trees[0]])
        every.append(statistics.median(ratios))
        low, _, high = statistics.quantiles(ratios)
        print(f"{stage.stem}: after / before = {every[-1]:.3f} (quartiles {low:.3f} and {high:.3f})", flush=True)
    print(f"all: {statistics.geometric_mean(every):.3f}")


def main() -> int:
    """Returns 1 where a picture differs."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.same_pictures", description=__doc__)
    parser.add_argument("before", type=Path, help="a checkout")
    parser.add_argument("after", type=Path, help="another one")
    parser.add_argument("--time", type=int, default=0, metavar="PAIRS", help="pairs of timed renders, at least 2")
    parser.add_argument("--only-time", action="store_true", help="compare no pictures")
    asked = parser.parse_args()
    stages = sorted((asked.before.resolve() / "usd_scenes" / "stages").glob("*.usda"))
    trees = Tree(asked.before), Tree(asked.after)
    try:
        count = 0 if asked.only_time else compare(trees, stages)
        if asked.time:
            measure(trees, stages, asked.time)
    finally:
        for tree in trees:
            tree.close()
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
