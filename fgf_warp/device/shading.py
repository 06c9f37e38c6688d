"""From a hit to a BSDF: interpolated primvars and normals, textures, and the parameters of UsdPreviewSurface.

A shape has a look: its material, and views of its primvars in the order in which the material names them. A material
has inputs, each a constant, a texture or a primvar. What textures and primvars give is taken into the range of what it
is for: reflectances and weights into [0, 1], emission to what is not negative.
"""

import warp as wp

from fgf_warp.device.bsdf import Bsdf, valid_normal
from fgf_warp.device.geometry import Hit
from fgf_warp.device.numerics import unit
from fgf_warp.device.textures import Textures, read_texture, tile_at

DIFFUSE = wp.constant(0)
EMISSION = wp.constant(1)
SPECULAR = wp.constant(2)
METALLIC = wp.constant(3)
ROUGHNESS = wp.constant(4)
CLEARCOAT = wp.constant(5)
CLEARCOAT_ROUGHNESS = wp.constant(6)
OPACITY = wp.constant(7)
NORMAL = wp.constant(8)
"""Inputs of a material, in their order."""

CONSTANT = wp.constant(0)
TEXTURE = wp.constant(1)
PRIMVAR = wp.constant(2)
"""Kinds of inputs."""

RGB = wp.constant(-1)
"""Stands for three channels."""


@wp.struct
class View:
    """Values of a primvar of a shape, one after the other."""

    first: int
    """-1: it has none."""
    width: int
    per_face: int
    """0: of the whole shape; 1: of each triangle; 3: of the corners of each."""
    item: int
    """Of values of each instance, what a hit of the first one tells; -1 of all others."""


@wp.struct
class Look:
    """What a shape with a surface has of its own; most of it is shared by what is alike."""

    material: int
    views: int
    """The first of its material's primvars."""
    normals: int
    """View of its shading normals, or -1."""
    item: int
    """What a hit of it tells; of instances that share the look, of the first of them."""
    instance: int
    """Whose space normals and tangents are in, of the first; or -1 for the world's."""
    container: int
    """Bit of the medium that light enters here, or -1."""


@wp.struct
class Input:
    """One input of a material."""

    kind: int
    value: wp.vec3
    """Of a constant, and what a shape without the primvar has; of a texture, its texture coordinates there."""
    texture: int
    view: int
    """Place of the primvar among the material's."""
    channel: int
    row_s: wp.vec3
    row_t: wp.vec3
    scale: wp.vec4
    bias: wp.vec4


@wp.struct
class Material:
    """UsdPreviewSurface."""

    inputs: int
    """The first of nine."""
    is_specular: int
    ior: float
    dielectric: int
    """Block of `ior` among the albedos."""
    threshold: float
    is_presence: int
    tangents: int
    """Place among its primvars of d position / d(s, t) of its normal map, or -1."""
    may_pass: int
    """1: some light may pass."""


@wp.struct
class Shading:
    """All surfaces of a scene."""

    looks: wp.array(dtype=Look)
    materials: wp.array(dtype=Material)
    inputs: wp.array(dtype=Input)
    views: wp.array(dtype=View)
    values: wp.array(dtype=float)
    """Of all primvars."""
    textures: Textures
    albedos: wp.array(dtype=float)
    """Tables of `device.albedos`."""
    glass: wp.array(dtype=int)
    """Blocks of glass in `albedos`, from each index of refraction to each."""
    glass_count: int
    """Different indices of refraction."""


@wp.struct
class Shade:
    """A surface where it is met."""

    bsdf: Bsdf
    emission: wp.vec3
    reflectance: wp.vec3
    """Colour, whatever the direction."""


@wp.func
def read_value(shading: Shading, view: View, hit: Hit, k: int) -> float:
    """One of the numbers of a primvar."""
    if view.item >= 0:
        return shading.values[view.first + (hit.item - view.item) * view.width + k]
    if view.per_face == 0 or hit.face < 0:
        return shading.values[view.first + k]
    if view.per_face == 1:
        return shading.values[view.first + hit.face * view.width + k]
    at = view.first + 3 * hit.face * view.width + k
    first = shading.values[at] * (1.0 - hit.u - hit.v)
    return first + shading.values[at + view.width] * hit.u + shading.values[at + 2 * view.width] * hit.v


@wp.func
def read_vector(shading: Shading, view: View, hit: Hit, first: int) -> wp.vec3:
    """Three successive numbers of a primvar."""
    return wp.vec3(
        read_value(shading, view, hit, first),
        read_value(shading, view, hit, first + 1),
        read_value(shading, view, hit, first + 2),
    )


@wp.func
def read_input(shading: Shading, look: Look, hit: Hit, index: int) -> wp.vec3:
    """An input's value at a hit; a single number in all channels."""
    source = shading.inputs[index]
    if source.kind == CONSTANT:
        return source.value
    view = shading.views[look.views + source.view]
    if source.kind == PRIMVAR:
        if view.first < 0:
            return source.value
        if view.width < 3:
            return wp.vec3(read_value(shading, view, hit, 0))
        return read_vector(shading, view, hit, 0)
    s = source.value[0]
    t = source.value[1]
    if view.first >= 0:
        s = read_value(shading, view, hit, 0)
        t = read_value(shading, view, hit, 1)
    at = wp.vec3(s, t, 1.0)
    st = wp.vec2(wp.dot(source.row_s, at), wp.dot(source.row_t, at))
    texture = shading.textures.textures[source.texture]
    rgba = texture.fallback
    image = tile_at(shading.textures, texture, st)
    if image >= 0:
        rgba = wp.cw_mul(read_texture(shading.textures, texture, image, st), source.scale) + source.bias
    if source.channel == RGB:
        return wp.vec3(rgba[0], rgba[1], rgba[2])
    return wp.vec3(rgba[source.channel])


@wp.func
def clamp_unit(v: wp.vec3) -> wp.vec3:
    """Each component in [0, 1]."""
    return wp.vec3(wp.clamp(v[0], 0.0, 1.0), wp.clamp(v[1], 0.0, 1.0), wp.clamp(v[2], 0.0, 1.0))


@wp.func
def read_weight(shading: Shading, look: Look, hit: Hit, index: int) -> float:
    """An input of one number in [0, 1]."""
    return wp.clamp(read_input(shading, look, hit, index)[0], 0.0, 1.0)


@wp.func
def read_opacity(shading: Shading, look: Look, material: Material, hit: Hit) -> float:
    """Opacity, cut at the threshold where there is one."""
    opacity = read_weight(shading, look, hit, material.inputs + OPACITY)
    if material.threshold > 0.0:
        return wp.where(opacity < material.threshold, 0.0, 1.0)
    return opacity


@wp.func
def shading_normal(
    shading: Shading, look: Look, material: Material, hit: Hit, normals_to_world: wp.mat33, axes: wp.mat33
) -> wp.vec3:
    """The shape's smooth normal, bent by the material's normal map; outward, in world space.

    normals_to_world, axes: what takes the shape's normals and its tangents to the world.
    """
    normal = hit.normal
    if look.normals >= 0:
        smooth = normals_to_world * read_vector(shading, shading.views[look.normals], hit, 0)
        if wp.length_sq(smooth) > 0.0:
            normal = unit(smooth)
    if material.tangents < 0:
        return normal
    view = shading.views[look.views + material.tangents]
    if view.first < 0 or hit.face < 0:
        return normal
    mapped = read_input(shading, look, hit, material.inputs + NORMAL)
    along_s = axes * read_vector(shading, view, hit, 0)
    along_t = axes * read_vector(shading, view, hit, 3)
    tangent = along_s - normal * wp.dot(normal, along_s)
    bitangent = wp.cross(normal, tangent)
    if wp.dot(bitangent, along_t) < 0.0:
        bitangent = -bitangent
    bent = unit(tangent) * mapped[0] + unit(bitangent) * mapped[1] + normal * mapped[2]
    if wp.length_sq(tangent) == 0.0 or wp.length_sq(bent) == 0.0:
        return normal
    return unit(bent)


@wp.func
def read_surface(
    shading: Shading,
    look: Look,
    hit: Hit,
    direction: wp.vec3,
    is_within: bool,
    normals_to_world: wp.mat33,
    axes: wp.mat33,
) -> Shade:
    """The surface at a hit, without glass; `prepare_bsdf` has to follow.

    is_within: of what light may enter, whether the path is in it; elsewhere the side is that of the direction.
    """
    material = shading.materials[look.material]
    first = material.inputs
    shade = Shade()
    bsdf = Bsdf()
    bsdf.facet = hit.normal
    is_behind = wp.dot(hit.normal, direction) > 0.0
    if look.container >= 0:
        is_behind = is_within
    if is_behind:
        bsdf.facet = -hit.normal
    normal = shading_normal(shading, look, material, hit, normals_to_world, axes)
    if is_behind:
        normal = -normal
    bsdf.normal = normal
    if wp.dot(normal - bsdf.facet, normal - bsdf.facet) > 0.0:
        bsdf.normal = valid_normal(normal, bsdf.facet, -direction)
    bsdf.diffuse = clamp_unit(read_input(shading, look, hit, first + DIFFUSE))
    bsdf.roughness = read_weight(shading, look, hit, first + ROUGHNESS)
    bsdf.clearcoat = read_weight(shading, look, hit, first + CLEARCOAT)
    bsdf.clearcoat_roughness = read_weight(shading, look, hit, first + CLEARCOAT_ROUGHNESS)
    bsdf.ior = material.ior
    bsdf.dielectric = material.dielectric
    bsdf.is_specular = material.is_specular
    shade.reflectance = bsdf.diffuse
    if material.is_specular == 1:
        bsdf.specular = clamp_unit(read_input(shading, look, hit, first + SPECULAR))
        shade.reflectance = clamp_unit(bsdf.diffuse + bsdf.specular)
    else:
        bsdf.metallic = read_weight(shading, look, hit, first + METALLIC)
    bsdf.fade = 1.0
    bsdf.cover = 1.0
    presence = float(1.0)
    if material.may_pass == 1:
        opacity = read_opacity(shading, look, material, hit)
        if material.is_presence == 1 or material.threshold > 0.0:
            presence = opacity
        if presence < 1.0 or look.container >= 0:
            bsdf.cover = opacity
        else:
            bsdf.fade = opacity
    emission = read_input(shading, look, hit, first + EMISSION) * presence
    shade.emission = wp.vec3(wp.max(emission[0], 0.0), wp.max(emission[1], 0.0), wp.max(emission[2], 0.0))
    shade.bsdf = bsdf
    return shade
