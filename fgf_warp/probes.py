"""The device's law and phase functions over arrays, for whoever compares them with their float64 twins in `theory`."""

from collections.abc import Collection, Mapping
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from fgf_warp.device import fbm, law, phase
from fgf_warp.device.law import Law
from fgf_warp.device.options import kernel_options
from fgf_warp.device.phase import Phase
from fgf_warp.device.tables import Table, draw_from
from fgf_warp.theory.fbm import ExactFbm
from fgf_warp.theory.law import LineLaw
from fgf_warp.theory.mixture import RateMixture
from fgf_warp.upload import LawTables, build_device_law

wp.set_module_options(kernel_options(meshes=False))

LAW_BOUNDS = {
    "line_exponent": (1e-5, 0.0),
    "line_exponent_d1": (1e-5, 0.0),
    "line_exponent_d2": (2e-5, 0.0),
    "transmittance_ss": (1e-6, 1e-5),
    "density_sm": (1e-5, 1e-5),
    "transmittance_ms": (1e-5, 1e-5),
    "density_mm": (2e-5, 1e-5),
}
"""The functions of `eval_law`, and the bounds that their docstrings state: relative error below c + d f(u)."""
LAW_ZERO = 2e-38
"""Values below it lose digits in float32, and count as zero."""
EXACT_FBM_BOUNDS = {
    "line_exponent": (1e-5, 0.0),
    "line_exponent_d1": (1e-4, 0.0),
    "line_exponent_d2": (1e-3, 0.0),
    "transmittance_ss": (1e-6, 1e-5),
    "density_sm": (1e-4, 1e-5),
    "transmittance_ms": (1e-4, 1e-5),
    "density_mm": (1e-3, 1e-5),
}
"""The functions of `eval_exact_fbm`, and the bounds of their relative error: below c + d f(u); that of f'' relative to
the larger of it and f'^2."""
EXACT_FBM_FLIGHT_BOUND, EXACT_FBM_UNIFORM_BOUND = 1e-3, 1e-6
"""Of a flight of `sample_exact_fbm`, relative; and of the uniform that it belongs to, by rounding."""
EXACT_FBM_ESCAPE_BOUND = 1e-4
"""Relative, of the uniform below which a flight escapes."""
FLIGHT_BOUNDS = {"sample_sm": (1.2e-4, 0.0), "sample_mm": (1.2e-4, 2e-6)}
"""The functions of `sample_law`, and the bounds of their relative error: below c + d/b.

A flight between medium vertices is drawn as u^b, so for small b its rounding grows as 1/b; but so does the width of
its distribution in ln u, and the distribution keeps its 6 digits.
"""
FLIGHT_SHORTEST, FLIGHT_LONGEST = 1e-30, 1e29
"""Flights beyond are zero or escaped in float32: legitimate, and counted rather than resolved."""
HG_BOUND, HG_COSINE_BOUND = 1e-5, 1e-6
"""Relative errors of `eval_phase` for exact directions, whatever the kind, and of `sample_hg_one_minus_cos`."""
DRAINE_BOUND, DRAINE_FORWARD_BOUND = 5e-7, 1e-6
"""Errors of the cdf at `sample_draine_one_minus_cos`: up to 90 degrees the latter, relative to xi, holds too."""
LOBE_BOUND = 4e-7
"""Error of the place in a lobe."""
DIRECTION_BOUND = 5e-7
"""Error of the length of sampled directions."""


@wp.kernel
def _eval_law(
    laws: wp.array(dtype=Law), which: wp.array(dtype=int), u: wp.array(dtype=float), out: wp.array2d(dtype=float)
):
    i = wp.tid()
    one = laws[which[i]]
    out[0, i] = law.line_exponent(one, u[i])
    out[1, i] = law.line_exponent_d1(one, u[i])
    out[2, i] = law.line_exponent_d2(one, u[i])
    out[3, i] = law.transmittance_ss(one, u[i])
    out[4, i] = law.density_sm(one, u[i])
    if one.b >= 0.0:
        out[5, i] = law.transmittance_ms(one, u[i])
        out[6, i] = law.density_mm(one, u[i])


@wp.kernel
def _eval_ratios(y: wp.array(dtype=float), out: wp.array2d(dtype=float)):
    i = wp.tid()
    out[0, i] = law.log1p_ratio(y[i])
    out[1, i] = law.log1p_ratio_slope(y[i])


@wp.kernel
def _sample_law(
    laws: wp.array(dtype=Law), which: wp.array(dtype=int), xi: wp.array(dtype=wp.vec3), out: wp.array2d(dtype=float)
):
    i = wp.tid()
    one = laws[which[i]]
    out[0, i] = law.sample_sm(one, xi[i][0])
    if one.b >= 0.0:
        out[1, i] = law.sample_mm(one, xi[i][0], xi[i][1], xi[i][2])


@wp.kernel
def _eval_exact_fbm(laws: wp.array(dtype=Law), u: wp.array(dtype=float), out: wp.array2d(dtype=float)):
    i = wp.tid()
    one = laws[0]
    out[0, i] = fbm.line_exponent(one, u[i])
    out[1, i] = fbm.line_exponent_d1(one, u[i])
    out[2, i] = fbm.line_exponent_d2(one, u[i])
    out[3, i] = fbm.segment_transmittance(one, u[i], False)
    out[4, i] = fbm.flight_density(one, u[i], False)
    out[5, i] = fbm.segment_transmittance(one, u[i], True)
    out[6, i] = fbm.flight_density(one, u[i], True)


@wp.kernel
def _sample_exact_fbm(
    laws: wp.array(dtype=Law),
    tables: wp.array(dtype=wp.vec3),
    from_medium: bool,
    xi: wp.array(dtype=float),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    out[i] = fbm.sample_flight(laws[0], tables, xi[i], from_medium)


@wp.kernel
def _draw_rates(tables: wp.array(dtype=wp.vec3), table: Table, xi: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = draw_from(tables, table, xi[i])


@cache
def _phase_kernels(kinds: frozenset[str]):
    eval_phase, sample_phase = phase.build_phase(kinds)

    @wp.kernel(module="unique", module_options=kernel_options(meshes=False))
    def eval_kernel(one: Phase, w: wp.vec3, wi: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = eval_phase(one, w, wi[i])

    @wp.kernel(module="unique", module_options=kernel_options(meshes=False))
    def sample_kernel(one: Phase, w: wp.vec3, xi: wp.array(dtype=wp.vec2), out: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        out[i] = sample_phase(one, w, xi[i][0], xi[i][1])

    return eval_kernel, sample_kernel


@wp.kernel
def _sample_hg_one_minus_cos(g: float, xi: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = phase.sample_hg_one_minus_cos(g, xi[i])


@wp.kernel
def _sample_draine_one_minus_cos(g: float, alpha: float, xi: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = phase.sample_draine_one_minus_cos(g, alpha, xi[i])


@wp.kernel
def _choose_lobe(back_weight: float, xi: wp.array(dtype=float), out: wp.array2d(dtype=float)):
    i = wp.tid()
    lobe, place = phase.choose_lobe(0.0, 1.0, back_weight, xi[i])
    out[0, i] = lobe
    out[1, i] = place


def eval_law(b: ArrayLike, kappa: ArrayLike, u: ArrayLike, device: str = "cpu") -> dict[str, np.ndarray]:
    """Every function of the law.

    Args:
        b: exponents in (-0.98, 1], broadcastable with the others.
        kappa: >= 0.
        u: mean optical depths, >= 0.
        device: to evaluate on.

    Returns:
        float32 arrays of the broadcast shape, by the names in `LAW_BOUNDS`; NaN where b < 0 has no such kernel.
    """
    b, kappa, u = np.broadcast_arrays(b, kappa, u)
    laws, which = _device_laws(b.ravel(), kappa.ravel(), device)
    out = wp.full((len(LAW_BOUNDS), u.size), np.nan, dtype=float, device=device)
    wp.launch(
        _eval_law, dim=u.size, inputs=[laws, which, _array(u.ravel(), float, device)], outputs=[out], device=device
    )
    return dict(zip(LAW_BOUNDS, out.numpy().reshape(-1, *u.shape), strict=True))


def eval_ratios(y: ArrayLike, device: str = "cpu") -> tuple[np.ndarray, np.ndarray]:
    """l(y) and m(y) of the law, float32, at each y >= 0, (n,)."""
    out = wp.zeros((2, len(np.asarray(y))), dtype=float, device=device)
    wp.launch(_eval_ratios, dim=out.shape[1], inputs=[_array(y, float, device)], outputs=[out], device=device)
    value, slope = out.numpy()
    return value, slope


def sample_law(b: ArrayLike, kappa: ArrayLike, xi: ArrayLike, device: str = "cpu") -> dict[str, np.ndarray]:
    """Flights in mean optical depth.

    Args:
        b: exponents, broadcastable to the leading axes of `xi`.
        kappa: >= 0, likewise.
        xi: (..., 3) uniforms in (0, 1).
        device: to evaluate on.

    Returns:
        float32 arrays of the leading shape, by the names in `FLIGHT_BOUNDS`; NaN where b < 0 has no such flight.
    """
    xi = np.asarray(xi)
    shape = xi.shape[:-1]
    laws, which = _device_laws(np.broadcast_to(b, shape).ravel(), np.broadcast_to(kappa, shape).ravel(), device)
    out = wp.full((2, which.size), np.nan, dtype=float, device=device)
    uniforms = _array(xi.reshape(-1, 3), wp.vec3, device)
    wp.launch(_sample_law, dim=which.size, inputs=[laws, which, uniforms], outputs=[out], device=device)
    return dict(zip(FLIGHT_BOUNDS, out.numpy().reshape(2, *shape), strict=True))


def eval_exact_fbm(line: ExactFbm, u: ArrayLike, device: str = "cpu") -> dict[str, np.ndarray]:
    """Every function of the law with the exact variance, by the names in `LAW_BOUNDS`, (n,) float32, at u > 0, (n,)."""
    laws, _ = _device_exact_fbm(line, line.outer_depth * 1e-6, device)
    depths = _array(u, float, device)
    out = wp.zeros((len(LAW_BOUNDS), depths.size), dtype=float, device=device)
    wp.launch(_eval_exact_fbm, dim=depths.size, inputs=[laws, depths], outputs=[out], device=device)
    return dict(zip(LAW_BOUNDS, out.numpy(), strict=True))


def sample_exact_fbm(
    line: ExactFbm, farthest: float, xi: ArrayLike, *, from_medium: bool, device: str = "cpu"
) -> np.ndarray:
    """Its flights from uniforms (n,), (n,) float32; those beyond u = `farthest` have escaped."""
    laws, tables = _device_exact_fbm(line, farthest, device)
    uniforms = _array(xi, float, device)
    out = wp.zeros(uniforms.size, dtype=float, device=device)
    inputs = [laws, tables, from_medium, uniforms]
    wp.launch(_sample_exact_fbm, dim=out.size, inputs=inputs, outputs=[out], device=device)
    return out.numpy()


def draw_rates(mixture: RateMixture, xi: ArrayLike, device: str = "cpu") -> np.ndarray:
    """Rates of frozen paths from uniforms (n,), (n,) float32."""
    rows = LawTables()
    table = rows.add("rates", np.cumsum(mixture.weights), mixture.rates)
    uniforms = _array(xi, float, device)
    out = wp.zeros(uniforms.size, dtype=float, device=device)
    wp.launch(_draw_rates, dim=out.size, inputs=[rows.upload(device), table, uniforms], outputs=[out], device=device)
    return out.numpy()


def eval_phase(
    kinds: Collection[str], parameters: Mapping[str, float], w: ArrayLike, wi: ArrayLike, device: str = "cpu"
) -> np.ndarray:
    """A phase function, as in a kernel that is built for several.

    Args:
        kinds: of the phase functions in the kernel, as in `fgf_warp.scene.PHASE_FUNCTIONS`.
        parameters: of the one that is evaluated, by their names in `fgf_warp.scene.Medium`; the others are 0.
        w: (3,), the unit vector that the light travels along.
        wi: (n, 3), unit vectors that it is scattered to.
        device: to evaluate on.

    Returns:
        (n,) float32 [1/sr].
    """
    directions = _array(wi, wp.vec3, device)
    out = wp.zeros(directions.size, dtype=float, device=device)
    kernel, _ = _phase_kernels(frozenset(kinds))
    inputs = [_device_phase(parameters), wp.vec3(*np.asarray(w)), directions]
    wp.launch(kernel, dim=out.size, inputs=inputs, outputs=[out], device=device)
    return out.numpy()


def sample_phase(
    kinds: Collection[str], parameters: Mapping[str, float], w: ArrayLike, xi: ArrayLike, device: str = "cpu"
) -> np.ndarray:
    """Directions of a phase function around w, (n, 3) float32, from uniforms (n, 2); the rest is as in `eval_phase`."""
    uniforms = _array(xi, wp.vec2, device)
    out = wp.zeros(uniforms.size, dtype=wp.vec3, device=device)
    _, kernel = _phase_kernels(frozenset(kinds))
    inputs = [_device_phase(parameters), wp.vec3(*np.asarray(w)), uniforms]
    wp.launch(kernel, dim=out.size, inputs=inputs, outputs=[out], device=device)
    return out.numpy()


def sample_hg_one_minus_cos(g: float, xi: ArrayLike, device: str = "cpu") -> np.ndarray:
    """1 - cos(theta) of Henyey-Greenstein for 0 <= g < 1, (n,) float32, from uniforms (n,)."""
    uniforms = _array(xi, float, device)
    out = wp.zeros(uniforms.size, dtype=float, device=device)
    wp.launch(_sample_hg_one_minus_cos, dim=out.size, inputs=[g, uniforms], outputs=[out], device=device)
    return out.numpy()


def sample_draine_one_minus_cos(g: float, alpha: float, xi: ArrayLike, device: str = "cpu") -> np.ndarray:
    """1 - cos(theta) of Draine's phase function for 0 <= g < 1, (n,) float32, from uniforms (n,)."""
    uniforms = _array(xi, float, device)
    out = wp.zeros(uniforms.size, dtype=float, device=device)
    inputs = [g, alpha, uniforms]
    wp.launch(_sample_draine_one_minus_cos, dim=out.size, inputs=inputs, outputs=[out], device=device)
    return out.numpy()


def choose_lobe(back_weight: float, xi: ArrayLike, device: str = "cpu") -> tuple[np.ndarray, np.ndarray]:
    """0 or 1 for the first or the second lobe, and the place in it, (n,) float32 each, from uniforms (n,)."""
    uniforms = _array(xi, float, device)
    out = wp.zeros((2, uniforms.size), dtype=float, device=device)
    wp.launch(_choose_lobe, dim=uniforms.size, inputs=[back_weight, uniforms], outputs=[out], device=device)
    lobe, place = out.numpy()
    return lobe, place


def _device_phase(parameters: Mapping[str, float]) -> Any:
    result = Phase()
    for name, value in parameters.items():
        setattr(result, name, value)
    return result


def _device_laws(b: np.ndarray, kappa: np.ndarray, device: str) -> tuple[Any, Any]:
    """The different laws among these pairs, and which of them each pair is."""
    pairs, which = np.unique(np.stack([b, kappa], axis=1), axis=0, return_inverse=True)
    made = [
        build_device_law(LineLaw("pink", b, kappa, (b - 1) / 2, 1.0, None), reciprocal=True)
        for b, kappa in pairs.tolist()
    ]
    return wp.array(made, dtype=Law, device=device), _array(which.ravel(), int, device)


def _device_exact_fbm(line: ExactFbm, farthest: float, device: str) -> tuple[Any, Any]:
    """The law, and the tables that it looks up."""
    rows = LawTables()
    described = LineLaw("fbm", 1.0, line.kappa, line.hurst, 1.0, line.outer_depth, "exact")
    made = build_device_law(described, reciprocal=True, rows=rows, longest_depth=farthest)
    return wp.array([made], dtype=Law, device=device), rows.upload(device)


def _array(values: ArrayLike, dtype: Any, device: str) -> Any:
    return wp.array(np.asarray(values, dtype=np.int32 if dtype is int else np.float32), dtype=dtype, device=device)
