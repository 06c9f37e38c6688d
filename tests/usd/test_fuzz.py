"""Stages with random mistakes: each becomes a picture or a refusal of a line or two, and nothing else."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.usd.fuzz import Renderer, mutant, write_pictures

FEW, MANY = 60, 500


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    process = Renderer()
    yield process
    process.close()


def assert_clean(seeds: range, renderer: Renderer, folder: Path) -> None:
    write_pictures(folder)
    found = {}
    for seed in seeds:
        path = folder / f"{seed}.usda"
        path.write_text(mutant(seed), encoding="utf-8")
        outcome = renderer.render(path)
        if outcome.kind not in ("rendered", "refused"):
            found[seed] = outcome
    assert not found


def test_a_stage_with_mistakes_is_rendered_or_refused(renderer: Renderer, tmp_path: Path) -> None:
    assert_clean(range(FEW), renderer, tmp_path)


@pytest.mark.slow
def test_many_stages_with_mistakes_are_rendered_or_refused(renderer: Renderer, tmp_path: Path) -> None:
    assert_clean(range(FEW, FEW + MANY), renderer, tmp_path)
