"""YAML, read with bounds: what is too large is told before it is made, and an alias is a copy of what it names.

An alias that shared its value with other places would change them too when one is overridden, so every place gets a
value of its own, without an anchor. Aliases can multiply, which is why nodes are counted as they are expanded.
"""

from __future__ import annotations

import copy
import re
import unicodedata
import warnings
from collections.abc import Iterator
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.constructor import RoundTripConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from generators.wording import one_line

TEXT_MAX = 2**18
"""Characters: the parser reads 50,000 in a second."""
NODES_MAX = 100_000
"""Keys and values, each alias counted as what it stands for."""
DEPTH_MAX = 50
"""Of what is in each other; a config needs 5."""
NUMBER_LENGTH_MAX = 100
"""Characters of a number, so that each fits a double, or is infinite as written."""

TOO_DEEP = re.compile(rf"(?:\[\s*){{{DEPTH_MAX + 1}}}")
"""Told before parsing: of every bracket the parser looks through all that are open."""

TAG = "tag:yaml.org,2002:"
MERGE = f"{TAG}merge"
NUMBERS = (f"{TAG}int", f"{TAG}float")
PLAIN = (*NUMBERS, *(f"{TAG}{kind}" for kind in ("str", "bool", "null", "map", "seq", "timestamp")))
SHOWN_LENGTH = 60
"""Characters of a value in a message."""

OTHER_ERRORS = (ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError)
"""What the parser raises beside its own errors, of a character or a number that there is not."""

Pairs = list[tuple[Node, Node]]


class YamlTextError(ValueError):
    """What is wrong with a text.

    Args:
        problem: in one line.
        line: from 1 on; None where it is not known.
    """

    def __init__(self, problem: str, line: int | None = None) -> None:
        super().__init__(one_line(problem))
        self.line = line


def parse_yaml(text: str) -> Any:
    """The document in a text, with its comments.

    Returns:
        Mappings and sequences of ruamel.yaml, which know their lines.

    Raises:
        YamlTextError: where it is not valid YAML, or beyond a bound.
    """
    if len(text) > TEXT_MAX:
        raise YamlTextError(f"is {len(text)} characters long; accepted: at most {TEXT_MAX}")
    if found := TOO_DEEP.search(text):
        line = text.count("\n", 0, found.start()) + 1
        raise YamlTextError(f"is nested too deep; accepted: at most {DEPTH_MAX} levels", line)
    yaml = YAML()
    yaml.Constructor = _TreeConstructor
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # An anchor may be used again: the later one holds from there on.
        try:
            return yaml.load(text)
        except MarkedYAMLError as error:
            mark = error.problem_mark
            raise YamlTextError(f"not valid YAML: {error.problem}", mark.line + 1 if mark else None) from error
        except YAMLError as error:
            raise YamlTextError(f"not valid YAML: {error}") from error
        except RecursionError as error:
            raise YamlTextError(f"is nested too deep; accepted: at most {DEPTH_MAX} levels") from error
        except YamlTextError:
            raise
        except OTHER_ERRORS as error:
            raise YamlTextError(f"not valid YAML: {error}", yaml.reader.line + 1) from error


class _TreeConstructor(RoundTripConstructor):
    """Makes the document of the tree that `_Expansion` makes."""

    def get_single_data(self) -> Any:
        """None of an empty text."""
        node = self.composer.get_single_node()
        if node is None:
            return None
        tree = _Expansion().expand(node)
        try:
            return self.construct_document(tree)
        except OTHER_ERRORS as error:
            raise _unreadable(tree, error) from error


class _Expansion:
    """Makes a tree of a graph of nodes, of which it knows beforehand how large it will be."""

    def __init__(self) -> None:
        self._sizes = dict[int, int]()
        self._seen = set[int]()

    def expand(self, node: Node, depth: int = 1) -> Node:
        """A copy without anchors, aliases and merge keys; comments stay where something is first."""
        self._measure(node)
        if depth > DEPTH_MAX:
            raise YamlTextError(f"is nested too deep; accepted: at most {DEPTH_MAX} levels", _line(node))
        if node.tag not in PLAIN:
            found = str(node.tag).replace(TAG, "!!")
            raise YamlTextError(f"found the tag {found}; accepted: values without", _line(node))
        plain = copy.copy(node)
        plain.anchor = None
        if id(node) in self._seen:
            plain.comment = None
        self._seen.add(id(node))
        if isinstance(node, MappingNode):
            plain.value = self._expand_pairs(node, depth)
        elif isinstance(node, SequenceNode):
            plain.value = [self.expand(item, depth + 1) for item in node.value]
        elif isinstance(node, ScalarNode):
            _check_scalar(node)
        return plain

    def _measure(self, node: Node) -> int:
        """Nodes of what it stands for; each is looked at once, since an alias names what comes before it."""
        size = self._sizes.get(id(node))
        if size == 0:
            raise YamlTextError(f"*{node.anchor} is part of itself; accepted: an alias of another place", _line(node))
        if size is None:
            self._sizes[id(node)] = 0  # Until it is known: a part that asks for it is around itself.
            size = 1 + sum(self._measure(part) for part in _parts(node))
            self._sizes[id(node)] = size
        if size > NODES_MAX:
            problem = f"has {size} keys and values, aliases counted as what they stand for"
            raise YamlTextError(f"{problem}; accepted: at most {NODES_MAX}", _line(node))
        return size

    def _expand_pairs(self, node: MappingNode, depth: int) -> Pairs:
        own: Pairs = []
        merged: Pairs = []
        for key, value in node.value:
            if key.tag == MERGE:
                merged.extend(self._merged(value, depth))
                continue
            if not isinstance(key, ScalarNode) or key.tag != f"{TAG}str":
                found = repr(key.value)[:SHOWN_LENGTH] if isinstance(key, ScalarNode) else "more than a word"
                raise YamlTextError(f"found {found} as a key; accepted: a word, else in quotes", _line(key))
            own.append((self.expand(key, depth + 1), self.expand(value, depth + 1)))
        taken = {key.value for key, _ in own}
        for key, value in merged:
            if key.value not in taken:
                taken.add(key.value)
                own.append((key, value))
        return own

    def _merged(self, value: Node, depth: int) -> Pairs:
        """What ``<<`` brings in; of several mappings the earlier ones come first."""
        parts = value.value if isinstance(value, SequenceNode) else [value]
        if not all(isinstance(part, MappingNode) for part in parts):
            raise YamlTextError("found no mapping after <<; accepted: a mapping, or a list of them", _line(value))
        return [pair for part in parts for pair in self.expand(part, depth + 1).value]


def _check_scalar(node: ScalarNode) -> None:
    text = node.value
    if node.tag in NUMBERS and len(text) > NUMBER_LENGTH_MAX:
        problem = f"found {text[:SHOWN_LENGTH]}..., a number of {len(text)} characters"
        raise YamlTextError(f"{problem}; accepted: at most {NUMBER_LENGTH_MAX}", _line(node))
    for char in text:
        if not char.isprintable() and char not in "\t\n" and unicodedata.category(char) in ("Cc", "Cs"):
            problem = f"found the character U+{ord(char):04X} in {text[:SHOWN_LENGTH]!r}"
            raise YamlTextError(f"{problem}; accepted: text without control characters", _line(node))


def _unreadable(tree: Node, error: Exception) -> YamlTextError:
    """Which scalar it was: what Python says of a number or a date that is none has no line."""
    for node in _scalars(tree):
        try:
            YAML().constructor.construct_document(node)
        except OTHER_ERRORS:
            found = node.value[:SHOWN_LENGTH]
            return YamlTextError(f"not valid YAML: {found!r} is no {str(node.tag).removeprefix(TAG)}", _line(node))
    return YamlTextError(f"not valid YAML: {error}")


def _scalars(node: Node) -> Iterator[ScalarNode]:
    if isinstance(node, ScalarNode):
        yield node
    for part in _parts(node):
        yield from _scalars(part)


def _parts(node: Node) -> list[Node]:
    """Keys and values of a mapping, items of a sequence."""
    if isinstance(node, MappingNode):
        return [part for pair in node.value for part in pair]
    return list(node.value) if isinstance(node, SequenceNode) else []


def _line(node: Node) -> int:
    return int(node.start_mark.line) + 1
