"""The pool of lanes against the driver that takes one path after the other: the same picture, by vector code."""

import statistics
import time
from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from fgf_warp.integrator import Counts, Round
from fgf_warp.renderer import begin, build_model, develop, step
from fgf_warp.settings import RENDERED_AOVS, Aov, RenderSettings
from tests.grid import REGIMES
from tests.render.test_instances import example
from tests.render.test_lights import INTRICATE, block_under
from tests.render.test_render import full_scene
from tests.scenes import furnace

SETTINGS = RenderSettings(width=64, height=64, spp=64, threads=1)


def cpu_seconds(work) -> float:
    started = time.process_time()
    work()
    return time.process_time() - started


def launch_threads(model, state):
    """All samples by the driver that takes one path after the other."""
    kernel = model.program.render_threads
    kernel.module.load(wp.get_device("cpu"), 1)
    pixels = model.settings.width * model.settings.height
    images = wp.zeros(1, dtype=int, device="cpu")
    counts, part = Counts(), Round()
    counts.done = wp.zeros(pixels, dtype=int, device="cpu")
    counts.wanted = wp.full(pixels, model.settings.spp, dtype=int, device="cpu")
    part.samples = model.settings.spp
    inputs = [model.uploaded.data, model.uploaded.limits, state.film, images, pixels, counts, part]
    wp.launch(kernel, dim=(1, pixels), inputs=inputs, device="cpu")


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

    def in_lanes():
        step(model, state, SETTINGS.spp)

    def one_at_a_time():
        launch_threads(model, state)

    in_lanes()
    one_at_a_time()
    ratios = [cpu_seconds(one_at_a_time) / cpu_seconds(in_lanes) for _ in range(5)]
    assert statistics.median(ratios) >= ratio, ratios


def through_a_lens(scene):
    """From a moving camera, whose near plane is in the medium."""
    view = replace(scene.camera, f_stop=1.0, focus_distance=5.0, clipping_range=(4.5, 5.5))
    closing = view.camera_to_world.copy()
    closing[0, 3] += 0.1
    return replace(scene, camera=replace(view, closing=closing))


@pytest.mark.parametrize(
    "make",
    [
        lambda: furnace(fills_view=False, **REGIMES["pink"]),
        lambda: furnace(fills_view=False, transport="mixed", **REGIMES["pink"]),
        full_scene,
        example,
        pytest.param(lambda: through_a_lens(furnace(fills_view=False, **REGIMES["pink"])), marks=pytest.mark.slow),
        pytest.param(lambda: block_under(INTRICATE["soft cone"], light_links=8), marks=pytest.mark.slow),
    ],
    ids=["pink", "mixed", "full", "instances", "lens", "lights"],
)
def test_both_drivers_render_the_same_picture(make):
    """The driver of CUDA, run on the CPU: from the same random numbers, up to the order of sums."""
    model = build_model(make(), replace(SETTINGS, spp=8, aovs=RENDERED_AOVS))
    pool, threads = begin(model), begin(model)
    step(model, pool, 8)
    launch_threads(model, threads)
    threads.samples[:] = 8
    a, b = develop(model, pool), develop(model, threads)
    assert np.allclose(a.radiance, b.radiance, rtol=1e-4, atol=1e-6)
    assert np.array_equal(a.alpha, b.alpha)
    for aov, plane in a.aovs.items():
        # Motion is a difference of places in the image, which are rounded to 64 / 2^24.
        atol = 1e-5 if aov == Aov.MOTION else 1e-6
        assert np.allclose(plane, b.aovs[aov], rtol=1e-4, atol=atol), aov
