"""What comes of reading a stage."""

from __future__ import annotations

from dataclasses import dataclass

from fgf_warp.errors import FgfError
from fgf_warp.scene import Camera, Light, Medium, Scene, Shape


@dataclass(frozen=True)
class StageReading:
    """What a stage came to.

    Args:
        scene: for the renderer.
        resolution: width and height [pixel] of the stage's render settings, or None.
        warnings: what of the stage is not rendered as it is written, one text each.
        sources: what the stage wants in the image's planes, the sourceName of each RenderVar; None where it does not
            say.
        up_axis: ``Y`` or ``Z``.
    """

    scene: Scene
    resolution: tuple[int, int] | None
    warnings: tuple[str, ...]
    sources: tuple[str, ...] | None = None
    up_axis: str = "Y"


@dataclass(frozen=True)
class StageSurvey:
    """What of a stage can be read, whatever is refused.

    Args:
        shapes: those that are accepted.
        media: that they are filled with.
        lights: those that are accepted, or the default ones where nothing else gives light.
        camera: the one that is taken where none is asked for, or None where it is refused.
        refusals: for what reading would stop.
        warnings: what is mended, left out or not rendered as it is written: a text and the path that it holds for.
        reading: what the stage came to, or None where it is refused.
    """

    shapes: tuple[Shape, ...]
    media: tuple[Medium, ...]
    lights: tuple[Light, ...]
    camera: Camera | None
    refusals: tuple[FgfError, ...]
    warnings: tuple[tuple[str, str], ...]
    reading: StageReading | None
