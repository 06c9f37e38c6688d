"""Slabs and half-spaces against the tables of the theory: reflectance, transmittance, mean number of collisions."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fgf_warp.renderer import begin, build_model, develop, step
from fgf_warp.settings import Aov, RenderSettings
from tests import stats
from tests.scenes import camera, law_of, slab

RELATIVE_ERROR = 0.002
SETTINGS = RenderSettings(width=32, height=32, spp=1, seed=20, max_depth=100_000, aovs=frozenset({Aov.COLLISIONS}))
QUANTITIES = {"R": (0, None), "T": (1, None), "collisions": (0, Aov.COLLISIONS)}
"""Channel and plane of each."""
INCIDENCES = {"lambert": "lambert", "normal": 1.0}
"""As the tables name them, and as the scene does."""


def measure(scene, quantities):
    """Means of these quantities and their standard errors, each of at most 0.2 % relative; and the render."""
    model = build_model(scene, SETTINGS)
    state = begin(model)
    samples = 512
    while True:
        step(model, state, samples)
        result = develop(model, state)
        picked = [QUANTITIES[quantity] for quantity in quantities]
        means = np.array([stats.image_mean(result, channel, aov=aov) for channel, aov in picked])
        worst = (means[:, 1] / means[:, 0]).max()
        if worst <= RELATIVE_ERROR:
            assert result.truncated_count == 0
            return means, result
        # As many more as the error asks for, and a little over.
        samples = int(state.samples.max() * min(8.0, 1.1 * (worst / RELATIVE_ERROR) ** 2 - 1)) + 64


def check_rows(rows, transport):
    values, errors, expected = [], [], []
    for row, incidence in rows:
        medium = law_of(row["b"], row["kappa"]) | dict(albedo=(row["albedo"],) * 3)
        scene = slab(row["T"], incidence=INCIDENCES[incidence], transport=transport, **medium)
        found, _ = measure(scene, QUANTITIES)
        values += list(found[:, 0])
        errors += list(found[:, 1])
        expected += [row[f"R_{incidence}"], row[f"T_{incidence}_total"], row[f"mean_collisions_{incidence}"]]
    stats.assert_means(values, errors, expected, detects=0.02)


def rows_of(table):
    return [{key: table[key][i] for key in table} for i in range(len(table["albedo"]))]


def some(rows, picked, keys=("T", "b", "kappa", "albedo")):
    """The rows of these values."""
    found = [row for row in rows if tuple(row[key] for key in keys) in picked]
    assert len(found) == len(picked)
    return found


SOME = {(1, 0, 0, 0.9), (1, 0, 1, 0.9), (1, 0.5, 1, 0.9), (4, 0.2, 1, 0.99), (0.2, 0.5, 10, 1), (1, 1, 1, 0.9)}
SOME_RENEWAL = {(1, 0.5, 1, 0.9), (4, 1, 0.1, 0.9), (4, -0.5, 1, 0.9), (1, 0.2, 1, 1)}


def test_reciprocal_lambert(reference):
    rows = some(rows_of(reference("slab_isotropic_reciprocal.csv")), SOME)
    check_rows([(row, "lambert") for row in rows], "reciprocal")


def test_reciprocal_normal(reference):
    rows = some(rows_of(reference("slab_isotropic_reciprocal.csv")), SOME)
    check_rows([(row, "normal") for row in rows], "reciprocal")


def test_renewal_lambert(reference):
    rows = some(rows_of(reference("slab_isotropic_renewal_only.csv")), SOME_RENEWAL)
    check_rows([(row, "lambert") for row in rows], "renewal")


@pytest.mark.slow
def test_every_reciprocal_row(reference):
    rows = rows_of(reference("slab_isotropic_reciprocal.csv"))
    check_rows([(row, incidence) for row in rows for incidence in ("lambert", "normal")], "reciprocal")


@pytest.mark.slow
def test_every_renewal_row(reference):
    rows = rows_of(reference("slab_isotropic_renewal_only.csv"))
    check_rows([(row, "lambert") for row in rows], "renewal")


HALF_SPACE = 1e4
"""A slab so thick. Rounding moves its upper face, which is at z = 0, by 3e-4, and so R by some 0.1 % for small b."""


def check_half_spaces(cases):
    """Of (incidence, law, albedo, reflectance) each."""
    values, errors = [], []
    for incidence, law, albedo, expected in cases:
        scene = slab(HALF_SPACE, incidence=incidence, transport="reciprocal", albedo=(albedo,) * 3, **law)
        found, result = measure(scene, ["R"])
        values.append(found[0, 0])
        errors.append(found[0, 1])
        # What leaves below would have to come back through as much again.
        assert result.radiance[..., 1].mean(dtype=np.float64) ** 2 <= 1e-3 * expected
    stats.assert_means(values, errors, [expected for *_, expected in cases], detects=0.02)


def half_spaces(rows):
    return [
        (INCIDENCES[incidence], law_of(row["b"], row["kappa"]), row["albedo"], row[f"R_{incidence}"])
        for row in rows
        for incidence in INCIDENCES
    ]


def classical_half_spaces(rows):
    return [(row["mu0"], {}, row["albedo"], row["R_plane_albedo"]) for row in rows]


def test_half_space(reference):
    rows = rows_of(reference("halfspace_isotropic.csv"))
    picked = {(0, 0, 0.9), (0, 1, 0.9), (0.2, 1, 0.9), (0.5, 1, 0.99), (1, 1, 0.9)}
    check_half_spaces(half_spaces(some(rows, picked, ("b", "kappa", "albedo"))))


def test_classical_half_space_at_an_angle(reference):
    rows = rows_of(reference("chandrasekhar_H_isotropic.csv"))
    picked = {(0.5, 0.1), (0.9, 0.25), (0.9, 0.5), (0.9, 0.75), (0.3, 1)}
    check_half_spaces(classical_half_spaces(some(rows, picked, ("albedo", "mu0"))))


@pytest.mark.slow
def test_every_half_space(reference):
    check_half_spaces(half_spaces(rows_of(reference("halfspace_isotropic.csv"))))


@pytest.mark.slow
def test_every_classical_half_space(reference):
    check_half_spaces(classical_half_spaces(rows_of(reference("chandrasekhar_H_isotropic.csv"))))


@pytest.mark.parametrize(
    ("transport", "laws"),
    [
        ("reciprocal", [(0, 0), (0, 1), (0.2, 1), (0.5, 10), (0.8, 3), (1, 1)]),
        # For paths that are frozen at a low rate the slab must be thick too.
        ("mixed", [(0.2, 1), (0.5, 1), (0.8, 0.3), (1, 0.1)]),
    ],
)
def test_escape_from_the_boundary_does_not_depend_on_the_law(transport, laws):
    """The camera is on the boundary and looks along it, and so little down that the first collision is at depth 0.

    Of particles that scatter there (1 - sqrt(1 - albedo)) / albedo escape. A depth of 1e-5 would be too much for small
    b, whose correlation falls as u^b; so would be the rounding of a slab that is much thicker.
    """
    along = camera((0, 0, 0), (-1, 0, -1e-20), aperture=1e-21)
    values, errors, expected = [], [], []
    for b, kappa in laws:
        for albedo in (0.5, 0.95):
            scene = slab(100.0, incidence=1.0, transport=transport, albedo=(albedo,) * 3, **law_of(b, kappa))
            found, _ = measure(replace(scene, camera=along), ["R"])
            values.append(found[0, 0])
            errors.append(found[0, 1])
            expected.append(1 - math.sqrt(1 - albedo))
    stats.assert_means(values, errors, expected, detects=0.015)
