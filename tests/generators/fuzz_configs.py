"""Configs with mistakes in them, and a process of its own that plans them: a crash or a hang is then a finding."""

from __future__ import annotations

import io
import json
import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from generators.planning.template import NAME, SCENE, TEMPLATE
from tests.answering import ROOT, AnsweringProcess, Outcome

TIME_LIMIT = 20
"""Seconds that one config may take."""
MEMORY_LIMIT = 2**31
"""Bytes that the process may have, USD and all."""
STAGES = ROOT / "usd_scenes" / "stages"

RICH = f"""\
name: rich
description: A bit of everything
scene: {STAGES}/cloud_block.usda
medium: /World/Looks/Cloud
camera: /World/Camera
seed: 3
image: {{width: 16, height: 16}}
quality: {{target_error: 0.1, error_over: p95, time: 10, max_spp: 64}}
aovs: &planes [depth, variance]
orbit: {{center: [0, 1, 0], distance: 6}}
axes:
  H: {{values: [-0.4, -0.2]}}
  S_w: &range {{logspace: [1, 4, 2]}}
  sigma_m: *range
  g:
    <<: *range
    logspace: [0.1, 0.2, 2]
  azimuth: {{linspace: [0, 90, 2]}}
  elevation: {{normal: [20, 1]}}
  albedo_r: {{uniform: [0.2, 0.4]}}
  albedo_g: {{expression: "min(1, 0.5 + albedo_r / 2) if H < -0.3 else sqrt(albedo_r)"}}
  sun: {{target: "/World/Sun.inputs:intensity", geometric: [1, 2, 2]}}
  phase_function: [hg]
  transport: [renewal]
zip: [[H, S_w], [sigma_m, g]]
constraints: ["H < 0 and S_w > 0", "not (g > 2)"]
design: latin_hypercube
draws: 1
splits: {{train: 0.5, test: 0.5, by: [H]}}
targets: {{transmittance: [0, 0.5], mean_free_path: true}}
output: somewhere
"""

NUMBERS = [
    *("0", "-1", "1", "2", "3.5", "1e-300", "1e300", "-1e38", "1e38", "1e39", "1e-45", "1e100", "2147483648", "0x10"),
    *(".nan", ".inf", "-.inf", "1_000_001", "1000001", "20000000", "1000000000", "18446744073709551616", "9" * 400),
    *("9" * 5000, "1e999999999", "0x" + "f" * 5000, "-0.0", "0o7", "1.", "2001-99-99", "0x_", "1:30", "0.01", "-0.5"),
]
WORDS = [
    *(
        "true",
        "null",
        "~",
        "''",
        "'x'",
        "..",
        "../x",
        "/abs",
        "a/b",
        "a::b",
        "'a\\0b'",
        '"\\0"',
        '"\\ud800"',
        '"\\U00110000"',
    ),
    *(
        "y" * 300,
        "z" * 70_000,
        "é" * 200,
        "\u202e",
        "💧",
        '"a\\nb"',
        "[]",
        "{}",
        "[[]]",
        "[1, 2]",
        "{a: 1}",
        "!!bool x",
    ),
    *(
        "!!int x",
        "!!set {a}",
        "!tag x",
        "!!python/name:os.system",
        "*nowhere",
        "&here x",
        "*here",
        "!!binary x",
        "%",
        "@",
    ),
    *("H", "S_w", "-H", "sin(H)", "1/0", "H**999", "'H' * 9", "(" * 300 + "H", "-" * 900 + "H", "+".join(["H"] * 400)),
    *(
        "not " * 200 + "H",
        "lambda: 0",
        "__import__('os')",
        "H < 0",
        "H if H else H",
        "max()",
        "exp(1000)",
        "'a' < H",
        "[H]",
    ),
    *("/World/Sun", "/World/Sun.inputs:intensity", "/World/Sun.inputs:intensity[2]", "/World/Sun.xformOp:rotateXYZ[7]"),
    *(
        "/World{look}",
        "/World/Nothing.size",
        "/World/Looks/Cloud.inputs:fgf:hurst",
        "/World/Sun.inputs:color[0]",
        "/.x",
    ),
    *(
        "auto:1%",
        "auto:0%",
        f"auto:0.{'0' * 400}1%",
        "reference",
        "cuda:9",
        "exact",
        "mixed",
        "two_lobe",
        "p95",
        "http://x",
    ),
    *(
        "axes",
        "scene",
        "frame",
        "camera",
        "distance",
        "kappa",
        "L",
        "albedo",
        "target",
        "expression",
        "uniform",
        "values",
    ),
]
KEYS = [
    *("name", "scene", "medium", "camera", "frame", "seed", "image.width", "image.height", "spp", "quality", "preset"),
    *("quality.time", "quality.target_error", "quality.max_spp", "aovs", "png", "exposure", "targets.transmittance"),
    *(
        "targets.mean_free_path",
        "transport",
        "line_variance",
        "axes",
        "zip",
        "draws",
        "design",
        "constraints",
        "output",
    ),
    *("splits", "splits.train", "splits.by", "orbit", "orbit.center", "orbit.distance", "orbit.azimuth", "axes.H"),
    *(
        "axes.S_w",
        "axes.sigma_m",
        "axes.L",
        "axes.g",
        "axes.kappa",
        "axes.scene",
        "axes.camera",
        "axes.frame",
        "axes.sun",
    ),
    *("axes.albedo", "axes.H.uniform", "axes.S_w.logspace", "axes.g.linspace", "axes.sun.target", "axes.L.expression"),
    *("axes./World/Sun.inputs:intensity", "a.b.c", "." * 30, "x." * 400 + "y", "<<", "axes.H.values.3", "k" * 3000),
]
SHAPES = [
    *("{{linspace: [{0}, {1}, 3]}}", "{{logspace: [{0}, {1}, 2]}}", "{{geometric: [{0}, {1}, 3]}}", "[{0}, {1}]"),
    *("{{uniform: [{0}, {1}]}}", "{{loguniform: [{0}, {1}]}}", "{{normal: [{0}, {1}]}}", "{{linspace: [0, 1, {0}]}}"),
    *("{{geometric: [1, 2, {0}]}}", "{{values: [{0}]}}", "{{center: [{0}, 0, {1}], distance: {1}}}", "{{width: {0}}}"),
    *("{{train: {0}, test: {1}}}", "{{time: {0}}}", "{{target_error: {0}, max_spp: {1}}}", "{{transmittance: [{0}]}}"),
]
"""What holds numbers."""
NUMBER = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e-?\d+)?(?![\w.])")
WORD = re.compile(r"[A-Za-z_][\w:]*")
VALUE = re.compile(r"(?<=: )[^\n#{\[&*|>]+")


def seeds() -> list[str]:
    """The configs that mistakes are put into, of few samples."""
    shipped = [path.read_text(encoding="utf-8") for path in sorted((ROOT / "configs").glob("*.yaml"))]
    template = (
        TEMPLATE.read_text(encoding="utf-8")
        .replace(NAME, "template")
        .replace(SCENE, "../usd_scenes/stages/cloud_block.usda")
    )
    small = [re.sub(r"draws: \d+", "draws: 8", text) for text in (*shipped, template)]
    return [RICH, *(text.replace("../usd_scenes/stages", str(STAGES)) for text in small)]


def replace_one(pattern: re.Pattern[str], text: str, by: str, rng: random.Random) -> str:
    found = [*pattern.finditer(text)]
    if not found:
        return text
    match = rng.choice(found)
    return text[: match.start()] + by + text[match.end() :]


def anything(rng: random.Random) -> str:
    """A value."""
    kind = rng.random()
    if kind < 0.4:
        return rng.choice(NUMBERS)
    if kind < 0.8:
        return rng.choice(WORDS)
    return rng.choice(SHAPES).format(rng.choice(NUMBERS), rng.choice(NUMBERS))


def replace_number(text: str, rng: random.Random) -> str:
    return replace_one(NUMBER, text, rng.choice(NUMBERS), rng)


def replace_value(text: str, rng: random.Random) -> str:
    return replace_one(VALUE, text, anything(rng), rng)


def replace_word(text: str, rng: random.Random) -> str:
    return replace_one(WORD, text, rng.choice([*WORDS, *WORD.findall(text)]), rng)


def flip_character(text: str, rng: random.Random) -> str:
    at = rng.randrange(len(text))
    return text[:at] + rng.choice("\0\t\n\"'#&*:[]{}|>%@!<,\x7f\x85é\ufeff\ud800 -?") + text[at + 1 :]


def delete_line(text: str, rng: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    del lines[rng.randrange(len(lines))]
    return "".join(lines)


def repeat_line(text: str, rng: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    at = rng.randrange(len(lines))
    return "".join([*lines[:at], lines[at], *lines[at:]])


def cut_off(text: str, rng: random.Random) -> str:
    return text[: rng.randrange(1, len(text))]


def multiply_aliases(text: str, rng: random.Random) -> str:
    depth, width = rng.randint(1, 12), rng.randint(2, 9)
    lines = ["a0: &a0 [1, 2]"]
    lines += [f"a{at}: &a{at} [{', '.join([f'*a{at - 1}'] * width)}]" for at in range(1, depth)]
    return "\n".join([*lines, text.replace("[", f"[*a{depth - 1}, ", 1) if rng.random() < 0.5 else text])


def nest(text: str, rng: random.Random) -> str:
    depth = rng.choice((5, 60, 400, 20_000))
    inner = rng.choice(("[" * depth + "]" * depth, "{a: " * depth + "}" * depth, "[" * depth))
    return replace_one(VALUE, text, inner, rng)


def alias_a_value(text: str, rng: random.Random) -> str:
    """Names one value and puts it in another's place."""
    anchored = replace_one(re.compile(r"(?<=: )(?=[\w\[{-])"), text, "&one ", rng)
    after = anchored.find("&one ") + 5
    return anchored[:after] + replace_one(VALUE, anchored[after:], "*one", rng)


def change_tree(text: str, rng: random.Random) -> str:
    """Moves, copies, removes or renames parts of the tree."""
    if text.startswith("a0: "):
        return text  # Whose tree has no end.
    try:
        tree = YAML(typ="safe").load(text)
        places = [*_places(tree)]
    except Exception:
        return text
    for _ in range(rng.randint(1, 3) if places else 0):
        parent, key = rng.choice(places)
        other, other_key = rng.choice(places)
        change = rng.randrange(5)
        try:
            if change == 0:
                del parent[key]
            elif change == 1:
                parent[key] = json.loads(json.dumps(other[other_key]))
            elif change == 2 and isinstance(parent, dict):
                parent[rng.choice([*parent, "target", "scene", "x" * 300, "a.b", ""])] = parent.pop(key)
            elif change == 3:
                parent[key] = [parent[key]] * rng.choice((1, 2, 40))
            else:
                parent[key] = {rng.choice(("values", "uniform", "linspace", "expression")): parent[key]}
        except (KeyError, IndexError, TypeError):
            continue
    out = io.StringIO()
    try:
        YAML(typ="safe").dump(tree, out)
    except (ValueError, RecursionError):
        return text  # Python writes no number so long, and no tree so deep.
    return out.getvalue()


def _places(node: Any) -> list[tuple[Any, Any]]:
    """Every container with each of its keys."""
    keys = list(node) if isinstance(node, dict) else list(range(len(node))) if isinstance(node, list) else []
    return [place for key in keys for place in ((node, key), *_places(node[key]))]


MUTATIONS: dict[Callable[[str, random.Random], str], int] = {
    replace_number: 8,
    replace_value: 8,
    change_tree: 6,
    replace_word: 4,
    alias_a_value: 3,
    delete_line: 2,
    multiply_aliases: 1,
    nest: 1,
    repeat_line: 1,
    flip_character: 1,
    cut_off: 1,
}
"""How often each is taken; those after which nothing can be parsed are rare."""


@dataclass(frozen=True)
class Mutant:
    """A config with mistakes.

    Args:
        text: of the file.
        overrides: what ``--set`` is given.
    """

    text: str
    overrides: tuple[str, ...]


def mutant(seed: int) -> Mutant:
    """A config with none to three mistakes, and none to two overrides; one at least of both."""
    rng = random.Random(seed)
    text = rng.choice(BASES) if rng.random() < 0.6 else RICH
    changes = rng.choice((0, 1, 1, 1, 2, 3))
    for _ in range(changes):
        (mutation,) = rng.choices([*MUTATIONS], [*MUTATIONS.values()])
        text = mutation(text, rng)
    count = rng.choice((1, 2)) if not changes else rng.choice((0, 0, 0, 1))
    overrides = [f"{rng.choice(KEYS)}={anything(rng)}" for _ in range(count)]
    return Mutant(text, tuple(override.replace("\0", "") for override in overrides))


BASES = seeds()


class Planner:
    """A process that plans configs one after the other."""

    def __init__(self) -> None:
        self._process = AnsweringProcess("tests.generators.fuzz_configs_process", seconds=TIME_LIMIT)

    def plan(self, folder: Path, mutated: Mutant) -> Outcome:
        """Plans in a folder of its own.

        Returns:
            ``planned``, ``refused``, or what must not be.
        """
        (folder / "config.yaml").write_bytes(mutated.text.encode("utf-8", "surrogatepass"))
        answer = self._process.ask(json.dumps([str(folder), mutated.overrides]))
        return answer if isinstance(answer, Outcome) else Outcome(**answer)

    def close(self) -> None:
        """Ends the process."""
        self._process.close()
