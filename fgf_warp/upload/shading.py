"""Surfaces from a scene to the device: materials, and the primvars that they read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Any

import numpy as np
import warp as wp

from fgf_warp.device import shading
from fgf_warp.scene import (
    ColorInput,
    FloatInput,
    Instances,
    Mesh,
    PrimvarInput,
    Shape,
    Solid,
    Surface,
    TextureInput,
    count_of,
)
from fgf_warp.upload.albedos import AlbedoTables
from fgf_warp.upload.arrays import upload_structs
from fgf_warp.upload.instances import is_open, mesh_of, number_surfaces
from fgf_warp.upload.media import indices_of_refraction
from fgf_warp.upload.textures import TextureRows

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

View = tuple[int, int, int, int]
"""The fields of `device.shading.View`."""
NO_VIEW: View = (-1, 0, 0, -1)


def build_device_shading(shapes: Sequence[Shape], containers: Sequence[Shape], device: str) -> Any:
    """The device's view of all surfaces.

    Args:
        shapes: whose surfaces there are; looks and instances are numbered in their order.
        containers: the shapes filled with media, in the order of their bits.
        device: where to put them.

    Returns:
        `device.shading.Shading`.
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


def _names_read(surface: Surface) -> list[str]:
    """Names of the primvars that it reads; a texture that is read at one place has an empty one, which no shape has."""
    return sorted({value.primvar for value in surface.inputs})


class ShadingRows:
    """Materials and what they read; each surface and each array of values is there once."""

    def __init__(self) -> None:
        self.textures = TextureRows()
        self._surfaces: dict[int, tuple[int, Surface]] = {}
        self._inputs: list[Any] = []
        self._views: list[View] = [NO_VIEW]
        self._values: list[np.ndarray] = []
        self._count = 0
        self._view_of: dict[tuple, tuple[View, Any]] = {}
        self._views_of: dict[tuple, tuple[int, int, Any]] = {}

    def add_look(self, shape: Shape, item: int) -> tuple[int, int, int]:
        """Adds the material of a shape and the primvars that it reads.

        Args:
            shape: that has a surface.
            item: number of its surface, of instances that of the first, as a hit tells it.

        Returns:
            Its material, the first of its views, and the view of its normals or -1.
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
    ) -> list[View]:
        """A view for each primvar that the surface reads, and for the tangents of its normal map."""
        found = [
            (*self._view(("instances", id(own[name])), own[name])[:3], item)
            if name in own
            else self._view_of_primvar(carrier.primvars, name)
            for name in _names_read(surface)
        ]
        if surface.normal is not None:
            found.append(self._view_of_tangents(surface.normal, carrier))
        return found

    def _view_of_primvar(self, primvars: Mapping[str, np.ndarray], name: str) -> View:
        values = primvars.get(name)
        return NO_VIEW if values is None else self._view(("primvar", id(values)), values)

    def _view_of_tangents(self, normal: TextureInput, carrier: Solid | Mesh) -> View:
        st = carrier.primvars.get(normal.primvar)
        if not isinstance(carrier, Mesh) or st is None or st.shape[1] != 3 or st.shape[2] < 2:
            return NO_VIEW
        key = ("tangents", id(st), id(carrier.points), id(carrier.triangles), normal.transform)
        if key in self._view_of:
            return self._view_of[key][0]
        return self._view(key, tangents(carrier, st, normal.transform), (carrier, st))

    def _view(self, key: tuple, values: np.ndarray, keeps: Any = None) -> View:
        """Where values are.

        Args:
            key: equal for equal values.
            values: (k,), (1, 1, k), (m, 1, k) or (m, 3, k), of instances (n, k).
            keeps: what the key has the identities of, if not of `values`.
        """
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
        """The device's `Material`s, (n,); what they look up is added to `tables`."""
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
    """Directions in which the texture coordinates of each triangle grow, for normal maps.

    Args:
        mesh: whose positions they are.
        st: (m, 3, k >= 2), at the corners.
        transform: of the texture coordinates, two rows of three.

    Returns:
        (m, 1, 6) float32: the unit derivatives of position by s and by t; 0 where the coordinates do not vary.
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
    """Two sides of each triangle in texture coordinates, (2, m) each: from its first corner to the second and third."""
    return (st[:, 1] - st[:, 0]).T, (st[:, 2] - st[:, 0]).T


def _identities(carrier: Solid | Mesh) -> tuple[int, ...]:
    """The same of shapes that have the same arrays."""
    values = (id(array) for _, array in sorted(carrier.primvars.items()))
    if isinstance(carrier, Mesh):
        return (id(carrier.points), id(carrier.triangles), *values)
    return tuple(values)


def _rgb(value: Any) -> Any:
    return wp.vec3(*value) if isinstance(value, tuple) else wp.vec3(value, value, value)
