import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from fgf_warp.errors import OutputError
from fgf_warp.output.color import mean_delta_e, to_display, write_png
from fgf_warp.settings import RenderSettings
from tests.renders import made_up_render


def srgb(linear: float) -> int:
    """IEC 61966-2-1, written out."""
    return round(255 * (12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055))


@pytest.mark.parametrize("linear", [0.0, 0.001, 0.0031308, 0.01, 0.18, 0.5, 0.9, 1.0])
def test_display_values_follow_the_standard(linear):
    assert to_display(np.full((1, 1, 3), linear))[0, 0, 1] == srgb(linear)


def test_values_out_of_range_clip():
    assert to_display(np.array([[[-1.0, 1.5, 1e30]]])).tolist() == [[[0, 255, 255]]]


def test_exposure_is_in_stops():
    np.testing.assert_array_equal(to_display(np.full((1, 1, 3), 0.1), 2.0), to_display(np.full((1, 1, 3), 0.4)))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_not_finite_are_refused(value):
    with pytest.raises(OutputError, match="not finite"):
        to_display(np.full((1, 1, 3), value))


def test_png_holds_the_display_values_and_says_srgb(tmp_path):
    result = made_up_render(RenderSettings(width=5, height=3, spp=1))
    write_png(tmp_path / "a.png", result, 0.5)
    image = oiio.ImageInput.open(str(tmp_path / "a.png"))
    np.testing.assert_array_equal(image.read_image("uint8"), to_display(result.radiance, 0.5))
    assert b"sRGB" in (tmp_path / "a.png").read_bytes()


def test_display_values_are_written_as_they_are(tmp_path):
    pixels = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    write_png(tmp_path / "a.png", pixels)
    np.testing.assert_array_equal(oiio.ImageInput.open(str(tmp_path / "a.png")).read_image("uint8"), pixels)


def test_colour_differences_are_those_of_cie_2000():
    black, white, grey = (np.full((2, 3, 3), value, np.uint8) for value in (0, 255, 119))
    assert mean_delta_e(grey, grey) == 0.0
    assert mean_delta_e(black, white) == pytest.approx(100.0, abs=0.01)
    # Greys differ in lightness alone, whose weight depends on its mean.
    luminance = ((119 / 255 + 0.055) / 1.055) ** 2.4
    lightness = 116 * luminance ** (1 / 3) - 16
    off = (lightness / 2 - 50) ** 2
    expected = lightness / (1 + 0.015 * off / np.sqrt(20 + off))
    assert mean_delta_e(black, grey) == pytest.approx(expected, rel=1e-3)
    half = mean_delta_e(np.concatenate([black, grey]), np.concatenate([black, black]))
    assert half == pytest.approx(expected / 2, rel=1e-3)
