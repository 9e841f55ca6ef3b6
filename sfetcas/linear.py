"""Sparse symmetric linear systems: solutions, and inertia by factorisation.

Small systems go to LAPACK, larger ones to the solvers that come with CasADi; the pattern is analysed once.
"""

from __future__ import annotations

import functools
from typing import Any

import casadi as ca
import numpy as np

from .arrays import Array
from .kernels import Batch

__all__ = ["InertiaSolver", "SparseMap", "SparseSolver", "pattern"]

DENSE = 150
"""Up to this size LAPACK on the full matrix is faster than a sparse factorisation (measured)."""


class SparseMap:
    """A constant matrix by its entries that are not zero; products with vectors by ``@``.

    Attributes
    ----------
    row, column, value : ndarray
        The entries, each place once, sorted by rows.
    shape : (int, int)
    """

    def __init__(self, row: Array, column: Array, value: Array, shape: tuple[int, int]) -> None:
        self.shape = shape
        places, inverse = np.unique(np.asarray(row, dtype=np.int64) * shape[1] + column, return_inverse=True)
        summed = np.bincount(inverse.ravel(), weights=value, minlength=len(places))
        keep = summed != 0.0
        self.row, self.column = (part.astype(np.intp) for part in np.divmod(places[keep], max(shape[1], 1)))
        self.value = summed[keep]
        # Small matrices are faster in full.
        self._full = self.full() if shape[0] * shape[1] <= FULL else None

    @functools.cached_property
    def T(self) -> SparseMap:  # noqa: N802 - the name of NumPy
        """The transpose."""
        return SparseMap(self.column, self.row, self.value, (self.shape[1], self.shape[0]))

    @functools.cached_property
    def absolute(self) -> SparseMap:
        """The matrix of the absolute values."""
        return SparseMap(self.row, self.column, np.abs(self.value), self.shape)

    def __matmul__(self, vector: Array) -> Array:
        if self._full is not None:
            return np.asarray(self._full @ vector)
        return np.bincount(self.row, weights=self.value * vector[self.column], minlength=self.shape[0])

    def full(self) -> Array:
        """The matrix with its zeros."""
        matrix = np.zeros(self.shape)
        matrix[self.row, self.column] = self.value
        return matrix

    def rows(self, chosen: Array) -> SparseMap:
        """The chosen rows, in their order."""
        chosen = np.asarray(chosen, dtype=np.intp)
        begin, end = np.searchsorted(self.row, chosen), np.searchsorted(self.row, chosen, side="right")
        taken = np.concatenate([np.zeros(0, np.intp), *(np.arange(a, b) for a, b in zip(begin, end, strict=True))])
        new = np.repeat(np.arange(len(chosen)), end - begin)
        return SparseMap(new, self.column[taken], self.value[taken], (len(chosen), self.shape[1]))


FULL = 20_000
"""Up to this many places the product with the full matrix is faster (measured)."""


class SparseSolver:
    """Solutions of ``A x = b`` for matrices of one pattern.

    Parameters
    ----------
    n : int
        Size of the matrix.
    row, column : ndarray
        Places of the entries, column by column.
    plugin : str
        Linear solver of CasADi for systems that are not small.
    """

    def __init__(self, n: int, row: Array, column: Array, plugin: str = "csparse") -> None:
        self.n = n
        self._places = row * n + column if n <= DENSE else None
        if self._places is None:
            self._sparsity = pattern(n, row, column)
            self._plugin = plugin
            if plugin == "mumps":
                self._solver = ca.Linsol("newton", plugin, self._sparsity)
                # A MUMPS that is never used prints when it is destroyed: its first memory is used once, on a
                # matrix that is easy; solutions take a second one.
                self._solver.nfact(ca.DM(self._sparsity, (row == column).astype(float)))

    def factor(self, entries: Array) -> None:
        """Take a matrix; it is factorised when it is solved with (CasADi does so at each call anyway)."""
        if self._places is not None:
            self._matrix: Any = np.zeros(self.n * self.n)
            self._matrix[self._places] = entries
            self._matrix = self._matrix.reshape(self.n, self.n)
        else:
            self._matrix = ca.DM(self._sparsity, entries) if self._plugin == "mumps" else entries

    def solve(self, b: Array) -> Array:
        """Solution for the matrix given last; b of shape (n,) or (n, k).

        Raises
        ------
        numpy.linalg.LinAlgError
            The matrix is singular.
        """
        if self._places is not None:
            return np.asarray(np.linalg.solve(self._matrix, b))
        try:
            if self._plugin == "mumps":
                return np.asarray(self._solver.solve(self._matrix, ca.DM(b)).full()).reshape(b.shape)
            batch = self._batch(1 if b.ndim == 1 else b.shape[1])
            batch.set(0, self._matrix)
            batch.set(1, b.T)
            return np.array(batch()[0].reshape(b.T.shape).T)
        except RuntimeError:
            raise np.linalg.LinAlgError("singular matrix") from None

    @functools.lru_cache(maxsize=4)  # noqa: B019 - lives as long as the solver
    def _batch(self, columns: int) -> Batch:
        """The solution as a function, which takes and gives arrays without copies."""
        entries, b = ca.MX.sym("entries", self._sparsity.nnz()), ca.MX.sym("b", self.n, columns)
        x = ca.densify(ca.solve(ca.MX(self._sparsity, entries), b, self._plugin))
        return Batch(ca.Function("solve", [entries, b], [x]), 1)


def pattern(n: int, row: Array, column: Array) -> ca.Sparsity:
    """Sparsity of a square matrix by the places of its entries, column by column."""
    return ca.Sparsity(n, n, np.searchsorted(column, np.arange(n + 1)).tolist(), row.tolist())


class InertiaSolver:
    """Factors that count negative eigenvalues of symmetric matrices of one pattern.

    All methods raise numpy.linalg.LinAlgError where the factorisation breaks down.
    """

    def __init__(self, name: str, sparsity: ca.Sparsity) -> None:
        self._solver = ca.Linsol(name, "ldl", sparsity)
        self._solver.sfact(ca.DM(sparsity, 1.0))

    def nfact(self, matrix: ca.DM) -> None:
        """Factorise a matrix."""
        try:
            self._solver.nfact(matrix)
        except RuntimeError:
            raise np.linalg.LinAlgError("no factors without pivots") from None

    def neig(self, matrix: ca.DM) -> int:
        """Number of negative eigenvalues of the matrix factorised last."""
        return int(self._solver.neig(matrix))

    def solve(self, matrix: ca.DM, b: ca.DM) -> ca.DM:
        """Solution for the matrix factorised last."""
        try:
            return self._solver.solve(matrix, b)
        except RuntimeError:
            raise np.linalg.LinAlgError("no factors without pivots") from None
