"""The pool of lanes against the driver that takes one path after the other: the same picture, by vector code."""

import statistics
import time
from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from fgf_warp import launching
from fgf_warp.integrator.work import Counts, Round
from fgf_warp.renderer import Variant, begin, build_model, develop, step
from fgf_warp.settings import RENDERED_AOVS, Aov, RenderSettings
from tests.grid import REGIMES
from tests.render.test_instances import example
from tests.render.test_lights import INTRICATE, block_under
from tests.render.test_render import full_scene, same
from tests.scenes import furnace

SETTINGS = RenderSettings(width=64, height=64, spp=64, threads=1)


def cpu_seconds(work) -> float:
    started = time.process_time()
    work()
    return time.process_time() - started


def advance_by_threads(monkeypatch, model, state, wanted):
    """As on CUDA, on the CPU, where blocks have one thread."""
    model.program.render_threads.module.load(wp.get_device("cpu"), 1)
    monkeypatch.setattr(launching, "BLOCK_DIM", 1)
    for image in launching.advance_cuda(model, state, range(len(model.variants)), wanted, None):
        state.samples[image] = wanted[image]


def launch_threads(model, state):
    """All samples by the driver that takes one path after the other."""
    kernel = model.program.render_threads
    kernel.module.load(wp.get_device("cpu"), 1)
    pixels = model.settings.width * model.settings.height
    images = wp.zeros(1, dtype=int, device="cpu")
    counts, part = Counts(), Round()
    counts.done = wp.zeros(pixels, dtype=int, device="cpu")
    counts.wanted = wp.full(pixels, model.settings.spp, dtype=int, device="cpu")
    counts.order = wp.array(np.arange(pixels), dtype=int, device="cpu")
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
        pytest.param(lambda: furnace(fills_view=False, transport="mixed", **REGIMES["pink"]), marks=pytest.mark.slow),
        pytest.param(full_scene, marks=pytest.mark.slow),
        pytest.param(example, marks=pytest.mark.slow),
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


def uneven(rng, images, height, width):
    """Samples per pixel from 0 to 20; two pixels of three get none."""
    return rng.integers(1, 21, (images, height, width)) * (rng.random((images, height, width)) < 1 / 3)


@pytest.mark.parametrize("driver", ["pool", "threads"])
def test_how_samples_are_spread_over_steps_does_not_change_a_pixel(driver, monkeypatch):
    """Some pixels get theirs early and others late, in launches of few samples; all end at 20 as with one step."""
    settings = replace(SETTINGS, width=13, height=9, spp=20, threads=2, aovs=RENDERED_AOVS)
    scene = full_scene()
    model = build_model(scene, settings, [Variant(scene.media, seed) for seed in (3, 4)])
    whole, parts = begin(model), begin(model)
    step(model, whole, 20)
    monkeypatch.setattr(launching, "PATHS_PER_LAUNCH", 13 * 9 * 3)
    monkeypatch.setattr(launching, "PATHS_PER_CUDA_LAUNCH", 13 * 9 * 3)
    early = uneven(np.random.default_rng(1), 2, 9, 13).astype(np.int32)
    for wanted in (early, np.full_like(early, 20)):
        if driver == "pool":
            step(model, parts, wanted - parts.samples)
        else:
            advance_by_threads(monkeypatch, model, parts, wanted)
        assert np.array_equal(parts.samples, wanted)
    for image in (0, 1):
        a, b = develop(model, whole, image), develop(model, parts, image)
        assert same(a, b) if driver == "pool" else np.allclose(a.radiance, b.radiance, rtol=1e-4, atol=1e-6)


def test_pixels_may_get_very_different_numbers_of_samples():
    """Each is what it is where all pixels get its number."""
    settings = replace(SETTINGS, width=7, height=5, spp=2000, threads=2, aovs=RENDERED_AOVS)
    model = build_model(full_scene(), settings)
    many, one, mixed = begin(model), begin(model), begin(model)
    step(model, many, 2000)
    step(model, one, 1)
    counts = np.ones((1, 5, 7), dtype=np.int32)
    counts[0, 2, 3] = 2000
    seen = []
    step(model, mixed, counts, lambda done, total: seen.append((done, total)))
    assert seen[-1] == (2034, 2034)
    found, most, least = (develop(model, state) for state in (mixed, many, one))
    assert np.array_equal(found.aovs[Aov.SAMPLES], counts[0])
    assert np.array_equal(found.radiance, np.where(counts[0, ..., None] == 1, least.radiance, most.radiance))
    assert (found.samples, found.path_count) == (round(2034 / 35), 2034)
