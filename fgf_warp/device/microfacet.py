"""Interfaces, and microfacets distributed as GGX, in the frame of the surface's normal, which is z.

Twins of the functions of the same names in `theory/bsdf.py`, where their sources are.
"""

import warp as wp

from fgf_warp.device.numerics import PI, sincos_turns

SMOOTH_ALPHA = wp.constant(1.0e-3)
"""Twin of `theory.bsdf.SMOOTH_ALPHA`: below it a lobe is taken as a mirror."""


@wp.func
def is_smooth(roughness: float) -> bool:
    """True where a lobe is taken as a mirror."""
    return roughness * roughness < SMOOTH_ALPHA


@wp.func
def fresnel_dielectric(cosine: float, eta: float) -> float:
    """Share of unpolarised light that an interface reflects, in [0, 1]; error below 1e-6.

    cosine: of the angle of incidence, in [0, 1].
    eta: index of refraction beyond the interface over that before it, > 0.
    """
    if eta == 1.0:
        return 0.0
    beyond_sq = 1.0 - (1.0 - cosine) * (1.0 + cosine) / (eta * eta)
    if beyond_sq <= 0.0:
        return 1.0
    beyond = wp.sqrt(beyond_sq)
    s = (cosine - eta * beyond) / (cosine + eta * beyond)
    p = (eta * cosine - beyond) / (eta * cosine + beyond)
    return 0.5 * (s * s + p * p)


@wp.func
def grazing_share(cosine: float) -> float:
    """(1 - cos)^5 of Schlick's reflectance, for a cosine in [0, 1]."""
    x = 1.0 - cosine
    return x * x * x * x * x


@wp.func
def reflect(w: wp.vec3, h: wp.vec3) -> wp.vec3:
    """The mirror direction of w about the unit vector h."""
    return h * (2.0 * wp.dot(w, h)) - w


@wp.func
def refract(wo: wp.vec3, h: wp.vec3, eta: float) -> wp.vec3:
    """The unit direction beyond an interface of normal h, on the side of wo; 0 where all is reflected."""
    cosine = wp.dot(wo, h)
    beyond_sq = 1.0 - (1.0 - cosine) * (1.0 + cosine) / (eta * eta)
    if beyond_sq <= 0.0:
        return wp.vec3(0.0)
    return wp.normalize(h * (cosine / eta - wp.sqrt(beyond_sq)) - wo / eta)


@wp.func
def ggx_density(alpha: float, h: wp.vec3) -> float:
    """D of a microfacet normal [1/sr]."""
    spread = h[0] * h[0] + h[1] * h[1] + alpha * alpha * h[2] * h[2]
    return alpha * alpha / (PI * spread * spread)


@wp.func
def smith_lambda(alpha: float, w: wp.vec3) -> float:
    """Smith's Lambda, in a form that keeps its digits where it is small."""
    x = alpha * alpha * (w[0] * w[0] + w[1] * w[1]) / wp.max(w[2] * w[2], 1.0e-30)
    return 0.5 * x / (1.0 + wp.sqrt(1.0 + x))


@wp.func
def sample_visible_normal(alpha: float, wo: wp.vec3, xi1: float, xi2: float) -> wp.vec3:
    """A microfacet normal, drawn from those that `wo` sees, from two uniforms."""
    w = wp.normalize(wp.vec3(alpha * wo[0], alpha * wo[1], wo[2]))
    z = (1.0 - xi2) * (1.0 + w[2]) - w[2]
    sine = wp.sqrt(wp.clamp((1.0 - z) * (1.0 + z), 0.0, 1.0))
    s, c = sincos_turns(xi1)
    h = wp.vec3(sine * c + w[0], sine * s + w[1], z + w[2])
    return wp.normalize(wp.vec3(alpha * h[0], alpha * h[1], wp.max(h[2], 1.0e-7)))


@wp.func
def eval_ggx(alpha: float, wo: wp.vec3, wi: wp.vec3) -> wp.vec3:
    """Single reflection by facets that reflect everything.

    wo, wi: unit vectors above the surface.

    Returns f times the cosine at wi [1/sr]; pdf_solid_angle of reflection by a normal of `sample_visible_normal`
    [1/sr]; and the cosine of the angle of incidence on the facets.
    """
    h = wp.normalize(wo + wi)
    lambda_o = smith_lambda(alpha, wo)
    common = ggx_density(alpha, h) / (4.0 * wo[2])
    return wp.vec3(
        common / (1.0 + lambda_o + smith_lambda(alpha, wi)),
        common / (1.0 + lambda_o),
        wp.clamp(wp.dot(wo, h), 0.0, 1.0),
    )


@wp.func
def eval_ggx_refraction(alpha: float, eta: float, wo: wp.vec3, wi: wp.vec3) -> wp.vec3:
    """Single refraction by facets that transmit everything: the same as `eval_ggx` for wi below the surface.

    eta: index of refraction below the surface over that above it.
    """
    h = wp.normalize(wo + wi * eta)
    h = wp.where(h[2] < 0.0, -h, h)
    cosine_o = wp.dot(wo, h)
    cosine_i = wp.dot(wi, h)
    if cosine_o <= 0.0 or cosine_i >= 0.0:
        return wp.vec3(0.0)
    lambda_o = smith_lambda(alpha, wo)
    focus = cosine_o + eta * cosine_i
    jacobian = -eta * eta * cosine_i / wp.max(focus * focus, 1.0e-20)
    common = ggx_density(alpha, h) * cosine_o * jacobian / wo[2]
    return wp.vec3(
        common / (1.0 + lambda_o + smith_lambda(alpha, wi)), common / (1.0 + lambda_o), wp.min(cosine_o, 1.0)
    )
