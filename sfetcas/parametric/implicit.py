"""First and second derivatives of answers of an equilibrium by parameters, by the implicit function theorem.

Near an equilibrium a state is given by a *step* of all unknowns and multipliers from it, after prescribed rotations
have been set to their values for the parameters.  With the equations ``F(step, p) = 0`` and the answers ``a(step, p)``,
both functions of this step, ``K = dF/dstep`` and ``S = dstep/dp = -K^-1 dF/dp``

    da/dp = a_step S + a_p,      K^T m = -a_step^T,      d2a/dp2 = [S; I]^T d2(a + m.F) [S; I],

exact however the step is defined, as long as it is the same in both.  Equations and answers depend on the parameters
through the *data* only, with the chain rule ``d/dp = d/ddata ddata/dp``.

Where lines end elements do: the places ``c`` of these are further numbers, and answers ``s`` besides, with ``c = s``,

    dc/dp = (I - s_c)^-1 s_p,      da/dp = a_p + a_c dc/dp,

and second derivatives are those of ``a + a_c (I - s_c)^-1 s`` in the directions ``[I; dc/dp]``.

Source: Hinze, Pinnau, Ulbrich and Ulbrich 2009, section 1.6 (sensitivities and adjoints; the second derivatives).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from .. import tolerances
from ..errors import SolveError, Status
from ..mathematics.arrays import Array
from ..mathematics.kernels import Batch
from ..mathematics.linear import SparseSolver, places_of
from ..mathematics.threads import single_threaded
from .arguments import Arguments
from .results import Results
from .switched import Switches

__all__ = ["Implicit", "Slopes"]

LARGE_PRIMAL_FACTOR = 1000.0
"""Times the weight for a second attempt: where numbers act along a neutral direction both differ."""

SINGULAR = 1e-5
"""Eigenvalues of the weighted matrix, usually of the size of one, below which an equilibrium may be singular.

Rounding of 1e-13 in the equations leaves that over the eigenvalue in the state, which the matrix depends on: of the
derivatives no more than three digits are left.
"""

EXPANDED = 1000
"""Up to this many unknowns functions are expanded to scalar operations: with more that takes longer than it gains."""

DISAGREE = 1e-3
"""Share by which the derivatives of both may differ."""


@dataclass(frozen=True)
class Slopes:
    """First derivatives at one equilibrium.

    Attributes
    ----------
    steps : ndarray (total, numbers)
        Derivatives of the step, dimensionless, by the numbers.
    answers : ndarray (answers,)
        In SI units.
    jacobian : ndarray (answers, numbers)
    entries : ndarray
        Entries of the Newton matrix.
    places : ndarray (ends, numbers)
        Derivatives of the places where lines end.
    whole : ndarray (total, numbers + ends)
        Derivatives of the step by the numbers and these places.
    weights : ndarray (answers, ends)
        Weights of the places as answers beside each answer.
    """

    steps: Array
    answers: Array
    jacobian: Array
    entries: Array
    places: Array
    whole: Array
    weights: Array


class Implicit:
    """Derivatives of the answers of one program.

    Parameters
    ----------
    arguments : Arguments
    results : Results
        The answers.
    weight : ndarray (total,)
        Weights of the unknowns, by which eigenvalues are of order one; zero for multipliers.
    unique : bool
        Whether constraints are independent of each other.
    switches : Switches, optional
        Strings and stops, of which act what does so at the equilibrium.

    Attributes
    ----------
    total, turning : int
        Number of unknowns and multipliers; number of rotation unknowns, which come first.
    """

    def __init__(
        self,
        arguments: Arguments,
        results: Results,
        weight: Array,
        *,
        unique: bool = True,
        switches: Switches | None = None,
    ) -> None:
        self._arguments, self._results, self._program = arguments, results, arguments.program
        self._switches = switches
        self._weight, self._unique = weight, unique
        self.total, self._count = arguments.expressions.total, arguments.size
        self.rotation_unknowns = self._program.equations.rotation_unknowns
        self._symmetric = self._program.model.has_potential
        self._batches: dict[str, Batch] = {}
        self._data = _Data(arguments)

    # -- functions ----------------------------------------------------------------------------------

    @functools.cached_property
    def _symbols(self) -> tuple[ca.MX, ca.MX]:
        """Step and data in one, and the state that the step goes from."""
        return ca.MX.sym("x", self.total + self._data.size), ca.MX.sym("state", self._program.states)

    def _at(self, expression: ca.MX, *, moved: bool = True) -> ca.MX:
        """An expression of the program's state and given, and of :attr:`_rest`, after the step or before it."""
        program, (x, state) = self._program, self._symbols
        step, data = ca.vertsplit(x, [0, self.total, self.total + self._data.size])
        given, rest = self._data.whole(data)
        if self._switches is not None:
            given = self._switches.expression(given, state)
        hold = ca.Function("hold", [program.state_symbol, program.symbol], [program.prescribed_expression])
        there = hold.call([state, given], True)[0]
        if moved:
            by = ca.MX.sym("by", self.total)
            q, y, lam = program.moved_expression(by)
            move = ca.Function("move", [program.state_symbol, by], [ca.vertcat(ca.vec(q), y, lam, program.parts[3])])
            there = move.call([there, step], True)[0]
        function = ca.Function("at", [self._rest, program.state_symbol, program.symbol], [ca.densify(expression)])
        return function.call([rest, there, given], True)[0]

    @functools.cached_property
    def _rest(self) -> ca.MX:
        return ca.MX.sym("rest", self._data.undeformed_size)

    @functools.cached_property
    def _outputs(self) -> ca.MX:
        """The answers after a step, then the places where lines end."""
        found = self._results.expression(self._program, self._rest)
        places = self._results.touches(self._program, self._rest, self._arguments.ends)
        return self._at(ca.vertcat(found, places))

    @functools.cached_property
    def _seeds(self) -> ca.MX:
        """Derivatives of the data by the numbers, as an argument."""
        return ca.MX.sym("seeds", self._data.pattern)

    def _directions(self, steps: ca.MX | ca.DM) -> ca.MX:
        """Directions of step and data, one for each number."""
        return ca.vertcat(steps, self._seeds)

    @functools.cached_property
    def _equations(self) -> ca.Function:
        """(x, state, seeds) -> derivative of the equations by the numbers, and the entries of the matrix."""
        residual = self._at(self._program.forces.residual, moved=False)
        entries = self._at(self._program.matrix.nz[:], moved=False)
        x, state, seeds, (balance, stiff) = self._expanded(residual, entries) or (
            *self._symbols,
            self._seeds,
            (residual, entries),
        )
        by_p = ca.jtimes(balance, x, ca.vertcat(ca.DM(self.total, self._count), seeds))
        return ca.Function("equations", [x, state, seeds], [ca.densify(by_p), stiff])

    def _expanded(self, *results: ca.MX) -> Any:
        """Functions of x, state and seeds as scalar operations, which are ten times as fast; None where these are too
        many."""
        if self.total > EXPANDED:
            return None
        try:
            function = ca.Function("whole", list(self._symbols), list(results)).expand()
        except RuntimeError:
            # What solves linear systems.
            return None
        x, state = (ca.SX.sym(symbol.name(), symbol.shape[0]) for symbol in self._symbols)
        return x, state, ca.SX.sym("seeds", self._data.pattern), function.call([x, state])

    @functools.cached_property
    def _by_all(self) -> ca.Function | None:
        """(x, state, seeds) -> the answers, their derivatives by the step, sparse, and by the numbers where that stays;
        None where :attr:`_along` is meant for it."""
        found = self._expanded(self._outputs)
        if found is None:
            return None
        x, state, seeds, (outputs,) = found
        by_data = ca.jtimes(outputs, x, ca.vertcat(ca.DM(self.total, self._count), seeds))
        return ca.Function(
            "by_all", [x, state, seeds], [outputs, ca.jacobian(outputs, x[: self.total]), ca.densify(by_data)]
        )

    @functools.cached_property
    def _along(self) -> ca.Function:
        """(x, state, seeds, steps) -> the answers, and their derivatives in directions, one for each number."""
        x, state = self._symbols
        steps = ca.MX.sym("steps", self.total, self._count)
        found = ca.jtimes(self._outputs, x, self._directions(steps))
        return ca.Function("along", [x, state, self._seeds, steps], [self._outputs, ca.densify(found)])

    @functools.cached_property
    def _by_step(self) -> ca.Function:
        """(x, state, weights) -> derivative of weighted answers by the step."""
        x, state = self._symbols
        weights = ca.MX.sym("weights", self._outputs.numel())
        found = ca.jtimes(self._outputs, x, weights, True)[: self.total]
        return ca.Function("by_step", [x, state, weights], [ca.densify(found)])

    @functools.cached_property
    def _curved(self) -> ca.Function:
        """(x, state, seeds, weights, multipliers, steps) -> second derivatives of weighted answers by the numbers.

        But for what the data add that are curved themselves: by the second result, their gradient, which is returned.
        """
        x, state = self._symbols
        weights, m = ca.MX.sym("weights", self._outputs.numel()), ca.MX.sym("multipliers", self.total)
        steps = ca.MX.sym("steps", self.total, self._count)
        lagrangian = ca.dot(weights, self._outputs) + ca.dot(m, self._at(self._program.forces.residual))
        along, gradient = self._directions(steps), ca.gradient(lagrangian, x)
        found = ca.mtimes(along.T, ca.jtimes(gradient, x, along))
        results = [ca.densify(found), ca.densify(gradient[self.total :])]
        return ca.Function("curved", [x, state, self._seeds, weights, m, steps], results)

    # -- numbers ------------------------------------------------------------------------------------

    def _x(self, p: Array) -> tuple[Array, Array]:
        """Step and data, and the derivatives of these by the numbers, as :attr:`_seeds` takes them."""
        data, seeds = self._data.at(p)
        return np.concatenate([np.zeros(self.total), data]), seeds

    @single_threaded
    def slopes(self, p: Array, state: Array) -> Slopes:
        """First derivatives at the equilibrium ``state`` (states,) of the numbers p (numbers,).

        Raises
        ------
        SolveError
            The equilibrium is singular.
        """
        x, seeds = self._x(p)
        by_p, entries = self._called("_equations", x, state, seeds)
        right = -by_p.reshape(self._count, self.total).T
        steps = self._solved(entries, right)
        if steps is None:
            return self._regularised_slopes((x, seeds), state, entries, right)
        return self._slopes((x, seeds), state, entries, steps)

    def _slopes(self, at: tuple[Array, Array], state: Array, entries: Array, steps: Array) -> Slopes:
        x, seeds = at
        if self._by_all is None:
            answers, jacobian = self._called("_along", x, state, seeds, steps.T)
            return self._with_ends(steps, answers, jacobian.reshape(self._count, -1).T.copy(), entries)
        answers, values, by_data = self._called("_by_all", x, state, seeds)
        by_step = np.zeros((len(answers), self.total))
        by_step[self._filled] = values
        return self._with_ends(steps, answers, by_step @ steps + by_data.reshape(self._count, -1).T, entries)

    def _with_ends(self, steps: Array, answers: Array, jacobian: Array, entries: Array) -> Slopes:
        """Derivatives by the numbers from those of all answers by all numbers, with places where lines end."""
        n, count = self._results.size, len(self._arguments.defaults)
        left = np.eye(len(self._arguments.ends)) - jacobian[n:, count:]
        places, weights = np.linalg.solve(left, jacobian[n:, :count]), np.linalg.solve(left.T, jacobian[:n, count:].T).T
        by_numbers = jacobian[:n, :count] + jacobian[:n, count:] @ places
        return Slopes(
            steps[:, :count] + steps[:, count:] @ places, answers[:n], by_numbers, entries, places, steps, weights
        )

    @functools.cached_property
    def _filled(self) -> tuple[Array, Array]:
        """Places of the derivatives of the answers by the step."""
        assert self._by_all is not None
        return places_of(self._by_all.sparsity_out(1))

    @single_threaded
    def second(self, p: Array, state: Array, slopes: Slopes, weights: Array) -> Array:
        """Hessian (numbers, numbers) of the sum of all answers times their ``weights`` (answers,)."""
        x, seeds = self._x(p)
        weights = np.append(weights, weights @ slopes.weights)
        (right,) = self._called("_by_step", x, state, weights)
        multipliers = self._transposed(slopes.entries, -right)
        found, gradient = self._called("_curved", x, state, seeds, weights, multipliers, slopes.whole.T)
        found = found.reshape(self._count, self._count) + self._data.curved(p, gradient)
        along = np.vstack([np.eye(slopes.places.shape[1]), slopes.places])
        found = along.T @ found @ along
        return 0.5 * (found + found.T)

    def _called(self, name: str, *given: Array) -> list[Array]:
        """Results of one of the functions, flat, without copies between NumPy and CasADi on the way in."""
        if name not in self._batches:
            self._batches[name] = Batch(getattr(self, name), 1)
        batch = self._batches[name]
        for i, values in enumerate(given):
            batch.set(i, values)
        return [found.ravel().copy() for found in batch()]

    # -- the linear system --------------------------------------------------------------------------

    @functools.cached_property
    def _places(self) -> tuple[Array, Array]:
        return places_of(self._program.matrix.sparsity())

    @functools.cached_property
    def _straight(self) -> SparseSolver:
        row, column = self._places
        return SparseSolver(self.total, row, column, self._rows, symmetric=self._symmetric)

    @functools.cached_property
    def _across(self) -> tuple[SparseSolver, Array]:
        """That of the transposed matrix, and the order of its entries."""
        row, column = self._places
        order = np.lexsort((column, row))
        solver = SparseSolver(self.total, column[order], row[order], self._rows, symmetric=self._symmetric)
        return solver, order

    @property
    def _rows(self) -> int:
        return self._program.equations.rows

    @functools.cached_property
    def _generic(self) -> Array:
        """A shape that no symmetry makes orthogonal to a neutral one."""
        return 1.0 + 0.5 * np.sin(1.0 + np.arange(self.total))

    def _solved(self, entries: Array, right: Array) -> Array | None:
        """Solution for the right sides; None where the matrix may be singular."""
        if not self._unique or not self.total:
            return None if self.total else right
        weight, generic = self._weight, self._generic
        try:
            self._straight.factor(entries)
            found = self._straight.solve(np.column_stack([right, weight * generic]))
        except np.linalg.LinAlgError:
            return None
        # An inverse iteration: what is soft grows by as much.
        size, grown = (float(np.sqrt(weight @ shape**2)) for shape in (generic, found[:, -1]))
        return found[:, :-1] if np.isfinite(found).all() and grown * SINGULAR <= size else None

    def _regularised(self, entries: Array, proximal: float) -> Array:
        entries = entries.copy()
        row, column = self._places
        diagonal = np.flatnonzero(row == column)
        entries[diagonal] += proximal * self._weight
        entries[diagonal[self.total - self._rows :]] -= tolerances.DUAL
        return entries

    def _regularised_slopes(self, at: tuple[Array, Array], state: Array, entries: Array, right: Array) -> Slopes:
        """Derivatives with a little softness in all neutral directions, if none of the numbers acts along these."""
        found = []
        for proximal in (tolerances.PROXIMAL, LARGE_PRIMAL_FACTOR * tolerances.PROXIMAL):
            regularised = self._regularised(entries, proximal)
            self._straight.factor(regularised)
            found.append(self._slopes(at, state, regularised, self._straight.solve(right)))
        one, other = (slopes.jacobian for slopes in found)
        if not np.abs(one - other).max(initial=0.0) <= DISAGREE * np.abs(one).max(initial=0.0):
            raise SolveError(Status.SINGULAR, "a limit point, a bifurcation, or what nothing resists")
        return found[0]

    def _transposed(self, entries: Array, right: Array) -> Array:
        solver, order = self._across
        solver.factor(entries[order])
        return solver.solve(right)


class _Data:
    """What is given and what is told of the undeformed scene, as far as it depends on the numbers: the *data*.

    However they depend on them, their derivatives are found by themselves, and those of the equations and answers
    by the data.

    Attributes
    ----------
    size, undeformed_size : int
        Of the data; of what is told of the undeformed scene.
    pattern : Sparsity (size, numbers)
        Of their derivatives.
    """

    def __init__(self, arguments: Arguments) -> None:
        p = ca.MX.sym("p", arguments.size)
        given, rest = ca.densify(arguments.given(p)), ca.densify(arguments.undeformed(p))
        flat, self.undeformed_size = ca.vertcat(given, rest), rest.numel()
        rows = sorted(set(ca.jacobian_sparsity(flat, p).row()))
        data = flat[rows]
        self._rows, self.size, self._given = rows, len(rows), given.numel()
        self._constant = ca.Function("constant", [p], [flat])(np.append(arguments.defaults, arguments.places))
        derivative = ca.jacobian(data, p)
        self.pattern = derivative.sparsity()
        self._first = ca.Function("data", [p], [data, derivative])
        weights = ca.MX.sym("weights", self.size)
        self._second = ca.Function("curved", [p, weights], [ca.densify(ca.hessian(ca.dot(weights, data), p)[0])])

    def whole(self, data: ca.MX) -> tuple[ca.MX, ca.MX]:
        """What is given, and what is told of the undeformed scene."""
        flat = ca.MX(self._constant)
        if self.size:
            flat[self._rows] = data
        given, rest = ca.vertsplit(flat, [0, self._given, self._given + self.undeformed_size])
        return given, rest

    def at(self, p: Array) -> tuple[Array, Array]:
        """The data, and the entries of their derivatives."""
        data, derivative = self._first(p)
        return np.array(data).ravel(), np.array(derivative.nonzeros())

    def curved(self, p: Array, weights: Array) -> Array:
        """Second derivatives (numbers, numbers) of the data, each times its weight and added up."""
        return np.array(self._second(p, weights))
