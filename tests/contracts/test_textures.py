"""Textures against closed forms: texels, wraps, sRGB and UDIM; and what materials read."""

import numpy as np
import pytest

from fgf_warp.scene import Image, Texture
from fgf_warp.upload import decoded_srgb
from tests.contracts.shading_kernels import read_texture

RNG = np.random.default_rng(11)
HEIGHT, WIDTH = 3, 5
FLOATS = Image("floats", RNG.random((HEIGHT, WIDTH, 4), dtype=np.float32) * 3)
BYTES = Image("bytes", RNG.integers(0, 256, (HEIGHT, WIDTH, 4), dtype=np.uint8))
SRGB = Image("srgb", BYTES.pixels, is_srgb=True)
PLACES = RNG.uniform(-3.2, 3.2, (500, 2))


def linear(image):
    if image.pixels.dtype == np.float32:
        return image.pixels.astype(np.float64)
    values = image.pixels / 255.0
    if image.is_srgb:
        values[..., :3] = decoded_srgb()[image.pixels[..., :3]]
    return values


def wrapped(i, count, wrap):
    """The texel that stands for texel i, and whether there is one."""
    if wrap == "black":
        return np.clip(i, 0, count - 1), (i >= 0) & (i < count)
    if wrap == "clamp":
        return np.clip(i, 0, count - 1), np.ones_like(i, dtype=bool)
    period = count if wrap == "repeat" else 2 * count
    i = np.mod(i, period)
    return np.where(i < count, i, 2 * count - 1 - i), np.ones_like(i, dtype=bool)


def expected(image, st, wrap_s, wrap_t):
    texels = linear(image)
    x, y = st[:, 0] * WIDTH - 0.5, (1 - st[:, 1]) * HEIGHT - 0.5
    result = np.zeros((len(st), 4))
    for dx in (0, 1):
        for dy in (0, 1):
            column, is_in_s = wrapped(np.floor(x).astype(int) + dx, WIDTH, wrap_s)
            row, is_in_t = wrapped(np.floor(y).astype(int) + dy, HEIGHT, wrap_t)
            weight = np.abs(1 - dx - (x - np.floor(x))) * np.abs(1 - dy - (y - np.floor(y)))
            result += (weight * is_in_s * is_in_t)[:, None] * texels[row, column]
    return result


@pytest.mark.parametrize("image", [FLOATS, BYTES, SRGB], ids=lambda image: image.name)
@pytest.mark.parametrize(
    ("wrap_s", "wrap_t"),
    [("black", "clamp"), ("clamp", "mirror"), ("repeat", "black"), ("mirror", "repeat"), ("repeat", "repeat")],
)
def test_bilinear_and_wrapped(image, wrap_s, wrap_t):
    st = PLACES.astype(np.float32).astype(np.float64)
    _, rgba = read_texture(Texture({(0, 0): image}, wrap_s=wrap_s, wrap_t=wrap_t), st)
    assert np.abs(rgba - expected(image, st, wrap_s, wrap_t)).max() < 2e-5


def test_the_lower_left_texel_is_at_the_origin():
    _, rgba = read_texture(Texture({(0, 0): FLOATS}), [(0.5 / WIDTH, 0.5 / HEIGHT)])
    assert np.allclose(rgba[0], FLOATS.pixels[-1, 0], rtol=1e-6)


def test_tiles():
    """Tile (u, v) fills its own square, up to its edge; elsewhere the fallback is shown."""
    tiles = {(0, 0): FLOATS, (9, 0): BYTES, (2, 1): SRGB}
    texture = Texture(tiles, is_udim=True, fallback=(0.1, 0.2, 0.3, 0.4))
    inner = RNG.random((200, 2)).astype(np.float32).astype(np.float64)
    for (u, v), image in tiles.items():
        st = (inner + np.array([u, v])).astype(np.float32).astype(np.float64)
        found, rgba = read_texture(texture, st)
        assert np.all(found >= 0)
        assert np.abs(rgba - expected(image, st - (u, v), "clamp", "clamp")).max() < 2e-4
    outside = [(-0.5, 0.5), (10.5, 0.5), (1.5, 0.5), (0.5, 1.5), (0.5, -0.5), (2.5, 2.5)]
    found, rgba = read_texture(texture, outside)
    assert np.all(found == -1)
    assert np.allclose(rgba, texture.fallback)


def test_no_image_shows_the_fallback():
    found, rgba = read_texture(Texture({}, fallback=(0.5, 0.25, 0.125, 1.0)), [(0.5, 0.5)])
    assert found[0] == -1
    assert np.allclose(rgba[0], (0.5, 0.25, 0.125, 1.0))
