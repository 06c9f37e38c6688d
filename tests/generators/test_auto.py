"""Settings chosen by what was measured, for an error or a time that one can afford."""

import math
import shutil
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from fgf_warp.errors import ConfigError
from fgf_warp.renderer import render
from fgf_warp.result import block_means
from fgf_warp.settings import RenderSettings
from generators.auto import Candidate, choose, distance, list_candidates, nearest, paired_bias, pick
from generators.checking.verify import verify_dataset
from generators.dataset.reader import Dataset
from generators.dataset.store import Store
from generators.publishing.words import describe_quality
from generators.running.run import generate, render_again
from generators.stage import load_scene
from generators.tradeoff.front import BASE, Front, Pair, Reference, Rung
from generators.wish import Wish
from tests.generators.small_plan import STAGE, TEXT, content, small_plan

ERROR, TIME = Wish.parse("auto:1%"), Wish.parse("auto:5s")
FEATURES = {"regime": "pink", "H": -0.25, "g": 0.5, "albedo": 0.9, "optical_depth": 3.0, "scatterings": 4.0}


def rung(name, seconds=1.0, noise=0.01, bias=0.0, **settings):
    """A rung whose bias is at most so large."""
    return Rung(
        name=name,
        settings=settings,
        spp=settings.get("spp", 128),
        seconds=seconds,
        rmse=noise,
        relative_mse=noise**2 + bias**2,
        relative_rmse=math.hypot(noise, bias),
        bias=bias,
        bias_low=bias,
        bias_high=bias,
        bias_rms=bias,
        bias_rms_high=bias,
        noise=noise,
        flip=0.0,
        delta_e=0.0,
        efficiency=1.0,
        pareto=True,
    )


def pair(name="cloud", rungs=(), **features):
    return Pair(
        name=name,
        stage="cloud_block",
        medium={},
        features={**FEATURES, **features},
        start_seconds=0.0,
        reference=Reference(spp=1, relative_standard_error=0.0, seconds=1.0),
        rungs=(rung(BASE), *rungs),
    )


def front(*pairs):
    return Front(versions={}, machine="", pixels=48, replicates=4, pairs=pairs)


@pytest.mark.parametrize(
    ("text", "error", "time"),
    [
        ("auto:1%", 0.01, None),
        ("auto:0.5%", 0.005, None),
        ("auto:.5%", 0.005, None),
        ("auto:5s", None, 5),
        ("auto:2min", None, 120),
    ],
)
def test_wishes_are_read(text, error, time):
    assert Wish.parse(text) == Wish(text, error, time)


@pytest.mark.parametrize("text", ["auto", "auto:", "auto:1", "auto:0%", "auto:0s", "auto:-1%", "auto:1 %", "auto:5m"])
def test_other_spellings_are_refused_with_those_that_are_accepted(text):
    with pytest.raises(ConfigError, match=f"preset {text}: accepted: .*auto:1%.*auto:5s"):
        Wish.parse(text)


def test_an_error_is_below_one():
    with pytest.raises(ConfigError, match="auto:100%: accepted: an error below 100 %"):
        Wish.parse("auto:100%")


def test_the_nearest_pairs_of_the_regime_come_first():
    same, near, far = pair("same"), pair("near", g=0.6), pair("far", H=0.9, g=-0.9, optical_depth=300.0)
    other = pair("other", regime="negative")
    assert [one.name for one in nearest(front(far, other, near, same), FEATURES)] == ["same", "near"]
    assert nearest(front(other, far), FEATURES) == []
    assert nearest(front(same), {"optical_depth": 0.0, "scatterings": 1.0}) == []


def test_distances_are_finite_at_the_ends():
    ends = {**FEATURES, "optical_depth": 0.0, "scatterings": 0.0, "albedo": 1.0}
    assert 0 < distance(ends, FEATURES) < math.inf
    assert distance(FEATURES, FEATURES) == 0.0


def test_candidates_have_the_largest_bias_and_the_mean_gain():
    pairs = [
        pair(rungs=[rung("depth", 0.5, bias=0.001, max_depth=64), rung("roulette", 0.5, bias=0.4, roulette_depth=4)]),
        pair(rungs=[rung("depth", 2.0, bias=0.003, max_depth=64), rung("roulette", 1.0, roulette_depth=4)]),
    ]
    base, depth, roulette = list_candidates(pairs, frozenset({"max_depth", "roulette_depth"}))
    assert (base.rung, base.bias, base.gain) == (BASE, 0.0, 1.0)
    assert (depth.bias, depth.gain) == (0.003, pytest.approx(1.0))
    # It has none, whatever the noise of the measurement says.
    assert (roulette.bias, roulette.gain) == (0.0, pytest.approx(2**0.5))


def test_what_is_not_to_be_chosen_is_no_candidate():
    rungs = [
        rung("few", spp=16),
        rung("denoised", denoise=True, max_depth=4),
        rung("renewal", transport="renewal"),
        rung("small", upscale=2),
        rung("known", 0.0, max_depth=8),
    ]
    pairs = [pair(rungs=rungs), pair()]
    assert [one.rung for one in list_candidates(pairs[:1], frozenset({"max_depth"}))] == [BASE]
    assert [one.rung for one in list_candidates(pairs[:1], frozenset({"upscale"}))] == [BASE, "small"]
    assert [one.rung for one in list_candidates(pairs, frozenset({"upscale"}))] == [BASE]
    assert [one.rung for one in list_candidates([], frozenset({"upscale"}))] == [BASE]


def test_a_bias_must_leave_room_for_noise():
    def chosen(bias, gain):
        return pick([Candidate(BASE), Candidate("depth", {"max_depth": 64}, bias, gain)], ERROR, 0.0).rung

    assert chosen(0.0, 1.5) == "depth"
    assert chosen(0.0, 1.05) == BASE
    assert chosen(0.0051, 100.0) == BASE
    # At half the error, a quarter of the square is lost.
    assert chosen(0.005, 1.4) == BASE
    assert chosen(0.005, 1.5) == "depth"


def test_a_bias_must_be_worth_it_beside_what_has_none():
    roulette = Candidate("roulette", {"roulette_depth": 32}, gain=1.5)
    for gain, expected in ((1.6, "roulette"), (1.8, "depth")):
        depth = Candidate("depth", {"max_depth": 64}, 0.001, gain)
        assert pick([Candidate(BASE), roulette, depth], ERROR, 0.0).rung == expected


def test_in_a_time_the_sum_of_noise_and_bias_decides():
    def chosen(bias, gain, noise):
        return pick([Candidate(BASE), Candidate("depth", {"max_depth": 64}, bias, gain)], TIME, noise).rung

    assert chosen(0.01, 4.0, 0.02) == "depth"
    assert chosen(0.01, 4.0, 0.01) == BASE


def test_the_bias_of_paired_images_is_told_from_their_scatter():
    rng = np.random.default_rng(1)
    image = np.ones((32, 32, 3))
    scatter = rng.normal(0, 0.1, (32, 32, 1))
    # Of 16 blocks of 64 pixels, 0.1 / 8 each: their mean square is known to 35 %, and is taken out.
    assert paired_bias(image, image + scatter) < 0.0125
    assert paired_bias(image, image + scatter - 0.05) == pytest.approx(0.05, abs=0.01)
    assert paired_bias(image, image) == 0.0
    assert paired_bias(0 * image, 0 * image) == 0.0


@pytest.mark.slow
def test_settings_are_chosen_and_keep_the_error():
    """A rung that was measured to be without bias is found out by the pilot, another is taken; and it ends well.

    Of a ball of albedo 0.9, single scattering is a third of the light. The target is 4 %: over 16 blocks, each a mean
    over 64 pixels, the error of the image's own error is below 20 %.
    """
    base = load_scene(STAGE, width=32, height=32)
    settings = RenderSettings(width=32, height=32, seed=3)
    rungs = [rung("single", 0.1, max_depth=1), rung("depth 32", 0.5, bias=0.01, max_depth=32)]
    features = choose_features(base.scene, settings)
    choice = choose(base.scene, settings, Wish.parse("auto:4%"), front(pair("ball", rungs, **features)))
    assert choice.rung == "depth 32"
    assert (choice.settings.max_depth, choice.settings.roulette_depth) == (32, settings.roulette_depth)
    assert choice.goal.over == "rms"
    assert 0.04 * math.sqrt(0.75) < choice.goal.error < 0.04
    assert "max_depth 32" in choice.lines[0] and "ball" in choice.lines[0]
    assert "single" in choice.lines[1] and "bias here is" in choice.lines[1]

    from fgf_warp.finishing import render_image

    result = render_image(base.scene, choice.settings, choice.goal)
    reference = render(base.scene, replace(settings, spp=4096, seed=4))
    means = block_means(reference.radiance)
    errors = np.sqrt(block_means((result.radiance - reference.radiance) ** 2)) / means
    assert 0.02 < math.sqrt(np.mean(errors**2)) < 0.048


def test_datasets_choose_for_each_sample_and_can_be_made_again(tmp_path, monkeypatch):
    measured = front(pair("ball", [rung("depth 32", 0.5, max_depth=32)], g=0.8))
    for module in ("generators.planning.plan", "generators.running.render"):
        monkeypatch.setattr(f"{module}.read_front", lambda: measured)
    # The second medium is far from what was measured.
    plan = small_plan(tmp_path, "preset=auto:5%", "spp=", "axes={g: [0.8, -0.8], H: [-0.25]}")
    assert describe_quality(plan.meta).endswith("(rms), at most 65536 spp, settings chosen for each sample")
    generate(plan, TEXT, tmp_path / "data")
    dataset = Dataset(tmp_path / "data")
    labels = pq.read_table(tmp_path / "data" / "index.parquet").to_pylist()
    assert [row["chosen_settings"] for row in labels] == ["max_depth 32", "balanced"]
    assert all(0.02 < row["reached_error"] <= 0.05 for row in labels)
    assert not verify_dataset(dataset).findings
    before = content(tmp_path / "data")
    for index in range(2):
        shutil.rmtree(tmp_path / "data" / dataset.folders[index])
    spp = {row["index"]: row["spp"] for row in labels}
    list(render_again(plan, Store(tmp_path / "data"), range(2), spp))
    assert content(tmp_path / "data") == before


def test_a_dataset_of_another_measurement_is_another_one(tmp_path, monkeypatch):
    digests = set()
    for measured in (front(pair()), front(pair("another"))):
        monkeypatch.setattr("generators.planning.plan.read_front", lambda measured=measured: measured)
        digests.add(small_plan(tmp_path, "preset=auto:5%", "spp=").meta.digest)
    assert len(digests) == 2


def choose_features(scene, settings):
    """As the pilot has them."""
    from generators.auto import _Pilot

    return _Pilot(scene, settings).features
