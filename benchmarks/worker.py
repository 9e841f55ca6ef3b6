"""A process for solves that may take too long or end it."""

from __future__ import annotations

import multiprocessing
import os
import signal
from concurrent.futures import Future, ProcessPoolExecutor, TimeoutError
from concurrent.futures.process import BrokenProcessPool
from typing import Any

__all__ = ["Worker"]

START = 60.0
"""Seconds that a new process may take to import."""


class Worker:
    """A process that solves one thing at a time and is killed when that takes too long."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._begin()

    def _begin(self) -> None:
        self.pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))
        self.process = self.pool.submit(os.getpid).result(START)

    def ask(self, function: Any, *arguments: Any) -> tuple[Any, str]:
        """What a function gives, or nothing and what happened instead."""
        future: Future[Any] = self.pool.submit(function, *arguments)
        try:
            error = future.exception(self.seconds)
        except TimeoutError:
            os.kill(self.process, signal.SIGTERM)
            self.close()
            self._begin()
            return None, "too slow"
        if isinstance(error, BrokenProcessPool):
            self._begin()
            return None, "CRASH"
        # Whatever else was raised is a mistake of the library, and this tells where.
        return (future.result(), "") if error is None else (None, f"ERROR {type(error).__name__}: {error}")

    def close(self) -> None:
        """End the process."""
        self.pool.shutdown()
