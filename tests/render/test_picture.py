"""What is where in a picture: the right way round, with the right colours in the right planes."""

from dataclasses import replace

import numpy as np
import pytest

from fgf_warp.renderer import render
from fgf_warp.scene import AreaLight, DomeLight, Medium, Mesh, Scene, Solid, Surface
from fgf_warp.settings import RENDERED_AOVS, Aov, RenderSettings
from fgf_warp.theory import kernels
from tests import stats
from tests.render.test_media import BOX, CORNERS
from tests.scenes import camera, furnace, transform

SETTINGS = RenderSettings(width=64, height=48, spp=64, aovs=RENDERED_AOVS)
COLORS = {(1, 1): (0.8, 0.1, 0.1), (-1, 1): (0.1, 0.8, 0.1), (1, -1): (0.1, 0.1, 0.8)}
"""Diffuse colours by the side, right and up, on which a ball stands; the lower left stays empty."""


@pytest.mark.parametrize("kind", ["solid", "mesh"])
def test_nothing_is_mirrored(kind):
    """Three coloured boxes in three quarters of the picture, in radiance, albedo, depth and alpha."""

    def box(name, at, color):
        if kind == "solid":
            return Solid(name, "cube", transform(0.5, at), Surface(color))
        return Mesh(name, CORNERS * 0.5 + np.asarray(at), BOX, Surface(color))

    shapes = tuple(box(f"/{k}", (x, y, -0.5), color) for k, ((x, y), color) in enumerate(COLORS.items()))
    scene = Scene(camera((0, 0, 8), (0, 0, 0), aperture=0.5), shapes, lights=(DomeLight("/sky", (1.0,) * 3),))
    result = render(scene, SETTINGS)
    row, column = {1: 12, -1: 36}, {1: 48, -1: 16}
    for (x, y), color in COLORS.items():
        at = (row[y], column[x])
        assert np.allclose(result.aovs[Aov.ALBEDO][at], color, atol=1e-5)
        # A convex box under a uniform sky of radiance 1 shows its reflectance.
        assert np.allclose(result.radiance[at], color, atol=1e-5)
        assert np.isclose(result.aovs[Aov.DEPTH][at], 8.0, rtol=1e-5)
        assert result.alpha[at] == 1
    empty = (row[-1], column[-1])
    assert np.isinf(result.aovs[Aov.DEPTH][empty])
    assert result.alpha[empty] == 0
    assert np.array_equal(result.radiance[empty], (1, 1, 1))
    assert np.array_equal(result.aovs[Aov.ALBEDO][empty], (0, 0, 0))


def test_a_cylinder_is_round_and_capped():
    """Through its side and along its axis it is 2 radii thick and 2 half heights long."""
    medium = Medium("/m", 1.0, (0.0,) * 3)
    scene = furnace()
    cylinder = Solid("/c", "cylinder", transform((0.5, 0.5, 1.5)), medium=0)
    rays = {
        "across": ((5, 0, 0.3), (0, 0, 0.3), 1.0),
        "along": ((0.1, 0.1, 6), (0.1, 0.1, 0), 3.0),
        "off the axis": ((5, 0.4, 0), (0, 0.4, 0), 0.6),
    }
    for position, towards, thickness in rays.values():
        view = camera(position, towards, aperture=1e-4)
        result = render(replace(scene, media=(medium,), shapes=(cylinder,), camera=view), replace(SETTINGS, spp=256))
        expected = float(kernels.transmittance_ss(0.0, 0.0, thickness))
        stats.assert_means(*stats.image_mean(result), expected, detects=0.05)


def test_what_is_just_before_a_light_shadows_it():
    """A black plate that covers a rect light, at 8e-5 of its distance."""
    floor = Solid("/floor", "cube", transform((10, 10, 1), (0, 0, -1)), Surface((0.5,) * 3))
    light = AreaLight("/lamp", "rect", (0, 0, 100), (1, 0, 0), (0, -1, 0), (1e4,) * 3)
    plate = Solid("/plate", "cube", transform((1.1, 1.1, 1e-3), (0, 0, 99.992)), Surface((0.0,) * 3))
    scene = Scene(camera((1.5, 0, 0.7), (0, 0, 0), aperture=1e-3), (floor,), lights=(light,))
    assert render(scene, SETTINGS).radiance.min() > 0
    assert not render(replace(scene, shapes=(floor, plate)), SETTINGS).radiance.any()


def test_the_last_surface_still_glows():
    """A path that may not scatter on still brings the light of what it met."""
    plate = Solid("/plate", "cube", transform((5, 5, 0.1)), Surface((0.5,) * 3, (0.7, 0.8, 0.9)))
    scene = replace(furnace(), media=(), shapes=(plate,), lights=())
    result = render(scene, replace(SETTINGS, max_depth=1))
    assert np.allclose(result.radiance, (0.7, 0.8, 0.9))
