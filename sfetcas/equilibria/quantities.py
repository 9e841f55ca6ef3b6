"""Quantities of an answer by their names, and how far the same quantity of two answers is apart.

Names are those of the JSON answer: ``nodes.B.position``, ``reactions.A.moment``, ``energy.elastic``; along members a
place is needed, ``members.beam.moment at 0.5``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..description.records import nearest
from ..errors import SceneError
from ..mathematics.arrays import Array
from .solution import Equilibrium, Posture

__all__ = ["VALUE", "WHERE", "Further", "Quantity", "entry_of", "value_of"]

WHERE = ("analysis", "accuracy_of")
"""Where a scene names what the accuracy is of."""

VALUE = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|[^\s.]+"
"""A number or a word behind a quantity; a dot in another place is one of the name, which may have spaces."""

Further = Callable[[str, str], dict[str, Any]]
"""Of a kind and a name (``nodes``, ``B``) what an answer has beyond what all have; empty where that is nothing."""

SMALL = 1e-6
"""Share of the unit of a quantity below which it is not relative to itself, but to this: it may be zero."""


def value_of(step: Posture, quantity: str, at: float | None = None, further: Further | None = None) -> Any:
    """A quantity by its name in the answer, as ``nodes.B.position`` or ``members.beam.moment``.

    Parameters
    ----------
    at : float, optional
        Fraction of the length; needed for quantities along members.
    further : callable, optional
        What the answer has beside positions, reactions, fields along members, springs, motions, contacts and energy.

    Raises
    ------
    SceneError
        There is no such quantity.
    """
    kind, *names = quantity.split(".")
    more = {} if further is None else further(kind, names[0] if names else "")
    if kind == "members":
        if len(names) != 2 or at is None:
            raise SceneError(f"found {quantity!r}, accepted: members.NAME.QUANTITY with the key 'at'")
        return entry_of(step.along(names[0], [at]), names[1])[0]
    if kind == "nodes" and len(names) == 2:
        return entry_of({**_node(step, names[0]), **more}, names[1])
    if kind == "reactions" and len(names) == 2:
        return entry_of(dict(zip(("force", "moment"), step.reaction(names[0]), strict=True)), names[1])
    if kind == "springs" and len(names) == 2:
        return entry_of(step.spring(names[0]).to_dict(), names[1])
    if kind == "motions" and len(names) == 2:
        return entry_of(step.motion(names[0]), names[1])
    if kind == "contacts" and len(names) == 2:
        return entry_of(step.contacts.get(names[0], {}), names[1])
    if more:
        return entry_of(more, names[0] if names else kind)
    if kind == "energy" and len(names) == 1 and isinstance(step, Equilibrium):
        return entry_of(step.energy, names[0])
    if quantity == "factor":
        return step.factor
    known = (
        "nodes.NAME.KEY, members.NAME.KEY, reactions.NAME.KEY, springs.NAME.KEY, motions.NAME.KEY, "
        "contacts.NAME.KEY, energy.KEY, certificate.KEY, factor, at flutter points omega"
    )
    raise SceneError(f"found {quantity!r}, accepted: {known}")


def _node(step: Posture, name: str) -> dict[str, Any]:
    found: dict[str, Any] = {"position": step.position(name)}
    turned = step.quaternion(name)
    if turned is not None:
        found["quaternion"] = turned
        if not step.model.space:
            found["angle"] = step.angle(name)
    return found


def entry_of(table: dict[str, Any], key: str) -> Any:
    """What a table has under a key.

    Raises
    ------
    SceneError
        Nothing; the nearest key is told.
    """
    if key not in table:
        raise SceneError(f"found {key!r}; {nearest(key, table)}")
    return table[key]


@dataclass(frozen=True)
class Quantity:
    """A quantity whose accuracy matters.

    Attributes
    ----------
    name : str
        As in the answer.
    at : float or None
        Fraction of the length of a member.
    """

    name: str
    at: float | None = None

    @property
    def text(self) -> str:
        """The name with its place."""
        return self.name if self.at is None else f"{self.name} at {self.at:g}"

    @classmethod
    def named(cls, text: str) -> Quantity:
        """From its name, along members with a place: ``members.beam.moment at 0.5``.

        Raises
        ------
        SceneError
            No number stands after ``at``, or no place along a member.
        """
        found = re.fullmatch(rf"(.*\S)\s+at\s+({VALUE})", text.strip())
        if not found and text.startswith("members."):
            accepted = f"a place along the member too, as {text.strip()} at 0.5"
            raise SceneError(f"found {text!r}, accepted: {accepted}", WHERE)
        if not found:
            return cls(text.strip())
        try:
            return cls(found[1], float(found[2]))
        except ValueError:
            raise SceneError(f"found {text!r}, accepted: NAME, or members.NAME.KEY at FRACTION", WHERE) from None

    def value(self, step: Posture, look_up: Callable[..., Any] = value_of) -> Array:
        """What an answer says, as numbers, (n,).

        Raises
        ------
        SceneError
            It has no such quantity, or this is not made of numbers.
        """
        found = look_up(step, self.name, self.at)
        try:
            numbers = np.atleast_1d(np.asarray(found, dtype=float)).ravel()
        except (TypeError, ValueError):
            numbers = np.array([np.nan])
        if not np.isfinite(numbers).all():
            raise SceneError(f"found {self.name!r}, which is not a number here, accepted: a quantity made of numbers")
        return numbers

    @property
    def positions(self) -> bool:
        """Whether it is of the order of positions."""
        return self.name.endswith(".position")

    def unit(self, step: Posture, values: Iterable[Array]) -> float:
        """What differences are relative to.

        Positions count over the size of the scene, rotations in rad, all else over itself, along members over the
        largest there, but at least over a millionth of the unit of forces (moments, energies, curvatures) or of the
        loads.
        """
        key, scales, loading = self.name.rpartition(".")[2], step.model.scales, step.loading
        if key in ("position", "travel", "gap"):
            return step.model.scene.size
        if key in ("quaternion", "angle", "at"):
            return 1.0
        own = {"force": scales.force, "stop": scales.force, "curvature": 1.0 / scales.length}.get(key, scales.moment)
        loads = max(1.0, float(np.abs(loading.force).max(initial=0.0)), float(np.abs(loading.pull).max(initial=0.0)))
        largest = [SMALL * own * loads, *(float(np.linalg.norm(value)) for value in values)]
        if self.at is not None:
            member = self.name.split(".")[1]
            along = step.along(member, step.places(member))[key]
            largest.append(float(np.linalg.norm(along, axis=1).max()))
        return max(largest)

    def difference(self, one: Posture, other: Posture) -> float:
        """How far it is apart in two answers, see :meth:`unit`; infinite where one has more numbers than the other."""
        a, b = self.value(one), self.value(other)
        if a.shape != b.shape:
            return np.inf
        return self.apart(a, b) / self.unit(other, [b])

    def apart(self, a: Array, b: Array) -> float:
        """Distance of two values, of quaternions whichever signs they have."""
        opposite = self.name.endswith(".quaternion") and a @ b < 0.0
        return float(np.linalg.norm(a + b if opposite else a - b))
