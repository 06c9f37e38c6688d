"""Mistakes in the text of a stage: each mutation makes one, at random."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from dataclasses import dataclass

from tests.usd.fuzz_prims import PRIMS, TARGETS, network, prim, target

NUMBERS = [
    "nan",
    "inf",
    "-inf",
    "0",
    "-1",
    "1.0000001",
    "1e38",
    "-1e38",
    "1e300",
    "1e-45",
    "2147483647",
    "-2147483648",
    "99999999999",
]
NUMBER = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e-?\d+)?(?![\w.])")
WORD = re.compile(r"[A-Za-z_][\w:]*")
HEAD = re.compile(r"^( *)(?:def|over|class)\b[^\n]*\n", re.MULTILINE)
"""The first line of a prim."""
NAMED = re.compile(r'(?<=def )(\w* ?)"(\w+)"')
VALUE = re.compile(r"^( *)(?!uniform )([\w\[\]]+) ([\w:]+) = ([^\n]*[^\n(\[{,])$", re.MULTILINE)
"""An attribute whose value is on one line."""
ATTRIBUTE = re.compile(r"(?<=[\w\]] )([A-Za-z][\w:]*)(?=(?:\.\w+)? = )")
ARRAY = re.compile(r"(?<== )\[([^\[\]\n]*)\]")
ELEMENT = re.compile(r"\([^()]*\)|<[^>]*>|\"[^\"]*\"|[^\s,()<>\"]+")
ASSET = re.compile(r"@[^@\n]*@")
PATH = re.compile(r"<[^>\n]*>")
TYPES = [
    "float",
    "double",
    "int",
    "bool",
    "string",
    "token",
    "asset",
    "color3f",
    "point3f[]",
    "int[]",
    "matrix4d",
    "half",
]
FILES = [
    "gone.usda",
    "broken.usda",
    "loop.usda",
    "good.usda",
    "sky.png",
    "folder.png",
    "empty.png",
    "text.png",
    "cut.png",
]
FILES += ["odd.exr", "gone.png", "", "..", "x" * 300 + ".usda", "日本.usda", "good.usda[inside.usda]", "anon:0x0:none"]
TIMES = ["nan", "inf", "-inf", "1e300", "-1e300", "1e-45", "-5", "0", "0.5", "1", "2", "2.0000000001", "1000000000000"]
NAMES = ["x" * 250, "x" * 300, "x" * 4000, "日本", "ünï", "Ωmega", "_", "__class__", "a1", "World", "Camera"]


def _choose(found: list[re.Match[str]], rng: random.Random) -> re.Match[str] | None:
    return rng.choice(found) if found else None


def _replace(text: str, match: re.Match[str] | None, by: str) -> str:
    return text if match is None else text[: match.start()] + by + text[match.end() :]


@dataclass(frozen=True)
class Block:
    """A prim in the text of a stage.

    Args:
        start: of its first line.
        end: after its last one.
        indent: that its lines begin with.
    """

    start: int
    end: int
    indent: str


def _blocks(text: str) -> list[Block]:
    found = []
    for head in HEAD.finditer(text):
        close = re.compile(rf"^{head[1]}\}}\n?", re.MULTILINE).search(text, head.end())
        if close:
            found.append(Block(head.start(), close.end(), head[1]))
    return found


def _inside(text: str, block: Block) -> int:
    """Where what is in the prim begins, after its brace."""
    found = re.compile(rf"^{block.indent}\{{\n", re.MULTILINE).search(text, block.start, block.end)
    return found.end() if found else block.end


def _path(text: str, at: int) -> str:
    """Of the prim that the place is in."""
    names = [
        NAMED.search(text, block.start, block.end) for block in _blocks(text) if _inside(text, block) <= at < block.end
    ]
    return "".join(f"/{name[2]}" for name in names if name)


def _insert(text: str, rng: random.Random, write: Callable[[str, str], str]) -> str:
    """Writes into a prim, or beside all: `write` takes the path of the prim and the indentation."""
    places = [*((_inside(text, block), block.indent + "    ") for block in _blocks(text)), (len(text), "")]
    at, indent = rng.choice(places)
    return f"{text[:at]}{write(_path(text, at), indent)}{text[at:]}"


# Characters and lines


def flip_byte(text: str, rng: random.Random) -> str:
    at = rng.randrange(len(text))
    return text[:at] + chr(rng.choice((0, 9, 34, 40, 64, 91, 123, 127, 233, rng.randrange(32, 127)))) + text[at + 1 :]


def swap_words(text: str, rng: random.Random) -> str:
    words = [*WORD.finditer(text)]
    if len(words) < 2:
        return text
    one, other = sorted(rng.sample(range(len(words)), 2))
    return _replace(_replace(text, words[other], words[one].group()), words[one], words[other].group())


def delete_line(text: str, rng: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    if len(lines) > 1:
        del lines[rng.randrange(1, len(lines))]
    return "".join(lines)


def repeat_line(text: str, rng: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    at = rng.randrange(len(lines))
    return "".join([*lines[:at], lines[at], *lines[at:]])


def drop_bracket(text: str, rng: random.Random) -> str:
    return _replace(text, _choose([*re.finditer(r"[\[\](){}<>\"@]", text)], rng), "")


def cut_off(text: str, rng: random.Random) -> str:
    return text[: rng.randrange(1, len(text) + 1)]


# Values


def replace_number(text: str, rng: random.Random) -> str:
    return _replace(text, _choose([*NUMBER.finditer(text, 10)], rng), rng.choice(NUMBERS))


def empty_array(text: str, rng: random.Random) -> str:
    return _replace(text, _choose([*ARRAY.finditer(text)], rng), "[]")


def shorten_array(text: str, rng: random.Random) -> str:
    found = _choose([*ARRAY.finditer(text)], rng)
    return _replace(text, found, f"[{', '.join(ELEMENT.findall(found[1])[:-1])}]" if found else "")


def lengthen_array(text: str, rng: random.Random) -> str:
    found = _choose([*ARRAY.finditer(text)], rng)
    elements = ELEMENT.findall(found[1]) if found else []
    more = elements[:1] * rng.choice((1, 2, 1000))
    return _replace(text, found, f"[{', '.join([*elements, *more])}]") if elements else text


def change_type(text: str, rng: random.Random) -> str:
    found = _choose([*re.finditer(r"(?<=\n)( *(?:uniform )?)\w+(?:\[\])?(?= [\w:]+(?: =|\.))", text)], rng)
    return _replace(text, found, f"{found.group(1) if found else ''}{rng.choice(TYPES)}")


def block_value(text: str, rng: random.Random) -> str:
    found = _choose([*VALUE.finditer(text)], rng)
    return _replace(text, found, f"{found[1]}{found[2]} {found[3]} = None" if found else "")


def sample_in_time(text: str, rng: random.Random) -> str:
    found = _choose([*VALUE.finditer(text)], rng)
    if found is None:
        return text
    samples = ", ".join(f"{time}: {found[4]}" for time in rng.sample(TIMES, rng.randrange(1, 5)))
    return _replace(text, found, f"{found[1]}{found[2]} {found[3]}.timeSamples = {{ {samples} }}")


def change_times(text: str, rng: random.Random) -> str:
    found = _choose([*re.finditer(r"(?<=\n)( *)-?[\d.]+(?=: )", text)], rng)
    return _replace(text, found, f"{found[1]}{rng.choice(TIMES)}" if found else "")


def change_interpolation(text: str, rng: random.Random) -> str:
    word = rng.choice(("constant", "uniform", "vertex", "varying", "faceVarying", "odd", ""))
    return _replace(text, _choose([*re.finditer(r'(?<=interpolation = ")\w+(?=")', text)], rng), word)


# Names, files and targets


def misspell(text: str, rng: random.Random) -> str:
    found = _choose([*ATTRIBUTE.finditer(text)], rng)
    if found is None:
        return text
    name = found[1]
    at = rng.randrange(len(name))
    by = (
        name.removeprefix("inputs:"),
        f"inputs:{name}",
        name[:at] + name[at + 1 :] or "x",
        name[:at] + name[at] + name[at:],
        name.swapcase(),
        name.lower(),
        "x" * 300 + name,
    )
    return _replace(text, found, rng.choice(by).strip(":") or "x")


def misplace_file(text: str, rng: random.Random) -> str:
    return _replace(text, _choose([*ASSET.finditer(text)], rng), f"@{rng.choice(FILES)}@")


def misplace_target(text: str, rng: random.Random) -> str:
    return _replace(
        text, _choose([*PATH.finditer(text)], rng), f"<{rng.choice((*TARGETS, '/', '..', '/World/World'))}>"
    )


def change_name(text: str, rng: random.Random) -> str:
    found = _choose([*NAMED.finditer(text)], rng)
    return _replace(text, found, f'{found[1]}"{rng.choice(NAMES)}"' if found else "")


def add_layer(text: str, rng: random.Random) -> str:
    return text.replace("(\n", f"(\n    subLayers = [@{rng.choice(FILES)}@]\n", 1)


# Prims


def change_prim(text: str, rng: random.Random) -> str:
    return _replace(text, _choose([*re.finditer(r"(?<=def )\w+", text)], rng), rng.choice([*PRIMS, "Nonsense"]))


def delete_prim(text: str, rng: random.Random) -> str:
    blocks = _blocks(text)
    block = rng.choice(blocks) if blocks else None
    return text if block is None else text[: block.start] + text[block.end :]


def repeat_prim(text: str, rng: random.Random) -> str:
    """Once more beside the first or somewhere else, with its own name or another one."""
    blocks = _blocks(text)
    if not blocks:
        return text
    block = rng.choice(blocks)
    copy = NAMED.sub(
        lambda name: f'{name[1]}"{name[2]}{rng.choice(("", "2", "2"))}"', text[block.start : block.end], count=1
    )
    at = rng.choice((block.end, *(_inside(text, other) for other in blocks)))
    return text[:at] + copy + text[at:]


def nest_prim(text: str, rng: random.Random) -> str:
    """Below many others."""
    blocks = _blocks(text)
    if not blocks:
        return text
    block, depth = rng.choice(blocks), rng.choice((3, 30, 300, 1000))
    parent = rng.choice(('def Xform "N"', 'def "N"', 'over "N"', 'def Scope "N"'))
    nested = f"{parent}\n{{\n" * depth + text[block.start : block.end] + "}\n" * depth
    return text[: block.start] + nested + text[block.end :]


def add_prim(text: str, rng: random.Random) -> str:
    return _insert(text, rng, lambda _, indent: prim(f"Added{rng.randrange(1000)}", rng, indent))


def add_network(text: str, rng: random.Random) -> str:
    return _insert(text, rng, lambda path, indent: network(path, rng, indent))


def add_arc(text: str, rng: random.Random) -> str:
    """A prim that is made of another one, which may be missing, itself or above it."""
    arc = rng.choice(("references", "payload", "inherits", "specializes", "references"))
    inside = rng.choice((*TARGETS, "/World/Looks", "/Good"))
    file = f"@{rng.choice(FILES)}@" if arc in ("references", "payload") else ""
    what = rng.choice((file or f"<{inside}>", f"{file}<{inside}>"))
    flags = rng.choice(("", "instanceable = true\n", 'apiSchemas = ["GoneAPI", "MeshLightAPI"]\n', "active = false\n"))
    kind = rng.choice(("", "Xform ", "Mesh ", "PointInstancer ", "Material "))
    name = f"Arc{rng.randrange(1000)}"
    return _insert(
        text, rng, lambda _, indent: f'{indent}def {kind}"{name}" (\n{flags}{arc} = {what}\n)\n{indent}{{\n{indent}}}\n'
    )


def add_relationship(text: str, rng: random.Random) -> str:
    name = rng.choice(
        ("material:binding", "prototypes", "camera", "products", "orderedVars", "light:filters", "proxyPrim")
    )
    return _insert(text, rng, lambda _, indent: f"{indent}rel {name} = {target(rng)}\n" if indent else "")


MUTATIONS: dict[Callable[[str, random.Random], str], int] = {
    replace_number: 10,
    shorten_array: 4,
    empty_array: 3,
    lengthen_array: 3,
    change_type: 2,
    block_value: 1,
    sample_in_time: 3,
    change_times: 1,
    change_interpolation: 2,
    misspell: 3,
    misplace_file: 2,
    misplace_target: 3,
    change_name: 1,
    add_layer: 1,
    change_prim: 3,
    delete_prim: 2,
    repeat_prim: 2,
    nest_prim: 1,
    add_prim: 5,
    add_network: 3,
    add_arc: 3,
    add_relationship: 2,
    swap_words: 2,
    delete_line: 3,
    repeat_line: 1,
    flip_byte: 1,
    drop_bracket: 1,
    cut_off: 1,
}
"""How often each is taken; those after which nothing can be parsed are rare."""


def changed(text: str, rng: random.Random) -> str:
    """The text with one mistake."""
    (mutation,) = rng.choices([*MUTATIONS], [*MUTATIONS.values()])
    return mutation(text, rng)
