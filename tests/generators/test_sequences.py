"""Sequences: all frames are read before the first one is rendered."""

import gc
import weakref
from pathlib import Path

import pytest
from typer.testing import CliRunner

import fgf_warp.renderer
import usd_scenes.reader
from generators.cli import app
from tests.renders import made_up_render
from tests.usd.prims import CAMERA, DOME, medium_sphere

HEADER = '#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "Y"\n)\n'
FRAMES = 12


@pytest.fixture
def render(tmp_path: Path, fake_renderer, monkeypatch):
    """Runs `fgf render` of frames of a sphere with these attributes of its medium, and of the sphere."""

    def make(scene, settings, progress=None):
        fake_renderer.append(settings.seed)
        return made_up_render(settings)

    monkeypatch.setattr(fgf_warp.renderer, "render", make)

    def run(medium: str, sphere: str = ""):
        ball = medium_sphere(medium).replace("    rel material", f"    {sphere}\n    rel material", 1)
        (tmp_path / "shot.usda").write_text(HEADER + CAMERA + DOME + ball)
        arguments = ["render", tmp_path / "shot.usda", "-o", tmp_path / "shot.##.exr", "-w", 8, "--frames"]
        return CliRunner().invoke(app, [str(argument) for argument in (*arguments, f"1:{FRAMES}")])

    return run


def test_a_frame_that_is_refused_is_named_before_work_begins(render, fake_renderer, tmp_path: Path) -> None:
    outcome = render("float inputs:fgf:asymmetry.timeSamples = { 1: 0, 9: 0, 10: 1.5 }")
    assert outcome.exit_code == 2
    (line,) = [line for line in outcome.stderr.splitlines() if line.startswith("error: ")]
    assert "/Look.inputs:fgf:asymmetry: g = 1.5; accepted" in line
    assert line.endswith("(frame 10)")
    assert fake_renderer == []
    assert not [*tmp_path.glob("*.exr")]


def test_what_a_later_frame_alone_is_warned_of_is_told_with_the_frame(render, fake_renderer) -> None:
    outcome = render("", 'token visibility.timeSamples = { 1: "inherited", 7: "invisible" }')
    assert outcome.exit_code == 0, outcome.output
    warnings = [line for line in outcome.stderr.splitlines() if line.startswith("warning: ")]
    assert [line.split(":")[1].strip() for line in warnings] == ["no geometry"]
    assert warnings[0].endswith("(frame 7)")
    assert len(fake_renderer) == FRAMES


def test_no_more_scenes_are_kept_than_one_renders(render, monkeypatch) -> None:
    seen, read, kept = [], usd_scenes.reader.read_scene, []

    def watched(*arguments, **options):
        gc.collect()
        kept.append(sum(scene() is not None for scene in seen))
        reading = read(*arguments, **options)
        seen.append(weakref.ref(reading.scene))
        return reading

    monkeypatch.setattr(usd_scenes.reader, "read_scene", watched)
    assert render("").exit_code == 0
    assert len(seen) == 2 * FRAMES
    assert max(kept) <= 1
