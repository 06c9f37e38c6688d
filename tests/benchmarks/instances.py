"""`python -m tests.benchmarks.instances`: what a million instances of a mesh of 1,000 triangles cost, on two threads.

A stage is written, and then read, placed and rendered at 128 x 128 with 16 samples per pixel by a process of its own,
twice, since the first one builds the kernel. It tells the time of each step and the peak of the memory of the process.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdLux, Vt

from tests.contracts.test_bvh import knot

MOST_SECONDS, MOST_MEGABYTES = 20, 700
"""What they may cost."""

MEASURE = """
import resource, sys, time
begun = time.perf_counter()
import warp as wp
wp.config.log_level = wp.LOG_WARNING
from fgf_warp.renderer import begin, build_model, develop, prepare, step
from fgf_warp.settings import RenderSettings
from usd_scenes.reader import read_scene

def tell(what):
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{time.perf_counter() - begun:6.2f} s {peak:6.0f} MB  {what}", flush=True)

tell("started")
scene = read_scene(sys.argv[1]).scene
tell("read")
settings = RenderSettings(width=128, height=128, spp=16, threads=2)
prepare(scene, settings)
tell("kernel loaded")
model = build_model(scene, settings)
tell("placed")
state = begin(model)
step(model, state, settings.spp)
image = develop(model, state)
tell(f"rendered, mean {image.radiance.mean():.4f}")
"""


def write_stage(path: Path, count: int) -> None:
    """A PointInstancer with so many turned and scaled copies of a knot in a cube, under a dome."""
    rng = np.random.default_rng(1)
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdLux.DomeLight.Define(stage, "/Dome")
    instancer = UsdGeom.PointInstancer.Define(stage, "/Many")
    stage.SetDefaultPrim(instancer.GetPrim())
    side = int(np.ceil(count ** (1 / 3)))
    number = np.arange(count)
    places = np.stack([number % side, number // side % side, number // side**2], axis=1)
    places = places + rng.normal(scale=0.2, size=(count, 3))
    turns = rng.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(places.astype(np.float32)))
    instancer.CreateOrientationsAttr(Vt.QuathArray.FromNumpy(turns.astype(np.float16)))
    instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(rng.uniform(0.1, 0.3, size=(count, 3)).astype(np.float32)))
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(np.zeros(count, dtype=np.int32)))
    shape = knot(5, 100)
    mesh = UsdGeom.Mesh.Define(stage, "/Many/Knot")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(shape.points.astype(np.float32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(shape.triangles.astype(np.int32).ravel()))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(shape.triangles), 3, dtype=np.int32)))
    mesh.CreateSubdivisionSchemeAttr("none")
    instancer.CreatePrototypesRel().SetTargets([mesh.GetPath()])
    stage.Save()


def measure(path: Path) -> list[str]:
    """The lines that a process of its own has to tell: of each step seconds, megabytes and what it was."""
    command = [sys.executable, "-c", MEASURE, str(path)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()


def costs(lines: list[str]) -> tuple[float, float]:
    """Seconds and megabytes of all steps."""
    seconds, _, megabytes, *_ = lines[-1].split()
    return float(seconds), float(megabytes)


def main() -> int:
    """Returns the exit code: 0 where it costs no more than it may, else 1."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.instances", description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000, help="instances")
    count = parser.parse_args().count
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "many.usdc"
        write_stage(path, count)
        measure(path)
        lines = measure(path)
    print("\n".join(lines))
    seconds, megabytes = costs(lines)
    print(f"{count:,} instances: {seconds:g} s of {MOST_SECONDS}, {megabytes:g} MB of {MOST_MEGABYTES}")
    return int(seconds > MOST_SECONDS or megabytes > MOST_MEGABYTES)


if __name__ == "__main__":
    sys.exit(main())
