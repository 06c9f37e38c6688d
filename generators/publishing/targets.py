"""Targets of a sample beyond its parameters: what its law of transmittance says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from generators.law import evaluate_law

TRANSMITTANCE, MEAN_FREE_PATH = "transmittance", "mean_free_path"
TARGETS: dict[str, tuple[str, str]] = {
    TRANSMITTANCE: ("mean transmittance of segments of the lengths transmittance_t, from an uncorrelated end", ""),
    "transmittance_t": ("lengths of the segments of transmittance", "unit"),
    MEAN_FREE_PATH: ("mean length of a flight from an uncorrelated end; null where infinite or unknown", "unit"),
}
"""What `compute_targets` gives, with meaning and unit."""


def compute_targets(row: Mapping[str, Any], targets: Mapping[str, Any]) -> dict[str, Any]:
    """The targets of one sample.

    Args:
        row: of the plan, with the labels of the swept medium.
        targets: that are asked for, as in `PlanMeta`: ``transmittance`` with its lengths [unit] as ``t``, and
            ``mean_free_path``.

    Returns:
        Numbers, lists of numbers, or None, by the names of `TARGETS`.

    Raises:
        ConfigError: for a length that is not finite and >= 0, or beyond where the law ends.
    """
    curve = targets.get(TRANSMITTANCE)
    law = evaluate_law(
        hurst=row["H"],
        white_noise_scale=None,
        mean_extinction=row["sigma_m"],
        outer_scale=row["L"],
        kappa=row["kappa"],
        line_variance=row["line_variance"],
        lengths=curve["t"] if curve else None,
    )
    found = {TRANSMITTANCE: law["transmittance"], "transmittance_t": law["t"]} if curve else {}
    return {**found, MEAN_FREE_PATH: law["mean_free_path"]} if MEAN_FREE_PATH in targets else found
