"""What a run of `fgf stability` found, and the verdict on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generators.stability.furnace import Rendered
from generators.stability.measurement import Measurement

CELLS = "cells.parquet"
"""The table beside the report, with a row for every cell."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a run found.

    Args:
        law: measurements of the law's functions.
        flights: of its samplers.
        exact_fbm: of the law and the sampler with the exact variance of fractional Brownian motion.
        phase: of the phase functions.
        parameters: of what is accepted.
        rendered: of the renders.
        device: that all of it ran on.
        seconds: that it took.
    """

    law: tuple[Measurement, ...]
    flights: tuple[Measurement, ...]
    exact_fbm: tuple[Measurement, ...]
    phase: tuple[Measurement, ...]
    parameters: tuple[Measurement, ...]
    rendered: tuple[Rendered, ...]
    device: str
    seconds: float

    @property
    def measurements(self) -> list[tuple[str, Measurement]]:
        """All, each with the part that it belongs to."""
        parts = (
            ("law", self.law),
            ("flights", self.flights),
            ("exact variance", self.exact_fbm),
            ("phase functions", self.phase),
            ("parameters", self.parameters),
            *((f"render: {one.experiment.name}", tuple(one.measurements.values())) for one in self.rendered),
        )
        return [(part, measurement) for part, measurements in parts for measurement in measurements]

    @property
    def outside_count(self) -> int:
        """Values outside their bounds, of which renders that failed are some."""
        return sum(int(measurement.outside.sum()) for _, measurement in self.measurements)


def conclude(outcome: Outcome) -> str:
    """The verdict in a sentence."""
    measured = sum(int((~np.isnan(found.values)).sum()) for _, found in outcome.measurements if found.bound is not None)
    if outcome.outside_count:
        return f"{outcome.outside_count:,} of {measured:,} values are outside their bounds."
    return (
        f"All {measured:,} values are inside their bounds: all light is accounted for, no parameter is clamped, "
        "nothing is NaN, and absorbing spheres let pass what the law says."
    )
