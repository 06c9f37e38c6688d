"""What a medium is to a path, as a value: all that the stages of a path ask of it, and nothing else."""

from fgf_warp.integrator.media import lone, many, vacuum
from fgf_warp.integrator.media.value import MediumFunctions, MediumParts

KINDS = {"none": vacuum.build_medium, "lone": lone.build_medium, "many": many.build_medium}
"""By `RenderFeatures.medium_kind`."""


def build_medium(parts: MediumParts) -> MediumFunctions:
    """The medium of a kernel of these features."""
    return KINDS[parts.features.medium_kind](parts)
