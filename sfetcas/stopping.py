"""SIGTERM as Ctrl-C: one sentence and the usual exit code, nothing half-written, no temporary files left.

Also while the command still imports what it needs: the package asks for that before all else where it is the command
that runs, and leaves signals alone where it is a library of another program.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

__all__ = ["INTERRUPTED", "SENTENCE", "heard", "leave_at_once"]

INTERRUPTED = 128 + signal.SIGINT
"""Exit code after Ctrl-C."""

SENTENCE = "sfetcas: interrupted; nothing was written"


def leave_at_once() -> None:
    """Until :func:`heard`, end the process of the command on a signal: there is nothing yet to be put in order."""
    if not _is_command() or threading.current_thread() is not threading.main_thread():
        return
    for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)):
        # What is ignored, as in the background, stays so.
        if signal.getsignal(number) == usual:
            signal.signal(number, _leave)


@contextlib.contextmanager
def heard() -> Iterator[Callable[[int], int]]:
    """Within this SIGTERM raises KeyboardInterrupt, too; given is what makes the exit code of that of an interrupt."""
    signals: list[int] = []

    def interrupt(number: int, frame: Any) -> None:
        # Once: it is often sent twice, and the second one must not disturb what the first has put in order.
        signal.signal(number, signal.SIG_IGN)
        signals.append(number)
        raise KeyboardInterrupt

    def code(usual: int) -> int:
        return 128 + signals[0] if usual == INTERRUPTED and signals else usual

    if threading.current_thread() is not threading.main_thread():
        yield code
        return
    if signal.getsignal(signal.SIGINT) is _leave:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    before = signal.getsignal(signal.SIGTERM)
    before = signal.SIG_DFL if before is _leave else before
    if before == signal.SIG_DFL:
        signal.signal(signal.SIGTERM, interrupt)
    try:
        yield code
    finally:
        # The command ends now: a second signal adds nothing.
        signal.signal(signal.SIGTERM, signal.SIG_IGN if signals and _is_command() else before)


def _is_command() -> bool:
    """Whether this process is ``sfetcas`` or ``python -m sfetcas``, and none that these have started."""
    words = getattr(sys, "orig_argv", [])
    if "--multiprocessing-fork" in words or not sys.argv:
        return False
    if sys.argv[0] == "-m":
        # What is run is not known yet where its package is imported.
        return "-msfetcas" in words or ("-m", "sfetcas") in zip(words, words[1:])
    return os.path.basename(sys.argv[0]).removesuffix(".exe") == "sfetcas"


def _leave(number: int, frame: Any) -> None:
    os.write(2, f"{SENTENCE}\n".encode())
    os._exit(128 + number)


leave_at_once()
