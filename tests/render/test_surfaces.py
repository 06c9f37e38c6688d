"""Surfaces beyond matte ones: energy, opacity, textures, normals and glass, in pictures with known answers."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fgf_warp.renderer import begin, build_model, develop, render, step
from fgf_warp.scene import (
    AreaLight,
    DistantLight,
    DomeLight,
    Image,
    Medium,
    Mesh,
    PrimvarInput,
    Scene,
    Solid,
    Surface,
    Texture,
    TextureInput,
)
from fgf_warp.settings import Aov, RenderSettings
from fgf_warp.theory.bsdf import fresnel_dielectric
from tests import stats
from tests.grid import REGIMES
from tests.render.test_drivers import launch_threads
from tests.scenes import camera, instance_of, transform

WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
DOME = (DomeLight("/dome", WHITE),)
SETTINGS = RenderSettings(width=32, height=32, spp=64, max_depth=2**16)
CLEAR = Medium("/clear", mean_extinction=1e-6)
VIEW = camera((0, 0, 5), (0, 0, 0), aperture=0.3)
CORNERS = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
ST = ((CORNERS[:, :2] + 1) / 2)[TRIANGLES].astype(np.float32)


def ball(surface, *media, view=VIEW, lights=DOME):
    medium = 0 if media else None
    return Scene(view, (Solid("/ball", "sphere", np.eye(4), surface, medium),), media, lights)


def quad(surface, z=0.0, size=1.0, name="/quad", **more):
    points = CORNERS * size + (0, 0, z)
    return Mesh(name, points, TRIANGLES, surface, primvars={"st": ST, **more.pop("primvars", {})}, **more)


def texture_of(pixels, **more):
    return Texture({(0, 0): Image("image", np.asarray(pixels, dtype=np.float32))}, **more)


def mean_of(scene, settings=SETTINGS):
    return stats.image_mean(render(scene, settings))


@pytest.mark.parametrize(
    "surface",
    [
        Surface(WHITE, metallic=1.0, roughness=0.0),
        Surface(WHITE, metallic=1.0, roughness=0.7),
        Surface(WHITE, ior=1.5, roughness=0.2),
        Surface(WHITE, specular=(0.6, 0.6, 0.6), roughness=0.5),
        Surface(WHITE, ior=1.5, clearcoat=1.0, clearcoat_roughness=0.0, roughness=0.0),
    ],
    ids=["mirror", "rough metal", "under specular", "specular workflow", "under a coat"],
)
def test_white_furnace(surface):
    stats.assert_means(*mean_of(ball(surface)), 1.0, detects=0.02)


@pytest.mark.parametrize("roughness", [0.0, 0.5])
def test_light_connected_to_and_light_met_agree(roughness):
    """The same dome as two hemispheres that surfaces connect to, weighed against what they scatter to by themselves."""
    halves = tuple(DistantLight(f"/{z}", (0, 0, z), math.pi / 2, WHITE) for z in (-1.0, 1.0))
    surface = Surface(WHITE, ior=1.5, roughness=roughness)
    stats.assert_means(*mean_of(ball(surface, lights=halves)), 1.0, detects=0.02)


SHEET = Surface(BLACK, opacity=0.3)
UNSEEN = quad(SHEET, z=-9.0, size=0.1, name="/unseen")
"""Behind others: it makes their kernel one that other tests need too."""


def test_a_sheet_lets_light_through_to_the_camera():
    """Transmittance 0.7, alpha 0.3."""
    result = render(Scene(VIEW, (quad(SHEET),), (), DOME), replace(SETTINGS, spp=256))
    stats.assert_means(*stats.image_mean(result), 0.7, detects=0.02)
    assert abs(result.alpha.mean() - 0.3) < 0.01


def test_a_sheet_lets_light_through_to_surfaces():
    """Every connection is dimmed by 0.7: no noise."""
    floor = quad(Surface((0.5, 0.5, 0.5)), z=-1.0, name="/floor", size=3.0)
    sun = (DistantLight("/sun", (0.0, 0.6, -0.8), 0.0, WHITE),)
    view = camera((0, -3, -0.2), (0, 0, -1), aperture=0.02)
    lit = render(Scene(view, (quad(SHEET, size=2.0), floor), (), sun), SETTINGS)
    assert np.allclose(lit.radiance, 0.5 / math.pi * 0.8 * 0.7, rtol=1e-4)


@pytest.mark.slow
def test_a_medium_goes_on_behind_a_sheet():
    """A segment that passes a sheet in a medium is one segment: its transmittance is no product."""
    medium = Medium("/fog", mean_extinction=0.5, albedo=BLACK, hurst=-0.25, white_noise_scale=2.0)
    box = Solid("/box", "cube", transform((10, 10, 1)), medium=0)
    sheet = quad(SHEET, size=9.0)
    view = camera((0, 0, 4), (0, 0, 0), aperture=1e-3)
    settings = replace(SETTINGS, spp=512)
    whole, error = mean_of(Scene(view, (box,), (medium,), DOME), settings)
    found, other = mean_of(Scene(view, (box, sheet), (medium,), DOME), settings)
    stats.assert_means(found / 0.7, math.hypot(error, other / 0.7), whole, detects=0.05)


def test_a_cutout():
    """Alpha below the threshold is not there at all, the rest is wholly there."""
    pixels = np.ones((1, 4, 4))
    pixels[0, :, 3] = (0.2, 0.2, 0.8, 0.8)
    opacity = TextureInput(texture_of(pixels, wrap_s="clamp"), channels="a")
    surface = Surface(BLACK, emission=(0.25, 0.25, 0.25), opacity=opacity, opacity_threshold=0.5)
    result = render(Scene(camera((0, 0, 5), (0, 0, 0), aperture=0.4), (quad(surface),), (), DOME), SETTINGS)
    assert np.allclose(result.radiance[:, :15], 1.0)
    assert np.allclose(result.radiance[:, 17:], 0.25)
    assert np.allclose(result.alpha[:, :15], 0)
    assert np.allclose(result.alpha[:, 17:], 1)


def test_a_texture_that_reads_no_coordinates_is_read_at_one_place():
    """The middle of its right texel, on a shape that has coordinates."""
    image = texture_of([[[0, 0, 0, 1], [0.25, 0.5, 0.75, 1]]], wrap_s="clamp")
    emission = TextureInput(image, primvar="", st=(0.75, 0.5))
    view = camera((0, 0, 5), (0, 0, 0), aperture=0.4)
    result = render(Scene(view, (quad(Surface(BLACK, emission=emission)),), (), DOME), SETTINGS)
    assert np.allclose(result.radiance, (0.25, 0.5, 0.75))


def test_a_textured_quad_shows_its_texels():
    """Of 8 x 8 texels, each over 4 x 4 pixels, the bilinear; in world space and as an instance."""
    texels = np.random.default_rng(3).random((8, 8, 4)).astype(np.float32)
    image = texture_of(texels, wrap_s="clamp", wrap_t="clamp")
    emission = TextureInput(image, scale=(2.0, 2.0, 2.0, 1.0), bias=(0.1, 0.0, 0.0, 0.0))
    mesh = quad(Surface(BLACK, emission=emission))
    view = camera((0, 0, 5), (0, 0, 0), aperture=0.4)
    settings = replace(SETTINGS, width=64, height=64, spp=16)
    center = (np.arange(64) + 0.5) / 8 - 0.5
    low = np.clip(np.floor(center).astype(int), 0, 7)
    high, along = np.clip(np.floor(center).astype(int) + 1, 0, 7), center - np.floor(center)
    rows = texels[low] * (1 - along)[:, None, None] + texels[high] * along[:, None, None]
    both = rows[:, low] * (1 - along)[None, :, None] + rows[:, high] * along[None, :, None]
    expected = 2 * both[..., :3] + (0.1, 0.0, 0.0)
    in_world = render(Scene(view, (mesh, UNSEEN), (), DOME), settings).radiance
    assert np.abs(in_world - expected).mean() < 0.01
    small = replace(mesh, points=mesh.points / 4, name="/small")
    placed = instance_of("/instance", small, transform(4.0))
    assert np.abs(render(Scene(view, (placed,)), settings).radiance - in_world).mean() < 1e-3


def test_primvars_colour_faces_and_corners():
    per_face = np.array([[[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]], dtype=np.float32)
    per_corner = np.concatenate([ST, np.zeros((2, 3, 1), np.float32)], axis=2)
    view = camera((0, 0, 5), (0, 0, 0), aperture=0.36)
    for values, expected in (
        (per_face, lambda x, y: (x > y, y > x, 0 * x)),
        (per_corner, lambda x, y: ((1 + x) / 2, (1 + y) / 2, 0 * x)),
    ):
        surface = Surface(BLACK, emission=PrimvarInput("color", BLACK))
        colored = quad(surface, primvars={"color": values})
        found = render(Scene(view, (colored, UNSEEN), (), DOME), SETTINGS).radiance
        x, y = np.meshgrid((np.arange(32) - 15.5) / 16 * 0.9, (15.5 - np.arange(32)) / 16 * 0.9)
        clear = np.abs(x - y) > 0.1
        assert np.abs(found - np.stack(expected(x, y), axis=-1))[clear].max() < 0.02


def test_a_normal_map_tilts_the_plane():
    """A constant normal shades as the plane that has it: along s, along t, and where the texture is turned."""
    sun = (DistantLight("/sun", (-0.6, 0.0, -0.8), 0.0, WHITE),)
    tilt = np.array([0.3, 0.1, math.sqrt(0.9)])
    texel = np.ones((1, 1, 4))
    texel[..., :3] = (tilt + 1) / 2
    turned = ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0))
    for transform_, normal in ((None, tilt), (turned, np.array([tilt[1], -tilt[0], tilt[2]]))):
        more = {} if transform_ is None else {"transform": transform_}
        bend = TextureInput(texture_of(texel), scale=(2.0, 2.0, 2.0, 1.0), bias=(-1.0, -1.0, -1.0, 0.0), **more)
        surface = Surface((0.5, 0.5, 0.5), normal=bend)
        found = render(Scene(VIEW, (quad(surface), UNSEEN), (), sun), SETTINGS).radiance
        assert np.allclose(found, 0.5 / math.pi * normal @ (0.6, 0.0, 0.8), rtol=1e-3)


def test_smooth_normals():
    """Corner normals are interpolated: two triangles that shade as one bent sheet."""
    leaning = np.array([[math.sin(a), 0.0, math.cos(a)] for a in (-0.5, 0.5, 0.5, -0.5)], dtype=np.float32)
    sun = (DistantLight("/sun", (0.0, 0.0, -1.0), 0.0, WHITE),)
    mesh = quad(Surface((1.0, 1.0, 1.0)), normals=leaning[TRIANGLES])
    view = camera((0, 0, 5), (0, 0, 0), aperture=0.36)
    found = render(Scene(view, (mesh, UNSEEN), (), sun), SETTINGS).radiance
    x = (np.arange(32) - 15.5) / 16 * 0.9
    normal = np.stack([x * math.sin(0.5), np.full(32, math.cos(0.5))])
    expected = normal[1] / np.linalg.norm(normal, axis=0) / math.pi
    assert np.allclose(found[..., 0], expected[None], rtol=2e-3)


HEAD_ON = camera((0, 0, 5), (0, 0, 0), aperture=1e-4)
GLASS = Surface(WHITE, opacity=0.0, ior=1.5, roughness=0.0)


def through_a_plate(optical_depth, reflectance):
    """Of light that meets a plate head-on, what comes back and what passes."""
    passed = math.exp(-optical_depth)
    again = 1 - (reflectance * passed) ** 2
    share = (1 - reflectance) ** 2 * passed
    return reflectance + share * reflectance * passed / again + share / again


@pytest.mark.parametrize("ior", [1.0, 1.5])
def test_an_absorbing_ball_of_glass_head_on(ior):
    """Beer and Lambert along the diameter, with the series of Fresnel's reflections."""
    medium = Medium("/ink", mean_extinction=0.4, albedo=BLACK)
    scene = ball(replace(GLASS, ior=ior), medium, view=HEAD_ON)
    expected = through_a_plate(0.8, float(fresnel_dielectric(1.0, ior)))
    stats.assert_means(*mean_of(scene, replace(SETTINGS, spp=256)), expected, detects=0.02)


def test_nested_media_by_priority():
    """A kernel of another ink in glass of equal index bends nothing; one of lower priority is not there."""
    inks = [Medium("/outer", 0.3, albedo=BLACK), Medium("/inner", 0.9, albedo=BLACK, priority=1)]
    outer = Solid("/outer", "sphere", np.eye(4), GLASS, 0)
    inner = Solid("/inner", "sphere", transform(0.5), replace(GLASS), 1)
    settings, reflectance = replace(SETTINGS, spp=256), float(fresnel_dielectric(1.0, 1.5))
    scene = Scene(HEAD_ON, (outer, inner), tuple(inks), DOME)
    stats.assert_means(*mean_of(scene, settings), through_a_plate(0.3 + 0.9, reflectance), detects=0.02)
    hidden = Scene(HEAD_ON, (outer, inner), (inks[0], replace(inks[1], priority=-1)), DOME)
    stats.assert_means(*mean_of(hidden, settings), through_a_plate(0.6, reflectance), detects=0.02)


def test_total_internal_reflection():
    """From within glass, light beyond a face is seen at 20 degrees, bent and n^2 times as bright, and not at 60."""
    box = Solid("/box", "cube", np.eye(4), GLASS, 0)
    wall = quad(Surface(BLACK, emission=WHITE), z=3.0, size=50.0)
    # Near the middle of the face, so that what is reflected there leaves by another.
    bent = 1.5**2 * (1 - float(fresnel_dielectric(math.cos(math.radians(20)), 1 / 1.5)))
    for degrees, share in ((20.0, bent), (60.0, 0.0)):
        angle = math.radians(degrees)
        towards = np.array([math.sin(angle), 0.0, math.cos(angle)])
        at = np.array([0.0, 0.0, 1.0]) - 0.5 * towards
        view = camera(at, at + towards, aperture=1e-3)
        found, _ = mean_of(
            Scene(view, (box, wall), (CLEAR,), (DomeLight("/night", BLACK),)), replace(SETTINGS, spp=256)
        )
        assert abs(found - share) < 0.03 * 1.5**2


@pytest.mark.parametrize("roughness", [0.0, 0.4])
@pytest.mark.parametrize("transport", ["reciprocal", "renewal"])
def test_furnace_of_a_medium_in_glass(transport, roughness):
    medium = Medium("/fog", mean_extinction=2.5, transport=transport, **REGIMES["pink"])
    result = render(ball(replace(GLASS, roughness=roughness), medium), SETTINGS)
    assert result.truncated_count == 0
    if roughness == 0:
        assert np.abs(result.radiance - 1).max() <= 1e-4
    else:
        stats.assert_means(*stats.image_mean(result), 1.0, detects=0.02)


def everything():
    """Glass around a medium, a sheet in front of a textured floor with a normal map, and lights."""
    rng = np.random.default_rng(2)
    image = texture_of(rng.random((4, 4, 4)))
    bend = TextureInput(image, scale=(0.4, 0.4, 0.0, 0.0), bias=(-0.2, -0.2, 1.0, 0.0))
    floor = Surface(TextureInput(image), roughness=0.3, ior=1.5, clearcoat=0.5, normal=bend)
    lights = (
        AreaLight("/lamp", "rect", (0.0, 2.0, 3.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (5.0, 4.0, 3.0)),
        DomeLight("/dome", (0.3, 0.4, 0.5)),
    )
    fog = Medium("/fog", mean_extinction=3.0, albedo=(0.9, 0.8, 0.7), **REGIMES["pink"])
    shapes = (
        Solid("/ball", "sphere", transform(0.5, (0.3, 0.0, 0.6)), replace(GLASS, roughness=0.3), 0),
        Solid(
            "/metal", "cube", transform(0.2, (-0.6, 0.4, 0.3)), Surface((0.9, 0.6, 0.3), metallic=1.0, roughness=0.2)
        ),
        quad(floor, z=-0.2),
        quad(Surface((0.2, 0.6, 0.2), opacity=0.4, ior=1.3, roughness=0.0), z=1.5, size=0.4, name="/sheet"),
    )
    return Scene(camera((0, -1, 4), (0, 0, 0), aperture=0.5), shapes, (fog,), lights)


@pytest.mark.slow
def test_both_drivers_render_the_same_picture():
    """The driver of CUDA, run on the CPU: from the same random numbers, up to the order of sums."""
    model = build_model(everything(), replace(SETTINGS, spp=4, aovs=frozenset({Aov.ALBEDO, Aov.DEPTH}), threads=1))
    pool, threads = begin(model), begin(model)
    step(model, pool, 4)
    launch_threads(model, threads)
    threads.samples[:] = 4
    a, b = develop(model, pool), develop(model, threads)
    same = np.isclose(a.radiance, b.radiance, rtol=1e-3, atol=1e-5).all(axis=-1)
    assert same.mean() > 0.995, "a path may go another way by rounding, but few do"
    assert np.abs(a.radiance.mean() - b.radiance.mean()) < 0.02 * a.radiance.mean()
