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

import functools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from .. import tolerances
from ..contact.nearby import Places
from ..contact.pairs import penetrating
from ..description.scene import Scene
from ..errors import SceneError, SolveError, Status
from ..mathematics import quaternion
from ..mathematics.arrays import Array, Index, Sparse
from ..mathematics.complementarity import Friction, complementary
from ..mathematics.threads import one_thread
from ..mechanics.equations import State
from ..mechanics.mesh import Approach, Spot
from ..mechanics.rotations import RotationFreedom
from ..mechanics.unilateral import Unilateral, UnilateralRows
from .conserving import check_conserving
from .coupling import Bodies, Moving, StepEquations, factored
from .events import Event
from .gaps import Near, Pose, Rows, Touching
from .impulses import TURNED, ImpulseStepper
from .inertia import Inertia
from .inertialess import refuse_spinning, spinning
from .integrators import InitialState, Integrator, TimeGrid
from .sampling import Sample
from .stages import StageEquations
from .steps import LAST_CHANGE

__all__ = ["Stepping", "by_rows"]

PENETRATION = 5e-7
"""How far members may penetrate at the end of a step, over their radius."""

STRIDE, THINNEST = 0.5, 1e-3
"""How far anything moves in a step, over the smallest distance of touching lines, or a place that comes near to it over
the radius of what is round, before the step is divided; smallest such radius, unit of length.
"""

REACH = 2.0
"""Distance of surfaces at which places are looked at, over how far anything moves in the step without impulses."""

CLOSE = 0.01
"""That distance at least, over the smallest distance of touching lines, or over the unit of length."""

NARROW = 1e-3
"""Gap, over the smallest distance of touching lines, up to which contacts may push after an iteration."""

ITERATIONS, SLIDING, SLID = 40, 4, 1e-8
"""Iterations of Newton's method at most, in how many of them places go on to where the distance is least, and how
little of the unit of length they move then where they have arrived.
"""

SEARCHES, SPREAD = 30, (-0.5, -0.25, 0.25, 0.5, 0.75)
"""Searches after a step at most, and where places are added beside one that is found there: shares of the way from it
to the nearest one of the same two members that was looked at.
"""

NEAREST = 4
"""Steps of Newton's method to the place on the second member that is nearest to one that is added on the first."""

SHORTER = 12
"""How often a step is halved at most."""

CONVERGED = 1e-9
"""Change, rad or unit of length, at which Newton's method ends, with one more iteration."""

ENOUGH = 1e-6
"""Change, rad or unit of length, from which on it is seen where places are to be added."""

FRESH = 1e-5
"""Change, rad or unit of length, up to which the next iteration has the same factors."""

RINGS = 0.05
"""Turn in a step, rad, beyond which rates at its begin say little of where it leads."""

GROWN = 1e-9
"""Energy over that of what moves by which it may grow with restitution: beyond rounding, also where masses differ."""

HALVED = 30
"""How often the restitution of a cluster is halved at most before it is taken to be zero."""


def by_rows(scene: Scene) -> bool:
    """Whether what stops members are rows of the model: strings and stops are, and obstacles where that is faster.

    Contact between members is found by a search, and friction with what it finds.  On what is round or moves, the work
    of rows is that of a step only to second order.
    """
    flat = all(stop.kind == "flat" and stop.carrier is None for stop in scene.obstacles.values())
    apart = scene.rubs or any(contact.between_members for contact in scene.contacts.values())
    return scene.stopped or (flat and not apart and scene.resolved_dimension == "plane")


@dataclass(frozen=True, eq=False)
class _Course:
    """A step: the state and the pose at its begin, its length, factors (2, groups) in its middle and at its end."""

    begin: Moving
    before: Pose
    h: float
    factors: Array


@dataclass(frozen=True, eq=False)
class _End:
    """The end of a step: state, quantities and pose, what is looked at with forces (n, axes) across and along, places
    at which these act in the step, and factors of Newton's matrix.
    """

    state: State
    x: Array
    pose: Pose
    near: Near
    forces: Array
    acting: Near
    factors: Any = None


@dataclass(frozen=True, eq=False)
class _Chosen:
    """Which contacts (n,), of bool, may push in an iteration, and what their forces change at them."""

    looked: Array
    yielding: Sparse


@final
class Stepping(Integrator):
    """Time stepping with impulses for motions in which much touches; steps are as long as told, or shorter."""

    def __init__(self, system: StageEquations, progress: Callable[[float], Any] | None = None) -> None:
        super().__init__(system, progress)
        check_conserving(system, "stepping")
        self._rows: ImpulseStepper | None = None
        if len(system.unilateral):
            refuse_spinning(system.model.scene)
            self._rows = ImpulseStepper(system)
        self._touching = Touching(system)
        self._inertia = Inertia(system)
        self._axes, self._places = system.axes, system.places
        self._driven = bool(system.model.scene.motions)
        self._dragging = system.tables.full if self._touching.rubs else 0

    @functools.cached_property
    def _equations(self) -> StepEquations:
        # Where all that stops members are rows they are not needed.
        return StepEquations(self.system)

    @functools.cached_property
    def _bodies(self) -> Bodies:
        return Bodies(self._equations.bodies)

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
        spin = self.system.equations.spins(at.w)
        if self._rows is None:
            touched = tuple(self._part(key) for key in after.pushed)
            count = len(touched)
            acting, nothing = np.ones(count), np.zeros(count)
            rows = UnilateralRows(touched, np.zeros(count, np.intp), -acting, nothing)
        else:
            rows = self.system.unilateral
            acting = np.array([float(part in after.pushed) for part in rows.parts])
        return Sample(
            at.t, at.state.q, at.state.y, at.x, at.v, (after.v - before.v) / h, spin, at.state.unwrapped,
            acting=acting, lost=at.lost, unilateral=rows, dragged=after.dragged / h,
            rubbed={key: (impulse / h, sticks) for key, (impulse, sticks) in after.rubbed.items()},
            pushed={_spot(key): impulse / after.length for key, impulse in after.pushed.items()},
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

    def _part(self, key: Spot | Approach | Unilateral) -> Unilateral:
        return key if isinstance(key, Unilateral) else Unilateral("contacts", key.contact, "touching", key)

    # -- one step -------------------------------------------------------------------------------------

    def _stepped(self, begin: Moving, h: float) -> Moving:
        """The state after a step, which is halved where that is needed."""
        now, t, left, part = begin, begin.t, h, h
        pushed, rubbed, dragged = dict[Any, float](), dict[Any, tuple[Array, bool]](), np.zeros(self._dragging)
        while left > tolerances.DECIMAL * h:
            part = min(part, left)
            found = self._step(now, part)
            if found is None:
                if part < h * 0.5**SHORTER:
                    detail = f"at {now.t * self.system.masses.time:.9g} s no impulses of a step could be found"
                    detail += f" of {part * self.system.masses.time:.3g} s"
                    light = spinning(self.system.model.scene)[:1] if self._axes == 3 else []
                    detail += "".join(f"; members.{name} has no inertia about its axis, see rhoI" for name in light)
                    raise SolveError(Status.STOPPED, detail)
                part *= 0.5
                continue
            pushed = found.pushed
            _add_rubbed(rubbed, found.rubbed)
            dragged = dragged + found.dragged
            now, left = replace(found, length=part), left - part
            self.count += 1
        return replace(now, t=t + h, pushed=pushed, rubbed=rubbed, dragged=dragged)

    def _factors(self, t: float, h: float) -> Array:
        """Factors (2, groups) of loads in the middle and at the end of a step."""
        end = np.nextafter(t + h, -np.inf)
        return np.array([self.system.factors(t + 0.5 * h), self.system.factors(end)])

    def _displaced(self, x: Array) -> Array:
        """Displacements, or rates, of all places (places, axes) among those of the quantities."""
        return x[: self._axes * self._places].reshape(self._places, self._axes)

    def _step(self, begin: Moving, h: float) -> Moving | None:
        """The state after a step; None where it has to be shorter."""
        if self._rows is not None:
            return self._rows.step(begin, h, self._factors(begin.t, h))
        touching, longest = self._touching, STRIDE * self._touching.distance
        if (stride := self._farthest(h * begin.v)) > longest:
            return None
        course = _Course(begin, self._pose(begin.state, begin.x), h, self._factors(begin.t, h))
        if self._goes_through(course):
            return None
        ahead, x = self._ahead(course), begin.x + h * begin.v
        pose, reach = self._pose(ahead, x), max(REACH * stride, CLOSE * min(touching.distance, 1.0))
        places = touching.nearby.found(pose.curve, reach)
        near = Near(places, np.flatnonzero(touching.on_obstacles(pose) < reach))
        end: _End | None = _End(ahead, x, pose, near, np.zeros((len(near), self._axes)), near)
        closely = False
        for _ in range(SEARCHES):
            end = None if end is None else self._pushed(course, end, closely)
            if end is None or self._farthest(end.x - begin.x) > 2.0 * longest or self._turned(begin, end) > TURNED:
                return None
            more, missing = self._penetrating(end)
            if not len(more) and not len(missing):
                if closely:
                    return self._impelled(course, end)
                closely = True
                continue
            more = self._spread(end, more)
            count, nothing = len(end.near.places), np.zeros((len(more) + len(missing), self._axes))
            parts = end.forces[:count], nothing[: len(more)], end.forces[count:], nothing[len(more) :]
            near = Near(end.near.places.fixed().with_more(more), np.concatenate([end.near.spots, missing]))
            end = replace(end, near=near, forces=np.concatenate(parts))
        return None

    def _goes_through(self, course: _Course) -> bool:
        """Whether a place may go through something round unseen, whose radius it moves by in the step."""
        touching = self._touching
        radii = np.maximum(touching.radii, THINNEST)
        moves = np.linalg.norm(self._displaced(course.h * course.begin.v)[touching.places], axis=1)
        far = moves > STRIDE * radii
        return bool(far.any() and (far & (touching.on_obstacles(course.before) < moves)).any())

    def _ahead(self, course: _Course) -> State:
        """Where a step would lead at constant rates; a body that rings faster than steps follow begins where it is."""
        begin, bodies = course.begin, self._equations.bodies
        guess = course.h * begin.w
        guess[self.system.equations.unknowns :] = 0.0
        turned = np.zeros(int(bodies.max()) + 1)
        count = self.system.equations.rotation_unknowns
        np.maximum.at(turned, bodies[:count], np.abs(guess[:count]))
        guess[turned[bodies] > RINGS] = 0.0
        state = self.system.equations.moved(begin.state, guess)
        if not self._driven:
            return state
        return self.system.equations.holding(state, self.system.loading(course.factors[1]))

    def _pose(self, state: State, x: Array) -> Pose:
        return self._touching.pose(state.q, self._displaced(x))

    def _farthest(self, moved: Array) -> float:
        """How far any place moves in changes of the quantities (quantities,)."""
        names = self.system.model.segments
        own = np.delete(self._displaced(moved), names.without_position, axis=0)
        return float(np.linalg.norm(own, axis=1).max(initial=0.0))

    def _turned(self, begin: Moving, end: _End) -> float:
        """How far anything turns in a step, rad."""
        q0, q1 = begin.state.q, end.state.q
        if self._axes == 2:
            return float(np.abs(q1 - q0).max(initial=0.0))
        turned = quaternion.rotation_vector(quaternion.multiply(q1, quaternion.conjugate(q0)))
        return float(np.abs(turned).max(initial=0.0))

    def _penetrating(self, end: _End) -> tuple[Places, Index]:
        """What is inside of each other at the end of a step: pairs of places, and spots that are not yet looked at."""
        touching = self._touching
        found = touching.nearby.found(end.pose.curve, 0.0, ends=False)
        deep = touching.nearby.gaps(end.pose.curve, found) < -PENETRATION * 0.5 * touching.nearby.distance[found.pairs]
        inside = np.flatnonzero(touching.on_obstacles(end.pose) < -INSIDE)
        return found.chosen(deep), np.setdiff1d(inside, end.near.spots)

    def _spread(self, end: _End, more: Places) -> Places:
        """Places that are added for those that penetrate: these, and more beside them, as members that are nearly
        parallel turn about each place at which one pushes.  All stay where they are: were they to go on to where the
        distance is least, they would follow each other.
        """
        own, lines, found = end.near.places, self._touching.lines, more.fixed()
        if not len(own) or not len(more):
            return found
        ways = [lines.lengths(y) - lines.lengths(x)[:, None] for x, y in ((more.one, own.one), (more.other, own.other))]
        far = np.where(more.pairs[:, None] == own.pairs, np.abs(ways[0]) + np.abs(ways[1]), np.inf)
        nearest = np.argmin(far, axis=1)
        beside = np.flatnonzero(np.isfinite(far[np.arange(len(more)), nearest]))
        some, ways = more.chosen(beside), [way[beside, nearest[beside]] for way in ways]
        for share in SPREAD:
            one, other = (lines.moved(x, share * way) for x, way in zip((some.one, some.other), ways, strict=True))
            there = Places(some.pairs, one, other, np.ones(len(some), np.intp))
            there = self._touching.nearby.nearest(end.pose.curve, there, NEAREST, CLOSE)
            found = found.with_more(there.chosen(self._touching.nearby.apart(there)).fixed())
        return found

    def _pushed(self, course: _Course, end: _End, closely: bool) -> _End | None:
        """The end of a step at which nothing penetrates at given places, by Newton's method from there, nearly so where
        other places may be added; None where that does not converge.
        """
        equations, unknowns, moved, last = self._equations, self.system.equations.unknowns, 0.0, False
        order, back = equations.order, np.argsort(equations.order)
        touching, state, near, forces = self._touching, end.state, end.near, end.forces
        acting, factors = near, end.factors
        kept: _Chosen | None = None
        for k in range(ITERATIONS):
            # Near the end the same factors do as well.
            fresh = factors is None or moved > FRESH
            residual, x, matrix = equations.positions(state, course.begin, course.h, course.factors, fresh=fresh)
            if not (np.isfinite(residual).all() and (matrix is None or np.isfinite(matrix.data).all())):
                return None
            pose = self._pose(state, x)
            slides = k < SLIDING and bool((near.places.held < 3).any())
            if slides and k:
                near, forces, slides = self._slid(pose, near, forces)
            friction = touching.friction(near)
            acting = touching.passed(course.before, pose, near) if k <= SLIDING else acting
            rows = touching.rows(course.before, pose, acting, middle=True)
            along, friction = rows.matrix(touching.lines), friction.scaled(rows.lengths)
            factors = factors if matrix is None else factored(matrix)

            def solve(right: Array, factors: Any = factors) -> Array:
                return np.asarray(factors.solve(right[order])[back])

            given = _listed(forces, friction)
            step = solve(along.T @ given - residual)
            if len(near):
                here = touching.rows(course.before, pose, near, acting).matrix(touching.lines)
                opened = np.concatenate([touching.gaps(pose, near), touching.slips(course.before, pose, acting)])
                if fresh or slides or (kept is not None and len(kept.looked) != len(near)):
                    kept = None
                found = self._forces(solve, (here, along), opened, given, step, friction, kept)
                if found is None:
                    return None
                given, step, kept = found
                forces = _arranged(given, friction, forces)
            state, before = self.system.equations.moved(state, step), moved
            moved = float(np.abs(step[:unknowns]).max(initial=0.0))
            if not moved < FAR:
                return None
            if last or not (closely or slides or moved > ENOUGH):
                x = equations.quantities(state, course.factors[1])
                return _End(state, x, self._pose(state, x), near, forces, acting, factors)
            # Rounding may leave more than that, which falls no further.
            last = not slides and moved <= (CONVERGED if moved < 0.5 * before else LAST_CHANGE)
        return None

    def _forces(
        self,
        solve: Callable[[Array], Array],
        rows: tuple[Sparse, Sparse],
        opened: Array,
        given: Array,
        step: Array,
        friction: Friction,
        kept: _Chosen | None,
    ) -> tuple[Array, Array, _Chosen] | None:
        """Forces (n,), the step with them, and of which contacts they are sought; None where none are found.

        Of all that is looked at only what may push has a part in it: what has pushed, and what the step closes.

        Parameters
        ----------
        solve : callable
            Newton's step for a residual.
        rows : (here, along)
            Derivatives of gaps and slips, and ways of forces.
        opened, given : ndarray (n,)
            Gaps and slips, and forces before.
        step : ndarray (total,)
            With these forces.
        friction : Friction
        kept : optional
            What has been chosen with the same factors before.
        """
        (here, along), count, before = rows, len(opened) - friction.along.size, step
        looked = (given[:count] > 0.0) | ((opened + here @ step)[:count] < NARROW * self._touching.distance)
        if kept is not None:
            looked |= kept.looked
        while True:
            chosen, own = friction.of(looked)
            if kept is None or (looked != kept.looked).any():
                kept = _Chosen(looked.copy(), self._bodies.coupled(solve, here[chosen], along[chosen]))
            right = (opened + here @ before)[chosen] - kept.yielding @ given[chosen]
            found = complementary(kept.yielding, right, given[chosen], own)
            if found is None:
                return None
            after = given.copy()
            after[chosen] = found
            step = before + solve(along.T @ (after - given))
            closed = ((opened + here @ step)[:count] < -INSIDE) & ~looked
            if not closed.any():
                return after, step, kept
            looked |= closed

    def _slid(self, pose: Pose, near: Near, forces: Array) -> tuple[Near, Array, bool]:
        """What is looked at where places have gone on to where the distance is least, the forces, and whether that is
        still far.
        """
        nearby, places = self._touching.nearby, near.places
        found = nearby.nearest(pose.curve, places, 2, CLOSE)
        ends = ((x, y) for x, y in ((places.one, found.one), (places.other, found.other)))
        far = max(
            float(np.abs(self._touching.lines.lengths(y) - self._touching.lines.lengths(x)).max()) for x, y in ends
        )
        able = nearby.apart(found)
        kept = np.concatenate([able, np.ones(len(near.spots), bool)])
        return Near(found.chosen(able), near.spots), forces[kept], far > SLID

    # -- velocities -----------------------------------------------------------------------------------

    def _impelled(self, course: _Course, end: _End) -> Moving | None:
        """The state after the impulses at the end of a step; None where none are found."""
        begin, h, state, touching = course.begin, course.h, end.state, self._touching
        v = 2.0 * (end.x - begin.x) / h - begin.v
        drift, spins = self._drift(state, begin.t + h)
        solve, momenta = self._equations.massive(state, course.factors[1], v - drift)
        w = solve(momenta)
        after = Moving(begin.t + h, state, end.x, v, w, begin.lost, dragged=np.zeros(self._dragging))
        if state.q.shape[1] == 4:
            self.norm = max(self.norm, float(np.abs(np.einsum("ij,ij->i", state.q, state.q) - 1.0).max(initial=0.0)))
        gaps = touching.gaps(end.pose, end.near)
        closed = np.flatnonzero((end.forces[:, 0] > 0.0) | (gaps < INSIDE))
        if not len(closed):
            return after
        near, acting, forces = end.near.chosen(closed), end.acting.chosen(closed), end.forces[closed]
        friction, gained = (
            touching.friction(near),
            touching.gaps(end.pose, acting) - touching.gaps(course.before, acting),
        )
        held, lengths = _listed(forces, friction), touching.rows(course.before, end.pose, acting, middle=True).lengths
        work = held * np.concatenate([gained, touching.slips(course.before, end.pose, acting)])
        rows = touching.rows(course.before, end.pose, near)
        matrix, moving = rows.matrix(touching.lines), rows.along(self._full(drift, spins))
        before = (matrix @ begin.w + rows.along(self._full(*self._drift(begin.state, begin.t))))[: len(closed)]
        back = np.zeros(len(held))
        back[: len(closed)] = np.minimum(before, 0.0) * touching.restitution(near)
        pushed = h * held * lengths
        found = self._rebounds(
            self._bodies.coupled(solve, matrix, matrix), matrix @ w + moving, back, pushed, work, friction
        )
        if found is None:
            return None
        impulses, gain = found
        moved = solve(matrix.T @ (impulses - pushed))
        moved[self.system.equations.unknowns :] = 0.0
        rates = self.system.rates(state, course.factors[1], moved[: self.system.equations.unknowns])[1]
        told = self._named(near, impulses, friction, rows)
        return replace(after, v=v + rates, w=w + moved, lost=begin.lost - gain, **told)

    def _drift(self, state: State, t: float) -> tuple[Array, Array]:
        """Rates (quantities,) of what prescribed motions move, and angular velocities (rotations, turns) of what they
        turn.
        """
        system = self.system
        if not self._driven:
            return np.zeros(system.layout.x), np.zeros((0, 0))
        unit, factors, still = system.masses.time, system.factors(t), np.zeros(system.equations.unknowns)
        faster = np.array([0.0 if history is None else history.rate(t * unit) * unit for history in system.histories])
        turned, turning = system.loading(factors).turn, system.loading(faster).turn
        spins = quaternion.angular_velocity(turned, turning)[:, 3 - system.tables.width :]
        fixed = system.model.rotations.kind == RotationFreedom.FIXED
        return system.rates_in_time(state, factors, still, faster)[1], np.where(fixed[:, None], spins, 0.0)

    def _full(self, rates: Array, spins: Array) -> Array:
        """Rates by full coordinates."""
        tables = self.system.tables
        found = np.zeros(tables.full)
        if self._driven:
            found[: tables.of_places] = spins.ravel()
            found[tables.of_places : tables.of_rows] = self._displaced(rates).ravel()
        return found

    @staticmethod
    def _rebounds(
        yielding: Sparse, speed: Array, back: Array, pushed: Array, work: Array, friction: Friction
    ) -> tuple[Array, float] | None:
        """Impulses (n,) of the whole step and what energy gains by it; None where none are found.

        ``speed`` (n,) are rates of gaps and slips before those at its end, ``back`` those at its begin where gaps close
        times the restitution, ``pushed`` the impulses within the step, and ``work`` (n,) what these did.
        """
        from scipy.sparse.csgraph import connected_components

        impulses: Array
        count, cluster = connected_components(yielding, directed=False)
        kept, of_step = np.zeros(len(pushed)), np.zeros(len(pushed))
        of_step[friction.along] = pushed[friction.along]
        for k in range(HALVED + 2):
            right = speed + yielding @ (kept - pushed) + back
            found = complementary(yielding, right, pushed - kept, friction)
            # Once more from there, so that what makes it unique has no part in it.
            found = None if found is None else complementary(yielding, right, found, friction)
            if found is None:
                return None
            impulses = kept + found
            change = impulses - pushed
            gained = work + 0.5 * change * (2.0 * speed + yielding @ change)
            total = np.bincount(cluster, weights=gained, minlength=count)
            size = np.bincount(cluster, weights=np.abs(work) + np.abs(change * speed), minlength=count)
            rebounds = np.bincount(cluster, weights=back < 0.0, minlength=count) > 0.0
            grows = (total > GROWN * size)[cluster]
            halved = grows & (back < 0.0)
            # Friction of the step that is not taken back takes energy away whatever comes after it.
            stays = grows & ~rebounds[cluster] & (kept != of_step)
            if not halved.any() and not stays.any():
                break
            back = np.where(halved, 0.0 if k >= HALVED - 1 else 0.5 * back, back)
            kept = np.where(stays, of_step, kept)
        return impulses, float(gained.sum())

    # -- names ----------------------------------------------------------------------------------------

    def _named(self, near: Near, impulses: Array, friction: Friction, rows: Rows) -> dict[str, Any]:
        """What has pushed, with its impulse; what friction has done, by name and in all."""
        pushed, rubbed = dict[Any, float](), dict[Any, tuple[Array, bool]]()
        keys = {k: self._key(near, k) for k in np.flatnonzero(impulses[: len(near)] > 0.0).tolist()}
        for k, key in keys.items():
            pushed[key] = pushed.get(key, 0.0) + impulses[k]
        if not self._touching.rubs:
            return {"pushed": pushed}
        ways, most = rows.directions, friction.coefficients * impulses[friction.across]
        sticks = np.linalg.norm(impulses[friction.along], axis=1) < (1.0 - STICKS) * most
        for k, own, still in zip(friction.across.tolist(), friction.along, sticks.tolist(), strict=True):
            if k in keys:
                _add_rubbed(rubbed, {keys[k]: (impulses[own] @ ways[own], still)})
        along = np.where(np.arange(len(impulses)) < len(near), 0.0, impulses)
        return {"pushed": pushed, "rubbed": rubbed, "dragged": rows.of_forces(along, self.system.tables.full)}

    def _key(self, near: Near, k: int) -> Spot | Approach:
        """The name of something that is looked at."""
        places, lines = near.places, self._touching.lines
        if k >= len(places):
            return self._touching.spots[near.spots[k - len(places)]]
        pair, both = self._touching.nearby.pairs[places.pairs[k]], (places.one, places.other)
        e = [int(along.elements[k] - lines.first[lines.owner[along.elements[k]]]) for along in both]
        at = [float(lines.fractions(along.chosen(np.array([k])))[0]) for along in both]
        return Approach(
            pair.contact, (pair.members[0], pair.members[1]), (e[0], e[1]), (at[0], at[1]), (True, True), pair.distance
        )

    def _refuse_inside(self, begin: Moving) -> None:
        """Refuse members that penetrate each other or obstacles at the begin."""
        touching = self._touching
        pose = self._pose(begin.state, begin.x)
        found = touching.nearby.found(pose.curve, 0.0, ends=False)
        gaps = touching.nearby.gaps(pose.curve, found)
        deep = gaps < -tolerances.CLOSED * self.system.model.scene.size / touching.unit
        for k in np.flatnonzero(deep).tolist():
            pair, lines = touching.nearby.pairs[found.pairs[k]], touching.nearby.lines
            at = (float(lines.fractions(along.chosen(np.array([k])))[0]) for along in (found.one, found.other))
            detail = penetrating(pair.members, at, -gaps[k] * touching.unit)
            raise SceneError(f"{detail} at t = 0, accepted: members that do not", ("contacts", pair.contact))
        gaps = touching.on_obstacles(pose)
        for k in np.flatnonzero(gaps < -tolerances.CLOSED * self.system.model.scene.size / touching.unit).tolist():
            spot, deep_by = touching.spots[k], -gaps[k] * touching.unit
            message = f"found {spot.where} inside, by {deep_by:.3g} m at t = 0, accepted: members that begin outside"
            raise SceneError(message, ("contacts", spot.contact))


INSIDE = 1e-10
"""Gap, unit of length, up to which something is closed, and by which it may be inside an obstacle."""

FAR = 10.0
"""Change in an iteration, rad or unit of length, at which Newton's method is given up."""


STICKS = 1e-6
"""Share of the largest force along surfaces by which it has to be smaller for what touches to be told as sticking."""


def _listed(forces: Array, friction: Friction) -> Array:
    """Forces (n, axes) as numbers: those across, then those along of what rubs."""
    return np.concatenate([forces[:, 0], forces[friction.across, 1:].ravel()])


def _arranged(listed: Array, friction: Friction, forces: Array) -> Array:
    """The opposite of :func:`_listed`, as an array like some forces (n, axes)."""
    found = np.zeros_like(forces)
    found[:, 0] = listed[: len(forces)]
    found[friction.across, 1:] = listed[friction.along]
    return found


def _add_rubbed(found: dict[Any, tuple[Array, bool]], more: Mapping[Any, tuple[Array, bool]]) -> None:
    """Add impulses of friction to those of the same names; what does not stick everywhere does not."""
    for key, (impulse, sticks) in more.items():
        before = found.get(key)
        found[key] = (impulse, sticks) if before is None else (before[0] + impulse, before[1] and sticks)


def _spot(key: Spot | Approach | Unilateral) -> Spot | Approach | None:
    """What touches; None for a string or a stop."""
    return key.spot if isinstance(key, Unilateral) else key


def _owner(key: Spot | Approach | Unilateral) -> object:
    """What touches, wherever along its members."""
    return (key.contact, key.members) if isinstance(key, Approach) else key
