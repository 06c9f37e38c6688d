"""Makes damaged files of a dataset anew, to the same bytes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING

from fgf_warp.errors import ConfigError, CorruptFileError, FgfError
from generators.checking.findings import Kind, Verification, name_ranges
from generators.checking.published import read_labels
from generators.checking.verify import verify_dataset
from generators.dataset import layout
from generators.dataset.plan_table import INDEX, read_plan
from generators.dataset.reader import Dataset
from generators.dataset.record import STAGES_COME_BACK, decode_record
from generators.dataset.scene_files import config_file, scene_problems
from generators.dataset.store import Store
from generators.publishing.publish import publish
from generators.running.opening import shards_under_way, sole

if TYPE_CHECKING:
    from generators.planning.plan import Plan

OLD_CARD = f"{layout.RUN}/README.replaced.md"
"""A card that is not as it was written may hold what a person wrote."""
DEVICES = {"cpu": "cpu", "cuda": "cuda:0"}
"""By the kind that a plan names, which is part of its digest."""


def restore_plan(location: str) -> None:
    """Writes the plan anew from the dataset's config.

    Raises:
        ConfigError: where there is no config, or where it plans something else than the samples that are there.
        CorruptFileError: where its stage is damaged.
        OutputError: where it cannot be written.
    """
    store = Store(location)
    _refuse_run(store)
    if problems := scene_problems(store):
        name, found, _ = problems[0]
        raise CorruptFileError(
            f"{location}/{name}: {found}; {layout.PLAN} follows from it and is damaged too, "
            "so both cannot be made anew; accepted: one of them from a copy of the dataset"
        )
    store.write(layout.PLAN, _plan(store, _recorded_digest(store)).to_bytes())


def repair_dataset(location: str, found: Verification) -> Iterator[str]:
    """Makes anew what is damaged.

    A sample is rendered first, and then takes the place of what is there of it. What does not belong to the dataset
    stays, but for what a killed run left half-written.

    Args:
        location: of the dataset.
        found: what is wrong in it.

    Yields:
        A line for each thing that was done, or could not be.

    Raises:
        ConfigError: where a run is under way, or where the config plans something else.
        SceneError: where the stage is not accepted.
        OutputError: where a file cannot be written.
    """
    _refuse_run(Store(location))
    if notes := [finding.name for finding in found.of(Kind.DAMAGED) if finding.name.startswith(layout.FAILURES)]:
        for note in notes:
            Store(location).remove(note)
            yield f"removed {note}"
        found = verify_dataset(Dataset(location))  # Beside damaged notes nothing published is compared.
    if any(finding.name == layout.PLAN for finding in found.of(Kind.DAMAGED)):
        restore_plan(location)
        yield f"made {layout.PLAN} anew"
        found = verify_dataset(Dataset(location))
    elif any(finding.name == layout.CROISSANT for finding in found.of(Kind.DAMAGED)):
        with suppress(FgfError):  # what cannot be planned now does not keep the rest from being healed
            if _differs_from_config(Dataset(location)):
                restore_plan(location)
                yield f"made {layout.PLAN} anew, of which {layout.CROISSANT} could not tell that it had been changed"
    dataset = Dataset(location)
    for useless in found.of(Kind.LEFTOVER):
        dataset.store.remove(useless.name)
        yield f"removed {useless.name}"
    stages = [damaged.name for damaged in found.of(Kind.DAMAGED) if damaged.name.startswith(f"{layout.SCENE}/")]
    for name in stages:
        yield f"{name} cannot be made anew of the dataset alone: {STAGES_COME_BACK}"
    if not stages:
        yield from _render_damaged(dataset, found)
    elif samples := found.damaged_samples():
        yield f"samples that wait for the stages to be rendered again: {name_ranges(samples)}"
    if any(finding.name == layout.CARD for finding in found.of(Kind.DAMAGED)) and dataset.store.exists(layout.CARD):
        yield _keep_card(dataset.store)
    try:
        with sole(dataset.store):
            publish(dataset)
        yield "wrote labels, metadata, card and contact sheet"
    except CorruptFileError as error:
        yield f"labels, metadata, card and contact sheet stay as they are: {error}"


def _keep_card(store: Store) -> str:
    try:
        store.write(OLD_CARD, store.read(layout.CARD))
    except CorruptFileError as error:
        store.clear_way(layout.CARD, even_files=True)
        return f"moved the card that was there aside: {error}"
    return f"kept the card that was there as {OLD_CARD}"


def _render_damaged(dataset: Dataset, found: Verification) -> Iterator[str]:
    damaged = found.damaged_samples()
    if not damaged:
        return
    from generators.running.run import render_again  # noqa: PLC0415 - with the renderer

    spp = _reached(dataset, damaged, found)
    for finished in render_again(_plan(dataset.store, dataset.meta.digest), dataset.store, damaged, spp):
        if finished.error is not None:
            yield f"sample {finished.index} could not be rendered again: {finished.error}"
        elif "time" in dataset.meta.quality and finished.index not in spp:
            yield f"rendered sample {finished.index} again, for as long as planned: its samples per pixel are not known"
        else:
            yield f"rendered sample {finished.index} again"


def _reached(dataset: Dataset, damaged: list[int], found: Verification) -> dict[int, int]:
    """Samples per pixel that samples had, as their records say, or intact labels where a record is damaged."""
    names = {finding.name for finding in found.of(Kind.DAMAGED)}
    # What damaged labels say would be rendered as if it were true.
    labels = None if layout.INDEX in names else read_labels(dataset)
    of_labels = {} if labels is None else dict(zip(labels[INDEX].to_pylist(), labels["spp"].to_pylist(), strict=True))
    reached = {}
    for index in damaged:
        folder = dataset.folders[index]
        if names.isdisjoint((folder, f"{folder}/{layout.RECORD}")):
            reached[index] = dataset.record(index).spp
        elif of_labels.get(index) is not None:
            reached[index] = of_labels[index]
    return reached


def _plan(store: Store, digest: str | None) -> Plan:
    """The plan of the dataset's config.

    Args:
        store: of the dataset.
        digest: that it has; None where that is not known.
    """
    from generators.planning.document import load_config  # noqa: PLC0415
    from generators.planning.plan import build_plan  # noqa: PLC0415 - with USD

    if not store.exists(layout.CONFIG):
        raise ConfigError(f"{store.location}: {layout.CONFIG} is missing, without which nothing can be rendered again")
    loaded = load_config(config_file(store.location))
    for device in DEVICES.values():
        plan = build_plan(loaded, device)
        if digest in (None, plan.meta.digest):
            return plan
    raise ConfigError(
        f"{store.location}/{layout.CONFIG}: plans another dataset than the one that is there (config, stage or version "
        "of FGF-Warp differ), so nothing can be made anew to the same bytes"
    )


def _differs_from_config(dataset: Dataset) -> bool:
    """Whether the plan that is there is another than its config makes, or says other things of it."""
    meta, table = read_plan(_plan(dataset.store, dataset.meta.digest).to_bytes(), layout.PLAN)
    return meta != dataset.meta or not table.equals(dataset.plan)


def _recorded_digest(store: Store) -> str | None:
    """The plan that the samples belong to, by the first record that can be read."""
    for name in store.sizes(layout.DATA):
        if name.endswith(f"/{layout.RECORD}"):
            with suppress(CorruptFileError):
                return decode_record(store.read(name), name).plan
    return None


def _refuse_run(store: Store) -> None:
    if held := shards_under_way(store):
        raise ConfigError(f"{store.location}: a run is under way in this folder, on shard {held[0]}; wait for its end")
