"""The lattice against independent numbers: the same image, with less noise."""

from dataclasses import replace

import numpy as np
import pytest

from fgf_warp.renderer import render
from fgf_warp.settings import RenderSettings
from tests import stats
from tests.grid import REGIMES
from tests.render.test_render import full_scene
from tests.scenes import furnace

SETTINGS = RenderSettings(width=24, height=24, spp=64, max_depth=64, roulette_depth=5)


def sphere():
    return furnace(fills_view=False, albedo=(0.8, 0.8, 0.8), asymmetry=0.5, **REGIMES["pink"])


@pytest.mark.parametrize(
    ("make", "gain"), [(sphere, 1.5), pytest.param(full_scene, 1.2, marks=pytest.mark.slow)], ids=["sphere", "full"]
)
def test_the_lattice_lowers_the_variance(make, gain):
    """Of 48 renders each, over 576 pixels: the ratio of the variances is known to some percent."""

    def renders(sampler):
        images = [render(make(), replace(SETTINGS, seed=k, sampler=sampler)).radiance[..., 0] for k in range(48)]
        return np.array(images, dtype=np.float64)

    independent, lattice = renders("independent"), renders("lattice")
    assert independent.var(axis=0, ddof=1).mean() > gain * lattice.var(axis=0, ddof=1).mean()
    means = [images.mean(axis=(1, 2)) for images in (independent, lattice)]
    error = np.hypot(*(mean.std(ddof=1) / np.sqrt(48) for mean in means))
    stats.assert_means(means[0].mean(), error, means[1].mean(), detects=0.005)
