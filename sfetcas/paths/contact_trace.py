"""Following a path in contact step by step, over changes of the contacts.

A step after which other places touch is taken back and halved until the change is near.  The state beyond the change is
then sought at a fixed factor, and the path goes on from there, away from the change.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from .. import tolerances
from ..contact.contact_statics import ContactRun
from ..contact.settling import Held, Ran, free_places, moved, placed
from ..equilibria.solution import Equilibrium
from ..errors import SolveError
from ..mathematics.arrays import TINY, Array
from ..mechanics.accuracy import largest_difference
from ..mechanics.equations import State
from ..mechanics.mesh import Mesh, Touch
from ..mechanics.model import Model
from ..solvers.arclength import Tangent
from ..solvers.critical import root
from ..solvers.newton import largest_rotation
from ..solvers.tracing import FAR
from .contact_curve import ContactCurve, Stood

__all__ = ["Trace", "Tracer"]

FIRST, LONGEST = 0.1, 0.35
"""Length of the first step, and most that a node turns in one, rad."""

SHARE = 30
"""No step takes more than this part of the range."""

TURNING, SHARPEST = 0.25, 0.6
"""Angle between the tangents of neighbouring points that steps aim at, and the largest one, rad."""

EVENT = 1e-3
"""So near to a change of what touches the state beyond it is looked for: rad, or shares of the unit."""

SHORTEST = 1e-5
"""Shorter steps, rad or shares of the unit, end a path where nothing touches otherwise."""

REACHES = (1.0, 3.0, 10.0, 30.0)
"""Times that distance at which it is looked for."""

BEYOND = 3.0
"""Positions beyond a change differ by less than this times that distance, over the size of the scene."""

WORN = 2.0
"""Elements that are this many times as long as those of the mesh that was begun with are made anew."""

SETTLES = 60
"""Equilibria with places held that are solved for one state beyond a change."""

BEGINNING = 1e-3
"""Share of the range at which a path starts that has no direction at factor 0."""


@dataclass
class Trace:
    """A path in contact.

    Attributes
    ----------
    points : list of Stood
    limits : set of int
        Numbers of the limit points among them.
    notes : list of str
        What happened on the way.
    end : str
        Why it ends: ``range``, ``points``, ``lost``, or ``bent``: a small member is bent beyond linear elasticity.
    limit : SolveError or None
        For ``bent``: what is beyond its limits.
    corners : set of int
        Indices of points after which the contacts change.
    """

    points: list[Stood]
    limits: set[int] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)
    end: str = "points"
    limit: SolveError | None = None
    corners: set[int] = field(default_factory=set)


class Tracer:
    """Follows paths of one scene on meshes that start from one base mesh.

    Parameters
    ----------
    run : ContactRun
    base : Mesh
    span : tuple of float
        Smallest and largest factor.
    knots : tuple of float
        Factors at which histories have knots.
    """

    def __init__(self, run: ContactRun, base: Mesh, span: tuple[float, float], knots: tuple[float, ...]) -> None:
        self.run, self.base, self.span, self.scene = run, base, span, run.scene
        self.stops = (span[0], *knots, span[1])
        self.curve = ContactCurve(self.scene, run.prepare, max(map(abs, span)))

    # -- begin ----------------------------------------------------------------------------------

    def begin(self, beside: Callable[[float], Equilibrium]) -> tuple[Stood, tuple[str, ...]] | None:
        """The first point and notes: upwards unless the range ends at 0; next to factor 0 where that has no
        equilibrium.

        ``beside`` gives the equilibrium at a factor, on any mesh.
        """
        up = 1.0 if self.span[1] > 0.0 else -1.0
        factor, notes = 0.0, tuple[str, ...]()
        held = self.run.grown(self.base, factor)
        stood = None if held is None else self._looking(held, factor, up, 0.0)
        if stood is None:
            factor = up * BEGINNING * (self.span[1] if up > 0.0 else -self.span[0])
            notes = (f"at factor 0 nothing tells which way the path goes: it starts at factor {factor:g}",)
            near = beside(factor)
            held = self._on_base(near.model, near.state, near.model.mesh.touches, factor)
            stood = None if held is None else self._looking(held, factor, up, 0.0)
        if stood is None:
            return None
        self._choose_unit(stood)
        return self._looking(stood.held, factor, up, 0.0) or stood, notes

    def _choose_unit(self, stood: Stood) -> None:
        """The factor that would turn the structure by a radian were it linear, if that is in the range."""
        share = (stood.tangent.factor / self.curve.unit) ** 2
        if share < 0.5:
            least = tolerances.UNIT * self.curve.unit
            self.curve.unit = max(abs(stood.tangent.factor) / np.sqrt(1.0 - share), least)

    def _looking(self, held: Held, factor: float, sign: float, arc: float) -> Stood | None:
        """A state from which the factor rises or falls along the curve."""
        self.curve.piece = self._piece(factor, sign)
        return self.curve.stood(held, factor, Tangent(np.zeros(held.prepared.equations.total), sign), arc)

    def _piece(self, factor: float, sign: float) -> tuple[float, float]:
        """Neighbouring knots, on the side to which the factor goes; the last ones at the ends of the range."""
        if not self.scene.histories:
            return -np.inf, np.inf
        pieces = [(a, b) for a, b in zip(self.stops, self.stops[1:], strict=False) if a <= factor <= b]
        return pieces[-1] if sign > 0.0 else pieces[0]

    # -- along ----------------------------------------------------------------------------------

    def traced(self, start: Stood, count: int) -> Trace:
        """The path from a point until the factor leaves the range, for at most ``count`` points."""
        trace = Trace([start])
        now, before, length, barrier = start, None, FIRST, np.inf
        while len(trace.points) < count:
            length = min(length, self._longest(now), 0.5 * (barrier - now.arc))
            there, used, failed = self._step(now, before, length)
            barrier = min(barrier, failed)
            if there is None or barrier - now.arc < EVENT:
                before, barrier, length = None, np.inf, 0.1 * FIRST
                now = self._over(trace, now) or now
                if trace.end == "lost":
                    return trace
                continue
            trace.limit = self.curve.plain(there.held.prepared).beyond_limits(there.standing)
            if trace.limit is not None:
                trace.end = "bent"
                return trace
            end = there.factor if there.factor in self.stops else None
            self._take(trace, now, there)
            if end is not None and end in self.span:
                trace.end = "range"
                return trace
            before, now, length = now, there, used * self._growth(now, there)
            if end is not None:
                before, now = None, self._looking(there.held, end, np.sign(there.tangent.factor), there.arc) or there
            elif self._worn(now.held.mesh):
                before, now, barrier = None, self._renewed(now), np.inf
        return trace

    def _take(self, trace: Trace, now: Stood, there: Stood) -> None:
        """Add a point, and the limit point before it."""
        if now.tangent.factor * there.tangent.factor < 0.0:
            limit = self.curve.limit(now, there)
            if limit is not None:
                trace.limits.add(len(trace.points))
                trace.points.append(limit)
            else:
                trace.notes.append(f"a limit point near factor {there.factor:.6g} could not be located")
        trace.points.append(there)

    def _longest(self, now: Stood) -> float:
        curve = self.curve.plain(now.held.prepared)
        turning = largest_rotation(curve.equations, now.tangent.z)
        stride = (self.span[1] - self.span[0]) / SHARE
        return min(LONGEST / max(turning, TINY), stride / max(abs(now.tangent.factor), TINY))

    def _growth(self, now: Stood, there: Stood) -> float:
        cosine = min(1.0, self.curve.plain(now.held.prepared).inner(now.tangent, there.tangent))
        return float(np.clip(TURNING / max(np.arccos(cosine), 1e-12), 0.3, 2.0))

    def _step(self, now: Stood, before: Stood | None, length: float) -> tuple[Stood | None, float, float]:
        """The next point, the length that led to it, and the nearest arc beyond which something changes.

        A step over the end of a piece ends there: beyond it loads and motions are others.
        """
        failed = np.inf
        while length > SHORTEST and failed - now.arc > EVENT:
            there = self.curve.along(now, length, before) if self._room(now, length) else None
            if there is not None and self._same(now, there, length, before):
                end = self._end(now, there)
                there = there if end is None else self._at(now, there, end)
            else:
                there = None
            if there is not None:
                if self.wrong(now, there) is None:
                    return there, length, failed
                failed = now.arc + length
            elif not self._room(now, length):
                failed = now.arc + length
            length *= 0.5
        return None, length, failed

    @staticmethod
    def _room(now: Stood, length: float) -> bool:
        """Whether all places stay within their members, and those of a stretch apart."""
        touches = list(now.held.mesh.touches)
        for (i, k), rate in zip(free_places(now.held.mesh.touches), now.rates, strict=True):
            touches[i] = moved(touches[i], k, touches[i].places[k] + length * float(rate))
        inside = all(0.0 <= x <= 1.0 for touch in touches for x in touch.places)
        return inside and all(touch.to is None or touch.at < touch.to for touch in touches)

    def _same(self, now: Stood, there: Stood, length: float, before: Stood | None) -> bool:
        """Whether a point is on the same curve as the one before."""
        curve = self.curve.plain(now.held.prepared)
        if curve.inner(now.tangent, there.tangent) < np.cos(SHARPEST):
            return False
        expected = self.curve.expected(now, length, before)[0]
        turned = length * largest_rotation(curve.equations, now.tangent.z)
        return curve.prepared.distance(expected, there.standing.state) <= FAR * turned + EVENT * FAR

    def wrong(self, now: Stood, there: Stood) -> tuple[Touch, ...] | None:
        """The contacts a point should have instead; the present ones where a step passed an obstacle; else None."""
        held, reviser, way = there.held, self.run.reviser, self.run.at(there.factor)
        released = reviser.released(held.prepared.model, held.loading, held.mesh.touches, way)
        if released != held.mesh.touches:
            return released
        changed = reviser.wrong(held, way)
        return now.held.mesh.touches if changed is None and self.run.toucher.passing.over(now.held, held) else changed

    # -- over changes of what touches -----------------------------------------------------------

    def _over(self, trace: Trace, now: Stood) -> Stood | None:
        """The first point beyond a change of what touches, added to the path; None, which ends it, where none is found.

        Where the factor turns at the change, this is a limit point with a corner.
        """
        found = self._beyond(now)
        if found is None:
            trace.end = "lost"
            reason = "what touches beyond it was not found, or the path cannot be followed further"
            trace.notes.append(f"the path ends at factor {now.factor:.6g}: {reason}")
            return None
        after, turned = found
        if turned:
            trace.notes.append(f"at factor {now.factor:.6g} the factor turns at a corner, where touches change")
        trace.corners.add(len(trace.points) - 1)
        trace.points.append(after)
        return after

    def _beyond(self, now: Stood) -> tuple[Stood, bool] | None:
        """A state beyond a change, and whether the factor turns there."""
        for times in REACHES:
            reach = times * EVENT
            there = self.curve.along(now, reach)
            rise = (there.factor - now.factor) if there is not None else reach * now.tangent.factor
            if abs(rise) < 1e-3 * reach * self.curve.unit:
                rise = float(np.copysign(1e-3 * reach * self.curve.unit, rise))
            for turned, factor in ((False, now.factor + rise), (True, now.factor - rise)):
                held = self._resolved(now, there, factor, reach)
                back = (factor - now.factor) * now.tangent.factor < 0.0
                # Back at what touches already is the path that led here.
                if held is None or (back and _kinds(held) == _kinds(now.held)):
                    continue
                after = self._looking(held, factor, float(np.sign(factor - now.factor)), now.arc + reach)
                if after is not None:
                    return after, turned
        return None

    def _resolved(self, now: Stood, there: Stood | None, factor: float, reach: float) -> Held | None:
        """The state at a factor with what touches there, if it is near."""
        if not self.span[0] <= factor <= self.span[1]:
            return None
        touches, way = now.held.mesh.touches, self.run.at(factor)
        wrong = None if there is None else self.wrong(now, there)
        toucher = self.run.toucher
        for trial in (touches,) if wrong is None else (wrong, touches):
            most = self.run.settler.solves + SETTLES
            held = toucher.resolved(replace(self.base, touches=()), now.held, trial, way, most)
            if held is not None:
                apart = largest_difference(now.held.touched.fields, held.touched.fields)
                if apart <= BEYOND * reach:
                    return held
        return None

    # -- meshes and factors ---------------------------------------------------------------------

    def _worn(self, mesh: Mesh) -> bool:
        """Whether the places of contact have stretched elements too far."""
        for name in {touch.member for touch in mesh.touches}:
            cuts, base = mesh.cuts[name], self.base.cuts[name]
            middles = 0.5 * (cuts[1:] + cuts[:-1])
            own = np.diff(base)[np.clip(np.searchsorted(base, middles) - 1, 0, len(base) - 2)]
            if (np.diff(cuts) > WORN * own).any():
                return True
        return False

    def _renewed(self, now: Stood) -> Stood:
        """The same point on a mesh that is not stretched; itself where it is not found there."""
        held = self.again(now)
        sign = float(np.sign(now.tangent.factor))
        return now if held is None else self._looking(held, now.factor, sign, now.arc) or now

    def _end(self, now: Stood, there: Stood) -> float | None:
        """The end of the piece that a step passes."""
        low, high = self._piece(now.factor, np.sign(there.factor - now.factor)) if self.scene.histories else self.span
        return high if there.factor > high else low if there.factor < low else None

    def _at(self, a: Stood, b: Stood, factor: float) -> Stood | None:
        """The point between two others at a factor."""
        if factor in (a.factor, b.factor):
            return a if factor == a.factor else b
        if len(b.standing.state.q) != len(a.standing.state.q) or _kinds(a.held) != _kinds(b.held):
            # Between them something begins or ends to touch: on which side of that the factor is, is asked.
            sides = (self._settled(near, factor, near.arc) for near in (a, b))
            return next((there for there in sides if there is not None and self.wrong(a, there) is None), None)
        arc = b.arc - a.arc
        rise, left, right = b.factor - a.factor, arc * a.tangent.factor, arc * b.tangent.factor

        def missing(x: float) -> float:
            bent = 3.0 * rise - 2.0 * left - right + x * (left + right - 2.0 * rise)
            return a.factor - factor + x * (left + x * bent)

        place = arc * root(missing, 0.0, missing(0.0), 1.0, missing(1.0))
        near = self.curve.along(a, place)
        return None if near is None else self._settled(near, factor, near.arc)

    def _settled(self, near: Stood, factor: float, arc: float) -> Stood | None:
        """The point at a factor beside another."""
        held: Held | Ran | None = near.held
        if factor != near.factor:
            source = near.held.prepared.model, near.held.corrected.state
            held = self.run.settler.settle(near.held.mesh, source, self.run.at(factor))
        if not isinstance(held, Held) or largest_difference(near.held.touched.fields, held.touched.fields) > FAR:
            return None
        if len(near.tangent.z) != held.prepared.equations.total:
            return self.curve.stood(
                held, factor, Tangent(np.zeros(held.prepared.equations.total), near.tangent.factor), arc
            )
        there = self.curve.stood(held, factor, near.tangent, arc)
        if there is not None:
            return there
        # Without any load the direction may be open: that of the point beside it is as good.
        state, plain = held.corrected.state, self.curve.plain(held.prepared)
        return replace(near, held=held, standing=plain.standing(state, factor, near.tangent, arc=arc), arc=arc)

    def crossings(self, trace: Trace, factors: tuple[float, ...]) -> list[Stood]:
        """The points of a path at given factors, in the order along the path."""
        first = trace.points[0]
        met = [first for factor in factors if factor == first.factor][:1]
        for a, b in zip(trace.points, trace.points[1:], strict=False):
            low, high = min(a.factor, b.factor), max(a.factor, b.factor)
            here = [f for f in dict.fromkeys(factors) if low < f < high or f == b.factor]
            self.curve.piece = self._piece(0.5 * (low + high), 1.0)
            for factor in sorted(here, reverse=bool(b.factor < a.factor)):
                found = self._at(a, b, factor)
                if found is not None:
                    met.append(found)
        return met

    def again(self, point: Stood) -> Held | None:
        """A point of a path on another mesh as an equilibrium on this one at the same factor; None if there is none."""
        held = point.held
        return self._on_base(held.prepared.model, held.corrected.state, held.mesh.touches, point.factor)

    def _on_base(self, model: Model, state: State, touches: tuple[Touch, ...], factor: float) -> Held | None:
        mesh = placed(self.scene, replace(self.base, touches=()), touches)
        found = self.run.settler.settle(mesh, (model, state), self.run.at(factor))
        return found if isinstance(found, Held) else None


def _kinds(held: Held) -> list[tuple[str, str, bool, tuple[Array, ...] | tuple[float, ...]]]:
    """What touches what, at places or along stretches, and which of them at the ends of members."""
    return [
        (t.contact, t.member, t.to is None, tuple(x for x in t.places if x in (0.0, 1.0))) for t in held.mesh.touches
    ]
