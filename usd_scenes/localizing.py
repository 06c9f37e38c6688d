"""A stage with all that it is made of, as files of one folder that need nothing beside it.

Every layer of a stage, of all its variants and value clips, and every picture gets a file of its own, under a name
without folders, and the layers name each other by these. Layers stay apart, so variant sets and instances stay what
they are; packages (.usdz) are unpacked. What is not there, or neither a layer nor a picture, is no part of the copy: it
is named as `MISSING`, where nothing is ever put, so it is missing from the copy as it is from the stage, and no stage
makes a folder hold other files of the machine.

A copy of a copy is the same to the byte.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from pxr import Ar, Sdf, Tf, UsdShade, UsdUtils

from fgf_warp.errors import SceneError
from usd_scenes import schema
from usd_scenes.reader.diagnostics import usd_errors_as_scene_errors
from usd_scenes.reader.images import is_picture

MISSING = "missing"
"""Folder, never made, that what is left out of the copy is said to be in."""
LAYER_SUFFIXES = (".usd", ".usda", ".usdc")
OF_ANY_FORMAT = ".usd"
"""What a layer of another format, as of a package, is called: USD looks into such files."""
CRATE = b"PXR-USDC"
"""First bytes of a binary layer."""
UDIM = "<UDIM>"
FRAME = re.compile("#+")
"""Stands in the template of value clips for a clip's number."""
FRAME_NUMBER = r"(-?\d+)"
UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")
NAME_LONGEST, SUFFIX_LONGEST = 100, 20
"""Characters of a name without its suffix, and of the suffix."""

Variables = Mapping[str, object]
"""Values of a stage's expression variables, of which paths may be made."""


@dataclass(frozen=True)
class _File:
    """One file of the copy.

    Args:
        source: path that USD resolved, on disk or inside a package.
        layer: what is written; None where the source is copied to the byte.
        is_text: whether the layer is written as text.
        bytes: size of the source.
    """

    source: str
    layer: Sdf.Layer | None
    is_text: bool
    bytes: int

    def write(self, path: Path) -> None:
        if self.layer is not None:
            arguments = {"format": "usda" if self.is_text else "usdc"} if path.suffix == OF_ANY_FORMAT else {}
            self.layer.Export(str(path), "", arguments)
        elif Path(self.source).is_file():
            shutil.copyfile(self.source, path)
        else:
            path.write_bytes(_open(self.source).GetBuffer())


class StageFiles:
    """What stages are made of; the files are written by `write`.

    Args:
        stages: path of each stage, by the name that it gets in the folder, see `stage_file_name`.

    Raises:
        SceneError: for a stage that cannot be opened.
    """

    def __init__(self, stages: Mapping[str, str | Path]) -> None:
        schema.register()
        self._files: dict[str, _File] = {}
        self._names: dict[tuple[str, str], str] = {}
        self._taken = {name.casefold() for name in stages}
        self._queue: deque[tuple[str, Variables, str]] = deque()
        for name, path in stages.items():
            source = str(Path(path).absolute())
            with usd_errors_as_scene_errors(str(path)), _resolving_as(source):
                self._names[_key(source, {})] = name
                self._queue.append((source, {}, name))
                while self._queue:
                    self._add_layer(*self._queue.popleft())

    @property
    def bytes(self) -> int:
        """Size together; what layers are called by may lengthen them a little."""
        return sum(file.bytes for file in self._files.values())

    @property
    def names(self) -> tuple[str, ...]:
        """Of the files, in order."""
        return tuple(sorted(self._files))

    def write(self, folder: Path) -> None:
        """Writes them; equal stages give equal bytes.

        Args:
            folder: that is there and empty.

        Raises:
            OSError: where a file cannot be written.
            SceneError: where USD cannot write a layer.
        """
        with usd_errors_as_scene_errors(str(folder)):
            for name, file in self._files.items():
                file.write(folder / name)

    def _add_layer(self, source: str, variables: Variables, name: str) -> None:
        """Takes a layer with other paths in it, and asks for what these name."""
        anchor, layer = Sdf.Layer.FindOrOpen(source), Sdf.Layer.CreateAnonymous()
        if anchor is None:
            raise SceneError(f"{source}: is not there, or is no layer of USD")
        layer.TransferContent(anchor)
        own, offsets = dict(layer.expressionVariables), list(layer.subLayerOffsets)
        # What a layer says of variables gives way to what those say that it is referenced by.
        inherited = {**own, **variables}
        changed: set[str] = set()

        def rename(path: str) -> str:
            new = self._rename(path, anchor, inherited)
            changed.update([path] if new != path else [])
            return new

        if variables:
            layer.expressionVariables = inherited
        UsdUtils.ModifyAssetPaths(layer, rename, keepEmptyPathsInArrays=True)
        if own:
            layer.expressionVariables = own
        else:
            layer.ClearExpressionVariables()
        for place, offset in enumerate(offsets):
            layer.subLayerOffsets[place] = offset  # USD forgets them.
        is_of_usd = Path(Ar.SplitPackageRelativePathInner(source)[1] or source).suffix in LAYER_SUFFIXES
        content = _open(source)
        is_text = is_of_usd and not content.GetBuffer().startswith(CRATE)
        self._files[name] = _File(source, None if is_of_usd and not changed else layer, is_text, content.GetSize())

    def _rename(self, path: str, anchor: Sdf.Layer, variables: Variables) -> str:
        """What a path in a layer becomes; the same for what is named so already."""
        asset, arguments = Sdf.Layer.SplitIdentifier(path)
        if not asset or asset.startswith("`"):
            return path  # an expression that has no value
        base = PurePosixPath(_innermost(asset)).name
        if found := _resolve(asset, anchor):
            name = self._add(found, variables, base)
        elif UDIM in base:
            tiles = UsdShade.UdimUtils.ResolveUdimTilePaths(asset, anchor)
            name = self._add_set(asset, anchor, base, {tile: source for source, tile in tiles}, variables)
        else:
            name = self._add_set(asset, anchor, base, dict(_clips(asset, anchor)), variables)
        if name is None:
            name = f"{MISSING}/{self._name(_key(MISSING + anchor.ComputeAbsolutePath(asset), {}), base)}"
        return Sdf.Layer.CreateIdentifier(f"./{name}", arguments)

    def _add(self, source: str, variables: Variables, base: str) -> str | None:
        """The name of a file; None where it is neither a layer nor a picture."""
        if not _is_wanted(source):
            return None
        key = _key(source, variables if _is_layer(source) else {})
        if key not in self._names:
            self._take(source, variables, self._name(key, stage_file_name(base) if _is_layer(source) else base))
        return self._names[key]

    def _add_set(
        self, asset: str, anchor: Sdf.Layer, base: str, parts: Mapping[str, str], variables: Variables
    ) -> str | None:
        """The name of files that one path stands for, with the placeholder in it; None where there are none.

        Args:
            asset: the path.
            anchor: the layer that it is in.
            base: its last part, with the placeholder.
            parts: the files, by what is in the placeholder's place.
            variables: see `Variables`.
        """
        wanted = {part: source for part, source in sorted(parts.items()) if _is_wanted(source)}
        if not wanted:
            return None
        key = _key(f"{anchor.ComputeAbsolutePath(asset)} {min(wanted.values())}", variables)
        if key not in self._names:
            # One that is named alone too is there twice.
            for part, source in wanted.items():
                self._take(source, variables, _filled(self._name(key, base, list(wanted)), part))
        return self._names[key]

    def _take(self, source: str, variables: Variables, name: str) -> None:
        if _is_layer(source):
            self._queue.append((source, variables, name))
        else:
            self._files[name] = _File(source, None, False, _open(source).GetSize())

    def _name(self, key: tuple[str, str], base: str, parts: list[str] | None = None) -> str:
        """A name that no other file has, whatever the case of its letters."""
        if key not in self._names:
            for candidate in _candidates(base):
                names = {_filled(candidate, part).casefold() for part in parts or ()} | {candidate.casefold()}
                if self._taken.isdisjoint(names):
                    self._taken |= names
                    self._names[key] = candidate
                    break
        return self._names[key]


def stage_file_name(name: str) -> str:
    """What a layer's file is called in the folder: as it was, but for one that is no plain USD file, such as a package.

    Args:
        name: of the file, without folders.
    """
    path = PurePosixPath(name)
    return name if path.suffix in LAYER_SUFFIXES else f"{path.stem}{OF_ANY_FORMAT}"


def _key(source: str, variables: Variables) -> tuple[str, str]:
    """What tells files of the copy apart: a layer may name others by variables, and so mean something else twice."""
    return source, repr(sorted(variables.items()))


def _candidates(base: str) -> Iterator[str]:
    """Names of harmless characters: of the file, then with a number."""
    stem, dot, suffix = base.rpartition(".")
    if not stem:
        stem, dot, suffix = base, "", ""
    parts = [_harmless(part) for part in re.split(f"({UDIM}|#+)", stem)]
    stem = "".join(parts)[:NAME_LONGEST].lstrip(".") or "file"
    suffix = dot + UNSAFE.sub("_", suffix)[:SUFFIX_LONGEST]
    yield stem + suffix
    number = 2
    while True:
        yield f"{stem}-{number}{suffix}"
        number += 1


def _harmless(part: str) -> str:
    return part if part == UDIM or FRAME.fullmatch(part) else UNSAFE.sub("_", part)


def _filled(name: str, part: str) -> str:
    """A name with a tile's number, or numbers between points, in place of its placeholder."""
    if UDIM in name:
        return name.replace(UDIM, part)
    numbers = iter(part.split(","))
    return FRAME.sub(lambda _: next(numbers), name)


def _clips(asset: str, anchor: Sdf.Layer) -> Iterator[tuple[str, str]]:
    """The clips of a template that are there: their numbers and where they are."""
    folder, _, base = asset.rpartition("/")
    if not FRAME.search(base):
        return
    pattern = re.compile(FRAME_NUMBER.join(map(re.escape, FRAME.split(base))))
    for name in sorted(set(_names_beside(folder, anchor))):
        found = pattern.fullmatch(name)
        source = _resolve(f"{folder}/{name}" if folder else name, anchor) if found else ""
        if found and source:
            yield ",".join(found.groups()), source


def _names_beside(folder: str, anchor: Sdf.Layer) -> Iterator[str]:
    """Names of the files in a folder that a path in a layer leads to."""
    package = Ar.SplitPackageRelativePathInner(anchor.resolvedPath.GetPathString())[0] if _is_packed(anchor) else ""
    if package:
        content = Sdf.ZipFile.Open(package)
        yield from (PurePosixPath(name).name for name in content.GetFileNames()) if content else ()
        return
    places = {Path(anchor.realPath).parent / folder, *(Path(root) / folder for root in _search_path())}
    for place in sorted(places):
        if place.is_dir():
            yield from (path.name for path in place.iterdir())


def _is_packed(layer: Sdf.Layer) -> bool:
    return layer.GetFileFormat().IsPackage() or Ar.IsPackageRelativePath(layer.identifier)


def _search_path() -> list[str]:
    """Folders of the resolver's context, where paths are looked for that start with no dot."""
    contexts = Ar.GetResolver().GetCurrentContext().Get()
    return [path for context in contexts if hasattr(context, "GetSearchPath") for path in context.GetSearchPath()]


def _resolving_as(source: str) -> Ar.ResolverContextBinder:
    """Within it paths are found as they are where a stage is open."""
    return Ar.ResolverContextBinder(Ar.GetResolver().CreateDefaultContextForAsset(source))


def _resolve(asset: str, anchor: Sdf.Layer) -> str:
    """Where a file is; empty where there is none, and for what is no plain file."""
    found = Ar.GetResolver().Resolve(anchor.ComputeAbsolutePath(asset)).GetPathString()
    return found if found and (Ar.IsPackageRelativePath(found) or Path(found).is_file()) else ""


def _innermost(asset: str) -> str:
    """The path of a file inside a package, or the path itself."""
    while Ar.IsPackageRelativePath(asset):
        asset = Ar.SplitPackageRelativePathInner(asset)[1]
    return asset


def _is_layer(source: str) -> bool:
    suffix = Ar.GetResolver().GetExtension(source)
    return bool(suffix) and Sdf.FileFormat.FindByExtension(suffix) is not None


def _is_wanted(source: str) -> bool:
    """Whether it is a layer or a picture."""
    if not _is_layer(source) and Path(source).is_file():
        return is_picture(source)
    if not _is_layer(source):
        with tempfile.NamedTemporaryFile() as copy:
            copy.write(_open(source).GetBuffer())
            copy.flush()
            return is_picture(copy.name)
    try:
        return Sdf.Layer.FindOrOpen(source) is not None
    except Tf.ErrorException:
        return False


def _open(source: str) -> Ar.Asset:
    return Ar.GetResolver().OpenAsset(Ar.ResolvedPath(source))
