"""The scenes, authored as USD files and read back as any other stage; both renderers get what is read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from fgf_warp.scene import Medium, Scene
from fgf_warp.settings import BALANCED
from usd_scenes.authoring import author_fgf_medium
from usd_scenes.examples import build_mesh, build_sphere
from usd_scenes.reader import read_scene

SIGMA_T = 2.5
ALBEDO = 0.8
ASYMMETRY = 0.5


@dataclass(frozen=True)
class Bounds:
    """On the number of scattering events of a path.

    Args:
        max_depth: at most.
        roulette_depth: after which Russian roulette may end it.
    """

    max_depth: int
    roulette_depth: int


SHORT = Bounds(64, 5)
"""Of times per path."""
DEFAULT = Bounds(BALANCED.max_depth, BALANCED.roulette_depth)
"""Of times to an error: those of the default preset."""


@dataclass(frozen=True)
class Image:
    """How large a scene's picture is [pixel]."""

    width: int
    height: int


IMAGES = {"A": Image(128, 128), "B": Image(256, 256), "C": Image(128, 128), "S": Image(64, 64)}
SINGLE = ("A", "B", "C")
"""Scenes that are one image."""
SWEEP_SPP = 64
"""Samples per pixel of the images of S."""


def medium(
    sigma_t: float = SIGMA_T, albedo: float = ALBEDO, asymmetry: float = ASYMMETRY, **correlation: float
) -> Medium:
    """A grey medium; the classical exponential where no correlation is given."""
    return Medium("/World/Looks/Medium", sigma_t, (albedo,) * 3, asymmetry, **correlation)


def sweep_media() -> list[Medium]:
    """The 256 media of S: every combination of 8 sigma_t, 8 albedos and 4 g."""
    sigma_t, albedo, asymmetry = np.geomspace(0.5, 8, 8), np.linspace(0.3, 0.95, 8), (-0.3, 0.0, 0.4, 0.8)
    return [medium(float(s), float(a), g) for s, a, g in product(sigma_t, albedo, asymmetry)]


def author(name: str, folder: Path) -> Path:
    """Writes the stage of scene A, B, C or S into a folder.

    Args:
        name: of the scene.
        folder: an existing one.

    Returns:
        The .usda file.
    """
    stage = {"A": _ball, "B": _box, "C": _bumpy_ball, "S": _ball}[name]()
    path = folder / f"{name}.usda"
    stage.GetRootLayer().Export(str(path))
    return path


def read(path: Path) -> Scene:
    """The scene of a stage that `author` wrote; a warning of the reader is an error here."""
    reading = read_scene(path)
    if reading.warnings:
        raise ValueError(f"{path.name}: {'; '.join(reading.warnings)}")
    return reading.scene


def with_first_medium(scene: Scene, values: Medium) -> Scene:
    """The same scene with the values of another medium in the place of its first."""
    return scene.with_medium(0, replace(values, name=scene.media[0].name))


def bumpy_sphere(rings: int = 133) -> tuple[np.ndarray, np.ndarray]:
    """A sphere of radius 1 +- 0.15 with smooth bumps.

    Args:
        rings: triangles from pole to pole, >= 3; twice as many around.

    Returns:
        Points (n, 3), and triangles (4 rings (rings - 1), 3), counter-clockwise seen from outside.
    """
    around = 2 * rings
    theta, phi = np.pi * np.arange(1, rings) / rings, 2 * np.pi * np.arange(around) / around
    theta, phi = (grid.ravel() for grid in np.meshgrid(theta, phi, indexing="ij"))
    band = np.column_stack([np.sin(theta) * np.cos(phi), np.cos(theta), -np.sin(theta) * np.sin(phi)])
    directions = np.concatenate([band, [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]])
    x, y, z = directions.T
    points = directions * (1 + 0.15 * np.sin(6 * x) * np.sin(6 * y + 1) * np.sin(6 * z + 2))[:, None]

    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(rings - 2), np.arange(around), indexing="ij"))
    right = (j + 1) % around
    upper, upper_right = i * around + j, i * around + right
    lower, lower_right = upper + around, upper_right + around
    top, bottom = len(points) - 2, len(points) - 1
    j, right, last = np.arange(around), (np.arange(around) + 1) % around, (rings - 2) * around
    triangles = [
        np.column_stack([upper, lower, lower_right]),
        np.column_stack([upper, lower_right, upper_right]),
        np.column_stack([np.full(around, top), j, right]),
        np.column_stack([last + j, np.full(around, bottom), last + right]),
    ]
    return points, np.concatenate(triangles)


def _ball() -> Usd.Stage:
    return build_sphere(medium())


def _bumpy_ball() -> Usd.Stage:
    return build_mesh(medium(), *bumpy_sphere())


def _box() -> Usd.Stage:
    """A cube of medium that hovers over a diffuse floor, under a light that looks down."""
    stage = Usd.Stage.CreateInMemory("box.usda")
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())

    box = UsdGeom.Cube.Define(stage, "/World/Box")
    box.CreateSizeAttr(2.0)
    box.AddTranslateOp().Set(Gf.Vec3d(0, 1.2, 0))
    look = UsdShade.Material.Define(stage, "/World/Looks/Medium")
    author_fgf_medium(look, mean_extinction=SIGMA_T, albedo=(ALBEDO,) * 3, asymmetry=ASYMMETRY)
    UsdShade.MaterialBindingAPI.Apply(box.GetPrim()).Bind(look)

    floor = UsdGeom.Cube.Define(stage, "/World/Floor")
    floor.CreateSizeAttr(2.0)
    floor.AddTranslateOp().Set(Gf.Vec3d(0, -0.1, 0))
    floor.AddScaleOp().Set(Gf.Vec3f(4, 0.1, 4))
    paint = UsdShade.Material.Define(stage, "/World/Looks/Paint")
    shader = UsdShade.Shader.Define(stage, "/World/Looks/Paint/Shader")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.7, 0.5, 0.3))
    shader.CreateInput("ior", Sdf.ValueTypeNames.Float).Set(1.0)  # Reflects nothing: matte.
    paint.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(floor.GetPrim()).Bind(paint)

    light = UsdLux.RectLight.Define(stage, "/World/Light")
    light.CreateWidthAttr(2.0)
    light.CreateHeightAttr(2.0)
    light.CreateIntensityAttr(10.0)
    light.AddTranslateOp().Set(Gf.Vec3d(0, 4, 0))
    light.AddRotateXOp().Set(-90.0)

    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 2.6, 7))
    camera.AddRotateXOp().Set(-13.0)
    camera.CreateFocalLengthAttr(2.0)
    camera.CreateHorizontalApertureAttr(1.0)
    camera.CreateVerticalApertureAttr(1.0)
    return stage
