"""Kernels that evaluate the device's functions over arrays, for the contract tests; those of media are in `probes`."""

from dataclasses import dataclass
from functools import cache

import numpy as np
import warp as wp

from fgf_warp.device import bvh, lights, rng, surfaces
from fgf_warp.device.geometry import MISS, Hit, Solid, Start, build_intersect_solids
from fgf_warp.device.numerics import INFINITE
from fgf_warp.device.options import kernel_options
from fgf_warp.integrator.kinds import LIGHT_KINDS
from fgf_warp.upload import build_device_meshes, upload_solids

wp.set_module_options(kernel_options(meshes=True))


@dataclass(frozen=True)
class TreeFeatures:
    """Of `RenderFeatures` those that the traversal is built for."""

    faces: bool = False
    instances: bool = False
    solids_in_tree: bool = False
    motion: bool = False
    links: bool = False
    passes: bool = False
    shaped_lights: frozenset[str] = frozenset()


PLAIN = TreeFeatures()
RICH = TreeFeatures(True, True, True, True, True, True, frozenset({"mesh"}))


@wp.kernel
def sample_diffuse_kernel(n: wp.vec3, xi: wp.array(dtype=wp.vec2), out: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    out[i] = surfaces.sample_diffuse(n, xi[i][0], xi[i][1])


ALL_LIGHTS = frozenset(LIGHT_KINDS.values())
intersect_lights, sample_any_light, any_light_pdf, any_radiance = lights.build_lights(ALL_LIGHTS, True, True)


@wp.kernel
def sample_light_kernel(
    light: wp.array(dtype=lights.Light),
    tables: lights.LightTables,
    position: wp.vec3,
    normal: wp.vec3,
    xi: wp.array(dtype=wp.vec2),
    direction: wp.array(dtype=wp.vec3),
    out: wp.array2d(dtype=float),
):
    i = wp.tid()
    s = sample_any_light(light[0], tables, position, xi[i][0], xi[i][1])
    hit = Hit()
    hit.normal = normal
    point = position + s.direction * wp.min(s.distance, 1.0e30)
    direction[i] = s.direction
    out[0, i] = s.pdf_solid_angle
    out[1, i] = any_light_pdf(light[0], tables, hit, position, point, s.direction)
    out[2, i] = s.distance
    out[3, i] = s.radiance[0]


@wp.kernel
def intersect_light_kernel(
    light: wp.array(dtype=lights.Light),
    tables: lights.LightTables,
    position: wp.vec3,
    direction: wp.array(dtype=wp.vec3),
    out: wp.array2d(dtype=float),
):
    i = wp.tid()
    hit = Hit()
    hit.t = INFINITE
    hit.kind = MISS
    hit = intersect_lights(light, position, direction[i], hit)
    if hit.kind != MISS or light[0].kind == lights.DOME or lights.is_in_distant_light(light[0], direction[i]):
        point = position + direction[i] * wp.min(hit.t, 1.0e30)
        out[0, i] = any_light_pdf(light[0], tables, hit, position, point, direction[i])
        out[1, i] = any_radiance(light[0], tables, hit, point, direction[i])[0]


@wp.kernel
def philox_kernel(seed: wp.uint64, counter: wp.array(dtype=wp.vec4ui), out: wp.array(dtype=wp.vec4ui)):
    i = wp.tid()
    c = counter[i]
    out[i] = rng.philox(seed, c[0], c[1], c[2], c[3])


@wp.kernel
def independent_kernel(seed: wp.uint64, bounce: int, purpose: int, out: wp.array2d(dtype=wp.vec4)):
    pixel, sample = wp.tid()
    sample_index = wp.int32(rng.reverse_bits(wp.uint32(sample)))
    out[pixel, sample] = rng.draw_independent(seed, pixel, sample_index, bounce, purpose)


@wp.kernel
def lattice_kernel(seed: wp.uint64, bounce: int, purpose: int, out: wp.array2d(dtype=wp.vec4)):
    pixel, sample = wp.tid()
    sample_index = wp.int32(rng.reverse_bits(wp.uint32(sample)))
    if purpose == rng.CAMERA:
        shift = rng.pixel_shift(seed, pixel)
        xi = rng.draw_in_pixel(wp.int32(shift[0]), wp.int32(shift[1]), sample_index)
        out[pixel, sample] = wp.vec4(xi[0], xi[1], 0.0, 0.0)
    else:
        out[pixel, sample] = rng.draw_lattice(seed, pixel, sample_index, bounce, purpose)


@cache
def intersect_kernel(features, tries_solids):
    intersect_meshes, intersect_solids = bvh.build_intersect_meshes(features), build_intersect_solids(features)

    @wp.kernel(module="unique", module_options=kernel_options(meshes=True))
    def kernel(
        trees: wp.array(dtype=bvh.Bvh),
        solids: wp.array(dtype=Solid),
        origin: wp.array(dtype=wp.vec3),
        direction: wp.array(dtype=wp.vec3),
        start: Start,
        t: wp.array(dtype=float),
        kind: wp.array(dtype=int),
        item: wp.array(dtype=int),
        face: wp.array(dtype=int),
        u: wp.array(dtype=float),
        v: wp.array(dtype=float),
        normal: wp.array(dtype=wp.vec3),
    ):
        i = wp.tid()
        nearest = Hit()
        nearest.t = 1.0e30
        if wp.static(tries_solids):
            nearest = intersect_solids(solids, trees[0].motions, origin[i], direction[i], start, nearest)
        hit = intersect_meshes(trees, origin[i], direction[i], start, nearest)
        t[i] = wp.where(hit.kind == MISS, -1.0, hit.t)
        kind[i] = hit.kind
        item[i] = hit.item
        face[i] = hit.face
        u[i] = hit.u
        v[i] = hit.v
        normal[i] = hit.normal

    return kernel


@dataclass(frozen=True)
class MeshHits:
    """What rays meet: distances, -1 for a miss; kinds and items; triangles and places on them; normals."""

    t: np.ndarray
    kind: np.ndarray
    item: np.ndarray
    face: np.ndarray
    u: np.ndarray
    v: np.ndarray
    normal: np.ndarray


def hit_meshes(shapes, origin, direction, *, lights=(), kept=PLAIN, inside=0, tried=(), **start) -> MeshHits:
    """What rays meet of meshes and `tried` solids, by the traversal that is built for the features `kept`."""
    tree, solids = build_device_meshes([*shapes, *tried], lights, "cpu"), upload_solids(tried, [*shapes, *tried], "cpu")
    begin = Start()
    begin.inside, begin.crossed = inside, -1
    for key, value in start.items():
        setattr(begin, key, value)
    rays = [wp.array(np.asarray(x, dtype=np.float32), dtype=wp.vec3, device="cpu") for x in (origin, direction)]
    dtypes = (float, int, int, int, float, float, wp.vec3)
    found = [wp.zeros(len(rays[0]), dtype=dtype, device="cpu") for dtype in dtypes]
    kernel = intersect_kernel(kept, bool(tried))
    wp.launch(
        kernel,
        dim=len(rays[0]),
        inputs=[wp.array([tree], dtype=bvh.Bvh, device="cpu"), solids, *rays, begin],
        outputs=found,
        device="cpu",
    )
    return MeshHits(*(array.numpy() for array in found))


def cast_on_meshes(meshes, origin, direction, inside: int = 0):
    """Distances, -1 for a miss, and normals, at which rays meet meshes."""
    hits = hit_meshes(meshes, origin, direction, inside=inside)
    return hits.t, hits.normal
