"""Processes that are started by this one: whole or not at all, and interrupts are not theirs."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import tempfile
from collections.abc import Iterator, Sequence
from multiprocessing import resource_tracker
from typing import Any

from .stopping import noted

__all__ = ["begin_apart", "context_of", "postponed"]

SIGNALS = {signal.SIGINT, signal.SIGTERM}


LONGEST = 70
"""Bytes of the folder for temporary files, so that with 32 more a socket may have its name, on any system."""


def context_of(preloaded: Sequence[str]) -> Any:
    """How processes are started: by a server that has imported some modules, where the system can (``forkserver``)."""
    short = len(os.fsencode(tempfile.gettempdir())) <= LONGEST
    if not (short and "forkserver" in multiprocessing.get_all_start_methods()):
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(preloaded))
    return context


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
