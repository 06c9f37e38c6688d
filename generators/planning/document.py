"""The YAML file of a config: read, overridden, validated, with errors that say where and what to write instead."""

from __future__ import annotations

import copy
import difflib
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from fgf_warp.errors import ConfigError
from generators.dataset.layout import scene_file
from generators.planning.axes import AXIS_FORMS, AxisConfig, GridConfig
from generators.planning.config import (
    ImageConfig,
    OrbitConfig,
    QualityConfig,
    SplitsConfig,
    SweepConfig,
    TargetsConfig,
)
from generators.planning.scenes import stage_name
from generators.planning.yaml_text import TEXT_MAX, YamlTextError, parse_yaml
from generators.wording import one_line

Keys = tuple[int | str, ...]
"""Where a value is in a document."""

ModelT = TypeVar("ModelT", bound=BaseModel)

MODELS: dict[Keys, type[BaseModel]] = {
    (): SweepConfig,
    ("image",): ImageConfig,
    ("orbit",): OrbitConfig,
    ("quality",): QualityConfig,
    ("splits",): SplitsConfig,
    ("targets",): TargetsConfig,
    ("targets", "transmittance"): GridConfig,
}
"""What may have which keys in the config of a dataset; all else is an axis."""
COMPARED = {
    "greater_than": "greater than",
    "greater_than_equal": "greater than or equal to",
    "less_than": "less than",
    "less_than_equal": "less than or equal to",
}
"""What is said of a bound, which may have many digits."""
OVERRIDE_KEYS_MAX = 10
"""Of an override; a config needs 5."""
OVERRIDE_SHOWN, KEY_SHOWN = 200, 60
"""Characters of an override and of a key in a message."""


@dataclass(frozen=True, eq=False)
class LoadedConfig:
    """A config with the document it came from.

    Args:
        config: as validated.
        path: the file.
        document: the YAML in force, overrides applied, comments kept.
        overridden: the overrides, by the keys of what they set.
    """

    config: SweepConfig
    path: Path
    document: CommentedMap
    overridden: Mapping[Keys, str] = field(default_factory=dict)

    def file(self, name: str) -> Path:
        """A file that the config names, found from its own folder."""
        return self.path.parent / name

    def error(self, keys: Keys, text: str) -> ConfigError:
        """What is wrong with a value.

        Args:
            keys: where it is; the last of them need not be in the document.
            text: what is wrong.
        """
        there = _keys_in(self.document, keys)
        where = _origin(there, self.path, self.document, self.overridden)
        return ConfigError(f"{where}: {_joined(keys)}: {one_line(text)}")

    def to_bytes(self) -> bytes:
        """The config in force as a dataset keeps it: its stages are the dataset's own, and what they were is told."""
        document, told = copy.deepcopy(self.document), dict[str, str]()

        def own(name: str) -> str:
            held = scene_file(stage_name(name))
            if name != held:
                told[held] = name
            return held

        if "scene" in document:
            document["scene"] = own(document["scene"])
        for axis in self.scene_axes:
            listed = document["axes"][axis]
            names = listed if isinstance(listed, CommentedSeq) else listed["values"]
            names[:] = [own(name) for name in names]
        content = io.BytesIO()
        for held, name in told.items():
            # As a literal, since a name may hold the end of a line.
            content.write(f"# {held} was {name!r}\n".encode())
        YAML().dump(document, content)
        return content.getvalue()

    @property
    def scene_axes(self) -> tuple[str, ...]:
        """Keys of the axes whose values are stages."""
        return tuple(key for key, axis in self.config.axes.items() if (axis.target or key) == "scene")


def load_config(path: Path, overrides: Sequence[str] = ()) -> LoadedConfig:
    """Reads and validates a config.

    Args:
        path: the YAML file.
        overrides: each ``key.key=value``, the value in YAML; they take the place of what the file says.

    Raises:
        ConfigError: in one line: file, line and key (or the override), what was found, what is accepted.
    """
    document = read_document(path, SweepConfig)
    config, overridden = validate_document(document, path, SweepConfig, _model_at, overrides)
    return LoadedConfig(config, path, document, overridden)


def read_document(path: Path, model: type[BaseModel]) -> CommentedMap:
    """Reads a YAML file.

    Args:
        path: of the file.
        model: what is expected in it, for the message.

    Raises:
        ConfigError: where it cannot be read, is not valid YAML, or no mapping.
    """
    try:
        document = parse_yaml(_read_text(path))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not a text file in UTF-8") from error
    except YamlTextError as error:
        line = "" if error.line is None else f":{error.line}"
        raise ConfigError(f"{path}{line}: {error}") from error
    if not isinstance(document, CommentedMap):
        keys = ", ".join(model.model_fields)
        raise ConfigError(f"{path}: found {shown(document)}; accepted: a mapping with the keys {keys}")
    return document


def validate_document(
    document: CommentedMap,
    path: Path,
    model: type[ModelT],
    model_at: Callable[[Keys], type[BaseModel]],
    overrides: Sequence[str] = (),
) -> tuple[ModelT, dict[Keys, str]]:
    """Puts overrides into a document, and checks it.

    Args:
        document: of `read_document`; the overrides change it.
        path: where it came from, for messages.
        model: what it must be.
        model_at: what is expected at a place in it, for messages.
        overrides: each ``key.key=value``, the value in YAML; they take the place of what the document says.

    Returns:
        The model, and the overrides by the keys of what they set.

    Raises:
        ConfigError: in one line: file, line and key (or the override), what was found, what is accepted.
    """
    overridden: dict[Keys, str] = {}
    for override in overrides:
        overridden[_apply_override(document, override)] = override
    try:
        return model.model_validate(_plain(document)), overridden
    except ValidationError as error:
        raise ConfigError(_explain(error.errors()[0], path, document, overridden, model_at)) from error


def _read_text(path: Path) -> str:
    """No device or pipe, which may never end."""
    if path.exists() and not path.is_file():
        raise ConfigError(f"{path}: is no file; accepted: a file with YAML in it")
    size = path.stat().st_size
    if size > 4 * TEXT_MAX:  # As UTF-8 has it at most.
        raise ConfigError(f"{path}: is {size} bytes long; accepted: at most {TEXT_MAX} characters")
    return path.read_text(encoding="utf-8")


def nearest(found: str, names: Iterable[str]) -> str:
    """``did you mean NAME? `` where one is near, else nothing."""
    listed = list(names)
    by_case = [name for name in listed if name.lower() == found.lower()]
    near = by_case or difflib.get_close_matches(found, listed, n=1, cutoff=0.5)
    return f"did you mean {near[0]}? " if near else ""


def shown(value: Any) -> str:
    """A value for a message, cut where it is long."""
    return one_line("nothing" if value is None else repr(value), 60)


def _model_at(keys: Keys) -> type[BaseModel]:
    return MODELS.get(keys, AxisConfig)


def _apply_override(document: CommentedMap, override: str) -> Keys:
    """Sets the value in the document; returns its key path."""
    dotted, separator, text = override.partition("=")
    keys = tuple(dotted.strip().split("."))
    if not separator or not all(keys) or len(keys) > OVERRIDE_KEYS_MAX:
        raise ConfigError(f"{_set(override)}: accepted: KEY=VALUE, with dots between nested keys")
    try:
        value = parse_yaml(text)
    except YamlTextError as error:
        raise ConfigError(f"{_set(override)}: {error}") from error
    node = document
    for depth, key in enumerate(keys[:-1], start=1):
        node = node.setdefault(key, CommentedMap())
        if not isinstance(node, CommentedMap):
            raise ConfigError(f"{_set(override)}: {_joined(keys[:depth])} is {shown(node)}, which has no keys")
    node[keys[-1]] = value
    return keys


def _set(override: str) -> str:
    return f"--set {one_line(override, OVERRIDE_SHOWN)}"


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


def _explain(
    error: ErrorDetails,
    path: Path,
    document: CommentedMap,
    overridden: Mapping[Keys, str],
    model_at: Callable[[Keys], type[BaseModel]],
) -> str:
    """One line that says where, what was found, and what is accepted."""
    keys = _keys_in(document, error["loc"])
    where = f"{_origin(keys, path, document, overridden)}: {_dotted(error['loc'], keys)}"
    if error["type"] == "extra_forbidden":
        names = tuple(model_at(keys[:-1]).model_fields)
        return f"{where}: unknown key; {nearest(str(keys[-1]), names)}accepted: {', '.join(names)}"
    if error["type"] == "missing" and isinstance(error["loc"][-1], str):
        return f"{where}: this key is missing"
    bounds = error.get("ctx", {})
    if error["type"] == "missing":
        accepted = "one item more"
    elif error["type"] in ("too_short", "string_too_short"):
        accepted = f"at least {bounds['min_length']} {'character' if error['type'].startswith('string') else 'item'}"
    elif error["type"] == "too_long":
        accepted = f"at most {bounds['max_length']} items"
    elif error["type"] in COMPARED and isinstance(bound := next(iter(bounds.values())), float):
        accepted = f"{COMPARED[error['type']]} {bound:g}"
    else:
        accepted = error["msg"].removeprefix("Input should be ")
    return f"{where}: found {shown(error['input'])}; accepted: {accepted}"


def _keys_in(document: CommentedMap, location: Sequence[int | str]) -> Keys:
    """The part of a location that the document has; of pydantic's, the rest names alternatives inside the models."""
    found: list[int | str] = []
    node: Any = document
    for key in location:
        if (isinstance(node, CommentedMap) and key in node) or (
            isinstance(node, CommentedSeq) and isinstance(key, int) and key < len(node)
        ):
            found.append(key)
            node = node[key]
    return tuple(found)


def _dotted(location: Sequence[int | str], keys: Keys) -> str:
    """The location as a user would write it."""
    if location[-1] not in keys and isinstance(location[-1], str) and location[-1] not in (*AXIS_FORMS, "[key]"):
        return _joined((*keys, location[-1]))
    return _joined(keys)


def _joined(keys: Keys) -> str:
    parts = (f"[{key}]" if isinstance(key, int) else f".{one_line(key, KEY_SHOWN)}" for key in keys)
    return "".join(parts).removeprefix(".")


def _origin(keys: Keys, path: Path, document: CommentedMap, overridden: Mapping[Keys, str]) -> str:
    for override_keys, override in overridden.items():
        if keys[: len(override_keys)] == override_keys:
            return _set(override)
    node: Any = document
    line = 0
    for key in keys:
        if not hasattr(node, "lc") or node.lc.data is None or key not in node.lc.data:
            break  # Set by an override, beside what the file has.
        line = (node.lc.item(key) if isinstance(key, int) else node.lc.key(key))[0]
        node = node[key]
    return f"{path}:{line + 1}" if keys else str(path)
