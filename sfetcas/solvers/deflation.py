"""Deflation: Newton's method that keeps away from equilibria which are known already.

Newton's method on the stationarity equations ``F`` finds minima, saddles and maxima alike.  Deflation solves
``m F = 0`` with ``m = prod(1 + 1/d_i^2)``, where ``d_i`` is the root mean square, over the length, of the rotation
from the i-th known equilibrium.  The matrix of that differs from the Newton matrix by one of rank one, so that
its step is the plain step times a number (Sherman-Morrison).

Source: Farrell, Birkisson and Funke 2015, SIAM J. Sci. Comput. 37, A2026 (shifted deflation).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from .. import tolerances
from ..mathematics.arrays import TINY, Array
from ..mechanics.equations import Equations, State
from ..mechanics.loading import Loading
from .between_states import turned_between
from .newton import Iterate, Moving, largest_rotation, newton, newton_step
from .prepared import Prepared, Solved

__all__ = ["deflated", "nearest"]

LONGEST = 0.7
"""Largest rotation of a node in an iteration, rad."""

UNDEFLATED = 1e-3
"""Newton steps shorter than this, rad, end the deflated iteration; plain Newton steps converge from there."""

OTHER_TURN = 1.5
"""Largest rotation of a node, rad, between the state that start places lead to and the equilibrium beside it."""

ITERATIONS = 40
"""Iterations of a run: those that arrive at something new need 5 to 35 (measured)."""


def deflated(
    prepared: Prepared,
    state: State,
    loading: Loading,
    known: Sequence[State],
    *,
    step: Callable[[Iterate], Array] | None = None,
    correct: Callable[[State], Solved] | None = None,
    least: int = 0,
) -> Solved | None:
    """An equilibrium by Newton's method from a state, kept away from the known states; None without convergence.

    Parameters
    ----------
    prepared, state, loading
        As of :meth:`.Prepared.correct`.
    known : sequence of State
        On the same mesh.
    step : callable, optional
        Iterate -> step (total,), by default Newton's.
    correct : callable, optional
        What converges from a near state, by default :meth:`.Prepared.correct`.
    least : int
        Steps at least.
    """
    equations = prepared.equations
    moving = Moving(equations, loading)
    correct = correct or (lambda near: prepared.correct(near, loading))

    def after(here: Iterate, step: Array) -> Iterate:
        length = largest_rotation(equations, step)
        if length < UNDEFLATED and here.count >= least:
            return replace(here, length=length)
        # The step of the deflated equations points along the plain one, forwards or backwards.
        turned = step[: equations.rotation_unknowns]
        left = 1.0 - sum(_slope(equations, here.state, other, turned) for other in known)
        stretch = min(1.0 / max(abs(left), 1e-12), LONGEST / max(length, TINY))
        state = equations.moved(here.state, (stretch if left > 0.0 else -stretch) * step)
        return replace(moving.at(state), count=here.count + 1)

    begin = moving.at(equations.holding(state, loading))
    near, arrived = newton(
        begin,
        step or (lambda here: newton_step(equations, here.point, prepared.weight)),
        after,
        lambda here: here.length < UNDEFLATED and here.count >= least,
        ITERATIONS + least,
    )
    found = correct(near.state) if arrived else None
    return found if found is not None and found.converged else None


def nearest(prepared: Prepared, loading: Loading) -> Solved | None:
    """The equilibrium beside the ``start`` places of nodes, stable or not; None if Newton's method finds none near.

    A minimisation from there would leave an unstable one.
    """
    state, gap = prepared.guess(loading, settle=False)
    found = deflated(prepared, state, loading, ()) if gap <= tolerances.REACHED else None
    return found if found is not None and prepared.distance(found.state, state) <= OTHER_TURN else None


def _slope(equations: Equations, state: State, other: State, step: Array) -> float:
    """Derivative of ``log(1 + 1/d^2)`` along a step (rotation unknowns,), with d the distance of two states, rad."""
    share = equations.mass / equations.mass.sum()
    between = turned_between(equations, state, other)
    squared = float(share @ between**2) + 1e-30
    return -2.0 * float((share * between) @ step) / (squared * (1.0 + squared))
