"""Our renderer and Mitsuba behind one interface, each for a process of its own: what is heavy is imported there."""

from __future__ import annotations

import platform
import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fgf_warp.scene import Medium, Scene
from tests.benchmarks import scenes
from tests.benchmarks.llvm import provide_llvm
from tests.benchmarks.mitsuba_scene import to_mitsuba

CPU_VARIANT = "llvm_ad_rgb"
SCALAR_VARIANT = "scalar_rgb"
LANES_PER_PASS = 1 << 22
"""Of Mitsuba's wavefronts: between 2^18 and 2^22 its speed is the same within its noise, and memory grows."""


@dataclass
class Cost:
    """What a piece of work took."""

    cpu_seconds: float = 0.0
    wall_seconds: float = 0.0


@dataclass
class Measured:
    """Images, and what they took.

    Args:
        cost: of all of them.
        paths: camera paths of all of them.
        images: (n, height, width, 3) float32.
    """

    cost: Cost
    paths: int
    images: np.ndarray


@dataclass
class _Loaded:
    """A scene that is ready to be rendered."""

    image: scenes.Image
    value: Any
    parameters: Any


@contextmanager
def measure() -> Iterator[Cost]:
    """CPU time of all threads of this process, and wall time."""
    cost = Cost()
    cpu, wall = time.process_time(), time.perf_counter()
    yield cost
    cost.cpu_seconds, cost.wall_seconds = time.process_time() - cpu, time.perf_counter() - wall


class Ours:
    """FGF-Warp."""

    def __init__(self) -> None:
        import warp as wp

        wp.config.log_level = wp.LOG_WARNING
        self._scenes: dict[str, tuple[scenes.Image, Scene, scenes.Bounds]] = {}

    def load(self, key: str, stage: Path, medium: Medium | None = None, bounds: scenes.Bounds = scenes.SHORT) -> None:
        """Reads a stage and builds the kernel for it.

        Args:
            key: names it in the other calls; the part before a colon is the name of the scene.
            stage: its file.
            medium: replaces the stage's first.
            bounds: of the paths.
        """
        from fgf_warp.renderer import prepare

        scene = scenes.read(stage)
        if medium is not None:
            scene = scenes.with_first_medium(scene, medium)
        self._scenes[key] = scenes.IMAGES[key.partition(":")[0]], scene, bounds
        prepare(scene, self._settings(key, 1, 0, 1))

    def render(self, key: str, spp: int, seed: int, threads: int) -> Measured:
        """One image; the cost is that of rendering, without that of bringing the scene to the device."""
        from fgf_warp.renderer import begin, build_model, develop, step

        model = build_model(self._scenes[key][1], self._settings(key, spp, seed, threads))
        with measure() as cost:
            state = begin(model)
            step(model, state, spp)
            result = develop(model, state)
        return Measured(cost, result.path_count, result.radiance[None])

    def converge(self, key: str, spp: int, seed: int, threads: int) -> Measured:
        """One image of so many samples per pixel on average, which go where they help."""
        from fgf_warp.convergence import Goal, render_until

        settings, goal = self._settings(key, spp, seed, threads), Goal(over="rms", max_spp=spp)
        with measure() as cost:
            result = render_until(self._scenes[key][1], settings, goal)
        return Measured(cost, result.path_count, result.radiance[None])

    def sweep(self, key: str, indices: list[int], spp: int, seed: int, threads: int) -> Measured:
        """The images of some of the media of S, as one batch."""
        from fgf_warp.renderer import Variant, render_batch

        scene, media = self._scenes[key][1], scenes.sweep_media()
        name = scene.media[0].name
        settings = self._settings(key, spp, seed, threads)
        images, paths = [], 0
        with measure() as cost:
            variants = [Variant((replace(media[i], name=name),), seed + i) for i in indices]
            for result in render_batch(scene, variants, settings):
                images.append(result.radiance)
                paths += result.path_count
        return Measured(cost, paths, np.stack(images))

    def mean_events(self, key: str, spp: int, seed: int) -> float:
        """Mean number of scattering events per camera path, of a scene that is one medium.

        A path that is cut at a maximum depth of n would scatter for the (n + 1)-th time.
        """
        from fgf_warp.renderer import render

        settings = self._settings(key, spp, seed, 1)
        result = render(self._scenes[key][1], settings)
        events = float(result.alpha.mean())
        for depth in range(1, settings.max_depth):
            result = render(self._scenes[key][1], replace(settings, seed=seed + depth, max_depth=depth))
            events += result.truncated_count / result.path_count
            if result.truncated_count == 0:
                break
        return events

    def peak_memory(self) -> int:
        """The largest resident size of this process [byte]."""
        return _peak_memory()

    def versions(self) -> dict[str, str]:
        import warp as wp

        from fgf_warp import __version__

        return {"fgf-warp": __version__, "warp-lang": wp.config.version, "Python": platform.python_version()}

    def _settings(self, key: str, spp: int, seed: int, threads: int) -> Any:
        from fgf_warp.settings import RenderSettings

        image, _, bounds = self._scenes[key]
        return RenderSettings(
            width=image.width,
            height=image.height,
            spp=spp,
            seed=seed,
            max_depth=bounds.max_depth,
            roulette_depth=bounds.roulette_depth,
            threads=threads,
        )


class Mitsuba:
    """Mitsuba 3.

    Args:
        variant: of Mitsuba.
        emitter_sampling: see `to_mitsuba`.
    """

    def __init__(self, variant: str, emitter_sampling: bool = True) -> None:
        self._has_llvm = variant.startswith("llvm")
        if self._has_llvm:
            provide_llvm()
        import mitsuba as mi

        mi.set_variant(variant)
        self._emitter_sampling = emitter_sampling
        self._folder = tempfile.TemporaryDirectory()
        self._scenes: dict[str, _Loaded] = {}

    def load(self, key: str, stage: Path, bounds: scenes.Bounds = scenes.SHORT) -> None:
        """Reads a stage with our reader and translates it; the first render compiles."""
        import mitsuba as mi

        image, folder = scenes.IMAGES[key.partition(":")[0]], Path(self._folder.name)
        found = to_mitsuba(scenes.read(stage), image, bounds, folder, emitter_sampling=self._emitter_sampling)
        scene = mi.load_dict(found)
        self._scenes[key] = _Loaded(image, scene, mi.traverse(scene))

    def render(self, key: str, spp: int, seed: int, threads: int) -> Measured:
        """One image, in passes of at most LANES_PER_PASS paths where the variant is an llvm one."""
        self._set_threads(threads)
        loaded = self._scenes[key]
        with measure() as cost:
            image = self._render(loaded, spp, seed)
        return Measured(cost, spp * loaded.image.width * loaded.image.height, image[None])

    def sweep(self, key: str, indices: list[int], spp: int, seed: int, threads: int) -> Measured:
        """The images of some of the media of S: one scene, whose values are set anew for each."""
        import drjit as dr
        import mitsuba as mi

        self._set_threads(threads)
        loaded, media = self._scenes[key], scenes.sweep_media()
        sigma_t, albedo, asymmetry = (
            next(name for name in loaded.parameters.keys() if name.endswith(ending))  # noqa: SIM118
            for ending in (".sigma_t.value.value", ".albedo.value.value", ".phase_function.g")
        )
        images = []
        with measure() as cost:
            for i in indices:
                values = {sigma_t: media[i].mean_extinction, albedo: media[i].albedo[0], asymmetry: media[i].asymmetry}
                for name, value in values.items():
                    # Opaque, so that the value is an input of the compiled kernel and not a constant in it.
                    loaded.parameters[name] = dr.opaque(mi.Float, value)
                loaded.parameters.update()
                images.append(self._render(loaded, spp, seed + i))
        return Measured(cost, spp * loaded.image.width * loaded.image.height * len(indices), np.stack(images))

    def peak_memory(self) -> int:
        """The largest resident size of this process [byte]."""
        return _peak_memory()

    def versions(self) -> dict[str, str]:
        import drjit as dr
        import mitsuba as mi

        found = {"mitsuba": mi.__version__, "drjit": dr.__version__}
        if self._has_llvm:
            found["LLVM"] = ".".join(map(str, dr.detail.llvm_version()))
        return found

    def _render(self, loaded: _Loaded, spp: int, seed: int) -> np.ndarray:
        import drjit as dr
        import mitsuba as mi

        pixels = loaded.image.width * loaded.image.height
        at_once = max(1, LANES_PER_PASS // pixels) if self._has_llvm else spp
        total = np.zeros((loaded.image.height, loaded.image.width, 3), dtype=np.float32)
        for i, first in enumerate(range(0, spp, at_once)):
            count = min(at_once, spp - first)
            image = mi.render(loaded.value, spp=count, seed=seed + (i << 24))
            dr.eval(image)
            dr.sync_thread()
            total += np.array(image) * (count / spp)
        return total

    def _set_threads(self, threads: int) -> None:
        """In the llvm variants one thread of several only hands out the work."""
        import drjit as dr

        dr.set_thread_count(threads + 1 if self._has_llvm and threads > 1 else threads)


def _peak_memory() -> int:
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
