"""Distribution of cases to an executor in chunks, and collection of their results in order."""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from queue import SimpleQueue
from typing import Any

from ..errors import SceneError
from ..stopping import arrived
from .work import FAILED, NOT_RUN, SHORT, SOLVED, UNANSWERED, Job, Outcome, solve_chunk
from .workers import Workers

__all__ = ["chunk_of", "fed"]

CHUNKS, LARGEST = 256, 16
"""A sweep is cut into about so many chunks, of so many cases at most: few enough to cost nothing, and enough for all
who work to end at the same time."""

ROOM = 1024
"""Chunks that an executor has at once."""


def chunk_of(count: int) -> int:
    """Number of cases in a chunk, for a number of cases."""
    return min(max(count // CHUNKS, 1), LARGEST)


def fed(
    executor: Executor, job: Job, values: Sequence[Sequence[float]], size: int, progress: Callable[[int], object]
) -> tuple[list[Outcome], bool]:
    """Solve all cases: their results, and whether it was interrupted.

    Raises
    ------
    SceneError
        The answer of the first case that was solved does not have a quantity that is asked for.
    """
    feeding = _Feeding(executor, job, values, size, progress)
    interrupted = feeding.run()
    missing = Outcome(NOT_RUN, "interrupted before")
    return [outcome or missing for outcome in feeding.outcomes], interrupted


class _Feeding:
    """One sweep under way."""

    def __init__(
        self,
        executor: Executor,
        job: Job,
        values: Sequence[Sequence[float]],
        size: int,
        progress: Callable[[int], object],
    ) -> None:
        self.executor, self.values, self.progress = executor, values, progress
        self.data = pickle.dumps(job)
        self.room = executor.room if isinstance(executor, Workers) else ROOM
        count = len(values)
        self.waiting = deque(tuple(range(i, min(i + size, count))) for i in range(0, count, size))
        self.flying: dict[Future[list[Outcome]], tuple[int, ...]] = {}
        self.finished: SimpleQueue[Future[list[Outcome]]] = SimpleQueue()
        self.again: set[int] = set()
        self.outcomes: list[Outcome | None] = [None] * count
        self.answered = False

    def run(self) -> bool:
        """Run all cases; whether it was interrupted."""
        try:
            self._fill()
            while self.flying:
                self._take(self.finished.get())
                self._fill()
        except KeyboardInterrupt:
            arrived()
            self._rescue()
            return True
        finally:
            for future in self.flying:
                future.cancel()
        return False

    def _fill(self) -> None:
        while self.waiting and len(self.flying) < self.room:
            chunk = self.waiting.popleft()
            try:
                future = self.executor.submit(solve_chunk, self.data, [self.values[i] for i in chunk])
            except RuntimeError as error:
                # Broken, or shut down: it takes no more.
                self._record(chunk, [_lost(error, NOT_RUN)] * len(chunk))
                continue
            self.flying[future] = chunk
            future.add_done_callback(self.finished.put)

    def _take(self, future: Future[list[Outcome]]) -> None:
        chunk = self.flying.pop(future)
        if future.cancelled():
            self._record(chunk, [Outcome(NOT_RUN, "cancelled")] * len(chunk))
            return
        error = future.exception()
        if error is None:
            self._record(chunk, future.result())
        elif self._innocent(future, error):
            self.waiting.appendleft(chunk)
        elif not self.again.issuperset(chunk):
            # Once more, each by itself: whose fault it is shows then.
            self.again |= set(chunk)
            self.waiting.extendleft((i,) for i in reversed(chunk))
        else:
            self._record(chunk, [_lost(error, FAILED)])

    def _innocent(self, future: Future[Any], error: BaseException) -> bool:
        """Whether a process died that had it still to do."""
        broken = isinstance(error, BrokenExecutor) and isinstance(self.executor, Workers)
        return broken and not self.executor.guilty(future)  # type: ignore[attr-defined]

    def _record(self, chunk: tuple[int, ...], outcomes: Sequence[Outcome]) -> None:
        for i, outcome in zip(chunk, outcomes, strict=True):
            if outcome.status == UNANSWERED and not self.answered:
                raise SceneError(outcome.reason)
            self.answered = self.answered or outcome.status in (SOLVED, SHORT)
            self.outcomes[i] = outcome
        self.progress(len(chunk))

    def _rescue(self) -> None:
        """Keep what was ready when it was interrupted."""
        self.progress = lambda more: None
        for future, chunk in list(self.flying.items()):
            if future.done() and not future.cancelled() and future.exception() is None:
                self._record(chunk, future.result())


def _lost(error: BaseException, status: str) -> Outcome:
    if status == NOT_RUN:
        return Outcome(status, f"the executor takes no more work ({type(error).__name__}: {error})")
    if isinstance(error, BrokenExecutor):
        return Outcome(status, "the process that solved it died, twice")
    return Outcome(status, f"{type(error).__name__}: {error}")
