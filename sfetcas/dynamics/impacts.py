"""Impacts: the velocities after impulses along rows that act on one side only, at one instant.

Velocities ``w`` of the unknowns change by impulses ``p`` along the rows ``H`` that act or close, so that none closes
further,

    M (w+ - w) = H^T p,      p >= 0,      H w+ >= -e H w,      p . (H w+ + e H w) = 0,

where ``e`` is the restitution of each row, and zero of one that opens.  Rows ``G`` of all other constraints hold before
and after, with impulses of either sign.  Without restitution it is the velocity nearest to ``w`` in the metric of the
masses ``M`` that all rows allow (Gauss's principle of least constraint).  What is lost, ``1/2 w.M w - 1/2 w+.M w+`` as
seen from the rows, is not below zero where all ``e`` are alike; where they differ and it would be, the least of them
counts for all.  Where several rows act the impulses are those of a least-squares problem with bounds.  Where obstacles
rub there are further impulses along them, see :mod:`~sfetcas.dynamics.rough_impacts`.

Source: Moreau, Unilateral contact and dry friction in finite freedom dynamics, in: Nonsmooth Mechanics and
Applications, CISM 302 (1988); Lawson and Hanson, Solving Least Squares Problems (1974), chapter 23.
"""

from __future__ import annotations

import functools

import casadi as ca
import numpy as np

from ..errors import SolveError, Status
from ..mathematics.arrays import TINY, Array, Index
from ..mathematics.complementarity import by_pivots
from ..mechanics.equations import State
from .rough_impacts import Rough, rough_impulses
from .stages import StageEquations
from .taken import Memory

__all__ = ["Collision", "Impacts"]


class Impacts:
    """Masses and rows of a system with unilateral constraints, at any state."""

    def __init__(self, system: StageEquations) -> None:
        self.system = system

    def at(self, memory: Memory) -> Collision:
        """What an impact at a state would do."""
        return Collision(self, memory)

    @functools.cached_property
    def momenta(self) -> ca.Function:
        """(q, y, factors, unwrapped, v) -> Jacobian of the rows, masses of the unknowns, and their momenta.

        The momenta are those of velocities v of the quantities.
        """
        system, n = self.system, self.system.layout
        q, y, v = ca.MX.sym("q", n.components, n.rotations), ca.MX.sym("y", n.y), ca.MX.sym("v", n.x)
        factors, unwrapped = ca.MX.sym("factors", n.factors), ca.MX.sym("unwrapped", n.unwrapped)
        found = system.momenta(q, y, factors, unwrapped, v)
        return ca.Function("momenta", [q, y, factors, unwrapped, v], list(found))


class Collision:
    """Masses and rows at a state, and the velocities after impulses along the rows."""

    def __init__(self, impacts: Impacts, memory: Memory) -> None:
        system, unit = impacts.system, impacts.system.masses.time
        unilateral = system.unilateral
        self._system, self._rows, self._signs = system, unilateral.rows, unilateral.signs
        self._restitution, self._rubbing = unilateral.restitution, system.rubbing
        # What sticks does so before and after what happens elsewhere, unless an impulse moves it.
        self._sticks = np.zeros(0, bool) if memory.rubs is None else memory.rubs.sticks > 0.0
        self._state = State(memory.q, memory.y, memory.lam, memory.unwrapped)
        self._factors = system.factors(memory.t)
        rates = [0.0 if history is None else history.rate(memory.t * unit) for history in system.histories]
        self._faster = np.array(rates) * unit
        still = np.zeros(system.equations.unknowns)
        _, drift, _, self._opening = system.rates_in_time(self._state, self._factors, still, self._faster)
        given = self._state.q.T, memory.y, self._factors, system.counted(self._state)
        rows, mass, momentum = (np.array(part) for part in impacts.momenta(*given, memory.rates[0] - drift))
        # In units in which each unknown has the mass one, but where it has next to none.
        diagonal = np.abs(np.diag(mass))
        self._unit = 1.0 / np.sqrt(np.maximum(diagonal, LIGHT * diagonal.max(initial=TINY)))
        self._jacobian, self._momentum = rows * self._unit, momentum.ravel() * self._unit
        self._mass = mass * self._unit * self._unit[:, None] + MASSLESS * np.eye(len(mass))

    @functools.cached_property
    def _always(self) -> Index:
        """The rows that are on no side."""
        return np.setdiff1d(np.arange(len(self._jacobian)), self._system.switching)

    def _allowed(self, before: Array, still: Array | None = None) -> Array:
        """The nearest velocities (unknowns,) at which no row opens or closes that acts, and nothing moves that sticks.

        ``still`` (m,) of bool are the places that stick; by default those that do in the state.
        """
        held = np.concatenate([self._always, self._rows[before]])
        if self._rubbing is not None:
            still = self._sticks if still is None else still
            held = np.concatenate([held, self._rubbing.rows[still & before[self._rubbing.of]].ravel()])
        return self._onto(held, self._momentum[:, None], -self._opening[held])[:, 0]

    def speeds(self, before: Array, closes: Array) -> Array:
        """The speeds (rows,) with which rows close, zero of others; arguments as of :meth:`solved`."""
        found = np.zeros(len(closes))
        if closes.any():
            rows = self._rows[closes]
            moved = self._jacobian[rows] @ self._allowed(before) + self._opening[rows]
            found[closes] = self._signs[closes] * moved
        return found

    def nearest(self, acting: Array, still: Array | None = None) -> Array:
        """The nearest velocities (quantities,) that acting rows (rows,) and places that stick (m,), of bool, allow."""
        return self._velocities(self._allowed(acting, still))

    def held_back(self, before: Array, rests: Array) -> float:
        """The energy that is lost where rows (rows,) of bool come to rest beside those that act before."""
        if not rests.any():
            return 0.0
        free, held = (0.5 * float(w @ self._mass @ w) for w in (self._allowed(before), self._allowed(before | rests)))
        return max(0.0, free - held)

    def independent(self, acting: Array, sticks: Array, pushes: Array) -> Array:
        """Which rows (m, axes - 1), 1 or 0, hold places that stick, none of which follows from others.

        ``acting`` (rows,) and ``sticks`` (m,) are of bool; rows of places with the largest ``pushes`` (m,) come first.
        """
        assert self._rubbing is not None
        jacobian = self._jacobian / np.maximum(np.linalg.norm(self._jacobian, axis=1), TINY)[:, None]
        held = np.linalg.svd(jacobian[np.concatenate([self._always, self._rows[acting]])], full_matrices=False)
        known = list(held[2][held[1] > DEPENDENT])
        found = np.zeros(self._rubbing.rows.shape)
        for k in sorted(np.flatnonzero(sticks).tolist(), key=lambda k: -pushes[k]):
            for i, row in enumerate(self._rubbing.rows[k].tolist()):
                rest = jacobian[row]
                for _ in range(2):
                    rest = rest - sum((one * (one @ rest) for one in known), np.zeros(len(rest)))
                if (size := float(np.linalg.norm(rest))) > DEPENDENT:
                    known.append(rest / size)
                    found[k, i] = 1.0
        return found

    def _velocities(self, w: Array) -> Array:
        """Velocities (quantities,) for those of the unknowns in their units."""
        return self._system.rates_in_time(self._state, self._factors, w * self._unit, self._faster)[1]

    def solved(self, before: Array, closes: Array, quiet: Array | None = None) -> tuple[Array, Array, Array, float]:
        """Velocities (quantities,) after the event, impulses, which rows touch then, and the energy that is lost.

        ``before`` and ``closes`` are the rows that act and those that close, (rows,) of bool; ``quiet`` those of them
        that do not rebound, whatever their restitution.
        """
        always = self._always
        w = self._allowed(before)
        silent = np.zeros(len(before), bool) if quiet is None else quiet
        impulses, taking, lost = np.zeros(len(before)), np.flatnonzero(before | closes), 0.0
        touching = before.copy()
        if closes.any():
            chosen = self._signs[taking, None] * self._jacobian[self._rows[taking]]
            speed = chosen @ w + self._signs[taking] * self._opening[self._rows[taking]]
            # Rows that act do not move, and what moves so slowly is rounding.
            speed[before[taking] | (np.abs(speed) < SLOW)] = 0.0
            restitution = np.where(silent, 0.0, self._restitution)[taking]
            along, rough = self._rough(taking)
            chosen = np.vstack([chosen, self._jacobian[along]])
            back = self._onto(always, chosen.T, np.zeros(len(always)))
            if rough:
                found, left, lost, rebound = self._rubbed(chosen @ back, speed, w, along, restitution, rough)
            else:
                found, left, lost, rebound = self._hit(chosen @ back, speed, restitution)
            w = w - back @ found
            found = found[: len(taking)]
            impulses[taking] = found
            slow = SLOW * max(1.0, float(np.abs(speed).max()))
            touching[taking] = ((found > 0.0) & (rebound <= slow)) | (left > -slow)
        return self._velocities(w), impulses, touching, lost

    def pressing(self, touching: Array, opening: Array) -> Array:
        """Which of the rows (rows,) that touch push, of bool.

        ``opening`` (rows,) are the accelerations with which rows open where none pushes.
        """
        taking, found = np.flatnonzero(touching), np.zeros(len(touching), bool)
        rows = self._signs[taking, None] * self._jacobian[self._rows[taking]]
        back = self._onto(self._always, rows.T, np.zeros(len(self._always)))
        found[taking] = _pushing(rows @ back, -opening[taking]) > 0.0
        return found

    def _rough(self, taking: Index) -> tuple[Index, list[Rough]]:
        """Rows along the obstacles that rub, of the unilateral rows that take part, and how they belong together."""
        if self._rubbing is None:
            return np.zeros(0, np.intp), []
        here = np.flatnonzero(np.isin(self._rubbing.of, taking))
        along, each = self._rubbing.rows[here].ravel(), self._rubbing.rows.shape[1]
        rough = [
            Rough(
                int(np.flatnonzero(taking == self._rubbing.of[k])[0]),
                len(taking) + each * i + np.arange(each),
                float(self._rubbing.coefficients[k]),
            )
            for i, k in enumerate(here.tolist())
        ]
        return along, rough

    def _rubbed(
        self, yielding: Array, speed: Array, w: Array, along: Index, restitution: Array, rough: list[Rough]
    ) -> tuple[Array, Array, float, Array]:
        """As :meth:`_hit` with impulses along rows as well, in the order of ``yielding``."""
        n = len(speed)
        slip = self._jacobian[along] @ w + self._opening[along]
        slip[np.abs(slip) < SLOW] = 0.0
        # Rows are told by their speeds of closing, but their impulses open them.
        before = np.concatenate([-speed, slip])
        signs = np.concatenate([-np.ones(n), np.ones(len(along))])
        rebound = restitution * np.maximum(speed, 0.0)
        found, lost, rebound = rough_impulses(signs[:, None] * yielding * signs, before, rebound, rough)
        found = -signs * found
        return found, speed - yielding[:n] @ found, lost, rebound

    @staticmethod
    def _hit(yielding: Array, speed: Array, restitution: Array) -> tuple[Array, Array, float, Array]:
        """Impulses, speeds of closing after them, the energy that is lost, and the speeds of rebound, (n,) each."""
        closing = np.maximum(speed, 0.0)
        rebound = restitution * closing
        found = _pushing(yielding, speed + rebound)
        left = speed - yielding @ found
        lost = 0.5 * float(found @ (speed + left))
        if lost < 0.0 and rebound.any():
            rebound = restitution[speed > 0.0].min() * closing
            found = _pushing(yielding, speed + rebound)
            left = speed - yielding @ found
            lost = 0.5 * float(found @ (speed + left))
        return found, left, max(lost, 0.0), rebound

    def _onto(self, rows: Index, momenta: Array, opening: Array) -> Array:
        """Velocities (unknowns, n) for momenta (unknowns, n) under which rows open at given rates (rows,)."""
        from scipy.linalg import lu_factor, lu_solve

        held = self._jacobian[rows]
        size = np.maximum(np.linalg.norm(held, axis=1), TINY)
        held, n = held / size[:, None], len(self._mass)
        right = np.vstack([momenta, np.repeat((opening / size)[:, None], momenta.shape[1], axis=1)])
        matrix = np.block([[self._mass, held.T], [held, np.zeros((len(rows),) * 2)]])
        # Rows that depend on each other leave multipliers open: a small diagonal, which is then taken out again.
        regular = matrix - np.diag(np.repeat([0.0, DUAL], [n, len(rows)]))
        factors = lu_factor(regular)
        found = lu_solve(factors, right)
        for _ in range(REFINED):
            found += lu_solve(factors, right - matrix @ found)
        return np.asarray(found[:n])


def _pushing(yielding: Array, speed: Array) -> Array:
    """The impulses p (n,), none below zero, with ``speed - yielding p`` not above zero, and zero where p is not.

    ``yielding`` (n, n) is symmetric and has no eigenvalue below zero.
    """
    found = by_pivots(yielding, -speed)
    if found is None:
        raise SolveError(Status.FAILED, f"which of {len(speed)} impulses at one time push was not found")
    return found


SLOW = 1e-9
"""Speed of opening, over the largest closing speed or dimensionless, up to which a row stays closed in an impact."""

LIGHT, MASSLESS = 1e-6, 1e-12
"""Share of the largest mass below which an unknown keeps it in its unit, and of a unit that counts as no mass; and what
is divided by instead of zero.
"""

DEPENDENT = 1e-6
"""Length of what of a row's gradient, of length one, does not follow from others, up to which it follows from them."""

DUAL, REFINED = 1e-12, 3
"""Diagonal of the rows, whose gradients are of length one, and rounds in which what it does is taken out again."""
