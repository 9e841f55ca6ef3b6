"""Start of worker processes: an interrupt neither leaves one half-started nor reaches the workers."""

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

__all__ = ["begin_apart", "context_of", "cores", "postponed"]

SIGNALS = {signal.SIGINT, signal.SIGTERM}


LONGEST = 70
"""Largest length of the path of the temporary folder, bytes, for ``forkserver``: names of its sockets add 32 bytes."""


def context_of(preloaded: Sequence[str]) -> Any:
    """The :mod:`multiprocessing` context for workers: ``forkserver`` with preloaded modules if possible, else spawn."""
    short = len(os.fsencode(tempfile.gettempdir())) <= LONGEST
    if not (short and "forkserver" in multiprocessing.get_all_start_methods()):
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(preloaded))
    return context


def cores() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextlib.contextmanager
def postponed() -> Iterator[None]:
    """Context manager that delays SIGINT and SIGTERM until it is left: a process is started whole or not at all."""
    signals: list[int] = []
    try:
        # Other threads receive signals, too, so that it is not enough to block them in this one.
        with noted(forward=False) as signals, _blocked():
            yield
    finally:
        if signals:
            signal.raise_signal(signals[0])


@contextlib.contextmanager
def _blocked() -> Iterator[None]:
    """Context in which SIGINT and SIGTERM are blocked for processes that are started, until :func:`begin_apart`."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # The tracker unblocks signals when it starts by itself: it is started before they are blocked.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def begin_apart() -> None:
    """Initialise signals in a worker process: ignore SIGINT, which its parent handles, and unblock both."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
