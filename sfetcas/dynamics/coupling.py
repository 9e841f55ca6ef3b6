"""Steps of the conserving scheme and impulses as sparse matrices of numbers, for bodies that contact alone couples.

A body is a block of the matrices: what contact does to it is solved for with factors of that block.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from ..mathematics.arrays import TINY, Array, Index, Sparse
from ..mathematics.kernels import Batch
from ..mechanics.equations import State
from .conserving import Middle, symbols_of_step
from .stages import StageEquations

__all__ = ["MASSLESS", "SOFT", "Bodies", "Moving", "StepEquations", "bodies_of", "factored"]

DUAL, REFINED = 1e-10, 2
"""Diagonal of rows over the largest mass of their body in the matrix of impulses, and rounds that take it out."""

MASSLESS, SOFT = 1e-14, 1e-13
"""Share of the largest mass of a body, or of the largest entry in its part of a matrix, that everything has at least,
and share of its own by which anything is heavier: some combinations of unknowns have no mass.
"""


@dataclass(frozen=True, eq=False)
class Moving:
    """A state between steps, dimensionless.

    Attributes
    ----------
    t : float
    state : State
    x, v : ndarray (quantities,)
        Quantities and their rates.
    w : ndarray (total,)
        Rates of the unknowns that come nearest to these.
    lost : float
        Energy that contact has taken so far.
    pushed : mapping
        For what has touched in the step before its impulse.
    length : float
        The length of that step; of one that was divided that of its last part.
    rubbed : mapping
        For what has rubbed in it the impulse (axes,) of friction on it, or on the first member, and whether it sticks.
    dragged : ndarray (full,)
        The impulses of all friction by full coordinates; empty without friction.
    """

    t: float
    state: State
    x: Array
    v: Array
    w: Array
    lost: float = 0.0
    pushed: dict[Any, float] = field(default_factory=dict)
    length: float = 1.0
    rubbed: dict[Any, tuple[Array, bool]] = field(default_factory=dict)
    dragged: Array = field(default_factory=lambda: np.zeros(0))


class Bodies:
    """Solutions with a matrix of many bodies, each a block, for right sides that belong to contact between them.

    A column carries the sides of as many contacts as there are bodies: there are no more of them than contacts of one
    body.

    Parameters
    ----------
    bodies : ndarray (total,)
        Number of the body of each unknown.
    """

    def __init__(self, bodies: Index) -> None:
        self._bodies = bodies

    def coupled(self, solve: Callable[[Array], Array], left: Sparse, right: Sparse) -> Sparse:
        """``left K^-1 right^T`` (rows, rows), sparse, with ``solve`` for ``K^-1``."""
        from scipy.sparse import coo_matrix, csc_matrix

        count, size = right.shape
        if not count:
            return csc_matrix((0, 0))
        entries = right.tocoo()
        body = self._bodies[entries.col]
        key, own = np.unique(body * np.intp(count) + entries.row, return_inverse=True)
        own = own.ravel()
        bodies, rows = np.divmod(key, count)
        begins = np.searchsorted(bodies, bodies)
        column = np.arange(len(key)) - begins
        width = int(column.max()) + 1
        block = np.zeros((size, width))
        block[entries.col, column[own]] = entries.data
        found = solve(block)
        # Each row of the left by the columns of its bodies.
        given = left.tocoo()
        its, part = np.unique(self._bodies[given.col] * np.intp(count) + given.row, return_inverse=True)
        sums = coo_matrix((given.data, (part.ravel(), given.col)), shape=(len(its), size)).tocsr() @ found
        of_body, of_row = np.divmod(its, count)
        first, last = np.searchsorted(bodies, of_body), np.searchsorted(bodies, of_body, side="right")
        each = last - first
        row, at = np.repeat(np.arange(len(its)), each), np.arange(each.sum()) - np.repeat(np.cumsum(each) - each, each)
        columns = rows[first[row] + at]
        return coo_matrix((sums[row, at], (of_row[row], columns)), shape=(count, count)).tocsc()


class Filled:
    """Sparse matrices of one pattern."""

    def __init__(self, pattern: ca.Sparsity) -> None:
        from scipy.sparse import csc_matrix

        columns, rows = (np.array(part, np.intc) for part in pattern.get_ccs())
        self._empty = csc_matrix((np.ones(len(rows)), rows, columns), shape=pattern.shape)

    def __call__(self, entries: Array) -> Sparse:
        """The matrix with these entries, column by column."""
        found = self._empty.copy()
        found.data[:] = entries.ravel()
        return found


class StepEquations:
    """The equations of a step and of velocities as matrices and vectors of numbers."""

    def __init__(self, system: StageEquations) -> None:
        self.system = system
        self._middle, self._balance, self._moving, self._order = self._positions()
        self._whole, self._size = Filled(self._order.pattern), system.total

    def _positions(self) -> tuple[Batch, Batch, Batch, Any]:
        system = self.system
        q, y, lam, begin, h, factors = symbols_of_step(system)
        found = Middle(system, begin, h, factors, q, y, lam)
        matrix, order = system.matrix(found.entries, [2.0 / h**2], begin.unwrapped)
        x = system.moving(q, y, system.given(factors[:, 1]), begin.unwrapped)
        arguments = [q, y, lam, begin.q, begin.y, begin.x, begin.rates, begin.unwrapped, h, factors]
        outputs = [ca.densify(found.residual), ca.densify(x)]
        function = ca.Function("positions", arguments, [*outputs, matrix])
        balance = ca.Function("balance", arguments, outputs)
        end = ca.MX.sym("end", system.layout.factors)
        x = system.moving(q, y, system.given(end), begin.unwrapped)
        moving = ca.Function("moving", [q, y, end, begin.unwrapped], [ca.densify(x)])
        return Batch(function, 1), Batch(balance, 1), Batch(moving, 1), order

    def positions(
        self, now: State, begin: Moving, h: float, factors: Array, *, fresh: bool
    ) -> tuple[Array, Array, Sparse | None]:
        """Residual (total,) and quantities at the end of a step; if ``fresh`` also the matrix (total, total) in the
        order of elimination.
        """
        batch = self._middle if fresh else self._balance
        given = now.q, now.y, now.lam, begin.state.q, begin.state.y, begin.x, begin.v
        for i, values in enumerate((*given, begin.state.unwrapped, np.array([h]), factors)):
            if values.size:
                batch.set(i, values)
        residual, x, *matrix = batch()
        return residual.ravel().copy(), x.ravel().copy(), self._whole(matrix[0]) if fresh else None

    def quantities(self, now: State, factors: Array) -> Array:
        """The quantities (quantities,) in a state."""
        for i, values in enumerate((now.q, now.y, factors, now.unwrapped)):
            if values.size:
                self._moving.set(i, values)
        return self._moving()[0].ravel().copy()

    @functools.cached_property
    def order(self) -> Index:
        """Numbers of the unknowns in the order of elimination, (total,)."""
        return np.array(self._order.order, np.intp)

    @functools.cached_property
    def bodies(self) -> Index:
        """Number of the body of each unknown, (total,): what contact alone couples is several."""
        found = np.zeros(self._size, np.intp)
        found[self.order] = bodies_of(self._order.pattern)
        return found

    @functools.cached_property
    def _momenta(self) -> tuple[Batch, Filled]:
        """(q, y, factors, unwrapped, v) -> masses with the Jacobian of the rows, (total, total), and momenta."""
        system, n = self.system, self.system.layout
        q, y, v = ca.MX.sym("q", n.components, n.rotations), ca.MX.sym("y", n.y), ca.MX.sym("v", n.x)
        factors, unwrapped = ca.MX.sym("factors", n.factors), ca.MX.sym("unwrapped", n.unwrapped)
        rows, mass, momentum = system.momenta(q, y, factors, unwrapped, v)
        matrix = ca.blockcat([[mass, rows.T], [rows, ca.MX(n.lam, n.lam)]])
        function = ca.Function("momenta", [q, y, factors, unwrapped, v], [matrix, ca.densify(momentum)])
        return Batch(function, 1), Filled(function.sparsity_out(0))

    def _massive(self, now: State, factors: Array, v: Array) -> tuple[Sparse, Array]:
        """Masses and rows (total, total), and momenta (total,) of rates v (quantities,); zero for the rows."""
        batch, filled = self._momenta
        for i, values in enumerate((now.q, now.y, factors, now.unwrapped, v)):
            if values.size:
                batch.set(i, values)
        matrix, momentum = batch()
        return filled(matrix), np.concatenate([momentum.ravel(), np.zeros(self.system.layout.lam)])

    def massive(self, now: State, factors: Array, v: Array) -> tuple[Callable[[Array], Array], Array]:
        """What solves for the rates of unknowns and multipliers with the masses at a state, and momenta of rates v."""
        from scipy.sparse import diags
        from scipy.sparse.linalg import splu

        matrix, momenta = self._massive(now, factors, v)
        unknowns, size = self.system.equations.unknowns, self.system.total
        mass = np.abs(matrix.diagonal()[:unknowns])
        # What is light beside another body is not made heavier by what has no mass of its own.
        largest = np.full(int(self.bodies.max(initial=0)) + 1, TINY)
        np.maximum.at(largest, self.bodies[:unknowns], mass)
        soft = np.zeros(size)
        soft[:unknowns] = np.maximum(MASSLESS * largest[self.bodies[:unknowns]] - mass, SOFT * mass)
        dual = np.zeros(size)
        dual[unknowns:] = DUAL / largest[self.bodies[unknowns:]]
        whole = (matrix + diags(soft)).tocsc()
        own = splu((whole - diags(dual)).tocsc())

        def solve(right: Array) -> Array:
            found = own.solve(right)
            for _ in range(REFINED):
                found = found + own.solve(right - whole @ found)
            return np.asarray(found)

        return solve, momenta


def bodies_of(pattern: ca.Sparsity) -> Index:
    """Number of the body of each row (n,) of a matrix: what its entries couple is one."""
    from scipy.sparse.csgraph import connected_components

    return np.asarray(connected_components(ca.DM(pattern, 1.0).sparse(), directed=False)[1])


def factored(matrix: Sparse) -> Any:
    """Factors of a matrix in the order that it has; what turns without inertia and stiffness gets a little of it."""
    from scipy.sparse import identity
    from scipy.sparse.linalg import splu

    try:
        return splu(matrix, permc_spec="NATURAL")
    except RuntimeError:
        soft = MASSLESS * float(np.abs(matrix.diagonal()).max(initial=TINY))
        return splu((matrix + soft * identity(matrix.shape[0])).tocsc(), permc_spec="NATURAL")
