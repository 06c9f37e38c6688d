"""Random numbers addressed by (seed, pixel, sample, bounce, purpose): no state, so no order of evaluation.

Independent numbers: Philox4x32 of Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3", with 7 rounds, the
fewest that the paper reports to pass BigCrush. The seed is the 64-bit key, the address the 128-bit counter.

Lattice points: at each event the samples of a pixel take the points of one randomly shifted rank-1 lattice in four
dimensions, in an order that is shuffled anew for every event. Any 2^m successive samples from a multiple of 2^m on are
a whole lattice of 2^m points, which covers the four dimensions evenly. Each point alone is uniform, so estimates are
unbiased; events of a path are independent of each other as for independent numbers.
"""

import warp as wp

PHILOX_ROUNDS = wp.constant(7)
MULTIPLIER_0 = wp.constant(wp.uint32(0xD2511F53))
MULTIPLIER_1 = wp.constant(wp.uint32(0xCD9E8D57))
WEYL_0 = wp.constant(wp.uint32(0x9E3779B9))
WEYL_1 = wp.constant(wp.uint32(0xBB67AE85))
"""The constants of the paper's table 2 for Philox4x32."""

LCG_FACTOR = wp.constant(wp.uint32(1664525))
LCG_TERM = wp.constant(wp.uint32(1013904223))
LOWBIAS_0 = wp.constant(wp.uint32(0x7FEB352D))
LOWBIAS_1 = wp.constant(wp.uint32(0x846CA68B))

LATTICE_1 = wp.constant(wp.uint32(5307))
LATTICE_2 = wp.constant(wp.uint32(11929))
LATTICE_3 = wp.constant(wp.uint32(14551))
LATTICE_4 = wp.constant(wp.uint32(7693))
LATTICE_5 = wp.constant(wp.uint32(8631))
"""Generating vector, after its first component 1: found bit by bit, as the one of least worst-case error (P_2 with
weights 0.6) on average over 4 to 16384 points, so that it serves any number of samples."""

CAMERA = wp.constant(0)
"""Purpose: position in the pixel."""
EVENT = wp.constant(1)
"""Purpose: flight, roulette, and the two numbers of a new direction."""
CONNECTION = wp.constant(2)
"""Purpose: which light, and where on it."""
WHOLE_PATH = wp.constant(3)
"""Purpose: at bounce 0 which channel's flights a path takes, its time, and the two numbers of its place on the lens;
and, for each medium at a bounce of its own, whether and at which rate the path is frozen there."""
PURPOSES = wp.constant(4)


@wp.func(inline=True)
def mul_high(a: wp.uint32, b: wp.uint32) -> wp.uint32:
    """Upper 32 bits of the 64-bit product."""
    return wp.uint32((wp.uint64(a) * wp.uint64(b)) >> wp.uint64(32))


@wp.func(inline=True)
def to_uniform(bits: wp.uint32) -> float:
    """A number in (0, 1): multiples of 2^-32 as far as float32 holds them, never 0 and never 1."""
    return wp.clamp(float(bits) * 2.3283064365386963e-10, 1.16415321826935e-10, 0.99999994)


@wp.func(inline=True)
def philox(seed: wp.uint64, c0: wp.uint32, c1: wp.uint32, c2: wp.uint32, c3: wp.uint32) -> wp.vec4ui:
    """Four independent 32-bit words for one counter."""
    key0 = wp.uint32(seed)
    key1 = wp.uint32(seed >> wp.uint64(32))
    x0 = c0
    x1 = c1
    x2 = c2
    x3 = c3
    for _ in range(PHILOX_ROUNDS):
        y0 = mul_high(MULTIPLIER_1, x2) ^ x1 ^ key0
        y1 = MULTIPLIER_1 * x2
        y2 = mul_high(MULTIPLIER_0, x0) ^ x3 ^ key1
        x3 = MULTIPLIER_0 * x0
        x0 = y0
        x1 = y1
        x2 = y2
        key0 = key0 + WEYL_0
        key1 = key1 + WEYL_1
    return wp.vec4ui(x0, x1, x2, x3)


@wp.func(inline=True)
def reverse_bits(x: wp.uint32) -> wp.uint32:
    """The 32 bits in reverse order: of a sample's number, the van der Corput sequence."""
    y = (x << wp.uint32(16)) | (x >> wp.uint32(16))
    y = ((y & wp.uint32(0x00FF00FF)) << wp.uint32(8)) | ((y >> wp.uint32(8)) & wp.uint32(0x00FF00FF))
    y = ((y & wp.uint32(0x0F0F0F0F)) << wp.uint32(4)) | ((y >> wp.uint32(4)) & wp.uint32(0x0F0F0F0F))
    y = ((y & wp.uint32(0x33333333)) << wp.uint32(2)) | ((y >> wp.uint32(2)) & wp.uint32(0x33333333))
    return ((y & wp.uint32(0x55555555)) << wp.uint32(1)) | ((y >> wp.uint32(1)) & wp.uint32(0x55555555))


@wp.func(inline=True)
def stir_words(a: wp.uint32, b: wp.uint32, c: wp.uint32, d: wp.uint32) -> wp.vec4ui:
    """Each word with the products of others."""
    x = a + b * d
    y = b + c * x
    z = c + x * y
    return wp.vec4ui(x, y, z, d + y * z)


@wp.func(inline=True)
def mix_words(words: wp.vec4ui) -> wp.vec4ui:
    """The second half of `hash_words`; of its result, four words more."""
    shift = wp.uint32(16)
    return stir_words(
        words[0] ^ (words[0] >> shift),
        words[1] ^ (words[1] >> shift),
        words[2] ^ (words[2] >> shift),
        words[3] ^ (words[3] >> shift),
    )


@wp.func(inline=True)
def hash_words(a: wp.uint32, b: wp.uint32, c: wp.uint32, d: wp.uint32) -> wp.vec4ui:
    """Four words from four: pcg4d of Jarzynski and Olano 2020, "Hash functions for GPU rendering"."""
    return mix_words(
        stir_words(
            a * LCG_FACTOR + LCG_TERM, b * LCG_FACTOR + LCG_TERM, c * LCG_FACTOR + LCG_TERM, d * LCG_FACTOR + LCG_TERM
        )
    )


@wp.func(inline=True)
def mix_bits(bits: wp.uint32) -> wp.uint32:
    """A word whose every bit depends on all of `bits`: lowbias32 of Wellons 2018, "Prospecting for hash functions"."""
    x = (bits ^ (bits >> wp.uint32(16))) * LOWBIAS_0
    x = (x ^ (x >> wp.uint32(15))) * LOWBIAS_1
    return x ^ (x >> wp.uint32(16))


@wp.func(inline=True)
def shuffle_nested(reversed_bits: wp.uint32, key: wp.uint32) -> wp.uint32:
    """A random permutation of binary fractions that maps every dyadic interval onto one of its size.

    The hash of Laine and Karras 2011, "Stratified sampling for stochastic transparency", with the constants of
    Vegdahl 2021, "Building a better LK hash"; each bit is changed by those below it alone, in reverse order.
    """
    x = reversed_bits
    x = x ^ (x * wp.uint32(0x3D20ADEA))
    x += key
    x *= (key >> wp.uint32(16)) | wp.uint32(1)
    x = x ^ (x * wp.uint32(0x05526C56))
    x = x ^ (x * wp.uint32(0x53A22864))
    return x


@wp.func(inline=True)
def draw_independent(seed: wp.uint64, pixel: int, sample_index: int, bounce: int, purpose: int) -> wp.vec4:
    """Four independent numbers in (0, 1) for one address; `sample_index` is the number with its bits reversed."""
    bits = philox(seed, wp.uint32(pixel), wp.uint32(sample_index), wp.uint32(bounce), wp.uint32(purpose))
    return wp.vec4(to_uniform(bits[0]), to_uniform(bits[1]), to_uniform(bits[2]), to_uniform(bits[3]))


@wp.func(inline=True)
def pixel_shift(seed: wp.uint64, pixel: int) -> wp.vec4ui:
    """The shift of the lattice from which a pixel's samples take their first numbers, those of the camera."""
    return hash_words(wp.uint32(pixel), wp.uint32(CAMERA), wp.uint32(seed), wp.uint32(seed >> wp.uint64(32)))


@wp.func(inline=True)
def draw_in_pixel(shift_x: int, shift_y: int, sample_index: int) -> wp.vec2:
    """A point of the pixel's lattice in (0, 1)^2, in its own order: all other events are shuffled against it."""
    place = wp.uint32(sample_index)
    return wp.vec2(to_uniform(place + wp.uint32(shift_x)), to_uniform(place * LATTICE_1 + wp.uint32(shift_y)))


@wp.func(inline=True)
def event_shift(seed: wp.uint64, pixel: int, bounce: int, purpose: int) -> wp.vec4ui:
    """The shift of the lattice of one event."""
    event = wp.uint32(bounce) * wp.uint32(PURPOSES) + wp.uint32(purpose)
    return hash_words(wp.uint32(pixel), event, wp.uint32(seed), wp.uint32(seed >> wp.uint64(32)))


@wp.func(inline=True)
def place_in_lattice(shift: wp.vec4ui, sample_index: int) -> wp.uint32:
    """Which of the points of the lattice with this shift a sample takes."""
    return shuffle_nested(wp.uint32(sample_index), mix_bits(shift[0] ^ (shift[2] * WEYL_0)))


@wp.func(inline=True)
def draw_lattice(seed: wp.uint64, pixel: int, sample_index: int, bounce: int, purpose: int) -> wp.vec4:
    """The first four numbers of a point of the lattice of one event, in (0, 1)."""
    shift = event_shift(seed, pixel, bounce, purpose)
    place = place_in_lattice(shift, sample_index)
    return wp.vec4(
        to_uniform(place + shift[0]),
        to_uniform(place * LATTICE_1 + shift[1]),
        to_uniform(place * LATTICE_2 + shift[2]),
        to_uniform(place * LATTICE_3 + shift[3]),
    )


@wp.func(inline=True)
def draw_more_lattice(seed: wp.uint64, pixel: int, sample_index: int, bounce: int, purpose: int) -> wp.vec2:
    """The next two numbers of the same point."""
    shift = event_shift(seed, pixel, bounce, purpose)
    place = place_in_lattice(shift, sample_index)
    more = mix_words(shift)
    return wp.vec2(to_uniform(place * LATTICE_4 + more[0]), to_uniform(place * LATTICE_5 + more[1]))


@wp.func(inline=True)
def draw_more_independent(seed: wp.uint64, pixel: int, sample_index: int, bounce: int, purpose: int) -> wp.vec2:
    """Two further independent numbers of one address."""
    xi = draw_independent(seed, pixel, sample_index, bounce, purpose + PURPOSES)
    return wp.vec2(xi[0], xi[1])
