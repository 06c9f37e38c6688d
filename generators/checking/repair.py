"""Makes damaged files of a dataset anew, to the same bytes."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fgf_warp.errors import ConfigError
from generators.checking.findings import Finding, Kind, Verification
from generators.checking.published import read_labels
from generators.checking.verify import verify_dataset
from generators.dataset import layout
from generators.dataset.plan_table import INDEX
from generators.dataset.reader import Dataset
from generators.dataset.store import Store
from generators.publishing.publish import publish

if TYPE_CHECKING:
    from generators.planning.plan import Plan

OLD_CARD = f"{layout.RUN}/README.replaced.md"
"""A card that is not as it was written may hold what a person wrote."""


@dataclass(frozen=True)
class Repaired:
    """What a repair did.

    Args:
        done: a line for each thing.
        warnings: what it could not do, or not to the same bytes.
    """

    done: tuple[str, ...]
    warnings: tuple[str, ...]


def restore_plan(location: str) -> None:
    """Writes the plan anew from the dataset's config.

    Raises:
        ConfigError: where there is no config, or samples are there that it does not plan.
        SceneError: where its stage is not there.
        OutputError: where it cannot be written.
    """
    store = Store(location)
    with _planned(store, None) as plan:
        for name in store.sizes(layout.DATA):
            if name.endswith(f"/{layout.RECORD}") and plan.meta.digest.encode() in store.read(name):
                break
        else:
            if any(name.endswith(f"/{layout.RECORD}") for name in store.sizes(layout.DATA)):
                raise ConfigError(f"{location}/{layout.CONFIG}: {OTHER_PLAN}")
        store.write(layout.PLAN, plan.to_bytes())


OTHER_PLAN = (
    "plans another dataset than the one that is there (config, stage or version differ), so that nothing can be made "
    "anew to the same bytes"
)


def repair_dataset(location: str, found: Verification) -> Repaired:
    """Makes anew what is damaged.

    A sample is rendered first, and then takes the place of what is there of it. What does not belong to the dataset
    stays, but for what a killed run left half-written.

    Args:
        location: of the dataset.
        found: what is wrong in it.

    Raises:
        ConfigError: where a run is under way, or where the config plans something else.
        SceneError: where the stage is not there.
        OutputError: where a file cannot be written.
        CorruptFileError: where the labels cannot be written, as a sample is still damaged.
    """
    done, warnings = [], []
    if any(finding.name == layout.PLAN for finding in found.of(Kind.DAMAGED)):
        restore_plan(location)
        done.append(f"made {layout.PLAN} anew")
        found = verify_dataset(Dataset(location))
    dataset = Dataset(location)
    notes = [finding for finding in found.of(Kind.DAMAGED) if finding.name.startswith(layout.FAILURES)]
    for useless in [*found.of(Kind.LEFTOVER), *notes]:
        dataset.store.remove(useless.name)
        done.append(f"removed {useless.name}")
    damaged = found.damaged_samples()
    if damaged:
        for index, error in _render(dataset, damaged, found.findings):
            if error is None:
                done.append(f"rendered sample {index} again")
            else:
                warnings.append(f"sample {index} could not be rendered: {error}")
    if any(finding.name == layout.CARD for finding in found.of(Kind.DAMAGED)) and dataset.store.exists(layout.CARD):
        dataset.store.write(OLD_CARD, dataset.store.read(layout.CARD))
        done.append(f"kept the card that was there as {OLD_CARD}")
    if not warnings:
        publish(dataset)
        done.append("wrote labels, card, metadata and contact sheet")
    return Repaired(tuple(done), tuple(warnings))


def _render(dataset: Dataset, damaged: list[int], findings: tuple[Finding, ...]) -> Iterator[tuple[int, str | None]]:
    """Renders samples to as many samples per pixel as they had; tells of each the error, if there was one."""
    from generators.running.run import render_again  # noqa: PLC0415 - with the renderer

    spp = _reached(dataset, damaged, findings)
    with _planned(dataset.store, dataset) as plan:
        for finished in render_again(plan, dataset.store, damaged, spp):
            yield finished.index, finished.error


def _reached(dataset: Dataset, damaged: list[int], findings: tuple[Finding, ...]) -> dict[int, int]:
    """Samples per pixel that the samples had, as their records say, or the labels where these are damaged."""
    without_record = {finding.sample for finding in findings if finding.name.endswith(layout.RECORD)}
    gone = {finding.sample for finding in findings if finding.name in dataset.folders}
    labels = read_labels(dataset)
    found = {}
    for index in damaged:
        if index not in without_record | gone:
            found[index] = dataset.record(index).spp
        elif labels is not None and labels[INDEX][index].as_py() == index and labels["spp"][index].as_py():
            found[index] = labels["spp"][index].as_py()
    return found


@contextmanager
def _planned(store: Store, dataset: Dataset | None) -> Iterator[Plan]:
    """The plan of the dataset's config; of the dataset where there is one."""
    from generators.planning.document import load_config  # noqa: PLC0415
    from generators.planning.plan import build_plan  # noqa: PLC0415 - with USD

    if not store.exists(layout.CONFIG):
        raise ConfigError(f"{store.location}: {layout.CONFIG} is missing, without which nothing can be rendered again")
    device = "cuda:0" if dataset is not None and dataset.meta.device == "cuda" else "cpu"
    with tempfile.TemporaryDirectory() as temporary:
        path = store.folder / layout.CONFIG if store.folder else Path(temporary, layout.CONFIG)
        if store.folder is None:
            path.write_bytes(store.read(layout.CONFIG))
        plan = build_plan(load_config(path), device)
        if dataset is not None and plan.meta.digest != dataset.meta.digest:
            raise ConfigError(f"{store.location}/{layout.CONFIG}: {OTHER_PLAN}")
        yield plan
