"""The similarity relations: media that scatter light alike once its direction is lost.

Wyman, Patterson and Wilson 1989, "Similarity relations for the interaction parameters in radiation transport". Of the
first order is the medium that scatters evenly, with sigma_s' = (1 - g) sigma_s and the same sigma_a. Its field is the
medium's own times sigma_m' / sigma_m: the mean extinction along a length keeps its relative variance, kappa u^b / u
with u = sigma_m' t, at each t. A path that the mixed transport has frozen keeps its rate, relative to sigma_m'.
"""

from __future__ import annotations

from dataclasses import dataclass

from fgf_warp.theory.law import LineLaw


@dataclass(frozen=True)
class SimilarChannel:
    """One channel of the medium that scatters evenly.

    Args:
        mean_extinction: sigma_m' [1/length].
        albedo: in [0, 1].
        kappa: of the law at sigma_m'.
    """

    mean_extinction: float
    albedo: float
    kappa: float


def similar_channel(law: LineLaw, albedo: float, mean_cosine: float) -> SimilarChannel:
    """The similar channel.

    Args:
        law: of the channel.
        albedo: in [0, 1].
        mean_cosine: of the phase function, in (-1, 1).
    """
    scale = 1 - albedo * mean_cosine
    return SimilarChannel(
        law.mean_extinction * scale, albedo * (1 - mean_cosine) / scale, law.kappa * scale ** (1 - law.b)
    )
