"""Newton's method on the stationarity equations: to rounding from a near state, downhill from a far one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .. import tolerances
from ..mathematics.arrays import TINY, Array
from ..mechanics.equations import Equations, Point, State
from ..mechanics.loading import Loading
from .sharing import shared

__all__ = [
    "LEAST_SCALE",
    "TURN",
    "Corrected",
    "changed_by",
    "correct",
    "descend",
    "independent",
    "loose_rows",
    "met",
    "named_in",
    "newton_step",
    "redundant",
    "relative_residual",
    "rounded",
    "rows_in",
    "stretched",
    "with_sharing",
]

TURN = 1.2
"""Largest rotation (rad) of a step downhill under forces."""

SHORT = 0.05
"""Steps shorter than this, rad, need not shrink yet."""


@dataclass(frozen=True)
class Corrected:
    """Where Newton's method arrived.

    ``first`` and ``second`` are the largest rotations (rad) of the first two steps: how far the equations were
    from linear.
    """

    state: State
    point: Point
    converged: bool
    iterations: int
    first: float
    second: float
    residual: float


def relative_residual(equations: Equations, point: Point) -> float:
    """Largest out-of-balance moment or force over what is added up at its node, or largest gap."""
    return float((np.abs(point.residual) / np.maximum(point.scale, LEAST_SCALE)).max(initial=0.0))


LEAST_SCALE = 1e-14
"""Of the units of the model: where nothing acts and nothing is stiff, less than this is nothing."""


def newton_step(equations: Equations, point: Point, weight: Array) -> Array:
    """The step of all unknowns and multipliers."""
    equations.solver.factor(equations.regularised(point.entries, tolerances.PROXIMAL * weight, tolerances.DUAL))
    step = equations.solver.solve(-point.residual)
    if redundant(equations, point):
        # Of redundant closings only the softness above limits the multipliers: their loose part has no meaning.
        rows, loose = slice(equations.unknowns, None), loose_rows(equations, point)
        if loose.size:
            step[rows] -= loose @ (loose.T @ step[rows])
    return step


def correct(
    equations: Equations,
    state: State,
    loading: Loading,
    weight: Array,
    *,
    iterations: int = 12,
    most: float = np.inf,
    contraction: float = 1.0,
    tangent: Array | None = None,
    flat: Array | None = None,
    drag: Callable[[State, Point], Point] | None = None,
) -> Corrected:
    """Newton's method from a near state down to rounding: as long as a step gains a factor of 4.

    What rounding of the state keeps out of balance has converged as well.

    Parameters
    ----------
    weight : ndarray
        Weight of the proximal term, see :class:`~sfetcas.solvers.stability.StabilityTest`.
    most : float
        Give up when a later step than the first turns any node by more, rad.
    contraction : float
        Give up when a step is not shorter than this times the one before (or than 0.05 rad).
    tangent : ndarray, optional
        Entries of the Newton matrix of the equilibrium that is left, for the first step: then it goes along the
        path, while the matrix under the new load may already point away from it.
    flat : ndarray, optional
        Shapes of a flat energy, columns (turning unknowns, shapes): no step goes along them.
    drag : callable, optional
        Adds couples that resist to the equations, see :class:`~sfetcas.solvers.pseudo_transient.Drag`; the point that
        is returned has none.
    """

    def dragged(state: State) -> Point:
        point = met(equations, equations.at(state, loading))
        return point if drag is None else drag(state, point)

    tolerance = tolerances.CONVERGED
    state = equations.holding(state, loading)
    point = dragged(state)
    residual = relative_residual(equations, point)
    first = second = last = np.inf
    begun = state, point, residual
    count = 0
    for count in range(iterations):
        # One step is always taken: under a tiny load even the whole answer is below rounding of the stiffness.
        if residual == 0.0 or (count and residual <= tolerances.EXACT and _balanced(equations, point)):
            break
        try:
            here = replace(point, entries=tangent) if tangent is not None and count == 0 else point
            step = newton_step(equations, here, weight)
            if here is not point and _unresisted(equations, step, point, weight):
                step = newton_step(equations, point, weight)
        except np.linalg.LinAlgError:
            break
        turning = step[: equations.turning_unknowns]
        if flat is not None:
            weighted = weight[:, None] * flat
            turning -= flat @ np.linalg.lstsq(flat.T @ weighted, weighted.T @ turning, rcond=None)[0]
        length = float(np.abs(turning).max(initial=0.0))
        if not np.isfinite(length):
            break
        if count == 0:
            first = length
        elif count == 1:
            second = length
        if count and residual > tolerance and (length > most or length > max(contraction * last, SHORT)):
            if begun[2] <= tolerance:
                break
            return Corrected(state, point, False, count, first, second, residual)
        last = length
        trial = equations.moved(state, step)
        there = dragged(trial)
        gained = relative_residual(equations, there)
        low = residual <= tolerance or (count and gained > 0.25 * residual and rounded(equations, state, point))
        if low and gained > 0.25 * residual and (count or _balanced(equations, point)):
            if gained < residual:
                state, point, residual = trial, there, gained
            break
        state, point, residual = trial, there, gained
        if not np.isfinite(residual):
            break
    if not residual <= tolerance and begun[2] <= tolerance:
        state, point, residual = begun
    if residual > tolerance and drag is None and rounded(equations, state, point):
        # Rounding may leave a little more where multipliers are shared.
        tolerance = min(tolerances.BALANCED, 4.0 * residual)
    second = 0.0 if second == np.inf else second
    converged = residual <= tolerance
    if drag is not None or equations.redundant:
        point = equations.at(state, loading)
    if drag is None and converged:
        state, point = with_sharing(equations, state, loading, point, tolerance)
        residual = relative_residual(equations, point)
    return Corrected(state, point, converged, count, first, second, residual)


EPSILON = 1e-15
"""Rounding of unknowns over the largest of their kind, or one."""


def rounded(equations: Equations, state: State, point: Point) -> bool:
    """Whether rounding of the unknowns explains what is out of balance, and balance beside all that acts is good.

    A residual that does not fall may as well be what no unknown balances, however small it is: that explains nothing.
    """
    if not relative_residual(equations, point) <= tolerances.BALANCED or not _balanced(equations, point):
        return False
    turning, unknowns, total = equations.turning_unknowns, equations.unknowns, equations.total
    sizes = [max(1.0, float(np.abs(part).max(initial=0.0))) for part in (state.q, state.y)]
    size = np.concatenate([np.repeat(sizes, [turning, unknowns - turning]), np.abs(state.lam)])
    noise = np.bincount(equations.row, np.abs(point.entries) * size[equations.column], minlength=total)
    return bool((np.abs(point.residual) <= EPSILON * noise).all())


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


def _balanced(equations: Equations, point: Point) -> bool:
    """Whether what is out of balance is little beside all that acts, too, and not only beside what is stiff."""
    n = equations.unknowns
    acting = (point.scale - equations.noise)[:n].max(initial=0.0)
    return float(np.abs(point.residual[:n]).max(initial=0.0)) <= tolerances.BALANCED * acting


def _unresisted(equations: Equations, step: Array, point: Point, weight: Array) -> bool:
    """Whether little but the proximal term resists a step: an unloaded mechanism of rigid members has no stiffness."""
    turned = step[: equations.turning_unknowns]
    return bool(tolerances.PROXIMAL * float(weight @ turned**2) > 0.1 * abs(float(step @ point.residual)))


def descend(
    equations: Equations, state: State, loading: Loading, weight: Array, *, iterations: int = 30, most: float = TURN
) -> State:
    """Downhill towards a minimum of the potential on the closings, from any state.

    Newton steps with element matrices made positive, so that each points downhill, shortened until the
    potential (with the gaps, weighted beyond the multipliers) falls by a third of what the step promises.
    Forces turn no node by more than ``most`` in a step, so that they do not wind a beam up; a moment may roll
    it up at once.  Stops where steps have become short: the state is meant for IPOPT or Newton's method.
    """
    scale = 1.0
    most = np.inf if np.any(loading.moment) and most == TURN else most
    point = equations.at(state, loading, convex=True)
    for _ in range(iterations):
        try:
            step = newton_step(equations, point, 1e4 * weight)
        except np.linalg.LinAlgError:
            return state
        n = equations.unknowns
        length = float(np.abs(step[: equations.turning_unknowns]).max(initial=0.0))
        if not np.isfinite(length):
            return state
        # Slope of the potential alone: the residual without the multipliers' share.
        lam = state.lam + step[n:]
        penalty = 2.0 * float(np.abs(lam).max(initial=0.0))
        gaps = np.abs(point.residual[n:]).sum()
        slope = float(point.residual[:n] @ step[:n]) + float(state.lam @ point.residual[n:]) - penalty * gaps
        slope = min(slope, 0.0)
        before = point.potential + penalty * gaps
        scale = min(1.0, 4.0 * scale, most / max(length, TINY))
        for _ in range(40):
            trial = equations.moved(state, np.concatenate([scale * step[:n], scale * step[n:]]))
            there = equations.at(trial, loading, convex=True)
            after = there.potential + penalty * np.abs(there.residual[n:]).sum()
            if after - before <= 0.3 * (scale - 0.5 * scale**2) * slope + 1e-12 * abs(before):
                break
            scale *= 0.5
        state, point = trial, there
        if scale == 1.0 and length < 0.02:
            break
    return state


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
