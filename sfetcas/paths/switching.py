"""Following paths over changes of what is unilateral: strings that go slack or become taut, stops that are reached.

Which strings are taut and which stops are active is a choice, see :mod:`~sfetcas.mechanics.unilateral`.  While it holds
the equilibria are a smooth curve, which is followed like any other.  Where a margin vanishes the curve ends.  A state
there is an equilibrium of each choice that differs in what has no margin; of their curves those lead on along which no
margin falls.  Where the energy of the choice with the fewest active constraints has a strict minimum there is at most
one to either side of the factor, as rates and multipliers solve a strictly convex quadratic program.  Elsewhere all
choices are looked at: there may be none, several, and the factor may turn.

Source: Cottle, Pang and Stone 2009, The Linear Complementarity Problem, theorem 3.1.6.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..description.records import enumerated
from ..equilibria.stops import settled
from ..errors import SolveError, Status
from ..mathematics.arrays import Array
from ..mechanics.fields import Fields, transferred
from ..mechanics.margins import margins
from ..mechanics.mesh import Mesh
from ..mechanics.unilateral import Stops, Unilateral, switched_over, unilaterals
from ..solvers.arclength import PASSING, Curve, Standing, Tangent
from ..solvers.beginning import begin_path
from ..solvers.critical import Event, at_factors
from ..solvers.prepared import Prepared
from ..solvers.tracing import Traced, trace, without

__all__ = ["Choices", "Followed", "Part", "Transition"]

NEAR = 1e-7
"""Margins that are as small have to be asked how they go on."""

STEP = 1e-5
"""Arc length over which rates of margins are differenced: of second order, so 1e-10; rounding leaves 1e-11."""

FLAT = 1e-7
"""Rates of margins by the arc length that are as small say nothing."""

LOCKED = 1e-3
"""Rates of gaps by the arc length where active constraints lock what is to move; elsewhere they are next to none."""

ALIKE = 1e-6
"""Two ways on whose directions differ by less are one: a constraint that does nothing makes no other."""

MOST = 6
"""Constraints without a margin at one point, at most: all choices of them may have to be looked at."""


@dataclass(frozen=True, eq=False)
class Part:
    """A stretch of a path in one choice, and the curve that it is part of."""

    curve: Curve
    traced: Traced


@dataclass(frozen=True, eq=False)
class Transition:
    """A point at which a path goes over to another choice.

    Attributes
    ----------
    standing : Standing
        The point, in the choice before.
    changes : tuple of str
        What happens, a sentence each: ``tendons.cable goes slack``.
    turns : bool
        Whether the factor turns there.
    notes : tuple of str
    """

    standing: Standing
    changes: tuple[str, ...]
    turns: bool
    notes: tuple[str, ...]


@dataclass
class Followed:
    """A path, or a branch of one, in all its parts.

    Attributes
    ----------
    parts : list of Part
    transitions : list of Transition
        Between one part and the next.
    ending : str
        Where no way on was found: why, a sentence.
    """

    parts: list[Part] = field(default_factory=list)
    transitions: list[Transition] = field(default_factory=list)
    ending: str = ""

    @property
    def points(self) -> list[Standing]:
        """Those of all parts; where one part ends and the next begins there are two."""
        return [point for part in self.parts for point in part.traced.points]

    @property
    def events(self) -> list[Event]:
        """Limit points and bifurcations."""
        return [event for part in self.parts for event in part.traced.events]

    @property
    def near(self) -> tuple[float, ...]:
        """As of :class:`~sfetcas.solvers.tracing.Traced`."""
        return tuple(factor for part in self.parts for factor in part.traced.near)

    @property
    def missed(self) -> float:
        """As of :class:`~sfetcas.solvers.tracing.Traced`, of all parts."""
        return sum(part.traced.missed for part in self.parts)

    @property
    def end(self) -> str:
        """As of :class:`~sfetcas.solvers.tracing.Traced`."""
        return self.parts[-1].traced.end

    @property
    def limit(self) -> SolveError | None:
        """As of :class:`~sfetcas.solvers.tracing.Traced`."""
        return self.parts[-1].traced.limit

    @property
    def message(self) -> str:
        """Why it ends ``bent`` or ``margin``, a sentence."""
        return self.ending or str(self.limit or "")

    @property
    def count(self) -> int:
        """Number of points of the last parts that steps led to."""
        return len(self.points) - len(self.events) - len(self.parts) + 1

    def without(self, known: Sequence[Standing]) -> Followed:
        """This without the bifurcations at points that are known already, as those of the path it branches off."""
        return replace(self, parts=[replace(part, traced=without(part.traced, known)) for part in self.parts])


@dataclass(frozen=True, eq=False)
class _Way:
    """A way on from a point: a choice, its curve, and the point on it, its tangent ahead."""

    which: tuple[Unilateral, ...]
    stops: Stops
    curve: Curve
    standing: Standing


class Choices:
    """The models of one mesh, one for each choice, and paths over changes of the choice.

    Parameters
    ----------
    mesh : Mesh
    prepare : callable
        Mesh -> Prepared.
    span : (low, high)
        Range of factors.
    knots : tuple of float
        Factors at which histories have knots.
    """

    def __init__(
        self, mesh: Mesh, prepare: Callable[[Mesh], Prepared], span: tuple[float, float], knots: tuple[float, ...]
    ) -> None:
        self.mesh, self.span, self.knots = replace(mesh, stops=()), span, knots
        self._prepare, self._known = prepare, dict[Stops, Prepared]()
        self.unit = max(map(abs, span))
        self.constraints = unilaterals(self.prepared(()).model.scene)

    def prepared(self, stops: Stops) -> Prepared:
        """The model of a choice, ready to be solved."""
        if stops not in self._known:
            self._known[stops] = self._prepare(replace(self.mesh, stops=stops))
        return self._known[stops]

    def curve(self, stops: Stops) -> Curve:
        """The curve of a choice."""
        return Curve(self.prepared(stops), self.unit)

    # -- begin ----------------------------------------------------------------------------------

    def begin(self, stops: Stops = ()) -> tuple[Curve, Standing, tuple[str, ...]]:
        """The first point, as of :func:`~sfetcas.solvers.beginning.begin_path`, in the choice that holds there.

        The search for it begins with ``stops``.

        Raises
        ------
        SolveError
            There is no equilibrium to start from, or none that tells in which choice the path goes on.
        """
        found: dict[Stops, tuple[Curve, Standing, tuple[str, ...]]] = {}
        if not self.constraints:
            found[stops] = begin_path(self.prepared(stops), self.span)
            self.unit = found[stops][0].unit
            return found[stops]

        def answer(stops: Stops) -> Mapping[Unilateral, float]:
            found[stops] = begin_path(self.prepared(stops), self.span)
            return margins(found[stops][1].fields)

        stops = settled(self.prepared(()).model.scene, answer, stops)
        curve, start, notes = found[stops]
        self.unit = curve.unit
        near = self._without_margin(start)
        if not near:
            return curve, start, notes
        up = 1.0 if self.span[1] > 0.0 else -1.0
        ways = self._ways(start, stops, near, up, begins=True)
        if len(ways) != 1:
            raise SolveError(Status.FAILED, f"at its beginning {_several(ways, near, self.constraints)}", start.state)
        return ways[0].curve, ways[0].standing, notes

    # -- along ----------------------------------------------------------------------------------

    def follow(self, curve: Curve, start: Standing, count: int, missing: float = np.inf) -> Followed:
        """A path from a point on, over all changes of the choice; ``missing`` as of :func:`.trace`."""
        found, tried = Followed(), set[Stops]()
        watch = self._watched if self.constraints else None
        while True:
            left = max(1, count - found.count) if found.parts else count
            traced = trace(curve, start, self.span, left, self.knots, watch, missing)
            found.parts.append(Part(curve, traced))
            if traced.end != "margin":
                return found
            at, stops = traced.points[-1], curve.model.mesh.stops
            tried = {stops} if len(traced.points) > 1 else {*tried, stops}
            crossed = [self.constraints[i] for i in traced.crossed]
            near = list(dict.fromkeys([*crossed, *self._without_margin(at)]))
            if len(near) > MOST:
                found.ending = f"{len(near)} tendons and stops change at once, accepted: at most {MOST}"
                return found
            ways = self._ways(at, stops, near, float(np.sign(at.tangent.factor)))
            if len(ways) != 1 or ways[0].stops in tried:
                found.ending = _several(ways, near, self.constraints)
                return found
            way, way_on = ways[0], ways[0].standing
            turns = bool(at.tangent.factor * way_on.tangent.factor < 0.0)
            changes = tuple(one.becomes(stops) for one in way.which)
            found.transitions.append(Transition(at, changes, turns, _said(at, way_on, turns)))
            curve, start = way.curve, way_on

    def _watched(self, standing: Standing) -> Array:
        """Margins (constraints,) of a point."""
        return np.array(list(margins(standing.fields).values()))

    def _without_margin(self, standing: Standing) -> list[Unilateral]:
        return [one for one, margin in margins(standing.fields).items() if abs(margin) <= NEAR]

    def crossings(self, followed: Followed, factors: tuple[float, ...]) -> list[Standing]:
        """The points at given factors, in their order along the path; where parts meet they are listed once."""
        found = list[Standing]()
        for part in followed.parts:
            first = part.traced.points[0]
            met = at_factors(part.curve, part.traced.points, factors)
            found += met if part is followed.parts[0] else [point for point in met if point is not first]
        # A closed curve ends where it begins.
        last = followed.points[-1]
        return found[:-1] if followed.end == "closed" and last in found else found

    # -- over a change --------------------------------------------------------------------------

    def _ways(
        self, at: Standing, stops: Stops, near: Sequence[Unilateral], sign: float, *, begins: bool = False
    ) -> list[_Way]:
        """The ways on from a point at which some constraints have no margin, with the sign of the factor's rate so far.

        A choice holds along each; those that go the same way are one, in the choice with the fewest changes.
        """
        fewest = switched_over(stops, [one for one in near if one.active(stops)])
        unique = self._has_minimum(at, fewest)
        found: list[_Way] = []
        # What has led to the end of its choice cannot go on in it.
        for size in range(0 if begins else 1, len(near) + 1):
            for which in itertools.combinations(near, size):
                for ahead in (sign,) if unique or begins else (sign, -sign):
                    way = self._way(at, switched_over(stops, which), which, ahead)
                    if way is None or min(self._rates(way, near)) < -FLAT:
                        continue
                    if not any(_alike(way, other) for other in found):
                        found.append(way)
                    if unique:
                        return found
        return found

    def _has_minimum(self, at: Standing, stops: Stops) -> bool:
        """Whether the energy has a strict minimum at a point in a choice."""
        way = self._way(at, stops, (), 1.0, regular=False)
        if way is None or not way.curve.model.conservative:
            return False
        return not way.standing.inertia.negative and not way.standing.inertia.zero

    def _way(
        self, at: Standing, stops: Stops, which: tuple[Unilateral, ...], sign: float, *, regular: bool = True
    ) -> _Way | None:
        """The way on in a choice with a rising or falling factor; None where what is left is singular in it, or locked.

        Motions that are neutral in the choice before are so in any that has fewer active constraints.
        """
        prepared = self.prepared(stops)
        curve = Curve(prepared, self.unit, self._piece(at.factor, sign))
        state = transferred(at.model, at.state, prepared.model)
        here = curve.standing(state, at.factor, Tangent(np.zeros(curve.equations.total), sign), arc=at.arc)
        if regular and here.inertia.zero > at.inertia.zero:
            return None
        if here.residual > PASSING:
            # A margin that was next to nothing is none now.
            here = curve.at_factor(here, at.factor) or curve.corrected(here.state, here.factor, here.tangent) or here
        state, factor = curve.predicted(here, STEP)
        gaps = curve.equations.at(state, curve.loading(factor)).residual[curve.equations.unknowns :]
        if regular and np.abs(gaps).max(initial=0.0) > LOCKED * STEP:
            return None
        # Curves are kept without a piece: they are followed over all of them.
        return _Way(which, stops, self.curve(stops), replace(here, arc=at.arc))

    def _piece(self, factor: float, sign: float) -> tuple[float, float]:
        """Factors without a knot of a history, on the side to which the factor goes."""
        if not self.prepared(()).model.scene.histories:
            return -np.inf, np.inf
        ends = (self.span[0], *self.knots, self.span[1])
        pieces = [(a, b) for a, b in itertools.pairwise(ends) if a <= factor <= b]
        return pieces[-1 if sign > 0.0 else 0]

    def _rates(self, way: _Way, which: Sequence[Unilateral]) -> list[float]:
        """Rates of margins by the arc length."""
        curve, here = way.curve, way.standing
        ends = []
        for length in (STEP, -STEP):
            state, factor = curve.predicted(here, length)
            ends.append(margins(Fields(curve.equations, state, curve.loading(factor))))
        return [(ends[0][one] - ends[1][one]) / (2.0 * STEP) for one in which]


def _alike(a: _Way, b: _Way) -> bool:
    """Whether two ways go the same way, in rotations and the factor."""
    turns, unit = a.curve.equations.rotation_unknowns, a.curve.unit
    one, other = a.standing.tangent, b.standing.tangent
    apart, weight = one.z[:turns] - other.z[:turns], a.curve.weight[:turns]
    return float(apart @ (weight * apart)) + ((one.factor - other.factor) / unit) ** 2 <= ALIKE**2


def _several(ways: Sequence[_Way], near: Sequence[Unilateral], constraints: Sequence[Unilateral]) -> str:
    """Why no way is chosen."""
    names = enumerated(list(dict.fromkeys(f"{one.table}.{one.name}" for one in near)))
    if len(ways) < 2:
        return f"no choice of what is taut and at a stop leads on: {names}"
    told = ["; ".join(one.is_told(way.stops) for one in near) for way in ways]
    return f"{len(ways)} ways lead on, and the path branches: {' or '.join(told)}"


def _said(before: Standing, after: Standing, turns: bool) -> tuple[str, ...]:
    """What has to be known of a transition."""
    notes: tuple[str, ...] = ("the factor turns there, at a corner",) if turns else ()
    ways = [standing.inertia.negative for standing in (before, after)]
    if before.model.conservative and ways[0] != ways[1]:
        notes += (f"the number of unstable directions changes from {ways[0]} to {ways[1]}",)
    return notes
