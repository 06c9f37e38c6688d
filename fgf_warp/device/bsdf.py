"""What surfaces do to light: layers and glass, evaluated and sampled; twin of `theory/bsdf.py`.

Values are of basic radiance, L / n^2. `prepare_bsdf`, `eval_bsdf` and `sample_bsdf` take directions in world space, the
functions of single lobes take them in the frame of the shading normal, which is z.
"""

import warp as wp

from fgf_warp.device.albedos import DIELECTRIC_FRESNEL, GGX_AVERAGES, TABLE, albedo_at, average_at
from fgf_warp.device.layers import (
    Bsdf,
    coat_albedo,
    ggx_albedo,
    multiple_share,
    single_albedo,
    top_albedo,
    top_average,
)
from fgf_warp.device.microfacet import (
    eval_ggx,
    eval_ggx_refraction,
    fresnel_dielectric,
    grazing_share,
    is_smooth,
    reflect,
    refract,
    sample_visible_normal,
)
from fgf_warp.device.numerics import PI, max_component, orthonormal_tangent, sincos_turns

LEAST_LOSS = wp.constant(1.0e-6)
"""Share of light below which nothing is left to couple to."""
LEAST_COSINE = wp.constant(1.0e-4)
"""Of the angle under which a surface is seen."""


@wp.struct
class BsdfSample:
    """A direction in which a path goes on, in world space."""

    wi: wp.vec3
    weight: wp.vec3
    """f times the cosine over the pdf; 0 where there is no direction."""
    pdf: float
    """pdf_solid_angle of all lobes that are no mirrors [1/sr]."""
    is_delta: int
    """1: a mirror's direction, which `eval_bsdf` does not find."""
    transmits: int
    """1: to the other side of the surface."""


@wp.func
def to_local(normal: wp.vec3, w: wp.vec3) -> wp.vec3:
    """A vector of world space in the frame of a unit normal."""
    tangent = orthonormal_tangent(normal)
    return wp.vec3(wp.dot(tangent, w), wp.dot(wp.cross(normal, tangent), w), wp.dot(normal, w))


@wp.func
def to_world(normal: wp.vec3, w: wp.vec3) -> wp.vec3:
    """A unit vector of the frame of a unit normal in world space."""
    tangent = orthonormal_tangent(normal)
    return wp.normalize(tangent * w[0] + wp.cross(normal, tangent) * w[1] + normal * w[2])


@wp.func
def valid_normal(normal: wp.vec3, facet: wp.vec3, wo: wp.vec3) -> wp.vec3:
    """The shading normal, turned as little as makes it visible and its mirror direction leave the surface.

    The mirror direction is raised to the surface, and the normal put between it and `wo` (Keller et al. 2017, "The
    Iray light transport simulation and rendering system", section on shading normals).
    """
    n = normal
    seen = wp.dot(n, wo)
    least = 0.01
    if seen < least:
        n = wp.normalize(n + wo * (least - seen))
    mirrored = n * (2.0 * wp.dot(n, wo)) - wo
    above = wp.dot(mirrored, facet)
    enough = wp.min(0.9 * wp.dot(wo, facet), least)
    if above < enough:
        n = wp.normalize(wo + wp.normalize(mirrored + facet * (enough - above)))
    return n


@wp.func
def is_on_side(bsdf: Bsdf, wi: wp.vec3, cosine: float) -> bool:
    """True where a direction is on one side of the surface and of the shading normal's plane: no light leaks."""
    return wp.dot(bsdf.facet, wi) * cosine > 0.0


@wp.func
def mean(v: wp.vec3) -> float:
    """Mean of the channels."""
    return (v[0] + v[1] + v[2]) / 3.0


@wp.func
def prepare_bsdf(tables: wp.array(dtype=float), before: Bsdf, wo: wp.vec3) -> Bsdf:
    """Adds all that evaluation and sampling share to what is known of a surface at a point.

    tables: of `device.albedos`.
    before: with what is set from outside.
    wo: unit vector to where it is seen from, in world space.
    """
    bsdf = before
    bsdf.wo = to_local(bsdf.normal, wo)
    bsdf.wo[2] = wp.max(bsdf.wo[2], LEAST_COSINE)
    cosine = wp.min(bsdf.wo[2], 1.0)
    dielectric = 1.0 - bsdf.metallic
    average = average_at(tables, GGX_AVERAGES, bsdf.roughness)
    fresnel = wp.vec3(tables[bsdf.dielectric + DIELECTRIC_FRESNEL])
    if bsdf.is_specular == 1:
        fresnel = bsdf.specular + (wp.vec3(1.0) - bsdf.specular) / 21.0
    bsdf.shares = multiple_share(fresnel, average)
    lost = wp.max(1.0 - average, LEAST_LOSS)
    tinted = bsdf.shares * dielectric + multiple_share(bsdf.diffuse, average) * bsdf.metallic
    bsdf.multiple = tinted / (PI * lost)

    bsdf.coat_o = coat_albedo(tables, bsdf, cosine)
    bsdf.ggx_o = ggx_albedo(tables, bsdf, cosine)
    bsdf.top_o = top_albedo(tables, bsdf, cosine, bsdf.coat_o, bsdf.ggx_o)
    reached = wp.vec3(1.0) - top_average(tables, bsdf, average)
    for k in range(3):
        bsdf.matte[k] = dielectric * bsdf.fade * bsdf.diffuse[k] / (PI * wp.max(reached[k], LEAST_LOSS))
    through = wp.vec3(1.0) - bsdf.top_o
    bsdf.passes = through * (bsdf.cover * (1.0 - bsdf.fade) * dielectric)
    glass = float(0.0)
    if bsdf.eta > 0.0:
        glass = 1.0 - bsdf.cover
        if not is_smooth(bsdf.roughness):
            lost_front = 1.0 - average_at(tables, bsdf.front + TABLE, bsdf.roughness)
            lost_back = 1.0 - average_at(tables, bsdf.back + TABLE, bsdf.roughness)
            bsdf.reflects = lost_front / wp.max(lost_front + bsdf.eta * bsdf.eta * lost_back, LEAST_LOSS)
    else:
        bsdf.passes += wp.vec3(1.0 - bsdf.cover)

    # Lobes are chosen by what they reflect.
    under_coat = bsdf.cover * (1.0 - bsdf.coat_o)
    single = single_albedo(tables, bsdf, cosine, bsdf.ggx_o) * dielectric + bsdf.diffuse * (bsdf.metallic * bsdf.ggx_o)
    coat = bsdf.cover * bsdf.coat_o
    specular = under_coat * mean(single)
    matte = under_coat * mean(tinted) * (1.0 - bsdf.ggx_o)
    matte += bsdf.cover * dielectric * bsdf.fade * mean(wp.cw_mul(bsdf.diffuse, through))
    scattered = coat + specular + matte + glass
    bsdf.p_pass = wp.clamp(mean(bsdf.passes), 0.0, 1.0)
    whole = wp.max(scattered, 1.0e-20)
    bsdf.p_coat = coat / whole
    bsdf.p_specular = specular / whole
    bsdf.p_matte = matte / whole
    bsdf.p_glass = glass / whole
    return bsdf


@wp.func
def facet_fresnel(bsdf: Bsdf, cosine: float) -> wp.vec3:
    """Reflectance of the specular layer's facets, metal and dielectric, per channel."""
    dielectric = 1.0 - bsdf.metallic
    if bsdf.is_specular == 1:
        return bsdf.specular + (wp.vec3(1.0) - bsdf.specular) * grazing_share(cosine)
    return bsdf.diffuse * bsdf.metallic + wp.vec3(dielectric * fresnel_dielectric(cosine, bsdf.ior))


@wp.func
def eval_layers(tables: wp.array(dtype=float), bsdf: Bsdf, wi: wp.vec3) -> wp.vec3:
    """f times the cosine of all layers but mirrors [1/sr]; `wi` above the surface, in the normal's frame."""
    cosine = wp.min(wi[2], 1.0)
    coat = coat_albedo(tables, bsdf, cosine)
    whole = ggx_albedo(tables, bsdf, cosine)
    value = wp.vec3(0.0)
    if not is_smooth(bsdf.roughness):
        single = eval_ggx(bsdf.roughness * bsdf.roughness, bsdf.wo, wi)
        value = facet_fresnel(bsdf, single[2]) * single[0]
        value += bsdf.multiple * ((1.0 - bsdf.ggx_o) * (1.0 - whole) * cosine)
        value *= 1.0 - wp.max(bsdf.coat_o, coat)
    if bsdf.clearcoat > 0.0 and not is_smooth(bsdf.clearcoat_roughness):
        single = eval_ggx(bsdf.clearcoat_roughness * bsdf.clearcoat_roughness, bsdf.wo, wi)
        value += wp.vec3(bsdf.clearcoat * fresnel_dielectric(single[2], bsdf.ior) * single[0])
    if max_component(bsdf.matte) > 0.0:
        through = wp.cw_mul(wp.vec3(1.0) - bsdf.top_o, wp.vec3(1.0) - top_albedo(tables, bsdf, cosine, coat, whole))
        value += wp.cw_mul(bsdf.matte, through) * cosine
    return value * bsdf.cover


@wp.func
def pdf_layers(bsdf: Bsdf, wi: wp.vec3) -> float:
    """pdf_solid_angle of the layers' lobes [1/sr]; `wi` as in `eval_layers`."""
    pdf = bsdf.p_matte * wi[2] / PI
    if not is_smooth(bsdf.roughness):
        pdf += bsdf.p_specular * eval_ggx(bsdf.roughness * bsdf.roughness, bsdf.wo, wi)[1]
    if bsdf.clearcoat > 0.0 and not is_smooth(bsdf.clearcoat_roughness):
        alpha = bsdf.clearcoat_roughness * bsdf.clearcoat_roughness
        pdf += bsdf.p_coat * eval_ggx(alpha, bsdf.wo, wi)[1]
    return pdf


@wp.func
def eval_glass(tables: wp.array(dtype=float), bsdf: Bsdf, wi: wp.vec3) -> wp.vec2:
    """f times the cosine of rough glass, and pdf_solid_angle [1/sr]; `wi` on either side, in the normal's frame."""
    alpha = bsdf.roughness * bsdf.roughness
    once = albedo_at(tables, bsdf.front, bsdf.roughness, bsdf.wo[2])
    cosine = wp.abs(wi[2])
    block = wp.where(wi[2] > 0.0, bsdf.front, bsdf.back)
    again = wp.where(wi[2] > 0.0, bsdf.reflects, 1.0 - bsdf.reflects)
    lost = wp.max(1.0 - average_at(tables, block + TABLE, bsdf.roughness), LEAST_LOSS)
    lost_i = 1.0 - albedo_at(tables, block, bsdf.roughness, cosine)
    value = (1.0 - once) * again * lost_i / lost * cosine / PI
    pdf = (1.0 - once) * again * cosine / PI
    single = wp.vec3()
    share = float(0.0)
    if wi[2] > 0.0:
        single = eval_ggx(alpha, bsdf.wo, wi)
        share = fresnel_dielectric(single[2], bsdf.eta)
    else:
        single = eval_ggx_refraction(alpha, bsdf.eta, bsdf.wo, wi)
        share = 1.0 - fresnel_dielectric(single[2], bsdf.eta)
    return wp.vec2(value + share * single[0], pdf + once * share * single[1])


@wp.func
def eval_bsdf(tables: wp.array(dtype=float), bsdf: Bsdf, wi: wp.vec3) -> wp.vec4:
    """f times the cosine per channel, and pdf_solid_angle [1/sr], without mirrors and what passes straight.

    Both are those of light that does not pass straight, so they are that of `theory.bsdf` over 1 - `p_pass`. Error of f
    times the cosine below 2e-3 relative plus 2e-5.

    tables: of `device.albedos`.
    bsdf: of `prepare_bsdf`.
    wi: unit vector to where light comes from, in world space.
    """
    w = to_local(bsdf.normal, wi)
    if not is_on_side(bsdf, wi, w[2]):
        return wp.vec4(0.0)
    value = wp.vec3(0.0)
    pdf = float(0.0)
    if w[2] > 0.0 and bsdf.cover > 0.0:
        value = eval_layers(tables, bsdf, w)
        pdf = pdf_layers(bsdf, w)
    if bsdf.p_glass > 0.0 and not is_smooth(bsdf.roughness):
        glass = eval_glass(tables, bsdf, w)
        value += wp.vec3((1.0 - bsdf.cover) * glass[0])
        pdf += bsdf.p_glass * glass[1]
    value /= wp.max(1.0 - bsdf.p_pass, 1.0e-20)
    return wp.vec4(value[0], value[1], value[2], pdf)


@wp.func
def sample_delta(bsdf: Bsdf, w: wp.vec3, weight: wp.vec3) -> BsdfSample:
    """The sample of a lobe that has only one direction, `w` in the frame of the normal."""
    s = BsdfSample()
    s.wi = to_world(bsdf.normal, w)
    s.weight = wp.where(is_on_side(bsdf, s.wi, w[2]), weight, wp.vec3(0.0))
    s.is_delta = 1
    s.transmits = wp.where(w[2] < 0.0, 1, 0)
    return s


@wp.func
def sample_mirror(bsdf: Bsdf, weight: wp.vec3) -> BsdfSample:
    """The sample of a mirror."""
    return sample_delta(bsdf, wp.vec3(-bsdf.wo[0], -bsdf.wo[1], bsdf.wo[2]), weight)


@wp.func
def sample_smooth_glass(bsdf: Bsdf, weight: wp.vec3, xi: float) -> BsdfSample:
    """Reflection by smooth glass or refraction through it, chosen by a uniform."""
    if xi < fresnel_dielectric(wp.min(bsdf.wo[2], 1.0), bsdf.eta):
        return sample_mirror(bsdf, weight)
    return sample_delta(bsdf, refract(bsdf.wo, wp.vec3(0.0, 0.0, 1.0), bsdf.eta), weight)


@wp.func
def sample_cosine(xi1: float, xi2: float) -> wp.vec3:
    """A unit vector distributed as its z, from two uniforms."""
    s, c = sincos_turns(xi2)
    radius = wp.sqrt(1.0 - xi1)
    return wp.vec3(radius * c, radius * s, wp.sqrt(xi1))


@wp.func
def sample_rough_glass(tables: wp.array(dtype=float), bsdf: Bsdf, xi: wp.vec4) -> wp.vec3:
    """A direction, in the frame of the normal, of one scattering or of several; 0 where there is none."""
    once = albedo_at(tables, bsdf.front, bsdf.roughness, bsdf.wo[2])
    if xi[2] < once:
        h = sample_visible_normal(bsdf.roughness * bsdf.roughness, bsdf.wo, xi[0], xi[1])
        cosine = wp.clamp(wp.dot(bsdf.wo, h), 0.0, 1.0)
        if xi[3] < fresnel_dielectric(cosine, bsdf.eta):
            w = reflect(bsdf.wo, h)
            return wp.where(w[2] > 0.0, w, wp.vec3(0.0))
        w = refract(bsdf.wo, h, bsdf.eta)
        return wp.where(w[2] < 0.0, w, wp.vec3(0.0))
    w = sample_cosine(xi[0], xi[1])
    return wp.where(xi[3] < bsdf.reflects, w, -w)


@wp.func
def rescale(xi: float, low: float, width: float) -> float:
    """The place of xi in [low, low + width], in [0, 1)."""
    return wp.clamp((xi - low) / wp.max(width, 1.0e-20), 0.0, 0.9999999)


@wp.func
def sample_bsdf(tables: wp.array(dtype=float), bsdf: Bsdf, xi: wp.vec4) -> BsdfSample:
    """A direction of what does not pass straight.

    tables: of `device.albedos`.
    bsdf: of `prepare_bsdf`.
    xi: uniforms in [0, 1): the first two place the direction in a lobe, the others choose the lobe.
    """
    stays = wp.max(1.0 - bsdf.p_pass, 1.0e-20)
    w = wp.vec3(0.0)
    glass_end = bsdf.p_glass
    coat_end = glass_end + bsdf.p_coat
    specular_end = coat_end + bsdf.p_specular
    if xi[2] < glass_end:
        place = wp.vec4(xi[0], xi[1], rescale(xi[2], 0.0, bsdf.p_glass), xi[3])
        if is_smooth(bsdf.roughness):
            return sample_smooth_glass(bsdf, wp.vec3((1.0 - bsdf.cover) / (bsdf.p_glass * stays)), xi[3])
        w = sample_rough_glass(tables, bsdf, place)
    elif xi[2] < coat_end:
        if is_smooth(bsdf.clearcoat_roughness):
            return sample_mirror(bsdf, wp.vec3(bsdf.cover * bsdf.coat_o / (bsdf.p_coat * stays)))
        alpha = bsdf.clearcoat_roughness * bsdf.clearcoat_roughness
        w = reflect(bsdf.wo, sample_visible_normal(alpha, bsdf.wo, xi[0], xi[1]))
        w = wp.where(w[2] > 0.0, w, wp.vec3(0.0))
    elif xi[2] < specular_end:
        if is_smooth(bsdf.roughness):
            share = bsdf.cover * (1.0 - bsdf.coat_o) / (bsdf.p_specular * stays)
            return sample_mirror(bsdf, facet_fresnel(bsdf, wp.min(bsdf.wo[2], 1.0)) * share)
        w = reflect(bsdf.wo, sample_visible_normal(bsdf.roughness * bsdf.roughness, bsdf.wo, xi[0], xi[1]))
        w = wp.where(w[2] > 0.0, w, wp.vec3(0.0))
    elif bsdf.p_matte > 0.0:
        w = sample_cosine(xi[0], xi[1])
    s = BsdfSample()
    s.wi = bsdf.normal
    if wp.length_sq(w) > 0.0:
        s.wi = to_world(bsdf.normal, w)
        s.transmits = wp.where(w[2] < 0.0, 1, 0)
        scattered = eval_bsdf(tables, bsdf, s.wi)
        s.pdf = scattered[3]
        if s.pdf > 0.0:
            s.weight = wp.vec3(scattered[0], scattered[1], scattered[2]) / s.pdf
    return s
