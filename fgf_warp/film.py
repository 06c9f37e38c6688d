"""The film: sums over the samples of each pixel on the device, the memory they take, and the image made of them."""

from __future__ import annotations

import platform
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import warp as wp

from fgf_warp import __version__
from fgf_warp.errors import NumericalError
from fgf_warp.integrator.planes import PLANES
from fgf_warp.model import Model, State
from fgf_warp.result import RenderResult
from fgf_warp.scene import Instances, Scene, Shape, count_of
from fgf_warp.settings import Aov, RenderSettings

FARTHEST = 1e38
"""Depths beyond it stand for nothing met."""
SUMS = {"sum", "sum of vectors"}
"""Rules of planes that are means over the samples."""


def begin(model: Model) -> State:
    """A state without samples, whose films are empty."""
    settings = model.settings
    pixels = settings.width * settings.height * len(model.variants)

    film = model.program.film()
    for plane in model.program.planes:
        sums = wp.zeros(pixels, dtype=plane.dtype, device=settings.device)
        if plane.initial:
            sums.fill_(plane.initial)
        setattr(film, plane.name, sums)
    images = len(model.variants)
    return State(film, np.zeros((images, settings.height, settings.width), dtype=np.int32), np.zeros(images))


def film_bytes(settings: RenderSettings) -> int:
    """Memory of the film of one pixel [byte]."""
    return sum(plane.pixel_bytes for plane in PLANES if plane.is_needed(settings.aovs))


def develop(model: Model, state: State, image: int = 0) -> RenderResult:
    """The image that the film holds.

    Args:
        model: what is rendered.
        state: of at least one sample per pixel.
        image: its index in the batch.

    Returns:
        Means over the samples, as float32 arrays; the exposure of the camera is in the radiance.

    Raises:
        NumericalError: where a sample was not finite, naming its pixel.
    """
    settings, film, counts = model.settings, state.film, state.samples[image]
    pixels = settings.width * settings.height

    def plane(sums: wp.array) -> np.ndarray:
        values = sums[image * pixels : (image + 1) * pixels].numpy()
        return values.reshape(settings.height, settings.width, *values.shape[1:])

    def mean(sums: wp.array) -> np.ndarray:
        values = plane(sums)
        return values / counts.reshape(*counts.shape, *(1,) * (values.ndim - 2))

    _check_finite(model, image, plane(film.invalid))
    radiance = mean(film.radiance)
    spread = np.maximum(mean(film.radiance_sq) - radiance**2, 0.0)
    several = counts[..., None] > 1
    variance = np.where(several, spread / np.where(several, counts[..., None] - 1, 1), np.inf)
    exposure = model.scene.camera.exposure_scale
    aovs: dict[Aov, np.ndarray] = {}
    if Aov.DEPTH in settings.aovs:
        depth = plane(film.depth)
        aovs[Aov.DEPTH] = np.where(depth < FARTHEST, depth, np.inf).astype(np.float32)
    for row in PLANES:
        if row.name in settings.aovs and row.rule in SUMS:
            # What the kernel need not sum is 0: normals without surfaces, and motion of what rests.
            means = mean(getattr(film, row.name)) if row in model.program.planes else np.zeros_like(radiance)
            aovs[Aov(row.name)] = means.astype(np.float32)
    if Aov.MOTION in settings.aovs:
        aovs[Aov.MOTION] = aovs[Aov.MOTION][..., :2]
    if Aov.DIRECT in settings.aovs:
        aovs[Aov.DIRECT] *= np.float32(exposure)
    if Aov.INDIRECT in settings.aovs:
        aovs[Aov.INDIRECT] = (exposure * (radiance - mean(film.direct))).astype(np.float32)
    if Aov.SAMPLES in settings.aovs:
        aovs[Aov.SAMPLES] = counts.copy()
    numbers, instances = _prim_numbers(model.scene)
    if Aov.PRIM_ID in settings.aovs:
        aovs[Aov.PRIM_ID] = numbers[plane(film.seen_item)]
    if Aov.INSTANCE_ID in settings.aovs:
        aovs[Aov.INSTANCE_ID] = instances[plane(film.seen_item)]
    return RenderResult(
        radiance=(exposure * radiance).astype(np.float32),
        alpha=mean(film.alpha).astype(np.float32),
        variance=(exposure**2 * variance).astype(np.float32),
        aovs=aovs,
        samples=round(float(counts.mean())),
        path_count=int(counts.sum(dtype=np.int64)),
        truncated_count=int(plane(film.truncated).sum(dtype=np.int64)),
        seconds=float(state.seconds[image]),
        settings=replace(settings, seed=model.variants[image].seed),
        provenance=_provenance(model, image, round(float(counts.mean()))),
    )


def _prim_numbers(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """What prim each thing is that a path sees first.

    Returns:
        (n,) int32 each, indexed by `Path.seen_item`: the number of the prim, 0 for nothing, and that in its instancer
        or -1. Surfaces count from the front, and nothing and the containers from the back.
    """
    prims = {name: number for number, name in enumerate(scene.prims, start=1)}

    def numbers(shape: Shape) -> np.ndarray:
        rows = np.full((count_of(shape), 2), (prims[shape.name], -1), dtype=np.int32)
        of_instancer = shape.numbers if isinstance(shape, Instances) else shape.instance
        if of_instancer is not None:
            rows[:, 1] = of_instancer
        return rows

    surfaces = [numbers(shape) for shape in scene.shapes if shape.surface is not None]
    containers = [numbers(shape) for shape in scene.shapes if shape.medium is not None]
    table = np.concatenate([*surfaces, *reversed(containers), np.array([(0, -1)], dtype=np.int32)])
    return table[:, 0], table[:, 1]


def _check_finite(model: Model, image: int, invalid: np.ndarray) -> None:
    if not invalid.any():
        return
    row, column = np.unravel_index(int(np.argmax(invalid)), invalid.shape)
    variant = model.variants[image]
    media = "; ".join(
        f"{m.name}: H = {m.hurst:g}, S_w = {m.white_noise_scale:g}, sigma_m = {m.mean_extinction:g}, "
        f"phase function = {m.phase_function}, g = {m.asymmetry:g}"
        for m in variant.media
    )
    raise NumericalError(
        f"{int(invalid.sum())} samples are not finite, most of them in pixel ({column}, {row}) "
        f"with seed {variant.seed} ({media})"
    )


def _provenance(model: Model, image: int, samples: int) -> dict[str, Any]:
    """What an image was made from and by, for the header of its file."""
    settings, scene, variant = model.settings, model.scene, model.variants[image]
    return {
        "scene": scene.source,
        "meters_per_unit": scene.meters_per_unit,
        "camera": scene.camera.name,
        "exposure_scale": scene.camera.exposure_scale,
        **({"prims": list(scene.prims)} if Aov.PRIM_ID in settings.aovs else {}),
        "media": [
            {
                "name": m.name,
                "H": m.hurst,
                "phase_function": m.phase_function,
                "g": m.asymmetry,
                "back_asymmetry": m.back_asymmetry,
                "back_weight": m.back_weight,
                "draine_alpha": m.draine_alpha,
                "S_w": m.white_noise_scale,
                "sigma_m": m.mean_extinction,
                "extinction_color": list(m.extinction_color),
                "albedo": list(m.albedo),
                "L": m.outer_scale,
                "regime": m.line_law.regime,
                "b": m.line_law.b,
                "kappa": m.line_law.kappa,
                "transport": m.resolved_transport,
                "frozen_share": scene.frozen_share(index, m),
                "line_variance": m.line_variance,
                "priority": m.priority,
            }
            for index, m in enumerate(variant.media)
        ],
        "settings": {
            key: value
            for key, value in asdict(settings).items()
            if key in ("width", "height", "max_depth", "roulette_depth", "similarity_order", "sampler")
        }
        | {"seed": variant.seed, "spp": samples, "device": settings.device.split(":")[0]},
        "versions": {"fgf-warp": __version__, "warp-lang": wp.config.version, "python": platform.python_version()},
    }
