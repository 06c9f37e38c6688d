"""Which frames are asked for, and which files a render writes."""

from __future__ import annotations

from pathlib import Path

import pytest

from fgf_warp.errors import ConfigError
from fgf_warp.settings import Aov
from generators.pictures import Picture, parse_frames, plan_pictures
from generators.stage import planes_of


@pytest.mark.parametrize(
    ("spec", "frames"),
    [
        ("7", (7,)),
        ("1:4", (1, 2, 3, 4)),
        ("1:6x2", (1, 3, 5)),
        ("101,105:107", (101, 105, 106, 107)),
        ("3:1", (3, 2, 1)),
        ("0:1x0.5", (0, 0.5, 1)),
        ("0.1:0.4x0.1", (0.1, 0.2, 0.3, 0.4)),
        ("-2:0", (-2, -1, 0)),
        ("1:3,2:4", (1, 2, 3, 4)),
    ],
)
def test_frames_are_spelled_as_for_usdrecord(spec: str, frames: tuple[float, ...]) -> None:
    assert parse_frames(spec) == frames


@pytest.mark.parametrize("spec", ["", "a", "1:", "1:3,", "nan", "1:inf", "1:3 x", "1-3", "1:" + "9" * 400])
def test_other_frames_are_refused(spec: str) -> None:
    with pytest.raises(ConfigError, match=r"frames .*: accepted: frames such as 7, 1:24, 1:24x2 or 101,105:110"):
        parse_frames(spec)


@pytest.mark.parametrize("spec", ["1:3x0", "1:3x-1", "3:1x1"])
def test_a_stride_leads_from_the_first_frame_to_the_last(spec: str) -> None:
    with pytest.raises(ConfigError, match=r"stride .*; accepted: one that leads from"):
        parse_frames(spec)


def test_more_frames_than_any_film_has_are_refused() -> None:
    with pytest.raises(ConfigError, match="accepted: at most 100000 frames"):
        parse_frames("1:9,1:1000000000000")


PRODUCTS = """#usda 1.0
def RenderSettings "Settings"
{
    rel products = [</One>, </Two>]
}
def RenderProduct "One"
{
    token productName.timeSamples = { 1: "{folder}/one.1.exr", 2: "{folder}/one.2.exr" }
}
def RenderProduct "Two"
{
    token productName = "{folder}/two.###.exr"
}
"""


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    path = tmp_path / "bare.usda"
    path.write_text("#usda 1.0\n")
    return path


@pytest.fixture
def with_products(tmp_path: Path) -> Path:
    path = tmp_path / "products.usda"
    path.write_text(PRODUCTS.replace("{folder}", str(tmp_path)))
    return path


def test_one_image_needs_no_frame(bare: Path) -> None:
    pictures, warnings = plan_pictures(bare, [None], Path("a.exr"), Path("a.png"), None)
    assert pictures == [Picture(None, None, Path("a.exr"), Path("a.png"))]
    assert warnings == []
    assert plan_pictures(bare, [7], Path("a.exr"), None, None)[0] == [Picture(7, None, Path("a.exr"))]


@pytest.mark.parametrize(
    ("name", "frame", "expected"),
    [
        ("a.####.exr", 7, "a.0007.exr"),
        ("a.##.exr", 101, "a.101.exr"),
        ("a_###.##.exr", 2.5, "a_002.50.exr"),
        ("a.####.exr", -3, "a.-003.exr"),
    ],
)
def test_placeholders_hold_the_frames_number(bare: Path, name: str, frame: float, expected: str) -> None:
    ((picture,), _) = plan_pictures(bare, [frame], Path("film") / name, None, None)
    assert picture.exr == Path("film") / expected


@pytest.mark.parametrize(
    ("frames", "output", "png", "message"),
    [
        ([1, 2], "a.exr", None, "a.exr: is the name of several images; accepted: a placeholder such as ####"),
        ([1, 2], "a.##.exr", "a.png", "a.png: is the name of several images"),
        ([1, 2.5], "a.##.exr", None, "a.##.exr: has too few decimals for frame 2.5"),
        ([1], "a.##.##.##.exr", None, "accepted: one placeholder"),
        ([None], "a.##.exr", None, "a.##.exr: there is no frame whose number it could hold; accepted: --frames"),
        (["default"], "a.##.exr", None, "there is no frame"),
        ([None], "a.png", None, "accepted: a file name that ends in .exr"),
        ([None], "a.exr", "a.exr", "accepted: a file name that ends in .png"),
        ([None], None, None, "--output .* is missing"),
    ],
)
def test_names_that_do_not_tell_images_apart_are_refused(bare: Path, frames, output, png, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        plan_pictures(bare, frames, output and Path(output), png and Path(png), None)


def test_every_product_is_written_for_every_frame(with_products: Path, tmp_path: Path) -> None:
    pictures, warnings = plan_pictures(with_products, [1, 2], None, None, None, tmp_path)
    assert [(p.frame, p.product, p.exr.name) for p in pictures] == [
        (1, "/One", "one.1.exr"),
        (1, "/Two", "two.001.exr"),
        (2, "/One", "one.2.exr"),
        (2, "/Two", "two.002.exr"),
    ]
    assert {p.exr.parent for p in pictures} == {tmp_path}
    assert warnings == []
    with pytest.raises(ConfigError, match=r"one.2.exr: is the name of several images"):
        plan_pictures(with_products, [2, 3], None, None, None, tmp_path)


def test_output_names_the_first_products_image(with_products: Path) -> None:
    pictures, warnings = plan_pictures(with_products, [1], Path("a.exr"), None, None)
    assert pictures == [Picture(1, "/One", Path("a.exr"))]
    assert warnings == ["--output names one image, that of /One; not rendered: /Two"]


def test_a_product_is_an_exr(tmp_path: Path) -> None:
    path = tmp_path / "jpg.usda"
    path.write_text(PRODUCTS.replace(".exr", ".jpg"))
    with pytest.raises(ConfigError, match=r"/One.productName = .*jpg; accepted: a file name that ends in .exr"):
        plan_pictures(path, [1], None, None, None)


NAMED = """#usda 1.0
def RenderSettings "Settings"
{
    rel products = [</One>, </Two>]
}
def RenderProduct "One"
{
    token productName = "ONE"
}
def RenderProduct "Two"
{
    token productName = "TWO"
}
"""


@pytest.fixture
def named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Writes a stage with products of these names; the working directory has a folder, and links to it and to another.

    Whoever names files in a stage may be anyone.
    """
    work = tmp_path / "work"
    (work / "film").mkdir(parents=True)
    (tmp_path / "others").mkdir()
    (work / "same").symlink_to("film")
    (work / "away").symlink_to(tmp_path / "others")
    (work / "loop").symlink_to("loop")
    monkeypatch.chdir(work)

    def write(one: str, two: str = "two.exr") -> Path:
        path = tmp_path / "named.usda"
        path.write_text(NAMED.replace("ONE", one).replace("TWO", two))
        return path

    return write


OUTSIDE = ("/ABSOLUTE/a.exr", "../a.exr", "film/../../a.exr", "missing/../../a.exr", "away/a.exr", "same/../../a.exr")


@pytest.mark.parametrize("name", [*OUTSIDE, "loop/a.exr"])
def test_a_stage_writes_no_file_outside_the_working_directory(named, tmp_path: Path, name: str) -> None:
    name = name.replace("/ABSOLUTE", str(tmp_path / "others"))
    with pytest.raises(ConfigError, match=r"/One.productName = .*a\.exr: leads out of .*/work;|loop/a.exr: is no name"):
        plan_pictures(named(name), [1], None, None, None)


@pytest.mark.parametrize("name", OUTSIDE)
def test_an_output_root_is_where_products_lie(named, tmp_path: Path, name: str) -> None:
    name = name.replace("/ABSOLUTE", str(tmp_path / "others"))
    (tmp_path / "work" / "inner").mkdir()
    inside, _ = plan_pictures(named("film/a.exr"), [1], None, None, None, Path("inner"))
    assert [picture.exr for picture in inside] == [Path("inner/film/a.exr"), Path("inner/two.exr")]
    with pytest.raises(ConfigError, match="leads out of"):
        plan_pictures(named("../a.exr"), [1], None, None, None, Path("inner"))
    anywhere, _ = plan_pictures(named(str(tmp_path / "work" / name)), [1], None, None, None, Path("/"))
    assert anywhere[0].exr == tmp_path / "work" / name


@pytest.mark.parametrize("pair", [("a.exr", "./a.exr"), ("film/a.exr", "same/a.exr"), ("a.exr", "film/../a.exr")])
def test_two_products_of_one_file_are_refused_however_they_spell_it(named, pair: tuple[str, str]) -> None:
    with pytest.raises(ConfigError, match=r"a\.exr: is the name of several images"):
        plan_pictures(named(*pair), [1], None, None, None)


def test_the_users_own_name_may_lie_anywhere(named, tmp_path: Path) -> None:
    pictures, _ = plan_pictures(named("../a.exr"), [1], tmp_path / "b.exr", None, None)
    assert [picture.exr for picture in pictures] == [tmp_path / "b.exr"]


def test_render_vars_go_by_their_common_names() -> None:
    found, unknown = planes_of(["Ci", "Z", "Albedo", "path_length", "pathLength", "sampleCount", "fog"])
    assert found == {Aov.DEPTH, Aov.ALBEDO, Aov.PATH_LENGTH, Aov.SAMPLES}
    assert unknown == ["fog"]
    assert planes_of([*Aov]) == (frozenset(Aov), [])
