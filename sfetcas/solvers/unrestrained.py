"""Free motions along which loads do work without end: there is no equilibrium, and none is searched.

Two kinds can be recognised before anything is solved.  A *travel* is a straight motion of displacements alone that
strains nothing however far it goes, while the loads do work on it.  A *round* is the motion of a mechanism of mobility
one that comes back to its start: it is followed once around, unloaded, and the loads drive it all the way, as a moment
does with a crank that can turn round.  Weight cannot: the work of one half is taken back on the other.  Where dead
forces bend flexible members on the way the round decides nothing, and an equilibrium is searched.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .. import tolerances
from ..description.supports import free_to_move
from ..errors import SceneError
from ..mathematics.arrays import Array
from ..mechanics.equations import State
from ..mechanics.loading import Loading
from .constraints import free_motions, in_words
from .newton import Iterate, Moving, newton
from .prepared import Prepared

__all__ = ["refuse_unrestrained"]

STEP = 0.1
"""Largest rotation from one state of a round to the next, rad."""

ROUNDS = 400
"""Largest number of states of a round: six turns of the fastest link."""

CORRECTIONS, RESISTED = 12, 1e-3
"""Largest number of Newton steps to a state of a round; their primal regularisation, share of the weight."""

FAR = (1.0, 1e6)
"""Amplitudes, in lengths of the scene, at which a straight motion must strain nothing to count as a travel."""


def refuse_unrestrained(prepared: Prepared, factor: float) -> None:
    """Refuse a scene with a free motion that the loads at a factor drive without end.

    Scenes with contacts, stops or prescribed motions are not examined.

    Raises
    ------
    SceneError
        There is one; the message describes the motion.
    """
    model = prepared.model
    stopped = model.scene.contacts or any(spring.stop is not None for spring in model.scene.springs.values())
    if stopped or model.scene.motions or not prepared.diagnosis.mobility:
        return
    loading, start = model.loading(factor), prepared.equations.start(model.loading(0.0, 0.0))
    motions = prepared.motions
    motion = _travel(prepared, loading, start, motions)
    if motion is None and motions.shape[1] == 1 and _known(prepared, loading):
        motion = _round(prepared, loading, start, motions[:, 0])
    if motion is not None:
        raise SceneError(free_to_move(in_words(prepared.equations, motion)))


def _known(prepared: Prepared, loading: Loading) -> bool:
    """Whether an unloaded round decides: couples or followers drive it, and no dead force bends flexible members."""
    drive = loading.of(lambda kind: kind.is_couple or kind.follows)
    flexible = any(member.type != "rigid" for member in prepared.model.scene.members.values())
    dead = loading.force.any() or loading.pull.any() or loading.of(lambda kind: not kind.is_couple and not kind.follows)
    return bool(drive and not (flexible and dead))


def _pull(prepared: Prepared, state: State, loading: Loading) -> Array:
    """Generalised forces (unknowns,) on the unknowns at a state with zero multipliers, dimensionless."""
    point = prepared.equations.at(replace(state, lam=np.zeros_like(state.lam)), loading)
    return -point.residual[: prepared.equations.unknowns]


def _acting(loading: Loading) -> float:
    """Largest load, dimensionless: beside it forces that are rounding of directions are tiny."""
    parts = (loading.force, loading.pull, *loading.loads)
    return max(float(np.abs(part).max(initial=0.0)) for part in parts)


def _moved(prepared: Prepared, state: State, motion: Array) -> State:
    equations = prepared.equations
    return equations.moved(state, np.concatenate([motion, np.zeros(equations.total - len(motion))]))


def _travel(prepared: Prepared, loading: Loading, start: State, motions: Array) -> Array | None:
    """The straight motion (unknowns,) on which the loads do most work, if nothing ever stops it; else None."""
    equations = prepared.equations
    unloaded, turning = prepared.model.loading(0.0, 0.0), equations.rotation_unknowns
    _, sizes, right = np.linalg.svd(np.linalg.qr(motions[:turning], mode="r"))
    straight = motions @ right[np.append(sizes, np.zeros(len(right) - len(sizes))) < tolerances.NEGLIGIBLE].T
    motion = straight @ (straight.T @ _pull(prepared, start, loading))
    if not np.abs(motion).max(initial=0.0) > tolerances.BALANCED * _acting(loading):
        return None
    motion /= np.abs(motion).max()
    work = float(motion @ _pull(prepared, start, loading))
    for way in FAR:
        there = _moved(prepared, start, way * motion)
        point = equations.at(there, unloaded)
        restrained = np.abs(point.residual[: equations.unknowns]).max() > tolerances.BALANCED * work
        opened = np.abs(point.residual[equations.unknowns :]).max(initial=0.0) > tolerances.CLOSED * way
        driven = float(motion @ _pull(prepared, there, loading)) >= (1.0 - tolerances.BALANCED) * work
        if restrained or opened or point.strain > tolerances.BALANCED * way * work or not driven:
            return None
    return motion


def _round(prepared: Prepared, loading: Loading, start: State, motion: Array) -> Array | None:
    """The first direction (unknowns,) of a mechanism's motion round to its start if loads drive it all the way."""
    equations, unloaded = prepared.equations, prepared.model.loading(0.0, 0.0)
    first = _of_unit_speed(equations.rotation_unknowns, motion)
    if first is None:
        return None
    speed, largest, work, furthest = first, 0.0, 0.0, 0.0
    drive = float(speed @ _pull(prepared, start, loading))
    if abs(drive) <= tolerances.BALANCED * _acting(loading):
        return None
    speed = first = first * (1.0 if drive >= 0.0 else -1.0)
    state = start
    for _ in range(ROUNDS):
        drive = float(speed @ _pull(prepared, state, loading))
        largest = max(largest, drive)
        work += STEP * drive
        if not drive > tolerances.NEGLIGIBLE * largest:
            return None
        before, state = state, _unstrained(prepared, _moved(prepared, state, STEP * speed), unloaded)
        went = _apart(prepared, state, before)
        # A motion with resistance is drawn back; after a sharp bend of the motion a step leads elsewhere.
        if not 0.5 * STEP < went < 0.5:
            return None
        free = free_motions(equations, prepared.weight, state)
        # With all links in one line there are two motions: that which continues the last one is taken.
        onward = _of_unit_speed(equations.rotation_unknowns, free @ np.linalg.lstsq(free, speed, rcond=None)[0])
        point = equations.at(state, unloaded)
        gap = np.abs(point.residual[equations.unknowns :]).max(initial=0.0)
        if onward is None or point.strain > tolerances.BALANCED * work or gap > tolerances.CLOSED:
            return None
        speed = onward
        away = _apart(prepared, state, start)
        furthest = max(furthest, away)
        if furthest > 0.5 and away < 0.6 * went and float(speed @ first) > 0.0:
            return first
    return None


def _unstrained(prepared: Prepared, state: State, unloaded: Loading) -> State:
    """The state without strain and gaps nearest to one, by Newton steps that leave the free motion alone."""
    equations = prepared.equations
    n, weight = equations.unknowns, prepared.weight
    moving = Moving(equations, unloaded)
    # Small beside all stiffness: along the free motion there is next to no force, so that nothing moves along it.
    primal = RESISTED * np.concatenate([weight, np.full(n - len(weight), float(weight.mean()))])

    def step(here: Iterate) -> Array:
        equations.solver.factor(equations.regularised(here.point.entries, primal, tolerances.DUAL))
        step = equations.solver.solve(-here.point.residual)
        step[n:] = 0.0
        return step

    def after(here: Iterate, step: Array) -> Iterate:
        # Displacements have to converge as well as rotations.
        return replace(moving(here, step), length=float(np.abs(step).max(initial=0.0)))

    return newton(moving.at(state), step, after, lambda here: here.length < tolerances.CLOSED, CORRECTIONS)[0].state


def _of_unit_speed(rotation_unknowns: int, motion: Array) -> Array | None:
    """The motion (unknowns,) scaled to a largest rotation of 1; None if it rotates nothing."""
    fastest = float(np.abs(motion[:rotation_unknowns]).max(initial=0.0))
    return motion / fastest if fastest > tolerances.NEGLIGIBLE * np.abs(motion).max(initial=0.0) else None


def _apart(prepared: Prepared, a: State, b: State) -> float:
    """Largest difference of two states, without whole turns, rad or lengths of the scene."""
    turned = prepared.distance(a, b) if prepared.model.space else np.abs(np.exp(1j * a.q) - np.exp(1j * b.q))
    return float(max(np.max(turned, initial=0.0), np.abs(a.y - b.y).max(initial=0.0)))
