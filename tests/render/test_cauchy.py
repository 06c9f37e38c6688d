"""Cauchy's invariants: mean path length and mean number of collisions in convex bodies under isotropic illumination.

Where nothing is absorbed, the path length is 4 V / S and the number of collisions sigma_hat 4 V / S on the mean,
sigma_hat = -Tr'(0), whatever the law and the phase function; by a reciprocal transport (Bitterli et al. 2018).
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from fgf_warp.renderer import render
from fgf_warp.scene import Solid
from fgf_warp.settings import Aov, RenderSettings
from fgf_warp.theory import kernels
from tests import stats
from tests.scenes import camera, furnace, law_of

PLANES = (Aov.PATH_LENGTH, Aov.COLLISIONS)
SETTINGS = RenderSettings(width=32, height=32, spp=1024, max_depth=2**24, aovs=frozenset(PLANES))
DISTANCE = 100.0
"""Of the camera; rays that are not quite parallel change what follows by 1e-4."""
ANGLES = 8
"""Nodes of the quadrature over directions; the integrand is smooth."""
CASES = [
    dict(mean_extinction=sigma_m, asymmetry=g, **law_of(b, kappa))
    for b, kappa, sigma_m, g in (
        (0.0, 0.0, 2.5, 0.5),
        (0.0, 1.0, 2.5, 0.0),
        (0.0, 10.0, 10.0, -0.7),
        (0.2, 1.0, 2.5, 0.8),
        (0.2, 10.0, 2.5, 0.0),
        (0.5, 0.1, 5.0, 0.3),
        (0.5, 1.0, 2.5, -0.5),
        (0.5, 10.0, 10.0, 0.0),
        (0.8, 3.0, 2.5, 0.9),
        (1.0, 0.1, 5.0, 0.0),
        (1.0, 1.0, 2.5, 0.8),
        (1.0, 3.0, 2.5, -0.3),
    )
]


RECIPROCAL = [
    ("reciprocal", CASES),
    # For 0 < b < 1 the rates of frozen paths have no variance, nor have their numbers of collisions; here it is kappa.
    ("mixed", [case for case in CASES if case["hurst"] == 0.5 and case["kappa"] <= 1]),
]


def seen_through_a_window(scene, shape, radius, settings):
    """Both planes of a body at the origin, integrated over a window that holds it, and their standard errors, (2, 2).

    The body is within `radius`. For 1 in place of a plane the integral would be the area that it shows.
    """
    half = radius / math.sqrt(DISTANCE**2 - radius**2)
    view = camera((0, 0, DISTANCE), (0, 0, 0), aperture=2 * half)
    scene = replace(scene, shapes=(shape,), camera=view)
    pair = [render(scene, replace(settings, seed=2 * settings.seed + k)) for k in (0, 1)]
    assert not any(result.truncated_count for result in pair)
    window = (2 * DISTANCE * half) ** 2
    return window * np.array([stats.plane_mean(*(result.aovs[plane][..., 0] for result in pair)) for plane in PLANES])


def check_invariants(measure, transport, cases, mean_chord):
    """Asserts both for every case, as one family."""
    found, expected = [], []
    for k, case in enumerate(cases):
        medium = dict(transport=transport, **case)
        law = furnace(**medium).media[0].line_law
        means = measure(medium, replace(SETTINGS, seed=k))
        rates = (1.0, float(kernels.initial_rate(law.b, law.kappa)) * case["mean_extinction"])
        found.append(means)
        expected.extend(mean_chord * rate for rate in rates)
    found = np.concatenate(found)
    stats.assert_means(found[:, 0], found[:, 1], expected, detects=0.01)


def mean_in_sphere(medium, settings=SETTINGS):
    """The planes of a parallel beam over the disc of the unit sphere, which is isotropic illumination by symmetry."""
    ball = Solid("/ball", "sphere", np.eye(4), medium=0)
    return seen_through_a_window(furnace(**medium), ball, 1.0, settings) / math.pi


def mean_in_cylinder(radius, half_height, medium, settings):
    """The same of beams from all directions, by a quadrature over the angle to the cylinder's axis."""
    nodes, weights = np.polynomial.legendre.leggauss(ANGLES)
    total, variance, area = np.zeros(2), np.zeros(2), 0.0
    for k, (angle, weight) in enumerate(zip(math.pi / 4 * (nodes + 1), math.pi / 4 * weights, strict=True)):
        matrix = np.eye(4)
        tilt = [[1, 0, 0], [0, math.cos(angle), -math.sin(angle)], [0, math.sin(angle), math.cos(angle)]]
        matrix[:3, :3] = np.array(tilt) @ np.diag([radius, radius, half_height])
        can = Solid("/can", "cylinder", matrix, medium=0)
        own = replace(settings, spp=settings.spp // ANGLES, seed=ANGLES * settings.seed + k)
        shown = seen_through_a_window(furnace(**medium), can, math.hypot(radius, half_height), own)
        share = weight * math.sin(angle)
        total += share * shown[:, 0]
        variance += (share * shown[:, 1]) ** 2
        area += share * (math.pi * radius**2 * math.cos(angle) + 4 * radius * half_height * math.sin(angle))
    return np.column_stack([total, np.sqrt(variance)]) / area


@pytest.mark.parametrize(("transport", "cases"), RECIPROCAL, ids=["reciprocal", "mixed"])
def test_sphere(transport, cases):
    check_invariants(mean_in_sphere, transport, cases, 4 / 3)


def check_cylinder(transport, cases):
    radius, half_height = 1.0, 0.4
    measure = partial(mean_in_cylinder, radius, half_height)
    check_invariants(measure, transport, cases, 4 * radius * half_height / (radius + 2 * half_height))


@pytest.mark.parametrize(("transport", "cases"), RECIPROCAL, ids=["reciprocal", "mixed"])
def test_cylinder(transport, cases):
    check_cylinder(transport, cases[::5])


@pytest.mark.slow
@pytest.mark.parametrize(("transport", "cases"), RECIPROCAL, ids=["reciprocal", "mixed"])
def test_cylinder_of_every_law(transport, cases):
    check_cylinder(transport, cases)


def test_a_renewal_collides_less_often():
    """Its free flights start anew at each collision, and are longer than between the collisions of one realisation."""
    medium = dict(transport="renewal", mean_extinction=2.5, **law_of(0.5, 10.0))
    (_, (collisions, error)), expected = mean_in_sphere(medium), 4 / 3 * 2.5
    assert collisions < expected - 100 * error
