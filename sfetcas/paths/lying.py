"""Paths along which members lie on obstacles: lines begin, grow, part and end from one point to the next.

Which of the forces along a line push changes at each end of elements that it comes to, so between its points such a
stretch of a path is smooth in pieces only.  Each point is found as a load step is, see
:class:`~sfetcas.contact.member_contact.MemberContact`: what pushes is solved for, and elements end where lines do.  But
the factor is an unknown, and the point lies across the tangent at the one before.  The tangent is that of what pushes
there: where a line ends the curvature of the gap is zero, so to first order nothing depends on where it ends.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..contact.lines import Points, lies_along, points_of
from ..contact.member_contact import FITS, MemberContact
from ..mathematics.arrays import TINY, Array
from ..mechanics.fields import transferred
from ..mechanics.loading import Loading
from ..mechanics.mesh import ContactPoint, Mesh
from ..mechanics.model import Model
from ..solvers.arclength import Curve, Standing, Tangent
from ..solvers.between_states import turned_between
from ..solvers.critical import Event, root
from ..solvers.prepared import Prepared, Solved
from ..solvers.tracing import FIRST, SHORTEST, STRIDE, TURNING, Traced, longest

__all__ = ["LEVEL", "SHARE", "SHARPEST", "Lying", "Piece"]

Piece = Callable[[float, float], tuple[float, float]]
"""(factor, sign of its rate) -> range of factors without a knot of a history."""

ASIDE = 1e-6
"""Arc length over which a tangent is taken to another mesh, as a difference of states whose rounding is 1e-14."""

BEGINS = 0.02
"""Length of a line when it begins, over that of its member: where it ends is found from there."""

SHARPEST = 2.5
"""More than this many times the angle that steps aim at is too much: the point is on another branch."""

SHARE = 12
"""No step takes more than this part of the range: points cost some ten times those of other paths."""

LEVEL = 1e-8
"""Rate of the factor by the arc length, over the unit of the factor, that is none: there the path turns.

The factor then is off by the square of it.
"""


class Lying:
    """Stretches of a path along which members lie on obstacles.

    Parameters
    ----------
    run : MemberContact
        The search for what touches.
    mesh : Mesh
        The elements, but for those that lines need.
    span : (low, high)
        Range of factors.
    piece : callable
        Range of factors without a knot of a history around a factor, in the direction of its rate.
    finer : float
        As of :class:`~sfetcas.contact.lines.Lines`.

    Attributes
    ----------
    unit : float
        As of :class:`~sfetcas.solvers.arclength.Curve`.
    """

    def __init__(
        self,
        run: MemberContact,
        mesh: Mesh,
        span: tuple[float, float],
        piece: Piece,
        finer: float = 1.0,
    ) -> None:
        self.run, self.mesh, self.span, self.piece = run, mesh, span, piece
        self.finer, self.unit = finer, 1.0

    # -- one point ------------------------------------------------------------------------------

    def curve(self, at: Standing) -> Curve:
        """The curve of what pushes at a point."""
        return Curve(at.prepared, self.unit, self.piece(at.factor, at.tangent.factor))

    def ahead(
        self, now: Standing, length: float, begins: Sequence[ContactPoint] = (), fits: int = 1
    ) -> Standing | None:
        """The point at a length ahead of another one, with lines that begin at some places; None if it is not found."""
        self.run.across = functools.partial(self.along, now)
        try:
            found = self._found(self._predicted(now, length), now, begins, fits)
        finally:
            self.run.across = None
        if found is None:
            return None
        curve, direction = self.along(now, found.prepared)
        return curve.standing(found.state, found.factor, direction, arc=now.arc + length)

    def at_factor(self, near: Standing, factor: float) -> Standing | None:
        """The point at a factor, from one near to it; None if it is not found."""
        rate = near.tangent.factor
        length = (factor - near.factor) / rate if rate else 0.0
        length = float(np.clip(length, -STRIDE, STRIDE))
        source = replace(self._predicted(near, length), loading=self.curve(near).loading(factor))
        found = self._found(source, near, (), FITS)
        if found is None:
            return None
        curve, along = self.along(near, found.prepared)
        return curve.standing(found.state, factor, along, arc=near.arc + length)

    def _predicted(self, now: Standing, length: float) -> Solved:
        """What is expected at a length ahead of a point."""
        curve = self.curve(now)
        state, factor = curve.predicted(now, length)
        loading = curve.loading(factor)
        return Solved.taken(now.prepared, state, loading)

    def along(self, now: Standing, prepared: Prepared) -> tuple[Curve, Tangent]:
        """The curve of another model, and on it the tangent at a point: its rotations and its factor."""
        curve, z = self.turning(now, prepared)
        return curve, curve.normed(Tangent(z, now.tangent.factor))

    def turning(self, now: Standing, prepared: Prepared) -> tuple[Curve, Array]:
        """The curve of another model, and the rates (total,) of its rotations by the arc length at a point."""
        aside = now.equations.moved(now.state, ASIDE * now.tangent.z)
        curve = Curve(prepared, self.unit, self.piece(now.factor, now.tangent.factor))
        one, other = (transferred(now.model, state, prepared.model) for state in (now.state, aside))
        z, turned = np.zeros(curve.equations.total), turned_between(curve.equations, other, one, near=True)
        z[: len(turned)] = turned / ASIDE
        return curve, z

    def _found(self, source: Solved, now: Solved, begins: Sequence[ContactPoint], fits: int) -> Solved | None:
        """What is near to a state that is expected after another one, under its loads or across a tangent."""
        run = self.run

        def way(model: Model) -> Loading:
            return model.loading(source.factor)

        points = points_of(source)
        run.lines.keys = frozenset(one.pair for one in (*begins, *points) if one in begins or lies_along([one]))
        run.lines.finer = self.finer
        run.edges.begin(now.fields)
        found = run.resolved(*self._laid(source, begins), source, way)
        found = None if found is None else run.fitted(found, way, fits)
        return found if found is not None and run.near(now, found, STRIDE) else None

    def _laid(self, source: Solved, begins: Sequence[ContactPoint]) -> tuple[Mesh, Points]:
        """The elements, with those that lines need, and the places along these and elsewhere, of an expected state.

        Where lines end that slides: it is where it is expected.
        """
        run, mesh, lines, points = self.run, self.mesh, self.run.lines, points_of(source)
        parts = {key: [(part[0], part[-1]) for part in own] for key, own in lines.stretches(source).items()}
        for one in begins:
            at = min(max(one.at[0], 0.0), 1.0)
            parts.setdefault(one.pair, []).append((max(at - BEGINS, 0.0), min(at + BEGINS, 1.0)))
        kept = [point for point in points if point.pair not in parts or any(point.slides)]
        for key, stretches in parts.items():
            pair = run.closest.pairs[key]
            places = [x for part in stretches for x in part]
            sliding = tuple(ContactPoint(*key, (x,), (True,), pair.distance) for x in places)
            mesh, _ = lines.fitted(lines.divided(source.fields, mesh, pair, places), sliding)
        for key, stretches in parts.items():
            near = run.closest.along(source.fields, run.closest.pairs[key], mesh, np.inf)
            laid = lines.laid(one for one in near if any(a <= one.at[0] <= b for a, b in stretches))
            # Within a line nothing presses at a point.
            ends = {x for part in stretches for x in part} - {x for point in kept for x in point.at}
            kept += [point for point in laid if not all(point.sides) or point.at[0] in ends]
        return replace(mesh, points=()), tuple(kept)

    # -- from point to point --------------------------------------------------------------------

    def traced(self, start: Standing, flat: Callable[[Standing], list[ContactPoint]], count: int) -> Traced:
        """The stretch of a path from a point on, for so many points or, ``ceases``, until no member lies any more.

        Parameters
        ----------
        start : Standing
            A point with lines, or one from which on there are some.
        flat : callable
            Places of a point at which lines begin.
        count : int
        """
        points, events, length = [start], list[Event](), FIRST
        while length >= SHORTEST:
            now, stride = points[-1], (self.span[1] - self.span[0]) / SHARE
            length = min(length, longest(self.curve(now), now, stride))
            known = points_of(now) if lies_along(points_of(now)) else ()
            begins = [one for one in flat(now) if one.pair not in {point.pair for point in known}]
            there, end = self._next(now, length, begins)
            if there is None:
                length *= 0.5
                continue
            if now.tangent.factor * there.tangent.factor < 0.0:
                events.append(Event("limit", self._limit(now, there)))
                points.append(events[-1].standing)
            points.append(there)
            # As long as the tangent turns by what steps aim at.
            length = (there.arc - now.arc) * float(np.clip(TURNING / max(self._angle(now, there), TINY), 0.3, 2.0))
            if end in self.span:
                return Traced(points, events, "range")
            if end is not None:
                points[-1] = self._beyond_knot(there)
            if not lies_along(points_of(there)) and not flat(there) and not self._rests(there):
                return Traced(points, events, "ceases")
            if len(points) - len(events) >= count:
                return Traced(points, events, "points")
        return Traced(points, events, "lost")

    def _rests(self, at: Standing) -> bool:
        """Whether a member lies, to the accuracy, from the last place that presses up to its end, without a force."""
        lifted = self.run.accuracy * self.run.scene.size
        pressed = (point for point in points_of(at) if len(point.members) == 1)
        return any(
            self.run.closest.rests(at.fields, point.pair, min(max(point.at[0], 0.0), 1.0), lifted) for point in pressed
        )

    def _next(
        self, now: Standing, length: float, begins: Sequence[ContactPoint]
    ) -> tuple[Standing | None, float | None]:
        """The point at a length ahead, None if it is not on the same curve, and the factor if it is one to end at."""
        there: Standing | None = None
        if begins and self._rests(now):
            # What lies there without a force goes on doing so where nothing else begins to press.
            there = self.ahead(now, length)
            there = there if there is not None and self._rests(there) else None
        there = there or (self.ahead(now, length, begins) if begins else None)
        there = there or self.ahead(now, length)
        if there is None or self._angle(now, there) > SHARPEST * TURNING:
            return None, None
        end = self._end(now, there)
        return (there, None) if end is None else (self.at_factor(now, end) or self.at_factor(there, end), end)

    def _end(self, now: Standing, there: Standing) -> float | None:
        """The end of the range, or the knot of a history, that is between two points; None where there is none."""
        low, high = self.piece(now.factor, now.tangent.factor)
        low, high = max(low, self.span[0]), min(high, self.span[1])
        return None if low <= there.factor <= high else low if there.factor < low else high

    def _angle(self, a: Standing, b: Standing) -> float:
        """Angle between the tangents at two points, rad."""
        curve, along = self.along(a, b.prepared)
        return float(np.arccos(np.clip(curve.inner(along, b.tangent), -1.0, 1.0)))

    def _beyond_knot(self, at: Standing) -> Standing:
        """A point at a knot of a history with the tangent beyond it."""
        still = Tangent(np.zeros(at.equations.total), at.tangent.factor)
        return self.curve(at).standing(at.state, at.factor, still, arc=at.arc)

    def _limit(self, a: Standing, b: Standing) -> Standing:
        """The point between two others at which the factor turns."""
        known = {a.arc: a, b.arc: b}

        def rate(arc: float) -> float:
            found = self.ahead(a, arc - a.arc, fits=FITS)
            known[arc] = found or b
            return np.nan if found is None else found.tangent.factor

        return known[root(rate, a.arc, a.tangent.factor, b.arc, b.tangent.factor, LEVEL * self.unit)]

    def crossings(self, points: Sequence[Standing], factors: tuple[float, ...]) -> list[Standing]:
        """The points at given factors, in their order along the path; one at the end of a range is as it is."""
        met = [points[0]] if points[0].factor in factors else []
        for a, b in itertools.pairwise(points):
            low, high = min(a.factor, b.factor), max(a.factor, b.factor)
            within = [factor for factor in dict.fromkeys(factors) if low < factor < high]
            for factor in sorted(within, reverse=bool(b.factor < a.factor)):
                found = self.at_factor(self._nearest(a, b, factor), factor)
                met += [] if found is None else [found]
            met += [b] if b.factor in factors and b.factor != a.factor else []
        return met

    def _nearest(self, a: Standing, b: Standing, factor: float) -> Standing:
        """Which of two points one between them is found from."""
        return min(a, b, key=lambda one: abs(one.factor - factor))
