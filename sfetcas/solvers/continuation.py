"""Continuation: the loop of all step by step ways, and the way of an equilibrium as loads and motions grow.

Nobody has to prescribe load steps.  :func:`follow` tells which of several equilibria growing loads lead to: the state
is followed in as few steps as Newton's method allows, negative eigenvalues are counted at each of them, and where the
state ceases to be stable it is left along its unstable mode.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from .. import tolerances
from ..errors import SolveError
from ..mathematics.core import Way
from ..mechanics.equations import State
from ..mechanics.loading import Loading
from ..mechanics.model import Model
from .newton import Limits
from .prepared import Prepared, Solved
from .redundancy import redundant
from .residuals import relative_residual

__all__ = [
    "CONTRACTION",
    "FARTHEST",
    "JUMPED",
    "NARROW",
    "STEP_ROTATION",
    "TRAVEL",
    "Followed",
    "advanced",
    "between",
    "follow",
    "near_factor",
    "plain_way",
]

STEP_ROTATION = 0.4
"""A step is too long when its corrections turn a node by more than this, rad."""

CONTRACTION = 0.35
"""... or do not shrink at least by this from one to the next."""

FIRST, BRIEF = 0.5, 0.05
"""Part of the way of the first step; below a second correction of so much, rad, steps grow by four, else by two."""

SHORTEST = 1e-4
"""Steps below this share of the way done end the search on this branch."""

LEAST_STEP = 1e-12
"""The first step is never below this part of the way."""

HALF_TURN, LINEAR = np.pi, 1e-3
"""The first correction of a step rotates a node by at most half a turn, rad: beyond that Newton's method may end whole
turns away.  A second correction below the second number, rad, shows that the answer is linear, and any first one is
taken, but where the scene has angles that count turns."""

UNBALANCED, STILL = 1e-4, 1e-3
"""A first step of at most this part of the way, whose second correction is less than this share of its first and that
still does not converge, ends the way: the state does not move any more, so no unknown carries the loads."""

NARROW = 0.02
"""The share of the way done at which a stable and an unstable state are near enough to leave between them."""

BLOCKED = 1e-3
"""Part of the way of a step that is short enough to end the way where it is not allowed."""

TRAVEL = 0.5
"""A step moves nothing that is driven by more than this, in lengths of the scene, and turns it by a radian at most."""

FARTHEST = 200.0
"""So many of these steps a way has at most: what is driven on beyond, in the plane, takes longer ones."""

CREPT, CREEPS = 1e-3, 3
"""Leaving an unstable state that ends within the first number, rad, of where it began has not left it; the way ends
when this happens more often than the second number says."""

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
"""What a note says of a place on the way where a state was left."""


Point = TypeVar("Point")


def advanced(
    point: Point,
    length: float,
    trial: Callable[[Point, float], tuple[Point | None, float]],
    arrived: Callable[[Point], bool],
    *,
    shortest: float = 0.0,
    tries: int | None = None,
) -> tuple[Point, bool]:
    """The loop of all continuations: the last point reached, and whether that one has arrived.

    Parameters
    ----------
    point
        The first point of the way or curve.
    length : float
        Length of the first trial step, in any measure.
    trial : callable
        (point, length) -> the next point, or None if the step is refused, and the length of the next trial.
    arrived : callable
        Point -> whether the way ends there.
    shortest : float
        Steps that are not longer than this end the way; a trial gives it up with the length 0.
    tries : int, optional
        Largest number of trial steps.
    """
    for _ in itertools.count() if tries is None else range(tries):
        if arrived(point):
            return point, True
        if not length > shortest:
            return point, False
        there, length = trial(point, length)
        point = point if there is None else there
    return point, arrived(point)


def follow(
    prepared: Prepared,
    way: Callable[[float], Loading],
    state: State,
    *,
    switch_branch: bool = True,
    allowed: Callable[[Solved, Solved], bool] | None = None,
    refuse: Callable[[Solved], None] | None = None,
    contraction: float = CONTRACTION,
    proportional: bool | None = None,
) -> Followed:
    """Natural-parameter continuation from ``way(0)``, where ``state`` is an equilibrium, to ``way(1)``.

    Steps are corrected by Newton's method and shortened where its corrections are long or do not shrink; the inertia is
    counted at each point.  With ``switch_branch=False`` a state that becomes unstable is followed on, as far as
    Newton's method carries.  A step that is not ``allowed`` from one equilibrium to the next is too long, and where
    short ones are not either the way ends.  ``refuse`` is shown each, and raises where there is no sense in going on.
    Corrections shrink by ``contraction`` at least; an infinite one is for stiffnesses that jump at the
    beginning of any step.  ``proportional`` says whether loads are along the way; by default where there are no
    histories.
    """
    # What is driven may meet on its way what snaps, and in space a whole turn looks like none.
    whole = way(1.0).plus(way(0.0).scaled(-1.0))
    turn = whole.turned
    driven = min(max(turn, float(np.abs(whole.shift).max(initial=0.0)) / TRAVEL, 1.0), FARTHEST)
    longest = 1.0 / max(turn if prepared.model.space else 0.0, driven)
    tries = MOST + int(AROUND * driven) if prepared.model.minimisable else MOST_WITHOUT_POTENTIAL
    proportional = not prepared.model.scene.histories if proportional is None else proportional
    following = _Following(prepared, way, longest, switch_branch, allowed, refuse, contraction, proportional)
    begin = _On(_begun(prepared, state, way(0.0)), 0.0)
    plainly = following.plainly(begin, whole, tries)
    here, reached = advanced(*plainly[:2], following.trial, lambda here: here.done >= 1.0, tries=plainly[2])
    return Followed(here.found.state, reached, tuple(following.left))


def _begun(prepared: Prepared, state: State, loading: Loading) -> Solved:
    """An equilibrium from which loads are followed, corrected where it is none to rounding already."""
    begin, equations = Solved.taken(prepared, state, loading), prepared.equations
    if equations.rows and redundant(equations, begin.point):
        return prepared.correct(state, loading)
    exact = relative_residual(equations, begin.point) <= tolerances.EXACT
    return begin if exact else prepared.correct(state, loading)


def plain_way(contraction: float = CONTRACTION) -> tuple[Way, Limits]:
    """A way as the core follows it, and the limits of corrections on it; see :func:`follow`."""
    way = Way(
        done=0.0,
        step=FIRST,
        tries=MOST,
        longest=1.0,
        linear=LINEAR,
        unbalanced=UNBALANCED,
        still=STILL,
        shortest=SHORTEST,
        least=LEAST_STEP,
        brief=BRIEF,
    )
    return way, Limits(most=STEP_ROTATION, contraction=contraction)


@dataclass(frozen=True, eq=False)
class _On:
    """An equilibrium on a way of loads, and the part of the way that is done there."""

    found: Solved
    done: float


@dataclass(eq=False)
class _Following:
    """The steps of :func:`follow`, with its arguments.

    ``longest`` is that of a step, a part of the way; ``left`` and ``crept`` are the places at which an unstable
    equilibrium was left, and how often without moving.
    """

    prepared: Prepared
    way: Callable[[float], Loading]
    longest: float
    switch_branch: bool
    allowed: Callable[[Solved, Solved], bool] | None
    refuse: Callable[[Solved], None] | None
    contraction: float
    proportional: bool
    left: list[float] = field(default_factory=list)
    crept: int = 0

    def plainly(self, begin: _On, whole: Loading, tries: int) -> tuple[_On, float, int]:
        """What the core follows by itself: the last point, the length of the next step, and the trials that are left.

        It takes the decisions of :meth:`trial`, as long as loads are proportional and nothing comes near to being
        unstable.
        """
        prepared, model, usual = self.prepared, self.prepared.model, (begin, FIRST, tries)
        counted = self.switch_branch and prepared.switches_branch
        # The core sets rotations that motions prescribe, but no angles.
        angles = model.unwrapping.prescribed(model.rotations.kind, whole)
        proportional = self.proportional and (not whole.turned or np.isnan(angles).all())
        known = begin.found.converged and model.has_potential and self.allowed is None and self.refuse is None
        if not (proportional and known):
            return usual
        way, limits = plain_way(self.contraction)
        way.tries, way.longest = tries, self.longest
        found = prepared.followed(begin.found, whole, way, limits, counted=counted)
        if found is None:
            return usual
        if way.done == 0.0:
            return begin, way.step, way.tries
        return _On(Solved.taken(prepared, found[0], self.way(way.done)), way.done), way.step, way.tries

    def trial(self, here: _On, step: float) -> tuple[_On | None, float]:
        """The next point, None if the step is refused, and the length of the next step, parts of the way."""
        step = min(step, self.longest)
        trial = min(1.0, here.done + step)
        there = self.prepared.correct(
            here.found.state,
            self.way(trial),
            most=STEP_ROTATION,
            contraction=self.contraction,
            tangent=here.found.point.entries,
        )
        far = there.first > HALF_TURN and (self.prepared.model.unwrapping.count > 0 or there.second > LINEAR)
        good = there.converged and not far
        if good and not self._free(here, there):
            return None, 0.0 if step <= BLOCKED else step * (0.5 if there.first < 2.0 * STEP_ROTATION else 0.25)
        unstable = self._negative(there) if good and self.switch_branch else 0
        if not good or unstable is None:
            # Short steps may leave the state where it is and out of balance, just as long ones do.
            stuck = here.done == 0.0 and step <= UNBALANCED and there.second < STILL * there.first and not far
            if not stuck and step > max(SHORTEST * here.done, LEAST_STEP):
                return None, step * (0.1 if here.done == 0.0 else 0.5 if there.iterations > 2 else 0.25)
            return (None, 0.0) if stuck else self._snapped(here)
        following = step * (4.0 if there.second < BRIEF else 2.0)
        if unstable > 0:
            if trial - here.done > NARROW * here.done:
                return None, 0.5 * (trial - here.done)
            switched = self._switched(there, there.loading)
            if switched is None or not self._free(here, switched):
                return None, 0.0
            there, following = switched, 0.1 * (4.0 if switched.second < BRIEF else 2.0)
            self.left.append(trial)
        if self.refuse is not None:
            self.refuse(there)
        return _On(there, trial), following

    def _snapped(self, here: _On) -> tuple[_On | None, float]:
        """The stable state shortly beyond one that ends its branch, and the length of the next step."""
        # Only an equilibrium has an unstable mode.
        if not self.switch_branch or not here.found.converged:
            return None, 0.0
        beyond = min(1.0, here.done * (1.0 + 10.0 * SHORTEST) + LEAST_STEP)
        snapped = self._switched(here.found, self.way(beyond))
        if snapped is None or not self._free(here, snapped):
            return None, 0.0
        self.crept += self.prepared.distance(snapped.state, here.found.state) < CREPT
        if self.crept > CREEPS:
            return None, 0.0
        self.left.append(here.done)
        return _On(snapped, beyond), 0.1

    def _free(self, here: _On, there: Solved) -> bool:
        """Whether the step from one state to another is allowed."""
        return self.allowed is None or self.allowed(here.found, there)

    @staticmethod
    def _negative(found: Solved) -> int | None:
        """Number of negative eigenvalues; None where multipliers without bound leave none that can be counted."""
        try:
            return found.negative
        except SolveError:
            return None

    @staticmethod
    def _switched(found: Solved, loading: Loading) -> Solved | None:
        try:
            return found.prepared.switch_branch(found, loading)
        except SolveError:
            return None
