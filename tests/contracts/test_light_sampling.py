"""Samplers of lights and of the diffuse lobe: where they point, and that their pdf is the one they state."""

import math

import numpy as np
import pytest
import warp as wp

from fgf_warp.device import lights
from fgf_warp.scene import (
    AreaLight,
    CylinderLight,
    DistantLight,
    DomeLight,
    MeshLight,
    Shaping,
    SphereLight,
)
from fgf_warp.upload import LightRows, build_device_light
from tests import stats
from tests.contracts import device_kernels
from tests.lighting import grey_image, shaping_factor

N = 100_000
WHITE = (1.0, 1.0, 1.0)
POINT = np.array([0.3, -0.2, 0.1])


def numbers(seed):
    return wp.array(np.random.default_rng(seed).random((N, 2)).astype(np.float32), dtype=wp.vec2, device="cpu")


def device_light(light):
    """An array of the light alone, and what it looks up."""
    rows = LightRows()
    return wp.array([build_device_light(light, rows)], dtype=lights.Light, device="cpu"), rows.upload("cpu")


def sample(light, seed=1, normal=(0.0, 0.0, 0.0)):
    """Directions, and rows of pdf_solid_angle, the pdf that a ray meeting the light is given, distance and radiance."""
    direction = wp.zeros(N, dtype=wp.vec3, device="cpu")
    out = wp.zeros((4, N), dtype=float, device="cpu")
    inputs = [*device_light(light), wp.vec3(*POINT), wp.vec3(*normal), numbers(seed)]
    wp.launch(device_kernels.sample_light_kernel, dim=N, inputs=inputs, outputs=[direction, out], device="cpu")
    return direction.numpy().astype(np.float64), out.numpy().astype(np.float64)


def meet(light, direction):
    """pdf_solid_angle and radiance, float64, of what rays from `POINT` meet of a light."""
    rays = wp.array(direction.reshape(-1, 3).astype(np.float32), dtype=wp.vec3, device="cpu")
    out = wp.zeros((2, len(rays)), dtype=float, device="cpu")
    inputs = [*device_light(light), wp.vec3(*POINT), rays]
    wp.launch(device_kernels.intersect_light_kernel, dim=len(rays), inputs=inputs, outputs=[out], device="cpu")
    return out.numpy().astype(np.float64).reshape(2, *direction.shape[:-1])


FLAT = {
    "rect": AreaLight("/l", "rect", (0.5, 0.4, 3.0), (0.8, 0.1, 0.0), (0.1, -1.2, 0.2), WHITE),
    "disk": AreaLight("/l", "disk", (0.5, 0.4, 3.0), (0.8, 0.1, 0.0), (0.1, -1.2, 0.2), WHITE),
}


@pytest.mark.parametrize("kind", FLAT)
def test_flat_lights_are_sampled_by_area(kind):
    light = FLAT[kind]
    direction, (pdf, pdf_met, distance, _) = sample(light)
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
    direction, (pdf, pdf_met, distance, _) = sample(light)
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
    direction, (pdf, *_) = sample(light)
    cone = 2 * math.sin(half_angle / 2) ** 2
    v = 0.5 * ((direction + np.asarray(light.direction)) ** 2).sum(axis=1)
    stats.assert_distributed(v, lambda x: np.clip(x / cone, 0, 1))
    assert np.abs(pdf * 2 * math.pi * cone - 1).max() < 1e-5


RNG = np.random.default_rng(7)
SUN = np.full((16, 32), 0.01)
SUN[3, 20] = 1e6
TURNED = tuple(map(tuple, np.linalg.qr(RNG.normal(size=(3, 3)))[0].tolist()))
CHI_SQUARE = {
    "rect": (FLAT["rect"], 0.6),
    "disk": (FLAT["disk"], 0.6),
    "sphere": (SphereLight("/l", (0.5, 1.4, 3.0), 0.7, WHITE), 0.3),
    "distant": (DistantLight("/l", (0.6, 0.0, -0.8), 0.3, WHITE), 0.4),
    "cylinder": (CylinderLight("/l", (0.5, 0.4, 2.0), (0.9, 0.8, 0.1), 0.5, WHITE), 1.0),
    "near cylinder": (CylinderLight("/l", (0.3, -0.2, 0.8), (3.0, 0.8, 0.1), 0.6, WHITE), 1.6),
    "cylinder end-on": (CylinderLight("/l", (0.3, 1.4, 4.0), (0.0, 0.1, 2.0), 0.5, WHITE), 0.32),
    "rect with image": (
        AreaLight(
            "/l", "rect", (0.5, 0.4, 3.0), (0.8, 0.1, 0.0), (0.1, -1.2, 0.2), WHITE, grey_image(RNG.random((6, 5)) ** 4)
        ),
        0.6,
    ),
    "rect with image, turned": (
        AreaLight(
            "/l",
            "rect",
            (0.5, 0.4, 3.0),
            (0.8, 0.1, 0.0),
            (0.1, -1.2, 0.2),
            WHITE,
            grey_image(RNG.random((3, 4)), is_srgb=True),
            ((0.0, -0.5, 0.5), (0.5, 0.0, 0.5)),
        ),
        0.6,
    ),
    "dome": (DomeLight("/l", WHITE, grey_image(RNG.random((7, 12)) ** 6), TURNED), math.pi),
    "dome of bytes": (DomeLight("/l", WHITE, grey_image(RNG.random((2, 3)), is_srgb=True)), math.pi),
    "dome of one texel": (DomeLight("/l", WHITE, grey_image([[0.3]])), math.pi),
    "black dome": (DomeLight("/l", WHITE, grey_image(np.zeros((4, 8)))), math.pi),
    "dome with a sun": (DomeLight("/l", WHITE, grey_image(SUN)), math.pi),
}
"""Lights, and the half angle of a cone around the directions to them."""
BINS, POINTS = (16, 32), 24
"""Of the cone, along 1 - cos and azimuth; and of quadrature along each side of a bin."""


def turned_to(axis) -> np.ndarray:
    """A rotation that takes z to the unit vector `axis`, (3, 3)."""
    across = np.cross(axis, [0.6, 0.0, 0.8])
    across /= np.linalg.norm(across)
    return np.column_stack([across, np.cross(axis, across), axis])


@pytest.mark.parametrize("kind", CHI_SQUARE)
def test_directions_follow_the_pdf_that_rays_are_given(kind):
    """Chi-square over bins of a cone; and the pdf integrates to 1."""
    light, half_angle = CHI_SQUARE[kind]
    direction, (pdf, *_) = sample(light)
    assert (pdf > 0).all()
    frame = turned_to(direction.mean(axis=0) / np.linalg.norm(direction.mean(axis=0)))
    if half_angle == math.pi:
        frame = np.eye(3)
    reach = 1 - math.cos(half_angle)
    own = direction @ frame
    counts = np.histogram2d(
        1 - own[:, 2], np.arctan2(own[:, 1], own[:, 0]), bins=BINS, range=((0, reach), (-np.pi, np.pi))
    )[0]
    assert counts.sum() == N
    v = (np.arange(BINS[0] * POINTS) + 0.5) / (BINS[0] * POINTS) * reach
    azimuth = (np.arange(BINS[1] * POINTS) + 0.5) / (BINS[1] * POINTS) * 2 * np.pi - np.pi
    v, azimuth = np.meshgrid(v, azimuth, indexing="ij")
    sine = np.sqrt(v * (2 - v))
    rays = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), 1 - v], axis=-1) @ frame.T
    pdf_met, _ = meet(light, rays)
    expected = pdf_met.reshape(BINS[0], POINTS, BINS[1], POINTS).mean(axis=(1, 3)) * reach * 2 * np.pi / counts.size
    assert abs(expected.sum() - 1) < 5e-3
    # A bin that an edge of the light just touches is not seen by quadrature.
    stats.assert_histogram(counts, np.maximum(expected * N, 1e-3))


@pytest.mark.parametrize("kind", CHI_SQUARE)
def test_sampled_radiance_is_what_rays_meet(kind):
    light, _ = CHI_SQUARE[kind]
    direction, (pdf, pdf_met, _, radiance) = sample(light)
    met, radiance_met = meet(light, direction)
    # Rays at an edge may miss by rounding.
    met_it = met > 0
    assert met_it.mean() > 0.999
    assert np.isclose(pdf_met, pdf, rtol=1e-3).mean() > 0.999
    assert np.isclose(met[met_it], pdf[met_it], rtol=1e-3).mean() > 0.999
    assert np.isclose(radiance_met[met_it], radiance[met_it], rtol=2e-3, atol=1e-6).mean() > 0.99
    if kind != "black dome":
        assert radiance.mean() > 0


def test_mesh_lights_are_sampled_by_area():
    corners = np.array([[0.0, 0.0, 3.0], [0.0, 1.5, 3.0], [2.0, 0.0, 3.0], [-1.0, -1.0, 3.0]])
    triangles = np.array([[0, 1, 2], [0, 0, 1], [3, 0, 2]])
    light = MeshLight("/l", corners[triangles], WHITE)
    direction, (pdf, pdf_met, distance, radiance) = sample(light, normal=(0.0, 0.0, -1.0))
    at = (POINT + direction * distance[:, None])[:, :2]
    counts, expected = [], []
    for triangle, area in zip(corners[triangles], light.areas, strict=True):
        if area == 0:
            continue
        edges = (triangle[1:] - triangle[0])[:, :2].T
        u, v = np.linalg.solve(edges, (at - triangle[0, :2]).T)
        within = (u > 0) & (v > 0) & (u + v < 1)
        # Even in the square that is folded to a triangle.
        across, along = (u + v) ** 2, v / (u + v)
        counts.append(np.histogram2d(across[within], along[within], bins=8, range=((0, 1), (0, 1)))[0])
        expected.append(np.full((8, 8), N * area / light.area / 64))
    assert sum(c.sum() for c in counts) > N - 10
    stats.assert_histogram(np.array(counts), np.array(expected))
    assert np.allclose(pdf, distance**2 / (direction[:, 2] * light.area), rtol=1e-4)
    assert np.allclose(pdf_met, pdf, rtol=1e-4)
    assert (radiance == 1).all()
    behind = MeshLight("/l", corners[triangles][:, ::-1], WHITE)
    assert not sample(behind)[1][0].any()


SHAPINGS = {
    "hard cone": Shaping((0.0, 0.6, -0.8), math.radians(40)),
    "soft cone": Shaping((0.0, 0.6, -0.8), math.radians(60), 0.7),
    "narrow cone": Shaping((0.0, 0.6, -0.8), math.radians(0.1), 1.0),
    "focus": Shaping((0.0, 0.6, -0.8), math.pi, 0.0, 3.5, (0.25, 0.0, 0.0)),
}


@pytest.mark.parametrize("kind", SHAPINGS)
def test_shaping_follows_the_schema(kind):
    """Relative error below 1e-4 of the peak, in all directions, and close to the axis."""
    shaping = SHAPINGS[kind]
    light = DomeLight("/l", WHITE, shaping=shaping)
    rng = np.random.default_rng(1)
    away = rng.normal(size=(N, 3)) * np.where(np.arange(N) % 2, 10.0, min(shaping.cone_angle, 1.0))[:, None]
    emitted = np.asarray(shaping.axis) + away
    emitted = (emitted / np.linalg.norm(emitted, axis=1)[:, None]).astype(np.float32).astype(np.float64)
    emitted /= np.linalg.norm(emitted, axis=1)[:, None]
    _, radiance = meet(light, -emitted)
    expected = shaping_factor(shaping, emitted)
    assert (expected == 0).any() != (kind == "focus")
    at_edge = np.abs(2 * np.arcsin(np.linalg.norm(emitted - shaping.axis, axis=-1) / 2) - shaping.cone_angle) < 1e-6
    assert np.abs(radiance - expected)[~at_edge].max() < (1e-4 if kind != "narrow cone" else 2e-3)


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
