"""Finds all that is wrong with a stage, by USD's own validators and by those of FGF-Warp.

The latter are a plugin of USD's validation (`plugInfo.json`, keyword ``FgfValidators``): USD imports this module when
one of them is asked for. Other programs may run them too, with this folder and the schema's in PXR_PLUGINPATH_NAME.
"""

from __future__ import annotations

from collections.abc import Callable

from pxr import UsdValidation

from usd_scenes.validation.findings import Finding
from usd_scenes.validation.media import check_binding, check_terminals, check_values
from usd_scenes.validation.run import Asked, Validation, validate_stage
from usd_scenes.validation.scene import check_scene

__all__ = ["Asked", "Finding", "Validation", "validate_stage"]

PRIM_VALIDATORS = {
    "MediumBinding": check_binding,
    "MediumTerminals": check_terminals,
    "MediumValues": check_values,
}


def _at_start(check: Callable[[object], list[UsdValidation.ValidationError]]) -> Callable[..., object]:
    """As USD calls validators: with the times that it is asked about, all of them where it is not."""
    return lambda checked, _times: check(checked)


def _register() -> None:
    registry = UsdValidation.ValidationRegistry()
    for name, check in PRIM_VALIDATORS.items():
        registry.RegisterPluginPrimValidator(f"{__name__}:{name}", _at_start(check))
    registry.RegisterPluginStageValidator(f"{__name__}:Scene", _at_start(check_scene))


_register()
