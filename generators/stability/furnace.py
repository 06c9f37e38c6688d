"""Small renders of a sphere of medium in a uniform environment of radiance 1, over a grid of extremes.

Whatever a medium does, no light is lost: the radiance that arrives, what was absorbed, and the share of paths that were
cut at the bound on their length add up to 1. That is so wherever a path scatters and leaves, and tells nothing about
flights, law and geometry. Those show where a sphere absorbs and does not scatter: what passes through its centre is the
law's transmittance of the diameter.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any

import numpy as np

from fgf_warp.errors import NumericalError, SceneError
from fgf_warp.features import required_features
from fgf_warp.renderer import Model, Variant, advance, batches, begin, develop
from fgf_warp.result import RenderResult
from fgf_warp.scene import Camera, DistantLight, DomeLight, Medium, Scene, Solid
from fgf_warp.settings import Aov, RenderSettings, Sampler
from generators.planning.sampling import sample_seed
from generators.stability.measurement import Axis, Measurement, Value
from generators.stability.parameters import shorten_refusal

SETTINGS = RenderSettings(
    width=16, height=16, spp=8, max_depth=1024, roulette_depth=1024, aovs=frozenset({Aov.COLLISIONS}), memory=0.5
)
"""Without roulette, of which nothing is in balance but the mean."""
NOISY_SPP = 32
"""Samples per pixel where there is noise."""
STANDARD_ERRORS = 3.0
"""That a balance may be off."""
FLOOR = 1e-6
"""Rounding of float32 in radiance and in what was absorbed, over a thousand events, beside the noise."""
LARGEST_DEVIATION, LARGEST_COLOURED_DEVIATION = 1.0, 2.0
"""Of a path from the mean; of a chromatic medium the weight of a path is up to 3. A standard error knows nothing of
events that are rarer than one in all paths: one such event is added to it."""
HELD_BOUND = 2.0**-24
"""Relative rounding of a parameter that is held in float32."""
SMALLEST = float(np.finfo(np.float32).tiny)
SECOND_LOOK = 4
"""A balance beyond its bound is rendered anew with so many times the samples, and that render counts. Of 1000 sound
renders 2.7 are beyond 3 standard errors; twice in a row, one in 100 000."""
DISTANCE, VIEW = 5.0, 0.28
"""Of the camera, in radii, and its aperture over its focal length: every pixel sees the sphere."""
NARROW_VIEW = 1e-4
"""The aperture with which every pixel sees the sphere's centre."""

BALANCE, SHOWN, HELD, EXCESS = (
    "light out of balance",
    "light that passes, off the law's",
    "parameters changed on the device",
    "radiance outside [0, 1]",
)
COLLISIONS, CUT, SECONDS = "scattering events per path", "share of paths cut", "seconds per render"
RESCALED, CHANGED = "difference to scale 1", "share of pixels that differ from scale 1"
"""The quantities."""

Index = tuple[int, ...]
"""A place in a grid."""
Progress = Callable[[int, int], None]
"""Called with the renders done so far, and in all."""


@dataclass(frozen=True)
class Experiment:
    """Renders over a grid.

    Args:
        name: short, for labels.
        question: what it is to show, in a sentence.
        axes: of the grid.
        planes: pairs of axes, rows and columns of the maps that are drawn.
        middle: values of axes at which maps show what has no bound; they are on every such axis.
        media: the arguments of `build_medium` that are the same everywhere; an axis may be any of them, or ``scale``,
            the sphere's radius.
        is_connected: whether the environment is two hemispheres that paths connect to, instead of what they escape to.
        has_roulette: whether Russian roulette plays, from the first event on.
        shows_law: whether the camera sees the sphere's centre alone, of a medium that must not scatter (albedo 0), so
            that what passes is the law's transmittance of the diameter.
        keeps_depth: whether extinction, S_w and L are rescaled with the sphere by their units, and the seeds are those
            of scale 1, so that the image must be that of scale 1.
    """

    name: str
    question: str
    axes: tuple[Axis, ...]
    planes: tuple[tuple[str, str], ...]
    media: dict[str, Any]
    middle: dict[str, Value] = field(default_factory=dict)
    is_connected: bool = False
    has_roulette: bool = False
    shows_law: bool = False
    keeps_depth: bool = False

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the grid."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def is_noisy(self) -> bool:
        """True where light that arrives, is absorbed and is cut adds up to 1 in the mean only, not for each path."""
        return self.is_connected or self.has_roulette or self.is_chromatic

    @property
    def is_chromatic(self) -> bool:
        """True where the extinction has a colour, and paths of each channel a weight in the others."""
        return "color" in self.media

    def settings(self, device: str) -> RenderSettings:
        """Of its renders."""
        settings = replace(SETTINGS, device=device)
        if self.has_roulette:
            settings = replace(settings, roulette_depth=0)
        if self.shows_law:
            settings = replace(settings, sampler=Sampler.INDEPENDENT)
        return replace(settings, spp=NOISY_SPP) if self.is_noisy or self.shows_law else settings


@dataclass(frozen=True, eq=False)
class Cell:
    """One render of an experiment.

    Args:
        index: its place in the grid.
        scene: what is rendered.
        radius: of the sphere.
        seed: equal ones give equal images.
    """

    index: Index
    scene: Scene
    radius: float
    seed: int


@dataclass(frozen=True)
class Deviation:
    """How far a mean is from what it must be.

    Args:
        off: by how much, >= 0.
        bound: of that.
        is_noisy: whether chance alone may make it exceed its bound.
    """

    off: float
    bound: float
    is_noisy: bool

    @property
    def is_beyond(self) -> bool:
        """True where the bound is not kept."""
        return self.off > self.bound


@dataclass(frozen=True, eq=False)
class Reading:
    """What is kept of one render.

    Args:
        balance: what radiance, absorption and the share of cut paths lack of 1, or exceed it by, in the worst channel.
        shown: of the radiance from the law's transmittance; None where it is not to show that.
        radiance: (pixels, 3) float64.
        collisions: mean number of scattering events of a path.
        truncated: share of paths cut at the bound on their length.
        seconds: of the render.
        held: largest relative difference of the parameters on the device to those of the medium.
    """

    balance: Deviation
    shown: Deviation | None
    radiance: np.ndarray
    collisions: float
    truncated: float
    seconds: float
    held: float

    @property
    def deserves_second_look(self) -> bool:
        """True where it is beyond a bound, and no other than chance may exceed."""
        beyond = [one for one in (self.balance, self.shown) if one is not None and one.is_beyond]
        return len(beyond) > 0 and all(one.is_noisy for one in beyond)


@dataclass(frozen=True, eq=False)
class Rendered:
    """What an experiment gives.

    Args:
        experiment: what was rendered.
        measurements: by quantity.
        failures: messages of renders with samples that were not finite.
        looked_again: renders beyond a noisy bound at first sight.
    """

    experiment: Experiment
    measurements: dict[str, Measurement]
    failures: tuple[str, ...]
    looked_again: int


def build_medium(
    *,
    transport: str,
    H: float,
    S_w: float = 1.0,
    sigma_m: float = 1.0,
    L: float | None = 10.0,
    kappa: float | None = None,
    g: float = 0.0,
    albedo: float = 1.0,
    line_variance: str = "asymptotic",
    color: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> Medium:
    """A medium of these parameters, by their short names.

    Args:
        transport: ``reciprocal``, ``renewal`` or ``mixed``.
        H: Hurst exponent.
        S_w: white-noise scale [length^(-2-2H)].
        sigma_m: mean extinction [1/length], of each channel times `color`.
        L: outer scale [length], where H > 0.
        kappa: in place of the value that follows from S_w.
        g: asymmetry in (-1, 1).
        albedo: in [0, 1], of every channel.
        line_variance: ``asymptotic`` or ``exact``.
        color: >= 0, by channel.

    Raises:
        SceneError: where they are not accepted.
    """
    return Medium(
        "/medium",
        mean_extinction=sigma_m,
        extinction_color=color,
        albedo=(albedo,) * 3,
        asymmetry=g,
        hurst=H,
        white_noise_scale=S_w,
        outer_scale=L,
        kappa=kappa,
        transport=transport,  # type: ignore[arg-type]
        line_variance=line_variance,  # type: ignore[arg-type]
    )


def build_furnace(medium: Medium, radius: float, *, is_connected: bool, view: float) -> Scene:
    """A sphere of medium that fills the view, in an environment of radiance 1 that is met or connected to.

    Args:
        medium: in the sphere.
        radius: of it.
        is_connected: whether paths connect to the environment.
        view: the camera's aperture over its focal length.

    Raises:
        SceneError: where the sphere is too large for the medium's law.
    """
    camera_to_world, sphere_to_world = np.eye(4), np.diag([radius, radius, radius, 1.0])
    camera_to_world[2, 3] = DISTANCE * radius
    dome = (DomeLight("/sky", (1.0, 1.0, 1.0)),)
    halves = tuple(DistantLight(f"/sky{z:+g}", (0.0, 0.0, z), math.pi / 2, (1.0, 1.0, 1.0)) for z in (-1.0, 1.0))
    return Scene(
        Camera("/camera", camera_to_world, 1.0, view, view),
        shapes=(Solid("/sphere", "sphere", sphere_to_world, medium=0),),
        media=(medium,),
        lights=halves if is_connected else dome,
    )


def run_experiment(experiment: Experiment, device: str, progress: Progress | None = None) -> Rendered:
    """Renders the grid and measures it.

    Args:
        experiment: what to render.
        device: a Warp device.
        progress: called after each render.
    """
    settings = experiment.settings(device)
    refusals = np.full(experiment.shape, "", dtype=object)
    cells = list(_cells(experiment, refusals))
    found: dict[Index, Reading | NumericalError] = {}
    for cell, reading in _read(experiment, cells, settings):
        found[cell.index] = reading
        if progress is not None:
            progress(len(found), len(cells))
    again = [cell for cell in cells if _deserves_second_look(found[cell.index])]
    others = [replace(cell, seed=sample_seed(1, cell.seed)) for cell in again]
    for cell, reading in _read(experiment, others, replace(settings, spp=SECOND_LOOK * settings.spp)):
        found[cell.index] = reading
    failures = tuple(str(reading) for reading in found.values() if isinstance(reading, NumericalError))
    return Rendered(experiment, _measure(experiment, found, refusals), failures, len(again))


def _deserves_second_look(reading: Reading | NumericalError) -> bool:
    return isinstance(reading, Reading) and reading.deserves_second_look


def _cells(experiment: Experiment, refusals: np.ndarray) -> Iterator[Cell]:
    """The cells whose parameters are accepted; notes the reasons of those that are not."""
    names = [axis.name for axis in experiment.axes]
    seeds = np.arange(math.prod(experiment.shape)).reshape(experiment.shape)
    if experiment.keeps_depth:
        seeds = np.broadcast_to(seeds.take([0], axis=names.index("scale")), experiment.shape)
    for index, values in zip(
        np.ndindex(experiment.shape), itertools.product(*(axis.values for axis in experiment.axes)), strict=True
    ):
        parameters = experiment.media | dict(zip(names, values, strict=True))
        radius = parameters.pop("scale", 1.0)
        if experiment.keeps_depth:
            parameters["sigma_m"] /= radius
            parameters["S_w"] *= radius ** (-2 - 2 * parameters["H"])
            parameters["L"] *= radius
        try:
            scene = build_furnace(
                build_medium(**parameters),
                radius,
                is_connected=experiment.is_connected,
                view=NARROW_VIEW if experiment.shows_law else VIEW,
            )
        except SceneError as error:
            refusals[index] = shorten_refusal(str(error))
            continue
        yield Cell(index, scene, radius, int(seeds[index]))


def _read(
    experiment: Experiment, cells: Sequence[Cell], settings: RenderSettings
) -> Iterator[tuple[Cell, Reading | NumericalError]]:
    """Renders the cells in batches of one kernel and one size of sphere."""

    def batch(cell: Cell) -> tuple[float, str]:
        return cell.radius, repr(required_features(cell.scene, settings))

    for _, group in itertools.groupby(sorted(cells, key=batch), key=lambda cell: cell.radius):
        alike = list(group)
        variants = [Variant(cell.scene.media, sample_seed(0, cell.seed)) for cell in alike]
        rest = iter(alike)
        for model in batches(alike[0].scene, variants, settings):
            yield from _read_batch(experiment, model, rest)


def _read_batch(
    experiment: Experiment, model: Model, cells: Iterator[Cell]
) -> Iterator[tuple[Cell, Reading | NumericalError]]:
    held = _held_errors(model)
    state = begin(model)
    for image, cell in zip(advance(model, state, model.settings.spp), cells, strict=False):
        try:
            result = develop(model, state, image)
        except NumericalError as error:
            yield cell, error
        else:
            yield cell, _reading(experiment, cell, result, held[image])


def _reading(experiment: Experiment, cell: Cell, result: RenderResult, held: float) -> Reading:
    radiance, collisions = (
        plane.astype(np.float64).reshape(-1, 3) for plane in (result.radiance, result.aovs[Aov.COLLISIONS])
    )
    truncated = result.truncated_count / result.path_count
    return Reading(
        balance=_balance(experiment, cell, result, radiance, collisions),
        shown=_shown(cell, result, radiance) if experiment.shows_law else None,
        radiance=radiance,
        collisions=float(collisions.mean()),
        truncated=truncated,
        seconds=result.seconds,
        held=held,
    )


def _balance(
    experiment: Experiment, cell: Cell, result: RenderResult, radiance: np.ndarray, collisions: np.ndarray
) -> Deviation:
    albedo = np.array(cell.scene.media[0].albedo, dtype=np.float32).astype(np.float64)
    truncated = result.truncated_count / result.path_count
    total = radiance + (1 - albedo) * collisions
    # At the event where it is cut, a path still absorbs; what is left of it is lost.
    lost = truncated * (1.0 if experiment.has_roulette else albedo ** (result.settings.max_depth + 1))
    off, noise = np.abs(total.mean(axis=0) + lost - 1), np.zeros(3)
    if experiment.is_noisy:
        cut = math.sqrt(truncated * (1 - truncated) / result.path_count)
        rare = LARGEST_COLOURED_DEVIATION if experiment.is_chromatic else LARGEST_DEVIATION
        noise = np.hypot(total.std(axis=0, ddof=1) / math.sqrt(len(total)) + cut, rare / result.path_count)
    bound = FLOOR + STANDARD_ERRORS * noise
    worst = int(np.argmax(off / bound))
    return Deviation(float(off[worst]), float(bound[worst]), experiment.is_noisy)


def _shown(cell: Cell, result: RenderResult, radiance: np.ndarray) -> Deviation:
    """Of what passes from the law's transmittance; each path passes or does not, so the noise is known beforehand."""
    law = cell.scene.media[0].line_law
    passed = float(law.eval_kernels(law.mean_extinction * 2 * cell.radius).transmittance_ss)
    noise = math.hypot(math.sqrt(passed * (1 - passed) / result.path_count), LARGEST_DEVIATION / result.path_count)
    return Deviation(abs(float(radiance.mean()) - passed), FLOOR + STANDARD_ERRORS * noise, is_noisy=True)


def _held_errors(model: Model) -> np.ndarray:
    """(images,): how far the parameters that the device holds are from those of the media, relative to them."""
    held = model.uploaded.data.media.numpy()
    media = [variant.media[0] for variant in model.variants]
    pairs = [
        (held["phase"]["asymmetry"], [medium.asymmetry for medium in media]),
    ]
    for channel, law in enumerate(("law", "law_green", "law_blue")):
        lines = [medium.channel_laws[channel] for medium in media]
        pairs += [
            (held["extinction"][:, channel], [line.mean_extinction for line in lines]),
            (held["albedo"][:, channel], [medium.albedo[channel] for medium in media]),
            (held[law]["b"], [line.b for line in lines]),
            (held[law]["kappa"], [line.kappa for line in lines]),
        ]
    errors = [np.abs(found - value) / np.maximum(np.abs(value), SMALLEST) for found, value in pairs]
    return np.max(errors, axis=0)


def _measure(
    experiment: Experiment, found: dict[Index, Reading | NumericalError], refusals: np.ndarray
) -> dict[str, Measurement]:
    readings = {index: reading for index, reading in found.items() if isinstance(reading, Reading)}

    def over(value: Callable[[Reading], float], failed: float = np.nan) -> np.ndarray:
        grid = np.full(experiment.shape, np.nan)
        for index in found:
            grid[index] = value(readings[index]) if index in readings else failed
        return grid

    def measured(quantity: str, values: np.ndarray, bound: np.ndarray | float | None = None) -> Measurement:
        return Measurement(quantity, experiment.axes, values, bound, refusals)

    def deviation(quantity: str, of: Callable[[Reading], Deviation]) -> Measurement:
        return measured(
            quantity, over(lambda reading: of(reading).off, np.inf), over(lambda reading: of(reading).bound)
        )

    quantities = {
        BALANCE: deviation(BALANCE, attrgetter("balance")),
        HELD: measured(HELD, over(lambda reading: reading.held), HELD_BOUND),
        COLLISIONS: measured(COLLISIONS, over(lambda reading: reading.collisions)),
        CUT: measured(CUT, over(lambda reading: reading.truncated)),
        SECONDS: measured(SECONDS, over(lambda reading: reading.seconds)),
    }
    if not experiment.is_noisy:
        quantities[EXCESS] = measured(EXCESS, over(lambda r: max(r.radiance.max() - 1, -r.radiance.min(), 0.0)), FLOOR)
    if experiment.shows_law:
        quantities[SHOWN] = deviation(SHOWN, attrgetter("shown"))
    if experiment.keeps_depth:
        quantities |= _compare_scales(experiment, readings, measured)
    return quantities


def _compare_scales(
    experiment: Experiment,
    readings: dict[Index, Reading],
    measured: Callable[..., Measurement],
) -> dict[str, Measurement]:
    """Each image beside that of scale 1, which has the same seed."""
    off, bound, changed = (np.full(experiment.shape, np.nan) for _ in range(3))
    scales = next(axis for axis in experiment.axes if axis.name == "scale")
    place = experiment.axes.index(scales)
    for index, reading in readings.items():
        original = readings.get((*index[:place], scales.values.index(1.0), *index[place + 1 :]))
        if original is None:
            continue
        a, b = reading.radiance, original.radiance
        off[index] = abs(a.mean() - b.mean())
        bound[index] = STANDARD_ERRORS * math.sqrt((a.var(ddof=1) + b.var(ddof=1)) / len(a)) + FLOOR
        changed[index] = (np.abs(a - b) > FLOOR).mean()
    return {RESCALED: measured(RESCALED, off, bound), CHANGED: measured(CHANGED, changed)}
