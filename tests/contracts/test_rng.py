"""Random numbers: the generator's known answers, the lattice, and the failures that weak generators have shown."""

import numpy as np
import pytest
import warp as wp

from fgf_warp.device import rng
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


DRAWS = {"independent": device_kernels.independent_kernel, "lattice": device_kernels.lattice_kernel}


def draw(kind, seed, pixels, samples, bounce=1, purpose=1):
    """(pixels, samples, 4) numbers of one event."""
    out = wp.zeros((pixels, samples), dtype=wp.vec4, device="cpu")
    wp.launch(
        DRAWS[kind], dim=(pixels, samples), inputs=[wp.uint64(seed), bounce, purpose], outputs=[out], device="cpu"
    )
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


@pytest.mark.parametrize("kind", DRAWS)
def test_uniform_in_the_open_interval(kind):
    # Of the lattice, one sample of each pixel: only those are independent.
    xi = draw(kind, 0, 2048, 256) if kind == "independent" else draw(kind, 0, 2**19, 1)
    assert xi.min() > 0
    assert xi.max() < 1
    counts = np.histogram(xi, bins=4096, range=(0, 1))[0]
    stats.assert_histogram(counts, np.full(4096, xi.size / 4096))


def assert_independent(x, y):
    """Chi-square on 32 x 32 bins."""
    counts = np.histogram2d(x.ravel(), y.ravel(), bins=32, range=((0, 1), (0, 1)))[0]
    stats.assert_histogram(counts, np.full(counts.shape, x.size / counts.size))


def test_independent_numbers_are_independent():
    """Of their neighbours in every direction of the address."""
    xi = draw("independent", 9, 1024, 512)
    assert_independent(xi[..., 0], xi[..., 1])
    assert_independent(xi[1:, :, 0], xi[:-1, :, 0])
    assert_independent(xi[:, 1:, 0], xi[:, :-1, 0])
    assert_independent(xi[..., 1], draw("independent", 9, 1024, 512, bounce=2)[..., 1])
    assert_independent(xi[..., 2], draw("independent", 9, 1024, 512, purpose=2)[..., 2])
    assert_independent(xi[..., 3], draw("independent", 10, 1024, 512)[..., 3])


@pytest.mark.parametrize("sample", [0, 1, 63])
def test_a_point_of_the_lattice_is_independent_of_other_events_and_pixels(sample):
    """Without this an estimate would be biased: of each sample alone, in every pair of its numbers."""

    def of(bounce=1, purpose=1, seed=9):
        return draw("lattice", seed, 2**17, sample + 1, bounce, purpose)[:, sample]

    xi = of()
    for a, b in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)):
        assert_independent(xi[:, a], xi[:, b])
    for k in range(4):
        assert_independent(xi[1:, k], xi[:-1, k])
        assert_independent(xi[:, k], of(bounce=2)[:, k])
        assert_independent(xi[:, k], of(purpose=3)[:, k])
        assert_independent(xi[:, k], of(seed=10)[:, k])
    for k in range(2):
        assert_independent(xi[:, k], of(purpose=0)[:, k])


def test_the_lattice_is_shuffled_anew_at_every_event():
    """Of the two events' samples in one pixel, the pairs fill the square as those of random orders would."""
    first, second = draw("lattice", 4, 4096, 64, bounce=1), draw("lattice", 4, 4096, 64, bounce=2)
    assert_independent(first[..., 0], second[..., 0])
    assert_independent(draw("lattice", 4, 4096, 64, bounce=0, purpose=0)[..., 0], first[..., 0])


@pytest.mark.parametrize("purpose", [0, 1])
def test_every_aligned_block_of_samples_is_a_lattice(purpose):
    """So in each of its numbers the samples are evenly spaced."""
    xi = draw("lattice", 3, 64, 256, purpose=purpose)[..., : 2 if purpose == 0 else 4]
    for size in (1, 2, 16, 64, 256):
        blocks = np.sort(xi.reshape(64, 256 // size, size, -1), axis=2)
        gaps = np.diff(np.concatenate([blocks, blocks[:, :, :1] + 1], axis=2), axis=2)
        assert np.abs(gaps * size - 1).max() < 1e-4


def worst_case_error(vector, count):
    """Squared, of the rank-1 lattice of `count` points, for periodic functions of smoothness 2 and weights 0.6."""
    x = np.arange(count)[:, None] * np.array(vector) % count / count
    return np.prod(1 + 0.6 * 2 * np.pi**2 * (x * x - x + 1 / 6), axis=1).mean() - 1


def test_the_generating_vector_is_a_good_one():
    """As good as the first components of a published one, and better by 1.5 where those serve least."""
    ours = (1, int(rng.LATTICE_1), int(rng.LATTICE_2), int(rng.LATTICE_3))
    # exod2_base2_m20_CKN of Cools, Kuo and Nuyens 2006, "Constructing embedded lattice rules".
    published = (1, 182667, 469891, 498753)
    gains = [worst_case_error(published, 2**m) / worst_case_error(ours, 2**m) for m in range(2, 13)]
    assert min(gains) > 0.95
    assert max(gains) > 1.5


def test_means_of_many_images():
    """The means of 256 images spread as means of independent numbers do; sees a bias of 1e-3 in all of them."""
    means = np.array([draw("independent", seed, 1024, 16).mean(axis=(0, 1)) for seed in range(256)])
    z = (means - 0.5) / np.sqrt(1 / 12 / (1024 * 16))
    assert np.abs(z).max() < stats.sidak_z(z.size)
    assert abs(z.var() - 1) < 5 * np.sqrt(2 / z.size)
