"""What a medium is to a path, as a value: all that the stages of a path ask of it, and nothing else."""

from collections.abc import Callable

from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.flight import FlightStart
from fgf_warp.integrator.laws import LineLaws
from fgf_warp.integrator.media import lone, many, vacuum
from fgf_warp.integrator.media.value import MediumFunctions
from fgf_warp.integrator.path import PathRecord
from fgf_warp.integrator.pool_layout import PoolLayout
from fgf_warp.integrator.sampler import Sampler

KINDS: dict[str, Callable[[RenderFeatures, PathRecord, Sampler, LineLaws, FlightStart, PoolLayout], MediumFunctions]] = {
    "none": vacuum.build_medium,
    "lone": lone.build_medium,
    "many": many.build_medium,
}
"""By `RenderFeatures.medium_kind`."""


def build_medium(
    features: RenderFeatures,
    record: PathRecord,
    sampler: Sampler,
    laws: LineLaws,
    flight: FlightStart,
    layout: PoolLayout,
) -> MediumFunctions:
    """The medium of a kernel of these features."""
    return KINDS[features.medium_kind](features, record, sampler, laws, flight, layout)
