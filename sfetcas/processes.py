"""Processes that are started by this one: whole or not at all, and interrupts are not theirs."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from multiprocessing import resource_tracker

from .stopping import noted

__all__ = ["begin_apart", "postponed"]

SIGNALS = {signal.SIGINT, signal.SIGTERM}


@contextlib.contextmanager
def postponed() -> Iterator[None]:
    """Within this signals wait: a process is started whole, or not at all."""
    signals: list[int] = []
    try:
        # Other threads take them, too, so that it is not enough to block them in this one.
        with noted(forward=False) as signals, _blocked():
            yield
    finally:
        if signals:
            signal.raise_signal(signals[0])


@contextlib.contextmanager
def _blocked() -> Iterator[None]:
    """For what is started meanwhile, until :func:`begin_apart`."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # Where this starts by itself, it lets signals through.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def begin_apart() -> None:
    """In a process that another one started: interrupts are for that one to see, and what was postponed there ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
