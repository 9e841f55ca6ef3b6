"""A step with impulses as one CasADi function: that of :mod:`~sfetcas.dynamics.stepping` where obstacles stop members.

What stops members are rows of the equations, each with a force.  Which of them push is found in the iterations of
Newton's method, and for the impulses on velocities after it, by rounds of linear equations: of a row that pushes the
gap at the end of the step is zero, of all others the force is.  Those change sides whose sign is wrong: all at once,
and where that goes round, as it may where rows follow from each other, one after the other from none on.

Between yes and no there is a gap: a force that is rounding beside the largest one does not pull, and of what is closed
to rounding only that pushes which would be closed further.

Source: Alart and Curnier 1991 (Newton's method of contact); Judice and Pires 1994 (blocks that change sides); Goldfarb
and Idnani 1983 (one by one).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import final

import casadi as ca
import numpy as np

from ..mathematics.arrays import TINY, Array
from ..mathematics.kernels import Batch
from ..mechanics.equations import State
from .conserving import Conserving, Middle, check_conserving, symbols_of_step
from .coupling import MASSLESS, SOFT, Moving, bodies_of
from .integrators import InitialState
from .methods import Begin, Method
from .stages import DUAL_REGULARISATION, StageEquations, solution
from .steps import LAST_CHANGE, guessed, repeated

__all__ = ["TURNED", "ImpulseStepper", "Impulsive"]

ITERATIONS, ROUNDS, BLOCKS = 20, 60, 8
"""Iterations of Newton's method and rounds in each at most, and after how many rows change sides one by one."""

TURNED = 1.0 + 1e-6
"""Rotation in a step, rad, beyond which it is not taken: far from where it begins there are other solutions.

A little more than one, which motions may prescribe.
"""

HALVED = 30
"""How often the restitution of what touches each other is halved before it is taken to be zero."""

INSIDE, MISSED = 1e-10, 1e-8
"""Gap, unit of length or rad, up to which something is closed, and by which it may be negative; and what is accepted
after the last iteration.
"""

PULLS, SLOW = 1e-9, 1e-9
"""Share of the largest force or impulse by which one may be negative, and speed of closing, dimensionless or over the
largest, up to which a gap stays closed.
"""

GROWN = 1e-9
"""Share of the energy that an impact moves by which it may grow: beyond rounding, also where masses differ."""


@final
class Impulsive(Method):
    """The step with impulses of a system all of whose unilateral rows take part.

    A state has behind the angles that count turns which of the rows push, 1 or 0, and as many zeros.
    """

    name, order, kept = "stepping", 1, 1
    places, loaded, polished = Conserving.places, Conserving.loaded, True

    def iteration(self, system: StageEquations) -> ca.Function:
        """As of :meth:`.Method.iteration`, with which rows push behind the multipliers.

        ``(q, y, lam, acting, constants...) -> (q, y, lam, acting, size)``
        """
        check_conserving(system, self.name)
        q, y, lam, begin, h, factors = symbols_of_step(system)
        acting, n = ca.MX.sym("acting", len(system.unilateral)), system.equations.unknowns
        found = Middle(system, begin, h, factors, q, y, lam)
        every = replace(begin, unwrapped=_with_acting(system, begin.unwrapped, ca.MX.ones(acting.shape)))
        matrix, order = system.matrix(found.entries, [2.0 / h**2], every.unwrapped)
        free = np.array(order.order) < n
        matrix += ca.diag(MASSLESS * _largest_of_bodies(matrix, free) * ca.DM(free.astype(float)))
        own = [order.back[n + row] for row in system.unilateral.rows.tolist()]
        given = ca.MX.zeros(system.total)
        given[own] = lam[system.unilateral.rows.tolist()]
        right = ca.mtimes(matrix, given) - found.residual[order.order]
        one_sided = PushingRows(own, system.unilateral.signs)
        x, pushing, failed = one_sided.solved(matrix, right, acting, ca.MX.ones(acting.shape), INSIDE)
        step = (x - given)[order.back]
        (there,), shift, more, size = system.moved([q], step)
        size = ca.fmax(size, ca.fmax(failed, _largest(pushing - acting)))
        arguments = [q, y, lam, acting, *self.constants(begin, h, factors)]
        return ca.Function("pushed", arguments, [there, y + shift, lam + more, pushing, size])

    def constants(self, begin: Begin, h: ca.MX, factors: ca.MX) -> list[ca.MX]:
        """As of :class:`.Conserving`."""
        return Conserving().constants(begin, h, factors)

    def after(self, h: ca.MX, rates: ca.MX, moved: ca.MX) -> ca.MX:
        """As of :class:`.Conserving`, before the impulses at the end of the step."""
        return Conserving().after(h, rates, moved)

    @staticmethod
    def openings(system: StageEquations) -> int:
        """How many numbers a step passes on of gaps and, where any rebounds, of rates of the unknowns."""
        rows = system.unilateral
        return len(rows) + (system.equations.unknowns if rows.restitution.any() else 0)

    def beginning(self, system: StageEquations, begun: InitialState) -> list[Array]:
        """What a state has beside the angles that count turns where a motion begins."""
        opening = np.concatenate([system.openings(begun.state, 0.0), begun.rates])[: self.openings(system)]
        return [begun.touching, np.zeros(len(begun.touching)), opening]

    def step(self, system: StageEquations) -> ca.Function:
        """As of :func:`~sfetcas.dynamics.steps.step_function`, with gaps and rates of the unknowns, ``opening``, before
        and after the step, and after it ``acting``, which rows push, and the energy that is ``lost``.
        """
        n = system.layout
        q, y, lam = ca.MX.sym("q", n.components, n.rotations), ca.MX.sym("y", n.y), ca.MX.sym("lam", n.lam)
        turns, shifts = ca.MX.sym("turns", system.turns, n.rotations), ca.MX.sym("shifts", n.y)
        x, rates = ca.MX.sym("x", n.x), ca.MX.sym("rates", n.x)
        ratio, h, factors = ca.MX.sym("ratio"), ca.MX.sym("h"), ca.MX.sym("factors", n.factors, 2)
        unwrapped, opening = ca.MX.sym("unwrapped", n.unwrapped), ca.MX.sym("opening", self.openings(system))
        end = system.given(factors[:, 1])
        guess = guessed(system, self, q, y, turns, shifts, ratio, [end])
        newton = repeated(self.iteration(system), changing=4, most=ITERATIONS, polished=True)
        constants = self.constants(Begin(q, y, x, rates, unwrapped), h, factors)
        there, moved, lam_next, acting, size, count = newton(*guess, lam, system.acting(unwrapped), *constants)
        x_next = system.moving(there, moved, end, unwrapped)
        rows = system.gaps(there, moved, end, unwrapped)
        gaps, forces = _gaps(system, there, moved, factors[:, 1], unwrapped), _pushes(system, lam_next)
        turned = system.turned(q, there)
        refused = ca.logic_or(ca.mmin(ca.vertcat(0.0, gaps)) < -MISSED, _largest(ca.vec(turned)) > TURNED)
        missed = system.missed(rows, _with_acting(system, unwrapped, acting))
        impulses = _Impulses(system).function
        v = self.after(h, rates, x_next - x)
        v, given, opening_next, lost, failed = impulses(
            there, moved, unwrapped, factors, h, v, h * forces, acting, gaps, opening
        )
        told = ca.MX(lam_next)
        if len(system.unilateral):
            told[system.unilateral.rows.tolist()] = ca.DM(system.unilateral.signs) * given / h
        results = {
            "q_next": there,
            "y_next": moved,
            "lam_stages": told,
            "turns_stages": turned,
            "shifts_stages": moved - y,
            "x_stages": x_next,
            "rates_next": v,
            "size": ca.fmax(ca.fmax(size, failed), 1.0 * refused),
            "iterations": count,
            "gap": _largest(missed),
            "acting": 1.0 * (given > 0.0),
            "opening_next": opening_next,
            "lost": lost,
        }
        names = ["q", "y", "lam", "turns", "shifts", "x", "rates", "ratio", "h", "factors", "unwrapped", "opening"]
        arguments = [q, y, lam, turns, shifts, x, rates, ratio, h, factors, unwrapped, opening]
        return ca.Function("step", arguments, [ca.densify(one) for one in results.values()], names, list(results))


class ImpulseStepper:
    """Takes steps of a system in process; what one-sided rows are, strings and stops among them, are rows of its model.

    Parameters
    ----------
    system : StageEquations
    """

    def __init__(self, system: StageEquations) -> None:
        self.system, self._method = system, Impulsive()
        self._function = self._method.step(system)
        self._batch = Batch(self._function, 1)

    def step(self, begin: Moving, h: float, factors: Array) -> Moving | None:
        """The state after a step of length h with factors (2, groups) in its middle and at its end.

        None where it has to be shorter.
        """
        system, n, state = self.system, self.system.layout, begin.state
        parts = system.unilateral.parts
        acting = np.array([float(part in begin.pushed) for part in parts])
        opening = np.concatenate([system.openings(state, begin.t), begin.w])[: self._method.openings(system)]
        still = np.zeros((n.rotations, system.turns)), np.zeros(n.y)
        given = state.q, state.y, state.lam, *still, begin.x, begin.v, np.zeros(1), np.array([h]), factors
        for i, values in enumerate((*given, system.counted(state, acting), opening)):
            if values.size:
                self._batch.set(i, values)
        for result in self._batch.results:
            result[...] = np.nan
        parts_found = (part.ravel().copy() for part in self._batch())
        found = dict(zip(self._function.name_out(), parts_found, strict=True))
        if not (found["size"][0] <= LAST_CHANGE and np.isfinite(found["x_stages"]).all()):
            return None
        q, lam = found["q_next"].reshape(n.rotations, -1), found["lam_stages"]
        unwrapping = system.model.unwrapping
        unwrapped = unwrapping.angles(q, state.unwrapped) if unwrapping.count else state.unwrapped
        impulses = h * system.unilateral.signs * lam[system.unilateral.rows]
        pushed = {part: float(p) for part, p in zip(parts, impulses, strict=True) if p > 0.0}
        w = np.concatenate([found["opening_next"][len(parts) :], np.zeros(system.total)])[: system.total]
        after = State(q, found["y_next"], lam, unwrapped)
        v, lost = found["rates_next"], begin.lost + float(found["lost"][0])
        return Moving(begin.t + h, after, found["x_stages"], v, w, lost, pushed)


class _Impulses:
    """Impulses on velocities along rows that are closed at the end of a step."""

    def __init__(self, system: StageEquations) -> None:
        self.system, self.count, self.unknowns = system, len(system.unilateral), system.equations.unknowns
        self._restitution = system.unilateral.restitution

    @functools.cached_property
    def function(self) -> ca.Function:
        """``(q, y, unwrapped, factors, h, v, within, acting, gaps, opening) -> (v, given, opening, lost, failed)``.

        State, factors in the middle and at the end, length, and rates of the quantities at the end of a step; impulses
        (rows,) within it, which rows pushed, and gaps; gaps and rates of the unknowns at its begin.  Then rates of the
        quantities, impulses of the whole step, gaps and rates of the unknowns at its end, the energy that is lost, and
        above 0 where none were found.
        """
        n, size = self.system.layout, self.count
        shapes = {
            "q": (n.components, n.rotations),
            "y": (n.y,),
            "unwrapped": (n.unwrapped,),
            "factors": (n.factors, 2),
            "h": (1,),
            "v": (n.x,),
            "within": (size,),
            "acting": (size,),
            "gaps": (size,),
            "opening": (Impulsive.openings(self.system),),
        }
        symbols = {name: ca.MX.sym(name, *shape) for name, shape in shapes.items()}
        given = list(symbols.values())
        opening = symbols["gaps"] if not self._restitution.any() else symbols["opening"]
        none = ca.MX.zeros(size)
        idle = ca.Function("idle", given, [symbols["v"], none, opening, ca.MX(0.0), ca.MX(0.0)])
        if not size:
            return idle
        found = ca.Function("hit", given, self._hit(**symbols))
        if self._restitution.any():
            return found
        closed = _largest(symbols["acting"]) + (ca.mmin(symbols["gaps"]) < INSIDE)
        either = ca.Function.if_else("either", found, idle)
        return ca.Function("impulses", given, list(either(closed > 0.0, *given)))

    def _hit(
        self,
        q: ca.MX,
        y: ca.MX,
        unwrapped: ca.MX,
        factors: ca.MX,
        h: ca.MX,
        v: ca.MX,
        within: ca.MX,
        acting: ca.MX,
        gaps: ca.MX,
        opening: ca.MX,
    ) -> list[ca.MX]:
        """As of :attr:`function`."""
        system, end = self.system, factors[:, 1]
        nothing, still = ca.MX.zeros(system.total), ca.MX.zeros(system.layout.factors)
        drift, drifts, none = ca.MX.zeros(v.shape), ca.MX.zeros(self.count), ca.MX.zeros(self.count)
        if system.model.scene.motions:
            # Factors go on as in the second half of the step.
            faster = 2.0 * (end - factors[:, 0]) / h
            _, drift, _, rates = system.interpreted.along_step_in_time(q, y, end, unwrapped, nothing, faster)
            drifts = system.opened(rates)
        rows, mass, momentum = system.momenta(q, y, end, unwrapped, v - drift)
        masses = self._matrix(mass, rows)
        which, signs = system.unilateral.rows.tolist(), ca.DM(system.unilateral.signs)
        one_sided = PushingRows([self.unknowns + row for row in which], system.unilateral.signs)
        allowed, _, _ = one_sided.solved(masses, ca.vertcat(momentum, ca.MX.zeros(rows.shape[0])), none, none, SLOW)
        speeds = drifts - signs * ca.mtimes(rows, allowed[: self.unknowns])[which]
        closed = ca.fmax(acting, 1.0 * (gaps < INSIDE))
        before, w = opening[: self.count], opening[self.count :]
        problem = _Impact(one_sided, masses, speeds, within, closed, within / h * (gaps - before))
        if not self._restitution.any():
            step, given, failed = problem.solved(acting, none)
            after = gaps
        else:
            back = ca.DM(self._restitution) * ca.fmin(drifts - signs * ca.mtimes(rows, w)[which], 0.0) * closed
            step, given, _, _, failed, _, _ = problem.rebounds()(nothing, none, back, 0.0, 0.0, *problem.data, acting)
            after = ca.vertcat(gaps, (allowed + step)[: self.unknowns])
        moved = system.interpreted.along_step(q, y, end, unwrapped, self._step(step), still)[1]
        return [v + moved, given, after, -ca.sum1(problem.gained(step, given)), failed]

    def _step(self, x: ca.MX) -> ca.MX:
        """Changes of the unknowns alone."""
        return ca.vertcat(x[: self.unknowns], ca.MX.zeros(x.shape[0] - self.unknowns))

    @staticmethod
    def _matrix(mass: ca.MX, rows: ca.MX) -> ca.MX:
        """Masses and rows, with a little of what makes them independent."""
        unknowns, count = mass.shape[0], rows.shape[0]
        whole = ca.vertcat(ca.horzcat(mass, rows.T), ca.horzcat(rows, ca.MX(count, count)))
        largest = _largest_of_bodies(whole, np.arange(unknowns + count) < unknowns)
        own = ca.densify(ca.diag(mass))
        soft = ca.fmax(MASSLESS * largest[:unknowns] - own, SOFT * own)
        return whole + ca.diag(ca.vertcat(soft, -DUAL_REGULARISATION / largest[unknowns:]))


@dataclass(frozen=True, eq=False)
class _Impact:
    """Impulses along closed rows: masses with all rows, rates of gaps before them, impulses within the step, which rows
    are closed, and the work that forces have done within the step.
    """

    one_sided: PushingRows
    masses: ca.MX
    speeds: ca.MX
    within: ca.MX
    closed: ca.MX
    work: ca.MX

    @property
    def data(self) -> tuple[ca.MX, ...]:
        """What changes from step to step."""
        return self.masses, self.speeds, self.within, self.closed, self.work

    def symbols(self) -> _Impact:
        """The same as symbols of a function."""
        names = ("masses", "speeds", "within", "closed", "work")
        parts = (ca.MX.sym(name, part.sparsity()) for name, part in zip(names, self.data, strict=True))
        return _Impact(self.one_sided, *parts)

    def solved(self, acting: ca.MX, back: ca.MX) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Changes of velocities and multipliers (total,), impulses (rows,) of the whole step, and 1 if none were found,
        where gaps of closed rows open by ``- back`` at least; ``acting`` is a guess of those that push.
        """
        own, signs = self.one_sided.own, ca.DM(self.one_sided.signs)
        given = ca.MX.zeros(self.masses.shape[0])
        given[own] = signs * self.within
        right = ca.mtimes(self.masses, given)
        right[own] = signs * (self.speeds + back)
        least = SLOW * ca.fmax(1.0, _largest(self.speeds))
        x, pushing, failed = self.one_sided.solved(self.masses, right, acting, self.closed, least)
        # What does not push does so with nothing, not with rounding.
        return x, signs * x[own] * pushing, failed

    def opened(self, x: ca.MX) -> ca.MX:
        """What changes of velocities do to the rates of gaps (rows,)."""
        unknowns = ca.MX(x)
        unknowns[self.one_sided.own] = 0.0
        return -ca.DM(self.one_sided.signs) * ca.mtimes(self.masses, unknowns)[self.one_sided.own]

    def gained(self, x: ca.MX, given: ca.MX) -> ca.MX:
        """The energy that bodies gain by the forces and impulses of each row in the whole step."""
        return self.work + 0.5 * (given - self.within) * (2.0 * self.speeds + self.opened(x))

    def rebounds(self) -> ca.Function:
        """``(x, given, back, count, failed, data..., acting) -> (x, given, back, count, failed, size, tries)``: what
        rebounds is halved where the energy of what touches each other would grow.
        """
        problem, n = self.symbols(), self.speeds.numel()
        back, count, failed = ca.MX.sym("back", n), ca.MX.sym("count"), ca.MX.sym("failed")
        acting, of_row = ca.MX.sym("acting", n), ca.DM(self._clusters())
        x, given, lost = problem.solved(acting, back)
        gained = ca.mtimes(of_row, problem.gained(x, given))
        change = (given - problem.within) * problem.speeds
        size = ca.mtimes(of_row, ca.fabs(problem.work) + ca.fabs(change))
        grows = ca.mtimes(of_row.T, 1.0 * (gained > GROWN * size)) * (back < 0.0)
        less = ca.if_else(count < HALVED, 0.5, 0.0)
        results = [x, given, ca.if_else(grows, less * back, back), count + 1.0, lost, _largest(grows)]
        changing = [ca.MX.sym("x", x.shape[0]), ca.MX.sym("given", n), back, count, failed]
        once = ca.Function("rebound", [*changing, *problem.data, acting], results)
        return repeated(once, changing=len(changing), most=HALVED + 2)

    def _clusters(self) -> Array:
        """Which rows belong to bodies that rows couple, (clusters, rows), 1 or 0."""
        own = bodies_of(self.masses.sparsity())[self.one_sided.own]
        return np.asarray(own == np.unique(own)[:, None], dtype=float)


@dataclass(frozen=True, eq=False)
class PushingRows:
    """Linear equations ``A x = b`` of which some rows hold on one side: each holds and its unknown pushes, or is open.

    Attributes
    ----------
    own : list of int
        Numbers of these rows, and of what pushes along each among the unknowns.
    signs : ndarray (rows,)
        What pushes, times its sign, is not below zero, nor is ``- sign (A x - b)``, by how much the row is open.
    """

    own: list[int]
    signs: Array

    def solved(
        self, matrix: ca.MX, right: ca.MX, acting: ca.MX, closed: ca.MX, least: ca.MX | float
    ) -> tuple[ca.MX, ca.MX, ca.MX]:
        """The solution (n,), which rows push, 1 or 0, and how many are wrong where none was found.

        Parameters
        ----------
        matrix, right : MX (n, n), (n,)
        acting : MX (rows,)
            A guess of those that push.
        closed : MX (rows,)
            Those that may, 1 or 0.
        least : MX or float
            By how much one that does not may be closed: rounding.
        """
        rounds = repeated(self._round(matrix.sparsity()), changing=3, most=ROUNDS)
        nothing = ca.MX.zeros(right.shape)
        x, acting, _, size, _ = rounds(nothing, acting, 0.0, matrix, right, closed, least)
        return x, acting, size

    def _round(self, pattern: ca.Sparsity) -> ca.Function:
        """``(x, acting, count, matrix, right, closed, least) -> (x, acting, count, size)``."""
        size, count = pattern.size1(), len(self.own)
        matrix, right = ca.MX.sym("matrix", pattern), ca.MX.sym("right", size)
        acting, closed = ca.MX.sym("acting", count), ca.MX.sym("closed", count)
        number, least = ca.MX.sym("count"), ca.MX.sym("least")
        held, signs = ca.MX.ones(size), ca.DM(self.signs)
        held[self.own] = acting
        x = solution(ca.mtimes(ca.diag(held), matrix) - ca.diag(1.0 - held), held * right)
        pushes, opened = signs * x[self.own], -signs * (ca.mtimes(matrix, x) - right)[self.own]
        wrong = ca.if_else(acting, pushes < -PULLS * _largest(pushes), ca.logic_and(closed, opened < -least))
        by = ca.if_else(acting, -pushes, -opened)
        arguments = [ca.MX.sym("x", size), acting, number, matrix, right, closed, least]
        results = [x, _changed(acting, wrong, by, number), number + 1.0, _largest(1.0 * wrong)]
        return ca.Function("round", arguments, results)


def _largest_of_bodies(matrix: ca.MX, among: Array) -> ca.MX:
    """Of each row (n,) the largest size of those diagonal entries, ``among`` (n,) of bool, that belong to its body."""
    body, diagonal = bodies_of(matrix.sparsity()), ca.densify(ca.diag(matrix))
    found = ca.MX.zeros(matrix.shape[0])
    for number in range(int(body.max(initial=-1)) + 1):
        own = np.flatnonzero(body == number)
        masses = own[among[own]].tolist()
        found[own.tolist()] = ca.fmax(_largest(diagonal[masses]), TINY) if masses else 1.0
    return found


def _gaps(system: StageEquations, q: ca.MX, y: ca.MX, factors: ca.MX, unwrapped: ca.MX) -> ca.MX:
    """Gaps (rows,) of the unilateral rows at the end of a step."""
    return system.opened(system.gaps(q, y, system.given(factors), unwrapped))


def _pushes(system: StageEquations, lam: ca.MX) -> ca.MX:
    """Forces (rows,) of the unilateral rows, which are not to be below zero."""
    return ca.DM(system.unilateral.signs) * lam[system.unilateral.rows.tolist()]


def _with_acting(system: StageEquations, unwrapped: ca.MX, acting: ca.MX) -> ca.MX:
    """What counts turns, with which unilateral rows act."""
    angles = unwrapped[: system.layout.unwrapped - 2 * acting.numel()]
    return ca.vertcat(angles, acting, ca.MX.zeros(acting.shape))


def _changed(acting: ca.MX, wrong: ca.MX, by: ca.MX, count: ca.MX) -> ca.MX:
    """Which rows act after wrong ones have changed sides: all of them; after some rounds that one by which it is most
    wrong alone, one that pulls before one that is inside, and at first none act.

    ``by`` (rows,) is how much each is wrong.
    """
    wrong = 1.0 * wrong
    pulls = wrong * acting
    chosen = ca.if_else(_largest(pulls) > 0.0, pulls, wrong) * by
    worst = ca.logic_and(wrong, chosen >= _largest(chosen))
    one = ca.if_else(count > BLOCKS, worst, ca.if_else(_largest(wrong) > 0.0, acting, 0.0))
    return ca.fabs(acting - ca.if_else(count < BLOCKS, wrong, one))


def _largest(values: ca.MX) -> ca.MX:
    """The largest size of some numbers, zero of none."""
    return ca.norm_inf(ca.vertcat(0.0, values))
