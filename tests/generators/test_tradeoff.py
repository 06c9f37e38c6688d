"""`fgf tradeoff`: what it says of noise and bias is true, and its intervals hold what they should."""

import dataclasses
import json
import logging
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import fgf_warp.renderer
import usd_scenes.reader
from fgf_warp.errors import ConfigError
from fgf_warp.output import flip
from fgf_warp.scene import Medium
from fgf_warp.settings import BALANCED, Aov, RenderSettings, Sampler
from generators.cli import app
from generators.tradeoff import measure as measuring
from generators.tradeoff import run
from generators.tradeoff.config import LADDER, MediumConfig, RungConfig, load_tradeoff, variations
from generators.tradeoff.front import BASE, Front, Rung, read_front, write_front
from generators.tradeoff.metrics import bright_blocks, compare, relative_standard_error, relative_weights
from generators.tradeoff.reference import default_cache, reference_settings, render_reference
from tests.browser import CHROMIUM, Page
from tests.renders import made_up_render
from tests.scenes import furnace
from usd_scenes.reader import StageReading

needs_flip = pytest.mark.skipif(flip.find_spec("flip_evaluator") is None, reason="the extra quality is not installed")
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium")
TINY = RenderSettings(width=16, height=16, spp=4)


# ---- metrics


def true_image() -> np.ndarray:
    """A bright spot of three colours over next to nothing."""
    y, x = np.mgrid[:16, :16]
    return np.exp(-((x - 7) ** 2 + (y - 9) ** 2) / 40)[..., None] * [1.0, 0.7, 0.4] + 0.02


def simulate(rng, expectation: np.ndarray, spp: int, count: int) -> np.ndarray:
    """Images as skewed as renders of few samples: gamma distributed, with a variance that follows the brightness."""
    shape = np.full(expectation.shape, 0.3 * spp)
    return rng.gamma(shape, expectation / shape, size=(count, *expectation.shape))


def true_bias(expectation: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """Signed mean and root mean square, relative."""
    scale = relative_weights(truth)
    signed = ((expectation - truth) * scale**2 * bright_blocks(truth)).sum()
    return float(signed), float(np.sqrt((((expectation - truth) * scale) ** 2).sum()))


@pytest.mark.parametrize("depth", [0.0, 0.05], ids=["without bias", "with a wavy bias"])
def test_intervals_cover_the_truth_as_often_as_they_say(depth):
    # A coverage of 95 % gives 90 to 99 of 100 with a probability of 0.98, and 368 to 391 of 400 with 0.99; one of 90 %
    # fails the latter with 0.9. The reference is only twice as good as an image.
    truth = true_image()
    expectation = truth * (1 + depth + depth * np.sin(np.arange(16) / 3)[:, None, None])
    signed, rms = true_bias(expectation, truth)
    rng = np.random.default_rng(5)
    found = [compare(simulate(rng, expectation, 16, 8), simulate(rng, truth, 64, 8)) for _ in range(400)]
    covered = [errors.bias_low <= signed <= errors.bias_high for errors in found]
    assert 90 <= sum(covered[:100]) <= 99
    assert 368 <= sum(covered) <= 391
    # Of the size of the bias only the upper end is asked for, and it may be careful.
    assert sum(rms <= errors.bias_rms_high for errors in found) >= 386


def test_noise_and_bias_add_up_to_the_error_and_the_reference_is_in_none():
    truth = true_image()
    expectation = truth * 1.1
    rng = np.random.default_rng(6)
    found = [compare(simulate(rng, expectation, 64, 6), simulate(rng, truth, 128, 6)) for _ in range(200)]
    scale = relative_weights(truth)
    noise2 = float((expectation**2 / (0.3 * 64) * scale**2).sum())
    _, rms = true_bias(expectation, truth)
    assert np.mean([errors.noise**2 for errors in found]) == pytest.approx(noise2, rel=0.01)
    assert np.mean([errors.relative_mse for errors in found]) == pytest.approx(noise2 + rms**2, rel=0.01)
    # The reference's variance alone, had it not been taken out, would make it too large by a tenth.
    assert np.mean([errors.bias_rms**2 for errors in found]) == pytest.approx(rms**2, rel=0.04)
    plain = (expectation**2 / (0.3 * 64)).mean() + ((expectation - truth) ** 2).mean()
    assert np.mean([errors.rmse**2 for errors in found]) == pytest.approx(plain, rel=0.01)


def test_the_reference_tells_its_own_error():
    truth = true_image()
    rng = np.random.default_rng(7)
    found = np.mean([relative_standard_error(simulate(rng, truth, 64, 8)) ** 2 for _ in range(100)])
    assert found == pytest.approx(float((truth**2 / (0.3 * 64 * 8) * relative_weights(truth) ** 2).sum()), rel=0.02)


def test_equal_images_have_no_error_and_black_ones_none_either():
    images = np.broadcast_to(true_image(), (4, 16, 16, 3))
    for one in (images, np.zeros((4, 16, 8, 3))):
        errors = compare(one, one)
        assert dataclasses.astuple(errors) == (0.0,) * 7


def test_black_blocks_count_for_nothing():
    lit, expectation = true_image(), true_image() * 1.1
    rng = np.random.default_rng(8)
    images, parts = simulate(rng, expectation, 16, 4), simulate(rng, lit, 64, 4)
    wider = [np.pad(each, ((0, 0), (0, 0), (0, 8), (0, 0))) for each in (images, parts)]
    assert compare(*wider).relative_mse == pytest.approx(compare(images, parts).relative_mse, rel=1e-9)


# ---- config


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("stages: [sphere]\nstage: a\n", r"config.yaml:2: stage: unknown key; did you mean stages\?"),
        ("media: []\n", r"config.yaml: stages: this key is missing"),
        ("stages: []\n", r"config.yaml:1: stages: found \[\]; accepted: "),
        ("stages: [sphere]\nmedia:\n- {h: 1}\n", r"config.yaml:3: media\[0\].h: unknown key; did you mean H\?"),
        ("stages: [sphere]\nmedia:\n- {albedo: 2}\n", r"config.yaml:3: media\[0\].albedo: found 2; accepted: less"),
        ("stages: [sphere]\nmedia: [{transport: fast}]\n", r"media\[0\].transport: found 'fast'; accepted: 'recip"),
        ("stages: [sphere]\nladder: {a: {sp: 1}}\n", r"ladder.a.sp: unknown key; did you mean spp\?"),
        ("stages: [sphere]\nladder: {a: {spp: 0}}\n", r"ladder.a.spp: found 0; accepted: greater than or equal to 1"),
        ("stages: [sphere]\nladder: {balanced: {spp: 1}}\n", r"ladder.balanced: is the preset of that name; acc"),
        ("stages: [sphere]\nreplicates: 3\n", "config.yaml:2: replicates: found 3; accepted: greater than or equal"),
        ("stages: [sphere]\nsize: 2000\n", "config.yaml:2: size: found 2000; accepted: less than or equal to 1024"),
    ],
)
def test_error_says_where_what_and_what_instead(write_config, lines, message):
    with pytest.raises(ConfigError, match=message) as caught:
        load_tradeoff(write_config(lines))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("stages: [spere.usda]\n", "stages: spere.usda: there is no such file; accepted: a USD file, or cloud_block"),
        ("stages: [sphere]\nmedia: [{H: 0}]\n", r"config.yaml: sphere: H = 0: .*H = 0; accepted"),
        ("stages: [sphere]\nmedia: [{H: -0.9, transport: mixed}]\n", "accepted for H < -0.5: renewal only"),
    ],
)
def test_what_cannot_be_is_refused_before_work_begins(write_config, lines, message):
    with pytest.raises(ConfigError, match=message):
        measuring.list_subjects(load_tradeoff(write_config(lines)))


def test_the_shipped_config_spans_the_regimes():
    loaded = load_tradeoff(Path("configs/tradeoff.yaml"))
    subjects, _ = measuring.list_subjects(loaded)
    media = [subject.scene.media[0] for subject in subjects]
    assert {medium.line_law.regime for medium in media} >= {"exponential", "white", "pink", "negative", "fbm"}
    assert {"reciprocal", "renewal"} <= {medium.resolved_transport for medium in media}
    assert min(medium.asymmetry for medium in media) < 0
    assert max(medium.asymmetry for medium in media) > 0.9
    assert len({subject.name for subject in subjects}) == len(subjects)


def test_a_stage_is_measured_as_it_is_and_around():
    subjects, _ = measuring.list_subjects(load_tradeoff(Path("usd_scenes/stages/studio.usda"), ["size=8"]))
    media = [subject.scene.media[0] for subject in subjects]
    assert subjects[0].name == "studio: as authored"
    assert len({medium.mean_extinction for medium in media}) == 3
    assert len({medium.hurst for medium in media}) >= 2
    assert len({medium.asymmetry for medium in media}) == 2
    assert len(set(media)) == len(media)


def test_the_ladder_has_each_knob_alone_and_what_changes_nothing_is_left_out():
    scene = furnace(hurst=-0.25, white_noise_scale=1.0, asymmetry=0.5)
    rungs = measuring.applicable_rungs(scene, LADDER)
    assert rungs[BASE].apply(TINY) == TINY
    assert rungs["preview"].overrides() == {"spp": 16}
    assert {"similarity 4", "renewal"} <= set(rungs)
    assert not {"reciprocal", "asymptotic variance", "exact variance"} & set(rungs)
    even = scene.with_media((replace(scene.media[0], asymmetry=0.0),))
    assert "similarity 4" not in measuring.applicable_rungs(even, LADDER)
    # Below white noise there is but one transport, and without correlation all are the same.
    for changes in ({"hurst": -0.7}, {"white_noise_scale": 0.0}):
        other = scene.with_media((replace(scene.media[0], **changes),))
        assert not {"renewal", "reciprocal"} & set(measuring.applicable_rungs(other, LADDER))
    bounded = scene.with_media((replace(scene.media[0], hurst=0.25, outer_scale=10.0),))
    assert "exact variance" in measuring.applicable_rungs(bounded, LADDER)
    assert Aov.DENOISED in RungConfig(denoise=True).apply(TINY).aovs
    assert RungConfig(sampler="independent").apply(TINY).sampler is Sampler.INDEPENDENT


def test_an_authored_kappa_gives_way_to_a_scale():
    medium = Medium("m", 2.0, hurst=-0.25, kappa=3.0)
    assert MediumConfig(S_w=1.0).apply(medium).kappa is None
    assert MediumConfig(g=0.5, albedo=0.25).apply(medium) == replace(medium, asymmetry=0.5, albedo=(0.25,) * 3)
    assert str(MediumConfig(H=-0.25, g=0.5)) == "H = -0.25, g = 0.5"
    assert all(isinstance(edit.apply(medium), Medium) for edit in variations(medium))


# ---- reference


def test_a_reference_is_rendered_once(fake_renderer, tmp_path):
    settings = reference_settings(TINY, spp=4, replicates=4)
    assert settings.spp == 32
    assert settings.sampler is Sampler.INDEPENDENT
    first = render_reference(furnace(), settings, 4, tmp_path)
    again = render_reference(furnace(), settings, 4, tmp_path)
    assert len(fake_renderer) == len(set(fake_renderer)) == 4
    assert (first.cached, again.cached) == (False, True)
    assert np.array_equal(first.parts, again.parts)
    assert (again.spp, again.seconds) == (128, first.seconds)


@pytest.mark.parametrize("change", ["medium", "size", "spp", "parts", "depth", "version"])
def test_another_one_is_rendered_for_another(change, fake_renderer, tmp_path, monkeypatch):
    settings = reference_settings(TINY, spp=4, replicates=4)
    render_reference(furnace(), settings, 4, tmp_path)
    assert render_reference(furnace(), replace(settings, threads=1, memory=1.0), 4, tmp_path).cached
    scene = furnace(hurst=-0.25) if change == "medium" else furnace()
    other = {"size": {"width": 8}, "spp": {"spp": 5}, "depth": {"max_depth": 7}}.get(change, {})
    if change == "version":
        monkeypatch.setattr("generators.tradeoff.reference.__version__", "99")
    parts = 5 if change == "parts" else 4
    assert not render_reference(scene, replace(settings, **other), parts, tmp_path).cached


def test_a_damaged_reference_is_told_and_rendered_anew(fake_renderer, tmp_path, caplog):
    first = render_reference(furnace(), TINY, 4, tmp_path)
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:1000])
    with caplog.at_level(logging.WARNING):
        again = render_reference(furnace(), TINY, 4, tmp_path)
    assert "rendered anew" in caplog.text
    assert not again.cached
    assert np.array_equal(first.parts, again.parts)
    assert render_reference(furnace(), TINY, 4, tmp_path).cached


def test_the_cache_is_where_the_system_says(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert default_cache() == tmp_path / "fgf-warp" / "references"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert default_cache() == Path.home() / ".cache" / "fgf-warp" / "references"


# ---- the front


def test_the_front_that_is_shipped_can_be_read():
    front = read_front()
    assert len(front.pairs) >= 12
    regimes = {pair.medium["regime"] for pair in front.pairs}
    assert regimes >= {"exponential", "white", "pink", "negative", "fbm"}
    for pair in front.pairs:
        base = pair.rung(BASE)
        assert base.settings == {}
        assert base.spp == BALANCED.spp
        assert base.efficiency == 1.0
        assert base.relative_rmse > 3 * pair.reference.relative_standard_error
        assert any(rung.pareto for rung in pair.rungs)
        assert {"optical_depth", "scatterings", "regime", "H", "g", "albedo"} <= set(pair.features)
        for rung in pair.rungs:
            assert rung.bias_low <= rung.bias <= rung.bias_high
            assert rung.relative_rmse**2 == pytest.approx(rung.noise**2 + rung.bias_rms**2)
            assert rung.bias_rms <= rung.bias_rms_high


def test_a_rung_tells_what_it_needs_for_an_error():
    numbers = dict.fromkeys((field.name for field in dataclasses.fields(Rung)), 0.0)
    rung = Rung(**numbers | {"settings": {}, "spp": 100, "seconds": 2.0, "noise": 0.04, "bias_rms": 0.5})
    assert rung.is_unbiased
    assert rung.spp_for(0.02) == pytest.approx(400)
    assert rung.seconds_for(0.02) == pytest.approx(8.0)
    biased = replace(rung, settings={"max_depth": 4}, bias_rms=0.03)
    assert not biased.is_unbiased
    assert biased.spp_for(0.05) == pytest.approx(100)
    assert biased.spp_for(0.03) is biased.seconds_for(0.02) is None
    denoised = replace(rung, settings={"denoise": True}, relative_rmse=0.03)
    assert denoised.spp_for(0.03) == 100
    assert denoised.spp_for(0.02) is None


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"pairs": [{}]}', '{"pairs": 3}'])
def test_what_is_no_front_is_refused(content, tmp_path):
    file = tmp_path / "tradeoff.json"
    with pytest.raises(ConfigError, match="cannot be read: No such file"):
        read_front(file)
    file.write_text(content)
    with pytest.raises(ConfigError, match="is no measurement of `fgf tradeoff`"):
        read_front(file)


# ---- the command and what it writes


LADDER_LINES = "ladder: {quick: {spp: 4}, few: {max_depth: 2}, sampler: {sampler: independent}}"


@pytest.fixture
def command(fake_renderer, tmp_path, monkeypatch):
    """`fgf tradeoff` of two media and four rungs, whose renders are made up, and which draws nothing."""
    scene = furnace(hurst=-0.25, white_noise_scale=1.0, asymmetry=0.5)
    monkeypatch.setattr(usd_scenes.reader, "read_scene", lambda path, **_: StageReading(scene, None, ("odd",)))
    monkeypatch.setattr("generators.tradeoff.report.draw_front", lambda front: b"figure")
    monkeypatch.setattr("generators.tradeoff.report.write_tradeoff_report", lambda outcome, path, _: path.touch())
    (tmp_path / "scene.usda").write_text("")
    config = tmp_path / "trial.yaml"
    config.write_text(f"stages: [scene.usda]\nmedia: [{{}}, {{H: -0.5}}]\nsize: 16\nreplicates: 4\n{LADDER_LINES}\n")

    def call(*arguments: str):
        options = ["--out", str(tmp_path / "out"), "--cache", str(tmp_path / "cache"), *arguments]
        return CliRunner().invoke(app, ["tradeoff", str(config), *options])

    return call


@needs_flip
def test_the_command_writes_numbers_figure_and_page(command, tmp_path):
    answer = command()
    assert answer.exit_code == 0, answer.output
    assert "warning: scene.usda: odd" in answer.stderr
    files = sorted(file.name for file in (tmp_path / "out").iterdir())
    assert files == ["front.svg", "tradeoff.html", "tradeoff.json"]
    file = tmp_path / "out" / "tradeoff.json"
    front = read_front(file)
    assert [pair.name for pair in front.pairs] == ["scene: as authored", "scene: H = -0.5"]
    assert [rung.name for rung in front.pairs[0].rungs] == [BASE, "quick", "few", "sampler"]
    assert front.pairs[0].rung("quick").settings == {"spp": 4}
    assert front.pairs[1].medium["H"] == -0.5
    # Nothing that is not a number in the sense of JSON, and all that was written is read.
    json.loads(file.read_text(), parse_constant=pytest.fail)
    write_front(tmp_path / "again.json", front)
    assert (tmp_path / "again.json").read_bytes() == file.read_bytes()
    assert "taken from" not in answer.stdout
    assert f"2 of 2 references taken from {tmp_path / 'cache'}" in command().stdout


@needs_flip
def test_a_stop_leaves_what_was_there(command, tmp_path, monkeypatch):
    assert command().exit_code == 0
    before = {file: file.read_bytes() for file in (tmp_path / "out").iterdir()}
    render, count = fgf_warp.renderer.render, 0

    def stopped(scene, settings, progress=None):
        nonlocal count
        count += 1
        if count > 20:
            raise KeyboardInterrupt
        return render(scene, settings, progress)

    monkeypatch.setattr(fgf_warp.renderer, "render", stopped)
    answer = command("--set", "size=8")
    assert answer.exit_code == 3
    assert "stopped; no report is written" in answer.stderr
    assert {file: file.read_bytes() for file in (tmp_path / "out").iterdir()} == before
    assert len(list((tmp_path / "cache").iterdir())) == 3


@pytest.mark.parametrize("missing", ["flip_evaluator", "pyoidn"])
def test_without_an_extra_nothing_is_begun(command, fake_renderer, tmp_path, monkeypatch, missing):
    monkeypatch.setattr("fgf_warp.output.flip.find_spec", lambda name: None if name == missing else "found")
    monkeypatch.setattr("fgf_warp.output.denoise.find_spec", lambda name: None if name == missing else "found")
    answer = command("--set", "ladder={a: {denoise: true}}")
    assert answer.exit_code == 2
    assert "pip install 'fgf-warp[" in answer.stderr
    assert not fake_renderer
    assert not (tmp_path / "out").exists()


@needs_flip
@pytest.mark.parametrize("option", ["--out", "--cache"])
def test_a_folder_that_cannot_be_is_told_first(command, fake_renderer, tmp_path, option):
    answer = command(option, str(tmp_path / "trial.yaml" / "folder"))
    assert answer.exit_code == 2
    assert "cannot be made" in answer.stderr
    assert not fake_renderer


@pytest.fixture(scope="module")
def page_file(tmp_path_factory):
    """A report of one pair, whose renders are made up."""
    folder = tmp_path_factory.mktemp("report")
    scene = furnace(hurst=-0.25, white_noise_scale=1.0)
    rungs = {BASE: RungConfig(), "quick": RungConfig(spp=4), "cut": RungConfig(max_depth=1)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fgf_warp.renderer, "render", lambda scene, settings, progress=None: made_up_render(settings))
        subject = measuring.Subject("a: <b>", "a.usda", scene)
        measured = measuring.measure_pair(subject, TINY, rungs, 4, folder)
    outcome = measuring.Outcome(Front({"fgf-warp": "1"}, "a machine", 16, 4, (measured.pair,)), (measured,))
    *_, page = run.write(outcome, folder, "fgf tradeoff a.yaml")
    return page


@needs_flip
def test_the_page_needs_no_other_file(page_file):
    page = page_file.read_text()
    assert not re.findall(r"""(?:href|src)=["'](?!#|data:)""", page)
    assert str(page_file.parent) not in page
    assert "a: &lt;b&gt;" in page
    # The reference, and a picture of each rung beside its error.
    assert page.count("data:image/png") == 4
    assert (page_file.parent / "front.svg").read_bytes().startswith(b"<?xml")


@needs_flip
@needs_browser
@pytest.mark.parametrize(("width", "dark"), [(1280, False), (400, True)])
def test_a_browser_has_nothing_to_complain_of(page_file, width, dark):
    with Page(page_file, width, dark=dark) as page:
        assert page.complaints == []
        assert [url for url in page.requests if not url.startswith("data:")] == [page_file.as_uri()]
        assert page.run("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
        assert page.run("[...document.images].every(image => image.naturalWidth > 0)")
        background = page.run("getComputedStyle(document.body).backgroundColor")
        assert (background == "rgb(255, 255, 255)") is not dark


# ---- renders


@pytest.mark.slow
def test_intervals_cover_the_truth_of_renders():
    """100 measurements of a bias that is known from 2000 times as many samples; 95 % of intervals should cover it."""
    scene = furnace(albedo=(0.9, 0.8, 0.6), hurst=-0.25, white_noise_scale=1.0)
    settings = replace(TINY, spp=16, max_depth=2)
    parts = replace(TINY, spp=64, max_depth=65536, roulette_depth=32, sampler=Sampler.INDEPENDENT)

    def images(settings: RenderSettings, count: int, first: int) -> np.ndarray:
        variants = [fgf_warp.renderer.Variant(scene.media, first + index) for index in range(count)]
        return np.stack([made.radiance for made in fgf_warp.renderer.render_batch(scene, variants, settings)])

    truth = images(replace(parts, spp=2**16), 4, 10**6).mean(axis=0, dtype=np.float64)
    expectation = images(replace(settings, spp=2**15), 4, 2 * 10**6).mean(axis=0, dtype=np.float64)
    signed, rms = true_bias(expectation, truth)
    assert signed < -0.01
    quick, long = images(settings, 800, 0), images(parts, 800, 10**5)
    found = [compare(quick[i : i + 8], long[i : i + 8]) for i in range(0, 800, 8)]
    assert 90 <= sum(errors.bias_low <= signed <= errors.bias_high for errors in found) <= 99
    assert sum(rms <= errors.bias_rms_high for errors in found) >= 90


@needs_flip
@pytest.mark.slow
def test_a_measured_sphere(tmp_path):
    """What must be so of any medium: more samples less noise, cut paths too dark, the reference better than all."""
    overrides = ["size=24", "media=[{}]", "ladder={spp 16: {spp: 16}, one: {max_depth: 1}}"]
    loaded = load_tradeoff(Path("usd_scenes/stages/sphere.usda"), overrides)
    subjects, _ = measuring.list_subjects(loaded)
    (one,) = measuring.measure(loaded, subjects, tmp_path, "cpu").measured
    rungs = {rung.name: rung for rung in one.pair.rungs}
    assert rungs["spp 16"].noise == pytest.approx(rungs[BASE].noise * np.sqrt(8), rel=0.4)
    assert rungs["one"].bias_high < -0.05
    assert abs(rungs[BASE].bias) < 3 * (rungs[BASE].bias_high - rungs[BASE].bias_low)
    assert min(rung.relative_rmse for rung in rungs.values()) > 4 * one.pair.reference.relative_standard_error
