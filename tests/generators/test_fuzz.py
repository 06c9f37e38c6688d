"""Datasets with random damage: every command tells it in lines, changes nothing of others, and a repair heals it."""

import os
import shutil
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.generators.fuzz import Examiner, damage, make_whole

FEW, MANY = 12, 2000


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_whole(tmp_path_factory.mktemp("fuzz"))


@pytest.fixture(scope="module")
def examiner(whole: Path) -> Iterator[Examiner]:
    process = Examiner(whole)
    yield process
    process.close()


def assert_clean(seeds: range, whole: Path, examiner: Examiner, folder: Path) -> None:
    found, kinds = {}, Counter[str]()
    for seed in seeds:
        copy = folder / str(seed)
        shutil.copytree(whole, copy)
        told = damage(copy, seed)
        outcome = examiner.examine(copy, generates=seed % 2 == 1)
        kinds[outcome.kind] += 1
        if outcome.kind not in ("whole", "told"):
            found[seed] = f"{told}: {outcome.kind}: {outcome.text}"
        os.system(f"chmod -R u+rwX {copy}")
        shutil.rmtree(copy)
    assert not found, "\n\n".join(f"seed {seed}: {text}" for seed, text in found.items())
    assert kinds["whole"] > len(seeds) / 2, kinds


def test_a_damaged_dataset_is_told_and_healed(whole: Path, examiner: Examiner, tmp_path: Path) -> None:
    assert_clean(range(FEW), whole, examiner, tmp_path)


@pytest.mark.slow
def test_many_damaged_datasets_are_told_and_healed(whole: Path, examiner: Examiner, tmp_path: Path) -> None:
    assert_clean(range(FEW, FEW + MANY), whole, examiner, tmp_path)
