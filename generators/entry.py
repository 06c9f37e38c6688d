"""Where `fgf` begins: before anything is imported that takes a while."""

from __future__ import annotations

import signal


def main() -> None:
    """Entry point of the console script.

    Until `generators.interrupts` listens, Ctrl-C ends the program as other signals do, and says nothing of where in the
    imports it was.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from generators import cli  # noqa: PLC0415 - with typer

    cli.main()
