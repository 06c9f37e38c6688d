import numpy as np
import pytest

from fgf_warp.output.drawing import Canvas, resize_linear, text_width


def test_text_appears_where_it_is_asked_for():
    canvas = Canvas(200, 60, (0.0, 0.0, 0.0))
    canvas.text(20, 10, "H = -0.25", 24, (1.0, 1.0, 1.0))
    rows, columns = np.nonzero(canvas.pixels[..., 0] > 128)
    assert rows.min() >= 10
    assert rows.max() < 10 + 24
    assert columns.min() >= 20
    assert columns.max() <= 20 + text_width("H = -0.25", 24) + 1
    assert len(rows) > 100


def test_pictures_and_rectangles_land_on_their_pixels():
    canvas = Canvas(10, 8, (0.0, 0.0, 0.0))
    picture = np.arange(18, dtype=np.uint8).reshape(2, 3, 3)
    canvas.paste(picture, 4, 5)
    canvas.fill(0, 0, 2, 1, (1.0, 1.0, 1.0))
    np.testing.assert_array_equal(canvas.pixels[5:7, 4:7], picture)
    assert canvas.pixels[0, :2].min() == 255
    assert canvas.pixels[1].max() == 0


def test_small_pictures_grow_by_whole_factors():
    picture = np.random.default_rng(0).random((2, 3, 3), dtype=np.float32)
    grown = resize_linear(picture, 8)
    assert grown.shape == (4, 6, 3)
    np.testing.assert_array_equal(grown[::2, 1::2], picture)


def test_large_pictures_shrink_in_linear_light():
    stripes = np.zeros((60, 80, 3), np.float32)
    stripes[:, ::2] = 2.0
    small = resize_linear(stripes, 40)
    assert small.shape == (30, 40, 3)
    assert small[5:-5, 5:-5].mean() == pytest.approx(1.0, abs=1e-5)
