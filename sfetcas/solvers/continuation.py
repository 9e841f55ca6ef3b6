"""Following an equilibrium while loads and motions grow together from zero.

Nobody has to prescribe load steps; this is a check, and it costs a few Newton iterations.  The library asks
which of several equilibria the growing loads lead to: the state is followed from the undeformed scene in as
few steps as Newton's method allows, the inertia is counted at each of them, and where the state ceases to be
stable it is left along its unstable mode.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import SolveError
from ..mechanics.equations import State
from ..mechanics.loading import Loading
from ..mechanics.model import Model
from .prepared import Prepared, Solved

__all__ = ["JUMPED", "NARROW", "Followed", "between", "follow", "near_factor"]

STEP_ROTATION = 0.4
"""A step is too long when its corrections turn a node by more than this, rad."""

CONTRACTION = 0.35
"""... or do not shrink at least by this from one to the next."""

SHORTEST = 1e-4
"""Steps below this share of the way done end the search on this branch."""

LEAST_STEP = 1e-12
"""The first step is never below this part of the way."""

HALF_TURN, LINEAR = np.pi, 1e-3
"""A step turns a node by at most half a turn, rad, beyond which Newton's method may end whole turns away as well as it
ends here, unless its corrections, rad, show that the answer is linear; where turns are counted also then."""

UNBALANCED, STILL = 1e-4, 1e-3
"""Part of the way of a first step that need not be shorter where the second of its corrections is this share of the
first, and equilibrium is missed all the same: no unknown carries the loads."""

NARROW = 0.02
"""The share of the way done at which a stable and an unstable state are near enough to leave between them."""

BLOCKED = 1e-3
"""Part of the way of a step that is short enough to end the way where it is not allowed."""

TRAVEL = 0.5
"""A step moves nothing that is driven by more than this, in lengths of the scene, and turns it by a radian at most."""

FARTHEST = 200.0
"""So many of these steps a way has at most: what is driven on beyond, in the plane, takes longer ones."""

CREPT, CREEPS = 1e-3, 3
"""What lands this near, rad, has left nothing; so many times it happens by chance, and else the way leads nowhere."""

MOST = 400
"""Steps tried before giving up."""

AROUND = 20
"""Steps more for each that driven motions ask for at least: a snap that a radian brings takes so many to find."""

MOST_WITHOUT_POTENTIAL = 6000
"""Steps tried before giving up where loads cannot be minimised, so that there is no other way to the answer.

A follower of 1e4 EI/L^2 swings a cantilever through 4,000 steps.
"""


@dataclass(frozen=True)
class Followed:
    """Result of :func:`follow`.

    Attributes
    ----------
    state : State
        State at the end of the way, or where it was lost.
    reached : bool
        Whether the end of the way was reached.
    left : tuple of float
        Parts of the way at which an unstable equilibrium was left.
    """

    state: State
    reached: bool
    left: tuple[float, ...]


def between(model: Model, begin: float, end: float) -> Callable[[float], Loading]:
    """The way from one factor to another, which at 1 is exactly that one."""
    return lambda t: model.loading(end if t == 1.0 else begin + t * (end - begin))


def near_factor(factor: float) -> str:
    """Where on the way of the loads a state was left, which is known to a few percent."""
    return f"near factor {factor:.3g}"


JUMPED = "left an unstable equilibrium there along its unstable mode"
"""What became of it."""


def follow(
    prepared: Prepared,
    way: Callable[[float], Loading],
    state: State,
    *,
    switch_branch: bool = True,
    allowed: Callable[[Solved, Solved], bool] | None = None,
    refuse: Callable[[Solved], None] | None = None,
) -> Followed:
    """Natural-parameter continuation from ``way(0)``, where ``state`` is an equilibrium, to ``way(1)``.

    Steps are corrected by Newton's method and shortened where its corrections are long or do not shrink; the inertia is
    counted at each point.  With ``switch_branch=False`` a state that becomes unstable is followed on, as far as
    Newton's method carries.  A step that is not ``allowed`` from one equilibrium to the next is too long, and where
    short ones are not either the way ends.  ``refuse`` is shown each, and raises where there is no sense in going on.
    """
    # What is driven may meet on its way what snaps, and in space a whole turn looks like none.
    whole = way(1.0).plus(way(0.0).scaled(-1.0))
    turn = max(float(np.linalg.norm(whole.turn, axis=1).max(initial=0.0)), whole.driven)
    driven = min(max(turn, float(np.abs(whole.shift).max(initial=0.0)) / TRAVEL, 1.0), FARTHEST)
    longest = 1.0 / max(turn if prepared.model.space else 0.0, driven)
    done, step = 0.0, 0.5
    left: list[float] = []
    crept = 0
    now = prepared.correct(state, way(0.0))

    def free(there: Solved) -> bool:
        return allowed is None or allowed(now, there)

    tries = MOST + int(AROUND * driven) if prepared.model.minimisable else MOST_WITHOUT_POTENTIAL
    for _ in range(tries):
        if done >= 1.0:
            return Followed(now.state, True, tuple(left))
        step = min(step, longest)
        trial = min(1.0, done + step)
        there = prepared.correct(
            now.state, way(trial), most=STEP_ROTATION, contraction=CONTRACTION, tangent=now.point.entries
        )
        far = there.first > HALF_TURN and (prepared.model.unwrapping.count > 0 or there.second > LINEAR)
        good = there.converged and not far
        if good and not free(there):
            if step <= BLOCKED:
                break
            step *= 0.5 if there.first < 2.0 * STEP_ROTATION else 0.25
            continue
        unstable = _unstable(there) if good and switch_branch else 0
        if not good or unstable is None:
            if done == 0.0 and step <= UNBALANCED and there.second < STILL * there.first and not far:
                # No step moves the state any more, and something is out of balance, in a short step as in a long one.
                break
            if step > max(SHORTEST * done, LEAST_STEP):
                step *= 0.1 if done == 0.0 else 0.5 if there.iterations > 2 else 0.25
                continue
            # What is no equilibrium has no unstable mode, whatever a first step balances to rounding.
            if not switch_branch or not now.converged:
                break
            trial = min(1.0, done * (1.0 + 10.0 * SHORTEST) + LEAST_STEP)
            snapped = _switched(now, way(trial))
            if snapped is None or not free(snapped):
                break
            crept += prepared.distance(snapped.state, now.state) < CREPT
            if crept > CREEPS:
                break
            now = snapped
            left.append(done)
            done, step = trial, 0.1
            continue
        if unstable > 0:
            if trial - done > NARROW * done:
                step = 0.5 * (trial - done)
                continue
            switched = _switched(there, there.loading)
            if switched is None or not free(switched):
                break
            there = switched
            left.append(trial)
            step = 0.1
        now, done = there, trial
        if refuse is not None:
            refuse(now)
        step *= 4.0 if there.second < 0.05 else 2.0
    return Followed(now.state, done >= 1.0, tuple(left))


def _unstable(found: Solved) -> int | None:
    """Negative eigenvalues; None where forces without bound meet closings that no unknown changes, by rounding."""
    try:
        return found.negative
    except SolveError:
        return None


def _switched(found: Solved, loading: Loading) -> Solved | None:
    try:
        return found.prepared.switch_branch(found, loading)
    except SolveError:
        return None
