"""Pseudo-transient continuation: downhill along the gradient flow of the energy, in steps or towards a state.

:func:`flow` goes downhill where there is an energy whose value is not at hand: under even pressure, and under moments
about hinges.
Gradient flow ``M dx/dt = -F(x)`` leads from beside an unstable equilibrium to a stable one, whatever lies between.
Its implicit steps ``(K + s M) dx = -F`` need the equations and their derivative only; with ``s`` beyond the lowest
eigenvalue below zero every step points to where the energy falls, and where there is none they are Newton's.

With :class:`Drag` a step minimises the energy plus half of ``drag * M`` times the square of the rotations since the
state before, so that a structure which falls goes down the way that drag lets it, whatever stops it there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..mathematics.arrays import Array
from ..mechanics.equations import Equations, Point, State
from ..mechanics.loading import Loading
from .between_states import turned_between
from .newton import Iterate, moving, newton, newton_step, turned_by

__all__ = ["Drag", "flow"]

LONGEST = 0.3
"""No node turns by more than this in a step, rad: the flow is not to jump over what lies in its way."""

ARRIVED = 1e-5
"""Newton's steps shorter than this, rad, have arrived."""

MOST = 200
"""Steps at most: leaving a nearly neutral state takes some ten, the way from one shape to another some thirty."""

SHIFT_GROWTH, LEAST_SHIFT = 4.0, 1e-9
"""Growth of ``s`` until a step is short enough, and the least that it begins with, in units of force.

A spin of a member between balls is resisted by 1e-7 of its bending: a firmer beginning would creep along it.
"""

LASTING = 5
"""The lowest eigenvalue is looked for after so many steps, and where they have arrived.

On the way it only keeps the flow from running back, and to find it costs ten times as much as a step.
"""


def flow(
    equations: Equations, state: State, loading: Loading, depth: Callable[[Point, float], float]
) -> tuple[State | None, int]:
    """Where the flow leads from a state, None where it does not come to rest, and its steps.

    Parameters
    ----------
    depth : callable
        At a point of the equations, and with what it was before: how far eigenvalues are below zero, or a number
        that is not much larger; zero where none is.
    """
    diagonal = equations.diagonal[: equations.rotation_unknowns]
    deep, last, age = 0.0, LEAST_SHIFT, 0

    def at(state: State) -> Point:
        return equations.at(state, loading)

    def step(here: Iterate) -> Array:
        nonlocal deep, last, age
        if not ARRIVED < here.length < np.inf or age == LASTING:
            deep, age = depth(here.point, deep), 0
        age += 1
        shift, length = 2.0 * deep, np.inf
        while length > LONGEST:
            entries = here.point.entries.copy()
            entries[diagonal] += shift * equations.mass
            step = newton_step(equations, replace(here.point, entries=entries), equations.mass)
            length = turned_by(equations, step)
            used, shift = shift, max(SHIFT_GROWTH * shift, last / SHIFT_GROWTH**2, LEAST_SHIFT)
        last = used
        return step

    def arrived(here: Iterate) -> bool:
        return deep == 0.0 and here.length < ARRIVED and (age == 1 or depth(here.point, deep) == 0.0)

    here, rests = newton(Iterate(state, at(state)), step, moving(equations, at), arrived, MOST)
    return here.state if rests else None, here.count


@dataclass(frozen=True)
class Drag:
    """Couples that resist rotations since a state.

    Attributes
    ----------
    equations : Equations
    since : State
    size : float
        Couple by rotation and by the weight of :attr:`Equations.mass`, in units of the model.
    """

    equations: Equations
    since: State
    size: float

    def __call__(self, state: State, point: Point) -> Point:
        """The point of the equations with drag."""
        equations, n = self.equations, self.equations.rotation_unknowns
        couples = self.size * equations.mass * turned_between(equations, state, self.since)
        residual, entries, scale = point.residual.copy(), point.entries.copy(), point.scale.copy()
        residual[:n] += couples
        scale[:n] += abs(couples)
        entries[equations.diagonal[:n]] += self.size * equations.mass
        return replace(point, residual=residual, entries=entries, scale=scale)
