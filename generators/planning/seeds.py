"""Many seeds at once: what `numpy.random.SeedSequence` gives one by one, for a whole column of samples.

Its algorithm is fixed by NumPy's promise of equal streams; a test holds the two together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

POOL = 4
"""Words that all entropy is mixed into."""
INIT_A, MULT_A = 0x43B0D7E5, 0x931E8875
INIT_B, MULT_B = 0x8B51F9DD, 0x58F38DED
MIX_LEFT, MIX_RIGHT = 0xCA01F9DD, 0x4973F715
SHIFT = 16
MASK = 0xFFFFFFFF


def seed_words(dataset_seed: int, numbers: Sequence[int] | np.ndarray, suffix: Sequence[int] = ()) -> np.ndarray:
    """The first 64 bits of ``SeedSequence(dataset_seed, spawn_key=(number, *suffix))`` for each number.

    Args:
        dataset_seed: in [0, 2^64).
        numbers: (n,), each in [0, 2^32).
        suffix: of the key, each in [0, 2^32).

    Returns:
        (n,) uint64.
    """
    of_seed = [dataset_seed & MASK, dataset_seed >> 32, 0, 0]
    entropy: list[int | np.ndarray] = [*of_seed, np.asarray(numbers, dtype=np.uint32), *suffix]
    mixer = _Mixer()
    pool = [mixer.hash(word) for word in entropy[:POOL]]
    for source in range(POOL):
        for target in range(POOL):
            if source != target:
                pool[target] = _mix(pool[target], mixer.hash(pool[source]))
    for word in entropy[POOL:]:
        pool = [_mix(part, mixer.hash(word)) for part in pool]
    multiplier = INIT_B
    words = []
    for part in pool[:2]:
        value = part ^ np.uint32(multiplier)
        multiplier = multiplier * MULT_B & MASK
        value = value * np.uint32(multiplier)
        words.append((value ^ value >> np.uint32(SHIFT)).astype(np.uint64))
    return words[0] | words[1] << np.uint64(32)


class _Mixer:
    """Hashes words, each with a constant of its own."""

    def __init__(self) -> None:
        self._multiplier = INIT_A

    def hash(self, word: int | np.ndarray) -> np.ndarray:
        value = np.atleast_1d(np.asarray(word, dtype=np.uint32)) ^ np.uint32(self._multiplier)
        self._multiplier = self._multiplier * MULT_A & MASK
        value = value * np.uint32(self._multiplier)
        return np.asarray(value ^ value >> np.uint32(SHIFT))


def _mix(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    value: np.ndarray = np.uint32(MIX_LEFT) * one - np.uint32(MIX_RIGHT) * other
    return np.asarray(value ^ value >> np.uint32(SHIFT))
