"""Runs USD's validators and ours on a file, frame by frame, and tells each thing once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

from pxr import Sdr, Usd, UsdGeom, UsdShade, UsdValidation

from usd_scenes import schema
from usd_scenes.reader.diagnostics import note_warnings, open_stage, usd_errors_as_scene_errors
from usd_scenes.reader.frames import Frame, kind_of, name_of
from usd_scenes.reader.notes import Notes
from usd_scenes.reader.policy import OF_USD
from usd_scenes.reader.readings import StageReading
from usd_scenes.reader.stage import survey_stage
from usd_scenes.validation.findings import MENDED, ORDER, OURS, Finding
from usd_scenes.validation.media import check_binding, check_terminals, check_values
from usd_scenes.validation.scene import check_survey

UNKNOWN_SHADER = "MissingShaderIdInRegistry"
"""What USD's validators call a shader that they do not know."""
MATERIALX_PREFIX = "ND_"
"""Of the shaders' identifiers that MaterialX defines."""
TOLD_BY_THE_READER = "usdValidation:CompositionErrorTest."
"""The reader goes through the same list of USD's, and says what becomes of each."""
MISSING_ASSET = "usdUtilsValidators:MissingReferenceValidator."
MISSING_TARGET = "usdShadeValidators:MaterialBindingCollectionValidator."
IN_OTHER_WORDS = {
    "MissingSurface": "material without a surface",
    "NothingToFill": "is not supported and is left out",
    "ShadowedMedium": "the medium is never seen",
    "UnappliedSchema": "applied make no medium",
}
"""What our validators find, and how the reader warns of the same prim for the same reason."""

Progress = Callable[[str, int, int], None]
"""Is told what is done next, how many steps are done and of how many."""


@dataclass(frozen=True)
class Validation:
    """What there is to say about a stage.

    Args:
        findings: errors first.
        reading: what the stage came to at the first frame; None where it is refused.
    """

    findings: tuple[Finding, ...]
    reading: StageReading | None


@dataclass(frozen=True)
class Asked:
    """What changes what is read of a stage; as for `read_scene`."""

    camera: str | None = None
    purposes: Sequence[str] | None = None
    strict: bool = False


def validate_stage(
    path: str | Path,
    frames: Sequence[Frame | None] = (None,),
    asked: Asked | None = None,
    progress: Progress | None = None,
) -> Validation:
    """All that USD's validators and ours find in a file.

    Args:
        path: a .usd, .usda, .usdc or .usdz file.
        frames: at least one; None is where the stage starts. USD's own validators look at no frame.
        asked: what is to be read; None is what is read where nothing is asked for.
        progress: see `Progress`.

    Returns:
        Each thing once, with the frames that it holds for; errors before warnings, and of one severity by path.

    Raises:
        SceneError: where there is no such file, it is none of USD, or what is asked for is not there.
    """
    schema.register()
    schema.register_shader()
    with usd_errors_as_scene_errors(str(path)) as heard:
        stage = open_stage(Path(path))
        of_opening = Notes()
        note_warnings(heard, of_opening, stage)
        by_plugin = _validators_of_usd()
        steps = [*by_plugin, *(name_of(frame) for frame in frames)]

        def show(step: str) -> None:
            if progress is not None:
                progress(step, steps.index(step), len(steps))

        of_usd: list[Finding] = []
        for name, validators in by_plugin.items():
            show(name)
            of_usd += _run(validators, stage)
        collected = _Collected(frames)
        reading = None
        for index, frame in enumerate(frames):
            show(name_of(frame))
            survey = survey_stage(stage, frame, **vars(asked or Asked()))
            survey = replace(survey, warnings=(*of_opening.entries(), *survey.warnings))
            reading = survey.reading if index == 0 else reading
            found = [
                *_of_media(stage, frame),
                *(Finding.of(error, f"{OURS}Scene") for error in check_survey(stage, survey)),
            ]
            collected.add(index, _once(found))
    ours = collected.findings()
    kept = {finding for finding in of_usd if not _is_told(finding, ours)}
    return Validation(tuple(sorted([*kept, *ours], key=_place)), reading)


class _Collected:
    """What is found at each frame, each thing once; of texts that differ in numbers alone the first stands for all."""

    def __init__(self, frames: Sequence[Frame | None]) -> None:
        self._frames = frames
        self._found: dict[object, tuple[Finding, dict[int, None]]] = {}

    def add(self, index: int, findings: Iterable[Finding]) -> None:
        """Adds what is found at the frame of that index."""
        for finding in findings:
            key = replace(finding, text=finding.text if len(self._frames) == 1 else kind_of(finding.text))
            _, held = self._found.setdefault(key, (finding, {}))
            held[index] = None

    def findings(self) -> list[Finding]:
        """All, with the frames that they hold for."""
        return [
            finding if len(held) == len(self._frames) else replace(finding, frames=self._spelled([*held]))
            for finding, held in self._found.values()
        ]

    def _spelled(self, indices: list[int]) -> str:
        runs = [[index for _, index in run] for _, run in groupby(enumerate(indices), lambda pair: pair[1] - pair[0])]
        return ", ".join(
            name_of(self._frames[run[0]], "")
            if len(run) == 1
            else f"{name_of(self._frames[run[0]], '')} to {name_of(self._frames[run[-1]], '')}"
            for run in runs
        )


def _validators_of_usd() -> dict[str, list[UsdValidation.Validator]]:
    """Those that are not ours, by the plugin that they are of."""
    found: dict[str, list[UsdValidation.Validator]] = {}
    for validator in UsdValidation.ValidationRegistry().GetOrLoadAllValidators():
        name = validator.GetMetadata().name
        if not name.startswith(OURS):
            found.setdefault(name.split(":")[0], []).append(validator)
    return found


def _run(validators: list[UsdValidation.Validator], stage: Usd.Stage) -> list[Finding]:
    try:
        found = UsdValidation.ValidationContext(validators).Validate(stage)
    except OF_USD:
        if len(validators) == 1:
            # As where a layer is damaged that the stage does without: the reader names it.
            return [
                Finding(
                    "warning",
                    validators[0].GetMetadata().name,
                    "/",
                    "fails on this stage, of which a layer may be damaged",
                )
            ]
        return [finding for validator in validators for finding in _run([validator], stage)]
    return [Finding.of(error) for error in found if not _is_of_materialx(error)]


def _of_media(stage: Usd.Stage, frame: Frame | None) -> Iterator[Finding]:
    for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()):
        checks: list[tuple[str, Callable[..., list[UsdValidation.ValidationError]]]] = []
        if prim.IsA(UsdShade.Material):
            checks = [("MediumValues", check_values), ("MediumTerminals", check_terminals)]
        elif prim.IsA(UsdGeom.Gprim):
            checks = [("MediumBinding", check_binding)]
        for name, check in checks:
            yield from (Finding.of(error, f"{OURS}{name}") for error in check(prim, frame))


def _once(found: Sequence[Finding]) -> Iterator[Finding]:
    """Without what the reader tells of for a reason that another validator names."""
    told = {finding.prim_path for finding in found if finding.severity == "error" and not finding.is_refusal}
    words = {(finding.prim_path, IN_OTHER_WORDS.get(finding.name)) for finding in found}
    for finding in found:
        is_repeated = finding.name == MENDED and any(
            of == finding.prim_path and reason and reason in finding.text for of, reason in words
        )
        if not is_repeated and not (finding.is_refusal and finding.prim_path in told):
            yield finding


def _is_told(finding: Finding, ours: Sequence[Finding]) -> bool:
    """True for what the reader tells of too, with what becomes of it."""
    if finding.validator.startswith(MISSING_ASSET):
        asset = Path(finding.text.rstrip(".").strip("'").rsplit("'", maxsplit=1)[-1].replace("\\", "/")).name
        return any(asset in other.text for other in ours)
    if finding.validator.startswith(MISSING_TARGET):
        return any(other.path == finding.path for other in ours)
    return finding.validator.startswith(TOLD_BY_THE_READER)


def _is_of_materialx(found: UsdValidation.ValidationError) -> bool:
    """True where a shader of MaterialX is unknown because this build of USD knows none of them."""
    if found.GetName() != UNKNOWN_SHADER or "mtlx" in Sdr.Registry().GetAllShaderNodeSourceTypes():
        return False
    prims = [site.GetProperty().GetPrim() if site.IsProperty() else site.GetPrim() for site in found.GetSites()]
    return all((UsdShade.Shader(prim).GetShaderId() or "").startswith(MATERIALX_PREFIX) for prim in prims)


def _place(finding: Finding) -> tuple[int, str, str]:
    return ORDER.index(finding.severity), finding.path, finding.text
