"""Pseudo-transient continuation: downhill along the gradient flow of the energy.

:func:`flow` goes downhill where there is an energy whose value is not computed: under even pressure, and under moments
about hinges.  Gradient flow ``M dx/dt = -F(x)`` leads from beside an unstable equilibrium to a stable one.  Implicit
steps ``(K + s M) dx = -F`` of it need the equations and their derivative only; with ``s`` above minus the lowest
eigenvalue each is a descent direction, and with ``s = 0``, where no eigenvalue is negative, it is Newton's.

With :class:`Drag` a step minimises the energy plus half of ``drag * M`` times the square of the rotations since the
state before: the implicit Euler step of an overdamped motion, which obstacles may stop.  What can move without turning
needs drag on displacements too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from ..mathematics.arrays import Array, Index
from ..mechanics.equations import Equations, Point, State
from ..mechanics.loading import Loading
from .between_states import turned_between
from .newton import Iterate, Moving, largest_rotation, newton, newton_step

__all__ = ["Drag", "flow"]

LONGEST = 0.3
"""Largest rotation of a node in a step, rad, so that the flow does not jump over equilibria in its way."""

ARRIVED = 1e-5
"""Length of a step, rad, below which the flow has come to rest."""

MOST = 200
"""Steps at most: leaving a nearly neutral state takes some ten, the way from one shape to another some thirty."""

SHIFT_GROWTH, LEAST_SHIFT = 4.0, 1e-9
"""Growth of ``s`` until a step is short enough, and its least value above zero, dimensionless.

The rotation of a member about its axis between ball joints is resisted by 1e-7 of its bending stiffness: with a larger
first value the flow would creep along it.
"""

LASTING = 5
"""Number of steps after which the lowest eigenvalue is computed again; also done where the flow comes to rest.

On the way it only keeps the flow from running back, and it costs ten times as much as a step.
"""


def flow(
    equations: Equations, state: State, loading: Loading, depth: Callable[[Point, float], float]
) -> tuple[State | None, int]:
    """The state to which the flow leads, None if it does not come to rest, and the number of steps.

    Parameters
    ----------
    equations : Equations
    state : State
        Start of the flow.
    loading : Loading
    depth : callable
        (point, last value) -> minus the lowest eigenvalue by :attr:`.Equations.mass`, or a bound not much larger; zero
        if no eigenvalue is negative.
    """
    diagonal = equations.diagonal[: equations.rotation_unknowns]
    deep, last, age = 0.0, LEAST_SHIFT, 0

    def step(here: Iterate) -> Array:
        nonlocal deep, last, age
        if not ARRIVED < here.length < np.inf or age == LASTING:
            deep, age = depth(here.point, deep), 0
        age += 1
        shift = 2.0 * deep
        while True:
            entries = here.point.entries.copy()
            entries[diagonal] += shift * equations.mass
            step = newton_step(equations, replace(here.point, entries=entries), equations.mass)
            if not LONGEST < largest_rotation(equations, step) < np.inf:
                last = shift
                return step
            shift = max(SHIFT_GROWTH * shift, last / SHIFT_GROWTH**2, LEAST_SHIFT)

    def arrived(here: Iterate) -> bool:
        return deep == 0.0 and here.length < ARRIVED and (age == 1 or depth(here.point, deep) == 0.0)

    after = Moving(equations, loading)
    here, rests = newton(after.at(state), step, after, arrived, MOST)
    return here.state if rests else None, here.count


@dataclass(frozen=True)
class Drag:
    """Moments that resist rotations since a state, and forces that resist displacements.

    Attributes
    ----------
    equations : Equations
    since : State
    size : float
        Ratio of the moment on a rotation unknown to its rotation times :attr:`.Equations.mass`, dimensionless.
    moved : ndarray (k,)
        Numbers of displacement unknowns that are resisted too: forces of this size over the displacement.
    """

    equations: Equations
    since: State
    size: float
    moved: Index = field(default_factory=lambda: np.zeros(0, np.intp))

    def __call__(self, state: State, point: Point) -> Point:
        """The equations at a state with the drag, its scale and its stiffness added."""
        equations, n = self.equations, self.equations.rotation_unknowns
        dragged = np.concatenate([np.arange(n), n + self.moved])
        weight = self.size * np.concatenate([equations.mass, np.ones(len(self.moved))])
        turned = turned_between(equations, state, self.since)
        efforts = weight * np.concatenate([turned, (state.y - self.since.y)[self.moved]])
        residual, entries, scale = point.residual.copy(), point.entries.copy(), point.scale.copy()
        residual[dragged] += efforts
        scale[dragged] += abs(efforts)
        entries[equations.diagonal[dragged]] += weight
        return replace(point, residual=residual, entries=entries, scale=scale)
