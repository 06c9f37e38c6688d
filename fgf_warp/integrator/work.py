"""Which samples of which pixels a launch renders."""

import warp as wp


@wp.struct
class Limits:
    """Where a path ends that nothing else ends."""

    max_depth: int
    roulette_depth: int


@wp.struct
class Counts:
    """How many samples the pixels have and get; one entry per pixel of each image, image after image."""

    done: wp.array(dtype=int)
    """Before all launches of a step."""
    wanted: wp.array(dtype=int)
    """After them."""
    order: wp.array(dtype=int)
    """Of each image, the pixels: side by side those that get about equally many samples, so that they end together."""


@wp.struct
class Round:
    """Of the samples that each pixel gets in a step, those of one launch."""

    skipped: int
    """Of earlier launches."""
    samples: int
    """At most."""


@wp.func(inline=True)
def samples_of_round(counts: Counts, part: Round, place: int):
    """The first sample of a pixel in this launch, and the one after its last."""
    end = counts.wanted[place]
    first = wp.min(counts.done[place] + part.skipped, end)
    return first, wp.min(first + part.samples, end)


@wp.func
def skip_pixels(counts: Counts, part: Round, first_place: int, rank: int, end_rank: int) -> int:
    """The first place in the order of pixels, from `rank` on, whose pixel gets samples in this launch."""
    for candidate in range(rank, end_rank):
        first_sample, end_sample = samples_of_round(counts, part, first_place + counts.order[first_place + candidate])
        if first_sample < end_sample:
            return candidate
    return end_rank
