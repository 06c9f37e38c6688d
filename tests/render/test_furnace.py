"""Energy: a medium or surface that absorbs nothing, in a uniform environment of radiance 1, looks like nothing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fgf_warp.renderer import render
from fgf_warp.scene import DistantLight, Solid, Surface
from fgf_warp.settings import RenderSettings
from tests import stats
from tests.grid import PHASES, REGIMES, TRANSPORTS
from tests.scenes import camera, furnace

SETTINGS = RenderSettings(width=48, height=48, spp=16, max_depth=2**20)
MEDIA = [
    (regime, transport)
    for regime in REGIMES
    for transport in TRANSPORTS
    if regime != "negative" or transport == "renewal"
]
HALVES = tuple(DistantLight(f"/{z}", (0, 0, z), math.pi / 2, (1.0, 1.0, 1.0)) for z in (-1.0, 1.0))


@pytest.mark.parametrize("g", [-0.8, 0.0, 0.8])
@pytest.mark.parametrize(("regime", "transport"), MEDIA)
def test_medium(regime, transport, g):
    """Every pixel of the disc, not only their mean: light that no light source is connected to carries no noise."""
    result = render(furnace(asymmetry=g, transport=transport, **REGIMES[regime]), SETTINGS)
    assert result.truncated_count == 0
    assert result.alpha.mean() > 0.3, "the medium is hardly there"
    assert np.abs(result.radiance - 1).max() <= 0.002


@pytest.mark.parametrize("g", [-0.8, 0.0, 0.8])
@pytest.mark.parametrize(("regime", "transport"), MEDIA)
def test_medium_under_connections(regime, transport, g):
    """The same environment as two hemispheres that paths connect to: next-event estimation and its weights."""
    scene = furnace(asymmetry=g, transport=transport, **REGIMES[regime])
    result = render(replace(scene, lights=HALVES), replace(SETTINGS, spp=128))
    stats.assert_means(*stats.image_mean(result), 1.0, detects=0.01)


@pytest.mark.parametrize(
    "kind", ["draine", *(pytest.param(k, marks=pytest.mark.slow) for k in PHASES if k != "draine")]
)
def test_phase_function(kind):
    """Of weight 1 where it is sampled, and matched with its density where lights are connected to."""
    scene = furnace(phase_function=kind, **PHASES[kind], **REGIMES["pink"])
    assert np.abs(render(scene, SETTINGS).radiance - 1).max() <= 0.002
    result = render(replace(scene, lights=HALVES), replace(SETTINGS, spp=128))
    stats.assert_means(*stats.image_mean(result), 1.0, detects=0.01)


def test_flights_without_length():
    """Close above white noise, most flights between medium vertices have none; channels that differ weigh them too."""
    medium = {"hurst": -0.4999, "white_noise_scale": 1.0, "extinction_color": (1.0, 0.5, 0.1)}
    result = render(furnace(transport="reciprocal", mean_extinction=1.0, **medium), replace(SETTINGS, spp=32))
    means, errors = zip(*(stats.image_mean(result, channel) for channel in range(3)), strict=True)
    stats.assert_means(means, errors, 1.0, detects=0.03)


def test_surface():
    scene = replace(furnace(), media=(), shapes=(Solid("/ball", "sphere", np.eye(4), Surface((1.0, 1.0, 1.0))),))
    assert np.abs(render(scene, SETTINGS).radiance - 1).max() <= 1e-5


def test_camera_inside():
    scene = replace(furnace(**REGIMES["pink"]), camera=camera((0.3, 0.2, 0.1), (1, 0, 0)))
    result = render(scene, SETTINGS)
    assert result.alpha.mean() > 0.3
    assert np.abs(result.radiance - 1).max() <= 1e-5
