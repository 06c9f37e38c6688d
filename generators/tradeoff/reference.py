"""Long renders to compare with, kept in a cache from one measurement to the next."""

from __future__ import annotations

import io
import logging
import os
import platform
import time
import zipfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from fgf_warp import __version__
from fgf_warp.output.atomic import write_bytes
from fgf_warp.scene import Scene
from fgf_warp.settings import PRESETS, RenderSettings, Sampler
from generators.planning.digest import canonical, content_hash

FIRST_SEED = 2**40
"""Of the references' seeds: far from those of the images that are compared with them."""
SPP_FACTOR = 32
"""Of the largest number of samples on the ladder. The lattice sampler's variance is lower by up to 1.9, so the error of
the reference is sqrt(32 / 1.9) = 4.1 times below that of the most accurate image of which only noise is wrong."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class LongRender:
    """A reference.

    Args:
        parts: (n, height, width, 3) float32 radiance of independent renders, of which it is the mean.
        spp: samples per pixel, of all parts together.
        truncated_share: of the paths that reached the bound on their length.
        seconds: that it took when it was rendered: CPU time, or wall time of another device [s].
        cached: whether it was rendered before.
    """

    parts: np.ndarray
    spp: int
    truncated_share: float
    seconds: float
    cached: bool

    @property
    def picture(self) -> np.ndarray:
        """(height, width, 3) float64 radiance."""
        return self.parts.mean(axis=0, dtype=np.float64)


def default_cache() -> Path:
    """Where references are kept unless told otherwise, by the XDG base directory specification."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if Path(base).is_absolute() else Path.home() / ".cache") / "fgf-warp" / "references"


def reference_settings(settings: RenderSettings, *, spp: int, replicates: int) -> RenderSettings:
    """Settings of each part of a reference: without a bound that could be met, and with independent samples.

    Args:
        settings: size and device.
        spp: the largest number of samples per pixel that is compared with it.
        replicates: parts.
    """
    preset = PRESETS["reference"]
    return replace(
        settings,
        spp=-(-SPP_FACTOR * spp // replicates),
        max_depth=preset.max_depth,
        roulette_depth=preset.roulette_depth,
        sampler=Sampler.INDEPENDENT,
    )


def render_reference(
    scene: Scene, settings: RenderSettings, replicates: int, cache: Path, progress: Callable[[], None] = lambda: None
) -> LongRender:
    """Renders a reference, or takes it from the cache.

    Args:
        scene: what to render.
        settings: of each part.
        replicates: parts.
        cache: a folder.
        progress: called after each part.

    Raises:
        OutputError: where it cannot be put into the cache.
        NumericalError: where a sample was not finite.
    """
    file = cache / f"{_key(scene, settings, replicates)}.npz"
    found = _read(file)
    if found is not None:
        for _ in range(replicates):
            progress()
        return found
    from fgf_warp.renderer import render  # noqa: PLC0415 - starts Warp

    began, parts, truncated, paths = clock(settings), [], 0, 0
    for part in range(replicates):
        result = render(scene, replace(settings, seed=FIRST_SEED + part))
        parts.append(result.radiance)
        truncated, paths = truncated + result.truncated_count, paths + result.path_count
        progress()
    made = LongRender(
        np.stack(parts), settings.spp * replicates, truncated / paths, clock(settings) - began, cached=False
    )
    _write(file, made)
    return made


def clock(settings: RenderSettings) -> float:
    """Time that a render of these settings is counted in [s]: of all CPU threads, or of the wall on another device."""
    return time.process_time() if settings.device == "cpu" else time.perf_counter()


def _key(scene: Scene, settings: RenderSettings, replicates: int) -> str:
    """Hash of all that determines the pixels."""
    told = {name: value for name, value in asdict(settings).items() if name not in ("threads", "memory")}
    told |= {"aovs": sorted(settings.aovs), "device": settings.device.split(":")[0], "machine": platform.machine()}
    versions = [__version__, version("warp-lang")]
    return content_hash({"scene": canonical(scene), "settings": told, "parts": replicates, "versions": versions})


def _read(file: Path) -> LongRender | None:
    try:
        with np.load(file, allow_pickle=False) as stored:
            return LongRender(
                stored["parts"],
                int(stored["spp"]),
                float(stored["truncated_share"]),
                float(stored["seconds"]),
                cached=True,
            )
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        log.warning("%s: cannot be read, so the reference is rendered anew: %s", file, error)
        return None


def _write(file: Path, made: LongRender) -> None:
    with io.BytesIO() as content:
        np.savez(content, parts=made.parts, spp=made.spp, truncated_share=made.truncated_share, seconds=made.seconds)
        write_bytes(file, content.getvalue())
