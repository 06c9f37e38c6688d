"""What is written beside the images of a sample."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path, PurePosixPath
from types import NoneType
from typing import Any, TypeVar

from fgf_warp.errors import CorruptFileError

OWN_HASH = "sha256"
"""Key of the hash of all else that a note says."""
STAGES_COME_BACK = "fgf generate with the config that the dataset was made from writes the stages anew"
"""What heals stages, which do not follow from the rest of a dataset."""


@dataclass(frozen=True)
class FileEntry:
    """One file of a sample.

    Args:
        bytes: its size.
        sha256: its hash, hexadecimal.
    """

    bytes: int
    sha256: str


@dataclass(frozen=True)
class Record:
    """What a render reached; equal for equal plans on one kind of device.

    Args:
        index: of the sample.
        plan: digest of the plan.
        spp: samples per pixel.
        truncated: paths cut at the bound on their length.
        nonfinite: samples that were not finite; a complete sample has none.
        standard_error: mean relative standard error of the blocks of pixels; None where a single sample per pixel
            does not tell.
        statistics: of the image, by name; see `generators.publishing.statistics`.
        targets: the extra targets, by name: numbers or lists of numbers.
        files: the sample's other files, but for the timing, by name.
        reached_error: the error over what the config's ``error_over`` says; None where that is the mean.
        chosen_settings: in words, where they are chosen for each sample; else None.
    """

    index: int
    plan: str
    spp: int
    truncated: int
    nonfinite: int
    standard_error: float | None = None
    statistics: Mapping[str, float] = field(default_factory=dict)
    targets: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, FileEntry] = field(default_factory=dict)
    reached_error: float | None = None
    chosen_settings: str | None = None


@dataclass(frozen=True)
class Timing:
    """What differs between two runs of one plan.

    Args:
        render_seconds: wall time of the render [s].
        write_seconds: wall time of encoding and writing [s].
        worker: that rendered it.
        attempts: 1 where the first one came through.
    """

    render_seconds: float
    write_seconds: float
    worker: str
    attempts: int


@dataclass(frozen=True)
class Failure:
    """Why a sample is not there.

    Args:
        index: of the sample.
        reason: in one line.
        attempts: that were made.
    """

    index: int
    reason: str
    attempts: int


@dataclass(frozen=True)
class SceneRecord:
    """What the stages of a dataset are made of.

    Args:
        files: of the folder, by name.
    """

    files: Mapping[str, FileEntry]


Note = TypeVar("Note", Record, Timing, Failure)


def file_entry(content: bytes) -> FileEntry:
    """Size and hash of a file's content.

    Returns:
        Size [byte], and SHA-256 in hexadecimal.
    """
    return FileEntry(len(content), hashlib.sha256(content).hexdigest())


def file_entry_at(path: Path) -> FileEntry:
    """Size and hash of a file, which may be large."""
    with path.open("rb") as file:
        return FileEntry(path.stat().st_size, hashlib.file_digest(file, "sha256").hexdigest())


def encode(value: Record | Timing | Failure | SceneRecord) -> bytes:
    """As JSON, equal for equal values, with a hash of itself: nothing else tells whether a number in it has changed.

    What is None is left out.
    """
    content = {name: entry for name, entry in asdict(value).items() if entry is not None}
    return _as_json({**content, OWN_HASH: hashlib.sha256(_as_json(content)).hexdigest()})


def decode_record(content: bytes, name: str) -> Record:
    """Reads a ``record.json``.

    Args:
        content: of the file.
        name: of the file, for the error.

    Raises:
        CorruptFileError: where it is not what `encode` wrote.
    """
    found = _decode(content, name)
    try:
        files = {key: FileEntry(**entry) for key, entry in found["files"].items()}
        return _checked(Record(**{**found, "files": files}))
    except (KeyError, TypeError, AttributeError) as error:
        raise _damaged(name) from error


def decode_timing(content: bytes, name: str) -> Timing:
    """Reads a ``timing.json``; raises as `decode_record` does."""
    try:
        return _checked(Timing(**_decode(content, name)))
    except TypeError as error:
        raise _damaged(name) from error


def decode_failure(content: bytes, name: str) -> Failure:
    """Reads the note on a failure; raises as `decode_record` does."""
    try:
        return _checked(Failure(**_decode(content, name)))
    except TypeError as error:
        raise _damaged(name) from error


def decode_scene_record(content: bytes, name: str) -> SceneRecord:
    """Reads a ``files.json``; raises as `decode_record` does."""
    try:
        files = {key: FileEntry(**entry) for key, entry in _decode(content, name)["files"].items()}
    except (CorruptFileError, KeyError, TypeError, AttributeError) as error:
        raise CorruptFileError(f"{name}: is damaged; {STAGES_COME_BACK}") from error
    for key in files:
        # A name that leads elsewhere would have a stranger's dataset write there.
        if key in ("", "..") or key != PurePosixPath(key).name or "\\" in key:
            raise CorruptFileError(f"{name}: names {key!r}; accepted: files of its own folder")
    return SceneRecord(files)


def _checked(note: Note) -> Note:
    """The note, if its values have their types.

    Raises:
        TypeError: where one has another.
    """
    types: dict[str, Any] = {"int": int, "str": str, "float": (int, float), "float | None": (int, float, NoneType)}
    for entry in fields(note):
        if not isinstance(getattr(note, entry.name), types.get(str(entry.type), object)):
            raise TypeError(entry.name)
    if isinstance(note, Record):
        numbers = [*note.statistics.values(), *(entry.bytes for entry in note.files.values())]
        if not all(isinstance(number, int | float) for number in numbers) or not isinstance(note.targets, dict):
            raise TypeError("statistics")
    return note


def _decode(content: bytes, name: str) -> dict[str, Any]:
    try:
        found = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise _damaged(name) from error
    if not isinstance(found, dict):
        raise _damaged(name)
    own_hash = found.pop(OWN_HASH, None)
    try:
        is_as_written = own_hash == hashlib.sha256(_as_json(found)).hexdigest()
    except (ValueError, RecursionError):
        is_as_written = False  # such as a NaN
    if not is_as_written:
        raise _damaged(name)
    return found


def _as_json(content: Mapping[str, Any]) -> bytes:
    return (json.dumps(content, indent=1, sort_keys=True, allow_nan=False) + "\n").encode()


def _damaged(name: str) -> CorruptFileError:
    return CorruptFileError(f"{name}: is damaged; fgf verify --repair makes it anew")
