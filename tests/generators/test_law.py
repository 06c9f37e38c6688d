import numpy as np
import pytest

from fgf_warp.errors import ConfigError
from fgf_warp.theory import kernels
from fgf_warp.theory.law import build_line_law
from generators.law import evaluate_law

CASES = [
    (-0.7, 0.3, 1.5, None),
    (-0.5, 1.0, 2.0, None),
    (-0.25, 1.0, 2.0, None),
    (-0.05, 10.0, 0.5, None),
    (0.3, 0.1, 1.0, 100.0),
    (1.4, 0.1, 1.0, 2.0),
    (-0.25, 0.0, 2.0, None),
]


@pytest.mark.parametrize(("hurst", "s_w", "sigma_m", "outer"), CASES)
def test_numbers_are_those_of_the_theory(hurst, s_w, sigma_m, outer):
    t = [0.01, 0.5, 3.0]
    found = evaluate_law(hurst=hurst, white_noise_scale=s_w, mean_extinction=sigma_m, outer_scale=outer, lengths=t)
    law = build_line_law(hurst=hurst, white_noise_scale=s_w, mean_extinction=sigma_m, outer_scale=outer)
    u = sigma_m * np.array(t)
    assert (found["regime"], found["b"], found["kappa"], found["t"]) == (law.regime, law.b, law.kappa, t)
    np.testing.assert_allclose(found["transmittance"], kernels.transmittance_ss(law.b, law.kappa, u), rtol=1e-15)
    np.testing.assert_allclose(found["free_flight_pdf"], sigma_m * kernels.density_sm(law.b, law.kappa, u), rtol=1e-15)
    mean = kernels.mean_free_path(law.b, law.kappa) / sigma_m
    assert found["mean_free_path"] == (pytest.approx(mean, rel=1e-15) if np.isfinite(mean) else None)


def test_density_is_per_unit_length():
    t = np.linspace(0.0, 20.0, 200001)
    found = evaluate_law(hurst=-0.25, white_noise_scale=1.0, mean_extinction=2.0, lengths=t)
    density = np.array(found["free_flight_pdf"])
    # The trapezoidal rule's error at this step is below 1e-4, of which most stems from the steep start.
    assert np.trapezoid(density, t) == pytest.approx(1.0 - found["transmittance"][-1], abs=1e-4)
    assert np.trapezoid(density * t, t) == pytest.approx(found["mean_free_path"], rel=1e-4)


@pytest.mark.parametrize(("hurst", "slope"), [(-0.7, 0.0), (-0.5, 2.0 * np.log1p(0.5) / 0.5), (-0.25, 2.0)])
def test_limits_at_zero_length(hurst, slope):
    found = evaluate_law(hurst=hurst, white_noise_scale=1.0, mean_extinction=2.0, lengths=[0.0])
    assert found["transmittance"] == [1.0]
    assert found["free_flight_pdf"] == [pytest.approx(slope, rel=1e-15)]


def test_infinite_mean_free_path_is_none():
    found = evaluate_law(hurst=0.5, white_noise_scale=None, kappa=1.0, mean_extinction=1.0, outer_scale=1e9)
    assert found["mean_free_path"] is None
    assert any("mean free path is infinite" in warning for warning in found["warnings"])


def test_kappa_beside_s_w_is_said():
    found = evaluate_law(hurst=-0.25, white_noise_scale=1.0, kappa=0.5, mean_extinction=1.0)
    assert found["kappa"] == 0.5
    assert "kappa = 0.5 takes the place of S_w = 1" in found["warnings"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"hurst": 0.0}, "H = 0; accepted"),
        ({"white_noise_scale": -1.0}, "S_w = -1; accepted"),
        ({"white_noise_scale": None}, "S_w or kappa is needed"),
        ({"mean_extinction": 0.0}, "sigma_m = 0; accepted"),
        ({"hurst": 0.5}, "needs an outer scale L"),
        ({"lengths": [1.0, -1.0]}, "t = -1; accepted"),
        ({"lengths": [float("inf")]}, "t = inf; accepted"),
        ({"mean_extinction": 0.0, "white_noise_scale": 0.0}, "say at which t"),
    ],
)
def test_input_out_of_the_domain_is_refused(changes, message):
    with pytest.raises(ConfigError, match=message):
        evaluate_law(**({"hurst": -0.25, "white_noise_scale": 1.0, "mean_extinction": 1.0} | changes))
