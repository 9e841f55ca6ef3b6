"""Combinations of closings that no unknown changes, to first order: what joints hold twice, and stretched members.

Their multipliers are not determined; :mod:`~sfetcas.solvers.sharing` says which are given.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .. import tolerances
from ..mathematics.arrays import Array
from ..mechanics.equations import Equations, Point, State
from ..mechanics.loading import Loading
from .residuals import relative_residual
from .sharing import shared

__all__ = [
    "changed_by",
    "independent",
    "loose_rows",
    "met",
    "named_in",
    "redundant",
    "rows_in",
    "stretched",
    "with_sharing",
]


def loose_rows(equations: Equations, point: Point, slack: float | None = None) -> Array:
    """Combinations of rows that vanish to first order at this state: orthonormal columns, (rows, n).

    Their singular values are below the share ``slack`` of the largest, without one 1e-6.
    """
    slack = SLACK if slack is None else slack
    if not equations.rows:
        return np.zeros((0, 0))
    # A row that no rotation changes is loose too, also where it is the only one.
    # Without beams rows are of the size of the units of the model.
    usual = float((equations.model.beams.weight**2).sum()) or 1.0
    find = _smallest if equations.rows > MANY else _all_singular
    squares, left, largest = find(equations, point)
    small = left[:, squares < ROUGHLY * max(largest, usual)]
    if not small.size:
        return small
    # Squares are known to rounding of the largest, and sizes to the root of that: what is small is looked at itself.
    changes, count = changed_by(equations, point, small), small.shape[1]
    _, sizes, right = np.linalg.svd(np.pad(changes, ((0, max(0, count - len(changes))), (0, 0))), full_matrices=False)
    return np.asarray(small @ right[sizes < slack * np.sqrt(max(largest, usual))].T)


def independent(equations: Equations, point: Point, among: Array) -> Array:
    """Of a space of combinations of rows, orthonormal columns (rows, n), what has no part in loose ones: (rows, m)."""
    inside = among.T @ loose_rows(equations, point)
    across = np.linalg.qr(inside, mode="complete")[0][:, inside.shape[1] :]
    return np.asarray(among @ across)


def changed_by(equations: Equations, point: Point, ways: Array) -> Array:
    """Change of the unknowns' equations with combinations of rows, columns (rows, k): (unknowns, k)."""
    n = equations.unknowns
    chosen = (equations.row >= n) & (equations.column < n)
    row, column, entries = equations.row[chosen] - n, equations.column[chosen], point.entries[chosen]
    found = [np.bincount(column, weights=entries * way[row], minlength=n) for way in ways.T]
    return np.array(found).reshape(ways.shape[1], n).T


def _all_singular(equations: Equations, point: Point) -> tuple[Array, Array, float]:
    """Squares of all singular values of the rows, their left vectors and the largest square."""
    n = equations.unknowns
    chosen = (equations.row >= n) & (equations.column < n)
    rows = np.zeros((equations.rows, n))
    rows[equations.row[chosen] - n, equations.column[chosen]] = point.entries[chosen]
    squares, left = np.linalg.eigh(rows @ rows.T)
    return squares, left, float(squares[-1])


def _smallest(equations: Equations, point: Point) -> tuple[Array, Array, float]:
    """The same for the smallest ones only, by inverse iteration with the sparse matrix of the rows."""
    n = equations.unknowns
    entries = equations.of_rows(point.entries)
    largest = float(np.bincount(equations.row, weights=entries**2, minlength=equations.total)[n:].max())
    equations.solver.factor(equations.regularised(entries, np.ones(n), TINY_SHARE * largest))
    count = 8
    while True:
        block = np.random.default_rng(0).standard_normal((equations.total, min(count, equations.rows)))
        for _ in range(INVERSE):
            block[:n] = 0.0
            block[n:] = np.linalg.qr(block[n:])[0]
            block = equations.solver.solve(block)
        left, sizes, _ = np.linalg.svd(block[n:], full_matrices=False)
        squares = 1.0 / sizes - TINY_SHARE * largest
        if squares.max() > SLACK * largest or count >= equations.rows:
            return squares[::-1], left[:, ::-1], largest
        count *= 4


ROUGHLY = 1e-4
"""Share of the largest square below which singular values are looked at closely."""

MANY = 300
"""From this many rows on only the loose ones are looked for."""

INVERSE = 3
"""Inverse iterations: what is loose stands out by twelve digits."""

TINY_SHARE = 1e-15
"""Share of the largest square that keeps the matrix of loose rows regular."""


def rows_in(loose: Array) -> list[int]:
    """The rows that take part in combinations, columns of :func:`loose_rows`, whichever span their space."""
    return np.flatnonzero(np.linalg.norm(loose, axis=1) > TAKES_PART).tolist() if loose.size else []


TAKES_PART = 0.1
"""Length of a row's part in all loose combinations, of 1: a row takes part in none of them by rounding, 1e-8."""


def named_in(equations: Equations, loose: Array) -> str:
    """Their names."""
    return ", ".join(dict.fromkeys(equations.row_names[row] for row in rows_in(loose)))


def stretched(equations: Equations, point: Point, loose: Array | None = None) -> str:
    """What is said of members that no finite force holds straight; empty where rows do not vanish.

    ``loose`` are combinations of rows that are known to.  Else those that nearly vanish are asked whether their
    multipliers have no end: to close what is left of the closings by rows of the size s takes a step (left / s) that
    changes s itself by as much, beside s only where the rows vanish at the closed state.
    """
    if loose is None:
        nearly = loose_rows(equations, point, NEARLY)
        sizes = np.linalg.norm(changed_by(equations, point, nearly), axis=0)
        growing = np.abs(nearly.T @ point.residual[equations.unknowns :]) > GROWING * sizes**2
        loose = nearly if growing.any() else nearly[:, :0]
    return FULLY + named_in(equations, loose) if loose.size else ""


FULLY = "fully stretched between held points, where an inextensible member takes any force: "

NEARLY = 1e-3
"""Share of the largest singular value of the closings below which members may be on their way to being stretched."""

GROWING = 0.01
"""Share by which closing them would change rows that nearly vanish, from which on it makes them vanish."""

SLACK = 1e-6
"""Singular values of the closings below this share of the largest: no slack to first order."""


def redundant(equations: Equations, point: Point) -> bool:
    """Whether rows depend on each other, as far as known: asked at the first state, and at each equilibrium."""
    if equations.redundant is None:
        equations.redundant = bool(loose_rows(equations, point).size)
    return equations.redundant


def with_sharing(
    equations: Equations, state: State, loading: Loading, point: Point, tolerance: float, *, reactions: bool = False
) -> tuple[State, Point]:
    """An equilibrium with redundant multipliers as :func:`~sfetcas.solvers.sharing.shared`, as far as it stays one."""
    loose = loose_rows(equations, point)
    # The first state asked may have been a bent one, where no closing is redundant.
    equations.redundant = equations.redundant or bool(loose.size)
    if not loose.size:
        return state, point
    there = shared(equations, state, loading, loose, reactions=reactions)
    found = equations.at(there, loading)
    return (there, found) if relative_residual(equations, met(equations, found)) <= tolerance else (state, point)


def met(equations: Equations, point: Point) -> Point:
    """The point without the gaps of redundant closings that no unknown closes, where they are as good as closed.

    Places in a scene have so many digits: the third of three parallel links fits to these, and moves with the others.
    """
    if not redundant(equations, point):
        return point
    loose = loose_rows(equations, point)
    left = loose.T @ point.residual[equations.unknowns :]
    # What turning by less closes is a member nearly straight, and its gap has to be closed.
    stays = np.abs(left) > TURNS_FIRST * np.linalg.norm(changed_by(equations, point, loose), axis=0)
    gaps = loose[:, stays] @ left[stays]
    if not 0.0 < np.linalg.norm(gaps) <= tolerances.CLOSED:
        return point
    residual = point.residual.copy()
    residual[equations.unknowns :] -= gaps
    return replace(point, residual=residual)


TURNS_FIRST = 1e-3
"""Turning, rad, by which gaps are closed: what takes more, to first order, no unknown closes."""
