"""What is measured: every scene in alternation, one timing of ours, one of theirs, and again."""

from __future__ import annotations

import math
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fgf_warp.convergence import PILOT_SPP
from fgf_warp.result import block_errors, error_over
from tests.benchmarks import scenes
from tests.benchmarks.agreement import (
    Agreement,
    Estimate,
    compare,
    compare_means,
    compare_pairs,
    estimate,
    mean_squared_error,
)
from tests.benchmarks.limit import FLAGS, Walk, build_walk, run_walk
from tests.benchmarks.renderers import CPU_VARIANT, SCALAR_VARIANT, Measured, Mitsuba, Ours
from tests.benchmarks.sides import Side

PARTS = (*scenes.SINGLE, "S", "laws", "limit")
"""What `--only` chooses from."""
SWEEP_IMAGES = 256
THREADS = 2
"""For wall times."""
REFERENCE_SHARE = 4
"""Renders in a reference of S, each of so many times its samples."""

TARGETS = {"A": 10.0, "B": 5.0, "C": 1.2, "S": 10.0}
"""Ratios of CPU time per path that are aimed at, against Mitsuba's llvm variant."""
SCALAR_TARGET = 35.0
THREADS_TARGET = 1.8
MEMORY_TARGET = 2**30
EQUAL_ERROR = 0.01
"""Relative, to which equal-error times are scaled."""
ERROR_TARGETS = {"A": 12.0, "B": 6.0, "S": 12.0}
"""Ratios of equal-error times that are aimed at, against Mitsuba's llvm variant."""
ADAPTIVE_TARGET = 1.3
ADAPTIVE_RENDERS = 8
"""On either side, whose spread is their error."""

SPEED, ERROR, ADAPTIVE, LAW, LIMIT = "Speed", "Equal error", "Adaptive", "Laws", "Limit"
"""Parts of the report."""
PHASE_ONLY = f"{CPU_VARIANT}, phase sampling only"
"""Where all light is a constant environment, this is the faster way for Mitsuba."""

LAWS: dict[str, dict[str, float]] = {
    "exponential": {},
    "power law, b = 1": {"hurst": 0.5, "kappa": 0.5},
    "fractional, H = -0.25": {"hurst": -0.25, "kappa": 0.5},
}
"""Correlation of the media that are compared, all in reciprocal transport."""
EVENTS_TOLERANCE = 0.02
"""Relative, of mean numbers of scattering events that count as the same."""


@dataclass(frozen=True)
class Effort:
    """How much is done.

    Args:
        repeats: of each timing, in alternation.
        seconds: that one timing should take.
        sweep_step: every how manieth image of S is rendered.
        reference_seconds: for the reference of equal-error times.
        adaptive_spp: samples per pixel of adaptive images, and of those that they are compared to.
    """

    repeats: int
    seconds: float
    sweep_step: int
    reference_seconds: float
    adaptive_spp: int


FULL = Effort(repeats=8, seconds=2.5, sweep_step=1, reference_seconds=20.0, adaptive_spp=1024)
QUICK = Effort(repeats=5, seconds=0.4, sweep_step=8, reference_seconds=4.0, adaptive_spp=128)


@dataclass(frozen=True)
class Row:
    """One line of the table: what is compared came to, the smaller the better.

    Args:
        part: of the report.
        scene: of the benchmark.
        quantity: what is compared.
        unit: of the repeats.
        our_repeats: what ours came to.
        their_repeats: what theirs came to, each right after the same of ours.
        target: of the ratio; None where none is set.
        agreement: of the images; None where the row needs none.
        note: for the reader.
    """

    part: str
    scene: str
    quantity: str
    unit: str
    our_repeats: list[float]
    their_repeats: list[float]
    target: float | None = None
    agreement: Agreement | None = None
    note: str = ""

    @property
    def ours(self) -> float:
        """The median."""
        return statistics.median(self.our_repeats)

    @property
    def theirs(self) -> float:
        """The median."""
        return statistics.median(self.their_repeats)

    @property
    def ratios(self) -> list[float]:
        """Theirs over ours, in each repeat."""
        return [theirs / ours for ours, theirs in zip(self.our_repeats, self.their_repeats, strict=True)]

    @property
    def ratio(self) -> float:
        """The median."""
        return statistics.median(self.ratios)

    @property
    def failed(self) -> bool:
        """True where the images disagree."""
        return self.agreement is not None and not self.agreement.holds

    def to_json(self) -> dict[str, Any]:
        """The fields, and what follows from them."""
        derived = ("ours", "theirs", "ratio", "failed")
        return asdict(self) | {name: getattr(self, name) for name in derived}


@dataclass
class Report:
    """All that was measured."""

    rows: list[Row] = field(default_factory=list)
    versions: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def to_json(self) -> dict[str, Any]:
        return {
            "versions": self.versions,
            "rows": [row.to_json() for row in self.rows],
            "notes": self.notes,
            "seconds": self.seconds,
        }


class Benchmark:
    """The processes of both sides, and what they were asked so far.

    Args:
        effort: how much to do.
        say: prints a line of progress.
    """

    def __init__(self, effort: Effort, say: Callable[[str], None]) -> None:
        self.effort = effort
        self.report = Report()
        self._say = say
        self._folder = tempfile.TemporaryDirectory()
        self._sides: dict[str, Side] = {}

    def run(self, parts: Sequence[str]) -> Report:
        """Measures some of PARTS."""
        start = time.perf_counter()
        try:
            for part in parts:
                self._say(f"{part}:")
                if part in scenes.SINGLE:
                    self.scene(part)
                else:
                    {"S": self.sweep, "laws": self.laws, "limit": self.limit}[part]()
        finally:
            for side in self._sides.values():
                side.close()
        self.report.seconds = time.perf_counter() - start
        return self.report

    def scene(self, name: str) -> None:
        """Scenes A, B and C: times, two threads, and equal error."""
        ours, theirs = self._side("ours"), self._side(CPU_VARIANT)
        pairs = {CPU_VARIANT: theirs}
        if name != "B":
            pairs[PHASE_ONLY] = self._side(PHASE_ONLY)
        if name == "A":
            pairs[SCALAR_VARIANT] = self._side(SCALAR_VARIANT)
        stage = self._stage(name)
        spp = {side.name: self._warm_up(side, name, stage) for side in (ours, *pairs.values())}
        runs: dict[str, list[Measured]] = {label: [] for label in ("ours", *pairs)}
        wall: dict[str, list[Measured]] = {"ours": [], CPU_VARIANT: []}
        for repeat in range(self.effort.repeats):
            for label, side in {"ours": ours, **pairs}.items():
                runs[label].append(side.render(name, spp[side.name], seed=1 + repeat, threads=1))
            for label, side in {"ours": ours, CPU_VARIANT: theirs}.items():
                wall[label].append(side.render(name, spp[side.name], seed=101 + repeat, threads=THREADS))
            self._say_speeds(name, repeat, runs)
        every = {label: _estimate(runs[label] + wall.get(label, [])) for label in runs}
        for label in pairs:
            agreement = compare(every["ours"], every[label])
            target = {CPU_VARIANT: TARGETS[name], SCALAR_VARIANT: SCALAR_TARGET}.get(label)
            self._compare(SPEED, name, f"CPU time, {label}", runs["ours"], runs[label], _cpu, target, agreement)
        agreement = compare(every["ours"], every[CPU_VARIANT])
        self._compare(SPEED, name, f"wall time of two threads, {CPU_VARIANT}", *wall.values(), _wall, None, agreement)
        self._compare_threads(name, wall["ours"], runs["ours"])
        self._equal_error(name, stage)
        if name == "B":
            self._adaptive(name)

    def sweep(self) -> None:
        """Scene S: batches that are each a fair sample of all its media."""
        ours, theirs, phase_only = self._side("ours, S"), self._side(CPU_VARIANT), self._side(PHASE_ONLY)
        stage = self._stage("S")
        # Shuffled, or the media of a batch would have much in common.
        indices = np.random.default_rng(0).permutation(SWEEP_IMAGES)[:: self.effort.sweep_step].tolist()
        for side in (ours, theirs, phase_only):
            side.load("S", stage)
            side.sweep("S", indices[:2], scenes.SWEEP_SPP, seed=0, threads=1)  # Compiles.
        # All images at once, for the memory that this takes.
        whole = ours.sweep("S", indices, scenes.SWEEP_SPP, seed=7, threads=THREADS)
        self._say(f"  S: {len(indices)} images in one batch by ours: {whole.cost.wall_seconds:.1f} s")
        batches = [indices[first :: self.effort.repeats] for first in range(self.effort.repeats)]
        runs: dict[str, list[Measured]] = {"ours": [], CPU_VARIANT: [], PHASE_ONLY: []}
        wall: dict[str, list[Measured]] = {"ours": [], CPU_VARIANT: []}
        for repeat, batch in enumerate(batches):
            for label, side in {"ours": ours, CPU_VARIANT: theirs}.items():
                runs[label].append(side.sweep("S", batch, scenes.SWEEP_SPP, seed=1, threads=1))
                wall[label].append(side.sweep("S", batch, scenes.SWEEP_SPP, seed=1001, threads=THREADS))
            runs[PHASE_ONLY].append(phase_only.sweep("S", batch, scenes.SWEEP_SPP, seed=1, threads=1))
            self._say_speeds("S", repeat, runs)
        for label, target in {CPU_VARIANT: TARGETS["S"], PHASE_ONLY: None}.items():
            agreement = compare_pairs(_images(runs["ours"]), _images(runs[label]))
            self._compare(SPEED, "S", f"CPU time, {label}", runs["ours"], runs[label], _cpu, target, agreement)
        agreement = compare_pairs(*map(_images, wall.values()))
        self._compare(SPEED, "S", f"wall time of two threads, {CPU_VARIANT}", *wall.values(), _wall, None, agreement)
        self._compare_threads("S", wall["ours"], runs["ours"])
        self._equal_error_of_sweep(stage, batches)
        our_memory, their_memory = ours.peak_memory(), theirs.peak_memory()
        self.report.rows.append(
            Row(
                SPEED,
                "S",
                "peak memory, against the target",
                "MiB",
                [our_memory / 2**20],
                [MEMORY_TARGET / 2**20],
                target=1.0,
                note=f"Mitsuba's process, after all that it rendered: {their_memory / 2**20:.0f} MiB",
            )
        )

    def laws(self) -> None:
        """The laws of correlated media against the exponential, at the same mean number of scattering events."""
        ours, stage = self._side("ours"), self._stage("A")
        wanted = self._mean_events(ours, stage, "exponential", scenes.SIGMA_T)
        self.report.notes.append(
            f"Scene A has {wanted:.3f} scattering events per camera path, those of roulette's survivors."
        )
        extinctions = {law: self._matching_extinction(ours, stage, law, wanted) for law in LAWS}
        runs: dict[str, list[Measured]] = {law: [] for law in LAWS}
        spp = {law: self._choose_spp(ours, f"A:{law}") for law in LAWS}
        for repeat in range(self.effort.repeats):
            for law, done in runs.items():
                done.append(ours.render(f"A:{law}", spp[law], seed=1 + repeat, threads=1))
            self._say_speeds("laws", repeat, runs)
        for law, (sigma, events) in extinctions.items():
            note = f"sigma_m {sigma:.3g}, {events:.3f} scattering events per path"
            self._compare(LAW, "A", f"CPU time, {law}", runs[law], runs["exponential"], _cpu, None, None, note)

    def limit(self) -> None:
        """Scene A against a C loop of the same random walk."""
        program = build_walk(Path(self._folder.name))
        if program is None:
            text = "The C loop was skipped: there is no gcc on this machine."
            self._say(f"  {text}")
            self.report.notes.append(text)
            return
        ours, stage = self._side("ours"), self._stage("A")
        spp = self._warm_up(ours, "A", stage)
        paths = 1 << 20
        paths = int(paths * self.effort.seconds / run_walk(program, paths, 0).cpu_seconds)
        runs: list[Measured] = []
        walks: list[Walk] = []
        for repeat in range(self.effort.repeats):
            runs.append(ours.render("A", spp, seed=1 + repeat, threads=1))
            walks.append(run_walk(program, paths, seed=1 + repeat))
            self._say(f"  limit {repeat + 1}/{self.effort.repeats}: {walks[-1].nanoseconds_per_event:.2f} ns per event")
        events = statistics.mean(walk.events_per_path for walk in walks)
        per_event = [_cpu(run) / events for run in runs]
        loop = [walk.nanoseconds_per_event for walk in walks]
        self.report.rows.append(
            Row(
                LIMIT,
                "A",
                f"CPU time per scattering event, C loop (gcc {' '.join(FLAGS)})",
                "ns",
                per_event,
                loop,
                agreement=compare_means([float(run.images.mean()) for run in runs], [w.mean for w in walks]),
                note=f"{events:.3f} scattering events per path",
            )
        )

    # ---- parts of them

    def _side(self, name: str) -> Side:
        """The process of this name, started when it is first asked for."""
        if name not in self._sides:
            if name.startswith("ours"):
                side = Side(name, Ours)
            elif name == PHASE_ONLY:
                side = Side(name, Mitsuba, CPU_VARIANT, False)
            else:
                side = Side(name, Mitsuba, name)
            self._sides[name] = side
            self.report.versions |= side.versions()
        return self._sides[name]

    def _stage(self, name: str) -> Path:
        return scenes.author(name, Path(self._folder.name))

    def _warm_up(self, side: Side, name: str, stage: Path) -> int:
        side.load(name, stage)
        return self._choose_spp(side, name)

    def _choose_spp(self, side: Side, key: str) -> int:
        """A power of two that takes from one to two halves of the time of a timing; all is compiled thereby."""
        side.render(key, 1, seed=0, threads=1)
        spp = 1
        while side.render(key, spp, seed=0, threads=1).cost.cpu_seconds < self.effort.seconds / 2:
            spp *= 2
        return spp

    def _load_default(self, name: str, stage: Path, labels: Sequence[str]) -> tuple[str, dict[str, Side]]:
        """The scene's key with the bounds of the default preset, and the sides that have it now."""
        key, sides = f"{name}:default", {label: self._side(label) for label in labels}
        for side in sides.values():
            side.load(key, stage, bounds=scenes.DEFAULT)
        return key, sides

    def _equal_error(self, name: str, stage: Path) -> None:
        """Times until the image's RMSE is EQUAL_ERROR of its mean."""
        labels = ["ours", CPU_VARIANT] + [PHASE_ONLY] * (name != "B")
        key, sides = self._load_default(name, stage, labels)
        spp = {label: self._choose_spp(side, key) for label, side in sides.items()}
        runs: dict[str, list[Measured]] = {label: [] for label in labels}
        for repeat in range(self.effort.repeats):
            for label, side in sides.items():
                runs[label].append(side.render(key, spp[label], seed=5001 + repeat, threads=1))
            self._say_speeds(f"{name}, default preset", repeat, runs)
        # Of seeds that no other render has; on all threads, each of which does what fills a timing.
        count = max(2, round(THREADS * self.effort.reference_seconds / self.effort.seconds))
        self._say(f"  {name}: a reference of {count} renders of {spp['ours']} samples per pixel")
        known = _estimate([sides["ours"].render(key, spp["ours"], 10_001 + i, THREADS) for i in range(count)])
        goal = (EQUAL_ERROR * known.mean.mean()) ** 2
        times: dict[str, list[float]] = {}
        for label, done in runs.items():
            error = statistics.mean(mean_squared_error(run.images[0], known) for run in done)
            times[label] = [run.cost.cpu_seconds * error / goal for run in done]
        agreements = {label: compare(known, _estimate(runs[label])) for label in labels[1:]}
        self._compare_errors(name, f"CPU time to an RMSE of {EQUAL_ERROR:.0%} of the mean", times, agreements)

    def _equal_error_of_sweep(self, stage: Path, batches: Sequence[list[int]]) -> None:
        """Times for all images of S until the RMSE over the mean is EQUAL_ERROR, as root mean square over them."""
        key, sides = self._load_default("S", stage, ["ours, S", CPU_VARIANT, PHASE_ONLY])
        runs: dict[str, list[Measured]] = {label: [] for label in sides}
        for repeat, batch in enumerate(batches):
            for label, side in sides.items():
                runs[label].append(side.sweep(key, batch, scenes.SWEEP_SPP, seed=5001, threads=1))
            self._say_speeds("S, default preset", repeat, runs, len(batches))
        indices, spp = [index for batch in batches for index in batch], REFERENCE_SHARE * scenes.SWEEP_SPP
        self._say(f"  S: a reference of {REFERENCE_SHARE} renders of {spp} samples per pixel of {len(indices)} images")
        many = [
            sides["ours, S"].sweep(key, indices, spp, seed=10_001 * (1 + i), threads=THREADS).images
            for i in range(REFERENCE_SHARE)
        ]
        means = np.mean(many, axis=(0, 2, 3, 4), keepdims=True)[0]
        known = estimate(np.stack(many) / means)
        times: dict[str, list[float]] = {}
        for label, done in runs.items():
            error = mean_squared_error(_images(done) / means, known)
            scale = error / EQUAL_ERROR**2 * SWEEP_IMAGES
            times[label] = [run.cost.cpu_seconds * scale / len(run.images) for run in done]
        ours = _images(runs["ours, S"])
        agreements = {label: compare_pairs(ours, _images(runs[label])) for label in (CPU_VARIANT, PHASE_ONLY)}
        what = f"CPU time of {SWEEP_IMAGES} images to an RMSE of {EQUAL_ERROR:.0%} of their means"
        self._compare_errors("S", what, times, agreements)

    def _compare_errors(
        self, name: str, quantity: str, times: dict[str, list[float]], agreements: dict[str, Agreement]
    ) -> None:
        """Rows of the first label's times against those of the others."""
        ours, *others = times
        for label in others:
            target = ERROR_TARGETS.get(name) if label == CPU_VARIANT else None
            what = f"{quantity}, {label}"
            self.report.rows.append(Row(ERROR, name, what, "s", times[ours], times[label], target, agreements[label]))

    def _adaptive(self, name: str) -> None:
        """Adaptive sampling against equally many samples for all pixels, both ours, at equal error."""
        ours, key, spp = self._side("ours"), f"{name}:default", self.effort.adaptive_spp
        ours.converge(key, PILOT_SPP, seed=0, threads=1)
        adaptive: list[Measured] = []
        uniform: list[Measured] = []
        for repeat in range(ADAPTIVE_RENDERS):
            adaptive.append(ours.converge(key, spp, seed=20_001 + repeat, threads=1))
            uniform.append(ours.render(key, spp, seed=30_001 + repeat, threads=1))
            self._say_speeds(f"{name}, {spp} spp", repeat, {"adaptive": adaptive, "uniform": uniform}, ADAPTIVE_RENDERS)
        both = (adaptive, uniform)
        agreement = compare(*map(_estimate, both))
        errors = [_errors(_images(runs)) for runs in both]
        for quantity in errors[0]:
            times = [
                [run.cost.cpu_seconds * (error[quantity] / EQUAL_ERROR) ** 2 for run in runs]
                for runs, error in zip(both, errors, strict=True)
            ]
            target = ADAPTIVE_TARGET if quantity.endswith("rms over blocks") else None
            note = f"at {spp} spp {errors[0][quantity]:.2%} against {errors[1][quantity]:.2%}"
            what = f"CPU time to {EQUAL_ERROR:.0%} of {quantity}"
            self.report.rows.append(Row(ADAPTIVE, name, what, "s", *times, target, agreement, note))

    def _matching_extinction(self, ours: Side, stage: Path, law: str, wanted: float) -> tuple[float, float]:
        """The sigma_m at which a law has the wanted mean number of scattering events, and that number, by secants."""
        tried = [(math.log(scenes.SIGMA_T), self._mean_events(ours, stage, law, scenes.SIGMA_T))]
        while abs(tried[-1][1] / wanted - 1) > EVENTS_TOLERANCE / 2 and len(tried) < 12:
            slope = 0.8
            if len(tried) > 1:
                (x0, y0), (x1, y1) = tried[-2:]
                slope = max(0.1, math.log(y1 / y0) / (x1 - x0))
            x = tried[-1][0] + math.log(wanted / tried[-1][1]) / slope
            tried.append((x, self._mean_events(ours, stage, law, math.exp(x))))
        sigma, events = math.exp(tried[-1][0]), tried[-1][1]
        if abs(events / wanted - 1) > EVENTS_TOLERANCE:
            raise RuntimeError(
                f"{law}: {events:.3f} scattering events per path at sigma_m {sigma:.3g}, not {wanted:.3f}"
            )
        self._say(f"  {law}: sigma_m {sigma:.3f} for {events:.3f} scattering events per path")
        return sigma, events

    def _mean_events(self, ours: Side, stage: Path, law: str, sigma: float) -> float:
        ours.load(f"A:{law}", stage, scenes.medium(sigma, **LAWS[law]))
        return float(ours.mean_events(f"A:{law}", 4, seed=5))

    def _compare(
        self,
        part: str,
        scene: str,
        quantity: str,
        ours: Sequence[Measured],
        theirs: Sequence[Measured],
        time_of: Callable[[Measured], float],
        target: float | None,
        agreement: Agreement | None,
        note: str = "",
    ) -> None:
        """A row of times per camera path."""
        our_times, their_times = ([time_of(run) for run in side] for side in (ours, theirs))
        self.report.rows.append(Row(part, scene, quantity, "ns/path", our_times, their_times, target, agreement, note))

    def _compare_threads(self, scene: str, two: Sequence[Measured], one: Sequence[Measured]) -> None:
        """A row of ours alone: wall time of one thread against that of two."""
        note = (
            f"of {THREADS} cores, {_cores(two):.2f} were at work for the two threads and {_cores(one):.2f} for the one"
        )
        label = "wall time, ours on two threads against one"
        self._compare(SPEED, scene, label, two, one, _wall, THREADS_TARGET, None, note)

    def _say_speeds(self, name: str, repeat: int, runs: dict[str, list[Measured]], repeats: int | None = None) -> None:
        speeds = ", ".join(f"{label} {1e3 / _cpu(done[-1]):.3g}" for label, done in runs.items())
        self._say(f"  {name} {repeat + 1}/{repeats or self.effort.repeats}: million paths per CPU second: {speeds}")


def _images(runs: Sequence[Measured]) -> np.ndarray:
    return np.concatenate([run.images for run in runs])


def _estimate(runs: Sequence[Measured]) -> Estimate:
    return estimate(_images(runs))


def _errors(images: np.ndarray) -> dict[str, float]:
    """Of one of these independent renders, from their spread: relative to blocks of pixels, and to the image's mean."""
    mean, variance = images.mean(axis=0, dtype=np.float64), images.var(axis=0, ddof=1, dtype=np.float64)
    blocks = block_errors(mean, variance)
    return {
        "relative error, rms over blocks": error_over("rms", *blocks),
        "relative error, mean over blocks": error_over("mean", *blocks),
        "relative error, 95th percentile of blocks": error_over("p95", *blocks),
        "RMSE over the image's mean": float(np.sqrt(variance.mean()) / mean.mean()),
    }


def _cpu(run: Measured) -> float:
    """[ns] per path."""
    return 1e9 * run.cost.cpu_seconds / run.paths


def _cores(runs: Sequence[Measured]) -> float:
    """CPU time over wall time; less than the number of threads where other work takes the cores."""
    return statistics.median(run.cost.cpu_seconds / run.cost.wall_seconds for run in runs)


def _wall(run: Measured) -> float:
    """[ns] per path."""
    return 1e9 * run.cost.wall_seconds / run.paths
