"""One picture of a dataset, laid out along its axes."""

import itertools
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from fgf_warp.errors import CorruptFileError
from fgf_warp.output.drawing import text_width
from fgf_warp.output.exr import write_exr
from fgf_warp.settings import RenderSettings
from generators.dataset import layout
from generators.dataset.plan_table import AxisMeta, write_plan
from generators.dataset.reader import Dataset
from generators.dataset.record import Record, Timing, encode, file_entry
from generators.dataset.store import Store
from generators.publishing import contact_sheet
from generators.publishing.index import build_index
from tests.generators.made_up import META
from tests.renders import made_up_render

H = AxisMeta("H", "H", (-0.5, -0.4, -0.25))
G = AxisMeta("g", "g", (0.0, 0.5))
DRAWN = AxisMeta("S_w", "S_w", None)
LOOK = AxisMeta("look", "/World{look}", ("bright", "dim"), category=True)


def grid_of(*axes):
    """A row for each combination of the axes' values."""
    names = [axis.name for axis in axes]
    return [dict(zip(names, values, strict=True)) for values in itertools.product(*(axis.values for axis in axes))]


def dataset_of(folder, axes, rows, width=16, height=12, missing=(), rendered=True):
    """A dataset of pictures of noise."""
    meta = replace(META, name="trial", axes=tuple(axes), width=width, height=height, aovs=())
    store, count = Store(folder), len(rows)
    columns = {axis.name: [row[axis.name] for row in rows] for axis in axes}
    fixed = {"index": range(count), "split": ["train"] * count, "seed": range(count)}
    store.write(layout.PLAN, write_plan(meta, pa.table({**fixed, **columns})))
    for index in set(range(count)) - set(missing) if rendered else ():
        render = made_up_render(RenderSettings(width=width, height=height, spp=1, seed=index, aovs=frozenset()))
        with tempfile.TemporaryDirectory() as temporary:
            write_exr(Path(temporary, layout.RADIANCE), render)
            exr = Path(temporary, layout.RADIANCE).read_bytes()
        record = Record(index, meta.digest, 1, 0, 0, 0.1, files={layout.RADIANCE: file_entry(exr)})
        files = {layout.RADIANCE: exr, layout.RECORD: encode(record), layout.TIMING: encode(Timing(1, 1, "w", 1))}
        store.commit(layout.sample_folder("train", index), files)
    return Dataset(folder)


def draw(dataset):
    return contact_sheet.draw_contact_sheet(dataset, build_index(dataset))


def layout_of(dataset, shape=(192, 256)):
    return contact_sheet._choose_layout(dataset.meta, build_index(dataset), shape)


def places_of(picture, pixels):
    """Where the sheet shows a picture: the tops and lefts."""
    height, width, _ = picture.shape
    corners = np.argwhere((pixels[: -height + 1, : -width + 1] == picture[0, 0]).all(axis=2))
    return [(y, x) for y, x in corners if (pixels[y : y + height, x : x + width] == picture).all()]


def test_first_axis_runs_down_and_last_across(tmp_path):
    dataset = dataset_of(tmp_path, [H, G], grid_of(H, G), width=64, height=32)
    found = layout_of(dataset)
    assert (found.row_count, found.column_count) == (3, 2)
    assert [level.labels for level in found.rows] == [("H = -0.5", "H = -0.4", "H = -0.25")]
    assert [level.labels for level in found.columns] == [("g = 0", "g = 0.5")]


def test_every_thumbnail_is_the_image_it_stands_for(tmp_path):
    dataset = dataset_of(tmp_path, [G, LOOK], grid_of(G, LOOK), width=64, height=32)
    pixels = draw(dataset)
    found = []
    for index in range(4):
        picture = contact_sheet._thumbnail(dataset, index, 256)
        assert picture.shape == (128, 256, 3)
        places = places_of(picture, pixels)
        assert len(places) == 1
        found += places
    (y0, x0), (y1, x1), (y2, x2), (y3, x3) = found
    assert y0 == y1 < y2 == y3
    assert x0 == x2 < x1 == x3


def test_size_of_the_sheet_follows_from_its_parts(tmp_path):
    pixels = draw(dataset_of(tmp_path, [H, G], grid_of(H, G)))
    margin, gap = contact_sheet.MARGIN, contact_sheet.GAP
    label = pixels.shape[1] - 2 * margin - 2 * 256 - gap
    assert 50 < label < 110  # of 'H = -0.25'
    header = pixels.shape[0] - 2 * margin - 3 * 192 - 2 * gap
    assert 3 * 18 < header < 180  # three captions, the title, its line, the columns' labels


def test_missing_images_stay_empty(tmp_path):
    pixels = draw(dataset_of(tmp_path, [H, G], grid_of(H, G), missing=(3,)))
    empty = np.rint(255 * np.array(contact_sheet.EMPTY)).astype(np.uint8)
    # A few pixels at the edges of letters happen to have the same colour.
    assert 0 <= (np.abs(pixels.astype(int) - empty).max(axis=2) <= 1).sum() - 192 * 256 < 100


def test_combinations_that_a_constraint_excludes_leave_their_place_blank(tmp_path):
    rows = [row for row in grid_of(H, G) if row["H"] < -0.3 or row["g"] > 0]
    found = layout_of(dataset_of(tmp_path, [H, G], rows))
    assert found.indices == (0, 1, 2, 3, None, 4)
    draw(Dataset(tmp_path))


def test_zipped_axes_flow(tmp_path):
    other = AxisMeta("g", "g", (0.1, 0.2, 0.3))
    rows = [{"H": hurst, "g": asymmetry} for hurst, asymmetry in zip(H.values, other.values, strict=True)]
    found = layout_of(dataset_of(tmp_path, [H, other], rows))
    assert (found.indices, found.rows, found.columns) == ((0, 1, 2), (), ())


def test_draws_of_one_combination_lie_side_by_side(tmp_path):
    rows = [{**row, "S_w": draw} for row in grid_of(H) for draw in (0.1, 0.7)]
    found = layout_of(dataset_of(tmp_path, [H, DRAWN], rows))
    assert found.indices == tuple(range(6))
    assert [level.labels for level in found.columns] == [("draw 1", "draw 2")]


@pytest.mark.parametrize(
    ("axes", "rows"),
    [
        ((), [{}]),
        ((), [{}] * 7),
        ((H,), grid_of(H)),
        ((DRAWN,), [{"S_w": 0.1 * i} for i in range(5)]),
        ((LOOK, G), grid_of(LOOK, G)),
    ],
)
def test_sheets_of_few_drawn_or_named_axes(tmp_path, axes, rows):
    dataset = dataset_of(tmp_path, axes, rows)
    found = layout_of(dataset)
    assert found.indices == tuple(range(len(rows)))
    assert draw(dataset).shape[1] >= found.column_count * 256


def test_large_datasets_show_a_part_of_every_value_and_say_so(tmp_path):
    axes = (AxisMeta("H", "H", tuple(range(100))), AxisMeta("g", "g", tuple(range(10))))
    dataset = dataset_of(tmp_path, axes, grid_of(*axes), rendered=False)
    found = layout_of(dataset, (48, 64))
    assert len(found.indices) == contact_sheet.THUMBNAILS_MAX
    assert all(0 < b - a < 10 for a, b in itertools.pairwise(found.indices))
    assert {index % 10 for index in found.indices} == set(range(10))
    _, below = contact_sheet._title(dataset.meta, build_index(dataset), len(found.indices))
    assert below.startswith("240 of 1,000 samples, spread over all  ·  1,000 not there")


def test_long_names_are_cut_to_their_place():
    name = "scene = ../a/folder/of/many/stages/cloud_block.usda"
    short = contact_sheet._fitted(name, 17, 150)
    assert text_width(short, 17) <= 150
    assert short.startswith("...")
    assert short.endswith("block.usda")
    assert contact_sheet._fitted("g = 0", 17, 150) == "g = 0"
    assert contact_sheet._wrap([name, "g 0.5"], 150)[-1] == "g 0.5"


def test_a_damaged_image_is_named(tmp_path):
    dataset = dataset_of(tmp_path, [G], grid_of(G))
    name = f"{dataset.folders[1]}/{layout.RADIANCE}"
    dataset.store.write(name, dataset.store.read(name)[:200])
    with pytest.raises(CorruptFileError, match=name):
        draw(dataset)
