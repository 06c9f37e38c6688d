"""What an axis changes: the swept medium, the view, or anything else of the stage."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, cast

from generators.dataset.plan_table import INDEX, SEED, SPLIT
from generators.publishing import columns

Kind = Literal["medium", "frame", "camera", "scene", "orbit", "attribute", "variants"]
MEDIUM_FIELDS = {
    "H": "hurst",
    "g": "asymmetry",
    "S_w": "white_noise_scale",
    "sigma_m": "mean_extinction",
    "L": "outer_scale",
    "kappa": "kappa",
    "albedo": "albedo",
    "albedo_r": "albedo",
    "albedo_g": "albedo",
    "albedo_b": "albedo",
    "back_asymmetry": "back_asymmetry",
    "back_weight": "back_weight",
    "draine_alpha": "draine_alpha",
    "transport": "transport",
    "line_variance": "line_variance",
    "phase_function": "phase_function",
}
"""What each parameter of the swept medium is called in `fgf_warp.scene.Medium`."""
MEDIUM_NAMES = ("transport", "line_variance", "phase_function")
"""Those whose values are names."""
ORBIT_FIELDS = ("azimuth", "elevation", "distance")
VIEW_NAMES = ("frame", "camera", "scene")
KNOWN = (*MEDIUM_FIELDS, *VIEW_NAMES, *ORBIT_FIELDS)
"""Targets that are named by a word."""
UNITS = {
    "S_w": "unit^(-2-2H)",
    "sigma_m": "1/unit",
    "L": "unit",
    "azimuth": "degree",
    "elevation": "degree",
    "distance": "unit",
}
LABELS = ("regime", "b")
"""Columns of the plan that follow from the medium, beside those of `MEDIUM_FIELDS`."""
RESERVED = frozenset({INDEX, SPLIT, SEED, *LABELS, *columns.RESERVED})
"""Columns of a dataset that no axis may take."""
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""What a column may be called."""

_ATTRIBUTE = re.compile(r"(?P<prim>(?:/\w+)+)\.(?P<attribute>\w+(?::\w+)*)(?:\[(?P<component>\d)\])?")
_VARIANT = re.compile(r"(?P<prim>(?:/\w+)+)\{(?P<variants>\w+)\}")


@dataclass(frozen=True)
class Target:
    """What an axis changes.

    Args:
        kind: ``medium``, the swept one; ``frame``, ``camera``, ``scene``; ``orbit`` of the camera; ``attribute`` or
            ``variants`` of a prim.
        name: of the parameter, as in `KNOWN`, or of the attribute or variant set.
        prim: path of the prim, of the last two kinds.
        component: of the attribute; None where it is a single number.
    """

    kind: Kind
    name: str
    prim: str = ""
    component: int | None = None

    @property
    def has_names(self) -> bool:
        """True where its values are names, and no numbers."""
        return self.kind in ("camera", "scene", "variants") or (self.kind == "medium" and self.name in MEDIUM_NAMES)

    @property
    def unit(self) -> str:
        """Of its values; empty where there is none or it is not known."""
        return UNITS.get(self.name, "")

    def __str__(self) -> str:
        """As in a config."""
        if self.kind == "variants":
            return f"{self.prim}{{{self.name}}}"
        if self.kind == "attribute":
            return f"{self.prim}.{self.name}" + ("" if self.component is None else f"[{self.component}]")
        return self.name


def parse_target(text: str) -> Target | None:
    """The target that a text names; None where it names none."""
    if text in MEDIUM_FIELDS:
        return Target("medium", text)
    if text in ORBIT_FIELDS:
        return Target("orbit", text)
    if text in VIEW_NAMES:
        return Target(cast("Kind", text), text)
    if found := _ATTRIBUTE.fullmatch(text):
        component = found["component"]
        return Target("attribute", found["attribute"], found["prim"], None if component is None else int(component))
    if found := _VARIANT.fullmatch(text):
        return Target("variants", found["variants"], found["prim"])
    return None


def column_name(text: str) -> str:
    """The column of an axis that is called by its target: ``/World/Key.inputs:intensity`` has no place in one."""
    return re.sub(r"\W+", "_", text).strip("_") if text.startswith("/") else text
