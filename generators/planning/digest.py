"""Content in a form that tells whether it is the same."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from fgf_warp.scene import Image


def content_hash(content: Any) -> str:
    """Hexadecimal SHA-256 of what `canonical` gives, or of anything JSON-ready."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def canonical(value: Any) -> Any:
    """A JSON-ready form in which equal content is equal text; arrays by their hash."""
    if value is None or type(value) in (str, int, bool):
        return value
    if isinstance(value, np.ndarray):
        array = np.ascontiguousarray(value)
        return [str(array.dtype), array.shape, hashlib.sha256(array.tobytes()).hexdigest()]
    if is_dataclass(value):
        # Where the scene and its pictures were read from does not change a pixel.
        place = "name" if isinstance(value, Image) else "source"
        named = {field.name: canonical(getattr(value, field.name)) for field in fields(value) if field.name != place}
        return {"type": type(value).__name__, **named}
    if isinstance(value, Mapping):
        return {str(key): canonical(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [canonical(item) for item in value]
    return repr(value) if isinstance(value, float) and not math.isfinite(value) else value


class KeptHashes:
    """Hashes of dataclasses that share their larger fields, whose text is kept: a camera moves, the scene does not."""

    KEPT_MAX = 64

    def __init__(self) -> None:
        self._texts: dict[int, tuple[Any, str]] = {}

    def of(self, value: Any) -> str:
        """What ``content_hash(canonical(value))`` gives."""
        texts = {"type": json.dumps(type(value).__name__)}
        for field in fields(value):
            if field.name != "source":
                texts[field.name] = self._text(getattr(value, field.name))
        whole = ", ".join(f'"{name}": {text}' for name, text in sorted(texts.items()))
        return hashlib.sha256(f"{{{whole}}}".encode()).hexdigest()

    def _text(self, part: Any) -> str:
        kept = self._texts.get(id(part))
        if kept is not None and kept[0] is part:
            return kept[1]
        text = json.dumps(canonical(part), sort_keys=True)
        if len(self._texts) >= self.KEPT_MAX:
            self._texts.clear()
        self._texts[id(part)] = part, text
        return text
