"""Next-event estimation for all lanes at once: where nothing between path and light needs a look-up; branch-free."""

from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.bvh import Bvh
from fgf_warp.device.geometry import MISS, Hit, Solid, chord, solid_span, surface_distance
from fgf_warp.device.lights import Light, chance, light_distance, sample_light
from fgf_warp.device.medium import Medium
from fgf_warp.device.numerics import choose
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.connection import Aim
from fgf_warp.integrator.laws import LineLaws
from fgf_warp.integrator.path import PathRecord


class LaneConnection(NamedTuple):
    """Functions of the device, in the order of a connection.

    Args:
        begin: (path, lone) -> Path, without a connection yet.
        aim_at_light: (path, lone, seed, light, kind) -> Path, connected to this light where it is the one.
        block_by_surface: (path, solid, kind) -> Path.
        block_by_light: (path, light, kind) -> Path.
        distance_of_mesh: (trees, path) -> float, of the mesh that is in the connection's way.
        block: (path, t) -> Path, whose connection is ended by what is at distance t.
        dim: (path, lone, solid, kind) -> Path, whose connection is dimmed by the only medium.
        end: (path) -> Path, with the light that the connection brings.
    """

    begin: Any
    aim_at_light: Any
    block_by_surface: Any
    block_by_light: Any
    distance_of_mesh: Any
    block: Any
    dim: Any
    end: Any


def build_lane_connection(
    features: RenderFeatures, record: PathRecord, laws: LineLaws, aim: Aim, intersect_meshes: Any
) -> LaneConnection:
    """The functions of a kernel of these features."""
    Path = record.struct
    scatter_pdf, light_numbers, aim_at = aim
    medium_at_depth, channel_transmittance = laws.medium_at_depth, laws.channel_transmittance
    rates_of, is_from_medium = laws.rates_of, laws.is_from_medium

    @wp.func(inline=True)
    def begin(before: Path, lone: Medium) -> Path:
        path = before
        scatters = before.scatters != MISS
        path.pdf_direction = wp.where(scatters, scatter_pdf(before, lone, before.wi), before.pdf_direction)
        path.light_share = wp.vec3(0.0, 0.0, 0.0)
        return path

    @wp.func(inline=True)
    def aim_at_light(before: Path, lone: Medium, seed: wp.uint64, light: Light, kind: int) -> Path:
        path = before
        xi = light_numbers(before, seed)
        aimed = aim_at(before, lone, sample_light(light, kind, before.origin, xi[1], xi[2]), chance(light))
        is_chosen = xi[0] >= light.first_chance and xi[0] < light.last_chance
        path.to_light = choose(is_chosen, aimed.to_light, before.to_light)
        path.light_distance = wp.where(is_chosen, aimed.light_distance, before.light_distance)
        path.light_share = choose(is_chosen, aimed.light_share, before.light_share)
        return path

    @wp.func(inline=True)
    def block(before: Path, t: float) -> Path:
        path = before
        path.light_share = before.light_share * wp.where(t < before.light_distance, 0.0, 1.0)
        return path

    @wp.func(inline=True)
    def block_by_surface(before: Path, solid: Solid, kind: int) -> Path:
        return block(before, surface_distance(solid_span(solid, kind, before.origin, before.to_light), 0.0))

    @wp.func(inline=True)
    def block_by_light(before: Path, light: Light, kind: int) -> Path:
        return block(before, light_distance(light, kind, before.origin, before.to_light))

    @wp.func
    def distance_of_mesh(trees: wp.array(dtype=Bvh), path: Path) -> float:
        nearest = Hit()
        nearest.t = path.light_distance
        return intersect_meshes(trees, path.origin, path.to_light, path.start, nearest).t

    @wp.func(inline=True)
    def dim(before: Path, lone: Medium, solid: Solid, kind: int) -> Path:
        path = before
        span = chord(solid_span(solid, kind, before.origin, before.to_light), before.start.inside != wp.uint32(0))
        length = wp.min(span[1], before.light_distance) - span[0]
        medium = medium_at_depth(lone, before.depth + 1)
        passed = channel_transmittance(medium, wp.max(length, 0.0), is_from_medium(before), rates_of(before)[0])
        path.light_share = before.light_share * wp.where(length > 0.0, passed, 1.0)
        return path

    @wp.func(inline=True)
    def end(before: Path) -> Path:
        path = before
        path.radiance = before.radiance + before.light_share
        return path

    return LaneConnection(begin, aim_at_light, block_by_surface, block_by_light, distance_of_mesh, block, dim, end)
