"""Linear complementarity: forces that only push, and gaps that do not become less than none.

    x >= 0,      A x + b >= 0,      x . (A x + b) = 0

With few forces, or where what they do to each other is no energy: pivots, all wrong signs at once and, where that goes
round, Lemke's, which lead to a solution wherever ``A`` is of an energy, and mostly where it is not.

With many forces ``A`` is sparse.  Which forces push is mostly known from a problem like it: Newton's method on
``min(x, A x + b) = 0``, which lets all that is infeasible change sides at once, then ends within a few steps.  Where it
does not, an interior-point method leads to the solution in a number of steps that hardly grows.  Where rows depend on
each other a small diagonal makes the solution unique.  It multiplies the change from a solution that is near, so that
it has no part in where a sequence of such solutions ends.

Source: Lemke 1965 (pivots); Judice and Pires 1994 (blocks of them); Cottle, Pang and Stone 2009, The Linear
Complementarity Problem, sections 4.4 and 4.9; Kojima, Megiddo, Noma and Yoshise 1991, A unified approach to interior
point algorithms for linear complementarity problems; Mehrotra 1992 (doi 10.1137/0802028); Rockafellar 1976 (proximal
point).
"""

from __future__ import annotations

import numpy as np

from .arrays import TINY, Array, Sparse

__all__ = ["by_pivots", "complementary"]

YIELDING = 1e-7
"""Diagonal that is added, over the one that is there."""

NOTHING = 1e-11
"""Share of the largest diagonal below which one is none: of what moves as one body."""

SOLVED = 1e-11
"""Largest error, over the largest entry of ``b`` in the unit of each row, that is accepted."""

FEW, MOST = 15, 100
"""Steps of Newton's method, and of the interior-point method, at most."""

BLOCKS, PIVOTS = 8, 10
"""Block pivots without fewer wrong signs, after which single ones follow; of these at most as many over the number of
rows.
"""

BALANCED = 4
"""Rounds in which units of rows are found."""

ROUNDING, FLAT = 1e-11, 1e-9
"""Share of the largest number, all of them dimensionless, up to which a wrong sign is rounding, and of the largest of a
column up to which a pivot is none.
"""

SHY = 0.99
"""Share of the way to where a number would be zero that a step of the interior-point method goes."""


def complementary(matrix: Sparse, b: Array, near: Array) -> Array | None:
    """The solution x (n,) that is nearest to ``near`` (n,), a solution of a problem like it; None where none is found.

    ``matrix`` (n, n) has a symmetric part without negative eigenvalues.  What has no diagonal stays zero.

    Examples
    --------
    >>> from scipy.sparse import csc_matrix
    >>> complementary(csc_matrix([[2.0, 1.0], [1.0, 2.0]]), np.array([-2.0, 1.0]), np.zeros(2)).round(6).tolist()
    [1.0, 0.0]
    """
    from scipy.sparse import diags

    diagonal = matrix.diagonal()
    able = np.flatnonzero(diagonal > NOTHING * diagonal.max(initial=TINY))
    unit = 1.0 / np.sqrt(diagonal[able])
    scaled = diags(unit) @ matrix[:, able][able] @ diags(unit) + YIELDING * diags(np.ones(len(able)))
    begin = near[able] / unit
    right = unit * b[able] - YIELDING * begin
    least = SOLVED * np.abs(right).max(initial=TINY)
    x = _by_newton(scaled.tocsc(), right, begin, least)
    x = _from_inside(scaled.tocsc(), right, least) if x is None else x
    if x is None:
        return None
    found = np.zeros(len(b))
    found[able] = x * unit
    return found


def by_pivots(matrix: Array, b: Array) -> Array | None:
    """The solution x (n,) of a problem with a dense matrix (n, n); None where pivots lead to none that is accurate.

    Examples
    --------
    >>> by_pivots(np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-2.0, 1.0])).tolist()
    [1.0, 0.0]
    """
    try:
        return _by_pivots(matrix, b)
    except np.linalg.LinAlgError:
        return None


def _by_pivots(matrix: Array, b: Array) -> Array | None:
    chosen, best, blocks = np.zeros(len(b), bool), len(b) + 1, BLOCKS
    while blocks:
        x, wrong = _tried(matrix, b, chosen)
        if not wrong.any():
            return x
        count = int(wrong.sum())
        blocks = BLOCKS if count < best else blocks - 1
        best = min(best, count)
        chosen = chosen ^ wrong
    found = _by_single_pivots(matrix, b)
    if found is None:
        return None
    x, wrong = _tried(matrix, b, found)
    return None if wrong.any() else x


def _tried(matrix: Array, b: Array, chosen: Array) -> tuple[Array, Array]:
    """The numbers (n,) where only chosen ones may differ from zero, and which signs are wrong."""
    x, rest = np.zeros(len(b)), b.copy()
    if chosen.any():
        # Rows may depend on each other: then what they do together is unique.
        x[chosen] = np.linalg.lstsq(matrix[np.ix_(chosen, chosen)], -b[chosen], rcond=None)[0]
        rest += matrix[:, chosen] @ x[chosen]
    size = np.abs(np.concatenate([x, rest, b])).max(initial=0.0)
    return np.maximum(x, 0.0), np.where(chosen, x, rest) < -ROUNDING * size


def _by_single_pivots(matrix: Array, b: Array) -> Array | None:
    """Which numbers (n,) are not zero, by Lemke's pivots; None where they lead to no solution."""
    n, unit = len(b), np.ones(len(b))
    # Of rows of different units each has one in which its largest number is about one.
    for _ in range(BALANCED):
        largest = np.abs(unit[:, None] * matrix * unit).max(axis=1, initial=0.0)
        unit /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
    table = np.column_stack([np.eye(n), -unit[:, None] * matrix * unit, -np.ones(n), unit * b])
    basis, out, enters = np.arange(n), int(np.argmin(table[:, -1])), 2 * n
    size = np.abs(table[:, -1]).max(initial=0.0)
    if table[out, -1] >= 0.0:
        return np.zeros(n, bool)
    for _ in range(PIVOTS * n):
        table[out] /= table[out, enters]
        others = np.arange(n) != out
        table[others] -= np.outer(table[others, enters], table[out])
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
    from scipy.sparse.linalg import splu

    x, opening = begin, matrix @ begin + b
    for _ in range(FEW):
        pushes = x > opening
        chosen = np.flatnonzero(pushes)
        x = np.zeros(len(b))
        if len(chosen):
            x[chosen] = splu(matrix[:, chosen][chosen]).solve(-b[chosen])
        opening = matrix @ x + b
        if np.abs(np.minimum(x, opening)).max(initial=0.0) <= least:
            return np.maximum(x, 0.0)
    return None


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
