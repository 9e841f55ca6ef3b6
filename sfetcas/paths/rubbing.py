"""Paths of scenes with friction where members touch: how far loads can go before all slips, and what comes then.

What sticks and what slides depends on all that was before.  So each point of such a path is found as a load step is,
from the one before it, with Coulomb's law in the slip since then, see :class:`~sfetcas.contact.gripping.Gripping`; but
the factor is an unknown, and the point lies across the tangent.  Where a place begins to slide, to stick, to touch or
to leave the path has a corner, which is located.

At a corner there may be no way on across the tangent so far, as where the last place that has stuck begins to slide.
Then the way is that on which what is at its limit slides.  If the loads do not change along it, all that touches slides
away under them: there the path ends.
"""

from __future__ import annotations

import enum
import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..contact.lines import on_line, points_of
from ..contact.member_contact import STRIDE
from ..contact.pairs import PairKey, doing
from ..mathematics.arrays import TINY
from ..mechanics.fields import Fields, transferred
from ..mechanics.mesh import ContactPoint
from ..solvers.arclength import Curve, Standing, Tangent
from ..solvers.between_states import turned_between
from ..solvers.critical import Event
from ..solvers.one_sided import LASTING
from ..solvers.prepared import Prepared, Solved
from ..solvers.tracing import FINE, FIRST, SHORTEST, TURNING, Corner, Traced, longest
from .lying import LEVEL, SHARE, SHARPEST, Lying

__all__ = ["Rubbing"]

LOCATED, SHARP, SHORT = 1e-7, 1e-8, 1e-3
"""Arc length to which a corner is located; margin of the law of friction, share of the limit, at which what begins to
slide is; and share of the way to where it is expected that is left out.
"""

AT_LIMIT = 1e-3
"""Share of the limit within which what sticks slides where no way leads on along the tangent."""

THERE = 1e-8
"""Share of the unit of the factor that is no step to the end of the range, or to the knot of a history."""

FARTHER = 2.0
"""How many times farther than its length a step may lead: where loads hardly change any more it would lead anywhere."""


class _Does(enum.Enum):
    """What something that touches does."""

    TOUCHES = "touches"
    STICKS = "sticks to"
    SLIDES = "slides along"


@dataclass(frozen=True)
class _Place:
    """A place that touches, or a line on an obstacle, of which only one place is told."""

    pair: PairKey
    at: tuple[float, ...]
    does: _Does
    margin: float
    line: bool

    @property
    def kind(self) -> tuple[PairKey, _Does, bool]:
        """What is the same until the path has a corner."""
        return self.pair, self.does, self.line

    def told(self, verb: str) -> str:
        """What it does, a sentence: ``contacts.floor slides along bar at 1``."""
        contact, members = self.pair
        if self.line:
            return f"contacts.{contact} {verb} {members[0]} all along its line"
        return doing(contact, members, self.at, verb)


class Rubbing(Lying):
    """A path with friction.  Parameters as of :class:`.Lying`."""

    # -- one point ------------------------------------------------------------------------------

    def curve(self, at: Standing) -> Curve:
        """As of :class:`.Lying`; displacements of nodes count like rotations, as what slides may turn nothing."""
        return self._weighted(super().curve(at))

    def _weighted(self, curve: Curve) -> Curve:
        curve.weight[curve.equations.rotation_unknowns :] = 0.0
        curve.weight[list(self._moving(curve.prepared).values())] = 1.0
        return curve

    def _moving(self, prepared: Prepared) -> dict[str, int]:
        """Numbers of the displacements of nodes that are unknowns whatever touches, by their names."""
        first, loose = prepared.equations.rotation_unknowns, self.run.travels(self.mesh)
        return {name: first + i for i, name in enumerate(prepared.model.positions.unknowns) if name in loose}

    def along(self, now: Standing, prepared: Prepared) -> tuple[Curve, Tangent]:
        """As of :class:`.Lying`, with displacements of nodes."""
        curve, z = self.turning(now, prepared)
        numbers = self._moving(prepared)
        for name, number in self._moving(now.prepared).items():
            if name in numbers:
                z[numbers[name]] = now.tangent.z[number]
        return curve, self._weighted(curve).normed(Tangent(z, now.tangent.factor))

    def ahead(
        self, now: Standing, length: float, begins: Sequence[ContactPoint] = (), fits: int = 1
    ) -> Standing | None:
        """As of :class:`.Lying`; with its tangent away from the point before."""
        self.run.within = functools.partial(self._within, now, length)
        try:
            there = super().ahead(now, length, begins, fits)
        finally:
            self.run.within = None
        if there is not None and length > FINE and self.run.passing.bulged(now.fields, there.fields):
            # What turns far does not pass what its tip meets on its arc.
            return None
        return self._leading(now, there)

    def _leading(self, now: Standing, there: Standing | None) -> Standing | None:
        """The second of two points with its tangent away from the first."""
        if there is None:
            return None
        curve, apart = self._apart(now, there)
        return there if curve.inner(apart, there.tangent) >= 0.0 else replace(there, tangent=there.tangent.back)

    def _within(self, now: Standing, length: float, there: Solved) -> bool:
        """Whether a point is as near to another one as the end of a step of a length may be."""
        curve, apart = self._apart(now, there)
        return bool(np.sqrt(curve.inner(apart, apart)) <= FARTHER * length)

    def _apart(self, a: Standing, b: Solved) -> tuple[Curve, Tangent]:
        """How far the second of two points is from the first: rotations, displacements of nodes and the factor."""
        curve = self._weighted(Curve(b.prepared, self.unit))
        before, apart = transferred(a.model, a.state, b.model), np.zeros(curve.equations.total)
        turned = turned_between(curve.equations, b.state, before, near=True)
        apart[: len(turned)] = turned
        numbers = np.array(list(self._moving(b.prepared).values()), np.intp)
        apart[numbers] = (b.state.y - before.y)[numbers - curve.equations.rotation_unknowns]
        return curve, Tangent(apart, b.factor - a.factor)

    def _found(self, source: Solved, now: Solved, begins: Sequence[ContactPoint], fits: int) -> Solved | None:
        run = self.run
        run.lines.keys = frozenset(point.pair for point in points_of(now) if on_line(point))
        run.lines.finer = self.finer
        mesh = replace(now.model.mesh, points=())
        there = run.stepped(mesh, now, lambda model: model.loading(source.factor), source)
        return there if there is not None and run.near(now, there, STRIDE) else None

    # -- corners --------------------------------------------------------------------------------

    def _places(self, at: Standing) -> Iterator[_Place]:
        """What touches at a point; a line sticks as long as anything along it does."""
        lines = dict[PairKey, list[tuple[_Place, float, float]]]()
        for point in at.model.mesh.points:
            told, does, share = at.fields.contact_point(point), _Does.TOUCHES, 0.0
            limit = 0.0 if point.grip is None else point.grip.coefficient * told["push"]
            if point.grip is not None:
                pressed = told["push"] > LASTING * at.model.scales.force
                does = _Does.SLIDES if pressed and told["slides"] else _Does.STICKS
                share = told["rubs"] / limit if pressed else 0.0
            place = _Place(point.pair, told["at"], does, 1.0 - share, point.line)
            if point.line:
                lines.setdefault(point.pair, []).append((place, share * limit, limit))
            else:
                yield place
        for own in lines.values():
            places, shares, limits = zip(*own, strict=True)
            sticks = next((place for place in places if place.does is _Does.STICKS), places[0])
            # All together: one after the other begins to slide, and none by itself tells when the last one does.
            yield replace(sticks, margin=1.0 - sum(shares) / max(sum(limits), TINY))

    def _kinds(self, at: Standing) -> list[object]:
        return sorted((place.kind for place in self._places(at)), key=str)

    def _margin(self, at: Standing) -> float:
        """Least margin of the law of friction of what sticks at a point, share of the limit; 1 where nothing does."""
        return min((place.margin for place in self._places(at) if place.does is _Does.STICKS), default=1.0)

    def _changes(self, at: Standing, beyond: Standing) -> tuple[str, ...]:
        """What happens at a corner, from a point to the next, sentences."""
        before, told = list(self._places(at)), list[str]()
        for place in self._places(beyond):
            same = next((one for one in before if self._alike(one, place)), None)
            if same is None:
                told.append(place.told("touches"))
                continue
            before.remove(same)
            told += [place.told(place.does.value)] if place.does is not same.does else []
        return (*told, *(place.told("leaves") for place in before))

    def _alike(self, one: _Place, other: _Place) -> bool:
        if one.pair != other.pair or one.line != other.line:
            return False
        return one.line or self.run.closest.alike(one.pair, one.at, other.at)

    def _beyond(self, at: Standing) -> tuple[Standing, Standing | None, bool]:
        """A corner, the first point beyond it, None where there is none, and whether from there on what touches slides
        away under the same loads.
        """
        slipping = self._slipping(at)
        slides = None if slipping is None else replace(at, tangent=slipping)
        # Just beyond the corner all is at its limit to rounding, at the corner to what that is located to.
        lengths = () if slides is None else (SHORTEST, 3.0 * SHORTEST, 10.0 * SHORTEST)
        just = next(filter(None, (self.ahead(slides, length) for length in lengths if slides is not None)), None)
        if slides is not None and abs(slides.tangent.factor) <= LEVEL * self.unit:
            just = just or self.ahead(slides, FINE) or at
            return just, just, True
        there = self.ahead(at, FINE)
        if there is None and slides is not None:
            there = self.ahead(slides, FINE)
            # Loads that fall without a slip lead back.
            if there is not None and all(place.does is _Does.STICKS for place in self._places(there)):
                there = None
            at = just or at
        return at, there, False

    def _slipping(self, at: Standing) -> Tangent | None:
        """The tangent on which what is at its limit slides, against its friction; None where nothing is."""
        run = self.run
        limited = replace(run.gripping, since=at.fields, strength=1.0 - AT_LIMIT, firm=1.0, yields=0.0)
        points = limited.set_up(at.fields, at.model.mesh, [run.gripping.begun(point) for point in points_of(at)])
        prepared = run.prepare(replace(at.model.mesh, points=points))
        curve = self._weighted(Curve(prepared, self.unit, self.piece(at.factor, at.tangent.factor)))
        state, loading = run.carried(at, prepared), curve.loading(at.factor)
        equations, point = curve.equations, curve.equations.at(state, loading)
        fields = Fields(equations, state, loading)
        rough = [point for point in prepared.model.mesh.points if point.grip is not None]
        slides = [point for point in rough if fields.contact_point(point)["slides"]]
        if not slides:
            return None
        try:
            rate = curve.solved(point, -curve.slope(state, at.factor, point)[:, None])[:, 0]
        except np.linalg.LinAlgError:
            return None
        tangent = curve.normed(Tangent(rate, 1.0))
        state, factor = curve.predicted(replace(at, state=state, tangent=tangent), FINE)
        told = map(Fields(equations, state, curve.loading(factor)).contact_point, slides)
        against = sum(float(one["slip"] @ one["friction"]) for one in told) <= 0.0
        return tangent if against else tangent.back

    # -- from point to point --------------------------------------------------------------------

    def traced(self, start: Standing, flat: Callable[[Standing], list[ContactPoint]], count: int) -> Traced:
        """The path from a point on, for so many points."""
        # Where it comes from displacements of nodes may not count.
        start = replace(start, tangent=self.curve(start).normed(start.tangent))
        points, events, corners, base = [start], list[Event](), list[Corner](), start
        longer, length, wall = self.finer * (self.span[1] - self.span[0]) / SHARE, FIRST * self.finer, np.inf
        known = [(start.arc, self._margin(start))]
        kinds: list[object] | None = self._kinds(start)
        while (wall < np.inf or length >= SHORTEST) and len(points) - len(events) - len(corners) < count:
            if wall - base.arc <= LOCATED or (wall < np.inf and known[-1][1] <= SHARP):
                there, end = self._over(base, points, corners)
                if there is None:
                    return Traced(points, events, end, corners=corners)
                # Whether what has just begun to touch sticks is seen farther on: it had moved before.
                after = self._kinds(there)
                kinds = None if kinds is None or len(after) > len(kinds) else after
                base, wall, length, known = there, np.inf, FIRST * self.finer, [(there.arc, self._margin(there))]
                continue
            length = min(length, longest(self.curve(base), base, longer))
            expected = _root(known) - base.arc
            if wall < np.inf:
                room = wall - base.arc
                length = (1.0 - SHORT) * expected if 0.0 < expected < room else 0.5 * room
            there, stop, changes = self._next_to(base, length, kinds)
            if there is None and self.run.jammed and length <= FINE:
                return Traced(points, events, "lost", corners=corners)
            if there is None:
                if changes or wall < np.inf or length <= FINE or 0.0 <= expected < length:
                    wall = base.arc + length
                    # What was expected is too far.
                    known = known[-1:] if 0.0 < expected <= length else known
                else:
                    length *= 0.5
                continue
            turned = self._angle(base, there)
            if max(abs(point.tangent.factor) for point in (base, there)) <= LEVEL * self.unit:
                # What turns into the way along which it is drawn comes to slide away in the end.
                return Traced([*points, there], events, "away", corners=corners)
            if stop is None and base.tangent.factor * there.tangent.factor < 0.0:
                events.append(Event("limit", self._limit(base, there)))
                points.append(events[-1].standing)
            base, kinds = there, self._kinds(there) if kinds is None else kinds
            known = [*known[-1:], (base.arc, self._margin(base))]
            if wall == np.inf or stop is not None:
                points.append(base)
                length *= float(np.clip(self.finer * TURNING / max(turned, TINY), 0.3, 2.0))
            if stop in self.span:
                return Traced(points, events, "range", corners=corners)
            if stop is not None:
                base = points[-1] = self._beyond_knot(base)
        return Traced(points, events, "lost" if length < SHORTEST else "points", corners=corners)

    def _over(self, base: Standing, points: list[Standing], corners: list[Corner]) -> tuple[Standing | None, str]:
        """Add a corner, located from a point before it; the first point beyond it, or None and why the path ends."""
        at, there, away = self._beyond(base)
        stop = None if there is None or away else self._end(at, there)
        if stop is not None:
            # What happens there is told beyond it.
            found = self.at_factor(at, stop)
            points += [point for point in (at, found) if point is not None and point is not points[-1]]
            if found is None or stop in self.span:
                return None, "lost" if found is None else "range"
            points[-1] = self._beyond_knot(found)
            return points[-1], ""
        told = () if there is None else self._changes(base, there)
        if there is not None and told:
            turns = not away and bool(base.tangent.factor * there.tangent.factor < 0.0)
            corners.append(Corner(at, told, turns))
        points += [at] if at is not points[-1] else []
        points += [there] if there is not None and not away else []
        return (None, "away" if away else "lost") if there is None or away else (there, "")

    def _next_to(
        self, base: Standing, length: float, kinds: list[object] | None
    ) -> tuple[Standing | None, float | None, bool]:
        """The point at a length ahead with the same ``kinds``, None if there is none on the same curve; the factor if
        it is one to end at; and whether it has none as something has changed.
        """
        there = self.ahead(base, length)
        if there is None or kinds not in (None, self._kinds(there)):
            return None, None, there is not None
        if self._angle(base, there) > SHARPEST * TURNING:
            return None, None, False
        end = self._end(base, there)
        if end is None:
            return there, None, False
        there = self.at_factor(base, end)
        # In a short step little tells what slides.
        short = abs(end - base.factor) <= FINE * self.unit
        same = there is not None and (short or kinds in (None, self._kinds(there)))
        return (there, end, False) if same else (None, None, False)

    def at_factor(self, near: Standing, factor: float) -> Standing | None:
        """As of :class:`.Lying`; with its tangent away from the point before, and itself where that is no step."""
        if abs(factor - near.factor) <= THERE * self.unit:
            return replace(near, loading=self.curve(near).loading(factor))
        return self._leading(near, super().at_factor(near, factor))

    def _beyond_knot(self, at: Standing) -> Standing:
        """As of :class:`.Lying`; loads may turn there, so that what slides sticks: only the factor goes on at first."""
        return replace(
            at, tangent=Tangent(np.zeros(at.equations.total), float(np.copysign(self.unit, at.tangent.factor)))
        )

    def _nearest(self, a: Standing, b: Standing, factor: float) -> Standing:
        """As of :class:`.Lying`: the point before it, of which it remembers what has slipped."""
        return a


def _root(known: Sequence[tuple[float, float]]) -> float:
    """Where a margin vanishes on a straight line through the last two of some places and margins; nan where nowhere."""
    if len(known) < 2:
        return np.nan
    (a, fa), (b, fb) = known[-2:]
    return b + fb * (b - a) / (fa - fb) if fb < fa else np.nan
