"""The law on the device: the float32 twins against float64 and 50 digits, and the samplers against their cdfs."""

import numpy as np
import pytest

from fgf_warp.device import law as device
from fgf_warp.theory import kernels
from tests import stats
from tests.contracts import device_kernels
from tests.grid import LAWS

U = np.geomspace(1e-8, 1e8, 65).astype(np.float32).astype(np.float64)
BOUNDS = {
    "line_exponent": (1e-5, 0.0),
    "line_exponent_d1": (1e-5, 0.0),
    "line_exponent_d2": (2e-5, 0.0),
    "transmittance_ss": (1e-6, 1e-5),
    "density_sm": (1e-5, 1e-5),
    "transmittance_ms": (1e-5, 1e-5),
    "density_mm": (2e-5, 1e-5),
}
"""The bounds that the docstrings state: relative error below c + d f(u)."""
NORMAL = 2e-38
"""Smaller values lose digits in float32, and count as zero."""


def assert_twins(found, expected, exponent):
    for name, (constant, per_exponent) in BOUNDS.items():
        usable = np.isfinite(expected[name]) & (np.abs(expected[name]) > NORMAL) & (np.abs(expected[name]) < 3e38)
        assert usable.any()
        error = np.abs(found[name][usable] / expected[name][usable] - 1)
        excess = error / (constant + per_exponent * exponent[usable])
        assert excess.max() <= 1, f"{name}: {error[excess.argmax()]:.2e} at {np.flatnonzero(usable)[excess.argmax()]}"
        vanishing = np.abs(expected[name]) <= NORMAL
        assert np.all(np.abs(found[name][vanishing]) <= 2 * NORMAL)


def test_twins_over_the_extremes():
    b, kappa, u = (np.array(column) for column in zip(*[(b, k, u) for b, k in LAWS for u in U], strict=True))
    b, kappa = b.astype(np.float32).astype(np.float64), kappa.astype(np.float32).astype(np.float64)
    found = device_kernels.eval_law(list(zip(b, kappa, strict=True)), u)
    expected = {name: getattr(kernels, name)(b, kappa, u) for name in device_kernels.LAW_FUNCTIONS[:5]}
    with np.errstate(invalid="ignore", divide="ignore"):
        for name in device_kernels.LAW_FUNCTIONS[5:]:
            expected[name] = np.where(b >= 0, getattr(kernels, name)(b, kappa, u), np.nan)
    assert_twins(found, expected, expected["line_exponent"])


def test_device_at_50_digits(reference):
    t = reference("kernels.csv")
    found = device_kernels.eval_law(list(zip(t["b"], t["kappa"], strict=True)), t["u"])
    expected = {
        "line_exponent": t["f"],
        "line_exponent_d1": t["fprime"],
        "line_exponent_d2": t["fsecond"],
        "transmittance_ss": t["Tr"],
        "density_sm": t["minus_dTr"],
        "transmittance_ms": t["T_ms"],
        "density_mm": t["p_mm"],
    }
    assert_twins(found, expected, t["f"])


def test_ratios():
    y = np.concatenate([np.geomspace(1e-12, 1e30, 2000), [0.0, 0.9999999, 1.0, 1.0000001]])
    y = y.astype(np.float32).astype(np.float64)
    value, slope = device_kernels.eval_ratios(y)
    assert np.abs(value / kernels.log1p_ratio(y) - 1).max() <= 5e-7
    assert np.abs(slope / kernels.log1p_ratio_slope(y) - 1)[y < 1e18].max() <= 2e-6


def test_flights_start_and_end():
    laws = [(b, kappa) for b, kappa in LAWS if b >= 0]
    found = device_kernels.eval_law(laws, np.zeros(len(laws)))
    assert np.array_equal(found["transmittance_ss"], np.ones(len(laws)))
    far = device_kernels.eval_law(laws, np.full(len(laws), 1e30))
    assert np.isfinite(far["transmittance_ss"]).all()


def test_fit_of_flights():
    """Over all q that can occur, and b close to its ends, beside a flight that has escaped: the stated bound."""
    q = np.linspace(-40, kernels.FIT_LARGEST_Q, 4001)
    for b in (-0.979, -0.5, -0.01, 0.01, 0.2, 0.5, 0.75, 0.9, 0.95, 0.97, 0.99):
        fit, a = kernels.fit_flight(b), 1 - b
        assert fit.coefficients.shape == (int(device.FIT_DEGREE) + 1,)
        guess = np.logaddexp(0, np.log(a / 2) + q)
        t = np.minimum(fit.scale * guess / (guess + fit.bend) - 1, 1)
        expected = kernels.flight_log_ratio(b, q)[0]
        error = np.abs(np.polynomial.polynomial.polyval(t, fit.coefficients) * guess - expected)[expected < 86]
        assert error.max() <= (1e-4 if b > 0.95 else 4e-5)


def test_sampler_twins():
    """A flight and its float64 twin from the same numbers, over the extremes: the stated bound of the fit."""
    rng = np.random.default_rng(1)
    draws = 400
    xi = rng.random((draws * len(LAWS), 3)).astype(np.float32).astype(np.float64)
    xi = np.clip(xi, 2.0**-32, 1 - 2.0**-24)
    found = device_kernels.sample_law(LAWS, xi)
    b, kappa = (np.tile(column, draws) for column in zip(*LAWS, strict=True))
    with np.errstate(over="ignore", invalid="ignore"):
        flight = kernels.sample_sm(b, kappa, xi[:, 0])
        correlated = kernels.sample_mm(b, kappa, *xi.T)
    usable = flight < 1e29
    assert np.abs(found[0] / flight - 1)[usable].max() <= 1.2e-4
    assert np.median(np.abs(found[0] / flight - 1)[usable]) <= 1e-5
    assert np.all(found[0][~usable] >= 1e28)
    # Tmm of b = 1 has a closed form of its own; the twin composes it for every b.
    usable = (b >= 0) & (b < 1) & (correlated < 1e29) & (correlated > 1e-30)
    assert np.abs(found[1] / correlated - 1)[usable].max() <= 5e-4


def test_flights_at_50_digits(reference):
    t = reference("inverse_cdf.csv")
    pairs = list(zip(t["b"], t["kappa"], strict=True))
    found = device_kernels.sample_law(pairs, np.repeat(t["xi"][:, None], 3, axis=1))[0]
    usable = np.abs(t["ln_u_sm"]) < 60
    assert usable.sum() > 250
    assert np.abs(np.log(found[usable]) - t["ln_u_sm"][usable]).max() <= 1.2e-4


@pytest.mark.parametrize("column", [0, 1], ids=["sm", "mm"])
def test_mean_flights_at_50_digits(reference, column):
    """Of the laws whose flights spread by no more than twice their mean; sees a bias of 3 %."""
    t, draws, name = reference("moments.csv"), 200_000, ("sm", "mm")[column]
    mean = t[f"mean_u_{name}"]
    with np.errstate(invalid="ignore"):
        spread = np.sqrt(t[f"meansq_u_{name}"] - mean**2)
    picked = np.flatnonzero(spread <= 2 * mean)
    assert picked.size > 20
    laws = list(zip(t["b"][picked], t["kappa"][picked], strict=True))
    xi = np.random.default_rng(11).random((draws * len(laws), 3))
    flights = device_kernels.sample_law(laws, np.clip(xi, 2.0**-32, 1 - 2.0**-24))[column]
    found = flights.astype(np.float64).reshape(draws, len(laws)).mean(axis=0)
    stats.assert_means(found, spread[picked] / np.sqrt(draws), mean[picked], detects=0.03)


SHORTEST, LONGEST = 1e-30, 1e29
"""Flights beyond are zero or escaped in float32: legitimate, and counted rather than resolved."""


def assert_flights(u, survival):
    """Asserts that flights have this survival function: the share of each end, and the shape between them."""
    below, above = 1 - survival(np.array(SHORTEST)), survival(np.array(LONGEST))
    counts = [np.sum(u <= SHORTEST), np.sum((u > SHORTEST) & (u < LONGEST)), np.sum(u >= LONGEST)]
    stats.assert_histogram(counts, u.size * np.array([below, 1 - below - above, above]))
    middle = u[(u > SHORTEST) & (u < LONGEST)]
    stats.assert_distributed(middle, lambda x: (1 - survival(x) - below) / (1 - below - above))


@pytest.mark.parametrize("law", [law for law in LAWS if law[1] in (1e-2, 1.0, 10.0, 1e3)], ids=str)
def test_flights_follow_their_cdf(law):
    """Kolmogorov-Smirnov on 40,000 flights: sees a distance of 0.01 between the distributions."""
    b, kappa = law
    xi = np.random.default_rng(7).random((40_000, 3))
    u_sm, u_mm = device_kernels.sample_law([law], np.clip(xi, 2.0**-32, 1 - 2.0**-24))
    assert_flights(u_sm, lambda u: kernels.transmittance_ss(b, kappa, u))
    if b >= 0:
        assert_flights(u_mm, lambda u: kernels.transmittance_ms(b, kappa, u))
