"""The ``expect`` tables of a scene: looking quantities up in an answer and comparing them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .errors import SceneError
from .records import nearest, say
from .scene import Expect, Scene
from .solution import Equilibrium, Solution

__all__ = ["Check", "check", "look_up"]


@dataclass(frozen=True)
class Check:
    """One comparison.

    Attributes
    ----------
    expect : Expect
    value : object
        What the answer says, as far as the reference goes.
    error : float
        Largest absolute difference; infinite where exact values differ.
    passed : bool
    """

    expect: Expect
    value: Any
    error: float
    passed: bool


def check(scene: Scene, solution: Solution) -> list[Check]:
    """Compare the answers with all expectations of the scene, in their order.

    Raises
    ------
    SceneError
        A quantity that the answer does not have.
    """
    checks = []
    for i, expect in enumerate(scene.expect):
        try:
            value = look_up(_step(solution, expect), expect.quantity, expect.at)
        except SceneError as error:
            raise error.within("expect", str(i), "quantity") from None
        try:
            checks.append(_compared(expect, value))
        except SceneError as error:
            raise error.within("expect", str(i), "value") from None
        except (TypeError, ValueError):
            message = f"found {say(expect.value)}, accepted: numbers as in the answer, {say(value)}"
            raise SceneError(message, ("expect", str(i), "value")) from None
    return checks


def _step(solution: Solution, expect: Expect) -> Equilibrium:
    if expect.step is None:
        return solution.last
    return min(solution.steps, key=lambda step: abs(step.factor - float(expect.step or 0.0)))


def look_up(step: Equilibrium, quantity: str, at: float | None = None) -> Any:
    """A quantity by its name in the answer, as ``nodes.B.position`` or ``members.beam.moment``.

    Parameters
    ----------
    at : float, optional
        Fraction of the length; needed for quantities along members.
    """
    parts = quantity.split(".")
    if parts[0] == "members":
        if len(parts) != 3 or at is None:
            raise SceneError(f"found {quantity!r}, accepted: members.NAME.QUANTITY with the key 'at'")
        along = step.along(parts[1], [at])
        return _entry(along, parts[2])[0]
    if parts[0] == "nodes" and len(parts) == 3:
        entry: dict[str, Any] = {"position": step.position(parts[1])}
        turned = step.quaternion(parts[1])
        if turned is not None:
            entry |= (
                {"quaternion": turned} if step.model.space else {"quaternion": turned, "angle": step.angle(parts[1])}
            )
        return _entry(entry, parts[2])
    if parts[0] == "reactions" and len(parts) == 3:
        force, moment = step.reaction(parts[1])
        return _entry({"force": force, "moment": moment}, parts[2])
    if parts[0] == "contacts" and len(parts) == 3:
        return _entry(step.contacts[parts[1]], parts[2])
    if parts[0] == "energy" and len(parts) == 2:
        return _entry(step.energy, parts[1])
    if parts[0] == "certificate" and len(parts) == 2:
        return _entry(step.certificate.to_dict(), parts[1])
    if quantity == "factor":
        return step.factor
    known = (
        "nodes.NAME.KEY, members.NAME.KEY, reactions.NAME.KEY, contacts.NAME.KEY, energy.KEY, certificate.KEY, factor"
    )
    raise SceneError(f"found {quantity!r}, accepted: {known}")


def _entry(table: dict[str, Any], key: str) -> Any:
    if key not in table:
        raise SceneError(f"found {key!r}; {nearest(key, table)}")
    return table[key]


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
