"""Opens stages and turns what USD says about them into one-line errors and warnings."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pxr import Pcp, Tf, Usd

from fgf_warp.errors import FgfError, SceneError
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.listening import Heard, listening
from usd_scenes.reader.notes import Notes
from usd_scenes.reader.policy import OF_USD, text_of

STAGE_ADDRESS = re.compile(r"\s*\([^()]* on stage @.*$", re.DOTALL)
"""USD ends warnings with the stage's address in memory, which differs from run to run."""
PARSER_RULE = re.compile(r"parse error matching .* at (?=')")
"""USD may name the C++ type of the grammar rule that failed."""
UNKNOWN_FORMAT = re.compile(r"asset @(?P<asset>[^@]*)@ .* -- Cannot determine file format")
FROM_USD = "USD: "
"""What a warning of USD's own begins with."""
IN_PRIM = re.compile(r"^In <[^>]*>: ")
"""What USD puts before an error of a prim where it warns of it."""
MISSING = (Pcp.ErrorType_InvalidAssetPath, Pcp.ErrorType_InvalidSublayerPath, Pcp.ErrorType_UnresolvedPrimPath)
CYCLES = (Pcp.ErrorType_ArcCycle, Pcp.ErrorType_SublayerCycle)


@contextmanager
def usd_errors_as_scene_errors(source: str) -> Iterator[Heard]:
    """Keeps USD's messages off the terminal, and names `source` in front of every error.

    Args:
        source: the file, as the user wrote it.

    Yields:
        What USD warns of.

    Raises:
        FgfError: of the class that was raised inside, or SceneError for an error of USD.
    """
    with listening() as heard:
        try:
            yield heard
        except OF_USD as error:
            raise SceneError(_named(source, _first_line(text_of(error)))) from None
        except FgfError as error:
            raise type(error)(_named(source, str(error))) from error


def open_stage(path: Path) -> Usd.Stage:
    """The stage in a file.

    Raises:
        SceneError: where there is no such file or it is no USD file.
        Tf.ErrorException: where USD cannot parse it.
    """
    if not path.is_file():
        raise SceneError("no such file")
    if not Usd.Stage.IsSupportedFile(str(path)):
        raise SceneError("not a USD file; accepted: .usd, .usda, .usdc and .usdz")
    try:
        return Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        if len(error.args) == 1:  # Only "failed to open": no parser took it.
            raise SceneError("not a USD file, whatever its name ends with") from None
        raise


def leave_out_what_is_missing(context: StageContext) -> None:
    """Tells what the stage is composed without: references, payloads and layers that are missing or go in circles.

    Raises:
        SceneError: naming the prim and the asset of the first such error, where the stage is read strictly.
    """
    # A circle is the cause of much else that USD then reports.
    errors = sorted(
        context.stage.GetCompositionErrors(),
        key=lambda error: (error.errorType not in CYCLES, str(error.rootSite.path), str(error)),
    )
    for error in errors:
        context.mend(_found_and_done(error, context.stage), error.rootSite.path)


def note_warnings(heard: Heard, notes: Notes, stage: Usd.Stage) -> None:
    """Hands on what USD warned of, but for what `leave_out_what_is_missing` has told."""
    told = {_on_one_line(str(error)) for error in stage.GetCompositionErrors()}
    for warning in heard.warnings():
        text = _on_one_line(STAGE_ADDRESS.sub("", warning))
        if IN_PRIM.sub("", text) not in told:
            notes.add(f"{FROM_USD}{text}")


def _found_and_done(error: Pcp.ErrorBase, stage: Usd.Stage) -> str:
    text = _on_one_line(str(error))
    if unknown := UNKNOWN_FORMAT.search(text):
        return f"this USD cannot read {Path(unknown['asset']).name}; what it refers to is left out"
    if error.errorType in CYCLES:
        return f"{text.rstrip('. ')}; what closes the circle is left out"
    # The warning names the prim, and the file is the stage's own.
    text = text.replace(f" introduced by @{stage.GetRootLayer().identifier}@<{error.rootSite.path}>", "")
    done = "it is left out" if error.errorType in MISSING else "what is wrong is left out"
    return f"{text.removesuffix('; skipping.').rstrip('. ')}; {done}"


def _named(source: str, text: str) -> str:
    return text if source in text.split(": ", maxsplit=1)[0] else f"{source}: {text}"


def _first_line(text: str) -> str:
    return PARSER_RULE.sub("syntax error at ", text.strip().splitlines()[0])


def _on_one_line(text: str) -> str:
    return re.sub(r",@anon:[^@]*@", "", " ".join(text.split()))
