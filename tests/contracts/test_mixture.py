"""Transmittances as mixtures of exponentials, and the draws of rates on the device."""

import numpy as np
import pytest

from fgf_warp import probes
from fgf_warp.theory import kernels
from fgf_warp.theory.mixture import RateMixture, fit_rates, mix_rates
from tests import stats

LAWS = [
    (b, kappa)
    for b in (1e-9, 1e-4, 1e-3, 0.02, 0.2, 0.5, 0.98, 1.0)
    for kappa in (1e-8, 1e-4, 1e-2, 0.3, 1.0, 10.0, 1e3, 1e8)
]


def laplace(mixture: RateMixture, u: np.ndarray) -> np.ndarray:
    return np.exp(-np.outer(u, mixture.rates)) @ mixture.weights


@pytest.mark.parametrize(("b", "kappa"), LAWS)
def test_the_mixture_has_the_laws_transmittance(b, kappa):
    mixture = mix_rates(b, kappa)
    assert (mixture.weights > 0).all()
    assert (mixture.rates >= 0).all()
    assert abs(mixture.weights.sum() - 1) < 1e-12
    u = np.geomspace(1e-9, 1e9, 3001)
    assert np.abs(laplace(mixture, u) - kernels.transmittance_ss(b, kappa, u)).max() < (3e-8 if b >= 0.02 else 1e-4)


@pytest.mark.parametrize("kappa", [0.3, 1.0])
def test_for_a_power_law_it_has_the_moments_of_the_gamma_distribution(kappa):
    mixture = mix_rates(1.0, kappa)
    mean = mixture.rates @ mixture.weights
    variance = mixture.rates**2 @ mixture.weights - mean**2
    assert abs(mean - 1) < 1e-5
    assert abs(variance / kappa - 1) < 1e-3


def test_what_is_not_completely_monotone_has_no_mixture():
    """exp(-u^2) is no mean of exponentials, and the error says so."""
    assert fit_rates(lambda u: np.exp(-(u**2)), 5.0).error > 1e-2


def test_rates_are_drawn_as_often_as_their_weights_say():
    """Chi-square on 200,000 draws."""
    mixture = mix_rates(0.5, 1.0)
    xi = np.random.default_rng(3).random(200_000).astype(np.float32)
    drawn = probes.draw_rates(mixture, xi)
    assert set(np.unique(drawn)) <= set(mixture.rates.astype(np.float32))
    counts = [(drawn == rate).sum() for rate in mixture.rates.astype(np.float32)]
    stats.assert_histogram(counts, mixture.weights * xi.size)


def test_the_ends_of_the_table_are_drawn_too():
    mixture = mix_rates(0.5, 1.0)
    drawn = probes.draw_rates(mixture, np.array([mixture.weights[0] / 2, 1 - 2.0**-24]))
    assert drawn[0] == np.float32(mixture.rates[0])
    assert drawn[1] == np.float32(mixture.rates[-1])
