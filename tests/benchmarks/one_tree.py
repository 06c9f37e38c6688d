"""Renders with the source tree that PYTHONPATH names; `same_pictures` runs two of these.

Reads what to do line by line and answers each with a line of JSON. It uses nothing of the project but what every
version of it has, and is run as a file.
"""

import json
import os
import sys
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
import warp as wp
from picture_scenes import SCENES

from fgf_warp.convergence import Goal
from fgf_warp.finishing import as_rendered, render_image
from fgf_warp.renderer import Variant, begin, build_model, develop, render_batch
from fgf_warp.result import RenderResult
from fgf_warp.scene import Scene
from fgf_warp.settings import RENDERED_AOVS, USUAL_AOVS, RenderSettings
from usd_scenes.reader import read_scene

PLANES = {"none": frozenset(), "usual": USUAL_AOVS, "all": RENDERED_AOVS}
EXTINCTIONS = (1.0, 0.5, 2.0)
"""Of the media of a batch, times their own."""


def scene_of(asked: dict[str, object]) -> Scene:
    """The scene of a stage or of that name, with media that are changed as asked."""
    name = asked["scene"]
    scene = SCENES[name]() if name in SCENES else read_scene(name).scene
    changes = {key: tuple(value) if isinstance(value, list) else value for key, value in asked["medium"].items()}
    # What the file is called is no part of a picture.
    return replace(scene.with_media(tuple(replace(medium, **changes) for medium in scene.media)), source="")


def variants_of(scene: Scene, asked: dict[str, object]) -> list[Variant]:
    """Those whose first medium is asked for; else the scene's own media, of several densities."""
    if "media" in asked:
        return [Variant((replace(scene.media[0], **change),), seed) for seed, change in enumerate(asked["media"])]
    return [
        Variant(tuple(replace(m, mean_extinction=k * m.mean_extinction) for m in scene.media), seed)
        for seed, k in enumerate(EXTINCTIONS)
    ]


def by_threads(scene: Scene, settings: RenderSettings) -> RenderResult:
    """With the driver of one thread a path, as the tests of that tree start it: on the CPU."""
    from tests.render.test_drivers import launch_threads

    model = build_model(*as_rendered(scene, settings))
    state = begin(model)
    launch_threads(model, state)
    state.samples[:] = settings.spp
    return develop(model, state)


def rendered(scene: Scene, settings: RenderSettings, asked: dict[str, object]) -> list[RenderResult]:
    """One image or, of a batch, several."""
    if asked["by"] == "batch":
        return [*render_batch(scene, variants_of(scene, asked), settings)]
    if asked["by"] == "threads":
        return [by_threads(scene, settings)]
    goal = Goal(**asked["goal"]) if asked["by"] == "goal" else None
    return [render_image(scene, settings, goal)]


def answer(asked: dict[str, object]) -> dict[str, object]:
    """Seconds of the processor that a render took, and its paths; its arrays are written where a file is named."""
    planes = PLANES[asked["planes"]] if asked["planes"] in PLANES else frozenset({asked["planes"]})
    settings = RenderSettings(**{"seed": 1, "aovs": planes, **asked["settings"]})
    scene = scene_of(asked)
    began = process_time()
    results = rendered(scene, settings, asked)
    seconds = process_time() - began
    if asked["file"]:
        np.savez(asked["file"], **arrays_of(results))
    tree = str(Path(sys.modules["fgf_warp"].__file__).parents[1])
    return {"seconds": seconds, "paths": sum(result.path_count for result in results), "tree": tree}


def arrays_of(results: list[RenderResult]) -> dict[str, np.ndarray]:
    """All that there is of them, by the image's number and name."""
    arrays = {}
    for k, result in enumerate(results):
        counts = np.array([result.samples, result.path_count, result.truncated_count])
        of_image = {"radiance": result.radiance, "alpha": result.alpha, "error^2": result.variance, "counts": counts}
        of_image |= {str(plane): value for plane, value in result.aovs.items()}
        arrays |= {f"{k} {name}": value for name, value in of_image.items()}
    return arrays


def main() -> None:
    """Answers until there are no more lines."""
    wp.config.log_level = wp.LOG_WARNING
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    for line in sys.stdin:
        try:
            found = answer(json.loads(line))
        except Exception as error:
            found = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(found), file=out)


if __name__ == "__main__":
    main()
