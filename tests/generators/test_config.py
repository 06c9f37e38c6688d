import pytest

from fgf_warp.errors import ConfigError
from generators.config import AxisConfig, SweepConfig, load_config

BASE = "name: a\nscene: s.usda\n"


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("spp: 4\nimage:\n  widht: 3\n", r"config.yaml:5: image.widht: unknown key; did you mean width\?"),
        ("axs: {}\n", r"config.yaml:3: axs: unknown key; did you mean axes\?"),
        ("axes:\n  g: [0]\n  h: [-0.5]\n", r"config.yaml:5: axes.h: no such parameter to sweep; did you mean H\?"),
        ("axes: {hurst: [1]}\n", "axes.hurst: .* accepted: H, g, S_w, sigma_m, L, kappa, albedo"),
        ("axes:\n  H:\n  - -0.5\n  - wide\n", r"config.yaml:6: axes.H\[1\]: found 'wide'; accepted: a valid number"),
        ("axes:\n  H: -0.5\n", r"config.yaml:4: axes.H: found -0.5; accepted: a list of numbers, or one of values"),
        ("axes: {H: {linspace: [0.1, 0.2]}}\n", "axes.H.linspace: found .* one item more"),
        ("axes: {H: {linspace: [0.1, 0.2, 0]}}\n", r"axes.H.linspace\[2\]: found 0"),
        ("axes: {H: {values: [1], uniform: [0, 1]}}\n", "axes.H: .* accepted: exactly one of"),
        ("axes: {S_w: {loguniform: [0, 1]}}\n", "axes.S_w: .* both ends > 0"),
        ("axes: {S_w: {logspace: [-1, 1, 3]}}\n", "axes.S_w: .* both ends > 0"),
        ("axes: {S_w: {uniform: [2, 1]}}\n", "axes.S_w: .* low < high"),
        ("axes: {H: []}\n", "axes.H: found "),
        ("axes: {H: [.nan]}\n", r"axes.H\[0\]: found nan; accepted: a finite number"),
        ("spp: 0\n", "config.yaml:3: spp: found 0; accepted: greater than or equal to 1"),
        ("spp: '4'\n", "spp: found '4'; accepted: a valid integer"),
        ("spp: true\n", "spp: found True; accepted: a valid integer"),
        ("png: 1\n", "png: found 1; accepted: a valid boolean"),
        ("seed: -1\n", "seed: found -1"),
        ("exposure: 2000\n", "config.yaml:3: exposure: found 2000; accepted: less than or equal to 32"),
        ("exposure: -33\n", "exposure: found -33; accepted: greater than or equal to -32"),
        ("seed: 18446744073709551616\n", "seed: found 18446744073709551616"),
        ("preset: best\n", "preset: found 'best'; accepted: 'preview', 'balanced' or 'reference'"),
        ("aovs: [dept]\n", r"aovs\[0\]: found 'dept'"),
        ("name: b\n", "config.yaml:3: not valid YAML: .*duplicate"),
        ("axes: [1\n", "config.yaml:.: not valid YAML"),
    ],
)
def test_error_says_where_what_and_what_instead(write_config, lines, message):
    with pytest.raises(ConfigError, match=message) as caught:
        load_config(write_config(BASE + lines))
    assert "\n" not in str(caught.value)


def test_missing_key_is_named(write_config):
    with pytest.raises(ConfigError, match=r"config.yaml: scene: this key is missing"):
        load_config(write_config("name: a\n"))


@pytest.mark.parametrize("content", ["", "- 1\n", "text\n"])
def test_other_yaml_is_refused(write_config, content):
    with pytest.raises(ConfigError, match="accepted: a mapping with the keys name, scene"):
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
        load_config(write_config(BASE), [override])


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
    assert AxisConfig(linspace=(1 / 3, 2 / 3, 2)).grid_values() == (1 / 3, 2 / 3)


def test_logarithmic_values_may_be_small_beside_their_span():
    assert AxisConfig(logspace=(1e-15, 10.0, 5)).grid_values() == (1e-15, 1e-11, 1e-7, 1e-3, 10.0)
    assert AxisConfig(logspace=(1e-14, 100.0, 9)).grid_values()[1] == 1e-12


def test_random_axes_follow_their_quantiles():
    assert AxisConfig(uniform=(-1.0, 3.0)).value_at(0.25) == 0.0
    assert AxisConfig(loguniform=(0.1, 10.0)).value_at(0.5) == pytest.approx(1.0, rel=1e-14)
    assert AxisConfig(loguniform=(0.1, 10.0)).value_at(0.0) == 0.1


def test_spp_replaces_the_presets():
    config = SweepConfig(name="a", scene="s", preset="reference")
    assert config.render_settings(4, 4, "cpu").spp == 4096
    settings = config.model_copy(update={"spp": 3}).render_settings(4, 4, "cpu")
    assert (settings.spp, settings.max_depth) == (3, 65536)


def test_config_in_force_is_kept_with_comments_and_works_from_its_new_place(tmp_path, write_config):
    loaded = load_config(write_config("# mine\n" + BASE + "spp: 4\n"), ["spp=8"])
    folder = tmp_path / "datasets" / "a"
    folder.mkdir(parents=True)
    loaded.write(folder)
    assert (folder / "config.yaml").read_text().startswith("# mine\n")
    again = load_config(folder / "config.yaml")
    assert again.config.spp == 8
    assert again.scene_path.resolve() == loaded.scene_path.resolve()
