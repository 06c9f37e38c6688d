"""What a picture's settings ask for beside what the renderer does by itself; no kernel is built here."""

from dataclasses import asdict, replace

import numpy as np
import pytest

import fgf_warp.convergence
import fgf_warp.renderer
from fgf_warp import finishing
from fgf_warp.convergence import Goal
from fgf_warp.errors import ConfigError
from fgf_warp.finishing import as_rendered, finish, render_image
from fgf_warp.output.exr import read_exr, write_exr
from fgf_warp.renderer import prepare
from fgf_warp.scene import CONFORM_POLICIES
from fgf_warp.settings import RENDERED_AOVS, Aov, RenderSettings
from tests.renders import made_up_render
from tests.scenes import furnace

SETTINGS = RenderSettings(width=13, height=7, spp=4, seed=5, aovs=RENDERED_AOVS, upscale=2)


@pytest.fixture
def denoiser(monkeypatch):
    """Stands in for the real one, which may not be installed: twice the radiance."""
    monkeypatch.setattr(finishing, "check_denoiser", lambda: None)
    monkeypatch.setattr(finishing, "denoiser_version", lambda: "0")
    monkeypatch.setattr(finishing, "denoise", lambda radiance, albedo, normal: 2 * radiance)


def finished(settings: RenderSettings):
    """What is rendered, and the picture made of it."""
    rendered = made_up_render(as_rendered(furnace(), settings)[1])
    return rendered, finish(rendered, settings)


def test_settings_that_ask_for_nothing_more_change_nothing():
    scene, settings = furnace(), replace(SETTINGS, upscale=1)
    assert as_rendered(scene, settings) == (scene, settings)
    rendered, picture = finished(settings)
    assert picture.settings == settings
    for name in ("radiance", "alpha", "variance", "aovs", "provenance"):
        assert getattr(picture, name) is getattr(rendered, name) or name == "aovs"
    assert all(picture.aovs[aov] is plane for aov, plane in rendered.aovs.items())


@pytest.mark.parametrize("policy", CONFORM_POLICIES)
@pytest.mark.parametrize(("size", "factor"), [((13, 7), 2), ((8, 6), 2), ((7, 50), 4), ((3, 5), 8)])
def test_an_upscaled_picture_sees_what_the_picture_would(policy, size, factor):
    scene = furnace()
    scene = replace(scene, camera=replace(scene.camera, conform_policy=policy, pixel_aspect_ratio=1.3))
    settings = replace(SETTINGS, width=size[0], height=size[1], upscale=factor)
    seen, rendered = as_rendered(scene, settings)
    assert (rendered.width, rendered.height) == tuple(-(-pixels // factor) for pixels in size)
    window = scene.camera.window(settings.width, settings.height)
    assert seen.camera.window(rendered.width, rendered.height) == pytest.approx(window, rel=1e-14)


def test_every_plane_has_the_size_of_the_picture_and_keeps_its_kind():
    rendered, picture = finished(SETTINGS)
    assert rendered.radiance.shape == (4, 7, 3)
    assert picture.radiance.shape == picture.variance.shape == (7, 13, 3)
    assert picture.alpha.shape == (7, 13)
    for aov, plane in picture.aovs.items():
        small = rendered.aovs[aov]
        assert plane.shape == (7, 13, *small.shape[2:])
        assert plane.dtype == small.dtype
        if aov != Aov.MOTION:
            assert small.min() <= plane.min() <= plane.max() <= small.max()
    assert np.isinf(picture.aovs[Aov.DEPTH]).sum() == 4, "no pixel is between near and nothing"
    assert set(np.unique(picture.aovs[Aov.PRIM_ID])) <= set(np.unique(rendered.aovs[Aov.PRIM_ID]))
    assert set(np.unique(picture.variance)) == set(np.unique(rendered.variance))


def test_enlarging_keeps_what_is_linear_in_the_image():
    """A ramp stays a ramp, but for half a rendered pixel at the edges, and motion counts pixels of the picture."""
    rendered = made_up_render(as_rendered(furnace(), SETTINGS)[1])
    ramp = np.broadcast_to(np.arange(7, dtype=np.float32)[None, :, None], (4, 7, 3)).copy()
    motion = np.ones((4, 7, 2), dtype=np.float32)
    picture = finish(replace(rendered, radiance=ramp, aovs={**rendered.aovs, Aov.MOTION: motion}), SETTINGS)
    expected = (np.arange(13) + 0.5) * 7 / 13 - 0.5
    assert picture.radiance[3, 1:-1, 1] == pytest.approx(expected[1:-1], abs=1e-5)
    assert picture.aovs[Aov.MOTION].reshape(-1, 2) == pytest.approx(np.array([[13 / 7, 7 / 4]] * 91), rel=1e-6)


def test_an_upscaled_picture_says_so_in_its_header(tmp_path):
    _, picture = finished(SETTINGS)
    write_exr(tmp_path / "a.exr", picture)
    _, header = read_exr(tmp_path / "a.exr")
    assert header["settings"] == {"seed": 5, "spp": 4, "width": 13, "height": 7, "upscale": 2}
    assert picture.settings == SETTINGS


def test_the_denoised_plane_is_one_more_and_its_guides_are_not_written(denoiser):
    settings = replace(SETTINGS, upscale=1, aovs=frozenset({Aov.DENOISED, Aov.NORMAL}))
    rendered, picture = finished(settings)
    assert set(rendered.aovs) == {Aov.ALBEDO, Aov.NORMAL}
    assert set(picture.aovs) == {Aov.DENOISED, Aov.NORMAL}
    assert picture.radiance is rendered.radiance
    assert np.array_equal(picture.aovs[Aov.DENOISED], 2 * rendered.radiance)
    assert picture.provenance["versions"]["pyoidn"] == "0"


def test_denoised_planes_are_enlarged_after(denoiser):
    _, picture = finished(replace(SETTINGS, aovs=frozenset({Aov.DENOISED})))
    assert picture.aovs[Aov.DENOISED] == pytest.approx(2 * picture.radiance, rel=1e-6)


def test_media_get_the_transport_and_line_variance_of_the_settings():
    settings = replace(SETTINGS, transport="renewal", line_variance="exact", upscale=1)
    scene, plain = as_rendered(furnace(hurst=0.3, white_noise_scale=0.1, outer_scale=50.0), settings)
    assert (scene.media[0].transport, scene.media[0].line_variance) == ("renewal", "exact")
    assert (plain.transport, plain.line_variance) == (None, None)


@pytest.mark.parametrize(
    ("medium", "asked", "message"),
    [
        (dict(hurst=-0.7, white_noise_scale=1.0), {"transport": "mixed"}, "/medium: transport = 'mixed' .* renewal"),
        (
            dict(hurst=1.5, white_noise_scale=1.0, outer_scale=9.0),
            {"line_variance": "exact"},
            "/medium: line_variance = 'exact' with H = 1.5; accepted: asymptotic, or exact with H < 1",
        ),
        (
            dict(hurst=0.3, white_noise_scale=1.0, outer_scale=0.01),
            {"line_variance": "exact"},
            "/medium: .* the law holds up to",
        ),
    ],
)
def test_a_medium_that_cannot_have_what_is_asked_for_is_named(medium, asked, message):
    with pytest.raises(ConfigError, match=message):
        as_rendered(furnace(**medium), replace(SETTINGS, **asked))


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"upscale": 0}, r"upscale = 0; accepted: an integer in \[1, 8\]"),
        ({"upscale": 1.5}, r"upscale = 1.5; accepted"),
        ({"upscale": 9}, r"upscale = 9; accepted"),
        ({"transport": "fast"}, "transport = 'fast'; accepted: reciprocal, renewal, mixed, or None"),
        ({"line_variance": "none"}, "line_variance = 'none'; accepted: asymptotic, exact, or None"),
    ],
)
def test_settings_are_checked(setting, message):
    with pytest.raises(ConfigError, match=message):
        RenderSettings(**setting)


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ({"upscale": 2}, "upscale = 2"),
        ({"transport": "renewal"}, "transport = 'renewal'"),
        ({"line_variance": "exact"}, "line_variance"),
        ({"aovs": {Aov.DENOISED}}, "aovs"),
    ],
)
def test_the_renderer_refuses_what_it_would_not_follow(setting, named):
    settings = RenderSettings(**setting)
    with pytest.raises(ConfigError, match=f"{named}.*; accepted: fgf_warp.finishing.render_image"):
        prepare(furnace(), settings)


def test_pictures_are_rendered_to_a_goal_or_to_their_samples(monkeypatch):
    asked = []

    def render(scene, settings, progress):
        asked.append(("spp", settings))
        return made_up_render(settings)

    def render_until(scene, settings, goal, progress):
        asked.append((goal, settings))
        return made_up_render(settings)

    monkeypatch.setattr(fgf_warp.renderer, "render", render)
    monkeypatch.setattr(fgf_warp.convergence, "render_until", render_until)
    goal = Goal(error=0.1)
    for picture in (render_image(furnace(), SETTINGS), render_image(furnace(), SETTINGS, goal)):
        assert picture.settings == SETTINGS
        assert picture.radiance.shape == (7, 13, 3)
    assert [bound for bound, _ in asked] == ["spp", goal]
    assert all(asdict(settings)["upscale"] == 1 and settings.width == 7 for _, settings in asked)
