"""Fractional Brownian motion with the exact variance of finite segments: float64, its twin, and their domain."""

import numpy as np
import pytest

from fgf_warp import probes
from fgf_warp.errors import SceneError
from fgf_warp.scene import Medium
from fgf_warp.theory import fbm
from fgf_warp.theory.fbm import ExactFbm
from fgf_warp.theory.law import build_line_law
from tests import stats
from tests.scenes import furnace

LINES = [
    ExactFbm(hurst, kappa, outer_depth)
    for hurst in (0.011, 0.1, 0.3, 0.5, 0.8, 0.989)
    for kappa in (1e-6, 0.05, 1.0, 30.0, 1e4)
    for outer_depth in (0.1, 10.0, 1e4)
]


def reach(line: ExactFbm) -> float:
    """u up to which the law holds."""
    return fbm.falls_until(line)


def depths(line: ExactFbm) -> np.ndarray:
    """From t/L = 1e-6 to where Tr stops falling, as float32 numbers."""
    return (np.geomspace(1e-6 * line.outer_depth, reach(line), 61)[:-1]).astype(np.float32).astype(np.float64)


def test_variance_at_50_digits(reference):
    t = reference("variance.csv")
    rows = np.flatnonzero((t["regime"] == "fbm") & (t["kappa"] <= 1e8))
    assert rows.size >= 50
    for i in rows:
        law = build_line_law(
            hurst=t["H"][i],
            white_noise_scale=t["S_w"][i],
            mean_extinction=t["sigma_m"][i],
            outer_scale=t["L"][i],
            line_variance="exact",
        )
        assert abs(law.variance(t["t"][i]) / t["v_fbm_exact_eq11"][i] - 1) < 1e-11


def test_the_asymptotic_variance_is_poor_for_small_hurst_exponents():
    """The theory's figure: -17.7 % at H = 0.1, t/L = 0.01."""
    assert abs(1 / float(fbm.variance_ratio(0.1, 0.01)) - 1 / 0.823) < 2e-3


@pytest.mark.parametrize("hurst", [0.1, 0.3, 0.5, 0.8])
def test_the_error_of_the_asymptotic_variance_has_the_corrected_order(hurst):
    """|R - 1| goes as (t/L)^min(1, 2H): the local slope at t/L = 1e-8."""
    tau = np.array([1e-8, 2e-8])
    error = np.abs(fbm.variance_ratio(hurst, tau) - 1)
    assert abs(np.log2(error[1] / error[0]) - min(1, 2 * hurst)) < 0.05


@pytest.mark.parametrize("line", LINES[::4], ids=str)
def test_derivatives_are_those_of_the_exponent(line):
    u = depths(line)[10:]
    h = 1e-5 * u

    def slope(function):
        return (function(line, u + h) - function(line, u - h)) / (2 * h)

    assert np.abs(slope(fbm.line_exponent) / fbm.line_exponent_d1(line, u) - 1).max() < 1e-5
    d2 = fbm.line_exponent_d2(line, u)
    scale = np.abs(d2) + 1e-4 * fbm.line_exponent_d1(line, u) / u
    assert (np.abs(slope(fbm.line_exponent_d1) - d2) / scale).max() < 1e-3


def test_far_below_the_outer_scale_it_is_the_power_law():
    line, u = ExactFbm(0.6, 0.8, 1e9), np.geomspace(1e-3, 100, 20)
    assert np.abs(fbm.eval_kernels(line, u).transmittance_ss * (1 + 0.8 * u) ** (1 / 0.8) - 1).max() < 1e-5


@pytest.mark.parametrize("line", LINES, ids=str)
def test_as_far_as_it_falls_all_kernels_are_densities(line):
    values = fbm.eval_kernels(line, depths(line))
    for kernel in (values.transmittance_ss, values.density_sm, values.transmittance_ms, values.density_mm):
        assert (kernel >= 0).all()
    assert (np.diff(values.transmittance_ss) <= 0).all()
    assert (np.diff(values.transmittance_ms) <= 0).all()


@pytest.mark.parametrize("line", LINES, ids=str)
def test_twin(line):
    """The bounds that `device/fbm.py` states."""
    u = depths(line)
    found = probes.eval_exact_fbm(line, u)
    expected = fbm.eval_kernels(line, u)
    d1, d2 = fbm.line_exponent_d1(line, u), fbm.line_exponent_d2(line, u)
    bounds = probes.EXACT_FBM_BOUNDS
    assert np.abs(found["line_exponent"] / fbm.line_exponent(line, u) - 1).max() <= bounds["line_exponent"][0]
    assert np.abs(found["line_exponent_d1"] / d1 - 1).max() <= bounds["line_exponent_d1"][0]
    d2_error = np.abs(found["line_exponent_d2"] - d2) / np.maximum(np.abs(d2), d1**2)
    assert d2_error.max() <= bounds["line_exponent_d2"][0]
    visible = expected.transmittance_ss > 1e-30
    exponent = fbm.line_exponent(line, u)[visible]
    for name in ("transmittance_ss", "density_sm", "transmittance_ms", "density_mm"):
        constant, per_exponent = bounds[name]
        error = np.abs(found[name][visible] / getattr(expected, name)[visible] - 1)
        assert (error <= constant + per_exponent * exponent).all(), name


@pytest.mark.parametrize("line", LINES, ids=str)
@pytest.mark.parametrize("from_medium", [False, True])
def test_flights(line, from_medium):
    """Against the float64 survival at the flight that the device returns: xi within what the stated error moves it."""
    farthest = reach(line)
    xi = np.clip(np.random.default_rng(5).random(2000), 2.0**-32, 1 - 2.0**-24).astype(np.float32).astype(np.float64)
    u = probes.sample_exact_fbm(line, farthest, xi, from_medium=from_medium).astype(np.float64)
    escaped = u > farthest * 1.001
    values = fbm.eval_kernels(line, np.where(escaped, farthest, u))
    survival = values.transmittance_ms if from_medium else values.transmittance_ss
    density = values.density_mm if from_medium else values.density_sm
    assert (xi[escaped] <= survival[escaped] * (1 + probes.EXACT_FBM_ESCAPE_BOUND)).all()
    met = ~escaped
    assert (u[escaped] >= 1e30).all()
    tolerance = probes.EXACT_FBM_FLIGHT_BOUND * u[met] * density[met] + probes.EXACT_FBM_UNIFORM_BOUND
    assert (np.abs(survival[met] - xi[met]) <= tolerance).all()


@pytest.mark.parametrize("line", [ExactFbm(0.1, 1.0, 10.0), ExactFbm(0.7, 0.2, 10.0)], ids=str)
def test_flights_follow_their_cdf(line):
    xi = np.random.default_rng(11).random(40_000)
    farthest = reach(line)
    for from_medium in (False, True):
        u = probes.sample_exact_fbm(line, farthest, xi, from_medium=from_medium)

        def survival(x, from_medium=from_medium):
            values = fbm.eval_kernels(line, np.minimum(x, farthest))
            return values.transmittance_ms if from_medium else values.transmittance_ss

        end = float(survival(np.array(farthest)))
        stats.assert_histogram([np.sum(u >= 1e30), np.sum(u < 1e30)], u.size * np.array([end, 1 - end]))
        stats.assert_distributed(u[u < 1e30], lambda x, f=survival, end=end: (1 - f(x)) / (1 - end))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (dict(hurst=1.4), "line_variance = 'exact' with H = 1.4; accepted: asymptotic, or exact with H < 1"),
        (dict(outer_scale=None, kappa=0.3), "H = 0.3 needs an outer scale L; accepted: > 0"),
        (dict(line_variance="best"), "line_variance = 'best'; accepted: asymptotic, exact"),
    ],
)
def test_domain(changes, message):
    parameters = dict(mean_extinction=1.0, hurst=0.3, white_noise_scale=0.3, outer_scale=5.0, line_variance="exact")
    with pytest.raises(SceneError) as caught:
        Medium("/m", **parameters | changes)
    assert message in str(caught.value)


@pytest.mark.parametrize("hurst", [-0.5, -0.3, -0.7])
def test_below_zero_both_variances_are_the_same(hurst):
    exact = build_line_law(hurst=hurst, white_noise_scale=0.4, mean_extinction=2.0, line_variance="exact")
    assert exact.exact_fbm is None
    assert exact.longest_segment() == np.inf


def test_a_medium_longer_than_its_law_is_refused():
    """No segment in the unit sphere is longer than 2."""
    scene = dict(hurst=0.8, kappa=2.0, line_variance="exact")
    furnace(outer_scale=40.0, **scene)
    with pytest.raises(SceneError, match=r"/medium: .*holds up to t = .* segments are up to 2 long; accepted: at most"):
        furnace(outer_scale=0.5, **scene)


def test_what_is_no_mixture_of_exponentials_is_not_frozen():
    medium = dict(hurst=0.9, kappa=0.01, outer_scale=1.0, line_variance="exact")
    furnace(transport="reciprocal", **medium)
    with pytest.raises(SceneError, match="no mixture of exponentials has its transmittance"):
        furnace(transport="mixed", **medium)


def test_the_exact_variance_needs_no_warning():
    parameters = dict(hurst=0.1, white_noise_scale=0.1, mean_extinction=1.0, outer_scale=10.0)
    assert any("outer scale" in text for text in build_line_law(**parameters).warnings((1.0,)))
    assert build_line_law(line_variance="exact", **parameters).warnings((1.0,)) == []
