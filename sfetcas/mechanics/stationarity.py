"""Residual and Newton matrix of a model at a state, as CasADi expressions.

The equations are those of :class:`~sfetcas.mechanics.equations.Equations`; tests compare the two.
"""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np

from ..mathematics.arrays import Index
from ..mathematics.constants import picked, sparse, times
from .expressions import Expressions, Given
from .tables import Places
from .terms import pulls_of, rotation_forces, rotation_gradient

__all__ = ["Forces", "Stationarity", "summed"]


class Forces:
    """Additional forces on a state: on places (places * axes,) as a residual, and pulls on the points of elements."""

    def __init__(self, on_places: ca.MX | float = 0.0, pull: ca.MX | float = 0.0) -> None:
        self.on_places, self.pull = on_places, pull


class Stationarity:
    """Residual and entries of one state.

    Parameters
    ----------
    entries : bool
        Whether matrix entries are built; without them the expression graph of the residual is shorter.

    Attributes
    ----------
    residual : MX (unknowns + rows,)
    entries : list of MX
        In the order of :attr:`~sfetcas.mechanics.tables.Tables.static`.
    shares : list of (Index, MX)
        For each group of terms the full coordinates of its sides, and the forces and moments that it takes from them.
    on_places : MX
        Dead forces on places, as a residual.
    rotation_jacobian : MX (axes, turns * nodes of elements)
        Derivatives of the chords of elements by rotations of their nodes.
    """

    def __init__(
        self,
        expressions: Expressions,
        q: ca.MX,
        y: ca.MX,
        lam: ca.MX,
        given: Given,
        unwrapped: ca.MX,
        forces: Forces | None = None,
        *,
        entries: bool = True,
    ) -> None:
        forces, self._expressions = forces or Forces(), expressions
        model, tables = expressions.model, expressions.tables
        self._lam, self._given, self._further = lam[: len(model.positions.rows), :], given, forces
        places, self._closed = expressions.retained_places(y, given), expressions.open_gaps(y, given)
        self.shares: list[tuple[Index, ca.MX]] = []
        self.entries: list[ca.MX] = []
        self.on_places, rows = forces.on_places - given.force, list[tuple[int, ca.MX]]()
        self.rotation_jacobian = ca.MX(expressions.axes, 0)
        self._strings: list[tuple[Index, ca.MX]] = []
        self._along: list[tuple[Index, ca.MX]] = []
        for number, group in enumerate(model.terms):
            n, function = len(group.data), rotation_gradient(group.kind) if entries else rotation_forces(group.kind)
            if not n:
                self.shares.append((tables.sides[number], ca.MX(tables.sides[number].shape[1], 0)))
                continue
            arguments = [
                *expressions.arguments(number, q, places, given, unwrapped),
                expressions.multipliers(number, lam),
            ]
            if number == 0:
                arguments[3] += ca.reshape(ca.MX(forces.pull) + ca.MX.zeros(given.pull.shape), *arguments[3].shape)
            if group.kind.spans or group.kind.pulls:
                elements = group.elements[:, None] + np.arange(group.kind.spans or 1)
                pulls = expressions.many(pulls_of(group.kind), n)(*arguments)
                (self._strings if group.kind.spans else self._along).append((elements, pulls))
            found = expressions.many(function, n)(*arguments)
            gaps, acting, *stiff = found[2:] if entries else found
            self.shares.append((tables.sides[number], acting))
            if number == 0:
                self._closed += times(expressions.closing, ca.vec(gaps))
            elif group.labels.size:
                rows.append((number, ca.vec(gaps)))
            if not entries:
                continue
            self.entries.append(ca.vec(stiff[0]))
            if number == 0:
                self.rotation_jacobian, closed = stiff[1], tables.closed
                rotation_jacobians = picked(ca.vec(self.rotation_jacobian), closed.entry) * ca.DM(closed.value)
                self.entries += [rotation_jacobians, rotation_jacobians]
            elif group.labels.size:
                self.entries += [ca.vec(stiff[1])] * 2
        self._rows = expressions.stacked(rows)

    @property
    def pull(self) -> ca.MX:
        """Minus the internal force at the points of elements, (axes, elements * points)."""
        expressions = self._expressions
        own = ca.reshape(self._given.pull + self._further.pull, expressions.axes, -1)
        constant = expressions.multipliers(0, self._lam)
        each = np.repeat(np.arange(expressions.elements), expressions.points)
        return own + constant[:, each.tolist()]

    @property
    def strings(self) -> ca.MX:
        """What strings between nodes of elements take over from these, as a pull, (axes, elements)."""
        return self._summed(self._strings)

    @property
    def along(self) -> ca.MX:
        """What rings add to these at the starts of elements, as a pull, (axes, elements)."""
        return self._summed(self._along)

    def _summed(self, pulls: list[tuple[Index, ca.MX]]) -> ca.MX:
        expressions = self._expressions
        found = ca.MX(expressions.axes, expressions.elements)
        for elements, pull in pulls:
            n, count = elements.shape
            every = np.repeat(np.arange(n), count)
            onto = sparse(every, elements.ravel(), np.ones(n * count), (n, expressions.elements))
            found += ca.mtimes(pull, onto)
        return found

    def moments(self, nodes: Index) -> ca.MX:
        """Moments (turns, n) that elements, and what acts along them, take from given nodes of elements."""
        expressions = self._expressions
        width = expressions.turns * expressions.points
        own = ca.vec(self.shares[0][1][:width, :])
        for group, (_, values) in zip(expressions.model.terms, self.shares, strict=True):
            if group.kind.along_element:
                cells = (group.elements[:, None] * width + np.arange(width)).ravel()
                onto = sparse(cells, np.arange(len(cells)), np.ones(len(cells)), (own.shape[0], len(cells)))
                own += times(onto, ca.vec(values[:width, :]))
        return ca.reshape(own, expressions.turns, -1)[:, nodes.tolist()]

    def gathered(self, more: list[tuple[Index, ca.MX]]) -> ca.MX:
        """The residual with further forces and moments on sides added."""
        rows = [self._closed, self._rows]
        return self._expressions.gathered([*self.shares, *more], self.on_places, self._lam, rows)

    @functools.cached_property
    def residual(self) -> ca.MX:
        """The residual: out-of-balance moments and forces, then gaps of loop closures and joints."""
        return self.gathered([])


def summed(shape: tuple[int, int], places: Places, entries: ca.MX) -> ca.MX:
    """The sparse matrix of given shape from its entries and their rows, columns, weights and numbers."""
    row, column, weight, entry = places
    cells, inverse = np.unique(column * shape[0] + row, return_inverse=True)
    sums = sparse(inverse.ravel(), entry, weight, (len(cells), entries.shape[0]))
    starts = np.searchsorted(cells // shape[0], np.arange(shape[1] + 1)).tolist()
    return ca.MX(ca.Sparsity(*shape, starts, (cells % shape[0]).tolist()), times(sums, entries))
