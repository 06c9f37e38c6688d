"""The same kernels on CUDA: they build without a GPU; with one, its images agree with the CPU's."""

from dataclasses import replace

import pytest
import warp as wp

from fgf_warp.features import required_features
from fgf_warp.integrator.program import build_program
from fgf_warp.renderer import render
from fgf_warp.scene import Mesh
from fgf_warp.settings import RENDERED_AOVS, RenderSettings
from tests import stats
from tests.grid import REGIMES
from tests.render.test_instances import example
from tests.render.test_media import BOX, CORNERS
from tests.render.test_render import full_scene
from tests.scenes import furnace

HOPPER = 90
SETTINGS = RenderSettings(width=64, height=64, spp=256, aovs=RENDERED_AOVS)


def mesh_scene():
    scene = furnace(**REGIMES["pink"])
    return replace(scene, shapes=(Mesh("/box", CORNERS, BOX, medium=0),))


@pytest.mark.parametrize(
    "make",
    [
        full_scene,
        mesh_scene,
        lambda: furnace(extinction_color=(1, 2, 3)),
        lambda: furnace(transport="mixed", **REGIMES["pink"]),
        pytest.param(
            lambda: furnace(transport="mixed", extinction_color=(1, 2, 3), **REGIMES["exact fbm"]),
            marks=pytest.mark.slow,
        ),
        pytest.param(example, marks=pytest.mark.slow),
    ],
    ids=["full", "mesh", "chromatic", "mixed", "exact variance", "instances"],
)
def test_the_kernel_builds_for_cuda(make, tmp_path):
    kernel = build_program(required_features(make(), SETTINGS)).render_threads
    wp.compile_aot_module(kernel.module, arch=HOPPER, module_dir=str(tmp_path), use_ptx=True)
    assert any(path.stat().st_size > 10_000 for path in tmp_path.glob("*.ptx"))


@pytest.mark.parametrize("regime", REGIMES)
def test_images_agree_with_the_cpu(regime):
    if not wp.is_cuda_available():
        pytest.skip("this machine has no CUDA device")
    scene = replace(full_scene(), media=furnace(albedo=(0.9, 0.8, 0.7), **REGIMES[regime]).media)
    cpu, cuda = render(scene, SETTINGS), render(scene, replace(SETTINGS, device="cuda:0", seed=1))
    stats.assert_images_agree(cpu, cuda, blocks=8, detects=0.1)
