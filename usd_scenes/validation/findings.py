"""What validators find, in the terms of USD and as plain values."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pxr import Sdf, Sdr, Usd, UsdShade, UsdValidation

from usd_scenes import schema
from usd_scenes.reader.diagnostics import open_stage, usd_errors_as_scene_errors

Severity = Literal["error", "warning", "info"]
SEVERITIES: dict[object, Severity] = {
    UsdValidation.ValidationErrorType.Error: "error",
    UsdValidation.ValidationErrorType.Warn: "warning",
    UsdValidation.ValidationErrorType.Info: "info",
}
ORDER: tuple[Severity, ...] = ("error", "warning", "info")
OF_THE_INSTALLATION = (
    "usdShadeValidators:ShaderSdrCompliance.MissingShaderIdInRegistry",
    "usdShadeValidators:ShaderSdrCompliance.MissingSourceTypeInRegistry",
)
"""What USD calls errors of the stage, though it only says that no such shader of another renderer is installed."""
OURS = "usd_scenes.validation:"
REFUSED, OPEN_MESH = "Refused", "OpenMediumMesh"
UNKNOWN_SHADER = "MissingShaderIdInRegistry"
"""What USD's validators call a shader that they do not know."""
MATERIALX_PREFIX = "ND_"
"""Of the shaders' identifiers that MaterialX defines."""


@dataclass(frozen=True)
class Finding:
    """One thing that a validator found.

    Args:
        severity: ``error``, ``warning`` or ``info``.
        validator: of USD's validation, with the name of what it found: ``plugin:Validator.Error``.
        path: of the prim or property, ``/`` for the whole stage.
        text: what was found, and what is accepted.
    """

    severity: Severity
    validator: str
    path: str
    text: str

    def __str__(self) -> str:
        return f"{self.severity}: {self.path}: {self.text}  [{self.validator}]"


def validate_stage(path: str | Path) -> tuple[Finding, ...]:
    """All that USD's validators and ours find in a file, errors first.

    Args:
        path: a .usd, .usda, .usdc or .usdz file.

    Raises:
        SceneError: where there is no such file, or it is none of USD.
    """
    schema.register()
    schema.register_shader()
    with usd_errors_as_scene_errors(str(path)):
        stage = open_stage(Path(path))
        validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
        errors = UsdValidation.ValidationContext(validators).Validate(stage)
        found = {_finding(error) for error in errors if not _is_of_materialx(error)}
    told = {_prim_path(finding) for finding in found if _is_ours(finding) and not _is_refusal(finding)}
    # What the reader refuses for a reason that another validator names is told once.
    kept = [finding for finding in found if not (_is_refusal(finding) and _prim_path(finding) in told)]
    return tuple(sorted(kept, key=lambda finding: (ORDER.index(finding.severity), finding.path, finding.text)))


def error(name: str, prim: Usd.Prim, text: str, path: Sdf.Path | None = None) -> UsdValidation.ValidationError:
    """An error of the prim, or of its property at `path`."""
    return _made(UsdValidation.ValidationErrorType.Error, name, prim, text, path)


def warning(name: str, prim: Usd.Prim, text: str) -> UsdValidation.ValidationError:
    """Something about the prim that is accepted but hardly meant."""
    return _made(UsdValidation.ValidationErrorType.Warn, name, prim, text)


def info(name: str, prim: Usd.Prim, text: str) -> UsdValidation.ValidationError:
    """Something about the prim that is worth knowing."""
    return _made(UsdValidation.ValidationErrorType.Info, name, prim, text)


def refusal(name: str, stage: Usd.Stage, text: str) -> UsdValidation.ValidationError:
    """An error from a message of the reader, which begins with the path of a prim or property, or is of the stage."""
    head = text.split(" ", maxsplit=1)[0].rstrip(":")
    path = Sdf.Path(head) if head.startswith("/") and Sdf.Path.IsValidPathString(head) else Sdf.Path.absoluteRootPath
    prim = stage.GetPrimAtPath(path.GetPrimPath())
    if not prim:
        return error(name, stage.GetPseudoRoot(), text)
    own = text.removeprefix(f"{path}: ")
    return error(name, prim, own.replace(str(path), path.name, 1) if path.IsPropertyPath() else own, path)


def _is_of_materialx(found: UsdValidation.ValidationError) -> bool:
    """True where a shader of MaterialX is unknown because this build of USD knows none of them."""
    if found.GetName() != UNKNOWN_SHADER or "mtlx" in Sdr.Registry().GetAllShaderNodeSourceTypes():
        return False
    prims = [site.GetProperty().GetPrim() if site.IsProperty() else site.GetPrim() for site in found.GetSites()]
    return all((UsdShade.Shader(prim).GetShaderId() or "").startswith(MATERIALX_PREFIX) for prim in prims)


def _made(
    kind: object, name: str, prim: Usd.Prim, text: str, path: Sdf.Path | None = None
) -> UsdValidation.ValidationError:
    is_property = path is not None and path.IsPropertyPath() and prim.GetProperty(path.name)
    site = UsdValidation.ValidationErrorSite(prim.GetStage(), path if is_property else prim.GetPath())
    return UsdValidation.ValidationError(name, kind, [site], text)


def _finding(found: UsdValidation.ValidationError) -> Finding:
    path = next((_site_path(site) for site in found.GetSites()), "/")
    severity = SEVERITIES.get(found.GetType(), "error")
    return Finding(
        severity="warning" if found.GetIdentifier() in OF_THE_INSTALLATION else severity,
        validator=found.GetIdentifier(),
        path=path,
        text=" ".join(found.GetMessage().split()),
    )


def _site_path(site: UsdValidation.ValidationErrorSite) -> str:
    if site.IsProperty():
        return str(site.GetProperty().GetPath())
    return str(site.GetPrim().GetPath()) if site.IsPrim() else "/"


def _prim_path(finding: Finding) -> Sdf.Path:
    return Sdf.Path(finding.path).GetPrimPath()


def _is_ours(finding: Finding) -> bool:
    return finding.severity == "error" and finding.validator.startswith(OURS)


def _is_refusal(finding: Finding) -> bool:
    return finding.validator in (f"{OURS}Scene.{REFUSED}", f"{OURS}Scene.{OPEN_MESH}")
