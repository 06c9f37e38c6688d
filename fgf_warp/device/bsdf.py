"""What surfaces do to light: microfacets, Fresnel, and layers of them that lose no energy; twin of `theory/bsdf.py`.

Values are of basic radiance, L / n^2. Functions on `Bsdf` take directions in world space, those on lobes take them in
the frame of the shading normal, which is z. What is looked up comes from one array of tables, `theory.bsdf.Albedo` and
its averages; a block of it is addressed by where it begins:

* the first, of GGX: albedo, albedo of (1 - cos)^5, and the averages of each;
* of a dielectric: albedo, averages, averages of the products with its own albedo and those of GGX, average reflectance;
* of glass: albedo and averages.
"""

import warp as wp

from fgf_warp.device.numerics import PI, max_component, orthonormal_tangent, sincos_turns

SMOOTH_ALPHA = wp.constant(1.0e-3)
SMOOTH_ROUGHNESS = wp.constant(0.0316227766)
ROWS = wp.constant(32)
COLUMNS = wp.constant(65)
TABLE = wp.constant(32 * 65)
SQUARE = wp.constant(32 * 32)
"""Sizes of the tables of `theory.bsdf`."""
GGX_AVERAGES = wp.constant(2 * 32 * 65)
DIELECTRIC_PRODUCTS = wp.constant(32 * 65 + 32)
DIELECTRIC_FRESNEL = wp.constant(32 * 65 + 32 + 3 * 32 * 32)
"""Where in their blocks they begin."""
LEAST_LOSS = wp.constant(1.0e-6)
"""Share of light below which nothing is left to couple to."""
LEAST_COSINE = wp.constant(1.0e-4)
"""Of the angle under which a surface is seen."""


@wp.struct
class Bsdf:
    """A surface at one point, seen from one side: `theory.bsdf.Bsdf`, and what follows from it.

    First what is set from outside, then what `prepare_bsdf` adds.
    """

    normal: wp.vec3
    """Shading normal, on the side that it is seen from."""
    facet: wp.vec3
    """Geometric normal, on the same side."""
    wo: wp.vec3
    """Where it is seen from, in the frame of `normal`."""
    diffuse: wp.vec3
    metallic: float
    specular: wp.vec3
    is_specular: int
    """1: the specular workflow."""
    roughness: float
    clearcoat: float
    clearcoat_roughness: float
    ior: float
    dielectric: int
    """Block of `ior`."""
    fade: float
    cover: float
    eta: float
    """Of glass; 0 where there is none."""
    front: int
    back: int
    """Blocks of `eta` and of its inverse."""

    passes: wp.vec3
    """Share that passes straight."""
    multiple: wp.vec3
    """The same of all facets, metal's included, over pi times what is scattered more than once."""
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


@wp.struct
class BsdfSample:
    """A direction to go on in."""

    wi: wp.vec3
    weight: wp.vec3
    """f times the cosine over the pdf."""
    pdf: float
    """pdf_solid_angle of all lobes that are no mirrors."""
    is_delta: int
    transmits: int


# ---- tables.


@wp.func
def row_of(roughness: float) -> float:
    """Place among the rows of a table."""
    return wp.clamp((roughness - SMOOTH_ROUGHNESS) / (1.0 - SMOOTH_ROUGHNESS), 0.0, 1.0) * float(ROWS - 1)


@wp.func
def blend(tables: wp.array(dtype=float), first: int, width: int, row: float, column: float, columns: int) -> float:
    """Bilinear in a table of rows of `width`."""
    r = wp.min(int(row), ROWS - 2)
    c = wp.min(int(column), columns - 2)
    along = row - float(r)
    across = column - float(c)
    at = first + r * width + c
    upper = tables[at] * (1.0 - across) + tables[at + 1] * across
    lower = tables[at + width] * (1.0 - across) + tables[at + width + 1] * across
    return upper * (1.0 - along) + lower * along


@wp.func
def albedo_at(tables: wp.array(dtype=float), first: int, roughness: float, cosine: float) -> float:
    """A directional albedo."""
    column = wp.sqrt(wp.clamp(cosine, 0.0, 1.0)) * float(COLUMNS - 1)
    return blend(tables, first, COLUMNS, row_of(roughness), column, COLUMNS)


@wp.func
def product_at(tables: wp.array(dtype=float), first: int, roughness: float, other: float) -> float:
    """An average of a product of albedos of two roughnesses."""
    return blend(tables, first, ROWS, row_of(roughness), row_of(other), ROWS)


@wp.func
def average_at(tables: wp.array(dtype=float), first: int, roughness: float) -> float:
    """An average over light from everywhere."""
    row = row_of(roughness)
    r = wp.min(int(row), ROWS - 2)
    return tables[first + r] * (1.0 - (row - float(r))) + tables[first + r + 1] * (row - float(r))


# ---- one interface.


@wp.func
def fresnel_dielectric(cosine: float, eta: float) -> float:
    """Share of unpolarised light that is reflected; `cosine` in [0, 1], error below 1e-6."""
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
    """(1 - cos)^5 of Schlick's reflectance."""
    x = 1.0 - cosine
    return x * x * x * x * x


@wp.func
def refract(wo: wp.vec3, h: wp.vec3, eta: float) -> wp.vec3:
    """The direction beyond an interface of normal h; 0 where all is reflected."""
    cosine = wp.dot(wo, h)
    beyond_sq = 1.0 - (1.0 - cosine) * (1.0 + cosine) / (eta * eta)
    if beyond_sq <= 0.0:
        return wp.vec3(0.0)
    return wp.normalize(h * (cosine / eta - wp.sqrt(beyond_sq)) - wo / eta)


# ---- GGX.


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
    """A microfacet normal as `wo` sees them."""
    w = wp.normalize(wp.vec3(alpha * wo[0], alpha * wo[1], wo[2]))
    z = (1.0 - xi2) * (1.0 + w[2]) - w[2]
    sine = wp.sqrt(wp.clamp((1.0 - z) * (1.0 + z), 0.0, 1.0))
    s, c = sincos_turns(xi1)
    h = wp.vec3(sine * c + w[0], sine * s + w[1], z + w[2])
    return wp.normalize(wp.vec3(alpha * h[0], alpha * h[1], wp.max(h[2], 1.0e-7)))


@wp.func
def eval_ggx(alpha: float, wo: wp.vec3, wi: wp.vec3) -> wp.vec3:
    """Single reflection by white facets: f times the cosine, its pdf_solid_angle, the cosine on the facets.

    For wo and wi above the surface.
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
    """Single refraction by facets that transmit everything, likewise; for wi below the surface."""
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


# ---- albedos of the layers.


@wp.func
def is_smooth(roughness: float) -> bool:
    """True where a lobe is taken as a mirror."""
    return roughness * roughness < SMOOTH_ALPHA


@wp.func
def dielectric_albedo(tables: wp.array(dtype=float), ior: float, block: int, roughness: float, cosine: float) -> float:
    """Of one reflection; of a mirror exactly."""
    if is_smooth(roughness):
        return fresnel_dielectric(cosine, ior)
    return albedo_at(tables, block, roughness, cosine)


@wp.func
def coat_albedo(tables: wp.array(dtype=float), bsdf: Bsdf, cosine: float) -> float:
    """Of the coat."""
    if bsdf.clearcoat == 0.0:
        return 0.0
    return bsdf.clearcoat * dielectric_albedo(tables, bsdf.ior, bsdf.dielectric, bsdf.clearcoat_roughness, cosine)


@wp.func
def ggx_albedo(tables: wp.array(dtype=float), bsdf: Bsdf, cosine: float) -> float:
    """Of the specular layer's facets, if they were white."""
    if is_smooth(bsdf.roughness):
        return 1.0
    return albedo_at(tables, 0, bsdf.roughness, cosine)


@wp.func
def single_albedo(tables: wp.array(dtype=float), bsdf: Bsdf, cosine: float, whole: float) -> wp.vec3:
    """Of the specular layer's dielectric, one reflection; `whole` is its `ggx_albedo`."""
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
    """Of what lies above the matte layer."""
    below = single_albedo(tables, bsdf, cosine, whole) + bsdf.shares * (1.0 - whole)
    return wp.vec3(coat) + below * (1.0 - coat)


@wp.func
def multiple_share(fresnel: wp.vec3, average: float) -> wp.vec3:
    """Of what facets scatter more than once, the share that they do not absorb."""
    result = wp.vec3()
    for k in range(3):
        result[k] = fresnel[k] * fresnel[k] * average / (1.0 - fresnel[k] * (1.0 - average))
    return result


@wp.func
def top_average(tables: wp.array(dtype=float), bsdf: Bsdf, average: float) -> wp.vec3:
    """`top_albedo` over light from everywhere; `average` is that of the specular layer's white facets."""
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


@wp.func
def mean(v: wp.vec3) -> float:
    """Of the components."""
    return (v[0] + v[1] + v[2]) / 3.0


@wp.func
def prepare_bsdf(tables: wp.array(dtype=float), before: Bsdf, wo: wp.vec3) -> Bsdf:
    """All that evaluation and sampling share; `wo` is in world space."""
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


# ---- frames.


@wp.func
def to_local(normal: wp.vec3, w: wp.vec3) -> wp.vec3:
    """A world vector in the frame of a normal."""
    tangent = orthonormal_tangent(normal)
    return wp.vec3(wp.dot(tangent, w), wp.dot(wp.cross(normal, tangent), w), wp.dot(normal, w))


@wp.func
def to_world(normal: wp.vec3, w: wp.vec3) -> wp.vec3:
    """A vector in the frame of a normal in the world."""
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


# ---- evaluation.


@wp.func
def facet_fresnel(bsdf: Bsdf, cosine: float) -> wp.vec3:
    """Reflectance of the specular layer's facets, metal and dielectric."""
    dielectric = 1.0 - bsdf.metallic
    if bsdf.is_specular == 1:
        return bsdf.specular + (wp.vec3(1.0) - bsdf.specular) * grazing_share(cosine)
    return bsdf.diffuse * bsdf.metallic + wp.vec3(dielectric * fresnel_dielectric(cosine, bsdf.ior))


@wp.func
def eval_layers(tables: wp.array(dtype=float), bsdf: Bsdf, wi: wp.vec3) -> wp.vec3:
    """f times the cosine of all layers but mirrors; `wi` in the frame of the shading normal, above the surface."""
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
    """pdf_solid_angle of the layers' lobes; likewise."""
    pdf = bsdf.p_matte * wi[2] / PI
    if not is_smooth(bsdf.roughness):
        pdf += bsdf.p_specular * eval_ggx(bsdf.roughness * bsdf.roughness, bsdf.wo, wi)[1]
    if bsdf.clearcoat > 0.0 and not is_smooth(bsdf.clearcoat_roughness):
        alpha = bsdf.clearcoat_roughness * bsdf.clearcoat_roughness
        pdf += bsdf.p_coat * eval_ggx(alpha, bsdf.wo, wi)[1]
    return pdf


@wp.func
def eval_glass(tables: wp.array(dtype=float), bsdf: Bsdf, wi: wp.vec3) -> wp.vec2:
    """f times the cosine of rough glass, and pdf_solid_angle; `wi` on either side, in the frame of the normal."""
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
    """f times the cosine per channel, and pdf_solid_angle, without mirrors and what passes straight.

    Both are those of light that does not pass straight, so they are that of `theory.bsdf` over 1 - `p_pass`.
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


# ---- sampling.


@wp.func
def go_to(bsdf: Bsdf, w: wp.vec3, weight: wp.vec3) -> BsdfSample:
    """The only direction that a mirror sends light to, in the frame of the normal."""
    s = BsdfSample()
    s.wi = to_world(bsdf.normal, w)
    s.weight = wp.where(is_on_side(bsdf, s.wi, w[2]), weight, wp.vec3(0.0))
    s.is_delta = 1
    s.transmits = wp.where(w[2] < 0.0, 1, 0)
    return s


@wp.func
def mirror(bsdf: Bsdf, weight: wp.vec3) -> BsdfSample:
    """The mirror direction."""
    return go_to(bsdf, wp.vec3(-bsdf.wo[0], -bsdf.wo[1], bsdf.wo[2]), weight)


@wp.func
def sample_smooth_glass(bsdf: Bsdf, weight: wp.vec3, xi: float) -> BsdfSample:
    """Reflection or refraction of a mirror."""
    if xi < fresnel_dielectric(wp.min(bsdf.wo[2], 1.0), bsdf.eta):
        return mirror(bsdf, weight)
    return go_to(bsdf, refract(bsdf.wo, wp.vec3(0.0, 0.0, 1.0), bsdf.eta), weight)


@wp.func
def reflect(w: wp.vec3, h: wp.vec3) -> wp.vec3:
    """The mirror direction of w about h."""
    return h * (2.0 * wp.dot(w, h)) - w


@wp.func
def sample_cosine(xi1: float, xi2: float) -> wp.vec3:
    """A direction distributed as the cosine."""
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
    """A direction of what does not pass straight; two numbers place it in a lobe, the others choose it.

    The weight is 0 where there is no direction.
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
            return mirror(bsdf, wp.vec3(bsdf.cover * bsdf.coat_o / (bsdf.p_coat * stays)))
        alpha = bsdf.clearcoat_roughness * bsdf.clearcoat_roughness
        w = reflect(bsdf.wo, sample_visible_normal(alpha, bsdf.wo, xi[0], xi[1]))
        w = wp.where(w[2] > 0.0, w, wp.vec3(0.0))
    elif xi[2] < specular_end:
        if is_smooth(bsdf.roughness):
            share = bsdf.cover * (1.0 - bsdf.coat_o) / (bsdf.p_specular * stays)
            return mirror(bsdf, facet_fresnel(bsdf, wp.min(bsdf.wo[2], 1.0)) * share)
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
