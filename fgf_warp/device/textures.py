"""Images over texture coordinates: bilinear, wrapped, or in tiles.

The origin of texture coordinates is at the lower left, rows of images begin at the top.
"""

import warp as wp

BLACK = wp.constant(0)
CLAMP = wp.constant(1)
REPEAT = wp.constant(2)
MIRROR = wp.constant(3)
"""Wraps, in the order of `fgf_warp.scene.WRAPS`."""

BYTES = wp.constant(0)
"""Linear, 8 bits a channel."""
SRGB_BYTES = wp.constant(1)
"""The same, with R, G and B encoded by the transfer function of sRGB."""
FLOATS = wp.constant(2)

UDIM_COLUMNS = wp.constant(10)
FARTHEST = wp.constant(1.0e9)
"""Texture coordinate, in texels, beyond which integers end."""


@wp.struct
class Image:
    """A picture among the texels of its kind: row after row, the first at the top."""

    first: int
    """Of its texels."""
    width: int
    height: int
    kind: int


@wp.struct
class Images:
    """All pictures of a scene."""

    images: wp.array(dtype=Image)
    texels: wp.array(dtype=wp.uint32)
    """RGBA in 8 bits each, the lowest first."""
    float_texels: wp.array(dtype=wp.vec4)
    decoded: wp.array(dtype=float)
    """(256,) linear values of the bytes of sRGB."""


@wp.struct
class Texture:
    """One image, or tiles of UDIM: columns of ten, then rows."""

    first_tile: int
    """Of its indices of images; -1 stands for none."""
    tile_rows: int
    """0: one image, wrapped."""
    wrap_s: int
    wrap_t: int
    fallback: wp.vec4


@wp.struct
class Textures:
    """All textures of a scene."""

    textures: wp.array(dtype=Texture)
    tiles: wp.array(dtype=int)
    images: Images


@wp.func
def fetch_texel(images: Images, image: Image, column: int, row: int) -> wp.vec4:
    """Linear RGBA of one texel; row 0 is the top one."""
    place = image.first + row * image.width + column
    if image.kind == FLOATS:
        return images.float_texels[place]
    packed = images.texels[place]
    r = wp.int32(packed & wp.uint32(255))
    g = wp.int32((packed >> wp.uint32(8)) & wp.uint32(255))
    b = wp.int32((packed >> wp.uint32(16)) & wp.uint32(255))
    a = float(packed >> wp.uint32(24)) / 255.0
    if image.kind == SRGB_BYTES:
        return wp.vec4(images.decoded[r], images.decoded[g], images.decoded[b], a)
    return wp.vec4(float(r) / 255.0, float(g) / 255.0, float(b) / 255.0, a)


@wp.func
def wrap_texel(i: int, count: int, wrap: int) -> int:
    """The texel that stands for one beyond the image; -1 for black."""
    if i >= 0 and i < count:
        return i
    if wrap == BLACK:
        return -1
    if wrap == CLAMP:
        return wp.clamp(i, 0, count - 1)
    period = count
    if wrap == MIRROR:
        period = 2 * count
    # The remainder has the sign of i.
    place = i % period
    if place < 0:
        place += period
    if place >= count:
        place = period - 1 - place
    return place


@wp.func
def tap(images: Images, image: Image, column: int, row: int) -> wp.vec4:
    """A texel, black where there is none."""
    if column < 0 or row < 0:
        return wp.vec4(0.0)
    return fetch_texel(images, image, column, row)


@wp.func
def read_image(images: Images, image: Image, s: float, t: float, wrap_s: int, wrap_t: int) -> wp.vec4:
    """Linear RGBA at texture coordinates, bilinear between the centres of texels."""
    x = wp.clamp(s * float(image.width) - 0.5, -FARTHEST, FARTHEST)
    y = wp.clamp((1.0 - t) * float(image.height) - 0.5, -FARTHEST, FARTHEST)
    column = int(wp.floor(x))
    row = int(wp.floor(y))
    across = x - wp.floor(x)
    down = y - wp.floor(y)
    left = wrap_texel(column, image.width, wrap_s)
    right = wrap_texel(column + 1, image.width, wrap_s)
    top = wrap_texel(row, image.height, wrap_t)
    bottom = wrap_texel(row + 1, image.height, wrap_t)
    upper = tap(images, image, left, top) * (1.0 - across) + tap(images, image, right, top) * across
    lower = tap(images, image, left, bottom) * (1.0 - across) + tap(images, image, right, bottom) * across
    return upper * (1.0 - down) + lower * down


@wp.func
def tile_at(textures: Textures, texture: Texture, st: wp.vec2) -> int:
    """The image at texture coordinates, -1 for none."""
    if texture.tile_rows == 0:
        return textures.tiles[texture.first_tile]
    column = wp.floor(st[0])
    row = wp.floor(st[1])
    if column < 0.0 or column >= float(UDIM_COLUMNS) or row < 0.0 or row >= float(texture.tile_rows):
        return -1
    return textures.tiles[texture.first_tile + int(row) * UDIM_COLUMNS + int(column)]


@wp.func
def read_texture(textures: Textures, texture: Texture, image: int, st: wp.vec2) -> wp.vec4:
    """Linear RGBA at texture coordinates, where `tile_at` gives this image."""
    picture = textures.images.images[image]
    if texture.tile_rows == 0:
        return read_image(textures.images, picture, st[0], st[1], texture.wrap_s, texture.wrap_t)
    # Each tile ends at its edge.
    return read_image(textures.images, picture, st[0] - wp.floor(st[0]), st[1] - wp.floor(st[1]), CLAMP, CLAMP)
