"""How far samples are rendered."""

import shutil
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest

from fgf_warp.convergence import FIRST_SPP
from fgf_warp.errors import ConfigError
from fgf_warp.renderer import Variant, advance, begin, build_model, develop, image_bytes, step
from fgf_warp.settings import GIB
from generators.checking.verify import verify_dataset
from generators.dataset import layout
from generators.dataset.reader import Dataset
from generators.dataset.store import Store
from generators.publishing.words import describe_quality
from generators.running.messages import Chunk
from generators.running.render import Way, render_chunk
from generators.running.run import generate, render_again
from tests.generators.small_plan import TEXT, content, small_plan


def test_images_of_a_batch_may_go_on_alone(tmp_path):
    """Samples added to a part of the images give what they give to all of them."""
    plan = small_plan(tmp_path)
    variants = [Variant(plan.media_of(sample), sample.seed) for sample in plan.samples[:3]]
    model = build_model(plan.scene_of(plan.samples[0]), plan.settings, variants)
    together, apart = begin(model), begin(model)
    step(model, together, 12)
    assert list(advance(model, apart, 4)) == [0, 1, 2]
    assert list(advance(model, apart, 8, images=[2, 0])) == [2, 0]
    assert list(advance(model, apart, 8, images=[])) == []
    assert [set(samples.flat) for samples in apart.samples] == [{12}, {4}, {12}]
    assert all(apart.seconds > 0)
    for image in (0, 2):
        a, b = develop(model, together, image), develop(model, apart, image)
        np.testing.assert_array_equal(a.radiance, b.radiance)
        np.testing.assert_array_equal(a.variance, b.variance)


@pytest.mark.parametrize("over", ["mean", "p95"])
def test_samples_end_at_their_target_and_can_be_made_again(tmp_path, over):
    # The darker the medium, the sooner it is known.
    plan = small_plan(
        tmp_path,
        "axes={H: [-0.25], albedo: [0, 0.5, 1]}",
        "spp=",
        f"quality={{target_error: 0.02, error_over: {over}, max_spp: 512}}",
    )
    generate(plan, TEXT, tmp_path / "data")
    dataset = Dataset(tmp_path / "data")
    records = dataset.records(range(3))
    reached = [record.standard_error if over == "mean" else record.reached_error for record in records]
    assert all(error <= 0.02 or record.spp == 512 for error, record in zip(reached, records, strict=True))
    # It is not by chance that they end there.
    assert max(reached) > 0.01
    assert len({record.spp for record in records}) > 1
    labels = pq.read_table(tmp_path / "data" / "index.parquet")
    assert ("reached_error" in labels.column_names) == (over != "mean")
    if over != "mean":
        assert labels["reached_error"].to_pylist() == reached
        assert describe_quality(plan.meta) == "relative error 2 % (p95), at most 512 spp"
    assert not verify_dataset(dataset).findings
    before = content(tmp_path / "data")
    for index in range(3):
        shutil.rmtree(tmp_path / "data" / dataset.folders[index])
    list(render_again(plan, Store(tmp_path / "data"), range(3), {record.index: record.spp for record in records}))
    assert content(tmp_path / "data") == before


def test_samples_with_a_time_budget_say_how_far_they_came(tmp_path):
    plan = small_plan(tmp_path, "axes={H: [-0.25], g: [0, 0.5]}", "spp=", "quality={time: 0.05, max_spp: 100000}")
    generate(plan, TEXT, tmp_path / "data")
    dataset = Dataset(tmp_path / "data")
    before = content(tmp_path / "data")
    records = dataset.records(range(2))
    assert all(FIRST_SPP <= record.spp < 100000 for record in records)
    list(render_again(plan, Store(tmp_path / "data"), [0, 1], {record.index: record.spp for record in records}))
    assert content(tmp_path / "data") == before


def test_progress_counts_samples_over_the_batches_of_a_chunk(tmp_path):
    plan = small_plan(tmp_path, "spp=", "quality={target_error: 0.05, max_spp: 256}")
    # Two images of two halves at once.
    plan = replace(plan, settings=replace(plan.settings, memory=4.5 * image_bytes(plan.settings) / GIB))
    store, shares = Store(tmp_path / "data"), []
    store.write(layout.PLAN, plan.to_bytes())
    finished = list(render_chunk(plan, store, Chunk(tuple(range(6))), Way(), shares.append))
    assert len(finished) == 6
    assert 0 < min(shares) < max(shares) <= 6
    assert max(shares) > 4


def test_a_goal_needs_the_memory_of_two_halves(tmp_path):
    plan = small_plan(tmp_path, "spp=", "quality={target_error: 0.05}")
    plan = replace(plan, settings=replace(plan.settings, memory=1.5 * image_bytes(plan.settings) / GIB))
    with pytest.raises(ConfigError, match="a batch of 2 images"):
        generate(plan, TEXT, tmp_path / "data")
