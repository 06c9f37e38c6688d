"""Renders the stages whose paths it is given, line by line, and answers each with a line of JSON.

All are rendered by one kernel: beside each stands all of the stage that has a bit of everything.
A stage whose kernel would need still more is only read.
"""

import json
import os
import re
import resource
import signal
import sys
import traceback
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path

import numpy as np
import warp as wp
from typer.main import get_command

from fgf_warp import renderer
from fgf_warp.features import required_features
from fgf_warp.output.exr import read_exr
from fgf_warp.scene import Instances, Scene, Shape
from fgf_warp.settings import Aov, RenderSettings
from generators.cli import app
from tests.usd.fuzz import CPU_LIMIT, MEMORY_LIMIT
from tests.usd.one_kernel import union
from usd_scenes.reader import read_scene

SIZE = 8
SETTINGS = RenderSettings(width=SIZE, height=SIZE, spp=1, aovs=frozenset({Aov.VARIANCE}))
COMMAND = get_command(app)
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


OF_THE_STAGE = re.compile(
    r"no (camera|light|geometry): |upAxis = |metersPerUnit = |\d+ cameras and none|several RenderSettings|USD: |"
    r"the stage's renderSettingsPrimPath|render var of sourceName |\d+ paths \("
)
"""How warnings begin that are of no prim, but of the stage or the picture."""


@dataclass(frozen=True)
class Done:
    """How a command ended.

    Args:
        exit_code: of it, -1 where it did not exit.
        exception: that it ended with, beside SystemExit.
        stdout: what it said.
        stderr: what it said of what was wrong.
    """

    exit_code: int
    exception: Exception | None
    stdout: str
    stderr: str

    @property
    def traceback(self) -> str:
        """Empty where it ended as commands do."""
        return "" if self.exception is None else "".join(traceback.format_exception(self.exception))


def run(arguments: list[str]) -> Done:
    """Runs `fgf`, as a runner of Typer's does, which builds all commands anew each time."""
    code, exception, out, err = -1, None, StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            COMMAND.main(arguments, prog_name="fgf")
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
        except Exception as raised:
            exception = raised
    return Done(code, exception, out.getvalue(), err.getvalue())


def answer(path: Path) -> dict[str, str]:
    """What becomes of a stage, what it takes, and whether `fgf validate` agrees."""
    Path("/proc/self/clear_refs").write_text("5")  # The largest size from here on.
    signal.setitimer(signal.ITIMER_PROF, CPU_LIMIT)  # Its signal ends the process.
    outcome = render_picture(path)
    if outcome["kind"] in ("rendered", "refused", "read"):
        outcome = judge_validation(outcome, path)
    signal.setitimer(signal.ITIMER_PROF, 0)
    status = Path("/proc/self/status").read_text()
    memory = 1024 * int(re.search(r"VmHWM:\s+(\d+)", status)[1])
    if outcome["kind"] not in ("rendered", "refused", "read"):
        return outcome
    if memory > MEMORY_LIMIT:
        return {"kind": "bloated", "text": f"{memory / (1 << 20):.0f} MiB"}
    return outcome


def render_picture(path: Path) -> dict[str, str]:
    image = path.with_suffix(".exr")
    done = run(["render", str(path), "-o", str(image), *OPTIONS])
    left = [other.name for other in path.parent.iterdir() if other.stem == path.stem and other not in (path, image)]
    if isinstance(done.exception, NotRendered):
        return {"kind": "read"}
    if done.traceback:
        return {"kind": "raised", "text": done.traceback}
    if left:
        return {"kind": "littered", "text": ", ".join(left)}
    lines = [line for line in done.stderr.splitlines() if line.strip() and PROGRESS not in line]
    errors = [line for line in lines if not line.startswith("warning: ")]
    warnings = [line.removeprefix("warning: ") for line in lines if line.startswith("warning: ")]
    if nameless := [text for text in warnings if not OF_THE_STAGE.match(text) and "/" not in text]:
        return {"kind": "nameless", "text": nameless[0]}
    if done.exit_code == 0 and not errors:
        channels, _ = read_exr(image)
        is_finite = all(np.isfinite(channels[name]).all() for name in "RGBA")
        return {"kind": "rendered" if is_finite else "invalid", "text": ""}
    return judge_refusal(done, errors, image)


def judge_refusal(done: Done, errors: list[str], image: Path) -> dict[str, str]:
    is_clean = done.exit_code in (2, 4) and 1 <= len(errors) <= 2 and errors[0].startswith("error: ")
    if image.exists() or not is_clean:
        return {"kind": "untidy", "text": f"exit code {done.exit_code}: {done.stdout}{done.stderr}"}
    return {"kind": "refused" if done.exit_code == 2 else "invalid", "text": errors[0]}


def judge_validation(outcome: dict[str, str], path: Path) -> dict[str, str]:
    """The outcome, unless validating the same stage fails, or lets pass what was refused."""
    done = run(["validate", str(path)])
    if done.traceback:
        return {"kind": "raised", "text": f"validate: {done.traceback}"}
    if done.exit_code not in (0, 2):
        return {"kind": "untidy", "text": f"validate: exit code {done.exit_code}: {done.stdout}{done.stderr}"}
    if outcome["kind"] == "refused" and done.exit_code == 0:
        return {"kind": "disagreed", "text": f"validate lets pass: {outcome['text']}"}
    return outcome


class Companion:
    """A scene that stands beside all others, so that they need one kernel.

    Args:
        path: of its stage.
    """

    def __init__(self, path: Path) -> None:
        self.scene = read_scene(path).scene
        self.features = required_features(self.scene, SETTINGS)
        self._moved: dict[int, tuple[Shape, ...]] = {}

    def beside(self, scene: Scene) -> Scene:
        """Both in one."""
        media = len(scene.media)
        if media not in self._moved:
            self._moved[media] = tuple(_moved(shape, media) for shape in self.scene.shapes)
        return replace(
            scene,
            shapes=scene.shapes + self._moved[media],
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
    # A process that runs away meets a MemoryError before the machine does.
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + 2 * MEMORY_LIMIT, resource.RLIM_INFINITY))
    print("ready", file=out)
    for line in sys.stdin:
        print(json.dumps(answer(Path(line.strip()))), file=out)


if __name__ == "__main__":
    main()
