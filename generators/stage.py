"""The base scene of a render or a dataset, with the size its images get."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fgf_warp.errors import ConfigError, SceneError
from fgf_warp.scene import Camera, Scene

DEFAULT_WIDTH = 960
"""[pixel], of a stage without a resolution; as of usdrecord."""
DEFAULT_PURPOSES = ("default", "render")


@dataclass(frozen=True, eq=False)
class BaseScene:
    """A stage as read.

    Args:
        scene: the plain scene.
        width: of its images [pixel].
        height: of its images [pixel].
        warnings: what was left out of the stage or is unusual in it.
    """

    scene: Scene
    width: int
    height: int
    warnings: tuple[str, ...]


def load_scene(
    path: Path,
    *,
    camera: str | None = None,
    frame: float | None = None,
    purposes: Sequence[str] = DEFAULT_PURPOSES,
    width: int | None = None,
    height: int | None = None,
    strict: bool = False,
) -> BaseScene:
    """Reads a USD stage.

    Args:
        path: of the stage.
        camera: prim path or name; None takes the render settings', else the first (with a warning where there are
            several), else a view from the front.
        frame: time code; None takes the stage's startTimeCode, else each attribute's earliest sample.
        purposes: of the geometry to include.
        width: [pixel]; see `image_size`.
        height: [pixel].
        strict: True refuses a stage of which something is missing, such as a texture, in place of a warning.

    Raises:
        SceneError: for a missing, broken or unsuitable stage.
        UnsupportedFeatureError: for one that asks for more than the renderer does.
    """
    if not path.is_file():
        raise SceneError(f"{path}: there is no such stage")
    from usd_scenes.reader import read_scene  # noqa: PLC0415 - USD is slow to import

    reading = read_scene(path, camera=camera, frame=frame, purposes=tuple(purposes), strict=strict)
    size = image_size(reading.scene.camera, reading.resolution, width, height)
    return BaseScene(reading.scene, *size, tuple(reading.warnings))


def image_size(
    camera: Camera, resolution: tuple[int, int] | None, width: int | None, height: int | None
) -> tuple[int, int]:
    """Width and height of the image [pixel].

    As asked for; of one alone, the other follows from the aspect ratio: the stage's where it has a resolution, else
    the camera's. Of neither, it is the stage's resolution, else 960 wide.

    Raises:
        ConfigError: for a size below one pixel.
    """
    for name, size in (("width", width), ("height", height)):
        if size is not None and size < 1:
            raise ConfigError(f"image {name} = {size}; accepted: an integer >= 1")
    if width is not None and height is not None:
        return width, height
    aspect = resolution[0] / resolution[1] if resolution else camera.aspect_ratio
    if height is not None:
        return max(1, round(height * aspect)), height
    if width is None and resolution is not None:
        return resolution
    width = width or DEFAULT_WIDTH
    return width, max(1, round(width / aspect))
