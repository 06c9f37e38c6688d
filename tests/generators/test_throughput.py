"""What a run costs beside rendering and encoding, and what Ray costs beside one process."""

import time
from datetime import datetime

import pytest
import warp as wp

from generators.running import render
from generators.running.run import Workers, generate
from tests.generators.small_plan import STAGE, TEXT, small_plan
from tests.generators.test_run import told

IMAGES = (
    f"scene={STAGE.with_name('cloud_block.usda')}",
    "medium=/World/Looks/Cloud",
    "image={width: 64, height: 64}",
    "spp=64",
    "axes={H: {uniform: [-0.45, -0.1]}, g: {uniform: [-0.5, 0.5]}}",
)
"""As those of a dataset, small."""


def counted(work, total):
    """The function, which notes the time that its thread spends in it on the CPU."""

    def count(*arguments, **named):
        started = time.thread_time()
        try:
            return work(*arguments, **named)
        finally:
            total.append(time.thread_time() - started)

    return count


@pytest.mark.measure
def test_a_run_renders_and_encodes_for_most_of_its_time(tmp_path, monkeypatch, capsys):
    """At most 15 % of 256 samples go elsewhere: by time on the CPU, which others on it do not disturb."""
    generate(small_plan(tmp_path, *IMAGES, "draws=2"), TEXT, tmp_path / "warm")
    plan = small_plan(tmp_path, *IMAGES, "draws=256")
    rendering, encoding = [], []
    monkeypatch.setattr(wp, "launch", counted(wp.launch, rendering))
    monkeypatch.setattr(render, "encode_images", counted(render.encode_images, encoding))
    started, began = time.process_time(), time.perf_counter()
    assert generate(plan, TEXT, tmp_path / "data").is_complete
    spent, wall = time.process_time() - started, time.perf_counter() - began
    outside = 1 - (sum(rendering) + sum(encoding)) / spent
    with capsys.disabled():
        print(
            f"\n{wall:.1f} s, of which on the CPU {spent:.1f} s: rendering {sum(rendering):.1f} s, "
            f"encoding {sum(encoding):.1f} s, all else {outside:.1%}"
        )
    assert outside <= 0.15


def samples_per_second(location):
    """After the start-up: from the first sample to the last."""
    times = [datetime.fromisoformat(line["time"]).timestamp() for line in told(location, "sample")]
    return (len(times) - 1) / (times[-1] - times[0])


@pytest.mark.measure
def test_ray_renders_nearly_as_fast_as_one_process(tmp_path, capsys):
    """At least 0.9 of it on two cores, in the better of two runs each that take turns."""
    plan = small_plan(tmp_path, *IMAGES, "draws=96")
    rates = {"local": [], "ray": []}
    for turn in range(2):
        for executor, workers in (("local", Workers(cores=2)), ("ray", Workers("ray", 2))):
            location = tmp_path / f"{executor}-{turn}"
            generate(plan, TEXT, location, workers=workers)
            rates[executor].append(samples_per_second(location))
    with capsys.disabled():
        print(f"\nsamples per second: {rates}")
    assert max(rates["ray"]) >= 0.9 * max(rates["local"])
