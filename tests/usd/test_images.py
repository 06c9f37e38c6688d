"""What is in a file is what a texture holds, whatever the file's format, channels and place."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its own documentation uses
import pytest
from pxr import Sdf, Usd, UsdUtils

from fgf_warp.errors import SceneError
from tests.usd.pictures import noise, write_picture
from usd_scenes.reader.images import ImageFiles


@pytest.fixture
def files() -> ImageFiles:
    return ImageFiles()


def linear(encoded: np.ndarray) -> np.ndarray:
    """The transfer function of sRGB as its standard writes it."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize("suffix", ["png", "tif", "tga"])
@pytest.mark.parametrize("channels", [3, 4])
def test_8_bit_colors_stay_as_they_are(files: ImageFiles, tmp_path: Path, suffix: str, channels: int) -> None:
    pixels = noise(channels)
    image = files.read(str(write_picture(tmp_path / f"a.{suffix}", pixels))).image
    assert (image.pixels.dtype, image.pixels.shape, image.is_srgb) == (np.uint8, (5, 7, 4), True)
    np.testing.assert_array_equal(image.pixels[..., :channels], pixels)
    assert channels == 4 or (image.pixels[..., 3] == 255).all()


@pytest.mark.parametrize(("color_space", "is_srgb"), [("auto", True), ("raw", False), ("sRGB", True)])
def test_8_bit_colors_are_decoded_where_they_are_srgb(
    files: ImageFiles, tmp_path: Path, color_space, is_srgb: bool
) -> None:
    file = files.read(str(write_picture(tmp_path / "a.png", noise(3))), color_space)
    assert (file.image.is_srgb, file.is_encoded) == (is_srgb, is_srgb)


@pytest.mark.parametrize("channels", [1, 2])
def test_grey_is_in_all_colors_and_linear(files: ImageFiles, tmp_path: Path, channels: int) -> None:
    pixels = noise(channels)
    image = files.read(str(write_picture(tmp_path / "a.png", pixels))).image
    assert not image.is_srgb
    for color in range(3):
        np.testing.assert_array_equal(image.pixels[..., color], pixels[..., 0])
    np.testing.assert_array_equal(image.pixels[..., 3], pixels[..., 1] if channels == 2 else np.full((5, 7), 255))


def test_grey_may_be_called_srgb(files: ImageFiles, tmp_path: Path) -> None:
    assert files.read(str(write_picture(tmp_path / "a.png", noise(1))), "sRGB").image.is_srgb


def test_16_bits_become_floats(files: ImageFiles, tmp_path: Path) -> None:
    pixels = noise(4, np.uint16)
    image = files.read(str(write_picture(tmp_path / "a.png", pixels))).image
    assert image.pixels.dtype == np.float32
    np.testing.assert_allclose(image.pixels, pixels / 65535, atol=1e-7)


def test_16_bits_of_srgb_are_decoded_but_for_alpha(files: ImageFiles, tmp_path: Path) -> None:
    pixels = noise(4, np.uint16)
    file = files.read(str(write_picture(tmp_path / "a.png", pixels)), "sRGB")
    assert (file.image.is_srgb, file.is_encoded) == (False, True)
    np.testing.assert_allclose(file.image.pixels[..., :3], linear(pixels[..., :3] / 65535), atol=1e-6)
    np.testing.assert_allclose(file.image.pixels[..., 3], pixels[..., 3] / 65535, atol=1e-7)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_floats_stay_as_they_are(files: ImageFiles, tmp_path: Path, channels: int) -> None:
    pixels = noise(channels, np.float32) * 100 - 50
    image = files.read(str(write_picture(tmp_path / "a.exr", pixels))).image
    np.testing.assert_array_equal(image.pixels[..., :channels], pixels)
    assert not image.is_srgb


def test_radiance_files(files: ImageFiles, tmp_path: Path) -> None:
    pixels = noise(3, np.float32) * 1000
    image = files.read(str(write_picture(tmp_path / "a.hdr", pixels))).image
    np.testing.assert_allclose(image.pixels[..., :3], pixels, atol=1000 / 128)


def test_jpeg(files: ImageFiles, tmp_path: Path) -> None:
    image = files.read(str(write_picture(tmp_path / "a.jpg", np.full((8, 8, 3), 200, dtype=np.uint8)))).image
    np.testing.assert_allclose(image.pixels[..., :3], 200, atol=2)


def test_a_data_window_lies_in_its_display_window(files: ImageFiles, tmp_path: Path) -> None:
    spec = oiio.ImageSpec(2, 1, 3, "float")
    spec.x, spec.y = 1, 2
    spec.full_width, spec.full_height = 4, 3
    file = oiio.ImageOutput.create(str(tmp_path / "a.exr"))
    assert file.open(str(tmp_path / "a.exr"), spec)
    assert file.write_image(np.ones((1, 2, 3), dtype=np.float32))
    assert file.close()
    pixels = files.read(str(tmp_path / "a.exr")).image.pixels
    assert pixels.shape == (3, 4, 4)
    assert pixels[..., 0].tolist() == [[0, 0, 0, 0], [0, 0, 0, 0], [0, 1, 1, 0]]


def test_wrap_modes_of_the_file(files: ImageFiles, tmp_path: Path) -> None:
    path = write_picture(tmp_path / "a.exr", noise(3, np.float32), wrapmodes="periodic,mirror")
    assert files.read(str(path)).wraps == ("repeat", "mirror")
    assert files.read(str(write_picture(tmp_path / "b.png", noise(3)))).wraps == (None, None)


def test_each_file_is_read_once(files: ImageFiles, tmp_path: Path) -> None:
    path = write_picture(tmp_path / "a.png", noise(3))
    first = files.read(str(path))
    path.unlink()
    assert files.read(str(path)) is first
    with pytest.raises(SceneError):
        files.read(str(path), "raw")


@pytest.mark.parametrize(
    ("content", "reason"),
    [(None, "there is no such file"), (b"hello", "no picture that can be read: Not a PNG file"), (b"", "is empty")],
)
def test_what_is_no_picture_is_refused(files: ImageFiles, tmp_path: Path, content: bytes | None, reason: str) -> None:
    path = tmp_path / "a.png"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SceneError, match=reason):
        files.read(str(path))


@pytest.mark.parametrize("suffix", ["png", "exr", "tif"])
def test_a_file_that_was_cut_off_is_refused(files: ImageFiles, tmp_path: Path, suffix: str) -> None:
    path = write_picture(tmp_path / f"a.{suffix}", np.random.default_rng(2).random((64, 64, 3)).astype(np.float32))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(SceneError, match=r"damaged|no picture"):
        files.read(str(path))


def test_pixels_that_are_not_finite_are_mended_and_counted(files: ImageFiles, tmp_path: Path) -> None:
    pixels = noise(3, np.float32)
    pixels[0, 0] = (np.inf, 0.25, np.nan)
    pixels[1, 2, 1] = -np.inf
    file = files.read(str(write_picture(tmp_path / "a.exr", pixels)))
    assert file.image.pixels[0, 0, :3].tolist() == [65504, 0.25, 0]
    assert file.image.pixels[1, 2, 1] == -65504
    assert (file.image.pixels[2:, :, :3] == pixels[2:]).all()
    (text,) = file.mended
    assert text.startswith("2 of 35 pixels are not finite; 65504 is used for what is infinite, and 0 for")


@pytest.mark.parametrize("made_by", [os.mkfifo, os.mkdir, lambda path: path.symlink_to("/dev/zero")])
def test_what_is_no_plain_file_is_not_opened(files: ImageFiles, tmp_path: Path, made_by) -> None:
    """Whoever opens a pipe waits for ever for its other end."""
    path = tmp_path / "a.png"
    made_by(path)
    with pytest.raises(SceneError, match="it is no plain file"):
        files.read(str(path))
    with pytest.raises(SceneError, match="it is no plain file"):
        files.read(f"{path}[b.png]")


def test_a_picture_inside_a_package(files: ImageFiles, tmp_path: Path) -> None:
    pixels = noise(3)
    write_picture(tmp_path / "maps" / "a.png", pixels)
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    prim = stage.DefinePrim("/P")
    prim.CreateAttribute("file", Sdf.ValueTypeNames.Asset).Set("./maps/a.png")
    stage.Save()
    package = tmp_path / "a.usdz"
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "a.usda"), str(package))
    packed = Usd.Stage.Open(str(package))
    image = files.read(packed.GetPrimAtPath("/P").GetAttribute("file").Get().resolvedPath).image
    np.testing.assert_array_equal(image.pixels[..., :3], pixels)
