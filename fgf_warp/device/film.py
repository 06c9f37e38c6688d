"""Sums over the samples of each pixel, in float64 and in the order of the samples.

So an image does not depend on how its samples are cut into steps, nor on what else is rendered with it.
"""

import warp as wp

from fgf_warp.device.numerics import INFINITE, is_finite


@wp.struct
class Film:
    """One entry per pixel of each image, image after image; planes that the render does not need are empty."""

    radiance: wp.array(dtype=wp.vec3d)
    radiance_sq: wp.array(dtype=wp.vec3d)
    alpha: wp.array(dtype=wp.float64)
    depth: wp.array(dtype=wp.float32)
    """The nearest, not a sum."""
    transmittance: wp.array(dtype=wp.vec3d)
    albedo: wp.array(dtype=wp.vec3d)
    collisions: wp.array(dtype=wp.vec3d)
    path_length: wp.array(dtype=wp.vec3d)
    normal: wp.array(dtype=wp.vec3d)
    motion: wp.array(dtype=wp.vec3d)
    """The third number is 0."""
    optical_depth: wp.array(dtype=wp.vec3d)
    direct: wp.array(dtype=wp.vec3d)
    scatterings: wp.array(dtype=wp.float64)
    seen: wp.array(dtype=wp.float32)
    """Distance of the nearest thing that is seen, not a sum."""
    seen_item: wp.array(dtype=wp.int32)
    """Which it is, see `Path.seen_item`."""
    invalid: wp.array(dtype=wp.int32)
    """Samples that were not finite, and were left out."""
    truncated: wp.array(dtype=wp.int32)
    """Paths cut at the bound on their length."""


@wp.struct
class Tally:
    """The film's entry for one pixel, while its samples are added."""

    radiance: wp.vec3d
    radiance_sq: wp.vec3d
    alpha: wp.float64
    depth: float
    transmittance: wp.vec3d
    albedo: wp.vec3d
    collisions: wp.vec3d
    path_length: wp.vec3d
    normal: wp.vec3d
    motion: wp.vec3d
    optical_depth: wp.vec3d
    direct: wp.vec3d
    scatterings: wp.float64
    seen: float
    seen_item: int
    invalid: int
    truncated: int


@wp.struct
class Sample:
    """What one path brings."""

    radiance: wp.vec3
    alpha: float
    depth: float
    transmittance: wp.vec3
    albedo: wp.vec3
    collisions: wp.vec3
    path_length: wp.vec3
    normal: wp.vec3
    motion: wp.vec3
    optical_depth: wp.vec3
    direct: wp.vec3
    scatterings: float
    seen: float
    seen_item: int
    truncated: int


@wp.func(inline=True)
def add_where(condition: bool, total: wp.vec3d, value: wp.vec3) -> wp.vec3d:
    """total + value, or total."""
    return wp.vec3d(
        total[0] + wp.float64(wp.where(condition, value[0], 0.0)),
        total[1] + wp.float64(wp.where(condition, value[1], 0.0)),
        total[2] + wp.float64(wp.where(condition, value[2], 0.0)),
    )


@wp.func(inline=True)
def square(v: wp.vec3d) -> wp.vec3d:
    """Of each component."""
    return wp.vec3d(v[0] * v[0], v[1] * v[1], v[2] * v[2])


@wp.func(inline=True)
def add_sample(before: Tally, sample: Sample, is_complete: bool) -> Tally:
    """The tally with the sample in it, where it is complete; branch-free."""
    tally = before
    is_valid = is_complete and is_finite(sample.radiance)
    tally.invalid = before.invalid + wp.where(is_complete and not is_valid, 1, 0)
    tally.truncated = before.truncated + wp.where(is_complete, sample.truncated, 0)
    value = add_where(is_valid, wp.vec3d(), sample.radiance)
    tally.radiance = before.radiance + value
    tally.radiance_sq = before.radiance_sq + square(value)
    tally.alpha = before.alpha + wp.float64(wp.where(is_valid, sample.alpha, 0.0))
    tally.depth = wp.min(before.depth, wp.where(is_valid, sample.depth, INFINITE))
    tally.transmittance = add_where(is_valid, before.transmittance, sample.transmittance)
    tally.albedo = add_where(is_valid, before.albedo, sample.albedo)
    tally.collisions = add_where(is_valid, before.collisions, sample.collisions)
    tally.path_length = add_where(is_valid, before.path_length, sample.path_length)
    tally.normal = add_where(is_valid, before.normal, sample.normal)
    tally.motion = add_where(is_valid, before.motion, sample.motion)
    tally.optical_depth = add_where(is_valid, before.optical_depth, sample.optical_depth)
    tally.direct = add_where(is_valid, before.direct, sample.direct)
    tally.scatterings = before.scatterings + wp.float64(wp.where(is_valid, sample.scatterings, 0.0))
    is_nearer = is_valid and sample.seen < before.seen
    tally.seen = wp.where(is_nearer, sample.seen, before.seen)
    tally.seen_item = wp.where(is_nearer, sample.seen_item, before.seen_item)
    return tally
