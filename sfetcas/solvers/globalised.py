"""Globalised Newton method: the equilibrium from the undeformed state, without IPOPT.

An iteration rotates every node by a rotation vector, so that norms hold by construction and a minimisation of the
energy on the closings remains.  Where the energy is not convex on them, which the signs of the pivots of the factorised
matrix show (Sylvester), positive matrices replace those of the elements, and the diagonal is shifted until the signs
are right; steps are shortened until potential and gaps fall.  Near the answer steps are taken whole.  Unstable
equilibria are left along the lowest mode.  Loads without potential, and cases in which no minimum is found, are
followed from zero loads.  Where something touches nothing is least in where it does: whole steps begin at a known
equilibrium, and where they fail what is given becomes another little by little.
From an equilibrium for other values Newton's whole steps are tried first.

Every operation on numbers is one of a :class:`Method`: the functions of :class:`~sfetcas.solvers.program.Program`,
whose numbers generated C has to the last bit, with the same decisions and the same :class:`Rules`; or
:class:`~sfetcas.solvers.evaluated.Evaluated`, which makes nothing for a model.

Sources: Nocedal and Wright 2006, chapters 3 and 18 (line search on an l1 merit function); Vanderbei 1995
(quasidefinite matrices have factors in any order).
"""

from __future__ import annotations

import enum
import functools
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from .. import tolerances
from ..mathematics.arrays import TINY, Array, Index
from ..mechanics.equations import Equations
from ..mechanics.model import Model
from .sides import Sides

__all__ = ["MEANINGS", "NOT_DEFINED", "Code", "Globalised", "Method", "Outcome", "Rules", "Shifts", "Systems"]


class Code(enum.IntEnum):
    """How a solve ended; :data:`MEANINGS` has a sentence for each."""

    SOLVED = 0
    UNSTABLE = 1
    ITERATIONS = 2
    STALLED = 3
    NOT_FINITE = 4
    BAD_ARGUMENT = 5
    TOUCHES = 6


MEANINGS = {
    Code.SOLVED: "an equilibrium, stable or neutral where there is an energy that tells",
    Code.UNSTABLE: "an equilibrium, but an unstable one, from which no way led to a stable one",
    Code.ITERATIONS: "no equilibrium within the iterations allowed",
    Code.STALLED: "no equilibrium: no step led further",
    Code.NOT_FINITE: "no equilibrium, or a result of it is not finite: the numbers left what can be computed",
    Code.TOUCHES: "no equilibrium with what touches for the arguments of the scene: something else does",
    Code.BAD_ARGUMENT: "an argument or the start is not a finite number, or an argument outside of its range",
}
"""A sentence for each code."""


NOT_DEFINED = -1
"""Stands for the number of negative eigenvalues where loads have no potential."""

FAILED = -1_000_000
"""Stands for the number of negative pivots of a matrix that could not be factorised."""

FIRMEST = 1e12
"""Shift of the diagonal, over the weight, at which attempts to make the matrix positive end."""

LEAST = 1e-9
"""Entry of the first displacement in the start vector for the lowest mode, whose rotations are of the size of one.

It decides only where no rotation takes part.
"""


@dataclass(frozen=True)
class Rules:
    """Numbers that control the method, in process and in generated C.

    Attributes
    ----------
    iterations : int
        Largest number of Newton iterations, of all attempts together.
    converged, rounding : float
        Relative residual that counts as converged; and at which the iteration stops at once.
    gain : float
        The iteration goes on as long as a step reduces a converged residual to this share of it.
    turn : float
        Largest rotation of a node in a downhill step under forces, rad; with moments there is no limit.
    near : float
        Newton steps shorter than this, rad, are taken without line search.
    proximal, soft, hard : float
        Primal regularisation, share of the weight; further regularisation of displacements (primal) and rows (dual) in
        the factors only, whose effect iterative refinement removes; the same in factors with pivots where members lie
        along obstacles: forces at the ends of a short element bend it hardly more than none.
    firm, firmer : float
        First shift that makes the matrix positive, share of the weight; factor by which it grows.
    rounds : int
        Largest number of rounds of refinement.
    left : float
        Largest residual after refinement, share of the right side.
    armijo : float
        Share of the decrease that a quadratic model promises which a step has to bring.
    noise : float
        Rounding of the merit function, share of it.
    halvings : int
        Largest number of trial lengths of a step, each half of the one before.
    escapes : int
        Largest number of unstable equilibria that are left; 0 accepts an unstable one.
    nudge : float
        Largest rotation of a node along the mode by which they are left, rad.
    sweeps : int
        Inverse iterations for that mode.
    corrections : int
        Largest number of Newton steps at one share of the loads.
    shortest : float
        Least increment of the loads that grow from zero, share of the whole.
    far : float
        Largest rotation of a Newton step at growing loads, rad.
    """

    iterations: int = 300
    converged: float = 1e-10
    rounding: float = field(default_factory=lambda: tolerances.EXACT)
    gain: float = 0.25
    turn: float = 1.2
    near: float = 0.05
    proximal: float = field(default_factory=lambda: tolerances.PROXIMAL)
    soft: float = field(default_factory=lambda: tolerances.SOFT)
    hard: float = field(default_factory=lambda: tolerances.DUAL)
    firm: float = 1e-3
    firmer: float = 10.0
    rounds: int = 8
    left: float = 1e-6
    armijo: float = 0.3
    noise: float = 1e-12
    halvings: int = 40
    escapes: int = 8
    nudge: float = 0.2
    sweeps: int = 60
    corrections: int = 12
    shortest: float = 1e-4
    far: float = 1.0


@dataclass(frozen=True)
class Outcome:
    """Result of the method.

    Attributes
    ----------
    code : Code
    state : ndarray (states,)
        As :meth:`~sfetcas.solvers.program.Program.state` reads it; nan for a bad argument.
    residual : float
        Largest residual over its scale, dimensionless.
    negative : int
        Number of negative eigenvalues of the energy on the closings; -1 where loads have no potential.
    iterations : int
    places : ndarray (ends,)
        Where elements end beside the ends of lines that move with the numbers, if there are any.
    """

    code: Code
    state: Array
    residual: float
    negative: int
    iterations: int
    places: Array = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class _Here:
    """A state with the results of :meth:`Method.at`; ``size`` is the relative residual, ``gaps`` a sum."""

    state: Any
    residual: Array
    size: float
    potential: float
    gaps: float
    entries: Any


class Shifts(NamedTuple):
    """How the diagonals of matrices are shifted: see :class:`Globalised` and :class:`Rules`."""

    proximal: float
    mass: Array
    soft: Array
    diagonal: Index

    def shifted(self, entries: Array, firm: float, share: float) -> tuple[Array, Array]:
        """The entries that are solved for, and those of the matrix that is factorised."""
        target = entries.copy()
        target[self.diagonal] += (self.proximal + firm) * self.mass
        matrix = target.copy()
        matrix[self.diagonal] += share * self.soft
        return target, matrix


class Systems(Protocol):
    """Linear systems of the method."""

    def shift(self, entries: Any, firm: float, share: float) -> None:
        """Take a matrix with its diagonal shifted."""

    def negative(self) -> int | None:
        """Factorise it: the number of its negative pivots; None where factors break down."""

    def backward(self, b: Array) -> Array:
        """Solution (total,) with these factors, or with pivoting."""

    def left(self, x: Array, b: Array) -> Array:
        """What is left (total,) of b without the further regularisation."""


class Method(Protocol):
    """Operations on numbers of which the method consists; states and what is given are of types of their own."""

    model: Model
    equations: Equations

    @property
    def states(self) -> int:
        """Numbers of a state."""

    @property
    def diagonal(self) -> Index:
        """Positions of the diagonal among the entries of the matrix."""

    def systems(self, shifts: Shifts, *, factors: bool, pivoted: bool) -> Systems:
        """Its linear systems."""

    def is_finite(self, given: Any) -> bool:
        """Whether all that is given is."""

    def turns(self, given: Any) -> bool:
        """Whether there are moments."""

    def taken(self, given: Any) -> Any:
        """What is given as the other methods take it."""

    def shared(self, given: Any, share: float) -> Any:
        """The same with a share of all loads and motions."""

    def standing(self, flat: Array) -> Any:
        """The state of a vector (states,)."""

    def flattened(self, state: Any) -> Array:
        """The vector (states,) of a state."""

    def multipliers(self, state: Any) -> Array:
        """Its multipliers (rows,)."""

    def begin(self, given: Any) -> Any:
        """The undeformed state with prescribed rotations at their values."""

    def hold(self, state: Any, given: Any) -> Any:
        """A state with prescribed rotations at their values."""

    def at(self, state: Any, given: Any) -> Any:
        """Residual (total,), relative residual, potential, sum of gaps, and entries of the matrix."""

    def merit(self, state: Any, given: Any) -> Any:
        """Potential and sum of gaps."""

    def convex(self, state: Any, given: Any) -> Any:
        """Entries of the matrix with positive matrices of the elements."""

    def move(self, state: Any, step: Array, share: float) -> Any:
        """The state after a share of a step (total,)."""

    def seek(
        self, method: Globalised, state: Any, given: Any, whole: int, left: int
    ) -> tuple[Code, Any, float, int, int] | None:
        """What :class:`Globalised` finds from a state, at once; None where it has to do it step by step.

        Parameters
        ----------
        method : Globalised
        state, given
        whole : int
            Whole steps at most, from a near state; 0 for the way downhill and out of what is unstable.
        left : int
            Iterations at most.

        Returns
        -------
        Code, state, relative residual, number of negative eigenvalues, iterations that were not needed
        """


class Globalised:
    """The method for one program.

    Parameters
    ----------
    program : Method
    weight : ndarray (rotation unknowns,)
        See :class:`~sfetcas.solvers.stability.StabilityTest`.
    rules : Rules, optional
    begun : (ndarray (given,), ndarray (states,)), optional
        What is given at an equilibrium, and its state, from which others are followed; by default they are from zero.

    Attributes
    ----------
    mass, soft, seed : ndarray (total,)
        Diagonal of shifts and of the proximal term; signs of the further regularisation; start vector for the lowest
        mode.
    diagonal : ndarray (total,)
        Positions of the diagonal among the entries of the matrix.
    pivoted : bool
        Whether systems are solved by factors with pivots.
    """

    def __init__(
        self,
        program: Method,
        weight: Array,
        rules: Rules | None = None,
        begun: tuple[Array, Array] | None = None,
    ) -> None:
        self.program, self.rules, self.begun = program, rules or Rules(), begun
        equations = program.equations
        self._rotation_unknowns, self._unknowns, self._total = (
            equations.rotation_unknowns,
            equations.unknowns,
            equations.total,
        )
        # Diagonals of shifts (rotations by their weight, displacements by 1), and of the further regularisation.
        self.mass = np.concatenate(
            [weight, np.ones(self._unknowns - self._rotation_unknowns), np.zeros(equations.rows)]
        )
        self.soft = np.repeat(
            [0.0, 1.0, -1.0], [self._rotation_unknowns, self._unknowns - self._rotation_unknowns, equations.rows]
        )
        self.diagonal = program.diagonal
        self._symmetric = program.model.has_potential
        # Where a line ends the Lagrangian has no curvature along the member: there is no order without small pivots.
        self.pivoted = not self._symmetric or program.model.mesh.lies
        self._sliding = program.model.mesh.sliding
        shifts = Shifts(self.rules.proximal, self.mass, self.soft, self.diagonal)
        self._systems = program.systems(shifts, factors=self._symmetric and self._total > 0, pivoted=self.pivoted)
        self._left = 0

    @functools.cached_property
    def seed(self) -> Array:
        """Start vector (total,) for the lowest mode: the fields of the rule of sides, and tiny displacements."""
        beside = LEAST / (1.0 + np.arange(self._unknowns - self._rotation_unknowns))
        equations = self.program.equations
        return np.concatenate([Sides(equations).seed, beside, np.zeros(equations.rows)])

    def _sought(self, state: Any, given: Any, whole: int = 0) -> Outcome | None:
        """What is found at once, see :meth:`Method.seek`."""
        found = self.program.seek(self, state, given, whole, self._left)
        if found is None:
            return None
        code, there, residual, negative, self._left = found
        return Outcome(code, self.program.flattened(there), residual, negative, 0)

    # -- linear algebra -----------------------------------------------------------------------------

    def _factor(self, entries: Any, firm: float) -> int:
        """Factorise a matrix with its diagonal shifted; the number of its negative pivots less that of rows.

        Nor are places that slide counted.  :data:`FAILED` if the factors break down, 0 for unsymmetric matrices.
        """
        systems = self._systems
        systems.shift(entries, firm, self.rules.soft)
        if not self._symmetric or not self._total:
            return 0
        pivots = systems.negative()
        if pivots is None:
            return FAILED
        if self.pivoted:
            systems.shift(entries, firm, self.rules.hard)
        return pivots - (self._total - self._unknowns) - self._sliding

    def _backward(self, b: Array) -> Array:
        return self._systems.backward(b) if self._total else b

    def _solved(self, b: Array) -> Array | None:
        """Solution (total,) for the last matrix without the further regularisation, by refinement; None if it fails."""
        x, best, left, last = np.zeros(self._total), None, b, np.inf
        largest = float(np.abs(b).max(initial=0.0))
        for _ in range(self.rules.rounds):
            x = x + self._backward(left)
            left = self._systems.left(x, b)
            size = float(np.abs(left).max(initial=0.0))
            if not size < last:
                break
            best, gained, last = x, last > 4.0 * size, size
            if size <= 1e-16 * largest or not gained:
                break
        return best if last <= self.rules.left * largest else None

    def _newton(self, here: _Here) -> tuple[Array | None, int]:
        """Newton's step (total,), None if the solution fails, and the number of negative eigenvalues."""
        negative = self._factor(here.entries, 0.0)
        return (None if negative == FAILED else self._solved(-here.residual)), negative

    def _downwards(self, here: _Here, given: Any) -> Array | None:
        """A descent direction (total,) from a matrix that is positive on the closings; None if no shift gives one."""
        entries = self.program.convex(here.state, given)
        firm = 0.0
        while firm < FIRMEST:
            if self._factor(entries, firm) == 0:
                step = self._solved(-here.residual)
                if step is not None:
                    return step
            firm = max(self.rules.firm, self.rules.firmer * firm)
        return None

    # -- states ---------------------------------------------------------------------------------------

    def _at(self, state: Any, given: Any) -> _Here:
        residual, size, potential, gaps, entries = self.program.at(state, given)
        flat = np.asarray(residual, dtype=float).ravel()
        return _Here(state, flat, float(size), float(potential), float(gaps), entries)

    def _moved(self, state: Any, step: Array, share: float) -> Any:
        return self.program.move(state, step, share)

    def _length(self, step: Array) -> float:
        return float(np.abs(step[: self._rotation_unknowns]).max(initial=0.0))

    # -- the method -----------------------------------------------------------------------------------

    # Overflow is detected by results that are not finite, as in C.
    @np.errstate(over="ignore", invalid="ignore")
    def __call__(self, given: Any, start: Array | None = None, *, warm: bool = False) -> Outcome:
        """Solve for an equilibrium.

        Parameters
        ----------
        given : ndarray (given,) or Loading
            Loads and data that vary, dimensionless, as the method takes them: see
            :meth:`~sfetcas.solvers.program.Program.given_of`.
        start : ndarray (states,), optional
            State to begin with; the undeformed one by default.
        warm : bool
            Whether that is an equilibrium for other values, from which whole steps are tried first.
        """
        program, rules = self.program, self.rules
        if not program.is_finite(given) or (start is not None and not np.isfinite(start).all()):
            return Outcome(Code.BAD_ARGUMENT, np.full(program.states, np.nan), np.inf, NOT_DEFINED, 0)
        self._left = rules.iterations
        self._free = not program.turns(given)
        whole = program.taken(given)
        state = program.begin(whole) if start is None else program.hold(program.standing(start), whole)
        found = self._near(state, whole) if warm else None
        found = found or self._from(state, whole)
        if found.code not in (Code.SOLVED, Code.UNSTABLE) and self._left:
            followed = self._followed(given)
            found = followed if followed.code is Code.SOLVED else found
        if found.code is Code.SOLVED and found.negative > 0 and program.model.minimisable:
            found = replace(found, code=Code.UNSTABLE)
        if found.code in (Code.SOLVED, Code.UNSTABLE) and not np.isfinite(found.state).all():
            found = replace(found, code=Code.NOT_FINITE)
        return replace(found, iterations=rules.iterations - self._left)

    def _near(self, state: Any, given: Any) -> Outcome | None:
        """By whole steps to an equilibrium that need not be left; None where they do not lead to one."""
        found = self._by_whole_steps(state, given, self.rules.corrections)
        if found.code is not Code.SOLVED:
            return None
        if found.negative <= 0 or not self.program.model.minimisable:
            return found
        leaves = self.rules.escapes and self.program.model.downhill
        return None if leaves else replace(found, code=Code.UNSTABLE)

    def _from(self, state: Any, given: Any) -> Outcome:
        """Downhill from a state to an equilibrium, and on from unstable ones, ``escapes`` times."""
        program = self.program
        if not program.model.downhill:
            return self._by_whole_steps(state, given, self._left)
        sought = self._sought(state, given)
        if sought is not None:
            return sought
        for _ in range(self.rules.escapes + 1):
            found = self._descended(self._at(state, given), given)
            if found.code is not Code.SOLVED or found.negative <= 0:
                return found
            state = self._nudged(program.standing(found.state), given)
        return replace(found, code=Code.UNSTABLE)

    def _ended(self, code: Code, here: _Here, negative: int = NOT_DEFINED) -> Outcome:
        return Outcome(code, self.program.flattened(here.state), here.size, negative, 0)

    def _descended(self, here: _Here, given: Any) -> Outcome:
        """Downhill to an equilibrium, stable or not."""
        rules, scale, first = self.rules, 1.0, True
        while self._left:
            self._left -= 1
            if not np.isfinite(here.size):
                return self._ended(Code.NOT_FINITE, here)
            step, negative = self._newton(here)
            if not first and here.size <= rules.rounding:
                return self._ended(Code.SOLVED, here, negative)
            first = False
            if step is not None and self._length(step) < rules.near:
                # Near an equilibrium, stable or not, Newton's own step leads to it.
                there = self._at(self._moved(here.state, step, 1.0), given)
                if here.size <= rules.converged and not there.size <= rules.gain * here.size:
                    best = there if there.size < here.size else here
                    return self._ended(Code.SOLVED, best, self._factor(best.entries, 0.0))
                if there.size < here.size or negative == 0:
                    here = there
                    continue
            if step is None or negative != 0:
                step = self._downwards(here, given)
            if step is None or not np.isfinite(self._length(step)):
                return self._ended(Code.STALLED, here)
            # Forces turn no node far in a step, so that they do not wind a beam up; a moment may roll it up at once.
            most = rules.turn if self._free else np.inf
            scale = min(1.0, 4.0 * scale, most / max(self._length(step), TINY))
            found = self._shortened(here, step, scale, given)
            if found is None:
                return self._ended(Code.STALLED, here)
            here, scale = found
        return self._ended(Code.ITERATIONS, here)

    def _shortened(self, here: _Here, step: Array, scale: float, given: Any) -> tuple[_Here, float] | None:
        """The state after a step that is halved until potential and gaps fall enough, and its share; None if never."""
        rules, n = self.rules, self._unknowns
        lam = self.program.multipliers(here.state)
        penalty = 2.0 * float(np.abs(lam + step[n:]).max(initial=0.0))
        # The slope of the potential alone: the residual without the multipliers' share.
        slope = float(here.residual[:n] @ step[:n]) + float(lam @ here.residual[n:]) - penalty * here.gaps
        slope, before = min(slope, 0.0), here.potential + penalty * here.gaps
        for halving in range(rules.halvings):
            state = self._moved(here.state, step, scale)
            if halving == 0:
                there = self._at(state, given)
                potential, gaps = there.potential, there.gaps
            else:
                potential, gaps = (float(value) for value in self.program.merit(state, given))
            wanted = rules.armijo * (scale - 0.5 * scale**2) * slope
            if potential + penalty * gaps - before <= wanted + rules.noise * abs(before):
                return (there if halving == 0 else self._at(state, given)), scale
            scale *= 0.5
        return None

    # -- out of what is unstable ----------------------------------------------------------------------

    def _nudged(self, state: Any, given: Any) -> Any:
        """The state displaced along its lowest mode to the side of lower energy."""
        shape = self._softest(self._at(state, given).entries)
        shape *= self.rules.nudge / max(self._length(shape), TINY)
        sides = [self._moved(state, shape, share) for share in (1.0, -1.0)]
        up, down = (float(self.program.merit(side, given)[0]) for side in sides)
        # A symmetric pair differs by rounding only: then the first side, so that answers repeat.
        return sides[1] if up - down > tolerances.LEVEL * max(abs(up), abs(down)) else sides[0]

    def _softest(self, entries: Any) -> Array:
        """The mode (total,) of the lowest eigenvalue, largest entry 1, by inverse iteration with a shift below it."""
        firm = self.rules.firm
        while self._factor(entries, firm) != 0 and firm < FIRMEST:
            firm *= self.rules.firmer
        x = self.seed
        for _ in range(self.rules.sweeps):
            x = self._backward(self.mass * x)
            x[self._unknowns :] = 0.0
            x /= max(float(np.abs(x).max(initial=0.0)), TINY)
        return x

    # -- loads that grow ------------------------------------------------------------------------------

    def _followed(self, given: Array) -> Outcome:
        """The equilibrium that is reached as the loads grow from zero, or what is given becomes another."""
        program, rules = self.program, self.rules
        begin = program.begin(self._shared(given, 0.0)) if self.begun is None else program.standing(self.begun[1])
        share, reached, step = 0.0, begin, 1.0
        found = None
        while share < 1.0 and self._left:
            there = min(1.0, share + step)
            loads = self._shared(given, there)
            there_begun = program.hold(reached, loads)
            found = self._by_whole_steps(there_begun, loads, rules.corrections)
            if found.code is Code.SOLVED:
                share, reached, step = there, program.standing(found.state), 2.0 * step
                continue
            step *= 0.5
            if step < rules.shortest:
                return found
        if found is None or share < 1.0:
            return Outcome(Code.ITERATIONS, program.flattened(reached), np.inf, NOT_DEFINED, 0)
        if found.negative > 0 and rules.escapes and program.model.downhill:
            whole = program.taken(given)
            return self._from(self._nudged(reached, whole), whole)
        return found

    def _shared(self, given: Any, share: float) -> Any:
        """What is given with a share of all loads and motions, but for data; or on the way to it from the start."""
        if self.begun is not None:
            return self.program.taken(self.begun[0] + share * (given - self.begun[0]))
        return self.program.shared(given, share)

    def _by_whole_steps(self, state: Any, given: Any, most: int) -> Outcome:
        """Newton's method from a near state."""
        sought = self._sought(state, given, most) if most else None
        return sought or self._corrected(self._at(state, given), given, most)

    def _corrected(self, here: _Here, given: Any, most: int) -> Outcome:
        """Newton's method from a near state."""
        rules, last, first = self.rules, np.inf, True
        for _ in range(min(most, self._left)):
            self._left -= 1
            if not np.isfinite(here.size):
                return self._ended(Code.NOT_FINITE, here)
            step, negative = self._newton(here)
            negative = negative if self._symmetric else NOT_DEFINED
            if not first and here.size <= rules.rounding:
                return self._ended(Code.SOLVED, here, negative)
            length = np.inf if step is None else self._length(step)
            if step is None or not length <= rules.far or length > max(last, rules.near):
                return self._ended(Code.STALLED, here)
            first, last = False, length
            there = self._at(self._moved(here.state, step, 1.0), given)
            if here.size <= rules.converged and not there.size <= rules.gain * here.size:
                return self._ended(Code.SOLVED, there if there.size < here.size else here, negative)
            here = there
        return self._ended(Code.SOLVED if here.size <= rules.converged else Code.ITERATIONS, here)
