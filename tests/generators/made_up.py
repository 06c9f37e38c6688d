"""A dataset made without rendering, for tests of what is done with one."""

import hashlib
import itertools
import tempfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pyarrow as pa

from fgf_warp.output.color import write_png
from fgf_warp.output.exr import write_exr
from fgf_warp.settings import Aov, RenderSettings
from fgf_warp.theory.law import build_line_law
from generators.dataset import layout
from generators.dataset.plan_table import AxisMeta, PlanMeta, write_plan
from generators.dataset.reader import Dataset
from generators.dataset.record import Failure, Record, Timing, encode, file_entry
from generators.dataset.store import Store
from generators.publishing.statistics import image_statistics
from tests.renders import made_up_render

HURST = (-0.5, -0.25, -0.1)
ASYMMETRY = (-0.5, 0.5)
SCALE = (0.5, 2.0)
LOOKS = ("bright", "dim")
META = PlanMeta(
    name="made-up",
    digest=hashlib.sha256(b"made-up").hexdigest(),
    version="0.1.0",
    seed=7,
    scene="cloud_block.usda",
    medium="/World/Looks/Cloud",
    axes=(
        AxisMeta("H", "H", HURST),
        AxisMeta("g", "g", ASYMMETRY),
        AxisMeta("S_w", "S_w", None, unit="unit^(-2-2H)"),
        AxisMeta("look", "/World/Key{look}", LOOKS, category=True),
    ),
    width=16,
    height=12,
    aovs=("depth", "variance"),
    quality={"spp": 8},
    description="Pictures of noise.",
    license="CC0-1.0",
)


def make_dataset(location: Path | str, missing: Iterable[int] = (), failed: Iterable[int] = ()) -> Dataset:
    """Writes 24 samples, two thirds for training, without those that are missing or failed."""
    store, rows = Store(location), plan_rows()
    store.write(layout.PLAN, write_plan(META, plan_table(rows)))
    store.write(layout.CONFIG, b"name: made-up\n")
    for row in rows:
        if row["index"] in failed:
            failure = Failure(row["index"], "3 samples are not finite, most of them in pixel (1, 2)", 2)
            store.write(layout.failure(row["index"]), encode(failure))
        elif row["index"] not in missing:
            store.commit(layout.sample_folder(row["split"], row["index"]), sample_files(row))
    return Dataset(location)


def plan_table(rows: list[dict]) -> pa.Table:
    """The rows with the types of their columns, of which L has no values."""
    return pa.table({name: pa.array([row[name] for row in rows], {"L": pa.float64()}.get(name)) for name in rows[0]})


def plan_rows() -> list[dict]:
    """The rows of the plan."""
    rows = []
    for index, (hurst, asymmetry, scale, look) in enumerate(itertools.product(HURST, ASYMMETRY, SCALE, LOOKS)):
        law = build_line_law(hurst=hurst, white_noise_scale=scale, mean_extinction=2.0)
        rows.append(
            {
                "index": index,
                "split": layout.SPLITS[(0, 0, 0, 0, 1, 2)[index % 6]],
                "seed": 2**62 + index,
                "H": hurst,
                "g": asymmetry,
                "S_w": scale,
                "look": look,
                "sigma_m": 2.0,
                "albedo_r": 0.9,
                "albedo_g": 0.8,
                "albedo_b": 0.7,
                "L": None,
                "regime": law.regime,
                "b": law.b,
                "kappa": law.kappa,
                "transport": "mixed",
                "line_variance": "asymptotic",
                "phase_function": "hg",
            }
        )
    return rows


def sample_files(row: dict) -> dict[str, bytes]:
    """What the folder of one sample holds."""
    settings = RenderSettings(
        width=META.width,
        height=META.height,
        spp=int(META.quality["spp"]),
        seed=row["seed"],
        aovs=frozenset(Aov(name) for name in META.aovs),
    )
    render = made_up_render(settings, dataset={"name": META.name, "plan": META.digest, "index": row["index"]})
    # The brighter the less correlated, so that the statistics differ.
    render = replace(render, radiance=render.radiance * (1 - row["H"]))
    with tempfile.TemporaryDirectory() as temporary:
        write_exr(Path(temporary, layout.RADIANCE), render)
        write_png(Path(temporary, layout.IMAGE), render)
        files = {path.name: path.read_bytes() for path in sorted(Path(temporary).iterdir())}
    record = Record(
        index=row["index"],
        plan=META.digest,
        spp=settings.spp,
        standard_error=0.02 + 0.001 * row["index"],
        truncated=row["index"] % 2,
        nonfinite=0,
        statistics=image_statistics(render),
        targets={},
        files={name: file_entry(content) for name, content in files.items()},
    )
    timing = Timing(0.1 + 0.01 * row["index"], 0.01, "worker 0", 1)
    return {**files, layout.RECORD: encode(record), layout.TIMING: encode(timing)}
