"""Interrupts of the command: SIGTERM as Ctrl-C, with one sentence and the usual exit code, and no partial files left.

Importing this module, the first thing that the package does, handles signals for the time of all other imports if the
process is the command line; as a library of another program it leaves signals alone.
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
"""Time, s, after which an interrupt that was not answered is raised again."""


def _is_command() -> bool:
    """Whether this process is ``sfetcas`` or ``python -m sfetcas``, and none that these have started."""
    words = getattr(sys, "orig_argv", [])
    started = any(word == "--multiprocessing-fork" or word.startswith("from multiprocessing.") for word in words)
    if started or not sys.argv:
        return False
    if sys.argv[0] == "-m":
        # With -m, Python imports the package before it puts the name of the program into sys.argv.
        return "-msfetcas" in words or ("-m", "sfetcas") in zip(words, words[1:])
    return os.path.basename(sys.argv[0]).removesuffix(".exe") == "sfetcas"


COMMAND = _is_command()
"""Whether this process is the command line, decided at import: later ``sys.argv`` has another name in it."""


def leave_at_once() -> None:
    """Make SIGINT and SIGTERM end the command at once until :func:`heard`; does nothing in other processes or threads.

    The message goes to the standard error; the exit code is 128 plus the number of the signal.
    """
    if not COMMAND or threading.current_thread() is not threading.main_thread():
        return
    for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)):
        # Ignored signals, as in a background job, stay ignored.
        if signal.getsignal(number) == usual:
            signal.signal(number, _leave)


def _leave(number: int, frame: FrameType | None) -> None:
    with contextlib.suppress(OSError):
        os.write(2, f"{SENTENCE}\n".encode())
    os._exit(128 + number)


class _Interrupts:
    """A handler that raises KeyboardInterrupt, in the command again and again until :func:`arrived` is called.

    Libraries that call Python from C may take it for an exception of their own, and drop it.
    """

    first: int | None = None
    waiting = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        known, self.first = self.first is not None, self.first or number
        # Ending a process group may send the signal twice: clean-up after the first one is not interrupted.
        if _on_its_way() or (known and not self.waiting and number != signal.SIGINT):
            return
        self.waiting = True
        if COMMAND and hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, AGAIN, AGAIN)
        raise KeyboardInterrupt

    def again(self, number: int, frame: FrameType | None) -> None:
        """Handler of the timer: raise the first signal again, for whichever handler is set now."""
        if self.waiting and self.first is not None:
            signal.raise_signal(self.first)


_interrupts = _Interrupts()


def _on_its_way() -> bool:
    """Whether a KeyboardInterrupt is being handled now."""
    error = sys.exc_info()[1]
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return error is not None


def asked() -> bool:
    """Whether an interrupt was raised and not answered yet: other errors may be a consequence of it."""
    return _interrupts.waiting


def arrived() -> None:
    """Note that an interrupt is answered now, so that it is not raised again."""
    _interrupts.waiting = False
    if COMMAND and hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.0)


@contextlib.contextmanager
def heard() -> Iterator[Callable[[int], int]]:
    """Context in which SIGTERM raises KeyboardInterrupt as SIGINT does, in the main thread.

    It yields a function of the exit code: :data:`INTERRUPTED` becomes 128 plus the number of the first signal, other
    codes stay.
    """
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
    """Context that collects SIGINT and SIGTERM in a list as they come; with ``forward`` they are handled as well.

    Only signals with a handler of Python are caught, and only if the context is entered in the main thread.
    """
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
