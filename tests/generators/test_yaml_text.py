"""What YAML may be, and how what it may not is told."""

import io
import os

import pytest
from ruamel.yaml import YAML

from fgf_warp.errors import ConfigError
from generators.planning.document import load_config
from generators.planning.yaml_text import DEPTH_MAX, NODES_MAX, TEXT_MAX, YamlTextError, parse_yaml
from tests.generators.test_cli import assert_refused, fgf

BASE = "name: a\nscene: s.usda\n"
BOMB = "a0: &a0 [1, 2]\n" + "".join(f"a{at}: &a{at} [{', '.join([f'*a{at - 1}'] * 9)}]\n" for at in range(1, 12))


@pytest.mark.parametrize(
    ("text", "problem", "line"),
    [
        (BOMB, f"has 184528 keys and values, aliases counted .* accepted: at most {NODES_MAX}", 6),
        ("b: 1\na: &a [*a]\n", r"\*a is part of itself", 2),
        ("a: &a {<<: *a}\n", r"\*a is part of itself", 1),
        ("a: " + "[" * 60 + "]" * 60, f"nested too deep; accepted: at most {DEPTH_MAX} levels", 1),
        ("a: " + "[1, [" * 30 + "]]" * 30, "nested too deep", 1),
        ("a: " + "{a: " * 5000, "nested too deep", None),
        ("#" * (TEXT_MAX + 1), f"is {TEXT_MAX + 1} characters long; accepted: at most {TEXT_MAX}", None),
        ("a: 1\nb: " + "9" * 5000, r"found 9+\.\.\., a number of 5000 characters; accepted: at most 100", 2),
        ("a: 1\nb: !!int x\n", "not valid YAML: 'x' is no int", 2),
        ("a: 1\nb: !!bool x\n", "not valid YAML: 'x' is no bool", 2),
        ("b: 2001-99-99\n", "'2001-99-99' is no timestamp", 1),
        ("b: 0x_\n", "'0x_' is no int", 1),
        ('b: "\\U00110000"\n', "not valid YAML: chr", 1),
        ('a: 1\nb: "\\ud800"\n', r"found the character U\+D800", 2),
        ('b: "x\\0y"\n', r"found the character U\+0000", 1),
        ("b: !!set {c}\n", "found the tag !!set; accepted: values without", 1),
        ("b: !mine c\n", "found the tag !mine; accepted: values without", 1),
        ("1: 2\n", "found '1' as a key; accepted: a word, else in quotes", 1),
        ("? [a]\n: 2\n", "found more than a word as a key", 1),
        ("a: {<<: 1}\n", "found no mapping after <<", 1),
        ("a: 1\na: 2\n", "not valid YAML: found duplicate key", 2),
        ("%YAML 3.0\n---\na: 1\n", "not valid YAML: found incompatible YAML document", 1),
    ],
)
def test_what_is_no_config_is_told_in_a_line(text, problem, line):
    with pytest.raises(YamlTextError, match=problem) as caught:
        parse_yaml(text)
    assert caught.value.line == line
    assert "\n" not in str(caught.value)


def test_aliases_and_merges_are_copies():
    document = parse_yaml("a: &one {x: [1], y: &no false}\nb: *one\nc: {<<: *one, x: 2}\nd: *no\n# end\n")
    document["b"]["x"][0] = 9
    assert document["a"] == {"x": [1], "y": False}
    assert document["c"] == {"x": 2, "y": False}
    assert document["d"] is False
    written = io.StringIO()
    YAML().dump(document, written)
    assert written.getvalue() == "a: {x: [1], y: false}\nb: {x: [9], y: false}\nc: {x: 2, y: false}\nd: false\n# end\n"


def test_of_several_merged_mappings_the_first_holds():
    document = parse_yaml("p: &p {x: 1}\nq: &q {x: 2, y: 3}\na: {<<: [*p, *q], z: 4}\n")
    assert dict(document["a"]) == {"x": 1, "y": 3, "z": 4}


def test_an_override_of_an_alias_leaves_the_other_place(write_config):
    lines = "axes:\n  S_w: &range {linspace: [1, 4, 2]}\n  sigma_m: *range\npng: &show false\n"
    config = load_config(write_config(BASE + lines), ["axes.sigma_m.linspace=[10, 20, 2]"]).config
    assert config.axes["S_w"].grid_values() == (1, 4)
    assert config.axes["sigma_m"].grid_values() == (10, 20)
    assert config.png is False


def test_overrides_are_bounded_too(write_config):
    path = write_config(BASE)
    for override in (f"axes={'[' * 400}", f"seed={'9' * 5000}", "png=!!bool x", "axes=&a [*a]", f"{'a.' * 400}b=1"):
        with pytest.raises(ConfigError, match=r"^--set .*accepted|^--set .*not valid YAML") as caught:
            load_config(path, [override])
        assert len(str(caught.value)) < 500


def test_a_pipe_a_device_and_a_large_file_are_no_configs(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    assert_refused(fgf("plan", tmp_path / "pipe.yaml"), "pipe.yaml: is no file; accepted: a file with YAML")
    assert_refused(fgf("plan", "/dev/zero"), "/dev/zero: is no file")
    assert_refused(fgf("plan", tmp_path), "is no file")
    (tmp_path / "large.yaml").write_bytes(b"#" * (4 * TEXT_MAX + 1))
    assert_refused(fgf("plan", tmp_path / "large.yaml"), f"bytes long; accepted: at most {TEXT_MAX} characters")
    assert_refused(fgf("plan", tmp_path / f"{'x' * 300}.yaml"), "File name too long")
