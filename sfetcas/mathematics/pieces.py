"""Nonlinear programs assembled from pieces: many instances of small functions of few unknowns each.

    minimise  sum of costs(w, c),    lower <= rows(w, c) <= upper,    w some of the unknowns, c constants

An equilibrium of each case, a step of each interval, a user's expression: all are pieces.  A piece is differentiated
once, symbolically, and mapped over all its instances; constant sparse matrices put the entries where they belong.  So
derivatives are exact, and what it costs to make them does not grow with the number of instances.  Unknowns and rows
have units: the solver sees numbers near one.  This module knows no mechanics.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, Index
from .constants import sparse, times
from .kernels import Kernels, chosen
from .linear import places_of
from .nlp import NLP

__all__ = ["Pieces", "Unknown"]


@dataclass(frozen=True, eq=False)
class Unknown:
    """A block of unknowns.

    Attributes
    ----------
    name : str
    symbol : MX
        Its symbol in expressions, in its own unit.
    index : ndarray of int
        Indices in the vector of all unknowns, in the shape of the block.
    unit : ndarray
        Unit by which each is divided in the program, in the shape of the block.
    low, high : ndarray
        Bounds, in the shape of the block.
    """

    name: str
    symbol: ca.MX
    index: Index
    unit: Array
    low: Array
    high: Array


@dataclass(frozen=True, eq=False)
class _Piece:
    """Instances of one function: unknowns (instances, w), constants (instances, c)."""

    name: str
    function: ca.Function
    index: Index
    constants: Array
    low: Array
    high: Array
    unit: Array
    cost: float
    labels: tuple[str, ...] = ()

    @property
    def instances(self) -> int:
        return len(self.index)

    @property
    def rows(self) -> int:
        return 0 if self.cost else int(self.function.numel_out(0))


class Pieces:
    """A program to which unknowns and pieces are added, then turned into an :class:`~sfetcas.mathematics.nlp.NLP`.

    Attributes and arguments ``x`` are vectors (n,) of all unknowns over their units.

    Parameters
    ----------
    kernels : str
        ``auto``, ``compiled`` or ``interpreted`` derivatives.
    """

    def __init__(self, kernels: Kernels = "auto") -> None:
        self._kernels: Kernels = kernels
        self.blocks: dict[str, Unknown] = {}
        self._guesses: list[Array] = []
        self._pieces: list[_Piece] = []
        self._size = 0

    # -- what it is made of -------------------------------------------------------------------------

    def unknowns(
        self,
        name: str,
        guess: ArrayLike,
        low: ArrayLike = -np.inf,
        high: ArrayLike = np.inf,
        unit: ArrayLike = 1.0,
        symbol: ca.MX | None = None,
    ) -> Unknown:
        """A block of unknowns in the shape of its guess; bounds and units are broadcast to it.

        A symbol may be there already, as expressions outlive the program they are put into.

        Raises
        ------
        ValueError
            A name that is there already.
        """
        if name in self.blocks:
            raise ValueError(f"unknowns {name!r} are there already")
        start = np.asarray(guess, dtype=float)
        shape = start.shape or (1,)
        low, high, unit = (np.broadcast_to(np.asarray(part, dtype=float), shape) for part in (low, high, unit))
        index = self._size + np.arange(start.size).reshape(shape)
        self._size += start.size
        # A matrix in CasADi's order has the same places as the block's own.
        symbol = ca.MX.sym(name, *shape) if symbol is None else symbol
        block = Unknown(name, symbol, index, unit, low, high)
        self.blocks[name] = block
        self._guesses.append(start.reshape(shape).ravel())
        return block

    def add_rows(
        self,
        name: str,
        function: ca.Function,
        index: Index,
        constants: Array | None = None,
        low: ArrayLike = 0.0,
        high: ArrayLike | None = None,
        unit: ArrayLike = 1.0,
        labels: Sequence[str] = (),
    ) -> None:
        """Add constraints ``low <= function(w, c) <= high`` for each instance; ``== low`` without ``high``.

        Parameters
        ----------
        function : (w, c) -> rows; or (w) -> rows
        index : (instances, w), indices of the unknowns
        constants : (instances, c)
        low, high, unit : broadcast to (instances, rows)
        labels : names of the instances, instead of their numbers
        """
        self._add(name, function, index, constants, low, low if high is None else high, unit, 0.0, labels)

    def add_cost(
        self, name: str, function: ca.Function, index: Index, constants: Array | None = None, weight: float = 1.0
    ) -> None:
        """Add the cost ``weight * sum of function(w, c)``; index is (instances, w), constants (instances, c)."""
        self._add(name, function, index, constants, 0.0, 0.0, 1.0, weight)

    def add_expression(
        self, name: str, expression: ca.MX, low: ArrayLike = 0.0, high: ArrayLike | None = None, unit: ArrayLike = 1.0
    ) -> None:
        """Add constraints on an expression (rows,) in symbols of the unknowns; bounds and units are broadcast to it."""
        function, index = self.function_of(name, expression)
        self.add_rows(name, function, index, None, low, high, unit)

    def add_term(self, name: str, expression: ca.MX, weight: float = 1.0) -> None:
        """Add a cost that is an expression in symbols of the unknowns."""
        function, index = self.function_of(name, expression)
        self.add_cost(name, function, index, weight=weight)

    def function_of(self, name: str, expression: ca.MX) -> tuple[ca.Function, Index]:
        """An expression in symbols of unknowns as a function of these, and their indices (1, w).

        Raises
        ------
        ValueError
            It has a symbol that stands for no unknown.
        """
        known = {block.symbol.__hash__(): block for block in self.blocks.values()}
        symbols = ca.symvar(expression)
        strange = [symbol.name() for symbol in symbols if symbol.__hash__() not in known]
        if strange:
            raise ValueError(f"{name}: found the symbol {strange[0]!r}, which stands for no unknown of this problem")
        blocks = [known[symbol.__hash__()] for symbol in symbols]
        # Only the numbers that it depends on: a sum over a long block may read one of them.
        whole = ca.vertcat(ca.MX(0, 1), *(ca.vec(symbol) for symbol in symbols))
        places = np.concatenate([np.zeros(0, np.intp), *(block.index.ravel(order="F") for block in blocks)])
        reads = ca.Function("reads", symbols, [ca.densify(ca.vec(expression))])
        pattern = ca.jacobian_sparsity(ca.densify(ca.vec(expression)), whole) if symbols else ca.Sparsity(1, 0)
        used = np.unique(np.array(pattern.get_col(), dtype=np.intp))
        w = ca.MX.sym("w", len(used))
        full = ca.MX(len(places), 1)
        full[used.tolist()] = w
        bounds = np.cumsum([0, *(symbol.numel() for symbol in symbols)]).tolist()
        parts = ca.vertsplit(full, bounds) if symbols else []
        values = reads.call([ca.densify(ca.reshape(p, *s.shape)) for p, s in zip(parts, symbols, strict=True)])
        return ca.Function("expression", [w], values), places[used][None, :]

    def _add(
        self,
        name: str,
        function: ca.Function,
        index: Index,
        constants: Array | None,
        low: ArrayLike,
        high: ArrayLike,
        unit: ArrayLike,
        cost: float,
        labels: Sequence[str] = (),
    ) -> None:
        index = np.asarray(index, dtype=np.intp)
        given = np.zeros((len(index), 0)) if constants is None else np.asarray(constants, dtype=float)
        shape = (len(index), 0 if cost else function.numel_out(0))
        a, b, each = (np.broadcast_to(np.asarray(part, dtype=float), shape) for part in (low, high, unit))
        self._pieces.append(_Piece(name, function, index, given, a, b, each, cost, tuple(labels)))

    # -- what may change without the program being made again ----------------------------------------

    def set_constants(self, name: str, constants: Array) -> None:
        """Replace the constants (instances, c) of a piece, given by its name."""
        at = next(i for i, piece in enumerate(self._pieces) if piece.name == name)
        self._pieces[at] = replace(self._pieces[at], constants=np.asarray(constants, dtype=float))

    # -- what stands where --------------------------------------------------------------------------

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self._size

    def _flat(self, key: str) -> Array:
        parts = [getattr(block, key).ravel() for block in self.blocks.values()]
        return np.concatenate([np.zeros(0), *parts])

    @property
    def units(self) -> Array:
        """Units of all unknowns, (n,)."""
        return self._flat("unit")

    @property
    def guess(self) -> Array:
        """Start values of all unknowns, (n,), in their own units."""
        return np.concatenate([np.zeros(0), *self._guesses])

    def constants(self) -> Array:
        """Constants of all pieces, flat: the parameters of the program."""
        return np.concatenate([np.zeros(0), *(piece.constants.ravel() for piece in self._pieces)])

    def value(self, block: Unknown, x: Array) -> Array:
        """The values of a block in a solution x of the program, in the shape and units of the block."""
        return np.asarray(x[block.index] * block.unit)

    def row_names(self) -> list[str]:
        """A name for each constraint row."""
        names = []
        for _, where, rows in self._instances():
            names += [f"{where}.{k}" for k in range(rows)] if rows > 1 else [where] * rows
        return names

    def violated(self, nlp: NLP, x: Array) -> list[tuple[str, float]]:
        """Constraints that x violates: names of their pieces and violations over their units, the worst first."""
        values = np.array(ca.Function("rows", [nlp.x, nlp.p], [nlp.g])(x, nlp.p_value)).ravel()
        off = np.maximum(np.maximum(nlp.lower - values, values - nlp.upper), 0.0)
        off = np.where(np.isfinite(off), off, np.inf)
        worst: dict[str, float] = {}
        for (piece, _), amount in zip(self.row_owners(), off.tolist(), strict=True):
            if amount > FEASIBLE:
                worst[piece] = max(worst.get(piece, 0.0), amount)
        return sorted(worst.items(), key=lambda item: -item[1])

    def row_owners(self) -> list[tuple[str, str]]:
        """For each constraint row the name of its piece and the label of its instance."""
        return [(name, where) for name, where, rows in self._instances() for _ in range(rows)]

    def _instances(self) -> Iterator[tuple[str, str, int]]:
        """Of each instance the piece, what it is called, and its rows."""
        for piece in self._pieces:
            for i in range(piece.instances):
                where = f"{piece.name}[{i}]" if piece.instances > 1 else piece.name
                yield piece.name, piece.labels[i] if piece.labels else where, piece.rows

    # -- the program ----------------------------------------------------------------------------------

    def nlp(self) -> NLP:
        """The nonlinear program, with unknowns and rows over their units."""
        x, p = ca.MX.sym("x", self._size), ca.MX.sym("p", len(self.constants()))
        units, made = self.units, [_Derived(piece, self._kernels) for piece in self._pieces]
        bounds = np.cumsum([0, *(piece.constants.size for piece in self._pieces)]).tolist()
        parts = ca.vertsplit(p, bounds) if self._pieces else []
        arguments = []
        scaled = ca.DM(units) * x
        for piece, part in zip(self._pieces, parts, strict=True):
            w = ca.reshape(scaled[piece.index.ravel().tolist()], piece.index.shape[1], piece.instances)
            arguments.append((w, ca.reshape(part, piece.constants.shape[1], piece.instances)))
        costs = [i for i, piece in enumerate(self._pieces) if piece.cost]
        rows = [i for i, piece in enumerate(self._pieces) if not piece.cost]
        f, gradient = ca.MX(0), ca.MX.zeros(self._size)
        for i in costs:
            value, slope = made[i].first(*arguments[i])
            f += self._pieces[i].cost * ca.sum2(value)
            gradient += times(self._onto(i), ca.vec(slope)) * self._pieces[i].cost
        lower = np.concatenate([np.zeros(0), *((self._pieces[i].low / self._pieces[i].unit).ravel() for i in rows)])
        upper = np.concatenate([np.zeros(0), *((self._pieces[i].high / self._pieces[i].unit).ravel() for i in rows)])
        found = [made[i].first(*arguments[i]) for i in rows]
        scales = [ca.DM(1.0 / self._pieces[i].unit.ravel()) for i in rows]
        g = ca.vertcat(ca.MX(0, 1), *(s * ca.vec(values) for s, (values, _) in zip(scales, found, strict=True)))
        jacobian = self._jacobian(rows, [made[i] for i in rows], [entries for _, entries in found], len(lower))

        def hessian(weight: ca.MX, multipliers: ca.MX) -> ca.MX:
            return self._hessian(made, arguments, rows, scales, weight, multipliers)

        return NLP(
            x=x,
            p=p,
            f=ca.densify(f),
            g=g,
            lower=lower,
            upper=upper,
            x_lower=self._flat("low") / units,
            x_upper=self._flat("high") / units,
            guess=self.guess / units,
            p_value=self.constants(),
            rows=tuple(self.row_names()),
            gradient=gradient,
            jacobian=jacobian,
            hessian=hessian,
        )

    def _onto(self, number: int) -> ca.DM:
        """What takes slopes by the unknowns of a piece to all unknowns."""
        at = self._pieces[number].index.ravel()
        return sparse(at, np.arange(len(at)), self.units[at], (self._size, len(at)))

    def _jacobian(self, rows: Sequence[int], made: Sequence[_Derived], entries: Sequence[ca.MX], total: int) -> ca.MX:
        row, column, weight, first = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)], [np.zeros(0)], 0
        for i, one in zip(rows, made, strict=True):
            piece = self._pieces[i]
            r, c = one.pattern
            own = first + (np.arange(piece.instances) * piece.rows)[:, None] + r
            at = piece.index[:, c]
            row.append(own.ravel())
            column.append(at.ravel())
            unit = piece.unit[:, r]
            weight.append((self.units[at] / unit).ravel())
            first += piece.instances * piece.rows
        flat = ca.vertcat(ca.MX(0, 1), *(ca.vec(part) for part in entries))
        return _summed((total, self._size), np.concatenate(row), np.concatenate(column), np.concatenate(weight), flat)

    def _hessian(
        self,
        made: Sequence[_Derived],
        arguments: Sequence[tuple[ca.MX, ca.MX]],
        rows: Sequence[int],
        scales: Sequence[ca.DM],
        weight: ca.MX,
        multipliers: ca.MX,
    ) -> ca.MX:
        parts, row, column, value = [], [np.zeros(0, np.intp)], [np.zeros(0, np.intp)], [np.zeros(0)]
        cut = np.cumsum([0, *(self._pieces[i].instances * self._pieces[i].rows for i in rows)]).tolist()
        of_rows = dict(zip(rows, ca.vertsplit(multipliers, cut) if rows else [], strict=True))
        unit = dict(zip(rows, scales, strict=True))
        for i, (piece, one) in enumerate(zip(self._pieces, made, strict=True)):
            if piece.cost:
                lam = ca.repmat(piece.cost * weight, 1, piece.instances)
            else:
                lam = ca.reshape(unit[i] * of_rows[i], piece.rows, piece.instances)
            a, b = one.bends
            if not len(a):
                continue
            parts.append(ca.vec(one.second(*arguments[i], lam)))
            at = piece.index[:, a], piece.index[:, b]
            row.append(np.minimum(*at).ravel())
            column.append(np.maximum(*at).ravel())
            # What stands twice in an instance is met on the diagonal from both sides.
            twice = 1.0 + ((at[0] == at[1]) & (a != b))
            value.append((twice * self.units[at[0]] * self.units[at[1]]).ravel())
        upper = _summed(
            (self._size, self._size),
            np.concatenate(row),
            np.concatenate(column),
            np.concatenate(value),
            ca.vertcat(ca.MX(0, 1), *parts),
        )
        return ca.triu2symm(upper)


ITERATIONS = 50.0
"""Iterations that are expected, by which ``auto`` chooses kernels."""

FEASIBLE = 1e-8
"""By how much rows may miss their bounds, over their units."""


def _summed(shape: tuple[int, int], row: Index, column: Index, weight: Array, entries: ca.MX) -> ca.MX:
    """A sparse matrix of entries by their places, those at one place added up."""
    cells, inverse = np.unique(column * shape[0] + row, return_inverse=True)
    sums = sparse(inverse.ravel(), np.arange(len(row)), weight, (len(cells), len(row)))
    starts = np.searchsorted(cells // shape[0], np.arange(shape[1] + 1))
    pattern = ca.Sparsity(*shape, starts.tolist(), (cells % shape[0]).tolist())
    return ca.MX(pattern, ca.mtimes(sums, entries)) if len(cells) else ca.MX(*shape)


class _Derived:
    """Derivatives of a piece, mapped over its instances."""

    def __init__(self, piece: _Piece, kernels: Kernels) -> None:
        self._piece, self._kernels = piece, kernels
        function = piece.function
        try:
            function = function.expand()
            kind: Any = ca.SX
        except RuntimeError:
            # What solves or branches stays as it is.
            kind = ca.MX
        self._w, self._c = kind.sym("w", piece.index.shape[1]), kind.sym("c", piece.constants.shape[1])
        given = [self._w, self._c] if function.n_in() > 1 else [self._w]
        self._value = ca.densify(ca.vec(function.call(given)[0]))
        self._kind = kind

    def _mapped(self, name: str, arguments: list[Any], results: list[Any]) -> ca.Function:
        function = ca.Function(name, arguments, results)
        # Names of compiled functions tell their content only.
        return chosen(function, ITERATIONS * self._piece.instances, self._kernels).map(self._piece.instances)

    @functools.cached_property
    def _jacobian(self) -> Any:
        return ca.jacobian(self._value, self._w)

    @functools.cached_property
    def pattern(self) -> tuple[Index, Index]:
        """Rows and columns of the first derivatives that are not zero."""
        return places_of(self._jacobian.sparsity())

    @functools.cached_property
    def _first(self) -> ca.Function:
        slopes = ca.densify(self._jacobian.T) if self._piece.cost else self._jacobian.nz[:]
        return self._mapped("piece_first", [self._w, self._c], [self._value, slopes])

    def first(self, w: ca.MX, c: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Values and first derivatives of all instances, columns."""
        values, slopes = self._first(w, c)
        return values, slopes

    @functools.cached_property
    def _second(self) -> Any:
        lam = self._kind.sym("lam", self._value.numel())
        weighted = ca.dot(lam, self._value)
        return lam, ca.triu(ca.hessian(weighted, self._w)[0])

    @functools.cached_property
    def bends(self) -> tuple[Index, Index]:
        """Rows and columns of the second derivatives that are not zero, upper triangle."""
        return places_of(self._second[1].sparsity())

    @functools.cached_property
    def _bend(self) -> ca.Function:
        lam, matrix = self._second
        return self._mapped("piece_second", [self._w, self._c, lam], [matrix.nz[:]])

    def second(self, w: ca.MX, c: ca.MX, lam: ca.MX) -> ca.MX:
        """Second derivatives of all instances times multipliers (rows, instances), columns."""
        return self._bend(w, c, lam)
