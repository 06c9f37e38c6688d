"""What becomes of a medium's parameters: refused, or accepted with the kappa that the theory's formulas give."""

from __future__ import annotations

import itertools
import math
import re

import numpy as np
from scipy.special import binom, gamma

from fgf_warp.theory.law import HURST_GUARD, HURST_MIN, KAPPA_MAX, build_line_law
from generators.stability.measurement import Axis, Measurement

KAPPA_BOUND = 1e-12
"""Relative difference of two ways to kappa in float64, through Gamma functions beside their poles."""
TINY = 1e-300


def measure_parameters(
    hursts: tuple[float, ...],
    white_noise_scales: tuple[float, ...],
    extinctions: tuple[float, ...],
    outer_scales: tuple[float | None, ...],
    scales: tuple[float, ...],
) -> list[Measurement]:
    """kappa of every combination, against `expected_kappa`, and whether the accepted ones are those that should be.

    Args:
        hursts: H.
        white_noise_scales: S_w at scale 1.
        extinctions: sigma_m at scale 1.
        outer_scales: L at scale 1; None where it is not authored.
        scales: lengths of the scene; all parameters are rescaled by their units, so that kappa must not change.

    Returns:
        Relative errors of kappa, and kappa itself, over (H, S_w, sigma_m, L, scale).
    """
    axes = (
        Axis("H", hursts),
        Axis("S_w", white_noise_scales),
        Axis("sigma_m", extinctions),
        Axis("L", outer_scales),
        Axis("scale", scales),
    )
    shape = tuple(len(axis.values) for axis in axes)
    kappas, errors = np.full(shape, np.nan), np.full(shape, np.nan)
    refusals = np.full(shape, "", dtype=object)
    combinations = itertools.product(hursts, white_noise_scales, extinctions, outer_scales, scales)
    for index, (hurst, white_noise_scale, extinction, outer_scale, scale) in zip(
        np.ndindex(shape), combinations, strict=True
    ):
        expected = expected_kappa(hurst, white_noise_scale, extinction, outer_scale)
        try:
            law = build_line_law(
                hurst=hurst,
                white_noise_scale=white_noise_scale * scale ** (-2 - 2 * hurst),
                mean_extinction=extinction / scale,
                outer_scale=None if outer_scale is None else outer_scale * scale,
            )
        except ValueError as error:
            refusals[index] = shorten_refusal(str(error))
            is_wrong = expected is not None and expected < KAPPA_MAX * (1 - KAPPA_BOUND)
            errors[index] = np.inf if is_wrong else np.nan
            continue
        kappas[index] = law.kappa
        errors[index] = np.inf if expected is None else abs(law.kappa - expected) / max(expected, TINY)
    return [
        Measurement("relative error of kappa", axes, errors, KAPPA_BOUND, refusals),
        Measurement("kappa", axes, kappas, KAPPA_MAX, refusals),
    ]


def expected_kappa(
    hurst: float, white_noise_scale: float, extinction: float, outer_scale: float | None
) -> float | None:
    """kappa by the formulas of Guo et al. 2019, supplement, (9) to (14), one by one and without logarithms.

    None where section 3 of the theory has the other parameters refused.

    Args:
        hurst: H.
        white_noise_scale: S_w [length^(-2-2H)].
        extinction: sigma_m [1/length].
        outer_scale: L [length]; None where it is not authored.

    Returns:
        >= 0, without a unit.
    """
    nearest = max(0, round(hurst))
    if hurst <= HURST_MIN or abs(hurst - nearest) < HURST_GUARD:
        return None
    if white_noise_scale == 0:
        return 0.0
    sine = math.sin(math.pi * (hurst - round(hurst))) * (-1) ** round(hurst)
    if hurst < 0:
        amplitude = -white_noise_scale / (gamma(2 * hurst + 3) * sine)
        return float(amplitude * extinction ** (-2 * hurst - 2))
    if outer_scale is None:
        return None
    constant = -1 / (2 * gamma(2 * hurst + 1) * sine)
    order = math.ceil(hurst)
    variance = 2 * constant * (-1) ** order * binom(2 * hurst - 1, order - 1) * white_noise_scale
    return float(variance * outer_scale ** (2 * hurst) / (2 * hurst + 1) / extinction**2)


def shorten_refusal(message: str) -> str:
    """A refusal without the values, by which refusals of one kind are counted."""
    return re.sub(r" \(from [^)]*\)| = [^ ;,]+", "", message)
