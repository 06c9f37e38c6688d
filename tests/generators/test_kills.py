"""Runs that are killed again and again, and asked to end, at any moment: what they make in the end does not tell of it.

Real renders in processes of their own: of a solid, of a closed mesh, and of instances.
"""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from generators.checking.verify import verify_dataset
from generators.dataset.reader import Dataset
from generators.planning.document import load_config
from generators.planning.plan import Plan, build_plan
from generators.running.run import Workers, generate
from tests.generators.small_plan import STAGE, content, labels

FGF = [sys.executable, "-c", "from generators.entry import main; main()"]
KILLS, TRIALS = 50, 10
SAMPLES = 32
SOLID = """    def Sphere "Sphere" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        rel material:binding = </World/Looks/Medium>
        double radius = 1
    }
"""
MESH = """    def Mesh "Mesh" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        rel material:binding = </World/Looks/Medium>
        point3f[] points = [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)]
        int[] faceVertexCounts = [3, 3, 3, 3]
        int[] faceVertexIndices = [0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2]
        uniform token subdivisionScheme = "none"
    }
"""
INSTANCES = f"""    def PointInstancer "Many"
    {{
        point3f[] positions = [(-0.6, 0, 0), (0.6, 0, 0), (0, 0.9, 0)]
        float3[] scales = [(0.3, 0.3, 0.3), (0.3, 0.3, 0.3), (0.3, 0.3, 0.3)]
        int[] protoIndices = [0, 0, 0]
        rel prototypes = </World/Many/Mesh>
{MESH}    }}
"""
SHAPES = {"solid": SOLID, "mesh": MESH, "instances": INSTANCES}
CONFIG = f"""\
name: killed
scene: SHAPE.usda
image: {{width: 24, height: 24}}
spp: 32
draws: {SAMPLES // 4}
axes:
  H: [-0.4, -0.25]
  g: [0, 0.5]
"""
OPTIONS = ([], [], ["--workers", "2"], ["--shard", "0/2"], ["--shard", "1/2"])
ENDINGS = (signal.SIGKILL, signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGHUP)


def plan_of(folder: Path, shape: str) -> Plan:
    stage = STAGE.read_text()
    assert SOLID in stage
    (folder / f"{shape}.usda").write_text(stage.replace(SOLID, SHAPES[shape]))
    (folder / "config.yaml").write_text(CONFIG.replace("SHAPE", shape))
    return build_plan(load_config(folder / "config.yaml"))


@pytest.fixture(scope="module")
def wholes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The datasets of runs that nothing disturbed."""
    found = {}
    for shape in SHAPES:
        folder = tmp_path_factory.mktemp(shape)
        generate(plan_of(folder, shape), CONFIG.encode(), folder / "data")
        found[shape] = folder / "data"
    return found


def end_somewhere(folder: Path, rng: random.Random) -> None:
    """Begins or goes on with a run, and ends it at some moment, all processes of its group at once."""
    data, ending = folder / "data", rng.choice(ENDINGS)
    command = [*FGF, "generate", str(folder / "config.yaml"), "--out", str(data), *rng.choice(OPTIONS)]
    process = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "TMPDIR": str(folder / "temporary")},
    )
    # A moment in the midst of samples, or a little after some time: while it starts, compiles, or publishes.
    samples = len(list(data.glob("data/*/[0-9]*"))) + rng.randint(0, 6)
    until = time.monotonic() + (rng.uniform(0, 6) if rng.random() < 0.4 else 120)
    while process.poll() is None and time.monotonic() < until and len(list(data.glob("data/*/[0-9]*"))) <= samples:
        time.sleep(0.002)
    time.sleep(rng.choice((0, 0, 0.05, 0.3)))
    if process.poll() is None:
        os.killpg(process.pid, ending)
    errors = process.communicate(timeout=120)[1]
    assert "Traceback" not in errors
    if process.returncode == 3:
        # It said so itself, so what it has is published, if it had begun.
        if (data / "plan.parquet").is_file():
            assert not verify_dataset(Dataset(data), deep=True).is_damaged
    else:
        # Before the command listens, a signal does what it does to any program.
        assert process.returncode in (0, -ending)


@pytest.mark.slow
@pytest.mark.parametrize("trial", range(TRIALS))
def test_a_run_that_is_ended_five_times_makes_the_same_dataset(tmp_path: Path, wholes, trial: int) -> None:
    rng, shape = random.Random(trial), [*SHAPES][trial % len(SHAPES)]
    plan = plan_of(tmp_path, shape)
    (tmp_path / "temporary").mkdir()
    for _ in range(KILLS // TRIALS):
        end_somewhere(tmp_path, rng)
    report = generate(plan, CONFIG.encode(), tmp_path / "data", workers=Workers(count=1 + trial % 2))
    assert report.is_complete
    assert content(tmp_path / "data") == content(wholes[shape])
    assert labels(tmp_path / "data").equals(labels(wholes[shape]))
    assert not list((tmp_path / "data").rglob("*.partial*"))
    assert verify_dataset(Dataset(tmp_path / "data"), deep=True).is_whole
