import itertools
import json
import pickle
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import usd_scenes.reader
from fgf_warp.errors import ConfigError, SceneError
from fgf_warp.scene import DomeLight
from fgf_warp.theory.law import build_line_law
from generators.dataset.plan_table import read_plan
from generators.planning.config import OrbitConfig
from generators.planning.digest import KeptHashes, canonical, content_hash
from generators.planning.document import load_config
from generators.planning.plan import build_plan
from generators.planning.sampling import sample_seed, sample_seeds
from generators.planning.scenes import orbiting
from generators.planning.seeds import seed_words
from tests.generators.small_plan import small_plan
from tests.scenes import furnace
from usd_scenes.reader import StageReading

STAGE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
    startTimeCode = 1
)
def Xform "World"
{
    def Sphere "Ball" (
        prepend apiSchemas = ["MaterialBindingAPI"]
        variants = { string look = "small" }
        prepend variantSets = "look"
    )
    {
        rel material:binding = </World/Cloud>
        double3 xformOp:translate.timeSamples = { 1: (0, 0, 0), 2: (1, 0, 0) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
        variantSet "look" = {
            "small" {
                double radius = 1
            }
            "large" {
                double radius = 2
            }
        }
    }
    def Material "Cloud" (
        prepend apiSchemas = ["FgfMediumAPI"]
    )
    {
        float inputs:fgf:meanExtinction = 2
    }
    def DomeLight "Sky"
    {
        color3f inputs:color = (1, 0.5, 0.25)
    }
    def Camera "Front"
    {
        double3 xformOp:translate = (0, 0, 9)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Camera "Far"
    {
        double3 xformOp:translate = (0, 0, 90)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""


@pytest.fixture
def plan_of(tmp_path, monkeypatch):
    """Plans a config of the given keys, with a scene in code in the place of the stage's."""

    def plan(base=None, device="cpu", **keys):
        read = StageReading(base or furnace(), None, ())
        monkeypatch.setattr(usd_scenes.reader, "read_scene", lambda path, **_: read)
        return plan_in(tmp_path, "", device, **keys)

    return plan


@pytest.fixture
def plan_stage(tmp_path):
    """The same with a real stage."""

    def plan(text=STAGE, **keys):
        return plan_in(tmp_path, text, "cpu", **{"camera": "Front", **keys})

    return plan


def plan_in(folder, stage, device, **keys):
    keys = {"name": "a", "scene": "s.usda", "spp": 2, "image": {"width": 8, "height": 6}, **keys}
    keys = {name: value for name, value in keys.items() if value is not None}
    if keys.get("scene") and not (folder / keys["scene"]).exists():
        (folder / keys["scene"]).parent.mkdir(exist_ok=True)
        (folder / keys["scene"]).write_text(stage)
    (folder / "config.yaml").write_text(json.dumps(keys))
    return build_plan(load_config(folder / "config.yaml"), device)


def column(plan, name):
    return [sample.parameters[name] for sample in plan.samples]


def rows_of(plan):
    return read_plan(plan.to_bytes(), "plan.parquet")[1].to_pylist()


def test_last_axis_varies_fastest_and_draws_faster_still(plan_of):
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
        ("albedo_g", 0.6, "albedo", (1.0, 0.6, 1.0)),
        ("transport", "mixed", "transport", "mixed"),
        ("phase_function", "isotropic", "phase_function", "isotropic"),
    ],
)
def test_an_axis_changes_its_parameter_and_no_other(plan_of, axis, value, field, expected):
    base = furnace()
    plan = plan_of(base, axes={axis: [value]})
    assert plan.samples[0].medium == replace(base.media[0], **{field: expected})
    assert plan.media_of(plan.samples[0]) == (plan.samples[0].medium,)


def test_equal_configs_give_equal_plans(plan_of):
    axes = {"H": [-0.5, -0.25], "S_w": {"uniform": [0, 1]}}
    first, second = plan_of(axes=axes, draws=3), plan_of(axes=axes, draws=3)
    assert first.meta.digest == second.meta.digest
    assert first.to_bytes() == second.to_bytes()
    assert [sample.parameters for sample in first.samples] == [sample.parameters for sample in second.samples]


def test_everything_that_changes_files_changes_the_digest(plan_of):
    common = {"axes": {"H": [-0.5, -0.25]}}
    albedo = {"albedo": (0.9, 0.9, 0.9)}
    plans = [
        plan_of(**common),
        plan_of(**common, seed=1),
        plan_of(**common, spp=3),
        plan_of(**common, preset="reference"),
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
        plan_of(axes={"H": {"values": [-0.5, -0.25]}, "transport": ["mixed"]}),
        plan_of(**common, spp=None, quality={"time": 2.0, "max_spp": 4}),
        plan_of(**common, targets={"mean_free_path": True}),
        plan_of(**common, splits={"train": 0.5, "test": 0.5}),
        plan_of(**common, orbit={"distance": 3.0}),
    ]
    assert len({plan.meta.digest for plan in plans}) == len(plans)


def test_words_about_a_dataset_do_not_change_the_digest(plan_of):
    assert plan_of().meta.digest == plan_of(description="Clouds.", license="CC0-1.0").meta.digest


def test_where_the_scene_lies_changes_neither_digest_nor_headers(plan_of):
    here, elsewhere = plan_of(scene="a/s.usda"), plan_of(replace(furnace(), source="/b/s.usda"), scene="b/s.usda")
    assert here.meta.digest == elsewhere.meta.digest
    assert here.scene_of(here.samples[0]).source == elsewhere.scene_of(elsewhere.samples[0]).source == "s.usda"
    assert here.meta.scene == "s.usda"


def test_the_number_of_the_gpu_does_not_change_the_digest(plan_of):
    assert plan_of(device="cuda:0").meta.digest == plan_of(device="cuda:1").meta.digest


def test_seeds_are_as_documented_and_all_differ():
    for dataset_seed in (0, 1, 2**64 - 1):
        expected = np.random.SeedSequence(dataset_seed, spawn_key=(3,)).generate_state(1, np.uint64)[0]
        assert sample_seed(dataset_seed, 3) == int(expected) >> 1
    seeds = {seed for dataset_seed in range(20) for seed in sample_seeds(dataset_seed, range(500))}
    assert len(seeds) == 20 * 500


def test_seeds_of_a_few_samples_are_these():
    # Held here so that a new version of NumPy cannot change what an old config makes.
    assert [sample_seed(0, index) for index in range(2)] == [8668861027912758289 // 2, 4881901421217228719 // 2]


@pytest.mark.parametrize("dataset_seed", [0, 5, 2**32, 2**64 - 1])
@pytest.mark.parametrize("suffix", [b"", b"H", b"sigma_m"])
def test_seeds_by_columns_are_those_of_numpy(dataset_seed, suffix):
    one_by_one = [np.random.SeedSequence(dataset_seed, spawn_key=(index, *suffix)) for index in (0, 1, 77, 999_999)]
    expected = [int(sequence.generate_state(1, np.uint64)[0]) for sequence in one_by_one]
    assert seed_words(dataset_seed, [0, 1, 77, 999_999], suffix).tolist() == expected


def test_hashes_by_parts_are_those_of_the_whole(scene):
    hashes = KeptHashes()
    for azimuth in (0.0, 30.0):
        moved = scene.with_camera(orbiting(scene.camera, OrbitConfig(distance=4.0, azimuth=azimuth), "Y"))
        assert hashes.of(moved) == content_hash(canonical(moved))


def test_hashes_by_parts_see_each_light(scene):
    hashes = KeptHashes()
    for brightness in (1.0, 2.0, *range(3, 3 + KeptHashes.KEPT_MAX), 1.0):
        lights = [DomeLight(name=name, radiance=(brightness * k, 1.0, 0.5)) for k, name in enumerate("abc")]
        lit = replace(scene, lights=(*scene.lights, *lights))
        assert hashes.of(lit) == content_hash(canonical(lit))


def test_a_plan_tells_how_far_it_is(config_path):
    told = []
    plan = build_plan(load_config(config_path), progress=lambda *told_now: told.append(told_now))
    count = len(plan.samples)
    assert told[0] == ("placing samples", 0, count)
    assert told[-1] == ("reading scenes", count, count)


def test_random_values_depend_on_seed_index_and_axis_alone(plan_of):
    alone = plan_of(axes={"S_w": {"uniform": [0, 1]}}, draws=4)
    among = plan_of(axes={"g": {"uniform": [-0.5, 0.5]}, "S_w": {"uniform": [0, 1]}, "H": [-0.4, -0.3]}, draws=2)
    for one, other in zip(alone.samples, among.samples, strict=True):
        assert one.parameters["S_w"] == other.parameters["S_w"]
    reseeded = plan_of(axes={"S_w": {"uniform": [0, 1]}}, draws=4, seed=1)
    assert reseeded.samples[0].parameters != alone.samples[0].parameters


def test_random_values_are_uniform_and_independent(plan_of):
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
def test_sweeps_out_of_the_domain_are_refused_by_index_and_value(plan_of, axes, message):
    with pytest.raises(ConfigError, match=message):
        plan_of(axes=axes)


def test_transport_is_checked_against_the_swept_parameters(plan_of):
    base = furnace(hurst=-0.7, white_noise_scale=1.0)
    plan = plan_of(base, transport="reciprocal", axes={"H": [-0.5, -0.25]})
    assert {sample.medium.resolved_transport for sample in plan.samples} == {"reciprocal"}
    with pytest.raises(ConfigError, match=r"sample 1: /medium: transport = 'reciprocal' with H = -0.7"):
        plan_of(transport="reciprocal", axes={"H": [-0.5, -0.7]})


def test_phase_function_is_checked_against_the_swept_parameters(plan_of):
    with pytest.raises(ConfigError, match=r"sample 1: /medium: g = 0.4 with phase_function = 'isotropic'"):
        plan_of(furnace(phase_function="isotropic"), axes={"g": [0.0, 0.4]})


def test_a_sweep_that_an_authored_kappa_would_silence_is_refused(plan_of):
    with pytest.raises(ConfigError, match=r"axes.S_w: /medium authors kappa = 0"):
        plan_of(furnace(kappa=0.5), axes={"S_w": [1.0]})


def test_a_medium_that_is_not_there_is_refused(plan_of):
    with pytest.raises(SceneError, match="no medium '/no'; it has: /medium"):
        plan_of(medium="/no")


def test_axes_of_one_group_advance_together(plan_of):
    axes = {"g": [0.0, 0.5], "H": [-0.5, -0.25], "S_w": [1.0, 2.0]}
    plan = plan_of(axes=axes, zip=[["H", "S_w"]])
    found = list(zip(column(plan, "g"), column(plan, "H"), column(plan, "S_w"), strict=True))
    assert found == [(0.0, -0.5, 1.0), (0.0, -0.25, 2.0), (0.5, -0.5, 1.0), (0.5, -0.25, 2.0)]
    assert list(plan.samples[0].parameters) == ["g", "H", "S_w"]


def test_dependent_axes_follow_in_any_order(plan_of):
    axes = {"kappa": {"expression": "2 * L"}, "L": {"expression": "sigma_m + 1"}, "sigma_m": [1.0, 2.0]}
    plan = plan_of(axes=axes)
    assert column(plan, "kappa") == [4.0, 6.0]
    assert [sample.medium.outer_scale for sample in plan.samples] == [2.0, 3.0]
    assert list(plan.samples[0].parameters) == ["kappa", "L", "sigma_m"]


def test_an_expression_without_a_value_names_what_it_has_none_for(plan_of):
    with pytest.raises(ConfigError, match=r"with sigma_m = 1: log.sigma_m - 1. has no value"):
        plan_of(axes={"sigma_m": [2.0, 1.0], "L": {"expression": "log(sigma_m - 1)"}})


def test_constraints_leave_samples_out_and_number_the_rest(plan_of):
    plan = plan_of(axes={"H": [-0.5, 0.5], "L": [1.0, 20.0]}, constraints=["H < 0 or L > 1", "H < 0 or L < 100"])
    assert list(zip(column(plan, "H"), column(plan, "L"), strict=True)) == [(-0.5, 1.0), (-0.5, 20.0), (0.5, 20.0)]
    assert [sample.index for sample in plan.samples] == [0, 1, 2]
    assert plan.left_out == 1
    with pytest.raises(ConfigError, match=r"constraints: none of 2 samples meets them"):
        plan_of(axes={"H": [-0.5, -0.25]}, constraints=["H > 0"])


def test_random_values_do_not_depend_on_constraints(plan_of):
    axes = {"S_w": {"uniform": [0, 1]}}
    every, some = plan_of(axes=axes, draws=50), plan_of(axes=axes, draws=50, constraints=["S_w < 0.5"])
    assert column(some, "S_w") == [value for value in column(every, "S_w") if value < 0.5]
    assert 0 < some.left_out < 50


def test_a_latin_hypercube_has_one_sample_in_each_part_of_every_axis(plan_of):
    axes = {"S_w": {"uniform": [0, 1]}, "g": {"uniform": [0.0, 0.5]}, "H": [-0.5, -0.25]}
    plan = plan_of(axes=axes, draws=20, design="latin_hypercube")
    assert sorted(int(value * 40) for value in column(plan, "S_w")) == list(range(40))
    assert sorted(int(value * 80) for value in column(plan, "g")) == list(range(40))
    again, other = (plan_of(axes=axes, draws=20, design="latin_hypercube", seed=seed) for seed in (0, 1))
    assert column(again, "S_w") == column(plan, "S_w") != column(other, "S_w")


def test_a_sobol_sequence_has_one_sample_in_each_elementary_box(plan_of):
    axes = {"S_w": {"uniform": [0, 1]}, "albedo": {"uniform": [0, 1]}}
    plan = plan_of(axes=axes, draws=64, design="sobol")
    boxes = Counter((int(8 * x), int(8 * y)) for x, y in zip(column(plan, "S_w"), column(plan, "albedo"), strict=True))
    assert set(boxes) == set(itertools.product(range(8), repeat=2))
    assert not plan.warnings
    longer = plan_of(axes=axes, draws=65, design="sobol")
    assert column(longer, "S_w")[:64] == column(plan, "S_w")
    assert longer.warnings == ("65 samples of a Sobol sequence: it is even over powers of 2 alone",)


def test_normal_draws_are_normal(plan_of):
    """2000 draws: the KS test sees a shift of 0.09 deviations."""
    values = column(plan_of(axes={"sigma_m": {"normal": [50, 3]}}, draws=2000), "sigma_m")
    assert stats.kstest(values, stats.norm(50, 3).cdf).pvalue > 1e-4


def test_too_many_samples_are_refused(plan_of):
    with pytest.raises(ConfigError, match="4000000 samples; accepted: at most 1000000"):
        plan_of(axes={"H": [-0.5, -0.4, -0.3, -0.2]}, draws=10**6)


def test_splits_have_their_shares_and_keep_groups_together(plan_of):
    axes = {"H": {"linspace": [-0.9, -0.1, 10]}, "g": [0.0, 0.1, 0.2]}
    plan = plan_of(axes=axes, draws=2, splits={"train": 0.7, "validation": 0.1, "test": 0.2, "by": ["H"]})
    assert Counter(sample.split for sample in plan.samples) == {"train": 42, "validation": 6, "test": 12}
    assert len({(sample.parameters["H"], sample.split) for sample in plan.samples}) == 10
    alone = plan_of(axes=axes, splits={"train": 0.5, "test": 0.5})
    assert Counter(sample.split for sample in alone.samples) == {"train": 15, "test": 15}
    reseeded = plan_of(axes=axes, splits={"train": 0.5, "test": 0.5}, seed=1)
    assert [sample.split for sample in alone.samples] != [sample.split for sample in reseeded.samples]
    assert {sample.split for sample in plan_of(axes=axes).samples} == {"train"}


def test_a_split_without_samples_is_refused(plan_of):
    with pytest.raises(ConfigError, match=r"config.yaml:1: splits: 3 groups of equal H leave test without any"):
        plan_of(axes={"H": [-0.4, -0.3, -0.2]}, draws=9, splits={"train": 0.9, "test": 0.1, "by": ["H"]})


def test_the_table_has_axes_and_the_labels_that_they_do_not_name(plan_of):
    plan = plan_of(axes={"S_w": [1.0], "H": [-0.25], "transport": ["mixed"]}, splits={"test": 1.0}, seed=5)
    (row,) = rows_of(plan)
    law = build_line_law(hurst=-0.25, white_noise_scale=1.0, mean_extinction=furnace().media[0].mean_extinction)
    assert list(row)[:6] == ["index", "split", "seed", "S_w", "H", "transport"]
    assert row["seed"] == sample_seed(5, 0)
    assert (row["split"], row["H"], row["transport"], row["regime"]) == ("test", -0.25, "mixed", "pink")
    assert (row["b"], row["kappa"], row["L"]) == (law.b, law.kappa, None)
    meta, _ = read_plan(plan.to_bytes(), "plan.parquet")
    assert meta == plan.meta
    assert [(axis.name, axis.values, axis.category) for axis in meta.axes][1:] == [
        ("H", (-0.25,), False),
        ("transport", ("mixed",), True),
    ]


def test_targets_and_quality_are_told(plan_of):
    plan = plan_of(
        spp=None,
        quality={"target_error": 0.1, "max_spp": 8},
        targets={"transmittance": {"linspace": [0, 1, 3]}, "mean_free_path": True},
    )
    assert plan.meta.quality == {"spp": 8, "target_error": 0.1}
    assert plan.meta.targets == {"transmittance": {"t": [0.0, 0.5, 1.0]}, "mean_free_path": True}


def test_a_curve_beyond_the_end_of_the_law_is_refused(plan_of):
    axes = {"H": [0.5], "L": [100.0], "S_w": [0.01], "line_variance": ["asymptotic", "exact"]}
    with pytest.raises(ConfigError, match=r"sample 1: targets.transmittance: t = 1e.06; accepted: at most"):
        plan_of(axes=axes, targets={"transmittance": [0.0, 1e6]})


def test_a_plan_is_small_in_another_process_and_reads_its_scenes_there(plan_stage):
    plan = plan_stage(axes={"sky": {"target": "/World/Sky.inputs:intensity", "uniform": [1, 2]}}, draws=30)
    plan.scene_of(plan.samples[0])
    content = pickle.dumps(plan)
    assert len(content) < 40_000
    copy = pickle.loads(content)
    for sample, same in zip(plan.samples[::7], copy.samples[::7], strict=True):
        assert copy.group_key(same) == plan.group_key(sample)
        found = copy.scene_of(same)
        assert found.lights[0].radiance == plan.scene_of(sample).lights[0].radiance
        assert found.lights[0].radiance[0] == pytest.approx(same.parameters["sky"], rel=1e-6)
        assert copy.media_of(same) == (same.medium,)


def test_samples_whose_media_alone_differ_share_a_scene(plan_stage):
    plan = plan_stage(axes={"H": [-0.5, -0.25], "frame": [1.0, 2.0]})
    keys = [plan.group_key(sample) for sample in plan.samples]
    assert keys[0] == keys[2] != keys[1] == keys[3]
    assert plan.scene_of(plan.samples[0]) is plan.scene_of(plan.samples[2])


def test_any_number_and_variant_of_the_stage_can_be_swept(plan_stage):
    plan = plan_stage(
        axes={
            "/World/Sky.inputs:color[1]": [0.125],
            "size": {"target": "/World/Ball{look}", "values": ["small", "large"]},
            "frame": [1.0, 2.0],
        },
    )
    assert list(plan.samples[0].parameters) == ["World_Sky_inputs_color_1", "size", "frame"]
    for sample in plan.samples:
        scene = plan.scene_of(sample)
        (ball,) = scene.shapes
        assert scene.lights[0].radiance == (1.0, 0.125, 0.25)
        assert ball.object_to_world[0, 0] == {"small": 1.0, "large": 2.0}[sample.parameters["size"]]
        assert ball.object_to_world[0, 3] == sample.parameters["frame"] - 1
    assert [axis.target for axis in plan.meta.axes] == ["/World/Sky.inputs:color[1]", "/World/Ball{look}", "frame"]


def test_an_axis_that_changes_nothing_is_warned_of(plan_stage):
    far = {"target": "/World/Far.focalLength", "values": [20.0, 30.0]}
    front = {"target": "/World/Front.focalLength", "values": [20.0, 30.0]}
    plan = plan_stage(axes={"front": front, "far": far})
    assert plan.warnings == ("axis far: with far = 20 and far = 30 the scene is the same",)


def test_cameras_are_swept_by_path_and_on_an_orbit(plan_stage):
    plan = plan_stage(camera=None, axes={"camera": ["/World/Front", "/World/Far"]})
    assert [plan.scene_of(sample).camera.position[2] for sample in plan.samples] == [9, 90]
    orbit = {"center": [1.0, 2.0, 3.0], "elevation": 30.0}
    around = plan_stage(orbit=orbit, axes={"azimuth": [0.0, 90.0], "distance": [4.0]})
    expected = [(1, 4, 3 + 4 * np.cos(np.pi / 6)), (1 + 4 * np.cos(np.pi / 6), 4, 3)]
    for sample, position in zip(around.samples, expected, strict=True):
        camera = around.scene_of(sample).camera
        np.testing.assert_allclose(camera.position, position, atol=1e-12)
        towards = -camera.camera_to_world[:3, 2]
        np.testing.assert_allclose(camera.position + 4 * towards, [1, 2, 3], atol=1e-12)
    with pytest.raises(ConfigError, match="sample 1: with elevation = 95: elevation = 95; accepted"):
        plan_stage(orbit={"distance": 1.0}, axes={"elevation": [0.0, 95.0]})


def test_stages_are_swept_by_their_files(plan_stage, tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "one.usda").write_text(STAGE)
    (tmp_path / "far" / "two.usda").write_text(STAGE.replace("meanExtinction = 2", "meanExtinction = 3"))
    plan = plan_stage(scene=None, axes={"scene": ["one.usda", "far/two.usda"]})
    assert column(plan, "scene") == ["one.usda", "two.usda"]
    assert [plan.scene_of(sample).source for sample in plan.samples] == ["one.usda", "two.usda"]
    assert [sample.medium.mean_extinction for sample in plan.samples] == [2.0, 3.0]
    (tmp_path / "far" / "one.usda").write_text(STAGE)
    with pytest.raises(ConfigError, match=r"axes: two stages are called one\.usda"):
        plan_stage(scene=None, axes={"scene": ["one.usda", "far/one.usda"]})


def test_what_changes_in_the_stage_changes_the_digest(plan_stage, tmp_path):
    axes = {"size": {"target": "/World/Ball{look}", "values": ["small", "large"]}}
    before = plan_stage(axes=axes)
    (tmp_path / "s.usda").write_text(STAGE.replace("radius = 2", "radius = 3"))
    assert plan_stage(axes=axes).meta.digest != before.meta.digest
    assert before.scene_of(before.samples[0])
    with pytest.raises(SceneError, match=r"s.usda: has changed since the plan was made"):
        before.scene_of(before.samples[1])


@pytest.mark.parametrize(
    ("target", "value", "message"),
    [
        ("/World/Ball.radius", -1.0, r"^sample 0: with x = -1: .*/World/Ball.radius = -1; accepted"),
        (
            "/World/Sko.inputs:intensity",
            1.0,
            r"config.yaml:1: axes.x: sample 0.* no prim /World/Sko; did .*/World/Sky\?",
        ),
        ("/World/Ball{lock}", "a", r"axes.x: .* has no variant set lock; did you mean look\?"),
        ("/World/Ball{look}", "huge", r"axes.x: .* no variant 'huge'; accepted: large, small"),
    ],
)
def test_what_the_stage_does_not_take_is_refused_by_axis_and_sample(plan_stage, target, value, message):
    with pytest.raises(ConfigError, match=message):
        plan_stage(axes={"x": {"target": target, "values": [value]}})


def test_scenes_of_other_sizes_are_refused(plan_stage, tmp_path):
    size = 'def Scope "Render"\n{\n def RenderSettings "S"\n {\n  uniform int2 resolution = (64, 48)\n }\n}\n'
    (tmp_path / "one.usda").write_text(STAGE + size)
    (tmp_path / "two.usda").write_text(STAGE)
    with pytest.raises(ConfigError, match=r"images of 64 x 48 .sample 0. and 960 x .*; accepted: one size"):
        plan_stage(scene=None, image={}, axes={"scene": ["one.usda", "two.usda"]})


def test_a_scene_without_media_can_be_planned_and_not_swept(plan_of):
    bare = replace(furnace(), shapes=(), media=())
    plan = plan_of(bare, draws=2)
    assert [sample.medium for sample in plan.samples] == [None, None]
    assert plan.media_of(plan.samples[0]) == ()
    assert list(rows_of(plan)[0]) == ["index", "split", "seed"]
    with pytest.raises(ConfigError, match=r"axes: s.usda has no medium to sweep"):
        plan_of(bare, axes={"H": [-0.5]})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("constraints=[H < 0, H + 1]", "constraints[1]: with H = -0.4, g = -0.5: H + 1 is 0.6; accepted: a comparison"),
        ("axes.g={expression: 1 / (H + 0.4)}", "axes.g.expression: with H = -0.4: 1 / (H + 0.4) has no value: "),
        ("orbit={distance: 0}", "orbit.distance: found 0; accepted: greater than 0"),
        ("orbit={elevation: 90, distance: 1}", "orbit.elevation: found 90; accepted: less than or equal to 89.9"),
        ("axes.g={geometric: [1, 1e300, 2]}", "found 1e+300; accepted: less than or equal to 1e+100"),
        ("axes.g=[]", "axes.g: found []; accepted: at least 1 item"),
        (f"constraints=[{', '.join(['H < 0'] * 101)}]", "accepted: at most 100 items"),
    ],
)
def test_what_cannot_be_evaluated_is_told_with_its_place(tmp_path, change, message):
    with pytest.raises(ConfigError) as caught:
        small_plan(tmp_path, change)
    assert message in str(caught.value)
    assert str(caught.value).startswith("--set ")
