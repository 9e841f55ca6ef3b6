"""Time stepping with impulses: motions in which much touches, impacts and contact found once in each step.

A step is that of :mod:`~sfetcas.dynamics.conserving`, which keeps the energy of what is free, with two sets of impulses
for all that is in reach.

- *Positions.*  Forces ``f`` push over the whole step, so that at its end no gap is closed,

      f >= 0,      g_1 >= 0,      f . g_1 = 0.

  They act along ``n = (d_0 + d_1) / (|d_0| + |d_1|)``, where ``d`` is the vector between the two places of the members
  that are nearest at the end of the step, so that their work is exactly ``f (g_1 - g_0) = -f g_0`` with the gap ``g_0``
  of the same two places at the begin: what did not penetrate before loses energy, or none, but gains none.

- *Velocities.*  At the end of the step impulses ``p`` change velocities ``w`` of the unknowns,

      M (w+ - w) = H^T (p - h f),      p >= 0,      H w+ >= -e H w_0,      p . (H w+ + e H w_0) = 0,

  with the velocities ``w_0`` at the begin and the restitution ``e``: Newton's law of impacts for all impulses of the
  step together.  Without restitution ``h f . H w+ + 1/2 (w+ - w) . M (w+ - w)`` is lost then.  With it, where the
  energy of a cluster of what touches would grow, its restitution is halved until it does not.

Bodies are coupled by contact alone: the matrices of both are factorised body by body, and what remains is a sparse
problem of linear complementarity for the forces (:mod:`~sfetcas.mathematics.complementarity`).  Places are searched for
before a step, where it would lead without impulses, and after it: where members penetrate there, places are added, and
the step is taken again.

Source: Moreau 1988, Unilateral contact and dry friction in finite freedom dynamics; Acary and Brogliato 2008,
Numerical methods for nonsmooth dynamical systems; Chen, Acary, Virlez and Bruls 2013 (nonsmooth generalised-alpha);
Laursen and Chawla 1997 (conservation in contact).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from .. import tolerances
from ..contact.nearby import Places
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import Array, Index, Sparse
from ..mathematics.complementarity import complementary
from ..mathematics.threads import one_thread
from ..mechanics.center_lines import Curve
from ..mechanics.equations import State
from ..mechanics.mesh import Approach, Spot
from ..mechanics.unilateral import Unilateral, UnilateralRows
from .conserving import check_conserving
from .coupling import Bodies, Moving, StepEquations, factored
from .events import Event
from .gaps import Touching
from .inertia import Inertia
from .integrators import InitialState, Integrator, TimeGrid
from .sampling import Sample
from .stages import StageEquations
from .steps import LAST_CHANGE

__all__ = ["Stepping"]

PENETRATION = 5e-7
"""How far members may penetrate at the end of a step, over their radius."""

STRIDE = 0.5
"""How far anything moves in a step, over the smallest distance of touching lines, before the step is divided."""

REACH = 2.0
"""Distance of surfaces at which places are looked at, over how far anything moves in the step without impulses."""

CLOSE = 0.01
"""That distance at least, over the smallest distance of touching lines, or over the unit of length."""

ITERATIONS, SLIDING, SLID = 40, 4, 1e-8
"""Iterations of Newton's method at most, in how many of them places go on to where the distance is least, and how
little of the unit of length they move then where they have arrived.
"""

SEARCHES, COPIED = 30, 3
"""Searches after a step at most, and after how many of them places go on that are added."""

SHORTER = 12
"""How often a step is halved at most."""

CONVERGED = 1e-9
"""Change, rad or unit of length, at which Newton's method ends, with one more iteration."""

FRESH = 1e-5
"""Change, rad or unit of length, up to which the next iteration has the same factors."""

RINGS = 0.05
"""Turn in a step, rad, beyond which rates at its begin say little of where it leads."""

GROWN = 1e-13
"""Energy over that of what moves by which it may grow with restitution: rounding."""

HALVED = 30
"""How often the restitution of a cluster is halved at most before it is taken to be zero."""


@dataclass(frozen=True, eq=False)
class _Course:
    """A step: the state and the lines at its begin, its length, factors (2, groups) in its middle and at its end."""

    begin: Moving
    before: Curve
    h: float
    factors: Array


@dataclass(frozen=True, eq=False)
class _End:
    """The end of a step: state, quantities and lines, the pairs of places and the numbers of spots that are looked at
    with the forces of both, and factors of Newton's matrix.
    """

    state: State
    x: Array
    curve: Curve
    places: Places
    spots: Index
    forces: Array
    factors: Any = None


@final
class Stepping(Integrator):
    """Time stepping with impulses for motions in which much touches; steps are as long as told, or shorter."""

    def __init__(self, system: StageEquations, progress: Callable[[float], Any] | None = None) -> None:
        super().__init__(system, progress)
        check_conserving(system, "stepping")
        for name in system.model.scene.motions:
            message = (
                "found with the integrator 'stepping', which knows no prescribed motion, accepted: radau-3, radau-2"
            )
            raise SceneError(f"{message}, generalised-alpha", ("motions", name))
        self._equations, self._touching = StepEquations(system), Touching(system)
        self._inertia = Inertia(system)
        self._bodies = Bodies(self._equations.bodies)
        self._axes, self._places = system.axes, system.places

    # -- the motion -----------------------------------------------------------------------------------

    def samples(self, begun: InitialState, course: TimeGrid) -> Iterator[Sample]:
        """States at the times of the answer, at which steps end; as of :meth:`.Integrator.samples`."""
        with one_thread():
            yield from self._samples(begun, course)

    def _samples(self, begun: InitialState, course: TimeGrid) -> Iterator[Sample]:
        assert course.step is not None
        w = np.concatenate([begun.rates, np.zeros(self.system.layout.lam)])
        now = Moving(0.0, begun.state, begun.x, begun.v, w)
        self._refuse_inside(now)
        ends = np.unique([*course.times.tolist(), *course.breaks])
        ends = ends[ends > tolerances.DECIMAL * course.end]
        waiting = bool(len(course.times)) and course.times[0] <= tolerances.DECIMAL * course.end
        wanted = set(course.times.tolist())
        for end in ends.tolist():
            count = max(1, int(np.ceil((end - now.t) / course.step * (1.0 - tolerances.DECIMAL))))
            for k in range(count):
                h = (end - now.t) / (count - k)
                after = self._stepped(now, h)
                if waiting:
                    waiting = False
                    yield self._sample(now, now, after, h)
                self._told(now, after)
                before, now = now, replace(after, t=end if k == count - 1 else after.t)
                self.proceed(now.t)
            if end in wanted:
                yield self._sample(now, before, now, now.t - before.t)

    def _sample(self, at: Moving, before: Moving, after: Moving, h: float) -> Sample:
        """A state, with the mean accelerations and what touched in a step."""
        parts = tuple(key for key in after.pushed)
        spin = self.system.equations.spins(at.w)
        touched = tuple(self._part(key) for key in parts)
        count = len(touched)
        rows = UnilateralRows(touched, np.zeros(count, np.intp), -np.ones(count), np.zeros(count))
        return Sample(
            at.t, at.state.q, at.state.y, at.x, at.v, (after.v - before.v) / h, spin, at.state.unwrapped,
            acting=np.ones(count), lost=at.lost, unilateral=rows,
        )  # fmt: skip

    def _told(self, before: Moving, after: Moving) -> None:
        """Note what began and ended to touch in a step."""
        began = [key for key in after.pushed if _owner(key) not in set(map(_owner, before.pushed))]
        ended = [key for key in before.pushed if _owner(key) not in set(map(_owner, after.pushed))]
        largest = max(began, key=lambda key: after.pushed[key], default=None)
        for key in began:
            lost = after.lost - before.lost if key == largest else 0.0
            self.events.append(Event(after.t, self._part(key), True, after.pushed[key], lost))
        self.events += [Event(after.t, self._part(key), False, 0.0, 0.0) for key in ended]

    def _part(self, key: Spot | Approach) -> Unilateral:
        return Unilateral("contacts", key.contact, "touching", key)

    # -- one step -------------------------------------------------------------------------------------

    def _stepped(self, begin: Moving, h: float) -> Moving:
        """The state after a step, which is halved where that is needed."""
        now, t, left, part = begin, begin.t, h, h
        pushed = dict[Any, float]()
        while left > tolerances.DECIMAL * h:
            part = min(part, left)
            found = self._step(now, part)
            if found is None:
                if part < h * 0.5**SHORTER:
                    detail = f"at {now.t * self.system.masses.time:.9g} s no impulses of a step could be found"
                    raise SolveError(Status.STOPPED, f"{detail} of {part * self.system.masses.time:.3g} s")
                part *= 0.5
                continue
            pushed = found.pushed
            now, left = found, left - part
            self.count += 1
        return replace(now, t=t + h, pushed=pushed)

    def _factors(self, t: float, h: float) -> Array:
        """Factors (2, groups) of loads in the middle and at the end of a step."""
        end = np.nextafter(t + h, -np.inf)
        return np.array([self.system.factors(t + 0.5 * h), self.system.factors(end)])

    def _displaced(self, x: Array) -> Array:
        """Displacements, or rates, of all places (places, axes) among those of the quantities."""
        return x[: self._axes * self._places].reshape(self._places, self._axes)

    def _step(self, begin: Moving, h: float) -> Moving | None:
        """The state after a step; None where it has to be shorter."""
        touching, longest = self._touching, STRIDE * self._touching.distance
        if (stride := self._farthest(h * begin.v)) > longest:
            return None
        course = _Course(begin, self._curve(begin.state, begin.x), h, self._factors(begin.t, h))
        ahead, x = self._ahead(begin, h), begin.x + h * begin.v
        curve, reach = self._curve(ahead, x), max(REACH * stride, CLOSE * min(touching.distance, 1.0))
        places = touching.nearby.found(curve, reach)
        spots = np.flatnonzero(touching.on_obstacles(self._displaced(x)).gaps < reach)
        end: _End | None = _End(ahead, x, curve, places, spots, np.zeros(len(places) + len(spots)))
        for search in range(SEARCHES):
            end = None if end is None else self._pushed(course, end)
            if end is None or self._farthest(end.x - begin.x) > 2.0 * longest:
                return None
            more, missing = self._penetrating(end)
            if not len(more) and not len(missing):
                return self._impelled(course, end)
            # It stays where it is; at first a copy of it also goes on to where the distance is least.  Were all to go
            # on, they would follow each other where members are nearly parallel.
            more = more.fixed().with_more(more) if search < COPIED else more.fixed()
            count = len(end.places)
            forces = end.forces[:count], np.zeros(len(more)), end.forces[count:], np.zeros(len(missing))
            places, spots = end.places.fixed().with_more(more), np.concatenate([end.spots, missing])
            end = replace(end, places=places, spots=spots, forces=np.concatenate(forces))
        return None

    def _ahead(self, begin: Moving, h: float) -> State:
        """Where a step would lead at constant rates; a body that rings faster than steps follow begins where it is."""
        guess, bodies = h * begin.w, self._equations.bodies
        guess[self.system.equations.unknowns :] = 0.0
        turned = np.zeros(int(bodies.max()) + 1)
        count = self.system.equations.rotation_unknowns
        np.maximum.at(turned, bodies[:count], np.abs(guess[:count]))
        guess[turned[bodies] > RINGS] = 0.0
        return self.system.equations.moved(begin.state, guess)

    def _curve(self, state: State, x: Array) -> Curve:
        return self._touching.lines.curve(state.q, self._displaced(x))

    def _farthest(self, moved: Array) -> float:
        """How far any place moves in changes of the quantities (quantities,)."""
        names = self.system.model.segments
        own = np.delete(self._displaced(moved), names.without_position, axis=0)
        return float(np.linalg.norm(own, axis=1).max(initial=0.0))

    def _penetrating(self, end: _End) -> tuple[Places, Index]:
        """What is inside of each other at the end of a step: pairs of places, and spots that are not yet looked at."""
        touching = self._touching
        found = touching.nearby.found(end.curve, 0.0, ends=False)
        deep = touching.nearby.gaps(end.curve, found) < -PENETRATION * 0.5 * touching.nearby.distance[found.pairs]
        inside = np.flatnonzero(touching.on_obstacles(self._displaced(end.x)).gaps < -INSIDE)
        return found.chosen(deep), np.setdiff1d(inside, end.spots)

    def _pushed(self, course: _Course, end: _End) -> _End | None:
        """The end of a step at which nothing penetrates at given places, by Newton's method from there; None where that
        does not converge.
        """
        equations, unknowns, moved, last = self._equations, self.system.equations.unknowns, 0.0, False
        order, back = equations.order, np.argsort(equations.order)
        state, places, forces, factors = end.state, end.places, end.forces, end.factors
        yielding: Sparse = np.zeros((0, 0))
        for k in range(ITERATIONS):
            matrix, residual, x = equations.positions(state, course.begin, course.h, course.factors)
            if not (np.isfinite(residual).all() and np.isfinite(matrix.data).all()):
                return None
            curve = self._curve(state, x)
            slides = k < SLIDING and bool((places.held < 3).any())
            if slides and k:
                places, forces, slides = self._slid(curve, places, forces)
            now = _End(state, x, curve, places, end.spots, forces)
            gaps, here = self._gaps(now)
            along = self._derivatives(now, course)
            # Near the end the same factors do as well.
            fresh = factors is None or moved > FRESH
            factors = factored(matrix) if fresh else factors

            def solve(right: Array, factors: Any = factors) -> Array:
                return np.asarray(factors.solve(right[order])[back])

            step = solve(along.T @ forces - residual)
            if len(gaps):
                if fresh or slides or yielding.shape[0] != len(gaps):
                    yielding = self._bodies.coupled(solve, here, along)
                found = complementary(yielding, gaps + here @ step - yielding @ forces, forces)
                if found is None:
                    return None
                step, forces = step + solve(along.T @ (found - forces)), found
            state, before = self.system.equations.moved(state, step), moved
            moved = float(np.abs(step[:unknowns]).max(initial=0.0))
            if not moved < FAR:
                return None
            if last:
                x = equations.quantities(state, course.factors[1])
                return _End(state, x, self._curve(state, x), places, end.spots, forces, factors)
            # Rounding may leave more than that, which falls no further.
            last = not slides and moved <= (CONVERGED if moved < 0.5 * before else LAST_CHANGE)
        return None

    def _slid(self, curve: Curve, places: Places, forces: Array) -> tuple[Places, Array, bool]:
        """Places that have gone on to where the distance is least, their forces, and whether that is still far."""
        nearby = self._touching.nearby
        found = nearby.nearest(curve, places, 2, CLOSE)
        ends = ((x, y) for x, y in ((places.one, found.one), (places.other, found.other)))
        far = max(
            float(np.abs(self._touching.lines.lengths(y) - self._touching.lines.lengths(x)).max()) for x, y in ends
        )
        able = nearby.apart(found)
        spots = np.ones(len(forces) - len(places), bool)
        return found.chosen(able), forces[np.concatenate([able, spots])], far > SLID

    def _gaps(self, end: _End) -> tuple[Array, Sparse]:
        """Gaps (rows,) of what is looked at, and their derivatives (rows, total), at the end of a step."""
        between, on = self._touching.between(end.curve, end.places), self._touching.on_obstacles(self._displaced(end.x))
        rows = self._touching.derivatives(end.curve, end.places, end.spots, between, on)
        return np.concatenate([between.gaps, on.gaps[end.spots]]), rows

    def _derivatives(self, end: _End, course: _Course) -> Sparse:
        """The derivatives between the begin and the end of a step."""
        touching, earlier = self._touching, self._displaced(course.begin.x)
        between = touching.between(end.curve, end.places, course.before)
        on = touching.on_obstacles(self._displaced(end.x), earlier)
        return touching.derivatives(course.before.mean(end.curve), end.places, end.spots, between, on)

    # -- velocities -----------------------------------------------------------------------------------

    def _impelled(self, course: _Course, end: _End) -> Moving | None:
        """The state after the impulses at the end of a step; None where none are found."""
        begin, h, state = course.begin, course.h, end.state
        v = 2.0 * (end.x - begin.x) / h - begin.v
        solve, momenta = self._equations.massive(state, course.factors[1], v)
        w = solve(momenta)
        after = Moving(begin.t + h, state, end.x, v, w, begin.lost)
        if state.q.shape[1] == 4:
            self.norm = max(self.norm, float(np.abs(np.einsum("ij,ij->i", state.q, state.q) - 1.0).max(initial=0.0)))
        gaps, rows = self._gaps(end)
        closed = np.flatnonzero((end.forces > 0.0) | (gaps < INSIDE))
        if not len(closed):
            return after
        work = (end.forces * (gaps - self._gaps(replace(end, x=begin.x, curve=course.before))[0]))[closed]
        rows, pushed = rows[closed], h * end.forces[closed]
        found = self._rebounds(
            self._bodies.coupled(solve, rows, rows),
            rows @ w,
            np.minimum(rows @ begin.w, 0.0) * self._restitution(end)[closed],
            pushed,
            work,
        )
        if found is None:
            return None
        moved = solve(rows.T @ (found - pushed))
        moved[self.system.equations.unknowns :] = 0.0
        rates = self.system.rates(state, course.factors[1], moved[: self.system.equations.unknowns])[1]
        lost = self._inertia.kinetic(v) - self._inertia.kinetic(v + rates) - float(work.sum())
        told = self._named(end, closed, found)
        return replace(after, v=v + rates, w=w + moved, lost=begin.lost + lost, pushed=told)

    @staticmethod
    def _rebounds(yielding: Sparse, speed: Array, back: Array, pushed: Array, work: Array) -> Array | None:
        """Impulses (n,) of the whole step; None where none are found.

        ``speed`` (n,) are rates of the gaps before those at its end, ``back`` those at its begin where they close times
        the restitution, ``pushed`` the impulses within the step, and ``work`` (n,) what these did.
        """
        from scipy.sparse.csgraph import connected_components

        count, cluster = connected_components(yielding, directed=False)
        for k in range(HALVED + 1):
            right = speed - yielding @ pushed + back
            impulses = complementary(yielding, right, pushed)
            # Once more from there, so that what makes it unique has no part in it.
            impulses = None if impulses is None else complementary(yielding, right, impulses)
            if impulses is None:
                return None
            change = impulses - pushed
            gained = work + 0.5 * change * (2.0 * speed + yielding @ change)
            total = np.bincount(cluster, weights=gained, minlength=count)
            size = np.bincount(cluster, weights=np.abs(work) + np.abs(change * speed), minlength=count)
            grows = (total > GROWN * size)[cluster] & (back < 0.0)
            if not grows.any():
                break
            back = np.where(grows, 0.0 if k == HALVED - 1 else 0.5 * back, back)
        return impulses

    def _restitution(self, end: _End) -> Array:
        between, on = self._touching.rebounds
        return np.concatenate([between[end.places.pairs], on[end.spots]])

    # -- names ----------------------------------------------------------------------------------------

    def _named(self, end: _End, closed: Index, impulses: Array) -> dict[Any, float]:
        """What has pushed, with its impulse."""
        found, lines, places = dict[Any, float](), self._touching.lines, end.places
        ones, others = lines.fractions(places.one), lines.fractions(places.other)
        for k, impulse in zip(closed.tolist(), impulses.tolist(), strict=True):
            if impulse <= 0.0:
                continue
            if k >= len(places):
                found[self._touching.spots[end.spots[k - len(places)]]] = impulse
                continue
            pair = self._touching.nearby.pairs[places.pairs[k]]
            e = [
                int(along.elements[k] - lines.first[lines.owner[along.elements[k]]])
                for along in (places.one, places.other)
            ]
            at = float(ones[k]), float(others[k])
            key = Approach(
                pair.contact, (pair.members[0], pair.members[1]), (e[0], e[1]), at, (True, True), pair.distance
            )
            found[key] = found.get(key, 0.0) + impulse
        return found

    def _refuse_inside(self, begin: Moving) -> None:
        """Refuse members that penetrate each other or obstacles at the begin."""
        touching = self._touching
        curve = touching.lines.curve(begin.state.q, self._displaced(begin.x))
        found = touching.nearby.found(curve, 0.0, ends=False)
        gaps = touching.nearby.gaps(curve, found)
        deep = gaps < -tolerances.CLOSED * self.system.model.scene.size / touching.unit
        for k in np.flatnonzero(deep).tolist():
            pair = touching.nearby.pairs[found.pairs[k]]
            detail = (
                f"members {pair.members[0]!r} and {pair.members[1]!r} penetrate by {-gaps[k] * touching.unit:.3g} m"
            )
            raise SceneError(f"{detail} at t = 0, accepted: members that do not", ("contacts", pair.contact))
        gaps = touching.on_obstacles(self._displaced(begin.x)).gaps
        for k in np.flatnonzero(gaps < -tolerances.CLOSED * self.system.model.scene.size / touching.unit).tolist():
            spot, deep_by = touching.spots[k], -gaps[k] * touching.unit
            message = f"found {spot.where} inside, by {deep_by:.3g} m at t = 0, accepted: members that begin outside"
            raise SceneError(message, ("contacts", spot.contact))


INSIDE = 1e-10
"""Gap, unit of length, up to which something is closed, and by which it may be inside an obstacle."""

FAR = 10.0
"""Change in an iteration, rad or unit of length, at which Newton's method is given up."""


def _owner(key: Spot | Approach) -> object:
    """What touches, wherever along its members."""
    return key if isinstance(key, Spot) else (key.contact, key.members)
