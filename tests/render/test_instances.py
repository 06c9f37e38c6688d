"""Instances, and shapes that move while the shutter is open, from the scene to the image."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from fgf_warp.features import required_features
from fgf_warp.renderer import render
from fgf_warp.scene import DistantLight, Mesh, Solid, Surface
from fgf_warp.scene import shapes as shapes_module
from fgf_warp.settings import RenderSettings
from tests import stats
from tests.contracts.test_instances import affine, in_world
from tests.grid import REGIMES
from tests.render.test_media import BLACK, BOX, CORNERS, transmittance
from tests.scenes import camera, furnace, instance_of, transform

SETTINGS = RenderSettings(width=32, height=32, spp=256, seed=11)
CUBE = Mesh("/cube", CORNERS, BOX)
SUN = DistantLight("/sun", (0, -1, 0), 0.5, (1.0, 1.0, 1.0))


def moving_scene(*shapes, **medium):
    """These shapes before a camera at z = 5, and behind it one of each kind: all such scenes share a kernel."""
    scene = furnace(fills_view=False, **(REGIMES["pink"] | {"albedo": BLACK} | medium))
    away, further = transform(0.1, (0, 0, 90)), transform(0.1, (0, 0, 91))
    behind = (
        Solid("/solid", "cube", away, Surface(BLACK), closing=further),
        Solid("/filled", "cube", away, medium=0, closing=further),
        instance_of("/surface", replace(CUBE, surface=Surface(BLACK)), away, further),
        instance_of("/medium", replace(CUBE, medium=0), away, further),
    )
    return replace(scene, shapes=(*shapes, *behind), lights=(*scene.lights, SUN))


def example():
    """Every kind of instance and of motion, in light from above: for tests of the kernel itself."""
    tilt = affine(np.random.default_rng(5), mirrored=True, shear=0.2, at=0.3)
    floor = Solid("/floor", "cube", transform((5, 1, 5), (0, -3.2, 0)), Surface((0.5, 0.4, 0.3)))
    ball = Solid("/ball", "sphere", transform(0.5, (-1.2, 0, 0)), medium=0, closing=transform(0.5, (-1, 0.5, 0)))
    cloud = instance_of("/cloud", replace(CUBE, medium=0), tilt @ transform(0.5))
    brick = instance_of("/brick", replace(CUBE, surface=Surface((0.8, 0.2, 0.2))), transform(0.4, (1.2, 0, 0)))
    return moving_scene(
        floor, ball, cloud, replace(brick, closing=transform(0.3, (1.0, 0.8, 0))[None, :3]), albedo=(0.8,) * 3
    )


def test_a_scene_pays_for_motion_and_instances_where_there_are_any():
    features = required_features(example(), SETTINGS)
    assert features.instances
    assert features.motion
    assert not features.connects_in_lanes
    assert features.lone_solid == ""
    ball = Solid("/ball", "sphere", transform(), medium=0, closing=transform(2.0))
    assert required_features(replace(furnace(), shapes=(ball,)), SETTINGS).lone_solid == ""


@pytest.mark.slow
@pytest.mark.parametrize("mirrored", [False, True])
def test_an_instance_looks_like_the_mesh_that_it_draws(mirrored):
    """A cloud and a brick, sheared, on a floor."""
    rng = np.random.default_rng(4)
    matrices = [affine(rng, mirrored=mirrored, shear=0.3, at=0) for _ in range(2)]
    matrices[1][:3, 3] = [1.3, 0.2, 0.3]
    floor = Solid("/floor", "cube", transform((5, 1, 5), (0, -2.2, 0)), Surface((0.5, 0.4, 0.3)))
    contents = (dict(medium=0), dict(surface=Surface((0.8, 0.2, 0.2))))
    placed = [
        instance_of(f"/{k}", replace(CUBE, **what), matrix @ transform(0.6))
        for k, (what, matrix) in enumerate(zip(contents, matrices, strict=True))
    ]
    scenes = [moving_scene(floor, *shapes, albedo=(0.8,) * 3) for shapes in (placed, map(in_world, placed))]
    a, b = (render(scene, replace(SETTINGS, seed=seed)) for seed, scene in enumerate(scenes))
    stats.assert_images_agree(a, b, blocks=4, detects=0.05)


@pytest.mark.parametrize("kind", ["solid", "instance"])
def test_what_moves_covers_a_place_for_its_share_of_the_time(kind):
    """A flat square of half-width 0.3 runs from x = -0.6 to 0.6: column by column against the closed form."""
    half, run = 0.3, 0.6
    opening, closing = (transform((half, 2.0, 1e-3), (x, 0, 0)) for x in (-run, run))
    black = Surface(BLACK)
    if kind == "solid":
        square = Solid("/square", "cube", opening, black, closing=closing)
    else:
        square = instance_of("/square", replace(CUBE, surface=black), opening, closing)
    view = camera((0, 0, 5), (0, 0, 0), aperture=0.4)
    result = render(replace(moving_scene(square), camera=view), SETTINGS)
    x = (np.arange(32 * 64) + 0.5) / (32 * 64) * 2 - 1
    covered = np.clip(np.minimum(x + half, run) - np.maximum(x - half, -run), 0, None) / (2 * run)
    expected = covered.reshape(32, 64).mean(axis=1)
    found = result.alpha.mean(axis=0)
    errors = np.sqrt(np.maximum(expected * (1 - expected), 1e-4) / (32 * SETTINGS.spp))
    stats.assert_means(1 + found - expected, errors, 1.0, detects=0.04)


@pytest.mark.parametrize("kind", ["solid", "instance"])
def test_a_medium_that_moves_through_the_view(kind):
    """A block of an absorber, 2 deep, that is before the camera for half of the time: (1 + T) / 2."""
    opening, closing = (transform(1.0, (x, 0, 0)) for x in (0.5, 1.5))
    if kind == "solid":
        block = Solid("/block", "cube", opening, medium=0, closing=closing)
    else:
        block = instance_of("/block", replace(CUBE, medium=0), opening, closing)
    scene = replace(moving_scene(block), camera=camera((0, 0, 5), (0, 0, 0), aperture=1e-4))
    expected = (1 + transmittance(scene.media[0], 2.0)) / 2
    stats.assert_means(*stats.image_mean(render(scene, SETTINGS)), expected, detects=0.02)


def test_a_camera_in_an_instance():
    cube = instance_of("/cube", replace(CUBE, medium=0), affine(np.random.default_rng(2), mirrored=True, at=0))
    scene = replace(moving_scene(cube), camera=camera((0, 0, 0), cube.object_to_world[0, :3, 2], aperture=1e-4))
    distance = float(np.linalg.norm(cube.object_to_world[0, :3, 2]))
    expected = transmittance(scene.media[0], distance)
    stats.assert_means(*stats.image_mean(render(scene, SETTINGS)), expected, detects=0.05)


@pytest.mark.parametrize("kind", ["solid", "instance"])
def test_a_camera_that_a_medium_moves_over(kind):
    """In the middle of a block at first, before it after half of the time, and then in the open."""
    opening, closing = (transform(1.0, (0, 0, z)) for z in (0.0, 2.0))
    if kind == "solid":
        block = Solid("/block", "cube", opening, medium=0, closing=closing)
    else:
        block = instance_of("/block", replace(CUBE, medium=0), opening, closing)
    scene = replace(moving_scene(block), camera=camera((0, 0, 0), (0, 0, -1), aperture=1e-4))
    # Of 1 - 2 t of the block it looks out through the lower face.
    within = quad(lambda t: transmittance(scene.media[0], 1 - 2 * t), 0, 0.5)[0]
    stats.assert_means(*stats.image_mean(render(scene, SETTINGS)), within + 0.5, detects=0.02)


def test_many_solids_look_the_same_in_the_tree_as_one_after_the_other(monkeypatch):
    rng = np.random.default_rng(3)
    kinds = ("sphere", "cube", "cylinder")
    shapes = tuple(
        Solid(f"/{k}", kinds[k % 3], transform(0.15, rng.uniform(-1.5, 1.5, size=3)), Surface((0.8, 0.6, 0.4)))
        for k in range(shapes_module.MANY_SOLIDS + 1)
    )
    scene = replace(furnace(fills_view=False), shapes=shapes, media=())
    assert required_features(scene, SETTINGS).solids_in_tree
    in_tree = render(scene, replace(SETTINGS, seed=1))
    monkeypatch.setattr(shapes_module, "MANY_SOLIDS", len(shapes))
    assert not required_features(scene, SETTINGS).solids_in_tree
    stats.assert_images_agree(in_tree, render(scene, replace(SETTINGS, seed=2)), blocks=4, detects=0.05)
