"""The law in float64 against 50-digit values and closed forms; its domain and its warnings."""

import math

import numpy as np
import pytest

from fgf_warp.theory import kernels
from fgf_warp.theory.law import build_line_law

TIGHT = 1e-12


def assert_relative(found, expected, bound=TIGHT):
    """Asserts |found / expected - 1| <= bound wherever the expected value is a normal double."""
    found, expected = np.asarray(found), np.asarray(expected)
    usable = np.isfinite(expected) & (np.abs(expected) > 1e-300)
    assert usable.any()
    assert np.abs(found[usable] / expected[usable] - 1).max() <= bound


def test_kernels_at_50_digits(reference):
    t = reference("kernels.csv")
    b, kappa, u = t["b"], t["kappa"], t["u"]
    assert_relative(kernels.log1p_ratio(t["y"]), t["log1p(y)/y"])
    assert_relative(kernels.line_exponent(b, kappa, u), t["f"])
    assert_relative(kernels.line_exponent_d1(b, kappa, u), t["fprime"])
    assert_relative(kernels.line_exponent_d2(b, kappa, u), t["fsecond"])
    assert_relative(kernels.transmittance_ss(b, kappa, u), t["Tr"])
    assert_relative(kernels.density_sm(b, kappa, u), t["minus_dTr"])
    assert np.array_equal(kernels.initial_rate(b, kappa)[b != 0], t["sigma_hat"][b != 0])
    medium = b >= 0
    b, kappa, u = b[medium], kappa[medium], u[medium]
    assert_relative(kernels.transmittance_ms(b, kappa, u), t["T_ms"][medium])
    assert_relative(kernels.density_mm(b, kappa, u), t["p_mm"][medium])


def test_variance_at_50_digits(reference):
    t = reference("variance.csv")
    accepted = t["kappa"] <= 1e8
    assert accepted.sum() > 100
    for i in np.flatnonzero(accepted):
        law = build_line_law(
            hurst=t["H"][i], white_noise_scale=t["S_w"][i], mean_extinction=t["sigma_m"][i], outer_scale=t["L"][i]
        )
        assert law.regime == t["regime"][i]
        assert_relative([law.b, law.kappa, law.variance(t["t"][i])], [t["b"][i], t["kappa"][i], t["v"][i]])
        if t["Tr"][i] > 1e-300:
            u = t["sigma_m"][i] * t["t"][i]
            assert_relative([kernels.transmittance_ss(law.b, law.kappa, u)], [t["Tr"][i]])


def test_kappa_beyond_the_table_is_refused(reference):
    t = reference("variance.csv")
    for i in np.flatnonzero(t["kappa"] > 1e8):
        with pytest.raises(ValueError, match=r"kappa .* accepted: in \[0, 1e\+08\]"):
            build_line_law(
                hurst=t["H"][i], white_noise_scale=t["S_w"][i], mean_extinction=t["sigma_m"][i], outer_scale=t["L"][i]
            )


def test_samplers_at_50_digits(reference):
    t = reference("inverse_cdf.csv")
    within = t["ln_u_sm"] < 700
    found = np.log(kernels.sample_sm(t["b"][within], t["kappa"][within], t["xi"][within]))
    assert np.abs(found - t["ln_u_sm"][within]).max() < 1e-13 * np.abs(t["ln_u_sm"][within]).max()


def test_flights_between_medium_vertices_at_50_digits(reference):
    """Tms(u) = xi, up to a relative rounding of u and an absolute one of Tms."""
    t = reference("inverse_cdf.csv")
    within = np.abs(t["ln_u_mm"]) < 300
    assert within.sum() > 150
    b, kappa, xi, u = t["b"][within], t["kappa"][within], t["xi"][within], np.exp(t["ln_u_mm"][within])
    slope = u * kernels.density_mm(b, kappa, u)
    assert np.all(np.abs(kernels.transmittance_ms(b, kappa, u) - xi) < 1e-12 * slope + 4e-16)


def ln_survival(name: str, b: float, kappa: float, u: np.ndarray) -> np.ndarray:
    """ln of Tss or Tms, of flights that end as ``sm`` and ``mm``; formed so that it does not underflow."""
    shortened = np.log(kernels.line_exponent_d1(b, kappa, u) / kernels.initial_rate(b, kappa)) if name == "mm" else 0.0
    return shortened - kernels.line_exponent(b, kappa, u)


@pytest.mark.parametrize("name", ["sm", "mm"])
def test_moments_at_50_digits(reference, name):
    """The mean of u^n is the integral of n u^(n-1) times the survival, by the trapezoidal rule in ln u."""
    t = reference("moments.csv")
    for column, order in ((f"mean_u_{name}", 1), (f"meansq_u_{name}", 2)):
        finite = np.flatnonzero(np.isfinite(t[column]))
        assert finite.size > 30
        x, found = np.arange(-60.0, 700.0, 1 / 64), []
        for i in finite:
            ln_u_n = order * x + ln_survival(name, t["b"][i], t["kappa"][i], np.exp(x))
            found.append(order * np.exp(ln_u_n).sum() / 64)
        assert_relative(found, t[column][finite], 1e-10)


def test_mean_free_path_at_50_digits(reference):
    t = reference("moments.csv")
    found = np.array([kernels.mean_free_path(b, kappa) for b, kappa in zip(t["b"], t["kappa"], strict=True)])
    assert np.array_equal(np.isinf(found), np.isinf(t["mean_u_sm"]))
    assert_relative(found, t["mean_u_sm"])


def test_white_noise_is_exponential_at_the_line_laws_rate():
    u = np.geomspace(1e-6, 100, 50)
    assert_relative(kernels.transmittance_ss(0.0, 2.0, u), np.exp(-u * math.log(3.0) / 2.0))


def test_fbm_is_a_power_law():
    u = np.geomspace(1e-6, 1e6, 50)
    assert_relative(kernels.transmittance_ss(1.0, 0.5, u), (1 + 0.5 * u) ** -2.0)


@pytest.mark.parametrize("b", [-0.9, -0.3, 0.0, 0.3, 0.7, 1.0])
def test_derivatives_are_those_of_the_exponent(b):
    u = np.geomspace(1e-3, 1e3, 40)
    h = 1e-5 * u
    bound = 1e-6  # of the central difference: h^2 truncation, and 1e-16 / 1e-5 rounding of near-constant slopes

    def slope(function):
        return (function(b, 2.0, u + h) - function(b, 2.0, u - h)) / (2 * h)

    assert_relative(slope(kernels.line_exponent), kernels.line_exponent_d1(b, 2.0, u), bound)
    if b != 0:
        assert_relative(slope(kernels.line_exponent_d1), kernels.line_exponent_d2(b, 2.0, u), bound)


@pytest.mark.parametrize("b", [-0.9, -0.02, 0.02, 0.5, 0.98, 1.0])
def test_flight_inverts_the_exponent(b):
    exponent = np.geomspace(1e-7, 20, 60)
    for kappa in (1e-8, 1e-2, 1.0, 50.0):
        u = kernels.flight_from_exponent(b, kappa, exponent)
        usable = np.isfinite(u) & (u < 1e250)
        assert_relative(kernels.line_exponent(b, kappa, u)[usable], exponent[usable])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (dict(hurst=0.0), r"H = 0; accepted: at least 0.01 away from 0"),
        (dict(hurst=0.995), r"H = 0.995; accepted: at least 0.01 away from 1"),
        (dict(hurst=-0.005), r"H = -0.005; accepted: at least 0.01 away from 0"),
        (dict(hurst=-0.98), r"H = -0.98; accepted: > -0.98"),
        (dict(hurst=-3.0), r"H = -3; accepted: > -0.98"),
        (dict(hurst=math.nan), r"H = nan"),
        (dict(hurst=math.inf), r"H = inf"),
        (dict(white_noise_scale=-1.0), r"S_w = -1; accepted: >= 0"),
        (dict(white_noise_scale=math.inf), r"S_w = inf"),
        (dict(mean_extinction=0.0), r"sigma_m = 0; accepted: > 0"),
        (dict(mean_extinction=-1.0), r"sigma_m = -1; accepted: > 0"),
        (dict(outer_scale=0.0), r"L = 0; accepted: > 0"),
        (dict(hurst=0.3), r"H = 0.3 needs an outer scale L"),
        (dict(kappa=-0.1), r"kappa = -0.1; accepted: in \[0, 1e\+08\]"),
        (dict(kappa=1.1e8), r"kappa = 1.1e\+08; accepted: in \[0, 1e\+08\]"),
        (dict(kappa=math.nan), r"kappa = nan"),
        (dict(white_noise_scale=1e30), r"kappa \(from S_w = 1e\+30, sigma_m = 1, H = -0.25\)"),
    ],
)
def test_domain(changes, message):
    parameters = dict(hurst=-0.25, white_noise_scale=1.0, mean_extinction=1.0) | changes
    with pytest.raises(ValueError, match=message):
        build_line_law(**parameters)


@pytest.mark.parametrize("hurst", [-0.01, 0.01, 0.99, 1.01, 1.99, 2.01, 2.99, 3.01])
def test_the_ends_of_the_domain_belong_to_it(hurst):
    law = build_line_law(hurst=hurst, white_noise_scale=0.1, mean_extinction=1.0, outer_scale=2.0)
    assert law.kappa > 0


def test_no_noise_is_the_exponential_exactly():
    law = build_line_law(hurst=-0.25, white_noise_scale=0.0, mean_extinction=0.0)
    assert (law.regime, law.kappa, law.is_exponential) == ("exponential", 0.0, True)


@pytest.mark.parametrize(
    ("parameters", "lengths", "message"),
    [
        (dict(hurst=-0.495, white_noise_scale=0.1), (), "scattering events cluster"),
        (dict(hurst=0.1, white_noise_scale=0.1, outer_scale=10.0), (1.0,), "not far below the outer scale"),
        (dict(hurst=0.3, white_noise_scale=0.1, outer_scale=1.0), (1.5,), "by 60 to 200 %"),
        (dict(hurst=0.3, white_noise_scale=0.1, outer_scale=1.0, line_variance="exact"), (1.5,), "beyond the outer"),
        (dict(hurst=1.5, white_noise_scale=0.1, outer_scale=1.0), (1.5,), "beyond the outer scale L = 1"),
        (dict(hurst=0.3, white_noise_scale=0.0, kappa=0.5, outer_scale=1.0), (1.5,), "beyond the outer scale L = 1"),
        (dict(hurst=0.3, white_noise_scale=0.0, kappa=0.5), (), "without an outer scale L"),
        (dict(hurst=0.3, white_noise_scale=0.0, kappa=0.5), (1.5,), "without an outer scale L"),
        (dict(hurst=-0.25, white_noise_scale=5.0), (), "modelling choice"),
        (dict(hurst=0.5, kappa=1.0, white_noise_scale=0.0), (), "mean free path is infinite"),
    ],
)
def test_warnings(parameters, lengths, message):
    law = build_line_law(mean_extinction=1.0, **parameters)
    assert [text for text in law.warnings(lengths) if message in text]


def test_media_far_below_their_outer_scale_have_no_warning_of_it():
    for parameters in (dict(white_noise_scale=0.001), dict(white_noise_scale=0.0, kappa=0.5)):
        law = build_line_law(hurst=0.5, mean_extinction=1.0, outer_scale=100.0, **parameters)
        assert not [text for text in law.warnings((1.0,)) if "outer scale" in text]


def test_plain_parameters_warn_of_nothing():
    law = build_line_law(hurst=-0.25, white_noise_scale=0.5, mean_extinction=1.0)
    assert law.warnings((1.0, 100.0)) == []
