"""Helmholtz reciprocity: light and camera exchanged, over and under two layers of different media.

The mean of radiance over the cosine and irradiance of the light, f(mu_camera, mu_light), must not change when both are
exchanged. The memory of reciprocal flights is the same in both directions (d'Eon 2018); that of a renewal is not.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from fgf_warp.renderer import render
from fgf_warp.scene import DistantLight, Medium, Scene, Solid
from fgf_warp.settings import RenderSettings
from fgf_warp.theory import kernels
from tests import stats
from tests.scenes import WIDE, camera, law_of, transform

SETTINGS = RenderSettings(width=32, height=32, spp=256, max_depth=100_000)
TRANSPORTS = ("reciprocal", "mixed")
"""Those that are reciprocal."""
STEEP, SLANT = 0.9, 0.25
"""Cosines; below 0 on the lower side of the layers."""
THICKNESSES = (1.0, 2.0)
LAWS = [((0.5, 10.0), (0.2, 1.0)), ((1.0, 3.0), (0.5, 1.0)), ((0.0, 1.0), (0.8, 3.0))]
"""(b, kappa) of the upper layer and the lower one."""


def towards(cosine):
    """The direction whose z is this."""
    return np.array([math.sqrt(1 - cosine**2), 0.0, cosine])


def seen(media, *, camera_at, light_at, seed, **settings):
    """f of the layers, upper and lower, each side given by its cosine; and its standard error."""
    layers, z = [], THICKNESSES[0]
    for k, thickness in enumerate(THICKNESSES):
        layers.append(
            Solid(f"/{k}", "cube", transform((WIDE, WIDE, thickness / 2), (0, 0, z - thickness / 2)), None, k)
        )
        z -= thickness
    scene = Scene(
        camera(100 * towards(camera_at), (0, 0, 0), aperture=1e-5),
        shapes=tuple(layers),
        media=media,
        lights=(DistantLight("/sun", tuple(-towards(light_at)), 0.0, (1.0, 1.0, 1.0)),),
    )
    mean, error = stats.image_mean(render(scene, replace(SETTINGS, seed=seed, **settings)))
    return np.array([mean, error]) / abs(light_at)


def layers_of(laws, transport, albedo=(0.9, 0.7), asymmetry=(0.5, -0.3)):
    return tuple(
        Medium(f"/{k}", mean_extinction=1.0, albedo=(a,) * 3, asymmetry=g, transport=transport, **law_of(*law))
        for k, (law, a, g) in enumerate(zip(laws, albedo, asymmetry, strict=True))
    )


def check_exchange(transport, cases, *, spp, detects):
    """Both above, and one of them below."""
    found, expected = [], []
    for k, laws in enumerate(cases):
        media = layers_of(laws, transport)
        for one, other in ((STEEP, SLANT), (STEEP, -SLANT)):
            found.append(seen(media, camera_at=one, light_at=other, seed=2 * k, spp=spp))
            expected.append(seen(media, camera_at=other, light_at=one, seed=2 * k + 1, spp=spp))
    found, expected = np.array(found), np.array(expected)
    errors = np.hypot(found[:, 1], expected[:, 1])
    stats.assert_means(found[:, 0], errors, expected[:, 0], detects=detects)


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_light_and_camera_may_be_exchanged(transport):
    check_exchange(transport, LAWS[:1], spp=256, detects=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("transport", TRANSPORTS)
def test_light_and_camera_may_be_exchanged_under_every_law(transport):
    check_exchange(transport, LAWS, spp=2048, detects=0.01)


def scattered_once(law, thickness, camera_at, light_at):
    """f of light that scatters once, isotropically and without loss, in one layer under renewal transport."""
    b, kappa = law

    def density(z):
        first = kernels.density_sm(b, kappa, z / camera_at)
        return first * kernels.transmittance_ss(b, kappa, z / light_at) / (camera_at * light_at * 4 * math.pi)

    return quad(density, 0, thickness, points=[1e-4, 1e-2])[0]


def test_a_renewal_is_not_reciprocal():
    """Light that scatters once is what theory says, in both directions, 1.5 to 1; and all light differs as it does."""
    law = (0.5, 10.0)
    media = layers_of((law, (0.0, 0.0)), "renewal", albedo=(0.5, 0.0), asymmetry=(0.0, 0.0))
    pairs = ((STEEP, SLANT), (SLANT, STEEP))
    once = [seen(media, camera_at=a, light_at=b, seed=k, max_depth=1) for k, (a, b) in enumerate(pairs)]
    expected = [0.5 * scattered_once(law, THICKNESSES[0], a, b) for a, b in pairs]
    stats.assert_means([mean for mean, _ in once], [error for _, error in once], expected, detects=0.01)
    (one, e1), (other, e2) = (seen(media, camera_at=a, light_at=b, seed=k) for k, (a, b) in enumerate(pairs))
    assert expected[0] > 1.4 * expected[1]
    assert one - other > 5 * math.hypot(e1, e2)
