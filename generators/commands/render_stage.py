"""What `fgf render` does once it is known how: reads a stage, renders it, and says what came of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import TYPE_CHECKING

import typer

from fgf_warp.errors import FgfError
from fgf_warp.settings import USUAL_AOVS, Aov, RenderSettings
from generators.commands.common import EXIT_PARTIAL, fail, progress_bar, start_warp, telling, warn

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from fgf_warp.convergence import Goal
    from fgf_warp.result import RenderResult
    from fgf_warp.scene import Scene
    from generators.auto import Choice
    from generators.pictures import Picture
    from generators.wish import Wish
    from usd_scenes.reader import Frame, ReadOptions


@dataclass(frozen=True, eq=False)
class StageToRender:
    """A stage, and how all pictures of it are made.

    Args:
        stage: the USD file.
        times: the frames to render, at least one; None is where the stage starts.
        settings: of every picture, whose size and planes are the stage's business.
        aovs: the planes, in place of those that the stage asks for; None keeps those.
        denoise: True where the plane denoised is added.
        width: [pixel], >= 1; None as `generators.stage.image_size` says.
        height: [pixel], >= 1; likewise.
        options: what is asked of the stage, beside frame and product.
    """

    stage: Path
    times: Sequence[Frame | None]
    settings: RenderSettings
    aovs: frozenset[Aov] | None
    denoise: bool
    width: int | None
    height: int | None
    options: ReadOptions
    _told: set[str] = field(default_factory=set)

    def load(self, frame: Frame | None, product: str | None) -> tuple[Scene, RenderSettings]:
        """What is rendered of one frame and one product, and how; new warnings are printed.

        Args:
            frame: one of the times.
            product: prim path of the RenderProduct; None is the settings' first.

        Returns:
            The scene, and settings of its size and planes.

        Raises:
            FgfError: where the stage is not accepted.
        """
        from generators.stage import load_scene  # noqa: PLC0415

        options: ReadOptions = {**self.options, "frame": frame, "product": product}
        with telling(f"reading {self.stage}"):
            base = load_scene(self.stage, width=self.width, height=self.height, **options)
        planes = next(planes for planes in (self.aovs, base.aovs, USUAL_AOVS) if planes is not None)
        if self.denoise:
            planes |= {Aov.DENOISED}
        settings = replace(self.settings, width=base.width, height=base.height, aovs=planes)
        self._warn_once(base.warnings, frame)
        return base.scene, settings

    def _warn_once(self, warnings: Sequence[str], frame: Frame | None) -> None:
        """Warns of each kind of thing at the first frame where it is met, and names that unless it is the first."""
        from usd_scenes.reader import kind_of, name_of  # noqa: PLC0415 - USD is slow to import

        new = {kind: warning for warning in warnings if (kind := kind_of(warning)) not in self._told}
        self._told.update(new)
        warn([text if frame == self.times[0] else f"{text} ({name_of(frame)})" for text in new.values()])


def render_pictures(
    pictures: Sequence[Picture], source: StageToRender, goal: Goal | None, wish: Wish | None, *, depth_is_asked: bool
) -> None:
    """Renders all images, each of which is written before the next is begun; Ctrl-C ends the program between them.

    Args:
        pictures: their files, and the frame and product of each.
        source: what they are of, in stages that are open.
        goal: what ends each, or None.
        wish: what settings are chosen for, or None.
        depth_is_asked: True where paths end early because that was asked for, which needs no warning.

    Raises:
        FgfError: for what cannot be read, rendered or written; of what can be known beforehand, before the first image.
    """
    done = 0
    try:
        if len(pictures) > 1:
            _check_frames(pictures, source)
        start_warp(source.settings.device)
        for picture in pictures:
            scene, settings = source.load(picture.frame, picture.product)
            _render_picture(picture, scene, settings, goal, wish, depth_is_asked=depth_is_asked)
            done += 1
    except KeyboardInterrupt:
        fail(f"stopped; {done} of {len(pictures)} images are written", EXIT_PARTIAL)


def explain_kernel(source: StageToRender) -> None:
    """Prints what the kernel of the first frame is built for, and why."""
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    from fgf_warp.features import explain  # noqa: PLC0415
    from fgf_warp.finishing import as_rendered  # noqa: PLC0415 - starts Warp

    table = Table("part", "in the kernel", "why")
    for reason in explain(*as_rendered(*source.load(source.times[0], None))):
        table.add_row(reason.part, "yes" if reason.built else "-", reason.why)
    Console(markup=False, highlight=False).print(table)


def _check_frames(pictures: Sequence[Picture], source: StageToRender) -> None:
    """Reads all that is to be rendered before the first image is, and keeps nothing of it.

    Raises:
        FgfError: with the frame that it is of.
    """
    from usd_scenes.reader import name_of  # noqa: PLC0415 - USD is slow to import

    with progress_bar(counted=True) as progress:
        task = progress.add_task("reading", total=len(pictures))
        for picture in pictures:
            try:
                source.load(picture.frame, picture.product)
            except FgfError as error:
                raise type(error)(f"{error} ({name_of(picture.frame)})") from error
            progress.advance(task)


def _render_picture(
    picture: Picture,
    scene: Scene,
    settings: RenderSettings,
    goal: Goal | None,
    wish: Wish | None,
    *,
    depth_is_asked: bool,
) -> None:
    """Renders one image and writes its files, each whole or not at all.

    Args:
        picture: its files.
        scene: what is rendered.
        settings: how.
        goal: what ends it, or None.
        wish: what its settings are chosen for, or None.
        depth_is_asked: True where paths end early because that was asked for, which needs no warning.
    """
    from fgf_warp.convergence import FIRST_SPP  # noqa: PLC0415 - starts Warp
    from fgf_warp.finishing import as_rendered, render_image  # noqa: PLC0415
    from fgf_warp.output.color import write_png  # noqa: PLC0415
    from fgf_warp.output.exr import write_exr  # noqa: PLC0415
    from fgf_warp.renderer import check_memory, prepare  # noqa: PLC0415

    check_memory(settings)
    choice = None if wish is None else _choose_by_wish(scene, settings, wish)
    if choice is not None:
        settings, goal = choice.settings, choice.goal
    with progress_bar(counted=False) as progress:
        task = progress.add_task("building the kernel", total=None)
        plain, asked = as_rendered(scene, settings)
        prepare(plain, asked)
        progress.update(task, description="placing the shapes")

        def show(done: int, total: int) -> None:
            # How much is needed for a goal is known after the first round.
            is_known = goal is None or total > FIRST_SPP * asked.width * asked.height
            expected = total if is_known else None
            progress.update(task, description=f"rendering {picture.exr.name}", completed=done, total=expected)

        began = perf_counter()
        result = render_image(scene, settings, goal, show)
        wall = perf_counter() - began
    write_exr(picture.exr, result)
    if picture.png:
        write_png(picture.png, result.aovs.get(Aov.DENOISED, result.radiance))
    _print_render(result, goal, depth_is_asked=depth_is_asked)
    if choice is not None:
        typer.echo(f"{choice.seconds + wall:.2f} s in all, with {choice.seconds:.2f} s of the pilot")
    elif goal is not None:
        typer.echo(f"ended by {_ended_by(result, goal)}")
    for file in picture.files:
        typer.echo(f"wrote {file}")


def _choose_by_wish(scene: Scene, settings: RenderSettings, wish: Wish) -> Choice:
    """The cheapest settings for a wish; prints what they are and why."""
    from generators.auto import choose  # noqa: PLC0415 - starts Warp
    from generators.tradeoff.front import read_front  # noqa: PLC0415

    with progress_bar(counted=False) as progress:
        progress.add_task("choosing the settings", total=None)
        choice = choose(scene, settings, wish, read_front())
    for line in choice.lines:
        typer.echo(line)
    return choice


def _print_render(result: RenderResult, goal: Goal | None, *, depth_is_asked: bool) -> None:
    over = "mean" if goal is None else goal.over
    typer.echo(
        f"{result.seconds:.2f} s, {result.samples_per_second:.4g} samples/s, {result.samples} samples per pixel, "
        f"{over} relative standard error {result.relative_error(over):.2%}"
    )
    if result.truncated_count and not depth_is_asked:
        share = result.truncated_count / result.path_count
        warn(
            [
                f"{result.truncated_count} paths ({share:.2g} of all) were cut after {result.settings.max_depth} "
                "scattering events, so the image is a little too dark; a higher --preset cuts later"
            ]
        )


def _ended_by(result: RenderResult, goal: Goal) -> str:
    """The bound that was met first."""
    if goal.is_met_by(result):
        return f"--targetError {goal.error:.4g}"
    return f"--spp {goal.max_spp}" if goal.time is None or result.samples >= goal.max_spp else f"--time {goal.time:g}"
