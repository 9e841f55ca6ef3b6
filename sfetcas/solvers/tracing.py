"""Tracing a curve of equilibria step by step, with its limit and bifurcation points.

A step is taken back and halved where Newton's method does not lead to the curve soon, where the curve turns, where
what is found is far from what was expected, or where more eigenvalues change their signs than one step explains:
then it may have jumped over a fold or to another branch.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..errors import SolveError
from ..mathematics.arrays import TINY, Array
from ..mathematics.core import Curve as CoreCurve
from ..mechanics.equations import State
from .arclength import PASSING, Curve, Standing, Tangent
from .continuation import advanced
from .critical import LARGEST_PRIMAL_FACTOR, ONE_EVENT, Event, events_between, sought
from .newton import largest_rotation
from .residuals import relative_residual

__all__ = [
    "FAR",
    "FINE",
    "FIRST",
    "SHARE",
    "SHORTEST",
    "STRIDE",
    "TURNING",
    "Corner",
    "Traced",
    "full_shape",
    "longest",
    "passes",
    "switched",
    "trace",
    "without",
]

TURNING = 0.25
"""Angle between the tangents of neighbouring points, rad, that steps aim at."""

SHARPEST = 2.5
"""More than this many times that angle is too much."""

STRIDE = 0.35
"""No node turns by more than this in a step, rad."""

SHARE = 30
"""No step takes more than this part of the range."""

FAR = 0.5
"""A point farther from the expected one than this share of the step is not on the same curve."""

CORNER = 50.0
"""The same where places begin to yield: the tangent of the angle between two tangents, times that of the rotations."""

SHORTEST = 1e-7
"""Shorter steps, rad or shares of the unit, end a curve."""

FINE = 1e-4
"""Below this length a step may meet several eigenvalues at once."""

TOUCH = 3.0 * FINE
"""Where an eigenvalue only touches zero, its sign may be seen to change and change back within this length."""

FIRST = 0.1
"""Length of the first step, rad or shares of the unit."""

SPREAD = 0.05
"""Steps may leave out as much of what members remember as if they were longer by this: rates jump at corners."""

BLURRED = 1e-10
"""What steps leave out of what members remember is rounding up to this, rad."""

MOST_AT_ONCE = 6
"""So many eigenvalues at most change their signs at once: more do so where a mesh is too coarse for what it carries."""

SEARCHED = 200
"""Points at which critical ones may be looked for, or as many as a curve may have if these are more.

A bifurcation takes five to fifteen; more are needed only where rounding makes bifurcations that there are not.
"""

EXPECTED = 3
"""Newton iterations of a step that is as long as it should be."""

AT_ONCE = 32
"""Points that the core finds in one call, at most."""

BEFORE = 2
"""Steps of a stretch on which something is watched before the core is asked for more."""

LOOP = 8
"""Points before a curve may close: fewer make no loop."""

ONE_POINT = 1e-5
"""Points that differ by less, rad or shares of the factor, are one: Newton's method leaves far less."""

WALKS = 6
"""Steps of Newton's method along a curve to the place next to a point."""

CROSSED = 1e-9
"""A margin is below zero where it is by more than this: rounding leaves less of one that stays zero."""

UNCLEAR = 1e-7
"""Where a margin is to vanish it is below this: rounding leaves far less, even of reactions of stiff structures."""

MEETING = 1e-3
"""Bifurcations on two curves are one within this, rad: rounding moves them along the shape that is open there."""


class Corner(NamedTuple):
    """A point at which a curve goes on in another direction.

    Attributes
    ----------
    standing : Standing
        The point, before it does.
    changes : tuple of str
        What happens, a sentence each.
    turns : bool
        Whether the factor turns there.
    """

    standing: Standing
    changes: tuple[str, ...]
    turns: bool


@dataclass(frozen=True, eq=False)
class Traced:
    """A stretch of a curve.

    Attributes
    ----------
    points : list of Standing
        In their order, limit and bifurcation points among them.
    events : list of Event
    end : str
        Why it ends: ``range`` (the factor leaves it), ``points`` (as many as asked for), ``closed`` (the last point is
        the first one again), ``lost`` (no further point was found), ``bent`` (it is beyond what the scene
        describes), ``margin`` (one that is watched is zero at the last point), or ``away`` (beyond that it slides away
        at the same factor).
    limit : SolveError or None
        Where it ends ``bent``: what is beyond its limits.
    near : tuple of float
        Factors at which it comes so near to another curve that a step led there at first.
    crossed : tuple of int
        Where it ends ``margin``: which of the margins are zero there and below beyond it.
    missed : float
        What its steps together leave out of what members remember, rad, see :meth:`.Curve.missed`.
    corners : list of Corner
        Where what touches changes within it.
    """

    points: list[Standing]
    events: list[Event]
    end: str
    limit: SolveError | None = None
    near: tuple[float, ...] = ()
    crossed: tuple[int, ...] = ()
    missed: float = 0.0
    corners: Sequence[Corner] = ()


def trace(
    curve: Curve,
    start: Standing,
    span: tuple[float, float],
    count: int,
    knots: tuple[float, ...] = (),
    watch: Callable[[Standing], Array] | None = None,
    missing: float = np.inf,
    passed: Callable[[Standing, Standing], bool] | None = None,
) -> Traced:
    """Follow a curve from a point until the factor leaves the span, or for so many points.

    At the knots of histories the curve has a corner: it is followed from one to the next.  ``watch`` gives the margins
    of a point (n,), dimensionless: where one of them falls below zero the curve ends.  ``passed`` says whether
    something has passed through something else between two neighbours: then the step was too long.  Where members have
    memory each point is one that the next remembers; a step leaves out ``missing`` of that, over its length, at most.
    """
    usual = start.inertia.zero
    start = curve.without_neutral(start) if usual and start.tangent.neutral is None else start
    traced = Traced([start], [], "range")
    stops = [span[0], *knots, span[1]]
    while traced.end == "range":
        now = traced.points[-1]
        pieces = [(a, b) for a, b in zip(stops, stops[1:], strict=False) if a <= now.factor <= b]
        ahead = [(a, b) for a, b in pieces if now.factor != (b if now.tangent.factor > 0.0 else a)]
        if not ahead:
            break
        here = curve.within(ahead[0]) if curve.model.scene.histories else curve
        if here is not curve:
            along = replace(now.tangent, z=np.zeros_like(now.tangent.z))
            now = here.standing(now.state, now.factor, along, arc=now.arc, iterations=now.iterations)
        if curve.remembers:
            here = here.following(now)
            now = _leaving(here, now)
        stride = (span[1] - span[0]) / SHARE
        more = count - len(traced.points) + len(traced.events)
        budget = here.searched + max(SEARCHED, more)
        piece = _Piece(here, ahead[0], stride, more, budget, [now], watch=watch, missing=missing, passed=passed)
        part = piece.traced()
        # A path that touches the end of its range may be singular there, and rounding puts that beyond.
        events = [event for event in part.events if span[0] <= event.standing.factor <= span[1]]
        outside = {id(event.standing) for event in part.events} - {id(event.standing) for event in events}
        points = [point for point in part.points[1:] if id(point) not in outside]
        near = traced.near + part.near
        missed = traced.missed + part.missed
        traced = Traced(
            traced.points + points, traced.events + events, part.end, part.limit, near, part.crossed, missed
        )
        curve = curve.on(points[-1].prepared) if points else curve
    return _with_crossed_folds(traced, usual)


def _leaving(curve: Curve, now: Standing) -> Standing:
    """A point with the tangent by which a path leaves it where loads may turn: some places yield, others unload.

    ``curve`` remembers what has led to the point.  Its tangent there is elastic; that shortly beyond is the one.
    """
    rest = curve.standing(now.state, now.factor, replace(now.tangent, z=np.zeros_like(now.tangent.z)), arc=now.arc)
    beyond = curve.corrected(*curve.predicted(rest, FINE), rest.tangent)
    if beyond is None:
        return rest
    return replace(rest, tangent=beyond.tangent, known=beyond.point, doubtful=beyond.doubtful)


def _with_crossed_folds(traced: Traced, usual: int) -> Traced:
    """A stretch in which folds of the factor at which no eigenvalue changes its sign are bifurcations.

    Another curve crosses there, of which this one is the branch to both sides.  The eigenvalue only touches zero, so
    its sign may be seen to change and change back beside the fold.
    """
    events = {id(event.standing): event for event in traced.events}
    points, firm = [traced.points[0]], 0
    for i, point in enumerate(traced.points[1:], start=1):
        if id(point) in events or (point.inertia.zero > usual and i + 1 < len(traced.points)):
            continue
        between = traced.points[firm + 1 : i]
        met = [events[id(p)] for p in between if id(p) in events]
        folds = [event for event in met if event.kind == "limit"]
        even = (point.inertia.negative - traced.points[firm].inertia.negative) % 2 == 0
        if folds and even and met[-1].standing.arc - met[0].standing.arc < TOUCH:
            for event in met:
                del events[id(event.standing)]
            between = [folds[0].standing]
            events[id(between[0])] = Event("bifurcation", between[0])
        points += [*between, point]
        firm = i
    points += traced.points[firm + 1 :]
    order = [events[id(point)] for point in points if id(point) in events]
    return replace(traced, points=points, events=order)


def without(traced: Traced, known: Sequence[Standing]) -> Traced:
    """A stretch without the bifurcations at points that are known already, as those of the curve it branches off."""

    def is_known(event: Event) -> bool:
        return event.kind == "bifurcation" and any(_meets(event.standing, other) for other in known)

    repeated = {id(event.standing) for event in traced.events if is_known(event)}
    points = [point for point in traced.points if id(point) not in repeated]
    return replace(traced, points=points, events=[e for e in traced.events if id(e.standing) not in repeated])


def _meets(a: Standing, b: Standing) -> bool:
    level = abs(a.factor - b.factor) <= ONE_POINT * max(abs(a.factor), abs(b.factor))
    return level and a.prepared.distance(a.state, b.state) <= MEETING


def passes(curve: Curve, traced: Traced, point: Standing) -> bool:
    """Whether a stretch leads through an equilibrium, in either direction."""
    near = min(traced.points, key=lambda p: _apart(curve, p, point))
    ahead = curve.way(near, point)
    beyond = (near is traced.points[0] and ahead < 0.0) or (near is traced.points[-1] and ahead > 0.0)
    if beyond and traced.end != "closed":
        return False
    for _ in range(WALKS):
        way = curve.way(near, point)
        there = curve.corrected(*curve.predicted(near, way), near.tangent)
        if there is None or _apart(curve, there, point) >= _apart(curve, near, point):
            break
        near = there
    return _apart(curve, near, point) < ONE_POINT


def _apart(curve: Curve, a: Standing, b: Standing) -> float:
    return curve.prepared.distance(a.state, b.state) + abs(a.factor - b.factor) / curve.unit


@dataclass(eq=False)
class _Piece:
    """A stretch of a curve within one piece of the histories, in steps that change the factor by a stride at most.

    ``more`` is the number of steps that are still to be taken, ``budget`` the value of ``curve.searched`` at which the
    stretch is given up; ``missing``, ``missed`` and ``passed`` are as of :func:`trace` and :class:`Traced`.  ``curve``
    is that on which the next step goes.  ``asks`` is the number of points that the core is asked for next where they
    are watched, ``waits`` the number of steps until it is asked, ``vain`` how often in a row it found none.
    """

    curve: Curve
    span: tuple[float, float]
    stride: float
    more: int
    budget: int
    points: list[Standing]
    events: list[Event] = field(default_factory=list)
    before: Standing | None = None
    end: str = ""
    limit: SolveError | None = None
    near: list[float] = field(default_factory=list)
    watch: Callable[[Standing], Array] | None = None
    crossed: tuple[int, ...] = ()
    missing: float = np.inf
    missed: float = 0.0
    passed: Callable[[Standing, Standing], bool] | None = None
    waits: int = 0
    vain: int = 0
    asks: int = 1

    def traced(self) -> Traced:
        """The stretch from its first point on."""
        # What is watched is often met soon.
        self.waits = 0 if self.watch is None else BEFORE
        _, arrived = advanced(self.points[0], FIRST, self.trial, lambda _: self.ended(), shortest=SHORTEST)
        end, near = self.end if arrived else "lost", tuple(self.near)
        crossed = self.crossed if end == "margin" else ()
        return Traced(self.points, self.events, end, self.limit, near, crossed, self.missed)

    def ended(self) -> bool:
        """Whether no further step is to be taken; ``end`` says why not."""
        if not self.end and self.more <= 0:
            self.end = "points"
        elif not self.end and self.curve.searched > self.budget:
            self.end = "lost"
        return bool(self.end)

    def trial(self, now: Standing, length: float) -> tuple[Standing | None, float]:
        """The next point, None if the step is refused, and the length of the next step."""
        length = self.plainly(now, length)
        if self.points[-1] is not now:
            return self.points[-1], length
        curve, length = self.curve, min(length, longest(self.curve, now, self.stride))
        there, left = _ahead(curve, now, self.before, length, self.span)
        if there is not None and self.passed is not None and self.passed(now, there):
            return None, 0.5 * length
        there = None if there is None else self._within_margins(now, there)
        corner = there is None and curve.remembers and 0.5 * length <= SHORTEST
        if corner:
            there, length = curve.around(now, FINE), FINE
        if there is None or (corner and not self.span[0] <= there.factor <= self.span[1]):
            return None, 0.0 if corner else 0.5 * length
        missed = curve.missed(now, there)
        if missed > max(self.missing * (there.arc - now.arc + SPREAD), BLURRED) and length >= FINE and not corner:
            return None, 0.5 * length
        if there is now:
            self.end = "margin"
            return there, 0.0
        self.limit = curve.beyond_limits(there)
        if self.limit is not None:
            self.end = "bent"
            return there, 0.0
        start, last = self.points[0], self.points[-1]
        # What remembers does not come back to where it began.
        closes = not (left or self.crossed or curve.remembers) and len(self.points) >= LOOP
        closed = closes and _closes(curve, start, now, there)
        ends = _to_start(curve, start, now, there) if closed else [there]
        between = [[]] if corner else [events_between(curve, *pair) for pair in pairwise([last, *ends])]
        if corner and now.tangent.factor * there.tangent.factor < 0.0 and now is not start:
            # It lies as near before the corner as steps can be short.
            self.events.append(Event("limit", now))
        if None in between:
            if not self.near or abs(self.near[-1] - now.factor) > abs(there.factor - now.factor):
                # Of shorter steps to the same place only the first is new.
                self.near.append(now.factor)
            if length >= FINE:
                return None, 0.5 * length
        for end, events in zip(ends, between, strict=True):
            # A point that is met by chance may be the limit point itself.
            met = [event for event in events or [] if event.standing is not self.points[-1]]
            self.events += met
            self.points += [event.standing for event in met if event.standing is not end] + [end]
        self.end = "margin" if self.crossed else "range" if left else "closed" if closed else ""
        self.before, self.more, self.missed = now, self.more - 1, self.missed + missed
        self.curve = curve.following(there)
        return there, 0.0 if self.end else length * _growth(curve, now, there)

    def plainly(self, now: Standing, length: float) -> float:
        """Steps that the core takes by itself, whose points are added, and the length of the next step.

        It takes the decisions of :meth:`trial`, as long as nothing is met and no eigenvalue is near to zero.  Where its
        first step is not plain it is asked again after as many steps as it has been asked in vain.
        """
        if now is not self.points[-1] or not self.curve.for_steps:
            return length
        if self.waits:
            self.waits -= 1
            return length
        rules = core_rules(length, self.span, self.stride, len(self.points) - 1)
        watched = self.watch is not None or self.passed is not None
        most = min(self.more, self.asks if watched else AT_ONCE)
        found = self.curve.plain_steps(rules, self.points[0], self.before, now, most)
        full, length = rules.points == rules.room, rules.length
        for count, (a, b) in enumerate(pairwise([now, *found])):
            if self._meets(a, b):
                found, full, length = found[:count], False, b.arc - a.arc
                break
        if found:
            self.before = found[-2] if len(found) > 1 else now
            self.points += found
            self.more -= len(found)
        # What is beyond something that is met has been found in vain.
        self.asks = min(2 * self.asks, AT_ONCE) if full else 1
        # The step at which it ended is not plain.
        self.vain = 0 if found else self.vain + 1
        self.waits = max(self.vain - 1, int(bool(found) and not full))
        return length

    def _meets(self, now: Standing, there: Standing) -> bool:
        """Whether a step leads through something, beyond a margin, or beyond what the scene describes."""
        through = self.passed is not None and self.passed(now, there)
        crossed = self.watch is not None and (self.watch(there) < -CROSSED).any()
        return bool(through or crossed) or self.curve.beyond_limits(there) is not None

    def _within_margins(self, now: Standing, there: Standing) -> Standing | None:
        """The point at the end of a step, or the first one before it at which a margin vanishes; None if not found."""
        self.crossed, watch = (), self.watch
        if watch is None:
            return there
        found: dict[int, Standing] = {}
        unclear: list[int] = []
        for i in np.flatnonzero(watch(there) < -CROSSED).tolist():
            zero = sought(self.curve, now, there, lambda standing, i=i: float(watch(standing)[i]))  # type: ignore[misc]
            if zero is None or abs(watch(zero)[i]) > UNCLEAR:
                unclear.append(i)
            else:
                found[i] = zero
        first = min(found.values(), key=lambda standing: standing.arc, default=there)
        # What is beyond the first one may have leapt.
        if unclear and (first is there or (watch(first)[unclear] < -CROSSED).any()):
            return None
        if first is there:
            return there
        together = first.arc + ONE_EVENT * (there.arc - now.arc)
        self.crossed = tuple(i for i, standing in found.items() if standing.arc <= together)
        return first


def core_rules(length: float, span: tuple[float, float], stride: float, known: int) -> CoreCurve:
    """What rules steps by the core: the length of the first, the range of factors, and by how much one changes these.

    ``known`` is the number of points before the one from which steps go on.
    """
    return CoreCurve(
        low=span[0],
        high=span[1],
        stride=stride,
        longest=STRIDE,
        shortest=SHORTEST,
        turning=TURNING,
        sharpest=np.cos(SHARPEST * TURNING),
        far=FAR,
        effort=2.0 ** (EXPECTED + 0.5),
        known=known,
        loop=LOOP,
        length=length,
    )


def _closes(curve: Curve, start: Standing, now: Standing, there: Standing) -> bool:
    """Whether the curve has come back to where it began, in the same direction."""
    step = 1.2 * curve.prepared.distance(now.state, there.state)
    near = curve.prepared.distance(start.state, there.state) < step
    level = abs(there.factor - start.factor) <= 1.2 * abs(there.factor - now.factor) + 1e-9 * curve.unit
    return near and level and curve.inner(start.tangent, there.tangent) > 0.9


def _to_start(curve: Curve, start: Standing, now: Standing, there: Standing) -> list[Standing]:
    """The last points of a curve that closes: the start again, after the point that came near it if that is before."""
    way = curve.way(there, start)
    if way > 0.0:
        return [there, replace(start, arc=there.arc + way)]
    return [replace(start, arc=now.arc + curve.way(now, start))]


def longest(curve: Curve, now: Standing, stride: float) -> float:
    """The longest step from a point: no node turns by more than a stride, nor does the factor change by more."""
    turning = largest_rotation(curve.equations, now.tangent.z)
    return min(STRIDE / max(turning, TINY), stride / max(abs(now.tangent.factor), TINY))


def _ahead(
    curve: Curve, now: Standing, before: Standing | None, length: float, span: tuple[float, float]
) -> tuple[Standing | None, bool]:
    """The point at a length ahead, None if it is not found on the same curve; and whether it is the end of the span."""
    expected, factor = curve.predicted(now, length, None if before is None else curve.bend(before, now))
    there = curve.corrected(expected, factor, now.tangent, now.arc + length, sharp=False)
    if there is None or not _same_curve(curve, now, there, expected, length):
        return None, False
    inside = span[0] <= there.factor <= span[1]
    return (there, False) if inside else (_at_end(curve, now, there, span), True)


def _same_curve(curve: Curve, now: Standing, there: Standing, expected: State, length: float) -> bool:
    # Where many places begin to yield at once there is a corner, however short the step.
    corner = curve.remembers and length < FINE
    if curve.inner(now.tangent, there.tangent) < np.cos(SHARPEST * TURNING) and not corner:
        return False
    turned = length * largest_rotation(curve.equations, now.tangent.z)
    if curve.prepared.distance(expected, there.state) > (CORNER if corner else FAR) * turned + SHORTEST:
        return False
    folded = now.tangent.factor * there.tangent.factor < 0.0
    changed = abs(there.inertia.negative - now.inertia.negative)
    plausible = changed == 1 if folded else changed <= 2
    return plausible or (length < FINE and changed <= MOST_AT_ONCE)


def _at_end(curve: Curve, now: Standing, there: Standing, span: tuple[float, float]) -> Standing | None:
    """The point of the curve at the end of the span that lies before a point beyond it."""
    end = span[1] if there.factor > span[1] else span[0]
    a, b = now, there
    for _ in range(60):
        share = (end - a.factor) / (b.factor - a.factor) if b.factor != a.factor else 0.5
        found = curve.between(now, there)(a.arc - now.arc + min(max(share, 0.0), 1.0) * (b.arc - a.arc))
        if found is None:
            return None
        exact = curve.at_factor(found, end) if abs(found.factor - end) <= 0.01 * curve.unit else None
        if exact is not None:
            return exact
        a, b = (found, b) if span[0] <= found.factor <= span[1] else (a, found)
    return None


def _growth(curve: Curve, now: Standing, there: Standing) -> float:
    """How much longer the next step may be."""
    cosine = min(1.0, curve.inner(now.tangent, there.tangent))
    by_angle = TURNING / max(np.arccos(cosine), 1e-12)
    by_effort = 2.0 ** (EXPECTED + 0.5 - there.iterations)
    return float(np.clip(min(by_angle, by_effort), 0.3, 2.0))


def switched(curve: Curve, event: Event, shapes: Array, side: int, number: int = 1) -> Standing | None:
    """The first point on the branch that crosses at a bifurcation, looking away from it.

    The branch is looked for across one of the singular shapes, with the ``number``, at growing distances: there the
    share of the shape is given and the factor is unknown, while the curve that was followed has no such point.  Where
    other eigenvalues vanish as well, no step goes along their shapes at first: if all is in balance then, each
    combination of them leads to a branch like this one, and it goes along none of the others.

    Parameters
    ----------
    shapes : ndarray (rotation unknowns, multiplicity)
        As of :func:`~sfetcas.solvers.critical.shapes_at`.
    side : int
        1 or -1: in which direction along the shape.
    """
    here = event.standing
    across = full_shape(curve, here, shapes[:, number - 1])
    across = replace(across, z=side * across.z, factor=side * across.factor)
    others = np.delete(shapes, number - 1, axis=1)
    alone = replace(across, neutral=curve.neutral(here.point, others, LARGEST_PRIMAL_FACTOR)) if others.size else across
    for length in (0.01, 0.02, 0.04, 0.08, 0.16, 0.3):
        state, factor = curve.predicted(replace(here, tangent=across), length)
        for tangent in (alone, across) if others.size else (across,):
            found = curve.corrected(state, factor, tangent, length)
            if found is None or curve.inner(found.tangent, across) <= 0.3:
                continue
            if tangent is across or relative_residual(curve.equations, found.point) <= PASSING:
                return replace(found, arc=length)
    return None


def full_shape(curve: Curve, here: Standing, shape: Array) -> Tangent:
    """A direction across the curve: a shape (rotation unknowns,) with its displacements and multipliers."""
    along = curve.normed(Tangent(curve.neutral(here.point, shape[:, None], LARGEST_PRIMAL_FACTOR).motions[:, 0], 0.0))
    share = curve.inner(along, here.tangent)
    mixed = Tangent(along.z - share * here.tangent.z, along.factor - share * here.tangent.factor)
    return curve.normed(mixed)
