"""Stages with mistakes in them, and a process of its own that renders them: a crash is then a finding, not the end."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

from pxr import Sdf, Tf

from tests.answering import AnsweringProcess, Outcome
from tests.usd.fuzz_stages import RICH, base_stages, write_pictures
from tests.usd.fuzz_texts import changed

CPU_LIMIT = 20
"""Seconds of the processor that one stage may take, with its validation, after which the process is ended."""
MEMORY_LIMIT = 2 << 30
"""Bytes that are in memory at once, with the renderer's own."""
OWN_MEMORY = 600 << 20
"""Of these, what the renderer has with any stage: USD by itself may take the rest."""
TIME_LIMIT = 300
"""Seconds by the clock after which a process that waits is ended."""
TEXT, BINARY, PACKAGE = ".usda", ".usdc", ".usdz"
KINDS = {TEXT: 8, BINARY: 1, PACKAGE: 1}
"""How often each kind of file is taken; mistakes of the latter two are in their bytes, at times in their text too."""
TRIES = 4
"""How often a stage is made anew that cannot be parsed; one in as many stays as it is."""
CLEAN = ("rendered", "refused", "read", "outside")
"""What may become of a stage."""


def write_mutant(seed: int, folder: Path) -> Path:
    """Writes a stage with one to three mistakes; the folder holds what `write_pictures` writes."""
    rng = random.Random(seed)
    (suffix,) = rng.choices([*KINDS], [*KINDS.values()])
    base = rng.choice(base_stages())
    mistakes = rng.choice((1, 1, 2, 3)) if suffix == TEXT else rng.choice((0, 0, 1))
    text = base
    for _ in range(TRIES):
        text = base
        for _ in range(mistakes):
            text = changed(text, rng)
        if _parsed(text) or rng.random() < 1 / TRIES:
            break
    path = folder / f"{seed}{suffix}"
    if suffix == TEXT:
        path.write_text(text, encoding="utf-8")
        return path
    layer = folder / f"layer{seed}.usdc"
    if not _exported(_parsed(text), layer):  # What can be parsed may still have no binary form.
        _exported(_parsed(base), layer)
    content = layer.read_bytes()
    if suffix == PACKAGE:
        with Sdf.ZipFileWriter.CreateNew(str(path)) as package:
            package.AddFile(str(layer), "stage.usdc")
            package.AddFile(str(folder / "sky.png"), "sky.png")
        content = path.read_bytes()
    layer.unlink()
    path.write_bytes(_damaged(content, rng))
    return path


def _parsed(text: str) -> Sdf.Layer | None:
    """None for what USD cannot parse."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    try:
        return layer if layer.ImportFromString(text) else None
    except Tf.ErrorException:
        return None


def _exported(layer: Sdf.Layer | None, path: Path) -> bool:
    try:
        return layer is not None and layer.Export(str(path))
    except Tf.ErrorException:
        return False


def _damaged(content: bytes, rng: random.Random) -> bytes:
    """Bytes changed, blocks of zeros or repeated, or the end cut off."""
    found = bytearray(content)
    for _ in range(rng.choice((1, 1, 3, 10))):
        # Tables are at the end of a binary stage and of a package, names and the version at the start.
        at = rng.choice(
            (rng.randrange(len(found)), rng.randrange(min(200, len(found))), len(found) - 1 - rng.randrange(200))
        )
        length = min(rng.choice((1, 1, 4, 64)), len(found) - at)
        kind = rng.choice(("random", "random", "zero", "full", "repeat", "cut"))
        if kind == "cut" and rng.random() < 0.2:
            del found[max(at, 300) :]
        elif kind == "repeat":
            found[at:at] = found[at : at + length]
        elif kind in ("zero", "full"):
            found[at : at + length] = (b"\0" if kind == "zero" else b"\xff") * length
        else:
            found[at : at + length] = rng.randbytes(length)
    return bytes(found)


class Renderer:
    """A process that renders stages one after the other with one kernel.

    Args:
        folder: for what it needs.
    """

    def __init__(self, folder: Path) -> None:
        write_pictures(folder)
        companion = folder / "rich.usda"
        companion.write_text(RICH)
        self._process = AnsweringProcess("tests.usd.fuzz_process", companion, seconds=TIME_LIMIT)

    def render(self, path: Path) -> Outcome:
        """Renders 8 by 8 pixels into a file beside the stage, and validates it.

        Returns:
            ``rendered``, ``refused``, ``read``, ``outside`` where the fault is of outside software that opens a damaged
            file, or what must not be.
        """
        answer = self._process.ask(str(path))
        outcome = answer if isinstance(answer, Outcome) else Outcome(**answer)
        if outcome.kind in CLEAN or path.suffix == TEXT or is_opened_by_usd(path):
            return outcome
        return Outcome("outside", outcome.kind)

    def close(self) -> None:
        """Ends the process."""
        self._process.close()


WALK = """
import resource, sys
from pxr import Tf, Usd
seconds, size = int(sys.argv[2]), int(sys.argv[3])
resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
resource.setrlimit(resource.RLIMIT_AS, (2 * size, 2 * size))
try:
    stage = Usd.Stage.Open(sys.argv[1])
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        for attribute in prim.GetAttributes():
            attribute.Get(Usd.TimeCode.EarliestTime())
except Tf.ErrorException:
    pass
sys.exit(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss > size)
"""


def is_opened_by_usd(path: Path) -> bool:
    """True where USD alone reads all of a file, or refuses it, within the bounds that hold for us."""
    command = [sys.executable, "-c", WALK, str(path), str(CPU_LIMIT), str(MEMORY_LIMIT - OWN_MEMORY)]
    try:
        return subprocess.run(command, capture_output=True, timeout=TIME_LIMIT, check=False).returncode == 0
    except subprocess.TimeoutExpired:
        return False
