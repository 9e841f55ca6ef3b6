"""The globalised Newton method on the equations as they are evaluated in process: nothing is made for a model."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import tolerances
from ..mathematics.arrays import Array, Index
from ..mathematics.core import Rules as CoreRules
from ..mathematics.core import doubles
from ..mathematics.linear import InertiaSolver, SparseSolver
from ..mechanics.equations import Equations, State
from ..mechanics.loading import Loading
from .globalised import Code, Globalised, Shifts
from .residuals import LEAST_SCALE, relative_residual

__all__ = ["Evaluated"]


SAME = (
    *("rounds", "halvings", "sweeps", "converged", "rounding", "gain", "turn", "near", "proximal", "soft", "hard"),
    *("firm", "firmer", "left", "armijo", "noise", "nudge", "far"),
)
"""Rules that the core has by the same names."""


class Evaluated:
    """The operations of :class:`~sfetcas.solvers.globalised.Method` by the equations of a model.

    What is given is a :class:`~sfetcas.mechanics.loading.Loading`, a state a
    :class:`~sfetcas.mechanics.equations.State`.
    """

    def __init__(self, equations: Equations) -> None:
        self.equations, self.model = equations, equations.model
        self._first = equations.start(self.model.loading(0.0, 0.0))

    @property
    def states(self) -> int:
        """Numbers of a state."""
        return len(self.flattened(self._first))

    @property
    def diagonal(self) -> Index:
        """Positions of the diagonal among the entries of the matrix."""
        return self.equations.diagonal

    def systems(self, shifts: Shifts, *, factors: bool, pivoted: bool) -> _Systems:
        """Linear systems."""
        return _Systems(self.equations, shifts, pivoted=pivoted)

    def is_finite(self, given: Loading) -> bool:
        """Whether all that is given is."""
        return bool(np.isfinite(self.equations.given(given)).all() and np.isfinite(given.turn).all())

    def turns(self, given: Loading) -> bool:
        """Whether there are moments."""
        return bool(given.of(lambda kind: kind.is_couple))

    def taken(self, given: Loading) -> Loading:
        """The same."""
        return given

    def shared(self, given: Loading, share: float) -> Loading:
        """The same with a share of all loads and motions."""
        return given.scaled(share)

    def standing(self, flat: Array) -> State:
        """The state of a vector (states,)."""
        q, y, lam, unwrapped = np.split(flat, np.cumsum([part.size for part in vars(self._first).values()])[:-1])
        return State(q.reshape(self._first.q.shape), y, lam, unwrapped)

    def flattened(self, state: State) -> Array:
        """The vector (states,) of a state."""
        return np.concatenate([part.ravel() for part in vars(state).values()])

    def multipliers(self, state: State) -> Array:
        """Its multipliers (rows,)."""
        return state.lam

    def begin(self, given: Loading) -> State:
        """The undeformed state with prescribed rotations at their values."""
        return self.equations.start(given)

    def hold(self, state: State, given: Loading) -> State:
        """A state with prescribed rotations at their values."""
        return self.equations.holding(state, given)

    def at(self, state: State, given: Loading) -> tuple[Array, float, float, float, Array]:
        """Residual (total,), relative residual, potential, sum of gaps, and entries of the matrix."""
        point = self.equations.at(state, given)
        gaps = float(np.abs(point.residual[self.equations.unknowns :]).sum())
        return point.residual, relative_residual(self.equations, point), point.potential, gaps, point.entries

    def merit(self, state: State, given: Loading) -> tuple[float, float]:
        """Potential and sum of gaps."""
        return self.at(state, given)[2:4]

    def convex(self, state: State, given: Loading) -> Array:
        """Entries of the matrix with positive matrices of the elements."""
        return self.equations.convex_entries(state, given)

    def seek(
        self, method: Globalised, state: State, given: Loading, whole: int, left: int
    ) -> tuple[Code, State, float, int, int] | None:
        """By the core: see :meth:`.Method.seek`."""
        equations, rules = self.equations, method.rules
        if not equations.by_core:
            return None
        matrices = equations.positive_matrices
        if matrices is None and self.model.mesh.elements:
            return None
        tape, slots, stiffness, alive = matrices or (None, np.empty(0), 0, [])
        mass, sides = doubles(method.mass), doubles(method.soft)
        # The shape that unstable equilibria are left along is made where there is one.
        for escapes in (0, rules.escapes) if rules.escapes and not whole else (0,):
            seed = doubles(method.seed) if escapes else mass
            known = CoreRules(
                mass=mass.ctypes.data,
                sides=sides.ctypes.data,
                seed=seed.ctypes.data,
                convex=tape,
                slots=slots.ctypes.data,
                stiffness=stiffness,
                escapes=escapes,
                symmetric=self.model.has_potential,
                pivoted=method.pivoted,
                free=not self.turns(given),
                sliding=self.model.mesh.sliding,
                level=tolerances.LEVEL,
                least=LEAST_SCALE,
                **{name: getattr(rules, name) for name in SAME},
            )
            found = equations.sought(state, given, known, whole, left)
            if found is None:
                return None
            state, sought = found
            left = sought.left
            if sought.status != Code.UNSTABLE:
                break
        del alive
        return Code(sought.status), state, sought.residual, sought.negative, left

    def move(self, state: State, step: Array, share: float) -> State:
        """The state after a share of a step (total,)."""
        return self.equations.moved(state, share * step)


class _Systems:
    """Linear systems by the solvers of the equations."""

    def __init__(self, equations: Equations, shifts: Shifts, *, pivoted: bool) -> None:
        self._equations, self._shifts, self._pivoted = equations, shifts, pivoted
        total, row, column = equations.total, equations.row, equations.column
        self._solver: Any = SparseSolver(total, row, column, equations.rows, symmetric=False) if pivoted else None
        self._factors = InertiaSolver(total, row, column)

    def shift(self, entries: Array, firm: float, share: float) -> None:
        self._target, self._matrix = self._shifts.shifted(entries, firm, share)

    def negative(self) -> int | None:
        try:
            self._factors.factor(self._matrix)
        except np.linalg.LinAlgError:
            return None
        return self._factors.negative()

    def backward(self, b: Array) -> Array:
        try:
            if not self._pivoted:
                return np.asarray(self._factors.solve(b[:, None])[:, 0])
            self._solver.factor(self._matrix)
            return np.asarray(self._solver.solve(b))
        except np.linalg.LinAlgError:
            return np.full(b.shape, np.nan)

    def left(self, x: Array, b: Array) -> Array:
        given = self._target * x[self._equations.column]
        return np.asarray(b - np.bincount(self._equations.row, weights=given, minlength=len(b)))
