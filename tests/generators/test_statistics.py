"""Numbers that describe an image, and what its law says."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fgf_warp.errors import ConfigError
from fgf_warp.output.exr import read_exr, write_exr
from fgf_warp.scene import Medium
from fgf_warp.settings import RenderSettings
from generators.publishing.statistics import LAGS, STATISTICS, image_statistics
from generators.publishing.targets import compute_targets
from tests.generators.small_plan import small_plan
from tests.renders import made_up_render


def channels_of(luminance, alpha=None):
    """A grey image; float32, as in a file."""
    grey = np.asarray(luminance, np.float32)
    return {**dict.fromkeys("RGB", grey), "A": np.ones_like(grey) if alpha is None else np.asarray(alpha, np.float32)}


def test_a_render_and_its_file_have_the_same_numbers(tmp_path):
    render = made_up_render(RenderSettings(width=40, height=24, spp=4, seed=3))
    write_exr(tmp_path / "image.exr", render)
    assert image_statistics(render) == image_statistics(read_exr(tmp_path / "image.exr")[0])


def test_every_statistic_is_a_finite_number_that_is_explained():
    found = image_statistics(made_up_render(RenderSettings(width=40, height=24, spp=4)))
    assert list(found) == list(STATISTICS)
    assert all(type(value) is float and math.isfinite(value) for value in found.values())


def test_distribution_is_that_of_numpy():
    render = made_up_render(RenderSettings(width=40, height=24, spp=4))
    luminance = render.radiance.astype(np.float64) @ [0.2126, 0.7152, 0.0722]
    found = image_statistics(render)
    assert found["luminance_mean"] == pytest.approx(luminance.mean())
    assert found["luminance_std"] == pytest.approx(luminance.std())
    assert found["luminance_p05"] == pytest.approx(np.percentile(luminance, 5))
    assert found["alpha_p75"] == pytest.approx(np.percentile(render.alpha.astype(np.float64), 75))
    assert found["green_mean"] == pytest.approx(render.radiance[..., 1].mean(), rel=1e-5)


def test_a_ramp_has_the_gradient_and_the_structure_of_a_ramp():
    ramp = np.tile(np.arange(32.0), (32, 1))
    found = image_statistics(channels_of(ramp))
    assert found["gradient_energy"] == pytest.approx(1)
    for lag in LAGS:
        assert found[f"structure_{lag}"] == pytest.approx(lag**2 / 2)  # none down, lag^2 across
    assert found["centroid_x"] > 0.1
    assert found["centroid_y"] == pytest.approx(0)


def test_centroid_is_where_the_light_is():
    spot = np.zeros((20, 40))
    spot[4, 29] = 2
    found = image_statistics(channels_of(spot))
    assert found["centroid_x"] == pytest.approx(29.5 / 40 - 0.5)
    assert found["centroid_y"] == pytest.approx(4.5 / 20 - 0.5)


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (9, 9)])
def test_small_and_black_images_have_statistics(size):
    found = image_statistics(channels_of(np.zeros(size)))
    assert all(math.isfinite(value) for value in found.values())
    assert [lag for lag in LAGS if f"structure_{lag}" in found] == [lag for lag in LAGS if lag < min(size)]
    assert found["centroid_x"] == 0


def test_structure_tells_how_far_noise_reaches():
    rng = np.random.default_rng(4)
    white = rng.standard_normal((64, 64)) + 5
    smooth = sum(np.roll(white, (i, j), (0, 1)) for i in range(4) for j in range(4)) / 16
    ratio = [image_statistics(channels_of(noise)) for noise in (white, smooth)]
    assert ratio[0]["structure_1"] / ratio[0]["structure_8"] > 0.9
    assert ratio[1]["structure_1"] / ratio[1]["structure_8"] < 0.5


@pytest.mark.parametrize("grey", [1.0, 0.25])
def test_targets_are_what_was_asked_for(grey):
    """In white noise the transmittance is an exponential, of the rate log(1 + kappa) / kappa."""
    medium = Medium("/medium", hurst=-0.5, white_noise_scale=1.0, mean_extinction=2.0, extinction_color=(grey,) * 3)
    kappa = medium.line_law.kappa
    assert kappa > 0
    rate = 2 * grey * math.log1p(kappa) / kappa
    found = compute_targets(medium, {"transmittance": {"t": [0.0, 0.5, 2.0]}, "mean_free_path": True})
    assert found["transmittance_t"] == [0.0, 0.5, 2.0]
    assert found["transmittance"] == pytest.approx([1, math.exp(-0.5 * rate), math.exp(-2 * rate)])
    assert found["mean_free_path"] == pytest.approx(1 / rate)
    assert compute_targets(medium, {}) == {}
    assert list(compute_targets(medium, {"mean_free_path": True})) == ["mean_free_path"]


def test_a_plan_asks_in_the_words_that_are_understood(tmp_path):
    plan = small_plan(tmp_path, "targets={transmittance: [0.5, 1], mean_free_path: true}")
    for sample in plan.samples:
        found = compute_targets(sample.medium, plan.meta.targets)
        assert found["transmittance_t"] == [0.5, 1]
        assert 1 > found["transmittance"][0] > found["transmittance"][1] > 0
        assert found["mean_free_path"] > 0


FBM = {"hurst": 0.3, "outer_scale": 1.0, "mean_extinction": 2.0}


def test_a_length_beyond_the_law_is_refused():
    medium = Medium("/medium", **FBM, kappa=0.5, line_variance="exact")
    with pytest.raises(ConfigError, match="where the law ends"):
        compute_targets(medium, {"transmittance": {"t": [1e6]}})


@pytest.mark.parametrize("parameters", [{**FBM, "kappa": 2.0}, {"mean_extinction": 0.0}])
def test_an_infinite_mean_is_null(parameters):
    assert compute_targets(Medium("/medium", **parameters), {"mean_free_path": True}) == {"mean_free_path": None}


def test_statistics_do_not_depend_on_the_order_of_memory():
    render = made_up_render(RenderSettings(width=33, height=17, spp=4))
    fortran = replace(render, radiance=np.asfortranarray(render.radiance))
    ours, theirs = image_statistics(render), image_statistics(fortran)
    assert ours == pytest.approx(theirs, rel=1e-12)
