"""The counter-based generator: the paper's known answers, and the failures that weak generators have shown."""

import numpy as np
import warp as wp

from tests import stats
from tests.contracts import device_kernels

SEED_PI = 0x299F31D0_A4093822
COUNTER_PI = (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344)
KNOWN_ANSWERS = [
    # rounds, key, counter, answer: the known-answer vectors of Salmon et al.'s Random123.
    (10, 0, (0,) * 4, (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    (10, 2**64 - 1, (2**32 - 1,) * 4, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (10, SEED_PI, COUNTER_PI, (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1)),
    (7, 0, (0,) * 4, (0x5F6FB709, 0x0D893F64, 0x4F121F81, 0x4F730A48)),
]


def philox_of_the_paper(seed, counter, rounds):
    """Philox4x32 in Python's integers, after figure 2 and table 2 of the paper."""
    key = [seed & 0xFFFFFFFF, seed >> 32]
    x = list(counter)
    for _ in range(rounds):
        high, low = zip(*(divmod(m * x[i], 2**32) for m, i in ((0xD2511F53, 0), (0xCD9E8D57, 2))), strict=True)
        x = [high[1] ^ x[1] ^ key[0], low[1], high[0] ^ x[3] ^ key[1], low[0]]
        key = [(key[0] + 0x9E3779B9) % 2**32, (key[1] + 0xBB67AE85) % 2**32]
    return tuple(x)


def philox(seed, counters):
    counter = wp.array(np.asarray(counters, dtype=np.uint32), dtype=wp.vec4ui, device="cpu")
    out = wp.zeros(counter.shape[0], dtype=wp.vec4ui, device="cpu")
    inputs = [wp.uint64(seed), counter]
    wp.launch(device_kernels.philox_kernel, dim=counter.shape[0], inputs=inputs, outputs=[out], device="cpu")
    return out.numpy()


def uniforms(seed, pixels, samples, purpose=1):
    out = wp.zeros((pixels, samples), dtype=wp.vec4, device="cpu")
    inputs = [wp.uint64(seed), samples, purpose]
    wp.launch(device_kernels.uniforms_kernel, dim=(pixels, samples), inputs=inputs, outputs=[out], device="cpu")
    return out.numpy().astype(np.float64)


def test_known_answers():
    for rounds, seed, counter, answer in KNOWN_ANSWERS:
        assert philox_of_the_paper(seed, counter, rounds) == answer


def test_device_is_the_papers_with_seven_rounds():
    counters = np.random.default_rng(0).integers(2**32, size=(200, 4), dtype=np.uint32)
    for seed in (0, 1, SEED_PI, 2**64 - 1):
        expected = [philox_of_the_paper(seed, [int(c) for c in counter], 7) for counter in counters]
        assert np.array_equal(philox(seed, counters), np.array(expected, dtype=np.uint32))


def test_every_part_of_the_address_matters():
    base = philox(5, [(1, 2, 3, 4)])[0]
    others = [philox(5 + 2**bit, [(1, 2, 3, 4)])[0] for bit in range(3, 64)]
    others += [
        philox(5, [np.bitwise_xor((1, 2, 3, 4), np.eye(4, dtype=int)[word] << bit)])[0]
        for word in range(4)
        for bit in range(31)
    ]
    flipped = np.array([np.bitwise_count(np.bitwise_xor(base, other)).sum() for other in others])
    # 128 bits, each flipped with probability one half: standard deviation 5.7.
    assert abs(flipped.mean() - 64) < 5 * 5.66 / np.sqrt(flipped.size)
    assert flipped.min() > 64 - 6 * 5.66


def test_uniform_in_the_open_interval():
    xi = uniforms(0, 2048, 256)
    assert xi.min() > 0
    assert xi.max() < 1
    counts = np.histogram(xi, bins=4096, range=(0, 1))[0]
    stats.assert_histogram(counts, np.full(4096, xi.size / 4096))


def test_pairs_are_independent():
    """Neighbours in every direction of the address: chi-square on 32 x 32 bins."""
    xi = uniforms(9, 1024, 512)
    pairs = {
        "words": (xi[..., 0], xi[..., 1]),
        "pixels": (xi[1:, :, 0], xi[:-1, :, 0]),
        "samples": (xi[:, 1:, 0], xi[:, :-1, 0]),
        "purposes": (xi[..., 2], uniforms(9, 1024, 512, purpose=2)[..., 2]),
        "seeds": (xi[..., 3], uniforms(10, 1024, 512)[..., 3]),
    }
    for x, y in pairs.values():
        counts = np.histogram2d(x.ravel(), y.ravel(), bins=32, range=((0, 1), (0, 1)))[0]
        stats.assert_histogram(counts, np.full(counts.shape, x.size / counts.size))


def test_means_of_many_images():
    """The means of 256 images spread as means of independent numbers do; sees a bias of 1e-3 in all of them."""
    means = np.array([uniforms(seed, 1024, 16).mean(axis=(0, 1)) for seed in range(256)])
    z = (means - 0.5) / np.sqrt(1 / 12 / (1024 * 16))
    assert np.abs(z).max() < stats.sidak_z(z.size)
    assert abs(z.var() - 1) < 5 * np.sqrt(2 / z.size)
