"""Statics where springs may be held at their stops and tendons may be slack, by an active-set method.

Each load factor is solved by itself.  Of the active stops whose reaction has the wrong sign the worst is released;
where there is none, of the stops that are violated the worst is activated; until no reaction has the wrong sign and no
stop is violated.  An active stop is a constraint, and its multiplier is the reaction of the stop.

A tendon of given length is such a constraint too: its multiplier is its tension.  It begins as taut, of those that
would push the one that pushes most becomes slack, and a slack one that is longer than its free length is taut again.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from ..description.scene import Scene
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import first_of_largest
from .solution import Equilibrium, Solution, at_factor
from .statics import Settings, solve

__all__ = ["solve_stopped"]

Stops = tuple[tuple[str, str], ...]
"""Springs at a stop: name, and low or high; tendons: name, and slack, or released or pulled."""

T = TypeVar("T")


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
            out = tuple((name, "released" if name in released else "pulled") for name in scene.shortenings)
            found, stops = _at_stops(scene, settings, factor, stops, out)
        except SolveError as error:
            raise at_factor(error, scene, factor, steps, seconds) from None
        steps += found.steps
        status = found.status if status is Status.SOLVED else status
        seconds = {key: seconds[key] + found.seconds[key] for key in seconds}
    return Solution(scene, status, tuple(steps), seconds)


def _at_stops(scene: Scene, settings: Settings, factor: float, stops: Stops, released: Stops) -> tuple[Solution, Stops]:
    """The answer of one factor with the directions of tendons, from the stops that the factor before it reached."""
    alone = scene.model_copy(update={"analysis": scene.analysis.model_copy(update={"steps": (factor,)})})
    tried: set[Stops] = set()
    while stops not in tried:
        tried.add(stops)
        found = solve(alone, settings, stops=(*stops, *released))
        change = _next_stops(found.last, stops)
        if change == stops:
            return found, stops
        stops = change
    doubtful = sorted({stop for choice in tried for stop in choice})
    names = ", ".join(f"{'tendons' if side == 'slack' else 'springs'}.{name}" for name, side in doubtful)
    raise SolveError(Status.FAILED, f"no choice of stops and slack tendons holds: {names}")


def _next_stops(answer: Equilibrium, stops: Stops) -> Stops:
    """The stops without the one that pulls most or, where none does, with the one that is passed most.

    Tendons come first: without the slack one that is longest beyond its free length, or with the one that pushes most.
    """
    scene, known = answer.model.scene, dict(stop for stop in stops if stop[1] != "slack")
    changed = _next_slack(answer, stops)
    if changed != stops:
        return changed
    pulls = {name: _pull(answer.spring(name).stop or 0.0, side) for name, side in stops if side != "slack"}
    if pulls and max(pulls.values()) > 0.0:
        worst = _first_of_most(pulls)
        return tuple(stop for stop in stops if stop[0] != worst or stop[1] == "slack")
    passed: dict[tuple[str, str], float] = {}
    for name, spring in scene.springs.items():
        if spring.stop is not None and name not in known:
            travel, (low, high) = answer.spring(name).travel, spring.stop
            passed[name, "low"], passed[name, "high"] = low - travel, travel - high
    if passed and max(passed.values()) > 0.0:
        return (*stops, _first_of_most(passed))
    return stops


def _next_slack(answer: Equilibrium, stops: Stops) -> Stops:
    """The stops with the tendon that pushes most, or without the slack one that is longest beyond its free length."""
    tendons = {name: tendon for name, tendon in answer.model.scene.tendons.items() if tendon.may_be_slack}
    if not tendons:
        return stops
    slack = {name for name, side in stops if side == "slack"}
    pushing = {name: -answer.tendon(name)["tension"] for name in tendons if name not in slack}
    if pushing and max(pushing.values()) > ROUNDING * answer.model.scales.force:
        return (*stops, (_first_of_most(pushing), "slack"))
    beyond = {name: answer.fields.beyond(name) for name in tendons if name in slack}
    if beyond and max(beyond.values()) > ROUNDING * answer.model.scales.length:
        worst = _first_of_most(beyond)
        return tuple(stop for stop in stops if stop != (worst, "slack"))
    return stops


ROUNDING = 1e-12
"""Of tensions and lengths over the units of the model: a tendon that has next to nothing to do stays as it is."""


def _first_of_most(found: dict[T, float]) -> T:
    """The name of the largest number above zero; of those that a symmetry makes the same the first in the scene."""
    return list(found)[first_of_largest(np.maximum(list(found.values()), 0.0))]


def _pull(effort: float, side: str) -> float:
    """How much a stop holds back instead of pushing back: a high one pushes down, a low one up."""
    return effort if side == "high" else -effort
