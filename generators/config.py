"""The YAML config of a dataset: its keys, and errors that say where and what to write instead.

An axis sweeps one parameter of the medium. Its form is one of

| form | values |
|---|---|
| ``[a, b, c]`` or ``{values: [a, b, c]}`` | as listed |
| ``{linspace: [start, stop, n]}`` | n values at equal distances, ends included |
| ``{logspace: [start, stop, n]}`` | n values at equal ratios, ends included; start and stop are the values themselves |
| ``{uniform: [low, high]}`` | drawn anew for each sample, evenly in the value |
| ``{loguniform: [low, high]}`` | drawn anew for each sample, evenly in the logarithm |

Spaced values are rounded to 12 digits, so that a step from -0.7 to -0.1 meets -0.5 itself: H = -0.5 is white noise,
and its nearest neighbour among the doubles is not.
"""

from __future__ import annotations

import copy
import difflib
import io
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from fgf_warp.errors import ConfigError
from fgf_warp.output.atomic import write_bytes
from fgf_warp.settings import PRESETS, SEED_MAX, Aov, RenderSettings

AxisParameter = Literal["H", "g", "S_w", "sigma_m", "L", "kappa", "albedo"]
AovName = Literal[
    "depth",
    "variance",
    "transmittance",
    "albedo",
    "samples",
    "collisions",
    "path_length",
    "normal",
    "prim_id",
    "instance_id",
    "motion",
    "optical_depth",
    "scatterings",
    "direct",
    "indirect",
]
AXIS_PARAMETERS: tuple[str, ...] = get_args(AxisParameter)
RANDOM_FORMS = ("uniform", "loguniform")
AXIS_FORMS = ("values", "linspace", "logspace", *RANDOM_FORMS)
SPACING_DIGITS = 12
"""Of spaced values: far below what a picture shows, far above the rounding of the spacing."""
EXPOSURE_MAX = 32.0
"""[stop], either way: far beyond what a picture needs, and far from where 2^x is no float."""

Count = Annotated[int, Field(ge=1)]
# A YAML sequence is a list; not being strict about the sequence leaves its items strict.
Spacing = Annotated[tuple[float, float, Count], Field(strict=False)]
Interval = Annotated[tuple[float, float], Field(strict=False)]


class _Model(BaseModel):
    # Strict: "0.5" in quotes or `true` for a number is a slip of the pen.
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class AxisConfig(_Model):
    """The values of one swept parameter; the module's table lists the forms."""

    values: Annotated[list[float], Field(min_length=1)] | None = None
    linspace: Spacing | None = None
    logspace: Spacing | None = None
    uniform: Interval | None = None
    loguniform: Interval | None = None

    @model_validator(mode="before")
    @classmethod
    def _accept_list(cls, found: Any) -> Any:
        if isinstance(found, list):
            return {"values": found}
        if not isinstance(found, dict):
            raise PydanticCustomError("axis_form", f"a list of numbers, or one of {', '.join(AXIS_FORMS)}")
        return found

    @model_validator(mode="after")
    def _check_form(self) -> AxisConfig:
        if sum(getattr(self, form) is not None for form in AXIS_FORMS) != 1:
            raise PydanticCustomError("axis_form", f"exactly one of {', '.join(AXIS_FORMS)}")
        for form in ("logspace", "loguniform"):
            bounds = getattr(self, form)
            if bounds is not None and min(bounds[:2]) <= 0:
                raise PydanticCustomError("axis_positive", f"{form} with both ends > 0")
        for form in RANDOM_FORMS:
            bounds = getattr(self, form)
            if bounds is not None and not bounds[0] < bounds[1]:
                raise PydanticCustomError("axis_order", f"{form}: [low, high] with low < high")
        return self

    @property
    def is_random(self) -> bool:
        """True where each sample draws its own value."""
        return self.uniform is not None or self.loguniform is not None

    def grid_values(self) -> tuple[float, ...]:
        """The values of an axis that is not random, in order."""
        if self.values is not None:
            return tuple(float(value) for value in self.values)
        if self.linspace is not None:
            # Near zero the rounding left by the spacing is relative to the span, not to the value.
            values = np.linspace(*self.linspace)
            negligible = 1e-12 * abs(self.linspace[1] - self.linspace[0])
            return _rounded(self.linspace, np.where(np.abs(values) < negligible, 0.0, values))
        assert self.logspace is not None
        return _rounded(self.logspace, np.geomspace(*self.logspace))

    def value_at(self, quantile: float) -> float:
        """The value of a random axis below which a share `quantile` in [0, 1) of all draws lies."""
        if self.uniform is not None:
            low, high = self.uniform
            return low + (high - low) * quantile
        assert self.loguniform is not None
        low, high = self.loguniform
        return low * math.exp(quantile * math.log(high / low))


class ImageConfig(_Model):
    """Size of the images [pixel]; what is absent follows from the stage."""

    width: Count | None = None
    height: Count | None = None


class SweepConfig(_Model):
    """A dataset.

    Args:
        name: of the dataset; the title of its contact sheet.
        scene: the USD stage, relative to the config file.
        camera: prim path or name; where absent, the render settings' camera, else the stage's first, with a
            warning where it has several, else a view from the front.
        frame: time code; where absent, the stage's startTimeCode, else each attribute's earliest sample.
        medium: prim path of the material to sweep; needed where the stage has several media.
        seed: of the dataset, in [0, 2^64); every sample's seed and random values follow from it.
        image: size of the images.
        spp: samples per pixel, >= 1; in place of the preset's.
        preset: one of `fgf_warp.settings.PRESETS`.
        aovs: planes to write beside radiance and alpha, see `fgf_warp.settings.Aov`.
        png: whether to write a PNG beside each EXR.
        exposure: of the PNGs and the contact sheet [stop], in [-32, 32].
        transport: in place of the one that the medium asks for.
        line_variance: likewise.
        axes: what to sweep; the last axis varies fastest.
        draws: samples per cell of the grid, >= 1.
        output: folder of the dataset; ``datasets/NAME`` where absent.
    """

    name: Annotated[str, Field(min_length=1)]
    scene: Annotated[str, Field(min_length=1)]
    camera: str | None = None
    frame: float | None = None
    medium: str | None = None
    seed: Annotated[int, Field(ge=0, le=SEED_MAX)] = 0
    image: ImageConfig = ImageConfig()
    spp: Count | None = None
    preset: Literal["preview", "balanced", "reference"] = "balanced"
    aovs: list[AovName] = []
    png: bool = True
    exposure: Annotated[float, Field(ge=-EXPOSURE_MAX, le=EXPOSURE_MAX)] = 0.0
    transport: Literal["reciprocal", "renewal", "mixed"] | None = None
    line_variance: Literal["asymptotic", "exact"] | None = None
    axes: dict[AxisParameter, AxisConfig] = {}
    draws: Count = 1
    output: str | None = None

    def render_settings(self, width: int, height: int, device: str) -> RenderSettings:
        """Settings of every sample, with seed 0 in the place of its own.

        Raises:
            ConfigError: for a size that is not accepted.
        """
        preset = PRESETS[self.preset]
        return RenderSettings(
            width=width,
            height=height,
            spp=self.spp or preset.spp,
            max_depth=preset.max_depth,
            roulette_depth=preset.roulette_depth,
            aovs=frozenset(Aov(name) for name in self.aovs),
            device=device,
        )


@dataclass(frozen=True, eq=False)
class LoadedConfig:
    """A config with the document it came from.

    Args:
        config: as validated.
        path: the file.
        document: the YAML in force, overrides applied, comments kept.
    """

    config: SweepConfig
    path: Path
    document: CommentedMap

    @property
    def scene_path(self) -> Path:
        """The USD stage, found from the config file's folder."""
        return self.path.parent / self.config.scene

    def write(self, folder: Path) -> None:
        """Writes the config in force to ``config.yaml`` in `folder`, from where it works again.

        Raises:
            OutputError: where it cannot be written.
        """
        document = copy.deepcopy(self.document)
        document["scene"] = Path(os.path.relpath(self.scene_path, folder)).as_posix()
        text = io.StringIO()
        YAML().dump(document, text)
        write_bytes(folder / "config.yaml", text.getvalue().encode())


def load_config(path: Path, overrides: Sequence[str] = ()) -> LoadedConfig:
    """Reads and validates a config.

    Args:
        path: the YAML file.
        overrides: each ``key.key=value``, the value in YAML; they take the place of what the file says.

    Raises:
        ConfigError: in one line: file, line and key (or the override), what was found, what is accepted.
    """
    document = _read_document(path)
    overridden: dict[tuple[str, ...], str] = {}
    for override in overrides:
        overridden[_apply_override(document, override)] = override
    try:
        config = SweepConfig.model_validate(_plain(document))
    except ValidationError as error:
        raise ConfigError(_explain(error.errors()[0], path, document, overridden)) from error
    return LoadedConfig(config, path, document)


def _read_document(path: Path) -> CommentedMap:
    try:
        document = YAML().load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not a text file in UTF-8") from error
    except MarkedYAMLError as error:
        line = f":{error.problem_mark.line + 1}" if error.problem_mark else ""
        raise ConfigError(f"{path}{line}: not valid YAML: {error.problem}") from error
    except YAMLError as error:
        raise ConfigError(f"{path}: not valid YAML: {' '.join(str(error).split())}") from error
    if not isinstance(document, CommentedMap):
        raise ConfigError(f"{path}: found {_shown(document)}; accepted: a mapping with the keys {_listed(SweepConfig)}")
    return document


def _apply_override(document: CommentedMap, override: str) -> tuple[str, ...]:
    """Sets the value in the document; returns its key path."""
    dotted, separator, text = override.partition("=")
    keys = tuple(dotted.strip().split("."))
    if not separator or not all(keys):
        raise ConfigError(f"--set {override}: accepted: KEY=VALUE, with dots between nested keys")
    try:
        value = YAML().load(text)
    except YAMLError as error:
        raise ConfigError(f"--set {override}: the value is not valid YAML") from error
    node = document
    for depth, key in enumerate(keys[:-1], start=1):
        node = node.setdefault(key, CommentedMap())
        if not isinstance(node, CommentedMap):
            raise ConfigError(f"--set {override}: {'.'.join(keys[:depth])} is {_shown(node)}, which has no keys")
    node[keys[-1]] = value
    return keys


def _plain(node: Any) -> Any:
    """The document as plain dicts, lists and scalars, which is what pydantic is strict about."""
    if isinstance(node, CommentedMap):
        return {key: _plain(value) for key, value in node.items()}
    if isinstance(node, CommentedSeq):
        return [_plain(item) for item in node]
    for scalar in (bool, int, float, str):
        if isinstance(node, scalar):
            return scalar(node)
    return node


def _explain(error: ErrorDetails, path: Path, document: CommentedMap, overridden: dict[tuple[str, ...], str]) -> str:
    """One line that says where, what was found, and what is accepted."""
    keys = _keys_in(document, error["loc"])
    where = f"{_origin(keys, path, document, overridden)}: {_dotted(error['loc'], keys)}"
    if error["type"] == "extra_forbidden":
        return f"{where}: unknown key; {_accepted_keys(str(keys[-1]), _model_of(keys))}"
    if error["loc"][-1] == "[key]":
        return f"{where}: no such parameter to sweep; {_accepted_names(str(keys[-1]), AXIS_PARAMETERS)}"
    if error["type"] == "missing" and isinstance(error["loc"][-1], str):
        return f"{where}: this key is missing"
    accepted = error["msg"].removeprefix("Input should be ")
    if error["type"] == "missing":
        accepted = "one item more"
    return f"{where}: found {_shown(error['input'])}; accepted: {accepted}"


def _keys_in(document: CommentedMap, location: Sequence[int | str]) -> tuple[int | str, ...]:
    """The part of pydantic's location that the document has; the rest names alternatives inside the models."""
    found: list[int | str] = []
    node: Any = document
    for key in location:
        if (isinstance(node, CommentedMap) and key in node) or (
            isinstance(node, CommentedSeq) and isinstance(key, int) and key < len(node)
        ):
            found.append(key)
            node = node[key]
    return tuple(found)


def _dotted(location: Sequence[int | str], keys: Sequence[int | str]) -> str:
    """The location as a user would write it."""
    shown = [*keys]
    if location[-1] not in shown and isinstance(location[-1], str) and location[-1] not in (*AXIS_FORMS, "[key]"):
        shown.append(location[-1])
    text = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in shown)
    return text.removeprefix(".")


def _origin(
    keys: Sequence[int | str], path: Path, document: CommentedMap, overridden: dict[tuple[str, ...], str]
) -> str:
    for override_keys, override in overridden.items():
        if tuple(keys[: len(override_keys)]) == override_keys:
            return f"--set {override}"
    node: Any = document
    line = 0
    for key in keys:
        line = (node.lc.item(key) if isinstance(key, int) else node.lc.key(key))[0]
        node = node[key]
    return f"{path}:{line + 1}" if keys else str(path)


def _model_of(keys: Sequence[int | str]) -> type[BaseModel]:
    """The model that has, or rather has not, the last of these keys."""
    if len(keys) == 1:
        return SweepConfig
    return ImageConfig if keys[0] == "image" else AxisConfig


def _accepted_keys(found: str, model: type[BaseModel]) -> str:
    return _accepted_names(found, tuple(model.model_fields))


def _accepted_names(found: str, names: Sequence[str]) -> str:
    nearest = difflib.get_close_matches(found, names, n=1, cutoff=0.5)
    by_case = [name for name in names if name.lower() == found.lower()]
    hint = f"did you mean {(by_case or nearest)[0]}? " if by_case or nearest else ""
    return f"{hint}accepted: {', '.join(names)}"


def _listed(model: type[BaseModel]) -> str:
    return ", ".join(model.model_fields)


def _shown(value: Any) -> str:
    text = "nothing" if value is None else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _rounded(spacing: tuple[float, float, int], values: np.ndarray) -> tuple[float, ...]:
    """Spaced values at 12 digits; the ends as they were written."""
    inner = [float(f"{value:.{SPACING_DIGITS}g}") for value in values]
    inner[0] = float(spacing[0])
    if len(inner) > 1:
        inner[-1] = float(spacing[1])
    return tuple(inner)
