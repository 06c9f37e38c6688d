"""Phase functions, theory and device, at their extremes: normalised, mean cosine, sampler against density, limits."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
import pytest

from fgf_warp import probes
from fgf_warp.scene import PHASE_FUNCTIONS
from fgf_warp.theory import phase
from tests import stats
from tests.grid import ASYMMETRIES

AXIS = np.array([0.48, -0.6, 0.64])
ALPHAS = (0.0, 1e-3, 1.0, 30.0, 1e3)
WEIGHTS = (0.0, 1e-6, 0.3, 0.5, 0.9, 1.0)


@dataclass(frozen=True)
class Contract:
    """What a phase function has to keep.

    Args:
        value: in float64 at 1 - cos(theta), which is named ``v``, with its parameters.
        mean_cosine: of its parameters, in closed form.
        grid: sets of parameters, extremes among them.
    """

    value: Callable[..., np.ndarray]
    mean_cosine: Callable[..., float]
    grid: tuple[dict[str, float], ...]


CONTRACTS = {
    "isotropic": Contract(lambda v: np.full_like(v, 1 / (4 * np.pi)), lambda: 0.0, ({},)),
    "hg": Contract(
        lambda v, asymmetry: phase.eval_hg(asymmetry, v),
        lambda asymmetry: asymmetry,
        tuple({"asymmetry": g} for g in ASYMMETRIES),
    ),
    "two_lobe": Contract(
        lambda v, asymmetry, back_asymmetry, back_weight: phase.eval_two_lobe(
            asymmetry, back_asymmetry, back_weight, v
        ),
        lambda asymmetry, back_asymmetry, back_weight: (1 - back_weight) * asymmetry + back_weight * back_asymmetry,
        tuple(
            {"asymmetry": g, "back_asymmetry": back, "back_weight": weight}
            for (g, back), weight in product(((0.8, -0.4), (0.9999, -0.9999), (-1e-7, 0.99)), WEIGHTS)
        ),
    ),
    "draine": Contract(
        lambda v, asymmetry, draine_alpha: phase.eval_draine(asymmetry, draine_alpha, v),
        lambda asymmetry, draine_alpha: (
            asymmetry
            * (1 + draine_alpha * (3 + 2 * asymmetry**2) / 5)
            / (1 + draine_alpha * (1 + 2 * asymmetry**2) / 3)
        ),
        tuple({"asymmetry": g, "draine_alpha": alpha} for g, alpha in product(ASYMMETRIES, ALPHAS)),
    ),
}
CASES = [
    pytest.param(
        kind, {name: float(np.float32(value)) for name, value in parameters.items()}, id=f"{kind} {parameters}"
    )
    for kind, contract in CONTRACTS.items()
    for parameters in contract.grid
]
EVERY_CASE = pytest.mark.parametrize(("kind", "parameters"), CASES)

FROM_AN_END = np.geomspace(1e-13, 1, 1500)
EDGES = np.concatenate([[0], FROM_AN_END, 2 - FROM_AN_END[-2::-1], [2]])
"""Of 1 - cos(theta), close at both ends, where the peaks are."""


def shares(kind, parameters) -> tuple[np.ndarray, np.ndarray]:
    """What the float64 density scatters between the edges, by quadrature, and the integral of cos over it."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    middle, half = (EDGES[1:] + EDGES[:-1])[:, None] / 2, np.diff(EDGES)[:, None] / 2
    v = middle + half * nodes
    density = 2 * np.pi * CONTRACTS[kind].value(v, **parameters) * weights * half
    return density.sum(axis=1), (density * (1 - v)).sum(axis=1)


def cdf(kind, parameters, v) -> np.ndarray:
    """Share that is scattered to angles of less than these 1 - cos(theta)."""
    return np.interp(v, EDGES, np.concatenate([[0], np.cumsum(shares(kind, parameters)[0])]))


def directions(one_minus_cos):
    """Unit vectors, float64, at these angles from AXIS."""
    across = np.cross(AXIS, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    sine = np.sqrt(one_minus_cos * (2 - one_minus_cos))
    return AXIS * (1 - one_minus_cos)[:, None] + across * sine[:, None]


def sample(kinds, parameters, n=100_000, seed=3) -> np.ndarray:
    """The device's directions, of a kernel that is built for these kinds."""
    xi = np.random.default_rng(seed).random((n, 2)).astype(np.float32)
    return probes.sample_phase(kinds, parameters, AXIS, xi).astype(np.float64)


@cache
def uniforms() -> np.ndarray:
    """Numbers in (0, 1), float32, that come close to both ends."""
    low = np.geomspace(1.2e-10, 0.5, 2000)
    return np.unique(
        np.concatenate([low, 1 - low, np.linspace(1e-3, 1, 5000)[:-1]]).astype(np.float32).clip(0, 1 - 6e-8)
    )


def test_every_phase_function_is_here():
    assert tuple(CONTRACTS) == PHASE_FUNCTIONS


@EVERY_CASE
def test_normalised_with_its_mean_cosine(kind, parameters):
    """Of the float64 twin, by quadrature."""
    share, cosine = shares(kind, parameters)
    assert abs(share.sum() - 1) < 1e-9
    assert abs(cosine.sum() - CONTRACTS[kind].mean_cosine(**parameters)) < 1e-9


@EVERY_CASE
def test_eval_twin(kind, parameters):
    v = np.concatenate([[0.0], np.geomspace(1e-9, 1.0, 300), 2 - np.geomspace(1e-9, 1.0, 300), [2.0]])
    expected = CONTRACTS[kind].value(v, **parameters)
    # Directions are float32 themselves: beside the function's own bound, an angle off by 3e-7 moves the value.
    angle = 2 * np.arcsin(np.sqrt(v / 2))
    nearby = [CONTRACTS[kind].value(2 * np.sin((angle + d) / 2) ** 2, **parameters) for d in (-3e-7, 3e-7)]
    allowed = probes.HG_BOUND * expected + np.abs(nearby - expected).max(axis=0)
    assert np.all(np.abs(probes.eval_phase({kind}, parameters, AXIS, directions(v)) - expected) <= allowed)


@EVERY_CASE
def test_sampler_follows_the_density(kind, parameters):
    """100,000 directions: a distance of 0.006 between the cosine's cdfs, and chi-square in both angles."""
    wi = sample({kind}, parameters)
    ahead, behind = (0.5 * ((wi - sign * AXIS.astype(np.float32)) ** 2).sum(axis=1) for sign in (1, -1))
    v = np.where(ahead < 1, ahead, 2 - behind)
    stats.assert_distributed(v, lambda x: cdf(kind, parameters, x))
    across = np.cross(AXIS, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    azimuth = np.arctan2(wi @ np.cross(AXIS, across), wi @ across)
    counts, edges, _ = np.histogram2d(v, azimuth, bins=(20, 16), range=((0, 2), (-np.pi, np.pi)))
    share = np.diff(cdf(kind, parameters, edges))
    stats.assert_histogram(counts, len(wi) * np.repeat(share[:, None] / 16, 16, axis=1))


@EVERY_CASE
def test_a_kernel_of_all_kinds_scatters_alike(kind, parameters):
    """What other media of the scene need changes nothing but roundings, which a sharp peak magnifies."""
    wi = directions(np.linspace(0, 2, 50))
    alone, together = (probes.eval_phase(kinds, parameters, AXIS, wi) for kinds in ({kind}, PHASE_FUNCTIONS))
    assert np.allclose(together, alone, rtol=1e-6)
    if max(abs(parameters.get(name, 0)) for name in ("asymmetry", "back_asymmetry")) <= 0.8:
        alone, together = (sample(kinds, parameters, 2000) for kinds in ({kind}, PHASE_FUNCTIONS))
        assert np.abs(together - alone).max() <= 1e-4


@pytest.mark.parametrize("g", [abs(g) for g in ASYMMETRIES])
def test_sample_hg_twin(g):
    g, xi = float(np.float32(g)), uniforms()
    found = probes.sample_hg_one_minus_cos(g, xi)
    assert np.abs(found / phase.sample_hg_one_minus_cos(g, xi) - 1).max() <= probes.HG_COSINE_BOUND


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("g", [abs(g) for g in ASYMMETRIES] + [0.2, 0.7, 1 - 2**-24])
def test_sample_draine_twin(g, alpha):
    """The error in the angle is stated, and measured here, as what lies between the two angles."""
    g, alpha, xi = float(np.float32(g)), float(np.float32(alpha)), uniforms()
    found = probes.sample_draine_one_minus_cos(g, alpha, xi)
    assert np.all((found >= 0) & (found <= 2))
    if g > 0.9999:
        return
    expected = phase.sample_draine_one_minus_cos(g, alpha, xi)
    between = np.abs(found - expected) * 2 * np.pi * phase.eval_draine(g, alpha, expected)
    assert between.max() <= probes.DRAINE_BOUND
    assert (between / xi)[expected < 1].max() <= probes.DRAINE_FORWARD_BOUND


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("g", [0.0, 1e-7, 0.5, 0.99])
def test_draines_sampler_inverts_its_density(g, alpha):
    """Of the float64 twin: closed form and Newton's steps against quadrature."""
    inner = EDGES[100:-100:10]
    below = cdf("draine", {"asymmetry": g, "draine_alpha": alpha}, inner)
    found = phase.sample_draine_one_minus_cos(g, alpha, below)
    between = np.abs(found - inner) * 2 * np.pi * phase.eval_draine(g, alpha, inner)
    assert (between / np.minimum(below, 1)).max() <= 1e-9


@pytest.mark.parametrize("weight", WEIGHTS)
def test_choose_lobe_twin(weight):
    """The device's number may lie on the other side of the limit where it is within its rounding."""
    weight, xi = float(np.float32(weight)), uniforms()
    lobe, place = probes.choose_lobe(weight, xi)
    expected_lobe, expected_place = phase.choose_lobe(0.0, 1.0, weight, xi)
    clear = np.abs(xi - min(weight, 1 - weight)) > 1e-7
    assert np.array_equal(lobe[clear], expected_lobe[clear])
    assert np.abs(place - expected_place)[clear].max() <= probes.LOBE_BOUND


@pytest.mark.parametrize("weight", [1e-6, 1 - 1e-6])
def test_the_rarer_lobe_keeps_its_digits(weight):
    """Numbers 2^-32 apart, as the generator makes them, are different places in the lobe."""
    xi = (np.arange(1, 4000) * 2.0**-32).astype(np.float32)
    lobe, place = probes.choose_lobe(weight, xi)
    assert np.all(lobe == (weight < 0.5))
    assert np.all(np.diff(place) > 2e-4)


LIMITS = [
    pytest.param("hg", {"asymmetry": 0.0}, "isotropic", {}, id="hg g = 0"),
    pytest.param(
        "two_lobe",
        {"asymmetry": 0.7, "back_asymmetry": -0.4, "back_weight": 0.0},
        "hg",
        {"asymmetry": 0.7},
        id="two_lobe of the first",
    ),
    pytest.param(
        "two_lobe",
        {"asymmetry": 0.7, "back_asymmetry": -0.4, "back_weight": 1.0},
        "hg",
        {"asymmetry": -0.4},
        id="two_lobe of the second",
    ),
    pytest.param("draine", {"asymmetry": -0.6, "draine_alpha": 0.0}, "hg", {"asymmetry": -0.6}, id="draine alpha = 0"),
]


@pytest.mark.parametrize(("kind", "parameters", "limit", "limit_parameters"), LIMITS)
def test_limits(kind, parameters, limit, limit_parameters):
    """The same values, and the same directions from the same numbers."""
    wi = directions(np.linspace(0, 2, 50))
    found, expected = (
        probes.eval_phase({one}, own, AXIS, wi) for one, own in ((kind, parameters), (limit, limit_parameters))
    )
    assert np.allclose(found, expected, rtol=1e-6)
    found, expected = sample({kind}, parameters, 5000), sample({limit}, limit_parameters, 5000)
    assert np.abs(found - expected).max() <= 1e-5


def test_draine_at_its_limit_is_rayleigh():
    v = np.linspace(0, 2, 50)
    expected = 3 / (16 * np.pi) * (1 + (1 - v) ** 2)
    assert np.allclose(phase.eval_draine(0.0, 1.0, v), expected, rtol=1e-14)
    found = probes.eval_phase({"draine"}, {"draine_alpha": 1.0}, AXIS, directions(v))
    assert np.allclose(found, expected, rtol=1e-6)
