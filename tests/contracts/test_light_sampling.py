"""Samplers of lights and of the diffuse lobe: where they point, and that their pdf is the one they state."""

import math

import numpy as np
import pytest
import warp as wp

from fgf_warp.device import lights
from fgf_warp.scene import AreaLight, DistantLight, SphereLight
from fgf_warp.upload import build_device_light
from tests import stats
from tests.contracts import device_kernels

N = 100_000
WHITE = (1.0, 1.0, 1.0)
POINT = np.array([0.3, -0.2, 0.1])


def numbers(seed):
    return wp.array(np.random.default_rng(seed).random((N, 2)).astype(np.float32), dtype=wp.vec2, device="cpu")


def sample(light, seed=1):
    """Directions, and rows of pdf_solid_angle, the pdf that a ray meeting the light is given, and distance."""
    direction = wp.zeros(N, dtype=wp.vec3, device="cpu")
    out = wp.zeros((3, N), dtype=float, device="cpu")
    one = wp.array([build_device_light(light)], dtype=lights.Light, device="cpu")
    inputs = [one, wp.vec3(*POINT), numbers(seed)]
    wp.launch(device_kernels.sample_light_kernel, dim=N, inputs=inputs, outputs=[direction, out], device="cpu")
    return direction.numpy().astype(np.float64), out.numpy().astype(np.float64)


FLAT = {
    "rect": AreaLight("/l", "rect", (0.5, 0.4, 3.0), (0.8, 0.1, 0.0), (0.1, -1.2, 0.2), WHITE),
    "disk": AreaLight("/l", "disk", (0.5, 0.4, 3.0), (0.8, 0.1, 0.0), (0.1, -1.2, 0.2), WHITE),
}


@pytest.mark.parametrize("kind", FLAT)
def test_flat_lights_are_sampled_by_area(kind):
    light = FLAT[kind]
    direction, (pdf, pdf_met, distance) = sample(light)
    halves = np.array([light.half_u, light.half_v])
    at = np.linalg.lstsq(halves.T, (POINT + direction * distance[:, None] - light.center).T, rcond=None)[0]
    if kind == "rect":
        counts = np.histogram2d(*at, bins=16, range=((-1, 1), (-1, 1)))[0]
        stats.assert_histogram(counts, np.full(counts.shape, N / counts.size))
    else:
        radius, azimuth = np.hypot(*at), np.arctan2(*at)
        counts = np.histogram2d(radius**2, azimuth, bins=16, range=((0, 1), (-np.pi, np.pi)))[0]
        stats.assert_histogram(counts, np.full(counts.shape, N / counts.size))
    normal = np.cross(*halves) / np.linalg.norm(np.cross(*halves))
    expected = distance**2 / (-(direction @ normal) * light.area)
    assert np.abs(pdf / expected - 1).max() < 1e-4
    assert np.abs(pdf_met / pdf - 1).max() < 1e-4


def test_sphere_lights_are_sampled_by_solid_angle():
    light = SphereLight("/l", (0.5, 1.4, 3.0), 0.7, WHITE)
    direction, (pdf, pdf_met, distance) = sample(light)
    towards = np.asarray(light.center) - POINT
    far = np.linalg.norm(towards)
    cone = 1 - math.sqrt(1 - (light.radius / far) ** 2)
    stats.assert_distributed(1 - direction @ towards / far, lambda v: np.clip(v / cone, 0, 1))
    assert np.abs(pdf * 2 * math.pi * cone - 1).max() < 1e-5
    assert np.abs(pdf_met / pdf - 1).max() < 1e-5
    surface = np.linalg.norm(POINT + direction * distance[:, None] - light.center, axis=1)
    assert np.abs(surface - light.radius).max() < 2e-3 * light.radius


@pytest.mark.parametrize("half_angle", [math.radians(0.265), 0.3, math.pi / 2])
def test_distant_lights_are_sampled_by_solid_angle(half_angle):
    light = DistantLight("/l", (0.6, 0.0, -0.8), half_angle, WHITE)
    direction, (pdf, _, _) = sample(light)
    cone = 2 * math.sin(half_angle / 2) ** 2
    v = 0.5 * ((direction + np.asarray(light.direction)) ** 2).sum(axis=1)
    stats.assert_distributed(v, lambda x: np.clip(x / cone, 0, 1))
    assert np.abs(pdf * 2 * math.pi * cone - 1).max() < 1e-5


def test_the_diffuse_lobe_follows_the_cosine():
    normal = np.array([0.48, -0.6, 0.64])
    out = wp.zeros(N, dtype=wp.vec3, device="cpu")
    inputs = [wp.vec3(*normal), numbers(2)]
    wp.launch(device_kernels.sample_diffuse_kernel, dim=N, inputs=inputs, outputs=[out], device="cpu")
    wi = out.numpy().astype(np.float64)
    across = np.cross(normal, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    azimuth = np.arctan2(wi @ np.cross(normal, across), wi @ across)
    counts = np.histogram2d((wi @ normal) ** 2, azimuth, bins=16, range=((0, 1), (-np.pi, np.pi)))[0]
    stats.assert_histogram(counts, np.full(counts.shape, N / counts.size))
