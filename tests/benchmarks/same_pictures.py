"""`python -m tests.benchmarks.same_pictures BEFORE AFTER`: whether two source trees render the same, to the byte.

Renders every row of `pictures` with both, each in a process of its own, and tells which arrays differ, and how far.
With ``--time`` it then renders the scenes A, B, C and S of `scenes` in turn, and tells the ratio of the seconds of the
processor that a path takes.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np

from tests.benchmarks import scenes
from tests.benchmarks.pictures import PICTURES, Picture
from tests.benchmarks.report import processor

SIZE = {"width": 48, "height": 48, "spp": 4}
TIMED_SPP = {"A": 64, "B": 16, "C": 32, "S": 4}
"""About a million paths each, and four of the sweep's 256 images: a second or two of one core."""


class Tree:
    """A process that renders with a source tree; it starts when it is first asked.

    Args:
        path: of the checkout.
    """

    def __init__(self, path: Path) -> None:
        self.path = path.resolve()
        self._process: subprocess.Popen[str] | None = None

    def render(self, asked: dict[str, object], file: Path | None = None) -> float:
        """Seconds of the processor a path.

        Args:
            asked: see `one_tree.answer`.
            file: that its arrays are written to.

        Raises:
            RuntimeError: for what the renderer refused.
        """
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, Path(__file__).with_name("one_tree.py")],
                env={**os.environ, "PYTHONPATH": str(self.path)},
                cwd=self.path,
                text=True,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            )
        self._process.stdin.write(json.dumps({**asked, "file": str(file or "")}) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        found = json.loads(answer or '{"error": "the process ended"}')
        if "error" in found:
            raise RuntimeError(f"{self.path}: {found['error']}")
        if Path(found["tree"]) != self.path:
            raise RuntimeError(f"{found['tree']} was imported in place of {self.path}")
        return found["seconds"] / found["paths"]

    def close(self) -> None:
        """Ends the process."""
        if self._process is not None:
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


def asked_of(picture: Picture, stages: Path) -> dict[str, object]:
    """What `one_tree` is asked for."""
    scene = str(stages / picture.scene) if picture.scene.endswith(".usda") else picture.scene
    return {**asdict(picture), "scene": scene, "settings": {**SIZE, **picture.settings}}


def compare(before: Tree, after: Tree, pictures: list[Picture], kept: Path) -> int:
    """Number of pictures that differ or are refused; says what does.

    Args:
        before: renders what is not in the folder yet.
        after: renders all.
        pictures: that are compared.
        kept: a folder of what the first tree rendered.
    """
    stages = before.path / "usd_scenes" / "stages"
    count = 0
    for picture in pictures:
        asked = asked_of(picture, stages)
        file, other = kept / f"{picture.name}.npz", kept / f"after-{os.getpid()}.npz"
        try:
            if not file.exists():
                before.render(asked, file)
            after.render(asked, other)
            found = [*differences(file, other)]
        except RuntimeError as error:
            found = [str(error)]
        other.unlink(missing_ok=True)
        count += bool(found)
        print(f"{picture.name}: {'; '.join(found) or 'equal to the byte'}", flush=True)
    print(f"{len(pictures) - count} of {len(pictures)} pictures are equal to the byte")
    return count


def timed(folder: Path) -> dict[str, dict[str, object]]:
    """What `one_tree` is asked for of the scenes A, B, C and S, whose stages are written into the folder."""
    bounds = {"max_depth": scenes.SHORT.max_depth, "roulette_depth": scenes.SHORT.roulette_depth}
    asked = {}
    for name, spp in TIMED_SPP.items():
        size = asdict(scenes.IMAGES[name])
        stage = str(scenes.author(name, folder))
        settings = {**size, **bounds, "spp": spp, "threads": 1}
        asked[name] = {"scene": stage, "medium": {}, "settings": settings, "planes": "none", "by": "image"}
    media = scenes.sweep_media()
    values = [{"mean_extinction": m.mean_extinction, "albedo": m.albedo, "asymmetry": m.asymmetry} for m in media]
    asked["S"] |= {"by": "batch", "media": values}
    return asked


def measure(trees: tuple[Tree, Tree], pairs: int) -> None:
    """Says the ratio of the seconds a path that both take, by pairs whose order alternates.

    Beside the median of the pairs it says the ratio of the least seconds, which other work disturbs less.
    """
    print(f"{processor()}, {pairs} pairs of each scene, seconds of the processor a path")
    every = []
    with tempfile.TemporaryDirectory() as folder:
        for name, asked in timed(Path(folder)).items():
            took: list[tuple[float, float]] = []
            for pair in range(-1, pairs):  # The first pair builds what has to be built.
                seconds = {tree: tree.render(asked) for tree in (trees if pair % 2 else trees[::-1])}
                if pair >= 0:
                    took.append((seconds[trees[0]], seconds[trees[1]]))
            ratios = [after / before for before, after in took]
            every.append(statistics.median(ratios))
            low, _, high = statistics.quantiles(ratios)
            least_before, least_after = map(min, zip(*took, strict=True))
            print(
                f"{name}: after / before = {every[-1]:.3f} (quartiles {low:.3f} and {high:.3f}), "
                f"of the least {least_after / least_before:.3f}",
                flush=True,
            )
    print(f"all: {statistics.geometric_mean(every):.3f}")


def main() -> int:
    """Returns 1 where a picture differs."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.same_pictures", description=__doc__)
    parser.add_argument("before", type=Path, help="a checkout")
    parser.add_argument("after", type=Path, help="another one")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="of what BEFORE rendered, and need not again")
    parser.add_argument("--only", default="", metavar="PATTERN", help="of the names of the pictures to compare")
    parser.add_argument("--time", type=int, default=0, metavar="PAIRS", help="pairs of timed renders, at least 2")
    parser.add_argument("--only-time", action="store_true", help="compare no pictures")
    asked = parser.parse_args()
    trees = Tree(asked.before), Tree(asked.after)
    pictures = [picture for picture in PICTURES if re.search(asked.only, picture.name)]
    count = 0
    try:
        if not asked.only_time:
            with tempfile.TemporaryDirectory() as folder:
                kept = asked.keep or Path(folder)
                kept.mkdir(parents=True, exist_ok=True)
                count = compare(*trees, pictures, kept)
        if asked.time:
            measure(trees, asked.time)
    finally:
        for tree in trees:
            tree.close()
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
