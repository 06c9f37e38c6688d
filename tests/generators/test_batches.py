"""A sweep over several kinds of law, through the renderer."""

from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from fgf_warp.output.exr import read_exr
from fgf_warp.renderer import image_bytes, render
from fgf_warp.settings import GIB
from generators import run
from generators.config import load_config
from generators.plan import build_plan
from tests.scenes import furnace

HURST = [-0.5, 0.3, -0.25, -0.5, -0.4]


@pytest.mark.parametrize("images_at_once", [1.5, 100])
def test_samples_of_mixed_laws_are_what_they_are_alone(tmp_path, config_path, images_at_once):
    loaded = load_config(config_path, [f"axes={{H: {HURST}, S_w: [0.5]}}", "aovs=[]"])
    plan = build_plan(loaded.config, furnace(albedo=(0.9, 0.7, 0.5), outer_scale=100.0), 12, 8)
    kinds = [sample.medium.line_law.kind for sample in plan.samples]
    assert kinds == ["exponential", "power", "fractional", "exponential", "fractional"]
    limited = replace(plan.settings, memory=images_at_once * image_bytes(plan.settings) / GIB)
    report = run.generate(replace(plan, settings=limited), loaded, tmp_path / "data", workers=2)
    assert report.is_complete
    rows = pq.read_table(tmp_path / "data" / "index.parquet").to_pylist()
    for row, sample, hurst in zip(rows, plan.samples, HURST, strict=True):
        assert (row["index"], row["H"], row["seed"]) == (sample.index, hurst, sample.seed)
        channels, header = read_exr(tmp_path / "data" / row["exr"])
        assert (header["media"][0]["H"], header["settings"]["seed"]) == (hurst, sample.seed)
        assert header["dataset"]["index"] == sample.index
        alone = render(plan.scene.with_medium(0, sample.medium), replace(plan.settings, seed=sample.seed))
        np.testing.assert_array_equal(np.stack([channels[name] for name in "RGB"], axis=2), alone.radiance)
        np.testing.assert_array_equal(channels["A"], alone.alpha)
        assert row["standard_error"] == alone.relative_standard_error
    assert len({row["standard_error"] for row in rows}) == len(rows)
