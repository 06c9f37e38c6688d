"""The scene of a sample: a stage with the values of its axes, read where it is needed."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fgf_warp.errors import ConfigError
from fgf_warp.scene import Camera
from generators.dataset.scene_files import scene_folder
from generators.planning.config import ELEVATION_MAX, OrbitConfig
from generators.planning.digest import KeptHashes
from generators.planning.targets import Target
from generators.stage import BaseScene, load_scene

if TYPE_CHECKING:
    from usd_scenes.reader import OpenStages

Key = tuple[float | str, ...]
"""Values of the axes that change the scene, in the order of `Recipe.targets`."""

SCENES_KEPT = 4
"""Scenes that stay in memory: samples that are near each other in the plan are of few of them."""


@dataclass(frozen=True)
class Recipe:
    """How the scenes of a plan are made.

    Args:
        stages: path of each stage, by the name of its file, see `stage_name`.
        targets: what the axes change, by column, without those of the swept medium.
        camera: prim path or name; None takes the stage's.
        orbit: where the camera is put; None leaves it where it is.
        frame: time code; None takes the stage's start.
        width: of the images [pixel]; None follows from the stage.
        height: likewise.
        dataset: location of the one that holds the stages under these names; None takes them from where they are.
    """

    stages: Mapping[str, str]
    targets: Mapping[str, Target]
    camera: str | None = None
    orbit: OrbitConfig | None = None
    frame: float | None = None
    width: int | None = None
    height: int | None = None
    dataset: str | None = None

    def key(self, parameters: Mapping[str, float | str]) -> Key:
        """What tells the scenes of samples apart."""
        return tuple(parameters[name] for name in self.targets)

    def stage_key(self, key: Key) -> Key:
        """The part of a key without the orbit: what the stage must be read anew for.

        Returns:
            The values of targets that are no orbit, in their order.
        """
        kinds = (target.kind for target in self.targets.values())
        return tuple(value for kind, value in zip(kinds, key, strict=True) if kind != "orbit")

    def read_stage(self, stage_key: Key, stages: OpenStages) -> BaseScene:
        """A stage with other values, with its own camera; its source is the name of the stage's file alone.

        Args:
            stage_key: the values, as of `stage_key`.
            stages: that have been entered.

        Raises:
            FgfError: where the stage is not there, not accepted, or not with these values.
        """
        view: dict[str, Any] = {"camera": self.camera, "frame": self.frame, "scene": next(iter(self.stages))}
        edits: dict[str, float | str] = {}
        targets = (target for target in self.targets.values() if target.kind != "orbit")
        for target, value in zip(targets, stage_key, strict=True):
            if target.kind in ("attribute", "variants"):
                edits[str(target)] = value
            else:
                view[target.name] = value
        name = view["scene"]
        base = load_scene(
            Path(self.stages[name]) if self.dataset is None else scene_folder(self.dataset) / name,
            camera=view["camera"],
            frame=view["frame"],
            edits=edits,
            stages=stages,
            width=self.width,
            height=self.height,
        )
        return replace(base, scene=replace(base.scene, source=name))

    def put_camera(self, base: BaseScene, key: Key) -> BaseScene:
        """The same with the camera on its orbit, if there is one.

        Raises:
            ConfigError: for an elevation or a distance out of its range.
        """
        if self.orbit is None:
            return base
        named = zip(self.targets.values(), key, strict=True)
        place: dict[str, Any] = {target.name: value for target, value in named if target.kind == "orbit"}
        camera = orbiting(base.scene.camera, self.orbit, base.up_axis, **place)
        return replace(base, scene=base.scene.with_camera(camera))


class SceneReader:
    """Reads the scenes of a plan, and keeps the last few; a copy in another process begins without any.

    Args:
        recipe: how they are made.
    """

    def __init__(self, recipe: Recipe) -> None:
        self.recipe = recipe
        self._lock = threading.Lock()
        self._open: OpenStages | None = None
        self._hashes = KeptHashes()
        self._stage = lru_cache(SCENES_KEPT)(self._read_stage)
        self._scene = lru_cache(SCENES_KEPT)(self._read)

    def __reduce__(self) -> tuple[type[SceneReader], tuple[Recipe]]:
        return SceneReader, (self.recipe,)

    def read(self, key: Key) -> tuple[BaseScene, str]:
        """The scene of a key of `Recipe.key`, and its hash; may be called from any thread.

        Returns:
            The scene with its camera in place, and the SHA-256 of all that is in it, in hexadecimal.

        Raises:
            FgfError: where the stage is not accepted, or not with these values.
        """
        with self._lock:
            return self._scene(key)

    def close(self) -> None:
        """Closes the stages: what changes in their files is seen when they are opened again."""
        with self._lock:
            self._open = None
            self._stage.cache_clear()
            self._scene.cache_clear()

    def _read(self, key: Key) -> tuple[BaseScene, str]:
        base = self.recipe.put_camera(self._stage(self.recipe.stage_key(key)), key)
        return base, self._hashes.of(base.scene)

    def _read_stage(self, stage_key: Key) -> BaseScene:
        from usd_scenes.reader import OpenStages  # noqa: PLC0415 - USD is slow to import

        self._open = self._open or OpenStages()
        with self._open:
            return self.recipe.read_stage(stage_key, self._open)


def stage_name(path: str) -> str:
    """What a stage is called in plans and labels: by its file in the dataset."""
    from usd_scenes.localizing import stage_file_name  # noqa: PLC0415 - USD is slow to import

    return stage_file_name(Path(path).name)


def orbiting(
    camera: Camera,
    orbit: OrbitConfig,
    up_axis: str,
    *,
    azimuth: float | None = None,
    elevation: float | None = None,
    distance: float | None = None,
) -> Camera:
    """A camera put on a sphere, at rest, looking at its centre.

    Args:
        camera: whose film and lens are taken.
        orbit: the centre, and what is not given beside.
        up_axis: ``Y`` or ``Z``.
        azimuth: [degree].
        elevation: [degree].
        distance: [unit].

    Returns:
        With a (4, 4) `camera_to_world` of its own and no motion.

    Raises:
        ConfigError: for an elevation or a distance out of its range.
    """
    from usd_scenes.reader import look_at  # noqa: PLC0415

    azimuth = orbit.azimuth if azimuth is None else azimuth
    elevation = orbit.elevation if elevation is None else elevation
    distance = orbit.distance if distance is None else distance
    if not abs(elevation) <= ELEVATION_MAX:
        raise ConfigError(f"elevation = {elevation:g}; accepted: in [-{ELEVATION_MAX}, {ELEVATION_MAX}] degrees")
    if distance is None or not distance > 0:
        raise ConfigError(f"distance = {distance}; accepted: > 0")
    around, above = math.radians(azimuth), math.radians(elevation)
    across, second, third = np.eye(3)
    up, front = (third, -second) if up_axis == "Z" else (second, third)
    level = math.cos(around) * front + math.sin(around) * across
    center = np.array(orbit.center)
    eye = center + distance * (math.cos(above) * level + math.sin(above) * up)
    if not 0 < np.linalg.norm(eye - center) < math.inf:
        raise ConfigError(f"distance = {distance:g}; accepted: one that is seen beside center = {list(orbit.center)}")
    return replace(camera, camera_to_world=look_at(eye, center, up), closing=None)
