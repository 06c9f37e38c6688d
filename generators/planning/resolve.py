"""What the axes of a config mean: their columns, targets and dependences, checked against each other."""

from __future__ import annotations

import keyword
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from graphlib import CycleError, TopologicalSorter

from fgf_warp.errors import ConfigError
from generators.planning.axes import GRID_FORMS, AxisConfig
from generators.planning.document import Keys, LoadedConfig, nearest, shown
from generators.planning.expressions import CONSTANTS, FUNCTIONS, Expression
from generators.planning.scenes import stage_name
from generators.planning.targets import KNOWN, MEDIUM_FIELDS, NAME, RESERVED, Target, column_name, parse_target

TARGET_FORMS = "/World/Key.inputs:intensity, /World/Ball.xformOp:translate[0] or /World/Set{look}"


@dataclass(frozen=True, eq=False)
class Axis:
    """One axis of a config.

    Args:
        key: in the config.
        name: of its column.
        target: what it changes.
        config: the values it takes.
        expression: that it follows from; None of one on the grid or drawn.
    """

    key: str
    name: str
    target: Target
    config: AxisConfig
    expression: Expression | None

    @cached_property
    def values(self) -> tuple[float | str, ...] | None:
        """In order, of an axis on the grid; else None. Stages are called as in `stage_name`."""
        if not self.config.is_on_grid:
            return None
        values = self.config.grid_values()
        return tuple(stage_name(str(value)) for value in values) if self.target.kind == "scene" else values


@dataclass(frozen=True, eq=False)
class Sweep:
    """The axes of a config, checked.

    Args:
        axes: in the order of the config.
        factors: groups of axes on the grid that advance together, of one or more; the last varies fastest.
        drawn: axes whose values are drawn.
        dependent: axes that follow from others, each after those.
        constraints: that samples must meet.
    """

    axes: tuple[Axis, ...]
    factors: tuple[tuple[Axis, ...], ...]
    drawn: tuple[Axis, ...]
    dependent: tuple[Axis, ...]
    constraints: tuple[Expression, ...]


def resolve(loaded: LoadedConfig) -> Sweep:
    """Checks the axes against each other and the rest of the config.

    Raises:
        ConfigError: with file, line and key.
    """
    config = loaded.config
    if config.spp is not None and config.quality is not None:
        raise loaded.error(("quality",), "both this and spp bound the samples per pixel; accepted: one of them")
    for key in ("spp", "quality"):
        if config.wish is not None and getattr(config, key) is not None:
            raise loaded.error((key,), f"follows from preset {config.preset}; accepted: one of them")
    axes: dict[str, Axis] = {}
    for key, axis in config.axes.items():
        resolved = _resolve_axis(loaded, key, axis)
        if resolved.name in axes:
            raise loaded.error(("axes", key), f"column {resolved.name} is taken by axis {axes[resolved.name].key}")
        axes[resolved.name] = resolved
    _check_targets(loaded, tuple(axes.values()))
    drawn = tuple(axis for axis in axes.values() if axis.config.is_random)
    if config.design != "random" and not drawn:
        raise loaded.error(("design",), f"{config.design} of no drawn axes; accepted: with uniform and the like")
    _check_names(loaded, ("splits", "by"), config.splits.by if config.splits else (), axes)
    return Sweep(
        axes=tuple(axes.values()),
        factors=_factors(loaded, axes),
        drawn=drawn,
        dependent=_in_order(loaded, axes),
        constraints=tuple(
            _parse(loaded, ("constraints", place), text, axes) for place, text in enumerate(config.constraints)
        ),
    )


def _resolve_axis(loaded: LoadedConfig, key: str, axis: AxisConfig) -> Axis:
    target = parse_target(axis.target or key)
    if target is None and axis.target is not None:
        text = f"found {axis.target!r}; {nearest(axis.target, KNOWN)}accepted: {', '.join(KNOWN)}, {TARGET_FORMS}"
        raise loaded.error(("axes", key, "target"), text)
    if target is None:
        text = f"no such parameter to sweep; {nearest(key, KNOWN)}accepted: {', '.join(KNOWN)}, or a target: such as "
        raise loaded.error(("axes", key), text + TARGET_FORMS)
    name = column_name(key)
    is_taken = name in RESERVED or keyword.iskeyword(name) or name in FUNCTIONS or name in CONSTANTS
    if is_taken or not NAME.fullmatch(name) or name.endswith("file_name"):
        accepted = "letters, digits and _, not a column that every dataset has, nor a word of expressions"
        raise loaded.error(("axes", key), f"cannot be the name of a column; accepted: {accepted}")
    if name in KNOWN and str(target) != name:
        raise loaded.error(("axes", key), f"the name says another target than {target}; accepted: another name")
    _check_values(loaded, key, axis, target)
    expression = None
    if axis.expression is not None:
        expression = _parsed(loaded, ("axes", key, "expression"), axis.expression)
    return Axis(key, name, target, axis, expression)


def _check_values(loaded: LoadedConfig, key: str, axis: AxisConfig, target: Target) -> None:
    """Refuses numbers where names belong, and the other way round."""
    if target.has_names and axis.values is None:
        raise loaded.error(("axes", key), f"{target} takes names; accepted: a list of them")
    for place, value in enumerate(axis.values or ()):
        if isinstance(value, str) != target.has_names:
            keys: Keys = ("axes", key, place)
            if isinstance(loaded.document["axes"][key], Mapping):
                keys = ("axes", key, "values", place)
            accepted = "a name" if target.has_names else "a valid number"
            raise loaded.error(keys, f"found {shown(value)}; accepted: {accepted}")


def _check_targets(loaded: LoadedConfig, axes: tuple[Axis, ...]) -> None:
    """Refuses axes that contradict each other or the config's own keys."""
    config = loaded.config
    by_target: dict[str, Axis] = {}
    for axis in axes:
        if other := by_target.get(str(axis.target)):
            raise loaded.error(("axes", axis.key), f"{axis.target} is swept by axis {other.key} already")
        by_target[str(axis.target)] = axis
    for name in ("frame", "camera", "scene", "transport", "line_variance"):
        if name in by_target and getattr(config, name) is not None:
            raise loaded.error((name,), f"axis {by_target[name].key} takes its place; accepted: one of them")
    for one, another, what in (
        ("S_w", "kappa", "the strength of the correlation"),
        *(("albedo", f"albedo_{channel}", "the albedo") for channel in "rgb"),
    ):
        if one in by_target and another in by_target:
            raise loaded.error(("axes",), f"{one} and {another} both set {what}; accepted: one of them")
    if config.scene is None and "scene" not in by_target:
        raise ConfigError(f"{loaded.path}: scene: this key is missing")
    orbiting = [axis for axis in axes if axis.target.kind == "orbit"]
    if config.orbit is None and orbiting:
        raise loaded.error(("axes", orbiting[0].key), "needs the key orbit, which says what the camera looks at")
    if config.orbit is not None and config.orbit.distance is None and "distance" not in by_target:
        raise loaded.error(("orbit",), "distance is missing; accepted: here, or as an axis")


def _factors(loaded: LoadedConfig, axes: Mapping[str, Axis]) -> tuple[tuple[Axis, ...], ...]:
    zipped: dict[str, tuple[Axis, ...]] = {}
    for place, names in enumerate(loaded.config.zip):
        _check_names(loaded, ("zip", place), names, axes)
        group = tuple(axes[name] for name in names)
        for axis in group:
            if axis.values is None:
                text = f"{axis.name} has no values in order; accepted: {', '.join(GRID_FORMS)}"
                raise loaded.error(("zip", place), text)
            if axis.name in zipped or names.count(axis.name) > 1:
                raise loaded.error(("zip", place), f"{axis.name} is named twice")
        if len({len(axis.values or ()) for axis in group}) > 1:
            counts = ", ".join(f"{axis.name} has {len(axis.values or ())}" for axis in group)
            raise loaded.error(("zip", place), f"{counts} values; accepted: equally many")
        zipped |= dict.fromkeys(names, group)
    on_grid = (zipped.get(axis.name, (axis,)) for axis in axes.values() if axis.values is not None)
    return tuple(dict.fromkeys(on_grid))


def _in_order(loaded: LoadedConfig, axes: Mapping[str, Axis]) -> tuple[Axis, ...]:
    """The dependent axes, each after those that it follows from."""
    needed = {}
    for axis in axes.values():
        if axis.expression is not None:
            keys = ("axes", axis.key, "expression")
            _check_names(loaded, keys, sorted(axis.expression.names), axes)
            needed[axis.name] = axis.expression.names
    try:
        order = tuple(TopologicalSorter(needed).static_order())
    except CycleError as error:
        circle = " -> ".join(reversed(error.args[1]))
        raise loaded.error(("axes",), f"expressions go round in a circle: {circle}") from error
    return tuple(axes[name] for name in order if name in needed)


def _parse(loaded: LoadedConfig, keys: Keys, text: str, axes: Mapping[str, Axis]) -> Expression:
    expression = _parsed(loaded, keys, text)
    _check_names(loaded, keys, sorted(expression.names), axes)
    return expression


def _parsed(loaded: LoadedConfig, keys: Keys, text: str) -> Expression:
    try:
        return Expression(text)
    except ConfigError as error:
        raise loaded.error(keys, str(error)) from error


def _check_names(loaded: LoadedConfig, keys: Keys, names: Iterable[str], axes: Mapping[str, Axis]) -> None:
    for name in names:
        if name not in axes:
            accepted = ", ".join(axes) or "none, as there are none"
            raise loaded.error(keys, f"{name!r} is no axis; {nearest(name, axes)}accepted: {accepted}")


def touches_medium(axes: Iterable[Axis]) -> bool:
    """Whether the swept medium has a parameter among them."""
    return any(axis.target.name in MEDIUM_FIELDS and axis.target.kind == "medium" for axis in axes)
