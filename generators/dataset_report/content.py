"""What the page shows of a dataset, gathered from its labels."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pyarrow as pa

from generators.dataset import layout
from generators.dataset.plan_table import INDEX, SEED, SPLIT, AxisMeta
from generators.dataset.reader import Dataset
from generators.publishing.columns import COMPLETE, EXR, FAILED, MISSING, PNG, STATUS
from generators.publishing.words import describe_quality

DIGITS = 6
"""Significant digits of the numbers on the page."""
REACHED = ("render_seconds", "standard_error", "reached_error", "spp", "truncated")
MAIN_STATISTICS = ("luminance_mean", "luminance_std", "luminance_p99", "alpha_mean", "gradient_energy", "structure_4")
"""What the page shows at once; the others are below them on demand."""
NOT_SHOWN = frozenset({STATUS, SPLIT, EXR, PNG, "config_hash", "nonfinite"})


@dataclass(frozen=True)
class Content:
    """The page's words and numbers.

    Args:
        counts: samples by status.
        splits: the same, by split.
        verdict: how far the dataset is, in one line.
        axes: name and values of each axis, as text.
        facts: of the dataset, by name.
        table: what the script draws from, JSON-ready.
    """

    counts: Mapping[str, int]
    splits: Mapping[str, Mapping[str, int]]
    verdict: str
    axes: tuple[Mapping[str, str], ...]
    facts: Mapping[str, str]
    table: Mapping[str, Any]


def gather(dataset: Dataset, labels: pa.Table) -> Content:
    """Reads what is known of each sample.

    Args:
        dataset: complete or not.
        labels: of all its samples, see `generators.publishing.index`.
    """
    status, split = labels[STATUS].to_pylist(), labels[SPLIT].to_pylist()
    by_split = Counter(zip(split, status, strict=True))
    splits = {
        name: {kind: by_split[name, kind] for kind in (COMPLETE, FAILED, MISSING)}
        for name in layout.SPLITS
        if name in split
    }
    counts = {kind: status.count(kind) for kind in (COMPLETE, FAILED, MISSING)}
    columns, constants = _columns(dataset, labels)
    failures = {index: failure for index, failure in dataset.failures().items() if status[index] == FAILED}
    return Content(
        counts=counts,
        splits=splits,
        verdict=_verdict(counts),
        axes=tuple({"name": axis.name, "text": _axis_text(axis, labels)} for axis in dataset.meta.axes),
        facts=_facts(dataset, labels),
        table={
            "width": dataset.meta.width,
            "height": dataset.meta.height,
            "status": status,
            "columns": columns,
            "constants": constants,
            "failures": {index: {"reason": f.reason, "attempts": f.attempts} for index, f in failures.items()},
            "files": [layout.RADIANCE, *([layout.IMAGE] if dataset.meta.png else []), layout.RECORD],
        },
    )


def _columns(dataset: Dataset, labels: pa.Table) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The columns that the page draws, and apart from them the labels that are the same in every sample."""
    axes = {axis.name: axis for axis in dataset.meta.axes}
    planned = set(dataset.plan.column_names)
    shown, constants = [_column(labels, SPLIT, "split")], []
    for field in labels.schema:
        if field.name in NOT_SHOWN or pa.types.is_nested(field.type):
            continue
        if field.name in axes:
            shown.append(_column(labels, field.name, "axis", axes[field.name].values))
        elif field.name in planned:
            if len(labels[field.name].unique()) > 1:
                shown.append(_column(labels, field.name, "number" if field.name in (INDEX, SEED) else "label"))
            else:
                constants.append({"name": field.name, "value": _rounded(labels[field.name][0].as_py())})
        else:
            shown.append(_column(labels, field.name, "reached" if field.name in REACHED else "statistic"))
    return shown, constants


def _column(labels: pa.Table, name: str, group: str, grid: tuple[float | str, ...] | None = None) -> dict[str, Any]:
    field = labels.schema.field(name)
    metadata = field.metadata or {}
    values = labels[name].to_pylist()
    return {
        "name": name,
        "group": group,
        "main": name in MAIN_STATISTICS,
        "category": pa.types.is_string(field.type),
        "unit": metadata.get(b"unit", b"").decode(),
        "about": metadata.get(b"meaning", b"").decode(),
        "grid": None if grid is None else [_rounded(value) for value in grid],
        # A seed has more digits than a script's numbers.
        "values": [str(value) for value in values] if name == SEED else [_rounded(value) for value in values],
    }


def _rounded(value: Any) -> Any:
    if not isinstance(value, float):
        return value
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None


def _verdict(counts: Mapping[str, int]) -> str:
    planned = sum(counts.values())
    if counts[COMPLETE] == planned:
        return f"All {planned:,} samples are there."
    absent = [f"{counts[kind]:,} {kind}" for kind in (FAILED, MISSING) if counts[kind]]
    return f"{counts[COMPLETE]:,} of {planned:,} samples are there; {', '.join(absent)}."


def _axis_text(axis: AxisMeta, labels: pa.Table) -> str:
    unit = f" [{axis.unit}]" if axis.unit else ""
    target = f", which sets {axis.target}" if axis.target != axis.name else ""
    if axis.values is not None:
        return ", ".join(_shown(value) for value in axis.values) + unit + target
    values = [value for value in labels[axis.name].to_pylist() if value is not None]
    return f"{_shown(min(values))} to {_shown(max(values))}, drawn{unit}{target}" if values else f"none{target}"


def _shown(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"


def _facts(dataset: Dataset, labels: pa.Table) -> dict[str, str]:
    meta = dataset.meta
    seconds = [value for value in labels["render_seconds"].to_pylist() if value is not None]
    errors = [value for value in labels["standard_error"].to_pylist() if value is not None]
    size = sum(dataset.store.sizes(layout.DATA).values())
    found = {
        "scene": meta.scene,
        "swept medium": meta.medium,
        "images": f"{meta.width} × {meta.height} pixels",
        "planes": ", ".join(("radiance", "alpha", *meta.aovs)),
        "quality": describe_quality(meta),
        "mean relative standard error": f"{sum(errors) / len(errors):.3g}" if errors else "",
        "time of rendering": _duration(sum(seconds)) if seconds else "",
        "time per sample": f"{sum(seconds) / len(seconds):.3g} s" if seconds else "",
        "size of the samples": f"{size / 1e9:.3g} GB" if size >= 1e9 else f"{size / 1e6:.3g} MB",
        "seed": str(meta.seed),
        "licence": meta.license,
        "made with": f"FGF-Warp {meta.version} on {meta.device}",
        "plan": meta.digest[:16],
    }
    return {name: text for name, text in found.items() if text}


def _duration(seconds: float) -> str:
    if seconds < 60:
        return f"{seconds:.3g} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s"
