"""The labels of a dataset as columns of a table: their order, types, units and meaning."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import pyarrow as pa

from generators.dataset.plan_table import INDEX, SEED, SPLIT
from generators.dataset.reader import Dataset
from generators.dataset.record import Record
from generators.publishing.statistics import STATISTICS
from generators.publishing.targets import TARGETS

STATUS, EXR, PNG = "status", "exr", "png"
COMPLETE, FAILED, MISSING = "complete", "failed", "missing"

PLANNED: dict[str, tuple[str, str]] = {
    INDEX: ("number of the sample, from 0", ""),
    SPLIT: ("train, validation or test", ""),
    SEED: ("seed of the render; the sample follows from it and its parameters", ""),
    "H": ("Hurst exponent of the field; -0.5 is white noise", ""),
    "g": ("mean cosine of scattering: < 0 back, > 0 onwards", ""),
    "S_w": (
        "white-noise scale, the strength of the fluctuations; null where kappa is given in its place",
        "unit^(-2-2H)",
    ),
    "sigma_m": ("mean extinction", "1/unit"),
    "albedo": ("share of light that a collision scatters", ""),
    "albedo_r": ("share of red light that a collision scatters", ""),
    "albedo_g": ("share of green light that a collision scatters", ""),
    "albedo_b": ("share of blue light that a collision scatters", ""),
    "L": ("outer scale of the field; null where it has none", "unit"),
    "regime": ("of the law: exponential, white, pink, negative, fbm or kfbm", ""),
    "b": ("exponent of the law", ""),
    "kappa": ("strength of the correlation in the law; 0 is the exponential", ""),
    "transport": ("what paths remember between flights: reciprocal, mixed or renewal", ""),
    "line_variance": ("of fractional Brownian motion: asymptotic or exact", ""),
    "phase_function": ("isotropic, hg, two_lobe or draine", ""),
    "back_asymmetry": ("mean cosine of the second lobe, of two_lobe", ""),
    "back_weight": ("share of the second lobe, of two_lobe", ""),
    "draine_alpha": ("alpha of the phase function, of draine", ""),
    "frame": ("time code at which the stage is read", ""),
    "camera": ("prim path of the camera", ""),
    "scene": ("file of the stage", ""),
    "azimuth": ("of the camera on its orbit", "degree"),
    "elevation": ("of the camera above the plane of its orbit", "degree"),
    "distance": ("of the camera from the centre of its orbit", "unit"),
}
"""Meaning and unit of the columns of the plan that are the same in every dataset."""


@dataclass(frozen=True)
class Column:
    """One label.

    Args:
        name: without dots, which loaders take for a step into a structure.
        type: of its values; any may be null.
        meaning: in a few words.
        unit: of its values; ``unit`` is the stage's unit of length. Empty where there is none.
    """

    name: str
    type: pa.DataType
    meaning: str
    unit: str = ""

    @property
    def field(self) -> pa.Field:
        """With meaning and unit as metadata."""
        return pa.field(self.name, self.type, metadata={"meaning": self.meaning, "unit": self.unit})


RESULTS = (
    Column(STATUS, pa.string(), "complete; failed where the render was given up, missing where it is still to come"),
    Column("spp", pa.int64(), "samples per pixel that were reached"),
    Column("standard_error", pa.float64(), "relative standard error of blocks of 8 x 8 pixels, on the mean"),
    Column("reached_error", pa.float64(), "this error over what the config asks for: rms, or a percentile of blocks"),
    Column("chosen_settings", pa.string(), "what the error was reached with: balanced, or what differs from it"),
    Column("truncated", pa.int64(), "paths cut at the bound on their length, of all pixels"),
    Column("nonfinite", pa.int64(), "samples of the image that were not finite; a complete one has none"),
    Column("render_seconds", pa.float64(), "wall time of the render; differs from run to run", "s"),
    Column("config_hash", pa.string(), "SHA-256 of the plan, which all that the files depend on goes into"),
    Column(EXR, pa.string(), "path of the radiance, linear Rec.709, float32"),
    Column(PNG, pa.string(), "path of the view, sRGB, 8 bit; null where none was asked for"),
)
"""What is known of a sample after its render, beside statistics and targets."""
RESERVED = frozenset(
    {*(column.name for column in RESULTS), *STATISTICS, *TARGETS, "file_name", "image", "label", "radiance", "alpha"}
)
"""Names that no axis can have: the columns of every dataset, and those that loaders make."""
OURS = frozenset({*PLANNED, *(column.name for column in RESULTS), *STATISTICS, *TARGETS})
"""Columns whose meaning is in our words."""


def columns_of(dataset: Dataset, records: Iterable[Record]) -> tuple[Column, ...]:
    """Of the labels of a dataset: the plan's, results, statistics, targets, and at last where the files are.

    Args:
        dataset: whose plan it is.
        records: of its complete samples.

    Returns:
        In the order in which they stand in the table.
    """
    records = tuple(records)
    needs = {"reached_error": "error_over", "chosen_settings": "chosen_from"}
    quality, files = dataset.meta.quality, RESULTS[-3:]
    reached = [column for column in RESULTS[:-3] if needs.get(column.name, "spp") in quality]
    statistics = _names(STATISTICS, (record.statistics for record in records))
    return (
        *_planned(dataset),
        *reached,
        *(Column(name, pa.float64(), STATISTICS.get(name, "statistic of the image")) for name in statistics),
        *_targets(records),
        *files,
    )


def _planned(dataset: Dataset) -> Iterator[Column]:
    axes = {axis.name: axis for axis in dataset.meta.axes}
    for field in dataset.plan.schema:
        meaning, unit = PLANNED.get(field.name, (field.name.replace("_", " "), ""))
        axis = axes.get(field.name)
        if axis is not None and field.name not in PLANNED:
            meaning, unit = f"value of `{axis.target}`", axis.unit
        # A column without any value has no type of its own, and loaders refuse such a one.
        yield Column(field.name, pa.float64() if pa.types.is_null(field.type) else field.type, meaning, unit)


def _targets(records: tuple[Record, ...]) -> Iterator[Column]:
    for name in _names(TARGETS, (record.targets for record in records)):
        values = [record.targets.get(name) for record in records]
        kind = pa.list_(pa.float64()) if any(isinstance(value, list) for value in values) else pa.float64()
        yield Column(name, kind, *TARGETS.get(name, ("target", "")))


def _names(known: Iterable[str], found: Iterable[Any]) -> list[str]:
    """The names that there are, the known ones first and in their order."""
    there = {name for names in found for name in names}
    return [*(name for name in known if name in there), *sorted(there.difference(known))]
