"""Content in a form that tells whether it is the same."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from fgf_warp.scene import Image, Scene

PLAIN = (str, int, float)
"""Written here, since a union of types would be made anew for each of the many numbers."""


def content_hash(content: Any) -> str:
    """Hexadecimal SHA-256 of what `canonical` gives, or of anything JSON-ready."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def canonical(value: Any, array: Callable[[np.ndarray], Any] | None = None) -> Any:
    """A JSON-ready form in which equal content is equal text; arrays by what `array` gives, else by their hash.

    Returns:
        Dictionaries with the name of the type, lists, texts and numbers; a float that is not finite is a text.
    """
    if value is None or isinstance(value, PLAIN):
        return repr(value) if isinstance(value, float) and not math.isfinite(value) else value
    if isinstance(value, np.ndarray):
        return (array or canonical_array)(value)
    if isinstance(value, tuple | list):
        return [canonical(item, array) for item in value]
    if is_dataclass(value):
        # Where the scene and its pictures were read from does not change a pixel.
        place = "name" if isinstance(value, Image) else "source"
        names = [field.name for field in fields(value) if field.name != place]
        return {"type": type(value).__name__, **{name: canonical(getattr(value, name), array) for name in names}}
    if isinstance(value, Mapping):
        return {str(key): canonical(item, array) for key, item in value.items()}
    return value


def canonical_array(array: np.ndarray) -> list[Any]:
    """Type, shape and hash of an array.

    Returns:
        Name of the type, shape, and SHA-256 in hexadecimal of its bytes.
    """
    array = np.ascontiguousarray(array)
    return [str(array.dtype), array.shape, hashlib.sha256(array.tobytes()).hexdigest()]


class KeptHashes:
    """Hashes of scenes that share their larger parts, of which what was found is kept: cameras and lights change."""

    KEPT_MAX = 64

    def __init__(self) -> None:
        self._found: dict[int, tuple[Any, Any]] = {}

    def of(self, scene: Scene) -> str:
        """What ``content_hash(canonical(scene))`` gives."""
        texts = {"type": json.dumps(type(scene).__name__)}
        for field in fields(scene):
            if field.name != "source":
                texts[field.name] = self._kept(getattr(scene, field.name), self._text)
        whole = ", ".join(f'"{name}": {text}' for name, text in sorted(texts.items()))
        return hashlib.sha256(f"{{{whole}}}".encode()).hexdigest()

    def _text(self, part: Any) -> str:
        if isinstance(part, tuple):
            return f"[{', '.join(self._kept(item, self._text) for item in part)}]"
        return json.dumps(canonical(part, lambda array: self._kept(array, canonical_array)), sort_keys=True)

    def _kept(self, part: Any, find: Callable[[Any], Any]) -> Any:
        # What is asked for comes last, so that the first one has not been asked for for the longest time.
        kept = self._found.pop(id(part), None)
        if kept is None or kept[0] is not part:
            kept = part, find(part)
        self._found[id(part)] = kept
        if len(self._found) > self.KEPT_MAX:
            del self._found[next(iter(self._found))]
        return kept[1]
