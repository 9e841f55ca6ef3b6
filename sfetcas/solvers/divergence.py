"""Where the static tangent under loads without potential becomes singular: divergence.

Such loads make the Newton matrix H unsymmetric.  With A the derivative of the closings, N a basis of the null space
of A and M a weight, the eigenvalues mu of ``N^T H N x = mu N^T M N x`` may be complex; the tangent is singular where
one of them is zero.  Along a path a real one does so by changing its sign, and two at once where a symmetry makes
them equal: then the determinant keeps its sign, while the number of eigenvalues with a negative real part changes by
two.  A complex pair whose real part changes its sign leaves the tangent regular.

At a zero another equilibrium is adjacent (static divergence); nothing else follows for stability: flutter does not
show in these numbers.

Source: Bolotin 1963, Nonconservative problems of the theory of elastic stability.
"""

from __future__ import annotations

import numpy as np

from .. import tolerances
from ..mathematics.arrays import Array
from ..mechanics.equations import Equations, Point
from .redundancy import independent
from .stability import ENTRIES_BLUR, LIGHT, Inertia, Stability

__all__ = ["TangentTest"]

ON_THE_AXIS = 1e-6
"""Imaginary parts that count as zero where the real part vanishes, dimensionless: eigenvalues are of size one."""


class TangentTest:
    """Eigenvalues of the unsymmetric tangent on the closings, for one model; dense matrices.

    Parameters
    ----------
    equations : Equations
    softest : float
        Ratio of weights to :attr:`.Equations.mass`, see :attr:`~sfetcas.solvers.stability.StabilityTest.softest`.
    """

    def __init__(self, equations: Equations, softest: float) -> None:
        self._equations, self._softest = equations, softest
        n = equations.unknowns
        masses = np.concatenate([equations.mass, np.full(equations.displacement_unknowns, LIGHT)])
        self._root = np.sqrt(softest * masses)
        self._in_h = np.flatnonzero((equations.row < n) & (equations.column < n))

    def _tangent(self, point: Point) -> tuple[Array, float, int]:
        """The weighted tangent (n, n), the limit up to which eigenvalues count as zero, the size of the null space.

        The tangent acts on the null space of the closings; on its complement it is a positive multiple of the identity,
        larger than its largest entry, since projecting costs less than a basis of the null space.
        """
        equations, n = self._equations, self._equations.unknowns
        h, rows = np.zeros((n, n)), np.zeros((equations.rows, n))
        h[equations.row[self._in_h], equations.column[self._in_h]] = point.entries[self._in_h]
        chosen, row, column = equations.jacobian_entries
        rows[row, column] = point.entries[chosen]
        h /= np.outer(self._root, self._root)
        largest, free = float(np.abs(h).max(initial=0.0)), n
        if len(rows):
            rows = independent(equations, point, np.eye(len(rows))).T @ rows / self._root
            across = np.linalg.qr(rows.T)[0].T
            free -= len(across)
            before, after = across @ h, h @ across.T
            inner = before @ across.T + (largest + 1.0) * np.eye(len(across))
            h += across.T @ (inner @ across - before) - after @ across
        return h, tolerances.NEUTRAL + ENTRIES_BLUR * largest, free

    def _eigenvalues(self, tangent: Array) -> Array:
        """Complex eigenvalues (n,) by rising real part."""
        values = np.linalg.eigvals(tangent)
        return np.asarray(values[np.argsort(values.real)])

    def inertia(self, point: Point) -> Inertia:
        """Numbers of eigenvalues with negative real part, and of those that are zero to rounding."""
        tangent, limit, _ = self._tangent(point)
        values = self._eigenvalues(tangent)
        zero = int((np.abs(values) <= limit).sum())
        return Inertia(int(((values.real < 0.0) & (np.abs(values) > limit)).sum()), zero)

    def around_zero(self, point: Point, *, sharp: bool = True) -> tuple[int, Array, Array]:
        """Zero, the real parts (n,) of all eigenvalues, rising, and shapes (rotation unknowns, n), rad.

        Zero is the number of eigenvalues below those listed; ``sharp`` changes nothing.  Shapes are right singular
        vectors, that of the least singular value at the real part nearest to zero: where eigenvalues vanish these span
        the null space of the tangent, while eigenvectors may coincide.
        """
        tangent = self._tangent(point)[0]
        values, vectors = self._eigenvalues(tangent).real, np.zeros_like(tangent)
        vectors[:, np.argsort(np.abs(values))] = np.linalg.svd(tangent)[2][::-1].T
        return 0, values, (vectors / self._root[:, None])[: self._equations.rotation_unknowns]

    def singular(self, point: Point, count: int) -> bool:
        """Whether the ``count`` eigenvalues nearest to the imaginary axis are real, and no complex pair."""
        values = self._eigenvalues(self._tangent(point)[0])
        nearest = values[np.argsort(np.abs(values.real))[:count]]
        return bool((np.abs(nearest.imag) <= ON_THE_AXIS).all())

    def depth(self, point: Point, near: float = 0.0) -> float:
        """Minus the lowest real part, as an eigenvalue by :attr:`.Equations.mass`; zero if none is below zero."""
        tangent, limit, free = self._tangent(point)
        lowest = float(self._eigenvalues(tangent)[0].real) if free else 0.0
        return -lowest * self._softest if lowest < -limit else 0.0

    def below(self, point: Point) -> int:
        """Number of negative real eigenvalues; with any, the tangent was singular on the way to this state."""
        tangent, limit, _ = self._tangent(point)
        values = self._eigenvalues(tangent)
        return int(((values.real < -limit) & (np.abs(values.imag) <= limit)).sum())

    def test(self, point: Point) -> Stability:
        """The result "not defined": without an energy there is no stability in the sense of a minimum."""
        turning = np.zeros(self._equations.rotation_unknowns)
        return Stability("not defined", 0, np.nan, turning, np.zeros(self._equations.displacement_unknowns))
