"""Where the entries of Newton's matrix of a time step go, and how they are summed up."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array, Index

__all__ = ["Closed", "Entries", "Pattern"]


class Entries:
    """Places of entries of a matrix in full coordinates, and the matrix that sums them up in the unknowns."""

    def __init__(self, unknown: Index, weight: Array) -> None:
        self._unknown, self._weight = unknown, weight
        self._rows: list[Array] = []
        self._columns: list[Array] = []
        self.count = 0

    def add(self, rows: Array, columns: Array) -> None:
        """Places of the next entries, in the order of what will be given."""
        rows, columns = np.broadcast_arrays(rows, columns)
        self._rows.append(rows.ravel())
        self._columns.append(columns.ravel())
        self.count += rows.size

    @functools.cached_property
    def places(self) -> tuple[Index, Index, Array, Index]:
        """Row, column and weight in the unknowns, and which entry each is."""
        nothing = np.zeros(0, np.intp)
        rows = np.concatenate([nothing, *self._rows])
        columns = np.concatenate([nothing, *self._columns])
        # Held sides, of the ground too, have no unknown.
        r = np.where(rows < 0, -1, self._unknown[rows])
        c = np.where(columns < 0, -1, self._unknown[columns])
        keep = np.flatnonzero((r >= 0) & (c >= 0))
        return r[keep], c[keep], (self._weight[rows] * self._weight[columns])[keep], keep


@dataclass(frozen=True)
class Pattern:
    """Pattern of a matrix, how entries are summed up in it, and the order of its unknowns."""

    pattern: ca.Sparsity
    sums: ca.DM
    order: list[int]
    back: list[int]


@dataclass(frozen=True)
class Closed:
    """Entries of closing rows by rotations: where they go in full coordinates, and which of the spins each is."""

    row: Index
    cell: Index
    entry: Index
    value: Array
