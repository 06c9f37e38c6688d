"""A dataset's files in a folder or, through fsspec, in an object store."""

from __future__ import annotations

import os
import shutil
import uuid
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from fnmatch import fnmatch
from pathlib import Path
from threading import Lock

import fsspec
from fsspec.implementations.local import LocalFileSystem
from fsspec.implementations.memory import MemoryFileSystem

from fgf_warp.errors import CorruptFileError, FgfError, OutputError
from fgf_warp.output.atomic import PARTIAL_GLOB, flush_to_disk, write_bytes
from generators.dataset import layout
from generators.dataset.aside import move_aside
from generators.dataset.scratch import scratch_folder

MOST_BYTES = 2**29
"""Of any file but an image: labels of a million samples are as large."""
READERS = 32
"""Requests at a time: an object store answers each after tens of milliseconds."""


_CLEARING = Lock()
"""Of the threads that write samples, one at a time looks what stands in the way."""


class GoneError(OutputError):
    """The folder of a dataset was removed, or moved, while a run was at work in it."""


class Store:
    """Reads and writes the files of one dataset; every name is relative to its location.

    In a folder, what is written appears whole or not at all. In an object store single files do, and of a sample's
    files the record comes last, so a sample is there where its record is.

    Nothing that is not of the dataset is ever removed: what stands in the way is moved aside, see `move_aside`.

    Args:
        location: a folder, or a URL that fsspec knows, such as ``s3://bucket/cloud``.

    Raises:
        OutputError: for a URL of a kind that is not installed, or that says too little.
    """

    def __init__(self, location: str | Path) -> None:
        self.location = str(location)
        try:
            self._fs, self._root = fsspec.core.url_to_fs(self.location)
        except Exception as error:  # each kind of URL has errors of its own
            raise OutputError(f"{location}: is no place of a dataset: {_reason(error)}") from error

    @property
    def folder(self) -> Path | None:
        """Of a dataset on this machine's file system."""
        return Path(self._root) if isinstance(self._fs, LocalFileSystem) else None

    @property
    def is_shared(self) -> bool:
        """Whether other processes see it."""
        return not isinstance(self._fs, MemoryFileSystem)

    def exists(self, name: str) -> bool:
        """Whether there is such a file.

        Raises:
            OutputError: where the place cannot be looked at.
        """
        with self._looking(name):
            return bool(self._fs.isfile(self._path(name)))

    def read(self, name: str) -> bytes:
        """Content of a file.

        Raises:
            FileNotFoundError: where there is none.
            CorruptFileError: where it cannot be read.
        """
        self.local_file(name)
        try:
            return bytes(self._fs.cat_file(self._path(name)))
        except FileNotFoundError:
            raise
        except self._errors as error:
            raise CorruptFileError(f"{self.location}/{name}: cannot be read: {_reason(error)}") from error

    def local_file(self, name: str) -> Path | None:
        """Where a file of a folder is, for libraries that read files by name; None in an object store.

        Raises:
            CorruptFileError: for what is there and cannot be read.
        """
        if self.folder is None:
            return None
        _check_readable(self.folder / name, f"{self.location}/{name}")
        return self.folder / name

    def read_all(self, names: Sequence[str]) -> list[bytes]:
        """Contents of many small files, in order; of an object store several are on their way at a time.

        Raises:
            FileNotFoundError: where one is missing.
            CorruptFileError: where one cannot be read.
        """
        if self.folder:
            return [self.read(name) for name in names]
        with ThreadPoolExecutor(READERS) as pool:
            return list(pool.map(self.read, names))

    def sizes(self, prefix: str = "") -> dict[str, int]:
        """Size of every file [byte] below a folder, by name and in their order; of none where there is no folder.

        Raises:
            OutputError: where the place cannot be looked at.
        """
        below = self._path(prefix)
        with self._looking(prefix):
            self._fs.invalidate_cache()
            if not self._fs.isdir(below):
                return {}
            found = self._fs.find(below, detail=True)
        return {path[len(self._root) + 1 :]: int(entry["size"] or 0) for path, entry in sorted(found.items())}

    def empty_folders(self) -> list[str]:
        """Folders without any file; an object store has none. Raises as `sizes` does."""
        with self._looking(""):
            self._fs.invalidate_cache()
            found = self._fs.find(self._root, withdirs=True, detail=True)
        folders = {path for path, entry in found.items() if entry["type"] == "directory" and path != self._root}
        holding = {path.rpartition("/")[0] for path in found}
        return sorted(path[len(self._root) + 1 :] for path in folders - holding)

    def entries(self) -> list[str]:
        """Names of files and folders at the top, without those that a killed run left half-written.

        Raises:
            OutputError: where the place cannot be looked at.
        """
        with self._looking(""):
            self._fs.invalidate_cache()
            found = self._fs.ls(self._root, detail=False) if self._fs.isdir(self._root) else []
        names = [str(path).rstrip("/").rpartition("/")[2] for path in found]
        return sorted(name for name in names if not fnmatch(name, PARTIAL_GLOB))

    def check_there(self) -> None:
        """Finds out whether the dataset is still where its run began, before something is written into it.

        Raises:
            GoneError: where it has no plan any more.
        """
        if not self.exists(layout.PLAN):
            raise GoneError(
                f"{self.location}: {layout.PLAN} is gone: the dataset was removed or moved while a run was at work in "
                "it, which ends here and writes nothing more"
            )

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
            if self.folder is None:
                self._fs.pipe_file(self._path(name), content)
                return
            if name == layout.PLAN:
                # Nothing but the plan makes the folder: one that was removed does not come back without it.
                self.folder.mkdir(parents=True, exist_ok=True)
            self.make_folder(name.rpartition("/")[0])
            self.clear_way(name)
            write_bytes(self.folder / name, content)

    def make_folder(self, name: str) -> None:
        """Makes a folder of the dataset and those that it is in, but not the dataset's own; an object store has none.

        Raises:
            OutputError: where it cannot be made.
        """
        if self.folder is None or not name:
            return
        with self._writing(name):
            path = self.folder
            for part in name.split("/"):
                path /= part
                _make_folder(path)

    def clear_way(self, name: str, *, even_files: bool = False, even_links: bool = False) -> None:
        """Moves a folder, or what else is no file, aside that stands where a file is to be.

        Args:
            name: of the file.
            even_files: whether to move a file aside too.
            even_links: whether to move a link aside too, for a file that is written where it is: what the link leads
                to is no part of the dataset.

        Raises:
            OutputError: where it cannot be moved.
        """
        if self.folder is None:
            return
        path = self.folder / name
        with self._writing(name):
            if (path.exists() and (even_files or not path.is_file())) or (even_links and path.is_symlink()):
                move_aside(path)

    def fetch(self, name: str, path: Path) -> None:
        """Copies a file to this machine.

        Raises:
            FileNotFoundError: where there is none.
            CorruptFileError: where it cannot be read.
        """
        try:
            self._fs.get_file(self._path(name), str(path))
        except FileNotFoundError:
            raise
        except self._errors as error:
            raise CorruptFileError(f"{self.location}/{name}: cannot be read: {_reason(error)}") from error

    def place(self, folder: str, fill: Callable[[Path], None], last: str) -> None:
        """Writes a folder of files, whole; one that is there gets them one by one, and keeps what else is in it.

        Args:
            folder: its name.
            fill: writes its files into a folder of this machine, and to the disk.
            last: the file that tells of the others; where they appear one by one, it goes first and comes last.

        Raises:
            OutputError: where it cannot be written.
        """
        with self._writing(folder), self.workspace(folder) as made:
            fill(made)
            if self.folder:
                _place_folder(self.folder / folder, made, last)
                return
            self.remove(f"{folder}/{last}")
            for path in _last_of(made, last):
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

    @contextmanager
    def workspace(self, folder: str) -> Iterator[Path]:
        """A folder on this machine to make a sample's files in, gone when the block ends unless `commit` took it.

        In a folder, it is a hidden one beside the sample's, which a later run sweeps where this one is killed.

        Args:
            folder: of the sample.

        Raises:
            OutputError: where it cannot be made.
        """
        if self.folder is None:
            with scratch_folder() as scratch:
                yield scratch
            return
        hidden = _hidden(self.folder / folder)
        with self._writing(folder):
            self.make_folder(folder.rpartition("/")[0])
            hidden.mkdir()
        try:
            yield hidden
        finally:
            shutil.rmtree(hidden, ignore_errors=True)

    def commit(
        self, folder: str, files: Mapping[str, bytes], *, replaces: bool = False, made_in: Path | None = None
    ) -> bool:
        """Makes a sample visible, whole, in the place of one without a record.

        Files beside it that are not of the sample stay where they are.

        Args:
            folder: of the sample.
            files: content by name, the record among them.
            replaces: whether it takes the place of one with a record too.
            made_in: the `workspace` that holds some of the files already, on the disk.

        Returns:
            False where it was already there; it is left as it is.

        Raises:
            OutputError: where it cannot be written; nothing of it is visible then.
        """
        if self.folder and made_in is None:
            with self.workspace(folder) as hidden:
                return self.commit(folder, files, replaces=replaces, made_in=hidden)
        with self._writing(folder):
            if self.folder and made_in:
                return _commit_folder(self.folder / folder, made_in, files, replaces)
            record = f"{folder}/{layout.RECORD}"
            if self.exists(record):
                if not replaces:
                    return False
                self.remove(record)
            for name in sorted(files, key=lambda name: name == layout.RECORD):
                self._fs.pipe_file(self._path(f"{folder}/{name}"), files[name])
            return True

    def remove(self, name: str) -> None:
        """Removes a file, or a hidden folder that a run left half-written, if it is there."""
        path = self._path(name)
        with self._writing(name):
            if self.folder and (Path(path).is_symlink() or not Path(path).is_dir()):
                Path(path).unlink(missing_ok=True)  # whatever it is: a pipe is no file
            elif not self.folder and self._fs.isfile(path):
                self._fs.rm_file(path)
            elif self.folder and fnmatch(Path(path).name, PARTIAL_GLOB) and Path(path).is_dir():
                shutil.rmtree(path)

    @property
    def _errors(self) -> tuple[type[Exception], ...]:
        """What may go wrong: each kind of object store has errors of its own."""
        return (OSError, ValueError) if self.folder else (Exception,)

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}" if name else self._root

    @contextmanager
    def _looking(self, name: str) -> Iterator[None]:
        try:
            yield
        except self._errors as error:
            where = f"{self.location}/{name}" if name else self.location
            raise OutputError(f"{where}: cannot be looked at: {_reason(error)}") from error

    @contextmanager
    def _writing(self, name: str) -> Iterator[None]:
        try:
            yield
        except FgfError:
            raise
        except self._errors as error:
            raise OutputError(f"{self.location}/{name}: cannot be written: {_reason(error)}") from error


def _check_readable(path: Path, name: str) -> None:
    if not path.exists():
        return
    if not path.is_file():
        # A pipe would be waited for, and a device never ends.
        raise CorruptFileError(f"{name}: cannot be read: is no file")
    if path.suffix != ".exr" and (size := path.stat().st_size) > MOST_BYTES:
        raise CorruptFileError(f"{name}: cannot be read: {size:,} bytes; accepted: at most {MOST_BYTES:,}")


def _reason(error: Exception) -> str:
    """What a library says, in one line."""
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return " ".join(text.split()) or type(error).__name__


def _commit_folder(target: Path, hidden: Path, files: Mapping[str, bytes], replaces: bool) -> bool:
    """By way of a hidden folder that is on the disk before it gets its name."""
    for name, content in files.items():
        if not (hidden / name).exists():
            with (hidden / name).open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
    flush_to_disk(hidden)
    _clear_for_folder(target)
    try:
        hidden.rename(target)
    except OSError:
        if not target.is_dir():
            raise
        if not replaces and (target / layout.RECORD).is_file():
            return False
        if _holds_others(target, files):
            _replace_within(target, hidden, files)
        else:
            # What is there goes only now that the new one is on the disk.
            old = target.rename(_hidden(target))
            hidden.rename(target)
            # Where it cannot go, verify names it.
            shutil.rmtree(old, ignore_errors=True)
    flush_to_disk(target.parent)
    return True


def _make_folder(path: Path) -> None:
    """Others may be making the same folder now, and none of theirs may be taken for what stands in the way."""
    if path.is_symlink() or not path.is_dir():
        _clear_for_folder(path)
        path.mkdir(exist_ok=True)


def _clear_for_folder(path: Path) -> None:
    with _CLEARING:
        if path.is_symlink() or (path.exists() and not path.is_dir()):
            move_aside(path)  # a link too, since what it leads to is no part of the dataset


def _holds_others(folder: Path, files: Mapping[str, bytes]) -> bool:
    """Whether there is something in the folder of a sample that is not the sample's."""
    return any(
        (path.name not in files and not fnmatch(path.name, PARTIAL_GLOB)) or (path.is_dir() and not path.is_symlink())
        for path in folder.iterdir()
    )


def _replace_within(target: Path, hidden: Path, files: Mapping[str, bytes]) -> None:
    """File by file, as in an object store, since what else lies there must never be anywhere else."""
    for name in files:
        if (target / name).is_dir():
            move_aside(target / name)
    (target / layout.RECORD).unlink(missing_ok=True)
    for name in sorted(files, key=lambda name: name == layout.RECORD):
        (hidden / name).replace(target / name)
    flush_to_disk(target)
    with suppress(OSError):
        hidden.rmdir()


def _place_folder(target: Path, hidden: Path, last: str) -> None:
    """Gives a hidden folder that is on the disk its name, or its files to the one that has it."""
    flush_to_disk(hidden)
    _clear_for_folder(target)
    if not target.is_dir():
        hidden.rename(target)
    else:
        files = _last_of(hidden, last)
        for path in files:
            if (target / path.name).is_dir():
                move_aside(target / path.name)
        (target / last).unlink(missing_ok=True)
        for path in files:
            path.replace(target / path.name)
        flush_to_disk(target)
    flush_to_disk(target.parent)


def _last_of(folder: Path, last: str) -> list[Path]:
    """The files of a folder, one of them behind the others."""
    return sorted(folder.iterdir(), key=lambda path: (path.name == last, path.name))


def _hidden(folder: Path) -> Path:
    """A name beside it that a later run sweeps, see `Store.sweep`."""
    return folder.with_name(f".{folder.name}.{uuid.uuid4().hex[:12]}.partial")
