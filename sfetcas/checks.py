"""The ``expect`` tables of a scene: looking quantities up in an answer and comparing them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import numpy as np

from . import tolerances
from .description.answers import answer_name
from .description.records import say
from .description.scene import Expect, Scene, check_scene
from .dynamics.motion import MotionState, Trajectory
from .equilibria.quantities import entry_of, value_of
from .equilibria.solution import Equilibrium, Solution
from .errors import SceneError
from .paths.path import Path

if TYPE_CHECKING:
    from .dynamics.modes import Modes

__all__ = ["Answer", "Check", "asked", "check"]


Answer: TypeAlias = "Solution | Path | Trajectory | Modes"
"""What :func:`sfetcas.solve` may return."""


@dataclass(frozen=True)
class Check:
    """The comparison of one expected value with the answer.

    Attributes
    ----------
    expect : Expect
        The expectation from the scene.
    value : object
        The value in the answer; of a vector only as many components as the expectation gives.
    error : float
        Largest absolute difference, in the unit of the quantity; infinite where a text, boolean or integer differs.
    passed : bool
        Whether the error is within the tolerance of the expectation.
    """

    expect: Expect
    value: Any
    error: float
    passed: bool


def check(scene: Scene, solution: Answer) -> list[Check]:
    """Compare the answers with all expectations of the scene, in their order.

    Raises
    ------
    SceneError
        An expectation names a quantity that the answer does not have, or its value has another shape.
    """
    check_scene(scene, "check({}, ...)")
    checks = []
    entries = _assigned(scene, solution)
    for i, expect in enumerate(scene.expect):
        try:
            entry, own = entries[i] if i in entries else (_entry_of(solution, expect), True)
        except SceneError as error:
            raise error.within("expect", str(i)) from None
        try:
            value = _value(solution, entry, expect)
        except SceneError as error:
            raise error.within("expect", str(i), "quantity") from None
        try:
            compared = _compared(expect, value)
            # More numbers than equilibria: one that another number has taken cannot meet this one too.
            checks.append(compared if own else replace(compared, error=np.inf, passed=False))
        except SceneError as error:
            raise error.within("expect", str(i), "value") from None
        except (TypeError, ValueError):
            message = f"found {say(expect.value)}, accepted: numbers as in the answer, {say(_plain(value))}"
            raise SceneError(message, ("expect", str(i), "value")) from None
    return checks


def _plain(value: Any) -> Any:
    """A value of an answer as one writes it in a scene: numbers with six digits, and lists of them."""
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(entry) for entry in value]
    return float(f"{value:.6g}") if isinstance(value, (float, np.floating)) else value


def asked(solution: Answer, expect: Expect) -> Any:
    """The value in an answer of the quantity that an expectation names; its expected value plays no part.

    Where a search listed several equilibria, the value is that of the default one.

    Raises
    ------
    SceneError
        The answer has no such quantity.
    """
    if isinstance(solution, Solution) and expect.step is None:
        expect = expect.model_copy(update={"step": solution.last.factor})
    return _value(solution, _entry_of(solution, expect), expect)


def _entry_of(solution: Answer, expect: Expect) -> Equilibrium | MotionState:
    """The answer that an expectation speaks of."""
    if isinstance(solution, Path):
        return _entry_on_path(solution, expect)
    if isinstance(solution, Trajectory):
        return solution.last if expect.time is None else solution.at(expect.time)
    if expect.step is None:
        return solution.last
    return min(solution.steps, key=lambda step: abs(step.factor - float(expect.step or 0.0)))


def _entry_on_path(path: Path, expect: Expect) -> Equilibrium:
    for key in ("limit_point", "bifurcation", "flutter_point", "transition"):
        number = getattr(expect, key)
        if number is not None:
            return _numbered(getattr(path, f"{key}s"), number, key)
    if expect.step is None:
        return path.last
    factor = expect.step
    met = [step for step in path.steps if math.isclose(step.factor, factor, abs_tol=tolerances.DECIMAL)]
    return _numbered(met, expect.crossing or 1, "crossing")


def _numbered(entries: Sequence[Equilibrium], number: int, key: str) -> Equilibrium:
    if number > len(entries):
        raise SceneError(f"found {number}, but the path has {len(entries)}", (key,))
    return entries[number - 1]


def _value(solution: Answer, entry: Equilibrium | MotionState, expect: Expect) -> Any:
    """What the answer says; of modes as of equilibria."""
    name = answer_name(expect.quantity)
    if name.kind.table == "modes" and solution.scene.analysis.type == "modes":
        return entry_of(cast("Modes", solution).values(), name.kind.key)
    return value_of(entry, name, expect.at)


def _assigned(scene: Scene, solution: Answer) -> dict[int, tuple[Equilibrium, bool]]:
    """Entry of each expect, by its place, where a search listed several of one factor; whether it is its own.

    Numbers of ``equilibrium`` go to different entries so that as many as possible are met; an expect without one
    is about the first entry of its factor, the default answer.
    """
    if scene.analysis.equilibria != "all" or not isinstance(solution, Solution):
        return {}
    chosen: dict[int, tuple[Equilibrium, bool]] = {}
    groups: dict[float, dict[int, list[int]]] = {}
    for i, expect in enumerate(scene.expect):
        factor = (solution.last if expect.step is None else _entry_of(solution, expect)).factor
        if expect.equilibrium is None:
            chosen[i] = next(step for step in solution.steps if step.factor == factor), True
        else:
            groups.setdefault(factor, {}).setdefault(int(expect.equilibrium), []).append(i)
    for factor, numbers in groups.items():
        entries = [step for step in solution.steps if step.factor == factor]
        matched = _matched([[scene.expect[i] for i in places] for places in numbers.values()], entries)
        for places, (entry, own) in zip(numbers.values(), matched, strict=True):
            chosen |= dict.fromkeys(places, (entries[entry], own))
    return chosen


def _matched(groups: list[list[Expect]], entries: list[Equilibrium]) -> list[tuple[int, bool]]:
    """Entry of each group of expects, as many as possible met, by augmenting paths; the others take what is left."""
    failures = [[sum(not _met(expect, entry) for expect in group) for entry in entries] for group in groups]
    taken: dict[int, int] = {}

    def place(group: int, seen: set[int]) -> bool:
        for entry, failed in enumerate(failures[group]):
            if not failed and entry not in seen:
                seen.add(entry)
                if entry not in taken or place(taken[entry], seen):
                    taken[entry] = group
                    return True
        return False

    unmet = [group for group in range(len(groups)) if not place(group, set())]
    for group in unmet:
        free = [entry for entry in range(len(entries)) if entry not in taken]
        if free:
            taken[min(free, key=lambda entry: failures[group][entry])] = group
    found = {group: (entry, True) for entry, group in taken.items()}
    return [found.get(group, (0, False)) for group in range(len(groups))]


def _met(expect: Expect, entry: Equilibrium) -> bool:
    try:
        return _compared(expect, value_of(entry, expect.quantity, expect.at)).passed
    except (SceneError, TypeError, ValueError):
        return False


def _compared(expect: Expect, value: Any) -> Check:
    reference = expect.value
    if isinstance(reference, (bool, str)) or (isinstance(reference, int) and expect.tolerance is None):
        same = np.array_equal(value, reference)
        return Check(expect, value, 0.0 if same else np.inf, bool(same))
    wanted, found = np.atleast_1d(np.asarray(reference, dtype=float)), np.atleast_1d(np.asarray(value, dtype=float))
    if np.ndim(reference) == 0 and found.size == 3:
        found = found[2:]  # a plane moment or curvature may be one number: about z
    if wanted.size > found.size:
        raise SceneError(f"found {wanted.size} reference numbers for {found.size} in the answer")
    found = found[: wanted.size]
    error = float(np.abs(found - wanted).max())
    if expect.quantity.endswith("quaternion"):
        error = min(error, float(np.abs(found + wanted).max()))
    tolerance = expect.tolerance or 0.0
    return Check(expect, found.tolist() if wanted.size > 1 else float(found[0]), error, bool(error <= tolerance))
