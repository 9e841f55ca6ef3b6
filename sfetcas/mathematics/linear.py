"""Sparse symmetric linear systems: solutions, and inertia by factorisation.

Small systems go to LAPACK, larger ones to the solvers that come with CasADi; the pattern is analysed once.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import io

import casadi as ca
import numpy as np

from .. import tolerances
from .arrays import TINY, Array, Index, added, depends, numbers
from .core import Factors, Pivoted, System, core, doubles
from .keeping import kept
from .kernels import Batch

__all__ = [
    "BLURRED",
    "MISSES",
    "NO_ROOM",
    "SOLVED",
    "CoreFactors",
    "CoreSystem",
    "InertiaSolver",
    "Product",
    "SparseMap",
    "SparseSolver",
    "blurred",
    "factor_tables",
    "last_rows",
    "pattern",
    "pivot_order",
    "places_of",
    "smallest",
]

DENSE = 150
"""Up to this size LAPACK on the full matrix is faster than a sparse factorisation (measured)."""


class SparseMap:
    """A constant sparse matrix by its entries; products by ``@``.

    Attributes
    ----------
    row, column, value : ndarray (n,)
        The entries, without repetitions, sorted by rows; of active ones there are no products.
    shape : (int, int)
    """

    def __init__(self, row: Array, column: Array, value: Array, shape: tuple[int, int]) -> None:
        self.shape = shape
        places = np.asarray(row, dtype=np.int64) * shape[1] + column
        if not ((places[1:] > places[:-1]).all() and value.all()):
            places, inverse = np.unique(places, return_inverse=True)
            value = added(np.zeros(len(places)), inverse.ravel(), value)
            keep = value != 0.0
            places, value = places[keep], value[keep]
            row, column = np.divmod(places, max(shape[1], 1))
        self.row, self.column = np.asarray(row, np.intp), np.asarray(column, np.intp)
        self.value = numbers(value)
        # Small matrices are faster in full.
        self._full = self.full() if shape[0] * shape[1] <= FULL and not depends(value) else None

    @functools.cached_property
    def T(self) -> SparseMap:  # noqa: N802 - the name of NumPy
        """The transpose."""
        return SparseMap(self.column, self.row, self.value, (self.shape[1], self.shape[0]))

    @functools.cached_property
    def absolute(self) -> SparseMap:
        """The matrix of the absolute values."""
        return SparseMap(self.row, self.column, np.abs(self.value), self.shape)

    def __matmul__(self, x: Array) -> Array:
        """The product with a vector (columns,) or a block of them (columns, k)."""
        if self._full is not None:
            return np.asarray(self._full @ x)
        if x.ndim == 1:
            return np.bincount(self.row, weights=self.value * x[self.column], minlength=self.shape[0])
        found = np.zeros((self.shape[0], x.shape[1]), dtype=x.dtype)
        rows, starts = np.unique(self.row, return_index=True)
        if len(rows):
            found[rows] = np.add.reduceat(self.value[:, None] * x[self.column], starts, axis=0)
        return found

    def full(self) -> Array:
        """The dense matrix, an array of :attr:`.shape`."""
        matrix = np.zeros(self.shape)
        matrix[self.row, self.column] = self.value
        return matrix

    def rows(self, chosen: Array) -> SparseMap:
        """The matrix of some rows, given by their indices (n,), in that order."""
        chosen = np.asarray(chosen, dtype=np.intp)
        begin, end = np.searchsorted(self.row, chosen), np.searchsorted(self.row, chosen, side="right")
        taken = np.concatenate([np.zeros(0, np.intp), *(np.arange(a, b) for a, b in zip(begin, end, strict=True))])
        new = np.repeat(np.arange(len(chosen)), end - begin)
        return SparseMap(new, self.column[taken], self.value[taken], (len(chosen), self.shape[1]))


FULL = 20_000
"""Up to this many places the product with the full matrix is faster (measured)."""


class Filled:
    """The places of matrices of one pattern at which there has been an entry, and the diagonal.

    Of what terms may give most can be zero, as of elements beyond a place: it would be in all factors.

    Parameters
    ----------
    row, column : ndarray
        Positions of the entries, column by column.
    symmetric : bool
        Whether an entry stands for that across the diagonal, too.

    Attributes
    ----------
    row, column : ndarray
        The places, column by column.
    every : bool
        Whether all places are taken, as there are few.
    grown : bool
        Whether the last matrix has entries elsewhere than those before.
    """

    def __init__(self, row: Array, column: Array, *, symmetric: bool = True) -> None:
        self.row, self.column, self._row, self._column = row, column, row, column
        # Where there are few, looking for zeros costs more than they do.
        self.every, self._known, self.grown = len(row) <= FEW_ENTRIES, row == column, False
        if not self.every:
            self.row, self.column = row[self._known], column[self._known]
            # Rounding may leave a zero on one side of the diagonal alone.
            self._across = np.lexsort((column, row)) if symmetric else np.arange(len(row))

    def taken(self, entries: Array) -> Array:
        """Of the entries of a matrix those at the places."""
        if self.every:
            return entries
        filled = entries != 0.0
        filled |= filled[self._across]
        self.grown = bool((filled & ~self._known).any())
        if self.grown:
            self._known |= filled
            self.row, self.column = self._row[self._known], self._column[self._known]
        return entries[self._known]


FEW_ENTRIES = 50_000
"""Up to so many entries factors with all of them take a millisecond."""


class SparseSolver:
    """Solutions of ``A x = b`` for matrices of one pattern.

    A few constraint rows are eliminated last, with pivoting.  Symmetric matrices with many of them are factorised
    without pivoting after a slight regularisation of the diagonal, whose effect iterative refinement removes; where
    that does not converge the system is solved with pivoting, and refined as well.

    Parameters
    ----------
    n : int
        Size of the matrix.
    row, column : ndarray
        Positions of the entries, column by column, with the whole diagonal.
    rows : int
        Number of multipliers of constraints, the last unknowns, with zero or negative diagonal.
    symmetric : bool
        Whether the matrices are symmetric.
    pivoted : bool
        Whether the core uses pivoting at once.

    Source: Vanderbei 1995 (symmetric quasidefinite matrices have factors in any order).
    """

    def __init__(
        self, n: int, row: Array, column: Array, rows: int = 0, *, symmetric: bool = True, pivoted: bool = False
    ) -> None:
        self.n, self._row, self._column = n, row, column
        self._small, self._few, self._symmetric = n <= DENSE, rows <= FEW_ROWS, symmetric
        self._rows, self._lost = rows, 0
        self._sides = np.repeat([tolerances.SOFT, -tolerances.SOFT], [n - rows, rows])
        self._filled = Filled(row, column, symmetric=symmetric)
        self._core, self._pivoted = core(), pivoted

    def factor(self, entries: Array) -> None:
        """Set the entries of the matrix; it is factorised by the next :meth:`solve`."""
        if self._small:
            self._entries = entries
            return
        self._matrix: Array = self._filled.taken(entries)
        if self._filled.grown:
            self.__dict__.pop("_sparse", None)
            self.__dict__.pop("_system", None)

    @functools.cached_property
    def _system(self) -> CoreSystem:
        return self._of(self._filled.row, self._filled.column)

    def _of(self, row: Array, column: Array) -> CoreSystem:
        assert self._core is not None
        symmetric = self._symmetric and not self._pivoted
        return CoreSystem(self._core, self.n, row, column, self._sides, last_rows(self._rows), symmetric)

    @property
    def of_core(self) -> CoreSystem | None:
        """The system of the core that takes all entries of the pattern; None where there is none."""
        return self._system if self._core is not None and self._filled.every and self.n else None

    @property
    def whole(self) -> CoreSystem | None:
        """As :attr:`of_core`, also where there are many, of which most may be zero, or none."""
        if self._core is None or self.of_core is not None:
            return self.of_core
        return self._of(self._row, self._column)

    @functools.cached_property
    def _sparse(self) -> _Sparse:
        return _Sparse(self.n, self._filled.row, self._filled.column, self._rows)

    def solve(self, b: Array) -> Array:
        """Solution for the matrix set last and right sides b, (n,) or (n, k); not finite for large singular matrices.

        Raises
        ------
        numpy.linalg.LinAlgError
            The matrix is singular.
        """
        if self._core is not None and self.n:
            return self._system.solved(self._entries if self._small else self._matrix, b)
        if self._small:
            full = np.zeros((self.n, self.n))
            full[self._row, self._column] = self._entries
            return np.asarray(np.linalg.solve(full, b))
        columns, sparse = b.reshape(self.n, -1), self._sparse
        if self._few:
            return sparse.rows_last.solve(self._matrix, columns).reshape(b.shape)
        x, error = np.full(columns.shape, np.nan), np.inf
        if self._symmetric and self._lost < OFTEN:
            soft = self._matrix.copy()
            soft[sparse.diagonal] += self._sides
            x, error = self._refined(sparse.without_pivots, soft, columns)
            self._lost = 0 if error <= SOLVED else self._lost + 1
        if not error <= SOLVED:
            other, least = self._refined(sparse.with_pivots, self._matrix, columns)
            x = other if not error <= least else x
        return x.reshape(b.shape)

    def _refined(self, factors: _Factors, near: Array, b: Array) -> tuple[Array, float]:
        """Solution (n, k) by refinement with the factors of a near matrix, and its residual as that of SOLVED."""
        size, most = float(np.abs(self._matrix).max()), np.abs(b).max(axis=0)
        x, left = np.zeros(b.shape), b
        best, last = np.full(b.shape, np.nan), np.inf
        for _ in range(ROUNDS):
            x = x + factors.solve(near, left)
            if not np.isfinite(x).all():
                break
            left = b - self._sparse.product(self._matrix, x)
            error = float((np.abs(left).max(axis=0) / (size * np.abs(x).max(axis=0) + most + TINY)).max())
            if not error < last:
                break
            gained, best, last = last > 4.0 * error, x, error
            if error <= NOTHING_TO_GAIN or not gained:
                break
        return best, last


class _Sparse:
    """A pattern of a :class:`SparseSolver`: where the diagonal is, products, and factors."""

    def __init__(self, n: int, row: Array, column: Array, rows: int) -> None:
        self._n, self._row, self._column, self._rows = n, row, column, rows
        self.diagonal = np.flatnonzero(row == column)

    @functools.cached_property
    def product(self) -> Product:
        return Product(self._n, self._row, self._column)

    @functools.cached_property
    def without_pivots(self) -> _Factors:
        return _Factors("ldl", self._n, self._row, self._column)

    @functools.cached_property
    def with_pivots(self) -> _Factors:
        return _Factors("csparse", self._n, self._row, self._column)

    @functools.cached_property
    def rows_last(self) -> _Factors:
        return _Factors("csparse", self._n, self._row, self._column, self._rows)


def _unsaid() -> contextlib.redirect_stderr[io.StringIO]:
    """Where factors break down: an error or what is left says so, users have no use for CasADi's warning before it."""
    return contextlib.redirect_stderr(io.StringIO())


class Product:
    """Products of (n, n) matrices of one pattern with blocks of vectors.

    Parameters
    ----------
    n : int
    row, column : ndarray
        Positions of the entries.
    """

    def __init__(self, n: int, row: Array, column: Array) -> None:
        self._n, self._row, self._column = n, row, column

    def __call__(self, entries: Array, x: Array) -> Array:
        """The matrix with these entries times x (n, k)."""
        found = [np.bincount(self._row, weights=entries * part[self._column], minlength=self._n) for part in x.T.copy()]
        return np.array(found).T.copy()


class _Factors:
    """Solutions by one of CasADi's linear solvers, the unknowns in an order that keeps the factors sparse.

    The ``last`` unknowns, whose diagonal is no pivot, are left to the end.
    """

    def __init__(self, plugin: str, n: int, row: Array, column: Array, last: int = 0) -> None:
        self._plugin = plugin
        self._order = _sparse_order(n, row, column, last)
        place = np.argsort(self._order)
        row, column = place[row], place[column]
        self._entries = np.lexsort((row, column))
        self._sparsity = pattern(n, row[self._entries], column[self._entries])

    def solve(self, entries: Array, b: Array) -> Array:
        """Solution for b (n, k).

        Raises
        ------
        numpy.linalg.LinAlgError
            The matrix is singular.
        """
        batch = self._batch(b.shape[1])
        batch.set(0, entries[self._entries])
        batch.set(1, b[self._order].T)
        x = np.empty(b.shape)
        # What fails without a word leaves no numbers.
        batch.results[0][...] = np.nan
        try:
            with _unsaid():
                x[self._order] = batch()[0].reshape(b.T.shape).T
        except RuntimeError:
            raise np.linalg.LinAlgError("singular matrix") from None
        return x

    @kept(4)
    def _batch(self, columns: int) -> Batch:
        """The solution as a function, which takes and gives arrays without copies."""
        entries, b = ca.MX.sym("entries", self._sparsity.nnz()), ca.MX.sym("b", self._sparsity.size1(), columns)
        x = ca.densify(ca.solve(ca.MX(self._sparsity, entries), b, self._plugin))
        return Batch(ca.Function("solve", [entries, b], [x]), 1)


FEW_ROWS = 12
"""Up to this many constraints factors with pivots are as fast (measured)."""

ROUNDS = 8
"""Rounds of refinement at most; usual are three."""

NOTHING_TO_GAIN = 1e-16
"""Residual, relative to matrix times solution, at which refinement ends."""

SOLVED = 1e-13
"""Residual, relative to matrix times solution, up to which a solution is accepted."""

OFTEN = 2
"""Matrices of a pattern, one after the other, that need pivoting, from which on all of it are solved so at once."""


def pattern(n: int, row: Array, column: Array) -> ca.Sparsity:
    """CasADi sparsity of an (n, n) matrix from rows and columns of its entries, column by column."""
    return ca.Sparsity(n, n, np.searchsorted(column, np.arange(n + 1)).tolist(), row.tolist())


def places_of(sparsity: ca.Sparsity) -> tuple[Index, Index]:
    """Rows and columns (entries,) of a CasADi sparsity, column by column."""
    row, column = sparsity.get_triplet()
    return np.array(row, dtype=np.intp), np.array(column, dtype=np.intp)


def blurred(row: Array, column: Array, entries: Array, vectors: Array) -> Array:
    """Bounds (k,) on the rounding errors of ``x^T A x`` for columns x (n, k), from rounding of the entries of A."""
    sizes, size = np.abs(vectors), np.abs(entries)
    return np.array([ENTRY * float((size * x[row]) @ x[column]) for x in sizes.T])


ENTRY = 5e-16
"""Rounding of an entry, relative to itself."""


def smallest(rows: SparseMap, right: Array, weights: Array) -> tuple[Array, Array]:
    """Solution x (columns,) of ``rows @ x = right`` with the smallest sum of ``weights * x**2``, and its multipliers.

    Rows may be linearly dependent if their right sides are consistent.  They are regularised slightly, and a few rounds
    of an augmented Lagrangian remove the effect: ``weights * x + rows.T @ multipliers`` is zero.
    """
    m, n = rows.shape
    places = np.concatenate([np.arange(n + m), rows.column, n + rows.row])
    others = np.concatenate([np.arange(n + m), n + rows.row, rows.column])
    entries = np.concatenate([weights, np.full(m, -YIELDING), rows.value, rows.value])
    order = np.lexsort((places, others))
    solver = SparseSolver(n + m, places[order], others[order], m)
    solver.factor(entries[order])
    x, multipliers = np.zeros(n), np.zeros(m)
    for _ in range(ROUNDS):
        missing = right - rows @ x
        step = solver.solve(np.concatenate([-weights * x - rows.T @ multipliers, missing]))
        x, multipliers = x + step[:n], multipliers + step[n:]
        if np.abs(missing).max(initial=0.0) <= SOLVED * np.abs(right).max(initial=0.0):
            break
    return x, multipliers


YIELDING = 1e-3
"""Softness of rows over that of weights of 1: each round leaves this share of what is missing, or less."""


class CoreFactors:
    """Factors by the core of symmetric matrices of one pattern, without pivoting.

    Parameters
    ----------
    library : CDLL
        The core.
    n : int
    row, column : ndarray
        Positions of the entries, column by column, on both sides of the diagonal.

    Attributes
    ----------
    tables : list of ndarray
        Of the matrix: where columns start, rows of entries; the order in which unknowns are eliminated, its inverse.
    address : int
        Where the core finds them.
    """

    def __init__(self, library: ctypes.CDLL, n: int, row: Array, column: Array) -> None:
        self._library = library
        self.tables = tables = factor_tables(n, row, column)
        # One piece of memory of each kind: of many small ones each would take as long.
        self._memory = whole, numbers = np.zeros(5 * n + 1, np.intc), np.zeros(2 * n)
        parent, mark, path, used, lower = _parts_of(whole, n, 5)
        pivot, column_ = _parts_of(numbers, n, 2)
        known = [part.ctypes.data for part in tables]
        self._factors = Factors(n, len(row), *known, 0, parent, lower, 0, 0, pivot, mark, path, used, column_)
        self.address = ctypes.addressof(self._factors)
        library.sf_count(self.address)
        filled = self._factors.filled
        self._lower = (np.zeros(filled, np.intc), np.zeros(filled))
        self._factors.lower_row, self._factors.value = (part.ctypes.data for part in self._lower)
        self._work, self._negative = np.zeros(n), ctypes.c_int()

    def factor(self, entries: Array) -> int:
        """Factorise the matrix with these entries; the number of its negative eigenvalues.

        Raises
        ------
        numpy.linalg.LinAlgError
            A pivot is zero, or not finite.
        """
        entries = doubles(entries)
        if self._library.sf_factorise(self.address, entries.ctypes.data, ctypes.addressof(self._negative)):
            raise np.linalg.LinAlgError("no factors without pivots")
        return self._negative.value

    def solve(self, b: Array) -> Array:
        """Solution (n, k) for the matrix that was factorised last."""
        x = b.T.copy()
        self._library.sf_backward(self.address, len(x), x.ctypes.data, self._work.ctypes.data)
        return x.T


class CoreSystem:
    """Solutions by the core for matrices of one pattern, as :class:`SparseSolver` says.

    Parameters
    ----------
    library, n, row, column
        As of :class:`CoreFactors`; a matrix that is not symmetric need not have entries on both sides.
    soft : ndarray (n,)
        What is added to the diagonal of symmetric matrices for factors without pivoting.
    last : int
        Unknowns that are eliminated last where there is pivoting.
    symmetric : bool

    Attributes
    ----------
    address : int
        Where the core finds it.
    order : ndarray (n,)
        In which unknowns are eliminated with pivots.
    """

    def __init__(
        self, library: ctypes.CDLL, n: int, row: Array, column: Array, soft: Array, last: int, symmetric: bool
    ) -> None:
        self._library, self._n, self._soft = library, n, doubles(soft)
        self._factors = CoreFactors(library, n, row, column)
        self.order = order = pivot_order(n, row, column, last)
        self._whole, self._numbers = np.zeros(8 * n + 2, np.intc), np.zeros(6 * n)
        self._room = 0
        start, rows = self._factors.tables[:2]
        places, numbers = _parts_of(self._whole, n, 8), _parts_of(self._numbers, n, 2)
        # The last two have one entry more than the others.
        places[-1] += self._whole.itemsize
        known = [start.ctypes.data, rows.ctypes.data, order.ctypes.data]
        arrays = zip(PIVOTED, [*known, *places, *numbers], strict=True)
        self._pivoted = Pivoted(n=n, **dict(arrays))
        self.make_room(8 * len(row) + 2 * n)
        addresses = (self._factors.address, ctypes.addressof(self._pivoted), self._soft.ctypes.data)
        self._system = System(*addresses, int(symmetric), 0, OFTEN, SOLVED)
        self.address = ctypes.addressof(self._system)
        self._work = self._numbers[2 * n :]

    def make_room(self, room: int = 0) -> None:
        """Room for factors with pivots; by default twice as much as there is."""
        self._room = room or 2 * self._room
        room = self._room
        self._memory = whole, numbers = np.empty(2 * room, np.intc), np.empty(2 * room)
        pivoted = self._pivoted
        pivoted.room = room
        pivoted.lower_row, pivoted.upper_row = _parts_of(whole, room, 2)
        pivoted.lower_value, pivoted.upper_value = _parts_of(numbers, room, 2)

    @property
    def pivots(self) -> Array | None:
        """The pivots of the last factors with pivoting, see ``sf_pivots``; None where there are none."""
        address = ctypes.addressof(self._pivoted)
        found = np.zeros(self._library.sf_pivots(address, None), np.intc)
        return found if self._library.sf_pivots(address, found.ctypes.data) else None

    def solved(self, entries: Array, b: Array) -> Array:
        """Solution for b (n,) or (n, k).

        Raises
        ------
        numpy.linalg.LinAlgError
            The matrix is singular.
        """
        entries, right = doubles(entries), doubles(b.T)
        x, count = np.empty(right.shape), 1 if b.ndim == 1 else b.shape[1]
        # Pivots of another matrix would leave other last digits.
        self._pivoted.known = 0
        while True:
            handed = (entries.ctypes.data, count, right.ctypes.data, x.ctypes.data, self._work.ctypes.data)
            broken = self._library.sf_solve(self.address, *handed)
            if broken == NO_ROOM:
                self.make_room()
                continue
            if broken:
                raise np.linalg.LinAlgError("singular matrix")
            return x.T


def factor_tables(n: int, row: Array, column: Array) -> list[Array]:
    """What factors without pivoting take: the ``tables`` of :class:`CoreFactors`."""
    order = _sparse_order(n, row, column).astype(np.intc)
    start = np.searchsorted(column, np.arange(n + 1)).astype(np.intc)
    return [start, np.ascontiguousarray(row, dtype=np.intc), order, np.argsort(order).astype(np.intc)]


def pivot_order(n: int, row: Array, column: Array, last: int) -> Array:
    """The order (n,) in which unknowns are eliminated where there is pivoting, with the last of them at the end."""
    return _sparse_order(n, row, column, last).astype(np.intc)


def last_rows(rows: int) -> int:
    """How many of the multipliers are eliminated last: few of them."""
    return rows if rows <= FEW_ROWS else 0


def _parts_of(array: Array, size: int, count: int) -> list[int]:
    """Where the first of so many parts of an array begin, each of a size."""
    begin, step = int(array.ctypes.data), size * array.itemsize
    return [begin + k * step for k in range(count)]


# fmt: off
PIVOTED = (
    "start", "row", "order", "place", "row_of", "mark", "reached", "stack", "at", "lower", "upper", "pivot", "x",
)
# fmt: on
"""Arrays of factors with pivots whose size is known."""

NO_ROOM = 2
"""What the core returns where factors need more memory."""


def _sparse_order(n: int, row: Array, column: Array, last: int = 0) -> Index:
    """The unknowns (n,) in an order that keeps factors sparse; the ``last`` ones, which may be no pivots, last."""
    kept = _kept_order if len(row) <= FEW_ENTRIES else _kept_large_order
    return kept(n, np.asarray(row, np.intc).tobytes(), np.asarray(column, np.intc).tobytes(), last)


def _order(n: int, row: bytes, column: bytes, last: int) -> Index:
    return _found_order(n, np.frombuffer(row, np.intc), np.frombuffer(column, np.intc), last)


_kept_order, _kept_large_order = functools.lru_cache(maxsize=128)(_order), functools.lru_cache(maxsize=4)(_order)
"""Orders of small patterns, which come many times, and of the last large ones, of which factors of several kinds are
made.
"""


def _found_order(n: int, row: Array, column: Array, last: int) -> Index:
    first = (row < n - last) & (column < n - last)
    own = pattern(n - last, row[first], column[first])
    return np.append(np.array((own + own.T).amd(), dtype=np.intp), np.arange(n - last, n))


class InertiaSolver:
    """Factors that count negative eigenvalues of symmetric matrices of one pattern.

    All methods raise numpy.linalg.LinAlgError where the factorisation breaks down.

    Parameters
    ----------
    n, row, column
        As of :class:`SparseSolver`.
    """

    def __init__(self, n: int, row: Array, column: Array) -> None:
        self._n, self._filled, self._core = n, Filled(row, column), core()

    @functools.cached_property
    def _factors(self) -> CoreFactors:
        assert self._core is not None
        return CoreFactors(self._core, self._n, self._filled.row, self._filled.column)

    def factor(self, entries: Array) -> None:
        """Factorise the matrix with these entries."""
        taken = self._filled.taken(entries)
        for name in ("_solver", "_sparsity", "_factors") if self._filled.grown else ():
            self.__dict__.pop(name, None)
        if self._core is not None:
            self._taken, self._negative = taken, self._factors.factor(taken)
            return
        self._matrix = ca.DM(self._sparsity, taken)
        try:
            with _unsaid():
                self._solver.nfact(self._matrix)
        except RuntimeError:
            raise np.linalg.LinAlgError("no factors without pivots") from None

    @functools.cached_property
    def _sparsity(self) -> ca.Sparsity:
        return pattern(self._n, self._filled.row, self._filled.column)

    @functools.cached_property
    def _solver(self) -> ca.Linsol:
        solver = ca.Linsol("inertia", "ldl", self._sparsity)
        solver.sfact(ca.DM(self._sparsity, 1.0))
        return solver

    def negative(self) -> int:
        """Number of negative eigenvalues of the matrix that was factorised last."""
        return self._negative if self._core is not None else int(self._solver.neig(self._matrix))

    def solve(self, b: Array) -> Array:
        """Solution (n, k) for the matrix that was factorised last."""
        if self._core is not None:
            return self._factors.solve(b)
        try:
            with _unsaid():
                return np.asarray(self._solver.solve(self._matrix, ca.DM(b)).full())
        except RuntimeError:
            raise np.linalg.LinAlgError("no factors without pivots") from None

    def missed(self) -> float:
        """What the factors miss of the matrix over the matrix, as refinement shows it: below 1 they count right.

        Not finite where nothing is left of them.
        """
        left, sizes = np.ones((self._n, 1)), [np.inf]
        for _ in range(MISSES):
            left = left - self._times(self.solve(left))
            sizes.append(float(np.linalg.norm(left)))
        return 0.0 if sizes[-1] <= BLURRED * np.sqrt(self._n) else sizes[-1] / max(sizes[-2], TINY)

    def _times(self, x: Array) -> Array:
        if self._core is None:
            return np.asarray(ca.mtimes(self._matrix, ca.DM(x)).full())
        given = self._taken * x[self._filled.column, 0]
        return np.bincount(self._filled.row, weights=given, minlength=self._n)[:, None]


MISSES, BLURRED = 3, 1e-8
"""Rounds after which what is left falls by the largest share that it can; share of the first that can be rounding."""
