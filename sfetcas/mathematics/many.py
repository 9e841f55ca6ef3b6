"""Functions of vectors for many vectors at once: by the core where it can, without the lock of the interpreter."""

from __future__ import annotations

import ctypes

import casadi as ca
import numpy as np

from .arrays import Array
from .core import core, doubles, table_of
from .kernels import Direct
from .tapes import tape_of

__all__ = ["Many"]


class Many:
    """A function of column vectors with one result, evaluated for many rows of arguments.

    Parameters
    ----------
    function : Function
        Each argument and the result are dense columns.
    """

    def __init__(self, function: ca.Function) -> None:
        self._single, self._library = Direct(function), core()
        self.results = int(function.numel_out(0))
        tape = tape_of(function) if self._library is not None else None
        self._tape = None if tape is None else table_of(tape)

    def __call__(self, *arguments: Array) -> Array:
        """Results (n, results) for arguments, each (n, numbers)."""
        count = len(arguments[0])
        found = np.empty((count, self.results))
        if not count:
            return found
        if self._library is None or self._tape is None:
            for i, row in enumerate(zip(*arguments, strict=True)):
                found[i] = self._single(*row)
            return found
        given = doubles(np.concatenate(arguments, axis=1))
        address = ctypes.addressof(self._tape[0])
        work = np.empty(self._library.sf_tape_work(address))
        self._library.sf_run(address, count, given.ctypes.data, found.ctypes.data, work.ctypes.data)
        return found
