"""Equilibria in which some rows push one way only: which of them do is solved together with all else.

In each of Newton's steps the system is linear but for the choice: a row either acts, its gap zero and its push not
below zero, or it does not, its push zero and its gap not below zero.  With all other unknowns eliminated that is a
linear complementarity problem, which is solved by pivots from the rows that acted before, see
:mod:`~sfetcas.mathematics.complementarity`.  The factor of the loads may be one more unknown, and the place across a
direction one more equation, see :class:`Border`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from .. import tolerances
from ..mathematics.arrays import Array, Index
from ..mathematics.complementarity import by_pivots, needs_none
from ..mechanics.equations import Equations, Point, State
from ..mechanics.loading import Loading
from .newton import AtLoads, Balance

__all__ = ["IN_VAIN", "LASTING", "Border", "OneSided"]

AGAIN, TIMES = 1e-8, 2
"""Relative residual from which on a choice that was made so many times is taken: others differ from it by rounding."""

IN_VAIN, TURNS = 3, 7
"""Steps one after the other in which no choice of rows is right, or one more of the last ``TURNS`` where others come
between, after which no solution is taken to be near.
"""

ROUNDING = 1e-11
"""Share of the largest gap, and of the largest push, up to which a wrong sign is rounding."""


LASTING = 1e-9
"""Share of the largest push up to which another one is rounding."""


@dataclass(frozen=True)
class Border:
    """An unknown factor of the loads, and the equation ``row . step + share (change of the factor) = 0`` for it.

    Attributes
    ----------
    loading : callable
        Factor -> Loading.
    slope : callable
        (state, factor, point) -> derivative (total,) of the residual by the factor.
    row : ndarray (total,)
    share : float
    """

    loading: Callable[[float], Loading]
    slope: Callable[[State, float, Point], Array]
    row: Array
    share: float


@dataclass(frozen=True)
class OneSided(AtLoads):
    """An equilibrium under given loads with rows that push one way only.

    Attributes
    ----------
    pushing : ndarray (m,)
        Their numbers among all residuals and unknowns: a gap and minus a push, which is a multiplier; or, where
        friction has the push for an unknown, minus a gap and a push.
    acting : ndarray (m,) of bool
        Which of them act; kept up to date by :meth:`step`.
    still : ndarray (k,)
        Numbers of unknowns that stay as they are, as friction does that is not known yet.
    border : Border, optional
        Where the factor of the loads is an unknown.
    """

    pushing: Index = field(default_factory=lambda: np.zeros(0, np.intp))
    acting: Array = field(default_factory=lambda: np.zeros(0, bool))
    still: Index = field(default_factory=lambda: np.zeros(0, np.intp))
    border: Border | None = None
    _past: list[tuple[bytes, bool]] = field(default_factory=list)

    def loading(self, factor: float) -> Loading:
        """The given loads, or those at the factor where that is an unknown."""
        return self.loads if self.border is None else self.border.loading(factor)

    @property
    def _signs(self) -> Array:
        """Of pushes 1, of multipliers -1, and with the opposite sign of residuals: (m,)."""
        return np.where(self.pushing < self.equations.unknowns, 1.0, -1.0)

    def pushes(self, state: State) -> Array:
        """The pushes (m,) in a state."""
        values = np.concatenate([state.y, state.lam])
        return np.asarray(self._signs * values[self.pushing - self.equations.rotation_unknowns])

    def pushed(self, state: State) -> Array:
        """Which rows (m,) push in a state.

        What pushes by rounding may as well not: on another processor it does not.
        """
        pushes = np.where(self.acting, self.pushes(state), 0.0)
        return np.asarray(pushes > LASTING * pushes.max(initial=0.0))

    def seen(self, state: State, point: Point) -> Point:
        """The equations with pulls of rows that act, and gaps of those that do not where they are below zero."""
        seen = super().seen(state, point)
        residual, rows, pulls = seen.residual.copy(), self.pushing, -self.pushes(state)
        pulls = np.where(pulls > ROUNDING * np.abs(pulls).max(initial=0.0), pulls, 0.0)
        gaps = -self._signs * residual[rows]
        residual[rows] = np.where(self.acting, np.hypot(gaps, pulls), np.minimum(gaps, 0.0))
        residual[self.still] = 0.0
        return replace(seen, residual=residual)

    def step(self, here: Balance) -> Array:
        """Newton's step, dimensionless, to the rows that act then: (total,), or (total + 1,) with the factor last."""
        equations, rows, signs, forces = self.equations, self.pushing, self._signs, self.pushes(here.state)
        point = super().seen(here.state, here.plain)
        point = replace(point, residual=point.residual.copy())
        point.residual[self.still] = 0.0
        slope = np.zeros(equations.total)
        if self.border is not None:
            slope = self.border.slope(here.state, here.loading.factor, point)
        moved, factor = self._moved(point, slope)
        first = self._basic(here.state, point, moved, slope, factor)
        found: Array | None = np.zeros(len(rows))
        if not needs_none(first[:, 0]):
            # Only where another choice is to be made it matters what each row would change.
            moved, factor = self._moved(point, slope, every=True)
            basic = self._basic(here.state, point, moved, slope, factor)
            now = np.maximum(np.where(self.acting, forces, -signs * point.residual[rows]), 0.0)
            # Where pushes are unknowns what slips changes with them, which is not part of the choice of rows.
            found = by_pivots(basic[:, 1:], basic[:, 0], now if (signs < 0.0).all() else None)
        if found is not None:
            self.acting[found > 0.0] ^= True
        near = here.residual <= AGAIN
        self._past.append((self.acting.tobytes() if near else b"", found is not None))
        vain = [not known for _, known in self._past]
        if not near and (sum(vain[-IN_VAIN:]) == IN_VAIN or sum(vain[-TURNS:]) > IN_VAIN):
            raise np.linalg.LinAlgError("again and again no choice of rows is right")
        if found is None:
            return self._with_factor(moved[:, 0], factor[0])
        shares = np.append(1.0, found)[: moved.shape[1]]
        step = moved @ shares
        step[rows[~self.acting]] = -(signs * forces)[~self.acting]
        return self._with_factor(step, factor @ shares)

    def _with_factor(self, step: Array, factor: float) -> Array:
        step = self._without_flat(step)
        return step if self.border is None else np.append(step, factor)

    def _basic(self, state: State, point: Point, moved: Array, slope: Array, factor: Array) -> Array:
        """Pushes of rows that act, and gaps of those that do not, after each of the steps of :meth:`_moved`: (m, k)."""
        rows, signs = self.pushing, self._signs
        gaps = _times(self.equations, point.entries, moved, rows) + np.outer(slope[rows], factor)
        gaps[:, 0] += point.residual[rows]
        gaps, pushes = -signs[:, None] * gaps, signs[:, None] * moved[rows]
        pushes[:, 0] += self.pushes(state)
        return np.where(self.acting[:, None], pushes, gaps)

    def _moved(self, point: Point, slope: Array, *, every: bool = False) -> tuple[Array, Array]:
        """Newton's step with the rows that act, and with ``every`` what a push of each other row, or a gap of each of
        these, changes: columns (total, 1 + m), and the change of the factor with each (1 + m,).
        """
        equations, rows = self.equations, self.pushing
        idle = np.zeros(equations.total, bool)
        idle[rows[~self.acting]] = True
        entries = np.where(idle[equations.row] | idle[equations.column], 0.0, point.entries)
        kept = np.zeros(equations.total, bool)
        kept[self.still] = True
        entries[kept[equations.row]] = 0.0
        entries[equations.diagonal[np.append(rows[~self.acting], self.still)]] = -1.0
        equations.solver.factor(equations.regularised(entries, tolerances.PROXIMAL * self.weight, tolerances.DUAL))
        right = np.zeros((equations.total, 2 + every * len(rows)))
        right[:, 0], right[:, -1] = np.where(idle, 0.0, -point.residual), np.where(idle, 0.0, -slope)
        if every:
            number = np.zeros(equations.total, np.intp)
            number[rows] = np.arange(1, len(rows) + 1)
            right[rows[self.acting], number[rows[self.acting]]] = -self._signs[self.acting]
            mine = idle[equations.column] & ~(idle | kept)[equations.row]
            column = number[equations.column[mine]]
            right[equations.row[mine], column] = -self._signs[column - 1] * point.entries[mine]
        moved = equations.solver.solve(right)
        moved, rate = moved[:, :-1], moved[:, -1]
        if self.border is None:
            return moved, np.zeros(moved.shape[1])
        factor = -(self.border.row @ moved) / (float(self.border.row @ rate) + self.border.share)
        return moved + np.outer(rate, factor), factor

    def for_core(self) -> None:
        """None: the core does not know what pushes."""
        return

    def suffices(self, here: Balance) -> bool:
        """Whether choices come again and again that differ by rounding."""
        close = [chosen for chosen, _ in self._past if chosen]
        return here.residual <= AGAIN and max(map(close.count, close), default=0) > TIMES

    @property
    def complete(self) -> bool:
        """False: rows that do not act have gaps."""
        return False


def _times(equations: Equations, entries: Array, x: Array, chosen: Index) -> Array:
    """Chosen rows of the Newton matrix times x (total, k): (chosen, k)."""
    place = np.full(len(x), -1)
    place[chosen] = np.arange(len(chosen))
    mine = place[equations.row] >= 0
    found = np.zeros((len(chosen), x.shape[1]))
    np.add.at(found, place[equations.row[mine]], entries[mine, None] * x[equations.column[mine]])
    return found
