"""The law, its flights and the phase functions of the device against their float64 twins."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fgf_warp import probes
from fgf_warp.theory import fbm, kernels, phase
from fgf_warp.theory.fbm import ExactFbm
from generators.stability.measurement import Axis, Measurement

LEAST_UNIFORM, LARGEST_UNIFORM = 2.0**-32, 1 - 2.0**-24
"""The ends of the device's uniforms."""
AXIS = np.array([0.48, -0.6, 0.64])
"""Directions are measured around it."""
ANGLE_ROUNDING = 3e-7
"""Of a direction in float32 [radian]."""
ANGLES = (0.0, *(float(f"{v:.3g}") for v in np.geomspace(1e-9, 1.0, 28)), *(2.0 - 10.0**-k for k in range(1, 9)), 2.0)
"""1 - cos(theta)."""
UNIFORMS = (1e-7, *(k / 40 for k in range(1, 40)), 1 - 6e-8)
"""xi."""


@dataclass(frozen=True)
class ExactGrid:
    """Parameters of the law with the exact variance of fractional Brownian motion.

    Args:
        hursts: H in (0, 1).
        kappas: > 0, of the asymptotic variance.
        outer_depths: sigma_m L > 0.
        lengths: t/L > 0; those from which Tr no longer falls are left out.
    """

    hursts: tuple[float, ...]
    kappas: tuple[float, ...]
    outer_depths: tuple[float, ...]
    lengths: tuple[float, ...] = (*(10.0**k for k in range(-6, 0)), 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)


def measure_law(
    bs: tuple[float, ...],
    kappas: tuple[float, ...],
    depths: tuple[float, ...],
    device: str,
    bounds: Mapping[str, tuple[float, float]] = probes.LAW_BOUNDS,
) -> list[Measurement]:
    """Relative error of f, its derivatives and the four kernels.

    Args:
        bs: exponents b in (-0.98, 1].
        kappas: > 0.
        depths: mean optical depths u > 0; u = 0 is measured too, where Tr must be 1.
        device: to evaluate on.
        bounds: c and d of each function, for a bound c + d f(u).

    Returns:
        Relative errors over (b, kappa, u), and |Tr(0) - 1| over (b, kappa).
    """
    axes = (Axis("b", bs), Axis("kappa", kappas), Axis("u", depths))
    b, kappa, u = _in_float32(axes)
    found = probes.eval_law(b, kappa, u, device)
    with np.errstate(all="ignore"):
        expected = {name: getattr(kernels, name)(b, kappa, u) for name in bounds}
        exponent = kernels.line_exponent(b, kappa, u)
    measured = []
    for name, (constant, per_exponent) in bounds.items():
        values = _relative_error(found[name], expected[name])
        if name in ("transmittance_ms", "density_mm"):
            values = np.where(b < 0, np.nan, values)
        measured.append(Measurement(f"relative error of {name}", axes, values, constant + per_exponent * exponent))
    start = probes.eval_law(b[..., 0], kappa[..., 0], 0.0, device)["transmittance_ss"].astype(np.float64)
    return [*measured, Measurement("error of Tr(0) = 1", axes[:2], np.abs(start - 1), 0.0)]


def measure_flights(bs: tuple[float, ...], kappas: tuple[float, ...], draws: int, device: str) -> list[Measurement]:
    """Flights from the same numbers as their float64 twins, the least and the largest of those numbers among them.

    Args:
        bs: exponents b in (-0.98, 1].
        kappas: > 0.
        draws: for each law.
        device: to evaluate on.

    Returns:
        Relative errors over (b, kappa), the largest of the draws, and the share of flights that escape.
    """
    axes = (Axis("b", bs), Axis("kappa", kappas))
    xi = np.random.default_rng(1).random((draws, 3)).astype(np.float32).astype(np.float64)
    xi[:2] = [[LEAST_UNIFORM] * 3, [LARGEST_UNIFORM] * 3]
    xi = np.clip(xi, LEAST_UNIFORM, LARGEST_UNIFORM)
    b, kappa = (grid[..., None] for grid in _in_float32(axes))
    found = probes.sample_law(b, kappa, np.broadcast_to(xi, (len(bs), len(kappas), draws, 3)), device)
    with np.errstate(all="ignore"):
        flights = kernels.sample_sm(b, kappa, xi[:, 0])
        composed = kernels.sample_mm(b, kappa, *xi.T)
        # For b = 1 the device has a closed form, which takes a single number.
        closed = np.expm1(-np.log(xi[:, 0]) * kappa / (1 + kappa)) / kappa
    correlated = np.where(b < 0, np.nan, np.where(b == 1, closed, composed))
    errors = {
        "sample_sm": _flight_error(found["sample_sm"], flights),
        "sample_mm": np.where(b < 0, np.nan, _flight_error(found["sample_mm"], correlated)),
    }
    with np.errstate(divide="ignore"):
        measured = [
            Measurement(
                f"relative error of {name}",
                axes,
                _largest(errors[name]),
                constant + np.where(b > 0, per_b / b, 0.0)[..., 0] if per_b else constant,
            )
            for name, (constant, per_b) in probes.FLIGHT_BOUNDS.items()
        ]
    escaped = (flights >= probes.FLIGHT_LONGEST).mean(axis=-1)
    return [*measured, Measurement("share of flights that escape", axes, escaped)]


def measure_exact_fbm(grid: ExactGrid, draws: int, device: str) -> list[Measurement]:
    """The law with the exact variance of fractional Brownian motion, as far as Tr falls, and its flights.

    Args:
        grid: of its parameters.
        draws: flights of each law.
        device: to evaluate on.

    Returns:
        Relative errors of the law over the grid, and the largest error of the flights as a share of its bound, over the
        grid without its lengths.
    """
    axes = (
        Axis("H", grid.hursts),
        Axis("kappa", grid.kappas),
        Axis("sigma_m L", grid.outer_depths),
        Axis("t/L", grid.lengths),
    )
    lengths = np.array(grid.lengths)
    shape = tuple(len(axis.values) for axis in axes)
    bounds = probes.EXACT_FBM_BOUNDS
    errors, limits = ({name: np.full(shape, np.nan) for name in bounds} for _ in range(2))
    flights = {name: np.full(shape[:3], np.nan) for name in probes.FLIGHT_BOUNDS}
    xi = np.clip(np.random.default_rng(1).random(draws).astype(np.float32), LEAST_UNIFORM, LARGEST_UNIFORM)
    xi[:2] = LEAST_UNIFORM, LARGEST_UNIFORM
    for place, (hurst, kappa, outer_depth) in zip(
        np.ndindex(shape[:3]), itertools.product(grid.hursts, grid.kappas, grid.outer_depths), strict=True
    ):
        line = ExactFbm(hurst, kappa, outer_depth)
        farthest = fbm.falls_until(line)
        falls = lengths * outer_depth <= farthest * (1 - 1e-6)
        u = (lengths[falls] * outer_depth).astype(np.float32).astype(np.float64)
        for name, error in _exact_fbm_errors(line, u, device).items():
            constant, per_exponent = bounds[name]
            errors[name][place][falls] = error
            limits[name][place][falls] = constant + per_exponent * fbm.line_exponent(line, u)
        for name, from_medium in (("sample_sm", False), ("sample_mm", True)):
            found = probes.sample_exact_fbm(line, farthest, xi, from_medium=from_medium, device=device)
            flights[name][place] = _exact_fbm_flight_share(line, farthest, xi, found, from_medium)
    return [
        *(Measurement(f"relative error of {name}", axes, errors[name], limits[name]) for name in bounds),
        *(Measurement(f"error of xi at {name}, share of the bound", axes[:3], flights[name], 1.0) for name in flights),
    ]


def _exact_fbm_errors(line: ExactFbm, u: np.ndarray, device: str) -> dict[str, np.ndarray]:
    found, kernels_of_line = probes.eval_exact_fbm(line, u, device), fbm.eval_kernels(line, u)
    d1, d2 = fbm.line_exponent_d1(line, u), fbm.line_exponent_d2(line, u)
    errors = {
        "line_exponent": _relative_error(found["line_exponent"], fbm.line_exponent(line, u)),
        "line_exponent_d1": _relative_error(found["line_exponent_d1"], d1),
        "line_exponent_d2": np.abs(found["line_exponent_d2"] - d2) / np.maximum(np.abs(d2), d1**2),
    }
    rest = [name for name in probes.EXACT_FBM_BOUNDS if name not in errors]
    return errors | {name: _relative_error(found[name], getattr(kernels_of_line, name)) for name in rest}


def _exact_fbm_flight_share(
    line: ExactFbm, farthest: float, xi: np.ndarray, flights: np.ndarray, from_medium: bool
) -> float:
    """The largest error of xi, at the survival of the flight, over what the flight's stated error makes of it."""
    u = flights.astype(np.float64)
    escaped = u >= probes.FLIGHT_LONGEST
    values = fbm.eval_kernels(line, np.where(escaped, farthest, u))
    survival = values.transmittance_ms if from_medium else values.transmittance_ss
    density = values.density_mm if from_medium else values.density_sm
    allowed = np.where(
        escaped,
        probes.EXACT_FBM_ESCAPE_BOUND * survival,
        probes.EXACT_FBM_FLIGHT_BOUND * u * density + probes.EXACT_FBM_UNIFORM_BOUND,
    )
    error = np.where(escaped, np.maximum(xi - survival, 0.0), np.abs(survival - xi))
    return float(np.max(error / allowed))


def measure_phase(asymmetries: tuple[float, ...], device: str) -> list[Measurement]:
    """Phase functions: values, lengths of sampled directions, and the angle that Henyey-Greenstein samples.

    Args:
        asymmetries: g in (-1, 1).
        device: to evaluate on.

    Returns:
        Over (phase function, 1 - cos), (phase function, xi) and (|g|, xi).
    """
    v, xi = np.array(ANGLES), np.array(UNIFORMS, dtype=np.float32)
    cases = _phase_cases(asymmetries)
    errors, bounds, lengths = [], [], []
    for kind, parameters, value in cases.values():
        rounded = {name: float(np.float32(parameter)) for name, parameter in parameters.items()}
        expected = value(v, **rounded)
        errors.append(_relative_error(probes.eval_phase({kind}, rounded, AXIS, _directions(v), device), expected))
        bounds.append(probes.HG_BOUND + _change_by_rounding(value, rounded, v) / expected)
        sampled = probes.sample_phase({kind}, rounded, AXIS, np.stack([xi, xi[::-1]], axis=1), device)
        lengths.append(np.abs(np.linalg.norm(sampled.astype(np.float64), axis=1) - 1))
    sizes = tuple(sorted({abs(g) for g in asymmetries}))
    cosines = [
        _relative_error(probes.sample_hg_one_minus_cos(g, xi, device), phase.sample_hg_one_minus_cos(g, xi))
        for g in np.array(sizes, dtype=np.float32).astype(np.float64).tolist()
    ]
    case, uniform = Axis("phase function", tuple(cases)), Axis("xi", UNIFORMS)
    return [
        Measurement(
            "relative error of eval_phase", (case, Axis("1 - cos", ANGLES)), np.array(errors), np.array(bounds)
        ),
        Measurement("error of the length of sample_phase", (case, uniform), np.array(lengths), probes.DIRECTION_BOUND),
        Measurement(
            "relative error of sample_hg_one_minus_cos",
            (Axis("|g|", sizes), uniform),
            np.array(cosines),
            probes.HG_COSINE_BOUND,
        ),
    ]


def _phase_cases(asymmetries: tuple[float, ...]) -> dict[str, tuple[str, dict[str, float], Callable[..., np.ndarray]]]:
    """By label: the kind, its parameters, and its value in float64 at 1 - cos, which comes first."""
    cases: dict[str, tuple[str, dict[str, float], Callable[..., np.ndarray]]] = {
        "isotropic": ("isotropic", {}, lambda v: np.full_like(v, 1 / (4 * np.pi)))
    }
    for g in asymmetries:
        cases[f"hg {g:g}"] = ("hg", {"asymmetry": g}, lambda v, asymmetry: phase.eval_hg(asymmetry, v))
    for weight in (0.0, 0.5, 1.0):
        lobes = {"asymmetry": max(asymmetries), "back_asymmetry": min(asymmetries), "back_weight": weight}
        cases[f"two_lobe {weight:g}"] = (
            "two_lobe",
            lobes,
            lambda v, asymmetry, back_asymmetry, back_weight: phase.eval_two_lobe(
                asymmetry, back_asymmetry, back_weight, v
            ),
        )
    for g, alpha in itertools.product((min(asymmetries), 0.0, max(asymmetries)), (1.0, phase.DRAINE_ALPHA_MAX)):
        cases[f"draine {g:g}, {alpha:g}"] = (
            "draine",
            {"asymmetry": g, "draine_alpha": alpha},
            lambda v, asymmetry, draine_alpha: phase.eval_draine(asymmetry, draine_alpha, v),
        )
    return cases


def _in_float32(axes: tuple[Axis, ...]) -> list[np.ndarray]:
    """The grid of parameters as the device holds them: their rounding is not an error of its functions."""
    values = [np.array(axis.values, dtype=np.float32).astype(np.float64) for axis in axes]
    return list(np.meshgrid(*values, indexing="ij"))


def _relative_error(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """NaN where float32 cannot hold the expected value; what counts as zero must be found as zero."""
    found = found.astype(np.float64)
    with np.errstate(all="ignore"):
        error = np.abs(found / expected - 1)
        is_zero = np.abs(expected) <= probes.LAW_ZERO
        error = np.where(is_zero, np.where(np.abs(found) <= 2 * probes.LAW_ZERO, 0.0, np.inf), error)
        error = np.where(np.isfinite(error), error, np.inf)
        return np.where(np.abs(expected) < np.finfo(np.float32).max, error, np.nan)


def _flight_error(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """NaN where the flight is zero or has escaped, as it must have on the device."""
    found = found.astype(np.float64)
    with np.errstate(all="ignore"):
        error = np.abs(found / expected - 1)
    error = np.where(np.isfinite(error), error, np.inf)
    escaped, vanished = expected >= probes.FLIGHT_LONGEST, expected <= probes.FLIGHT_SHORTEST
    agree = np.where(escaped, found >= probes.FLIGHT_LONGEST / 10, found <= 10 * probes.FLIGHT_SHORTEST)
    return np.where(escaped | vanished, np.where(agree, np.nan, np.inf), error)


def _largest(errors: np.ndarray) -> np.ndarray:
    """Over the draws; 0 where all flights were zero or had escaped."""
    return np.where(np.isnan(errors), 0.0, errors).max(axis=-1)


def _directions(one_minus_cos: np.ndarray) -> np.ndarray:
    """(n, 3) float64, at these angles from `AXIS`."""
    across = np.cross(AXIS, [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    sine = np.sqrt(one_minus_cos * (2 - one_minus_cos))
    return AXIS * (1 - one_minus_cos)[:, None] + across * sine[:, None]


def _change_by_rounding(
    value: Callable[..., np.ndarray], parameters: Mapping[str, float], one_minus_cos: np.ndarray
) -> np.ndarray:
    """Of a phase function where an angle is off by `ANGLE_ROUNDING`: directions are float32 themselves."""
    angle = 2 * np.arcsin(np.sqrt(one_minus_cos / 2))
    nearby = [value(2 * np.sin((angle + off) / 2) ** 2, **parameters) for off in (-ANGLE_ROUNDING, ANGLE_ROUNDING)]
    return np.abs(nearby - value(one_minus_cos, **parameters)).max(axis=0)
