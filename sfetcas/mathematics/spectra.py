"""Eigenvalues of large operators that are largest in size, by block Krylov spaces.

Applied to the inverse of a shifted pencil these are the eigenvalues of the pencil that are nearest to the shift.

Source: Golub and Van Loan, Matrix Computations, chapter 10; Ericsson and Ruhe 1980 (shift and invert).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .arrays import TINY, Array, Index

__all__ = ["Operator", "Pick", "largest"]

Operator = Callable[[Array], Array]
"""Takes a block of columns (n, k) to another."""

Pick = Callable[[Array], tuple[Index, bool]]
"""Takes eigenvalues to the numbers of those that are meant, and whether these are enough."""

EIGENPAIR = 1e-11
"""Residual of an eigenpair over its eigenvalue."""

SYMMETRIC = 1e-8
"""As :data:`EIGENPAIR` for operators that are symmetric, or of two symmetric matrices: the eigenvalue error is its
square."""

NOTHING_TO_GAIN = 1e-14
"""Residual over the largest eigenvalue at which rounding prevents further progress."""

STALLED = 4
"""Blocks after which a residual that has not become smaller by half is that of rounding, if it is small at all."""

SMALL = 1e-5
"""What small is, over the eigenvalue."""

DROPPED = 1e-11
"""What is left of a column by orthogonalisation, over the column, below which it is rounding."""

MOST = 320
"""Columns of a space at most."""

LEAST_BLOCKS = 12
"""Blocks of a space at least, before it is given up."""

LEAST_BLOCK = 8
"""Columns of a block at least: so often an eigenvalue may repeat and is still found so often."""


def largest(
    apply: Operator,
    size: int,
    wanted: int,
    inner: Operator | None = None,
    pick: Pick | None = None,
    *,
    symmetric: bool = False,
) -> tuple[Array, Array]:
    """Eigenvalues of an operator that are largest in size, falling, and their vectors as columns.

    Parameters
    ----------
    apply : callable
        The operator.
    size : int
        Length of a column.
    wanted : int
        How many; fewer are found where the operator has a smaller rank.
    inner : callable, optional
        Multiplies by the matrix of an inner product in which the operator is symmetric; the vectors are then real and
        orthonormal in it.  Left out: the operator is not symmetric, eigenvalues may be complex.
    pick : callable, optional
        Estimates of eigenvalues, falling -> indices of those that are wanted instead of the largest.
    symmetric : bool
        Without an inner product: whether the operator divides one symmetric matrix by another, as linear buckling does.

    Raises
    ------
    numpy.linalg.LinAlgError
        The operator gives no finite numbers, or no eigenvalues were found.
    """
    start = np.random.default_rng(0).standard_normal((size, min(size, max(LEAST_BLOCK, wanted))))
    space = _Space(size, inner)
    block, limit = space.orthonormal(apply(start)), EIGENPAIR if inner is None and not symmetric else SYMMETRIC
    most = max(MOST, LEAST_BLOCKS * block.shape[1])
    course: list[float] = []

    def first(values: Array) -> tuple[Index, bool]:
        return np.arange(min(wanted, len(values))), len(values) >= wanted

    while True:
        space.extend(block, apply(block))
        values, vectors, residuals, enough = space.pairs(pick or first)
        sizes = np.abs(values)
        shares = residuals / np.maximum(sizes, TINY)
        good = (shares <= limit) | (residuals <= NOTHING_TO_GAIN * sizes.max(initial=0.0))
        course.append(float(shares.max(initial=0.0)))
        stalled = course[-1] <= SMALL and course[-1] > 0.5 * min(course[:-STALLED], default=np.inf)
        block = space.orthonormal(space.images[:, -block.shape[1] :])
        if not block.shape[1] or (enough and (stalled or bool(good.all()))):
            return values, vectors
        if space.columns.shape[1] > most:
            # What has not come out by now is one of a crowd.
            good |= shares <= SMALL
            if not good.any():
                raise np.linalg.LinAlgError("no eigenvalues found")
            return values[good], vectors[:, good]


class _Space:
    """Orthonormal columns, and what the operator makes of them."""

    def __init__(self, size: int, inner: Operator | None) -> None:
        self._inner = inner
        self.columns, self.weighted, self.images = (np.zeros((size, 0)) for _ in range(3))

    def _times(self, block: Array) -> Array:
        return block if self._inner is None else self._inner(block)

    def orthonormal(self, block: Array) -> Array:
        """The part of a block across the columns so far, orthonormal; what is rounding is left out."""
        if not np.isfinite(block).all():
            raise np.linalg.LinAlgError("no finite eigenvectors")
        most = self.columns.shape[0] - self.columns.shape[1]
        new, weighted = np.zeros((len(block), 0)), np.zeros((len(block), 0))
        largest = max((self._norm(column) for column in block.T), default=0.0)
        for column in block.T:
            rest = column.copy()
            for _ in range(2):
                rest = rest - self.columns @ (self.weighted.T @ rest)
                rest = rest - new @ (weighted.T @ rest)
            norm = self._norm(rest)
            if norm > DROPPED * largest and new.shape[1] < most:
                rest /= norm
                new = np.column_stack([new, rest])
                weighted = np.column_stack([weighted, self._times(rest[:, None])])
        return new

    def _norm(self, column: Array) -> float:
        return float(np.sqrt(max(float(column @ self._times(column[:, None])[:, 0]), 0.0)))

    def extend(self, block: Array, images: Array) -> None:
        """Take further columns."""
        self.columns = np.hstack([self.columns, block])
        self.weighted = np.hstack([self.weighted, self._times(block)])
        self.images = np.hstack([self.images, images])

    def pairs(self, pick: Pick) -> tuple[Array, Array, Array, bool]:
        """Picked eigenvalues on the space, their vectors, lengths of their residuals, and whether they are enough."""
        small = self.weighted.T @ self.images
        if self._inner is not None:
            values, turn = np.linalg.eigh(0.5 * (small + small.T))
        else:
            values, turn = np.linalg.eig(small)
        order = np.argsort(-np.abs(values), kind="stable")
        picked, enough = pick(values[order])
        order = order[picked]
        values, turn = values[order], turn[:, order]
        vectors = self.columns @ turn
        left = self.images @ turn - vectors * values
        sizes = np.einsum("ni,ni->i", left.conj(), self._times(left)).real
        return values, vectors, np.sqrt(np.maximum(sizes, 0.0)), enough
