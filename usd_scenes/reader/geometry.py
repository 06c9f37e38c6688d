"""UsdGeom's solids: Sphere, Cube and Cylinder, as canonical solids under a transform."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from pxr import Usd, UsdGeom

from fgf_warp.scene import Solid
from usd_scenes.reader.attributes import read_number, read_token
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.materials import Look

SolidKind = Literal["sphere", "cube", "cylinder"]

AXIS_TURNS = {
    "Z": np.eye(4),
    "X": np.array([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=np.float64),
    "Y": np.array([[0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1]], dtype=np.float64),
}
"""Rotations that take the canonical cylinder's axis z to the named one."""


def read_sphere(prim: Usd.Prim, context: StageContext, look: Look) -> Solid | None:
    """A Sphere; None, with a warning, where its transform leaves no volume.

    Raises:
        SceneError: for a radius that is not > 0.
    """
    radius = _length(prim, "radius", context.time)
    return _solid("sphere", prim, np.diag([radius, radius, radius, 1]), context, look)


def read_cube(prim: Usd.Prim, context: StageContext, look: Look) -> Solid | None:
    """A Cube; None, with a warning, where its transform leaves no volume.

    Raises:
        SceneError: for a size that is not > 0.
    """
    half = _length(prim, "size", context.time) / 2
    return _solid("cube", prim, np.diag([half, half, half, 1]), context, look)


def read_cylinder(prim: Usd.Prim, context: StageContext, look: Look) -> Solid | None:
    """A Cylinder, or a Cylinder_1 whose radii agree; None, with a warning, for a cone or no volume.

    Raises:
        SceneError: for a radius or height that is not > 0, or an unknown axis.
    """
    if prim.IsA(UsdGeom.Cylinder_1):
        radius = _length(prim, "radiusBottom", context.time)
        if radius != _length(prim, "radiusTop", context.time):
            context.notes.add("Cylinder_1 with unequal radii is not supported and is left out", prim.GetPath())
            return None
    else:
        radius = _length(prim, "radius", context.time)
    half_height = _length(prim, "height", context.time) / 2
    axis = read_token(prim.GetAttribute("axis"), context.time, ("X", "Y", "Z")) or "Z"
    return _solid("cylinder", prim, AXIS_TURNS[axis] @ np.diag([radius, radius, half_height, 1]), context, look)


SOLID_READERS: dict[str, Callable[[Usd.Prim, StageContext, Look], Solid | None]] = {
    "Sphere": read_sphere,
    "Cube": read_cube,
    "Cylinder": read_cylinder,
    "Cylinder_1": read_cylinder,
}


def _solid(
    kind: SolidKind, prim: Usd.Prim, canonical_to_local: np.ndarray, context: StageContext, look: Look
) -> Solid | None:
    object_to_world = context.local_to_world(prim) @ canonical_to_local
    if np.linalg.det(object_to_world[:3, :3]) == 0:
        context.notes.add("the transform leaves no volume, and the prim is left out", prim.GetPath())
        return None
    return Solid(
        name=str(prim.GetPath()), kind=kind, object_to_world=object_to_world, surface=look.surface, medium=look.medium
    )


def _length(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> float:
    return read_number(prim.GetAttribute(name), time, accepted="> 0", holds=lambda x: x > 0)
