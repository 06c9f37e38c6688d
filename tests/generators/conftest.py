"""A dataset's base scene in code, and a renderer that does not render."""

import textwrap
from dataclasses import replace
from itertools import groupby
from types import SimpleNamespace

import pytest

import fgf_warp.convergence  # before its functions are replaced
import fgf_warp.renderer
import usd_scenes.reader
from tests.renders import made_up_render
from tests.scenes import furnace
from usd_scenes.reader import StageReading

CONFIG = """\
name: trial
scene: scene.usda
seed: 7
image: {width: 12, height: 8}
spp: 4
aovs: [variance]
axes:
  H: [-0.5, -0.25]
  g:
    linspace: [-0.5, 0.5, 3]
  S_w: {loguniform: [0.1, 10]}
"""
STAGE = """\
#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
)
def Xform "World"
{
}
"""


@pytest.fixture
def scene():
    return furnace()


@pytest.fixture
def config_path(tmp_path, monkeypatch, scene):
    """A config file beside its scene, which reads as the furnace."""
    monkeypatch.setattr(usd_scenes.reader, "read_scene", lambda path, **_: StageReading(scene, None, ()))
    (tmp_path / "scene.usda").write_text(STAGE)
    path = tmp_path / "trial.yaml"
    path.write_text(CONFIG)
    return path


@pytest.fixture
def write_config(tmp_path):
    """Writes a config of the given lines and returns its path."""

    def write(text: str):
        path = tmp_path / "config.yaml"
        path.write_text(textwrap.dedent(text))
        return path

    return write


@pytest.fixture
def fake_renderer(monkeypatch):
    """Takes the renderer's place; the list of seeds it was asked for. A test may replace its `render` once more."""
    seeds = []

    def render(scene, settings, progress=None):
        seeds.append(settings.seed)
        if progress:
            progress(1, 1)
        return made_up_render(settings, H=scene.media[0].hurst)

    def batches(scene, variants, settings):
        for _, images in groupby(variants, lambda variant: variant.media[0].line_law.kind):
            yield SimpleNamespace(scene=scene, settings=settings, variants=tuple(images))

    def advance(model, state, samples, progress, images):
        for done, image in enumerate(images):
            progress(samples * done, samples * len(images))
            yield image
        progress(1, 1)

    def develop(model, state, image):
        variant = model.variants[image]
        scene, settings = model.scene.with_media(variant.media), replace(model.settings, seed=variant.seed)
        return fgf_warp.renderer.render(scene, settings)

    monkeypatch.setattr(fgf_warp.renderer, "prepare", lambda scene, settings: None)
    for stand_in in (render, batches, advance, develop):
        monkeypatch.setattr(fgf_warp.renderer, stand_in.__name__, stand_in)
    monkeypatch.setattr(fgf_warp.renderer, "begin", lambda model: None)
    return seeds
