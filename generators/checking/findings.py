"""What a check finds, and what it makes of a dataset."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum


class Kind(StrEnum):
    """What follows from a finding."""

    INCOMPLETE = "incomplete"
    """A sample is not made yet, or could not be made."""
    OUTDATED = "outdated"
    """What is written at the end of a run is missing, or older than a sample."""
    DAMAGED = "damaged"
    """A file is gone, or is not what was written."""
    SURPLUS = "surplus"
    """A file or folder belongs to no dataset; loaders may take it for a part of this one."""
    LEFTOVER = "leftover"
    """A hidden file or folder that a run which was killed left half-written."""


@dataclass(frozen=True)
class Finding:
    """One thing that is not as it should be.

    Args:
        kind: what follows from it.
        name: of the file or folder, relative to the dataset.
        found: what is there.
        expected: what should be there.
        sample: index of the sample that it belongs to; None for files of the dataset.
    """

    kind: Kind
    name: str
    found: str
    expected: str
    sample: int | None = None

    def __str__(self) -> str:
        # Names of files, and what damaged ones say, may hold the end of a line.
        line = f"{self.name}: {self.found}; expected: {self.expected}"
        return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)


@dataclass(frozen=True)
class Verification:
    """What a check found.

    Args:
        findings: files of the dataset first, then samples by their index.
        planned: number of samples of the plan; 0 where the plan is damaged.
        complete: number of samples that are there.
        files: number of files that were looked at.
        bytes: their size together.
    """

    findings: tuple[Finding, ...]
    planned: int
    complete: int
    files: int
    bytes: int

    @property
    def is_whole(self) -> bool:
        """Whether nothing was found."""
        return not self.findings

    @property
    def is_damaged(self) -> bool:
        """Whether a file of the dataset is damaged."""
        return bool(self.of(Kind.DAMAGED))

    @property
    def is_unfinished(self) -> bool:
        """Whether samples, or what is written at the end of a run, are missing."""
        return bool(self.of(Kind.INCOMPLETE) or self.of(Kind.OUTDATED))

    def of(self, kind: Kind) -> list[Finding]:
        """The findings of one kind."""
        return [finding for finding in self.findings if finding.kind is kind]

    @property
    def is_repairable(self) -> bool:
        """Whether anything was found that can be made anew; what does not belong stays, and so do samples to come."""
        return any(finding.kind in (Kind.OUTDATED, Kind.DAMAGED, Kind.LEFTOVER) for finding in self.findings)

    def by_kind(self) -> dict[Kind, list[Finding]]:
        """The findings of each kind of which there are any."""
        return {kind: self.of(kind) for kind in Kind if self.of(kind)}

    def damaged_samples(self) -> list[int]:
        """Indices of the samples of which something is damaged, in order."""
        return sorted({finding.sample for finding in self.of(Kind.DAMAGED) if finding.sample is not None})


def name_ranges(numbers: Sequence[int]) -> str:
    """Numbers in increasing order as a person writes them: ``3, 7-12``."""
    return ", ".join(str(first) if first == last else f"{first}-{last}" for first, last in _ranges(numbers))


def _ranges(numbers: Iterable[int]) -> list[tuple[int, int]]:
    found: list[tuple[int, int]] = []
    for number in numbers:
        if found and number == found[-1][1] + 1:
            found[-1] = (found[-1][0], number)
        else:
            found.append((number, number))
    return found
