"""Configs with random mistakes: each becomes a plan or a refusal of one line, and nothing else."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.generators.fuzz_configs import Planner, mutant

FEW, MANY = 60, 10_000


@pytest.fixture(scope="module")
def planner() -> Iterator[Planner]:
    process = Planner()
    yield process
    process.close()


def assert_clean(seeds: range, planner: Planner, folder: Path) -> None:
    found, kinds = {}, Counter[str]()
    for seed in seeds:
        place = folder / str(seed)
        place.mkdir()
        outcome = planner.plan(place, mutant(seed))
        kinds[outcome.kind] += 1
        if outcome.kind not in ("planned", "refused"):
            found[seed] = outcome
    assert not found
    assert kinds["planned"] > len(seeds) / 10, kinds


def test_a_config_with_mistakes_is_planned_or_refused(planner: Planner, tmp_path: Path) -> None:
    assert_clean(range(FEW), planner, tmp_path)


@pytest.mark.slow
def test_many_configs_with_mistakes_are_planned_or_refused(planner: Planner, tmp_path: Path) -> None:
    assert_clean(range(FEW, FEW + MANY), planner, tmp_path)
