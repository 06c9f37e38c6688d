"""The stages are still vector code: the pool of lanes against the driver that takes one path after the other."""

import statistics
import time

import pytest
import warp as wp

from fgf_warp.renderer import begin, build_model, step
from fgf_warp.settings import RenderSettings
from tests.grid import REGIMES
from tests.render.test_render import full_scene
from tests.scenes import furnace

SETTINGS = RenderSettings(width=64, height=64, spp=64, threads=1)


def cpu_seconds(work) -> float:
    started = time.process_time()
    work()
    return time.process_time() - started


@pytest.mark.measure
@pytest.mark.parametrize(
    ("make", "ratio"),
    [
        (lambda: furnace(fills_view=False), 2.0),
        (lambda: furnace(fills_view=False, **REGIMES["pink"]), 2.0),
        (lambda: furnace(fills_view=False, **REGIMES["fbm"]), 2.0),
        (full_scene, 2.0),
    ],
    ids=["exponential", "fractional", "power", "full"],
)
def test_the_pool_of_lanes_is_faster_than_one_path_at_a_time(make, ratio):
    """By half of what it is or less: one loop over lanes that stays scalar costs more than that.

    Both run in one process and in alternation, and the machine needs vectors of eight floats or more.
    """
    model = build_model(make(), SETTINGS)
    state = begin(model)
    kernel = model.program.render_threads
    kernel.module.load(wp.get_device("cpu"), 1)
    inputs = [model.uploaded.data, model.uploaded.limits, state.film, 0, 64 * 64, 0, 64]

    def one_at_a_time():
        wp.launch(kernel, dim=(1, 64 * 64), inputs=inputs, device="cpu")

    def in_lanes():
        step(model, state, 64)

    in_lanes()
    one_at_a_time()
    ratios = [cpu_seconds(one_at_a_time) / cpu_seconds(in_lanes) for _ in range(5)]
    assert statistics.median(ratios) >= ratio, ratios
