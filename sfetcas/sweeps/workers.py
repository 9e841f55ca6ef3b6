"""Local processes as an executor that survives the death of any of them.

Where a process of an ordinary pool dies, the whole pool is broken, and it is unknown which task did it.  Here each
process is a pool of its own: only the task that it was at, its oldest one, is affected, and another process takes its
place.  Processes are never forks of this one, whose libraries have threads: a server process imports what is needed
once and forks itself (``forkserver``), where the system can; elsewhere each process imports for itself.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from multiprocessing.connection import Connection
from typing import Any, ParamSpec, TypeVar

from ..analyses import LATER
from ..errors import SceneError
from ..processes import begin_apart, context_of, postponed

__all__ = ["MOST_WORKERS", "Workers"]

P = ParamSpec("P")
T = TypeVar("T")

PRELOADED = ["sfetcas.sweeps.work", *LATER]

AHEAD = 2
"""Pieces of work that a process has at once: it does not wait for the next one."""

MOST_WORKERS = 10_000
"""Processes, or threads, at most."""


class _Lane:
    """One process, and the next one after it died."""

    def __init__(self, make: Callable[[], ProcessPoolExecutor]) -> None:
        self._make, self._pool, self._flying = make, make(), list[Future[Any]]()
        self._blamed = False
        self.culprits: set[Future[Any]] = set()

    @property
    def load(self) -> int:
        """Pieces of work that it has."""
        self._flying = [future for future in self._flying if not future.done()]
        return len(self._flying)

    def submit(self, function: Callable[..., T], *args: Any, **kwargs: Any) -> Future[T]:
        """Have a piece of work done."""
        with postponed():
            try:
                future = self._pool.submit(function, *args, **kwargs)
            except BrokenExecutor:
                self._pool.shutdown()
                self._pool, self._blamed = self._make(), False
                future = self._pool.submit(function, *args, **kwargs)
            self._flying.append(future)
        future.add_done_callback(self._done)
        return future

    def _done(self, future: Future[Any]) -> None:
        # What is lost is told in the order in which it was handed over: the process was at the first.
        lost = not future.cancelled() and isinstance(future.exception(), BrokenExecutor)
        if lost and not self._blamed:
            self._blamed = True
            self.culprits.add(future)

    def shutdown(self, wait: bool, cancel_futures: bool) -> None:
        """Let the process end."""
        self._pool.shutdown(wait, cancel_futures=cancel_futures)

    def kill(self) -> None:
        """End the process, whatever it is at."""
        for process in list((getattr(self._pool, "_processes", None) or {}).values()):
            process.kill()


class Workers(Executor):
    """An executor of local processes.

    Parameters
    ----------
    count : int
        Number of processes; started as they are needed.

    Raises
    ------
    SceneError
        They cannot start, as where a script starts them while it is imported.
    """

    def __init__(self, count: int) -> None:
        self._context = context_of(PRELOADED)
        self.room = AHEAD * count
        self._reader, self._writer = self._context.Pipe(duplex=False)
        self._lanes = [_Lane(self._pool) for _ in range(count)]
        try:
            with postponed():
                self._lanes[0].submit(_ready).result()
        except KeyboardInterrupt:
            self.kill()
            raise
        except BrokenExecutor:
            self.kill()
            accepted = "a call below if __name__ == '__main__': in a script that can be imported"
            raise SceneError(f"the processes of a sweep could not start, accepted: {accepted}") from None

    def _pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(1, self._context, initializer=_begin, initargs=(self._reader,))

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Submit a task to the process with the fewest tasks."""
        return min(self._lanes, key=lambda lane: lane.load).submit(fn, *args, **kwargs)

    def guilty(self, future: Future[Any]) -> bool:
        """Whether a process died at this task, not at another one that this task waited for."""
        return any(future in lane.culprits for lane in self._lanes)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all processes after their tasks."""
        for lane in self._lanes:
            lane.shutdown(wait, cancel_futures)
        if wait:
            self._writer.close()
            self._reader.close()

    def kill(self) -> None:
        """End all processes at once."""
        self._writer.close()
        for lane in self._lanes:
            lane.kill()
        self.shutdown(cancel_futures=True)


def _ready() -> None:
    """Nothing, by which is seen that processes start."""


def _begin(reader: Connection) -> None:
    """Leave interrupts to the process that started this one, and end with it."""
    begin_apart()
    threading.Thread(target=_end_with, args=(reader,), daemon=True).start()


def _end_with(reader: Connection) -> None:
    try:
        reader.recv_bytes()
    except (EOFError, OSError):
        os._exit(1)
