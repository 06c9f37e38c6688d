"""What the values of a scene are checked for where they are made: each says what was found and what is accepted.

Every check takes the name of what is checked, a prim path or what it is, and the parameter's, and raises a `SceneError`
that begins with both. What overflows float32 is refused too, since the device computes in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from fgf_warp.errors import SceneError
from fgf_warp.scene.placements import are_usable
from fgf_warp.scene.values import FLOAT32_MAX, Vec3

UNIT_ROUNDING = 1e-5
"""How far the length of a unit vector may be from 1, and the products of orthogonal axes from those of the identity:
what float32 and a product of some matrices in it leave."""


def check_range(name: str, key: str, value: float, accepted: str, holds: Callable[[float], bool]) -> None:
    """Checks one number.

    Args:
        name: of what has the parameter.
        key: the parameter's name.
        value: the number.
        accepted: the range in words, for the message.
        holds: True for a finite number in that range.

    Raises:
        SceneError: where it is outside, not finite, or too large for float32.
    """
    if not math.isfinite(value) or not holds(value):
        raise SceneError(f"{name}: {key} = {shown(value)}; accepted: {accepted}")
    if abs(value) > FLOAT32_MAX:
        raise SceneError(f"{name}: {key} = {shown(value)}; accepted: {accepted}, and at most {FLOAT32_MAX:.3g} in size")


def check_positive(name: str, key: str, value: float) -> None:
    """Checks that a number is > 0."""
    check_range(name, key, value, "> 0", lambda x: x > 0)


def check_not_negative(name: str, key: str, value: float) -> None:
    """Checks that a number is >= 0."""
    check_range(name, key, value, ">= 0", lambda x: x >= 0)


def check_fraction(name: str, key: str, value: float) -> None:
    """Checks that a number is in [0, 1]."""
    check_range(name, key, value, "in [0, 1]", lambda x: 0 <= x <= 1)


def check_choice(name: str, key: str, value: str, accepted: Sequence[str]) -> None:
    """Checks that a word is one of those that are accepted."""
    if value not in accepted:
        raise SceneError(f"{name}: {key} = {value!r}; accepted: {', '.join(accepted)}")


def check_color(name: str, key: str, color: Sequence[float], upper: float = FLOAT32_MAX) -> None:
    """Checks that a colour has three channels in [0, upper]."""
    unbounded = f"three finite numbers >= 0, at most {FLOAT32_MAX:.3g}"
    accepted = unbounded if upper == FLOAT32_MAX else f"three numbers in [0, {upper:g}]"
    if len(color) != 3 or not all(0 <= c <= upper for c in color):
        raise SceneError(f"{name}: {key} = {listed(color)}; accepted: {accepted}")


def check_vector(name: str, key: str, vector: Vec3) -> None:
    """Checks that a vector has three finite components."""
    if len(vector) != 3 or not all(abs(x) <= FLOAT32_MAX for x in vector):
        raise SceneError(f"{name}: {key} = {listed(vector)}; accepted: three finite numbers, at most {FLOAT32_MAX:.3g}")


def check_unit_vector(name: str, key: str, vector: Vec3) -> None:
    """Checks that the length of a vector is 1, up to `UNIT_ROUNDING`."""
    check_range(name, f"|{key}|", math.hypot(*vector), "1", lambda x: abs(x - 1) < UNIT_ROUNDING)


def check_matrix(name: str, key: str, matrix: np.ndarray) -> None:
    """Checks that a matrix is (4, 4), finite and invertible, and its inverse finite too."""
    if matrix.shape != (4, 4) or not is_finite(matrix) or np.linalg.det(matrix[:3, :3]) == 0:
        raise SceneError(f"{name}: {key} must be a finite, invertible 4x4 matrix")
    if not is_finite(np.linalg.inv(matrix)):
        raise SceneError(f"{name}: {key} is too far away for its size; accepted: an inverse below {FLOAT32_MAX:.3g}")


def check_motion(name: str, key: str, opening: np.ndarray, closing: np.ndarray | None) -> None:
    """Checks the matrix when the shutter opens, called `key`, and the one when it closes, called ``closing``."""
    check_matrix(name, key, opening)
    if closing is not None:
        check_matrix(name, "closing", closing)


def check_places(name: str, key: str, places: np.ndarray, count: int) -> None:
    """Checks the upper rows of as many matrices: (count, 3, 4) with count > 0, each as in `check_matrix`."""
    if places.shape != (count, 3, 4) or not count:
        raise SceneError(f"{name}: {key} must be an (n, 3, 4) array, with n > 0 the same for all")
    bad = np.flatnonzero(~are_usable(places))
    if len(bad):
        raise SceneError(
            f"{name}: {key}[{bad[0]}] is of no use; accepted: finite, invertible and with an inverse "
            f"below {FLOAT32_MAX:.3g}"
        )


def check_finite_array(name: str, key: str, array: np.ndarray, shape: tuple[int | str, ...]) -> None:
    """Checks that an array is finite and has the shape, in which a letter stands for any length."""
    lengths_fit = array.ndim == len(shape) and all(
        isinstance(length, str) or found == length for found, length in zip(array.shape, shape, strict=True)
    )
    if not lengths_fit or not is_finite(array):
        raise SceneError(f"{name}: {key} must be a finite ({', '.join(map(str, shape))}) array")


def check_primvars(name: str, primvars: Mapping[str, np.ndarray], accepted: Sequence[tuple[int, ...]]) -> None:
    """Checks that the shapes of primvars are one of those accepted, each followed by k, the numbers of a value."""
    for key, values in primvars.items():
        if values.shape[:-1] not in accepted:
            shapes = [f"({', '.join(map(str, shape))}, k)" for shape in accepted]
            told = " and ".join(filter(None, [", ".join(shapes[:-1]), shapes[-1]]))
            raise SceneError(f"{name}: primvar {key!r} has the shape {values.shape}; accepted: {told}")


def is_finite(values: np.ndarray) -> bool:
    """True where all values are finite as float32."""
    return bool(np.all(np.abs(values) <= FLOAT32_MAX))


def listed(values: Iterable[float]) -> str:
    """Numbers in brackets."""
    return "(" + ", ".join(f"{value:g}" for value in values) + ")"


def shown(value: float) -> str:
    """Short where that is the value; in full where the rounding would hide what is wrong."""
    short = f"{value:g}"
    return short if float(short) == value or not math.isfinite(value) else repr(float(value))
