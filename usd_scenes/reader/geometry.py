"""UsdGeom's implicit shapes: canonical solids under a transform, and triangles of what is none."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from pxr import Usd, UsdGeom

from fgf_warp.errors import SceneError
from fgf_warp.scene import FLOAT32_MAX
from usd_scenes.reader.attributes import NOT_NEGATIVE, POSITIVE, read_number, read_token
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.mesh import Form

SolidKind = Literal["sphere", "cube", "cylinder"]
Canonical = tuple[SolidKind, np.ndarray]
"""A solid and the (4, 4) matrix that takes it to the prim's space."""

AXIS_TURNS = {
    "Z": np.eye(4),
    "X": np.array([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=np.float64),
    "Y": np.array([[0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1]], dtype=np.float64),
}
"""Rotations that take the canonical cylinder's axis z to the named one."""
SEGMENTS = 256
"""Around a tessellated shape, which is then nowhere more than 1 - cos(pi / 256)^2 = 1.5e-4 of its radius inside the
true one, and by less than 2.6e-4 of its volume smaller."""


def read_solid(prim: Usd.Prim, context: StageContext) -> Canonical | None:
    """A Sphere, Cube or Cylinder, or a Cylinder_1 whose radii agree; None for any other shape.

    Returns:
        The kind, and the matrix from the canonical solid, whose radius and half-height are 1, to the prim's own space.

    Raises:
        SceneError: for a length that is not > 0, or an unknown axis.
    """
    if prim.IsA(UsdGeom.Sphere):
        radius = _length(prim, "radius", context.time)
        return "sphere", np.diag([radius, radius, radius, 1])
    if prim.IsA(UsdGeom.Cube):
        half = _length(prim, "size", context.time) / 2
        return "cube", np.diag([half, half, half, 1])
    if prim.IsA(UsdGeom.Cylinder):
        radius = _length(prim, "radius", context.time)
    elif prim.IsA(UsdGeom.Cylinder_1):
        bottom, top = _radii(prim, context)
        if bottom != top:
            return None
        radius = _length(prim, "radiusBottom", context.time)
    else:
        return None
    half_height = _length(prim, "height", context.time) / 2
    return "cylinder", _axis_turn(prim, context) @ np.diag([radius, radius, half_height, 1])


def read_cone(prim: Usd.Prim, context: StageContext) -> Form:
    """A Cone, whose tip is at the positive end of its axis.

    Returns:
        A closed surface of `SEGMENTS` segments around its axis, with its normals.

    Raises:
        SceneError: for a radius or height that is not > 0, or an unknown axis.
    """
    radius = _length(prim, "radius", context.time)
    half = _length(prim, "height", context.time) / 2
    return _revolved([[(0, -half), (radius, -half)], [(radius, -half), (0, half)]], prim, context)


def read_cut_cone(prim: Usd.Prim, context: StageContext) -> Form:
    """A Cylinder_1 of any two radii.

    Returns:
        A closed surface of `SEGMENTS` segments around its axis, with its normals; an end of radius 0 is a tip.

    Raises:
        SceneError: for a height that is not > 0, a negative radius, or an unknown axis.
    """
    bottom, top = _radii(prim, context)
    half = _length(prim, "height", context.time) / 2
    profile = [[(0, -half), (bottom, -half)], [(bottom, -half), (top, half)], [(top, half), (0, half)]]
    return _revolved([part for part in profile if part[0] != part[1]], prim, context)


def read_capsule(prim: Usd.Prim, context: StageContext) -> Form:
    """A Capsule or Capsule_1: two half spheres at the ends of a cylinder or of a cone that is cut off.

    Returns:
        A closed surface of `SEGMENTS` segments around its axis, with its normals.

    Raises:
        SceneError: for a height that is negative, a radius that is not > 0, or an unknown axis.
    """
    if prim.IsA(UsdGeom.Capsule_1):
        bottom, top = (_length(prim, name, context.time) for name in ("radiusBottom", "radiusTop"))
    else:
        bottom = top = _length(prim, "radius", context.time)
    half = _non_negative(prim, "height", context.time) / 2
    turns = np.linspace(0, np.pi / 2, SEGMENTS // 4 + 1)
    lower = [(bottom * np.sin(turn), -half - bottom * np.cos(turn)) for turn in turns]
    upper = [(top * np.cos(turn), half + top * np.sin(turn)) for turn in turns]
    lower[0], lower[-1], upper[0], upper[-1] = (0, -half - bottom), (bottom, -half), (top, half), (0, half + top)
    profile = [lower, [lower[-1], upper[0]], upper]
    return _revolved([part for part in profile if part[0] != part[-1]], prim, context)


def read_plane(prim: Usd.Prim, context: StageContext) -> Form:
    """A Plane, which faces along its axis.

    Returns:
        Two triangles, which enclose nothing.

    Raises:
        SceneError: for a width or length that is not > 0, or an unknown axis.
    """
    half_width = _length(prim, "width", context.time) / 2
    half_length = _length(prim, "length", context.time) / 2
    axis = _axis(prim, context)
    along_width, along_length = {"X": (2, 1), "Y": (0, 2), "Z": (0, 1)}[axis]
    points = np.zeros((4, 3))
    points[:, along_width] = np.array([-1, 1, 1, -1]) * half_width
    points[:, along_length] = np.array([-1, -1, 1, 1]) * half_length
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    if axis != "Z":  # z cross y is -x, and x cross z is -y.
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    return Form(points, triangles, None, context)


FORM_READERS: dict[str, Callable[[Usd.Prim, StageContext], Form]] = {
    "Cone": read_cone,
    "Cylinder_1": read_cut_cone,
    "Capsule": read_capsule,
    "Capsule_1": read_capsule,
    "Plane": read_plane,
}


def _revolved(profile: list[list[tuple[float, float]]], prim: Usd.Prim, context: StageContext) -> Form:
    """A closed surface of revolution around the prim's axis.

    Args:
        profile: parts from the bottom to the top, which meet in edges, each of points (radius, height) on a straight
            line or on an arc of a circle.
        prim: that has the axis.
        context: the stage.
    """
    outline = np.array([point for part in profile for point in part])
    slopes = np.concatenate([_outward(np.array(part)) for part in profile])
    parts = np.repeat(np.arange(len(profile)), [len(part) for part in profile])
    turns = np.arange(SEGMENTS) * (2 * np.pi / SEGMENTS)

    def around(values: np.ndarray) -> np.ndarray:
        """(n, SEGMENTS, 3), of (n, 2) radii and heights."""
        radii, heights = values.T[..., None]
        return np.stack(np.broadcast_arrays(radii * np.cos(turns), radii * np.sin(turns), heights), axis=-1)

    # Parts share the points where they meet, and there is one at each end of the axis.
    rings, ring_of = np.unique(outline, axis=0, return_inverse=True)
    sizes = np.where(rings[:, 0] > 0, SEGMENTS, 1)
    starts = (np.cumsum(sizes) - sizes)[ring_of.reshape(-1)]
    points = np.concatenate([ring[:size] for ring, size in zip(around(rings), sizes, strict=True)])

    bands = np.flatnonzero(parts[:-1] == parts[1:])
    row, column = np.repeat(bands, SEGMENTS), np.tile(np.arange(SEGMENTS), len(bands))
    following = (column + 1) % SEGMENTS
    low, high = outline[row, 0] > 0, outline[row + 1, 0] > 0
    rows = np.concatenate([np.stack([row, row, row + 1], axis=1)[low], np.stack([row, row + 1, row + 1], axis=1)[high]])
    columns = np.concatenate(
        [
            np.stack([column, following, following], axis=1)[low],
            np.stack([column, following, column], axis=1)[high],
        ]
    )
    triangles = starts[rows] + np.where(outline[rows, 0] > 0, columns, 0)
    turn = _axis_turn(prim, context)[:3, :3]
    normals = around(slopes)[rows, columns] @ turn.T
    return Form(points @ turn.T, triangles.astype(np.int32), normals.astype(np.float32), context)


def _outward(part: np.ndarray) -> np.ndarray:
    """(n, 2) unit normals of a straight line or an arc, which lie to the right of its way up."""
    if len(part) == 2:
        along = part[1] - part[0]
        normal = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        return np.tile(normal, (2, 1))
    is_lower = part[0, 0] == 0
    center = np.array([0, part[-1, 1] if is_lower else part[0, 1]])
    return (part - center) / np.linalg.norm(part - center, axis=1, keepdims=True)


def _axis(prim: Usd.Prim, context: StageContext) -> str:
    return read_token(prim.GetAttribute("axis"), context.time, ("X", "Y", "Z")) or "Z"


def _axis_turn(prim: Usd.Prim, context: StageContext) -> np.ndarray:
    return AXIS_TURNS[_axis(prim, context)]


def _radii(prim: Usd.Prim, context: StageContext) -> tuple[float, float]:
    """At the bottom and at the top."""
    return _non_negative(prim, "radiusBottom", context.time), _non_negative(prim, "radiusTop", context.time)


def _non_negative(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> float:
    return _bounded(prim, name, read_number(prim.GetAttribute(name), time, NOT_NEGATIVE))


def _length(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> float:
    return _bounded(prim, name, read_number(prim.GetAttribute(name), time, POSITIVE))


def _bounded(prim: Usd.Prim, name: str, length: float) -> float:
    """A length that its square and what is made of it do not overflow.

    Raises:
        SceneError: for one that is larger.
    """
    if length > FLOAT32_MAX:
        raise SceneError(f"{prim.GetPath()}.{name} = {length:g}; accepted: at most {FLOAT32_MAX:.3g}")
    return length
