"""What the renderer sees of a scene: plain frozen values, checked on construction.

Lengths are in the stage's units, since extinction is authored per stage unit and nothing in the transport
depends on the metre; `Scene.meters_per_unit` is carried along for the files' headers. Radiance is linear
Rec.709. Matrices are 4x4 float64 that act on column vectors: ``p_world = M @ p_local``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import combinations, product
from typing import Literal

import numpy as np

from fgf_warp.errors import OpenMeshError, SceneError
from fgf_warp.placements import FLOAT32_MAX, are_usable, blocks, bound_places, squared
from fgf_warp.shells import Shells, count_unmatched, find_shells, weld, winding_number
from fgf_warp.theory.choices import LINE_VARIANCES, TRANSPORTS, LineVariance, Transport
from fgf_warp.theory.law import LineLaw, build_line_law
from fgf_warp.theory.mixture import MIXTURE_ERROR, mix_exact_rates
from fgf_warp.theory.phase import DRAINE_ALPHA_MAX
from fgf_warp.theory.similarity import SimilarChannel, similar_channel

Rgb = tuple[float, float, float]
Vec3 = tuple[float, float, float]
Vec4 = tuple[float, float, float, float]
PhaseFunction = Literal["isotropic", "hg", "two_lobe", "draine"]
PHASE_FUNCTIONS: tuple[PhaseFunction, ...] = ("isotropic", "hg", "two_lobe", "draine")
PHASE_PARAMETERS: dict[str, tuple[PhaseFunction, ...]] = {
    "asymmetry": ("hg", "two_lobe", "draine"),
    "back_asymmetry": ("two_lobe",),
    "back_weight": ("two_lobe",),
    "draine_alpha": ("draine",),
}
"""The parameters of phase functions in `Medium`, and which have them."""

WHITE: Rgb = (1.0, 1.0, 1.0)
BLACK: Rgb = (0.0, 0.0, 0.0)

RESOLVED_DEPTH = 1e5
"""sigma_m times the largest coordinate: above it float32, which rounds by 6e-8, moves events by a hundredth of a mean
free path."""
CHANNEL_NAMES = ("red", "green", "blue")
CUBE_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


Projection = Literal["perspective", "orthographic"]
PROJECTIONS: tuple[Projection, ...] = ("perspective", "orthographic")
ConformPolicy = Literal[
    "expandAperture", "cropAperture", "adjustApertureWidth", "adjustApertureHeight", "adjustPixelAspectRatio"
]
CONFORM_POLICIES: tuple[ConformPolicy, ...] = (
    "expandAperture",
    "cropAperture",
    "adjustApertureWidth",
    "adjustApertureHeight",
    "adjustPixelAspectRatio",
)
START_ROUNDING = 1e-5
"""Of coordinates in float32, amply and relative: camera rays that begin so near a shape may begin in it."""
CONTACT_ROUNDING = 1e-5
"""Of coordinates in float32, amply and relative: shapes that are so near each other may touch."""
FACE_ROUNDING = 2e-6
"""Of coordinates in float32, relative: how far apart rays find faces that coincide, but at the flattest slants."""
FILM_MAX = 1e6
"""Of lengths of a perspective camera's film over its focal length: float32 cannot tell flatter rays from each other."""
APERTURE_UNIT = 0.1
"""Of lengths of film and lens [stage unit]: UsdGeom.Camera has them in tenths."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole, thin-lens or orthographic camera.

    Args:
        name: the prim path, for messages.
        camera_to_world: (4, 4) float64; the camera looks along its local -z, with +y up and +x right.
        focal_length: > 0 [stage unit / 10].
        horizontal_aperture: > 0, width of the film [stage unit / 10]; of an orthographic camera, of what it sees.
        vertical_aperture: > 0, height of the film.
        horizontal_offset: shift of the film to the right [stage unit / 10].
        vertical_offset: shift of the film upwards.
        projection: ``perspective`` or ``orthographic``.
        f_stop: focal length over the lens' diameter, >= 0; 0 is a pinhole. Not used by an orthographic camera.
        focus_distance: from the lens to what is sharp, along the view axis [stage unit], > 0 where f_stop > 0.
        clipping_range: nearest and farthest distance along the view axis that surfaces and boundaries are seen at
            directly [stage unit], 0 <= near < far.
        exposure_scale: > 0, by which radiance is multiplied in the image.
        conform_policy: what gives way where the image's aspect ratio is not the film's, as UsdRender names it.
        pixel_aspect_ratio: width of a pixel over its height, > 0; ``adjustPixelAspectRatio`` finds its own.
        closing: (4, 4) float64, `camera_to_world` when the shutter closes, between which it moves linearly; None: it
            rests.
    """

    name: str
    camera_to_world: np.ndarray
    focal_length: float = 50.0
    horizontal_aperture: float = 20.955
    vertical_aperture: float = 15.2908
    horizontal_offset: float = 0.0
    vertical_offset: float = 0.0
    projection: Projection = "perspective"
    f_stop: float = 0.0
    focus_distance: float = 0.0
    clipping_range: tuple[float, float] = (0.0, math.inf)
    exposure_scale: float = 1.0
    conform_policy: ConformPolicy = "expandAperture"
    pixel_aspect_ratio: float = 1.0
    closing: np.ndarray | None = None

    def __post_init__(self) -> None:
        _check_matrix(self.name, "camera_to_world", self.camera_to_world)
        if self.closing is not None:
            _check_matrix(self.name, "closing", self.closing)
        _check_choice(self.name, "projection", self.projection, PROJECTIONS)
        _check_choice(self.name, "conform_policy", self.conform_policy, CONFORM_POLICIES)
        _check_range(self.name, "f_stop", self.f_stop, ">= 0", lambda x: x >= 0)
        if self.has_lens:
            _check_range(self.name, "focus_distance", self.focus_distance, "> 0", lambda x: x > 0)
        _check_range(self.name, "exposure_scale", self.exposure_scale, "> 0", lambda x: x > 0)
        near, far = self.clipping_range
        if not 0 <= near < far:
            raise SceneError(f"{self.name}: clipping_range = ({near:g}, {far:g}); accepted: 0 <= near < far")
        for key in ("focal_length", "horizontal_aperture", "vertical_aperture", "pixel_aspect_ratio"):
            _check_range(self.name, key, getattr(self, key), "> 0", lambda x: x > 0)
        for key in ("horizontal_offset", "vertical_offset"):
            _check_range(self.name, key, getattr(self, key), "finite", lambda x: True)
        if self.projection == "perspective":
            widest = FILM_MAX * self.focal_length
            for key in ("horizontal_aperture", "vertical_aperture", "horizontal_offset", "vertical_offset"):
                accepted = f"at most {FILM_MAX:g} focal_length = {widest:g}"
                _check_range(self.name, key, getattr(self, key), accepted, lambda x: abs(x) <= widest)

    @property
    def has_lens(self) -> bool:
        """True where what is out of focus is blurred."""
        return self.f_stop > 0 and self.projection == "perspective"

    @property
    def is_pinhole(self) -> bool:
        """True where all rays begin in one point and see everything before it."""
        is_clipped = self.clipping_range != (0.0, math.inf)
        return self.projection == "perspective" and not (self.has_lens or is_clipped or self.closing is not None)

    @property
    def aspect_ratio(self) -> float:
        """Width of the film over its height."""
        return self.horizontal_aperture / self.vertical_aperture

    @property
    def position(self) -> np.ndarray:
        """(3,) float64, the pinhole in world space."""
        return self.camera_to_world[:3, 3]

    @property
    def lens_radius(self) -> float:
        """[stage unit]; 0 of a pinhole."""
        return APERTURE_UNIT * self.focal_length / (2 * self.f_stop) if self.has_lens else 0.0

    def window(self, width: int, height: int) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of the image: on the plane at unit distance, or orthographic in stage units.

        Where the image's aspect ratio is not the film's, it is as `conform_policy` says: the film is widened until it
        covers the image (``expandAperture``) or narrowed until the image covers it (``cropAperture``), only its width
        or only its height is changed, or the pixels are no squares (``adjustPixelAspectRatio``).
        """
        half_w, half_h = self.horizontal_aperture / 2, self.vertical_aperture / 2
        image_aspect = self.pixel_aspect_ratio * width / height
        wide, high = half_h * image_aspect, half_w / image_aspect
        policy = self.conform_policy
        fits_width = policy == "adjustApertureWidth" or (policy == "expandAperture" and wide > half_w)
        fits_width = fits_width or (policy == "cropAperture" and wide < half_w)
        if fits_width:
            half_w = wide
        elif policy != "adjustPixelAspectRatio":
            half_h = high
        scale = APERTURE_UNIT if self.projection == "orthographic" else 1 / self.focal_length
        return (
            scale * (self.horizontal_offset - half_w),
            scale * (self.horizontal_offset + half_w),
            scale * (self.vertical_offset - half_h),
            scale * (self.vertical_offset + half_h),
        )

    def start_bounds(self, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corner, (3,) each, of a box that holds what rays begin at; tight but where it turns."""
        left, right, bottom, top = self.window(width, height)
        near, grows = self.clipping_range[0], self.projection == "perspective"
        # Of the film's window at the near plane, and of the lens as seen from there.
        window = near if grows else 1.0
        lens = self.lens_radius * abs(1 - near / self.focus_distance) if self.has_lens else 0.0
        middle = np.array([window * (left + right) / 2, window * (bottom + top) / 2, -near])
        half = np.array([window * (right - left) / 2 + lens, window * (top - bottom) / 2 + lens, 0.0])
        matrices = [self.camera_to_world] + ([] if self.closing is None else [self.closing])
        axes = [unit_axes(matrix) for matrix in matrices]
        positions = [matrix[:3, 3] for matrix in matrices]
        if not np.array_equal(axes[0], axes[-1]):
            reach = float(np.abs(middle).sum() + half.sum())
            return np.min(positions, axis=0) - reach, np.max(positions, axis=0) + reach
        middles = [position + axes[0] @ middle for position in positions]
        spread = np.abs(axes[0]) @ half
        return np.min(middles, axis=0) - spread, np.max(middles, axis=0) + spread


def unit_axes(matrix: np.ndarray) -> np.ndarray:
    """(3, 3) float64, whose columns are the directions of a matrix's axes: its lengths are not the camera's."""
    return matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)


@dataclass(frozen=True)
class Medium:
    """A homogeneous medium whose extinction is a fractional Gaussian field.

    Args:
        name: the material's prim path, for messages and labels.
        mean_extinction: sigma_m [1/stage unit], > 0 (0 is accepted for the classical exponential).
        albedo: single-scattering albedo per channel, in [0, 1].
        asymmetry: Henyey-Greenstein g in (-1, 1), in float32 too; > 0 scatters forward.
        phase_function: ``isotropic``; ``hg``, Henyey-Greenstein; ``two_lobe``, a blend of two of them; or ``draine``,
            Henyey-Greenstein times 1 + alpha cos^2. A parameter that it does not have must be 0.
        back_asymmetry: g of the second lobe, in (-1, 1); of ``two_lobe``.
        back_weight: share of the second lobe, in [0, 1]; of ``two_lobe``.
        draine_alpha: alpha in [0, 1000]; of ``draine``. At 1, with g = 0, it is Rayleigh scattering.
        hurst: Hurst exponent H; -0.5 is white noise. Domain: section 3 of the theory, see `build_line_law`.
        white_noise_scale: S_w [stage unit^(-2-2H)], >= 0; 0 is the classical exponential.
        outer_scale: L [stage unit], > 0; needed where H > 0, not used elsewhere.
        kappa: authored directly, in [0, 1e8]; it then replaces the value that follows from S_w.
        extinction_color: multiplies `mean_extinction` per channel, >= 0. A channel of factor 0 is empty space.
        transport: None chooses reciprocal where H >= -1/2 and renewal below, the only one there.
        line_variance: ``exact`` where 0 < H < 1 takes the variance of each segment's own length, ``asymptotic`` that of
            segments far below L; elsewhere both are the same, but for H > 1, where only the latter is known.
        priority: of nested media, the one with the highest priority fills the space.

    Raises:
        SceneError: naming the medium, the parameter, its value and the accepted range.
    """

    name: str
    mean_extinction: float
    albedo: Rgb = WHITE
    asymmetry: float = 0.0
    phase_function: PhaseFunction = "hg"
    back_asymmetry: float = 0.0
    back_weight: float = 0.0
    draine_alpha: float = 0.0
    hurst: float = -0.5
    white_noise_scale: float = 0.0
    outer_scale: float | None = None
    kappa: float | None = None
    extinction_color: Rgb = WHITE
    transport: Transport | None = None
    line_variance: LineVariance = "asymptotic"
    priority: int = 0

    def __post_init__(self) -> None:
        _check_color(self.name, "albedo", self.albedo, upper=1.0)
        _check_color(self.name, "extinction_color", self.extinction_color)
        self._check_phase()
        if self.transport not in (None, *TRANSPORTS):
            raise SceneError(f"{self.name}: transport = {self.transport!r}; accepted: {', '.join(TRANSPORTS)}")
        if self.line_variance not in LINE_VARIANCES:
            raise SceneError(
                f"{self.name}: line_variance = {self.line_variance!r}; accepted: {', '.join(LINE_VARIANCES)}"
            )
        self._line_law(self.mean_extinction)
        _check_range(self.name, "sigma_m", self.mean_extinction, ">= 0", lambda x: x >= 0)
        self._check_channels()
        if self.transport in ("reciprocal", "mixed") and self.line_law.b < 0:
            raise SceneError(
                f"{self.name}: transport = {self.transport!r} with H = {self.hurst:g}; "
                "accepted for H < -0.5: renewal only"
            )

    @cached_property
    def line_law(self) -> LineLaw:
        """Regime, b and kappa by which this medium is labelled.

        Where the channels are equal, it is the law in force: that of any channel, whose `LineLaw.mean_extinction`
        is `mean_extinction` times the factor. A chromatic medium has no such single law; this is then the one at
        `mean_extinction`, as for a white `extinction_color`.
        """
        return self._line_law(self.mean_extinction) if self.is_chromatic else self.channel_laws[0]

    @cached_property
    def channel_laws(self) -> tuple[LineLaw, LineLaw, LineLaw]:
        """The line law of each channel: at its own extinction, so with its own kappa, which is 0 in empty space."""
        red, green, blue = (self._channel_law(factor) for factor in self.extinction_color)
        return red, green, blue

    def _check_phase(self) -> None:
        if self.phase_function not in PHASE_FUNCTIONS:
            accepted = ", ".join(PHASE_FUNCTIONS)
            raise SceneError(f"{self.name}: phase_function = {self.phase_function!r}; accepted: {accepted}")
        for key, g in (("g", self.asymmetry), ("back_asymmetry", self.back_asymmetry)):
            accepted = "in (-1, 1), rounded to float32 too"
            _check_range(self.name, key, g, accepted, lambda g: -1 < g < 1 and abs(float(np.float32(g))) < 1)
        _check_range(self.name, "back_weight", self.back_weight, "in [0, 1]", lambda x: 0 <= x <= 1)
        accepted = f"in [0, {DRAINE_ALPHA_MAX:g}]"
        _check_range(self.name, "draine_alpha", self.draine_alpha, accepted, lambda x: 0 <= x <= DRAINE_ALPHA_MAX)
        for parameter, kinds in PHASE_PARAMETERS.items():
            value = getattr(self, parameter)
            if value != 0 and self.phase_function not in kinds:
                key = "g" if parameter == "asymmetry" else parameter
                raise SceneError(
                    f"{self.name}: {key} = {_shown(value)} with phase_function = {self.phase_function!r}; accepted: 0, "
                    f"or a phase function that has it: {', '.join(kinds)}"
                )

    def check_segments(self, longest: float) -> None:
        """Checks that the law holds for segments up to this length [stage unit].

        Raises:
            SceneError: where the exact variance of a fractional Brownian motion has no falling transmittance that far,
                or in the mixed transport is no mixture of exponentials.
        """
        for line in self.channel_laws:
            exact = line.exact_fbm
            if exact is None:
                continue
            where = f"{self.name}: line_variance = 'exact' with L = {self.outer_scale:g}, kappa = {line.kappa:g}"
            reach = line.longest_segment()
            if longest > reach:
                raise SceneError(
                    f"{where}: the law holds up to t = {reach:.4g}, and segments are up to {longest:.4g} long; "
                    f"accepted: at most {reach:.4g}, which grows with L, or line_variance = 'asymptotic'"
                )
            if self.transport == "mixed":
                error = mix_exact_rates(exact, line.mean_extinction * longest).error
                if error > MIXTURE_ERROR:
                    raise SceneError(
                        f"{where}: no mixture of exponentials has its transmittance (the nearest is {error:.1e} off), "
                        "so that transport = 'mixed' has nothing to freeze; accepted: a larger L, or another transport"
                    )

    def _check_channels(self) -> None:
        for channel, factor in zip(CHANNEL_NAMES, self.extinction_color, strict=True):
            where = f"{self.name}: extinction_color = {_listed(self.extinction_color)}: in {channel}"
            extinction = self.mean_extinction * factor
            if extinction > FLOAT32_MAX:
                raise SceneError(f"{where}, sigma_m = {extinction:g}; accepted: at most {FLOAT32_MAX:.3g}")
            try:
                self._channel_law(factor)
            except SceneError as error:
                raise SceneError(f"{where}, {str(error).removeprefix(f'{self.name}: ')}") from error

    def _channel_law(self, factor: float) -> LineLaw:
        if factor == 0:
            return replace(self._line_law(self.mean_extinction), regime="exponential", kappa=0.0, mean_extinction=0.0)
        return self._line_law(self.mean_extinction * factor)

    def _line_law(self, mean_extinction: float) -> LineLaw:
        try:
            return _kept_law(
                self.hurst, self.white_noise_scale, mean_extinction, self.outer_scale, self.kappa, self.line_variance
            )
        except ValueError as error:
            raise SceneError(f"{self.name}: {error}") from error

    @property
    def resolved_transport(self) -> Transport:
        """The transport in force: as authored, else reciprocal where H >= -1/2 and renewal below."""
        return self.transport or ("reciprocal" if self.line_law.b >= 0 else "renewal")

    @property
    def freezes_paths(self) -> bool:
        """True where the mixed transport freezes some: not those of an exponential."""
        return self.transport == "mixed" and any(not law.is_exponential for law in self.channel_laws)

    @property
    def mean_cosine(self) -> float:
        """Of the angle by which the phase function scatters; Draine's follows from the moments of Henyey-Greenstein.

        The mean of P_n(cos) of Henyey-Greenstein is g^n, so that of cos^2 is (1 + 2 g^2) / 3 and that of cos^3 is
        (3 g + 2 g^3) / 5.
        """
        g, alpha = self.asymmetry, self.draine_alpha
        first = g * (1 + alpha * (3 + 2 * g**2) / 5) / (1 + alpha * (1 + 2 * g**2) / 3)
        return (1 - self.back_weight) * first + self.back_weight * self.back_asymmetry

    @property
    def is_chromatic(self) -> bool:
        """True where the channels differ in extinction."""
        return len(set(self.extinction_color)) > 1

    @cached_property
    def similar_channels(self) -> tuple[SimilarChannel, SimilarChannel, SimilarChannel]:
        """The channels of the medium that scatters evenly, and light whose direction is lost alike."""
        red, green, blue = (
            similar_channel(law, albedo, self.mean_cosine)
            for law, albedo in zip(self.channel_laws, self.albedo, strict=True)
        )
        return red, green, blue


@dataclass(frozen=True, eq=False)
class Image:
    """A picture that textures read.

    Args:
        name: the asset path, for messages.
        pixels: (height, width, 4) RGBA, the first row at the top; uint8, where 255 stands for 1, or float32.
        is_srgb: True where R, G and B are encoded by the transfer function of sRGB (uint8 only), else linear.
    """

    name: str
    pixels: np.ndarray
    is_srgb: bool = False

    def __post_init__(self) -> None:
        if self.pixels.ndim != 3 or self.pixels.shape[2] != 4 or not self.pixels.size:
            raise SceneError(f"{self.name}: pixels have the shape {self.pixels.shape}; accepted: (height, width, 4)")
        if self.pixels.dtype not in (np.uint8, np.float32):
            raise SceneError(f"{self.name}: pixels are {self.pixels.dtype}; accepted: uint8 and float32")
        if self.is_srgb and self.pixels.dtype != np.uint8:
            raise SceneError(f"{self.name}: float32 pixels are linear; accepted: is_srgb of uint8 pixels")


Wrap = Literal["black", "clamp", "repeat", "mirror"]
WRAPS: tuple[Wrap, ...] = ("black", "clamp", "repeat", "mirror")


@dataclass(frozen=True, eq=False)
class Texture:
    """One image, or the tiles of a UDIM set, over the plane of texture coordinates; bilinear.

    Args:
        tiles: the image of each unit square (u, v) of texture coordinates; of a plain texture {(0, 0): image}.
        is_udim: True where each tile fills its own square, and nothing is wrapped; elsewhere the fallback is shown.
        wrap_s: beyond the unit square in s.
        wrap_t: in t.
        fallback: RGBA where there is no image or no tile.
    """

    tiles: Mapping[tuple[int, int], Image]
    is_udim: bool = False
    wrap_s: Wrap = "repeat"
    wrap_t: Wrap = "repeat"
    fallback: Vec4 = (0.0, 0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        for key, wrap in (("wrap_s", self.wrap_s), ("wrap_t", self.wrap_t)):
            _check_choice("texture", key, wrap, WRAPS)


IDENTITY_ST = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@dataclass(frozen=True, eq=False)
class TextureInput:
    """A material's input that a texture gives: channels of scale * texel + bias.

    Args:
        texture: what is read.
        primvar: name of the texture coordinates, empty for none; a shape that has none of that name is read at `st`.
        st: texture coordinates of such shapes.
        transform: two rows of three, applied to (s, t, 1).
        channels: ``rgb``, or one of ``r``, ``g``, ``b`` and ``a``.
        scale: of RGBA.
        bias: of RGBA.
    """

    texture: Texture
    primvar: str = "st"
    st: tuple[float, float] = (0.0, 0.0)
    transform: tuple[Vec3, Vec3] = IDENTITY_ST
    channels: Literal["rgb", "r", "g", "b", "a"] = "rgb"
    scale: Vec4 = (1.0, 1.0, 1.0, 1.0)
    bias: Vec4 = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class PrimvarInput:
    """A material's input that varies over the shape.

    Args:
        primvar: its name.
        fallback: where a shape has none; one number is meant for all channels.
    """

    primvar: str
    fallback: Rgb | float = 0.0


ColorInput = Rgb | TextureInput | PrimvarInput
FloatInput = float | TextureInput | PrimvarInput


@dataclass(frozen=True)
class Surface:
    """A two-sided surface in the parameters of UsdPreviewSurface; as it stands, a grey diffuse one.

    What is transparent lets light through straight, unless it bounds a medium: then light is refracted there.

    Args:
        diffuse: reflectance per channel, in [0, 1].
        emission: emitted radiance per channel, >= 0, from both sides.
        specular: of the specular workflow, reflectance at normal incidence; None is the metallic workflow.
        metallic: in [0, 1], of the metallic workflow.
        roughness: in [0, 1]; the square of it is alpha of GGX.
        clearcoat: weight of a second specular lobe, in [0, 1].
        clearcoat_roughness: in [0, 1].
        ior: index of refraction, > 0; at 1, in the metallic workflow, what is no metal has no specular lobe.
        opacity: in [0, 1].
        opacity_threshold: in [0, 1]; > 0 makes opacity 0 below it, and 1 from it on.
        is_presence: True where opacity dims the specular lobe too, not only the diffuse one.
        normal: of the tangent space, as a texture of [-1, 1]; None is the shape's own.
    """

    diffuse: ColorInput = (0.18, 0.18, 0.18)
    emission: ColorInput = BLACK
    specular: ColorInput | None = None
    metallic: FloatInput = 0.0
    roughness: FloatInput = 0.5
    clearcoat: FloatInput = 0.0
    clearcoat_roughness: FloatInput = 0.01
    ior: float = 1.0
    opacity: FloatInput = 1.0
    opacity_threshold: float = 0.0
    is_presence: bool = False
    normal: TextureInput | None = None

    def __post_init__(self) -> None:
        for key, upper in (("diffuse", 1.0), ("emission", FLOAT32_MAX), ("specular", 1.0)):
            color = getattr(self, key)
            if isinstance(color, tuple):
                _check_color("surface", key, color, upper=upper)
        for key in ("metallic", "roughness", "clearcoat", "clearcoat_roughness", "opacity", "opacity_threshold"):
            number = getattr(self, key)
            if not isinstance(number, TextureInput | PrimvarInput):
                _check_range("surface", key, number, "in [0, 1]", lambda x: 0 <= x <= 1)
        _check_range("surface", "ior", self.ior, "> 0", lambda x: x > 0)

    @cached_property
    def inputs(self) -> tuple[TextureInput | PrimvarInput, ...]:
        """Those that vary over the shape."""
        values = (getattr(self, key) for key in self.__dataclass_fields__)
        return tuple(value for value in values if isinstance(value, TextureInput | PrimvarInput))

    @cached_property
    def primvars(self) -> frozenset[str]:
        """Names of what it reads from the shape."""
        return frozenset(value.primvar for value in self.inputs if value.primvar)

    @cached_property
    def coordinates(self) -> frozenset[str]:
        """Those of them that textures are read at, which are of two numbers or more."""
        return frozenset(value.primvar for value in self.inputs if isinstance(value, TextureInput) and value.primvar)

    @property
    def is_matte(self) -> bool:
        """True where it is diffuse, opaque, and everywhere the same."""
        shines = self.ior != 1 or self.specular is not None or self.metallic != 0 or self.clearcoat != 0
        return not (self.inputs or shines or self.may_be_transparent)

    @property
    def emits(self) -> bool:
        """True where it may glow."""
        return self.emission != BLACK

    @property
    def may_be_transparent(self) -> bool:
        """True where some light may pass it."""
        return self.opacity != 1


@dataclass(frozen=True, eq=False)
class Solid:
    """A canonical solid under an affine transform.

    ``sphere`` has radius 1, ``cube`` is [-1, 1]^3, ``cylinder`` has radius 1 around z with caps at z = -1, 1.

    Args:
        name: the prim path.
        kind: which solid.
        object_to_world: (4, 4) float64, invertible.
        surface: what its surface does to light; None lets light through unchanged (a boundary 'none').
        medium: index into `Scene.media` of what fills it, or None.
        closing: (4, 4) float64, `object_to_world` when the shutter closes; None: it rests.
        primvars: name to the value on all of it, (k,) float32.
        instance: its number in the instancer, or -1.
        light_links: bit k is set where lights whose `link` is k shine on it.
        shadow_links: bit k is set where it casts a shadow in the light of those whose `shadow_link` is k.
    """

    name: str
    kind: Literal["sphere", "cube", "cylinder"]
    object_to_world: np.ndarray
    surface: Surface | None = None
    medium: int | None = None
    closing: np.ndarray | None = None
    primvars: Mapping[str, np.ndarray] = field(default_factory=dict)
    instance: int = -1
    light_links: int = 0
    shadow_links: int = 0

    def __post_init__(self) -> None:
        _check_matrix(self.name, "object_to_world", self.object_to_world)
        if self.closing is not None:
            _check_matrix(self.name, "closing", self.closing)


NO_VOLUME = (
    "a medium needs a closed mesh, and of this one the faces are there twice, facing both ways: it encloses no volume"
)
DOUBLED_FACES = "faces of the mesh of a medium are there twice, facing both ways, and bound nothing; they are left out"
INWARD_SHELL = "a part of the mesh of a medium faces inwards with nothing around it; it is turned"


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh: in world space, or in that of its instances.

    Args:
        name: the prim path.
        points: (n, 3) float, finite.
        triangles: (m, 3) int32 indices into points; counter-clockwise seen from outside.
        surface: as for `Solid`.
        medium: index into `Scene.media`, or None. The mesh must then be closed: it fills what is in any of its shells
            but not in their cavities, which face inwards. A shell that faces inwards with nothing around it is turned.
        normals: (m, 3, 3) float32, unit shading normals at the corners of each triangle; None: the triangles' own.
        primvars: name to (1, 1, k), (m, 1, k) or (m, 3, k) float32, the values of the whole mesh, of each triangle, or
            at the corners of each, between which they are interpolated.
        instance: as for `Solid`.
        light_links: as for `Solid`.
        shadow_links: as for `Solid`.

    Raises:
        SceneError: for points that are not finite, indices out of range, or a medium in a mesh that is not
            closed (an edge that two triangles do not share in opposite directions) or encloses no volume.
    """

    name: str
    points: np.ndarray
    triangles: np.ndarray
    surface: Surface | None = None
    medium: int | None = None
    normals: np.ndarray | None = None
    primvars: Mapping[str, np.ndarray] = field(default_factory=dict)
    instance: int = -1
    light_links: int = 0
    shadow_links: int = 0

    def __post_init__(self) -> None:
        if self.points.ndim != 2 or self.points.shape[1] != 3 or not _is_finite(self.points):
            raise SceneError(f"{self.name}: points must be a finite (n, 3) array")
        if self.triangles.ndim != 2 or self.triangles.shape[1] != 3 or not len(self.triangles):
            raise SceneError(f"{self.name}: the mesh has no triangles")
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.points):
            raise SceneError(f"{self.name}: face vertex indices must lie in [0, {len(self.points) - 1}]")
        count = len(self.triangles)
        if self.normals is not None and (self.normals.shape != (count, 3, 3) or not _is_finite(self.normals)):
            raise SceneError(f"{self.name}: normals must be a finite ({count}, 3, 3) array")
        for key, values in self.primvars.items():
            if values.ndim != 3 or values.shape[:2] not in ((1, 1), (count, 1), (count, 3)):
                raise SceneError(
                    f"{self.name}: primvar {key!r} has the shape {values.shape}; accepted: (1, 1, k), ({count}, 1, k) "
                    f"and ({count}, 3, k)"
                )
        if self.medium is not None:
            open_edges = int(count_unmatched(self._welded).sum())
            if open_edges:
                raise OpenMeshError(
                    f"{self.name}: a medium needs a closed mesh, and this one has {open_edges} open or "
                    "inconsistently oriented edges"
                )
            if not self._shells.count:
                raise OpenMeshError(f"{self.name}: {NO_VOLUME}")
            del self.__dict__["_welded"]  # As large as the mesh, and of no further use.

    @cached_property
    def _welded(self) -> np.ndarray:
        """(m, 3) int, the triangles with one number for points that coincide."""
        return weld(self.points)[self.triangles]

    @cached_property
    def _shells(self) -> Shells:
        """Of a mesh that a medium fills."""
        return find_shells(self.points, self.triangles, self._welded)

    @cached_property
    def bodies(self) -> tuple[Mesh, ...]:
        """The mesh, or where shells of it overlap, nest or touch, meshes of which none has such."""
        if self.medium is None or not lets_light_through(self.surface) or self._shells.are_plain:
            return (self,)
        found = []
        for group in range(self._shells.count):
            chosen = np.flatnonzero(self._shells.groups == group)
            corners = np.where(self._shells.turned[chosen, None], [2, 1, 0], [0, 1, 2])

            def part(values: np.ndarray, chosen: np.ndarray = chosen, corners: np.ndarray = corners) -> np.ndarray:
                rows = values if len(values) == 1 else values[chosen]
                return rows if rows.shape[1] == 1 else np.take_along_axis(rows, corners[..., None], axis=1)

            found.append(
                replace(
                    self,
                    triangles=np.take_along_axis(self.triangles[chosen], corners, axis=1),
                    normals=None if self.normals is None else part(self.normals),
                    primvars={name: part(values) for name, values in self.primvars.items()},
                )
            )
        return tuple(found)

    @cached_property
    def mended(self) -> tuple[str, ...]:
        """What had to be done for the mesh to bound its medium, one sentence each."""
        if self.medium is None or not lets_light_through(self.surface):
            return ()
        found = []
        if self._shells.turned.any():
            found.append(INWARD_SHELL)
        if (self._shells.groups < 0).any():
            found.append(DOUBLED_FACES)
        return tuple(found)

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corner, (3,) each, of a box that holds the triangles."""
        is_used = np.zeros(len(self.points), dtype=bool)
        is_used[self.triangles] = True
        points = self.points[is_used]
        return points.min(axis=0), points.max(axis=0)


@dataclass(frozen=True, eq=False)
class Instances:
    """A mesh or a solid in many places, which are arrays: a million of them take 100 MB here.

    Instances share what their prototypes share: arrays that are the same object.

    Args:
        name: the prim path.
        prototype: what stands there, with its surface and medium: a mesh in its own space, or a solid that rests, whose
            own transform comes first.
        object_to_world: (n, 3, 4) float64, n > 0, the upper rows of each one's matrix, which is invertible.
        closing: the same when the shutter closes; None: all rest.
        numbers: (n,) int, of each in its instancer, or None, where they are in none.
        primvars: name to (n, k) float32, one value for each, in place of the prototype's.
        light_links: as for `Solid`, of all of them.
        shadow_links: as for `Solid`, of all of them.

    Raises:
        SceneError: for arrays that do not fit, matrices that are not finite or not invertible, or more than one
            instance of what a medium fills, since each is a shape of its own.
    """

    name: str
    prototype: Mesh | Solid
    object_to_world: np.ndarray
    closing: np.ndarray | None = None
    numbers: np.ndarray | None = None
    primvars: Mapping[str, np.ndarray] = field(default_factory=dict)
    light_links: int = 0
    shadow_links: int = 0

    def __post_init__(self) -> None:
        for key in ("object_to_world", "closing"):
            matrices = getattr(self, key)
            if matrices is None and key == "closing":
                continue
            if matrices.shape != (self.count, 3, 4) or not self.count:
                raise SceneError(f"{self.name}: {key} must be an (n, 3, 4) array, with n > 0 the same for all")
            bad = np.flatnonzero(~are_usable(matrices))
            if len(bad):
                raise SceneError(
                    f"{self.name}: {key}[{bad[0]}] is of no use; accepted: finite, invertible and with an inverse "
                    f"below {FLOAT32_MAX:.3g}"
                )
        if self.numbers is not None and self.numbers.shape != (self.count,):
            raise SceneError(f"{self.name}: numbers must be a ({self.count},) array")
        for key, values in self.primvars.items():
            if values.ndim != 2 or len(values) != self.count:
                raise SceneError(
                    f"{self.name}: primvar {key!r} has the shape {values.shape}; accepted: ({self.count}, k)"
                )
        if isinstance(self.prototype, Solid) and (self.medium is not None or self.prototype.closing is not None):
            raise SceneError(f"{self.name}: a solid that is filled or moves is no prototype; accepted: each as a Solid")
        if self.medium is not None and self.count > 1:
            raise SceneError(
                f"{self.name}: {self.count} instances are filled with a medium; accepted: each as Instances of its own"
            )

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.object_to_world)

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corner, (3,) each, of a box that holds all of them wherever they move."""
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        box = shape_bounds(self.prototype)
        for matrices in (self.object_to_world, *(() if self.closing is None else (self.closing,))):
            for at in blocks(self.count):
                lows, highs = bound_places(matrices[at], *box)
                low, high = np.minimum(low, lows.min(axis=0)), np.maximum(high, highs.max(axis=0))
        return low, high

    @property
    def surface(self) -> Surface | None:
        """Of the prototype."""
        return self.prototype.surface

    @property
    def medium(self) -> int | None:
        """Of the prototype."""
        return self.prototype.medium


Shape = Solid | Mesh | Instances


def count_of(shape: Shape) -> int:
    """In how many places it is."""
    return shape.count if isinstance(shape, Instances) else 1


def lets_light_through(surface: Surface | None) -> bool:
    """True where light crosses what has this surface."""
    return surface is None or surface.may_be_transparent


def bodies_of(shape: Shape) -> tuple[Shape, ...]:
    """The shape, or in the place of a mesh whose shells overlap, nest or touch those that it is made of."""
    if isinstance(shape, Instances):
        mesh = shape.prototype
        of_mesh = mesh.bodies if isinstance(mesh, Mesh) else (mesh,)
        return tuple(shape if body is mesh else replace(shape, prototype=body) for body in of_mesh)
    return shape.bodies if isinstance(shape, Mesh) else (shape,)


MANY_SOLIDS = 100
"""More surfaces of solids than that are looked up in a tree, and are not tried one after the other."""


def solids_in_tree(shapes: Sequence[Shape]) -> list[Solid | Instances]:
    """Those solids that are looked up in a tree: none, or all whose surface is all there is of them.

    Instances of solids are in it, and all others then too.
    """
    solids = [
        shape
        for shape in shapes
        if isinstance(shape, Solid) or (isinstance(shape, Instances) and isinstance(shape.prototype, Solid))
    ]
    bare = [solid for solid in solids if solid.surface is not None and solid.medium is None]
    return bare if len(bare) > MANY_SOLIDS or any(isinstance(solid, Instances) for solid in bare) else []


MAX_CONTAINERS = 32
"""Shapes filled with a medium: one bit each in a path's state."""
MAX_LINKS = 32
"""Sets of shapes that lights may be linked to: a bit each in `Solid.light_links` and its like."""


@dataclass(frozen=True)
class Shaping:
    """How a light's radiance depends on the direction that it leaves in, as UsdLux.ShapingAPI says.

    Args:
        axis: unit vector that it is centred around.
        cone_angle: half the cone's opening, radians in [0, pi]; nothing is emitted beyond.
        cone_softness: share of the cone's angle over which it fades, in [0, 1].
        focus: power of the cosine with the axis, >= 0.
        focus_tint: colour that the light takes on away from the axis, per channel >= 0.
    """

    axis: Vec3
    cone_angle: float = math.pi
    cone_softness: float = 0.0
    focus: float = 0.0
    focus_tint: Rgb = BLACK

    def __post_init__(self) -> None:
        _check_range("shaping", "|axis|", math.hypot(*self.axis), "1", lambda x: abs(x - 1) < 1e-5)
        _check_range("shaping", "cone_angle", self.cone_angle, "in [0, pi]", lambda x: 0 <= x <= math.pi)
        _check_range("shaping", "cone_softness", self.cone_softness, "in [0, 1]", lambda x: 0 <= x <= 1)
        _check_range("shaping", "focus", self.focus, ">= 0", lambda x: x >= 0)
        _check_color("shaping", "focus_tint", self.focus_tint)


@dataclass(frozen=True, eq=False, kw_only=True)
class LightSource:
    """What all lights have, beside a name and a radiance.

    Args:
        link: it shines only on shapes whose `light_links` have this bit, in [0, 32); None: on all, and on all media.
        shadow_link: only shapes whose `shadow_links` have this bit cast shadows in its light; None: all do.
        shaping: None where it emits evenly.
    """

    link: int | None = None
    shadow_link: int | None = None
    shaping: Shaping | None = None

    def _check_source(self, name: str, radiance: Rgb) -> None:
        _check_color(name, "radiance", radiance)
        for key in ("link", "shadow_link"):
            bit = getattr(self, key)
            if bit is not None and not 0 <= bit < MAX_LINKS:
                raise SceneError(f"{name}: {key} = {bit}; accepted: in [0, {MAX_LINKS - 1}], or None")

    def _check_image(self, name: str, image: Image | None) -> None:
        if image is not None and image.pixels.dtype == np.float32:
            colors = image.pixels[..., :3]
            if not (np.isfinite(colors).all() and colors.min() >= 0):
                raise SceneError(f"{name}: {image.name} has pixels below 0 or not finite; accepted: finite and >= 0")


@dataclass(frozen=True)
class DistantLight(LightSource):
    """Light from one direction, or from a cone around it.

    Args:
        name: the prim path.
        direction: unit vector along which the light travels.
        half_angle: of the cone, radians in [0, pi/2]; 0 is a delta light.
        radiance: of the cone's disc; for half_angle = 0 the irradiance on a surface that faces the light.
    """

    name: str
    direction: Vec3
    half_angle: float
    radiance: Rgb

    def __post_init__(self) -> None:
        self._check_source(self.name, self.radiance)
        _check_range(self.name, "half_angle", self.half_angle, "in [0, pi/2]", lambda x: 0 <= x <= math.pi / 2)
        _check_range(self.name, "|direction|", math.hypot(*self.direction), "1", lambda x: abs(x - 1) < 1e-5)


@dataclass(frozen=True)
class DomeLight(LightSource):
    """An environment: of constant radiance, or times an image around the scene.

    Args:
        name: the prim path.
        radiance: >= 0 per channel.
        image: multiplies the radiance: latitude and longitude around the light's y axis, as the format ``latlong`` of
            UsdLux.DomeLight says; None: constant.
        light_to_world: (3, 3) rows of numbers, orthogonal: turns the image.
    """

    name: str
    radiance: Rgb
    image: Image | None = None
    light_to_world: tuple[Vec3, Vec3, Vec3] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    def __post_init__(self) -> None:
        self._check_source(self.name, self.radiance)
        self._check_image(self.name, self.image)
        turn = np.array(self.light_to_world)
        if turn.shape != (3, 3) or not np.allclose(turn @ turn.T, np.eye(3), atol=1e-5):
            raise SceneError(f"{self.name}: light_to_world = {turn.tolist()}; accepted: an orthogonal 3x3 matrix")

    @property
    def is_plain(self) -> bool:
        """True where it is the same in every direction and for all that it shines on."""
        return self.image is None and self.link is None and self.shadow_link is None and self.shaping is None


@dataclass(frozen=True)
class AreaLight(LightSource):
    """A flat light that emits to the side of ``cross(half_u, half_v)`` and is black behind.

    Args:
        name: the prim path.
        shape: ``rect``, the parallelogram center +- half_u +- half_v, or ``disk``, the ellipse within it.
        center: [stage unit].
        half_u: from the center to the middle of one side.
        half_v: from the center to the middle of the next side.
        radiance: >= 0 per channel.
        image: multiplies the radiance of a rect; None: even.
        image_axes: of the rect's (half_u, half_v) coordinates (a, b) in [-1, 1]^2 the image's s and t: two rows of
            three, applied to (a, b, 1). The image fills the rect, so that its corners lie on the rect's; t = 0 is its
            lower edge.
    """

    name: str
    shape: Literal["rect", "disk"]
    center: Vec3
    half_u: Vec3
    half_v: Vec3
    radiance: Rgb
    image: Image | None = None
    image_axes: tuple[Vec3, Vec3] = ((0.5, 0.0, 0.5), (0.0, 0.5, 0.5))

    def __post_init__(self) -> None:
        self._check_source(self.name, self.radiance)
        for key in ("center", "half_u", "half_v"):
            _check_vector(self.name, key, getattr(self, key))
        _check_range(self.name, "area", self.area, "> 0", lambda x: x > 0)
        self._check_image(self.name, self.image)
        if self.image is not None and self.shape != "rect":
            raise SceneError(f"{self.name}: image on a {self.shape}; accepted: on a rect")
        self._check_image_axes()

    def _check_image_axes(self) -> None:
        at_corners = CUBE_CORNERS[:, :2] @ np.array(self.image_axes)[:, :2].T + np.array(self.image_axes)[:, 2]
        if {*map(tuple, at_corners.round(5))} != {(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)}:
            raise SceneError(
                f"{self.name}: image_axes = {self.image_axes}; accepted: those that lay its corners on the rect's"
            )

    @property
    def area(self) -> float:
        """[stage unit^2]."""
        cross = float(np.linalg.norm(np.cross(self.half_u, self.half_v)))
        return cross * (4.0 if self.shape == "rect" else math.pi)


@dataclass(frozen=True)
class SphereLight(LightSource):
    """A sphere that emits outwards.

    Args:
        name: the prim path.
        center: [stage unit].
        radius: > 0.
        radiance: >= 0 per channel.
    """

    name: str
    center: Vec3
    radius: float
    radiance: Rgb

    def __post_init__(self) -> None:
        self._check_source(self.name, self.radiance)
        _check_vector(self.name, "center", self.center)
        _check_range(self.name, "radius", self.radius, "> 0", lambda x: x > 0)

    @property
    def area(self) -> float:
        """[stage unit^2]."""
        return 4 * math.pi * self.radius**2


@dataclass(frozen=True)
class CylinderLight(LightSource):
    """A round tube without caps that emits outwards.

    Args:
        name: the prim path.
        center: [stage unit].
        half_axis: from the center to the middle of one end.
        radius: > 0.
        radiance: >= 0 per channel.
    """

    name: str
    center: Vec3
    half_axis: Vec3
    radius: float
    radiance: Rgb

    def __post_init__(self) -> None:
        self._check_source(self.name, self.radiance)
        _check_vector(self.name, "center", self.center)
        _check_vector(self.name, "half_axis", self.half_axis)
        _check_range(self.name, "length", math.hypot(*self.half_axis), "> 0", lambda x: x > 0)
        _check_range(self.name, "radius", self.radius, "> 0", lambda x: x > 0)

    @property
    def area(self) -> float:
        """[stage unit^2], of the tube."""
        return 4 * math.pi * self.radius * math.hypot(*self.half_axis)


@dataclass(frozen=True, eq=False)
class MeshLight(LightSource):
    """Triangles that emit to their front; they are not seen as a shape beside it, and block light as one.

    Args:
        name: the prim path.
        corners: (m, 3, 3) float64, in world space, counter-clockwise seen from the side that emits.
        radiance: >= 0 per channel.
    """

    name: str
    corners: np.ndarray
    radiance: Rgb

    def __post_init__(self) -> None:
        self._check_source(self.name, self.radiance)
        if self.corners.ndim != 3 or self.corners.shape[1:] != (3, 3) or not _is_finite(self.corners):
            raise SceneError(f"{self.name}: corners must be a finite (m, 3, 3) array")
        _check_range(self.name, "area", self.area, "> 0", lambda x: x > 0)

    @property
    def areas(self) -> np.ndarray:
        """(m,) float64 [stage unit^2], of each triangle."""
        a, b, c = (self.corners[:, corner] for corner in range(3))
        return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2

    @property
    def area(self) -> float:
        """[stage unit^2]."""
        return float(self.areas.sum())


Light = DistantLight | DomeLight | AreaLight | SphereLight | CylinderLight | MeshLight


@dataclass(frozen=True, eq=False)
class Scene:
    """All that one render needs of a stage.

    Args:
        camera: where the picture is taken from.
        shapes: surfaces and boundaries of media; of meshes of media their `bodies_of`.
        media: what `shapes` refer to by index.
        lights: the scene's light sources.
        meters_per_unit: of the stage, > 0; carried into the headers of files.
        source: where the scene came from, for headers and messages.

    Raises:
        SceneError: where a shape names a medium that is not there, or is too large for the law of its medium.
    """

    camera: Camera
    shapes: tuple[Shape, ...] = ()
    media: tuple[Medium, ...] = ()
    lights: tuple[Light, ...] = ()
    meters_per_unit: float = 0.01
    source: str = field(default="")

    def __post_init__(self) -> None:
        bodies = tuple(body for shape in self.shapes for body in bodies_of(shape))
        if bodies != self.shapes:  # Else the same tuple stays, by which one sees that another scene's are the same.
            object.__setattr__(self, "shapes", bodies)
        for shape in self.shapes:
            if shape.medium is not None and not 0 <= shape.medium < len(self.media):
                raise SceneError(f"{shape.name}: medium {shape.medium} is not one of the scene's {len(self.media)}")
        for index, medium in enumerate(self.media):
            if medium.line_variance == "exact" and (longest := self.longest_segment(index)) is not None:
                medium.check_segments(longest)

    def medium_index(self, name: str | None = None) -> int:
        """Index of the medium called `name`, or of the only one.

        Raises:
            SceneError: where there is none of that name, or no single one to take.
        """
        names = [medium.name for medium in self.media]
        if name is None and len(names) == 1:
            return 0
        if name in names:
            return names.index(name)
        asked = f"no medium {name!r}" if name else "the medium must be named"
        raise SceneError(f"{self.source or 'scene'}: {asked}; it has: {', '.join(names) or 'none'}")

    def medium_warnings(self, index: int, medium: Medium) -> list[str]:
        """What a user should know of a medium in the place of number `index`, one sentence each."""
        extent, reach = self._medium_sizes[index]
        found = medium.line_law.warnings([] if extent is None else [extent])
        if reach is not None:
            mean_extinction = max(line.mean_extinction for line in medium.channel_laws)
            if mean_extinction * reach > RESOLVED_DEPTH:
                found.append(
                    f"sigma_m = {mean_extinction:g} with coordinates up to {reach:.3g}: float32 rounds positions by "
                    "more than a hundredth of a mean free path, and the picture of it is off by as much"
                )
        return found

    def medium_extent(self, index: int) -> float | None:
        """The longest side of the bounding boxes of the shapes that a medium fills [stage unit]; None of none."""
        return self._medium_sizes[index][0]

    @cached_property
    def _medium_sizes(self) -> tuple[tuple[float | None, float | None], ...]:
        """Of each medium its extent, and the largest coordinate in it, from the origin or the camera [stage unit].

        A sweep asks for them for each of its samples.
        """
        found: list[tuple[float | None, float | None]] = []
        for index in range(len(self.media)):
            bounds = self._medium_bounds(index)
            if not bounds:
                found.append((None, None))
                continue
            corners = np.array(bounds).reshape(-1, 3)
            reach = float(max(np.abs(corners).max(), np.linalg.norm(corners - self.camera.position, axis=1).max()))
            found.append((max(float((high - low).max()) for low, high in bounds), reach))
        return tuple(found)

    @cached_property
    def prims(self) -> tuple[str, ...]:
        """The distinct names of shapes, in order: the first is prim 1 of images."""
        return tuple(dict.fromkeys(shape.name for shape in self.shapes))

    def shapes_around_starts(self, width: int, height: int) -> tuple[Shape, ...]:
        """Shapes filled with media that some camera rays may begin in and others not: by boxes, so rather too many."""
        low, high = self.camera.start_bounds(width, height)
        margin = START_ROUNDING * max(np.abs(low).max(), np.abs(high).max())
        varied = []
        for shape, (lowest, highest) in zip(self.shapes, self.bounds, strict=True):
            is_varied = shape.medium is not None and (moves(shape) or not np.array_equal(low, high))
            if is_varied and (low <= highest + margin).all() and (high >= lowest - margin).all():
                varied.append(shape)
        return tuple(varied)

    @cached_property
    def neighbours(self) -> tuple[Shape, ...]:
        """Shapes filled with one medium that may touch or overlap each other: by boxes, so rather too many."""
        filled = [k for k, shape in enumerate(self.shapes) if shape.medium is not None]
        if len(filled) > MAX_CONTAINERS:  # Nothing renders that.
            return ()
        found = set()
        for a, b in combinations(filled, 2):
            if self.shapes[a].medium == self.shapes[b].medium and boxes_meet(self.bounds[a], self.bounds[b]):
                found |= {a, b}
        return tuple(self.shapes[k] for k in sorted(found))

    @property
    def contact_rounding(self) -> float:
        """How far apart rays may find boundaries of `neighbours` that coincide [stage unit]."""
        corners = [shape_bounds(shape) for shape in self.neighbours]
        return FACE_ROUNDING * float(np.abs(corners).max(initial=0))

    def frozen_share(self, index: int, medium: Medium) -> float:
        """The share of paths for which a medium in the place of number `index` is frozen; 0 where it fills nothing.

        Its thickness is the least width of what it fills, of several shapes the largest.
        """
        widths = [shape_widths(shape)[0] for shape in self.shapes if shape.medium == index]
        return medium.line_law.frozen_share(max(widths)) if widths and medium.freezes_paths else 0.0

    def longest_segment(self, index: int) -> float | None:
        """A length that no segment in a medium exceeds [stage unit]; None where it fills nothing."""
        bounds = self._medium_bounds(index)
        if not bounds:
            return None
        lows, highs = zip(*bounds, strict=True)
        one_after_the_other = sum(shape_widths(shape)[1] for shape in self.shapes if shape.medium == index)
        return min(one_after_the_other, float(np.linalg.norm(np.max(highs, axis=0) - np.min(lows, axis=0))))

    def _medium_bounds(self, index: int) -> list[tuple[np.ndarray, np.ndarray]]:
        return [bounds for shape, bounds in zip(self.shapes, self.bounds, strict=True) if shape.medium == index]

    @cached_property
    def bounds(self) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Lowest and highest corner, (3,) each, of every shape's box.

        Looking through the points of a mesh takes time, and a sweep asks for each of its samples.
        """
        return tuple(shape_bounds(shape) for shape in self.shapes)

    @cached_property
    def radius(self) -> float:
        """Half the diagonal of the box around all shapes [stage unit]; 1 of none."""
        if not self.shapes:
            return 1.0
        lows, highs = zip(*self.bounds, strict=True)
        return float(np.linalg.norm(np.max(highs, axis=0) - np.min(lows, axis=0))) / 2

    def with_medium(self, index: int, medium: Medium) -> Scene:
        """The same scene with one medium replaced."""
        return self.with_media((*self.media[:index], medium, *self.media[index + 1 :]))

    def with_media(self, media: tuple[Medium, ...]) -> Scene:
        """The same scene with other media in the place of its own."""
        return replace(self, media=media)

    def with_camera(self, camera: Camera) -> Scene:
        """The same scene seen from elsewhere; `bounds` stay, which are found once for all views."""
        moved = replace(self, camera=camera)
        moved.__dict__["bounds"] = self.bounds
        return moved


def drifts_of(shape: Shape) -> np.ndarray:
    """(n, 3, 4) float64 by which points of a shape move while the shutter is open, from their place at the opening."""
    if isinstance(shape, Mesh) or shape.closing is None:
        return np.zeros((count_of(shape), 3, 4))
    opening, closing = (
        squared(matrices if isinstance(shape, Instances) else matrices[None, :3])
        for matrices in (shape.object_to_world, shape.closing)
    )
    drifts = (closing @ np.linalg.inv(opening) - np.eye(4))[:, :3]
    drifts[(opening == closing).all(axis=(1, 2))] = 0
    return drifts


def moves(shape: Shape) -> bool:
    """True where a shape moves while the shutter is open."""
    return not isinstance(shape, Mesh) and shape.closing is not None


def shape_widths(shape: Shape) -> tuple[float, float]:
    """The least width of a shape, and a length that no segment in it exceeds; of a mesh those of its bounding box."""
    if not isinstance(shape, Solid):
        low, high = shape_bounds(shape)
        return float((high - low).min()), float(np.linalg.norm(high - low))
    matrix = shape.object_to_world[:3, :3]
    stretches = np.linalg.svd(matrix, compute_uv=False)
    longest = stretches.max() if shape.kind == "sphere" else np.linalg.norm(CUBE_CORNERS @ matrix.T, axis=1).max()
    return 2 * float(stretches.min()), 2 * float(longest)


def shape_bounds(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner, (3,) each, of a box that holds the shape; not tight for a turned round solid."""
    if not isinstance(shape, Solid):
        return shape.bounds
    matrices = [shape.object_to_world] + ([] if shape.closing is None else [shape.closing])
    points = np.concatenate([CUBE_CORNERS @ matrix[:3, :3].T + matrix[:3, 3] for matrix in matrices])
    return points.min(axis=0), points.max(axis=0)


def points_in(instances: Instances, point: np.ndarray) -> np.ndarray:
    """(m, 3), a point of the world in the space of each instance whose box holds it when the shutter opens."""
    low, high = bound_places(instances.object_to_world, *shape_bounds(instances.prototype))
    near = np.flatnonzero(((low <= point) & (point <= high)).all(axis=1))
    local: np.ndarray = np.linalg.solve(squared(instances.object_to_world[near]), np.append(point, 1.0)[:, None])
    return local[:, :3, 0]


def boxes_meet(first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]) -> bool:
    """True where two boxes, given by lowest and highest corners, overlap or touch, if only by rounding."""
    (low, high), (lowest, highest) = first, second
    margin = CONTACT_ROUNDING * max(np.abs(corner).max() for corner in (low, high, lowest, highest))
    return bool((low <= highest + margin).all() and (high >= lowest - margin).all())


def encloses(shape: Shape, point: np.ndarray) -> bool:
    """True where the point, (3,) float64 in world space, lies in the closed shape when the shutter opens."""
    if isinstance(shape, Mesh):
        return any(winding_number(body.points, body.triangles, point) > 0.5 for body in shape.bodies)
    if isinstance(shape, Instances):
        return any(encloses(shape.prototype, local) for local in points_in(shape, point))
    x, y, z = np.linalg.solve(shape.object_to_world, np.append(point, 1.0))[:3]
    if shape.kind == "sphere":
        return bool(x * x + y * y + z * z < 1)
    if shape.kind == "cube":
        return bool(max(abs(x), abs(y), abs(z)) < 1)
    return bool(x * x + y * y < 1 and abs(z) < 1)


def count_open_edges(points: np.ndarray, triangles: np.ndarray) -> int:
    """Number of directed edges of a mesh that no triangle runs along in the other direction.

    Points that coincide are taken as one, so seams between texture or normal islands do not count.

    Args:
        points: (n, 3) float.
        triangles: (m, 3) int.

    Returns:
        0 for a closed, consistently oriented mesh.
    """
    return int(count_unmatched(weld(points)[triangles]).sum())


@lru_cache(64)
def _kept_law(
    hurst: float,
    white_noise_scale: float,
    mean_extinction: float,
    outer_scale: float | None,
    kappa: float | None,
    line_variance: LineVariance,
) -> LineLaw:
    """The law of the last few parameters: the three channels of a medium mostly have one, and it is asked for again."""
    return build_line_law(
        hurst=hurst,
        white_noise_scale=white_noise_scale,
        mean_extinction=mean_extinction,
        outer_scale=outer_scale,
        kappa=kappa,
        line_variance=line_variance,
    )


def _check_range(name: str, key: str, value: float, accepted: str, holds: Callable[[float], bool]) -> None:
    if not math.isfinite(value) or not holds(value):
        raise SceneError(f"{name}: {key} = {_shown(value)}; accepted: {accepted}")
    if abs(value) > FLOAT32_MAX:
        raise SceneError(
            f"{name}: {key} = {_shown(value)}; accepted: {accepted}, and at most {FLOAT32_MAX:.3g} in size"
        )


def _check_choice(name: str, key: str, value: str, accepted: Sequence[str]) -> None:
    if value not in accepted:
        raise SceneError(f"{name}: {key} = {value!r}; accepted: {', '.join(accepted)}")


def _check_color(name: str, key: str, color: Sequence[float], upper: float = FLOAT32_MAX) -> None:
    unbounded = f"three finite numbers >= 0, at most {FLOAT32_MAX:.3g}"
    accepted = unbounded if upper == FLOAT32_MAX else f"three numbers in [0, {upper:g}]"
    if len(color) != 3 or not all(0 <= c <= upper for c in color):
        raise SceneError(f"{name}: {key} = {_listed(color)}; accepted: {accepted}")


def _check_vector(name: str, key: str, vector: Vec3) -> None:
    if len(vector) != 3 or not all(abs(x) <= FLOAT32_MAX for x in vector):
        raise SceneError(
            f"{name}: {key} = {_listed(vector)}; accepted: three finite numbers, at most {FLOAT32_MAX:.3g}"
        )


def _check_matrix(name: str, key: str, matrix: np.ndarray) -> None:
    if matrix.shape != (4, 4) or not _is_finite(matrix) or np.linalg.det(matrix[:3, :3]) == 0:
        raise SceneError(f"{name}: {key} must be a finite, invertible 4x4 matrix")
    if not _is_finite(np.linalg.inv(matrix)):
        raise SceneError(f"{name}: {key} is too far away for its size; accepted: an inverse below {FLOAT32_MAX:.3g}")


def _is_finite(values: np.ndarray) -> bool:
    """True where all values are finite as float32."""
    return bool(np.all(np.abs(values) <= FLOAT32_MAX))


def _listed(values: Iterable[float]) -> str:
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"


def _shown(value: float) -> str:
    """Short where that is the value; in full where the rounding would hide what is wrong."""
    short = f"{value:g}"
    return short if float(short) == value or not math.isfinite(value) else repr(float(value))
