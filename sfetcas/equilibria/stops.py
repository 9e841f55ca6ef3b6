"""Statics where springs may be held at their stops and tendons may be slack, by an active-set method.

Each load factor is solved by itself.  Of the active stops whose reaction has the wrong sign the worst is released;
where there is none, of the stops that are violated the worst is activated; until no reaction has the wrong sign and no
stop is violated.  An active stop is a constraint, and its multiplier is the reaction of the stop.

A tendon of given length is such a constraint too: its multiplier is its tension.  It begins as taut, of those that
would push the one that pushes most becomes slack, and a slack one that is longer than its free length is taut again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ..description.scene import Scene
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import first_of_largest
from ..mechanics.unilateral import ROUNDING, Stops, Unilateral, margins, switched_over, unilaterals
from .solution import Equilibrium, Solution, at_factor
from .statics import Settings, solve

__all__ = ["next_stops", "settled", "solve_stopped"]


Margins = Mapping[Unilateral, float]


def solve_stopped(scene: Scene, settings: Settings) -> Solution:
    """Equilibria of a scene whose springs have stops, or whose tendons may be slack or are let out against friction.

    Raises
    ------
    SceneError
        All equilibria are asked for.
    SolveError
        The active-set iteration repeats itself, or a load factor has no equilibrium that could be found.
    """
    if scene.analysis.equilibria == "all":
        message = "found 'all' with stops of springs, accepted: 'one'"
        raise SceneError(message, ("analysis", "equilibria"))
    steps: list[Equilibrium] = []
    status, seconds = Status.SOLVED, {"model": 0.0, "solve": 0.0}
    stops: Stops = ()
    for factor, released in zip(scene.analysis.steps, scene.released_at_steps(), strict=True):
        try:
            out = tuple((name, "released") for name in scene.tendons if name in released)
            found, stops = _at_stops(scene, settings, factor, stops, out)
        except SolveError as error:
            raise at_factor(error, scene, factor, steps, seconds) from None
        steps += found.steps
        status = found.status if status is Status.SOLVED else status
        seconds = {key: seconds[key] + found.seconds[key] for key in seconds}
    return Solution(scene, status, tuple(steps), seconds)


def _at_stops(scene: Scene, settings: Settings, factor: float, stops: Stops, released: Stops) -> tuple[Solution, Stops]:
    """The answer of one factor with the tendons that are let out, from the stops that the factor before it reached."""
    alone = scene.model_copy(update={"analysis": scene.analysis.model_copy(update={"steps": (factor,)})})
    found: dict[Stops, Solution] = {}

    def answer(stops: Stops) -> Margins:
        found[stops] = solve(alone, settings, stops=(*stops, *released))
        return margins(found[stops].last.fields)

    stops = settled(scene, answer, stops)
    return found[stops], stops


def settled(scene: Scene, answer: Callable[[Stops], Margins], stops: Stops) -> Stops:
    """A choice of stops and slack tendons that holds.

    Parameters
    ----------
    scene : Scene
    answer : callable
        A choice -> the margins of the equilibrium in it.
    stops : tuple of (str, str)
        The choice to begin with.

    Raises
    ------
    SolveError
        No choice holds; or the first error of the equilibria, where some choice has none.
    """
    tried, first = set[Stops](), None
    while stops not in tried:
        tried.add(stops)
        try:
            found = answer(stops)
        except SolveError as error:
            # With more constraints than a structure can meet: none is active to begin with.
            first, stops = first or error, switched_over((), [one for one in unilaterals(scene) if one.active(())])
            continue
        change = next_stops(found, stops)
        if change == stops:
            return stops
        stops = change
    if first is not None:
        raise first
    doubtful = sorted({stop for choice in tried for stop in choice})
    names = ", ".join(f"{'tendons' if side == 'slack' else 'springs'}.{name}" for name, side in doubtful)
    raise SolveError(Status.FAILED, f"no choice of stops and slack tendons holds: {names}")


def next_stops(found: Margins, stops: Stops) -> Stops:
    """The choice to try after one with these margins; the same where that one holds.

    The stops without the one that pulls most or, where none does, with the one that is passed most.

    Tendons come first: with the one that pushes most, or without the slack one that is longest beyond its free length.
    """
    for table in ("tendons", "springs"):
        for active in (True, False):
            wrong = {one: -margin for one, margin in found.items() if (one.table, one.active(stops)) == (table, active)}
            if wrong and max(wrong.values()) > ROUNDING:
                # Of those that a symmetry makes the same the first in the scene.
                worst = first_of_largest(np.maximum(list(wrong.values()), 0.0))
                return switched_over(stops, [list(wrong)[worst]])
    return stops
