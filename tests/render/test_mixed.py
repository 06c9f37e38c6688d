"""The mixed transport: a frozen path is classical at a rate of its own, which it keeps; the others are reciprocal."""

from dataclasses import replace

import numpy as np
import pytest

from fgf_warp.renderer import Variant, render, render_batch
from fgf_warp.scene import Solid, Surface
from fgf_warp.settings import RenderSettings
from fgf_warp.theory.mixture import mix_rates
from tests import stats
from tests.scenes import camera, furnace, slab, transform

SETTINGS = RenderSettings(width=32, height=32, spp=512, seed=31, max_depth=100_000)
BLACK = (0.0, 0.0, 0.0)
NODES = (np.polynomial.legendre.leggauss(60)[0] + 1) / 2, np.polynomial.legendre.leggauss(60)[1] / 2


def channels(result):
    return np.array([stats.image_mean(result, channel) for channel in (0, 1)])


@pytest.mark.parametrize(("hurst", "kappa"), [pytest.param(-0.25, 1.0, marks=pytest.mark.slow), (0.5, 0.5)])
def test_a_slab_is_the_reciprocal_one_and_frozen_ones(hurst, kappa):
    """Reflectance and transmittance of a slab, T = 2, against the same by parts: (1-p) reciprocal + p frozen.

    The frozen part is the mean of classical slabs over the mixture's rates, each rendered for itself.
    """
    share, albedo = min(1 + 2 * hurst, 1), (0.9,) * 3
    mixture = mix_rates(share, kappa)
    common = dict(incidence="lambert", albedo=albedo)
    mixed = channels(render(slab(2.0, hurst=hurst, kappa=kappa, transport="mixed", **common), SETTINGS))
    reciprocal = channels(render(slab(2.0, hurst=hurst, kappa=kappa, transport="reciprocal", **common), SETTINGS))
    # What is left out has a share of less than 1e-4 of all paths.
    kept = np.flatnonzero(mixture.weights > 1e-5)
    assert mixture.weights[kept].sum() > 1 - 1e-4
    classical = slab(2.0, **common)
    variants = [
        Variant((replace(classical.media[0], mean_extinction=float(mixture.rates[k])),), seed=int(k) + 100)
        for k in kept
        if mixture.rates[k] > 0
    ]
    weights = [mixture.weights[k] for k in kept if mixture.rates[k] > 0]
    parts = np.array([channels(r) for r in render_batch(classical, variants, replace(SETTINGS, spp=64))])
    frozen = np.tensordot(weights, parts[..., 0], axes=1) + np.array([0, mixture.weights[mixture.rates == 0].sum()])
    frozen_error = np.sqrt(np.tensordot(np.square(weights), parts[..., 1] ** 2, axes=1))
    expected = (1 - share) * reciprocal[:, 0] + share * frozen
    errors = np.sqrt(mixed[:, 1] ** 2 + (1 - share) ** 2 * reciprocal[:, 1] ** 2 + (share * frozen_error) ** 2)
    stats.assert_means(mixed[:, 0], errors, expected, detects=0.02)
    if share < 1:
        assert abs(mixed[1, 0] - reciprocal[1, 0]) > 5 * errors[1], "the two transports look alike"


def law_of(scene, u):
    return scene.media[0].line_law.eval_kernels(u).transmittance_ss


@pytest.mark.parametrize("crosses", [False, True], ids=["chord", "crossings"])
@pytest.mark.parametrize(
    "law", [dict(hurst=-0.25, kappa=1.0), dict(hurst=0.5, kappa=1.0)], ids=["half frozen", "all frozen"]
)
def test_a_frozen_path_keeps_its_rate_through_a_surface(law, crosses):
    """An absorbing layer over a white floor: light passes it twice, the second time at a random slant.

    A frozen path has one rate on both ways, so that their optical depths add up inside Tr; another path forgets.
    """
    scene = furnace(albedo=BLACK, mean_extinction=0.4, transport="mixed", **law)
    wide = 1e5
    shapes = [
        Solid("/layer", "cube", transform((wide, wide, 0.5)), medium=0),
        Solid("/floor", "cube", transform((wide, wide, 0.5), (0, 0, -1.001)), surface=Surface((1.0,) * 3)),
    ]
    media = scene.media
    if crosses:
        # A second medium, out of sight, makes boundaries be crossed one by one.
        shapes.append(Solid("/far", "sphere", transform(1.0, (0, 0, 50.0)), medium=1))
        media = (*media, replace(media[0], name="/other", transport="reciprocal"))
    scene = replace(scene, shapes=tuple(shapes), media=media, camera=camera((0, 0, 5), (0, 0, 0), aperture=1e-4))
    cosine, weight = NODES
    down, up = 0.4, 0.4 / cosine
    share = min(1 + 2 * law["hurst"], 1)
    kept = (2 * cosine * weight) @ law_of(scene, down + up)
    forgotten = (2 * cosine * weight) @ (law_of(scene, down) * law_of(scene, up))
    expected = share * kept + (1 - share) * forgotten
    mean, error = stats.image_mean(render(scene, SETTINGS))
    stats.assert_means(mean, error, expected, detects=0.02)
    assert abs(expected - forgotten) > 5 * error, "keeping and forgetting look alike"


def test_without_correlation_there_is_nothing_to_freeze():
    for law in (dict(), dict(hurst=-0.5, white_noise_scale=2.0)):
        mixed = render(furnace(albedo=(0.9,) * 3, transport="mixed", **law), replace(SETTINGS, spp=4))
        reciprocal = render(furnace(albedo=(0.9,) * 3, transport="reciprocal", **law), replace(SETTINGS, spp=4))
        assert np.array_equal(mixed.radiance, reciprocal.radiance)
