"""Whether the folder of a sample holds what its record says."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

from fgf_warp.errors import CorruptFileError
from generators.checking.findings import Finding, Kind
from generators.dataset import layout
from generators.dataset.plan_table import PlanMeta
from generators.dataset.reader import Dataset
from generators.dataset.record import Record, Timing, decode_record, decode_timing, encode, file_entry

READABLE = "one that can be read"
Note = TypeVar("Note", Record, Timing)


def image_names(meta: PlanMeta) -> tuple[str, ...]:
    """Of the files that hold a sample's images."""
    return (layout.RADIANCE, layout.IMAGE) if meta.png else (layout.RADIANCE,)


def check_sample(dataset: Dataset, index: int, sizes: Mapping[str, int]) -> list[Finding]:
    """Looks at sizes, hashes and notes of one sample that is there, in whole or in part.

    Args:
        dataset: that it belongs to.
        index: of the sample.
        sizes: of the files in its folder [byte], by name.

    Returns:
        A finding for each file that is missing, damaged or not as the record says.
    """
    return list(_findings(dataset, index, sizes))


def _findings(dataset: Dataset, index: int, sizes: Mapping[str, int]) -> Iterator[Finding]:
    def damaged(name: str, found: str, expected: str) -> Finding:
        return Finding(Kind.DAMAGED, f"{folder}/{name}", found, expected, index)

    folder, images = dataset.folders[index], image_names(dataset.meta)
    known = {*images, layout.RECORD, layout.TIMING}
    for name in sorted(known - set(sizes)):
        yield damaged(name, "missing", "there, as is its folder")
    for name in sorted(set(sizes) - known):
        expected = f"nothing beside {', '.join(sorted(known))}"
        yield Finding(Kind.SURPLUS, f"{folder}/{name}", "not of the sample", expected, index)
    timing = read_note(dataset, f"{folder}/{layout.TIMING}", decode_timing) if layout.TIMING in sizes else None
    if isinstance(timing, str):
        yield damaged(layout.TIMING, timing, READABLE)
    if layout.RECORD not in sizes:
        return
    record = read_note(dataset, f"{folder}/{layout.RECORD}", decode_record)
    if isinstance(record, str):
        yield damaged(layout.RECORD, record, READABLE)
        return
    for found, expected in _differences(record, index, dataset.meta, images):
        yield damaged(layout.RECORD, found, expected)
    for name in images:
        entry = record.files.get(name)
        if name not in sizes or entry is None:
            continue
        if sizes[name] != entry.bytes:
            yield damaged(name, f"{sizes[name]:,} bytes", f"{entry.bytes:,} bytes, as the record says")
        elif isinstance(content := read(dataset, f"{folder}/{name}"), str):
            yield damaged(name, content, READABLE)
        elif (sha256 := file_entry(content).sha256) != entry.sha256:
            yield damaged(name, f"sha256 {sha256}", f"{entry.sha256}, as the record says")


def _differences(record: Record, index: int, meta: PlanMeta, images: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    if record.index != index:
        yield f"index {record.index}", f"{index}, as its folder says"
    if record.plan != meta.digest:
        yield f"plan {record.plan}", f"{meta.digest}, as {layout.PLAN} says"
    if record.nonfinite:
        yield f"{record.nonfinite} samples that are not finite", "none"
    if set(record.files) != set(images):
        yield f"files {', '.join(sorted(record.files)) or 'none'}", ", ".join(images)
    yield from _unreached(record, meta.quality)


def _unreached(record: Record, quality: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """A render ends at the samples per pixel that were planned, unless an error or a time ended it before."""
    most = quality.get("spp")
    if most is not None and record.spp > most:
        yield f"{record.spp} samples per pixel", f"at most {most:g}, as planned"
    if "time" in quality or most is None or record.spp >= most:
        return
    target = quality.get("target_error")
    reached = record.standard_error if record.reached_error is None else record.reached_error
    if target is None:
        yield f"{record.spp} samples per pixel", f"{most:g}, as planned"
    elif reached is None or reached > target:
        error = "unknown" if reached is None else f"{reached:.4g}"
        yield f"standard error {error} at {record.spp} samples per pixel", f"at most {target:g}"


def read_note(dataset: Dataset, name: str, decode: Callable[[bytes, str], Note]) -> Note | str:
    """A note beside the images, or what is wrong with it: every byte is as `encode` writes it."""
    content = read(dataset, name)
    if isinstance(content, str):
        return content
    try:
        note = decode(content, name)
        # Its hash does not see blanks.
        return note if encode(note) == content else "is not as it was written"
    except (CorruptFileError, ValueError, TypeError):
        return "is damaged"


def read(dataset: Dataset, name: str) -> bytes | str:
    """A file's content, or why it cannot be read."""
    try:
        return dataset.store.read(name)
    except OSError as error:
        return f"cannot be read: {error.strerror or error}"
    except CorruptFileError as error:
        return str(error).removeprefix(f"{dataset.store.location}/{name}: ")
