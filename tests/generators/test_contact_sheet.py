from dataclasses import replace

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from fgf_warp.output.exr import write_exr
from generators import contact_sheet
from generators.config import SweepConfig
from generators.manifest import exr_name
from generators.plan import build_plan
from tests.renders import made_up_render
from tests.scenes import furnace


def sheet_of(tmp_path, missing=(), width=64, height=48, **keys):
    """The plan, and the pixels of the sheet of its made-up images."""
    config = SweepConfig.model_validate({"name": "trial", "scene": "s", "spp": 1, **keys})
    plan = build_plan(config, furnace(), width, height)
    (tmp_path / "images").mkdir()
    for sample in plan.samples:
        if sample.index not in missing:
            write_exr(tmp_path / exr_name(sample), made_up_render(replace(plan.settings, seed=sample.seed)))
    contact_sheet.write_contact_sheet(tmp_path / "sheet.png", plan, tmp_path)
    return plan, oiio.ImageInput.open(str(tmp_path / "sheet.png")).read_image("uint8")


def test_first_axis_runs_down_and_last_across(tmp_path):
    plan, pixels = sheet_of(tmp_path, axes={"H": [-0.5, -0.4, -0.25], "g": [0.0, 0.5]}, width=256, height=64)
    layout = contact_sheet._choose_layout(plan, (64, 256))
    assert (layout.row_count, layout.column_count) == (3, 2)
    assert [level.labels for level in layout.rows] == [("H = -0.5", "H = -0.4", "H = -0.25")]
    assert [level.labels for level in layout.columns] == [("g = 0", "g = 0.5")]
    assert pixels.shape[1] >= 2 * 256
    assert pixels.shape[0] >= 3 * 64


def test_size_of_the_sheet_follows_from_its_parts(tmp_path):
    _, pixels = sheet_of(tmp_path, axes={"H": [-0.5, -0.4], "g": [0.0, 0.5, 0.7]})
    margin, gap, thumbnail = contact_sheet.MARGIN, contact_sheet.GAP, (4 * 48, 4 * 64)
    label = pixels.shape[1] - 2 * margin - 3 * thumbnail[1] - 2 * gap
    assert 50 < label < 110  # of 'H = -0.5'
    header = pixels.shape[0] - 2 * margin - 2 * thumbnail[0] - gap
    assert 2 * 18 < header < 160  # two captions, the title, its line, the columns' labels


def test_every_thumbnail_is_the_image_it_stands_for(tmp_path):
    plan, pixels = sheet_of(tmp_path, axes={"g": [0.0, 0.5], "H": [-0.5, -0.4]}, width=256, height=32)
    found = []
    for sample in plan.samples:
        picture = contact_sheet._thumbnail(tmp_path / exr_name(sample), plan)
        corners = np.argwhere((pixels[: -picture.shape[0] + 1, : -picture.shape[1] + 1] == picture[0, 0]).all(axis=2))
        places = [
            (y, x) for y, x in corners if (pixels[y : y + picture.shape[0], x : x + picture.shape[1]] == picture).all()
        ]
        assert len(places) == 1
        found += places
    (y0, x0), (y1, x1), (y2, x2), (y3, x3) = found
    assert y0 == y1 < y2 == y3
    assert x0 == x2 < x1 == x3


def test_missing_images_stay_empty(tmp_path):
    _, pixels = sheet_of(tmp_path, axes={"g": [0.0, 0.5], "H": [-0.5, -0.4]}, missing={3})
    empty = np.rint(255 * np.array(contact_sheet.EMPTY)).astype(np.uint8)
    # A few pixels at the edges of letters happen to have the same colour.
    assert 0 <= (np.abs(pixels.astype(int) - empty).max(axis=2) <= 1).sum() - 4 * 48 * 4 * 64 < 100


@pytest.mark.parametrize(
    ("axes", "draws", "count"),
    [({}, 1, 1), ({}, 7, 7), ({"H": [-0.5]}, 1, 1), ({"S_w": {"uniform": [0, 1]}}, 5, 5), ({"H": [-0.4, -0.3]}, 3, 6)],
)
def test_sheets_of_few_or_random_axes(tmp_path, axes, draws, count):
    plan, pixels = sheet_of(tmp_path, axes=axes, draws=draws, width=16, height=16)
    layout = contact_sheet._choose_layout(plan, (256, 256))
    assert layout.indices == tuple(range(count))
    assert layout.row_count * layout.column_count >= count
    assert pixels.shape[1] >= layout.column_count * 256


def test_large_datasets_show_an_evenly_spaced_part_and_say_so():
    config = SweepConfig.model_validate(
        {"name": "a", "scene": "s", "axes": {"g": {"linspace": [-0.9, 0.9, 50]}, "H": [-0.5, -0.4]}, "draws": 10}
    )
    plan = build_plan(config, furnace(), 64, 48)
    layout = contact_sheet._choose_layout(plan, (48, 64))
    assert len(layout.indices) == contact_sheet.THUMBNAILS_MAX
    assert layout.indices[0] == 0
    assert {b - a for a, b in zip(layout.indices, layout.indices[1:], strict=False)} == {4, 5}
    assert contact_sheet._subtitle(plan, len(layout.indices)).startswith("240 of 1,000 samples, evenly spaced")
