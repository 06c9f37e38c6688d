"""Whether the images of a sample decode to what the plan asks for and the record says."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fgf_warp.errors import CorruptFileError
from fgf_warp.output.color import to_display
from fgf_warp.output.exr import channel_names, read_exr
from fgf_warp.output.images import read_image
from fgf_warp.settings import Aov
from generators.checking.findings import Finding, Kind
from generators.dataset import layout
from generators.dataset.plan_table import INDEX, SEED
from generators.dataset.reader import Dataset
from generators.dataset.record import Record
from generators.dataset.scratch import scratch_folder
from generators.publishing.statistics import image_statistics

ROUNDING = 1e-9
"""Of statistics: sums in another order, on another machine."""
Problem = tuple[str, str]
"""What was found, and what is expected."""
Channels = dict[str, np.ndarray]


def check_images(dataset: Dataset, index: int) -> list[Finding]:
    """Decodes the images of a sample whose files are as its record says, and compares them with plan and record.

    Args:
        dataset: that it belongs to.
        index: of the sample.

    Returns:
        A finding for each file that is damaged; none where all is as it should be.
    """
    folder, record = dataset.folders[index], dataset.record(index)
    with scratch_folder() as scratch:

        def fetched(name: str) -> Path:
            if file := dataset.store.local_file(f"{folder}/{name}"):
                return file
            path = scratch / name
            path.write_bytes(dataset.store.read(f"{folder}/{name}"))
            return path

        problems: list[tuple[str, Problem]] = []
        try:
            channels, header = read_exr(fetched(layout.RADIANCE))
        except CorruptFileError as error:
            problems.append((layout.RADIANCE, (_without_path(error), "an image that decodes")))
        else:
            problems += [(layout.RADIANCE, problem) for problem in _radiance(dataset, index, record, channels, header)]
            problems += [(layout.RECORD, problem) for problem in _statistics(record, channels)]
            if dataset.meta.png:
                problems += [(layout.IMAGE, problem) for problem in _view(dataset, channels, fetched(layout.IMAGE))]
    return [Finding(Kind.DAMAGED, f"{folder}/{name}", *problem, index) for name, problem in problems]


def _radiance(
    dataset: Dataset, index: int, record: Record, channels: Channels, header: dict[str, Any]
) -> Iterator[Problem]:
    meta = dataset.meta
    planned = channel_names(frozenset(Aov(name) for name in meta.aovs))
    if set(channels) != set(planned):
        yield f"channels {', '.join(sorted(channels))}", ", ".join(sorted(planned))
    height, width = next(iter(channels.values())).shape
    if (width, height) != (meta.width, meta.height):
        yield f"{width} x {height} pixels", f"{meta.width} x {meta.height}"
    for name, plane in channels.items():
        if count := int((~_is_fine(name, plane, record.spp)).sum()):
            yield f"{count} values of channel {name} that are not finite", "none"
    for key, found, expected in (
        ("plan", header.get("dataset", {}).get("plan"), meta.digest),
        ("index", header.get("dataset", {}).get("index"), dataset.plan[INDEX][index].as_py()),
        ("seed", header.get("settings", {}).get("seed"), dataset.plan[SEED][index].as_py()),
        ("spp", header.get("settings", {}).get("spp"), record.spp),
    ):
        if found != expected:
            yield f"{key} {found} in the header", f"{expected}"


def _is_fine(name: str, plane: np.ndarray, spp: int) -> np.ndarray:
    """Finite; beside that, depth is infinite where nothing is met, and so is the variance of a single sample."""
    may_be_infinite = name == "Z" or (name.startswith("variance.") and spp == 1)
    return np.isfinite(plane) | (np.isposinf(plane) if may_be_infinite else False)


def _statistics(record: Record, channels: Channels) -> Iterator[Problem]:
    """The record's numbers that follow from the image."""
    if not all(name in channels and np.isfinite(channels[name]).all() for name in "RGBA"):
        return  # told of the radiance
    of_image = image_statistics(channels)
    for name, value in record.statistics.items():
        if name in of_image and not math.isclose(value, of_image[name], rel_tol=ROUNDING, abs_tol=ROUNDING):
            yield f"{name} = {value:.9g}", f"{of_image[name]:.9g}, as of the image"


def _view(dataset: Dataset, channels: Channels, file: Path) -> Iterator[Problem]:
    """The PNG is the radiance as a screen shows it, to the last bit."""
    try:
        pixels, names, _ = read_image(file)
    except CorruptFileError as error:
        yield _without_path(error), "an image that decodes"
        return
    radiance = np.stack([channels[name] for name in "RGB"], axis=2)
    if not np.isfinite(radiance).all():
        return  # told of the radiance
    expected = to_display(radiance, dataset.meta.exposure)
    shown = np.rint(pixels * 255).astype(np.uint8)
    if names != ("R", "G", "B") or shown.shape != expected.shape:
        yield f"{'x'.join(map(str, shown.shape))} values", f"{'x'.join(map(str, expected.shape))}, as of the radiance"
    elif count := int((shown != expected).any(axis=2).sum()):
        yield f"{count} pixels that are not those of {layout.RADIANCE}", "none"


def _without_path(error: CorruptFileError) -> str:
    """The file was read from a copy, whose name says nothing."""
    return str(error).partition(": ")[2].strip()
