"""Two-sided diffuse surfaces."""

import warp as wp

from fgf_warp.device.numerics import PI, rotate_from


@wp.struct
class Surface:
    """Reflectance, emitted radiance, and what shines on it."""

    diffuse: wp.vec3
    emission: wp.vec3
    light_links: wp.uint32
    """Bits of the linked lights that shine on it."""


@wp.func(inline=True)
def diffuse_pdf(normal: wp.vec3, wi: wp.vec3) -> float:
    """pdf_solid_angle of `sample_diffuse`, and the BSDF times the cosine over the reflectance."""
    return wp.max(wp.dot(normal, wi), 0.0) / PI


@wp.func(inline=True)
def sample_diffuse(normal: wp.vec3, xi1: float, xi2: float) -> wp.vec3:
    """A direction distributed as the cosine around the normal; its weight is the reflectance."""
    cosine = wp.sqrt(xi1)
    return rotate_from(normal, (1.0 - xi1) / (1.0 + cosine), xi2)
