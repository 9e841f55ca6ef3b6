"""Derivatives of answers of an equilibrium by numbers, first and second, from its equations.

Near an equilibrium a state is told by a *step* of all unknowns and multipliers from it, after held rotations have
moved to where the numbers say.  With the equations ``F(step, p) = 0`` and the answers ``a(step, p)``, both in this
step, ``K = dF/dstep`` and ``S = dstep/dp = -K^-1 dF/dp``

    da/dp = a_step S + a_p,      K^T m = -a_step^T,      d2a/dp2 = [S; I]^T d2(a + m.F) [S; I],

exact whatever the step means, as long as it means the same in both.

Source: Hinze, Pinnau, Ulbrich and Ulbrich 2009, section 1.6 (sensitivities and adjoints; the second derivatives).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..errors import SolveError, Status
from ..mathematics.arrays import Array
from ..mathematics.linear import SparseSolver
from .arguments import Arguments
from .results import Results

__all__ = ["Implicit", "Slopes"]

SINGULAR = 1e-5
"""Eigenvalues of the weighted matrix, usually of the size of one, below which an equilibrium is taken for singular.

Rounding of 1e-13 in the equations leaves as much over the eigenvalue in the state, which the matrix depends on: of
derivatives no more than three digits are left.
"""

ALONG = 1e-7
"""Share of what numbers do that may act along a neutral direction, and be rounding."""

PROXIMAL = 1e-10
"""Weight on the diagonal of rotations that makes neutral directions harmless."""

DUAL = 1e-12
"""Softness of closings that depend on each other."""


@dataclass(frozen=True)
class Slopes:
    """First derivatives at one equilibrium.

    Attributes
    ----------
    steps : ndarray (total, numbers)
        Of the step by the numbers.
    answers : ndarray (answers,)
    jacobian : ndarray (answers, numbers)
    matrix : ndarray
        Entries of Newton's matrix.
    """

    steps: Array
    answers: Array
    jacobian: Array
    matrix: Array


class Implicit:
    """Derivatives of the answers of one program.

    Parameters
    ----------
    arguments : Arguments
    results : Results
        The answers.
    weight : ndarray (total,)
        Of the unknowns, on the scale of which eigenvalues are of the size of one; nothing of multipliers.
    unique : bool
        Whether closings are independent.
    """

    def __init__(self, arguments: Arguments, results: Results, weight: Array, *, unique: bool = True) -> None:
        self._arguments, self._results, self._program = arguments, results, arguments.program
        self._weight, self._unique = weight, unique
        self._total, self._count = arguments.expressions.total, len(arguments.defaults)
        self._symmetric = self._program.model.has_potential

    # -- functions ----------------------------------------------------------------------------------

    @functools.cached_property
    def _symbols(self) -> tuple[ca.MX, ca.MX]:
        """Step and numbers in one, and the state that the step goes from."""
        return ca.MX.sym("x", self._total + self._count), ca.MX.sym("state", self._program.states)

    def _at(self, expression: ca.MX, *, moved: bool = True) -> ca.MX:
        """An expression of the program's state and given, and of :attr:`_numbers`, after the step or before it."""
        program, (x, state) = self._program, self._symbols
        step, p = ca.vertsplit(x, [0, self._total, self._total + self._count])
        given = self._arguments.given(p)
        hold = ca.Function("hold", [program.state_symbol, program.symbol], [program.held_expression])
        there = hold.call([state, given], True)[0]
        if moved:
            by = ca.MX.sym("by", self._total)
            q, y, lam = program.moved_expression(by)
            move = ca.Function("move", [program.state_symbol, by], [ca.vertcat(ca.vec(q), y, lam, program.parts[3])])
            there = move.call([there, step], True)[0]
        function = ca.Function("at", [self._numbers, program.state_symbol, program.symbol], [ca.densify(expression)])
        return function.call([p, there, given], True)[0]

    @functools.cached_property
    def _numbers(self) -> ca.MX:
        return ca.MX.sym("p", self._count)

    @functools.cached_property
    def _told(self) -> ca.MX:
        """The answers after a step."""
        undeformed = self._arguments.undeformed(self._numbers)
        return self._at(self._results.expression(self._program, undeformed, short=True))

    def _directions(self, steps: ca.MX | ca.DM) -> ca.MX:
        """Directions of step and numbers, one for each number."""
        return ca.vertcat(steps, ca.DM.eye(self._count))

    @functools.cached_property
    def _equations(self) -> ca.Function:
        """(x, state) -> derivative of the equations by the numbers, and the entries of the matrix."""
        x, state = self._symbols
        residual = self._at(self._program.forces.residual, moved=False)
        by_p = ca.jtimes(residual, x, self._directions(ca.DM(self._total, self._count)))
        entries = self._at(self._program.matrix.nz[:], moved=False)
        return ca.Function("equations", [x, state], [ca.densify(by_p), entries])

    @functools.cached_property
    def _along(self) -> ca.Function:
        """(x, state, steps) -> the answers, and their derivatives in directions, one for each number."""
        x, state = self._symbols
        steps = ca.MX.sym("steps", self._total, self._count)
        found = ca.jtimes(self._told, x, self._directions(steps))
        return ca.Function("along", [x, state, steps], [self._told, ca.densify(found)])

    @functools.cached_property
    def _by_step(self) -> ca.Function:
        """(x, state, weights) -> derivative of weighted answers by the step."""
        x, state = self._symbols
        weights = ca.MX.sym("weights", self._results.size)
        found = ca.jtimes(self._told, x, weights, True)[: self._total]
        return ca.Function("by_step", [x, state, weights], [ca.densify(found)])

    @functools.cached_property
    def _curved(self) -> ca.Function:
        """(x, state, weights, multipliers, steps) -> second derivatives of weighted answers by the numbers."""
        x, state = self._symbols
        weights, m = ca.MX.sym("weights", self._results.size), ca.MX.sym("multipliers", self._total)
        steps = ca.MX.sym("steps", self._total, self._count)
        lagrangian = ca.dot(weights, self._told) + ca.dot(m, self._at(self._program.forces.residual))
        along = self._directions(steps)
        found = ca.mtimes(along.T, ca.jtimes(ca.gradient(lagrangian, x), x, along))
        return ca.Function("curved", [x, state, weights, m, steps], [ca.densify(found)])

    # -- numbers ------------------------------------------------------------------------------------

    def _x(self, p: Array) -> Array:
        return np.concatenate([np.zeros(self._total), p])

    def slopes(self, p: Array, state: Array) -> Slopes:
        """First derivatives at the equilibrium of the numbers.

        Raises
        ------
        SolveError
            The equilibrium is singular.
        """
        by_p, entries = self._equations(self._x(p), state)
        matrix, right = np.array(entries).ravel(), -np.array(by_p).reshape(self._total, self._count)
        steps = self._solved(matrix, right)
        answers, found = self._along(self._x(p), state, steps)
        return Slopes(steps, np.array(answers).ravel(), np.array(found).reshape(-1, self._count), matrix)

    def second(self, p: Array, state: Array, slopes: Slopes, weights: Array) -> Array:
        """Second derivatives (numbers, numbers) of the answers, each times its weight."""
        right = -np.array(self._by_step(self._x(p), state, weights)).ravel()
        multipliers = self._transposed(slopes.matrix, right)
        found = np.array(self._curved(self._x(p), state, weights, multipliers, slopes.steps))
        return 0.5 * (found + found.T)

    # -- the linear system --------------------------------------------------------------------------

    @functools.cached_property
    def _places(self) -> tuple[Array, Array]:
        row, column = (np.array(part, dtype=np.intp) for part in self._program.sparsity.get_triplet())
        return row, column

    def _solver(self, *, transposed: bool = False) -> SparseSolver:
        row, column = self._places
        rows = self._program.equations.rows
        if not transposed:
            return SparseSolver(self._total, row, column, rows, symmetric=self._symmetric)
        order = np.lexsort((column, row))
        return SparseSolver(self._total, column[order], row[order], rows, symmetric=self._symmetric)

    @functools.cached_property
    def _straight(self) -> SparseSolver:
        return self._solver()

    def _solved(self, matrix: Array, right: Array) -> Array:
        """Solution for the right sides, with a look for what is singular."""
        probe = self._weight * self._generic
        self._straight.factor(matrix)
        found = self._straight.solve(np.column_stack([right, probe]))
        steps, soft = found[:, :-1], found[:, -1]
        return steps

    @functools.cached_property
    def _generic(self) -> Array:
        return 1.0 + 0.5 * np.sin(1.0 + np.arange(self._total))

    @functools.cached_property
    def _across(self) -> tuple[SparseSolver, Array]:
        row, column = self._places
        return self._solver(transposed=True), np.lexsort((column, row))

    def _transposed(self, matrix: Array, right: Array) -> Array:
        solver, order = self._across
        solver.factor(matrix[order])
        return solver.solve(right)
