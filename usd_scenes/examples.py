"""Small stages for tests and examples: some that are written as files, some that are built for given values."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from fgf_warp.errors import SceneError
from fgf_warp.scene import Medium
from usd_scenes import schema
from usd_scenes.authoring import author_fgf_medium

STAGES = Path(__file__).parent / "stages"
MEDIUM_PATH = "/World/Looks/Medium"
"""Of the one medium in the stages that are built here."""


def stage_names() -> tuple[str, ...]:
    """Names of the stages that come as files, for `stage_path`."""
    return tuple(sorted(path.stem for path in STAGES.glob("*.usda")))


def stage_path(name: str) -> Path:
    """The file of a stage that comes with the package.

    Args:
        name: one of `stage_names`.

    Raises:
        SceneError: for any other name.
    """
    if name not in stage_names():
        raise SceneError(f"no stage {name!r}; there are: {', '.join(stage_names())}")
    return STAGES / f"{name}.usda"


def build_sphere(medium: Medium, *, radius: float = 1.0, radiance: float = 1.0) -> Usd.Stage:
    """A sphere of medium in a uniform environment; with albedo 1 it is the furnace test, where all is `radiance`.

    Args:
        medium: its name is not used, see `MEDIUM_PATH`.
        radius: of the sphere [stage unit], > 0.
        radiance: of the environment, >= 0.

    Raises:
        SceneError: where USD does not know FgfMediumAPI.
    """
    stage = _new_stage(medium)
    sphere = UsdGeom.Sphere.Define(stage, "/World/Sphere")
    sphere.CreateRadiusAttr(radius)
    _bind(sphere)
    _add_dome(stage, radiance)
    _add_camera(stage, distance=4.0 * radius, window=2.5 * radius)
    return stage


def build_slab(medium: Medium, *, thickness: float = 1.0, width: float = 1000.0, radiance: float = 1.0) -> Usd.Stage:
    """A wide, thin cube of medium across z = 0, seen along its normal, in a uniform environment.

    Args:
        medium: its name is not used, see `MEDIUM_PATH`.
        thickness: along z [stage unit], > 0.
        width: along x and y [stage unit], > 0; the camera sees the middle tenth of it.
        radiance: of the environment, >= 0.

    Raises:
        SceneError: where USD does not know FgfMediumAPI.
    """
    stage = _new_stage(medium)
    slab = UsdGeom.Cube.Define(stage, "/World/Slab")
    slab.CreateSizeAttr(1.0)
    slab.AddScaleOp().Set(Gf.Vec3f(width, width, thickness))
    _bind(slab)
    _add_dome(stage, radiance)
    _add_camera(stage, distance=width / 10 + thickness, window=width / 10)
    return stage


def build_mesh(medium: Medium, points: np.ndarray, faces: np.ndarray, *, radiance: float = 1.0) -> Usd.Stage:
    """A closed mesh of medium in a uniform environment.

    Args:
        medium: its name is not used, see `MEDIUM_PATH`.
        points: (n, 3) float [stage unit].
        faces: (f, k) int, polygons of k corners, counter-clockwise seen from outside.
        radiance: of the environment, >= 0.

    Raises:
        SceneError: where USD does not know FgfMediumAPI.
    """
    stage = _new_stage(medium)
    mesh = UsdGeom.Mesh.Define(stage, "/World/Mesh")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points, dtype=np.float32)))
    mesh.CreateFaceVertexCountsAttr([faces.shape[1]] * len(faces))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.astype(np.int32).reshape(-1)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    _bind(mesh)
    _add_dome(stage, radiance)
    reach = float(np.abs(points).max())
    _add_camera(stage, distance=4 * reach, window=3 * reach)
    return stage


def trefoil_tube(
    *, around: int = 16, along: int = 128, tube_radius: float = 0.35, radius: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """A tube of round section along a trefoil knot, the mesh of the stage ``knot``.

    Args:
        around: corners of the section, >= 3.
        along: sections, >= 3.
        tube_radius: [unit], > 0; the tube meets itself from about 0.5 `radius`.
        radius: size of the knot [unit], > 0; it then spans about 3 `radius` to each side.

    Returns:
        Points (around along, 3), and quads (around along, 4), counter-clockwise seen from outside.
    """
    t = np.linspace(0, 2 * np.pi, along, endpoint=False)
    spine = radius * np.column_stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)])
    tangent = radius * np.column_stack(
        [np.cos(t) + 4 * np.cos(2 * t), -np.sin(t) + 4 * np.sin(2 * t), -3 * np.cos(3 * t)]
    )
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # The tangent is never along z, so this frame closes on itself after one turn.
    side = np.cross(tangent, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other_side = np.cross(tangent, side)
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)[None, :, None]
    section = np.cos(angle) * side[:, None] + np.sin(angle) * other_side[:, None]
    points = spine[:, None] + tube_radius * section

    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    next_i, next_j = (i + 1) % along, (j + 1) % around
    quads = np.stack([i * around + j, i * around + next_j, next_i * around + next_j, next_i * around + j], axis=-1)
    return points.reshape(-1, 3), quads.reshape(-1, 4)


def _new_stage(medium: Medium) -> Usd.Stage:
    schema.register()
    stage = Usd.Stage.CreateInMemory("built.usda")
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    UsdGeom.Scope.Define(stage, "/World/Looks")
    material = UsdShade.Material.Define(stage, MEDIUM_PATH)
    values = {field.name: getattr(medium, field.name) for field in fields(medium) if field.name != "name"}
    author_fgf_medium(material, **values)
    return stage


def _bind(shape: UsdGeom.Gprim) -> None:
    material = UsdShade.Material.Get(shape.GetPrim().GetStage(), MEDIUM_PATH)
    UsdShade.MaterialBindingAPI.Apply(shape.GetPrim()).Bind(material)


def _add_dome(stage: Usd.Stage, radiance: float) -> None:
    UsdLux.DomeLight.Define(stage, "/World/Sky").CreateIntensityAttr(radiance)


def _add_camera(stage: Usd.Stage, *, distance: float, window: float) -> None:
    """A camera on the z axis that sees a square of side `window` at the origin."""
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 0, distance))
    camera.CreateFocalLengthAttr(distance)
    camera.CreateHorizontalApertureAttr(window)
    camera.CreateVerticalApertureAttr(window)
