"""The door to FLIP: values that are known, and inputs that the library itself would take in silence."""

import importlib.util

import numpy as np
import pytest

from fgf_warp.errors import ConfigError, OutputError
from fgf_warp.output import flip

needs_flip = pytest.mark.skipif(
    importlib.util.find_spec("flip_evaluator") is None, reason="the extra quality is not installed"
)
BLACK = np.zeros((16, 16, 3), np.uint8)


@needs_flip
@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 40, 3), (16, 16, 3)])
@pytest.mark.parametrize("value", [0, 128, 255])
def test_equal_pictures_do_not_differ(shape, value):
    picture = np.full(shape, value, np.uint8)
    assert flip.mean_flip(picture, picture) == 0.0


@needs_flip
def test_more_noise_is_a_larger_difference():
    rng = np.random.default_rng(1)
    clean = np.full((32, 32, 3), 128.0)
    differences = [
        flip.mean_flip((clean + rng.normal(0, deviation, clean.shape)).astype(np.uint8), clean.astype(np.uint8))
        for deviation in (2, 8, 32)
    ]
    assert 0 < differences[0] < differences[1] < differences[2] < 1


@needs_flip
def test_black_and_white_are_as_different_as_can_be():
    assert flip.mean_flip(BLACK, BLACK + 255) > 0.9


@needs_flip
def test_parts_of_pictures_are_taken_as_they_are_seen():
    picture = np.random.default_rng(2).integers(0, 256, (16, 32, 3), dtype=np.uint8)
    every_other, whole = picture[:, ::2], np.ascontiguousarray(picture[:, ::2])
    assert flip.mean_flip(every_other, BLACK) == flip.mean_flip(whole, BLACK)


@pytest.mark.parametrize(
    "picture",
    [
        BLACK.astype(np.float32),
        np.full((16, 16, 3), np.nan),
        -np.ones((16, 16, 3)),
        BLACK[..., :1],
        BLACK[0],
        BLACK[:0],
    ],
    ids=["float", "nan", "negative", "one channel", "flat", "empty"],
)
def test_what_is_no_displayed_picture_is_refused(picture):
    for pair in ((picture, BLACK), (BLACK, picture)):
        with pytest.raises(OutputError, match=r"accepted: uint8 of shape \(height, width, 3\)"):
            flip.mean_flip(*pair)


def test_pictures_of_two_sizes_are_refused():
    with pytest.raises(OutputError, match="accepted: one shape"):
        flip.mean_flip(BLACK, BLACK[:8])


def test_without_the_extra_it_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr(flip, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"pip install 'fgf-warp\[quality\]'"):
        flip.mean_flip(BLACK, BLACK)
