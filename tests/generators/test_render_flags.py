"""The flags of `fgf render` that trade speed for accuracy, and what it says at the end."""

from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

import fgf_warp.convergence
import fgf_warp.renderer
from fgf_warp import finishing
from fgf_warp.convergence import MAX_SPP, Goal
from fgf_warp.output import denoise as door
from fgf_warp.output.color import to_display
from fgf_warp.output.exr import read_exr
from fgf_warp.output.images import read_image
from fgf_warp.settings import Aov
from generators.cli import app
from tests.renders import made_up_render


@pytest.fixture
def render(tmp_path, config_path, fake_renderer):
    """Runs `fgf render` of a small image."""
    common = ["render", config_path.parent / "scene.usda", "-o", tmp_path / "a.exr", "-w", 13, "--imageHeight", 7]

    def run(*flags):
        return CliRunner().invoke(app, [str(argument) for argument in (*common, *flags)])

    return run


@pytest.fixture
def asked(monkeypatch, fake_renderer):
    """The goals that the renderer is asked for, with scene and settings; each is rendered to an error of about 1 %."""
    found = []

    def render(scene, settings, progress=None):
        found.append((None, scene, settings))
        return made_up_render(settings)

    def render_until(scene, settings, goal, progress):
        found.append((goal, scene, settings))
        for done, total in ((1, 4 * settings.width * settings.height), (900, 1000)):
            progress(done, total)
        made = made_up_render(replace(settings, spp=min(100, goal.max_spp)))
        variance = np.broadcast_to((0.01 * made.radiance.mean()) ** 2, made.variance.shape).astype(np.float32)
        return replace(made, radiance=np.full_like(made.radiance, made.radiance.mean()), variance=variance)

    monkeypatch.setattr(fgf_warp.renderer, "render", render)
    monkeypatch.setattr(fgf_warp.convergence, "render_until", render_until)
    return found


def test_flags_become_settings(render, asked):
    flags = ("--maxDepth", 1, "--similarityOrder", 4, "--transport", "renewal", "--lineVariance", "exact")
    assert render(*flags).exit_code == 0
    assert render().exit_code == 0
    (_, changed, single), (_, plain, usual) = asked
    assert (changed.media[0].transport, changed.media[0].line_variance) == ("renewal", "exact")
    assert (plain.media[0].transport, plain.media[0].line_variance) == (None, "asymptotic")
    assert (single.max_depth, single.similarity_order) == (1, 4)
    assert (usual.max_depth, usual.similarity_order) == (1024, None)


@pytest.mark.parametrize(("flags", "is_told"), [((), True), (("--maxDepth", 1), False)])
def test_paths_that_were_cut_are_told_unless_that_was_asked_for(render, fake_renderer, monkeypatch, flags, is_told):
    monkeypatch.setattr(
        fgf_warp.renderer,
        "render",
        lambda scene, settings, progress=None: replace(made_up_render(settings), truncated_count=5),
    )
    outcome = render(*flags)
    assert outcome.exit_code == 0
    assert ("paths (" in outcome.stderr and "were cut after" in outcome.stderr) == is_told


def test_an_upscaled_picture_is_as_large_as_asked_for(tmp_path, render, asked):
    assert render("--upscale", 2).exit_code == 0
    assert (asked[0][2].width, asked[0][2].height) == (7, 4)
    channels, header = read_exr(tmp_path / "a.exr")
    assert channels["R"].shape == (7, 13)
    assert header["settings"]["upscale"] == 2


def test_denoise_adds_a_plane_which_the_view_shows(tmp_path, render, asked, monkeypatch):
    monkeypatch.setattr(finishing, "check_denoiser", lambda: None)
    monkeypatch.setattr(finishing, "denoiser_version", lambda: "0")
    monkeypatch.setattr(finishing, "denoise", lambda radiance, albedo, normal: radiance / 2)
    outcome = render("--denoise", "--aov", "depth", "--png", tmp_path / "a.png")
    assert outcome.exit_code == 0, outcome.output
    assert asked[0][2].aovs == {Aov.DEPTH, Aov.ALBEDO, Aov.NORMAL}
    channels, _ = read_exr(tmp_path / "a.exr")
    assert set(channels) == {"R", "G", "B", "A", "Z", "denoised.R", "denoised.G", "denoised.B"}
    shown = np.stack([channels[f"denoised.{name}"] for name in "RGB"], axis=2)
    pixels, _, _ = read_image(tmp_path / "a.png")
    assert np.array_equal(np.rint(pixels * 255), to_display(shown))
    assert np.array_equal(shown[..., 0], channels["R"] / 2)


@pytest.mark.parametrize(
    ("flags", "goal", "ended"),
    [
        (("--target-error", "0.02"), Goal(error=0.02), "ended by --targetError 0.02"),
        (("--targetError", "2%", "--errorOver", "p95"), Goal(error=0.02, over="p95"), "ended by --targetError 0.02"),
        (("--time", 3), Goal(time=3.0), "ended by --time 3"),
        (("--time", 3, "--targetError", "0.1%"), Goal(error=0.001, time=3.0), "ended by --time 3"),
        (("--time", 3, "--targetError", "2%"), Goal(error=0.02, time=3.0), "ended by --targetError 0.02"),
        (("--time", 3, "--spp", 64), Goal(time=3.0, max_spp=64), "ended by --spp 64"),
        (("--targetError", "0.1%", "--spp", 64), Goal(error=0.001, max_spp=64), "ended by --spp 64"),
    ],
)
def test_goals_end_by_the_bound_that_is_met_first(render, asked, flags, goal, ended):
    outcome = render(*flags)
    assert outcome.exit_code == 0, outcome.output
    assert asked[0][0] == goal
    assert ended in outcome.stdout
    spp = min(100, goal.max_spp)
    assert f"{spp} samples per pixel, {goal.over} relative standard error 1.00%" in outcome.stdout


def test_without_a_goal_nothing_ends_a_render_early(render, asked):
    outcome = render("--spp", 64)
    assert asked[0][0] is None
    assert asked[0][2].spp == 64
    assert "ended by" not in outcome.stdout
    assert Goal(time=1.0).max_spp == MAX_SPP


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (("--upscale", 0), "upscale = 0; accepted: an integer in [1, 8]"),
        (("--maxDepth", 0), "max_depth = 0; accepted: an integer in [1, "),
        (("--similarityOrder", 0), "similarity_order = 0; accepted"),
        (("--transport", "fast"), "--transport fast: accepted: reciprocal, renewal, mixed"),
        (("--lineVariance", "none"), "--lineVariance none: accepted: asymptotic, exact"),
        (("--targetError", "small"), "--targetError small: accepted: a share such as 0.01 or 1%"),
        (("--targetError", "nan"), "error = nan; accepted: a relative error in (0, 1)"),
        (("--targetError", "100%"), "error = 1.0; accepted: a relative error in (0, 1)"),
        (("--targetError", "1%", "--errorOver", "max"), "over = 'max'; accepted: mean, rms, or a percentile"),
        (("--errorOver", "rms"), "--errorOver is of the error that --targetError asks for, which is missing"),
        (("--time", 0), "time = 0.0; accepted: seconds > 0"),
        (("--time", 1, "--spp", 2), "max_spp = 2; accepted: an integer in [4, 2^31)"),
    ],
)
def test_flags_are_refused_before_rendering(tmp_path, render, asked, flags, message):
    outcome = render(*flags)
    assert outcome.exit_code == 2, outcome.output
    assert message in outcome.stderr
    assert not asked
    assert not (tmp_path / "a.exr").exists()


def test_a_missing_denoiser_is_told_before_rendering(render, asked, monkeypatch):
    monkeypatch.setattr(door, "find_spec", lambda name: None)
    outcome = render("--denoise")
    assert outcome.exit_code == 2, outcome.output
    assert "pip install 'fgf-warp[denoise]'" in outcome.stderr
    assert not asked
