import pytest

from fgf_warp.errors import ConfigError
from generators.planning.axes import AxisConfig
from generators.planning.config import SweepConfig
from generators.planning.document import load_config
from generators.planning.resolve import resolve

BASE = "name: a\nscene: s.usda\n"


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("spp: 4\nimage:\n  widht: 3\n", r"config.yaml:5: image.widht: unknown key; did you mean width\?"),
        ("axs: {}\n", r"config.yaml:3: axs: unknown key; did you mean axes\?"),
        ("axes:\n  g: [0]\n  h: [-0.5]\n", r"config.yaml:5: axes.h: no such parameter to sweep; did you mean H\?"),
        (
            "axes: {hurst: [1]}\n",
            "axes.hurst: .* accepted: H, g, S_w, sigma_m, L, kappa, albedo.* or a target: such as /",
        ),
        ("axes:\n  H:\n  - -0.5\n  - wide\n", r"config.yaml:6: axes.H\[1\]: found 'wide'; accepted: a valid number"),
        ("axes:\n  H: -0.5\n", r"config.yaml:4: axes.H: found -0.5; accepted: a list of numbers, or one of values"),
        ("axes: {H: {linspace: [0.1, 0.2]}}\n", "axes.H.linspace: found .* one item more"),
        ("axes: {H: {linspace: [0.1, 0.2, 0]}}\n", r"axes.H.linspace\[2\]: found 0"),
        ("axes: {H: {values: [1], uniform: [0, 1]}}\n", "axes.H: .* accepted: exactly one of"),
        ("axes: {S_w: {loguniform: [0, 1]}}\n", "axes.S_w: .* both ends > 0"),
        ("axes: {S_w: {logspace: [-1, 1, 3]}}\n", "axes.S_w: .* both ends > 0"),
        ("axes: {S_w: {uniform: [2, 1]}}\n", "axes.S_w: .* low < high"),
        ("axes: {H: []}\n", "axes.H: found "),
        ("axes: {S_w: {geometric: [1, 0, 3]}}\n", "axes.S_w: .* geometric with first and ratio > 0"),
        ("axes: {H: {normal: [1, 0]}}\n", "axes.H: .* a deviation > 0"),
        ("axes: {H: {unifrom: [1, 2]}}\n", r"axes.H.unifrom: unknown key; did you mean uniform\?"),
        ("axes:\n  H:\n    values: [-0.5, wide]\n", r"config.yaml:5: axes.H.values\[1\]: found 'wide'; .* number"),
        ("axes: {transport: [mixed, 2]}\n", r"axes.transport\[1\]: found 2.0; accepted: a name"),
        ("axes: {transport: {uniform: [1, 2]}}\n", "axes.transport: transport takes names"),
        (
            "axes: {key: {target: World/Key, values: [1]}}\n",
            "axes.key.target: found 'World/Key'; .* /World/Key.inputs:",
        ),
        ("axes: {a: {target: h, values: [1]}}\n", r"axes.a.target: found 'h'; did you mean H\?"),
        ("axes: {H: {target: g, values: [0]}}\n", "axes.H: the name says another target than g"),
        ("axes: {b: {target: g, values: [0]}}\n", "axes.b: cannot be the name of a column"),
        ("axes: {status: {target: g, values: [0]}}\n", "axes.status: cannot be the name of a column"),
        ("axes: {my-g: {target: g, values: [0]}}\n", "axes.my-g: cannot be the name of a column"),
        ("axes: {g: [0], other: {target: g, values: [0]}}\n", "axes.other: g is swept by axis g already"),
        ("axes: {/A.b: [0], A_b: {target: /A.c, values: [0]}}\n", "axes.A_b: column A_b is taken by axis /A.b"),
        ("axes: {albedo: [0], albedo_g: [0]}\n", "axes: albedo and albedo_g both set the albedo"),
        ("frame: 1\naxes: {frame: [0]}\n", "config.yaml:3: frame: axis frame takes its place"),
        ("axes: {scene: [a.usda]}\n", "config.yaml:2: scene: axis scene takes its place"),
        ("axes: {azimuth: [0]}\n", "axes.azimuth: needs the key orbit"),
        ("orbit: {azimuth: 3}\n", "orbit: distance is missing"),
        ("axes: {L: {expression: H}}\n", "axes.L.expression: 'H' is no axis"),
        ("axes: {S_w: [1], L: {expression: S_W}}\n", r"axes.L.expression: 'S_W' is no axis; did you mean S_w\?"),
        ("axes: {L: {expression: 2 *}}\n", "axes.L.expression: found '2 .'; accepted: an expression"),
        ("axes: {L: {expression: '().x'}}\n", r"axes.L.expression: found \(\).x; accepted: numbers"),
        ("axes: {L: {expression: H}, H: {expression: L}}\n", "axes: expressions go round in a circle: "),
        (
            "axes: {H: [1]}\nconstraints:\n- H < 0\n- h < 0\n",
            r"config.yaml:6: constraints\[1\]: 'h' is no axis; did you",
        ),
        ("axes: {H: [1, 2], L: [1]}\nzip: [[H, L]]\n", r"zip\[0\]: H has 2, L has 1 values; accepted: equally many"),
        ("axes: {H: {uniform: [0, 1]}, L: [1]}\nzip: [[H, L]]\n", r"zip\[0\]: H has no values in order"),
        ("axes: {H: [1], L: [1]}\nzip: [[H, H]]\n", r"zip\[0\]: H is named twice"),
        ("axes: {H: [1], L: [1]}\nzip: [[H, S]]\n", r"zip\[0\]: 'S' is no axis"),
        ("design: sobol\n", "design: sobol of no drawn axes"),
        ("splits: {train: 0.5, test: 0.4}\n", "splits: found .* add up to 1"),
        ("splits: {train: 1, by: [H]}\n", "splits.by: 'H' is no axis"),
        ("spp: 4\nquality: {time: 1}\n", "config.yaml:4: quality: both this and spp"),
        ("quality: {max_spp: 8}\n", "quality: found .* accepted: target_error, time, or both"),
        ("quality: {time: 1, error_over: rms}\n", "quality: .* accepted: error_over together with target_error"),
        ("quality: {target_error: 0.1, error_over: p100}\n", "quality: .* accepted: error_over: mean, rms, or a perc"),
        ("quality: {time: 1, max_spp: 3}\n", "quality.max_spp: found 3; accepted: .*4"),
        ("quality: {target_eror: 1}\n", r"quality.target_eror: unknown key; did you mean target_error\?"),
        ("quality: {target_error: 0}\n", "quality.target_error: found 0; accepted: greater than 0"),
        ("targets: {transmittance: [-1]}\n", "targets: found .* lengths >= 0"),
        ("targets: {transmittance: {uniform: [0, 1]}}\n", "targets.transmittance.uniform: unknown key"),
        ("axes: {H: [.nan]}\n", r"axes.H\[0\]: found nan; accepted: a finite number"),
        ("spp: 0\n", "config.yaml:3: spp: found 0; accepted: greater than or equal to 1"),
        ("spp: '4'\n", "spp: found '4'; accepted: a valid integer"),
        ("spp: true\n", "spp: found True; accepted: a valid integer"),
        ("png: 1\n", "png: found 1; accepted: a valid boolean"),
        ("seed: -1\n", "seed: found -1"),
        ("exposure: 2000\n", "config.yaml:3: exposure: found 2000; accepted: less than or equal to 32"),
        ("exposure: -33\n", "exposure: found -33; accepted: greater than or equal to -32"),
        ("seed: 18446744073709551616\n", "seed: found 18446744073709551616"),
        ("preset: best\n", "preset: found 'best'; accepted: preview, balanced, reference, or an error such as auto:1%"),
        ("preset: auto:5s\n", "preset: found 'auto:5s'; accepted: .* an error such as auto:1%"),
        ("preset: auto:1%\nspp: 4\n", "spp: follows from preset auto:1%; accepted: one of them"),
        ("preset: auto:1%\nquality: {time: 1}\n", "quality: follows from preset auto:1%"),
        ("aovs: [dept]\n", r"aovs\[0\]: found 'dept'"),
        ("name: b\n", "config.yaml:3: not valid YAML: .*duplicate"),
        ("axes: [1\n", "config.yaml:.: not valid YAML"),
    ],
)
def test_error_says_where_what_and_what_instead(write_config, lines, message):
    with pytest.raises(ConfigError, match=message) as caught:
        resolve(load_config(write_config(BASE + lines)))
    assert "\n" not in str(caught.value)


def test_missing_key_is_named(write_config):
    with pytest.raises(ConfigError, match=r"config.yaml: name: this key is missing"):
        load_config(write_config("scene: a\n"))
    with pytest.raises(ConfigError, match=r"config.yaml: scene: this key is missing"):
        resolve(load_config(write_config("name: a\n")))


@pytest.mark.parametrize("content", ["", "- 1\n", "text\n"])
def test_other_yaml_is_refused(write_config, content):
    with pytest.raises(ConfigError, match="accepted: a mapping with the keys name, description"):
        load_config(write_config(content))


def test_missing_file_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"no.yaml: cannot be read: No such file"):
        load_config(tmp_path / "no.yaml")


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("spp", "--set spp: accepted: KEY=VALUE"),
        ("image.=3", "accepted: KEY=VALUE"),
        ("spp=many", "--set spp=many: spp: found 'many'; accepted: a valid integer"),
        ("image.wdth=3", r"--set image.wdth=3: image.wdth: unknown key; did you mean width\?"),
        ("axes.Q=[1]", "--set axes.Q=.*: axes.Q: no such parameter to sweep"),
        ("name.x=3", "--set name.x=3: name is 'a', which has no keys"),
        ("axes=[", "--set axes=.: the value is not valid YAML"),
    ],
)
def test_override_errors_name_the_override(write_config, override, message):
    with pytest.raises(ConfigError, match=message):
        resolve(load_config(write_config(BASE), [override]))


def test_overrides_replace_and_add(write_config):
    path = write_config(BASE + "spp: 4\naxes: {H: [-0.5], g: [0]}\n")
    config = load_config(path, ["spp=16", "axes.H=[-0.4, 1e-1]", "image.width=9", "axes.S_w={values: [2]}"]).config
    assert config.spp == 16
    assert config.image.width == 9
    assert list(config.axes) == ["H", "g", "S_w"]
    assert config.axes["H"].grid_values() == (-0.4, 0.1)


def test_spaced_values_meet_the_decimals():
    # 0.1 steps by floating-point addition pass beside -0.5, which is a regime of its own.
    values = AxisConfig(linspace=(-0.7, -0.1, 7)).grid_values()
    assert values == (-0.7, -0.6, -0.5, -0.4, -0.3, -0.2, -0.1)
    assert AxisConfig(linspace=(-0.3, 0.3, 7)).grid_values()[3] == 0.0
    assert AxisConfig(logspace=(0.01, 100, 5)).grid_values() == (0.01, 0.1, 1.0, 10.0, 100.0)
    assert AxisConfig(geometric=(0.1, 10, 4)).grid_values() == (0.1, 1.0, 10.0, 100.0)
    assert AxisConfig(linspace=(1 / 3, 2 / 3, 2)).grid_values() == (1 / 3, 2 / 3)


def test_logarithmic_values_may_be_small_beside_their_span():
    assert AxisConfig(logspace=(1e-15, 10.0, 5)).grid_values() == (1e-15, 1e-11, 1e-7, 1e-3, 10.0)
    assert AxisConfig(logspace=(1e-14, 100.0, 9)).grid_values()[1] == 1e-12


def test_random_axes_follow_their_quantiles():
    assert AxisConfig(uniform=(-1.0, 3.0)).value_at(0.25) == 0.0
    assert AxisConfig(loguniform=(0.1, 10.0)).value_at(0.5) == pytest.approx(1.0, rel=1e-14)
    assert AxisConfig(loguniform=(0.1, 10.0)).value_at(0.0) == 0.1
    normal = AxisConfig(normal=(3.0, 2.0))
    assert normal.value_at(0.5) == pytest.approx(3.0, abs=1e-12)
    assert normal.value_at(0.8413447460685429) == pytest.approx(5.0, rel=1e-12)
    assert normal.value_at(0.0) > -20  # Drawn once in 2^53 times, and finite.


def test_spp_replaces_the_presets():
    config = SweepConfig(name="a", scene="s", preset="reference")
    assert config.render_settings(4, 4, "cpu").spp == 4096
    settings = config.model_copy(update={"spp": 3}).render_settings(4, 4, "cpu")
    assert (settings.spp, settings.max_depth) == (3, 65536)


def test_quality_bounds_each_sample():
    fixed = SweepConfig(name="a", spp=3)
    assert fixed.bounds == {"spp": 3}
    open_ended = SweepConfig.model_validate({"name": "a", "quality": {"target_error": 0.02, "max_spp": 99}})
    assert open_ended.bounds == {"spp": 99, "target_error": 0.02}
    assert open_ended.render_settings(4, 4, "cpu").spp == 99
    asked = {"target_error": 0.02, "max_spp": 99, "error_over": "p95"}
    assert SweepConfig.model_validate({"name": "a", "quality": asked}).bounds["error_over"] == "p95"


def test_config_in_force_is_kept_with_comments_and_works_from_its_new_place(tmp_path, write_config):
    loaded = load_config(write_config("# mine\n" + BASE + "spp: 4\n"), ["spp=8"])
    folder = tmp_path / "datasets" / "a"
    folder.mkdir(parents=True)
    (folder / "config.yaml").write_bytes(loaded.to_bytes())
    assert (folder / "config.yaml").read_text().startswith("# scene/s.usda was 's.usda'\n# mine\n")
    again = load_config(folder / "config.yaml")
    assert again.config.spp == 8
    assert again.file(again.config.scene) == folder / "scene" / "s.usda"
    assert again.to_bytes() == loaded.to_bytes()


@pytest.mark.parametrize("axis", ["scene: [a.usda, b/c.usda]", "place: {target: scene, values: [a.usda, b/c.usda]}"])
def test_stages_that_are_swept_are_found_from_the_new_place_too(tmp_path, write_config, axis):
    loaded = load_config(write_config(f"name: a\naxes:\n  {axis}\n"))
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / "config.yaml").write_bytes(loaded.to_bytes())
    (found,) = load_config(tmp_path / "new" / "config.yaml").config.axes.values()
    assert found.values == ["scene/a.usda", "scene/c.usda"]
