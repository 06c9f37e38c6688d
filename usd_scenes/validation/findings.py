"""What validators find, in the terms of USD and as plain values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pxr import Sdf, Usd, UsdValidation

from usd_scenes.reader.notes import VALUES

Severity = Literal["error", "warning", "info"]
SEVERITIES: dict[object, Severity] = {
    UsdValidation.ValidationErrorType.Error: "error",
    UsdValidation.ValidationErrorType.Warn: "warning",
    UsdValidation.ValidationErrorType.Info: "info",
}
ORDER: tuple[Severity, ...] = ("error", "warning", "info")
OURS = "usd_scenes.validation:"
REFUSED, OPEN_MESH, MENDED = "Refused", "OpenMediumMesh", "NotAsWritten"


@dataclass(frozen=True)
class Finding:
    """One thing that a validator found.

    Args:
        severity: ``error``, ``warning`` or ``info``.
        validator: of USD's validation, with the name of what it found: ``plugin:Validator.Error``.
        path: of the prim or property, ``/`` for the whole stage.
        text: what was found, and what is accepted or done.
        frames: for which it holds, such as "3:7, 9"; empty where it holds for all that were asked for.
    """

    severity: Severity
    validator: str
    path: str
    text: str
    frames: str = ""

    @classmethod
    def of(cls, found: UsdValidation.ValidationError, validator: str = "") -> Finding:
        """From the terms of USD.

        Args:
            found: the error.
            validator: ``plugin:Validator`` that found it; empty where USD ran it, and knows.
        """
        name = f"{validator}.{found.GetName()}" if validator else found.GetIdentifier()
        severity = SEVERITIES.get(found.GetType(), "error")
        # What a stage needs in order to be rendered is ours to say: USD's own rules are of assets that are passed on.
        if severity == "error" and not name.startswith(OURS):
            severity = "warning"
        path = next((_site_path(site) for site in found.GetSites()), "/")
        return cls(severity, name, path, " ".join(found.GetMessage().split()))

    @property
    def name(self) -> str:
        """The last name of what was found."""
        return self.validator.rsplit(".", maxsplit=1)[-1]

    @property
    def is_refusal(self) -> bool:
        """True for what the reader refuses."""
        return self.validator.startswith(OURS) and self.name in (REFUSED, OPEN_MESH)

    @property
    def prim_path(self) -> Sdf.Path:
        """Of the prim that it is about."""
        return Sdf.Path(self.path).GetPrimPath()

    def __str__(self) -> str:
        frames = f" (frames {self.frames})" if self.frames else ""
        return f"{self.severity}: {self.path}: {self.text}{frames}  [{self.validator}]"


def error(name: str, prim: Usd.Prim, text: str, path: Sdf.Path | None = None) -> UsdValidation.ValidationError:
    """An error of the prim, or of its property at `path`."""
    return _made(UsdValidation.ValidationErrorType.Error, name, prim, text, path)


def warning(name: str, prim: Usd.Prim, text: str, path: Sdf.Path | None = None) -> UsdValidation.ValidationError:
    """Something about the prim, or its property at `path`, that is accepted but hardly meant."""
    return _made(UsdValidation.ValidationErrorType.Warn, name, prim, text, path)


def info(name: str, prim: Usd.Prim, text: str) -> UsdValidation.ValidationError:
    """Something about the prim that is worth knowing."""
    return _made(UsdValidation.ValidationErrorType.Info, name, prim, text)


def refusal(name: str, stage: Usd.Stage, text: str) -> UsdValidation.ValidationError:
    """An error from a message of the reader, which begins with the path of a prim or property, or is of the stage."""
    prim, path, own = _placed(stage, text)
    return error(name, prim, own, path)


def mended(stage: Usd.Stage, text: str, path: str) -> UsdValidation.ValidationError:
    """A warning of the reader, of what is at `path`; where that is empty, the text may begin with a path."""
    joint = " " if text.startswith(VALUES) else ": "  # A value follows its attribute's path.
    prim, site, own = _placed(stage, f"{path}{joint}{text}" if path else text)
    return warning(MENDED, prim, own, site)


def _placed(stage: Usd.Stage, text: str) -> tuple[Usd.Prim, Sdf.Path | None, str]:
    """The prim that a message is about, what of it, and the message without that path."""
    head = text.split(" ", maxsplit=1)[0].rstrip(":")
    path = Sdf.Path(head) if head.startswith("/") and Sdf.Path.IsValidPathString(head) else Sdf.Path.absoluteRootPath
    prim = stage.GetPrimAtPath(path.GetPrimPath())
    if not prim or prim.IsPseudoRoot():
        return stage.GetPseudoRoot(), None, text
    own = text.removeprefix(f"{path}: ")
    return prim, path, own.replace(str(path), path.name, 1) if path.IsPropertyPath() else own


def _made(
    kind: object, name: str, prim: Usd.Prim, text: str, path: Sdf.Path | None = None
) -> UsdValidation.ValidationError:
    is_property = path is not None and path.IsPropertyPath() and prim.GetProperty(path.name)
    site = UsdValidation.ValidationErrorSite(prim.GetStage(), path if is_property else prim.GetPath())
    return UsdValidation.ValidationError(name, kind, [site], text)


def _site_path(site: UsdValidation.ValidationErrorSite) -> str:
    if site.IsProperty():
        return str(site.GetProperty().GetPath())
    return str(site.GetPrim().GetPath()) if site.IsPrim() else "/"
