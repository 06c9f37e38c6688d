"""Stages with random mistakes: each becomes a picture or a refusal of a line or two, and nothing else."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.usd.fuzz import CLEAN, Renderer, write_mutant
from tests.usd.fuzz_stages import write_pictures

FEW, MANY, AT_ONCE = 30, 10_000, 500


@pytest.fixture(scope="module")
def renderer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Renderer]:
    process = Renderer(tmp_path_factory.mktemp("companion"))
    yield process
    process.close()


def assert_clean(seeds: range, renderer: Renderer, folder: Path) -> None:
    write_pictures(folder)
    found, kinds = {}, Counter[str]()
    for seed in seeds:
        path = write_mutant(seed, folder)
        outcome = renderer.render(path)
        kinds[outcome.kind] += 1
        if outcome.kind not in CLEAN:
            found[seed] = outcome
        for file in (path, path.with_suffix(".exr")):
            file.unlink(missing_ok=True)
    assert not found
    assert kinds["rendered"] > len(seeds) / 5, kinds
    assert kinds["read"] < len(seeds) / 5, kinds
    assert kinds["outside"] <= 1 + len(seeds) / 100, kinds


def test_a_stage_with_mistakes_is_rendered_or_refused(renderer: Renderer, tmp_path: Path) -> None:
    assert_clean(range(FEW), renderer, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(FEW, FEW + MANY, AT_ONCE))
def test_many_stages_with_mistakes_are_rendered_or_refused(first: int, renderer: Renderer, tmp_path: Path) -> None:
    assert_clean(range(first, first + AT_ONCE), renderer, tmp_path)
