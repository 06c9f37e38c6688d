"""A medium: extinction, albedo, phase function, and the field whose statistics give the law of its transmittance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np

from fgf_warp.errors import SceneError
from fgf_warp.scene.checks import (
    check_choice,
    check_color,
    check_fraction,
    check_not_negative,
    check_range,
    listed,
    shown,
)
from fgf_warp.scene.values import FLOAT32_MAX, WHITE, Rgb
from fgf_warp.theory.choices import LINE_VARIANCES, TRANSPORTS, LineVariance, Transport
from fgf_warp.theory.law import LineLaw, build_line_law
from fgf_warp.theory.mixture import MIXTURE_ERROR, mix_exact_rates
from fgf_warp.theory.phase import DRAINE_ALPHA_MAX
from fgf_warp.theory.similarity import SimilarChannel, similar_channel

PhaseFunction = Literal["isotropic", "hg", "two_lobe", "draine"]
PHASE_FUNCTIONS: tuple[PhaseFunction, ...] = ("isotropic", "hg", "two_lobe", "draine")
PHASE_PARAMETERS: dict[str, tuple[PhaseFunction, ...]] = {
    "asymmetry": ("hg", "two_lobe", "draine"),
    "back_asymmetry": ("two_lobe",),
    "back_weight": ("two_lobe",),
    "draine_alpha": ("draine",),
}
"""The parameters of phase functions in `Medium`, and which have them."""

CHANNEL_NAMES = ("red", "green", "blue")

_cached_line_law = lru_cache(64)(build_line_law)
"""Of the last few parameters: the three channels of a medium mostly have one law, and it is asked for again."""


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
        kappa: in [0, 1e8], in place of the value that follows from S_w; None takes that.
        extinction_color: multiplies `mean_extinction` per channel, >= 0. A channel of factor 0 is empty space.
        transport: ``reciprocal``, ``renewal`` or ``mixed``; None takes reciprocal where H >= -1/2, and below it
            renewal, the only one there.
        line_variance: where 0 < H < 1, ``exact`` takes the variance at each segment's own length, and ``asymptotic``
            that of segments far below L. Elsewhere both are the same, but for H > 1, where only the latter is known.
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
        check_color(self.name, "albedo", self.albedo, upper=1.0)
        check_color(self.name, "extinction_color", self.extinction_color)
        self._check_phase()
        if self.transport is not None:
            check_choice(self.name, "transport", self.transport, TRANSPORTS)
        check_choice(self.name, "line_variance", self.line_variance, LINE_VARIANCES)
        self._law_at(self.mean_extinction)
        check_not_negative(self.name, "sigma_m", self.mean_extinction)
        self._check_channels()
        if self.transport in ("reciprocal", "mixed") and self.line_law.b < 0:
            raise SceneError(
                f"{self.name}: transport = {self.transport!r} with H = {self.hurst:g}; "
                "accepted for H < -0.5: renewal only"
            )

    def _check_phase(self) -> None:
        check_choice(self.name, "phase_function", self.phase_function, PHASE_FUNCTIONS)
        for key, g in (("g", self.asymmetry), ("back_asymmetry", self.back_asymmetry)):
            accepted = "in (-1, 1), rounded to float32 too"
            check_range(self.name, key, g, accepted, lambda g: -1 < g < 1 and abs(float(np.float32(g))) < 1)
        check_fraction(self.name, "back_weight", self.back_weight)
        accepted = f"in [0, {DRAINE_ALPHA_MAX:g}]"
        check_range(self.name, "draine_alpha", self.draine_alpha, accepted, lambda x: 0 <= x <= DRAINE_ALPHA_MAX)
        for parameter, kinds in PHASE_PARAMETERS.items():
            value = getattr(self, parameter)
            if value != 0 and self.phase_function not in kinds:
                key = "g" if parameter == "asymmetry" else parameter
                raise SceneError(
                    f"{self.name}: {key} = {shown(value)} with phase_function = {self.phase_function!r}; accepted: 0, "
                    f"or a phase function that has it: {', '.join(kinds)}"
                )

    def _check_channels(self) -> None:
        for channel, factor in zip(CHANNEL_NAMES, self.extinction_color, strict=True):
            where = f"{self.name}: extinction_color = {listed(self.extinction_color)}: in {channel}"
            extinction = self.mean_extinction * factor
            if extinction > FLOAT32_MAX:
                raise SceneError(f"{where}, sigma_m = {extinction:g}; accepted: at most {FLOAT32_MAX:.3g}")
            try:
                self._channel_law(factor)
            except SceneError as error:
                raise SceneError(f"{where}, {str(error).removeprefix(f'{self.name}: ')}") from error

    @cached_property
    def line_law(self) -> LineLaw:
        """The law whose regime, b and kappa this medium is labelled by.

        Where the channels are equal, it is the law in force: that of any channel, at `mean_extinction` times the
        factor. A chromatic medium has no such single law; this is then the one at `mean_extinction`, as for a white
        `extinction_color`.
        """
        return self._law_at(self.mean_extinction) if self.is_chromatic else self.channel_laws[0]

    @cached_property
    def channel_laws(self) -> tuple[LineLaw, LineLaw, LineLaw]:
        """The law of each channel at its own extinction, and so with its own kappa, which is 0 in empty space."""
        red, green, blue = (self._channel_law(factor) for factor in self.extinction_color)
        return red, green, blue

    @property
    def resolved_transport(self) -> Transport:
        """The transport in force: as authored, else reciprocal where H >= -1/2 and renewal below."""
        return self.transport or ("reciprocal" if self.line_law.b >= 0 else "renewal")

    @property
    def freezes_paths(self) -> bool:
        """True where the mixed transport freezes some paths: not those of an exponential law."""
        return self.transport == "mixed" and any(not law.is_exponential for law in self.channel_laws)

    @property
    def mean_cosine(self) -> float:
        """Mean cosine of the scattering angle, in [-1, 1]; 0 where the phase function scatters evenly.

        Draine's follows from the moments of Henyey-Greenstein, whose mean of P_n(cos) is g^n: that of cos^2 is
        (1 + 2 g^2) / 3, and that of cos^3 is (3 g + 2 g^3) / 5.
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
        """Of each channel the isotropic medium in which light loses its direction over the same length."""
        red, green, blue = (
            similar_channel(law, albedo, self.mean_cosine)
            for law, albedo in zip(self.channel_laws, self.albedo, strict=True)
        )
        return red, green, blue

    def check_segments(self, longest: float) -> None:
        """Checks that the law holds for all segments of a scene.

        Args:
            longest: the length of the longest [stage unit].

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

    def _channel_law(self, factor: float) -> LineLaw:
        """The law of a channel whose `extinction_color` is this factor."""
        if factor == 0:
            return replace(self._law_at(self.mean_extinction), regime="exponential", kappa=0.0, mean_extinction=0.0)
        return self._law_at(self.mean_extinction * factor)

    def _law_at(self, mean_extinction: float) -> LineLaw:
        """The law at an extinction other than the medium's own."""
        try:
            return _cached_line_law(
                hurst=self.hurst,
                white_noise_scale=self.white_noise_scale,
                mean_extinction=mean_extinction,
                outer_scale=self.outer_scale,
                kappa=self.kappa,
                line_variance=self.line_variance,
            )
        except ValueError as error:
            raise SceneError(f"{self.name}: {error}") from error
