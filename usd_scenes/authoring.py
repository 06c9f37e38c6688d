"""Writes fractional Gaussian field media into a stage, for this renderer and in the words of others."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import fields
from typing import Literal

import numpy as np
from pxr import Gf, Sdf, Usd, UsdShade

from fgf_warp.errors import SceneError
from fgf_warp.scene import WHITE, LineVariance, Medium, PhaseFunction, Rgb, Transport
from usd_scenes import schema
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.medium import read_medium

Boundary = Literal["none", "surface"]


def author_fgf_medium(
    material: Usd.Prim | UsdShade.Material,
    *,
    mean_extinction: float,
    albedo: Sequence[float] = WHITE,
    asymmetry: float = 0.0,
    phase_function: PhaseFunction = "hg",
    back_asymmetry: float = 0.0,
    back_weight: float = 0.0,
    draine_alpha: float = 0.0,
    hurst: float = -0.5,
    white_noise_scale: float = 0.0,
    outer_scale: float | None = None,
    kappa: float | None = None,
    extinction_color: Sequence[float] = WHITE,
    transport: Transport | None = None,
    line_variance: LineVariance = "asymptotic",
    boundary: Boundary = "none",
    priority: int = 0,
) -> None:
    """Applies FgfMediumAPI to a material and authors its values at the default time.

    All values are authored but those that are None, as fallbacks do not resolve through connections.

    Args:
        material: the Material.
        mean_extinction: sigma_m [1/stage unit], > 0 (0 is accepted for the classical exponential).
        albedo: single-scattering albedo per channel, in [0, 1].
        asymmetry: Henyey-Greenstein g in (-1, 1).
        phase_function: ``isotropic``, ``hg``, ``two_lobe`` or ``draine``; see `fgf_warp.scene.Medium`.
        back_asymmetry: g of the second lobe, in (-1, 1); of ``two_lobe``.
        back_weight: share of the second lobe, in [0, 1]; of ``two_lobe``.
        draine_alpha: in [0, 1000]; of ``draine``.
        hurst: H > -0.98, at least 0.01 from 0, 1, 2, ...
        white_noise_scale: S_w >= 0 [stage unit^(-2-2H)].
        outer_scale: L > 0 [stage unit]; needed where H > 0.
        kappa: in [0, 1e8]; replaces the value that follows from S_w.
        extinction_color: multiplies `mean_extinction` per channel, >= 0.
        transport: None chooses reciprocal where H >= -1/2 and renewal below.
        line_variance: of fractional Brownian motion, ``asymptotic`` for segments far below L, or ``exact``.
        boundary: ``none`` lets light through unchanged, ``surface`` keeps the material's UsdPreviewSurface, which
            should be transparent: an opaque one hides the medium.
        priority: of nested media, the one with the highest priority fills the space.

    Raises:
        SceneError: for a value out of its range or a prim that is no Material; nothing is then authored.
    """
    prim = material.GetPrim()
    path = str(prim.GetPath())
    try:
        # Plain numbers, whatever sequences or NumPy scalars they came as.
        medium = Medium(
            name=path,
            mean_extinction=float(mean_extinction),
            albedo=_rgb(albedo),
            asymmetry=float(asymmetry),
            phase_function=phase_function,
            back_asymmetry=float(back_asymmetry),
            back_weight=float(back_weight),
            draine_alpha=float(draine_alpha),
            hurst=float(hurst),
            white_noise_scale=float(white_noise_scale),
            outer_scale=None if outer_scale is None else float(outer_scale),
            kappa=None if kappa is None else float(kappa),
            extinction_color=_rgb(extinction_color),
            transport=transport,
            line_variance=line_variance,
            priority=operator.index(priority),
        )
    except (TypeError, ValueError) as error:
        raise SceneError(f"{path}: a value is not of the kind that its parameter takes: {error}") from error
    if boundary not in schema.BOUNDARIES:
        raise SceneError(f"{path}: boundary = {boundary!r}; accepted: {', '.join(schema.BOUNDARIES)}")
    schema.register()
    if not prim.IsA(UsdShade.Material):
        raise SceneError(f"{path}: {schema.SCHEMA_NAME} applies to a Material, and this is a {_type_of(prim)}")
    prim.ApplyAPI(schema.SCHEMA_NAME)
    with Sdf.ChangeBlock():
        for field in fields(medium):
            value = getattr(medium, field.name)
            if field.name != "name" and value is not None:
                prim.GetAttribute(schema.MEDIUM_ATTRIBUTES[field.name]).Set(_as_usd(value))
        prim.GetAttribute(schema.BOUNDARY_ATTRIBUTE).Set(boundary)


def author_interchange(material: Usd.Prim | UsdShade.Material) -> None:
    """Completes the network of a material that has a medium, for tools and renderers that do not know FgfMediumAPI.

    Two terminals are authored, neither of which is read here, since FgfMediumAPI is what says what the medium is:

    - ``outputs:fgf:volume``, a Shader ``FgfMedium`` whose inputs are connected to the material's ``inputs:fgf:*``, so
      that the medium is a part of the network to all that walk it.
    - ``outputs:volume``, MaterialX's ``volume`` of an ``anisotropic_vdf``: the classical exponential medium of the same
      mean extinction, albedo and mean cosine, at the values that the medium has now.

    Args:
        material: with FgfMediumAPI applied.

    Raises:
        SceneError: for a prim without a medium, or a value out of its range; nothing is then authored.
    """
    schema.register()
    prim = material.GetPrim()
    if schema.SCHEMA_NAME not in prim.GetAppliedSchemas():
        raise SceneError(f"{prim.GetPath()}: {schema.SCHEMA_NAME} is not applied; author a medium first")
    context = StageContext(stage=prim.GetStage(), time=Usd.TimeCode.Default(), purposes=frozenset())
    medium = read_medium(prim, context)
    material = UsdShade.Material(prim)
    _author_fgf_terminal(material)
    _author_classical_terminal(material, medium)


def _author_fgf_terminal(material: UsdShade.Material) -> None:
    shader = _define_shader(material, schema.SHADER_NAME, schema.SHADER_NAME)
    for attribute in material.GetPrim().GetAuthoredPropertiesInNamespace("inputs:fgf"):
        name = attribute.GetName().removeprefix("inputs:fgf:")
        shader.CreateInput(name, attribute.GetTypeName()).ConnectToSource(UsdShade.Input(attribute))
    output = shader.CreateOutput("volume", Sdf.ValueTypeNames.Token)
    material.CreateVolumeOutput("fgf").ConnectToSource(output)


def _author_classical_terminal(material: UsdShade.Material, medium: Medium) -> None:
    extinction = medium.mean_extinction * np.array(medium.extinction_color)
    albedo = np.array(medium.albedo)
    function = _define_shader(material, "ClassicalPhase", "ND_anisotropic_vdf")
    for name, color in (("absorption", extinction * (1 - albedo)), ("scattering", extinction * albedo)):
        function.CreateInput(name, Sdf.ValueTypeNames.Vector3f).Set(Gf.Vec3f(*map(float, color)))
    function.CreateInput("anisotropy", Sdf.ValueTypeNames.Float).Set(medium.mean_cosine)
    volume = _define_shader(material, "ClassicalVolume", "ND_volume")
    distribution = function.CreateOutput("out", Sdf.ValueTypeNames.Token)
    volume.CreateInput("vdf", Sdf.ValueTypeNames.Token).ConnectToSource(distribution)
    material.CreateVolumeOutput().ConnectToSource(volume.CreateOutput("out", Sdf.ValueTypeNames.Token))


def _define_shader(material: UsdShade.Material, name: str, kind: str) -> UsdShade.Shader:
    shader = UsdShade.Shader.Define(material.GetPrim().GetStage(), material.GetPath().AppendChild(name))
    shader.CreateIdAttr(kind)
    return shader


def _rgb(color: Sequence[float]) -> Rgb:
    red, green, blue = (float(channel) for channel in color)
    return red, green, blue


def _as_usd(value: float | str | Rgb) -> float | str | Gf.Vec3f:
    return Gf.Vec3f(*value) if isinstance(value, tuple) else value


def _type_of(prim: Usd.Prim) -> str:
    return prim.GetTypeName() or "prim without a type"
