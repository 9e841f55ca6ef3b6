"""Redundant rows: combinations of constraints that no unknown changes to first order.

They arise from redundant joints, and from straight members between fixed points.  Their multipliers are not determined;
:mod:`~sfetcas.solvers.sharing` says which ones are given.
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
    "ROUGHLY",
    "changed_by",
    "independent",
    "loose_rows",
    "met",
    "named_in",
    "redundant",
    "rows_in",
    "stretched",
    "usual_square",
    "with_sharing",
]


def loose_rows(equations: Equations, point: Point, slack: float | None = None) -> Array:
    """Combinations of rows whose derivative by the unknowns vanishes at this state: orthonormal columns, (rows, n).

    Left singular vectors of the Jacobian with singular values below ``slack`` (by default ``SLACK``) times the
    largest.
    """
    slack = SLACK if slack is None else slack
    if not equations.rows:
        return np.zeros((0, 0))
    # A step and what is left after it ask for the same; of large models much is asked of the undeformed state.
    many = equations.rows > MANY
    for entries, known, found in equations.loose:
        if known == slack and (entries is point.entries or (many and np.array_equal(entries, point.entries))):
            return found
    found = _loose_rows(equations, point, slack)
    equations.loose = [(point.entries, slack, found), *equations.loose[: ASKED - 1]]
    return found


def _loose_rows(equations: Equations, point: Point, slack: float) -> Array:
    usual = usual_square(equations)
    if equations.clearly_independent(point.entries, ROUGHLY, usual):
        return np.zeros((equations.rows, 0))
    if equations.rows > MANY:
        squares, left, largest = _smallest(equations, point, APART * slack**2, usual)
    else:
        products = _products(equations, point)
        if _clearly_independent(products, usual):
            return np.zeros((equations.rows, 0))
        squares, left, largest = _all_singular(products)
    small = left[:, squares < ROUGHLY * max(largest, usual)]
    if not small.size:
        return small
    # Squares are accurate to rounding of the largest, singular values to its root only: small ones are computed again.
    changes, count = changed_by(equations, point, small), small.shape[1]
    _, sizes, right = np.linalg.svd(np.pad(changes, ((0, max(0, count - len(changes))), (0, 0))), full_matrices=False)
    return np.asarray(small @ right[sizes < slack * np.sqrt(max(largest, usual))].T)


def usual_square(equations: Equations) -> float:
    """A usual square of a singular value, so that a row without derivative is found also if it is the only one."""
    # Without beams rows are of the size of one.
    return float((equations.model.beams.weight**2).sum()) or 1.0


def independent(equations: Equations, point: Point, among: Array) -> Array:
    """Of the span of combinations of rows, orthonormal columns (rows, n), those orthogonal to loose ones, (rows, m)."""
    inside = among.T @ loose_rows(equations, point)
    across = np.linalg.qr(inside, mode="complete")[0][:, inside.shape[1] :]
    return np.asarray(among @ across)


def changed_by(equations: Equations, point: Point, ways: Array) -> Array:
    """The transposed Jacobian of the rows times combinations, columns (rows, k): (unknowns, k), dimensionless."""
    n, (chosen, row, column) = equations.unknowns, equations.jacobian_entries
    entries = point.entries[chosen]
    found = [np.bincount(column, weights=entries * way[row], minlength=n) for way in ways.T]
    return np.array(found).reshape(ways.shape[1], n).T


def _all_singular(products: Array) -> tuple[Array, Array, float]:
    """Squares (rows,) of all singular values of the Jacobian, left vectors (rows, rows) and the largest square."""
    squares, left = np.linalg.eigh(products)
    return squares, left, float(squares[-1])


def _products(equations: Equations, point: Point) -> Array:
    """The Jacobian of the rows times its transposed, (rows, rows)."""
    chosen, row, column = equations.jacobian_entries
    rows = np.zeros((equations.rows, equations.unknowns))
    rows[row, column] = point.entries[chosen]
    return np.asarray(rows @ rows.T)


def _clearly_independent(products: Array, usual: float) -> bool:
    """Whether no singular value is small, by bounds of the least and the largest that cost little."""
    try:
        inverse = np.linalg.inv(products)
    except np.linalg.LinAlgError:
        return False
    # The least square is above one over the sum of the inverses of all, the largest below their sum.
    sizes = inverse.diagonal()
    return bool((sizes > 0.0).all() and ROUGHLY * max(float(products.trace()), usual) * float(sizes.sum()) < 1.0)


def _smallest(
    equations: Equations, point: Point, apart: float = np.inf, usual: float = 0.0
) -> tuple[Array, Array, float]:
    """As :func:`_all_singular` for the smallest singular values only, by inverse iteration with the sparse Jacobian.

    The largest sum of squares of a row stands for the largest square.  None are given where the least square is above
    the share ``apart`` of that, or of a ``usual`` one: as one vector shows, since one far below it would outgrow all
    others in it at once.
    """
    n = equations.unknowns
    entries = equations.of_rows(point.entries)
    largest = float(np.bincount(equations.row, weights=entries**2, minlength=equations.total)[n:].max())
    equations.solver.factor(equations.regularised(entries, np.ones(n), TINY_SHARE * largest))

    def iterated(count: int, times: int) -> tuple[Array, Array]:
        block = np.random.default_rng(0).standard_normal((equations.total, min(count, equations.rows)))
        for _ in range(times):
            block[:n] = 0.0
            block[n:] = np.linalg.qr(block[n:])[0]
            block = equations.solver.solve(block)
        left, sizes, _ = np.linalg.svd(block[n:], full_matrices=False)
        return 1.0 / sizes - TINY_SHARE * largest, left

    squares, left = iterated(1, FIRST)
    if squares[0] > apart * max(largest, usual):
        return squares[:0], left[:, :0], largest
    count = BLOCK
    while True:
        squares, left = iterated(count, INVERSE)
        if squares.max() > SLACK * largest or count >= equations.rows:
            return squares[::-1], left[:, ::-1], largest
        count *= 4


ROUGHLY = 1e-4
"""Share of the largest square below which the singular value is computed again, without squares."""

MANY = 300
"""Number of rows above which only the smallest singular values are computed."""

INVERSE, FIRST, BLOCK = 3, 2, 8
"""Inverse iterations of several vectors, those of a single one, and how many the several are at first; few iterations
suffice as the squares of loose rows are smaller by twelve digits.
"""

APART = 1e4
"""Ratio of the least square to the one below which rows are loose, from which on none are."""

ASKED = 4
"""States of which is remembered which rows are loose there."""

TINY_SHARE = 1e-15
"""Dual regularisation of the matrix of redundant rows, share of the largest square."""


def rows_in(loose: Array) -> list[int]:
    """Numbers of the rows with a part in the space of combinations (rows, n), of :func:`loose_rows`."""
    return np.flatnonzero(np.linalg.norm(loose, axis=1) > TAKES_PART).tolist() if loose.size else []


TAKES_PART = 0.1
"""Norm of a row's entries in the loose combinations (at most 1) from which it is named; rounding leaves 1e-8."""


def named_in(equations: Equations, loose: Array) -> str:
    """Names of the rows with a part in combinations (rows, n), for messages."""
    return ", ".join(dict.fromkeys(equations.row_names[row] for row in rows_in(loose)))


def stretched(equations: Equations, point: Point, loose: Array | None = None) -> str:
    """Message naming members that no finite force holds straight; empty if rows are independent.

    ``loose`` (rows, n) are the combinations known to be redundant.  Without them nearly redundant ones are taken whose
    multipliers would grow without bound: closing a gap ``g`` by a row of singular value ``s`` takes a step ``g / s``,
    which changes ``s`` by about as much; beside ``s`` this is much only if the row vanishes at the closed state.
    """
    if loose is None:
        nearly = loose_rows(equations, point, NEARLY)
        sizes = np.linalg.norm(changed_by(equations, point, nearly), axis=0)
        growing = np.abs(nearly.T @ point.residual[equations.unknowns :]) > GROWING * sizes**2
        loose = nearly if growing.any() else nearly[:, :0]
    if not loose.size:
        return ""
    strings = ", the stiffness of a tendon too" if equations.model.scene.tendons else ""
    return f"{FULLY} (EA lets it stretch{strings}): {named_in(equations, loose)}"


FULLY = "fully stretched between held points, where an inextensible member takes any force"

NEARLY = 1e-3
"""Singular values of nearly redundant rows, share of the largest: members may be about to become straight."""

GROWING = 0.01
"""Ratio of a gap to the square of the row's singular value from which closing it makes the row vanish."""

SLACK = 1e-6
"""Singular values of redundant rows, share of the largest."""


def redundant(equations: Equations, point: Point) -> bool:
    """Whether rows were redundant at the first state or at any equilibrium so far; kept in ``equations.redundant``."""
    if equations.redundant is None:
        if not np.isfinite(point.entries).all():
            # Of what is no number nothing is found out; Newton's method ends there.
            return False
        equations.redundant = bool(loose_rows(equations, point).size)
    return equations.redundant


def with_sharing(
    equations: Equations, state: State, loading: Loading, point: Point, tolerance: float, *, reactions: bool = False
) -> tuple[State, Point]:
    """An equilibrium with the multipliers of redundant rows by :func:`~sfetcas.solvers.sharing.shared`, and its point.

    Unchanged if the relative residual would exceed ``tolerance``.  ``reactions`` is passed on.
    """
    if equations.model.mesh.points and equations.redundant is False:
        # Rows of places beside each other are redundant to rounding only: of what touches they have been looked for
        # without contact.
        return state, point
    loose = loose_rows(equations, point)
    # The first state may have been a bent one, where no row is redundant.
    equations.redundant = equations.redundant or bool(loose.size)
    if not loose.size:
        return state, point
    there = shared(equations, state, loading, loose, reactions=reactions)
    found = equations.at(there, loading)
    return (there, found) if relative_residual(equations, met(equations, found)) <= tolerance else (state, point)


def met(equations: Equations, point: Point) -> Point:
    """The point without the gaps along redundant combinations of rows, which no unknown closes, if they are tiny.

    Such gaps come from the digits of positions in a scene: the third of three parallel links fits to rounding only.
    """
    if not redundant(equations, point):
        return point
    loose = loose_rows(equations, point)
    left = loose.T @ point.residual[equations.unknowns :]
    # A gap that a smaller rotation closes is that of a nearly straight member, and has to be closed.
    stays = np.abs(left) > TURNS_FIRST * np.linalg.norm(changed_by(equations, point, loose), axis=0)
    gaps = loose[:, stays] @ left[stays]
    if not 0.0 < np.linalg.norm(gaps) <= tolerances.CLOSED:
        return point
    residual = point.residual.copy()
    residual[equations.unknowns :] -= gaps
    return replace(point, residual=residual)


TURNS_FIRST = 1e-3
"""Rotation, rad, that would close a gap to first order; a gap that takes more is one that no unknown closes."""
