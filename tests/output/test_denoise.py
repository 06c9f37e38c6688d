"""The denoiser itself, where the extra `denoise` is installed, and what is said where it is not."""

import importlib.util

import numpy as np
import pytest

from fgf_warp.errors import ConfigError, OutputError
from fgf_warp.output import denoise as door
from fgf_warp.output.denoise import check_denoiser, denoise, denoiser_version

needs_denoiser = pytest.mark.skipif(
    importlib.util.find_spec("pyoidn") is None, reason="needs the extra denoise: pip install 'fgf-warp[denoise]'"
)


def noisy_ramp():
    """A ramp from 1 to 20, beyond what a screen shows, with a tenth of noise; and its guides."""
    clean = np.broadcast_to(np.geomspace(1, 20, 64, dtype=np.float32)[:, None, None], (64, 64, 3))
    noise = 1 + 0.1 * np.random.default_rng(3).standard_normal(clean.shape)
    return clean, (clean * noise).astype(np.float32), np.full_like(clean, 0.5), np.zeros_like(clean)


@needs_denoiser
def test_noise_goes_and_the_light_stays():
    clean, noisy, albedo, normal = noisy_ramp()
    before = noisy.copy()
    found = denoise(noisy, albedo, normal)
    assert np.array_equal(noisy, before), "the labelled radiance is never touched"
    assert np.abs(found / clean - 1).mean() < 0.2 * np.abs(noisy / clean - 1).mean()
    assert found.mean() == pytest.approx(clean.mean(), rel=0.01)


@needs_denoiser
def test_guides_tell_detail_from_noise():
    """Stripes as weak as the noise stay where albedo shows them, and are lost without."""
    stripes = np.where(np.arange(64) % 8 < 4, 0.9, 1.1).astype(np.float32)
    clean = np.broadcast_to(stripes[None, :, None], (64, 64, 3))
    noisy = (clean * (1 + 0.2 * np.random.default_rng(4).standard_normal(clean.shape))).astype(np.float32)
    normal = np.zeros_like(clean)
    guided, blind = denoise(noisy, clean / 2, normal), denoise(noisy, np.full_like(clean, 0.5), normal)
    assert np.abs(guided - clean).mean() < 0.5 * np.abs(blind - clean).mean()


@needs_denoiser
def test_equal_planes_give_equal_results():
    _, *planes = noisy_ramp()
    assert np.array_equal(denoise(*planes), denoise(*planes))


@needs_denoiser
def test_its_failures_are_errors_of_the_output():
    _, noisy, albedo, normal = noisy_ramp()
    with pytest.raises(OutputError, match="the image cannot be denoised"):
        denoise(noisy, albedo[:9], normal)


@needs_denoiser
def test_it_tells_its_version():
    check_denoiser()
    assert denoiser_version().startswith("2.")


def test_a_missing_denoiser_is_named_with_its_extra(monkeypatch):
    monkeypatch.setattr(door, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"needs pyoidn, which is not installed; accepted: pip install 'fgf-warp\[d"):
        check_denoiser()
