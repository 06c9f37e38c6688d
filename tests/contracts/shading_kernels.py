"""Kernels that evaluate the device's surfaces and textures over arrays, for the contract tests."""

import numpy as np
import warp as wp

from fgf_warp.device import bsdf, textures
from fgf_warp.device.options import kernel_options
from fgf_warp.scene import Texture
from fgf_warp.theory import bsdf as theory
from fgf_warp.upload import AlbedoTables, TextureRows

wp.set_module_options(kernel_options(meshes=True))


@wp.kernel
def eval_bsdf_kernel(
    tables: wp.array(dtype=float),
    raw: bsdf.Bsdf,
    wo: wp.vec3,
    wi: wp.array(dtype=wp.vec3),
    value: wp.array(dtype=wp.vec4),
    passes: wp.array(dtype=wp.vec4),
):
    i = wp.tid()
    made = bsdf.prepare_bsdf(tables, raw, wo)
    value[i] = bsdf.eval_bsdf(tables, made, wi[i])
    passes[i] = wp.vec4(made.passes[0], made.passes[1], made.passes[2], made.p_pass)


@wp.kernel
def sample_bsdf_kernel(
    tables: wp.array(dtype=float),
    raw: bsdf.Bsdf,
    wo: wp.vec3,
    xi: wp.array(dtype=wp.vec4),
    wi: wp.array(dtype=wp.vec3),
    weight: wp.array(dtype=wp.vec3),
    pdf: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    made = bsdf.prepare_bsdf(tables, raw, wo)
    s = bsdf.sample_bsdf(tables, made, xi[i])
    wi[i] = s.wi
    weight[i] = s.weight
    pdf[i] = wp.vec3(s.pdf, float(s.is_delta), float(s.transmits))


@wp.kernel
def read_texture_kernel(
    rows: textures.Textures, st: wp.array(dtype=wp.vec2), image: wp.array(dtype=int), rgba: wp.array(dtype=wp.vec4)
):
    i = wp.tid()
    texture = rows.textures[0]
    image[i] = textures.tile_at(rows, texture, st[i])
    rgba[i] = texture.fallback
    if image[i] >= 0:
        rgba[i] = textures.read_texture(rows, texture, image[i], st[i])


def device_bsdf(surface: theory.Bsdf, normal=(0.0, 0.0, 1.0)):
    """The tables, and the surface before `prepare_bsdf`."""
    tables, made = AlbedoTables(), bsdf.Bsdf()
    made.normal = made.facet = wp.vec3(*normal)
    made.diffuse, made.metallic = wp.vec3(*surface.diffuse), surface.metallic
    made.specular, made.is_specular = wp.vec3(*(surface.specular or (0, 0, 0))), surface.specular is not None
    made.roughness, made.clearcoat = surface.roughness, surface.clearcoat
    made.clearcoat_roughness, made.ior = surface.clearcoat_roughness, surface.ior
    made.fade, made.cover = surface.fade, surface.cover
    made.dielectric = tables.add_dielectric(surface.ior)
    if surface.eta is not None:
        made.eta = surface.eta
        made.front, made.back = tables.add_glass(surface.eta), tables.add_glass(1 / surface.eta)
    return tables.upload("cpu"), made


def eval_bsdf(surface: theory.Bsdf, wo, wi):
    """(n, 3) values, (n,) pdfs, and (4,) what passes straight with its probability."""
    tables, made = device_bsdf(surface)
    directions = wp.array(np.asarray(wi, dtype=np.float32).reshape(-1, 3), dtype=wp.vec3, device="cpu")
    value, passes = (wp.zeros(len(directions), dtype=wp.vec4, device="cpu") for _ in range(2))
    inputs = [tables, made, wp.vec3(*wo), directions]
    wp.launch(eval_bsdf_kernel, dim=len(directions), inputs=inputs, outputs=[value, passes], device="cpu")
    found = value.numpy().astype(np.float64)
    return found[:, :3], found[:, 3], passes.numpy()[0].astype(np.float64)


def sample_bsdf(surface: theory.Bsdf, wo, xi):
    """(n, 3) directions, (n, 3) weights, and (n, 3) rows of pdf, whether it is a mirror's, whether it transmits."""
    tables, made = device_bsdf(surface)
    numbers = wp.array(np.asarray(xi, dtype=np.float32), dtype=wp.vec4, device="cpu")
    out = [wp.zeros(len(numbers), dtype=wp.vec3, device="cpu") for _ in range(3)]
    inputs = [tables, made, wp.vec3(*wo), numbers]
    wp.launch(sample_bsdf_kernel, dim=len(numbers), inputs=inputs, outputs=out, device="cpu")
    return tuple(array.numpy().astype(np.float64) for array in out)


def read_texture(texture: Texture, st):
    """(n,) indices of images, -1 for the fallback, and (n, 4) RGBA."""
    rows = TextureRows()
    rows.add(texture)
    places = wp.array(np.asarray(st, dtype=np.float32), dtype=wp.vec2, device="cpu")
    image = wp.zeros(len(places), dtype=int, device="cpu")
    rgba = wp.zeros(len(places), dtype=wp.vec4, device="cpu")
    wp.launch(
        read_texture_kernel, dim=len(places), inputs=[rows.upload("cpu"), places], outputs=[image, rgba], device="cpu"
    )
    return image.numpy(), rgba.numpy().astype(np.float64)
