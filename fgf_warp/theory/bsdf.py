"""What surfaces do to light, in float64: GGX microfacets, Fresnel, and layers of them that lose no energy.

Directions are unit vectors (..., 3) in the frame of the shading normal, which is z; `wo` points towards where the light
goes, `wi` to where it comes from, both away from the surface. Sources:

* Walter et al. 2007, "Microfacet models for refraction through rough surfaces": GGX, and refraction.
* Heitz 2014, "Understanding the masking-shadowing function in microfacet-based BRDFs": height-correlated Smith.
* Dupuy and Benyoub 2023, "Sampling visible GGX normals with spherical caps".
* Kulla and Conty 2017, "Revisiting physically based shading at Imageworks": what scatters more than once.
* Kelemen and Szirmay-Kalos 2001, "A microfacet based coupled specular-matte BRDF model": diffuse below specular.
* UsdPreviewSurface's specification: which parameters there are, and F0 and F90 of its workflows.

A medium of index n holds n^2 times the radiance that reaches it from empty space. What is scattered here is basic
radiance, L / n^2, which refraction leaves as it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import ArrayLike

SMOOTH_ALPHA = 1e-3
"""Below it a lobe is narrower than a tenth of a degree, and taken as a mirror."""
SMOOTH_ROUGHNESS = SMOOTH_ALPHA**0.5
ALBEDO_ROWS = 32
"""Of tables of directional albedo: over roughness, from SMOOTH_ROUGHNESS to 1."""
ALBEDO_COLUMNS = 65
"""Over the square root of the cosine, from 0 to 1."""
ALBEDO_ERROR, GRAZING_ALBEDO_ERROR = 5e-3, 3e-2
"""Of what a table gives between its rows and columns, and so of the energy of a lobe: at cosines above 0.1, and at any.
Over light from everywhere it is below 1e-3."""
FRESNEL_NODES = 1 << 14
"""Of the average of a reflectance, which may have an edge."""
LEAST_COSINE = 1e-4
"""At which the first column stands for grazing light."""
LEAST_LOSS = 1e-6
"""Share of light below which nothing is left to couple to."""


# ---- one interface.


def fresnel_dielectric(cosine: ArrayLike, eta: ArrayLike) -> np.ndarray:
    """Share of unpolarised light that an interface reflects.

    Args:
        cosine: of the angle of incidence, in [0, 1].
        eta: index beyond the interface over the index before it, > 0. At 1 nothing is reflected.
    """
    cosine, eta = np.asarray(cosine, dtype=np.float64), np.asarray(eta, dtype=np.float64)
    beyond_sq = 1 - (1 - cosine**2) / eta**2
    beyond = np.sqrt(np.maximum(beyond_sq, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (cosine - eta * beyond) / (cosine + eta * beyond)
        p = (eta * cosine - beyond) / (eta * cosine + beyond)
    return np.where(beyond_sq <= 0, np.where(eta == 1, 0.0, 1.0), (s**2 + p**2) / 2)


def fresnel_schlick(cosine: ArrayLike, f0: ArrayLike) -> np.ndarray:
    """Schlick's reflectance, from f0 at normal incidence to 1 at grazing."""
    f0 = np.asarray(f0, dtype=np.float64)
    return f0 + (1 - f0) * (1 - np.asarray(cosine)) ** 5


def average_fresnel(eta: float) -> float:
    """`fresnel_dielectric`, averaged over light from everywhere: 2 times the integral of F mu over mu."""
    cosines = (np.arange(FRESNEL_NODES) + 0.5) / FRESNEL_NODES
    return float(2 * (cosines * fresnel_dielectric(cosines, eta)).mean())


def refract(wo: np.ndarray, h: np.ndarray, eta: ArrayLike) -> np.ndarray:
    """The direction beyond an interface of normal h; 0 where all is reflected."""
    cosine = (wo * h).sum(axis=-1)
    beyond_sq = 1 - (1 - cosine**2) / np.asarray(eta) ** 2
    along = cosine / eta - np.sqrt(np.maximum(beyond_sq, 0))
    return np.where((beyond_sq > 0)[..., None], h * along[..., None] - wo / np.asarray(eta)[..., None], 0.0)


# ---- GGX.


def ggx_density(alpha: ArrayLike, h: np.ndarray) -> np.ndarray:
    """D of a microfacet normal [1/sr] (Walter et al., eq. 33)."""
    alpha_sq = np.asarray(alpha) ** 2
    return alpha_sq / (np.pi * (h[..., 0] ** 2 + h[..., 1] ** 2 + alpha_sq * h[..., 2] ** 2) ** 2)


def smith_lambda(alpha: ArrayLike, w: np.ndarray) -> np.ndarray:
    """Smith's Lambda (Heitz, eq. 72)."""
    tangent_sq = (w[..., 0] ** 2 + w[..., 1] ** 2) / np.maximum(w[..., 2] ** 2, 1e-30)
    return (np.sqrt(1 + np.asarray(alpha) ** 2 * tangent_sq) - 1) / 2


def sample_visible_normal(alpha: ArrayLike, wo: np.ndarray, xi1: ArrayLike, xi2: ArrayLike) -> np.ndarray:
    """A microfacet normal as `wo` sees them (Dupuy and Benyoub, listing 3), from uniforms in (0, 1)."""
    stretch = np.stack(np.broadcast_arrays(np.asarray(alpha), np.asarray(alpha), 1.0), axis=-1)
    w = wo * stretch
    w = w / np.linalg.norm(w, axis=-1, keepdims=True)
    z = (1 - np.asarray(xi2)) * (1 + w[..., 2]) - w[..., 2]
    sine = np.sqrt(np.clip(1 - z**2, 0, 1))
    azimuth = 2 * np.pi * np.asarray(xi1)
    h = (np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), z], axis=-1) + w) * stretch
    return h / np.linalg.norm(h, axis=-1, keepdims=True)


def eval_ggx(alpha: ArrayLike, wo: np.ndarray, wi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Single reflection by microfacets that reflect everything.

    Returns:
        f times the cosine [1/sr], its pdf_solid_angle under sampling of visible normals, and the cosine of the angle of
        incidence on the facets.
    """
    h = wo + wi
    h = h / np.maximum(np.linalg.norm(h, axis=-1, keepdims=True), 1e-30)
    lambda_o, lambda_i = smith_lambda(alpha, wo), smith_lambda(alpha, wi)
    common = ggx_density(alpha, h) / (4 * wo[..., 2])
    above = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    return (
        np.where(above, common / (1 + lambda_o + lambda_i), 0),
        np.where(wo[..., 2] > 0, common / (1 + lambda_o), 0),
        (wo * h).sum(axis=-1),
    )


def eval_ggx_refraction(
    alpha: ArrayLike, eta: ArrayLike, wo: np.ndarray, wi: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Single refraction by microfacets that transmit everything (Walter et al., eqs. 17 and 21), of basic radiance.

    Returns:
        As for `eval_ggx`.
    """
    eta = np.asarray(eta)
    h = -(wo + eta * wi)
    h = h / np.maximum(np.linalg.norm(h, axis=-1, keepdims=True), 1e-30)
    h = h * np.sign(h[..., 2:])
    cosine_o, cosine_i = (wo * h).sum(axis=-1), (wi * h).sum(axis=-1)
    is_possible = (wi[..., 2] < 0) & (cosine_o > 0) & (cosine_i < 0)
    lambda_o, lambda_i = smith_lambda(alpha, wo), smith_lambda(alpha, wi)
    jacobian = eta**2 * np.abs(cosine_i) / np.maximum((cosine_o + eta * cosine_i) ** 2, 1e-30)
    common = ggx_density(alpha, h) * cosine_o * jacobian / wo[..., 2]
    return (
        np.where(is_possible, common / (1 + lambda_o + lambda_i), 0),
        np.where(is_possible, common / (1 + lambda_o), 0),
        cosine_o,
    )


# ---- directional albedos: shares of light that a lobe sends anywhere, by quadrature, in tables.


@dataclass(frozen=True, eq=False)
class Albedo:
    """A directional albedo over roughness and angle.

    Args:
        values: (ALBEDO_ROWS, ALBEDO_COLUMNS), between which it is interpolated linearly in the roughness and in the
            square root of the cosine.
    """

    values: np.ndarray

    def at(self, roughness: ArrayLike, cosine: ArrayLike) -> np.ndarray:
        """The albedo, for a roughness and a cosine in [0, 1]."""
        row, along = _row(roughness)
        column, across = _place(np.sqrt(np.asarray(cosine)), ALBEDO_COLUMNS)
        upper = self.values[row, column] * (1 - across) + self.values[row, column + 1] * across
        lower = self.values[row + 1, column] * (1 - across) + self.values[row + 1, column + 1] * across
        return upper * (1 - along) + lower * along

    @property
    def averages(self) -> np.ndarray:
        """(ALBEDO_ROWS,) over light from everywhere, of what is interpolated."""
        return self.values @ cosine_weights()

    def average(self, roughness: ArrayLike) -> np.ndarray:
        """The average at a roughness."""
        return interpolate_row(self.averages, roughness)

    def products(self, other: Albedo) -> np.ndarray:
        """(ALBEDO_ROWS, ALBEDO_ROWS) averages of this, of the first roughness, times another, of the second."""
        return (self.values * cosine_weights()) @ other.values.T


def interpolate_row(values: np.ndarray, roughness: ArrayLike) -> np.ndarray:
    """A column of a table, linearly."""
    row, along = _row(roughness)
    return values[row] * (1 - along) + values[row + 1] * along


def interpolate_rows(values: np.ndarray, first: ArrayLike, second: ArrayLike) -> np.ndarray:
    """A table over two roughnesses, bilinearly."""
    row, along = _row(first)
    column, across = _row(second)
    upper = values[row, column] * (1 - across) + values[row, column + 1] * across
    lower = values[row + 1, column] * (1 - across) + values[row + 1, column + 1] * across
    return upper * (1 - along) + lower * along


@cache
def cosine_weights() -> np.ndarray:
    """(ALBEDO_COLUMNS,) whose products with a row's values sum to its average, 2 times the integral of E mu over mu."""
    nodes, weights = _unit_nodes(8)
    column = np.arange(ALBEDO_COLUMNS - 1)[:, None]
    step = 1.0 / (ALBEDO_COLUMNS - 1)
    density = 4 * ((column + nodes) * step) ** 3 * weights * step
    result = np.zeros(ALBEDO_COLUMNS)
    result[:-1] += (density * (1 - nodes)).sum(axis=1)
    result[1:] += (density * nodes).sum(axis=1)
    return result


@cache
def ggx_albedo() -> tuple[Albedo, Albedo]:
    """Of one reflection: by facets that reflect everything, and by facets that reflect (1 - cos)^5."""
    cosine, seen = _reflections()
    return Albedo(seen.sum(axis=-1)), Albedo(((1 - cosine) ** 5 * seen).sum(axis=-1))


@cache
def dielectric_albedo(ior: float) -> Albedo:
    """Of one reflection by facets of a dielectric."""
    cosine, seen = _reflections()
    return Albedo((fresnel_dielectric(cosine, ior) * seen).sum(axis=-1) if ior != 1 else np.zeros(seen.shape[:2]))


@cache
def glass_albedo(eta: float) -> Albedo:
    """Of one reflection or refraction by facets of a dielectric that light may enter."""
    rows = []
    # More nodes, for total reflection begins at an edge.
    for alpha, wo, h, cosine, weights in _facets(32, 48):
        reflectance = fresnel_dielectric(cosine, eta)
        wi, beyond = 2 * cosine[..., None] * h - wo, refract(wo, h, eta)
        reflected = np.where(wi[..., 2] > 0, reflectance * _seen(alpha, wo, wi), 0)
        refracted = np.where(beyond[..., 2] < 0, (1 - reflectance) * _seen(alpha, wo, beyond), 0)
        rows.append((reflected + refracted) @ weights)
    return Albedo(np.array(rows))


@cache
def _reflections() -> tuple[np.ndarray, np.ndarray]:
    """Of each row and column, cosines on visible facets, and the weights of what they reflect, (.., .., nodes)."""
    rows = []
    for alpha, wo, h, cosine, weights in _facets(12, 32):
        wi = 2 * cosine[..., None] * h - wo
        rows.append((cosine, np.where(wi[..., 2] > 0, weights * _seen(alpha, wo, wi), 0)))
    cosines, seen = zip(*rows, strict=True)
    return np.array(cosines, dtype=np.float32), np.array(seen, dtype=np.float32)


def _facets(
    azimuth_count: int, height_count: int
) -> Iterator[tuple[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Row by row: alpha, directions, normals that each sees, the cosines between them, and their weights."""
    azimuths, azimuth_weights = _unit_nodes(azimuth_count)
    heights, height_weights = _unit_nodes(height_count)
    xi1, xi2 = (x.ravel() for x in np.meshgrid(azimuths / 2, heights, indexing="ij"))
    weights = np.outer(azimuth_weights, height_weights).ravel()
    cosines = np.maximum((np.arange(ALBEDO_COLUMNS) / (ALBEDO_COLUMNS - 1)) ** 2, LEAST_COSINE)[:, None]
    wo = np.stack(np.broadcast_arrays(np.sqrt(1 - cosines**2), 0.0, cosines), axis=-1)
    for roughness in np.linspace(SMOOTH_ROUGHNESS, 1, ALBEDO_ROWS):
        h = sample_visible_normal(roughness**2, wo, xi1, xi2)
        yield roughness**2, wo, h, np.clip((wo * h).sum(axis=-1), 0, 1), weights


def _seen(alpha: float, wo: np.ndarray, w: np.ndarray) -> np.ndarray:
    """G2 / G1: of what leaves visible facets, the share that leaves the surface."""
    lambda_o = smith_lambda(alpha, wo)
    return (1 + lambda_o) / (1 + lambda_o + smith_lambda(alpha, w))


def _row(roughness: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    return _place((np.asarray(roughness) - SMOOTH_ROUGHNESS) / (1 - SMOOTH_ROUGHNESS), ALBEDO_ROWS)


def _place(x: ArrayLike, count: int) -> tuple[np.ndarray, np.ndarray]:
    scaled = np.clip(np.asarray(x, dtype=np.float64), 0, 1) * (count - 1)
    row = np.minimum(scaled.astype(int), count - 2)
    return row, scaled - row


@cache
def _unit_nodes(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1) / 2, weights / 2


# ---- layers: the whole of UsdPreviewSurface, and the boundary of a medium.


@dataclass(frozen=True)
class Bsdf:
    """A surface at one point, seen from one side.

    From the top: a coat; a specular layer, metal and dielectric side by side; a matte layer below the dielectric. What
    is no coat is dimmed by 1 - max(E_c(o), E_c(i)), E_c the coat's albedo, which is reciprocal and never too much; the
    matte layer is coupled to what the layers above it leave (Kelemen and Szirmay-Kalos), so that nothing is lost there.
    The specular layer has back what its facets scatter more than once (Kulla and Conty).

    Args:
        diffuse: reflectance of the matte layer, and of the metal.
        metallic: share of the metal; 0 in the specular workflow.
        specular: reflectance at normal incidence in the specular workflow; None is the metallic workflow.
        roughness: square root of alpha.
        clearcoat: weight of the coat.
        clearcoat_roughness: likewise.
        ior: of the specular layer, and of the coat.
        fade: share of the matte layer that is there; the light that the rest would have got passes straight.
        cover: share of all layers that is there.
        eta: of the share 1 - `cover`, where that is glass: index beyond it over the index before it.
    """

    diffuse: tuple[float, float, float] = (0.18, 0.18, 0.18)
    metallic: float = 0.0
    specular: tuple[float, float, float] | None = None
    roughness: float = 0.5
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.01
    ior: float = 1.5
    fade: float = 1.0
    cover: float = 1.0
    eta: float | None = None

    def coat_albedo(self, cosine: ArrayLike) -> np.ndarray:
        """E_c, for a cosine in [0, 1]."""
        return self.clearcoat * _dielectric_albedo_at(self.ior, self.clearcoat_roughness, cosine)

    def ggx_albedo(self, cosine: ArrayLike) -> np.ndarray:
        """Of one reflection by facets of the specular layer, if they reflected everything."""
        if self.is_smooth:
            return np.ones_like(np.asarray(cosine, dtype=np.float64))
        return ggx_albedo()[0].at(self.roughness, cosine)

    def specular_albedo(self, cosine: ArrayLike) -> np.ndarray:
        """(..., 3) of the dielectric of the specular layer, all its reflections included."""
        whole = self.ggx_albedo(cosine)[..., None]
        multiple = _multiple_share(self._average_fresnel, self._average_ggx) * (1 - whole)
        if self.specular is None:
            return _dielectric_albedo_at(self.ior, self.roughness, cosine)[..., None] + multiple
        tip = (1 - np.asarray(cosine)) ** 5 if self.is_smooth else ggx_albedo()[1].at(self.roughness, cosine)
        f0 = np.array(self.specular)
        return f0 * (whole - tip[..., None]) + tip[..., None] + multiple

    def top_albedo(self, cosine: ArrayLike) -> np.ndarray:
        """(..., 3) of what lies above the matte layer."""
        coat = self.coat_albedo(cosine)[..., None]
        return coat + (1 - coat) * self.specular_albedo(cosine)

    @property
    def is_smooth(self) -> bool:
        """True where the specular layer is a mirror."""
        return self.roughness**2 < SMOOTH_ALPHA

    @property
    def is_coat_smooth(self) -> bool:
        """True where the coat is."""
        return self.clearcoat_roughness**2 < SMOOTH_ALPHA

    @cached_property
    def _average_fresnel(self) -> np.ndarray:
        if self.specular is None:
            return np.full(3, average_fresnel(self.ior))
        return np.array(self.specular) + (1 - np.array(self.specular)) / 21

    @cached_property
    def _average_ggx(self) -> float:
        return float(ggx_albedo()[0].average(self.roughness))

    @cached_property
    def top_average(self) -> np.ndarray:
        """(3,) `top_albedo` over light from everywhere."""
        (whole, tip), dielectric = ggx_albedo(), dielectric_albedo(self.ior)
        share = _multiple_share(self._average_fresnel, self._average_ggx)
        roughnesses = (self.clearcoat_roughness, self.roughness)

        def with_coat(other: Albedo) -> float:
            return float(interpolate_rows(dielectric.products(other), *roughnesses))

        coat = float(dielectric.average(self.clearcoat_roughness))
        if self.specular is None:
            single = np.full(3, dielectric.average(self.roughness))
            shared = np.full(3, with_coat(dielectric))
        else:
            f0 = np.array(self.specular)
            tips = float(tip.average(self.roughness))
            single = f0 * (self._average_ggx - tips) + tips
            shared = f0 * (with_coat(whole) - with_coat(tip)) + with_coat(tip)
        below = single + share * (1 - self._average_ggx)
        return self.clearcoat * coat + below - self.clearcoat * (shared + share * (coat - with_coat(whole)))

    @property
    def _dielectric_share(self) -> float:
        return 1.0 if self.specular is not None else 1 - self.metallic

    @property
    def _metal(self) -> np.ndarray:
        return (1 - self._dielectric_share) * np.array(self.diffuse)


def passing(bsdf: Bsdf, cosine: ArrayLike) -> np.ndarray:
    """(..., 3) share of light that passes straight, for a cosine in [0, 1]."""
    left = bsdf.cover * (1 - bsdf.fade) * bsdf._dielectric_share * (1 - bsdf.top_albedo(cosine))
    return left + (0.0 if bsdf.eta is not None else 1 - bsdf.cover)


def eval_bsdf(bsdf: Bsdf, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
    """f times the cosine [1/sr], (..., 3), of basic radiance; without mirrors and what passes straight.

    Args:
        bsdf: the surface.
        wo: (3,) with wo[2] > 0.
        wi: (..., 3).
    """
    wi = np.asarray(wi, dtype=np.float64)
    result = bsdf.cover * _eval_layers(bsdf, wo, wi)
    if bsdf.eta is not None and not bsdf.is_smooth:
        result = result + (1 - bsdf.cover) * _eval_glass(bsdf.roughness, bsdf.eta, wo, wi)[..., None]
    return result


def _eval_layers(bsdf: Bsdf, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
    cosine = np.maximum(wi[..., 2], 0)
    coat_o, coat_i = bsdf.coat_albedo(wo[2]), bsdf.coat_albedo(cosine)
    ggx_o, ggx_i = bsdf.ggx_albedo(wo[2]), bsdf.ggx_albedo(cosine)
    average = bsdf._average_ggx
    dielectric, metal = bsdf._dielectric_share, bsdf._metal
    color = np.array(bsdf.diffuse)

    share = dielectric * _multiple_share(bsdf._average_fresnel, average)
    share = share + (1 - dielectric) * _multiple_share(color, average)
    lobe = np.zeros((*wi.shape[:-1], 3))
    if not bsdf.is_smooth:
        single, _, facing = eval_ggx(bsdf.roughness**2, wo, wi)
        fresnel = (
            fresnel_dielectric(np.clip(facing, 0, 1), bsdf.ior)[..., None]
            if bsdf.specular is None
            else fresnel_schlick(np.clip(facing, 0, 1)[..., None], bsdf.specular)
        )
        lobe = (metal + dielectric * fresnel) * single[..., None]
        multiple = (1 - ggx_o) * (1 - ggx_i) * cosine / (np.pi * max(1 - average, LEAST_LOSS))
        lobe = lobe + share * multiple[..., None]
    lobe = lobe * (1 - np.maximum(coat_o, coat_i))[..., None]
    if bsdf.clearcoat > 0 and not bsdf.is_coat_smooth:
        single, _, facing = eval_ggx(bsdf.clearcoat_roughness**2, wo, wi)
        lobe = lobe + (bsdf.clearcoat * fresnel_dielectric(np.clip(facing, 0, 1), bsdf.ior) * single)[..., None]
    through = (1 - bsdf.top_albedo(wo[2])) * (1 - bsdf.top_albedo(cosine)) * cosine[..., None]
    matte = dielectric * bsdf.fade * color / (np.pi * np.maximum(1 - bsdf.top_average, LEAST_LOSS))
    return np.where((wi[..., 2] > 0)[..., None], lobe + matte * through, 0)


def _eval_glass(roughness: float, eta: float, wo: np.ndarray, wi: np.ndarray) -> np.ndarray:
    alpha = roughness**2
    front, back = glass_albedo(eta), glass_albedo(1 / eta)
    reflected, _, facing = eval_ggx(alpha, wo, wi)
    refracted, _, entering = eval_ggx_refraction(alpha, eta, wo, wi)
    cosine = np.abs(wi[..., 2])
    lost_o = 1 - front.at(roughness, wo[2])
    lost_front, lost_back = 1 - front.average(roughness), 1 - back.average(roughness)
    reflects = glass_reflects(roughness, eta)
    again = reflects * (1 - front.at(roughness, cosine)) / max(float(lost_front), LEAST_LOSS)
    through = (1 - reflects) * (1 - back.at(roughness, cosine)) / max(float(lost_back), LEAST_LOSS)
    above = fresnel_dielectric(np.clip(facing, 0, 1), eta) * reflected + lost_o * again * cosine / np.pi
    below = (1 - fresnel_dielectric(np.clip(entering, 0, 1), eta)) * refracted + lost_o * through * cosine / np.pi
    return np.where(wi[..., 2] > 0, above, below)


def glass_reflects(roughness: float, eta: float) -> float:
    """Of what rough glass scatters more than once, the share that comes back: that for which it is reciprocal."""
    lost_front = 1 - float(glass_albedo(eta).average(roughness))
    lost_back = 1 - float(glass_albedo(1 / eta).average(roughness))
    return lost_front / max(lost_front + eta**2 * lost_back, LEAST_LOSS)


def _dielectric_albedo_at(ior: float, roughness: float, cosine: ArrayLike) -> np.ndarray:
    """Of a mirror exactly."""
    if roughness**2 < SMOOTH_ALPHA:
        return fresnel_dielectric(cosine, ior)
    return dielectric_albedo(ior).at(roughness, cosine)


def _multiple_share(fresnel: np.ndarray, average: float) -> np.ndarray:
    """Of what facets scatter more than once, the share that they do not absorb (Kulla and Conty)."""
    return fresnel**2 * average / (1 - fresnel * (1 - average))
