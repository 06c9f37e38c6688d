"""Many images in one batch: each is what it would be alone."""

from dataclasses import replace

import numpy as np
import pytest

from fgf_warp import renderer
from fgf_warp.errors import ConfigError
from fgf_warp.features import required_features
from fgf_warp.integrator.planes import PLANES
from fgf_warp.integrator.program import build_program
from fgf_warp.renderer import Variant, batches, image_bytes, render, render_batch
from fgf_warp.settings import GIB, RENDERED_AOVS, RenderSettings
from tests import stats
from tests.grid import REGIMES
from tests.render.test_drivers import through_a_lens
from tests.render.test_render import full_scene, same
from tests.scenes import furnace

SETTINGS = RenderSettings(width=16, height=16, spp=64, max_depth=64, roulette_depth=5)


def media(count, rng, **regime):
    """Media of one regime with other numbers."""
    return [
        furnace(
            mean_extinction=rng.uniform(0.5, 4), asymmetry=rng.uniform(-0.8, 0.8), albedo=tuple(rng.random(3)), **regime
        ).media
        for _ in range(count)
    ]


@pytest.mark.parametrize("regime", ["exponential", "pink", "fbm"])
def test_means_of_256_images_are_those_of_independent_renders(regime):
    """No image of a batch takes anything from another: neither medium nor random numbers.

    The standard errors take the samples for independent, so they are a little too large; a shift of all images by
    half of one, or a spread larger than chance, would be seen.
    """
    rng = np.random.default_rng(1)
    variants = [Variant(own, seed) for seed, own in enumerate(media(256, rng, **REGIMES[regime]))]
    scene = furnace(fills_view=False)
    alone_settings = replace(SETTINGS, sampler="independent")
    z = []
    for variant, together in zip(variants, render_batch(scene, variants, SETTINGS), strict=True):
        alone = render(scene.with_media(variant.media), replace(alone_settings, seed=variant.seed + 10**6))
        difference = together.radiance.mean(axis=(0, 1)) - alone.radiance.mean(axis=(0, 1))
        variance = (together.variance + alone.variance).mean(axis=(0, 1)) / SETTINGS.width / SETTINGS.height
        z.append(difference / np.sqrt(variance))
    z = np.array(z, dtype=np.float64)
    assert np.abs(z).max() < stats.sidak_z(z.size)
    # Channels share their paths, so there are 256 independent ones.
    assert np.abs(z.mean(axis=0)).max() < stats.sidak_z(3) / np.sqrt(256)
    assert 0.7 < z.std() < 1.15


@pytest.mark.parametrize("threads", [1, 2])
def test_an_image_of_a_batch_is_to_the_bit_that_of_a_single_render(threads):
    scene, settings = full_scene(), replace(SETTINGS, spp=5, aovs=RENDERED_AOVS, threads=threads)
    rng = np.random.default_rng(2)
    variants = [
        Variant(own, 7 * k)
        for regime in ("pink", "exponential")
        for k, own in enumerate(media(4, rng, **REGIMES[regime]))
    ]
    for variant, result in zip(variants, render_batch(scene, variants, settings), strict=True):
        alone = render(scene.with_media(variant.media), replace(settings, seed=variant.seed))
        assert same(result, alone)
        assert result.settings == alone.settings
        assert result.provenance == alone.provenance


def test_a_batch_holds_as_much_as_the_memory_and_one_kernel():
    scene = furnace()
    rng = np.random.default_rng(3)
    variants = [Variant(own, 0) for regime in ("pink", "exponential") for own in media(5, rng, **REGIMES[regime])]
    settings = replace(SETTINGS, memory=3.5 * image_bytes(SETTINGS) / GIB)
    assert [len(model.variants) for model in batches(scene, variants, settings)] == [3, 2, 3, 2]
    roomy = list(render_batch(scene, variants, SETTINGS))
    assert all(same(a, b) for a, b in zip(roomy, render_batch(scene, variants, settings), strict=True))


def test_the_memory_that_an_image_is_said_to_need_is_what_it_takes(monkeypatch):
    """Its films are counted as they are, down to the byte, where the scene leaves no plane empty."""
    settings = replace(SETTINGS, aovs=RENDERED_AOVS)
    monkeypatch.setattr(renderer, "DEVELOPING_BYTES", 0)
    monkeypatch.setattr(renderer, "PLANE_BYTES", 0)
    # Its kernel need not be built.
    monkeypatch.setattr(renderer, "prepare", lambda *asked: build_program(required_features(*asked)))
    model = renderer.build_model(through_a_lens(full_scene()), settings)
    assert model.program.planes == PLANES
    state = renderer.begin(model)
    films = sum(getattr(state.film, plane.name).capacity for plane in PLANES)
    # The samples so far, and while a step is at work, those before and after it, and the order of pixels.
    assert films + 4 * state.samples.nbytes == image_bytes(settings)


def test_an_image_that_the_memory_does_not_hold_is_refused():
    settings = replace(SETTINGS, width=20000, height=20000)
    with pytest.raises(
        ConfigError, match=r"an image of 20000 x 20000 pixels needs .* GiB; accepted: at most memory = 4"
    ):
        render(furnace(), settings)


def test_numbers_of_a_medium_build_no_kernel(monkeypatch):
    """A change of H, g, S_w, sigma_m, albedo or L inside one kind of law."""
    scene = furnace(**REGIMES["pink"])
    program = build_program(required_features(scene, SETTINGS))
    for changed in (
        dict(hurst=-0.4),
        dict(asymmetry=0.9),
        dict(white_noise_scale=3.0),
        dict(mean_extinction=0.1),
        dict(albedo=(0.1, 0.2, 0.3)),
        dict(hurst=-0.1, outer_scale=2.0),
    ):
        other = scene.with_media((replace(scene.media[0], **changed),))
        assert build_program(required_features(other, SETTINGS)) is program
