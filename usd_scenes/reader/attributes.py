"""Values of attributes, checked where they are read.

USD stores most parameters as float32. A value is handed on as the shortest decimal that this float32 stands for,
which is what its author wrote: -0.49, not -0.49000000953674316. So messages, labels and sweeps agree.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from pxr import Sdf, Usd, UsdShade, Vt

from fgf_warp.errors import SceneError
from fgf_warp.scene import Rgb
from usd_scenes.reader.context import StageContext

NUMBERS = "iuf"
"""NumPy's kinds of integers and floats."""
SINGLE_PRECISION = {Sdf.ValueTypeNames.Float, Sdf.ValueTypeNames.Half}


@dataclass(frozen=True)
class Range:
    """Numbers that are accepted.

    Args:
        words: what they are, such as "[0, 1]".
        low: the least.
        high: the largest.
        excludes_low: True where `low` itself is not accepted, so that what is too low has no nearest number.
        is_cut: False where what is out of it is not to become the nearest number.
        is_whole: True where only integers are accepted.
    """

    words: str
    low: float = -math.inf
    high: float = math.inf
    excludes_low: bool = False
    is_cut: bool = True
    is_whole: bool = False

    def holds(self, number: float) -> bool:
        """True where a number is accepted."""
        is_within = self.low <= number <= self.high and not (self.excludes_low and number == self.low)
        return is_within and (not self.is_whole or float(number).is_integer())

    def nearest(self, number: float) -> float | None:
        """The accepted number that is nearest; None where there is none.

        Returns:
            A finite number: the given one where it is accepted, else `low` or `high`.
        """
        if math.isnan(number) or not (self.is_cut or self.holds(number)) or (self.excludes_low and number <= self.low):
            return None
        near = min(max(number, self.low), self.high)
        return near if math.isfinite(near) else None


UNIT = Range("[0, 1]", 0.0, 1.0)
NOT_NEGATIVE = Range(">= 0", 0.0)
POSITIVE = Range("> 0", 0.0, excludes_low=True)
FINITE = Range("a finite number")
WHOLE = Range("an integer", is_cut=False, is_whole=True)
FLAGS = {"true": True, "false": False}
COUNTS = {2: "two", 3: "three", 4: "four"}


def is_authored(attribute: Usd.Attribute) -> bool:
    """True where the attribute has a value of its own or a connection, not only a fallback."""
    return bool(attribute) and (attribute.HasAuthoredValue() or attribute.HasAuthoredConnections())


def plain_source(attribute: Usd.Attribute) -> Usd.Attribute | None:
    """The attribute that holds the value, or None where no plain value does.

    An input may be connected to an input of an enclosing material or node graph, whose value is then meant. Where
    it is connected to the output of a shader, such as a texture, it has no plain value.
    """
    if not attribute.HasAuthoredConnections():
        return attribute
    sources = UsdShade.Utils.GetValueProducingAttributes(UsdShade.Input(attribute))
    return sources[0] if len(sources) == 1 and not UsdShade.Output.IsOutput(sources[0]) else None


def read_number(
    attribute: Usd.Attribute, time: Usd.TimeCode, within: Range = FINITE, default: float | None = None
) -> float:
    """A number.

    Args:
        attribute: may be undefined if there is a `default`.
        time: where it is sampled.
        within: the accepted range.
        default: taken where the attribute has no value.

    Returns:
        As its author wrote it, see `as_written`.

    Raises:
        SceneError: for no value and no default, a value that is no finite number, or one that is not accepted.
    """
    value = attribute.Get(time) if attribute else None
    if value is None:
        value = default
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _refusal(attribute, value, within.words)
    number = float(value)
    if not math.isfinite(number) or not within.holds(number):
        raise _refusal(attribute, value, within.words)
    return as_written(number) if attribute and attribute.GetTypeName() in SINGLE_PRECISION else number


def read_color(attribute: Usd.Attribute, time: Usd.TimeCode) -> Rgb:
    """A linear Rec.709 color.

    Returns:
        Three numbers of any sign, as their author wrote them, see `as_written`.

    Raises:
        SceneError: for no value, or one that is not three finite numbers.
    """
    r, g, b = _read_numbers(attribute, time, 3, FINITE, "three finite numbers")
    return r, g, b


def _read_numbers(
    attribute: Usd.Attribute, time: Usd.TimeCode, size: int, within: Range, words: str
) -> tuple[float, ...]:
    """So many finite numbers within a range; `words` are of all of them together."""
    value = attribute.Get(time) if attribute else None
    numbers = _numbers(value, size)
    if numbers is None or not all(math.isfinite(number) and within.holds(number) for number in numbers):
        raise _refusal(attribute, value, words)
    return tuple(as_written(number) for number in numbers)


def read_mended(attribute: Usd.Attribute, context: StageContext, within: Range, default: float) -> float:
    """A number of a shape, a surface or a light: nothing that is out of its range keeps the prim from being rendered.

    Args:
        attribute: may be undefined.
        context: the stage, which is told of what is mended.
        within: the accepted range. A number out of it is cut to it.
        default: taken where there is no value, and, with a warning, where the value has no nearest accepted number.

    Returns:
        A finite number within the range, or the default.

    Raises:
        SceneError: for a value that is not accepted, where the stage is read strictly.
    """
    try:
        return read_number(attribute, context.time, within, default)
    except SceneError as error:
        return _mended(attribute, attribute.Get(context.time), error, context, within, default)


def read_mended_color(attribute: Usd.Attribute, context: StageContext, within: Range, default: Rgb) -> Rgb:
    """The same of a linear Rec.709 color, whose numbers are mended one by one."""
    r, g, b = read_mended_vector(attribute, context, default, within)
    return r, g, b


def read_mended_vector(
    attribute: Usd.Attribute, context: StageContext, default: tuple[float, ...], within: Range = FINITE
) -> tuple[float, ...]:
    """The same of as many numbers as the default has.

    Returns:
        As many finite numbers as the default has: those out of the range cut to it, those without a nearest accepted
        number taken from the default.
    """
    if not attribute or attribute.Get(context.time) is None:
        return default
    size = len(default)
    words = f"{size} finite numbers" if within is FINITE else f"{COUNTS.get(size, size)} numbers {_in(within)}"
    try:
        return _read_numbers(attribute, context.time, size, within, words)
    except SceneError as error:
        found = _numbers(attribute.Get(context.time), size)
        near = [None] * size if found is None else [within.nearest(number) for number in found]
        used = tuple(other if number is None else number for number, other in zip(near, default, strict=True))
        context.mend(f"{_after_prim(attribute, error)}; {_listed(used)} is used", attribute.GetPath())
        return used


def read_mended_token(
    attribute: Usd.Attribute,
    context: StageContext,
    accepted: tuple[str, ...],
    default: str,
    others: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """One of the `accepted` words.

    A value that differs from one in case or separators alone is taken for it, and any other is `default`: either is
    told. A missing one is `default` too.

    Args:
        attribute: may be undefined.
        context: the stage, which is told of what is mended.
        accepted: the words.
        default: one of them, or what stands for none of them.
        others: names that programs have for one of them, in small letters without separators.
    """
    try:
        return read_token(attribute, context.time, accepted) or default
    except SceneError as error:
        alike = {**others, **{_plain(word): word for word in accepted}}
        used = alike.get(_plain(attribute.Get(context.time)), default)
        context.mend(f"{_after_prim(attribute, error)}; {used} is used", attribute.GetPath())
        return used


def read_mended_flag(attribute: Usd.Attribute, context: StageContext, default: bool = False) -> bool:
    """True or false, of a boolean or of a number that is 0 or 1; any other value is told.

    Args:
        attribute: may be undefined.
        context: the stage, which is told of what is mended.
        default: taken where there is no value, and, with a warning, where it is neither.

    Raises:
        SceneError: in place of the warning, where the stage is read strictly.
    """
    value = attribute.Get(context.time) if attribute else None
    if value is None:
        return default
    if isinstance(value, int | float) and value in (0, 1):
        return bool(value)
    used = FLAGS.get(_plain(value), default)
    error = _refusal(attribute, value, "true, false")
    context.mend(f"{_after_prim(attribute, error)}; {str(used).lower()} is used", attribute.GetPath())
    return used


def _in(within: Range) -> str:
    return f"in {within.words}" if within.words.startswith("[") else within.words


def _mended(
    attribute: Usd.Attribute, value: object, error: SceneError, context: StageContext, within: Range, default: float
) -> float:
    near = within.nearest(float(value)) if isinstance(value, int | float) else None
    used = default if near is None else near
    context.mend(f"{_after_prim(attribute, error)}; {used:g} is used", attribute.GetPath())
    return used


def _numbers(value: object, size: int) -> list[float] | None:
    """So many numbers; None of anything else."""
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    return [float(number) for number in numbers] if numbers.shape == (size,) else None


def _plain(word: object) -> str:
    return str(word).lower().replace("_", "").replace("-", "").replace(" ", "")


def _listed(numbers: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{number:g}" for number in numbers) + ")"


def _after_prim(attribute: Usd.Attribute, error: SceneError) -> str:
    """A refusal of this module without the path, which the warning names anyway."""
    return str(error).removeprefix(f"{attribute.GetPath()} ")


def read_array(attribute: Usd.Attribute, time: Usd.TimeCode, dtype: type, width: int = 1) -> np.ndarray:
    """An array of numbers, empty where the attribute has no value.

    Args:
        attribute: of the prim's schema.
        time: where it is sampled.
        dtype: of the result.
        width: numbers in each entry.

    Returns:
        (n,) for `width` 1, else (n, width).

    Raises:
        SceneError: for a value that is no such array, or numbers that are not finite.
    """
    value = attribute.Get(time)
    array: np.ndarray = np.empty(0) if value is None else np.asarray(value)
    if not array.size and array.ndim:
        array = np.empty((0, width) if width > 1 else 0)
    if array.dtype.kind not in NUMBERS or array.shape[1:] != ((width,) if width > 1 else ()) or not array.ndim:
        kind = "numbers" if width == 1 else f"entries of {width} numbers"
        raise SceneError(f"{attribute.GetPath()} is no array; accepted: an array of {kind}")
    if not np.isfinite(array).all():
        raise SceneError(f"{attribute.GetPath()} holds numbers that are not finite; accepted: finite numbers")
    if np.issubdtype(dtype, np.integer) and array.dtype.kind == "f":
        is_whole = (array == np.trunc(array)) & (np.abs(array) <= np.iinfo(dtype).max // 2)
        if not is_whole.all():
            raise SceneError(f"{attribute.GetPath()} holds {array[~is_whole][0]:g}; accepted: integers")
    return array.astype(dtype)


def read_token(attribute: Usd.Attribute, time: Usd.TimeCode, accepted: tuple[str, ...]) -> str | None:
    """One of the `accepted` words, or None where the attribute has no value.

    Raises:
        SceneError: for any other value.
    """
    value = attribute.Get(time) if attribute else None
    if value is not None and value not in accepted:
        raise _refusal(attribute, value, ", ".join(accepted), is_word=True)
    return value


def read_words(attribute: Usd.Attribute, context: StageContext, time: Usd.TimeCode) -> tuple[str, ...]:
    """An array of tokens; none, with a warning, where it is something else.

    Args:
        attribute: may be undefined.
        context: the stage, which is told of what is left out.
        time: where it is sampled.

    Raises:
        SceneError: in place of the warning, where the stage is read strictly.
    """
    value = attribute.Get(time) if attribute else None
    if value is None or isinstance(value, Vt.TokenArray | Vt.StringArray):
        return tuple(value or ())
    context.mend(f"= {value}; accepted: an array of tokens; it is left out", attribute.GetPath())
    return ()


def as_written(number: float) -> float:
    """The shortest decimal that the nearest float32 stands for.

    Returns:
        A float64 whose decimal digits are those of the float32: 0.1 for 0.10000000149011612.
    """
    # Not by str(), whose digits depend on NumPy's print options, which libraries change when they are imported.
    return float(np.format_float_scientific(np.float32(number)))


def shown(number: float) -> str:
    """Short where that is the number; in full where the rounding would hide what is wrong."""
    short = f"{number:g}"
    return short if not math.isfinite(number) or float(short) == number else repr(number)


def _refusal(attribute: Usd.Attribute, value: object, accepted: str, *, is_word: bool = False) -> SceneError:
    if isinstance(value, float) and attribute and attribute.GetTypeName() in SINGLE_PRECISION:
        value = as_written(value)
    found = "no value" if value is None else shown(value) if isinstance(value, float) else str(value)
    if isinstance(value, str) and not (is_word and value):
        found = f'"{value}"'  # Else 5 would be refused where a 5 is accepted.
    return SceneError(f"{attribute.GetPath()} = {found}; accepted: {accepted}")
