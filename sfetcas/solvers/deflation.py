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
from ..mathematics import quaternion
from ..mathematics.arrays import Array, Index
from ..mathematics.keeping import kept
from ..mechanics.equations import Equations, State
from ..mechanics.loading import Loading
from ..mechanics.model import Model
from ..mechanics.rotations import Turn
from .newton import Corrected, newton_step
from .prepared import Prepared

__all__ = ["deflated", "nearest", "turned_between", "unheld"]

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


def turned_between(equations: Equations, here: State, there: State) -> Array:
    """Rotations from one state to another, ``there`` to ``here``, in the turning unknowns, rad.

    Plane angles count turns, but for parts of the structure that nothing holds: a whole turn of such a part is no
    difference.
    """
    model = equations.model
    vectors = _rotation_vectors(model, here, there) if model.space else _angles(model, here, there)
    between = np.zeros(equations.turning_unknowns)
    used = equations.number >= 0
    between[equations.number[used]] = vectors[used]
    return between


def _angles(model: Model, here: State, there: State) -> Array:
    angles = here.q - there.q
    for part in unheld(model):
        angles[part] -= 2.0 * np.pi * np.round(angles[part].mean() / (2.0 * np.pi))
    return np.asarray(angles)


def _rotation_vectors(model: Model, here: State, there: State) -> Array:
    vectors = quaternion.rotation_vector(quaternion.multiply(here.q, quaternion.conjugate(there.q)))
    # The one unknown of a rotation about a held axis is the angle about it.
    held = model.rotations.kind == Turn.AXIS
    vectors[held, 0] = (vectors * model.rotations.axis).sum(axis=1)[held]
    return vectors


@kept(1)
def unheld(model: Model) -> tuple[Index, ...]:
    """Rotations that hang together and of which none is held."""
    turns = model.rotations.turns
    label, before = np.arange(len(model.rotations.kind)), np.zeros(0)
    while not np.array_equal(label, before):
        before = label.copy()
        np.minimum.at(label, turns, np.broadcast_to(label[turns].min(axis=1)[:, None], turns.shape))
    held = set(label[model.rotations.kind == Turn.HELD].tolist())
    return tuple(np.flatnonzero(label == part) for part in np.unique(label).tolist() if part not in held)
