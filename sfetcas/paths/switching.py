"""Following paths over changes of what is unilateral: strings that go slack, stops that are reached, what touches.

Which strings are taut, which stops are active and which places touch is a choice, see :mod:`.conditions`.  While it
holds the equilibria are a smooth curve, which is followed like any other.  Where a margin vanishes the curve ends.  A
state there is an equilibrium of each choice that differs in what has no margin; of their curves those lead on along
which no margin falls.  Where the energy of the choice with the fewest active constraints has a strict minimum there is
at most one to either side of the factor, as rates and multipliers solve a strictly convex quadratic program.  Elsewhere
all choices are looked at: there may be none, several, and the factor may turn.

Source: Cottle, Pang and Stone 2009, The Linear Complementarity Problem, theorem 3.1.6.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from ..contact.lines import lies_along, points_of
from ..description.records import enumerated
from ..errors import SolveError, Status
from ..mathematics.arrays import Array
from ..mechanics.fields import Fields, transferred
from ..mechanics.mesh import ContactPoint, Mesh
from ..solvers.arclength import PASSING, Curve, Standing, Tangent
from ..solvers.beginning import begin_path
from ..solvers.critical import Event, at_factors, events_between, sought
from ..solvers.prepared import Prepared
from ..solvers.tracing import Traced, trace, without
from .conditions import NEAR, Choice, Conditions, Way
from .lying import Lying

__all__ = ["Choices", "First", "Followed", "Part", "Transition"]

NOTHING = Choice()
"""The choice in which nothing acts but strings, which are taut."""

STEP = 1e-5
"""Arc length over which rates of margins are differenced: of second order, so 1e-10; rounding leaves 1e-11."""

FLAT = 1e-7
"""Rates of margins by the arc length that are as small say nothing."""

LOCKED = 1e-3
"""Rates of gaps by the arc length where active constraints lock what is to move; elsewhere they are next to none."""

ALIKE = 1e-6
"""Two ways on whose directions differ by less are one: a constraint that does nothing makes no other."""

FITS, FLAT_FITS = 3, 8
"""Times that elements are made to end where something acts: each leaves a thirtieth of how far that is off, or less;
where a gap ceases to be curved more of it, as the place then goes far under small changes.
"""

BESIDE = (1e-3, 1e-2, 5e-2, 0.2)
"""Arc lengths before and behind an event between which it is located on a mesh that is made for it."""

S = TypeVar("S", Event, Standing)
"""What is located."""

TURNS = "the factor turns there, at a corner"
"""A note."""

BRIEF = 4
"""Points between the end of a line and the begin of another one, up to which the path goes to and fro between these."""

BACK = 6
"""Points back from the first one without lines within which they end: steps along lines are no longer."""

MOST = 6
"""Conditions without a margin at one point, at most: all choices of them may have to be looked at."""


@dataclass(frozen=True, eq=False)
class Part:
    """A stretch of a path in one choice.

    Attributes
    ----------
    curve : Curve
        What it is part of.
    traced : Traced
    begins : Standing or None
        Where it begins, if that is a little before the first point that was traced.
    lies : bool
        Whether members lie along obstacles: each point then has a model of its own.
    """

    curve: Curve
    traced: Traced
    begins: Standing | None = None
    lies: bool = False

    @property
    def points(self) -> list[Standing]:
        """All of them."""
        return self.traced.points if self.begins is None else [self.begins, *self.traced.points]


@dataclass(frozen=True, eq=False)
class First:
    """Where a part of a path begins.

    Attributes
    ----------
    curve : Curve
    standing : Standing
        The point from which on the curve is followed.
    begins : Standing or None
        As of :class:`Part`.
    """

    curve: Curve
    standing: Standing
    begins: Standing | None = None


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
    crossed : tuple of int
        As of :class:`~sfetcas.solvers.tracing.Traced`.
    """

    standing: Standing
    changes: tuple[str, ...]
    turns: bool
    notes: tuple[str, ...]
    crossed: tuple[int, ...] = ()


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
        return [point for part in self.parts for point in part.points]

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
        beginnings = sum(part.begins is not None for part in self.parts)
        return len(self.points) - beginnings - len(self.events) - len(self.parts) + 1

    def without(self, known: Sequence[Standing]) -> Followed:
        """This without the bifurcations at points that are known already, as those of the path it branches off."""
        return replace(self, parts=[replace(part, traced=without(part.traced, known)) for part in self.parts])


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
    conditions : Conditions
        What is one-sided.
    base, finer
        A mesh, and what makes ``mesh`` of it: that is made anew where elements of the first end elsewhere.
    halvings : int
        How often elements have been halved for that.
    """

    def __init__(
        self,
        mesh: Mesh,
        prepare: Callable[[Mesh], Prepared],
        span: tuple[float, float],
        knots: tuple[float, ...],
        conditions: Conditions[Any],
        base: Mesh | None = None,
        finer: Callable[[Mesh], Mesh] = lambda mesh: mesh,
        halvings: int = 0,
    ) -> None:
        self.mesh, self.span, self.knots = replace(mesh, stops=(), points=()), span, knots
        self._prepare, self._known = prepare, dict[Choice, Prepared]()
        self.unit, self.conditions = max(map(abs, span)), conditions
        self._base, self._finer = mesh if base is None else base, finer
        self.lying = conditions.lying(self.mesh, span, self._piece, 0.5**halvings)

    def prepared(self, choice: Choice = NOTHING) -> Prepared:
        """The model of a choice, ready to be solved."""
        if choice not in self._known:
            self._known[choice] = self._made(self.mesh, choice)
        return self._known[choice]

    def _made(self, mesh: Mesh, choice: Choice) -> Prepared:
        return self.conditions.made(self._prepare(replace(mesh, stops=choice.stops, points=choice.points)))

    def curve(self, choice: Choice) -> Curve:
        """The curve of a choice."""
        return Curve(self.prepared(choice), self.unit)

    # -- begin ----------------------------------------------------------------------------------

    def begin(self, first: Choice = NOTHING) -> tuple[First, tuple[str, ...]]:
        """Where the path begins, as of :func:`~sfetcas.solvers.beginning.begin_path`, in the choice that holds there.

        The search for it begins with ``first``; with notes.

        Raises
        ------
        SolveError
            There is no equilibrium to start from, or none that tells in which choice the path goes on.
        """
        if not self.conditions.any:
            curve, start, notes = begin_path(self.prepared(first), self.span)
            self.unit = curve.unit
            return First(curve, start), notes
        curve, start, notes = self.conditions.begin(self.prepared, self.span, first)
        self.unit = curve.unit
        if lies_along(start.model.mesh.points) and not self.conditions.remembers:
            laid = self._lying.at_factor(start, start.factor)
            if laid is None:
                detail = f"what lies along obstacles at factor {start.factor:g} was not found on the mesh of the path"
                raise SolveError(Status.FAILED, detail, start.state)
            return First(curve, laid), notes
        near = self.conditions.near(start.fields)
        if not near or self.conditions.remembers:
            return First(curve, start), notes
        up = 1.0 if self.span[1] > 0.0 else -1.0
        refused = self._refused(start, near)
        ways = [] if refused else self._ways(start, near, up, begins=True)
        if len(ways) != 1:
            why = refused or self._several(ways, near)
            raise SolveError(Status.FAILED, f"at its beginning {why}", start.state)
        return self._onward(ways[0]), notes

    def _refused(self, at: Standing, near: Sequence[Any]) -> str:
        """Why the path does not go on from a point beyond which some conditions change; empty where it may."""
        if len(near) > MOST:
            return f"{len(near)} {self.conditions.kinds} change at once, accepted: at most {MOST}"
        return self.conditions.refused(at.fields, near)

    def _onward(self, way: Way) -> First:
        """Where a way begins."""
        beyond = self.conditions.onward(way, self.curve, self.span)
        # Curves are kept without a piece: they are followed over all of them.
        return First(self.curve(way.choice), way.standing) if beyond is None else First(*beyond, way.standing)

    # -- along ----------------------------------------------------------------------------------

    def follow(self, first: First, count: int, missing: float = np.inf) -> Followed:
        """A path from a point on, over all changes of the choice; ``missing`` as of :func:`.trace`."""
        found, tried = Followed(), set[object]()
        watch, passed = (self._watched, self.conditions.passed) if self.conditions.any else (None, None)
        while True:
            left = max(1, count - found.count) if found.parts else count
            if self.conditions.remembers or lies_along(first.standing.model.mesh.points):
                onward = self._along_lines(found, first.standing, left)
                if onward is None:
                    return found
                first = onward
                continue
            curve = first.curve
            traced = self._until_flat(trace(curve, first.standing, self.span, left, self.knots, watch, missing, passed))
            found.parts.append(Part(curve, traced, first.begins))
            if traced.end != "margin":
                return found
            at, kind = traced.points[-1], Choice.of(curve.model.mesh).kind
            tried = {kind} if len(traced.points) > 1 else {*tried, kind}
            near = self.conditions.near(at.fields, traced.crossed)
            flat = self.conditions.flat((self.again(at) or at).fields, near)
            found.ending = self._refused(at, [] if flat else near)
            if found.ending:
                return found
            if flat:
                onward = self._lies_down(found, curve, at, traced.crossed, flat, left)
                if onward is None:
                    return found
                first = onward
                continue
            ways = self._ways(at, near, float(np.sign(at.tangent.factor)))
            if len(ways) != 1 or ways[0].choice.kind in tried:
                found.ending = self._several(ways, near)
                return found
            way = ways[0]
            turns = bool(at.tangent.factor * way.standing.tangent.factor < 0.0)
            changes = tuple(self.conditions.becomes(one, at.fields) for one in way.which)
            found.transitions.append(Transition(at, changes, turns, _said(at, way.standing, turns), traced.crossed))
            first = self._onward(way)

    @property
    def _lying(self) -> Lying:
        """What follows a path where members lie along obstacles."""
        assert self.lying is not None
        self.lying.unit = self.unit
        return self.lying

    def _lies_down(
        self,
        found: Followed,
        curve: Curve,
        at: Standing,
        crossed: tuple[int, ...],
        flat: Sequence[ContactPoint],
        count: int,
    ) -> First | None:
        """Add what follows a point at which members begin to lie along obstacles at some places; what begins then.

        None where the path ends.
        """
        if len(found.parts) > 1 and found.parts[-2].lies and len(found.parts[-1].traced.points) <= BRIEF:
            names = enumerated(sorted({f"contacts.{point.contact}" for point in flat}))
            found.ending = f"members lie along {names} without pressing, so that nothing tells which places touch"
            return None
        if any(any(point.slides) for point in flat):
            # Where elements do not end at a place the curvature is not known there.
            crossed = self.conditions.flats(at.fields)
            here = self._sought(curve, at, functools.partial(self._crossed, crossed), FLAT_FITS)
            fitted = self.again(at)
            if here is None and fitted is not None and not self.conditions.flat(fitted.fields):
                return First(Curve(fitted.prepared, self.unit), fitted)
            at = here or fitted or at
            found.parts[-1].traced.points[-1] = at
        told = tuple(dict.fromkeys(f"{p.members[0]} begins to lie along contacts.{p.contact}" for p in flat))
        found.transitions.append(Transition(at, told, False, (), crossed))
        return self._along_lines(found, replace(at), count)

    def _along_lines(self, found: Followed, start: Standing, count: int) -> First | None:
        """Add the part of a path along which members lie on obstacles, and the change at its end; what begins there.

        None where the path ends.
        """
        lying = self._lying
        traced = lying.traced(start, lambda at: self.conditions.flat(at.fields), count)
        found.parts.append(Part(lying.curve(start), traced, lies=True))
        notes = {True: (TURNS,), False: ()}
        found.transitions += [Transition(*corner, notes[corner.turns]) for corner in traced.corners]
        if self.conditions.remembers:
            return None
        names = sorted({f"contacts.{p.contact}" for point in traced.points for p in point.model.mesh.points})
        if traced.end == "lost":
            found.parts[-1] = replace(found.parts[-1], traced=replace(traced, end="margin"))
            found.ending = f"what lies along {enumerated(names)} is in balance nowhere near beyond it"
        if traced.end != "ceases":
            return None
        last, points = traced.points[-1], points_of(traced.points[-1])
        choice = Choice(points=points)
        curve, along = lying.along(last, self.prepared(choice))
        free = curve.corrected(self.conditions.carried(last, curve.prepared), last.factor, along, last.arc)
        if free is None:
            found.parts[-1] = replace(found.parts[-1], traced=replace(traced, end="lost"))
            return None
        at, crossed = self._begin_of(curve, free)
        found.parts[-1] = replace(found.parts[-1], traced=replace(traced, points=[*traced.points[:-1], at]))
        told = (f"nothing lies along {enumerated(names)} any more",)
        found.transitions.append(Transition(at, told, False, (), crossed))
        return First(self.curve(choice), replace(at))

    def _begin_of(self, curve: Curve, there: Standing) -> tuple[Standing, tuple[int, ...]]:
        """Where the choice of a point begins to hold, and the margins that vanish there; the point if not found."""
        back = replace(there, tangent=there.tangent.back)
        traced = trace(curve, back, self.span, BACK, self.knots, self._watched, np.inf, self.conditions.passed)
        if traced.end != "margin":
            return there, ()
        at = traced.points[-1]
        return replace(at, tangent=at.tangent.back, arc=2.0 * there.arc - at.arc), traced.crossed

    def _watched(self, standing: Standing) -> Array:
        """Margins (conditions,) of a point."""
        return self.conditions.watched(standing.fields)

    def _until_flat(self, traced: Traced) -> Traced:
        """A stretch up to the first point from which on members lie along something.

        That is seen where elements end at places: elsewhere curvatures are those of both sides of a force mixed.
        """
        flats = self.conditions.flats(traced.points[0].fields)
        for i, point in enumerate(traced.points[1:] if flats else (), start=1):
            fitted = self.again(point) if self.conditions.may_be_flat(point.fields) else None
            if fitted is not None and self.conditions.flat(fitted.fields):
                known = {id(one) for one in traced.points[:i]}
                events = [event for event in traced.events if id(event.standing) in known]
                return replace(traced, points=traced.points[: i + 1], events=events, end="margin", crossed=flats)
        return traced

    def crossings(self, followed: Followed, factors: tuple[float, ...]) -> list[Standing]:
        """The points at given factors, in their order along the path; where parts meet they are listed once."""
        found = list[Standing]()
        for part in followed.parts:
            first, begins = part.points[0], part is followed.parts[0]
            along = part.traced.points
            met = self._lying.crossings(along, factors) if part.lies else at_factors(part.curve, along, factors)
            if part.begins is not None:
                met = [*self._from(part.begins, part.curve, part.traced.points[0], factors), *met]
            found += [point for point in met if begins or point is not first]
        # A closed curve ends where it begins.
        last = followed.points[-1]
        return found[:-1] if followed.end == "closed" and last in found else found

    @staticmethod
    def _from(begins: Standing, curve: Curve, first: Standing, factors: tuple[float, ...]) -> list[Standing]:
        """The points at given factors from a change on, before the first one that is followed there."""
        low, high = sorted((begins.factor, first.factor))
        met = [factor for factor in factors if low < factor < high]
        start = [begins] if begins.factor in factors else []
        found = [
            *start,
            *(curve.at_factor(first, factor) for factor in sorted(met, reverse=bool(first.factor < begins.factor))),
        ]
        return [point for point in found if point is not None]

    # -- elements that end where something acts -------------------------------------------------

    def again(self, at: Standing, factor: float | None = None) -> Standing | None:
        """A point, that may be of another mesh, where elements end where something acts; None if it is not found.

        At a ``factor`` or, by default, across its tangent.
        """
        if self.conditions.remembers:
            return at
        if lies_along(at.model.mesh.points):
            return at if factor is None else self._lying.at_factor(at, factor)
        found: Standing | None = at
        for _ in range(FITS):
            mesh = self._fit(at.fields)
            own = at.model.mesh.same(replace(self.mesh, stops=at.model.mesh.stops, points=at.model.mesh.points))
            if mesh is self.mesh and own and factor in (None, at.factor):
                return found
            curve = self._on(mesh, at)
            found = self._onto(curve, at, factor)
            if found is None or mesh is self.mesh:
                return found
            at = found
        return found

    def _fit(self, fields: Fields) -> Mesh:
        """The mesh with elements that end where something acts at a state; itself where they need not."""
        fitted = self.conditions.fitted(self._base, fields)
        return self.mesh if fitted is self._base else self._finer(fitted)

    def _on(self, mesh: Mesh, at: Standing) -> Curve:
        """The curve of the choice of a point on a mesh."""
        choice = Choice.of(at.model.mesh)
        prepared = self.prepared(choice) if mesh is self.mesh else self._made(mesh, choice)
        return Curve(prepared, self.unit, self._piece(at.factor, float(np.sign(at.tangent.factor))))

    @staticmethod
    def _onto(curve: Curve, at: Standing, factor: float | None) -> Standing | None:
        """A point on the curve of another mesh."""
        state = transferred(at.model, at.state, curve.model)
        flat = Tangent(np.zeros(curve.equations.total), at.tangent.factor)
        if factor is not None:
            return curve.at_factor(replace(at, state=state, tangent=flat), factor)
        across = curve.standing(state, at.factor, flat).tangent
        return curve.corrected(state, at.factor, across, at.arc)

    def located(self, followed: Followed) -> Followed:
        """A path whose events and transitions are located where elements end where something acts then."""
        if self.conditions.remembers:
            return followed
        parts, transitions = list[Part](), list[Transition]()
        following = [*followed.parts[1:], followed.parts[-1]]
        for part, after, change in itertools.zip_longest(followed.parts, following, followed.transitions):
            found, events = dict[int, Standing](), list[Event]()
            for event in part.traced.events:
                seek_event = functools.partial(_event_of, event.kind)
                there = event if part.lies else self._sought(part.curve, event.standing, seek_event) or event
                events.append(there)
                found[id(event.standing)] = there.standing
            if change is not None:
                seek = functools.partial(self._crossed, change.crossed)
                # Where lines end it is the choice beyond that has margins.
                on = after.curve if part.lies else part.curve
                own = change.standing.prepared is on.prepared
                last = (self._sought(on, change.standing, seek) if own else None) or change.standing
                transitions.append(replace(change, standing=last))
                found[id(change.standing)] = last
            points = [found.get(id(point), point) for point in part.traced.points]
            parts.append(replace(part, traced=replace(part.traced, points=points, events=events)))
        return replace(followed, parts=parts, transitions=transitions)

    def fitted(self, followed: Followed) -> Followed:
        """A path all of whose points, but those that are located, are where elements end where something acts."""
        known = {id(event.standing) for event in followed.events} | {id(t.standing) for t in followed.transitions}

        start, ends = followed.points[0], (*self.span, *self.knots)

        def again(point: Standing) -> Standing:
            factor = point.factor if point is start or point.factor in ends else None
            return point if id(point) in known else self.again(point, factor) or point

        parts = list[Part]()
        for part in followed.parts:
            begins = None if part.begins is None else again(part.begins)
            traced = replace(part.traced, points=[again(point) for point in part.traced.points])
            parts.append(replace(part, traced=traced, begins=begins))
        return replace(followed, parts=parts)

    def _sought(
        self, curve: Curve, at: Standing, seek: Callable[[Curve, Standing, Standing], S | None], times: int = FITS
    ) -> S | None:
        """What is sought between two points beside one where elements end where something acts; None if not found."""
        found: S | None = None
        for _ in range(times):
            mesh = self._fit(at.fields)
            if mesh is self.mesh:
                break
            there = self._on(mesh, at)
            found = self._beside(curve, at, there, seek) or found
            if found is None:
                break
            curve, at = there, found.standing if isinstance(found, Event) else found
        return found

    def _beside(
        self, curve: Curve, at: Standing, there: Curve, seek: Callable[[Curve, Standing, Standing], S | None]
    ) -> S | None:
        """What is sought on a curve of another mesh beside a point."""
        for reach in BESIDE:
            ways = (-reach, reach)
            own = [curve.corrected(*curve.predicted(at, way), at.tangent, at.arc + way) for way in ways]
            a, b = (None if point is None else self._onto(there, point, None) for point in own)
            found = None if a is None or b is None else seek(there, a, b)
            if found is not None:
                return found
        return None

    def _crossed(self, crossed: Sequence[int], curve: Curve, a: Standing, b: Standing) -> Standing | None:
        """Where the first of some margins vanishes between two points."""
        points = [sought(curve, a, b, lambda point, i=i: float(self._watched(point)[i])) for i in crossed]  # type: ignore[misc]
        zero = [p for p, i in zip(points, crossed, strict=True) if p is not None and abs(self._watched(p)[i]) <= NEAR]
        return min(zero, key=lambda point: point.arc, default=None)

    # -- over a change --------------------------------------------------------------------------

    def _ways(self, at: Standing, near: Sequence[Any], sign: float, *, begins: bool = False) -> list[Way]:
        """The ways on from a point at which some conditions have no margin, with the sign of the factor's rate so far.

        A choice holds along each; those that go the same way are one, in the choice with the fewest changes.
        """
        acting = [one for one in near if self.conditions.active(one, at.fields)]
        unique = self.conditions.convex(near) and self._has_minimum(at, acting)
        found: list[Way] = []
        # What has led to the end of its choice cannot go on in it.
        for size in range(0 if begins else 1, len(near) + 1):
            for which in itertools.combinations(near, size):
                for ahead in (sign,) if unique or begins else (sign, -sign):
                    way = self._way(at, which, ahead)
                    if way is None or min(self._rates(way, near)) < -FLAT:
                        continue
                    if not any(_alike(way, other) for other in found):
                        found.append(way)
                    if unique:
                        return found
        return found

    def _has_minimum(self, at: Standing, active: Sequence[Any]) -> bool:
        """Whether the energy has a strict minimum at a point without some of what is active."""
        way = self._way(at, active, 1.0, regular=False)
        if way is None or not way.curve.model.conservative:
            return False
        return not way.standing.inertia.negative and not way.standing.inertia.zero

    def _way(self, at: Standing, which: Sequence[Any], sign: float, *, regular: bool = True) -> Way | None:
        """The way on in a choice with a rising or falling factor; None where what is left is singular in it, or locked.

        Motions that are neutral in the choice before are so in any that has fewer active constraints.
        """
        choice = self.conditions.switched(at.fields, which)
        if choice is None:
            return None
        prepared = self.prepared(choice)
        curve = Curve(prepared, self.unit, self._piece(at.factor, sign))
        state = self.conditions.carried(at, prepared)
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
        # What nothing holds along the way is in balance nowhere beyond.
        if regular and curve.corrected(state, factor, here.tangent, sharp=False) is None:
            return None
        return Way(tuple(which), choice, curve, replace(here, arc=at.arc))

    def _piece(self, factor: float, sign: float) -> tuple[float, float]:
        """Factors without a knot of a history, on the side to which the factor goes."""
        if not self.prepared().model.scene.histories:
            return -np.inf, np.inf
        ends = (self.span[0], *self.knots, self.span[1])
        within = min(max(factor, ends[0]), ends[-1])
        pieces = [(a, b) for a, b in itertools.pairwise(ends) if a <= within <= b]
        return pieces[-1 if sign > 0.0 else 0]

    def _rates(self, way: Way, which: Sequence[Any]) -> list[float]:
        """Rates of margins by the arc length."""
        curve, here = way.curve, way.standing
        ends = []
        for length in (STEP, -STEP):
            state, factor = curve.predicted(here, length)
            ends.append(self.conditions.margin(Fields(curve.equations, state, curve.loading(factor)), which))
        return ((ends[0] - ends[1]) / (2.0 * STEP)).tolist()

    def _several(self, ways: Sequence[Way], near: Sequence[Any]) -> str:
        """Why no way is chosen."""
        names = enumerated(list(dict.fromkeys(map(self.conditions.where, near))))
        if len(ways) < 2:
            return f"no choice of {self.conditions.choosing} leads on: {names}"
        told = ["; ".join(self.conditions.told(one, way.choice) for one in near) for way in ways]
        return f"{len(ways)} ways lead on, and the path branches: {' or '.join(told)}"


def _event_of(kind: str, curve: Curve, a: Standing, b: Standing) -> Event | None:
    """The first event of a kind between two points."""
    return next((event for event in events_between(curve, a, b) or [] if event.kind == kind), None)


def _alike(a: Way, b: Way) -> bool:
    """Whether two ways go the same way, in rotations and the factor."""
    turns, unit = a.curve.equations.rotation_unknowns, a.curve.unit
    one, other = a.standing.tangent, b.standing.tangent
    apart, weight = one.z[:turns] - other.z[:turns], a.curve.weight[:turns]
    return float(apart @ (weight * apart)) + ((one.factor - other.factor) / unit) ** 2 <= ALIKE**2


def _said(before: Standing, after: Standing, turns: bool) -> tuple[str, ...]:
    """What has to be known of a transition."""
    notes: tuple[str, ...] = (TURNS,) if turns else ()
    ways = [standing.inertia.negative for standing in (before, after)]
    if before.model.conservative and ways[0] != ways[1]:
        notes += (f"the number of unstable directions changes from {ways[0]} to {ways[1]}",)
    return notes
