"""Where a pool keeps what belongs to its lanes: sums of pixels, paths, and BSDFs, one after the other."""

from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.bsdf import Bsdf
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.path import PathRecord
from fgf_warp.integrator.rows import LANES
from fgf_warp.integrator.tally import TallyRecord


class PoolLayout(NamedTuple):
    """Functions of the device from the address of a pool to its arrays.

    Arrays of known layout, made in the kernel, are what lets the compiler see that lanes are apart.

    Args:
        sums_of: float64, of each lane's pixel, see `TallyRecord`.
        lanes_of: float32, see `PathRecord`.
        bsdfs_of: (LANES,) Bsdf, of each lane the surface that it met; empty where there is none.
        float_count: length of the pool, in units of four bytes.
    """

    sums_of: Any
    lanes_of: Any
    bsdfs_of: Any
    float_count: int


def build_pool_layout(features: RenderFeatures, record: PathRecord, tally: TallyRecord) -> PoolLayout:
    """The layout of a kernel of these features."""
    sum_count, path_floats = tally.sum_count, record.float_count
    bsdf_count = int(LANES) if features.shading else 0

    @wp.func(inline=True)
    def sums_of(pool: wp.uint64) -> wp.array(dtype=wp.float64):
        return wp.array(ptr=pool, shape=(wp.static(sum_count),), dtype=wp.float64)

    @wp.func(inline=True)
    def lanes_of(pool: wp.uint64) -> wp.array(dtype=float):
        return wp.array(ptr=pool + wp.uint64(wp.static(8 * sum_count)), shape=(wp.static(path_floats),), dtype=float)

    @wp.func(inline=True)
    def bsdfs_of(pool: wp.uint64) -> wp.array(dtype=Bsdf):
        start = pool + wp.uint64(wp.static(8 * sum_count + 4 * path_floats))
        return wp.array(ptr=start, shape=(wp.static(bsdf_count),), dtype=Bsdf)

    bsdf_floats = bsdf_count * Bsdf.numpy_dtype()["itemsize"] // 4
    return PoolLayout(sums_of, lanes_of, bsdfs_of, 2 * sum_count + path_floats + bsdf_floats)
