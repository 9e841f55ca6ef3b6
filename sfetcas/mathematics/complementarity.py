"""Linear complementarity: forces that only push, and gaps that do not become less than none; with friction as well.

    x >= 0,      A x + b >= 0,      x . (A x + b) = 0

With friction further numbers ``y`` belong to one of ``x``, which may be at most ``mu x`` together, and the slips ``v``
are further rows of ``A x + b``: ``y = - mu x v / |v|`` where ``v`` is not zero.

With few forces, or where what they do to each other is no energy: pivots.  Where it is known from where ``b`` has come
they follow its change: of several solutions, as of a strip that lies on a floor and is pressed along it, that is the
one that goes on.  Else all wrong signs at once and, where that goes round, Lemke's, which lead to a solution wherever
``A`` is of an energy, and mostly where it is not.

With many forces ``A`` is sparse.  Which forces push is mostly known from a problem like it: Newton's method on
``min(x, A x + b) = 0``, which lets all that is infeasible change sides at once, then ends within a few steps.  Where it
does not, an interior-point method leads to the solution in a number of steps that hardly grows.  Where rows depend on
each other a small diagonal makes the solution unique.  It multiplies the change from a solution that is near, so that
it has no part in where a sequence of such solutions ends.

Coulomb's law is that ``y`` is the nearest to ``y - v`` that is allowed.  Newton's method for this equation begins with
the solution of a problem like it, or with the one without friction; where it does not end, one contact after the other
is solved by itself for some rounds before it is tried again.

Source: Lemke 1965 (pivots); Judice and Pires 1994 (blocks of them); Cottle, Pang and Stone 2009, The Linear
Complementarity Problem, sections 4.4, 4.5 (along a change) and 4.9; Kojima, Megiddo, Noma and Yoshise 1991, A unified
approach to interior point algorithms for linear complementarity problems; Mehrotra 1992 (doi 10.1137/0802028);
Rockafellar 1976 (proximal point); Alart and Curnier 1991 (friction as an equation); Jean 1999, The non-smooth contact
dynamics method (rounds).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .arrays import TINY, Array, Index, Sparse
from .core import core, doubles, integers

__all__ = ["Friction", "by_pivots", "complementary", "needs_none"]

YIELDING = 1e-9
"""Diagonal that is added, over the one that is there."""

NOTHING = 1e-11
"""Share of the largest diagonal below which one is none: of what moves as one body."""

SOLVED = 1e-11
"""Largest error, over the largest entry of ``b`` in the unit of each row, that is accepted."""

FEW, MOST = 15, 100
"""Steps of Newton's method, and of the interior-point method, at most."""

DENSE = 400
"""Numbers of a problem up to which a dense matrix is faster than a sparse one."""

BLOCKS, PIVOTS, ALONG = 8, 10, 2
"""Block pivots without fewer wrong signs, after which single ones follow; of these at most as many over the number of
rows, and along a change of ``b``.
"""

BALANCED = 4
"""Rounds in which units of rows are found."""

ROUNDING, FLAT = 1e-11, 1e-9
"""Share of the largest number, all of them dimensionless, up to which a wrong sign is rounding, and of the largest of a
column up to which a pivot is none.
"""

CONTRADICTED = 1e-7
"""Share of the largest number that is left of what is to be zero where rows contradict each other: far beyond rounding.
"""

SHY = 0.99
"""Share of the way to where a number would be zero that a step of the interior-point method goes."""

TRIES, ROUNDS = 12, 40
"""How often Newton's method with friction is tried, and rounds over all contacts between two tries."""

AWAY = 1e9
"""Forces so many times those that contacts ask for alone are of rounds that lead away, as these may with friction."""


@dataclass(frozen=True, eq=False)
class Friction:
    """What rubs: numbers (k,) of forces across among all, and (k, directions) of those along; coefficients (k,)."""

    across: Index
    along: Index
    coefficients: Array

    def __len__(self) -> int:
        return len(self.across)

    def of(self, chosen: Array) -> tuple[Index, Friction]:
        """Numbers of chosen contacts (n,), of bool, and of what is along their surfaces; their law alone."""
        rubs = chosen[self.across]
        rows = np.concatenate([np.flatnonzero(chosen), self.along[rubs].ravel()]).astype(np.intp)
        count = int(chosen.sum())
        across = np.cumsum(chosen)[self.across[rubs]] - 1
        along = count + np.arange(self.along[rubs].size, dtype=np.intp).reshape(self.along[rubs].shape)
        return rows, Friction(across, along, self.coefficients[rubs])

    def scaled(self, lengths: Array) -> Friction:
        """The same law where forces act along vectors of some lengths (n,)."""
        along = lengths[self.along].mean(axis=1) if len(self) else lengths[:0]
        return replace(self, coefficients=self.coefficients * lengths[self.across] / along)


def complementary(matrix: Sparse, b: Array, near: Array, friction: Friction | None = None) -> Array | None:
    """The solution x (n,) that is nearest to ``near`` (n,), a solution of a problem like it; None where none is found.

    ``matrix`` (n, n) has a symmetric part without negative eigenvalues.  What has no diagonal stays zero.  With
    ``friction`` some of the numbers are forces along surfaces.

    Examples
    --------
    >>> from scipy.sparse import csc_matrix
    >>> complementary(csc_matrix([[2.0, 1.0], [1.0, 2.0]]), np.array([-2.0, 1.0]), np.zeros(2)).round(6).tolist()
    [1.0, 0.0]
    """
    from scipy.sparse import diags

    diagonal = matrix.diagonal()
    if friction is not None and len(friction):
        # Both directions along a surface have one unit, and none where nothing can push.
        pushes = diagonal[friction.across] > NOTHING * diagonal.max(initial=TINY)
        diagonal = diagonal.copy()
        diagonal[friction.along] = np.where(pushes[:, None], diagonal[friction.along].mean(axis=1, keepdims=True), 0.0)
    able = np.flatnonzero(diagonal > NOTHING * diagonal.max(initial=TINY))
    unit = 1.0 / np.sqrt(diagonal[able])
    scaled = diags(unit) @ matrix[:, able][able] @ diags(unit) + YIELDING * diags(np.ones(len(able)))
    begin = near[able] / unit
    right = unit * b[able] - YIELDING * begin
    least = SOLVED * np.abs(right).max(initial=TINY)
    if friction is not None and len(friction):
        place = np.full(len(b), -1, np.intp)
        place[able] = np.arange(len(able))
        rubs = place[friction.along[:, 0]] >= 0
        across, along = place[friction.across[rubs]], place[friction.along[rubs]]
        own = Friction(across, along, friction.coefficients[rubs] * unit[across] / unit[along[:, 0]])
        x = _rough(scaled.tocsc(), right, begin, least, own)
    else:
        x = _smooth(scaled.tocsc(), right, begin, least)
    if x is None:
        return None
    found = np.zeros(len(b))
    found[able] = x * unit
    return found


def _smooth(matrix: Sparse, b: Array, begin: Array, least: float) -> Array | None:
    """The solution without friction."""
    x = _by_newton(matrix.toarray() if len(b) <= DENSE else matrix, b, begin, least)
    return _from_inside(matrix, b, least) if x is None else x


def needs_none(b: Array) -> bool:
    """Whether zero is the solution, whatever the matrix: nothing of ``b`` (n,) is below it by more than rounding."""
    return bool((b >= -ROUNDING * np.abs(b).max(initial=0.0)).all())


def by_pivots(matrix: Array, b: Array, begin: Array | None = None) -> Array | None:
    """The solution x (n,) of a problem with a dense matrix (n, n); None where pivots lead to none that is accurate.

    ``begin`` (n,), not negative, is where ``b`` has come from: there ``x`` is zero.  Where there are several solutions
    the one is found to which the change of ``b`` leads from there.

    Examples
    --------
    >>> by_pivots(np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-2.0, 1.0])).tolist()
    [1.0, 0.0]
    """
    if needs_none(b):
        return np.zeros(len(b))
    try:
        x = None if begin is None else _judged(matrix, b, _by_single_pivots(matrix, b, begin - b, ALONG))
        return _by_blocks(matrix, b) if x is None else x
    except np.linalg.LinAlgError:
        return None


def _by_blocks(matrix: Array, b: Array) -> Array | None:
    """All wrong signs at once and, where that goes round, Lemke's pivots."""
    chosen, best, blocks = np.zeros(len(b), bool), len(b) + 1, BLOCKS
    while blocks:
        x, wrong = _tried(matrix, b, chosen)
        if not wrong.any():
            return x
        count = int(wrong.sum())
        blocks = BLOCKS if count < best else blocks - 1
        best = min(best, count)
        chosen = chosen ^ wrong
    return _judged(matrix, b, _by_single_pivots(matrix, b))


def _judged(matrix: Array, b: Array, chosen: Array | None) -> Array | None:
    """The solution (n,) of which only chosen numbers may differ from zero; None where there is none."""
    if chosen is None:
        return None
    x, wrong = _tried(matrix, b, chosen)
    return None if wrong.any() else x


def _tried(matrix: Array, b: Array, chosen: Array) -> tuple[Array, Array]:
    """The numbers (n,) where only chosen ones may differ from zero, and which signs are wrong."""
    x, rest = np.zeros(len(b)), b.copy()
    if chosen.any():
        # Rows may depend on each other: then what they do together is unique.
        x[chosen] = np.linalg.lstsq(matrix[np.ix_(chosen, chosen)], -b[chosen], rcond=None)[0]
        rest += matrix[:, chosen] @ x[chosen]
    size = np.abs(np.concatenate([x, rest, b])).max(initial=0.0)
    # Of more rows than are independent no forces may close all.
    wrong = (np.where(chosen, x, rest) < -ROUNDING * size) | (chosen & (np.abs(rest) > CONTRADICTED * size))
    return np.maximum(x, 0.0), wrong


def _by_single_pivots(matrix: Array, b: Array, back: Array | None = None, pivots: int = PIVOTS) -> Array | None:
    """Which numbers (n,) are not zero, by Lemke's pivots; None where they lead to no solution.

    Of ``b + share back`` (n,), with the least share from which on nothing of it is negative, zero is the solution; from
    there the share falls to zero.  Without ``back`` all rows are alike in their units.
    """
    n, unit = len(b), np.ones(len(b))
    # Of rows of different units each has one in which its largest number is about one.
    for _ in range(BALANCED):
        largest = np.abs(unit[:, None] * matrix * unit).max(axis=1, initial=0.0)
        unit /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
    back = np.ones(n) if back is None else unit * back
    table = np.column_stack([np.eye(n), -unit[:, None] * matrix * unit, -back, unit * b])
    size = np.abs(table[:, -1]).max(initial=0.0)
    low = np.flatnonzero(b < 0.0)
    if not len(low):
        return np.zeros(n, bool)
    basis, out, enters = integers(np.arange(n)), int(low[np.argmax(-table[low, -1] / back[low])]), 2 * n
    library = core()
    if library is not None:
        table = doubles(table)
        addresses = table.ctypes.data, basis.ctypes.data
        lost = library.sf_lemke(n, *addresses, out, pivots * n, FLAT, ROUNDING, float(size))
        return None if lost else np.isin(np.arange(n), basis[basis >= n] - n)
    for _ in range(pivots * n):
        table[out] /= table[out, enters]
        taken = table[:, enters].copy()
        taken[out] = 0.0
        table -= taken[:, None] * table[out]
        left, basis[out] = int(basis[out]), enters
        if left == 2 * n:
            return np.isin(np.arange(n), basis[basis >= n] - n)
        # What has left lets its partner in: of each pair one is zero.
        enters = left + n if left < n else left - n
        column = table[:, enters]
        able = np.flatnonzero(column > FLAT * np.abs(column).max(initial=TINY))
        if not len(able):
            return None
        ratios = table[able, -1] / column[able]
        least = able[ratios <= (1.0 + ROUNDING) * ratios.min() + ROUNDING * size]
        if not len(least):
            # Numbers that have grown beyond all bounds.
            return None
        last = least[basis[least] == 2 * n]
        # Of equal ones the first in the order of words, which does not go round.
        words = table[least, :n] / column[least, None]
        out = int(last[0] if len(last) else least[np.lexsort(words.T[::-1])[0]])
    return None


def _by_newton(matrix: Sparse, b: Array, begin: Array, least: float) -> Array | None:
    """Newton's method on the complementarity; None where it does not end soon."""
    x, opening = begin, matrix @ begin + b
    for _ in range(FEW):
        chosen = np.flatnonzero(x > opening)
        x = np.zeros(len(b))
        if len(chosen):
            x[chosen] = _solved(matrix[:, chosen][chosen], -b[chosen])
        opening = matrix @ x + b
        if np.abs(np.minimum(x, opening)).max(initial=0.0) <= least:
            return np.maximum(x, 0.0)
    return None


def _solved(matrix: Sparse, right: Array) -> Array:
    """The solution with a matrix that is sparse or dense."""
    from scipy.sparse.linalg import splu

    dense = isinstance(matrix, np.ndarray)
    return np.asarray(np.linalg.solve(matrix, right) if dense else splu(matrix).solve(right))


def _from_inside(matrix: Sparse, b: Array, least: float) -> Array | None:
    """The interior-point method, then which push as it says."""
    from scipy.sparse import diags
    from scipy.sparse.linalg import splu

    n, size = len(b), np.abs(b).max(initial=TINY)
    x, opening = np.full(n, size), np.full(n, size)
    for _ in range(MOST):
        missed = matrix @ x + b - opening
        mean = float(x @ opening) / n
        if max(float(np.abs(missed).max()), float(np.minimum(x, opening).max())) <= least:
            return x
        factors = splu((matrix + diags(opening / x)).tocsc())

        def step(goal: Array) -> tuple[Array, Array]:
            moved = factors.solve(goal / x - opening - missed)  # noqa: B023 - called within the round
            return moved, matrix @ moved + missed  # noqa: B023

        ahead, opens = step(np.zeros(n))
        share = _longest(x, ahead, opening, opens)
        left = float((x + share * ahead) @ (opening + share * opens)) / n
        moved, opened = step((left / mean) ** 3 * mean - ahead * opens)
        share = min(1.0, SHY * _longest(x, moved, opening, opened))
        x, opening = x + share * moved, opening + share * opened
        found = _by_newton(matrix, b, x, least) if mean < 1e-6 * size * size else None
        if found is not None:
            return found
    return None


def _longest(x: Array, moved: Array, opening: Array, opened: Array) -> float:
    """The longest share, at most one over :data:`SHY`, of a step in which nothing falls below zero."""
    both, change = np.concatenate([x, opening]), np.concatenate([moved, opened])
    falls = change < 0.0
    return float(np.min(-both[falls] / change[falls], initial=1.0 / SHY))


# -- friction ------------------------------------------------------------------------------------------


def _rough(matrix: Sparse, b: Array, begin: Array, least: float, friction: Friction) -> Array | None:
    """The solution with friction; None where none is found."""
    found = _by_newton_with_friction(matrix, b, begin, least, friction)
    if found is not None:
        return found
    across = np.setdiff1d(np.arange(len(b)), friction.along)
    alone = _smooth(matrix[:, across][across].tocsc(), b[across], begin[across], least)
    x = begin.copy()
    if alone is not None:
        x[:] = 0.0
        x[across] = alone
    rows = matrix.tocsr()
    for _ in range(TRIES):
        found = _by_newton_with_friction(matrix, b, x, least, friction)
        if found is not None:
            break
        nearer = _one_by_one(rows, b, x, friction)
        if nearer is None:
            break
        x = nearer
    return found


def _allowed(wished: Array, most: Array) -> Array:
    """Forces (k, directions) nearest to those wished that are no larger than ``most`` (k,)."""
    size = np.linalg.norm(wished, axis=1)
    return wished * np.where(size > most, most / np.maximum(size, TINY), 1.0)[:, None]


def _by_newton_with_friction(matrix: Sparse, b: Array, begin: Array, least: float, friction: Friction) -> Array | None:
    """Newton's method on complementarity and Coulomb's law; None where it does not end soon."""
    from scipy.sparse.linalg import splu

    n, across, along, mu = len(b), friction.across, friction.along, friction.coefficients
    width, normal = along.shape[1], np.setdiff1d(np.arange(n), along)
    x = begin
    for _ in range(2 * FEW):
        opening = matrix @ x + b
        wished, most = x[along] - opening[along], mu * np.maximum(x[across], 0.0)
        missed = max(
            float(np.abs(np.minimum(x[normal], opening[normal])).max(initial=0.0)),
            float(np.abs(x[along] - _allowed(wished, most)).max(initial=0.0)),
        )
        if missed <= least:
            x = x.copy()
            x[normal] = np.maximum(x[normal], 0.0)
            x[along] = _allowed(x[along], mu * x[across])
            return x
        pushes = np.zeros(n, bool)
        pushes[normal] = x[normal] > opening[normal]
        touches = pushes[across]
        pushes[along] = touches[:, None]
        chosen = np.flatnonzero(pushes)
        x = np.zeros(n)
        if not len(chosen):
            continue
        size = np.linalg.norm(wished, axis=1)
        slides = np.flatnonzero(touches & (size > most))
        way, share = wished[slides] / size[slides, None], most[slides] / size[slides]
        # Where it slides: y - mu x way - share (the part of y - v across the way) = 0; else an opening vanishes.
        turned = share[:, None, None] * (np.eye(width) - way[:, :, None] * way[:, None, :])
        open_of = np.ones(n)
        open_of[along[slides]] = 0.0
        here = np.flatnonzero(open_of)
        row, column = np.repeat(along[slides], width, axis=1), np.tile(along[slides], width)
        parts = (here, here, np.ones(len(here))), (row.ravel(), column.ravel(), turned.ravel())
        of_open = _matrix(parts, n)
        parts = (
            (row.ravel(), column.ravel(), (np.eye(width) - turned).ravel()),
            (along[slides].ravel(), np.repeat(across[slides], width), -(mu[slides, None] * way).ravel()),
        )
        whole = (of_open @ matrix + _matrix(parts, n)).tocsc()
        try:
            x[chosen] = splu(whole[:, chosen][chosen]).solve(-(of_open @ b)[chosen])
        except RuntimeError:
            return None
        if not np.isfinite(x).all():
            return None
    return None


def _matrix(parts: tuple[tuple[Array, Array, Array], ...], size: int) -> Sparse:
    """A square matrix of entries: rows, columns and values."""
    from scipy.sparse import coo_matrix

    rows, columns, values = (np.concatenate(part) for part in zip(*parts, strict=True))
    return coo_matrix((values, (rows, columns)), shape=(size, size)).tocsr()


def _one_by_one(matrix: Sparse, b: Array, begin: Array, friction: Friction) -> Array | None:
    """Rounds over all contacts, each of which is solved by itself; None where they lead away."""
    x, where = begin.copy(), {int(row): k for k, row in enumerate(friction.across)}
    stiff = [float(np.linalg.eigvalsh(_symmetric(matrix, own)).max(initial=TINY)) for own in friction.along]
    diagonal, normal = matrix.diagonal(), np.setdiff1d(np.arange(len(b)), friction.along).tolist()
    # Each of them alone asks for no more at first.
    farthest = float(np.abs(begin).max()) + float((np.abs(b) / np.maximum(np.abs(diagonal), TINY)).max())

    def opening(row: int) -> float:
        begin, end = matrix.indptr[row : row + 2]
        return float(matrix.data[begin:end] @ x[matrix.indices[begin:end]] + b[row])

    for _ in range(ROUNDS):
        for i in normal:
            x[i] = max(0.0, x[i] - opening(i) / diagonal[i])
            if i in where:
                k = where[i]
                own = friction.along[k]
                wished = x[own] - np.array([opening(j) for j in own.tolist()]) / stiff[k]
                x[own] = _allowed(wished[None], friction.coefficients[k : k + 1] * x[i])[0]
        if not np.abs(x).max() < AWAY * farthest:
            return None
    return x


def _symmetric(matrix: Sparse, own: Index) -> Array:
    """The symmetric part of a block on the diagonal."""
    block = matrix[own][:, own].toarray()
    return np.asarray(0.5 * (block + block.T))
