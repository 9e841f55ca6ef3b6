"""The curve of equilibria in contact over the load factor, while the kind and number of contacts do not change.

Unknowns are the rotations, the factor and the positions of the contacts along members.  For fixed contact positions the
equilibrium is found by arc-length continuation (see :mod:`~sfetcas.solvers.arclength`), so that limit points need no
special treatment; the contact positions follow from their conditions by Broyden's method.  Meshes are stretched with
the contact positions, so that unknowns keep their numbers.  Tangents are exact but for finite differences by the
contact positions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..contact.settling import OPEN, SETTLED, Held, free_places, moved, stretched
from ..contact.touches import Touched
from ..description.scene import Scene
from ..mathematics.arrays import Array
from ..mechanics.equations import Equations, State
from ..mechanics.mesh import Mesh, Touch
from ..solvers.arclength import Curve, Standing, Tangent
from ..solvers.between_states import turned_between
from ..solvers.critical import root
from ..solvers.prepared import Prepared

__all__ = ["ContactCurve", "Stood"]

MOST_STEPS = 10
"""Steps of places before giving up: more are needed only far from the curve."""

NUDGE = 1e-6
"""Change of a place over which is differenced, a fraction of the length."""

AHEAD = 1e-4
"""Way along the curve with places held over which conditions are differenced: second order, so 1e-8."""

FLAT = 1e-8
"""Share of the larger rate of the factor at both sides of a limit point that is rounding of differences."""


@dataclass(frozen=True, eq=False)
class Stood:
    """A point of the curve.

    Attributes
    ----------
    held : Held
        The equilibrium, its contact conditions met.
    standing : Standing
        The equilibrium as a point of the curve with fixed contact positions.
    tangent : Tangent
        Unit tangent of the curve in rotations (rad) and factor (over its unit).
    rates : ndarray (places,)
        Derivatives of the contact positions, as fractions of the length, by the arc length.
    slopes : ndarray (places, places)
        Jacobian of the contact conditions by the contact positions, across the tangent; dimensionless.
    arc : float
        Arc length from the start of the curve.
    """

    held: Held
    standing: Standing
    tangent: Tangent
    rates: Array
    slopes: Array
    arc: float

    @property
    def factor(self) -> float:
        """Factor of the loads and motions."""
        return float(self.standing.factor)


class ContactCurve:
    """Equilibria in contact as a curve over a factor.

    Parameters
    ----------
    scene : Scene
    prepare : callable
        Mesh -> Prepared.
    unit : float
        Change of the factor that counts as much as a radian.

    Attributes
    ----------
    piece : tuple of float
        Factors between which no history has a knot.
    """

    def __init__(self, scene: Scene, prepare: Callable[[Mesh], Prepared], unit: float) -> None:
        self.scene, self.prepare, self.unit = scene, prepare, unit
        self.piece = (-np.inf, np.inf)

    def plain(self, prepared: Prepared) -> Curve:
        """The curve of equilibria of one model, with fixed contact positions."""
        return Curve(prepared, self.unit, self.piece)

    # -- points ---------------------------------------------------------------------------------

    def stood(self, held: Held, factor: float, along: Tangent, arc: float = 0.0) -> Stood | None:
        """A point of the curve for an equilibrium, its tangent oriented as ``along``; None if that is undetermined."""
        curve = self.plain(held.prepared)
        return self._with_tangent(held, curve.standing(held.corrected.state, factor, along, arc=arc), along, arc)

    def _with_tangent(self, held: Held, standing: Standing, along: Tangent, arc: float) -> Stood | None:
        curve, inner = self.plain(held.prepared), standing.tangent
        free = free_places(held.mesh.touches)
        # Without places it tells whether the curve goes on at all: not so at the start of what is straight and pressed.
        ahead = self._conditions_ahead(curve, standing)
        beside = [self._beside(held, standing, free, j) for j in range(len(free))]
        if ahead is None or any(part is None for part in beside):
            return None
        turns = [part[0] for part in beside if part is not None]
        own = np.column_stack([part[1] for part in beside if part is not None]) if free else np.zeros((0, 0))
        if free and np.linalg.cond(own) > 1.0 / OPEN:
            return None
        sliding = -np.linalg.solve(own, ahead) if free else np.zeros(0)
        whole = Tangent(
            inner.z + sum((rate * turn.z for rate, turn in zip(sliding, turns, strict=True)), np.zeros_like(inner.z)),
            inner.factor + sum(rate * turn.factor for rate, turn in zip(sliding, turns, strict=True)),
        )
        length = float(np.sqrt(curve.inner(whole, whole)))
        length *= 1.0 if curve.inner(whole, along) >= 0.0 else -1.0
        tangent, rates = Tangent(whole.z / length, whole.factor / length), sliding / length
        # Differences were taken across the tangent with places held; steps go across the whole one.
        shares = np.array([curve.inner(tangent, turn) for turn in turns]) / curve.inner(tangent, inner)
        return Stood(held, standing, tangent, rates, own - np.outer(ahead, shares) if free else own, arc)

    def _conditions_ahead(self, curve: Curve, standing: Standing) -> Array | None:
        """Derivative of the conditions along the curve with places held."""
        found = []
        for way in (AHEAD, -AHEAD):
            there = curve.corrected(*curve.predicted(standing, way), standing.tangent)
            if there is None:
                return None
            found.append(Touched(curve.equations, there.state, there.loading).conditions)
        return np.asarray((found[0] - found[1]) / (2.0 * AHEAD))

    def _beside(
        self, held: Held, standing: Standing, free: list[tuple[int, int]], j: int
    ) -> tuple[Tangent, Array] | None:
        """Rates of the state, across the tangent with places held, and of the conditions with one place."""
        for way in (NUDGE, -NUDGE):
            step = np.zeros(len(free))
            step[j] = way
            there = self._held_at(held, free, step, standing.state, standing.factor, standing.tangent)
            if there is not None:
                after, found = there
                moves = _difference(held.prepared.equations, standing.state, found.state) / way
                rise = (found.factor - standing.factor) / way
                return Tangent(moves, rise), (after.touched.conditions - held.touched.conditions) / way
        return None

    def _held_at(
        self, held: Held, free: list[tuple[int, int]], step: Array, state: State, factor: float, across: Tangent
    ) -> tuple[Held, Standing] | None:
        """The equilibrium across a direction from a state with places moved; None where there is none, or no room."""
        touches: list[Touch] = list(held.mesh.touches)
        for (i, k), change in zip(free, step, strict=True):
            touches[i] = moved(touches[i], k, touches[i].places[k] + float(change))
        if any(not 0.0 < touches[i].places[k] < 1.0 for i, k in free):
            return None
        mesh = stretched(self.scene, held.mesh, tuple(touches))
        if mesh is None:
            return None
        prepared = self.prepare(mesh) if free else held.prepared
        found = self.plain(prepared).corrected(state, factor, across)
        return None if found is None else (_as_held(found), found)

    # -- along ----------------------------------------------------------------------------------

    def expected(self, start: Stood, length: float, before: Stood | None = None) -> tuple[State, float, Array]:
        """Predicted state, factor and changes of the contact positions a length along the tangent.

        With the point ``before`` the prediction also has the curvature of the curve.
        """
        curve, bend, rates = self.plain(start.held.prepared), None, length * start.rates
        if before is not None:
            arc = start.arc - before.arc
            turn, rise = start.tangent.z - before.tangent.z, start.tangent.factor - before.tangent.factor
            bend = Tangent(turn / arc, rise / arc)
            rates = rates + 0.5 * length**2 * (start.rates - before.rates) / arc
        z, factor = length * start.tangent.z, start.factor + length * start.tangent.factor
        if bend is not None:
            z, factor = z + 0.5 * length**2 * bend.z, factor + 0.5 * length**2 * bend.factor
        state = curve.equations.moved(start.standing.state, z)
        return curve.with_prescribed(state, curve.loading(factor)), factor, rates

    def along(self, start: Stood, length: float, before: Stood | None = None) -> Stood | None:
        """The point of the curve in the plane normal to the tangent at a length; None where none is found."""
        free = free_places(start.held.mesh.touches)
        state, factor, change = self.expected(start, length, before)
        found = self._held_at(start.held, free, change, state, factor, start.tangent)
        slopes = start.slopes
        for _ in range(MOST_STEPS):
            if found is None:
                return None
            held, standing = found
            here = held.touched.conditions
            step = -np.linalg.solve(slopes, here) if free else np.zeros(0)
            if np.abs(step).max(initial=0.0) < SETTLED:
                return self._with_tangent(held, standing, start.tangent, start.arc + length)
            found = self._held_at(held, free, step, standing.state, standing.factor, start.tangent)
            if found is not None:
                gained = found[0].touched.conditions - here
                slopes = slopes + np.outer(gained - slopes @ step, step) / float(step @ step)
        return None

    def limit(self, a: Stood, b: Stood) -> Stood | None:
        """The limit point (extremum of the factor) between two points; None where it is not found."""
        met: dict[float, Stood] = {0.0: a, b.arc - a.arc: b}
        flat = FLAT * max(abs(a.tangent.factor), abs(b.tangent.factor))

        def rate(length: float) -> float:
            there = self.along(a, length)
            if there is None:
                return float("nan")
            met[length] = there
            return there.tangent.factor if abs(there.tangent.factor) > flat else 0.0

        place = root(rate, 0.0, a.tangent.factor, b.arc - a.arc, b.tangent.factor)
        found = met.get(place)
        # An end of the bracket is what a search without success returns.
        return None if found is a or found is b else found


def _as_held(standing: Standing) -> Held:
    return Held(standing)


def _difference(equations: Equations, here: State, there: State) -> Array:
    """The step from one state to another, as :meth:`Equations.moved` takes it."""
    return np.concatenate([turned_between(equations, there, here), there.y - here.y, there.lam - here.lam])
