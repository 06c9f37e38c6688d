"""From a config and a scene to the list of samples: pure, printable, the same on every machine.

Seeds. With ``S = numpy.random.SeedSequence(dataset_seed, spawn_key=key)``, a sample's seed is the first 64-bit word of
S at ``key = (index,)``; the value of a random axis is the axis's quantile at the first 53 bits of S at
``key = (index, *ascii codes of the axis's name)``. So a sample depends on the dataset's seed, its index and the
axis's name alone: neither on the order of rendering nor on what other axes there are.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fgf_warp import __version__
from fgf_warp.errors import ConfigError, SceneError
from fgf_warp.scene import Medium, Scene
from fgf_warp.settings import RenderSettings
from generators.config import SweepConfig

MEDIUM_FIELDS = {
    "H": "hurst",
    "g": "asymmetry",
    "S_w": "white_noise_scale",
    "sigma_m": "mean_extinction",
    "L": "outer_scale",
    "kappa": "kappa",
    "albedo": "albedo",
}
"""What each axis's parameter is called in `Medium`."""


@dataclass(frozen=True)
class GridAxis:
    """An axis whose values are laid out as a grid.

    Args:
        name: of the parameter, as in the config.
        values: in order.
    """

    name: str
    values: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Sample:
    """One image of a dataset.

    Args:
        index: position in the dataset, from 0.
        parameters: the swept parameters and their values, in the order of the axes.
        medium: with these parameters.
        seed: of the render, in [0, 2^64).
    """

    index: int
    parameters: Mapping[str, float]
    medium: Medium
    seed: int

    @property
    def name(self) -> str:
        """Stem of the sample's files."""
        return f"{self.index:06d}"


@dataclass(frozen=True, eq=False)
class Plan:
    """All samples of a dataset, checked, before any is rendered.

    Args:
        name: of the dataset.
        seed: of the dataset.
        scene: that the samples share.
        medium_index: of the swept medium in the scene.
        settings: that the samples share, but for the seed.
        png: whether each sample gets a PNG.
        exposure: of the PNGs [stop].
        grid: the axes that are not random, the last varying fastest.
        draws: samples per cell of the grid, varying faster still.
        samples: by index.
        digest: hexadecimal SHA-256 of everything that the files depend on.
    """

    name: str
    seed: int
    scene: Scene
    medium_index: int
    settings: RenderSettings
    png: bool
    exposure: float
    grid: tuple[GridAxis, ...]
    draws: int
    samples: tuple[Sample, ...]
    digest: str

    def media_of(self, sample: Sample) -> tuple[Medium, ...]:
        """The scene's media with the sample's in its place."""
        return self.scene.with_medium(self.medium_index, sample.medium).media


def build_plan(config: SweepConfig, scene: Scene, width: int, height: int, device: str = "cpu") -> Plan:
    """Lists the samples and checks every one.

    Args:
        config: the dataset.
        scene: its base.
        width: of the images [pixel].
        height: of the images [pixel].
        device: to render on. CPU and CUDA round differently, so a dataset is made on one kind.

    Raises:
        ConfigError: for axes that contradict each other, or a sample out of the law's domain, by index and values.
        SceneError: where the scene has no such medium, or no single one.
    """
    # Only the file's name, so that the headers do not depend on the folder that a dataset was made from.
    scene = replace(scene, source=Path(config.scene).name)
    medium_index = scene.medium_index(config.medium)
    base = scene.media[medium_index]
    asked = {"transport": config.transport, "line_variance": config.line_variance}
    others = {name: value for name, value in asked.items() if value is not None}
    _check_axes(config, base)
    settings = config.render_settings(width, height, device)
    grid = tuple(GridAxis(name, axis.grid_values()) for name, axis in config.axes.items() if not axis.is_random)
    samples: list[Sample] = []
    cells = itertools.product(*(axis.values for axis in grid), range(config.draws))
    for index, cell in enumerate(cells):
        on_grid = dict(zip((axis.name for axis in grid), cell, strict=False))
        parameters: dict[str, float] = {
            name: axis.value_at(_quantile(config.seed, index, name)) if axis.is_random else on_grid[name]
            for name, axis in config.axes.items()
        }
        try:
            medium = _with_parameters(base, parameters, **others)
            # Refused where the medium is too large for its law.
            scene.with_medium(medium_index, medium)
        except SceneError as error:
            raise ConfigError(f"sample {index}: {error}") from error
        samples.append(Sample(index, parameters, medium, sample_seed(config.seed, index)))
    plan = Plan(
        name=config.name,
        seed=config.seed,
        scene=scene,
        medium_index=medium_index,
        settings=settings,
        png=config.png,
        exposure=config.exposure,
        grid=grid,
        draws=config.draws,
        samples=tuple(samples),
        digest="",
    )
    return replace(plan, digest=_digest(plan))


def sample_seed(dataset_seed: int, index: int) -> int:
    """Seed of a sample, in [0, 2^64); the module says how."""
    return _word(dataset_seed, index)


def _quantile(dataset_seed: int, index: int, axis: str) -> float:
    """In [0, 1), by the first 53 bits: as many as a double holds."""
    return (_word(dataset_seed, index, *axis.encode("ascii")) >> 11) * 2.0**-53


def _word(dataset_seed: int, *key: int) -> int:
    return int(np.random.SeedSequence(dataset_seed, spawn_key=key).generate_state(1, np.uint64)[0])


def _with_parameters(base: Medium, parameters: Mapping[str, float], **others: Any) -> Medium:
    changes: dict[str, Any] = {MEDIUM_FIELDS[name]: value for name, value in parameters.items()}
    if "albedo" in changes:
        changes["albedo"] = (changes["albedo"],) * 3
    return replace(base, **changes, **others)


def _check_axes(config: SweepConfig, base: Medium) -> None:
    """Refuses a sweep of S_w that another parameter would leave without effect."""
    if "S_w" in config.axes and "kappa" in config.axes:
        raise ConfigError("axes: S_w and kappa both set the strength of the correlation; accepted: one of them")
    if "S_w" in config.axes and base.kappa is not None:
        raise ConfigError(
            f"axes.S_w: {base.name} authors kappa = {base.kappa:g}, which takes the place of S_w; "
            "accepted: an axis kappa, or a stage without it"
        )


def _digest(plan: Plan) -> str:
    """SHA-256 of a canonical form. The scene counts by its content, wherever its layers lie."""
    settings = asdict(plan.settings)
    for execution in ("threads", "memory", "seed", "device"):
        del settings[execution]
    content = {
        "version": __version__,
        "scene": _canonical(plan.scene),
        "medium": plan.medium_index,
        "settings": {**settings, "aovs": sorted(plan.settings.aovs)},
        "device": "cuda" if plan.settings.device.startswith("cuda") else plan.settings.device,
        "name": plan.name,
        "seed": plan.seed,
        "png": plan.png,
        "exposure": plan.exposure,
        "grid": _canonical(plan.grid),
        "draws": plan.draws,
        "samples": [[dict(sample.parameters), sample.seed, _canonical(sample.medium)] for sample in plan.samples],
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _canonical(value: Any) -> Any:
    """A JSON-ready form in which equal content is equal text; arrays by their hash."""
    if isinstance(value, np.ndarray):
        array = np.ascontiguousarray(value)
        return [str(array.dtype), array.shape, hashlib.sha256(array.tobytes()).hexdigest()]
    if is_dataclass(value):
        # Where the scene was read from does not change a pixel.
        named = {
            field.name: _canonical(getattr(value, field.name)) for field in fields(value) if field.name != "source"
        }
        return {"type": type(value).__name__, **named}
    if isinstance(value, tuple | list):
        return [_canonical(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value)
    return value
