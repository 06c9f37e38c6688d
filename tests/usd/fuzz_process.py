"""Renders the stages whose paths it is given, line by line, and answers each with a line of JSON.

All are rendered by one kernel: beside each stands all of the stage that has a bit of everything.
A stage whose kernel would need still more is only read.
"""

import json
import os
import sys
import traceback
from dataclasses import replace
from pathlib import Path

import warp as wp
from typer.testing import CliRunner

from fgf_warp import renderer
from fgf_warp.features import required_features
from fgf_warp.output.exr import read_exr
from fgf_warp.scene import Instances, Scene, Shape
from fgf_warp.settings import Aov, RenderSettings
from generators.cli import app
from tests.usd.one_kernel import union
from usd_scenes.reader import read_scene

SIZE = 8
SETTINGS = RenderSettings(width=SIZE, height=SIZE, spp=1, aovs=frozenset({Aov.VARIANCE}))
PROGRESS = "━"
"""What lines with a bar hold."""
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
    if isinstance(done.exception, NotRendered):
        return {"kind": "read"}
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        return {"kind": "raised", "text": "".join(traceback.format_exception(done.exception))}
    if left:
        return {"kind": "littered", "text": ", ".join(left)}
    lines = [line for line in done.stderr.splitlines() if line.strip() and PROGRESS not in line]
    errors = [line for line in lines if not line.startswith("warning: ")]
    if done.exit_code == 0 and not errors:
        read_exr(image)
        return {"kind": "rendered", "text": ""}
    is_clean = done.exit_code in (2, 4) and 1 <= len(errors) <= 2 and errors[0].startswith("error: ")
    if image.exists() or not is_clean:
        return {"kind": "untidy", "text": f"exit code {done.exit_code}: {done.output}"}
    return {"kind": "refused" if done.exit_code == 2 else "invalid", "text": errors[0]}


class Companion:
    """A scene that stands beside all others, so that they need one kernel.

    Args:
        path: of its stage.
    """

    def __init__(self, path: Path) -> None:
        self.scene = read_scene(path).scene
        self.features = required_features(self.scene, SETTINGS)

    def beside(self, scene: Scene) -> Scene:
        """Both in one."""
        shapes = tuple(_moved(shape, len(scene.media)) for shape in self.scene.shapes)
        return replace(
            scene,
            shapes=scene.shapes + shapes,
            media=scene.media + self.scene.media,
            lights=scene.lights + self.scene.lights,
        )

    def has_kernel_for(self, scene: Scene) -> bool:
        """True where the scene needs nothing that this one does not."""
        return union([required_features(scene, SETTINGS), self.features]) == self.features


def _moved(shape: Shape, media: int) -> Shape:
    """The shape, of which the medium has moved up in the list."""
    if isinstance(shape, Instances):
        return replace(shape, prototype=_moved(shape.prototype, media))
    return shape if shape.medium is None else replace(shape, medium=shape.medium + media)


class NotRendered(Exception):  # noqa: N818 - it is no error
    """The scene was read, and needs a kernel of its own."""


def main() -> None:
    wp.config.log_level = wp.LOG_WARNING
    # What libraries print must not mix with the answers.
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    companion = Companion(Path(sys.argv[1]))
    prepare, render = renderer.prepare, renderer.render

    def prepare_both(scene: Scene, settings: RenderSettings) -> object:
        if not companion.has_kernel_for(scene):
            raise NotRendered
        return prepare(companion.beside(scene), settings)

    renderer.required_features = lambda _scene, _settings: companion.features
    render(companion.scene, SETTINGS)
    renderer.prepare = prepare_both
    renderer.render = lambda scene, settings, progress: render(companion.beside(scene), settings, progress)
    print("ready", file=out)
    for line in sys.stdin:
        print(json.dumps(answer(Path(line.strip()))), file=out)


if __name__ == "__main__":
    main()
