"""Calls timed several times; part of ``python -m benchmarks``."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

__all__ = ["least", "times"]

T = TypeVar("T")


def times(call: Callable[[], T], runs: int, longest: float = float("inf")) -> tuple[list[float], T]:
    """Wall times in seconds of so many calls after a first one, which is not counted, and what the last call gave.

    Parameters
    ----------
    call : callable
    runs : int
    longest : float
        Seconds after which no further call begins; one is always timed.
    """
    result = call()
    found: list[float] = []
    while len(found) < runs and (not found or sum(found) < longest):
        begin = time.perf_counter()
        result = call()
        found.append(time.perf_counter() - begin)
    return found, result


def least(call: Callable[[], T], runs: int) -> tuple[float, T]:
    """The least of the times in seconds of so many calls after a first one, and what the last call gave.

    Whatever else the machine does makes a call slower, never faster.
    """
    found, result = times(call, runs)
    return min(found), result
