"""FgfMediumAPI, the applied schema that makes a Material a fractional Gaussian field medium.

`schema.usda` is the source; `generatedSchema.usda` and `plugInfo.json` are made from it by
``python -m pxr.Usd.usdGenSchema schema.usda .`` in this folder, and are what USD reads. `shaderDefs.usda` says what the
Shader of the same name takes.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pxr import Plug, Sdr, Usd, UsdShade

from fgf_warp.errors import SceneError

SCHEMA_NAME = "FgfMediumAPI"
SHADER_NAME = "FgfMedium"
"""Of the Shader that stands for a medium in networks."""
FOLDER = Path(__file__).parent

MEDIUM_ATTRIBUTES: dict[str, str] = {
    "mean_extinction": "inputs:fgf:meanExtinction",
    "extinction_color": "inputs:fgf:extinctionColor",
    "albedo": "inputs:fgf:albedo",
    "asymmetry": "inputs:fgf:asymmetry",
    "phase_function": "fgf:phaseFunction",
    "back_asymmetry": "inputs:fgf:backAsymmetry",
    "back_weight": "inputs:fgf:backWeight",
    "draine_alpha": "inputs:fgf:draineAlpha",
    "hurst": "inputs:fgf:hurst",
    "white_noise_scale": "inputs:fgf:whiteNoiseScale",
    "outer_scale": "inputs:fgf:outerScale",
    "kappa": "inputs:fgf:kappa",
    "transport": "fgf:transport",
    "line_variance": "fgf:lineVariance",
    "priority": "fgf:priority",
}
"""Which attribute holds each field of `fgf_warp.scene.Medium`."""

BOUNDARY_ATTRIBUTE = "fgf:boundary"
BOUNDARIES = ("none", "surface")


def add_plugin() -> None:
    """Tells USD where FgfMediumAPI is; of no effect where it has read its schemas already."""
    Plug.Registry().RegisterPlugins(str(FOLDER))


def register() -> None:
    """Makes FgfMediumAPI known to USD; may be called any number of times.

    Raises:
        SceneError: where USD had read its schemas before `usd_scenes` was imported.
    """
    add_plugin()
    if Usd.SchemaRegistry().FindAppliedAPIPrimDefinition(SCHEMA_NAME) is None:
        raise SceneError(
            f"USD does not know {SCHEMA_NAME}: a stage was opened before usd_scenes was imported; import usd_scenes "
            f"first, or set PXR_PLUGINPATH_NAME to {FOLDER}"
        )


@cache
def register_shader() -> None:
    """Makes the Shader FgfMedium known to USD's registry of shaders, which validators look into."""
    path = str(FOLDER / "shaderDefs.usda")
    stage = Usd.Stage.Open(path)
    shader = UsdShade.Shader.Get(stage, f"/{SHADER_NAME}")
    for result in UsdShade.ShaderDefUtils.GetDiscoveryResults(shader, path):
        Sdr.Registry().AddDiscoveryResult(result)
