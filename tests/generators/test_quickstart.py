"""The shipped config, through USD and the renderer."""

from pathlib import Path

from typer.testing import CliRunner

from fgf_warp.output.exr import read_exr
from generators.cli import app

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


def test_a_part_of_quickstart_is_the_same_for_one_worker_and_two(tmp_path):
    small = ["--set", "image={width: 24, height: 18}", "--set", "spp=4", "--set", "axes={H: [-0.5, -0.1], g: [0.7]}"]
    for workers in (1, 2):
        arguments = [str(CONFIGS / "quickstart.yaml"), *small, "--out", str(tmp_path / str(workers))]
        outcome = CliRunner().invoke(app, ["generate", *arguments, "--workers", str(workers)])
        assert outcome.exit_code == 0, outcome.output
    images = [
        f"data/train/{sample}/{name}" for sample in ("000000", "000001") for name in ("radiance.exr", "image.png")
    ]
    for name in (*images, "contact_sheet.png"):
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes()
    channels, header = read_exr(tmp_path / "1/data/train/000001/radiance.exr")
    assert channels["R"].max() > 0
    assert [medium["H"] for medium in header["media"]].count(-0.1) == 1
