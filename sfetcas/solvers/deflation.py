"""Newton's method that keeps away from equilibria which are known already.

Newton's method on the stationarity equations ``F`` finds minima, saddles and maxima alike.  Deflation solves
``m F = 0`` with ``m = prod(1 + 1/d_i^2)``, where ``d_i`` is the root mean square, over the length, of the rotation
from the i-th known equilibrium.  The matrix of that differs from the Newton matrix by one of rank one, so that
its step is the plain step times a number (Sherman-Morrison).

Source: Farrell, Birkisson and Funke 2015, SIAM J. Sci. Comput. 37, A2026 (shifted deflation).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .. import tolerances
from ..mathematics.arrays import Array
from ..mechanics.equations import Equations, State
from ..mechanics.loading import Loading
from .between_states import turned_between
from .newton import Corrected, newton_step
from .prepared import Prepared

__all__ = ["deflated", "nearest"]

LONGEST = 0.7
"""No node turns by more than this in an iteration, rad."""

UNDEFLATED = 1e-3
"""Steps shorter than this, rad, go on without deflation."""

OTHER_TURN = 1.5
"""An equilibrium that turns a node by more than this, rad, from where it was led to is not the one that was meant."""

ITERATIONS = 40
"""Iterations of a run: those that arrive at something new need 5 to 35 (measured)."""


def deflated(prepared: Prepared, state: State, loading: Loading, known: Sequence[State]) -> Corrected | None:
    """A run of Newton's method that keeps away from known states; None where it does not arrive."""
    equations, turning = prepared.equations, slice(0, prepared.equations.turning_unknowns)
    state = equations.holding(state, loading)
    for _ in range(ITERATIONS):
        try:
            step = newton_step(equations, equations.at(state, loading), prepared.weight)
        except np.linalg.LinAlgError:
            return None
        length = float(np.abs(step[turning]).max(initial=0.0))
        if not np.isfinite(length):
            return None
        if length < UNDEFLATED:
            found = prepared.correct(state, loading)
            return found if found.converged else None
        # The step of the deflated equations points along the plain one, forwards or backwards.
        left = 1.0 - sum(_slope(equations, state, other, step[turning]) for other in known)
        stretch = min(1.0 / max(abs(left), 1e-12), LONGEST / length)
        state = equations.moved(state, (stretch if left > 0.0 else -stretch) * step)
    return None


def nearest(prepared: Prepared, loading: Loading) -> Corrected | None:
    """The equilibrium beside the ``start`` places of nodes, stable or not; None where Newton's method finds none.

    A minimisation from there would slide down from one that is unstable.
    """
    state, gap = prepared.guess(loading, settle=False)
    found = deflated(prepared, state, loading, ()) if gap <= tolerances.REACHED else None
    return found if found is not None and prepared.distance(found.state, state) <= OTHER_TURN else None


def _slope(equations: Equations, state: State, other: State, step: Array) -> float:
    """Derivative of ``log(1 + 1/d^2)`` along a step."""
    share = equations.mass / equations.mass.sum()
    between = turned_between(equations, state, other)
    squared = float(share @ between**2) + 1e-30
    return -2.0 * float((share * between) @ step) / (squared * (1.0 + squared))
