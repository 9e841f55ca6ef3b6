"""Projection of states and rates onto the constraints, by the smallest change."""

from __future__ import annotations

import numpy as np

from .. import tolerances
from ..mathematics.arrays import Array
from ..mechanics.equations import Equations, Point, State
from ..mechanics.loading import Loading

__all__ = ["closed", "factor_closings", "of_unit_length", "shortest"]

ROUNDS = 8
"""Newton iterations at most: from a drift of 1e-4 three are enough."""


def factor_closings(equations: Equations, point: Point) -> None:
    """Factor ``[1 G^T; G 0]``, with the Jacobian G of the constraints at a point, in the solver of the equations."""
    entries = equations.of_rows(point.entries)
    equations.solver.factor(equations.regularised(entries, np.ones(equations.unknowns), tolerances.DUAL))


def shortest(equations: Equations, gaps: Array) -> Array:
    """The smallest change (unknowns,) that reduces the gaps (rows,) of the constraints to zero, dimensionless.

    The matrix must have been factored by :func:`factor_closings`.
    """
    n = equations.unknowns
    step = equations.solver.solve(np.concatenate([np.zeros(n), -gaps]))
    return np.asarray(step[:n])


def of_unit_length(q: Array) -> tuple[Array, float]:
    """Quaternions (n, 4) normalised, or angles (n, 1) as they are, and the largest error of the squared norms."""
    if q.shape[1] == 1 or not len(q):
        return q, 0.0
    square = np.einsum("ij,ij->i", q, q)
    return q / np.sqrt(square)[:, None], float(np.abs(square - 1.0).max())


def closed(equations: Equations, state: State, loading: Loading) -> tuple[State, float]:
    """A state projected onto the constraints, and the largest gap before; leaves the factored matrix in the solver."""
    n = equations.unknowns
    if not equations.rows:
        return state, 0.0
    point = equations.at(state, loading)
    factor_closings(equations, point)
    gap = before = float(np.abs(point.residual[n:]).max())
    for _ in range(ROUNDS):
        step = np.concatenate([shortest(equations, point.residual[n:]), np.zeros(equations.rows)])
        moved = equations.moved(state, step)
        there = equations.at(moved, loading)
        left = float(np.abs(there.residual[n:]).max())
        # What no longer falls is rounding.
        if left >= gap:
            break
        state, point, gap = moved, there, left
    factor_closings(equations, point)
    return state, before
