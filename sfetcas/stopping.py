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
from types import FrameType

__all__ = ["COMMAND", "INTERRUPTED", "SENTENCE", "arrived", "asked", "heard", "leave_at_once", "noted"]

INTERRUPTED = 128 + signal.SIGINT
"""Exit code after Ctrl-C."""

SENTENCE = "sfetcas: interrupted; nothing was written"

AGAIN = 0.2
"""Seconds after which an interrupt is raised again that has not arrived."""


def _is_command() -> bool:
    """Whether this process is ``sfetcas`` or ``python -m sfetcas``, and none that these have started."""
    words = getattr(sys, "orig_argv", [])
    started = any(word == "--multiprocessing-fork" or word.startswith("from multiprocessing.") for word in words)
    if started or not sys.argv:
        return False
    if sys.argv[0] == "-m":
        # What is run is not known yet where its package is imported.
        return "-msfetcas" in words or ("-m", "sfetcas") in zip(words, words[1:])
    return os.path.basename(sys.argv[0]).removesuffix(".exe") == "sfetcas"


COMMAND = _is_command()
"""As the package is imported: later the name of what is run is another one."""


def leave_at_once() -> None:
    """Until :func:`heard`, end the process of the command on a signal: there is nothing yet to be put in order."""
    if not COMMAND or threading.current_thread() is not threading.main_thread():
        return
    for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)):
        # What is ignored, as in the background, stays so.
        if signal.getsignal(number) == usual:
            signal.signal(number, _leave)


def _leave(number: int, frame: FrameType | None) -> None:
    with contextlib.suppress(OSError):
        os.write(2, f"{SENTENCE}\n".encode())
    os._exit(128 + number)


class _Interrupts:
    """A handler that raises KeyboardInterrupt, in the command again and again until it has arrived.

    Libraries that call Python from C may take it for an exception of their own, and forget it.
    """

    first: int | None = None
    waiting = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        known, self.first = self.first is not None, self.first or number
        # Whoever ends a group of processes sends it twice to some: what puts things in order is not disturbed.
        if _on_its_way() or (known and not self.waiting and number != signal.SIGINT):
            return
        self.waiting = True
        if COMMAND and hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, AGAIN, AGAIN)
        raise KeyboardInterrupt

    def again(self, number: int, frame: FrameType | None) -> None:
        """The signal once more, which somebody may be noting."""
        if self.waiting and self.first is not None:
            signal.raise_signal(self.first)


_interrupts = _Interrupts()


def _on_its_way() -> bool:
    """Whether what runs now runs because of an interrupt."""
    error = sys.exc_info()[1]
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return error is not None


def asked() -> bool:
    """Whether there was an interrupt that has not arrived: whatever else happened may be because of it."""
    return _interrupts.waiting


def arrived() -> None:
    """An interrupt has come to where it is answered, and is not raised again."""
    _interrupts.waiting = False
    if COMMAND and hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.0)


@contextlib.contextmanager
def heard() -> Iterator[Callable[[int], int]]:
    """Within this SIGTERM raises KeyboardInterrupt, too; given is what makes the exit code of that of an interrupt."""
    if threading.current_thread() is not threading.main_thread():
        yield int
        return
    _interrupts.first, _interrupts.waiting = None, False

    def code(usual: int) -> int:
        return 128 + (_interrupts.first or signal.SIGINT) if usual == INTERRUPTED else usual

    numbers = (signal.SIGTERM, signal.SIGINT) if COMMAND else (signal.SIGTERM,)
    usual = (_leave, signal.SIG_DFL, signal.default_int_handler)
    before = {number: signal.getsignal(number) for number in numbers if signal.getsignal(number) in usual}
    for number in before:
        signal.signal(number, _interrupts)
    if COMMAND and hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _interrupts.again)
    try:
        yield code
    finally:
        arrived()
        for number, handler in before.items():
            # The command ends now, with all that it was to write: a signal adds nothing.
            signal.signal(number, signal.SIG_IGN if COMMAND else handler)


@contextlib.contextmanager
def noted(*, forward: bool) -> Iterator[list[int]]:
    """Signals that come meanwhile, where Python handles them, in any thread; ``forward``: they are handled as well."""
    found: list[int] = []
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    # Only the main thread may change them.
    if threading.current_thread() is not threading.main_thread():
        handlers = {}

    def note(number: int, frame: FrameType | None) -> None:
        found.append(number)
        before = handlers[signal.Signals(number)]
        if forward and callable(before):
            before(number, frame)

    handlers = {number: before for number, before in handlers.items() if callable(before)}
    for number in handlers:
        signal.signal(number, note)
    try:
        yield found
    finally:
        for number, before in handlers.items():
            signal.signal(number, before)


leave_at_once()
