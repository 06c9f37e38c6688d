from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from fgf_warp.errors import ConfigError, SceneError
from generators.config import SweepConfig
from generators.plan import _digest, build_plan, sample_seed
from tests.scenes import furnace


def plan_of(base=None, device="cpu", **keys):
    config = SweepConfig.model_validate({"name": "a", "scene": "s", "spp": 2, **keys})
    return build_plan(config, base or furnace(), 8, 6, device)


def test_last_axis_varies_fastest_and_draws_faster_still():
    plan = plan_of(axes={"H": [-0.5, -0.25], "g": [0.0, 0.5]}, draws=2)
    found = [(sample.parameters["H"], sample.parameters["g"]) for sample in plan.samples]
    cells = [(-0.5, 0.0), (-0.5, 0.5), (-0.25, 0.0), (-0.25, 0.5)]
    assert found == [cell for cell in cells for _ in range(2)]
    assert [sample.index for sample in plan.samples] == list(range(8))


@pytest.mark.parametrize(
    ("axis", "value", "field", "expected"),
    [
        ("H", -0.3, "hurst", -0.3),
        ("g", 0.4, "asymmetry", 0.4),
        ("S_w", 2.0, "white_noise_scale", 2.0),
        ("sigma_m", 3.0, "mean_extinction", 3.0),
        ("L", 9.0, "outer_scale", 9.0),
        ("kappa", 0.7, "kappa", 0.7),
        ("albedo", 0.6, "albedo", (0.6, 0.6, 0.6)),
    ],
)
def test_an_axis_changes_its_parameter_and_no_other(axis, value, field, expected):
    base = furnace()
    plan = plan_of(base, axes={axis: [value]})
    assert plan.samples[0].medium == replace(base.media[0], **{field: expected})
    assert plan.media_of(plan.samples[0]) == (plan.samples[0].medium,)


def test_equal_configs_give_equal_plans():
    axes = {"H": [-0.5, -0.25], "S_w": {"uniform": [0, 1]}}
    first, second = plan_of(axes=axes, draws=3), plan_of(axes=axes, draws=3)
    assert first.digest == second.digest
    assert [sample.parameters for sample in first.samples] == [sample.parameters for sample in second.samples]


def test_everything_that_changes_files_changes_the_digest():
    common = {"axes": {"H": [-0.5, -0.25]}}
    albedo = {"albedo": (0.9, 0.9, 0.9)}
    plans = [
        plan_of(**common),
        plan_of(**common, seed=1),
        plan_of(**common, spp=3),
        plan_of(**common, preset="preview"),
        plan_of(**common, aovs=["depth"]),
        plan_of(**common, exposure=1.0),
        plan_of(**common, png=False),
        plan_of(**common, transport="renewal"),
        plan_of(**common, draws=2),
        plan_of(**common, device="cuda:0"),
        plan_of(furnace(**albedo), **common),
        plan_of(furnace(sky=(1.0, 1.0, 0.9)), **common),
        plan_of(furnace(fills_view=False), **common),
        plan_of(axes={"H": [-0.5, -0.26]}),
    ]
    assert len({plan.digest for plan in plans}) == len(plans)


def test_where_the_scene_lies_changes_neither_digest_nor_headers():
    here, elsewhere = plan_of(scene="a/s.usda"), plan_of(replace(furnace(), source="/b/s.usda"), scene="/b/s.usda")
    assert here.digest == elsewhere.digest
    assert here.scene.source == elsewhere.scene.source == "s.usda"


def test_the_sampler_changes_the_digest_and_how_it_is_carried_out_does_not():
    plan = plan_of()
    for key, value, changes in (("sampler", "independent", True), ("memory", 0.5, False), ("threads", 3, False)):
        other = replace(plan, settings=replace(plan.settings, **{key: value}))
        assert (_digest(other) != _digest(plan)) == changes


def test_the_number_of_the_gpu_does_not_change_the_digest():
    assert plan_of(device="cuda:0").digest == plan_of(device="cuda:1").digest


def test_seeds_are_as_documented_and_all_differ():
    for dataset_seed in (0, 1, 2**64 - 1):
        expected = np.random.SeedSequence(dataset_seed, spawn_key=(3,)).generate_state(1, np.uint64)[0]
        assert sample_seed(dataset_seed, 3) == int(expected)
    seeds = {sample_seed(dataset_seed, index) for dataset_seed in range(20) for index in range(500)}
    assert len(seeds) == 20 * 500


def test_seeds_of_a_few_samples_are_these():
    # Held here so that a new version of NumPy cannot change what an old config makes.
    assert [sample_seed(0, index) for index in range(2)] == [8668861027912758289, 4881901421217228719]


def test_random_values_depend_on_seed_index_and_axis_alone():
    alone = plan_of(axes={"S_w": {"uniform": [0, 1]}}, draws=4)
    among = plan_of(axes={"g": {"uniform": [-0.5, 0.5]}, "S_w": {"uniform": [0, 1]}, "H": [-0.4, -0.3]}, draws=2)
    for one, other in zip(alone.samples, among.samples, strict=True):
        assert one.parameters["S_w"] == other.parameters["S_w"]
    reseeded = plan_of(axes={"S_w": {"uniform": [0, 1]}}, draws=4, seed=1)
    assert reseeded.samples[0].parameters != alone.samples[0].parameters


def test_random_values_are_uniform_and_independent():
    """4000 draws: the KS test sees a shift of 0.04 of the range, the correlation test one of 0.07."""
    axes = {"S_w": {"uniform": [1, 3]}, "sigma_m": {"loguniform": [0.1, 10]}}
    samples = plan_of(axes=axes, draws=4000).samples
    linear = np.array([sample.parameters["S_w"] for sample in samples])
    logarithm = np.log10([sample.parameters["sigma_m"] for sample in samples])
    assert stats.kstest(linear, stats.uniform(1, 2).cdf).pvalue > 1e-4
    assert stats.kstest(logarithm, stats.uniform(-1, 2).cdf).pvalue > 1e-4
    assert stats.pearsonr(linear, logarithm).pvalue > 1e-4
    assert stats.pearsonr(linear[1:], linear[:-1]).pvalue > 1e-4


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ({"H": [-0.5, 0.0]}, "sample 1: /medium: H = 0; accepted: "),
        ({"H": [-0.5], "S_w": [1.0, -1.0]}, "sample 1: /medium: S_w = -1; accepted: >= 0"),
        ({"g": [1.0]}, r"sample 0: /medium: g = 1; accepted: in \(-1, 1\)"),
        ({"albedo": [1.5]}, "sample 0: /medium: albedo"),
        ({"S_w": [1.0], "kappa": [1.0]}, "S_w and kappa"),
    ],
)
def test_sweeps_out_of_the_domain_are_refused_by_index_and_value(axes, message):
    with pytest.raises(ConfigError, match=message):
        plan_of(axes=axes)


def test_transport_is_checked_against_the_swept_parameters():
    base = furnace(hurst=-0.7, white_noise_scale=1.0)
    plan = plan_of(base, transport="reciprocal", axes={"H": [-0.5, -0.25]})
    assert {sample.medium.resolved_transport for sample in plan.samples} == {"reciprocal"}
    with pytest.raises(ConfigError, match=r"sample 1: /medium: transport = 'reciprocal' with H = -0.7"):
        plan_of(transport="reciprocal", axes={"H": [-0.5, -0.7]})


def test_phase_function_is_checked_against_the_swept_parameters():
    with pytest.raises(ConfigError, match=r"sample 1: /medium: g = 0.4 with phase_function = 'isotropic'"):
        plan_of(furnace(phase_function="isotropic"), axes={"g": [0.0, 0.4]})


def test_a_sweep_that_an_authored_kappa_would_silence_is_refused():
    with pytest.raises(ConfigError, match=r"axes.S_w: /medium authors kappa = 0.5"):
        plan_of(furnace(kappa=0.5), axes={"S_w": [1.0]})


def test_a_medium_that_is_not_there_is_refused():
    with pytest.raises(SceneError, match="no medium '/no'; it has: /medium"):
        plan_of(medium="/no")
