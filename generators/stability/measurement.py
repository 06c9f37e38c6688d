"""One quantity over a grid of parameters, and the bound it must keep: what every part of `fgf stability` gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Value = float | str | None


@dataclass(frozen=True)
class Axis:
    """One parameter of a grid.

    Args:
        name: as in configs and labels.
        values: in order; numbers, names, or None for what is not authored.
    """

    name: str
    values: tuple[Value, ...]

    def label(self, index: int) -> str:
        """One value as it is shown."""
        value = self.values[index]
        return "none" if value is None else value if isinstance(value, str) else f"{value:g}"


@dataclass(frozen=True, eq=False)
class Plane:
    """Two axes of a measurement: for each cell the largest value over all others.

    Args:
        rows: the axis that runs down.
        columns: the axis that runs to the right.
        values: (rows, columns) float64; NaN where nothing was measured.
        outside: (rows, columns) bool, where any value is outside its bound.
        refused: (rows, columns) bool, where no parameters are accepted.
        is_share: whether the values are shares of their bounds.
    """

    rows: Axis
    columns: Axis
    values: np.ndarray
    outside: np.ndarray
    refused: np.ndarray
    is_share: bool


@dataclass(frozen=True, eq=False)
class Measurement:
    """One quantity over a grid.

    Args:
        quantity: what was measured.
        axes: of the grid.
        values: float64 of the shape of the axes, >= 0; NaN where there is nothing to measure, and infinity where
            what was found is not a finite number, which is outside every bound.
        bound: that no value may exceed, broadcastable; None where there is none.
        refusals: of the same shape: the reason where the parameters are not accepted, else empty; None where all are.
    """

    quantity: str
    axes: tuple[Axis, ...]
    values: np.ndarray
    bound: np.ndarray | float | None = None
    refusals: np.ndarray | None = None

    def __post_init__(self) -> None:
        shape = tuple(len(axis.values) for axis in self.axes)
        if self.values.shape != shape:
            raise ValueError(f"{self.quantity}: values of shape {self.values.shape} over axes of shape {shape}")

    @property
    def bounds(self) -> np.ndarray:
        """The bound of each value; infinite where there is none.

        Returns:
            Of the shape of the values.
        """
        return np.broadcast_to(np.inf if self.bound is None else np.asarray(self.bound), self.values.shape)

    @property
    def refused(self) -> np.ndarray:
        """Where the parameters are not accepted.

        Returns:
            bool, of the shape of the values.
        """
        return np.zeros(self.values.shape, dtype=bool) if self.refusals is None else self.refusals != ""

    @property
    def shares(self) -> np.ndarray:
        """Each value over its bound: at most 1 inside, NaN where nothing was measured."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.select([self.values == 0, np.isinf(self.values)], [0.0, np.inf], self.values / self.bounds)

    @property
    def outside(self) -> np.ndarray:
        """Where the bound is not kept.

        Returns:
            bool, of the shape of the values; False where nothing was measured.
        """
        return self.shares > 1

    def worst(self) -> tuple[int, ...] | None:
        """Index of the value that is nearest to its bound, or farthest beyond it; None where nothing was measured.

        Returns:
            An index into each axis, in their order.
        """
        shares = self.shares
        if np.isnan(shares).all():
            return None
        return tuple(int(i) for i in np.unravel_index(int(np.nanargmax(shares)), shares.shape))

    def describe(self, index: Sequence[int]) -> str:
        """The parameters of one value."""
        return ", ".join(f"{axis.name} = {axis.label(i)}" for axis, i in zip(self.axes, index, strict=True))

    def plane(self, rows: str, columns: str, *, of_bound: bool = False, **fixed: Value) -> Plane:
        """Two of the axes.

        Args:
            rows: name of the axis that runs down.
            columns: name of the axis that runs to the right.
            of_bound: whether to take each value as a share of its bound.
            fixed: values of further axes; over those that are left the largest value counts.
        """
        names = [axis.name for axis in self.axes]
        chosen = tuple(axis.values.index(fixed[axis.name]) if axis.name in fixed else slice(None) for axis in self.axes)
        left = [name for name in names if name not in fixed]
        others = tuple(i for i, name in enumerate(left) if name not in (rows, columns))
        is_turned = left.index(rows) > left.index(columns)

        def arranged(array: Any) -> np.ndarray:
            return array.T if is_turned else array

        values = (self.shares if of_bound else self.values)[chosen]
        measured = ~np.isnan(values)
        largest = np.where(measured, values, -np.inf).max(axis=others)
        return Plane(
            rows=self.axes[names.index(rows)],
            columns=self.axes[names.index(columns)],
            values=arranged(np.where(measured.any(axis=others), largest, np.nan)),
            outside=arranged(np.any(self.outside[chosen], axis=others)),
            refused=arranged(np.all(self.refused[chosen], axis=others)),
            is_share=of_bound,
        )
