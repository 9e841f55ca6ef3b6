"""How often a call is timed, and what is kept of the times; part of ``python -m benchmarks``."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import TypeVar

__all__ = ["median", "times"]

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


def median(call: Callable[[], T], runs: int) -> tuple[float, T]:
    """The median of the times in seconds of so many calls after a first one, and what the last call gave."""
    found, result = times(call, runs)
    return statistics.median(found), result
