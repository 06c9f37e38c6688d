"""Renders the project's own stages with the source tree that PYTHONPATH names; `same_pictures` runs two of these.

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

from fgf_warp.finishing import render_image
from fgf_warp.settings import RENDERED_AOVS, USUAL_AOVS, RenderSettings
from usd_scenes.reader import read_scene

PLANES = {"none": frozenset(), "usual": USUAL_AOVS, "all": RENDERED_AOVS}


def answer(asked: dict[str, object]) -> dict[str, object]:
    """Seconds of the processor that a render took; its arrays are written to a file where one is named."""
    settings = RenderSettings(
        width=asked["width"],
        height=asked["width"],
        spp=asked["spp"],
        seed=1,
        aovs=PLANES[asked["planes"]],
        transport=asked["transport"],
    )
    scene = read_scene(asked["stage"]).scene
    scene = replace(scene, source="")  # What the file is called is no part of a picture.
    began = process_time()
    result = render_image(scene, settings)
    seconds = process_time() - began
    if asked["file"]:
        arrays = {str(plane): value for plane, value in result.aovs.items()}
        np.savez(asked["file"], radiance=result.radiance, alpha=result.alpha, **arrays)
    return {"seconds": seconds, "tree": str(Path(sys.modules["fgf_warp"].__file__).parents[1])}


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
