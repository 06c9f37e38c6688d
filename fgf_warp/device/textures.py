"""Images on the device: their texels, one by one."""

import warp as wp

BYTES = wp.constant(0)
"""Linear, 8 bits a channel."""
SRGB_BYTES = wp.constant(1)
"""The same, with R, G and B encoded by the transfer function of sRGB."""
FLOATS = wp.constant(2)


@wp.struct
class Image:
    """A picture among the texels of its kind: row after row, the first at the top."""

    first: int
    """Of its texels."""
    width: int
    height: int
    kind: int


@wp.func
def decode_srgb(value: float) -> float:
    """Linear value of one encoded as IEC 61966-2-1 says, both in [0, 1]."""
    if value <= 0.04045:
        return value / 12.92
    return wp.pow((value + 0.055) / 1.055, 2.4)


@wp.func
def fetch_texel(
    image: Image, texels: wp.array(dtype=wp.uint32), float_texels: wp.array(dtype=wp.vec4), column: int, row: int
) -> wp.vec4:
    """Linear RGBA of one texel; row 0 is the top one."""
    place = image.first + row * image.width + column
    if image.kind == FLOATS:
        return float_texels[place]
    packed = texels[place]
    mask = wp.uint32(255)
    rgba = (
        wp.vec4(
            float(packed & mask),
            float((packed >> wp.uint32(8)) & mask),
            float((packed >> wp.uint32(16)) & mask),
            float(packed >> wp.uint32(24)),
        )
        / 255.0
    )
    if image.kind == SRGB_BYTES:
        rgba = wp.vec4(decode_srgb(rgba[0]), decode_srgb(rgba[1]), decode_srgb(rgba[2]), rgba[3])
    return rgba
