import json
from pathlib import Path

import jsonschema
import pytest
from ruamel.yaml import YAML

from generators.commands import plan as planning
from generators.planning.template import TEMPLATE
from tests.generators.test_cli import assert_refused, fgf

CONFIGS = sorted(path for path in (Path(__file__).parents[2] / "configs").glob("*.yaml") if path.stem != "tradeoff")
"""Those of datasets."""


def test_plan_tells_of_axes_splits_and_what_is_left_out(config_path):
    changes = ["design=sobol", "draws=4", 'constraints=["g < 0.4"]', "splits={train: 0.5, test: 0.5}"]
    outcome = fgf("plan", config_path, *(part for change in changes for part in ("--set", change)))
    assert outcome.exit_code == 0
    assert "-0.5, -0.25" in outcome.stdout
    assert "16 from 0.1" in outcome.stdout
    assert "16 samples" in outcome.stdout
    assert "8 more are left out" in outcome.stdout
    assert "8 for train, 8 for test" in outcome.stdout
    assert "warning: 24 samples of a Sobol sequence" in outcome.stderr


def test_a_long_plan_shows_a_bar(config_path, monkeypatch):
    assert "reading scenes" not in fgf("plan", config_path).stderr
    monkeypatch.setattr(planning, "SILENT_SECONDS", 0)
    assert "reading scenes" in fgf("plan", config_path).stderr
    assert "reading scenes" in fgf("validate", config_path).stderr


def test_init_writes_a_config_that_can_be_planned(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    outcome = fgf("init", "in: a [folder.yaml")
    assert outcome.exit_code == 0, outcome.output
    assert fgf("plan", "in: a [folder.yaml").exit_code == 0
    assert_refused(fgf("init", "in: a [folder.yaml"), "is there already")
    assert_refused(fgf("init", "cloud.txt"), "accepted: a name that ends in .yaml")
    assert_refused(fgf("init", tmp_path / "no" / "cloud.yaml"), "cannot be written")


def test_schema_is_one_and_accepts_the_configs():
    schema = json.loads(fgf("schema").stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    for path in (TEMPLATE, *CONFIGS):
        assert not list(validator.iter_errors(YAML(typ="safe").load(path))), path
    for wrong in ({"name": "a", "ssp": 3}, {"name": "a", "axes": {"H": 3}}, {"name": "a", "spp": "4"}):
        assert list(validator.iter_errors(wrong))


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_the_configs_that_come_along_can_be_planned(path):
    few = ["--set", "draws=32"] if path.stem in ("sweep", "inverse") else []
    outcome = fgf("plan", path, *few)
    assert outcome.exit_code == 0, outcome.output
    assert "the scene is the same" not in outcome.stderr
