"""Globalised Newton method: the equilibrium from the undeformed state, without IPOPT.

An iteration rotates every node by a rotation vector, so that norms hold by construction and a minimisation of the
energy on the closings remains.  Where the energy is not convex on them, which the signs of the pivots of the factorised
matrix show (Sylvester), positive matrices replace those of the elements, and the diagonal is shifted until the signs
are right; steps are shortened until potential and gaps fall.  Near the answer steps are taken whole.  Unstable
equilibria are left along the lowest mode.  Loads without potential, and cases in which no minimum is found, are
followed from zero loads.  Where something touches nothing is least in where it does: whole steps begin at a known
equilibrium, and where they fail what is given becomes another little by little.
From an equilibrium for other values Newton's whole steps are tried first.

The core does all of it at once, in process and in generated C, by ``sf_find``; where there is none, what follows here
takes the same decisions by the same :class:`Rules`.

Sources: Nocedal and Wright 2006, chapters 3 and 18 (line search on an l1 merit function); Vanderbei 1995
(quasidefinite matrices have factors in any order).
"""

from __future__ import annotations

import enum
import functools
from dataclasses import dataclass, field, replace

import numpy as np

from .. import tolerances
from ..mathematics.arrays import TINY, Array
from ..mathematics.core import Inputs as CoreInputs
from ..mathematics.core import Rules as CoreRules
from ..mathematics.core import doubles, integers
from ..mathematics.linear import InertiaSolver, SparseSolver
from ..mechanics.equations import State
from ..mechanics.evaluation import Search
from ..mechanics.inputs import Inputs, Taken
from ..mechanics.unwrapping import MISCOUNTED
from .residuals import LEAST_SCALE, relative_residual
from .sides import Sides

__all__ = ["MEANINGS", "NOT_DEFINED", "Code", "Globalised", "Outcome", "Rules"]


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
    Code.TOUCHES: "no equilibrium with what touches as in the scene, or no choice of stops and strings that holds",
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
        As :meth:`~sfetcas.mechanics.equations.Equations.state` reads it; nan for a bad argument.
    residual : float
        Largest residual over its scale, dimensionless.
    negative : int
        Number of negative eigenvalues of the energy on the closings; -1 where loads have no potential.
    iterations : int
    places : ndarray (ends,)
        Where elements end beside the ends of lines that move with the numbers, if there are any.
    error : float
        What a parametric solver says of the error of positions; else nan.
    """

    code: Code
    state: Array
    residual: float
    negative: int
    iterations: int
    places: Array = field(default_factory=lambda: np.zeros(0))
    error: float = np.nan


@dataclass(frozen=True)
class _Here:
    """A state with the equations there; ``size`` is the relative residual, ``gaps`` a sum of magnitudes."""

    state: State
    residual: Array
    size: float
    potential: float
    gaps: float
    entries: Array


class Globalised:
    """The method for one model.

    Parameters
    ----------
    inputs : Inputs
        What varies, with the equations.
    weight : ndarray (rotation unknowns,)
        See :class:`~sfetcas.solvers.stability.StabilityTest`.
    rules : Rules, optional
    begun : (ndarray (inputs,), ndarray (states,)), optional
        What is given at an equilibrium, and its state, from which others are followed; by default they are from zero.

    Attributes
    ----------
    equations : Equations
    mass, soft, seed : ndarray (total,)
        Diagonal of shifts and of the proximal term; signs of the further regularisation; start vector for the lowest
        mode.
    pivoted : bool
        Whether systems are solved by factors with pivots.
    """

    def __init__(
        self,
        inputs: Inputs,
        weight: Array,
        rules: Rules | None = None,
        begun: tuple[Array, Array] | None = None,
    ) -> None:
        self.inputs, self.rules, self.begun = inputs, rules or Rules(), begun
        self.equations = equations = inputs.equations
        self._model = model = equations.model
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
        self._symmetric = model.has_potential
        # Where a line ends the Lagrangian has no curvature along the member: there is no order without small pivots.
        self.pivoted = not self._symmetric or model.mesh.lies
        self._sliding = model.mesh.sliding
        self._left, self._free = 0, True

    @functools.cached_property
    def seed(self) -> Array:
        """Start vector (total,) for the lowest mode: the fields of the rule of sides, and tiny displacements."""
        beside = LEAST / (1.0 + np.arange(self._unknowns - self._rotation_unknowns))
        return np.concatenate([Sides(self.equations).seed, beside, np.zeros(self.equations.rows)])

    # -- by the core ----------------------------------------------------------------------------------

    def _searching(self, *, seeded: bool) -> Search | None:
        """The core's method, with or without the seed, which is seldom needed; None without a core."""
        known = self.equations.for_search(self.inputs.varying)
        if known is None:
            return None
        core, system = known
        rules, inputs, arrays = self.for_core(seeded=seeded)
        return core.search(system, rules, inputs, self.inputs.varying, arrays)

    @functools.cached_property
    def _search(self) -> Search | None:
        return self._searching(seeded=False)

    @functools.cached_property
    def _seeded(self) -> Search | None:
        return self._searching(seeded=True)

    def for_core(self, *, seeded: bool = True) -> tuple[CoreRules, CoreInputs, list[Array]]:
        """Rules and inputs as the core takes them, without its tape and data, and the arrays that they point to."""
        model, inputs, rules = self._model, self.inputs, self.rules
        arrays: dict[str, Array] = {
            "mass": doubles(self.mass),
            "sides": doubles(self.soft),
            **({"seed": doubles(self.seed)} if seeded and model.downhill else {}),
        }
        of_inputs: dict[str, Array] = {
            "turned": integers(inputs.turned),
            "held": integers(inputs.held),
            "couple": integers(np.array(inputs.couples)),
            "rest": doubles(inputs.rest.flat),
            **({} if self.begun is None else dict(zip(("begun", "reached"), map(doubles, self.begun), strict=True))),
        }
        known = CoreRules(
            symmetric=self._symmetric,
            minimisable=model.minimisable,
            downhill=model.downhill,
            pivoted=self.pivoted,
            sliding=self._sliding,
            level=tolerances.LEVEL,
            least=LEAST_SCALE,
            miscounted=MISCOUNTED,
            **vars(rules),
            **{name: array.ctypes.data for name, array in arrays.items()},
        )
        given = CoreInputs(
            turning=len(inputs.turned),
            couples=len(inputs.couples),
            **{name: array.ctypes.data for name, array in of_inputs.items()},
        )
        return known, given, [*arrays.values(), *of_inputs.values()]

    def _by_core(self, row: Array, start: Array | None, *, warm: bool) -> Outcome | None:
        """The outcome by the core; None without one."""
        begins = 0 if start is None else 2 if warm else 1
        for seeded in (False, True):
            search = self._seeded if seeded else self._search
            if search is None:
                break
            state = np.full(self.states, np.nan) if start is None else np.array(start, dtype=float)
            sought = search(row, state, begins)
            if sought is not None:
                return Outcome(Code(sought.status), state, sought.residual, sought.negative, sought.iterations)
        return None

    @functools.cached_property
    def states(self) -> int:
        """Numbers of a state."""
        return len(self.inputs.rest.flat)

    # -- linear algebra -----------------------------------------------------------------------------

    @functools.cached_property
    def _factors(self) -> InertiaSolver:
        return InertiaSolver(self._total, self.equations.row, self.equations.column)

    @functools.cached_property
    def _solver(self) -> SparseSolver:
        equations = self.equations
        return SparseSolver(self._total, equations.row, equations.column, equations.rows, symmetric=False)

    def _shift(self, entries: Array, firm: float, share: float) -> None:
        """Take a matrix with its diagonal shifted: the entries that are solved for, and those that are factorised."""
        diagonal = self.equations.diagonal
        self._target = entries.copy()
        self._target[diagonal] += (self.rules.proximal + firm) * self.mass
        self._matrix = self._target.copy()
        self._matrix[diagonal] += share * self.soft

    def _factor(self, entries: Array, firm: float) -> int:
        """Factorise a matrix with its diagonal shifted; the number of its negative pivots less that of rows.

        Nor are places that slide counted.  :data:`FAILED` if the factors break down, 0 for unsymmetric matrices.
        """
        self._shift(entries, firm, self.rules.soft)
        if not self._symmetric or not self._total:
            return 0
        try:
            self._factors.factor(self._matrix)
        except np.linalg.LinAlgError:
            return FAILED
        pivots = self._factors.negative()
        if self.pivoted:
            self._shift(entries, firm, self.rules.hard)
        return pivots - (self._total - self._unknowns) - self._sliding

    def _backward(self, b: Array) -> Array:
        if not self._total:
            return b
        try:
            if not self.pivoted:
                return np.asarray(self._factors.solve(b[:, None])[:, 0])
            self._solver.factor(self._matrix)
            return np.asarray(self._solver.solve(b))
        except np.linalg.LinAlgError:
            return np.full(b.shape, np.nan)

    def _solved(self, b: Array) -> Array | None:
        """Solution (total,) for the last matrix without the further regularisation, by refinement; None if it fails."""
        x, best, left, last = np.zeros(self._total), None, b, np.inf
        largest = float(np.abs(b).max(initial=0.0))
        for _ in range(self.rules.rounds):
            x = x + self._backward(left)
            given = self._target * x[self.equations.column]
            left = np.asarray(b - np.bincount(self.equations.row, weights=given, minlength=len(b)))
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

    def _downwards(self, here: _Here, given: Taken) -> Array | None:
        """A descent direction (total,) from a matrix that is positive on the closings; None if no shift gives one."""
        entries = given.equations.convex_entries(here.state, given.given)
        firm = 0.0
        while firm < FIRMEST:
            if self._factor(entries, firm) == 0:
                step = self._solved(-here.residual)
                if step is not None:
                    return step
            firm = max(self.rules.firm, self.rules.firmer * firm)
        return None

    # -- states ---------------------------------------------------------------------------------------

    def _at(self, state: State, given: Taken) -> _Here:
        point = given.equations.under(state, given.given)
        gaps = float(np.abs(point.residual[self._unknowns :]).sum())
        size = relative_residual(given.equations, point)
        return _Here(state, point.residual, size, point.potential, gaps, point.entries)

    def _moved(self, state: State, step: Array, share: float, given: Taken) -> State:
        there = self.equations.moved(state, share * step)
        # However far a step turns what is driven, it is the drive that says how often.
        return replace(there, unwrapped=np.where(self.inputs.held, given.angles, there.unwrapped))

    def _length(self, step: Array) -> float:
        return float(np.abs(step[: self._rotation_unknowns]).max(initial=0.0))

    # -- the method -----------------------------------------------------------------------------------

    # Overflow is detected by results that are not finite, as in C.
    @np.errstate(over="ignore", invalid="ignore")
    def __call__(self, row: Array, start: Array | None = None, *, warm: bool = False) -> Outcome:
        """Solve for an equilibrium.

        Parameters
        ----------
        row : ndarray (inputs,)
            Data that vary, loads and motions, see :class:`~sfetcas.mechanics.inputs.Inputs`.
        start : ndarray (states,), optional
            State to begin with; the undeformed one by default.
        warm : bool
            Whether that is an equilibrium for other values, from which whole steps are tried first.

        Raises
        ------
        ValueError
            The start has another length.
        """
        if start is not None and np.shape(start) != (self.states,):
            found, accepted = np.shape(start), f"({self.states},), a state of this solver"
            raise ValueError(f"start: found an array of shape {found}, accepted: {accepted}")
        return self._by_core(row, start, warm=warm) or self._step_by_step(row, start, warm=warm)

    def _step_by_step(self, row: Array, start: Array | None, *, warm: bool) -> Outcome:
        """The outcome without the core."""
        rules, inputs, minimisable = self.rules, self.inputs, self._model.minimisable
        if not np.isfinite(row).all() or (start is not None and not np.isfinite(start).all()):
            return Outcome(Code.BAD_ARGUMENT, np.full(self.states, np.nan), np.inf, NOT_DEFINED, 0)
        self._left, self._free = rules.iterations, not inputs.turns(row)
        taken = inputs.taken(row)
        state = inputs.begun(taken) if start is None else inputs.holding(self.equations.state(start), taken)
        found = self._near(state, taken) if warm else None
        found = found or self._from(state, taken)
        if found.code not in (Code.SOLVED, Code.UNSTABLE) and self._left:
            followed = self._followed(row)
            found = followed if followed.code is Code.SOLVED else found
        if found.code is Code.SOLVED and found.negative > 0 and minimisable:
            found = replace(found, code=Code.UNSTABLE)
        if found.code in (Code.SOLVED, Code.UNSTABLE) and not np.isfinite(found.state).all():
            found = replace(found, code=Code.NOT_FINITE)
        return replace(found, iterations=rules.iterations - self._left)

    def _near(self, state: State, given: Taken) -> Outcome | None:
        """By whole steps to an equilibrium that need not be left; None where they do not lead to one."""
        found = self._corrected(self._at(state, given), given, self.rules.corrections)
        if found.code is not Code.SOLVED:
            return None
        if found.negative <= 0 or not self._model.minimisable:
            return found
        leaves = self.rules.escapes and self._model.downhill
        return None if leaves else replace(found, code=Code.UNSTABLE)

    def _from(self, state: State, given: Taken) -> Outcome:
        """Downhill from a state to an equilibrium, and on from unstable ones, ``escapes`` times."""
        if not self._model.downhill:
            return self._corrected(self._at(state, given), given, self._left)
        for escape in range(self.rules.escapes + 1):
            found = self._descended(self._at(state, given), given)
            if found.code is not Code.SOLVED or found.negative <= 0:
                return found
            if escape < self.rules.escapes:
                state = self._nudged(self.equations.state(found.state), given)
        return replace(found, code=Code.UNSTABLE)

    def _ended(self, code: Code, here: _Here, negative: int = NOT_DEFINED) -> Outcome:
        if code is Code.SOLVED and self.inputs.held.any():
            wanted = here.state.unwrapped
            apart = np.abs(self._model.unwrapping.angles(here.state.q, wanted) - wanted)[self.inputs.held]
            # What is driven stands by whole turns from where its drive says: that is no equilibrium of it.
            code = code if (apart <= MISCOUNTED).all() else Code.STALLED
        return Outcome(code, here.state.flat, here.size, negative, 0)

    def _descended(self, here: _Here, given: Taken) -> Outcome:
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
                there = self._at(self._moved(here.state, step, 1.0, given), given)
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

    def _shortened(self, here: _Here, step: Array, scale: float, given: Taken) -> tuple[_Here, float] | None:
        """The state after a step that is halved until potential and gaps fall enough, and its share; None if never."""
        rules, n = self.rules, self._unknowns
        lam = here.state.lam
        penalty = 2.0 * float(np.abs(lam + step[n:]).max(initial=0.0))
        # The slope of the potential alone: the residual without the multipliers' share.
        slope = float(here.residual[:n] @ step[:n]) + float(lam @ here.residual[n:]) - penalty * here.gaps
        slope, before = min(slope, 0.0), here.potential + penalty * here.gaps
        for _ in range(rules.halvings):
            state = self._moved(here.state, step, scale, given)
            there = self._at(state, given)
            wanted = rules.armijo * (scale - 0.5 * scale**2) * slope
            if there.potential + penalty * there.gaps - before <= wanted + rules.noise * abs(before):
                return there, scale
            scale *= 0.5
        return None

    # -- out of what is unstable ----------------------------------------------------------------------

    def _nudged(self, state: State, given: Taken) -> State:
        """The state displaced along its lowest mode to the side of lower energy."""
        shape = self._softest(self._at(state, given).entries)
        shape *= self.rules.nudge / max(self._length(shape), TINY)
        sides = [self._moved(state, shape, share, given) for share in (1.0, -1.0)]
        up, down = (self._at(side, given).potential for side in sides)
        # A symmetric pair differs by rounding only: then the first side, so that answers repeat.
        return sides[1] if up - down > tolerances.LEVEL * max(abs(up), abs(down)) else sides[0]

    def _softest(self, entries: Array) -> Array:
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

    def _followed(self, row: Array) -> Outcome:
        """The equilibrium that is reached as the loads grow from zero, or what is given becomes another."""
        equations, inputs, rules = self.equations, self.inputs, self.rules
        share, step, found = 0.0, 1.0, None
        reached = inputs.begun(self._shared(row, 0.0)) if self.begun is None else equations.state(self.begun[1])
        while share < 1.0 and self._left:
            there = min(1.0, share + step)
            taken = self._shared(row, there)
            found = self._corrected(self._at(inputs.holding(reached, taken), taken), taken, rules.corrections)
            if found.code is Code.SOLVED:
                share, reached, step = there, equations.state(found.state), 2.0 * step
                continue
            step *= 0.5
            if step < rules.shortest:
                return found
        if found is None or share < 1.0:
            return Outcome(Code.ITERATIONS, reached.flat, np.inf, NOT_DEFINED, 0)
        if found.negative > 0 and rules.escapes and self._model.downhill:
            whole = inputs.taken(row)
            return self._from(self._nudged(reached, whole), whole)
        return found

    def _shared(self, row: Array, share: float) -> Taken:
        """What is given with a share of all loads and motions, but for data; or on the way to it from the start."""
        if self.begun is None:
            return self.inputs.taken(self.inputs.shared(row, share))
        return self.inputs.taken(self.begun[0] + share * (row - self.begun[0]))

    def _corrected(self, here: _Here, given: Taken, most: int) -> Outcome:
        """Newton's method from a near state."""
        rules, last, first = self.rules, np.inf, True
        for _ in range(min(most, self._left)):
            self._left -= 1
            if not np.isfinite(here.size):
                return self._ended(Code.NOT_FINITE, here)
            step, counted = self._newton(here)
            negative = counted if self._symmetric else NOT_DEFINED
            if not first and here.size <= rules.rounding:
                return self._ended(Code.SOLVED, here, negative)
            length = np.inf if step is None else self._length(step)
            if step is None or not length <= rules.far or length > max(last, rules.near):
                # What is in balance already needs no step, which rounding alone would make.
                balanced = counted != FAILED and here.size <= rules.converged
                return self._ended(Code.SOLVED, here, negative) if balanced else self._ended(Code.STALLED, here)
            first, last = False, length
            there = self._at(self._moved(here.state, step, 1.0, given), given)
            if here.size <= rules.converged and not there.size <= rules.gain * here.size:
                return self._ended(Code.SOLVED, there if there.size < here.size else here, negative)
            here = there
        return self._ended(Code.SOLVED if here.size <= rules.converged else Code.ITERATIONS, here)
