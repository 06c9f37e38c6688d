"""UsdShade.Material: what the boundary of a shape does to light, and what fills the shape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from fgf_warp.errors import SceneError
from fgf_warp.scene import Medium, Rgb, Surface
from usd_scenes.reader.attributes import is_authored, plain_source, read_array, read_color
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.medium import ends_in_surface, has_medium, read_medium

PREVIEW_DIFFUSE: Rgb = (0.18, 0.18, 0.18)
PREVIEW_EMISSIVE: Rgb = (0.0, 0.0, 0.0)
PREVIEW_FALLBACKS: dict[str, float | Rgb] = {
    "clearcoat": 0.0,
    "displacement": 0.0,
    "ior": 1.5,
    "metallic": 0.0,
    "normal": (0.0, 0.0, 1.0),
    "occlusion": 1.0,
    "opacity": 1.0,
    "opacityThreshold": 0.0,
    "roughness": 0.5,
    "specularColor": (0.0, 0.0, 0.0),
    "useSpecularWorkflow": 0,
}
"""Inputs of UsdPreviewSurface that are not rendered, and the values at which that needs no warning."""


@dataclass(frozen=True)
class Look:
    """What a shape is made of.

    Args:
        surface: its surface, or None where light passes unchanged.
        medium: index of the medium that fills it, or None.
    """

    surface: Surface | None
    medium: int | None


@dataclass(frozen=True)
class _Reading:
    """One material: its medium, whether light passes its boundary unchanged, and its UsdPreviewSurface if any."""

    medium: int | None
    is_open: bool
    surface: Surface | None


class MaterialReader:
    """Reads each material once, when the first prim bound to it is met.

    Args:
        context: the stage.
    """

    def __init__(self, context: StageContext) -> None:
        self._context = context
        self._readings: dict[object, _Reading] = {}
        self._media: list[Medium] = []

    @property
    def media(self) -> tuple[Medium, ...]:
        """The media met so far; `Look.medium` counts in it."""
        return tuple(self._media)

    def look_of(self, prim: Usd.Prim) -> Look:
        """The look of a geometry prim: its bound material's, else its display color.

        Raises:
            SceneError: for a value out of its range.
        """
        material = self._bound_material(prim)
        if material is None:
            return Look(surface=self._display_surface(prim), medium=None)
        reading = self._reading_of(material)
        if reading.is_open:
            return Look(surface=None, medium=reading.medium)
        return Look(surface=reading.surface or self._display_surface(prim), medium=reading.medium)

    def _bound_material(self, prim: Usd.Prim) -> UsdShade.Material | None:
        material, binding = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(UsdShade.Tokens.full)
        if not material and binding:
            self._context.notes.add("bound to something that is no Material", binding.GetPath())
        return material or None

    def _reading_of(self, material: UsdShade.Material) -> _Reading:
        prim = material.GetPrim()
        # Instances share one material, and so one medium, though each sees it under a path of its own.
        key = (prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath()
        if key not in self._readings:
            self._readings[key] = self._read(material)
        return self._readings[key]

    def _read(self, material: UsdShade.Material) -> _Reading:
        prim, context = material.GetPrim(), self._context
        shader = _surface_shader(material)
        if material.ComputeVolumeSource()[0]:
            context.notes.add("volume shader is not supported", prim.GetPath())
        index = None
        if has_medium(prim, context):
            self._media.append(read_medium(prim, context))
            index = len(self._media) - 1
            if not ends_in_surface(prim, context):
                if shader:
                    context.notes.add("fgf:boundary = none: the material's surface is not used", prim.GetPath())
                return _Reading(medium=index, is_open=True, surface=None)
        if not shader:
            context.notes.add("material without a surface: the display color is used", prim.GetPath())
            return _Reading(medium=index, is_open=False, surface=None)
        return _Reading(medium=index, is_open=False, surface=self._preview_surface(shader))

    def _preview_surface(self, shader: UsdShade.Shader) -> Surface | None:
        if shader.GetIdAttr().Get() != "UsdPreviewSurface":
            self._context.notes.add("shader is no UsdPreviewSurface: the display color is used", shader.GetPath())
            return None
        self._note_what_is_not_read(shader)
        diffuse = self._color(shader, "diffuseColor", PREVIEW_DIFFUSE)
        emission = self._color(shader, "emissiveColor", PREVIEW_EMISSIVE)
        path = shader.GetPath()
        return _checked_surface(diffuse, emission, f"{path}.inputs:diffuseColor", f"{path}.inputs:emissiveColor")

    def _color(self, shader: UsdShade.Shader, name: str, fallback: Rgb) -> Rgb:
        shader_input = shader.GetInput(name)
        if not shader_input:
            return fallback
        source = plain_source(shader_input.GetAttr())
        if source is None:
            text = f"texture or other shader is not supported: {_in_words(fallback)} is used"
            self._context.notes.add(text, shader_input.GetAttr().GetPath())
            return fallback
        return read_color(source, self._context.time, fallback)

    def _note_what_is_not_read(self, shader: UsdShade.Shader) -> None:
        for name, harmless in PREVIEW_FALLBACKS.items():
            shader_input = shader.GetInput(name)
            if not shader_input or not is_authored(shader_input.GetAttr()):
                continue
            source = plain_source(shader_input.GetAttr())
            value = source.Get(self._context.time) if source else None
            if not _agree(value, harmless):
                text = "only diffuseColor and emissiveColor of UsdPreviewSurface are rendered"
                self._context.notes.add(text, shader_input.GetAttr().GetPath())

    def _display_surface(self, prim: Usd.Prim) -> Surface:
        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
        if not primvar:
            return Surface()
        path = primvar.GetAttr().GetPath()
        colors = read_array(primvar.GetAttr(), self._context.time, np.float32, width=3)
        if not len(colors):
            return Surface()
        if len(colors) > 1:
            self._context.notes.add("varying display color is not supported: its first value is used", path)
        r, g, b = (float(str(channel)) for channel in colors[0])
        return _checked_surface((r, g, b), PREVIEW_EMISSIVE, str(path), "")


def _surface_shader(material: UsdShade.Material) -> UsdShade.Shader | None:
    return material.ComputeSurfaceSource()[0] or None


def _checked_surface(diffuse: Rgb, emission: Rgb, diffuse_path: str, emission_path: str) -> Surface:
    try:
        return Surface(diffuse=diffuse, emission=emission)
    except SceneError as error:
        text = str(error)
        for start, path in (("surface: diffuse", diffuse_path), ("surface: emission", emission_path)):
            text = text.replace(start, path)
        raise SceneError(text) from error


def _agree(value: object, number: float | Rgb) -> bool:
    try:
        return bool(np.allclose(np.asarray(value, dtype=np.float64), number))
    except (TypeError, ValueError):
        return False


def _in_words(color: Rgb) -> str:
    return f"({color[0]:g}, {color[1]:g}, {color[2]:g})"
