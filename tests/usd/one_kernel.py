"""One kernel for all scenes: what a scene does not need may be in its kernel, and changes no image."""

from dataclasses import fields
from typing import Any

from fgf_warp.features import RenderFeatures
from fgf_warp.scene import PHASE_FUNCTIONS
from fgf_warp.settings import Sampler

EVERY: dict[str, Any] = {
    "solids": frozenset({"sphere", "cube", "cylinder"}),
    "shaped_lights": frozenset({"rect", "disk", "sphere", "cylinder", "mesh"}),
    "phases": frozenset(PHASE_FUNCTIONS),
    "lone_law": "",
    "lone_solid": "",
    "aovs": frozenset(),
    "sampler": Sampler.LATTICE,
}
EVERYTHING = RenderFeatures(**{field.name: EVERY.get(field.name, True) for field in fields(RenderFeatures)})
"""All categories of scenes, with the settings' defaults and no further planes."""
