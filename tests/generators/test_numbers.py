"""Numbers and names on the command line that are far from any that is accepted."""

import pytest

from fgf_warp.errors import ConfigError
from fgf_warp.output.atomic import NAME_BYTES_MAX
from generators.commands.numbers import number, whole
from tests.generators.test_cli import assert_refused, fgf

HUGE = "9" * 400
SHOWN = "99999999999999999999... (400 characters)"


@pytest.fixture
def stage(tmp_path):
    path = tmp_path / "stage.usda"
    path.write_text('#usda 1.0\ndef Sphere "Ball"\n{\n}\n')
    return path


@pytest.mark.parametrize(
    ("option", "accepted"),
    [
        ("--imageHeight", "an integer in [1, 65536]"),
        ("--imageWidth", "an integer in [1, 65536]"),
        ("--spp", "an integer in [1, 2147483647]"),
        ("--seed", "an integer in [0, 18446744073709551615]"),
        ("--maxDepth", "an integer in [1, 16777216]"),
        ("--similarityOrder", "an integer in [1, 16777216]"),
        ("--upscale", "an integer in [1, 8]"),
        ("--memory", "GiB > 0, at most 1048576"),
        ("--time", "a finite number of seconds > 0"),
        ("--targetError", "a share in (0, 1)"),
        ("--preset", "preview, balanced, reference"),
    ],
)
@pytest.mark.parametrize("value", [HUGE, "nan", "-1", "inf"])
def test_render_tells_the_range_of_each_option(tmp_path, stage, option, accepted, value):
    outcome = fgf("render", stage, "-o", tmp_path / "a.exr", option, value)
    assert_refused(outcome, f"{option} {SHOWN if value == HUGE else value}: accepted: {accepted}")


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--workers", HUGE, f"--workers {SHOWN}: accepted: an integer in [1, 10000]"),
        ("--cores", "1e9", "--cores 1e9: accepted: an integer in [1, 10000]"),
        ("--sample", "-1", "--sample -1: accepted: an integer in [0, 999999]"),
        ("--sample", "6", "--sample 6: accepted: 0 to 5"),
        ("--shard", f"0/{'9' * 5000}", "(5002 characters): accepted: i/n with 0 <= i < n"),
        ("--memory", "nan", "--memory nan: accepted: GiB > 0"),
    ],
)
def test_generate_tells_the_range_of_each_option(config_path, option, value, message):
    assert_refused(fgf("generate", config_path, option, value), message)


def test_frames_and_wishes_without_end_are_told(tmp_path, stage):
    common = ("render", stage, "-o", tmp_path / "a.####.exr")
    assert_refused(fgf(*common, "--frames", "1:999999999"), "--frames 1:999999999: accepted: at most 100000 frames")
    assert_refused(fgf(*common, "--frames", HUGE), f"--frames {SHOWN}: accepted: frames such as 7")
    assert_refused(fgf(*common, "--preset", f"auto:{HUGE}s"), "(406 characters): accepted: auto:ERROR or auto:TIME")
    assert_refused(fgf("law", "--H", "-0.5", "--S_w", "1", "--sigma_m", "1", "--t", f"1,{HUGE}"), "t = inf; accepted")


def test_a_picture_beyond_the_machine_is_told_before_work_begins(tmp_path, stage):
    size = ("--imageWidth", "65536", "--imageHeight", "65536", "--memory", "1048576")
    outcome = fgf("render", stage, "-o", tmp_path / "a.exr", *size)
    assert_refused(outcome, "an image of 65536 x 65536 pixels needs ")
    assert "accepted: at most this machine's memory = " in outcome.stderr


def test_names_that_no_file_can_have_are_told_before_rendering(tmp_path, stage):
    too_long = "é" * (NAME_BYTES_MAX // 2) + ".exr"
    outcome = fgf("render", stage, "-o", tmp_path / too_long)
    assert_refused(outcome, f"...: is {NAME_BYTES_MAX + 3} bytes long; accepted: at most {NAME_BYTES_MAX}")
    assert_refused(fgf("render", stage, "-o", tmp_path / ("d" * 300) / "a.exr"), "File name too long")
    assert_refused(fgf("render", tmp_path / ("s" * 300), "-o", tmp_path / "a.exr"), "File name too long")
    assert_refused(fgf("validate", tmp_path / ("s" * 300)), "File name too long")
    assert_refused(fgf("init", tmp_path / ("s" * 300 + ".yaml")), "File name too long")


def test_numbers_at_the_ends_of_their_range_are_accepted():
    assert [whole("--n", 1, 2**64)(text) for text in ("1", str(2**64))] == [1, 2**64]
    assert number("--x", "> 0", lambda value: value > 0)("1e-300") == 1e-300
    for refused in ("0", str(2**64 + 1), "1.0", ""):
        with pytest.raises(ConfigError, match=r"--n .*: accepted: an integer in \[1, 18446744073709551616\]"):
            whole("--n", 1, 2**64)(refused)
