"""A process that answers lines: one that crashes or hangs is then a finding, and not the end of the tests."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from threading import Timer
from typing import Any

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Outcome:
    """What became of what a process was given.

    Args:
        kind: one word; ``crashed`` and ``hung`` are of a process that ended instead of answering.
        text: the message, the traceback, or how the process ended.
    """

    kind: str
    text: str = ""


class AnsweringProcess:
    """A process that is given lines and answers each with lines of JSON, started anew where it ended.

    Args:
        module: that it runs, which says one line when it is ready.
        arguments: of the module.
        seconds: by the clock, that it may take for one line, after which it is ended.
        ending: the signal that ends it then.
    """

    def __init__(self, module: str, *arguments: object, seconds: float, ending: int = signal.SIGKILL) -> None:
        self._command = [sys.executable, "-m", module, *map(str, arguments)]
        self._seconds = seconds
        self._ending = ending
        self._process: subprocess.Popen[str] | None = None

    def ask(self, line: str) -> Any:
        """Gives it a line; what it answers, or an Outcome where it ended."""
        if self._process is None:
            pipe = subprocess.PIPE
            self._process = subprocess.Popen(self._command, cwd=ROOT, text=True, stdin=pipe, stdout=pipe)
            self._process.stdout.readline()  # It is ready.
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()
        return self.go_on()

    def go_on(self) -> Any:
        """What it answers next to the same line, or an Outcome where it ended."""
        process = self._process
        timer = Timer(self._seconds, process.send_signal, (self._ending,))
        timer.start()
        answer = process.stdout.readline()
        is_late = not timer.is_alive()
        if answer:
            timer.cancel()
            return json.loads(answer)
        code = process.wait()
        timer.cancel()
        self.close()
        # SIGPROF ends one that has used up the time of the processor that it set itself.
        return Outcome("hung" if is_late or code == -signal.SIGPROF else "crashed", f"exit code {code}")

    def close(self) -> None:
        """Ends the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
