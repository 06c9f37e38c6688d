"""Looks at a dataset as a whole: what is there, what is missing, what does not belong."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from fnmatch import fnmatch

from fgf_warp.errors import CorruptFileError
from fgf_warp.output.atomic import PARTIAL_GLOB
from generators.checking.findings import Finding, Kind, Verification, name_ranges
from generators.checking.images import check_images
from generators.checking.published import Samples, check_published
from generators.checking.samples import READABLE, check_sample
from generators.checking.scene import check_scene, scene_files
from generators.checking.spread import check_spread
from generators.dataset import layout
from generators.dataset.plan_table import SPLIT
from generators.dataset.reader import Dataset
from generators.dataset.record import Failure
from generators.dataset.store import Store
from generators.running.opening import shards_under_way

WORKERS = 8
"""Threads that read; hashing lets the others go on, and so does waiting for a file."""
VERSION_CONTROL = (".git", ".gitattributes", ".gitignore", ".gitmodules")
"""Names at the top that a dataset has where it is kept in a repository."""
Progress = Callable[[int, int], None]
"""Called with the number of samples looked at, and of all."""


def check_plan(location: str) -> Finding | None:
    """What is wrong with the plan, without which nothing else can be looked at.

    Raises:
        ConfigError: where there is no dataset.
    """
    store = Store(location)
    if not store.exists(layout.PLAN) and (store.exists(layout.CONFIG) and store.sizes(layout.DATA)):
        return Finding(Kind.DAMAGED, layout.PLAN, "missing", "there, as in every dataset")
    try:
        Dataset(location)
    except CorruptFileError:
        return Finding(Kind.DAMAGED, layout.PLAN, "is damaged", "the table of a plan")
    return None


def verify_dataset(dataset: Dataset, *, deep: bool = False, progress: Progress | None = None) -> Verification:
    """Finds everything that is not as plan and records say.

    Args:
        dataset: to look at; nothing in it is changed.
        deep: whether to decode the images too, and to compare them with the plan's rows and the records.
        progress: see `Progress`.
    """
    sizes = {name: size for name, size in dataset.store.sizes().items() if not name.startswith(f"{layout.RUN}/")}
    by_folder = _by_folder(dataset, sizes)
    there = [index for index, folder in enumerate(dataset.folders) if folder in by_folder]
    complete = [index for index in there if layout.RECORD in by_folder[dataset.folders[index]]]

    def check(index: int) -> list[Finding]:
        found = check_sample(dataset, index, by_folder[dataset.folders[index]])
        whole = not any(finding.kind is Kind.DAMAGED for finding in found)
        return [*found, *check_images(dataset, index)] if deep and whole else found

    of_samples: list[Finding] = []
    with ThreadPoolExecutor(WORKERS) as pool:
        for done, found in enumerate(pool.map(check, there), start=1):
            of_samples += found
            if progress:
                progress(done, len(there))
    damaged = {finding.sample for finding in of_samples if finding.kind is Kind.DAMAGED}
    samples = Samples(frozenset(there), frozenset(complete), frozenset(complete) - damaged)
    if notes := dataset.damaged_notes():  # No labels can be compared then.
        damage = [Finding(Kind.DAMAGED, name, "is damaged", READABLE) for name in notes]
        findings = [*damage, *check_scene(dataset), *_surplus(dataset, sizes), *of_samples]
    else:
        published = check_published(dataset, sizes, samples)
        # What was there once is named already.
        known = samples.there | {finding.sample for finding in published if finding.sample is not None}
        failed = {index: failure for index, failure in dataset.failures().items() if index not in known}
        findings = [
            *published,
            *check_scene(dataset),
            *_surplus(dataset, sizes),
            *_unfinished(dataset, known, failed),
            *check_spread(dataset, sorted(failed)),
            *of_samples,
        ]
    return Verification(tuple(findings), len(dataset.folders), len(complete), len(sizes), sum(sizes.values()))


def _by_folder(dataset: Dataset, sizes: Mapping[str, int]) -> dict[str, dict[str, int]]:
    """Of each sample's folder that is there: the sizes of what it holds."""
    planned = set(dataset.folders)
    found: dict[str, dict[str, int]] = {}
    for name, size in sizes.items():
        folder = "/".join(name.split("/")[:3])
        if folder in planned and folder != name:
            found.setdefault(folder, {})[name[len(folder) + 1 :]] = size
    return found


def _unfinished(dataset: Dataset, known: Collection[int], failures: Mapping[int, Failure]) -> Iterator[Finding]:
    """Samples that failed, each with its reason, and those that are missing, by split."""
    for index, failure in sorted(failures.items()):
        found = f"failed after {failure.attempts} attempts: {failure.reason}"
        yield Finding(Kind.INCOMPLETE, dataset.folders[index], found, "a sample", index)
    splits = dataset.plan[SPLIT].to_pylist()
    for split, planned in Counter(splits).items():
        missing = [i for i, name in enumerate(splits) if name == split and i not in known and i not in failures]
        if missing:
            found = f"{len(missing):,} of {planned:,} samples are missing: {name_ranges(missing)}"
            yield Finding(Kind.INCOMPLETE, f"{layout.DATA}/{split}", found, f"{planned:,} samples")


def _surplus(dataset: Dataset, sizes: Mapping[str, int]) -> Iterator[Finding]:
    """What belongs to no dataset, each folder of it once."""
    planned = set(dataset.folders)
    known = _files_of_the_dataset(dataset) | scene_files(dataset, sizes)
    parents = {parent for name in known | planned for parent in _parents(name)}
    strange: Counter[str] = Counter()
    empty = [name for name in dataset.store.empty_folders() if not _is_in(name, layout.RUN)]
    for name in [*sizes, *empty]:
        folder = "/".join(name.split("/")[:3])
        if name in known or _is_in(name, *VERSION_CONTROL) or (folder in planned and name not in planned):
            continue
        outermost = next((parent for parent in _parents(name) if parent not in parents), name)
        strange[outermost] += name in sizes
    for name, count in sorted(strange.items()):
        is_link = dataset.store.folder and (dataset.store.folder / name).is_symlink()
        what = "a link" if is_link else "a file" if name in sizes else f"a folder of {count} files"
        if fnmatch(name.rpartition("/")[2], PARTIAL_GLOB):
            if shards_under_way(dataset.store):
                continue  # it is being written
            yield Finding(Kind.LEFTOVER, name, f"{what} that a run left half-written", "nothing")
        else:
            yield Finding(Kind.SURPLUS, name, f"{what} that is not of the dataset", "nothing")


def _files_of_the_dataset(dataset: Dataset) -> set[str]:
    top = (layout.CARD, layout.INDEX, layout.PLAN, layout.CROISSANT, layout.CONFIG, layout.CONTACT_SHEET, layout.REPORT)
    return {*top, *(layout.split_metadata(split) for split in set(dataset.plan[SPLIT].to_pylist()))}


def _parents(name: str) -> list[str]:
    """The folders that a file is in, from the outermost on."""
    parts = name.split("/")
    return ["/".join(parts[:end]) for end in range(1, len(parts))]


def _is_in(name: str, *folders: str) -> bool:
    return any(name == folder or name.startswith(f"{folder}/") for folder in folders)
