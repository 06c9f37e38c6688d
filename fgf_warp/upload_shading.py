"""Surfaces from a scene to the device: materials, textures, primvars, and tables of albedos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Any

import numpy as np
import warp as wp

from fgf_warp.device import shading, textures
from fgf_warp.scene import (
    WRAPS,
    ColorInput,
    FloatInput,
    Image,
    Instances,
    Mesh,
    PrimvarInput,
    Shape,
    Solid,
    Surface,
    Texture,
    TextureInput,
    count_of,
)
from fgf_warp.theory import bsdf as theory
from fgf_warp.upload_instances import is_open, mesh_of, number_surfaces, upload_structs

CHANNELS = {"rgb": -1, "r": 0, "g": 1, "b": 2, "a": 3}
INPUTS = (
    "diffuse",
    "emission",
    "specular",
    "metallic",
    "roughness",
    "clearcoat",
    "clearcoat_roughness",
    "opacity",
    "normal",
)
"""Of a material, in the order in which the device has them."""
NO_VIEW = (-1, 0, 0, -1)


def build_device_shading(shapes: Sequence[Shape], containers: Sequence[Shape], device: str) -> Any:
    """The device's view of all surfaces.

    Args:
        shapes: whose surfaces there are; looks and instances are numbered in their order.
        containers: the shapes filled with media, in the order of their bits.
        device: where to put them.
    """
    shaded = [shape for shape in shapes if shape.surface is not None]
    rows = ShadingRows()
    instances = [shape for shape in shapes if mesh_of(shape)]
    instance_of: dict[Shape, int] = dict(zip(instances, accumulate(map(count_of, instances), initial=0), strict=False))
    item_of = number_surfaces(shapes)
    bit_of = {shape: bit for bit, shape in enumerate(containers) if is_open(shape)}
    looks = [rows.add_look(shape, item_of[shape]) for shape in shaded]
    result = rows.upload(device)
    result.looks = upload_structs(
        shading.Look,
        device,
        material=[material for material, _, _ in looks],
        views=[views for _, views, _ in looks],
        normals=[normals for _, _, normals in looks],
        item=[item_of[shape] for shape in shaded],
        instance=[instance_of.get(shape, -1) for shape in shaded],
        container=[bit_of.get(shape, -1) for shape in shaded],
    )
    tables = AlbedoTables()
    result.materials = rows.upload_materials(tables, device)
    iors = indices_of_refraction(containers)
    pairs = [tables.add_glass(beyond / before) for before in iors for beyond in iors]
    result.glass = wp.array(np.array(pairs, dtype=np.int32), dtype=int, device=device)
    result.glass_count = len(iors)
    result.albedos = tables.upload(device)
    return result


def indices_of_refraction(containers: Sequence[Shape]) -> list[float]:
    """Of empty space, and then the different ones of media that light is refracted into."""
    found = dict.fromkeys([1.0])
    found |= dict.fromkeys(s.surface.ior for s in containers if is_open(s) and s.surface is not None)
    return list(found)


class AlbedoTables:
    """Tables of directional albedo on their way to the device, block after block; of the same there is one."""

    def __init__(self) -> None:
        whole, tip = theory.ggx_albedo()
        self._blocks = [whole.values, tip.values, whole.averages, tip.averages]
        self._count = sum(block.size for block in self._blocks)
        self._found: dict[tuple[str, float], int] = {}

    def add_dielectric(self, ior: float) -> int:
        """Where the block of an opaque dielectric begins."""

        def blocks() -> list[np.ndarray]:
            (whole, tip), own = theory.ggx_albedo(), theory.dielectric_albedo(ior)
            products = [own.products(other) for other in (own, whole, tip)]
            return [own.values, own.averages, *products, np.array([theory.average_fresnel(ior)])]

        return self._add(("dielectric", ior), blocks)

    def add_glass(self, eta: float) -> int:
        """Where the block of glass begins; -1 where nothing is refracted."""
        if eta == 1:
            return -1
        albedo = theory.glass_albedo(eta)
        return self._add(("glass", eta), lambda: [albedo.values, albedo.averages])

    def _add(self, key: tuple[str, float], blocks: Any) -> int:
        if key not in self._found:
            made = blocks()
            self._found[key] = self._count
            self._blocks += made
            self._count += sum(block.size for block in made)
        return self._found[key]

    def upload(self, device: str) -> wp.array:
        """All numbers, one after the other."""
        values = np.concatenate([np.ravel(block) for block in self._blocks])
        return wp.array(values.astype(np.float32), dtype=float, device=device)


class ImageRows:
    """Images on their way to the device; of the same image there is one."""

    def __init__(self) -> None:
        self._images: dict[int, tuple[int, Image]] = {}

    def add(self, image: Image) -> int:
        """Index of the image."""
        return self._images.setdefault(id(image), (len(self._images), image))[0]

    def upload(self, device: str) -> Any:
        """The device's `Images`."""
        images = [image for _, image in self._images.values()]
        firsts, counts = [], {True: 0, False: 0}
        for image in images:
            is_float = image.pixels.dtype == np.float32
            firsts.append(counts[is_float])
            counts[is_float] += image.pixels.size // 4
        result = textures.Images()
        result.images = upload_structs(
            textures.Image,
            device,
            first=firsts,
            width=[image.pixels.shape[1] for image in images],
            height=[image.pixels.shape[0] for image in images],
            kind=[_texel_kind(image) for image in images],
        )
        result.texels = wp.array(_texels(images, np.uint8).view("<u4").ravel(), dtype=wp.uint32, device=device)
        result.float_texels = wp.array(_texels(images, np.float32), dtype=wp.vec4, device=device)
        result.decoded = wp.array(decoded_srgb().astype(np.float32), dtype=float, device=device)
        return result


def decoded_srgb() -> np.ndarray:
    """(256,) linear values of the bytes of sRGB (IEC 61966-2-1)."""
    encoded = np.arange(256) / 255
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def _texels(images: Sequence[Image], dtype: Any) -> np.ndarray:
    found = [image.pixels.reshape(-1, 4) for image in images if image.pixels.dtype == dtype]
    return np.ascontiguousarray(np.concatenate([np.zeros((0, 4), dtype), *found]))


def _texel_kind(image: Image) -> int:
    if image.pixels.dtype == np.float32:
        return int(textures.FLOATS)
    return int(textures.SRGB_BYTES if image.is_srgb else textures.BYTES)


class TextureRows:
    """Textures on their way to the device; of the same texture there is one."""

    def __init__(self) -> None:
        self.images = ImageRows()
        self._found: dict[int, int] = {}
        self._rows: list[Any] = []
        self._tiles: list[int] = []
        self._kept: list[Texture] = []

    def add(self, texture: Texture) -> int:
        """Index of the texture."""
        if id(texture) not in self._found:
            self._found[id(texture)] = len(self._rows)
            self._kept.append(texture)
            row = textures.Texture()
            row.first_tile = len(self._tiles)
            row.wrap_s, row.wrap_t = WRAPS.index(texture.wrap_s), WRAPS.index(texture.wrap_t)
            row.fallback = wp.vec4(*texture.fallback)
            if texture.is_udim:
                row.tile_rows = max((v for _, v in texture.tiles), default=0) + 1
                places = [(u, v) for v in range(row.tile_rows) for u in range(int(textures.UDIM_COLUMNS))]
            else:
                places = [(0, 0)]
            self._tiles += [self.images.add(texture.tiles[at]) if at in texture.tiles else -1 for at in places]
            self._rows.append(row)
        return self._found[id(texture)]

    def upload(self, device: str) -> Any:
        """The device's `Textures`."""
        result = textures.Textures()
        result.textures = wp.array(self._rows, dtype=textures.Texture, device=device)
        result.tiles = wp.array(np.array(self._tiles, dtype=np.int32), dtype=int, device=device)
        result.images = self.images.upload(device)
        return result


def _names_read(surface: Surface) -> list[str]:
    """Of the primvars that it reads; a texture that is read at one place has an empty one, which no shape has."""
    return sorted({value.primvar for value in surface.inputs})


_View = tuple[int, int, int, int]
"""The fields of `shading.View`."""


class ShadingRows:
    """Materials and what they read, on their way to the device; of the same surface or array there is one."""

    def __init__(self) -> None:
        self.textures = TextureRows()
        self._surfaces: dict[int, tuple[int, Surface]] = {}
        self._inputs: list[Any] = []
        self._views: list[_View] = [NO_VIEW]
        self._values: list[np.ndarray] = []
        self._count = 0
        self._view_of: dict[tuple, tuple[_View, Any]] = {}
        self._views_of: dict[tuple, tuple[int, int, Any]] = {}

    def add_look(self, shape: Shape, item: int) -> tuple[int, int, int]:
        """Its material, the first of its views, and the view of its normals or -1.

        Args:
            shape: that has a surface.
            item: what a hit of it, or of the first of its instances, tells.
        """
        assert shape.surface is not None
        material = self._add_surface(shape.surface)
        carrier: Solid | Mesh = shape.prototype if isinstance(shape, Instances) else shape
        own = shape.primvars if isinstance(shape, Instances) else {}
        reads = shape.surface.inputs or shape.surface.normal is not None
        normals = carrier.normals if isinstance(carrier, Mesh) else None
        if not reads and normals is None:
            return material, 0, -1
        # A mesh is made anew for each surface that it is given, its arrays are not.
        key = (id(shape.surface), *_identities(carrier), id(normals), item if own else -1)
        if key not in self._views_of:
            views, at = self._views_of_shape(shape.surface, carrier, own, item), len(self._views)
            self._views += views
            normals_at = -1
            if normals is not None:
                normals_at = len(self._views)
                self._views.append(self._view(("normals", id(normals)), normals))
            self._views_of[key] = (at, normals_at, carrier)
        first, normals_at, _ = self._views_of[key]
        return material, first, normals_at

    def _views_of_shape(
        self, surface: Surface, carrier: Solid | Mesh, own: Mapping[str, np.ndarray], item: int
    ) -> list[_View]:
        found = [
            (*self._view(("instances", id(own[name])), own[name])[:3], item)
            if name in own
            else self._view_of_primvar(carrier.primvars, name)
            for name in _names_read(surface)
        ]
        if surface.normal is not None:
            found.append(self._view_of_tangents(surface.normal, carrier))
        return found

    def _view_of_primvar(self, primvars: Mapping[str, np.ndarray], name: str) -> _View:
        values = primvars.get(name)
        return NO_VIEW if values is None else self._view(("primvar", id(values)), values)

    def _view_of_tangents(self, normal: TextureInput, carrier: Solid | Mesh) -> _View:
        st = carrier.primvars.get(normal.primvar)
        if not isinstance(carrier, Mesh) or st is None or st.shape[1] != 3 or st.shape[2] < 2:
            return NO_VIEW
        key = ("tangents", id(st), id(carrier.points), id(carrier.triangles), normal.transform)
        if key in self._view_of:
            return self._view_of[key][0]
        return self._view(key, tangents(carrier, st, normal.transform), (carrier, st))

    def _view(self, key: tuple, values: np.ndarray, keeps: Any = None) -> _View:
        """Where values of the shape (k,), (1, 1, k), (m, 1, k) or (m, 3, k) are, or (n, k) of instances."""
        if key not in self._view_of:
            per_face = values.shape[1] if values.ndim == 3 and values.shape[:2] != (1, 1) else 0
            view = (self._count, values.shape[-1], per_face, -1)
            self._values.append(np.asarray(values, dtype=np.float32).ravel())
            self._count += values.size
            # What the key names must live as long as the key.
            self._view_of[key] = (view, values if keeps is None else keeps)
        return self._view_of[key][0]

    def _add_surface(self, surface: Surface) -> int:
        if id(surface) not in self._surfaces:
            self._surfaces[id(surface)] = (len(self._surfaces), surface)
            places = {name: place for place, name in enumerate(_names_read(surface))}
            self._inputs += [self._input(getattr(surface, name), places) for name in INPUTS]
        return self._surfaces[id(surface)][0]

    def _input(self, value: ColorInput | FloatInput | None, places: Mapping[str, int]) -> Any:
        row = shading.Input()
        if isinstance(value, PrimvarInput):
            row.kind, row.view = int(shading.PRIMVAR), places[value.primvar]
            row.value = _rgb(value.fallback)
        elif isinstance(value, TextureInput):
            row.kind, row.view = int(shading.TEXTURE), places[value.primvar]
            row.texture = self.textures.add(value.texture)
            row.value = wp.vec3(*value.st, 0.0)
            row.row_s, row.row_t = (wp.vec3(*line) for line in value.transform)
            row.channel = CHANNELS[value.channels]
            row.scale, row.bias = wp.vec4(*value.scale), wp.vec4(*value.bias)
        else:
            row.kind, row.value = int(shading.CONSTANT), _rgb(0.0 if value is None else value)
        return row

    def upload(self, device: str) -> Any:
        """The device's `Shading`, without looks, materials and tables."""
        result = shading.Shading()
        first, width, per_face, item = np.array(self._views).T
        result.inputs = wp.array(self._inputs, dtype=shading.Input, device=device)
        result.views = upload_structs(shading.View, device, first=first, width=width, per_face=per_face, item=item)
        values = np.concatenate([np.zeros(0, np.float32), *self._values])
        result.values = wp.array(values, dtype=float, device=device)
        result.textures = self.textures.upload(device)
        return result

    def upload_materials(self, tables: AlbedoTables, device: str) -> wp.array:
        """The device's materials, whose tables are added."""
        surfaces = [surface for _, surface in self._surfaces.values()]
        return upload_structs(
            shading.Material,
            device,
            inputs=len(INPUTS) * np.arange(len(surfaces)),
            is_specular=[surface.specular is not None for surface in surfaces],
            ior=[surface.ior for surface in surfaces],
            dielectric=[tables.add_dielectric(surface.ior) for surface in surfaces],
            threshold=[surface.opacity_threshold for surface in surfaces],
            is_presence=[surface.is_presence for surface in surfaces],
            tangents=[-1 if surface.normal is None else len(surface.primvars) for surface in surfaces],
            may_pass=[surface.may_be_transparent for surface in surfaces],
        )


def tangents(mesh: Mesh, st: np.ndarray, transform: tuple) -> np.ndarray:
    """Per triangle, (m, 1, 6) float32, the derivatives of position by texture coordinates; 0 where they do not vary.

    Args:
        mesh: whose positions they are.
        st: (m, 3, k >= 2), at the corners.
        transform: of the texture coordinates, two rows of three.
    """
    corners = np.asarray(mesh.points, dtype=np.float64)[mesh.triangles]
    turned = st[..., :2].astype(np.float64) @ np.array(transform)[:, :2].T
    (ds1, dt1), (ds2, dt2) = _sides(turned)
    side1, side2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = ds1 * dt2 - ds2 * dt1
    inverse = np.divide(1.0, area, out=np.zeros_like(area), where=area != 0)[:, None]
    along_s = (side1 * dt2[:, None] - side2 * dt1[:, None]) * inverse
    along_t = (side2 * ds1[:, None] - side1 * ds2[:, None]) * inverse
    both = []
    for vectors in (along_s, along_t):
        length = np.linalg.norm(vectors, axis=1, keepdims=True)
        both.append(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0))
    return np.concatenate(both, axis=1).astype(np.float32)[:, None]


def _sides(st: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of each triangle, (2, m): from its first corner to its second, and to its third."""
    return (st[:, 1] - st[:, 0]).T, (st[:, 2] - st[:, 0]).T


def _identities(carrier: Solid | Mesh) -> tuple[int, ...]:
    values = (id(array) for _, array in sorted(carrier.primvars.items()))
    if isinstance(carrier, Mesh):
        return (id(carrier.points), id(carrier.triangles), *values)
    return tuple(values)


def _rgb(value: Any) -> Any:
    return wp.vec3(*value) if isinstance(value, tuple) else wp.vec3(value, value, value)
