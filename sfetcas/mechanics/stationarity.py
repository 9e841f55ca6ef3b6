"""What is out of balance at a state of a model, and the entries of Newton's matrix, as CasADi expressions.

The same equations as in :class:`~sfetcas.mechanics.equations.Equations`, of which the tests make sure.
"""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np

from ..mathematics.arrays import Array, Index
from ..mathematics.constants import sparse, times
from ..mathematics.linear import pattern
from .entries import Entries
from .expressions import Expressions, Given
from .joints import by_turning, forces_by_turning

__all__ = ["Forces", "Stationarity", "StationarityPlaces", "summed"]


class Forces:
    """Further forces on a state: on places (places * axes,) as a residual, and pull on the points of all elements."""

    def __init__(self, on_places: ca.MX | float = 0.0, pull: ca.MX | float = 0.0) -> None:
        self.on_places, self.pull = on_places, pull


class StationarityPlaces:
    """Where the entries of :class:`Stationarity` go, in the order in which it gives them."""

    def __init__(self, expressions: Expressions) -> None:
        self._expressions = expressions
        self.static = Entries(expressions.unknown, expressions.weight)
        static, cells = self.static, expressions.cells
        static.add(cells[:, None, :], cells[:, :, None])
        static.add(expressions.closed.row, expressions.closed.cell)
        static.add(expressions.closed.cell, expressions.closed.row)
        links = zip(expressions.model.connections, expressions.linked, expressions.link_rows, strict=True)
        for group, sides, labels in links:
            static.add(sides[:, None, :], sides[:, :, None])
            if group.rows:
                static.add(labels[:, None, :], sides[:, :, None])
                static.add(sides[:, :, None], labels[:, None, :])
        for rows, columns in expressions.follower_cells():
            static.add(rows, columns)

    @functools.cached_property
    def tied(self) -> tuple[Index, Index, Array, Index]:
        """Row, column, weight and number of the entries, with those of the ties between displacements and closings.

        These are one number, 1, after all others.
        """
        equations, w = self._expressions.equations, self._expressions.model.positions.W
        row, column, value, entry = self.static.places
        r, c = equations.unknowns + w.row, equations.turning_unknowns + w.column
        return (
            np.concatenate([row, r, c]),
            np.concatenate([column, c, r]),
            np.concatenate([value, np.tile(w.value, 2)]),
            np.concatenate([entry, np.full(2 * len(w.value), self.static.count)]),
        )


class Stationarity:
    """Residual and entries of one state.

    Parameters
    ----------
    entries : bool
        Without them derivatives of the residual are short: what gives entries gives their derivatives, too.

    Attributes
    ----------
    residual : MX (unknowns + rows,)
    entries : list of MX
        As :class:`StationarityPlaces` has them, without the last 1.
    moments : MX (turns * nodes of elements,)
        Moments on the nodes of elements.
    shares : list of (Index, MX)
        Full coordinates of the sides of connections, and what these do to them.
    on_places, couples : MX
        Forces on places, as a residual, and moments on rotations, as loads; what follows is as it is there.
    spin : MX (axes, turns * nodes of elements)
        Derivatives of the reaches of elements by rotations of their nodes.
    """

    def __init__(
        self,
        expressions: Expressions,
        q: ca.MX,
        y: ca.MX,
        lam: ca.MX,
        places: ca.MX,
        given: Given,
        near: ca.MX,
        forces: Forces | None = None,
        *,
        entries: bool = True,
    ) -> None:
        forces = forces or Forces()
        self._expressions, self._with_entries = expressions, entries
        model = expressions.model
        closings = len(model.positions.rows)
        self.shares: list[tuple[Index, ca.MX]] = []
        self.entries: list[ca.MX] = []
        on_places = forces.on_places - given.force
        gaps = expressions.open_gaps(y, given)
        turning = -given.moment
        self.spin, self.moments = ca.MX(expressions.axes, 0), ca.MX(0, 1)
        if expressions.elements:
            pull = given.pull + times(expressions.closing.T, lam[:closings, :]) + forces.pull
            self.pull = pull + expressions.carried(q, given)
            self._bent(q, given)
            gaps += times(expressions.closing, ca.vec(expressions.tangents(q, given)) - ca.vec(given.tangent))
            turning += times(expressions.onto_rotations, self.moments)
        rows = [gaps]
        first = closings
        for number, (group, sides) in enumerate(zip(model.connections, expressions.linked, strict=True)):
            n, count = len(group.data), group.kind.sizes[2]
            own = ca.reshape(lam[first : first + n * count], count, n)
            data = *expressions.sides(group, q, places), expressions.data(number, given, near)
            function = by_turning(group.kind) if entries else forces_by_turning(group.kind)
            found = expressions.many(function, n)(*data, expressions.link_load(number, given), own)
            forced, acting, *stiff = found[2:] if entries else found
            self.shares.append((sides, acting))
            self.entries += [ca.vec(one) for one in stiff[:1]]
            if count:
                rows.append(ca.vec(forced))
                self.entries += [ca.vec(one) for one in stiff[1:] * 2]
            first += n * count
        pushed, turned_by, followed = expressions.followed(q, given)
        self.entries += followed
        self.turning, self.on_places = turning + turned_by, on_places + pushed
        self.couples = given.moment - turned_by
        self._lam, self._rows = lam[:closings, :], rows

    def _bent(self, q: ca.MX, given: Given) -> None:
        """Moments of the elements, and their entries."""
        expressions = self._expressions
        model = expressions.model
        arguments = (
            q[:, model.rotations.turns.ravel().tolist()],
            given.stiffness,
            given.tangent,
            ca.reshape(self.pull, expressions.axes, expressions.elements * expressions.points),
        )
        if not self._with_entries:
            self.moments = ca.vec(expressions.many(model.element.moments, expressions.elements)(*arguments))
            return
        found = expressions.many(model.element.turning, expressions.elements)(*arguments)
        self.moments, self.spin = ca.vec(found[2]), found[5]
        closed = ca.vec(self.spin)[expressions.closed.entry.tolist()] * ca.DM(expressions.closed.value)
        self.entries += [ca.vec(found[3]), closed, closed]

    def gathered(self, more: list[tuple[Index, ca.MX]]) -> ca.MX:
        """The residual with further shares on sides."""
        shares = [*self.shares, *more]
        return self._expressions.gathered(self.turning, self.on_places, shares, self._lam, self._rows)

    @functools.cached_property
    def residual(self) -> ca.MX:
        """What is out of balance, and what closings and joints miss."""
        return self.gathered([])


def summed(total: int, places: tuple[Index, Index, Array, Index], entries: ca.MX) -> ca.MX:
    """The matrix (total, total) of entries by their rows, columns, weights and numbers."""
    row, column, weight, entry = places
    cells, inverse = np.unique(column * total + row, return_inverse=True)
    sums = sparse(inverse.ravel(), entry, weight, (len(cells), entries.shape[0]))
    return ca.MX(pattern(total, cells % total, cells // total), ca.mtimes(sums, entries))
