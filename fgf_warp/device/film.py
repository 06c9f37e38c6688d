"""Sums over the samples of each pixel, in float64 and in the order of the samples.

So an image does not depend on how its samples are cut into steps.
"""

import warp as wp


@wp.struct
class Film:
    """One entry per pixel; planes that the render does not need are empty."""

    radiance: wp.array(dtype=wp.vec3d)
    radiance_sq: wp.array(dtype=wp.vec3d)
    alpha: wp.array(dtype=wp.float64)
    depth: wp.array(dtype=wp.float32)
    """The nearest, not a sum."""
    transmittance: wp.array(dtype=wp.vec3d)
    albedo: wp.array(dtype=wp.vec3d)
    invalid: wp.array(dtype=wp.int32)
    """Samples that were not finite, and were left out."""
    truncated: wp.array(dtype=wp.int32)
    """Paths cut at the bound on their length."""
