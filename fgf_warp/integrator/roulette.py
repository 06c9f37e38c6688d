"""Russian roulette, and the step into the new direction."""

from typing import Any

import warp as wp

from fgf_warp.device.geometry import MISS
from fgf_warp.device.numerics import choose, max_component
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.path import PathRecord
from fgf_warp.integrator.work import Limits
from fgf_warp.settings import SPLIT_AOVS


def build_channel_weight(features: RenderFeatures, record: PathRecord) -> Any:
    """The function (path) -> vec3: the balance heuristic over the channel that the flights were sampled from."""
    Path = record.struct

    @wp.func(inline=True)
    def channel_weight(path: Path) -> wp.vec3:
        weight = wp.vec3(1.0, 1.0, 1.0)
        if wp.static(features.chromatic):
            total = path.channel_pdfs[0] + path.channel_pdfs[1] + path.channel_pdfs[2]
            weight = path.channel_pdfs * (3.0 / total)
        return weight

    return channel_weight


def build_russian_roulette(features: RenderFeatures, record: PathRecord, channel_weight: Any) -> Any:
    """The function (path, limits) -> Path that ends some paths and turns the others to `wi`; branch-free."""
    Path = record.struct
    splits = bool(features.aovs & SPLIT_AOVS)

    @wp.func(inline=True)
    def russian_roulette(before: Path, limits: Limits) -> Path:
        path = before
        scattered = before.scatters != MISS
        if wp.static(splits):
            path.direct = choose(before.depth == 0, before.radiance, before.direct)
        path.depth = before.depth + wp.where(scattered, 1, 0)
        if wp.static(features.crossings):
            path.crossings = wp.where(scattered, 0, before.crossings)
        plays = scattered and path.depth > limits.roulette_depth
        best = max_component(wp.cw_mul(before.throughput, channel_weight(before)))
        survival = wp.where(plays, wp.min(best, 1.0), 1.0)
        path.alive = wp.where(plays and before.xi[1] >= survival, 0, before.alive)
        path.throughput = before.throughput / wp.max(survival, 1.0e-37)
        path.direction = before.wi
        return path

    return russian_roulette
