"""The figures: their statistics on known input, their files, and what Figure 4 claims, as a test of the renderer."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from typer.testing import CliRunner

import fgf_warp.renderer
from fgf_warp.scene import Medium
from generators.cli import app
from generators.commands.common import EXIT_UNEXPECTED
from generators.figures import white_limit
from generators.figures.agreement import Estimate, compare, extrapolate
from generators.figures.gallery import EXHIBITS
from generators.figures.scale_independence import HURSTS, measured_order
from generators.figures.studio import load_studio, shoot, studio_settings
from tests.generators.test_cli import assert_refused, fgf
from tests.renders import made_up_render

FILES = {
    "hurst": ("hurst-equal-kappa.png", "hurst-equal-scale.png"),
    "negative-law": ("negative-law.svg",),
    "negative-image": ("negative-image.png", "negative-difference.png"),
    "white-limit": ("limit-pictures.png", "limit-differences.png", "limit-approach.svg"),
    "scale": ("scale-independence.svg",),
}
LIMITS = (("renewal, b -> 0", "white noise"), ("reciprocal, b -> 0", "predicted"))
ERROR = 0.02
"""Of each pixel of the images that are made up."""


def made_up(seed: int, *, shift: float = 0.0, size: int = 160) -> Estimate:
    """An image with a gradient, its noise, and `shift` in units of the noise."""
    truth = np.linspace(1, 3, size * size).reshape(size, size)
    noise = np.random.default_rng(seed).standard_normal((size, size))
    return Estimate(truth + ERROR * (noise + shift), np.full((size, size), ERROR**2))


def test_z_of_estimates_of_one_image_is_standard_normal():
    found = compare(made_up(1), made_up(2))
    assert found.noisy_z.size == 400
    assert stats.kstest(found.noisy_z, "norm").pvalue > 1e-3
    assert found.rms_z == pytest.approx(1, abs=0.12)
    assert found.holds


def test_agreement_holds_as_often_as_it_should():
    """Of 400 pairs at level 0.001 for each of two tests, 0.8 fail on average, and 6 or more once in 3000 times."""
    found = [compare(made_up(2 * i, size=32), made_up(2 * i + 1, size=32)) for i in range(400)]
    assert sum(not agreement.holds for agreement in found) < 6
    assert stats.kstest([agreement.chi_square_p for agreement in found], "uniform").pvalue > 1e-3
    assert stats.kstest([agreement.mean_p for agreement in found], "uniform").pvalue > 1e-3


def test_a_shift_is_seen():
    """By a twentieth of a pixel's noise: 5.7 standard errors of the mean, which the blocks alone do not show."""
    found = compare(made_up(1, shift=0.05), made_up(2))
    assert found.mean_z == pytest.approx(0.05 * 160 / np.sqrt(2), abs=4)
    assert found.visible_mean < 0.05 * ERROR / 2
    assert not found.holds


def test_a_pattern_without_a_mean_is_seen():
    """Its sign alternates between blocks, so that the means agree."""
    found, other = made_up(1), made_up(2)
    sign = np.kron((np.indices((20, 20)).sum(axis=0) % 2) * 2 - 1, np.ones((8, 8)))
    agreement = compare(replace(found, mean=found.mean + 0.5 * ERROR * sign), other)
    assert agreement.mean_p > 1e-3
    assert agreement.chi_square_p < 1e-9
    assert not agreement.holds


def test_blocks_without_noise_count_only_where_they_differ():
    flat = Estimate(np.ones((16, 16)), np.zeros((16, 16)))
    left = np.arange(16) < 8
    half = replace(flat, variance=np.where(left, ERROR**2, 0.0) * np.ones((16, 1)))
    noisy = Estimate(flat.mean + np.where(left, 0.01, 0.0), half.variance)
    assert compare(noisy, half).noisy_z.size == 2
    off = replace(noisy, mean=noisy.mean + np.where(left, 0.0, 0.01))
    assert not compare(off, half).holds


def test_extrapolation_removes_what_is_linear_in_b():
    zero = made_up(1)
    near, far = replace(zero, mean=zero.mean + 0.02), replace(zero, mean=zero.mean + 0.04)
    limit = extrapolate(near, far)
    np.testing.assert_allclose(limit.mean, zero.mean, rtol=1e-12)
    np.testing.assert_allclose(limit.variance, 5 * zero.variance)


def test_the_equivalent_medium_sums_the_cluster_up():
    """Each event in a cluster scatters with probability a; it is left with l, and has a further event with 1 - l."""
    medium = Medium("/cloud", 3.0, albedo=(1.0, 0.7, 0.0), kappa=2.0)
    rate = np.log(3) / 2
    found = white_limit.equivalent_medium(medium)
    series = [sum(a * rate * (a * (1 - rate)) ** n for n in range(200)) for a in medium.albedo]
    assert found.albedo == pytest.approx(series, abs=1e-12)
    assert found.line_law.is_exponential
    assert found.mean_extinction == pytest.approx(3 * rate)


@pytest.mark.parametrize("hurst", HURSTS)
def test_the_order_of_scale_independence(hurst):
    """min(1, 2H), not the 2H of the supplement. Near H = 1/2 the next term, of order 1, is not yet far below."""
    assert measured_order(hurst) == pytest.approx(min(1, 2 * hurst), abs=0.03)


@pytest.fixture(scope="module")
def preview(tmp_path_factory):
    """A preview of everything, as the command makes it."""
    folder = tmp_path_factory.mktemp("figures")
    outcome = CliRunner().invoke(app, ["figures", "--preset", "preview", "--out", str(folder)])
    assert outcome.exit_code == 0, outcome.output
    return folder, outcome.stdout


def test_preview_writes_all_figures(preview):
    folder, output = preview
    names = {name for files in FILES.values() for name in files} | {"index.html"}
    assert {path.name for path in folder.iterdir()} == names
    page = (folder / "index.html").read_text()
    assert page.count("<figure>") == len(names) - 1
    assert all(exhibit.title in page for exhibit in EXHIBITS.values())
    assert 'class="verdict"' in page
    assert "Renewal transport at H = -0.49 against white noise: they agree within noise." in output


def test_one_figure_alone(tmp_path):
    assert fgf("figures", "--only", "scale", "--out", tmp_path / "new" / "folder").exit_code == 0
    assert {path.name for path in (tmp_path / "new" / "folder").iterdir()} == {"index.html", *FILES["scale"]}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--only", "scales"), "figure scales: accepted: hurst, negative-law"),
        (("--preset", "best"), "preset best: accepted: preview, balanced, reference"),
        (("--device", "cuda:77"), "device = 'cuda:77'; accepted on this machine"),
        (("--out", "{tmp}/file/figures"), "cannot be made"),
    ],
)
def test_figures_refuse(tmp_path, arguments, message):
    (tmp_path / "file").touch()
    assert_refused(fgf("figures", *(argument.format(tmp=tmp_path) for argument in arguments)), message)


def test_the_verdict_follows_from_the_pictures(tmp_path, monkeypatch):
    """Pictures of mere noise, each of its own, are no renders of one image."""

    def render_batch(scene, variants, settings, progress=None):
        for variant in variants:
            yield made_up_render(replace(settings, seed=variant.seed))

    monkeypatch.setattr(fgf_warp.renderer, "render_batch", render_batch)
    outcome = fgf("figures", "--only", "white-limit", "--preset", "preview", "--out", tmp_path)
    assert outcome.exit_code == EXIT_UNEXPECTED
    assert "they differ" in outcome.stdout
    assert "Not as the theory says: renewal, b -> 0 against white noise" in outcome.stdout
    assert 'class="verdict failed"' in (tmp_path / "index.html").read_text()


@pytest.mark.parametrize(
    ("size", "spp", "detects"), [(96, 128, 0.0075), pytest.param(256, 512, 0.0015, marks=pytest.mark.slow)]
)
def test_transports_at_the_limit_of_white_noise(size, spp, detects):
    """Figure 4 as a test: for b -> 0+ renewal tends to white noise, and reciprocal to the medium that theory predicts.

    Each fails by chance once in 500 times, and sees a bias of `detects` of the mean with a probability of 98 %. What
    it must tell apart, the two limits and the two exponentials, is 3 % of the mean.
    """
    scene = load_studio()
    settings = replace(studio_settings("balanced", "cpu"), width=size, height=size, spp=spp, seed=77)
    shots = shoot(scene, white_limit.media(scene.media[0]), settings)
    rows = {(row.found, row.expected): row for row in white_limit.compare_all(white_limit.estimates_by_name(shots))}
    renewal, reciprocal = (rows[limit] for limit in LIMITS)
    for row in (renewal, reciprocal):
        assert row.agreement.visible_mean <= detects
        assert row.agreement.holds, f"{row.found}: {row.agreement.mean_z:.2f}, p = {row.agreement.chi_square_p:.1e}"
    predicted = rows["predicted", "white noise"].agreement
    measured = rows["reciprocal, H = -0.49", "white noise"].agreement
    assert predicted.mean < -0.025
    assert measured.mean == pytest.approx(predicted.mean, abs=detects)
    assert not [pair for pair, row in rows.items() if row.surprising]
