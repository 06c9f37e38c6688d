"""Renders the stages whose paths it is given, line by line, and answers each with a line of JSON.

A stage whose kernel would need more than the one that has everything, such as another sampler's, cannot occur.
"""

import json
import os
import sys
import traceback
from pathlib import Path

import numpy as np
import warp as wp
from typer.testing import CliRunner

from fgf_warp import renderer
from fgf_warp.output.exr import read_exr
from fgf_warp.scene import Camera, Scene
from fgf_warp.settings import RenderSettings
from generators.cli import app
from tests.usd.one_kernel import EVERYTHING

SIZE = 8
OPTIONS = [
    "--imageWidth",
    str(SIZE),
    "--imageHeight",
    str(SIZE),
    "--spp",
    "1",
    "--preset",
    "preview",
    "--aov",
    "variance",
]


def answer(path: Path) -> dict[str, str]:
    image = path.with_suffix(".exr")
    done = CliRunner().invoke(app, ["render", str(path), "-o", str(image), *OPTIONS])
    left = [other.name for other in path.parent.iterdir() if other.stem == path.stem and other not in (path, image)]
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return {"kind": "raised", "text": "".join(traceback.format_exception(done.exception))}
    if left:
        return {"kind": "littered", "text": ", ".join(left)}
    errors = [line for line in done.stderr.splitlines() if line and not line.startswith("warning: ")]
    if done.exit_code == 0 and not errors:
        read_exr(image)
        return {"kind": "rendered", "text": ""}
    is_clean = done.exit_code in (2, 4) and 1 <= len(errors) <= 2 and errors[0].startswith("error: ")
    if image.exists() or not is_clean:
        return {"kind": "untidy", "text": f"exit code {done.exit_code}: {done.output}"}
    return {"kind": "refused" if done.exit_code == 2 else "invalid", "text": errors[0]}


def main() -> None:
    wp.config.log_level = wp.LOG_WARNING
    renderer.required_features = lambda _scene, _settings: EVERYTHING
    # What libraries print must not mix with the answers.
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    empty = Scene(camera=Camera(name="camera", camera_to_world=np.eye(4)))
    renderer.prepare(empty, RenderSettings(width=SIZE, height=SIZE, spp=1))
    print("ready", file=out)
    for line in sys.stdin:
        print(json.dumps(answer(Path(line.strip()))), file=out)


if __name__ == "__main__":
    main()
