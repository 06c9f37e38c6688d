"""What a file says of its own colors holds, and bit depth decides only where it says nothing."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its own documentation uses
import pytest

from tests.usd.pictures import SAYS_COLORS, chunk, png_without, write_picture
from tests.usd.prims import preview_sphere
from usd_scenes.reader.images import ImageFile, ImageFiles

HALF = 128 / 255
SRGB_HALF = ((HALF + 0.055) / 1.055) ** 2.4
SRGB = chunk(b"sRGB", b"\0")
UNKNOWN = "are not known"


def gamma(value: float) -> bytes:
    return chunk(b"gAMA", struct.pack(">I", round(value * 100000)))


def coded(primaries: int, transfer: int) -> bytes:
    return chunk(b"cICP", bytes([primaries, transfer, 0, 1]))


def curve(*numbers: int) -> bytes:
    return b"curv\0\0\0\0" + struct.pack(f">I{len(numbers)}H", len(numbers), *numbers)


def parametric(kind: int, *numbers: float) -> bytes:
    fixed = [round(number * 65536) for number in numbers]
    return b"para\0\0\0\0" + struct.pack(f">HH{len(fixed)}i", kind, 0, *fixed)


SRGB_CURVE = parametric(3, 2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)
REC_709 = ((0.4361, 0.2225, 0.0139), (0.3851, 0.7169, 0.0971), (0.1431, 0.0606, 0.7141))
ADOBE = ((0.6097, 0.3111, 0.0195), (0.2053, 0.6257, 0.0609), (0.1492, 0.0632, 0.7446))


def profile(transfer: bytes, colorants: tuple = REC_709) -> bytes:
    """An ICC profile of three equal curves and a matrix."""
    tags = [(name, transfer) for name in (b"rTRC", b"gTRC", b"bTRC")]
    for name, xyz in zip((b"rXYZ", b"gXYZ", b"bXYZ"), colorants, strict=True):
        tags.append((name, b"XYZ \0\0\0\0" + struct.pack(">3i", *(round(value * 65536) for value in xyz))))
    place, table, data = 132 + 12 * len(tags), b"", b""
    for name, content in tags:
        table += struct.pack(">4sII", name, place + len(data), len(content))
        data += content + bytes(-len(content) % 4)
    return bytes(128) + struct.pack(">I", len(tags)) + table + data


def embedded(content: bytes) -> bytes:
    return chunk(b"iCCP", b"a name\0\0" + zlib.compress(content))


TABLE = [round(65535 * (n / 1023) ** 1.8) for n in range(1024)]
SAYS = [
    # chunks, what 0.502 is in 8 bits and 3 channels; what is told
    (b"", SRGB_HALF, ""),
    (SRGB, SRGB_HALF, ""),
    (gamma(1.0), HALF, ""),
    (gamma(0.45455), SRGB_HALF, ""),
    (gamma(1 / 1.8), HALF**1.8, ""),
    (SRGB + gamma(1.0), SRGB_HALF, ""),
    (gamma(0), SRGB_HALF, "its gamma of 0 is not plausible"),
    (gamma(1.0) + embedded(profile(SRGB_CURVE)), SRGB_HALF, ""),
    (embedded(profile(curve())), HALF, ""),
    (SRGB + embedded(profile(parametric(0, 1.0))), HALF, ""),
    (embedded(profile(curve(round(2.2 * 256)))), HALF**2.2, ""),
    (embedded(profile(curve(*TABLE))), HALF**1.8, ""),
    (embedded(profile(curve(563), ADOBE)), HALF ** (563 / 256), "its primaries are taken for those of Rec. 709"),
    (embedded(profile(curve(0, 65535, 0, 65535))), SRGB_HALF, UNKNOWN),
    (embedded(b"nothing"), SRGB_HALF, "is not followed"),
    (chunk(b"iCCP", b"a name\0\0damaged"), SRGB_HALF, "is damaged"),
    (coded(1, 8) + SRGB, HALF, ""),
    (coded(1, 13), SRGB_HALF, ""),
    (coded(9, 8), HALF, "its primaries are taken for those of Rec. 709"),
    (coded(1, 16) + gamma(1.0), HALF, "the transfer characteristics 16 of its cICP are not known"),
    (chunk(b"gAMA", b"\0"), SRGB_HALF, "its gAMA chunk is damaged"),
]


def decoded(path: Path, *, color_space="auto") -> tuple[ImageFile, float]:
    """The file, and its first number as it is rendered."""
    file = ImageFiles().read(str(path), color_space)
    first = file.image.pixels[0, 0, 0]
    value = first / 255 if file.image.pixels.dtype == np.uint8 else first
    return file, ((value + 0.055) / 1.055) ** 2.4 if file.image.is_srgb else value


def png(folder: Path, chunks: bytes, dtype: type = np.uint8, channels: int = 3) -> Path:
    pixels = np.full((4, 4, channels), 128 * (1 if dtype is np.uint8 else 257), dtype=dtype)
    path = write_picture(folder / "a.png", pixels)
    path.write_bytes(png_without(path.read_bytes(), SAYS_COLORS, chunks))
    return path


@pytest.mark.parametrize(("chunks", "expected", "told"), SAYS)
def test_a_png_is_what_it_says(tmp_path: Path, chunks: bytes, expected: float, told: str) -> None:
    file, value = decoded(png(tmp_path, chunks))
    # An 8-bit gamma of a profile is a multiple of 1/256, and a classified one is rounded to hundredths.
    assert value == pytest.approx(expected, rel=0.004)
    assert [told in text for text in file.told] == ([True] if told else [])
    assert file.is_encoded == (expected != HALF)


@pytest.mark.parametrize(("chunks", "expected"), [(b"", HALF), (SRGB, SRGB_HALF), (gamma(1.0), HALF)])
@pytest.mark.parametrize("channels", [1, 3])
def test_a_png_of_16_bits_is_what_it_says(tmp_path: Path, chunks: bytes, expected: float, channels: int) -> None:
    """0.216 and not 0.502, where the file says sRGB."""
    assert decoded(png(tmp_path, chunks, np.uint16, channels))[1] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(("chunks", "expected"), [(b"", HALF), (SRGB, SRGB_HALF), (gamma(1 / 1.8), HALF**1.8)])
def test_grey_is_what_it_says(tmp_path: Path, chunks: bytes, expected: float) -> None:
    assert decoded(png(tmp_path, chunks, channels=1))[1] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize(("color_space", "expected"), [("raw", HALF), ("sRGB", SRGB_HALF)])
def test_the_stage_stands_above_the_file(tmp_path: Path, color_space, expected: float) -> None:
    for chunks in (b"", SRGB, gamma(1.0), gamma(1 / 1.8)):
        assert decoded(png(tmp_path, chunks), color_space=color_space)[1] == pytest.approx(expected, rel=1e-5)


def test_alpha_is_not_encoded(tmp_path: Path) -> None:
    path = write_picture(tmp_path / "a.png", np.full((4, 4, 4), 128, dtype=np.uint8))
    path.write_bytes(png_without(path.read_bytes(), (), gamma(1 / 1.8)))
    rgba = decoded(path)[0].image.pixels[0, 0]
    assert rgba == pytest.approx([HALF**1.8] * 3 + [HALF], rel=1e-5)


def test_pixels_of_files_that_say_nothing_stay_as_they_are(tmp_path: Path) -> None:
    """Also where OpenImageIO names a color space of them, as of every PNG, JPEG and BMP."""
    for suffix, channels, is_srgb in (("png", 3, True), ("png", 1, False), ("jpg", 3, True), ("bmp", 3, True)):
        image = decoded(write_picture(tmp_path / f"a.{suffix}", np.full((8, 8, channels), 128, np.uint8)))[0].image
        assert (image.pixels.dtype, image.is_srgb) == (np.uint8, is_srgb)
        assert (image.pixels[..., :3] == 128).all()


@pytest.mark.parametrize("suffix", ["tif", "exr"])
@pytest.mark.parametrize(("name", "expected"), [(None, 0.5), ("sRGB", ((0.5 + 0.055) / 1.055) ** 2.4)])
def test_other_formats_are_what_they_say(tmp_path: Path, suffix: str, name: str | None, expected: float) -> None:
    says = {"oiio:ColorSpace": name} if name else {}
    path = write_picture(tmp_path / f"a.{suffix}", np.full((4, 4, 3), 0.5, np.float32), **says)
    assert decoded(path)[1] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("suffix", ["tif", "jpg"])
def test_profiles_of_other_formats_are_read(tmp_path: Path, suffix: str) -> None:
    spec = oiio.ImageSpec(8, 8, 3, "uint8")
    content = np.frombuffer(profile(curve()), dtype=np.uint8)
    spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(content)}]"), content)
    path = str(tmp_path / f"a.{suffix}")
    file = oiio.ImageOutput.create(path)
    assert file.open(path, spec), file.geterror()
    assert file.write_image(np.full((8, 8, 3), 128, dtype=np.uint8))
    assert file.close()
    assert decoded(Path(path))[1] == pytest.approx(HALF, rel=0.02)


def test_what_is_not_followed_is_told_of_the_texture(read, tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    path = png(tmp_path / "pictures", coded(1, 16))
    shader = f"""def Shader "T"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{path}@
        float2 inputs:st = (0, 0)
        float3 outputs:rgb
    }}
    """
    (text,) = read(preview_sphere("color3f inputs:diffuseColor.connect = </Look/T.outputs:rgb>", shader)).warnings
    assert text.endswith("a.png: the transfer characteristics 16 of its cICP are not known: /Look/T.inputs:file")
