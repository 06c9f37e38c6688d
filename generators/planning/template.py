"""What helps to write a config: one to begin with, and the schema that editors read."""

from __future__ import annotations

import json
import os
from pathlib import Path

from fgf_warp.errors import ConfigError
from fgf_warp.output.atomic import write_bytes
from generators.planning.config import SweepConfig
from generators.planning.targets import KNOWN

TEMPLATE = Path(__file__).parent / "template.yaml"
DIALECT = "https://json-schema.org/draft/2020-12/schema"
NAME, SCENE = "NAME", "SCENE"
"""What `write_template` fills in."""


def write_template(path: Path) -> None:
    """Writes a config with comments, of a stage that comes with the package.

    Args:
        path: of the file; its stem is the dataset's name.

    Raises:
        ConfigError: where there is a file, or it would be no YAML by its name.
        OutputError: where it cannot be written.
    """
    from usd_scenes.examples import stage_path  # noqa: PLC0415 - USD is slow to import

    if path.suffix.lower() not in (".yaml", ".yml"):
        raise ConfigError(f"{path}: accepted: a name that ends in .yaml or .yml")
    if path.exists():
        raise ConfigError(f"{path}: is there already; accepted: a new name")
    scene = Path(os.path.relpath(stage_path("cloud_block"), path.parent)).as_posix()
    text = TEMPLATE.read_text(encoding="utf-8")
    for slot, value in ((NAME, path.stem), (SCENE, scene)):
        text = text.replace(slot, json.dumps(value))
    write_bytes(path, text.encode())


def schema_text() -> str:
    """The JSON schema of configs."""
    schema = SweepConfig.model_json_schema()
    axes = schema["properties"]["axes"]
    axes["properties"] = dict.fromkeys(KNOWN, axes["additionalProperties"])  # Which editors complete.
    return json.dumps({"$schema": DIALECT, **schema, "title": "Dataset of FGF-Warp"}, indent=2) + "\n"
