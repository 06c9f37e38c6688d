"""`python -m tests.benchmarks`: runs the benchmark, writes the report, and fails where images disagree."""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time
from pathlib import Path

from tests.benchmarks.benchmark import FULL, PARTS, QUICK, Benchmark
from tests.benchmarks.llvm import LlvmNotFoundError, provide_llvm
from tests.benchmarks.report import as_line, save
from tests.benchmarks.sides import SideError


def main() -> int:
    """Returns the exit code: 0 fine, 1 images disagree, 2 it could not run."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("--only", default=",".join(PARTS), help=f"a list of {', '.join(PARTS)}")
    parser.add_argument("--quick", action="store_true", help="fewer and shorter timings: a look, not a result")
    parser.add_argument("--out", type=Path, help="folder of benchmarks.json and benchmarks.md; none is written without")
    arguments = parser.parse_args()
    parts = arguments.only.split(",")
    if not set(parts) <= set(PARTS):
        parser.error(f"--only {arguments.only}; accepted: a list of {', '.join(PARTS)}")
    start = time.perf_counter()

    def say(text: str) -> None:
        print(f"{time.perf_counter() - start:6.0f} s  {text}", flush=True)

    if importlib.util.find_spec("mitsuba") is None:
        print("Mitsuba is not installed: pip install --editable '.[bench]', or make bench", file=sys.stderr)
        return 2
    try:
        provide_llvm()
        report = Benchmark(QUICK if arguments.quick else FULL, say).run(parts)
    except (LlvmNotFoundError, SideError) as error:
        print(error, file=sys.stderr)
        return 2
    print()
    for row in report.rows:
        print(as_line(row))
    for note in report.notes:
        print(note)
    if arguments.out is not None:
        save(report, arguments.out, arguments.quick)
        print(f"\n{arguments.out / 'benchmarks.md'}, {arguments.out / 'benchmarks.json'}")
    failed = [f"{row.scene}, {row.quantity}" for row in report.rows if row.failed]
    if failed:
        print(f"\nFAILED, the images disagree: {'; '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
