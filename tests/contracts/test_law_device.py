"""The law on the device: the float32 twins against float64 and 50 digits, and the samplers against their cdfs."""

import numpy as np
import pytest

from fgf_warp import probes
from fgf_warp.device import law as device
from fgf_warp.theory import kernels
from tests import stats
from tests.grid import LAWS

U = np.geomspace(1e-8, 1e8, 65).astype(np.float32).astype(np.float64)


def assert_twins(found, expected, exponent):
    for name, (constant, per_exponent) in probes.LAW_BOUNDS.items():
        usable = (
            np.isfinite(expected[name]) & (np.abs(expected[name]) > probes.LAW_ZERO) & (np.abs(expected[name]) < 3e38)
        )
        assert usable.any()
        error = np.abs(found[name][usable] / expected[name][usable] - 1)
        excess = error / (constant + per_exponent * exponent[usable])
        assert excess.max() <= 1, f"{name}: {error[excess.argmax()]:.2e} at {np.flatnonzero(usable)[excess.argmax()]}"
        vanishing = np.abs(expected[name]) <= probes.LAW_ZERO
        assert np.all(np.abs(found[name][vanishing]) <= 2 * probes.LAW_ZERO)


def test_twins_over_the_extremes():
    b, kappa, u = (np.array(column) for column in zip(*[(b, k, u) for b, k in LAWS for u in U], strict=True))
    b, kappa = b.astype(np.float32).astype(np.float64), kappa.astype(np.float32).astype(np.float64)
    found = probes.eval_law(b, kappa, u)
    expected = {name: getattr(kernels, name)(b, kappa, u) for name in list(probes.LAW_BOUNDS)[:5]}
    with np.errstate(invalid="ignore", divide="ignore"):
        for name in list(probes.LAW_BOUNDS)[5:]:
            expected[name] = np.where(b >= 0, getattr(kernels, name)(b, kappa, u), np.nan)
    assert_twins(found, expected, expected["line_exponent"])


def test_device_at_50_digits(reference):
    t = reference("kernels.csv")
    found = probes.eval_law(t["b"], t["kappa"], t["u"])
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
    value, slope = probes.eval_ratios(y)
    assert np.abs(value / kernels.log1p_ratio(y) - 1).max() <= 5e-7
    assert np.abs(slope / kernels.log1p_ratio_slope(y) - 1)[y < 1e18].max() <= 2e-6


def test_flights_start_and_end():
    b, kappa = np.array([law for law in LAWS if law[0] >= 0]).T
    found = probes.eval_law(b, kappa, 0.0)
    assert np.array_equal(found["transmittance_ss"], np.ones(b.size))
    far = probes.eval_law(b, kappa, 1e30)
    assert np.isfinite(far["transmittance_ss"]).all()
    endless = probes.eval_law(*np.array(LAWS).T, np.inf)
    for name in ("transmittance_ss", "density_sm"):
        assert np.array_equal(endless[name], np.zeros(len(LAWS))), name


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
    # In float32, as on the device: near xi3 = b their rounding would be seen.
    b, kappa = (np.tile(np.float32(column), draws).astype(np.float64) for column in zip(*LAWS, strict=True))
    found = probes.sample_law(b, kappa, xi)
    with np.errstate(over="ignore", invalid="ignore"):
        flight = kernels.sample_sm(b, kappa, xi[:, 0])
        correlated = kernels.sample_mm(b, kappa, *xi.T)
    usable = flight < probes.FLIGHT_LONGEST
    error = np.abs(found["sample_sm"][usable] / flight[usable] - 1)
    assert error.max() <= probes.FLIGHT_BOUNDS["sample_sm"][0]
    assert np.median(error) <= 1e-5
    assert np.all(found["sample_sm"][~usable] >= 1e28)
    # Tmm of b = 1 has a closed form of its own; the twin composes it for every b.
    usable = (b >= 0) & (b < 1) & (correlated < probes.FLIGHT_LONGEST) & (correlated > probes.FLIGHT_SHORTEST)
    constant, per_b = probes.FLIGHT_BOUNDS["sample_mm"]
    bound = constant + per_b / np.maximum(b[usable], 1e-30)
    assert np.all(np.abs(found["sample_mm"][usable] / correlated[usable] - 1) <= bound)


def test_flights_at_50_digits(reference):
    t = reference("inverse_cdf.csv")
    found = probes.sample_law(t["b"], t["kappa"], np.repeat(t["xi"][:, None], 3, axis=1))["sample_sm"]
    usable = np.abs(t["ln_u_sm"]) < 60
    assert usable.sum() > 250
    assert np.abs(np.log(found[usable]) - t["ln_u_sm"][usable]).max() <= 1.2e-4


@pytest.mark.slow
@pytest.mark.parametrize("column", [0, 1], ids=["sm", "mm"])
def test_mean_flights_at_50_digits(reference, column):
    """Of the laws whose flights spread by no more than twice their mean; sees a bias of 3 %."""
    t, draws, name = reference("moments.csv"), 200_000, ("sm", "mm")[column]
    mean = t[f"mean_u_{name}"]
    with np.errstate(invalid="ignore"):
        spread = np.sqrt(t[f"meansq_u_{name}"] - mean**2)
    picked = np.flatnonzero(spread <= 2 * mean)
    assert picked.size > 20
    xi = np.clip(np.random.default_rng(11).random((draws, picked.size, 3)), 2.0**-32, 1 - 2.0**-24)
    flights = probes.sample_law(t["b"][picked], t["kappa"][picked], xi)[f"sample_{name}"]
    found = flights.astype(np.float64).mean(axis=0)
    stats.assert_means(found, spread[picked] / np.sqrt(draws), mean[picked], detects=0.03)


def assert_flights(u, survival):
    """Asserts that flights have this survival function: the share of each end, and the shape between them."""
    below, above = 1 - survival(np.array(probes.FLIGHT_SHORTEST)), survival(np.array(probes.FLIGHT_LONGEST))
    counts = [
        np.sum(u <= probes.FLIGHT_SHORTEST),
        np.sum((u > probes.FLIGHT_SHORTEST) & (u < probes.FLIGHT_LONGEST)),
        np.sum(u >= probes.FLIGHT_LONGEST),
    ]
    stats.assert_histogram(counts, u.size * np.array([below, 1 - below - above, above]))
    middle = u[(u > probes.FLIGHT_SHORTEST) & (u < probes.FLIGHT_LONGEST)]
    stats.assert_distributed(middle, lambda x: (1 - survival(x) - below) / (1 - below - above))


@pytest.mark.parametrize("law", [law for law in LAWS if law[1] in (1e-2, 1.0, 10.0, 1e3)], ids=str)
def test_flights_follow_their_cdf(law):
    """Kolmogorov-Smirnov on 40,000 flights: sees a distance of 0.01 between the distributions."""
    b, kappa = law
    xi = np.random.default_rng(7).random((40_000, 3))
    found = probes.sample_law(b, kappa, np.clip(xi, 2.0**-32, 1 - 2.0**-24))
    assert_flights(found["sample_sm"], lambda u: kernels.transmittance_ss(b, kappa, u))
    if b >= 0:
        assert_flights(found["sample_mm"], lambda u: kernels.transmittance_ms(b, kappa, u))
