"""Parts of a plan, for as many runs."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fgf_warp.errors import ConfigError
from generators.running.messages import Chunk
from generators.wording import shortened

if TYPE_CHECKING:
    from generators.planning.plan import Plan, Sample


@dataclass(frozen=True)
class Shard:
    """One of `count` parts of a plan.

    Args:
        index: in [0, count).
        count: >= 1.

    Raises:
        ConfigError: for others.
    """

    index: int = 0
    count: int = 1

    def __post_init__(self) -> None:
        if not 0 <= self.index < self.count:
            raise ConfigError(f"shard {self.index}/{self.count}: accepted: i/n with 0 <= i < n")

    @classmethod
    def parse(cls, text: str) -> Shard:
        """Reads ``i/n``, such as ``0/4`` for the first quarter.

        Raises:
            ConfigError: for anything else.
        """
        found = re.fullmatch(r"(\d{1,9})/(\d{1,9})", text.strip())
        if not found:
            raise ConfigError(f"shard {shortened(text)}: accepted: i/n with 0 <= i < n, such as 0/4")
        return cls(int(found[1]), int(found[2]))

    @property
    def is_whole(self) -> bool:
        """Whether it is all of the plan."""
        return self.count == 1

    @property
    def suffix(self) -> str:
        """Of the names of its files."""
        return "" if self.is_whole else f"-{self.index}-of-{self.count}"

    def __str__(self) -> str:
        return f"{self.index}/{self.count}"


def samples_of(plan: Plan, shard: Shard) -> list[int]:
    """Indices of the samples of a shard, those that share a batch after each other.

    Each shard gets as many of each batch, drawn by their seeds, so that all take about equally long, whatever the axes
    do.

    Returns:
        Each sample of the plan is in one of the `shard.count` shards.
    """
    groups: dict[Hashable, list[int]] = defaultdict(list)
    for sample in plan.samples:
        groups[plan.group_key(sample), _kernel_key(sample)].append(sample.index)
    dealt = [index for group in groups.values() for index in sorted(group, key=lambda index: plan.samples[index].seed)]
    mine = set(dealt[shard.index :: shard.count])
    return [index for group in groups.values() for index in group if index in mine]


def _kernel_key(sample: Sample) -> Hashable:
    """What of a medium a kernel is built for."""
    medium = sample.medium
    if medium is None:
        return None
    return tuple(law.kind for law in medium.channel_laws), medium.resolved_transport, medium.phase_function


def cut_chunks(indices: Sequence[int], count: int) -> list[Chunk]:
    """Cuts samples into about so many chunks of equal size, in their order.

    Args:
        indices: of samples.
        count: >= 1.

    Returns:
        At most `count`, of which the last may be smaller.
    """
    size = max(1, -(-len(indices) // count))
    return [Chunk(tuple(indices[first : first + size])) for first in range(0, len(indices), size)]
