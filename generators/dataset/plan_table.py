"""The frozen plan as a table: one row per sample, and what they share in the table's metadata."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from fgf_warp.errors import CorruptFileError
from fgf_warp.settings import Aov
from generators.dataset import layout

META_KEY = b"fgf_warp.plan"
INDEX, SPLIT, SEED = "index", "split", "seed"
"""Columns of every plan; the axes follow, then the labels of the swept medium."""


@dataclass(frozen=True)
class AxisMeta:
    """One axis of a sweep, as a reader of the dataset meets it.

    Args:
        name: of its column.
        target: what it changes: ``H`` and the like of the swept medium, or ``/prim.path:attribute``.
        values: in order, of an axis on the grid; None of one that is drawn or depends on others.
        category: whether its values are names.
        unit: ``1/unit`` and the like; empty where it has none or it is not known.
    """

    name: str
    target: str
    values: tuple[float | str, ...] | None
    category: bool = False
    unit: str = ""


@dataclass(frozen=True)
class PlanMeta:
    """What the samples of a plan share.

    Args:
        name: of the dataset.
        digest: hexadecimal SHA-256 of all that the files depend on; samples of another plan do not mix with these.
        version: of fgf-warp.
        seed: of the dataset.
        scene: name of the stage's file.
        medium: prim path of the swept medium; empty where the scene has none.
        axes: in the order of the config.
        width: of the images [pixel].
        height: of the images [pixel].
        aovs: planes beside radiance and alpha.
        png: whether there is an 8-bit view of each sample.
        exposure: of these views [stop].
        quality: what bounds each sample's render: ``spp``, which is the most with a ``target_error`` or a ``time``, and
            ``error_over`` where the target is not that of the mean over blocks of pixels; with ``chosen_from``, the
            hash of a measurement by which further settings are chosen for each sample.
        targets: the extra targets asked for, by name, with their settings.
        device: kind of device, ``cpu`` or ``cuda``: they round differently.
        description: a sentence of the author's.
        license: SPDX identifier.
        stages: names of the stages that the dataset holds, see `generators.dataset.layout.SCENE`; a dataset of before
            this was kept holds none.
    """

    name: str
    digest: str
    version: str
    seed: int
    scene: str
    medium: str
    axes: tuple[AxisMeta, ...]
    width: int
    height: int
    aovs: tuple[str, ...] = ()
    png: bool = True
    exposure: float = 0.0
    quality: dict[str, Any] = field(default_factory=dict)
    targets: dict[str, Any] = field(default_factory=dict)
    device: str = "cpu"
    description: str = ""
    license: str = ""
    stages: tuple[str, ...] = ()


BOUNDS = ("spp", "target_error", "time")
"""Of `PlanMeta.quality`, the numbers."""


def is_open(quality: Mapping[str, Any]) -> bool:
    """Whether the samples per pixel follow from an error or a time."""
    return "target_error" in quality or "time" in quality


def write_plan(meta: PlanMeta, samples: pa.Table) -> bytes:
    """The plan as the content of a parquet file.

    Args:
        meta: what the samples share.
        samples: one row each, by index.
    """
    table = samples.replace_schema_metadata({META_KEY: json.dumps(asdict(meta), sort_keys=True)})
    buffer = io.BytesIO()
    pq.write_table(table, buffer)
    return buffer.getvalue()


def read_plan(content: bytes, name: str) -> tuple[PlanMeta, pa.Table]:
    """What `write_plan` wrote.

    Args:
        content: of the file.
        name: of the file, for the error.

    Returns:
        What the samples share, and one row for each, by index.

    Raises:
        CorruptFileError: where it is something else.
    """
    try:
        table = pq.read_table(pa.BufferReader(content))
        found = json.loads(table.schema.metadata[META_KEY])
        axes = tuple(
            AxisMeta(**{**axis, "values": None if axis["values"] is None else tuple(axis["values"])})
            for axis in found.pop("axes")
        )
        listed = {name: tuple(found.get(name, ())) for name in ("aovs", "stages")}
        meta = PlanMeta(**{**found, "axes": axes, **listed})
        if _is_plan(meta, table):
            return meta, table
        error: Exception | None = None
    except (pa.ArrowException, OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError) as caught:
        error = caught
    raise CorruptFileError(f"{name}: is damaged or not the plan of a dataset") from error


def _is_bound(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < math.inf


def _is_plan(meta: PlanMeta, table: pa.Table) -> bool:
    """Whether values have their types, and the table the columns that every plan has, with a row for each index."""
    types: dict[str, Any] = {"str": str, "int": int, "bool": bool, "float": (int, float), "dict[str, Any]": dict}
    parts: list[Any] = [meta, *meta.axes]
    values = [(entry.type, getattr(part, entry.name)) for part in parts for entry in fields(part)]
    if not all(isinstance(value, types.get(str(kind), object)) for kind, value in values):
        return False
    for axis in meta.axes:
        # What a table's head cannot hold, and values that no place on the contact sheet is for.
        f"{meta.digest}{axis.name}{axis.target}{axis.unit}".encode()
        if axis.values is not None and not set(table[axis.name].to_pylist()) <= set(axis.values):
            return False
    needed = {INDEX, SPLIT, SEED, *(axis.name for axis in meta.axes)}
    return (
        table.num_rows >= 1
        and all(_is_bound(meta.quality[name]) for name in BOUNDS if name in meta.quality)
        and needed <= set(table.column_names)
        and table[INDEX].to_pylist() == list(range(table.num_rows))
        and set(table[SPLIT].to_pylist()) <= set(layout.SPLITS)
        and all(isinstance(seed, int | str) for seed in table[SEED].to_pylist())
        and set(meta.aovs) <= set(Aov)
        and min(meta.width, meta.height) >= 1
    )
