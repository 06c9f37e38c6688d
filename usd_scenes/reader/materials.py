"""UsdShade.Material: which one a shape has, what its boundary does to light, and what fills it."""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Usd, UsdShade

from fgf_warp.scene import Medium, Surface
from usd_scenes.reader import preview_surface
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.display import display_sources, display_surface
from usd_scenes.reader.instancing import Copies
from usd_scenes.reader.medium import ends_in_surface, has_medium, read_medium
from usd_scenes.reader.preview_surface import displaces, read_preview_surface
from usd_scenes.schema import SCHEMA_NAME

RENDER_CONTEXT = "fgf"
"""Terminals of this name are meant for this renderer and stand before the universal ones."""


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
        self._display_surfaces: dict[object, Surface] = {}
        self._media: list[Medium] = []

    @property
    def media(self) -> tuple[Medium, ...]:
        """The media met so far; `Look.medium` counts in it."""
        return tuple(self._media)

    def look_of(self, prim: Usd.Prim, copies: Copies | None = None) -> Look:
        """The look of a geometry prim or a GeomSubset: its bound material's, else its display color.

        Bindings are those for the purpose ``full``, else for all purposes, direct ones and those of collections, on
        the prim or above it, as UsdShade.MaterialBindingAPI resolves them.

        Args:
            prim: the geometry.
            copies: of the prototype that it is part of.

        Returns:
            `medium` is a place in `media`, or None; `surface` is None where light passes the boundary unchanged.

        Raises:
            SceneError: for a value out of its range, or a missing one where the stage is read strictly.
        """
        material = self._bound_material(prim)
        if material is None:
            return Look(surface=self._display_surface(prim, copies), medium=None)
        reading = self._reading_of(material)
        if reading.is_open:
            return Look(surface=None, medium=reading.medium)
        return Look(surface=reading.surface or self._display_surface(prim, copies), medium=reading.medium)

    def bounds_medium(self, prim: Usd.Prim) -> bool:
        """True where a medium is bound to a prim or to a GeomSubset of it, whether or not either can be read."""
        parts = [prim, *(subset.GetPrim() for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets())]
        bound = (self._bound_material(part) for part in parts)
        return any(has_medium(material.GetPrim(), self._context) for material in bound if material)

    def _display_surface(self, prim: Usd.Prim, copies: Copies | None) -> Surface:
        # Instances whose display color and opacity are the same attributes have them read once.
        key = display_sources(prim, copies)
        if key not in self._display_surfaces:
            self._display_surfaces[key] = display_surface(prim, self._context, copies)
        return self._display_surfaces[key]

    def _bound_material(self, prim: Usd.Prim) -> UsdShade.Material | None:
        bindings = UsdShade.MaterialBindingAPI(prim)
        material, binding = bindings.ComputeBoundMaterial(UsdShade.Tokens.full)
        if not material and binding:
            self._context.mend("bound to something that is no Material; the display color is used", binding.GetPath())
        elif not material and bindings.ComputeBoundMaterial(UsdShade.Tokens.preview)[0]:
            self._context.notes.add("bound for previews only: the display color is used", prim.GetPath())
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
        shader = material.ComputeSurfaceSource(RENDER_CONTEXT)[0]
        displacement = material.ComputeDisplacementSource(RENDER_CONTEXT)[0]
        if displacement and displaces(displacement, context):
            context.notes.add("displacement is not rendered", prim.GetPath())
        if not has_medium(prim, context):
            if material.ComputeVolumeSource(RENDER_CONTEXT)[0]:
                context.notes.add(f"a volume is rendered where {SCHEMA_NAME} says what it is", prim.GetPath())
            return _Reading(medium=None, is_open=False, surface=self._surface(material, shader))
        self._media.append(read_medium(prim, context))
        index = len(self._media) - 1
        if not ends_in_surface(prim, context):
            if shader:
                context.notes.add("fgf:boundary = none: the material's surface is not used", prim.GetPath())
            return _Reading(medium=index, is_open=True, surface=None)
        surface = self._surface(material, shader)
        if surface and not surface.may_be_transparent:
            context.notes.add("the medium is never seen, as the surface around it is opaque", prim.GetPath())
        return _Reading(medium=index, is_open=False, surface=surface)

    def _surface(self, material: UsdShade.Material, shader: UsdShade.Shader) -> Surface | None:
        """The material's surface; None, with a warning, where it has none that can be rendered."""
        notes = self._context.notes
        if not shader:
            notes.add("material without a surface: the display color is used", material.GetPath())
            return None
        if shader.GetShaderId() != preview_surface.KIND:
            notes.add(f"shader is no {preview_surface.KIND}: the display color is used", shader.GetPath())
            return None
        return read_preview_surface(shader, self._context)
