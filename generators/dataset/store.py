"""A dataset's files in a folder or, through fsspec, in an object store."""

from __future__ import annotations

import os
import shutil
import tempfile
import uuid
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from fnmatch import fnmatch
from pathlib import Path

import fsspec
from fsspec.implementations.local import LocalFileSystem
from fsspec.implementations.memory import MemoryFileSystem

from fgf_warp.errors import OutputError
from fgf_warp.output.atomic import PARTIAL_GLOB, flush_to_disk, write_bytes
from generators.dataset import layout

READERS = 32
"""Requests at a time: an object store answers each after tens of milliseconds."""


class Store:
    """Reads and writes the files of one dataset; every name is relative to its location.

    In a folder, what is written appears whole or not at all. In an object store single files do, and of a sample's
    files the record comes last, so a sample is there where its record is.

    Args:
        location: a folder, or a URL that fsspec knows, such as ``s3://bucket/cloud``.

    Raises:
        OutputError: for a URL of a kind that is not installed.
    """

    def __init__(self, location: str | Path) -> None:
        self.location = str(location)
        try:
            self._fs, self._root = fsspec.core.url_to_fs(self.location)
        except (ImportError, ValueError) as error:
            raise OutputError(f"{location}: {error}") from error

    @property
    def folder(self) -> Path | None:
        """Of a dataset on this machine's file system."""
        return Path(self._root) if isinstance(self._fs, LocalFileSystem) else None

    @property
    def is_shared(self) -> bool:
        """Whether other processes see it."""
        return not isinstance(self._fs, MemoryFileSystem)

    def exists(self, name: str) -> bool:
        """Whether there is such a file."""
        return bool(self._fs.isfile(self._path(name)))

    def read(self, name: str) -> bytes:
        """Content of a file.

        Raises:
            FileNotFoundError: where there is none.
        """
        return bytes(self._fs.cat_file(self._path(name)))

    def read_all(self, names: Sequence[str]) -> list[bytes]:
        """Contents of many small files, in order; of an object store several are on their way at a time.

        Raises:
            FileNotFoundError: where one is missing.
        """
        if self.folder:
            return [self.read(name) for name in names]
        with ThreadPoolExecutor(READERS) as pool:
            return list(pool.map(self.read, names))

    def sizes(self, prefix: str = "") -> dict[str, int]:
        """Size of every file [byte] below a folder, by name and in their order; of none where there is no folder."""
        self._fs.invalidate_cache()
        below = self._path(prefix)
        if not self._fs.isdir(below):
            return {}
        found = self._fs.find(below, detail=True)
        return {path[len(self._root) + 1 :]: int(entry["size"]) for path, entry in sorted(found.items())}

    def empty_folders(self) -> list[str]:
        """Folders without any file; an object store has none."""
        self._fs.invalidate_cache()
        found = self._fs.find(self._root, withdirs=True, detail=True)
        folders = {path for path, entry in found.items() if entry["type"] == "directory" and path != self._root}
        holding = {path.rpartition("/")[0] for path in found}
        return sorted(path[len(self._root) + 1 :] for path in folders - holding)

    def entries(self) -> list[str]:
        """Names of files and folders at the top, without those that a killed run left half-written."""
        self._fs.invalidate_cache()
        found = self._fs.ls(self._root, detail=False) if self._fs.isdir(self._root) else []
        names = [str(path).rstrip("/").rpartition("/")[2] for path in found]
        return sorted(name for name in names if not fnmatch(name, PARTIAL_GLOB))

    def sweep(self, samples: Collection[str]) -> None:
        """Removes what killed runs left half-written of these samples, and of the files that are no sample's.

        Args:
            samples: their names.

        Raises:
            OutputError: where a leftover cannot be removed.
        """
        if not self.folder:
            return
        for parent in ("", f"{layout.DATA}/*/", f"{layout.RUN}/", f"{layout.FAILURES}/"):
            for leftover in self.folder.glob(parent + PARTIAL_GLOB):
                owner = leftover.name.split(".")[1]
                if owner in samples or not owner.isdigit():
                    self.remove(str(leftover.relative_to(self.folder)))

    def write(self, name: str, content: bytes) -> None:
        """Writes a file, in the place of an older one.

        Raises:
            OutputError: where it cannot be written; an older one is as before.
        """
        with self._writing(name):
            if self.folder:
                path = self.folder / name
                path.parent.mkdir(parents=True, exist_ok=True)
                write_bytes(path, content)
            else:
                self._fs.pipe_file(self._path(name), content)

    def fetch(self, name: str, path: Path) -> None:
        """Copies a file to this machine.

        Raises:
            FileNotFoundError: where there is none.
        """
        self._fs.get_file(self._path(name), str(path))

    def place(self, folder: str, fill: Callable[[Path], None], last: str) -> None:
        """Writes a folder of files, whole; one that is there gets them one by one, and keeps what else is in it.

        Args:
            folder: its name.
            fill: writes its files into a folder of this machine, and to the disk.
            last: the file that tells of the others; where they appear one by one, it goes first and comes last.

        Raises:
            OutputError: where it cannot be written.
        """
        with self._writing(folder):
            if self.folder:
                _place_folder(self.folder / folder, fill, last)
                return
            with tempfile.TemporaryDirectory(prefix="fgf-") as temporary:
                fill(Path(temporary))
                self.remove(f"{folder}/{last}")
                for path in _last_of(Path(temporary), last):
                    self._fs.put_file(str(path), self._path(f"{folder}/{path.name}"))

    def upload(self, folder: Path) -> None:
        """Writes all files of a folder on this machine; those that are there already are removed should one fail.

        Raises:
            OutputError: where one cannot be written.
        """
        names = [path.name for path in sorted(folder.iterdir())]
        try:
            for name in names:
                with self._writing(name):
                    self._fs.put_file(str(folder / name), self._path(name))
        except BaseException:
            for name in names:
                self.remove(name)
            raise

    def commit(self, folder: str, files: dict[str, bytes], *, replaces: bool = False) -> bool:
        """Makes a sample visible, whole, in the place of one without a record.

        Args:
            folder: of the sample.
            files: content by name, the record among them.
            replaces: whether it takes the place of one with a record too.

        Returns:
            False where it was already there; it is left as it is.

        Raises:
            OutputError: where it cannot be written; nothing of it is visible then.
        """
        with self._writing(folder):
            if self.folder:
                return _commit_folder(self.folder / folder, files, replaces)
            if self.exists(f"{folder}/{layout.RECORD}"):
                if not replaces:
                    return False
                self.remove(folder)
            for name in sorted(files, key=lambda name: name == layout.RECORD):
                self._fs.pipe_file(self._path(f"{folder}/{name}"), files[name])
            return True

    def remove(self, name: str) -> None:
        """Removes a file, or a folder and all in it, if it is there."""
        path = self._path(name)
        with self._writing(name):
            if self._fs.exists(path):
                self._fs.rm(path, recursive=True)

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}" if name else self._root

    @contextmanager
    def _writing(self, name: str) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise OutputError(f"{self.location}/{name}: cannot be written: {error.strerror or error}") from error


def _commit_folder(target: Path, files: dict[str, bytes], replaces: bool) -> bool:
    """By way of a hidden folder that is on the disk before it gets its name."""
    target.parent.mkdir(parents=True, exist_ok=True)
    hidden = _hidden(target)
    try:
        hidden.mkdir()
        for name, content in files.items():
            with (hidden / name).open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
        flush_to_disk(hidden)
        try:
            hidden.rename(target)
        except OSError:
            if not target.is_dir():
                raise
            if not replaces and (target / layout.RECORD).is_file():
                shutil.rmtree(hidden)
                return False
            # What is there goes only now that the new one is on the disk.
            old = target.rename(_hidden(target))
            hidden.rename(target)
            shutil.rmtree(old)
        flush_to_disk(target.parent)
        return True
    except BaseException:
        shutil.rmtree(hidden, ignore_errors=True)
        raise


def _place_folder(target: Path, fill: Callable[[Path], None], last: str) -> None:
    """By way of a hidden folder that is on the disk before it gets its name."""
    hidden = _hidden(target)
    try:
        hidden.mkdir()
        fill(hidden)
        flush_to_disk(hidden)
        if target.is_dir():
            (target / last).unlink(missing_ok=True)
            for path in _last_of(hidden, last):
                path.replace(target / path.name)
            flush_to_disk(target)
        else:
            hidden.rename(target)
        flush_to_disk(target.parent)
    finally:
        shutil.rmtree(hidden, ignore_errors=True)


def _last_of(folder: Path, last: str) -> list[Path]:
    """The files of a folder, one of them behind the others."""
    return sorted(folder.iterdir(), key=lambda path: (path.name == last, path.name))


def _hidden(folder: Path) -> Path:
    """A name beside it that a later run sweeps, see `Store.sweep`."""
    return folder.with_name(f".{folder.name}.{uuid.uuid4().hex[:12]}.partial")
