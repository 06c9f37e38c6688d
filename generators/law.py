"""The transmittance law of one set of parameters, as plain numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fgf_warp.errors import ConfigError
from fgf_warp.theory.kernels import initial_rate, mean_free_path
from fgf_warp.theory.law import LineLaw, LineVariance, build_line_law

DEFAULT_DEPTHS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
"""sigma_m t of the lengths where none are asked for."""


# Whatever passes the range of numbers on the way is told by what comes out.
@np.errstate(all="ignore")
def evaluate_law(
    *,
    hurst: float,
    white_noise_scale: float | None,
    mean_extinction: float,
    outer_scale: float | None = None,
    kappa: float | None = None,
    line_variance: LineVariance = "asymptotic",
    lengths: Sequence[float] | None = None,
) -> dict[str, Any]:
    """Regime, b, kappa, mean free path, and transmittance and free-flight density at some lengths.

    Args:
        hurst: H, as `build_line_law`.
        white_noise_scale: S_w [length^(-2-2H)]; may be None where kappa is given.
        mean_extinction: sigma_m [1/length].
        outer_scale: L [length].
        kappa: in place of the value that follows from S_w.
        line_variance: of fractional Brownian motion, asymptotic or exact.
        lengths: t [length], finite and >= 0; None takes some around 1/sigma_m.

    Returns:
        JSON-ready, with the keys regime, b, kappa, mean_free_path [length] (None where infinite, or where the law ends
        before), law_ends_at [length] (None where it does not end), t, transmittance, free_flight_pdf [1/length] and
        warnings.

    Raises:
        ConfigError: naming the parameter, its value and the accepted range.
    """
    if white_noise_scale is None and kappa is None:
        raise ConfigError("S_w or kappa is needed")
    try:
        law = build_line_law(
            hurst=hurst,
            white_noise_scale=white_noise_scale or 0.0,
            mean_extinction=mean_extinction,
            outer_scale=outer_scale,
            kappa=kappa,
            line_variance=line_variance,
        )
    except ValueError as error:
        raise ConfigError(str(error)) from error
    reach = law.longest_segment()
    t = np.array(_default_lengths(mean_extinction, reach) if lengths is None else lengths, dtype=np.float64)
    if not (np.isfinite(t) & (t >= 0)).all():
        raise ConfigError(f"t = {', '.join(f'{value:g}' for value in t)}; accepted: finite numbers >= 0")
    u = mean_extinction * t
    if (t > reach).any():
        raise ConfigError(f"t = {t.max():g}; accepted with the exact variance: at most {reach:.6g}, where the law ends")
    # At u = 0 the formulas need kappa u^b, which for b < 0 has no value; the limits are known.
    inside = law.eval_kernels(np.where(u > 0, u, 1.0))
    transmittance = np.where(u > 0, inside.transmittance_ss, 1.0)
    rate = mean_extinction * np.where(u > 0, inside.density_sm, initial_rate(law.b, law.kappa))
    if not np.isfinite([u, transmittance, rate]).all():
        place = int(np.argmin(np.isfinite([u, transmittance, rate]).all(axis=0)))
        raise ConfigError(
            f"sigma_m = {mean_extinction:g} at t = {t[place]:g}, with b = {law.b:g} and kappa = {law.kappa:g}: the law "
            "has no value there in 64-bit numbers; accepted: parameters nearer to 1, by the choice of a unit of length"
        )
    warnings = law.warnings(t.tolist())
    mean = _mean_free_path(law)
    if mean is None:
        warnings.append(f"with the exact variance the law ends at t = {reach:.6g}, so there is no mean free path")
    if white_noise_scale is not None and kappa is not None:
        warnings.append(f"kappa = {kappa:g} takes the place of S_w = {white_noise_scale:g}")
    return {
        "regime": law.regime,
        "b": float(law.b),
        "kappa": float(law.kappa),
        "mean_free_path": mean if mean is not None and math.isfinite(mean) else None,
        "law_ends_at": reach if math.isfinite(reach) else None,
        "t": t.tolist(),
        "transmittance": transmittance.tolist(),
        "free_flight_pdf": rate.tolist(),
        "warnings": warnings,
    }


def _mean_free_path(law: LineLaw) -> float | None:
    """[length]; None where the law ends before it is known."""
    if law.exact_fbm is not None:
        return None
    return mean_free_path(law.b, law.kappa) / law.mean_extinction if law.mean_extinction > 0 else math.inf


def _default_lengths(mean_extinction: float, reach: float) -> list[float]:
    if mean_extinction == 0:
        raise ConfigError("sigma_m = 0 has no length of its own; say at which t to evaluate the law")
    unit = min(1 / mean_extinction, reach / max(DEFAULT_DEPTHS))
    return [depth * unit for depth in DEFAULT_DEPTHS]
