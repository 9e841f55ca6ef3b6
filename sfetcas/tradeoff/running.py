"""Work done in processes of their own, one at a time: nothing disturbs it, and it is ended where it takes long.

A server process imports what is needed once and makes a copy of itself for each piece of work (``forkserver``), where
the system can; elsewhere each imports for itself.
"""

from __future__ import annotations

from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from ..analyses import LATER
from ..processes import begin_apart, context_of, postponed

__all__ = ["Apart", "EndedError"]

PRELOADED = ["sfetcas.tradeoff.measuring", *LATER]


class EndedError(Exception):
    """The work was ended; or, without a number of seconds, its process died."""

    def __init__(self, seconds: float | None) -> None:
        super().__init__(f"took more than {seconds:g} s" if seconds is not None else "its process died")


class Apart:
    """Runs functions in fresh processes."""

    def __init__(self) -> None:
        self._context = context_of(PRELOADED)

    def __call__(self, longest: float, function: Callable[..., Any], *arguments: Any) -> Any:
        """What a function returns.

        Parameters
        ----------
        longest : float
            Seconds until it is ended.

        Raises
        ------
        EndedError
            It was ended, or died.
        """
        here, there = self._context.Pipe(duplex=False)
        process = self._context.Process(target=_work, args=(there, function, arguments), daemon=True)
        try:
            with postponed():
                process.start()
                there.close()
            if not here.poll(longest):
                raise EndedError(longest)
            return here.recv()
        except EOFError:
            raise EndedError(None) from None
        finally:
            if process.pid is not None:
                process.kill()
                process.join()
            # After that: nobody is there to write to what is closed.
            here.close()


def _work(there: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    begin_apart()
    there.send(function(*arguments))
    there.close()
