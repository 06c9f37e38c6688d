"""The labels of a dataset: one row per sample, one file, a fixed schema."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from fgf_warp.output.atomic import replacing
from generators.plan import Plan, Sample

PHASE_COLUMNS = ("back_asymmetry", "back_weight", "draine_alpha")
"""Fields of `Medium` beside g; 0 where its phase function does not have them."""
SCHEMA = pa.schema(
    [
        pa.field("index", pa.int64(), nullable=False),
        pa.field("H", pa.float64(), nullable=False),
        pa.field("g", pa.float64(), nullable=False),
        pa.field("S_w", pa.float64()),
        pa.field("sigma_m", pa.float64(), nullable=False),
        pa.field("albedo_r", pa.float64(), nullable=False),
        pa.field("albedo_g", pa.float64(), nullable=False),
        pa.field("albedo_b", pa.float64(), nullable=False),
        pa.field("L", pa.float64()),
        pa.field("regime", pa.string(), nullable=False),
        pa.field("b", pa.float64(), nullable=False),
        pa.field("kappa", pa.float64(), nullable=False),
        pa.field("transport", pa.string(), nullable=False),
        pa.field("line_variance", pa.string(), nullable=False),
        pa.field("phase_function", pa.string(), nullable=False),
        *(pa.field(name, pa.float64(), nullable=False) for name in PHASE_COLUMNS),
        pa.field("seed", pa.uint64(), nullable=False),
        pa.field("spp", pa.int64(), nullable=False),
        pa.field("render_seconds", pa.float64(), nullable=False),
        pa.field("standard_error", pa.float64(), nullable=False),
        pa.field("truncated", pa.int64(), nullable=False),
        pa.field("exr", pa.string(), nullable=False),
        pa.field("png", pa.string()),
    ]
)
"""Of ``index.parquet``. Short names and units as in the configs; one flat column per number, since those load
everywhere. ``S_w`` is null where kappa was authored in its place, ``L`` where there is none, ``png`` where none was
asked for. ``sigma_m``, ``kappa`` and ``b`` are those in force: a grey extinction color is a factor of ``sigma_m``; of
a chromatic medium, whose channels differ in them, they are the ones before the color. ``standard_error`` is the mean
relative standard error of the image's pixels, somewhat too large with the lattice (see `fgf_warp.settings.Sampler`);
``truncated`` the number of paths cut at the bound on their length. Only ``render_seconds`` differs between two runs of
one plan."""


@dataclass(frozen=True)
class Record:
    """What is known of a sample after it was rendered.

    Args:
        sample: as planned.
        render_seconds: wall time of the render [s].
        standard_error: mean relative standard error of the pixels.
        truncated: paths cut at the bound on their length.
    """

    sample: Sample
    render_seconds: float
    standard_error: float
    truncated: int


def exr_name(sample: Sample) -> str:
    """Path of the sample's EXR in the dataset's folder."""
    return f"images/{sample.name}.exr"


def png_name(sample: Sample) -> str:
    """Path of the sample's PNG in the dataset's folder."""
    return f"images/{sample.name}.png"


def write_manifest(path: Path, plan: Plan, records: Iterable[Record]) -> None:
    """Writes the table of the finished samples in the order of their indices.

    Raises:
        OutputError: where it cannot be written.
    """
    rows = [_row(plan, record) for record in sorted(records, key=lambda record: record.sample.index)]
    table = pa.Table.from_pylist(rows, schema=SCHEMA)
    with replacing(path) as temporary:
        pq.write_table(table, temporary)


def _row(plan: Plan, record: Record) -> dict[str, object]:
    sample, medium = record.sample, record.sample.medium
    return {
        "index": sample.index,
        "H": medium.hurst,
        "g": medium.asymmetry,
        "S_w": medium.white_noise_scale if medium.kappa is None else None,
        "sigma_m": medium.line_law.mean_extinction,
        "albedo_r": medium.albedo[0],
        "albedo_g": medium.albedo[1],
        "albedo_b": medium.albedo[2],
        "L": medium.outer_scale,
        "regime": medium.line_law.regime,
        "b": medium.line_law.b,
        "kappa": medium.line_law.kappa,
        "transport": medium.resolved_transport,
        "line_variance": medium.line_variance,
        "phase_function": medium.phase_function,
        **{name: getattr(medium, name) for name in PHASE_COLUMNS},
        "seed": sample.seed,
        "spp": plan.settings.spp,
        "render_seconds": record.render_seconds,
        "standard_error": record.standard_error,
        "truncated": record.truncated,
        "exr": exr_name(sample),
        "png": png_name(sample) if plan.png else None,
    }
