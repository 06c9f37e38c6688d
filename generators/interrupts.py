"""Ctrl-C, and the signals by which Slurm, Docker and a terminal that closes ask for the same."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
SAME_SECONDS = 0.3
"""After a signal, in which another is taken for the same one: shells and Slurm send some of them twice."""
IMPORT_SECONDS = 0.05
"""After which a signal is heard again that came while a library was imported."""
IMPORT_WAITS = 200
"""After so many it is heard in any case."""
SHOW_CURSOR = "\x1b[?25h"


def _is_importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


class _Listener:
    """What has come so far."""

    def __init__(self) -> None:
        self.came = self.waiting = False
        self.held_back = self.own = self.waits = 0

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handles a signal, in the main thread; all but the first are for `watch`."""
        if self.came and not self.waiting:
            return
        self.came = True
        self.waiting = _is_importing(frame) and self.waits < IMPORT_WAITS
        if self.waiting:
            self.waits += 1
            # Half a library would be left, and some print what they make of that.
            threading.Timer(IMPORT_SECONDS, self._again, [number]).start()
        elif not self.held_back:
            raise KeyboardInterrupt

    def _again(self, number: int) -> None:
        self.own += 1
        signal.raise_signal(number)

    def watch(self, pipe: int) -> None:
        """Ends the program with the second signal, also where the main thread compiles and hears none.

        Args:
            pipe: where the number of each signal comes from as it comes.
        """
        first = None
        while number := os.read(pipe, 1):
            if number[0] not in SIGNALS:
                continue
            if self.own:
                self.own -= 1
                continue
            now = time.monotonic()
            first = now if first is None else first
            if now - first > SAME_SECONDS:
                if sys.stderr.isatty():
                    os.write(2, SHOW_CURSOR.encode())  # a bar has hidden it
                os._exit(128 + number[0])
        os.close(pipe)


_listening: list[_Listener] = []


@contextmanager
def listening() -> Iterator[None]:
    """In it the first signal is a KeyboardInterrupt in the main thread, and the second ends the program at once.

    What was ignored when the program began, as under nohup, stays so. Outside the main thread, and within another such
    block, it does nothing.
    """
    if _listening or threading.current_thread() is not threading.main_thread():
        yield
        return
    listener = _Listener()
    _listening.append(listener)
    ours, theirs = os.pipe()
    os.set_blocking(theirs, False)
    threading.Thread(target=listener.watch, args=(ours,), daemon=True).start()
    heard = [number for number in SIGNALS if signal.getsignal(number) not in (signal.SIG_IGN, None)]
    before = {number: signal.signal(number, listener) for number in heard}
    wakeup = signal.set_wakeup_fd(theirs, warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(wakeup)
        for number, handler in before.items():
            signal.signal(number, handler)
        os.close(theirs)
        _listening.clear()


@contextmanager
def held_back() -> Iterator[None]:
    """The last work of a run, which a first signal does not cut off since there is nothing left to stop."""
    for listener in _listening:
        listener.held_back += 1
    try:
        yield
    finally:
        for listener in _listening:
            listener.held_back -= 1


@contextmanager
def unheard() -> Iterator[None]:
    """Processes that are started in it never hear these signals, which reach all of a group: who starts them ends them.

    From their first moment on, before they could say so themselves.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def handlers_kept() -> Iterator[None]:
    """Undoes what a library does to the handlers of these signals."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is not None:
                signal.signal(number, handler)
