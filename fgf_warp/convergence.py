"""Renders until an image is good enough: to a relative error, in a time, or with so many samples, put where they help.

An image is rendered as two halves, with random numbers of their own, and is their mean. Half their difference is as
large as the image's error, whatever the sampler. After a pilot, in which all pixels get equally many samples, each
cell of pixels of one half gets as many as the *other* half says that help most there: for the root mean square of the
relative errors in proportion to the error over the root of what a sample costs (Neyman's allocation). No pixel's
samples decide how many it gets, so the image is unbiased; only the number in all follows from the whole image.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from fgf_warp.errors import ConfigError, NumericalError
from fgf_warp.renderer import Model, Progress, State, Variant, advance, batches, begin, develop
from fgf_warp.result import (
    BLOCK,
    OVER,
    RenderResult,
    block_brightness,
    block_errors,
    block_means,
    block_sizes,
    block_sums,
    error_over,
)
from fgf_warp.scene import Scene
from fgf_warp.settings import Aov, RenderSettings

MAX_SPP = 2**20
"""That no goal exceeds unless it says so."""
FIRST_SPP = 4
"""Samples per pixel of the first round, so few that the error even of a large image is soon known."""
PILOT_SPP = 32
"""After which it is known where more are needed."""
GROWTH = 4
"""Of the samples from round to round, at most: the first ones know little of what is needed."""
TRUSTED_PATHS = 2**14
"""So many in all tell an error, even before the pilot's end; few may all miss what is rare, and agree."""
CELL = 4
"""Side of the cells of pixels that get equally many samples, which divides `BLOCK` [pixel]."""
EVEN_SHARE = 0.1
"""Of the samples, that all cells get alike: the pilot may have missed what is rare."""
UNSEEN_COST = 0.2
"""Of a camera path that meets nothing, against one that does: of 5 scattering events it is 0.2, of 10 it is 0.1."""
NORM = 2
"""The p-norm of relative errors that samples make least. For the mean, 1 would be right, and gains nothing over 2."""
PERCENTILE_NORM = 10
"""That for percentiles, in which large errors count more: the 95th takes 0.9 times as long as with 2."""
LEAST_GROWTH = 1.05
"""Of a further round, so that none is spent on next to nothing."""
UNUSED_TIME = 0.02
"""Share of a time that is not worth a further round."""
CAREFUL_SHARE = 0.75
"""Of the samples that the rest of a time is thought to allow, that are rendered before it is looked at again."""
ID_AOVS = frozenset({Aov.PRIM_ID, Aov.INSTANCE_ID})
"""Planes of numbers that no mean can be taken of."""
SECOND_HALF = 0x9E3779B97F4A7C15
"""The bits of the seed that tell the second half from the first."""


@dataclass(frozen=True)
class Goal:
    """When an image is good enough: whichever bound is met first.

    Args:
        error: relative standard error, in (0, 1), see `RenderResult.relative_error`.
        over: which blocks of pixels must have it: ``mean`` or ``rms`` over all, or a percentile, such as ``p95``; what
            the samples are given for, also where no error is asked for.
        time: wall time [s], > 0, but for building the kernel; the first round is rendered in any case.
        max_spp: samples per pixel on average, in [4, 2^31).

    Raises:
        ConfigError: naming the bound, its value and the accepted range.
    """

    error: float | None = None
    over: str = "mean"
    time: float | None = None
    max_spp: int = MAX_SPP

    def __post_init__(self) -> None:
        if self.error is not None and not (_is_number(self.error) and 0 < self.error < 1):
            raise ConfigError(f"error = {self.error!r}; accepted: a relative error in (0, 1), such as 0.01")
        if self.time is not None and not (_is_number(self.time) and 0 < self.time < math.inf):
            raise ConfigError(f"time = {self.time!r}; accepted: seconds > 0")
        if not re.fullmatch(OVER, str(self.over)):
            raise ConfigError(f"over = {self.over!r}; accepted: mean, rms, or a percentile from p1 to p99")
        if not isinstance(self.max_spp, int) or not FIRST_SPP <= self.max_spp < 2**31:
            raise ConfigError(f"max_spp = {self.max_spp!r}; accepted: an integer in [{FIRST_SPP}, 2^31)")

    def is_met_by(self, result: RenderResult) -> bool:
        """Whether an image has the error that is asked for."""
        return self.error is not None and result.relative_error(self.over) <= self.error


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def render_until(scene: Scene, settings: RenderSettings, goal: Goal, progress: Progress | None = None) -> RenderResult:
    """Renders a scene until it is good enough.

    Args:
        scene: what to render.
        settings: how; the goal takes the place of their samples per pixel.
        goal: when to stop.
        progress: called with the camera paths done, and expected in all, which changes.

    Raises:
        ConfigError: for a device that is not there, or an image that needs more memory than `settings.memory`.
        UnsupportedFeatureError: for a scene that this version cannot render.
        NumericalError: where a sample was not finite.
    """
    ((_, result),) = render_batch_until(scene, [Variant(scene.media, settings.seed)], settings, goal, progress)
    if isinstance(result, NumericalError):
        raise result
    return result


def render_batch_until(
    scene: Scene,
    variants: Sequence[Variant],
    settings: RenderSettings,
    goal: Goal,
    progress: Progress | None = None,
) -> Iterator[tuple[int, RenderResult | NumericalError]]:
    """Renders many images of one scene, each until it is good enough.

    Args:
        scene: whose media the variants replace.
        variants: one for each image. Those with laws of one kind should follow each other.
        settings: that the images share, but for the seed.
        goal: of each image. To a time they are rendered one after the other.
        progress: called with the camera paths of one batch that are done, and expected in all, which changes.

    Yields:
        The index of an image and the image, or why there is none, as soon as it is good enough.

    Raises:
        ConfigError: where the memory does not hold a single image, or for a device that is not there.
        UnsupportedFeatureError: for a scene that this version cannot render.
    """
    first = 0
    for model in halved_batches(scene, variants, settings):
        # In a function, so that the films of a batch are gone before the next are made.
        for image, result in converge(model, goal, progress):
            yield first + image, result
        first += len(model.variants) // 2


def halved_batches(scene: Scene, variants: Sequence[Variant], settings: RenderSettings) -> Iterator[Model]:
    """Models of the halves of successive images, for `converge`; raises as `render_batch_until` does.

    Args:
        scene: whose media the variants replace.
        variants: one for each image, of which a model has two.
        settings: that the images share, but for the seed.
    """
    halves = [half for variant in variants for half in (variant, replace(variant, seed=variant.seed ^ SECOND_HALF))]
    return batches(scene, halves, settings, together=2)


def merge_halves(first: RenderResult, second: RenderResult, spp: int, over: str) -> RenderResult:
    """The image of two halves that share no random number.

    Args:
        first: one.
        second: the other.
        spp: samples per pixel of both, on average.
        over: what they are given for, see `Goal`.

    Returns:
        Their mean; its variance is that of the samples, scaled so that the mean square of the relative error is that
        of half the difference of the halves.
    """
    radiance = (first.radiance + second.radiance) / 2
    variance = (first.variance + second.variance) / 4
    # A difference is a single draw of the error, so of squares, whose mean is that of the variance however few there
    # are, and with as much trust in the samples as one block of differences deserves: an image may have one pixel.
    found, pixels = block_errors(radiance, ((first.radiance - second.radiance) / 2) ** 2)
    told, _ = block_errors(radiance, variance)
    found_square, told_square = np.sum(pixels * found**2), np.sum(pixels * told**2)
    trust = pixels.sum() / (pixels.sum() + BLOCK**2)
    scale = 1.0 + trust * (found_square / told_square - 1.0) if told_square > 0 else 1.0
    parameters = first.provenance["settings"] | {"spp": spp, "error_over": over}
    return replace(
        first,
        radiance=radiance,
        alpha=(first.alpha + second.alpha) / 2,
        variance=variance * np.float32(scale),
        aovs={aov: _merge_planes(aov, first.aovs, second.aovs) for aov in first.aovs},
        samples=spp,
        path_count=first.path_count + second.path_count,
        truncated_count=first.truncated_count + second.truncated_count,
        seconds=first.seconds + second.seconds,
        provenance=first.provenance | {"settings": parameters},
    )


def _merge_planes(aov: Aov, ours: dict[Aov, np.ndarray], theirs: dict[Aov, np.ndarray]) -> np.ndarray:
    first, second = ours[aov], theirs[aov]
    if aov is Aov.DEPTH:
        return np.minimum(first, second)
    if aov is Aov.SAMPLES:
        return first + second
    if aov in ID_AOVS:
        # Both of one prim: an instance's number is nothing without its prim's.
        met_nothing = ours[Aov.PRIM_ID] == 0 if Aov.PRIM_ID in ours else first < 0
        return np.where(met_nothing, second, first)
    return (first + second) / 2


def converge(
    model: Model, goal: Goal, progress: Progress | None = None
) -> Iterator[tuple[int, RenderResult | NumericalError]]:
    """Renders the images of one of the `halved_batches` until each is good enough.

    Args:
        model: of the halves.
        goal: of each image.
        progress: called with the camera paths done, and expected in all, which changes.

    Yields:
        As `render_batch_until`.
    """
    state = begin(model)
    images = [_Image(model, number, goal) for number in range(len(model.variants) // 2)]
    pixels = model.settings.width * model.settings.height

    def show(before: int, done: int, _: int) -> None:
        if progress:
            expected = pixels * sum(image.expected_spp for image in images)
            progress(min(before + done, expected), expected)

    for group in [[image] for image in images] if goal.time is not None else [images]:
        yield from _converge(model, state, group, show)


def _converge(
    model: Model, state: State, images: list[_Image], show: Callable[[int, int, int], None]
) -> Iterator[tuple[int, RenderResult | NumericalError]]:
    """Renders in rounds; an image that is good enough takes no part in the next one."""
    began = time.perf_counter()
    while images:
        halves = [half for image in images for half in image.halves]
        added = np.concatenate([image.counts() for image in images]) - state.samples[halves]
        before = int(state.samples.sum(dtype=np.int64))
        for _ in advance(model, state, added, partial(show, before), halves):
            pass
        unfinished = []
        for image in images:
            try:
                result = image.develop(model, state)
            except NumericalError as error:
                yield image.number, error
                continue
            if image.goes_on(result, time.perf_counter() - began):
                unfinished.append(image)
            else:
                yield image.number, result
        images = unfinished


class _Image:
    """An image on the way to its goal.

    Args:
        model: whose image it is.
        number: of the image.
        goal: to reach.
    """

    def __init__(self, model: Model, number: int, goal: Goal) -> None:
        self.number, self.halves = number, (2 * number, 2 * number + 1)
        self.spp = self.expected_spp = FIRST_SPP
        self._before = (0, 0.0)
        self._goal, self._shape = goal, (model.settings.height, model.settings.width)
        self._trusted_spp = min(2 * math.ceil(TRUSTED_PATHS / math.prod(self._shape) / 2), PILOT_SPP)
        self._sizes = block_sizes(self._shape, CELL)
        self._densities = np.ones((2, *self._sizes.shape))

    def counts(self) -> np.ndarray:
        """(2, height, width) samples of the halves, together `spp` on average."""
        per_pixel = self._cell_counts(self.spp).repeat(CELL, axis=1).repeat(CELL, axis=2)
        return per_pixel[:, : self._shape[0], : self._shape[1]].astype(np.int32)

    def _cell_counts(self, spp: int) -> np.ndarray:
        """(2, rows, columns) samples per pixel, which never fall where `spp` grows."""
        least = min(spp, PILOT_SPP) / 2
        return np.rint([_fill(densities, self._sizes, spp / 2, least) for densities in self._densities])

    def develop(self, model: Model, state: State) -> RenderResult:
        """What is there so far.

        Raises:
            NumericalError: where a sample was not finite, naming its pixel.
        """
        first, second = (develop(model, state, half) for half in self.halves)
        result = merge_halves(first, second, self.spp, self._goal.over)
        self._errors, self._pixels = block_errors(result.radiance, result.variance)
        # Of a single sample.
        self._spreads = np.stack([block_means(half.variance, CELL) for half in (first, second)])
        self._spreads *= self._cell_counts(self.spp)
        if self.spp == PILOT_SPP:
            # Each by what the other one needs.
            norm = NORM if self._goal.over in ("mean", "rms") else PERCENTILE_NORM
            self._densities = np.stack([_density(second, norm), _density(first, norm)])
        return result

    def goes_on(self, result: RenderResult, seconds: float) -> bool:
        """Whether another round is worth it, after so many; `spp` says to how many samples."""
        limit = self._goal.max_spp
        if self._goal.time is not None:
            limit = min(limit, self._affordable_spp(self._goal.time, seconds))
            if limit < (1 + UNUSED_TIME) * self.spp:
                limit = self.spp
        limit -= limit % 2  # As many for one half as for the other.
        self.expected_spp = min(limit, max(self._needed_spp(), self._trusted_spp))
        if limit == self.spp or (self.spp >= self._trusted_spp and self._goal.is_met_by(result)):
            self.expected_spp = self.spp
            return False
        most = PILOT_SPP if self.spp < PILOT_SPP else GROWTH * self.spp
        if self._goal.time is not None and limit < most:
            most = 2 * math.ceil((self.spp + CAREFUL_SHARE * (limit - self.spp)) / 2)
        self.spp = min(self.expected_spp, most)
        return True

    def _affordable_spp(self, end: float, seconds: float) -> int:
        """That end at this time, if each sample takes as long as in the last round: adaptive ones take longer."""
        spp_before, seconds_before = self._before
        pace = (seconds - seconds_before) / (self.spp - spp_before)
        self._before = (self.spp, seconds)
        return self.spp + int((end - seconds) / pace)

    def _needed_spp(self) -> int:
        """The least, an even number, that the error is expected to need."""
        if self._goal.error is None:
            return self._goal.max_spp
        tried = LEAST_GROWTH * self.spp
        while tried < self._goal.max_spp and (found := self._expected_error(tried)) > self._goal.error:
            # The error falls as the root of the number, or faster where all are put where they help.
            tried *= max(found / self._goal.error, LEAST_GROWTH)
        return 2 * math.ceil(min(tried, self._goal.max_spp) / 2)

    def _expected_error(self, spp: float) -> float:
        now, then = self._block_variances(self.spp), self._block_variances(round(spp))
        falls = np.sqrt(np.divide(then, now, out=np.zeros_like(now), where=now > 0))
        return error_over(self._goal.over, self._errors * falls, self._pixels)

    def _block_variances(self, spp: int) -> np.ndarray:
        """(rows, columns) of blocks, up to a factor, with so many samples."""
        return block_sums((self._spreads / self._cell_counts(spp)).sum(axis=0) * self._sizes, BLOCK // CELL)


def _fill(densities: np.ndarray, sizes: np.ndarray, mean: float, least: float) -> np.ndarray:
    """Values in proportion to densities, but where that would be less than `least`, with a given mean over pixels."""
    if mean == least:
        return np.full_like(densities, mean)
    short, level = np.zeros_like(densities, dtype=bool), mean
    # What some cells get beyond their share the others lack, so that more of them may fall short.
    while (found := level * densities < least).sum() > short.sum():
        short = found
        level = (mean * sizes.sum() - least * sizes[short].sum()) / (densities * sizes)[~short].sum()
    return np.maximum(level * densities, least)


def _density(half: RenderResult, norm: int) -> np.ndarray:
    """(rows, columns) samples of the cells that help a half most, over their mean."""
    variances = block_means(half.variance, CELL) / _in_cells(block_brightness(half.radiance), half) ** 2
    # Half of a cell's own and half of all around it, for the pilot tells each with much noise, or missed what is rare.
    variances = (variances + _mean_around(variances)) / 2
    costs = _in_cells(UNSEEN_COST + (1 - UNSEEN_COST) * block_means(half.alpha), half)
    # Makes the sum of e^p least for a given sum of n c, where a relative error e falls as 1 / sqrt(n).
    needed = (variances ** (norm / 2) / costs) ** (2 / (norm + 2))
    mean = float(np.average(needed, weights=block_sizes(half.alpha.shape, CELL)))
    return EVEN_SHARE + (1 - EVEN_SHARE) * (needed / mean if mean > 0 else np.ones_like(needed))


def _in_cells(blocks: np.ndarray, half: RenderResult) -> np.ndarray:
    """Values of blocks, of their cells."""
    rows, columns = (-(-size // CELL) for size in half.alpha.shape)
    return blocks.repeat(BLOCK // CELL, axis=0).repeat(BLOCK // CELL, axis=1)[:rows, :columns]


def _mean_around(values: np.ndarray) -> np.ndarray:
    """Of each value and its eight neighbours; those beyond an edge are as those at it."""
    return sliding_window_view(np.pad(values, 1, mode="edge"), (3, 3)).mean(axis=(2, 3))
