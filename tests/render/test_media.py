"""Media seen without scattering, where the picture is the law itself; nesting; chromatic extinction."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from fgf_warp.renderer import render
from fgf_warp.scene import DistantLight, Medium, Mesh, Solid, Surface
from fgf_warp.settings import RENDERED_AOVS, Aov, RenderSettings
from tests import stats
from tests.grid import PHASES, REGIMES
from tests.scenes import camera, furnace, transform

SETTINGS = RenderSettings(width=32, height=32, spp=256, seed=11)
BLACK = (0.0, 0.0, 0.0)


def through_the_middle(scene):
    """The same scene through a camera that sees the sphere's centre alone."""
    return replace(scene, camera=camera((0, 0, 5), (0, 0, 0), aperture=1e-4))


def transmittance(medium: Medium, t: float) -> float:
    return float(medium.line_law.eval_kernels(medium.mean_extinction * t).transmittance_ss)


@pytest.mark.parametrize(
    ("regime", "transport"), [*((regime, None) for regime in REGIMES), ("pink", "mixed"), ("exact fbm", "mixed")]
)
def test_absorbing_sphere_shows_the_law(regime, transport):
    scene = through_the_middle(furnace(albedo=BLACK, transport=transport, **REGIMES[regime]))
    result = render(scene, replace(SETTINGS, aovs=RENDERED_AOVS))
    expected = transmittance(scene.media[0], 2.0)
    stats.assert_means(*stats.image_mean(result), expected, detects=0.2)
    assert np.abs(result.aovs[Aov.TRANSMITTANCE] / expected - 1).max() < 2e-5
    assert np.abs(result.aovs[Aov.DEPTH] - 4.0).max() < 1e-5
    assert np.abs(1 - result.alpha - result.radiance[..., 0]).max() < 1e-6
    # A particle collides once at most, and travels as far as it survives.
    assert np.array_equal(result.aovs[Aov.COLLISIONS][..., 1], result.alpha)
    length = quad(lambda t: transmittance(scene.media[0], t), 0.0, 2.0)[0]
    stats.assert_means(*stats.image_mean(result, aov=Aov.PATH_LENGTH), length, detects=0.02)


@pytest.mark.parametrize("regime", REGIMES)
def test_camera_inside(regime):
    scene = replace(furnace(albedo=BLACK, **REGIMES[regime]), camera=camera((0, 0, 0), (1, 2, 3)))
    stats.assert_means(*stats.image_mean(render(scene, SETTINGS)), transmittance(scene.media[0], 1.0), detects=0.05)


def test_the_only_medium_in_use_need_not_be_the_first():
    scene = through_the_middle(furnace(albedo=BLACK, **REGIMES["pink"]))
    unused = Medium("/unused", 0.1, BLACK)
    ball = replace(scene.shapes[0], medium=1)
    result = render(
        replace(scene, shapes=(ball,), media=(unused, scene.media[0])), replace(SETTINGS, aovs=RENDERED_AOVS)
    )
    expected = transmittance(scene.media[0], 2.0)
    stats.assert_means(*stats.image_mean(result), expected, detects=0.2)
    assert np.abs(result.aovs[Aov.TRANSMITTANCE] / expected - 1).max() < 2e-5


def test_memory_restarts_at_boundaries():
    """Of nested media the one of higher priority fills the space, and each segment begins anew."""
    scene = furnace(albedo=BLACK, **REGIMES["pink"])
    inner = Medium("/inner", 0.7, BLACK, hurst=0.3, white_noise_scale=0.5, outer_scale=5.0, priority=2)
    scene = through_the_middle(
        replace(
            scene,
            shapes=(*scene.shapes, Solid("/core", "cube", transform(0.5), medium=1)),
            media=(scene.media[0], inner),
        )
    )
    shell, core = transmittance(scene.media[0], 0.5), transmittance(inner, 1.0)
    stats.assert_means(*stats.image_mean(render(scene, SETTINGS)), shell * core * shell, detects=0.05)


@pytest.mark.parametrize("regime", ["pink", "fbm"])
@pytest.mark.parametrize("buried", ["another medium", "the same medium"])
def test_what_does_not_change_the_medium_does_not_end_its_memory(regime, buried):
    """A buried container of lower priority, or a second one of the same medium, is not there."""
    scene = furnace(albedo=BLACK, **REGIMES[regime])
    other = Medium("/inner", 0.7, BLACK, hurst=0.3, white_noise_scale=0.5, outer_scale=5.0, priority=-1)
    core = Solid("/core", "cube", transform(0.5), medium=1 if buried == "another medium" else 0)
    scene = through_the_middle(replace(scene, shapes=(*scene.shapes, core), media=(scene.media[0], other)))
    result = render(scene, replace(SETTINGS, aovs=RENDERED_AOVS))
    expected = transmittance(scene.media[0], 2.0)
    stats.assert_means(*stats.image_mean(result), expected, detects=0.1)
    assert np.abs(result.aovs[Aov.TRANSMITTANCE] / expected - 1).max() < 2e-5


CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
BOX = np.array(
    [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ]
)


def test_a_mesh_is_the_solid_that_it_draws():
    tilt = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    tilt *= np.sign(np.linalg.det(tilt))
    matrix = np.eye(4)
    matrix[:3, :3] = tilt
    scene = furnace(fills_view=False, **(REGIMES["pink"] | dict(albedo=(0.8, 0.8, 0.8))))
    as_solid = replace(scene, shapes=(Solid("/box", "cube", matrix, medium=0),))
    as_mesh = replace(scene, shapes=(Mesh("/box", CORNERS @ tilt.T, BOX, medium=0),))
    a, b = render(as_solid, replace(SETTINGS, seed=1)), render(as_mesh, replace(SETTINGS, seed=2))
    stats.assert_images_agree(a, b, blocks=4, detects=0.05)


def box(kind, name, scale, at, **of_shape):
    if kind == "solid":
        return Solid(name, "cube", transform(scale, at), **of_shape)
    return Mesh(name, CORNERS * scale + np.asarray(at), BOX, **of_shape)


@pytest.mark.parametrize("kinds", [("solid", "solid"), ("mesh", "mesh"), ("solid", "mesh"), ("mesh", "solid")], ids=str)
@pytest.mark.parametrize("gap", [0.0, 1e-3])
def test_media_that_touch_are_both_there(kinds, gap):
    """Two absorbing blocks of depth 1, one behind the other, seen at a slant through their common face."""
    scene = furnace(albedo=BLACK, mean_extinction=1.0, hurst=-0.25, white_noise_scale=0.5)
    first = box(kinds[0], "/first", (9, 9, 0.5), (0, 0, 0.5), medium=0)
    second = box(kinds[1], "/second", (9, 9, 0.5), (0, 0, -0.5 - gap), medium=1)
    media = (scene.media[0], replace(scene.media[0], name="/other"))
    view = camera((1.1, 0.7, 5), (0, 0, 0), aperture=1e-3)
    slant = np.sqrt(1.1**2 + 0.7**2 + 25) / 5
    result = render(replace(scene, shapes=(first, second), media=media, camera=view), replace(SETTINGS, spp=1024))
    stats.assert_means(*stats.image_mean(result), transmittance(media[0], slant) ** 2, detects=0.02)


@pytest.mark.parametrize(
    "kinds",
    [("solid", "solid"), ("solid", "mesh"), ("mesh", "solid"), pytest.param(("mesh", "mesh"), marks=pytest.mark.slow)],
    ids=str,
)
def test_a_medium_that_stands_on_a_floor(kinds):
    """The picture is that of the same block a thousandth above the floor, of which the floor sees as much."""
    medium = dict(albedo=(0.8,) * 3, mean_extinction=1.0, hurst=-0.25, white_noise_scale=0.5)

    def picture(gap, seed):
        scene = furnace(**medium)
        block = box(kinds[0], "/block", (0.8, 0.8, 0.8), (0, 0, 0.8 + gap), medium=0)
        floor = box(kinds[1], "/floor", (6, 6, 0.5), (0, 0, -0.5), surface=Surface((0.7,) * 3))
        view = camera((3, 2, 3), (0, 0, 0.3), aperture=0.9)
        scene = replace(scene, shapes=(block, floor), camera=view)
        return render(scene, replace(SETTINGS, spp=1024, seed=seed))

    stats.assert_images_agree(picture(0.0, 1), picture(1e-3, 2), blocks=4, detects=0.02)


@pytest.mark.parametrize(
    ("regime", "transport"),
    [
        *itertools.product(("pink", "fbm"), ("reciprocal", "renewal")),
        ("pink", "mixed"),
        pytest.param("white", "reciprocal", marks=pytest.mark.slow),
        pytest.param("white", "renewal", marks=pytest.mark.slow),
        pytest.param("kfbm", "reciprocal", marks=pytest.mark.slow),
        ("negative", "renewal"),
        *itertools.product(("exact fbm",), ("mixed", "reciprocal")),
    ],
)
def test_chromatic_extinction_is_three_media(regime, transport):
    """Each channel of a chromatic render, and its mean collisions and path length, against that channel alone."""
    color, albedo = (1.0, 0.4, 0.2), (0.9, 0.7, 0.99)
    parameters = REGIMES[regime] | dict(transport=transport, asymmetry=0.5)
    settings = replace(SETTINGS, spp=2048, aovs=frozenset({Aov.COLLISIONS, Aov.PATH_LENGTH}))
    together = render(through_the_middle(furnace(extinction_color=color, albedo=albedo, **parameters)), settings)
    found, errors, expected = [], [], []
    for channel in range(3):
        alone = furnace(mean_extinction=2.5 * color[channel], albedo=(albedo[channel],) * 3, **parameters)
        mono = render(through_the_middle(alone), replace(settings, seed=50 + channel))
        for aov in (None, Aov.COLLISIONS, Aov.PATH_LENGTH):
            mean, error = stats.image_mean(together, channel, aov=aov)
            mono_mean, mono_error = stats.image_mean(mono, aov=aov)
            found.append(mean)
            errors.append(np.hypot(error, mono_error))
            expected.append(mono_mean)
    stats.assert_means(found, errors, expected, detects=0.02)


@pytest.mark.parametrize("density", [1e6, 1e38])
def test_chromatic_extinction_where_flights_are_shorter_than_the_rounding_of_distances(density):
    """A ball of such an optical radius: the red channel, which is drawn for a third of the paths, against it alone."""
    medium = dict(mean_extinction=density, albedo=(0.5,) * 3, hurst=-0.25, kappa=1.0)
    together = render(furnace(extinction_color=(1.0, 0.1, 0.01), **medium), replace(SETTINGS, spp=128))
    mean, error = stats.image_mean(together)
    alone, alone_error = stats.image_mean(render(furnace(**medium), replace(SETTINGS, spp=128, seed=1)))
    stats.assert_means(mean, np.hypot(error, alone_error), alone, detects=0.05)


@pytest.mark.slow
def test_media_of_different_phase_functions_are_what_they_are_alone():
    """Two balls, too far apart to see each other, in light from the side: each against the kernel made for it."""
    settings, names, apart = replace(SETTINGS, spp=1024), ("two_lobe", "draine"), 100.0
    sun = DistantLight("/sun", (0, -1, 0), 1.0, (1.0, 1.0, 1.0))
    alone = [
        replace(furnace(albedo=(0.9,) * 3, phase_function=kind, **PHASES[kind], **REGIMES["pink"]), lights=(sun,))
        for kind in names
    ]
    balls = tuple(Solid(f"/{k}", "sphere", transform(at=(apart * k, 0, 0)), medium=k) for k in range(len(names)))
    media = tuple(replace(scene.media[0], name=f"/{kind}") for kind, scene in zip(names, alone, strict=True))
    means = []
    for k, scene in enumerate(alone):
        view = camera((apart * k, 0, 5), (apart * k, 0, 0), aperture=0.28)
        among_others = render(replace(scene, shapes=balls, media=media, camera=view), replace(settings, seed=k))
        by_itself = render(scene, replace(settings, seed=50 + k))
        stats.assert_images_agree(among_others, by_itself, blocks=2, detects=0.04)
        means.append(by_itself.radiance.mean())
    assert np.ptp(means) > 0.1 * np.mean(means), "the phase functions look alike"
