"""Renders as simulations: what must not change a pixel, and what must."""

from dataclasses import replace

import numpy as np
import pytest

from fgf_warp import launching, renderer
from fgf_warp.errors import ConfigError, NumericalError, UnsupportedFeatureError
from fgf_warp.features import required_features
from fgf_warp.integrator.program import build_program
from fgf_warp.renderer import begin, build_model, check_device, develop, render, step
from fgf_warp.scene import AreaLight, Solid, Surface
from fgf_warp.settings import RENDERED_AOVS, Aov, RenderSettings
from tests import stats
from tests.grid import REGIMES
from tests.scenes import furnace, transform

SETTINGS = RenderSettings(width=40, height=24, spp=24, seed=3, aovs=RENDERED_AOVS)


def full_scene():
    """Medium, floor, dome and rect light."""
    scene = furnace(sky=(0.3, 0.4, 0.6), fills_view=False, albedo=(0.8, 0.7, 0.6), asymmetry=0.4, **REGIMES["pink"])
    floor = Solid("/floor", "cube", transform((5, 1, 5), (0, -2.2, 0)), Surface((0.5, 0.4, 0.3)))
    lamp = AreaLight("/lamp", "rect", (0, 3, 0), (1, 0, 0), (0, 0, 1), (9.0, 8.0, 7.0))
    return replace(scene, shapes=(*scene.shapes, floor), lights=(*scene.lights, lamp))


def same(a, b):
    return (
        np.array_equal(a.radiance, b.radiance)
        and np.array_equal(a.variance, b.variance)
        and np.array_equal(a.alpha, b.alpha)
        and all(np.array_equal(a.aovs[aov], b.aovs[aov]) for aov in a.aovs)
        and a.truncated_count == b.truncated_count
    )


def test_threads_and_steps_do_not_change_a_pixel(monkeypatch):
    scene = full_scene()
    whole = render(scene, replace(SETTINGS, threads=1))
    assert same(whole, render(scene, replace(SETTINGS, threads=3)))
    monkeypatch.setattr(launching, "PATHS_PER_LAUNCH", 100)
    assert same(whole, render(scene, SETTINGS))
    model = build_model(scene, SETTINGS)
    state = begin(model)
    for samples in (1, 7, 16):
        step(model, state, samples)
    assert same(whole, develop(model, state))


def test_seed_decides_the_noise():
    scene = full_scene()
    first = render(scene, replace(SETTINGS, seed=0))
    assert same(first, render(scene, replace(SETTINGS, seed=0)))
    for seed in (1, 2**32, 2**64 - 1):
        assert not np.array_equal(first.radiance, render(scene, replace(SETTINGS, seed=seed)).radiance)


def test_progress_reaches_the_end():
    seen = []
    render(full_scene(), SETTINGS, lambda done, total: seen.append((done, total)))
    assert seen[-1] == (40 * 24 * 24, 40 * 24 * 24)
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)


@pytest.mark.parametrize("regime", ["exponential", "pink", "fbm"])
@pytest.mark.parametrize(
    "added", [{"meshes": True}, {"surfaces": True}, {"aovs": RENDERED_AOVS}], ids=["meshes", "surfaces", "aovs"]
)
def test_features_that_a_scene_does_not_need_do_not_change_a_pixel(regime, added, monkeypatch):
    scene = furnace(albedo=(0.9, 0.8, 0.7), asymmetry=0.3, **REGIMES[regime])
    settings = replace(SETTINGS, aovs=frozenset())
    lean = render(scene, settings)
    require(added, scene, settings, monkeypatch)
    if "aovs" in added:
        # The film must then hold the planes that the kernel writes.
        settings = replace(settings, aovs=RENDERED_AOVS)
    assert np.allclose(render(scene, settings).radiance, lean.radiance, rtol=1e-4, atol=0)


def require(added, scene, settings, monkeypatch):
    """Makes the renderer build the kernel of this scene with further features."""
    features = required_features(scene, settings)
    more = replace(features, **added)
    assert more != features
    monkeypatch.setattr(renderer, "required_features", lambda scene, settings: more)


LONE = {"lone_law": "", "lone_solid": False}


@pytest.mark.parametrize("regime", ["exponential", "pink", "fbm"])
@pytest.mark.parametrize("make", [full_scene, lambda: furnace(fills_view=False)], ids=["full", "sphere"])
@pytest.mark.parametrize(
    "added",
    [{"lone_solid": False}, pytest.param(LONE, marks=pytest.mark.slow), LONE | {"chromatic": True}],
    ids=str,
)
def test_a_chord_through_the_medium_is_the_same_as_crossing_its_boundaries(regime, make, added, monkeypatch):
    """The road of the lone solid against the one that any number of media take, in blocks of the image."""
    scene = replace(make(), media=furnace(albedo=(0.9, 0.8, 0.7), asymmetry=0.3, **REGIMES[regime]).media)
    settings = replace(SETTINGS, width=32, height=32, spp=512)
    chord = render(scene, settings)
    require(added, scene, settings, monkeypatch)
    crossing = render(scene, replace(settings, seed=4))
    stats.assert_images_agree(chord, crossing, blocks=4, detects=0.1)
    for aov in (Aov.COLLISIONS, Aov.PATH_LENGTH):
        stats.assert_planes_agree(chord.aovs[aov], crossing.aovs[aov], detects=0.05)
    for aov in (Aov.DEPTH, Aov.TRANSMITTANCE):
        near, far = chord.aovs[aov], crossing.aovs[aov]
        whole = np.isfinite(near) & np.isfinite(far)
        assert whole.mean() > 0.4
        # Edges of shapes, where each has samples of its own, apart.
        assert np.median(np.abs(near[whole] / far[whole] - 1)) < 0.01


def test_a_kernel_is_built_for_categories_not_for_numbers():
    scene = furnace(**REGIMES["pink"])
    others = [furnace(asymmetry=-0.3, albedo=(0.5,) * 3, **REGIMES[regime]) for regime in ("negative", "pink near fBm")]
    program = build_program(required_features(scene, SETTINGS))
    assert all(build_program(required_features(other, SETTINGS)) is program for other in others)
    assert build_program(required_features(furnace(), SETTINGS)) is not program


def test_variance_is_that_of_the_mean():
    """The spread of 64 independent renders is the variance that each states, within 5 standard errors (11 %)."""
    settings = replace(SETTINGS, width=24, height=24, spp=8, sampler="independent")
    renders = [render(full_scene(), replace(settings, seed=seed)) for seed in range(64)]
    spread = np.var([r.radiance for r in renders], axis=0, ddof=1, dtype=np.float64).mean()
    stated = np.mean([r.variance for r in renders], dtype=np.float64)
    assert abs(spread / stated - 1) < 0.11


def test_a_bound_on_the_path_is_reported():
    result = render(furnace(mean_extinction=20.0), replace(SETTINGS, max_depth=4))
    assert result.truncated_count > 0
    assert result.radiance.mean() < 0.9


def test_samples_that_are_not_finite_stop_the_render():
    scene = furnace(sky=(3e38, 1.0, 1.0), fills_view=True, **REGIMES["pink"])
    floor = Solid("/floor", "cube", transform((5, 1, 5), (0, -2.2, 0)), Surface((0.5,) * 3, (3e38, 0, 0)))
    scene = replace(scene, shapes=(*scene.shapes, floor))
    with pytest.raises(
        NumericalError, match=r"not finite, most of them in pixel \(\d+, \d+\) with seed 3 \(/medium: H = -0.25"
    ):
        render(scene, SETTINGS)


def test_unknown_device():
    with pytest.raises(ConfigError, match="device = 'cuda:9'; accepted on this machine: cpu"):
        check_device("cuda:9")


def test_too_many_containers():
    scene = furnace()
    many = tuple(Solid(f"/s{i}", "sphere", transform(0.01, (i, 0, 0)), medium=0) for i in range(65))
    with pytest.raises(UnsupportedFeatureError, match="65 shapes are filled with media"):
        render(replace(scene, shapes=many), SETTINGS)


@pytest.mark.parametrize(
    ("key", "value"), [("width", 0), ("spp", 0), ("seed", -1), ("seed", 2**64), ("max_depth", 0), ("spp", 2.5)]
)
def test_settings_are_checked(key, value):
    with pytest.raises(ConfigError, match=rf"{key} = {value}; accepted: an integer in \["):
        RenderSettings(**{key: value})
