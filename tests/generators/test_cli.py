import json
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

import fgf_warp.finishing
import fgf_warp.output.denoise
import fgf_warp.renderer
import usd_scenes.reader
from fgf_warp.errors import NumericalError, OutputError
from fgf_warp.features import explain
from fgf_warp.output.exr import read_exr
from fgf_warp.scene import Medium
from fgf_warp.settings import RENDERED_AOVS, Aov, RenderSettings, Sampler
from generators.cli import app
from generators.dataset.reader import Dataset
from generators.dataset.store import Store
from tests.renders import made_up_render
from tests.scenes import furnace
from usd_scenes.examples import build_sphere
from usd_scenes.reader import StageReading


def fgf(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def assert_refused(outcome, message, code=2):
    """One or two lines on stderr, after any warnings, and no traceback."""
    assert outcome.exit_code == code, outcome.output
    lines = [line for line in outcome.stderr.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1
    assert message in lines[0]
    assert "Traceback" not in outcome.output


@pytest.fixture
def stage(config_path):
    return config_path.parent / "scene.usda"


def test_law_prints_json_in_full_precision():
    outcome = fgf("law", "--H", "-0.5", "--S_w", "1", "--sigma_m", "2", "--t", "0.5,3", "--json")
    assert outcome.exit_code == 0
    found = json.loads(outcome.stdout)
    assert list(found) == [
        "regime",
        "b",
        "kappa",
        "mean_free_path",
        "law_ends_at",
        "t",
        "transmittance",
        "free_flight_pdf",
        "warnings",
    ]
    # White noise: Tr = (1 + S_w / sigma_m)^(-sigma_m^2 t / S_w) = 1.5^(-4 t).
    assert found["transmittance"] == pytest.approx([1.5**-2, 1.5**-12], rel=1e-14)


def test_law_prints_a_table():
    outcome = fgf("law", "--H", "-0.25", "--S_w", "1", "--sigma_m", "2")
    assert outcome.exit_code == 0
    assert "regime          pink noise" in outcome.stdout
    assert len(outcome.stdout.splitlines()) == 6 + 9


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--H", "0", "--S_w", "1", "--sigma_m", "1"), "H = 0; accepted"),
        (("--H", "-0.5", "--S_w", "-1", "--sigma_m", "1"), "S_w = -1; accepted: >= 0"),
        (("--H", "-0.5", "--S_w", "1", "--sigma_m", "1", "--t", "1;2"), "--t 1;2: accepted"),
        (("--H", "-0.5", "--sigma_m", "1"), "S_w or kappa"),
        (("--H", "-0.5"), "Missing option '--sigma_m'"),
        (("--H", "low", "--S_w", "1", "--sigma_m", "1"), "--H"),
    ],
)
def test_law_refuses(arguments, message):
    assert_refused(fgf("law", *arguments), message)


def test_unknown_options_and_commands_are_refused():
    assert_refused(fgf("law", "--hurst", "1"), "No such option")
    assert_refused(fgf("lwa"), "lwa")


def test_render_writes_what_was_asked_for(tmp_path, stage, fake_renderer):
    outcome = fgf(
        "render", stage, "-o", tmp_path / "a.exr", "-w", 12, "--imageHeight", 8, "--spp", 2, "--seed", 3,
        "--png", tmp_path / "a.png", "--aov", "depth", "--aov", "variance",
    )  # fmt: skip
    assert outcome.exit_code == 0, outcome.output
    channels, header = read_exr(tmp_path / "a.exr")
    assert set(channels) == {"R", "G", "B", "A", "Z", "variance.R", "variance.G", "variance.B"}
    assert channels["R"].shape == (8, 12)
    assert header["settings"] == {"seed": 3, "spp": 2}
    assert f"wrote {tmp_path / 'a.exr'}" in outcome.stdout
    assert "samples/s" in outcome.stdout
    assert (tmp_path / "a.png").is_file()


def test_render_writes_the_usual_planes_at_the_cameras_aspect(tmp_path, stage, fake_renderer):
    assert fgf("render", stage, "-o", tmp_path / "a.exr", "--imageHeight", 10, "--spp", 1).exit_code == 0
    channels, _ = read_exr(tmp_path / "a.exr")
    assert channels["R"].shape == (10, 10)
    assert len(channels) == 4 + 3 * 1 + 6 * 3


def test_render_reports_paths_that_were_cut(tmp_path, stage, fake_renderer, monkeypatch):
    def render(scene, settings, progress=None):
        return replace(made_up_render(settings), truncated_count=5)

    monkeypatch.setattr(fgf_warp.renderer, "render", render)
    outcome = fgf("render", stage, "-o", tmp_path / "a.exr", "-w", 4, "--preset", "preview")
    assert "5 paths" in outcome.stderr
    assert "after 1024 scattering events" in outcome.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("-o", "{tmp}/a.png"), "ends in .exr"),
        (("-o", "{tmp}/missing/a.exr"), "there is no folder"),
        (("-o", "{tmp}/scene.usda/a.exr"), "there is no folder"),
        (("-o", "{tmp}/a.exr", "--png", "{tmp}/scene.usda/a.png"), "there is no folder"),
        (("-o", "{tmp}/folder.exr"), "is a folder"),
        (("-o", "{tmp}/a.exr", "--spp", "0"), "spp = 0; accepted"),
        (("-o", "{tmp}/a.exr", "--imageWidth", "0"), "image width = 0; accepted"),
        (("-o", "{tmp}/a.exr", "--seed", "-1"), "seed = -1; accepted"),
        (("-o", "{tmp}/a.exr", "--device", "cuda:77"), "device = 'cuda:77'; accepted on this machine"),
        (("-o", "{tmp}/a.exr", "--preset", "best"), "--preset best: accepted: preview, balanced, reference"),
        (
            ("-o", "{tmp}/a.exr", "--preset", "auto:1"),
            "preset auto:1: accepted: auto:ERROR or auto:TIME, such as",
        ),
        (("-o", "{tmp}/a.exr", "--preset", "auto:1%", "--spp", "4"), "--spp: is chosen by --preset auto:1%"),
        (("-o", "{tmp}/a.exr", "--preset", "auto:5s", "--time", "4"), "--time: is chosen by --preset auto:5s"),
        (("-o", "{tmp}/a.exr", "--aov", "dept"), "--aov dept: accepted: depth"),
        (("-o", "{tmp}/a.exr", "--sampler", "sobol"), "--sampler sobol: accepted: lattice, independent"),
        (("-o", "{tmp}/a.exr", "--memory", "0"), "memory = 0.0; accepted: a number of GiB > 0"),
        (("-o", "{tmp}/a.exr", "--memory", "nan"), "memory = nan; accepted: a number of GiB > 0"),
        (("-o", "{tmp}/a.exr", "--memory", "much"), "--memory"),
        ((), "--output (-o) is missing; accepted: the name of the EXR, a stage whose RenderProducts"),
        (("--png", "{tmp}/a.png"), "--output (-o) is missing"),
        (("-o", "{tmp}/a.exr", "--complexity", "best"), "--complexity best: accepted: low, medium, high, veryhigh"),
        (("-o", "{tmp}/a.exr", "--frames", "1:x"), "frames 1:x: accepted: frames such as 7, 1:24, 1:24x2"),
        (("-o", "{tmp}/a.exr", "--frames", "1:3"), "a.exr: is the name of several images; accepted: a placeholder"),
        (("-o", "{tmp}/a.###.exr"), "a.###.exr: there is no frame whose number it could hold; accepted: --frames"),
        (("-o", "{tmp}/a.exr", "-f", "1", "--defaultTime"), "--defaultTime and --frames exclude each other"),
        (("--explain", "--sampler", "sobol"), "--sampler sobol: accepted: lattice, independent"),
    ],
)
def test_render_refuses_before_rendering(tmp_path, stage, fake_renderer, arguments, message):
    (tmp_path / "folder.exr").mkdir()
    outcome = fgf("render", stage, *(argument.format(tmp=tmp_path) for argument in arguments))
    assert_refused(outcome, message)
    assert fake_renderer == []


def test_render_refuses_an_image_that_the_memory_does_not_hold(tmp_path, stage, monkeypatch):
    def build(scene, settings):
        raise AssertionError("a kernel was built")

    monkeypatch.setattr(fgf_warp.renderer, "prepare", build)
    before = sorted(tmp_path.rglob("*"))
    size = ("-w", 20000, "--imageHeight", 10000)
    outcome = fgf("render", stage, "-o", tmp_path / "a.exr", "--png", tmp_path / "a.png", *size, "--memory", 0.5)
    assert_refused(outcome, "an image of 20000 x 10000 pixels needs ")
    assert "GiB; accepted: at most memory = 0.5 GiB" in outcome.stderr
    assert sorted(tmp_path.rglob("*")) == before


def test_render_hands_its_options_over(tmp_path, stage, fake_renderer, monkeypatch):
    asked = []

    def render(scene, settings, progress=None):
        asked.append((settings.sampler, settings.memory))
        return made_up_render(settings)

    monkeypatch.setattr(fgf_warp.renderer, "render", render)
    common = ("render", stage, "-o", tmp_path / "a.exr", "-w", 2, "--spp", 1)
    assert fgf(*common).exit_code == 0
    assert fgf(*common, "--sampler", "independent", "--memory", 1.5).exit_code == 0
    assert asked == [(Sampler.LATTICE, 4.0), (Sampler.INDEPENDENT, 1.5)]


@pytest.mark.parametrize("output", [(), ("-o", "nowhere/a.exr")])
def test_render_explains_its_kernel_and_renders_nothing(tmp_path, stage, fake_renderer, monkeypatch, output):
    monkeypatch.setenv("COLUMNS", "200")
    before = sorted(tmp_path.rglob("*"))
    outcome = fgf("render", stage, *output, "--explain", "--aov", "depth", "--sampler", "independent")
    assert outcome.exit_code == 0, outcome.output
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in outcome.stdout.splitlines() if "│" in line]
    settings = RenderSettings(aovs={Aov.DEPTH}, sampler="independent")
    expected = [[reason.part, "yes" if reason.built else "-", reason.why] for reason in explain(furnace(), settings)]
    assert rows == expected
    assert {"yes", "-"} == {row[1] for row in rows}
    assert fake_renderer == []
    assert sorted(tmp_path.rglob("*")) == before


MOVING = """#usda 1.0
def Camera "Film"
{
    double3 xformOp:translate.timeSamples = { 1: (1, 0, 9), 4: (4, 0, 9) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Sphere "Ball" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    rel material:binding = </Cloud>
    double radius = 0.5
    double radius.timeSamples = { 1: 1, 4: 4 }
}
def Material "Cloud" (
    prepend apiSchemas = ["FgfMediumAPI"]
)
{
}
def Sphere "Stand" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{
    uniform token purpose = "proxy"
}
"""


@pytest.fixture
def moving(tmp_path):
    """A stage whose camera and sphere have samples at frames 1 and 4."""
    path = tmp_path / "moving.usda"
    path.write_text(MOVING)
    return path


@pytest.fixture
def rendered(fake_renderer, monkeypatch):
    """The scenes and settings that the renderer is asked for."""
    asked = []

    def render(scene, settings, progress=None):
        asked.append((scene, settings))
        return made_up_render(settings)

    monkeypatch.setattr(fgf_warp.renderer, "render", render)
    return asked


SMALL = ("-w", 2, "--spp", 1)


def test_render_writes_an_image_for_each_frame(tmp_path, moving, rendered):
    outcome = fgf("render", moving, "-o", tmp_path / "a.###.exr", "--png", tmp_path / "a.#.png", "-f", "1:3,4", *SMALL)
    assert outcome.exit_code == 0, outcome.output
    assert sorted(path.name for path in tmp_path.glob("*.exr")) == [f"a.00{frame}.exr" for frame in (1, 2, 3, 4)]
    assert sorted(path.name for path in tmp_path.glob("*.png")) == [f"a.{frame}.png" for frame in (1, 2, 3, 4)]
    assert [scene.camera.position[0] for scene, _ in rendered] == [1, 2, 3, 4]
    assert [scene.shapes[0].object_to_world[0, 0] for scene, _ in rendered] == [1, 2, 3, 4]
    # What holds for all frames is told once.
    assert outcome.stderr.count("no light: a dim environment") == 1


def test_render_takes_default_values_where_there_are_no_samples(tmp_path, moving, rendered):
    assert fgf("render", moving, "-o", tmp_path / "a.exr", "--defaultTime", *SMALL).exit_code == 0
    assert rendered[0][0].shapes[0].object_to_world[0, 0] == 0.5


def test_render_adds_purposes_to_the_default_one(tmp_path, moving, rendered):
    for purposes, count in (("proxy", 2), ("render", 1)):
        assert fgf("render", moving, "-o", tmp_path / "a.exr", "--purposes", purposes, *SMALL).exit_code == 0
        assert len(rendered[-1][0].shapes) == count
    assert_refused(
        fgf("render", moving, "-o", tmp_path / "a.exr", "--purposes", "beauty"), "purposes = beauty; accepted"
    )


def test_render_hands_complexity_and_strictness_to_the_reader(tmp_path, stage, fake_renderer, monkeypatch):
    asked = {}

    def read(path, **choices):
        asked.update(choices)
        return StageReading(furnace(), None, ())

    monkeypatch.setattr(usd_scenes.reader, "read_scene", read)
    common = ("render", stage, "-o", tmp_path / "a.exr", *SMALL)
    assert fgf(*common).exit_code == 0
    assert (asked["complexity"], asked["strict"], asked["purposes"]) == ("high", False, None)
    assert fgf(*common, "--complexity", "low", "--strict", "--camera", "A").exit_code == 0
    assert (asked["complexity"], asked["strict"], asked["camera"]) == ("low", True, "A")


def test_render_of_clips_takes_each_frame_from_its_clip(tmp_path, rendered):
    for clip, radius in (("one", 1), ("two", 2)):
        samples = f"{{ 0: {radius}, 10: {radius + 0.5} }}"
        text = f'#usda 1.0\ndef Sphere "Ball"\n{{\n double radius.timeSamples = {samples}\n}}\n'
        (tmp_path / f"{clip}.usda").write_text(text)
    (tmp_path / "manifest.usda").write_text('#usda 1.0\ndef Sphere "Ball"\n{\n double radius\n}\n')
    stage = tmp_path / "clips.usda"
    stage.write_text("""#usda 1.0
def Sphere "Ball" (
    clips = {
        dictionary default = {
            asset[] assetPaths = [@./one.usda@, @./two.usda@]
            asset manifestAssetPath = @./manifest.usda@
            string primPath = "/Ball"
            double2[] active = [(1, 0), (11, 1)]
            double2[] times = [(1, 0), (11, 10), (11, 0), (21, 10)]
        }
    }
)
{
}
""")
    outcome = fgf("render", stage, "-o", tmp_path / "a.##.exr", "--frames", "1,6,11,16", *SMALL)
    assert outcome.exit_code == 0, outcome.output
    radii = [scene.shapes[0].object_to_world[0, 0] for scene, _ in rendered]
    assert radii == pytest.approx([1, 1.25, 2, 2.25])


PRODUCTS = """
def Camera "Other"
{
    float horizontalAperture = 20
    float verticalAperture = 10
}
def RenderSettings "Settings"
{
    rel products = [</One>, </Two>]
    rel camera = </Film>
    uniform int2 resolution = (6, 4)
}
def RenderProduct "One"
{
    token productName = "one.exr"
    rel orderedVars = [</Color>, </Depth>, </Fog>]
}
def RenderProduct "Two"
{
    rel camera = </Other>
    uniform int2 resolution = (8, 2)
    token productName = "two.exr"
}
def RenderVar "Color"
{
    string sourceName = "Ci"
}
def RenderVar "Depth"
{
    string sourceName = "Z"
}
def RenderVar "Fog"
{
    string sourceName = "fog"
}
def RenderSettings "Small"
{
    uniform int2 resolution = (3, 3)
}
"""


@pytest.fixture
def with_products(moving):
    """The same with two products, and other settings."""
    moving.write_text(MOVING + PRODUCTS)
    return moving


def test_render_writes_the_products_of_a_stage(tmp_path, with_products, rendered, monkeypatch):
    monkeypatch.chdir(tmp_path)
    outcome = fgf("render", with_products, "--frame", 1, "--spp", 1)
    assert outcome.exit_code == 0, outcome.output
    (one, _), (two, _) = read_exr(tmp_path / "one.exr"), read_exr(tmp_path / "two.exr")
    assert set(one) == {"R", "G", "B", "A", "Z"}
    assert set(two) > set(one)
    assert (one["R"].shape, two["R"].shape) == ((4, 6), (2, 8))
    assert [scene.camera.name for scene, _ in rendered] == ["/Film", "/Other"]
    assert "render var of sourceName fog is not known and left out; accepted: color, depth" in outcome.stderr


def test_renders_options_override_what_the_stage_says(tmp_path, with_products, rendered):
    options = ("--camera", "Other", "-w", 5, "--imageHeight", 7, "--aov", "albedo")
    outcome = fgf("render", with_products, "-o", tmp_path / "a.exr", "--frame", 1, "--spp", 1, *options)
    assert outcome.exit_code == 0, outcome.output
    channels, _ = read_exr(tmp_path / "a.exr")
    assert set(channels) == {"R", "G", "B", "A", "albedo.R", "albedo.G", "albedo.B"}
    assert channels["R"].shape == (7, 5)
    assert rendered[0][0].camera.name == "/Other"
    assert "--output names one image, that of /One; not rendered: /Two" in outcome.stderr
    assert not (tmp_path / "one.exr").exists()


def test_render_takes_the_settings_that_are_asked_for(tmp_path, with_products, rendered):
    common = ("render", with_products, "-o", tmp_path / "a.exr", "--frame", 1, "--spp", 1, "--renderSettingsPrimPath")
    assert fgf(*common, "/Small").exit_code == 0
    assert (rendered[0][1].width, rendered[0][1].height) == (3, 3)
    assert_refused(fgf(*common, "/Big"), "render settings '/Big' are not in the stage; it has: /Settings, /Small")


def test_a_render_that_is_stopped_leaves_whole_files_alone(tmp_path, moving, fake_renderer, monkeypatch):
    def render(scene, settings, progress=None):
        if scene.camera.position[0] == 3:
            raise KeyboardInterrupt
        return made_up_render(settings)

    monkeypatch.setattr(fgf_warp.renderer, "render", render)
    outcome = fgf("render", moving, "-o", tmp_path / "a.#.exr", "--frames", "1:4", *SMALL)
    assert_refused(outcome, "stopped; 2 of 4 images are written", code=3)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.1.exr", "a.2.exr", "moving.usda"]


def test_render_explains_the_kernel_of_a_frame(moving, rendered, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    outcome = fgf("render", moving, "--explain", "--frames", "3:4")
    assert outcome.exit_code == 0, outcome.output
    assert "/Ball" in outcome.stdout
    assert rendered == []


def test_render_refuses_a_missing_stage(tmp_path):
    assert_refused(fgf("render", tmp_path / "no.usda", "-o", tmp_path / "a.exr"), "there is no such stage")


def test_render_of_samples_that_are_not_finite_writes_nothing(tmp_path, stage, fake_renderer, monkeypatch):
    def render(scene, settings, progress=None):
        raise NumericalError("3 samples are not finite")

    monkeypatch.setattr(fgf_warp.renderer, "render", render)
    outcome = fgf("render", stage, "-o", tmp_path / "a.exr", "--spp", 1, "-w", 4)
    assert_refused(outcome, "3 samples are not finite", code=4)
    assert not (tmp_path / "a.exr").exists()


def test_generate_makes_a_dataset(tmp_path, config_path, fake_renderer):
    outcome = fgf("generate", config_path, "--out", tmp_path / "data", "--set", "axes.H=[-0.3]", "--workers", 1)
    assert outcome.exit_code == 0, outcome.output
    assert "3 of 3 samples rendered" in outcome.stdout
    assert str(tmp_path / "data" / "contact_sheet.png") in outcome.stdout
    assert len(fake_renderer) == 3


def test_generate_makes_denoised_planes(tmp_path, config_path, fake_renderer, monkeypatch):
    for module in (fgf_warp.finishing, fgf_warp.output.denoise):
        monkeypatch.setattr(module, "check_denoiser", lambda: None)
    monkeypatch.setattr(fgf_warp.finishing, "denoiser_version", lambda: "0")
    monkeypatch.setattr(fgf_warp.finishing, "denoise", lambda radiance, albedo, normal: radiance / 2)
    asked = ("--set", "axes.H=[-0.3]", "--set", "aovs=[denoised]")
    outcome = fgf("generate", config_path, "--out", tmp_path / "data", *asked)
    assert outcome.exit_code == 0, outcome.output
    channels, _ = read_exr(tmp_path / "data" / "data" / "train" / "000000" / "radiance.exr")
    assert set(channels) == {"R", "G", "B", "A", "denoised.R", "denoised.G", "denoised.B"}
    assert np.array_equal(channels["denoised.G"], channels["G"] / 2)
    assert fgf("verify", tmp_path / "data", "--deep").exit_code == 0


def test_generate_refuses_planes_of_a_denoiser_that_is_not_there(tmp_path, config_path, fake_renderer, monkeypatch):
    monkeypatch.setattr(fgf_warp.output.denoise, "find_spec", lambda name: None)
    outcome = fgf("generate", config_path, "--out", tmp_path / "data", "--set", "aovs=[denoised]")
    assert_refused(outcome, "accepted: pip install 'fgf-warp[denoise]'")
    assert fake_renderer == []


def test_generate_goes_on_with_another_memory(tmp_path, config_path, fake_renderer, monkeypatch):
    asked = set()

    def render(scene, settings, progress=None):
        asked.add(settings.memory)
        return made_up_render(settings)

    monkeypatch.setattr(fgf_warp.renderer, "render", render)
    assert fgf("generate", config_path, "--out", tmp_path / "data").exit_code == 0
    shutil.rmtree(tmp_path / "data/data/train/000001")
    outcome = fgf("generate", config_path, "--out", tmp_path / "data", "--memory", 0.25)
    assert outcome.exit_code == 0, outcome.output
    assert "1 of 6 samples rendered, 5 from earlier runs" in outcome.stdout
    assert asked == {4.0, 0.25}


@pytest.mark.parametrize(
    ("memory", "message"),
    [
        ("0", "memory = 0.0; accepted: a number of GiB > 0"),
        ("1e-9", "an image of 12 x 8 pixels needs "),
    ],
)
def test_generate_refuses_memory_that_holds_no_image(tmp_path, config_path, memory, message):
    before = sorted(tmp_path.rglob("*"))
    outcome = fgf("generate", config_path, "--out", tmp_path / "data", "--memory", memory)
    assert_refused(outcome, message)
    assert "GiB" in outcome.stderr
    assert sorted(tmp_path.rglob("*")) == before


def test_generate_reports_paths_that_were_cut(tmp_path, config_path, fake_renderer, monkeypatch):
    def render(scene, settings, progress=None):
        return replace(made_up_render(settings), truncated_count=5 if scene.media[0].asymmetry == 0 else 0)

    monkeypatch.setattr(fgf_warp.renderer, "render", render)
    outcome = fgf("generate", config_path, "--out", tmp_path / "data", "--set", "preset=preview")
    assert outcome.exit_code == 0, outcome.output
    assert outcome.stderr.count("were cut") == 1
    assert "10 paths in 2 of 6 samples (0.33 of all) were cut after 1024 scattering events" in outcome.stderr


def test_generate_of_whole_paths_reports_none(tmp_path, config_path, fake_renderer):
    assert "were cut" not in fgf("generate", config_path, "--out", tmp_path / "data").stderr


@pytest.mark.parametrize("command", ["plan", "validate"])
def test_a_sweep_is_warned_of_an_outer_scale_that_is_too_short(config_path, command):
    config_path.write_text(config_path.read_text().split("axes:")[0] + "axes: {H: [0.3], S_w: [1], L: [3, 1e9]}\n")
    warnings = [line for line in fgf(command, config_path).stderr.splitlines() if "outer scale" in line]
    # The sphere's box is 2 wide.
    assert len(warnings) == 1
    assert "warning: sample 0: t = 2 is not far below the outer scale L = 3" in warnings[0]


def test_generate_goes_to_the_folder_of_the_name(tmp_path, config_path, fake_renderer, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert fgf("generate", config_path).exit_code == 0
    assert (tmp_path / "datasets" / "trial" / "index.parquet").is_file()


@pytest.mark.parametrize("scheme", ["", "file://"])
def test_the_config_beside_a_dataset_finds_its_stage(tmp_path, config_path, fake_renderer, scheme):
    folder = tmp_path / "elsewhere" / "data"
    outcome = fgf("generate", config_path, "--out", f"{scheme}{folder}")
    assert outcome.exit_code == 0, outcome.output
    outcome = fgf("plan", folder / "config.yaml")
    assert outcome.exit_code == 0, outcome.output


def test_generate_of_a_part_says_so(tmp_path, config_path, fake_renderer, monkeypatch):
    def render(scene, settings, progress=None):
        raise NumericalError("3 samples are not finite")

    monkeypatch.setattr(fgf_warp.renderer, "render", render)
    outcome = fgf("generate", config_path, "--out", tmp_path / "data", "--set", "axes={}")
    assert_refused(outcome, "sample 0: 3 samples are not finite", code=3)


def test_generate_on_a_full_disk_is_partial(tmp_path, config_path, fake_renderer, monkeypatch):
    def fail(*_, **__):
        raise OutputError("000000.exr: cannot be written: No space left on device")

    monkeypatch.setattr(Store, "commit", fail)
    assert_refused(fgf("generate", config_path, "--out", tmp_path / "data"), "No space left", code=3)
    monkeypatch.undo()
    assert Dataset(tmp_path / "data").complete() == []


def test_generate_reports_damage(tmp_path, config_path, fake_renderer):
    assert fgf("generate", config_path, "--out", tmp_path / "data").exit_code == 0
    (tmp_path / "data" / "data" / "train" / "000001" / "record.json").write_bytes(b"")
    assert_refused(fgf("generate", config_path, "--out", tmp_path / "data"), "000001/record.json", code=4)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("axes.H=[0]", "sample 0: /medium: H = 0; accepted"),
        ("axes.S_w=[-1]", "sample 0: /medium: S_w = -1; accepted"),
        ("axes.g=[1]", "sample 0: /medium: g = 1; accepted"),
        ("axes.hurst=[1]", "axes.hurst: no such parameter"),
        ("ssp=4", "did you mean spp?"),
        ("scene=no.usda", "there is no such stage"),
        ("medium=/no", "no medium '/no'"),
    ],
)
@pytest.mark.parametrize("command", ["generate", "plan"])
def test_bad_configs_are_refused_before_anything_is_written(
    tmp_path, config_path, fake_renderer, monkeypatch, command, override, message
):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    assert_refused(fgf(command, config_path, "--set", override), message)
    assert sorted(tmp_path.rglob("*")) == before


def test_generate_makes_shards(tmp_path, config_path, fake_renderer):
    outcomes = [fgf("generate", config_path, "--out", tmp_path / "data", "--shard", f"{i}/2") for i in range(2)]
    assert [outcome.exit_code for outcome in outcomes] == [0, 0]
    assert "3 of 3 samples rendered" in outcomes[1].stdout
    assert Dataset(tmp_path / "data").complete() == list(range(6))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--shard", "2/2"), "shard 2/2: accepted: i/n with 0 <= i < n"),
        (("--executor", "dask"), "executor dask: accepted: local, ray, slurm"),
        (("--workers", "0"), "workers = 0; accepted: an integer >= 1"),
        (("--cores", "0"), "cores = 0; accepted: an integer >= 1"),
        (("--slurm", "partition"), "--slurm partition: accepted: KEY=VALUE"),
        (("--out", "nowhere://bucket"), "nowhere"),
    ],
)
def test_generate_refuses_workers_that_cannot_be(tmp_path, config_path, fake_renderer, options, message):
    before = sorted(tmp_path.rglob("*"))
    assert_refused(fgf("generate", config_path, "--out", tmp_path / "data", *options), message)
    assert sorted(tmp_path.rglob("*")) == before


def test_generate_refuses_folders_that_cannot_be(tmp_path, config_path, fake_renderer):
    assert_refused(fgf("generate", config_path, "--out", config_path / "data"), "Not a directory")
    assert_refused(fgf("generate", config_path, "--out", tmp_path), "holds no dataset")
    assert fgf("generate", config_path, "--out", tmp_path / "data").exit_code == 0
    assert_refused(fgf("generate", config_path, "--out", tmp_path / "data", "--set", "spp=9"), "another plan")


def test_plan_shows_the_samples(config_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    outcome = fgf("plan", config_path, "--set", "axes.g={linspace: [-0.5, 0.5, 15]}")
    assert outcome.exit_code == 0
    assert "30 samples, the first 20 shown" in outcome.stdout
    assert outcome.stdout.count("white") == 15
    assert outcome.stdout.count("pink") == 5
    # 30 samples of 12 x 8 pixels of 7 float32 channels and 3 bytes.
    assert "0.0893 MB" in outcome.stdout


def test_validate_tells_what_is_there(config_path, stage, tmp_path):
    built = tmp_path / "built.usda"
    build_sphere(Medium(name="", mean_extinction=2.5, hurst=-0.5)).Export(str(built))
    outcome = fgf("validate", built)
    assert outcome.exit_code == 0
    assert "camera  /World/Camera" in outcome.stdout
    assert "/World/Looks/Medium: H = -0.5" in outcome.stdout
    assert "sigma_m = 2.5; classical exponential, b = 0" in outcome.stdout
    assert "/World/Sphere: sphere, filled with /World/Looks/Medium" in outcome.stdout
    assert "DomeLight" in outcome.stdout
    of_config = fgf("validate", config_path).stdout
    assert "6 samples, sweeping H, g, S_w" in of_config
    assert "/medium: H = -0.5" in of_config
    assert_refused(fgf("validate", stage.parent / "no.usda"), "no such file")
    assert_refused(fgf("validate", stage.parent / "no.yaml"), "cannot be read")


def test_validate_tells_all_that_is_wrong(tmp_path):
    path = tmp_path / "scene.usda"
    path.write_text(
        '#usda 1.0\n(\n    defaultPrim = "A"\n    upAxis = "Y"\n)\n'
        + "".join(f'def Sphere "{name}"\n{{\n    double radius = 0\n}}\n' for name in "AB")
    )
    assert fgf("validate", path).exit_code == 0  # the spheres are left out
    outcome = fgf("validate", path, "--strict")
    assert outcome.exit_code == 2
    *findings, summary, verdict = outcome.stdout.splitlines()
    assert [line.split(": ")[:2] for line in findings] == [
        ["error", "/A.radius"],
        ["error", "/B.radius"],
        ["warning", "/"],
        ["warning", "/"],
    ]
    assert "no camera" in findings[-1]
    assert "metersPerUnit" in findings[-2]
    assert summary == f"{path}: 2 errors, 2 warnings"
    assert verdict == "not accepted by the renderer"


@pytest.mark.parametrize(
    "arguments",
    [
        ("render", "STAGE", "-o", "LONG.exr"),
        ("render", "STAGE", "-o", "LONG/a.exr"),
        ("render", "STAGE", "-o", "a.exr", "--png", "LONG.png"),
        ("render", "LONG.usda", "-o", "a.exr"),
        ("validate", "LONG.usda"),
        ("plan", "LONG.yaml"),
    ],
)
def test_a_name_that_no_file_can_have_is_refused(tmp_path, stage, monkeypatch, arguments):
    monkeypatch.chdir(tmp_path)
    spelled = [argument.replace("STAGE", str(stage)).replace("LONG", "x" * 300) for argument in arguments]
    assert_refused(fgf(*spelled), "File name too long")


def test_validate_takes_what_changes_what_is_read(tmp_path, config_path):
    path = tmp_path / "scene.usda"
    path.write_text(
        '#usda 1.0\n(\n    defaultPrim = "A"\n)\ndef DomeLight "A"\n{\n    asset inputs:texture:file = @gone.png@\n}\n'
        'def Camera "One"\n{\n}\ndef Camera "Two"\n{\n}\n'
    )
    plain = fgf("validate", path, "--frames", "1:3", "--camera", "/Two")
    assert plain.exit_code == 0
    assert "camera  /Two" in plain.stdout
    assert plain.stdout.count("gone.png") == 1
    strict = fgf("validate", path, "--strict")
    assert strict.exit_code == 2
    assert "error: /A.inputs:texture:file" in strict.stdout
    assert_refused(fgf("validate", path, "--frames", "1:3x0"), "stride 0; accepted")
    assert_refused(fgf("validate", path, "--frames", "1", "--defaultTime"), "exclude each other")
    assert_refused(fgf("validate", path, "--purposes", "gide"), "purposes = gide; accepted")
    assert_refused(fgf("validate", config_path, "--frames", "1"), "--frames is of a stage")


@pytest.mark.parametrize("command", ["render", "generate", "plan", "init", "schema", "validate", "law"])
def test_help_of_every_command_has_an_example(command):
    outcome = fgf(command, "--help")
    assert outcome.exit_code == 0
    assert f"fgf {command} " in outcome.stdout.split("Example:")[1]


def test_bare_command_shows_where_to_start():
    outcome = fgf()
    assert outcome.exit_code == 0
    assert "fgf generate configs/quickstart.yaml" in outcome.stdout


def test_help_imports_nothing_slow():
    """Rather than a time, what takes it."""
    code = (
        "import sys, generators.cli; "
        "slow = {'warp', 'pxr', 'colour', 'OpenImageIO', 'pyarrow', 'pydantic', 'ruamel', 'scipy', 'numpy'};"
        "print(sorted(slow & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_aov_has_channels(tmp_path, stage, fake_renderer):
    for aov in RENDERED_AOVS:
        outcome = fgf("render", stage, "-o", tmp_path / f"{aov}.exr", "--aov", aov, "-w", 2, "--spp", 1)
        assert outcome.exit_code == 0, outcome.output
