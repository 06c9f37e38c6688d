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
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value)
    return value
