"""Constant sparse matrices as factors in CasADi expressions."""

from __future__ import annotations

import casadi as ca
import numpy as np

from .arrays import Array
from .linear import SparseMap, places_of

__all__ = ["added", "by_axes", "constant", "hanging", "mapped", "picked", "sparse", "times"]


def constant(matrix: SparseMap) -> ca.DM:
    """A :class:`.SparseMap` as a CasADi matrix."""
    order = np.lexsort((matrix.row, matrix.column))
    row, column = matrix.row[order], matrix.column[order]
    starts = np.searchsorted(column, np.arange(matrix.shape[1] + 1))
    return ca.DM(ca.Sparsity(*matrix.shape, starts.tolist(), row.tolist()), matrix.value[order])


def sparse(row: Array, column: Array, value: Array, shape: tuple[int, int]) -> ca.DM:
    """A sparse CasADi matrix from rows, columns and values (n,) of entries; repeated entries are added."""
    row, column = np.broadcast_arrays(np.asarray(row, np.intp), column)
    return constant(SparseMap(row.ravel(), column.ravel(), np.ravel(value), shape))


def mapped(matrix: ca.DM) -> SparseMap:
    """A CasADi matrix as a :class:`.SparseMap`."""
    return SparseMap(*places_of(matrix.sparsity()), np.array(matrix.nonzeros()), matrix.shape)


def by_axes(matrix: SparseMap, axes: int) -> SparseMap:
    """A matrix for scalars as one for vectors with ``axes`` components: its Kronecker product with the identity."""
    each = np.arange(axes)
    row, column = ((part[:, None] * axes + each).ravel() for part in (matrix.row, matrix.column))
    return SparseMap(row, column, np.repeat(matrix.value, axes), (matrix.shape[0] * axes, matrix.shape[1] * axes))


def times(matrix: ca.DM | SparseMap, vector: ca.MX) -> ca.MX:
    """Matrix times vector; a zero vector where the matrix has no entries."""
    return added((matrix, vector))


def added(*products: tuple[ca.DM | SparseMap, ca.MX]) -> ca.MX:
    """Sum of matrices times vectors; zeros where no matrix has an entry.

    Each operation takes CasADi as long as one with numbers takes thousands of them: those with nothing are left out.
    """
    total = None
    for matrix, vector in products:
        if len(matrix.row) if isinstance(matrix, SparseMap) else matrix.nnz():
            product = ca.mtimes(constant(matrix) if isinstance(matrix, SparseMap) else matrix, vector)
            total = product if total is None else total + product
    if total is None:
        matrix, vector = products[0]
        return ca.MX.zeros(matrix.shape[0], vector.size2())
    return ca.densify(total)


def picked(vector: ca.MX, entries: Array) -> ca.MX:
    """Entries of a column vector by their indices (n,), possibly none."""
    return vector[entries.tolist()] if len(entries) else ca.MX(0, 1)


def hanging(onto: ca.DM, matrix: ca.DM) -> ca.DM:
    """``onto^T matrix onto``: a matrix of positions as one of the displacements of places."""
    return ca.mtimes(onto.T, ca.mtimes(matrix, onto))
