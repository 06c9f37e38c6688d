"""Whether the samples of a plan, and those that failed, lie where the axes say."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.stats import ks_2samp

from generators.checking.findings import Finding, Kind
from generators.dataset import layout
from generators.dataset.plan_table import SEED, AxisMeta
from generators.dataset.reader import Dataset

FAILED_LEAST = 5
"""Fewer failures say nothing of where they lie."""
LEVEL = 1e-3
"""Of the test of all axes together, so that a warning is rarely chance."""


def check_spread(dataset: Dataset, failed: Sequence[int]) -> list[Finding]:
    """Compares seeds and values of the axes with what the plan says of them, and failures with the other samples.

    Args:
        dataset: whose plan it is.
        failed: indices of the samples that could not be rendered. Where they crowd at one end of an axis, what is left
            is not spread as planned (Kolmogorov and Smirnov's test).

    Returns:
        Wrong seeds and values by sample, and axes at one end of which failures crowd.
    """
    return [*_wrong_seeds(dataset), *_wrong_values(dataset), *_crowded(dataset, failed)]


def _wrong_seeds(dataset: Dataset) -> Iterator[Finding]:
    seeds = dataset.plan[SEED]
    if (twice := len(seeds) - len(seeds.unique())) > 0:
        yield Finding(Kind.DAMAGED, layout.PLAN, f"{twice} seeds that are not the only ones of their kind", "none")


def _wrong_values(dataset: Dataset) -> Iterator[Finding]:
    for axis in dataset.meta.axes:
        if axis.values is not None and (strange := set(dataset.plan[axis.name].to_pylist()) - set(axis.values)):
            listed = ", ".join(str(value) for value in axis.values)
            yield Finding(Kind.DAMAGED, layout.PLAN, f"{axis.name} = {next(iter(strange))}", f"one of {listed}")


def _crowded(dataset: Dataset, failed: Sequence[int]) -> Iterator[Finding]:
    axes = [axis for axis in dataset.meta.axes if not axis.category]
    if len(failed) < FAILED_LEAST:
        return
    for axis in axes:
        values = np.array([math.nan if v is None else v for v in dataset.plan[axis.name].to_pylist()], float)
        bad, rest = values[list(failed)], np.delete(values, list(failed))
        bad, rest = bad[~np.isnan(bad)], rest[~np.isnan(rest)]
        if bad.size and rest.size and ks_2samp(bad, rest).pvalue < LEVEL / len(axes):
            yield _crowd(axis, bad, rest)


def _crowd(axis: AxisMeta, bad: np.ndarray, rest: np.ndarray) -> Finding:
    found = f"{bad.size} failed samples that crowd in {axis.name}, around {np.median(bad):.4g}"
    return Finding(Kind.INCOMPLETE, layout.FAILURES, found, f"as the others, around {np.median(rest):.4g}")
