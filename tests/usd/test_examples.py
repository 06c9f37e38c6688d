"""Stages that are built in Python hold what was asked for."""

from __future__ import annotations

import numpy as np
import pytest

from fgf_warp.scene import Medium
from usd_scenes.examples import MEDIUM_PATH, build_mesh, build_slab, build_sphere, stage_names, stage_path, trefoil_tube
from usd_scenes.reader import read_scene, read_stage
from usd_scenes.reader.bounds import scene_bounds

MEDIUM = Medium(
    name=MEDIUM_PATH, mean_extinction=2.5, hurst=-0.3, white_noise_scale=0.7, asymmetry=0.6, albedo=(0.9, 0.8, 0.7)
)


def test_sphere() -> None:
    scene = read_stage(build_sphere(MEDIUM, radius=3, radiance=0.5)).scene
    assert scene.media == (MEDIUM,)
    np.testing.assert_allclose(scene_bounds(scene.shapes), [[-3, -3, -3], [3, 3, 3]])
    assert scene.lights[0].radiance == (0.5, 0.5, 0.5)


def test_slab() -> None:
    scene = read_stage(build_slab(MEDIUM, thickness=0.5, width=40)).scene
    assert scene.media == (MEDIUM,)
    np.testing.assert_allclose(scene_bounds(scene.shapes), [[-20, -20, -0.25], [20, 20, 0.25]])


def test_the_slabs_camera_sees_nothing_but_slab() -> None:
    scene = read_stage(build_slab(MEDIUM, thickness=0.5, width=40)).scene
    left, right, bottom, top = np.array(scene.camera.window(10, 10)) * (scene.camera.position[2] - 0.25)
    assert max(-left, right, -bottom, top) < 20 / 9


def test_mesh() -> None:
    points, quads = trefoil_tube(around=6, along=30)
    reading = read_stage(build_mesh(MEDIUM, points, quads))
    (mesh,) = reading.scene.shapes
    assert mesh.points == pytest.approx(points, abs=1e-6)
    assert len(mesh.triangles) == 2 * len(quads)
    assert reading.warnings == ()


@pytest.mark.parametrize("name", sorted(set(stage_names()) - {"glass"}))
def test_surfaces_of_the_stages_are_matte(name: str) -> None:
    reading = read_scene(stage_path(name), strict=True)
    assert all(shape.surface is None or shape.surface.is_matte for shape in reading.scene.shapes)
