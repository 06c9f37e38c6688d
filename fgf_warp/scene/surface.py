"""Surfaces in the parameters of UsdPreviewSurface, and the inputs of theirs that vary over a shape."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from fgf_warp.scene.checks import check_color, check_fraction, check_positive
from fgf_warp.scene.textures import TextureInput
from fgf_warp.scene.values import BLACK, FLOAT32_MAX, Rgb


@dataclass(frozen=True)
class PrimvarInput:
    """A material's input that varies over the shape.

    Args:
        primvar: its name.
        fallback: its value where a shape has none; one number is meant for all channels.
    """

    primvar: str
    fallback: Rgb | float = 0.0


ColorInput = Rgb | TextureInput | PrimvarInput
"""Three channels: constant, or varying over the shape."""
FloatInput = float | TextureInput | PrimvarInput
"""One number: constant, or varying over the shape."""


@dataclass(frozen=True)
class Surface:
    """A two-sided surface in the parameters of UsdPreviewSurface, whose fallbacks are a grey diffuse one.

    Light goes straight through what is transparent, unless it bounds a medium: then light is refracted there.

    Args:
        diffuse: reflectance per channel, in [0, 1].
        emission: emitted radiance per channel, >= 0, from both sides.
        specular: of the specular workflow, reflectance at normal incidence; None is the metallic workflow.
        metallic: in [0, 1], of the metallic workflow.
        roughness: in [0, 1]; the square of it is alpha of GGX.
        clearcoat: weight of a second specular lobe, in [0, 1].
        clearcoat_roughness: in [0, 1].
        ior: index of refraction, > 0; at 1, in the metallic workflow, what is no metal has no specular lobe.
        opacity: in [0, 1].
        opacity_threshold: in [0, 1]; > 0 makes opacity 0 below it, and 1 from it on.
        is_presence: True where opacity also dims the specular lobe, not only the diffuse one.
        normal: of the tangent space, as a texture of [-1, 1]; None is the shape's own.

    Raises:
        SceneError: naming the parameter, its value and the accepted range, where it does not vary.
    """

    diffuse: ColorInput = (0.18, 0.18, 0.18)
    emission: ColorInput = BLACK
    specular: ColorInput | None = None
    metallic: FloatInput = 0.0
    roughness: FloatInput = 0.5
    clearcoat: FloatInput = 0.0
    clearcoat_roughness: FloatInput = 0.01
    ior: float = 1.0
    opacity: FloatInput = 1.0
    opacity_threshold: float = 0.0
    is_presence: bool = False
    normal: TextureInput | None = None

    def __post_init__(self) -> None:
        for key, upper in (("diffuse", 1.0), ("emission", FLOAT32_MAX), ("specular", 1.0)):
            color = getattr(self, key)
            if isinstance(color, tuple):
                check_color("surface", key, color, upper=upper)
        for key in ("metallic", "roughness", "clearcoat", "clearcoat_roughness", "opacity", "opacity_threshold"):
            number = getattr(self, key)
            if not isinstance(number, TextureInput | PrimvarInput):
                check_fraction("surface", key, number)
        check_positive("surface", "ior", self.ior)

    @cached_property
    def inputs(self) -> tuple[TextureInput | PrimvarInput, ...]:
        """The inputs that vary over the shape, in the order of the parameters."""
        values = (getattr(self, key) for key in self.__dataclass_fields__)
        return tuple(value for value in values if isinstance(value, TextureInput | PrimvarInput))

    @cached_property
    def primvars(self) -> frozenset[str]:
        """Names of the primvars that it reads from the shape."""
        return frozenset(value.primvar for value in self.inputs if value.primvar)

    @cached_property
    def coordinates(self) -> frozenset[str]:
        """Names of the primvars that are texture coordinates: values of two numbers or more."""
        return frozenset(value.primvar for value in self.inputs if isinstance(value, TextureInput) and value.primvar)

    @property
    def is_matte(self) -> bool:
        """True where it is diffuse, opaque, and everywhere the same."""
        shines = self.ior != 1 or self.specular is not None or self.metallic != 0 or self.clearcoat != 0
        return not (self.inputs or shines or self.may_be_transparent)

    @property
    def emits(self) -> bool:
        """True where it may glow."""
        return self.emission != BLACK

    @property
    def may_be_transparent(self) -> bool:
        """True where some light may pass it."""
        return self.opacity != 1


def lets_light_through(surface: Surface | None) -> bool:
    """True where some light crosses what has this surface; None is a boundary that all light crosses."""
    return surface is None or surface.may_be_transparent
