"""A sweep over several kinds of law, through the renderer."""

from dataclasses import replace

import numpy as np
import pytest

from fgf_warp.output.exr import read_exr
from fgf_warp.renderer import image_bytes, render
from fgf_warp.settings import GIB
from generators.dataset import layout
from generators.dataset.reader import Dataset
from generators.running.run import Workers, generate
from tests.generators.small_plan import TEXT, small_plan

HURST = [-0.5, 0.3, -0.25, -0.5, -0.4]


@pytest.mark.parametrize("images_at_once", [1.5, 100])
def test_samples_of_mixed_laws_are_what_they_are_alone(tmp_path, images_at_once):
    plan = small_plan(tmp_path, f"axes={{H: {HURST}, S_w: [0.5], L: [100]}}", "aovs=[]")
    kinds = [sample.medium.line_law.kind for sample in plan.samples]
    assert kinds == ["exponential", "power", "fractional", "exponential", "fractional"]
    limited = replace(plan.settings, memory=images_at_once * image_bytes(plan.settings) / GIB)
    report = generate(replace(plan, settings=limited), TEXT, tmp_path / "data", workers=Workers(cores=2))
    assert report.is_complete
    dataset = Dataset(tmp_path / "data")
    for sample, hurst in zip(plan.samples, HURST, strict=True):
        channels, header = read_exr(tmp_path / "data" / dataset.folders[sample.index] / layout.RADIANCE)
        assert (header["media"][0]["H"], header["settings"]["seed"]) == (hurst, sample.seed)
        assert header["dataset"]["index"] == sample.index
        scene = plan.scene_of(sample).with_media(plan.media_of(sample))
        alone = render(scene, replace(plan.settings, seed=sample.seed))
        np.testing.assert_array_equal(np.stack([channels[name] for name in "RGB"], axis=2), alone.radiance)
        np.testing.assert_array_equal(channels["A"], alone.alpha)
        assert dataset.record(sample.index).standard_error == alone.relative_standard_error
    assert len({record.standard_error for record in dataset.records(dataset.complete())}) == len(HURST)
