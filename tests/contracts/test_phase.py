"""Henyey-Greenstein on the device, from g = 0 to |g| = 0.9999: normalised, mean cosine g, sampler against density."""

import numpy as np
import pytest

from fgf_warp import probes
from fgf_warp.theory import phase
from tests import stats
from tests.grid import ASYMMETRIES

AXIS = np.array([0.48, -0.6, 0.64])


def directions(one_minus_cos):
    """Unit vectors, float64, at these angles from AXIS."""
    across = np.cross(AXIS, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    sine = np.sqrt(one_minus_cos * (2 - one_minus_cos))
    return AXIS * (1 - one_minus_cos)[:, None] + across * sine[:, None]


def sample(g, n, seed=3):
    xi = np.random.default_rng(seed).random((n, 2)).astype(np.float32)
    return xi, probes.sample_hg(g, AXIS, xi).astype(np.float64)


def one_minus_cos_of(wi):
    return 0.5 * ((wi - AXIS.astype(np.float32)) ** 2).sum(axis=1)


@pytest.mark.parametrize("g", ASYMMETRIES)
def test_eval_twin(g):
    g32 = float(np.float32(g))
    v = np.concatenate([[0.0], np.geomspace(1e-9, 2.0, 400)])
    found = probes.eval_hg(g32, AXIS, directions(v))
    expected = phase.eval_hg(g32, v)
    # Directions are float32 themselves: beside the function's own bound, an angle off by 2e-7 moves the value.
    from_peak = v if g32 >= 0 else 2 - v
    width = (1 - abs(g32)) ** 2 + 2 * abs(g32) * from_peak
    angle_rounding = 3 * abs(g32) * np.sqrt(2 * from_peak + 1e-14) * 2e-7 / width
    assert np.all(np.abs(found / expected - 1) <= probes.HG_BOUND + angle_rounding)


@pytest.mark.parametrize("g", [abs(g) for g in ASYMMETRIES])
def test_sample_twin(g):
    g32 = float(np.float32(g))
    xi = np.linspace(1e-7, 1 - 6e-8, 5000).astype(np.float32)
    found = probes.sample_hg_one_minus_cos(g32, xi)
    assert np.abs(found / phase.sample_hg_one_minus_cos(g32, xi) - 1).max() <= probes.HG_COSINE_BOUND


@pytest.mark.parametrize("g", ASYMMETRIES)
def test_normalised_with_mean_cosine_g(g):
    """Of the float64 twin, by quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(400)
    s = (nodes + 1) / 2
    # v = 2 s^8 gathers the nodes at the forward peak.
    v, dv = 2 * s**8, 16 * s**7
    forward = 2 * np.pi * phase.eval_hg(abs(g), v) * dv * weights / 2
    assert abs(forward.sum() - 1) < 1e-6
    assert abs((forward * (1 - v)).sum() - abs(g)) < 1e-6


@pytest.mark.parametrize("g", ASYMMETRIES)
def test_sampler_follows_the_density(g):
    """The cosine's cdf is known in closed form; 100,000 directions see a distance of 0.006."""
    _, wi = sample(g, 100_000)
    v = one_minus_cos_of(wi) if g >= 0 else one_minus_cos_of(-wi)
    a = abs(g)

    def cdf(x):
        if a < 1e-5:
            return x / 2
        t = np.sqrt((1 - a) ** 2 + 2 * a * x)
        return (1 + a) * (t - (1 - a)) / (2 * a * t)

    stats.assert_distributed(v, cdf)


@pytest.mark.parametrize("g", [0.0, 0.5, -0.8])
def test_sampler_in_both_angles(g):
    """Chi-square on 20 x 16 bins of cosine and azimuth."""
    n = 200_000
    _, wi = sample(g, n, seed=4)
    across = np.cross(AXIS, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    azimuth = np.arctan2(wi @ np.cross(AXIS, across), wi @ across)
    counts, edges, _ = np.histogram2d(wi @ AXIS, azimuth, bins=(20, 16), range=((-1, 1), (-np.pi, np.pi)))
    nodes, weights = np.polynomial.legendre.leggauss(20)
    middle, half = (edges[1:] + edges[:-1]) / 2, (edges[1:] - edges[:-1]) / 2
    cosines = middle[:, None] + half[:, None] * nodes
    share = (2 * np.pi * phase.eval_hg(g, 1 - cosines) * weights * half[:, None]).sum(axis=1)
    stats.assert_histogram(counts, n * np.repeat(share[:, None] / 16, 16, axis=1))
