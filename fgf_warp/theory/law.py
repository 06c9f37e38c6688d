"""From the field's parameters (H, S_w, sigma_m, L) to the two numbers that the transport needs: b and kappa.

Every regime of a fractional Gaussian field is one family in the mean optical depth u = sigma_m t::

    y(u) = kappa u^b        Tr(u) = exp(-u log1p(y) / y)

with b = min(1 + 2H, 1) and kappa the line variance in units of the mean. Source: Guo et al. 2019, supplement,
equations (9) to (14), with the sign of (5) corrected. The variance of fractional Brownian motion is asymptotic, for
t << L; with the exact one, (11), the law has a third number, see `theory.fbm`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from numpy.typing import ArrayLike

from fgf_warp.theory import fbm, kernels
from fgf_warp.theory.choices import LINE_VARIANCES, LineVariance

Regime = Literal["exponential", "white", "pink", "negative", "fbm", "kfbm"]
LawKind = Literal["exponential", "power", "fractional", "exact_fbm"]

REGIME_NAMES: dict[Regime, str] = {
    "exponential": "classical exponential",
    "white": "white noise",
    "pink": "pink noise",
    "negative": "negative correlation (empirical)",
    "fbm": "fractional Brownian motion",
    "kfbm": "k-th order fractional Brownian motion",
}

HURST_MIN = -0.98
"""Accepted H lies above: v(t) diverges at H = -1."""
HURST_GUARD = 0.01
"""Accepted H keeps this distance from every integer >= 0, where v(t) diverges."""
ROUNDING = 1e-12
"""Relative, of the guard: 2.01 - 2 is not quite 0.01."""
KAPPA_MAX = 1e8
"""Above it float32 transport is not tested."""
CLUSTER_B = 0.02
"""0 < b below it: medium vertices cluster at zero distance (the white-noise limit of Tmm)."""
FBM_ERROR = 0.1
"""(t/L)^min(1, 2H), the order of the error of the asymptotic fBm variance, above which a warning is due."""

WIDE_MEDIA = "for H = 0.3 and a mean optical depth of 4, by 60 to 200 %"
"""Measured on explicit fields wider than their outer scale."""


@dataclass(frozen=True)
class LineLaw:
    """The transmittance law along a line.

    Args:
        regime: which of the theory's regimes the parameters lie in.
        b: exponent of the optical depth, in (-0.98, 1].
        kappa: >= 0; 0 is the classical exponential.
        hurst: H.
        mean_extinction: sigma_m [1/length].
        outer_scale: L [length], or None.
        line_variance: ``exact`` where v(t) of a fractional Brownian motion is that of a finite segment; kappa is that
            of the asymptotic one all the same.
    """

    regime: Regime
    b: float
    kappa: float
    hurst: float
    mean_extinction: float
    outer_scale: float | None
    line_variance: LineVariance = "asymptotic"

    @property
    def is_exponential(self) -> bool:
        """True where Tr is exp(-rate u): no correlation, or white noise."""
        return self.kappa == 0.0 or self.b == 0.0

    @property
    def kind(self) -> LawKind:
        """Which of the law's forms applies: b = 0 or no correlation, b = 1, any other b, or an exact variance."""
        if self.is_exponential:
            return "exponential"
        if self.exact_fbm is not None:
            return "exact_fbm"
        return "power" if self.b == 1 else "fractional"

    @property
    def exact_fbm(self) -> fbm.ExactFbm | None:
        """The law with the exact variance, where that is not the asymptotic one."""
        if self.line_variance == "asymptotic" or self.regime != "fbm":
            return None
        assert self.outer_scale is not None
        return fbm.ExactFbm(self.hurst, self.kappa, self.mean_extinction * self.outer_scale)

    def variance(self, t: float) -> float:
        """v(t): variance of the extinction averaged over a segment of length t > 0 [1/length^2]."""
        asymptotic = self.kappa * (self.mean_extinction * t) ** self.b * self.mean_extinction / t
        exact = self.exact_fbm
        if exact is None:
            return asymptotic
        return asymptotic * float(fbm.variance_ratio(exact.hurst, self.mean_extinction * t / exact.outer_depth))

    def eval_kernels(self, u: ArrayLike) -> kernels.KernelValues:
        """The four transport kernels at mean optical depths u > 0."""
        exact = self.exact_fbm
        return kernels.eval_kernels(self.b, self.kappa, u) if exact is None else fbm.eval_kernels(exact, u)

    def longest_segment(self) -> float:
        """The t up to which the law holds [length]: Tr of an exact variance would rise again; inf for the others."""
        exact = self.exact_fbm
        return math.inf if exact is None else fbm.falls_until(exact) / self.mean_extinction

    def frozen_share(self, thickness: float) -> float:
        """The share of paths that the mixed transport freezes in a medium of this thickness [length].

        b, and for an exact variance 1 + d ln v / d ln t at t = thickness, of which what exceeds 1 is all paths.
        """
        exact = self.exact_fbm
        if exact is None:
            return self.b
        return min(1.0, float(fbm.local_exponent(exact.hurst, self.mean_extinction * thickness / exact.outer_depth)))

    def warnings(self, lengths: Sequence[float] = ()) -> list[str]:
        """What a user should know about these parameters, one sentence each.

        Args:
            lengths: segment lengths of interest [length], to judge an fBm against its outer scale.
        """
        found = []
        if 0 < self.b < CLUSTER_B and self.kappa > 0:
            found.append(
                f"H = {self.hurst:g} is just above -0.5 (b = {self.b:.3g} < {CLUSTER_B:g}): in the reciprocal "
                "transport scattering events cluster, and the picture is not that of H = -0.5"
            )
        found += self._outer_scale_warnings(max(lengths, default=0.0))
        if self.kappa > 1:
            found.append(f"kappa = {self.kappa:.4g} > 1: the Gamma law of the line average is then a modelling choice")
        if self.b == 1 and self.kappa >= 1 and self.exact_fbm is None:
            found.append(f"kappa = {self.kappa:.4g} >= 1 with b = 1: the mean free path is infinite")
        return found

    def _outer_scale_warnings(self, length: float) -> list[str]:
        """What a fractional Brownian motion takes for granted of segments of this length, 0 where none is known."""
        if self.regime not in ("fbm", "kfbm"):
            return []
        if self.outer_scale is None:
            return [
                f"H = {self.hurst:g} with kappa and without an outer scale L: the law is that of segments far below L, "
                "which cannot be checked; in media wider than L its transmittance is far too high"
            ]
        tau = length / self.outer_scale
        if tau > 1:
            return [
                f"t = {length:g} is beyond the outer scale L = {self.outer_scale:g}, where correlation ends: the law "
                f"is that of segments far below L, and its transmittance is too high; {WIDE_MEDIA}"
            ]
        if self.exact_fbm is not None or tau == 0 or tau ** min(1.0, 2.0 * self.hurst) <= FBM_ERROR:
            return []
        known = f"; the exact one is {fbm.variance_ratio(self.hurst, tau):.2f} of it" if self.hurst < 1 else ""
        return [
            f"t = {length:g} is not far below the outer scale L = {self.outer_scale:g}, as the "
            f"asymptotic variance of H = {self.hurst:g} takes it to be{known}"
        ]


def build_line_law(
    *,
    hurst: float,
    white_noise_scale: float,
    mean_extinction: float,
    outer_scale: float | None = None,
    kappa: float | None = None,
    line_variance: LineVariance = "asymptotic",
) -> LineLaw:
    """The line law of a medium; section 3 of the theory is its domain.

    Args:
        hurst: H > -0.98, at least 0.01 from 0, 1, 2, ...
        white_noise_scale: S_w >= 0 [length^(-2-2H)].
        mean_extinction: sigma_m [1/length], > 0; >= 0 where S_w = 0.
        outer_scale: L > 0 [length]; required where H > 0.
        kappa: in [0, 1e8]; replaces the value that follows from S_w.
        line_variance: ``exact`` takes the variance of finite segments where 0 < H < 1, which needs L even where kappa
            is given; for H < 0 both are the same, and for H > 1 only the asymptotic one is known.

    Raises:
        ValueError: naming the parameter, its value and the accepted range.
    """
    _check("H", hurst, f"> {HURST_MIN:g}", hurst > HURST_MIN)
    nearest = max(0, round(hurst))
    _check(
        "H",
        hurst,
        f"at least {HURST_GUARD:g} away from {nearest}, where the variance diverges",
        abs(hurst - nearest) >= HURST_GUARD * (1 - ROUNDING),
    )
    _check("S_w", white_noise_scale, ">= 0", white_noise_scale >= 0)
    correlated = (white_noise_scale if kappa is None else kappa) > 0
    _check(
        "sigma_m",
        mean_extinction,
        "> 0" if correlated else ">= 0",
        mean_extinction > 0 or (mean_extinction == 0 and not correlated),
    )
    if outer_scale is not None:
        _check("L", outer_scale, "> 0", outer_scale > 0)
    elif hurst > 0 and correlated and (kappa is None or line_variance == "exact"):
        raise ValueError(f"H = {hurst:g} needs an outer scale L; accepted: > 0")
    if line_variance not in LINE_VARIANCES:
        raise ValueError(f"line_variance = {line_variance!r}; accepted: {', '.join(LINE_VARIANCES)}")
    if line_variance == "exact" and hurst > 1 and correlated:
        raise ValueError(f"line_variance = 'exact' with H = {hurst:g}; accepted: asymptotic, or exact with H < 1")
    if kappa is None:
        kappa = _kappa(hurst, white_noise_scale, mean_extinction, outer_scale) if correlated else 0.0
        origin = f" (from S_w = {white_noise_scale:g}, sigma_m = {mean_extinction:g}, H = {hurst:g})"
    else:
        origin = ""
    _check(f"kappa{origin}", kappa, f"in [0, {KAPPA_MAX:g}]", 0 <= kappa <= KAPPA_MAX)
    return LineLaw(
        regime=classify_regime(hurst) if kappa > 0 else "exponential",
        b=min(1.0 + 2.0 * hurst, 1.0),
        kappa=kappa,
        hurst=hurst,
        mean_extinction=mean_extinction,
        outer_scale=outer_scale,
        line_variance=line_variance,
    )


def classify_regime(hurst: float) -> Regime:
    """The regime of the Hurst exponent H in (-1, inf), integers >= 0 excluded."""
    if hurst == -0.5:
        return "white"
    if hurst < -0.5:
        return "negative"
    if hurst < 0:
        return "pink"
    return "fbm" if hurst < 1 else "kfbm"


def _kappa(hurst: float, white_noise_scale: float, mean_extinction: float, outer_scale: float | None) -> float:
    """kappa of section 2 of the theory, in log space so that L^(2H) cannot overflow.

    With k = ceil(H) and Gamma(2H+2) = (2H+1) Gamma(2H+1), the fBm line and the k-th order line of section 1 are one:
    v = S_w binom(2H-1, k-1) L^(2H) / (Gamma(2H+2) |sin(pi H)|).
    """
    log_sine = math.log(abs(math.sin(math.pi * (hurst - round(hurst)))))
    if hurst < 0:
        log_k = math.log(white_noise_scale) - math.lgamma(2 * hurst + 3) - log_sine
        return _exp(log_k - (2 * hurst + 2) * math.log(mean_extinction))
    assert outer_scale is not None
    order = math.ceil(hurst)
    log_binomial = math.lgamma(2 * hurst) - math.lgamma(order) - math.lgamma(2 * hurst - order + 1)
    log_v = math.log(white_noise_scale) + log_binomial + 2 * hurst * math.log(outer_scale)
    log_v -= math.lgamma(2 * hurst + 2) + log_sine
    return _exp(log_v - 2 * math.log(mean_extinction))


def _exp(x: float) -> float:
    return math.exp(x) if x < 709.0 else math.inf


def _check(name: str, value: float, accepted: str, holds: bool) -> None:
    if math.isnan(value) or not holds or (math.isinf(value) and not name.startswith("kappa")):
        raise ValueError(f"{name} = {value:g}; accepted: {accepted}")
