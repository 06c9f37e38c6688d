"""Where the samples lie along the axes, and what is random in them: the same on every machine.

The combinations of the axes' values, times the draws, are numbered in order: that is a sample's *position*. Where
constraints leave positions out, the samples that remain are numbered anew: that is a sample's *index*.

Seeds. With ``S = numpy.random.SeedSequence(dataset_seed, spawn_key=key)``, a sample's seed is the first 63 bits of S
at ``key = (index,)``, an integer wherever labels are loaded; the value of a random axis is the axis's quantile at the
first 53 bits of S at ``key = (position, *ascii codes of the axis's name)``. So a sample depends on the dataset's seed,
its number and the axis's name alone: neither on the order of rendering nor on what other axes there are.

Designs. A Latin hypercube and a scrambled Sobol sequence fill the ranges of all drawn axes at once, more evenly than
independent draws. Their points depend on the dataset's seed and on how many drawn axes there are, in which order, and
a Latin hypercube on how many samples as well: each of the n samples is alone in its n-th part of every axis.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from fgf_warp.errors import ConfigError
from generators.dataset.layout import SPLITS
from generators.planning.axes import VALUES_MAX
from generators.planning.config import SplitsConfig
from generators.planning.document import LoadedConfig
from generators.planning.resolve import Axis, Sweep
from generators.planning.seeds import seed_words

Parameters = dict[str, float | str]
"""Values of the axes, in their order, by column."""

Progress = Callable[[str, int, int], None]
"""Is called with what is being done, how much of it is done, and how much there is."""
TOLD_EVERY = 1000
"""Positions, of which a progress is told."""
SAMPLES_MAX = VALUES_MAX
"""As many as names of six digits number."""
DESIGN_KEY = 2**31
"""Before the key of a design's randomness: far above all numbers of samples."""


def sample_seed(dataset_seed: int, index: int) -> int:
    """Seed of a sample, in [0, 2^63); the module says how. The index may be any number, such as another seed."""
    return int(np.random.SeedSequence(dataset_seed, spawn_key=(index,)).generate_state(1, np.uint64)[0]) >> 1


def sample_seeds(dataset_seed: int, indices: Sequence[int]) -> list[int]:
    """Seeds of samples, in their order: those of `sample_seed`, all at once."""
    return (seed_words(dataset_seed, indices) >> np.uint64(1)).tolist()


def position_count(sweep: Sweep, draws: int) -> int:
    """Number of combinations, times the draws."""
    return math.prod(factor[0].config.count for factor in sweep.factors) * draws


def sample_parameters(loaded: LoadedConfig, sweep: Sweep, progress: Progress) -> list[Parameters]:
    """The parameters of every sample, by index.

    Args:
        loaded: the dataset's config.
        sweep: its axes.
        progress: called now and then.

    Returns:
        By the name of the axis, those that follow from an expression among them; each in the unit of its axis.

    Raises:
        ConfigError: for too many samples, a constraint that none meets, or an expression without a value.
    """
    config = loaded.config
    count = position_count(sweep, config.draws)
    if count > SAMPLES_MAX:
        raise ConfigError(f"{loaded.path}: {count} samples; accepted: at most {SAMPLES_MAX}")
    quantiles = _quantiles(loaded, sweep, count).tolist()
    found = []
    for position, on_grid in enumerate(_cells(sweep, config.draws)):
        if position % TOLD_EVERY == 0:
            progress("placing samples", position, count)
        values = dict(on_grid)
        for axis, quantile in zip(sweep.drawn, quantiles[position], strict=True):
            values[axis.name] = axis.config.value_at(quantile)
        for axis in sweep.dependent:
            assert axis.expression is not None
            with _placed(loaded, ("axes", axis.key, "expression"), values):
                values[axis.name] = axis.expression.number(values)
        if _is_kept(loaded, sweep, values):
            found.append({axis.name: values[axis.name] for axis in sweep.axes})
    if not found:
        raise loaded.error(("constraints",), f"none of {count} samples meets them")
    return found


def _is_kept(loaded: LoadedConfig, sweep: Sweep, values: Parameters) -> bool:
    """Whether values meet all constraints."""
    for place, constraint in enumerate(sweep.constraints):
        with _placed(loaded, ("constraints", place), values):
            if not constraint.holds(values):
                return False
    return True


@contextmanager
def _placed(loaded: LoadedConfig, keys: tuple[int | str, ...], values: Parameters) -> Iterator[None]:
    """Says of an expression where it is, and for which values it cannot be evaluated."""
    try:
        yield
    except ConfigError as error:
        raise loaded.error(keys, f"with {described(values)}: {error}") from error


def described(parameters: Parameters) -> str:
    """Values of a sample for a message."""
    return ", ".join(
        f"{name} = {value if isinstance(value, str) else format(value, '.6g')}" for name, value in parameters.items()
    )


def assign_splits(splits: SplitsConfig | None, seed: int, samples: Sequence[Parameters]) -> list[str]:
    """The split of every sample, by index.

    Groups of samples that agree in the axes ``by`` are put in the order of a hash of their values and the seed, and
    that row is cut by the shares.

    Args:
        splits: the shares; None puts all into the first split.
        seed: of the dataset.
        samples: their parameters.

    Returns:
        Names of `SPLITS`, one for each sample.

    Raises:
        ConfigError: where there are too few groups for a split to have one.
    """
    if splits is None:
        return [SPLITS[0]] * len(samples)
    groups = [
        tuple(parameters[name] for name in splits.by) if splits.by else (index,)
        for index, parameters in enumerate(samples)
    ]
    row = sorted(set(groups), key=lambda group: hashlib.sha256(json.dumps([seed, *group]).encode()).digest())
    counts = _apportioned(splits.shares, len(row))
    for split, share in splits.shares.items():
        if share and not counts[split]:
            named = f"groups of equal {', '.join(splits.by)}" if splits.by else "samples"
            raise ConfigError(f"{len(row)} {named} leave {split} without any; accepted: more, or a larger share")
    splits_in_row = itertools.chain.from_iterable(itertools.repeat(split, counts[split]) for split in counts)
    split_of = dict(zip(row, splits_in_row, strict=True))
    return [split_of[group] for group in groups]


def _apportioned(shares: dict[str, float], total: int) -> dict[str, int]:
    """Whole numbers that add up to the total, by largest remainders."""
    counts = {split: math.floor(share * total) for split, share in shares.items()}
    by_remainder = sorted(shares, key=lambda split: counts[split] - shares[split] * total)
    for split in by_remainder[: total - sum(counts.values())]:
        counts[split] += 1
    return counts


def _cells(sweep: Sweep, draws: int) -> Iterator[Parameters]:
    """What the axes on the grid have at each position."""
    steps = [_steps(factor) for factor in sweep.factors]
    for chosen in itertools.product(*steps):
        cell: Parameters = {}
        for step in chosen:
            cell |= step
        yield from itertools.repeat(cell, draws)


def _steps(factor: Sequence[Axis]) -> list[Parameters]:
    """What axes that advance together have at each step."""
    names = [axis.name for axis in factor]
    rows = zip(*(axis.values or () for axis in factor), strict=True)
    return [dict(zip(names, row, strict=True)) for row in rows]


def _quantiles(loaded: LoadedConfig, sweep: Sweep, count: int) -> np.ndarray:
    """(count, drawn axes), each in [0, 1)."""
    seed, design = loaded.config.seed, loaded.config.design
    if design == "random":
        positions = np.arange(count)
        # By the first 53 bits: as many as a double holds.
        columns = [
            (seed_words(seed, positions, axis.name.encode("ascii")) >> np.uint64(11)) * 2.0**-53 for axis in sweep.drawn
        ]
        return np.stack(columns, axis=1) if columns else np.empty((count, 0))
    from scipy.stats import qmc  # noqa: PLC0415 - slow to import

    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(DESIGN_KEY, *design.encode("ascii"))))
    make = qmc.Sobol if design == "sobol" else qmc.LatinHypercube
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # The plan itself warns of counts that are no powers of 2.
        return make(len(sweep.drawn), rng=generator).random(count)
