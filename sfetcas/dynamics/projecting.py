"""States and rates brought back to what joints and closings allow, by the smallest change."""

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
    """Factor ``[1 G^T; G 0]`` with the derivative G of the closings at a point."""
    entries = equations.of_rows(point.entries)
    equations.solver.factor(equations.regularised(entries, np.ones(equations.unknowns), tolerances.DUAL))


def shortest(equations: Equations, gaps: Array) -> Array:
    """The smallest change of the unknowns by which closings move by ``-gaps``; factored before."""
    n = equations.unknowns
    step = equations.solver.solve(np.concatenate([np.zeros(n), -gaps]))
    return np.asarray(step[:n])


def of_unit_length(q: Array) -> tuple[Array, float]:
    """Rotations (n, components) of unit length, and the largest by which their squares were off."""
    if q.shape[1] == 1 or not len(q):
        return q, 0.0
    square = np.einsum("ij,ij->i", q, q)
    return q / np.sqrt(square)[:, None], float(np.abs(square - 1.0).max())


def closed(equations: Equations, state: State, loading: Loading) -> tuple[State, float]:
    """A state with its closings met, and the largest gap before; the matrix is factored there."""
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
