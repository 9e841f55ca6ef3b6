"""Arc length continuation: following a curve of equilibria through limit points.

The unknowns are those of the stationarity equations and the factor of loads and motions.  The predictor of a step is
the tangent with the curvature that the last two tangents give; the corrector is Newton's method with one more row,
which keeps corrections orthogonal to the tangent.  Lengths are measured in the root mean square of the rotations, rad,
and in the factor over a unit, so that they do not depend on the mesh; displacements that springs or joints act upon
count a little, multipliers not at all: where a structure carries more load without moving, only the factor counts.
"""

from __future__ import annotations

import copy
import ctypes
import functools
from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np

from .. import tolerances
from ..errors import SolveError
from ..mathematics.arrays import TINY, Array, Index
from ..mathematics.core import Curve as CoreCurve
from ..mathematics.core import Told
from ..mechanics.equations import MOST_ROWS, Point, State
from ..mechanics.loading import Loading
from ..mechanics.memory import Remembering
from .between_states import turned_between
from .neutral import Neutral
from .newton import Balance, ForCore, Limits, correct, limits_for_core
from .one_sided import Border
from .prepared import Prepared, Solved
from .redundancy import ROUGHLY, loose_rows, met, redundant, usual_square, with_sharing
from .residuals import relative_residual
from .sharing import shared
from .stability import LIGHT, Inertia

__all__ = ["PASSING", "Curve", "Standing", "Tangent", "bordered"]

PASSING = 1e-10
"""Relative residual up to which intermediate points of a curve are iterated; points of an answer go to rounding."""

TURN = 0.6
"""Largest rotation of a node, rad, by all corrections of a step together."""

LARGE_PRIMAL_FACTOR = 1e3
"""Factor of the proximal term at a second attempt, where the usual one happens to make the matrix singular."""

DOUBT = 30.0
"""Response to a random load of size one above which an eigenvalue may vanish; an eigenvalue of 1e-7 gives 1e5."""

ITERATIONS = 10
"""Largest number of Newton steps of a correction."""

SHORT = 0.01
"""Corrections shorter than this, rad, need not shrink: beside a bifurcation the first ones wander along its mode."""

FIXED_STEP = 1e-3
"""Change of what is prescribed, rad or dimensionless, in differences of the equations: of fourth order, so 1e-13."""

STARTS, BEHIND = 60, 10.0
"""Starts of Newton's method beside a corner of the curve; times farther than ahead a point behind it is looked for."""

PLACES = (1.0 / 3.0, 2.0 / 3.0)
"""Places within a step at which it is looked for turning points of what members remember."""

HISTORY = 1e-5
"""Step of the differences of loads with histories, share of the unit of the factor: of second order, so 1e-10."""


@dataclass(frozen=True, eq=False)
class Tangent:
    """Direction of the curve, of length one in the metric of :meth:`Curve.inner`.

    Attributes
    ----------
    z : ndarray (total,)
        Rates of unknowns and multipliers over the arc length, dimensionless.
    factor : float
        Rate of the factor.
    neutral : Neutral, optional
        Motions that are neutral all along the curve; the tangent has no part along them.
    """

    z: Array
    factor: float
    neutral: Neutral | None = None

    @property
    def back(self) -> Tangent:
        """The direction the other way along the curve."""
        return replace(self, z=-self.z, factor=-self.factor)


@dataclass(frozen=True, eq=False, kw_only=True)
class Standing(Solved):
    """A point of the curve.

    Attributes
    ----------
    tangent : Tangent
    arc : float
        Arc length from the start of the curve.
    doubtful : bool
        Whether an eigenvalue may vanish here: the response to a probing load exceeds ``DOUBT``.
    """

    tangent: Tangent
    arc: float
    doubtful: bool

    @functools.cached_property
    def inertia(self) -> Inertia:
        """Numbers of negative and of vanishing eigenvalues of the energy on the closings."""
        return self.prepared.inertia(self.point, doubtful=self.doubtful)


class Curve:
    """The equilibria of a model as a curve over a factor.

    Parameters
    ----------
    prepared : Prepared
    unit : float
        Change of the factor that counts as much in lengths as a rotation by a radian.
    piece : tuple of float
        Range of factors within which no history has a knot.

    Attributes
    ----------
    searched : int
        Number of points computed so far in searches for critical points.
    """

    def __init__(self, prepared: Prepared, unit: float, piece: tuple[float, float] = (-np.inf, np.inf)) -> None:
        self.prepared, self.unit, self.piece = prepared, unit, piece
        self.searched = 0
        equations = prepared.equations
        self.equations, self.model = equations, prepared.model
        rotation_unknowns = equations.rotation_unknowns
        self.weight = np.zeros(equations.total)
        lengths = sum(line.length for line in prepared.model.scene.center_lines.values())
        self.weight[:rotation_unknowns] = equations.mass * prepared.model.scales.length / lengths
        self.weight[equations.elastic_displacements] = LIGHT
        self._rotation_unknowns, self._proximal = rotation_unknowns, tolerances.PROXIMAL * prepared.weight
        self._driven = any(np.any(group.turn) for group in self.model.groups.values())
        self._linear = set(self.model.groups) == {None}
        self._limited = prepared.model.scene.limited

    def beyond_limits(self, standing: Standing) -> SolveError | None:
        """Why a point is beyond what the scene describes, see :meth:`.Fields.beyond_limits`; None where it is not."""
        return standing.fields.beyond_limits() if self._limited else None

    @property
    def remembers(self) -> bool:
        """Whether members remember what has led to a point, so that the curve goes on from each of them anew."""
        return self.model.scene.remembers

    def on(self, prepared: Prepared) -> Curve:
        """The curve with what members remember in another model of the same mesh; itself where that is its own."""
        if prepared is self.prepared:
            return self
        there = copy.copy(self)
        there.prepared, there.equations, there.model = prepared, prepared.equations, prepared.model
        there.__dict__.pop("for_core", None)
        return there

    def following(self, there: Standing) -> Curve:
        """The curve on which the path goes on from a point: members remember what has led there."""
        return self.on(there.prepared.remembering(there.state))

    def within(self, piece: tuple[float, float]) -> Curve:
        """A copy of the curve with another ``piece``, the range of factors without a knot of a history."""
        there = copy.copy(self)
        there.piece = piece
        return there

    def without_neutral(self, standing: Standing) -> Standing:
        """The point with the motions that are neutral there noted in its tangent, which has no part along them."""
        values, shapes = self.prepared.around_zero(standing.point)[1:]
        chosen = shapes[:, np.argsort(np.abs(values))[: standing.inertia.zero]]
        along = replace(standing.tangent, neutral=self.neutral(standing.point, chosen))
        return replace(standing, tangent=self._tangent(standing, along)[0])

    def neutral(self, point: Point, shapes: Array, primal_factor: float = 1.0) -> Neutral:
        """Motions with the given shapes (rotation unknowns, n), rad, for corrections that leave them alone.

        A large ``primal_factor`` of the proximal term keeps them from mixing with other neutral motions.
        """
        weight = self.prepared.weight
        weighted = Neutral.right(shapes, weight, self.equations.total)
        return Neutral.answered(weighted, self.solved(point, weighted, primal_factor), weight)[0]

    # -- lengths --------------------------------------------------------------------------------

    def inner(self, a: Tangent, b: Tangent) -> float:
        """Inner product of two directions: weighted sum over the unknowns, plus factors over their unit."""
        return float(a.z @ (self.weight * b.z)) + a.factor * b.factor / self.unit**2

    def normed(self, direction: Tangent) -> Tangent:
        """The direction scaled to length one in :meth:`inner`."""
        length = np.sqrt(self.inner(direction, direction))
        return replace(direction, z=direction.z / length, factor=direction.factor / length)

    def way(self, a: Standing, b: Standing) -> float:
        """Distance of the second point ahead of the first along the tangent there; rotations and the factor count."""
        apart = np.zeros(self.equations.total)
        apart[: self._rotation_unknowns] = turned_between(self.equations, b.state, a.state)
        return self.inner(Tangent(apart, b.factor - a.factor), a.tangent)

    # -- derivative by the factor ---------------------------------------------------------------

    def with_prescribed(self, state: State, loading: Loading) -> State:
        """The state with prescribed rotations at the values of a loading."""
        return self.equations.holding(state, loading) if self._driven else state

    def loading(self, factor: float) -> Loading:
        """Loads and motions at a factor; outside of the piece extrapolated linearly from its end."""
        within = min(max(factor, self.piece[0]), self.piece[1])
        there = self.model.loading(within)
        if within == factor:
            return there
        return replace(there.plus(self.rate(within).scaled(factor - within)), factor=factor)

    def rate(self, factor: float) -> Loading:
        """Derivative of loads and motions by the factor; at a knot of a history the one-sided one within the piece."""
        if self._linear:
            return self.model.groups[None]
        low, high = self.piece
        h = min(HISTORY * self.unit, 0.25 * (high - low))
        middle = min(max(factor, low + h), high - h)
        after, before = self.model.loading(middle + h), self.model.loading(middle - h)
        return after.plus(before.scaled(-1.0)).scaled(0.5 / h)

    def slope(self, state: State, factor: float, point: Point) -> Array:
        """Derivative (total,) of the residual by the factor at a state, dimensionless.

        Exact but for prescribed rotations, and displacements of places to which more than members is fixed, which
        enter by central differences of fourth order.
        """
        rate = self.rate(factor)

        def residual(w: float) -> Array:
            there = self.loading(factor).plus(rate.scaled(w))
            return self.equations.at(self.equations.holding(state, there), there).residual

        moved, nodal = self._steady if self._linear else self._kind(rate)
        if moved == 0.0 and nodal:
            return self.equations.slope(state, point, rate)
        if moved == 0.0:
            return np.asarray((residual(self.unit) - point.residual) / self.unit)
        h = min(self.unit, FIXED_STEP / moved)
        a, b = ((residual(w) - residual(-w)) / (2.0 * w) for w in (h, 2.0 * h))
        return np.asarray((4.0 * a - b) / 3.0)

    @functools.cached_property
    def _steady(self) -> tuple[float, bool]:
        """What :meth:`_kind` says where no history changes it."""
        return self._kind(self.model.groups[None])

    def _kind(self, rate: Loading) -> tuple[float, bool]:
        """Largest rate of what is prescribed in which the equations are not linear, and whether loads and motions act
        on nodes only.
        """
        shifts = rate.shift.reshape(-1, self.model.element.axes)[self._seen]
        return max(float(np.abs(part).max(initial=0.0)) for part in (rate.turn, shifts, rate.driven)), rate.nodal

    @functools.cached_property
    def for_core(self) -> tuple[Array, Array] | None:
        """What is given at factor 0 and its rate, for the core; None where loads or equations are not linear in it."""
        if not self._linear or self._driven or self._steady[0] != 0.0:
            return None
        return self.equations.given(self.loading(0.0)), self.equations.given(self.rate(0.0))

    @property
    def _apart(self) -> float:
        """Change of the factor in differences by the core, of equations that are linear in loads; 0: no differences."""
        return 0.0 if self._steady[1] else self.unit

    @functools.cached_property
    def _seen(self) -> Index:
        """Numbers of the places whose displacements terms other than elements see, as springs and strings do."""
        seen = [group.places.ravel() for group in self.model.connections]
        return np.unique(np.concatenate([np.zeros(0, np.intp), *seen]))

    # -- points ---------------------------------------------------------------------------------

    def solved(self, point: Point, right: Array, primal_factor: float = 1.0) -> Array:
        """Solutions for right sides (total, n) with the Newton matrix and ``primal_factor`` times the proximal term."""
        entries = self.equations.regularised(point.entries, primal_factor * self._proximal, tolerances.DUAL)
        self.equations.solver.factor(entries)
        return self.equations.solver.solve(right)

    def _tangent(self, at: Solved, along: Tangent) -> tuple[Tangent, bool]:
        """Tangent of the curve at an equilibrium, signed as ``along``, and whether an eigenvalue may vanish there.

        ``along`` itself where the regularised matrix is singular.
        """
        point = at.point
        rights = [-self.slope(at.state, at.factor, point), self._probe]
        rights += [] if along.neutral is None else [*along.neutral.weighted.T]
        try:
            both = self.solved(point, np.column_stack(rights))
        except np.linalg.LinAlgError:
            return along, True
        if not np.all(np.isfinite(both)):
            return along, True
        rate, answer, neutral = both[: len(self.weight), 0], both[: self._rotation_unknowns, 1], None
        if along.neutral is not None:
            neutral, values = Neutral.answered(along.neutral.weighted, both[:, 2:], self.prepared.weight)
            neutral = neutral if np.abs(values).max() <= tolerances.NEUTRAL else None
            rate = rate if neutral is None else neutral.without(rate)
        loose = loose_rows(self.equations, point) if redundant(self.equations, point) else np.zeros(0)
        if loose.size:
            # The rule for redundant multipliers is linear in multipliers and loads: it holds for their rates as well.
            first = self.equations.unknowns
            way = shared(self.equations, replace(at.state, lam=rate[first:]), self.rate(at.factor), loose)
            rate[first:] = way.lam
        found = self.normed(Tangent(rate, 1.0, neutral))
        doubtful = float(answer @ (self.prepared.weight * answer)) > DOUBT**2
        return found if self.inner(found, along) >= 0.0 else found.back, doubtful

    @functools.cached_property
    def _probe(self) -> Array:
        """A random load (total,) of size one: its response is large where an eigenvalue of the matrix is near zero."""
        weight, probe = self.prepared.weight, np.zeros(self.equations.total)
        shape = np.random.default_rng(0).standard_normal(self._rotation_unknowns)
        probe[: self._rotation_unknowns] = weight * shape / np.sqrt(max(float(shape @ (weight * shape)), TINY))
        return probe

    def standing(
        self, state: State, factor: float, along: Tangent, *, arc: float = 0.0, iterations: int = 0
    ) -> Standing:
        """The point of the curve at an equilibrium, with its tangent signed as ``along``."""
        loading = self.loading(factor)
        state, point = with_sharing(self.equations, state, loading, self.equations.at(state, loading), PASSING)
        residual = relative_residual(self.equations, point)
        found = Solved(self.prepared, state, loading, point, residual, iterations=iterations)
        return self._standing(found, along, arc)

    def _standing(self, found: Solved, along: Tangent, arc: float) -> Standing:
        tangent, doubtful = self._tangent(found, along)
        known = (getattr(found, part.name) for part in fields(Solved))
        return Standing(*known, tangent=tangent, arc=arc, doubtful=doubtful)

    def predicted(self, start: Standing, length: float, bend: Tangent | None = None) -> tuple[State, float]:
        """State and factor at an arc length from a point: along its tangent, with the curvature ``bend`` if given."""
        z, factor = length * start.tangent.z, start.factor + length * start.tangent.factor
        if bend is not None:
            z, factor = z + 0.5 * length**2 * bend.z, factor + 0.5 * length**2 * bend.factor
        return self.with_prescribed(self.equations.moved(start.state, z), self.loading(factor)), factor

    def corrected(
        self,
        state: State,
        factor: float,
        across: Tangent,
        arc: float = 0.0,
        *,
        primal_factor: float = 1.0,
        sharp: bool = True,
    ) -> Standing | None:
        """The equilibrium in the hyperplane through a state near the curve orthogonal to ``across``; None if not found.

        With a large ``primal_factor`` of the proximal term neutral directions keep their values.  ``sharp`` iterates
        to rounding instead of :data:`PASSING`.
        """
        limits = Limits(iterations=ITERATIONS, short=SHORT, turned=TURN, near=tolerances.BALANCED, returns=False)
        primal_factor = primal_factor if across.neutral is None else max(primal_factor, LARGE_PRIMAL_FACTOR)
        found = Solved(
            self.prepared, *correct(_Across(self, across, primal_factor, sharp), state, factor=factor, limits=limits)
        )
        return self._standing(found, across, arc) if found.converged else None

    def at_factor(self, near: Standing, factor: float, most: float = TURN) -> Standing | None:
        """The equilibrium at a factor, from a point near it; None if Newton's method does not converge to one near.

        ``most`` is the largest rotation of a node, rad, between the two.
        """
        if near.tangent.neutral is not None:
            across = Tangent(np.zeros(self.equations.total), 1.0, near.tangent.neutral)
            still = self.corrected(near.state, factor, across, near.arc)
            apart = np.inf if still is None else self.prepared.distance(still.state, near.state)
            return None if still is None or apart > most else replace(still, tangent=near.tangent)
        found = self.prepared.correct(near.state, self.loading(factor), most=most)
        if not found.converged or self.prepared.distance(found.state, near.state) > most:
            return None
        return self.standing(found.state, factor, near.tangent, arc=near.arc)

    def around(self, now: Standing, length: float) -> Standing | None:
        """The point at about a small length beyond a corner, shortly behind which a point lies; None if none is found.

        At the corner some places begin to yield and others to unload.  Newton's method may lead to and fro between the
        two there: it is begun at places around the expected one.  Where the curve turns back sharply, it goes on
        behind the point that it has come to; what only unloads there is the way back and no answer.
        """
        rng, n, memory = np.random.default_rng(0), self._rotation_unknowns, Remembering(self.model)
        for size in np.geomspace(0.1, 10.0, STARTS):
            shape = rng.standard_normal(n)
            for ahead in (length, -BEHIND * length):
                state, factor = self.predicted(now, ahead)
                aside = np.zeros(self.equations.total)
                aside[:n] = size * ahead * shape
                along = self.inner(Tangent(aside, 0.0), now.tangent)
                begin = self.equations.moved(state, aside - along * now.tangent.z)
                factor -= along * now.tangent.factor
                there = self.corrected(begin, factor, now.tangent, now.arc + abs(ahead), sharp=False)
                if there is None:
                    continue
                after = memory.after(there.state.q, there.state.y, memory.begun)
                spent = after[memory.size :] - memory.begun[memory.size :]
                if spent.sum() > 0.0:
                    return self._leading(now, there)
        return None

    def _leading(self, a: Standing, b: Standing) -> Standing:
        """The second of two neighbours with its tangent in the direction that leads away from the first."""
        way = Tangent(np.zeros(self.equations.total), b.factor - a.factor)
        way.z[: self._rotation_unknowns] = turned_between(self.equations, b.state, a.state, near=True)
        if self.inner(way, b.tangent) > 0.0:
            return b
        return replace(b, tangent=b.tangent.back)

    # -- plain steps ----------------------------------------------------------------------------

    @property
    def for_steps(self) -> bool:
        """Whether the core takes plain steps along the curve."""
        equations, prepared = self.equations, self.prepared
        if not equations.solved_by_core or self.for_core is None or prepared.counting is None:
            return False
        return not self.remembers and equations.rows <= MOST_ROWS and bool(equations.rotation_unknowns)

    def plain_steps(
        self, rules: CoreCurve, first: Standing, before: Standing | None, now: Standing, most: int
    ) -> list[Standing]:
        """Points beyond one, as far as steps are plain, see ``sf_trace``; none where the first step is not.

        The curve is one :attr:`for_steps`.

        Parameters
        ----------
        rules : Curve of the core
            The numbers that rule steps, and the length of the first; that of the next is put there.
        first, before, now : Standing
            The first point of all, the one before, None where there is none, and the one from which steps go on.
        most : int
            Number of points at most.
        """
        equations, given = self.equations, self.for_core
        counting = self.prepared.counting
        assert given is not None
        assert counting is not None
        if equations.rows and equations.redundant is None:
            redundant(equations, now.point)
        if now.tangent.neutral is not None or now.inertia.zero or equations.redundant:
            return []
        room, total = 1 + most, equations.total
        start, now_state = (np.concatenate([part.ravel() for part in vars(one.state).values()]) for one in (first, now))
        states, tangents = np.empty((room, len(start))), np.empty((room, total + 1))
        told = (Told * room)()
        states[0], tangents[0] = now_state, np.append(now.tangent.z, now.tangent.factor)
        told[0] = Told(factor=now.factor, arc=now.arc, negative=now.inertia.negative)
        columns, usual = equations.jacobian_columns, usual_square(equations)
        own = Limits(iterations=ITERATIONS, short=SHORT, turned=TURN, near=tolerances.BALANCED, returns=False)
        limits, alive = limits_for_core(equations, own, self.prepared.weight)
        addresses = (part.ctypes.data for part in (*given, self.weight, self._probe, *columns))
        for name, address in zip(
            ("begun", "rate", "metric", "probe", "column", "line", "entry"), addresses, strict=True
        ):
            setattr(rules, name, address)
        rules.unit, rules.passing, rules.doubt, rules.roughly, rules.usual = self.unit, PASSING, DOUBT, ROUGHLY, usual
        rules.apart, rules.room, rules.points = self._apart, room, 1
        if before is not None:
            last = np.append(before.tangent.z, before.tangent.factor)
            rules.before, rules.arc_before = last.ctypes.data, before.arc
        rules.state, rules.tangent, rules.told = states.ctypes.data, tangents.ctypes.data, ctypes.addressof(told)
        rules.first, rules.first_factor = start.ctypes.data, first.factor
        equations.trace(rules, limits, counting[0])
        del alive
        return [self._told(*one) for one in zip(told[1 : rules.points], states[1:], tangents[1:], strict=False)]

    def _told(self, told: Told, state: Array, tangent: Array) -> Standing:
        """A point that the core has found."""
        found = Standing(
            self.prepared,
            self.equations.state(state),
            self.loading(told.factor),
            None,
            *(told.residual, True, told.iterations),
            tangent=Tangent(tangent[:-1], float(tangent[-1])),
            arc=told.arc,
            doubtful=bool(told.doubtful),
        )
        # It has been counted on the way.
        vars(found)["inertia"] = Inertia(told.negative, 0)
        return found

    # -- between two points ---------------------------------------------------------------------

    def missed(self, a: Standing, b: Standing) -> float:
        """What one step from a point to the next leaves out of what members remember, see :meth:`.Remembering.missed`.

        Between the two the rotations are cubic in the arc length, as both points and tangents say.
        """
        if not self.remembers:
            return 0.0
        memory, n = Remembering(self.model), self._rotation_unknowns
        arc, step = b.arc - a.arc, np.zeros(self.equations.total)
        apart = turned_between(self.equations, b.state, a.state, near=True)
        way = list[tuple[Array, Array]]()
        for s in PLACES:
            rates = (s - 2.0 * s**2 + s**3) * a.tangent.z[:n] - (s**2 - s**3) * b.tangent.z[:n]
            step[:n] = (3.0 * s**2 - 2.0 * s**3) * apart + arc * rates
            there = self.loading(a.factor + s * (b.factor - a.factor))
            moved = self.with_prescribed(self.equations.moved(a.state, step), there)
            way.append((moved.q, moved.y))
        return memory.missed([*way, (b.state.q, b.state.y)])

    def between(self, a: Standing, b: Standing) -> Callable[[float], Standing | None]:
        """Points of the curve between two neighbours, by their distance from the first along its tangent.

        The function returns None if the corrector does not converge.
        """
        bend = self.bend(a, b)
        if bend is not None:
            along = self.inner(bend, a.tangent)
            bend = Tangent(bend.z - along * a.tangent.z, bend.factor - along * a.tangent.factor)

        def at(length: float) -> Standing | None:
            near = self.predicted(a, length, bend)
            found = self.corrected(*near, a.tangent, a.arc + length)
            # Where the proximal term happens to make the matrix singular, a larger one does not.
            return found or self.corrected(*near, a.tangent, a.arc + length, primal_factor=LARGE_PRIMAL_FACTOR)

        return at

    def bend(self, a: Standing, b: Standing) -> Tangent | None:
        """Curvature of the curve, the derivative of the tangent by the arc length, from two points; None for one."""
        arc = b.arc - a.arc
        if arc == 0.0:
            return None
        return Tangent((b.tangent.z - a.tangent.z) / arc, (b.tangent.factor - a.tangent.factor) / arc)


class _Across:
    """The bordered system of an equilibrium with unknown factor, for :func:`~sfetcas.solvers.newton.correct`.

    Its further equation keeps steps orthogonal to a direction.   Motions that are neutral along the curve are updated
    at each step, and no step goes along them.
    """

    complete = True

    def __init__(self, curve: Curve, across: Tangent, primal_factor: float, sharp: bool) -> None:
        self.curve, self.across, self.primal_factor, self.sharp = curve, across, primal_factor, sharp
        self.equations, self.neutral = curve.equations, across.neutral
        self.row = curve.weight * across.z

    def loading(self, factor: float) -> Loading:
        """Loads and motions at a factor."""
        return self.curve.loading(factor)

    def with_prescribed(self, state: State, loading: Loading) -> State:
        """The state with prescribed rotations at the values of a loading."""
        return self.curve.with_prescribed(state, loading)

    def seen(self, state: State, point: Point) -> Point:
        """The equations without the residual along neutral motions and the gaps of redundant rows."""
        point = met(self.equations, point)
        if self.neutral is None:
            return point
        return replace(point, residual=self.neutral.balanced(point.residual))

    def step(self, here: Balance) -> Array:
        """Newton's step (total + 1,) of all unknowns, multipliers and, last, the factor."""
        rights = [-here.point.residual, -self.curve.slope(here.state, here.loading.factor, here.point)]
        rights += [] if self.neutral is None else [*self.neutral.weighted.T]
        both = self.curve.solved(here.point, np.column_stack(rights), self.primal_factor)
        if self.neutral is not None:
            self.neutral = self.neutral.moved(both[:, 2:])
            both = self.neutral.without(both[:, :2])
        base, rate = both[:, 0], both[:, 1]
        unit = self.across.factor / self.curve.unit**2
        change = -float(self.row @ base) / (float(self.row @ rate) + unit)
        return np.append(base + change * rate, change)

    def for_core(self) -> ForCore | None:
        """What the core needs: loads linear in the factor, in which the equations are linear, and nothing neutral."""
        given = self.curve.for_core if self.neutral is None else None
        if given is None:
            return None
        weight = self.primal_factor * self.curve.prepared.weight
        passing = 0.0 if self.sharp else PASSING
        return ForCore(
            weight, border=(*given, self.row, self.across.factor / self.curve.unit**2, self.curve._apart, passing)
        )

    def suffices(self, here: Balance) -> bool:
        """Whether an intermediate point is accurate enough; its gaps must be closed too, as small ones move much."""
        gaps = float(np.abs(here.point.residual[self.equations.unknowns :]).max(initial=0.0))
        return not self.sharp and here.residual <= PASSING and gaps <= tolerances.CONVERGED


def bordered(curve: Curve, across: Tangent) -> Border:
    """The factor as an unknown, and the equation that keeps steps orthogonal to a direction."""
    return Border(curve.loading, curve.slope, curve.weight * across.z, across.factor / curve.unit**2)
