"""How far each sample is rendered."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fgf_warp.result import RenderResult

FIRST_ROUND = 16
"""Samples per pixel, of which the error can be told; each round after it doubles them."""


@dataclass(frozen=True)
class Quality:
    """What ends a sample's render: whichever of the bounds is met first.

    Args:
        spp: samples per pixel, at most.
        target_error: mean relative standard error of the pixels, looked at after 16, 32, 64, ... samples per pixel.
        time: of one image [s], if it is rendered alone; the first round is rendered in any case.
    """

    spp: int
    target_error: float | None = None
    time: float | None = None

    @classmethod
    def from_bounds(cls, spp: int, bounds: Mapping[str, float]) -> Quality:
        """Of a plan: its settings' samples per pixel, and the bounds that the config asks for."""
        return cls(spp, bounds.get("target_error"), bounds.get("time"))

    def next_round(self, done: int, seconds: float) -> int:
        """Samples per pixel to add to those that are done in so many seconds; 0 where that is enough."""
        if self.target_error is None and self.time is None:
            return self.spp - done
        more = min(max(done, FIRST_ROUND), self.spp - done)
        if self.time is not None and done:
            more = min(more, int((self.time - seconds) * done / seconds))
        return max(more, 0)

    def is_reached(self, result: RenderResult) -> bool:
        """Whether an image needs no further round."""
        if self.target_error is not None and result.relative_standard_error <= self.target_error:
            return True
        return self.next_round(result.samples, result.seconds) == 0
