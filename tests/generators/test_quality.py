"""How far samples are rendered."""

from dataclasses import replace

import numpy as np

import fgf_warp.renderer
from fgf_warp.renderer import Variant, advance, begin, build_model, develop, step
from fgf_warp.settings import Aov
from generators.dataset.reader import Dataset
from generators.dataset.store import Store
from generators.running.quality import Quality
from generators.running.run import generate, render_again
from tests.generators.small_plan import TEXT, content, small_plan
from tests.renders import made_up_render


def rounds(quality, seconds_per_sample=0.0, stop=None):
    """Totals of successive rounds."""
    totals, done = [], 0
    while (more := quality.next_round(done, done * seconds_per_sample)) and done != stop:
        done += more
        totals.append(done)
    return totals


def test_a_fixed_number_of_samples_is_one_round():
    assert rounds(Quality(1000)) == [1000]


def test_rounds_double_up_to_the_most():
    assert rounds(Quality(100, target_error=0.01)) == [16, 32, 64, 100]
    assert rounds(Quality(10, target_error=0.01)) == [10]


def test_a_time_budget_is_spent_and_not_much_more():
    # Of 1 ms a sample: 100 samples, after a first round that is made in any case.
    assert rounds(Quality(1000, time=0.1), 1e-3) == [16, 32, 64, 100]
    assert rounds(Quality(80, time=0.1), 1e-3) == [16, 32, 64, 80]
    assert rounds(Quality(1000, time=0.001), 1e-3) == [16]


def test_both_bounds_hold():
    quality = Quality(1000, target_error=0.01, time=0.1)
    result = replace(made_up_render(small_settings()), samples=32, seconds=0.05)
    assert result.relative_standard_error > 0.01
    assert not quality.is_reached(result)
    assert quality.is_reached(replace(result, seconds=0.1))
    assert quality.is_reached(replace(result, variance=result.variance * 0))
    assert Quality(32, target_error=0.01).is_reached(result)


def small_settings():
    from fgf_warp.settings import RenderSettings

    return RenderSettings(width=8, height=8, aovs=frozenset({Aov.VARIANCE}))


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
    assert apart.seconds[1] < apart.seconds[0]
    for image in (0, 2):
        a, b = develop(model, together, image), develop(model, apart, image)
        np.testing.assert_array_equal(a.radiance, b.radiance)
        np.testing.assert_array_equal(a.variance, b.variance)


def test_samples_end_at_their_target_and_can_be_made_again(tmp_path):
    # The darker the medium, the sooner it is known.
    plan = small_plan(
        tmp_path, "axes={H: [-0.25], albedo: [0, 0.5, 1]}", "spp=", "quality={target_error: 0.03, max_spp: 128}"
    )
    generate(plan, TEXT, tmp_path / "data")
    dataset = Dataset(tmp_path / "data")
    records = dataset.records(range(3))
    spp = {record.index: record.spp for record in records}
    assert set(spp.values()) <= {16, 32, 64, 128}
    assert len(set(spp.values())) > 1
    assert all(record.standard_error <= 0.03 or record.spp == 128 for record in records)
    # One round less was not enough.
    for index, count in spp.items():
        if count > 16:
            fewer = fgf_warp.renderer.render(
                plan.scene_of(plan.samples[index]).with_media(plan.media_of(plan.samples[index])),
                replace(plan.settings, spp=count // 2, seed=plan.samples[index].seed),
            )
            assert fewer.relative_standard_error > 0.03
    before = content(tmp_path / "data")
    for index in range(3):
        Store(tmp_path / "data").remove(dataset.folders[index])
    list(render_again(plan, Store(tmp_path / "data"), range(3), spp))
    assert content(tmp_path / "data") == before


def test_samples_with_a_time_budget_say_how_far_they_came(tmp_path):
    plan = small_plan(tmp_path, "axes={H: [-0.25], g: [0, 0.5]}", "spp=", "quality={time: 0.05, max_spp: 100000}")
    generate(plan, TEXT, tmp_path / "data")
    dataset = Dataset(tmp_path / "data")
    before = content(tmp_path / "data")
    records = dataset.records(range(2))
    assert all(16 <= record.spp < 100000 for record in records)
    list(render_again(plan, Store(tmp_path / "data"), [0, 1], {record.index: record.spp for record in records}))
    assert content(tmp_path / "data") == before
