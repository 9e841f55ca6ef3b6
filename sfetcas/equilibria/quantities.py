"""Quantities of an answer by their names, and how far the same quantity of two answers is apart.

Names are those of :data:`~sfetcas.description.answers.ANSWERS`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import tolerances
from ..description.answers import ANSWERS, MOTION, AnswerName, answer_name, check_answer
from ..description.records import nearest
from ..description.scene import Scene
from ..errors import SceneError
from ..mathematics.arrays import Array
from .solution import Configuration

__all__ = ["WHERE", "Quantity", "component_in", "entry_of", "value_of"]

WHERE = ("analysis", "accuracy_of")
"""Where a scene names what the accuracy is of."""


def value_of(step: Configuration, name: str | AnswerName, at: float | None = None) -> Any:
    """The value of a quantity by its name in the answer, as ``nodes.B.position`` or ``members.beam.moment at 0.5``.

    Parameters
    ----------
    step : Configuration
        The equilibrium or the state of a motion.
    name : str or AnswerName
    at : float, optional
        Fraction of the member's length, for a quantity along a member whose name does not give one.

    Raises
    ------
    SceneError
        There is no such quantity.
    """
    name = answer_name(name) if isinstance(name, str) else name
    kind, at = name.kind, name.at if name.at is not None else at
    if kind.along and at is None:
        raise SceneError(f"found {name.quantity!r}, accepted: {kind.name} with the key 'at'")
    found = step.told_along(kind.table, name.record, [at]) if kind.along else step.table(kind.table, name.record)
    if kind.key not in found and step.where not in kind.where:
        raise SceneError(f"found {name.quantity!r}, told of {', '.join(kind.where)} only")
    value = entry_of(found, kind.key)
    return component_in(value[0] if kind.along else value, name)


def component_in(value: Any, name: AnswerName) -> Any:
    """The component of a vector that a name asks for; the value itself where the name asks for none.

    Raises
    ------
    SceneError
        The value is a single number, which has no components.
    """
    if name.component is None:
        return value
    if np.ndim(value) == 0:
        raise SceneError(f"found {name.bare!r}, which is one number here, accepted: {name.quantity}")
    return np.asarray(value)[..., name.component]


def entry_of(table: dict[str, Any], key: str) -> Any:
    """The entry of a table under a key.

    Raises
    ------
    SceneError
        There is no such key; the message proposes the most similar one.
    """
    if key not in table:
        raise SceneError(f"found {key!r}; {nearest(key, table)}")
    return table[key]


@dataclass(frozen=True)
class Quantity:
    """A quantity that the accuracy of an analysis refers to, instead of the positions.

    Attributes
    ----------
    name : AnswerName
        With a fraction of the length where it is a quantity along a member.
    """

    name: AnswerName

    @classmethod
    def named(cls, text: str, scene: Scene, where: tuple[str, ...] = WHERE) -> Quantity:
        """The quantity of a name; along members with a place: ``members.beam.moment at 0.5``.

        Raises
        ------
        SceneError
            There is no such quantity, or it is one along a member and the place is missing; ``where`` it was given.
        """
        name = answer_name(text, *where)
        try:
            check_answer(scene, name)
        except SceneError as error:
            raise SceneError(error.bare, where) from None
        tables = sorted({kind.table for kind in ANSWERS if kind.key and (kind.named or MOTION in kind.where)} - {""})
        if name.kind.table not in tables:
            raise SceneError(f"found {text!r}, accepted: a quantity of {', '.join(tables)}", where)
        if name.kind.along != (name.at is not None) or len(name.selectors) > name.kind.along:
            accepted = f"{name.bare} at 0.5, or another place" if name.kind.along else name.bare
            raise SceneError(f"found {text!r}, accepted: {accepted}", where)
        return cls(name)

    @property
    def text(self) -> str:
        """The name, with its place along the member."""
        return self.name.text

    def value(self, step: Configuration) -> Array:
        """The value in an answer as an array (n,), in the unit of the quantity.

        Raises
        ------
        SceneError
            The answer has no such quantity, or it does not consist of numbers.
        """
        found = value_of(step, self.name)
        try:
            numbers = np.atleast_1d(np.asarray(found, dtype=float)).ravel()
        except (TypeError, ValueError):
            numbers = np.array([np.nan])
        if not np.isfinite(numbers).all():
            raise SceneError(f"found {self.text!r}, which is not a number here, accepted: a quantity made of numbers")
        return numbers

    @property
    def positions(self) -> bool:
        """Whether it is a position, whose discretisation error has a known order."""
        return self.name.kind.key == "position"

    def unit(self, step: Configuration, values: Iterable[Array]) -> float:
        """The reference value by which differences are divided.

        Lengths are divided by the size of the scene, rotations by 1 rad, all else by its own value (along members by
        its largest value there), but by no less than a millionth of its unit in the model or of the loads.
        """
        kind, scales, loading = self.name.kind, step.model.scales, step.loading
        if kind.unit == "m":
            return step.model.scene.size
        if kind.unit == "rad" or kind.key in ("quaternion", "at"):
            return 1.0
        time = step.model.scene.analysis.end or 1.0
        own = {
            "N": scales.force,
            "1/m": 1.0 / scales.length,
            "Pa": scales.force / scales.length**2,
            "": tolerances.UNIT,
            "m/s": step.model.scene.size / time,
            "rad/s": 1.0 / time,
        }.get(kind.unit, scales.moment)
        loads = max(1.0, float(np.abs(loading.force).max(initial=0.0)), float(np.abs(loading.pull).max(initial=0.0)))
        largest = [tolerances.UNIT * own * loads, *(float(np.linalg.norm(value)) for value in values)]
        if kind.along:
            along = step.told_along(kind.table, self.name.record)[kind.key]
            largest.append(float(np.linalg.norm(along.reshape(len(along), -1), axis=1).max()))
        return max(largest)

    def difference(self, one: Configuration, other: Configuration) -> float:
        """Relative difference of its values in two answers, see :meth:`unit`; infinite where their lengths differ."""
        a, b = self.value(one), self.value(other)
        if a.shape != b.shape:
            return np.inf
        return self.apart(a, b) / self.unit(other, [b])

    def apart(self, a: Array, b: Array) -> float:
        """Largest absolute difference of two values (n,); quaternions of opposite sign are the same rotation."""
        opposite = self.name.kind.key == "quaternion" and self.name.component is None and a @ b < 0.0
        return float(np.linalg.norm(a + b if opposite else a - b))
