"""Lights on a diffuse plane against closed forms, and next-event estimation against paths that find the light."""

import math

import numpy as np
import pytest

from fgf_warp.renderer import render
from fgf_warp.scene import AreaLight, DistantLight, DomeLight, Medium, Scene, Solid, SphereLight, Surface
from fgf_warp.settings import RenderSettings
from tests import stats
from tests.grid import REGIMES
from tests.scenes import camera, transform

RHO = 0.6
HEIGHT = 2.0
SETTINGS = RenderSettings(width=16, height=16, spp=1024, seed=4)


def form_factor_of_square(half: float, height: float) -> float:
    """Of a square of half width `half` above a point below its centre."""
    a = half / height
    return 4 / (2 * math.pi) * 2 * a / math.sqrt(1 + a * a) * math.atan(a / math.sqrt(1 + a * a))


LIGHTS = {
    "distant delta": (DistantLight("/l", (math.sin(0.5), 0, -math.cos(0.5)), 0.0, (3.0,) * 3), 3 * math.cos(0.5)),
    "distant disc": (DistantLight("/l", (0, 0, -1), 0.3, (3.0,) * 3), 3 * math.pi * math.sin(0.3) ** 2),
    "sun": (
        DistantLight("/l", (0, 0, -1), math.radians(0.265), (5e4,) * 3),
        5e4 * math.pi * math.sin(math.radians(0.265)) ** 2,
    ),
    "dome": (DomeLight("/l", (2.0,) * 3), 2 * math.pi),
    "rect": (
        AreaLight("/l", "rect", (0, 0, HEIGHT), (1, 0, 0), (0, -1, 0), (5.0,) * 3),
        5 * math.pi * form_factor_of_square(1.0, HEIGHT),
    ),
    "disk": (AreaLight("/l", "disk", (0, 0, HEIGHT), (1, 0, 0), (0, -1, 0), (5.0,) * 3), 5 * math.pi / (1 + HEIGHT**2)),
    "sphere": (SphereLight("/l", (0, 0, HEIGHT), 0.7, (5.0,) * 3), 5 * math.pi * (0.7 / HEIGHT) ** 2),
}


@pytest.mark.parametrize("kind", LIGHTS)
def test_irradiance_on_a_plane(kind):
    """A pixel shows rho E / pi; sees a bias of 0.5 %."""
    light, irradiance = LIGHTS[kind]
    floor = Solid("/floor", "cube", transform((1e3, 1e3, 1), (0, 0, -1)), Surface((RHO,) * 3))
    scene = Scene(camera((1.5, 0, 0.7), (0, 0, 0), aperture=1e-4), (floor,), lights=(light,))
    result = render(scene, SETTINGS)
    stats.assert_means(*stats.image_mean(result), RHO * irradiance / math.pi, detects=0.005)


def test_a_flat_light_is_black_from_behind():
    light, _ = LIGHTS["rect"]
    scene = Scene(camera((0, 0, 5), (0, 0, 0), aperture=0.1), lights=(light,))
    result = render(scene, SETTINGS)
    assert not result.radiance.any()
    assert (result.alpha == 1).all()


def test_lights_are_seen_at_their_radiance():
    light, _ = LIGHTS["sphere"]
    scene = Scene(camera((0, -5, 2), (0, 0, 2), aperture=0.1), lights=(light, DomeLight("/d", (1.0,) * 3)))
    assert np.allclose(render(scene, SETTINGS).radiance, 5.0)


@pytest.mark.parametrize(
    ("regime", "transport"),
    [("exponential", None), ("pink", "reciprocal"), ("pink", "renewal"), ("fbm", "reciprocal"), ("negative", None)],
)
def test_connections_agree_with_paths_that_find_the_light(regime, transport):
    """A block over a floor under a rect light, and under a plate that glows: the same picture.

    The plate is found by chance alone, so this holds Tms and Tss of connections, their pdfs and weights against
    free flights.
    """

    def scene(light):
        shapes = [
            Solid("/floor", "cube", transform((20, 20, 1), (0, 0, -2)), Surface((0.5,) * 3)),
            Solid("/block", "cube", np.eye(4), medium=0),
        ]
        lights = ()
        if light:
            lights = (AreaLight("/light", "rect", (0, 0, 3), (2, 0, 0), (0, -2, 0), (1.0,) * 3),)
        else:
            shapes.append(
                Solid("/plate", "cube", transform((2, 2, 1e-3), (0, 0, 3.001)), Surface((0,) * 3, (1.0,) * 3))
            )
        medium = dict(mean_extinction=1.5, albedo=(0.9,) * 3, asymmetry=0.6, transport=transport) | REGIMES[regime]
        return Scene(camera((5, 3, 1.5), (0, 0, 0)), tuple(shapes), (Medium("/medium", **medium),), lights)

    settings = dict(width=32, height=32)
    connected = render(scene(light=True), RenderSettings(**settings, spp=2048, seed=1))
    found = render(scene(light=False), RenderSettings(**settings, spp=8192, seed=2))
    stats.assert_images_agree(connected, found, blocks=4, detects=0.05)
