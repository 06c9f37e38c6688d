"""Makes a folder that of a plan's dataset, and keeps others out while a run is at work in it."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from fgf_warp.errors import ConfigError, CorruptFileError, OutputError
from fgf_warp.locks import HeldError, hold
from generators.dataset import layout
from generators.dataset.plan_table import read_plan
from generators.dataset.store import Store
from generators.publishing.croissant import claimed_hashes
from generators.running.shard import Shard, samples_of
from generators.running.stages import Tell, keep_stages

if TYPE_CHECKING:
    from generators.planning.plan import Plan

SHORT_LOCK = "lock"
"""Held while a run opens the dataset, and while one publishes it: never for long."""
SHARD_LOCK = "shard-*-of-*.lock"
SHARD_NAME = re.compile(r"shard-(\d{1,9})-of-(\d{1,9})\.lock")


@contextmanager
def opened(
    plan: Plan, config: bytes | None, store: Store, shard: Shard, tell: Tell | None = None
) -> Iterator[list[int]]:
    """Holds a shard of a dataset, which is made or found to be of this plan.

    In an object store, which has no locks, nothing keeps a second run out; each sample is committed once all the same.

    Args:
        plan: of the dataset.
        config: that it was made from, as YAML; kept with a new dataset, as are the plan's stages; None leaves what
            there is.
        store: of the dataset.
        shard: to hold.
        tell: see `Tell`.

    Yields:
        The indices of the shard's samples, those of equal scenes after each other.

    Raises:
        ConfigError: where there is something else, or where another run holds samples of the shard.
        CorruptFileError: where the dataset's plan has been changed, or its stages, and the plan was made of these.
        OutputError: where nothing can be written.
    """
    indices = samples_of(plan, shard)
    # What is not this dataset's does not even get a lock.
    _refuse_other_content(plan, store)
    with ExitStack() as held:
        with sole(store, makes=True):
            _refuse_other_content(plan, store)
            if store.folder:
                _refuse_held_samples(plan, store.folder / layout.RUN, shard, indices)
                store.clear_way(f"{layout.RUN}/{_shard_lock(shard)}", even_links=True)
                held.enter_context(hold(store.folder / layout.RUN / _shard_lock(shard), wait=False))
            store.sweep([layout.sample_name(index) for index in indices])
            if config is not None and store.exists(layout.PLAN):
                _check_plan(plan, store)
            # The plan first: a folder with other files and no plan is refused, by a run that goes on after a kill too.
            if not store.exists(layout.PLAN):
                store.write(layout.PLAN, plan.to_bytes())
            if config is not None:
                keep_stages(plan, store, tell)
                if not store.exists(layout.CONFIG):
                    store.write(layout.CONFIG, config)
        yield indices


@contextmanager
def sole(store: Store, *, makes: bool = False) -> Iterator[None]:
    """Alone with the dataset's own files, beside those of its samples; others wait.

    Args:
        store: of the dataset.
        makes: whether to make the dataset's folder where it is missing.

    Raises:
        OutputError: where the folder is missing or cannot be made.
    """
    if store.folder is None:
        yield
        return
    try:
        if makes:
            store.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{store.location}: cannot be made a dataset's folder: {error.strerror}") from error
    lock = f"{layout.RUN}/{SHORT_LOCK}"
    store.make_folder(layout.RUN)
    store.clear_way(lock, even_links=True)
    with hold(store.folder / lock, wait=True):
        yield


def shards_under_way(store: Store) -> list[Shard]:
    """The shards that runs hold now; none in an object store, which has no locks."""
    if store.folder is None or not (store.folder / layout.RUN).is_dir():
        return []
    # Where nothing can be written, no run is at work. Alone, since a run that begins would take a look for a hold.
    with suppress(OutputError), sole(store):
        return [shard for path, shard in _locks(store.folder / layout.RUN) if _is_held(path)]
    return []


def _is_held(path: Path) -> bool:
    try:
        with hold(path, wait=False):
            return False
    except HeldError:
        return True
    except OutputError:
        return False  # what cannot be locked is not held


def _refuse_other_content(plan: Plan, store: Store) -> None:
    if not store.exists(layout.PLAN):
        if any(name != layout.RUN for name in store.entries()):
            raise ConfigError(f"{store.location}: is not empty and holds no dataset; choose another place with --out")
        return
    meta, _ = read_plan(store.read(layout.PLAN), f"{store.location}/{layout.PLAN}")
    if meta.digest != plan.meta.digest:
        raise ConfigError(
            f"{store.location}: holds a dataset of another plan (config, scene or version differ); "
            "choose another place with --out, or delete this one"
        )


def _check_plan(plan: Plan, store: Store) -> None:
    """Refuses to go on with a plan that has been changed, which would be published as if it were what was made."""
    content = store.read(layout.PLAN)
    try:
        said = store.read(layout.CROISSANT) if store.exists(layout.CROISSANT) else b""
    except CorruptFileError:
        said = b""  # such metadata tell nothing, and are written anew at the end
    sha256 = hashlib.sha256(content).hexdigest()
    (_, table), (_, own) = read_plan(content, layout.PLAN), read_plan(plan.to_bytes(), layout.PLAN)
    if claimed_hashes(said).get(layout.PLAN, sha256) != sha256 or not table.equals(own):
        raise CorruptFileError(
            f"{store.location}/{layout.PLAN}: is not as it was written; fgf verify --repair makes it anew"
        )


def _refuse_held_samples(plan: Plan, run: Path, shard: Shard, indices: Collection[int]) -> None:
    for path, other in _locks(run):
        overlaps = other == shard or not set(indices).isdisjoint(samples_of(plan, other))
        if overlaps and _is_held(path):
            raise ConfigError(
                f"{run.parent}: another run is under way in this folder, on shard {other}; wait for its end"
            )


def _shard_lock(shard: Shard) -> str:
    return f"shard-{shard.index}-of-{shard.count}.lock"


def _locks(run: Path) -> Iterator[tuple[Path, Shard]]:
    """The locks of shards; files with other names are none."""
    for path in sorted(run.glob(SHARD_LOCK)):
        found = SHARD_NAME.fullmatch(path.name)
        if found and path.is_file():
            with suppress(ConfigError):
                yield path, Shard(int(found[1]), int(found[2]))
