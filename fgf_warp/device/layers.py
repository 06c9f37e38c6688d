"""The layers of a surface: what a coat, a specular layer and a matte one below them reflect of light from one side.

A matte layer gets what those above let through, over what of it they let out again, so no energy is lost (Kelemen and
Szirmay-Kalos 2001; for microfacets Kulla and Conty 2017). Twins of the methods of `theory.bsdf.Bsdf`, from tables.
"""

import warp as wp

from fgf_warp.device.albedos import (
    DIELECTRIC_PRODUCTS,
    GGX_AVERAGES,
    ROWS,
    SQUARE,
    TABLE,
    albedo_at,
    average_at,
    product_at,
)
from fgf_warp.device.microfacet import fresnel_dielectric, grazing_share, is_smooth


@wp.struct
class Bsdf:
    """A surface at one point, seen from one side: `theory.bsdf.Bsdf`, and what follows from it.

    First what is set from outside, then what `prepare_bsdf` adds. Roughnesses, weights and colours are in [0, 1].
    """

    normal: wp.vec3
    """Shading normal, on the side that it is seen from."""
    facet: wp.vec3
    """Geometric normal, on the same side."""
    wo: wp.vec3
    """Unit vector to where it is seen from, in the frame of `normal`."""
    diffuse: wp.vec3
    """Reflectance of the matte layer, and of the metal."""
    metallic: float
    """Share of the metal beside the specular layer's dielectric."""
    specular: wp.vec3
    """Reflectance at normal incidence, in the specular workflow."""
    is_specular: int
    """1: the specular workflow."""
    roughness: float
    """Square root of the alpha of the specular layer, and of glass."""
    clearcoat: float
    """Weight of the coat."""
    clearcoat_roughness: float
    ior: float
    """Index of refraction of the specular layer and of the coat, > 0."""
    dielectric: int
    """Block of `ior`."""
    fade: float
    """Share of the matte layer that is there; the light that the rest would have got passes straight."""
    cover: float
    """Share of all layers that is there; the rest is glass, or light passes straight through it."""
    eta: float
    """Of glass: index of refraction beyond the surface over that before it; 0 where there is no glass."""
    front: int
    back: int
    """Blocks of `eta` and of its inverse."""

    passes: wp.vec3
    """Share that passes straight."""
    multiple: wp.vec3
    """`shares` of all facets, metal's included, over pi times the share of light that they scatter more than once."""
    shares: wp.vec3
    """Of what the facets of the specular layer's dielectric scatter more than once, the share that is not absorbed."""
    matte: wp.vec3
    """Reflectance of the matte layer, over pi times what reaches it."""
    coat_o: float
    ggx_o: float
    top_o: wp.vec3
    """Albedos at `wo`: of the coat, of white facets, of all above the matte layer."""
    reflects: float
    """Of what rough glass scatters more than once, the share that comes back."""
    p_pass: float
    p_coat: float
    p_specular: float
    p_matte: float
    p_glass: float
    """Probabilities: of passing straight, and of each lobe where it does not."""


@wp.func
def dielectric_albedo(tables: wp.array(dtype=float), ior: float, block: int, roughness: float, cosine: float) -> float:
    """Of one reflection by a dielectric's facets; of a mirror exactly.

    block: of the tables of `ior`.
    """
    if is_smooth(roughness):
        return fresnel_dielectric(cosine, ior)
    return albedo_at(tables, block, roughness, cosine)


@wp.func
def coat_albedo(tables: wp.array(dtype=float), bsdf: Bsdf, cosine: float) -> float:
    """Of the coat, in [0, 1]."""
    if bsdf.clearcoat == 0.0:
        return 0.0
    return bsdf.clearcoat * dielectric_albedo(tables, bsdf.ior, bsdf.dielectric, bsdf.clearcoat_roughness, cosine)


@wp.func
def ggx_albedo(tables: wp.array(dtype=float), bsdf: Bsdf, cosine: float) -> float:
    """Of one reflection by the specular layer's facets, if they reflected everything."""
    if is_smooth(bsdf.roughness):
        return 1.0
    return albedo_at(tables, 0, bsdf.roughness, cosine)


@wp.func
def single_albedo(tables: wp.array(dtype=float), bsdf: Bsdf, cosine: float, whole: float) -> wp.vec3:
    """Of one reflection by the specular layer's dielectric, per channel; `whole` is `ggx_albedo` at this cosine."""
    if bsdf.is_specular == 0:
        return wp.vec3(dielectric_albedo(tables, bsdf.ior, bsdf.dielectric, bsdf.roughness, cosine))
    tip = float(0.0)
    if is_smooth(bsdf.roughness):
        tip = grazing_share(cosine)
    else:
        tip = albedo_at(tables, TABLE, bsdf.roughness, cosine)
    return bsdf.specular * (whole - tip) + wp.vec3(tip)


@wp.func
def top_albedo(tables: wp.array(dtype=float), bsdf: Bsdf, cosine: float, coat: float, whole: float) -> wp.vec3:
    """Of what lies above the matte layer, per channel; `coat` and `whole` are `coat_albedo` and `ggx_albedo` there."""
    below = single_albedo(tables, bsdf, cosine, whole) + bsdf.shares * (1.0 - whole)
    return wp.vec3(coat) + below * (1.0 - coat)


@wp.func
def multiple_share(fresnel: wp.vec3, average: float) -> wp.vec3:
    """Of what facets scatter more than once, the share that they do not absorb (Kulla and Conty 2017).

    fresnel: average reflectance of the facets per channel.
    average: of their albedo over light from everywhere, if they reflected everything.
    """
    result = wp.vec3()
    for k in range(3):
        result[k] = fresnel[k] * fresnel[k] * average / (1.0 - fresnel[k] * (1.0 - average))
    return result


@wp.func
def top_average(tables: wp.array(dtype=float), bsdf: Bsdf, average: float) -> wp.vec3:
    """`top_albedo` over light from everywhere; `average` is that of `ggx_albedo`."""
    block = bsdf.dielectric
    products = block + DIELECTRIC_PRODUCTS
    coat = float(0.0)
    with_own = float(0.0)
    with_whole = float(0.0)
    with_tip = float(0.0)
    if bsdf.clearcoat > 0.0:
        coat = average_at(tables, block + TABLE, bsdf.clearcoat_roughness)
        with_whole = product_at(tables, products + SQUARE, bsdf.clearcoat_roughness, bsdf.roughness)
        if bsdf.is_specular == 0:
            with_own = product_at(tables, products, bsdf.clearcoat_roughness, bsdf.roughness)
        else:
            with_tip = product_at(tables, products + 2 * SQUARE, bsdf.clearcoat_roughness, bsdf.roughness)
    single = wp.vec3()
    shared = wp.vec3()
    if bsdf.is_specular == 0:
        single = wp.vec3(average_at(tables, block + TABLE, bsdf.roughness))
        shared = wp.vec3(with_own)
    else:
        tip = average_at(tables, GGX_AVERAGES + ROWS, bsdf.roughness)
        single = bsdf.specular * (average - tip) + wp.vec3(tip)
        shared = bsdf.specular * (with_whole - with_tip) + wp.vec3(with_tip)
    shared += bsdf.shares * (coat - with_whole)
    return wp.vec3(bsdf.clearcoat * coat) + single + bsdf.shares * (1.0 - average) - shared * bsdf.clearcoat
