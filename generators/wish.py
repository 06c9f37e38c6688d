"""What one can afford, as a preset: ``auto:1%`` or ``auto:5s``."""

from __future__ import annotations

import re
from dataclasses import dataclass

from fgf_warp.errors import ConfigError
from generators.wording import shortened

AUTO = "auto"
"""What such presets begin with."""
FORMS = "auto:ERROR or auto:TIME, such as auto:1%, auto:0.5%, auto:5s or auto:2min"

LENGTH_MAX = 40
"""Characters, so that the number in it is finite."""


@dataclass(frozen=True)
class Wish:
    """What one can afford: an error or a time.

    Args:
        text: as it was written.
        error: root of the mean square of the relative errors of blocks of 8 x 8 pixels, in (0, 1).
        time: wall time once the kernels are built, the pilot included [s], > 0.
    """

    text: str
    error: float | None = None
    time: float | None = None

    @classmethod
    def parse(cls, text: str) -> Wish:
        """Reads ``auto:1%``, ``auto:5s`` or ``auto:2min``.

        Raises:
            ConfigError: for anything else.
        """
        found = re.fullmatch(r"auto:(\d+(?:\.\d*)?|\.\d+)(%|s|min)", text)
        if not found or len(text) > LENGTH_MAX or float(found[1]) == 0:
            raise ConfigError(f"preset {shortened(text)}: accepted: {FORMS}")
        number = float(found[1])
        if found[2] != "%":
            return cls(text, time=number * (60 if found[2] == "min" else 1))
        if number >= 100:
            raise ConfigError(f"preset {text}: accepted: an error below 100 %, such as auto:1%")
        return cls(text, error=number / 100)
