"""Reads stages that a test writes as text: it says what it is about, and the rest is the same for all."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fgf_warp import renderer
from tests.usd.one_kernel import EVERYTHING
from tests.usd.prims import CAMERA, DOME, HEADER
from usd_scenes.reader import StageReading, read_scene


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., StageReading]:
    """Reads the given prims beside a camera and a dome, from a file named stage.usda."""

    def read_prims(
        prims: str,
        *,
        header: str = HEADER,
        camera: str = CAMERA,
        light: str = DOME,
        chosen: str | None = None,
        **arguments,
    ) -> StageReading:
        return read_scene(write(tmp_path, header + camera + light + prims), camera=chosen, **arguments)

    return read_prims


@pytest.fixture(scope="module")
def one_kernel() -> Iterator[None]:
    """Makes the renderer build the kernel that has everything, for every scene."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(renderer, "required_features", lambda _scene, _settings: EVERYTHING)
        yield


def write(folder: Path, text: str) -> Path:
    """Writes stage.usda into a new folder, since USD shares layers that are still open under one path."""
    place = folder / str(len(list(folder.iterdir())))
    place.mkdir()
    path = place / "stage.usda"
    path.write_text(text)
    return path
