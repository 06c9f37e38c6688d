"""The stages that a dataset holds: whether they are as they were written, and where they can be opened."""

from __future__ import annotations

import atexit
from contextlib import ExitStack
from functools import lru_cache
from pathlib import Path

from fgf_warp.errors import CorruptFileError
from generators.dataset import layout
from generators.dataset.record import STAGES_COME_BACK, SceneRecord, decode_scene_record, file_entry, file_entry_at
from generators.dataset.scratch import scratch_folder
from generators.dataset.store import Store

Problem = tuple[str, str, str]
"""Name of a file, what was found, and what is expected."""
_COPIES = ExitStack()
"""Of stages from object stores; they go with the process."""
atexit.register(_COPIES.close)


def scene_folder(location: str) -> Path:
    """The folder of a dataset's stages: its own, or of an object store a copy that lives as long as the process.

    Args:
        location: of the dataset.

    Raises:
        CorruptFileError: where a file of an object store is not as it was written.
    """
    store = Store(location)
    if store.folder:
        return store.folder / layout.SCENE
    if not store.exists(layout.SCENE_RECORD):
        raise CorruptFileError(f"{location}/{layout.SCENE_RECORD}: is missing; {STAGES_COME_BACK}")
    return _copied(location, store.read(layout.SCENE_RECORD)) / layout.SCENE


def config_file(location: str) -> Path:
    """A dataset's config, from which its stages are found; of an object store as `scene_folder`.

    Args:
        location: of the dataset.

    Raises:
        CorruptFileError: as `scene_folder`.
    """
    store = Store(location)
    if store.folder:
        return store.folder / layout.CONFIG
    record = store.read(layout.SCENE_RECORD) if store.exists(layout.SCENE_RECORD) else b""
    path = _copied(location, record) / layout.CONFIG
    path.unlink(missing_ok=True)
    if store.exists(layout.CONFIG):
        store.fetch(layout.CONFIG, path)
    return path


def scene_problems(store: Store) -> list[Problem]:
    """What is wrong with the files of a dataset's stages, by sizes and hashes."""
    sizes = {name.removeprefix(f"{layout.SCENE}/"): size for name, size in store.sizes(layout.SCENE).items()}
    try:
        record = read_scene_record(store)
    except CorruptFileError:
        return [(layout.SCENE_RECORD, "is damaged", "the list of the stages' files")]
    if record is None:
        return [(layout.SCENE_RECORD, "missing", "there, with the stages")]
    found: list[Problem] = []
    for name, entry in record.files.items():
        path = layout.scene_file(name)
        if name not in sizes:
            found.append((path, "missing", "there, as a part of the stage"))
        elif sizes[name] != entry.bytes:
            found.append((path, f"{sizes[name]:,} bytes", f"{entry.bytes:,} bytes, as {layout.SCENE_RECORD} says"))
        else:
            found += _misread(store, path, entry.sha256)
    return found


def read_scene_record(store: Store) -> SceneRecord | None:
    """What the stages are made of; None where there are none.

    Raises:
        CorruptFileError: where it is not what was written.
    """
    if not store.exists(layout.SCENE_RECORD):
        return None
    return decode_scene_record(store.read(layout.SCENE_RECORD), f"{store.location}/{layout.SCENE_RECORD}")


def _misread(store: Store, path: str, sha256: str) -> list[Problem]:
    if store.folder and not (store.folder / path).is_file():
        return [(path, "is no file", "a file that can be read")]
    try:
        # Of a folder, without holding it in memory: pictures may be large.
        found = (file_entry_at(store.folder / path) if store.folder else file_entry(store.read(path))).sha256
    except (OSError, CorruptFileError) as error:
        return [(path, f"cannot be read: {error}", "a file that can be read")]
    return [] if found == sha256 else [(path, f"sha256 {found}", f"{sha256}, as {layout.SCENE_RECORD} says")]


@lru_cache
def _copied(location: str, record: bytes) -> Path:
    """A folder with the stages of an object store; another one for each record."""
    store, copy = Store(location), _COPIES.enter_context(scratch_folder())
    folder = copy / layout.SCENE
    folder.mkdir()
    files = decode_scene_record(record, f"{location}/{layout.SCENE_RECORD}").files if record else {}
    for name, entry in files.items():
        try:
            store.fetch(layout.scene_file(name), folder / name)
        except FileNotFoundError as error:
            raise CorruptFileError(f"{location}/{layout.scene_file(name)}: is missing; {STAGES_COME_BACK}") from error
        if file_entry_at(folder / name) != entry:
            raise CorruptFileError(f"{location}/{layout.scene_file(name)}: is damaged; {STAGES_COME_BACK}")
    return copy
