"""What a render gives back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fgf_warp.settings import Aov, RenderSettings


@dataclass(frozen=True, eq=False)
class RenderResult:
    """An image with its error, counts and provenance.

    Args:
        radiance: (height, width, 3) float32, linear Rec.709; row 0 is the top.
        alpha: (height, width) float32 in [0, 1]: share of camera paths that met a surface or scattered.
        variance: (height, width, 3) float32, variance of the pixel mean; inf for a single sample.
        aovs: the further planes that the settings ask for, float32: (height, width) of depth and scatterings,
            (height, width, 2) of motion, and (height, width, 3) of the others; of prim and instance id (height, width)
            int32. Variance and samples have their own places here.
        samples: samples per pixel reached.
        path_count: camera paths traced.
        truncated_count: paths cut at the bound on their length.
        seconds: wall time of the render, without building the kernel.
        settings: as rendered.
        provenance: parameters, seed and versions, JSON-ready, for the files' headers; equal renders on one
            device give equal values. With prim ids, ``prims`` lists the names that they count.
    """

    radiance: np.ndarray
    alpha: np.ndarray
    variance: np.ndarray
    aovs: dict[Aov, np.ndarray]
    samples: int
    path_count: int
    truncated_count: int
    seconds: float
    settings: RenderSettings
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def standard_error(self) -> np.ndarray:
        """(height, width, 3) float32, standard error of the pixel mean."""
        return np.sqrt(self.variance)

    @property
    def relative_standard_error(self) -> float:
        """Standard error over mean, averaged over the pixels that are not black; 0 for a black image."""
        mean = self.radiance.sum(axis=2, dtype=np.float64)
        lit = mean > 0
        error = self.standard_error.sum(axis=2, dtype=np.float64)
        return float((error[lit] / mean[lit]).mean()) if lit.any() else 0.0

    @property
    def samples_per_second(self) -> float:
        """Camera paths per second of wall time."""
        return self.path_count / self.seconds if self.seconds > 0 else 0.0
