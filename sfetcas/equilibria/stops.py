"""Statics where springs may be held at their stops and tendons may be slack, by an active-set method.

Each load factor is solved by itself.  Of the active stops whose reaction has the wrong sign the worst is released;
where there is none, of the stops that are violated the worst is activated; until no reaction has the wrong sign and no
stop is violated.  Where the worst one leads back to a choice that was tried, the next worst takes its place.  An active
stop is a constraint, and its multiplier is the reaction of the stop.

A tendon of given length is such a constraint too: its multiplier is its tension.  It begins as taut, of those that
would push the one that pushes most becomes slack, and a slack one that is longer than its free length is taut again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import product
from math import prod

import numpy as np

from ..description.scene import Scene
from ..errors import SceneError, SolveError, Status
from ..mathematics.arrays import first_of_largest
from ..mechanics.margins import ROUNDING, margins
from ..mechanics.unilateral import Stops, Unilateral, switched_over, unilaterals, worst_of
from .several import alike
from .solution import Equilibrium, Solution, at_factor
from .statics import Settings, solve

__all__ = ["followable", "next_stops", "settled", "solve_stopped"]


Margins = Mapping[Unilateral, float]


def solve_stopped(scene: Scene, settings: Settings) -> Solution:
    """Equilibria of a scene whose springs have stops, or whose tendons may be slack or are let out against friction.

    Raises
    ------
    SceneError
        All equilibria are asked for, of too many choices of what is slack and at a stop.
    SolveError
        The active-set iteration repeats itself, or a load factor has no equilibrium that could be found.
    """
    choices = _choices(scene) if scene.analysis.equilibria == "all" and scene.stopped else ()
    steps: list[Equilibrium] = []
    status, seconds = Status.SOLVED, {"model": 0.0, "solve": 0.0}
    stops: Stops = ()
    for factor, released in zip(scene.analysis.steps, scene.released_at_steps(), strict=True):
        try:
            out = tuple((name, "released" if name in released else "pulled") for name in scene.shortenings)
            found, stops = _at_stops(scene, settings, factor, stops, out, choices)
        except SolveError as error:
            raise at_factor(error, scene, factor, steps, seconds) from None
        steps += found.steps
        status = found.status if status is Status.SOLVED else status
        seconds = {key: seconds[key] + found.seconds[key] for key in seconds}
    return Solution(scene, status, tuple(steps), seconds)


def followable(scene: Scene, settings: Settings) -> bool:
    """Whether load steps of which no choice is found may be looked for along a path."""
    return scene.stopped and not (scene.contacts or settings.accuracy_of or scene.analysis.equilibria == "all")


def _choices(scene: Scene) -> tuple[Stops, ...]:
    """All choices of what is slack and at a stop.

    Raises
    ------
    SceneError
        There are too many to look for the equilibria of each.
    """
    parties: dict[str, list[tuple[tuple[str, str], ...]]] = {}
    for one in unilaterals(scene):
        parties.setdefault(f"{one.table}.{one.name}", [()]).append((one.entry,))
    count = prod(map(len, parties.values()))
    if count > MOST_CHOICES:
        found = f"found 'all' with {count} choices of slack tendons and stops of springs"
        raise SceneError(f"{found}, accepted: at most {MOST_CHOICES}, or 'one'", ("analysis", "equilibria"))
    return tuple(switched_over(sum(parts, ()), ()) for parts in product(*parties.values()))


MOST_CHOICES = 16
"""Choices of what is slack and at a stop of which all equilibria are looked for."""


def _at_stops(
    scene: Scene, settings: Settings, factor: float, stops: Stops, released: Stops, choices: tuple[Stops, ...] = ()
) -> tuple[Solution, Stops]:
    """The answer of one factor with the directions of tendons, from the stops that the factor before it reached.

    With ``choices`` all equilibria of these, see :func:`_all_of`.
    """
    alone = scene.model_copy(update={"analysis": scene.analysis.model_copy(update={"steps": (factor,)})})
    if choices:
        return _all_of(alone, settings, choices, released), ()
    found: dict[Stops, Solution] = {}

    def answer(stops: Stops) -> Margins:
        found[stops] = solve(alone, settings, stops=(*stops, *released))
        return margins(found[stops].last.fields)

    stops = settled(scene, answer, stops)
    return found[stops], stops


def _all_of(alone: Scene, settings: Settings, choices: tuple[Stops, ...], released: Stops) -> Solution:
    """The equilibria of one factor in each choice whose margins say that it holds, by rising energy.

    Raises
    ------
    SolveError
        No equilibrium of any choice holds; or the first error, where a choice has none.
    """
    steps: list[Equilibrium] = []
    searched, first, seconds, status = 0, None, {"model": 0.0, "solve": 0.0}, Status.SOLVED
    for choice in choices:
        try:
            found = solve(alone, settings, stops=(*choice, *released))
        except SolveError as error:
            # As where not all strings can be taut.
            first = first or error
            continue
        seconds = {key: seconds[key] + found.seconds[key] for key in seconds}
        status = found.status if status is Status.SOLVED else status
        searched += 1
        # What is said of the search of one choice is not true of all.
        entries = (replace(found.steps[0], notes=found.steps[0].notes[:-1]), *found.steps[1:])
        held = [entry for entry in entries if min(margins(entry.fields).values()) >= -NEAR]
        # What just touches is an equilibrium with and without it.
        steps += [entry for entry in held if not any(alike(entry, other) for other in steps)]
    if not steps:
        raise first or SolveError(Status.FAILED, "no choice of stops and slack tendons holds")
    steps.sort(key=lambda entry: entry.potential)
    note = (
        f"looked for in each of {len(choices)} choices of slack tendons and stops, of which {searched} have any; "
        "there may be more equilibria"
    )
    steps[0] = replace(steps[0], notes=(*steps[0].notes, note))
    return Solution(alone, status, tuple(steps), seconds)


NEAR = 1e-9
"""Margins of all equilibria may be below zero by as much: rounding leaves less of what is zero."""


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
        # Where that has been tried another one that is wrong is switched, the worst, or of those alike the first.
        wrong = {switched_over(stops, [one]): -margin for one, margin in found.items() if margin < -ROUNDING}
        others = {choice: by for choice, by in wrong.items() if choice not in tried}
        if change in tried and others:
            change = [*others][first_of_largest(np.array([*others.values()]))]
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
    constraints = list(found)
    active = np.array([one.active(stops) for one in constraints], dtype=bool)
    strings = np.array([one.table == "tendons" for one in constraints], dtype=bool)
    worst = worst_of(np.array([*found.values()]), active, strings, ROUNDING)
    return stops if worst is None else switched_over(stops, [constraints[worst]])
