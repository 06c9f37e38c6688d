"""A picture as a person asks for it: what the renderer makes, brought to its size and without its noise."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from fgf_warp import convergence, renderer
from fgf_warp.convergence import Goal
from fgf_warp.errors import ConfigError, SceneError
from fgf_warp.output.denoise import check_denoiser, denoise, denoiser_version
from fgf_warp.output.enlarging import enlarge, repeat
from fgf_warp.renderer import Progress
from fgf_warp.result import RenderResult
from fgf_warp.scene import Scene
from fgf_warp.settings import Aov, RenderSettings

GUIDES = frozenset({Aov.ALBEDO, Aov.NORMAL})
"""Planes by which the denoiser tells noise from detail."""
REPEATED_AOVS = frozenset({Aov.DEPTH, Aov.SAMPLES, Aov.PRIM_ID, Aov.INSTANCE_ID})
"""Planes whose pixels stand for themselves: between two names, or what is near and nothing, there is no third."""


def render_image(
    scene: Scene, settings: RenderSettings, goal: Goal | None = None, progress: Progress | None = None
) -> RenderResult:
    """Renders a picture with all that its settings ask for.

    Args:
        scene: what to render.
        settings: of the picture.
        goal: when it is good enough, in place of the settings' samples per pixel; of an upscaled picture, the pixels
            that are rendered.
        progress: called with the camera paths done and in all, which changes where there is a goal.

    Raises:
        ConfigError: for a device or a denoiser that is not there, a medium that cannot have the transport or line
            variance that is asked for, or an image that needs more memory than `settings.memory`.
        UnsupportedFeatureError: for a scene that this version cannot render.
        NumericalError: where a sample was not finite.
    """
    renderer.check_memory(settings)
    asked = as_rendered(scene, settings)
    if goal is None:
        return finish(renderer.render(*asked, progress), settings)
    return finish(convergence.render_until(*asked, goal, progress), settings)


def as_rendered(scene: Scene, settings: RenderSettings) -> tuple[Scene, RenderSettings]:
    """What the renderer is asked for, from which `finish` makes the picture.

    The media have the transport and line variance of the settings. Of an upscaled picture there are fewer pixels, which
    together see what those of the picture do, to the edge: where its sizes are no multiples, they are not quite square.

    Raises:
        ConfigError: for a denoiser that is not there, or a medium that cannot have what is asked for.
    """
    rendered = replace(
        settings,
        width=-(-settings.width // settings.upscale),
        height=-(-settings.height // settings.upscale),
        aovs=settings.aovs - {Aov.DENOISED},
        transport=None,
        line_variance=None,
        upscale=1,
    )
    if Aov.DENOISED in settings.aovs:
        check_denoiser()
        rendered = replace(rendered, aovs=rendered.aovs | GUIDES)
    scene = _with_laws(scene, settings)
    if settings.upscale > 1:
        stretch = (settings.width / rendered.width) / (settings.height / rendered.height)
        camera = replace(scene.camera, pixel_aspect_ratio=scene.camera.pixel_aspect_ratio * stretch)
        scene = replace(scene, camera=camera)
    return scene, rendered


def finish(result: RenderResult, settings: RenderSettings) -> RenderResult:
    """The picture that was asked for.

    Denoising comes first, since enlarged noise is no longer that of single pixels.

    Args:
        result: of `as_rendered` settings.
        settings: of the picture.
    """
    settings = replace(settings, seed=result.settings.seed)
    if settings == result.settings:
        return result
    started = time.perf_counter()
    if Aov.DENOISED in settings.aovs:
        result = _denoised(result)
    if settings.upscale > 1:
        result = _enlarged(result, settings)
    return replace(
        result,
        aovs={aov: plane for aov, plane in result.aovs.items() if aov in settings.aovs},
        seconds=result.seconds + time.perf_counter() - started,
        settings=settings,
    )


def _with_laws(scene: Scene, settings: RenderSettings) -> Scene:
    asked = {"transport": settings.transport, "line_variance": settings.line_variance}
    changes: dict[str, Any] = {name: value for name, value in asked.items() if value is not None}
    if not changes:
        return scene
    try:
        return scene.with_media(tuple(replace(medium, **changes) for medium in scene.media))
    except SceneError as error:
        # It names the medium, what is asked of it and what it accepts.
        raise ConfigError(str(error)) from error


def _denoised(result: RenderResult) -> RenderResult:
    plane = denoise(result.radiance, result.aovs[Aov.ALBEDO], result.aovs[Aov.NORMAL])
    versions = {**result.provenance.get("versions", {}), "pyoidn": denoiser_version()}
    return replace(
        result,
        aovs={**result.aovs, Aov.DENOISED: plane},
        provenance={**result.provenance, "versions": versions},
    )


def _enlarged(result: RenderResult, settings: RenderSettings) -> RenderResult:
    """Every plane in the size of the picture; the variance is that of the rendered pixels."""
    width, height = settings.width, settings.height
    rows, columns = result.alpha.shape

    def enlarged(aov: Aov, plane: np.ndarray) -> np.ndarray:
        return (repeat if aov in REPEATED_AOVS else enlarge)(plane, width, height)

    aovs = {aov: enlarged(aov, plane) for aov, plane in result.aovs.items()}
    if Aov.MOTION in aovs:
        aovs[Aov.MOTION] = aovs[Aov.MOTION] * np.array([width / columns, height / rows], dtype=np.float32)
    size = {"width": width, "height": height, "upscale": settings.upscale}
    return replace(
        result,
        radiance=enlarge(result.radiance, width, height),
        alpha=enlarge(result.alpha, width, height),
        variance=repeat(result.variance, width, height),
        aovs=aovs,
        provenance={**result.provenance, "settings": {**result.provenance.get("settings", {}), **size}},
    )
