"""Kernels that evaluate the device's functions over arrays, for the contract tests."""

from functools import cache

import numpy as np
import warp as wp

from fgf_warp.device import bvh, law, lights, phase, rng, surfaces
from fgf_warp.device.geometry import MISS, Hit, Start
from fgf_warp.device.law import Law
from fgf_warp.device.options import kernel_options
from fgf_warp.device.phase import Phase
from fgf_warp.theory.law import LineLaw
from fgf_warp.upload import build_device_law, build_device_meshes

wp.set_module_options(kernel_options(meshes=True))


@wp.kernel
def eval_law_kernel(laws: wp.array(dtype=Law), u: wp.array(dtype=float), out: wp.array2d(dtype=float)):
    i = wp.tid()
    out[0, i] = law.line_exponent(laws[i], u[i])
    out[1, i] = law.line_exponent_d1(laws[i], u[i])
    out[2, i] = law.line_exponent_d2(laws[i], u[i])
    out[3, i] = law.transmittance_ss(laws[i], u[i])
    out[4, i] = law.density_sm(laws[i], u[i])
    if laws[i].b >= 0.0:
        out[5, i] = law.transmittance_ms(laws[i], u[i])
        out[6, i] = law.density_mm(laws[i], u[i])


LAW_FUNCTIONS = (
    "line_exponent",
    "line_exponent_d1",
    "line_exponent_d2",
    "transmittance_ss",
    "density_sm",
    "transmittance_ms",
    "density_mm",
)


@wp.kernel
def eval_ratio_kernel(y: wp.array(dtype=float), out: wp.array2d(dtype=float)):
    i = wp.tid()
    out[0, i] = law.log1p_ratio(y[i])
    out[1, i] = law.log1p_ratio_slope(y[i])


@wp.kernel
def sample_law_kernel(
    laws: wp.array(dtype=Law),
    xi: wp.array(dtype=wp.vec3),
    out: wp.array2d(dtype=float),
):
    i = wp.tid()
    one = laws[i % laws.shape[0]]
    out[0, i] = law.sample_sm(one, xi[i][0])
    if one.b >= 0.0:
        out[1, i] = law.sample_mm(one, xi[i][0], xi[i][1], xi[i][2])


@cache
def phase_kernels(kinds: frozenset[str]):
    """Kernels of `eval_phase` and `sample_phase` of a scene with these kinds of phase functions."""
    eval_phase, sample_phase = phase.build_phase(kinds)

    @wp.kernel(module="unique", module_options=kernel_options(meshes=False))
    def eval_phase_kernel(one: Phase, w: wp.vec3, wi: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = eval_phase(one, w, wi[i])

    @wp.kernel(module="unique", module_options=kernel_options(meshes=False))
    def sample_phase_kernel(one: Phase, w: wp.vec3, xi: wp.array(dtype=wp.vec2), out: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        out[i] = sample_phase(one, w, xi[i][0], xi[i][1])

    return eval_phase_kernel, sample_phase_kernel


@wp.kernel
def sample_hg_cosine_kernel(g: float, xi: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = phase.sample_hg_one_minus_cos(g, xi[i])


@wp.kernel
def sample_draine_cosine_kernel(g: float, alpha: float, xi: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = phase.sample_draine_one_minus_cos(g, alpha, xi[i])


@wp.kernel
def choose_lobe_kernel(weight: float, xi: wp.array(dtype=float), out: wp.array(dtype=wp.vec2)):
    i = wp.tid()
    lobe, place = phase.choose_lobe(0.0, 1.0, weight, xi[i])
    out[i] = wp.vec2(lobe, place)


@wp.kernel
def sample_diffuse_kernel(n: wp.vec3, xi: wp.array(dtype=wp.vec2), out: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    out[i] = surfaces.sample_diffuse(n, xi[i][0], xi[i][1])


@wp.kernel
def sample_light_kernel(
    light: wp.array(dtype=lights.Light),
    position: wp.vec3,
    xi: wp.array(dtype=wp.vec2),
    direction: wp.array(dtype=wp.vec3),
    out: wp.array2d(dtype=float),
):
    i = wp.tid()
    s = lights.sample_light(light[0], light[0].kind, position, xi[i][0], xi[i][1])
    direction[i] = s.direction
    out[0, i] = s.pdf_solid_angle
    out[1, i] = lights.light_pdf(light[0], light[0].kind, position, position + s.direction * s.distance, s.direction)
    out[2, i] = s.distance


@wp.kernel
def philox_kernel(seed: wp.uint64, counter: wp.array(dtype=wp.vec4ui), out: wp.array(dtype=wp.vec4ui)):
    i = wp.tid()
    c = counter[i]
    out[i] = rng.philox(seed, c[0], c[1], c[2], c[3])


@wp.kernel
def independent_kernel(seed: wp.uint64, bounce: int, purpose: int, out: wp.array2d(dtype=wp.vec4)):
    pixel, sample = wp.tid()
    turn = wp.int32(rng.reverse_bits(wp.uint32(sample)))
    out[pixel, sample] = rng.draw_independent(seed, pixel, turn, bounce, purpose)


@wp.kernel
def lattice_kernel(seed: wp.uint64, bounce: int, purpose: int, out: wp.array2d(dtype=wp.vec4)):
    pixel, sample = wp.tid()
    turn = wp.int32(rng.reverse_bits(wp.uint32(sample)))
    if purpose == rng.CAMERA:
        shift = rng.pixel_shift(seed, pixel)
        xi = rng.draw_in_pixel(wp.int32(shift[0]), wp.int32(shift[1]), turn)
        out[pixel, sample] = wp.vec4(xi[0], xi[1], 0.0, 0.0)
    else:
        out[pixel, sample] = rng.draw_lattice(seed, pixel, turn, bounce, purpose)


def device_phase(asymmetry=0.0, back_asymmetry=0.0, back_weight=0.0, draine_alpha=0.0) -> Phase:
    """The device's phase function of these parameters."""
    result = Phase()
    result.asymmetry, result.back_asymmetry = asymmetry, back_asymmetry
    result.back_weight, result.draine_alpha = back_weight, draine_alpha
    return result


def device_laws(pairs, *, reciprocal: bool = True):
    """The device's laws of (b, kappa) pairs."""
    made = [
        build_device_law(LineLaw("pink", float(b), float(kappa), (b - 1) / 2, 1.0, None), reciprocal)
        for b, kappa in pairs
    ]
    return wp.array(made, dtype=Law, device="cpu")


def eval_law(pairs, u) -> dict[str, np.ndarray]:
    """Every function of the law at (b, kappa, u) triples."""
    laws = device_laws(pairs)
    out = wp.full((len(LAW_FUNCTIONS), len(u)), np.nan, dtype=float, device="cpu")
    wp.launch(eval_law_kernel, dim=len(u), inputs=[laws, _floats(u)], outputs=[out], device="cpu")
    return dict(zip(LAW_FUNCTIONS, out.numpy(), strict=True))


def eval_ratios(y) -> tuple[np.ndarray, np.ndarray]:
    """l and m at each y."""
    out = wp.zeros((2, len(y)), dtype=float, device="cpu")
    wp.launch(eval_ratio_kernel, dim=len(y), inputs=[_floats(y)], outputs=[out], device="cpu")
    return tuple(out.numpy())


def sample_law(pairs, xi) -> np.ndarray:
    """(2, n): sample_sm and sample_mm; law i mod len(pairs) takes the uniforms of row i, (n, 3)."""
    laws = device_laws(pairs)
    out = wp.full((2, len(xi)), np.nan, dtype=float, device="cpu")
    wp.launch(
        sample_law_kernel,
        dim=len(xi),
        inputs=[laws, wp.array(np.asarray(xi, dtype=np.float32), dtype=wp.vec3, device="cpu")],
        outputs=[out],
        device="cpu",
    )
    return out.numpy()


def _floats(values) -> wp.array:
    return wp.array(np.asarray(values, dtype=np.float32), dtype=float, device="cpu")


@wp.kernel(enable_backward=False, module="unique", module_options={"fuse_fp": False})
def meet_meshes_kernel(
    tree: bvh.Bvh,
    origin: wp.array(dtype=wp.vec3),
    direction: wp.array(dtype=wp.vec3),
    inside: wp.uint32,
    t: wp.array(dtype=float),
    normal: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    hit = Hit()
    hit.t = 1.0e30
    start = Start()
    start.inside = inside
    start.crossed = -1
    hit = bvh.intersect_meshes(tree, origin[i], direction[i], start, hit)
    t[i] = wp.where(hit.kind == MISS, -1.0, hit.t)
    normal[i] = hit.normal


def meet_meshes(meshes, origin, direction, inside: int = 0):
    """Distances, -1 for a miss, and normals, at which rays meet meshes."""
    containers = [mesh for mesh in meshes if mesh.medium is not None]
    tree = build_device_meshes(meshes, containers, "cpu")
    rays = [wp.array(np.asarray(x, dtype=np.float32), dtype=wp.vec3, device="cpu") for x in (origin, direction)]
    t = wp.zeros(len(rays[0]), dtype=float, device="cpu")
    normal = wp.zeros(len(rays[0]), dtype=wp.vec3, device="cpu")
    wp.launch(
        meet_meshes_kernel,
        dim=len(rays[0]),
        inputs=[tree, *rays, wp.uint32(inside)],
        outputs=[t, normal],
        device="cpu",
    )
    return t.numpy(), normal.numpy()
