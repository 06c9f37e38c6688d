"""Random numbers addressed by (seed, pixel, sample, bounce, purpose): no state, so no order of evaluation.

Philox4x32 of Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3", with 7 rounds, the fewest that
the paper reports to pass BigCrush. The seed is the 64-bit key, the address the 128-bit counter.
"""

import warp as wp

PHILOX_ROUNDS = wp.constant(7)
MULTIPLIER_0 = wp.constant(wp.uint32(0xD2511F53))
MULTIPLIER_1 = wp.constant(wp.uint32(0xCD9E8D57))
WEYL_0 = wp.constant(wp.uint32(0x9E3779B9))
WEYL_1 = wp.constant(wp.uint32(0xBB67AE85))
"""The constants of the paper's table 2 for Philox4x32."""

CAMERA = wp.constant(0)
"""Purpose: position in the pixel."""
EVENT = wp.constant(1)
"""Purpose: flight, roulette, and the two numbers of a new direction."""
CORRELATED_FLIGHT = wp.constant(2)
"""Purpose: the two further numbers of a flight between medium vertices."""
CONNECTION = wp.constant(3)
"""Purpose: which light, and where on it."""


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
def uniforms(seed: wp.uint64, pixel: int, sample: int, bounce: int, purpose: int) -> wp.vec4:
    """Four independent numbers in (0, 1) for one address."""
    bits = philox(seed, wp.uint32(pixel), wp.uint32(sample), wp.uint32(bounce), wp.uint32(purpose))
    return wp.vec4(to_uniform(bits[0]), to_uniform(bits[1]), to_uniform(bits[2]), to_uniform(bits[3]))
