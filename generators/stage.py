"""The base scene of a render or a dataset, with the size its images get."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from fgf_warp.errors import ConfigError, SceneError
from fgf_warp.scene import Camera, Scene
from fgf_warp.settings import Aov

if TYPE_CHECKING:
    from usd_scenes.reader import Edits, OpenStages, ReadOptions, StageReading

DEFAULT_WIDTH = 960
"""[pixel], of a stage without a resolution; as of usdrecord."""
RADIANCE_SOURCES = frozenset({"alpha", "beauty", "c", "ci", "color", "radiance", "rgb", "rgba"})
"""Names that render vars have for what is in every image."""
AOV_SOURCES = {
    "cameradepth": "depth",
    "lineardepth": "depth",
    "z": "depth",
    "n": "normal",
    "nn": "normal",
    "nworld": "normal",
    "normals": "normal",
    "diffusealbedo": "albedo",
    "motionvector": "motion",
    "motionvectors": "motion",
    "samplecount": "samples",
}
"""Names that render vars have for planes, beside the planes' own, in lower case and without underscores."""


class NoStageError(SceneError):
    """A stage that is not there."""


@dataclass(frozen=True, eq=False)
class BaseScene:
    """A stage as read.

    Args:
        scene: the plain scene.
        width: of its images [pixel].
        height: of its images [pixel].
        warnings: what was left out of the stage or is unusual in it.
        aovs: the planes that the stage asks for; None where it does not say.
        up_axis: ``Y`` or ``Z``.
    """

    scene: Scene
    width: int
    height: int
    warnings: tuple[str, ...]
    aovs: frozenset[Aov] | None = None
    up_axis: str = "Y"


def load_scene(
    path: Path,
    *,
    width: int | None = None,
    height: int | None = None,
    edits: Edits | None = None,
    stages: OpenStages | None = None,
    **options: Unpack[ReadOptions],
) -> BaseScene:
    """Reads a USD stage.

    Args:
        path: of the stage.
        width: [pixel], >= 1; see `image_size`.
        height: [pixel], >= 1.
        edits: values in place of the stage's, see `usd_scenes.reader.Edits`.
        stages: that have been entered, and keep what was read last, see `usd_scenes.reader.read_scene`.
        **options: what is asked of the stage, see `usd_scenes.reader.ReadOptions`.

    Returns:
        The scene with the size of its images, and the warnings of both.

    Raises:
        NoStageError: where there is none.
        SceneError: for a broken or unsuitable stage.
        UnsupportedFeatureError: for one that asks for more than the renderer does.
        ConfigError: for a size below one pixel.
    """
    check_stage(path)
    from usd_scenes.reader import read_scene  # noqa: PLC0415 - USD is slow to import

    reading = read_scene(path, edits=edits, stages=stages, **options)
    base, warnings = base_scene(reading, width, height)
    return replace(base, warnings=(*reading.warnings, *warnings))


def base_scene(
    reading: StageReading, width: int | None = None, height: int | None = None
) -> tuple[BaseScene, list[str]]:
    """What was read, with the size of its images, and what is to be said of it beside the reading's own warnings.

    Returns:
        The scene, whose warnings are those of the reading, and the further ones, one text each.

    Raises:
        ConfigError: for a size below one pixel.
    """
    size = image_size(reading.scene.camera, reading.resolution, width, height)
    aovs, unknown = (None, []) if reading.sources is None else planes_of(reading.sources)
    accepted = ", ".join(["color", *Aov])
    warnings = [f"render var of sourceName {name} is not known and left out; accepted: {accepted}" for name in unknown]
    return BaseScene(reading.scene, *size, reading.warnings, aovs, reading.up_axis), warnings


def split_purposes(asked: str | None) -> list[str] | None:
    """The purposes of a list with commas, and the one that is always among them; None where none are asked for."""
    return None if asked is None else ["default", *asked.split(",")]


def check_stage(path: Path) -> None:
    """Checks that there is a file.

    Raises:
        NoStageError: where there is none.
    """
    if not path.is_file():
        raise NoStageError(f"{path}: there is no such stage")


def planes_of(sources: Iterable[str]) -> tuple[frozenset[Aov], list[str]]:
    """The planes that render vars stand for, and the sourceNames that stand for none."""
    of_name = {aov.replace("_", ""): aov for aov in Aov}
    of_name |= {name: of_name[plane] for name, plane in AOV_SOURCES.items() if plane in of_name}
    plain = {source: source.lower().replace("_", "") for source in sources}
    unknown = [source for source, name in plain.items() if name not in of_name and name not in RADIANCE_SOURCES]
    return frozenset(of_name[name] for name in plain.values() if name in of_name), unknown


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
    aspect = resolution[0] / resolution[1] if resolution else camera.aspect_ratio / camera.pixel_aspect_ratio
    if height is not None:
        return max(1, round(height * aspect)), height
    if width is None and resolution is not None:
        return resolution
    width = width or DEFAULT_WIDTH
    return width, max(1, round(width / aspect))
